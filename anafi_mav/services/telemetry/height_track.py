"""A height as the drone's events report it, read at an earlier moment. No I/O.

A picture is older than the newest event. Its height is between two events, or a little after the last one.
"""

from __future__ import annotations

from collections import deque

KEPT = 32
"""Reports: six seconds of an ANAFI's, and a second of a simulated one that reports 30 times a second."""

MOST_CARRIED = 1.0
"""s that a height is carried beyond its report by the climb rate."""


class HeightTrack:
    """The newest reports of one height, m."""

    def __init__(self) -> None:
        self._reports: deque[tuple[float, float]] = deque(maxlen=KEPT)

    def clear(self) -> None:
        """Forget all reports: the drone does not know the height, or is disconnected."""
        self._reports.clear()

    def add(self, at: float, height: float) -> None:
        """A report (s, m). One that is older than the last is dropped."""
        if not self._reports or at > self._reports[-1][0]:
            self._reports.append((at, height))

    def at(self, moment: float, climb: float) -> float | None:
        """Return the height at a moment (s), None when no report is near it.

        `climb`: climb rate at that moment, m/s.
        """
        after: tuple[float, float] | None = None
        for report in reversed(self._reports):
            if report[0] <= moment:
                if after is None:
                    return self._carried(report, moment, climb)
                part = (moment - report[0]) / (after[0] - report[0])
                return report[1] + part * (after[1] - report[1])
            after = report
        return None if after is None else self._carried(after, moment, climb)

    @staticmethod
    def _carried(report: tuple[float, float], moment: float, climb: float) -> float | None:
        elapsed = moment - report[0]
        return report[1] + climb * elapsed if abs(elapsed) <= MOST_CARRIED else None
