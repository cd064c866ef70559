"""The buffer of each read from a socket.

asyncio allocates 256 KiB for each datagram. The C library maps a block of that size into memory and unmaps it again,
which takes 12 us of 18 us: with 250 drones a tenth of a core.
"""

from __future__ import annotations

from typing import Any

SIZE = 64 * 1024
"""Bytes: the longest UDP datagram, and less than what the C library maps (128 KiB, mallopt(3) M_MMAP_THRESHOLD)."""


def limit_reads(transport: Any) -> None:
    """Let a transport of asyncio read at most `SIZE` bytes at once.

    `max_size` is an attribute of asyncio's own transports, documented nowhere; on others it has no effect.
    """
    transport.max_size = SIZE
