"""The policy for a lost ground station, and the watch over heartbeats. No I/O.

Only heartbeats of type GCS count: a program that flies setpoints is no ground station, and its own silence has its
own
consequence. The policy is off unless a user sets it (conformance E11).
"""

from __future__ import annotations

import enum
from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav.clock import NEVER


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
        self._clients: dict[Hashable, float] = {}
        """Time of the last heartbeat over each channel."""
        self.lost = False

    def heard(self, now: float, client: Hashable = None) -> bool:
        """Note a ground station's heartbeat over a channel; True when it ends a loss."""
        self._heard = self._clients[client] = now
        back, self.lost = self.lost, False
        return back

    def restart(self, now: float) -> None:
        """Restart the watch: the time without reception is no silence of the ground stations.

        Stations that were present before are expected again, and a loss from before is forgotten.
        """
        if self._heard is not None:
            self._heard = now
        self._clients = dict.fromkeys(self._clients, now)
        self.lost = False

    def stalled(self, seconds: float) -> None:
        """Leave out a time in which the host could not receive heartbeats."""
        if self._heard is not None:
            self._heard += seconds
        self._clients = {client: heard + seconds for client, heard in self._clients.items()}

    def closed(self, client: Hashable, now: float, after: float, *, is_certain: bool) -> float | None:
        """Note that a channel has closed.

        Return the silence, s, when the last ground station is lost by that, and None otherwise. `is_certain`: its
        station is known to be gone. Otherwise it may return over another channel: silence decides.
        """
        last = self._clients.pop(client, None)
        if last is None or not is_certain or self.lost:
            return None
        if any(now - heard < after for heard in self._clients.values()):
            return None
        self.lost = True
        return now - last

    def expire(self, now: float, after: float) -> bool:
        """True at the first call after the ground stations have been silent for `after` s."""
        if now < self.expires_at(after):
            return False
        self.lost = True
        return True

    def expires_at(self, after: float) -> float:
        """Return when `expire` becomes true without further heartbeats (s), or `NEVER`."""
        return NEVER if self._heard is None or self.lost else self._heard + after
