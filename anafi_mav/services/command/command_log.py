"""Results of the commands of one component, for the status of the gateway. No I/O."""

from __future__ import annotations

from collections import Counter, deque
from typing import NamedTuple

MAX_REFUSALS = 20
"""Refused commands that are kept: what a person reads to see why a station's button does nothing."""

MAX_DURATIONS = 200
"""Durations of accepted commands that are kept: enough for a 99th percentile."""


class Refusal(NamedTuple):
    """A command whose final result was not ACCEPTED."""

    at: float
    """s, monotonic."""
    sysid: int
    compid: int
    client: str
    """Name of the channel."""
    command: int
    result: int
    reason: str


class CommandLog:
    """Counts results, and keeps the last refusals and durations."""

    def __init__(self) -> None:
        self.results: Counter[int] = Counter()
        """By MAV_RESULT."""
        self.refusals: deque[Refusal] = deque(maxlen=MAX_REFUSALS)
        """Oldest first."""
        self.durations: deque[float] = deque(maxlen=MAX_DURATIONS)
        """s from the arrival to the acknowledgement of actions that were accepted."""

    def refuse(self, refusal: Refusal) -> None:
        """Note a command that was not accepted."""
        self.results[refusal.result] += 1
        self.refusals.append(refusal)

    def accept(self, result: int, duration: float | None = None) -> None:
        """Note an accepted command; `duration`: s that its action took, None for a query."""
        self.results[result] += 1
        if duration is not None:
            self.durations.append(duration)
