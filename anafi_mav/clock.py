"""Time as a value that is handed in, the one timer, and turns of calls that may wait.

Cores never read a clock: their shell passes `now`. `Clock.monotonic` is the one time base of the process (seconds,
never steps back); the asyncio loop's own time is the same clock, so deadlines of cores can be given to `loop.call_at`
unchanged.
"""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

KeyT = TypeVar("KeyT")

NEVER = math.inf
"""Due time of what is not due by itself."""


class Clock(Protocol):
    """The two readings of time that a shell needs."""

    def monotonic(self) -> float:
        """Seconds since an arbitrary start; never steps."""

    def time(self) -> float:
        """Seconds since 1970-01-01 UTC; may step when the system clock is set."""

    def boottime(self) -> float:
        """Seconds since an arbitrary moment, with those for which the computer was suspended.

        `monotonic` stands still meanwhile. Without such a clock it is `monotonic`.
        """


class SystemClock:
    """The machine's clocks."""

    def __init__(self) -> None:
        self.monotonic = time.monotonic
        self.time = time.time
        self.boottime = (
            partial(time.clock_gettime, time.CLOCK_BOOTTIME) if sys.platform == "linux" else time.monotonic
        )  # clock_gettime(2)


class Alarm:
    """Calls a function once, at a time of the event loop's clock.

    Setting it again replaces the time set before.
    """

    __slots__ = ("_call", "_handle", "at")

    def __init__(self, call: Callable[[], None]) -> None:
        """`call` may set the alarm again."""
        self._call = call
        self._handle: asyncio.TimerHandle | None = None
        self.at: float | None = None
        """When it calls (s, loop clock); None after a cancellation or the call."""

    @property
    def is_set(self) -> bool:
        """True until it is cancelled or has called."""
        return self.at is not None

    def set(self, at: float) -> None:
        """Call at this time (s, loop clock), or as soon as possible when it has passed."""
        if self._handle is not None:
            self._handle.cancel()
        self._handle = asyncio.get_running_loop().call_at(at, self._fire)
        self.at = at

    def set_in(self, seconds: float) -> None:
        """Call after this many seconds."""
        self.set(asyncio.get_running_loop().time() + seconds)

    def cancel(self) -> None:
        """Do not call. Cancelling twice does no harm."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = self.at = None

    def _fire(self) -> None:
        self._handle = self.at = None
        self._call()


class YieldingCall:
    """Calls a function once, when clients have been read.

    Of many that are requested together, the event loop of the gateway calls some and reads sockets in between
    (`cli.event_loop`). Others call at once. For what may be later by some ms: never for an end of sticks, of setpoints
    or of a silence.
    """

    __slots__ = ("_call", "_loop")

    def __init__(self, call: Callable[[], None]) -> None:
        self._call = call
        self._loop: Any = None
        """The event loop that was requested to call."""

    def request(self) -> None:
        """Call in turn, perhaps now. A second request before the call has no effect."""
        loop: Any = asyncio.get_running_loop()
        if hasattr(loop, "call_after_clients"):
            self._loop = loop
            loop.call_after_clients(self._call)
        else:
            self._call()

    def cancel(self) -> None:
        """Do not call. Cancelling twice does no harm."""
        if self._loop is not None:
            self._loop.cancel_after_clients(self._call)


class Schedule(Generic[KeyT]):
    """When each of several keys is due; all of them can be brought forward together. No clock."""

    __slots__ = ("_due", "_keys", "all_at", "next")

    def __init__(self, keys: Iterable[KeyT]) -> None:
        self._keys: Sequence[KeyT] = tuple(keys)
        self._due = dict.fromkeys(self._keys, NEVER)
        self.all_at = NEVER
        """When every key is due at the latest (s)."""
        self.next = NEVER
        """When the first of them is due (s)."""

    def bring_forward(self, at: float) -> bool:
        """Make every key due at this time (s) at the latest; return True if `next` changes."""
        self.all_at = min(self.all_at, at)
        if at >= self.next:
            return False
        self.next = at
        return True

    def run(self, now: float, call: Callable[[KeyT], float]) -> None:
        """Call `call` for each due key, in sequence; it returns when the key is due again (s)."""
        keys = self._keys
        if now >= self.all_at:
            self.all_at = NEVER
        else:
            keys = [key for key, at in self._due.items() if now >= at]
        for key in keys:
            self._due[key] = call(key)
        self.next = min(self.all_at, min(self._due.values(), default=NEVER))


ROUND_TRIP_LIMIT = 2.5
"""s: a longer one is no measurement, for a link is lost before."""

SHORTER_SHARE = 0.3
"""Share of a shorter round trip that is believed at once.

A longer one is believed altogether. A loop that counts with too long a delay is slow, one with too short a one swings.
"""


class RoundTrip:
    """Time that a link takes to the peer and back, as measured so far."""

    __slots__ = ("seconds",)

    def __init__(self) -> None:
        self.seconds = 0.0
        """0 before the first measurement."""

    def measure(self, elapsed: float) -> None:
        """Take a measurement (s); one that makes no sense is ignored."""
        if 0.0 <= elapsed <= ROUND_TRIP_LIMIT:
            shorter = min(0.0, elapsed - self.seconds)
            self.seconds = max(elapsed, self.seconds + SHORTER_SHARE * shorter)
