"""The policy for a lost ground station, and the watch over heartbeats. No I/O.

Only heartbeats of type GCS count: a program that flies setpoints is no ground station, and its own silence has its
own
consequence. The policy is off unless a user sets it (conformance E11).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


class LossAction(enum.IntEnum):
    """Action on the loss of the last ground station; the numbers are those of PX4's NAV_DLL_ACT."""

    NOTHING = 0
    HOLD = 1
    RETURN = 2
    LAND = 3


@dataclass
class LossPolicy:
    """Policy of one vehicle for the loss of its ground stations."""

    action: LossAction = LossAction.NOTHING
    after: float = 10.0
    """s without any heartbeat."""


class GcsWatch:
    """Detects the moment at which the last ground station is lost, once for each loss."""

    def __init__(self) -> None:
        self._heard: float | None = None
        """Time of the last heartbeat of a ground station; None: none yet, so that none can be lost."""
        self.lost = False

    def heard(self, now: float) -> bool:
        """Note a ground station's heartbeat; True when it ends a loss."""
        self._heard = now
        back, self.lost = self.lost, False
        return back

    def restart(self, now: float) -> None:
        """Restart the watch: the time without reception is no silence of the ground stations.

        Stations that were present before are expected again, and a loss from before is forgotten.
        """
        if self._heard is not None:
            self._heard = now
        self.lost = False

    def stalled(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats."""
        if self._heard is not None:
            self._heard += seconds

    def expire(self, now: float, after: float) -> bool:
        """True at the first call after the ground stations have been silent for `after` s."""
        if self._heard is None or self.lost or now - self._heard < after:
            return False
        self.lost = True
        return True
