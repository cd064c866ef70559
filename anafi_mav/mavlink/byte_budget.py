"""Byte budget of one peer: when bytes leave, and the pace of its streams. No I/O."""

from __future__ import annotations

BURST = 0.1
"""s of the budget that may leave at once."""

MIN_BURST = 280
"""Bytes: a frame, however small the budget."""

STREAM_SHARE = 0.8
"""Of the budget for streams. The rest is for answers, which a client waits for."""

LEAST_SHARE = 0.4
"""Of the budget for streams while answers fill the rest, as a list of parameters does."""

WINDOW = 2.0
"""s over which the bytes of streams are counted. Most streams leave at least once in it."""

DEAD_BAND = 0.85
"""Share of the streams' budget above which they are left as they are, so that their rates do not swing."""

LARGEST_STEP = 2.0
"""Factor by which the slowdown grows or shrinks in one window: a second drone doubles the bytes."""

MAX_SLOWDOWN = 50.0
"""A message of 5 Hz leaves every ten seconds: a slower stream is of no use to a station."""


class ByteBudget:
    """A budget of bytes in a second."""

    def __init__(self, bytes_per_second: float) -> None:
        self._rate = bytes_per_second
        self._burst = max(MIN_BURST, bytes_per_second * BURST)
        self._left = self._burst
        self._at = 0.0

    def spend(self, size: int, now: float) -> float:
        """Spend the bytes of a frame; return the seconds until the next may leave."""
        self._left = min(self._burst, self._left + (now - self._at) * self._rate) - size
        self._at = now
        return max(0.0, -self._left / self._rate)


class StreamPace:
    """The factor by which the intervals of a peer's streams are longer than requested.

    It follows from the bytes that the streams of all systems take, so that each stream gets its part of the line and
    none is starved by a faster one. PX4 does the same with its streams (mavlink_main.cpp update_rate_mult).
    """

    def __init__(self, bytes_per_second: float) -> None:
        self.slowdown = 1.0
        self._rate = bytes_per_second
        self._streamed = 0
        self._other = 0
        self._since: float | None = None

    def count(self, size: int, *, is_stream: bool) -> None:
        """Count a frame that is to leave, whether it leaves or is dropped."""
        if is_stream:
            self._streamed += size
        else:
            self._other += size

    def adjust(self, now: float) -> None:
        """Follow what was counted, once in a window."""
        if self._since is None:
            self._since = now
        elapsed = now - self._since
        if elapsed < WINDOW:
            return
        answers = self._other / elapsed / self._rate
        share = max(LEAST_SHARE, min(STREAM_SHARE, 1.0 - answers))
        used = self._streamed / elapsed / (share * self._rate)
        if used > 1.0 or used < DEAD_BAND:
            step = min(LARGEST_STEP, max(1.0 / LARGEST_STEP, used))
            self.slowdown = min(MAX_SLOWDOWN, max(1.0, self.slowdown * step))
        self._since, self._streamed, self._other = now, 0, 0
