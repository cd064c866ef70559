"""What is done when no ground station is heard any more: the policy, and the watch over their heartbeats. No I/O.

Only heartbeats of type GCS count: a program that flies setpoints is no ground station, and its own silence has its own
consequence. The policy is off unless somebody sets it (conformance E11).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


class LossAction(enum.IntEnum):
    """What to do; the numbers are PX4's of NAV_DLL_ACT."""

    NOTHING = 0
    HOLD = 1
    RETURN = 2
    LAND = 3


@dataclass
class LossPolicy:
    """What one vehicle does when its ground stations are gone."""

    action: LossAction = LossAction.NOTHING
    after: float = 10.0
    """s without any heartbeat."""


class GcsWatch:
    """Tells the moment at which the last ground station is lost, once for each loss."""

    def __init__(self) -> None:
        self._heard: float | None = None
        """When a ground station was heard last; None: none yet, so that none can be lost."""
        self.lost = False

    def heard(self, now: float) -> bool:
        """A ground station's heartbeat; True when it ends a loss."""
        self._heard = now
        back, self.lost = self.lost, False
        return back

    def restart(self, now: float) -> None:
        """They can be heard again: that nobody was listening in between is no silence of theirs.

        Who was there before is expected again, and a loss of before counts anew.
        """
        if self._heard is not None:
            self._heard = now
        self.lost = False

    def stalled(self, seconds: float) -> None:
        """Leave out a time in which the host could not hear them."""
        if self._heard is not None:
            self._heard += seconds

    def expire(self, now: float, after: float) -> bool:
        """True at the first look after they have been silent for so long."""
        if self._heard is None or self.lost or now - self._heard < after:
            return False
        self.lost = True
        return True
