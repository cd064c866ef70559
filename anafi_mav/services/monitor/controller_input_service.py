"""Grabs the Skycontroller's wheels and buttons again after each connection."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.errors import AnafiMavError
from anafi_mav.services.service import Service
from anafi_mav.vehicle.base.severity import Severity


class ControllerInputService(Service):
    """Restores what ANF_SC_WHEELS and ANF_SC_BUTTONS requested before the link was lost."""

    def link_up(self) -> None:
        if self.host.drone.controller.present and self.host.vehicle.controller_inputs.are_requested:
            self.host.spawn(self._restore())

    async def _restore(self) -> None:
        try:
            await self.host.vehicle.controller_inputs.restore()
        except AnafiMavError as error:
            self.host.text(Severity.WARNING, texts.CONTROLLER_INPUTS.fill(error=error))
