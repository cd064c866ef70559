"""Reports that the pilot at a Skycontroller acquired control: actions of clients end then."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.severity import Severity


class PilotService(Service):
    """One text to every client each time the pilot takes the drone from one of them."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._takeovers = host.drone.controller.takeovers

    def tick(self, now: float) -> None:
        controller = self.host.drone.controller
        if controller.takeovers != self._takeovers:
            self._takeovers = controller.takeovers
            self.host.text(Severity.WARNING, texts.PILOT_HAS_CONTROL.fill(reason=controller.takeover_reason))
