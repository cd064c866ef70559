"""Reports who has the aircraft: the pilot at a Skycontroller, or programs.

A pilot who acquires control ends the actions of clients.
"""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.flight_policy import State

SWITCHED = {
    State.PILOT: texts.SWITCH_PILOT,
    State.PROGRAM: texts.SWITCH_PROGRAM,
    State.AUTOMATIC: texts.SWITCH_AUTOMATIC,
}
"""Text of each state of the switch."""


class PilotService(Service):
    """One text to every client each time the pilot or a program takes the drone."""

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._takeovers = host.drone.controller.takeovers
        self._switched = host.vehicle.pilot_switch.state

    def tick(self, now: float) -> float:
        controller, switched = self.host.drone.controller, self.host.vehicle.pilot_switch.state
        if controller.takeovers != self._takeovers:
            self._takeovers = controller.takeovers
            self.host.text(Severity.WARNING, texts.PILOT_HAS_CONTROL.fill(reason=controller.takeover_reason))
        if switched is not self._switched:
            self._switched = switched
            self.host.text(Severity.NOTICE, SWITCHED[switched])
        return NEVER
