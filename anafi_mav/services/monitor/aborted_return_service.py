"""Repeats the texts of `aborted_return` while the reason of the return lasts."""

from __future__ import annotations

from anafi_mav.services.service import Service


class AbortedReturnService(Service):
    """Reminds every client of a return that one of them has ended."""

    def tick(self, now: float) -> None:
        vehicle = self.host.vehicle
        aborted = vehicle.aborted_return
        if aborted is None:
            return
        if not aborted.lasts(vehicle):
            vehicle.aborted_return = None
        elif aborted.due(vehicle, now):
            aborted.report(vehicle, now)
