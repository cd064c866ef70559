"""Stores take-off point and initiator of a descent for a restart of the gateway in the air.

So no height is lost, and clients can end the same landings and returns as before. The file of a drone is found by its
serial number, and the record in it is valid for the flight that it names.
"""

from __future__ import annotations

from anafi_mav.drone import events
from anafi_mav.services.service import Service
from anafi_mav.vehicle.base.subscriptions import Subscriptions

KEY = "takeoff"
"""Name of the record in the drone's file."""


class TakeoffPointService(Service):
    """Writes the record of a flight whenever it changes."""

    def subscriptions(self) -> Subscriptions:
        kinds = (
            events.FlightId,
            events.GpsLocationChanged,
            events.TakeoffLocation,
            events.FlyingStateChanged,
            events.ReturnStateChanged,
        )
        return dict.fromkeys(kinds, lambda message, now: self._keep())

    def link_up(self) -> None:
        self._keep()

    def _keep(self) -> None:
        record, settings = self.host.vehicle.takeoff_record, self.host.memory.settings
        if record is None or settings.get(KEY) == (written := record.written):
            return
        settings[KEY] = written
        self.host.spawn(self._save())

    async def _save(self) -> None:
        if (problem := await self.host.memory.save()) is not None:
            self.host.warn_throttled(problem)
