"""Time as a value that is handed in. Cores never read a clock: their shell passes `now`.

`Clock.monotonic` is the one time base of the process (seconds, never steps back); the asyncio loop's own
time is the same clock, so deadlines of cores can be given to `loop.call_at` unchanged.
"""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What a shell needs to know about time."""

    def monotonic(self) -> float:
        """Seconds since an arbitrary start; never steps."""

    def time(self) -> float:
        """Seconds since 1970-01-01 UTC; may step when the system clock is set."""


class SystemClock:
    """The machine's clocks."""

    def monotonic(self) -> float:
        return time.monotonic()

    def time(self) -> float:
        return time.time()
