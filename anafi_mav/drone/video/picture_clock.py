"""Converts RTP timestamps of pictures to the time of this host. No I/O.

A picture arrives about a tenth of a second after it was taken: exposure, encoder, radio. Its RTP timestamp is the
moment it was taken, on a clock of the drone. RTCP sender reports name that clock's present time when they leave
(RFC 3550 6.4.1), and they are neither exposed nor encoded. So the fastest report, or picture, of the last minute gives
the difference between the two clocks, late by no more than its journey: some milliseconds with reports, the whole
delay of the fastest picture without them.
"""

from __future__ import annotations

import math

from anafi_mav.arsdk.video.rtp_h264 import CLOCK_RATE

WINDOW = 30.0
"""s. The fastest journey is looked for in the present window and the one before: two quartzes drift apart by some
milliseconds a minute."""

MOST_DELAY = 5.0
"""s between a picture and its arrival beyond which the drone has begun to count elsewhere."""

_WRAP = 1 << 32


class PictureClock:
    """The clock of one RTP stream, seen from here."""

    def __init__(self) -> None:
        self._last: tuple[int, float] | None = None
        """The newest timestamp, and the same in s without wrapping."""
        self._fastest = self._before = math.inf
        """s between the clocks by the fastest journey of the present window, and of the one before."""
        self._since = -math.inf
        self.has_reports = False
        """True when a sender report was received: times are then late by a journey, without the camera's delay."""

    def on_report(self, timestamp: int, arrived: float) -> None:
        """Sender report with the RTP time of its departure; `arrived` in s of this host."""
        self.has_reports = True
        self._note(self._seconds(timestamp), arrived)

    def on_picture(self, timestamp: int, arrived: float) -> float:
        """Return when a picture was taken, s of this host, never after it `arrived`."""
        taken = self._seconds(timestamp)
        self._note(taken, arrived)
        shot = taken + min(self._fastest, self._before)
        if arrived - shot <= MOST_DELAY:
            return shot
        self._since, self._fastest, self._before = arrived, arrived - taken, math.inf
        self.has_reports = False
        return arrived

    def _note(self, sent: float, arrived: float) -> None:
        if arrived - self._since >= WINDOW:
            self._before, self._fastest, self._since = self._fastest, math.inf, arrived
        self._fastest = min(self._fastest, arrived - sent)

    def _seconds(self, timestamp: int) -> float:
        """Return the timestamp in s, without wrapping.

        Reports and pictures are a fraction of a second apart.
        """
        before, seconds = self._last or (timestamp, 0.0)
        seconds += ((timestamp - before + _WRAP // 2) % _WRAP - _WRAP // 2) / CLOCK_RATE
        self._last = timestamp, seconds
        return seconds
