"""Repeats the texts of `aborted_return` while the reason of the return lasts."""

from __future__ import annotations

from anafi_mav.clock import NEVER
from anafi_mav.services.service import LOOK_EVERY, Service


class AbortedReturnService(Service):
    """Reminds every client of a return that one of them has ended."""

    is_watch = True

    def tick(self, now: float) -> float:
        vehicle = self.host.vehicle
        vehicle.remind_of_aborted_return(now)
        return NEVER if vehicle.flight_facts.aborted_return is None else now + LOOK_EVERY
