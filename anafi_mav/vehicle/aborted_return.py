"""Repeated reminders to clients after the drone's own return has been ended.

The drone does not return a second time for the same reason, so its reason is sent to the pilot at once and then at
intervals.
"""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.drone.events import HomeReachability, ReturnReason, WarningLevel
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.flying import LANDING
from anafi_mav.vehicle.base.severity import Severity

REPEAT_EVERY = 15.0
"""s between two reminders."""

_BATTERY = (
    ReturnReason.LOW_BATTERY,
    ReturnReason.BATTERY_LOST_COMM,
    ReturnReason.BATTERY_TOO_HOT,
)
"""Reasons that last until the drone stands: the battery does not recover in the air."""

_SHORT = {ReturnReason.LANDING_ZONE_NOT_FOUND: texts.NO_LANDING_ZONE}

_LAND_NOW = {
    HomeReachability.CRITICAL: texts.HOME_HARDLY_REACHABLE,
    HomeReachability.NOT_REACHABLE: texts.HOME_UNREACHABLE,
}


class AbortedReturn:
    """One return of the drone's own that was ended."""

    def __init__(self, system: int | None, reason: ReturnReason | None) -> None:
        """`system` of the client that has ended it; None: another command has."""
        self._system = system
        self._reason = reason
        self._next = -math.inf

    def lasts(self, vehicle: Aircraft) -> bool:
        """True while the drone still has the reason for which it wanted to return."""
        if vehicle.on_ground:
            return False
        if self._reason == ReturnReason.ICING:
            return vehicle.drone.alerts.state.icing not in (None, WarningLevel.OK)
        return self._reason in _BATTERY

    def due(self, vehicle: Aircraft, now: float) -> bool:
        """True when a reminder is due; never while the drone returns or lands."""
        return now >= self._next and not vehicle.returning and vehicle.flying_state not in LANDING

    def report(self, vehicle: Aircraft, now: float) -> None:
        """Notify every client."""
        self._next = now + REPEAT_EVERY
        for text in self.reports(vehicle):
            vehicle.text(Severity.CRITICAL, text)

    def reports(self, vehicle: Aircraft) -> list[OperatorText]:
        """Return the texts for the present state of the drone."""
        reason = "unknown" if self._reason is None else _SHORT.get(self._reason, spoken(self._reason))
        if self._system is None:
            said = [texts.RETURN_STOPPED.fill(reason=reason)]
        else:
            said = [texts.RETURN_ABORTED.fill(system=self._system, reason=reason)]
        if self._reason in _BATTERY:
            percent = vehicle.drone.battery.state.percent
            said.append(texts.NO_AUTOMATIC_RETURN.fill(percent="?" if percent is None else percent))
        reach = vehicle.drone.home.state.reachability
        if reach in _LAND_NOW:
            said.append(_LAND_NOW[reach])
        return said
