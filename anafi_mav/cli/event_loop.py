"""Event loop of the gateway: it looks at its sockets less often while they are busy.

Each wake-up costs system calls, a change of the process and a processor whose caches hold other things. With 250
drones a datagram arrives every tenth of a millisecond. While sockets bring that many, those of a moment are read
together, and what is sent for them shares datagrams. With few drones nothing waits.
"""

from __future__ import annotations

import asyncio
import selectors
import sys
import time
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

PAUSE = 0.002
"""s between two looks at the sockets while they are busy: much less than the 20 ms that telemetry may take."""

WINDOW = 0.1
"""s over which sockets with data are counted."""

BUSY = 60
"""Sockets with data within `WINDOW` that make a busy time: of 20 drones that send 30 times a second."""

ResultT = TypeVar("ResultT")


class PacedSelector(selectors.DefaultSelector):
    """Looks at the sockets every `PAUSE` while they are busy, else at once."""

    def __init__(
        self, monotonic: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        super().__init__()
        self._monotonic, self._sleep = monotonic, sleep
        self._count = 0
        """Sockets with data in the present window."""
        self._until = 0.0
        """End of that window (s, monotonic)."""
        self._is_busy = False
        self._next = 0.0
        """When to look again (s, monotonic) in a busy time."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return the sockets with data, after at most `timeout` s; None: after any time."""
        if self._is_busy and (rest := self._next - self._monotonic()) > 0.0:
            if timeout is not None:
                if timeout < rest:
                    if timeout > 0.0:
                        self._sleep(timeout)
                    return []
                timeout -= rest
            self._sleep(rest)
        found = super().select(timeout)
        now = self._monotonic()
        if now >= self._until:
            self._is_busy = self._count >= BUSY and now < self._until + WINDOW
            self._count, self._until = 0, now + WINDOW
        self._count += len(found)
        self._next = now + PAUSE
        return found


class _Policy(asyncio.DefaultEventLoopPolicy):
    """Makes event loops with that selector."""

    def new_event_loop(self) -> asyncio.AbstractEventLoop:
        return asyncio.SelectorEventLoop(PacedSelector())


def run(work: Coroutine[Any, Any, ResultT]) -> ResultT:
    """Run a coroutine as asyncio.run does.

    Windows has an event loop of its own, without a selector.
    """
    if sys.platform != "win32":
        asyncio.set_event_loop_policy(_Policy())
    return asyncio.run(work)
