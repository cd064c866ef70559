"""Reports to a service manager, as systemd: ready, alive, stopping (sd_notify(3)).

The signs of life leave from the event loop. One that hangs sends none, and the service manager then ends and starts
the gateway.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Mapping
from types import TracebackType

from typing_extensions import Self


class ServiceManager:
    """The socket of the service manager; without one it does nothing. Used as a context."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        """Read NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID."""
        place = environment.get("NOTIFY_SOCKET", "")
        # A leading @ is an abstract address, which begins with a zero byte.
        self._place = "\0" + place[1:] if place.startswith("@") else place
        own = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        period = environment.get("WATCHDOG_USEC", "")
        # Half of it is systemd's advice.
        self._every = int(period) / 1e6 / 2.0 if own and period.isdecimal() and int(period) > 0 else None
        self._socket: socket.socket | None = None
        self._timer: asyncio.TimerHandle | None = None

    def __enter__(self) -> Self:
        if self._place and hasattr(socket, "AF_UNIX"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def ready(self, status: str) -> None:
        """Report that the gateway serves; signs of life follow. `status`: for people."""
        self._send(f"READY=1\nSTATUS={status}")
        if self._socket is not None and self._every is not None:
            self._live(self._every)

    def stopping(self) -> None:
        """Report that the gateway ends.

        Signs of life go on: a flying drone is left in a hover first.
        """
        self._send("STOPPING=1")

    def _live(self, every: float) -> None:
        self._send("WATCHDOG=1")
        self._timer = asyncio.get_running_loop().call_later(every, self._live, every)

    def _send(self, text: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # its queue is full, or it is gone: no reason to end a flight
                self._socket.sendto(text.encode(), self._place)
