"""The clock of a computer that a test suspends."""

from __future__ import annotations

from anafi_mav.clock import SystemClock


class LaptopClock(SystemClock):
    """Add to `slept` what the computer has slept, s: the other clocks stand still meanwhile."""

    def __init__(self) -> None:
        super().__init__()
        self.slept = 0.0
        self.boottime = lambda: self.monotonic() + self.slept
