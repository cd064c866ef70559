"""Repeats the texts of `aborted_return` while the reason of the return lasts."""

from __future__ import annotations

from anafi_mav.services.service import Service


class AbortedReturnService(Service):
    """Reminds every client of a return that one of them has ended."""

    def tick(self, now: float) -> None:
        self.host.vehicle.remind_of_aborted_return(now)
