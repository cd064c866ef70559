"""Reads from sockets: their size and their order.

asyncio allocates 256 KiB for each datagram. The C library maps a block of that size into memory and unmaps it again,
which takes 12 us of 18 us: with 250 drones a tenth of a core.

asyncio reads one datagram of a socket per event-loop iteration. On a busy computer iterations take longer than the
datagrams need to follow one another. Those that wait become seconds old, and the kernel drops what does not fit.
Streams of TCP are read 64 KiB at once.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

SIZE = 64 * 1024
"""Bytes: the longest UDP datagram, and less than what the C library maps (128 KiB, mallopt(3) M_MMAP_THRESHOLD)."""


def limit_reads(transport: Any) -> None:
    """Let a transport of asyncio read at most `SIZE` bytes at once.

    `max_size` is an attribute of asyncio's own transports, documented nowhere; on others it has no effect.
    """
    transport.max_size = SIZE


MOST = 32
"""Datagrams that are read from one socket in an event-loop iteration at most: every other socket has its turn."""


def read_waiting(transport: Any, received: Callable[[bytes, Any], None], failed: Callable[[Exception], None]) -> None:
    """Hand on the datagrams that wait in a transport's socket.

    There are `MOST` at most, with the one that asyncio has read. An error of the socket goes to `failed`, and ends it.
    `_sock` is an attribute of asyncio's own transports, documented nowhere; others read on by themselves.
    """
    sock = getattr(transport, "_sock", None)
    for _ in range(MOST - 1):
        if sock is None or transport.is_closing():
            return
        try:
            data, address = sock.recvfrom(SIZE)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            failed(error)
            return
        received(data, address)


class OpenSocket(Protocol):
    """A socket, or asyncio's proxy of one."""

    def fileno(self) -> int:
        """Return the file descriptor; -1 once it is closed."""


def read_after_clients(sock: OpenSocket) -> None:
    """Have the running event loop read this socket after those of clients: a drone sends to it.

    That of the gateway can (`cli.event_loop`); others read all sockets alike.
    """
    read_last = getattr(asyncio.get_running_loop(), "read_after_clients", None)
    if read_last is not None:
        read_last(sock)
