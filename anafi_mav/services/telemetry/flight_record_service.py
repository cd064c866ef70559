"""FLIGHT_INFORMATION: number and start of the present flight (MAVLink common.xml 264).

Conformance F 132. Times are in the clock of all our messages; events from before we were connected are 0, MAVLink's
"unknown". The flight's number is made of the id that the drone gives each of its flights.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from anafi_mav.mavlink import dialect
from anafi_mav.services.service import Host, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.vehicle import Landed, Vehicle


@dataclass
class FlightRecord:
    """The present flight, or the last one. No I/O; `now` is in us since the start."""

    armed_at: int = 0
    took_off_at: int = 0
    landed_at: int = 0
    number: int = 0
    """0: no flight yet, or the drone has not reported its id."""
    _armed: bool | None = None
    _landed: Landed | None = None

    def look(self, *, armed: bool, landed: Landed, now: int) -> None:
        """Update from the vehicle's present state.

        The first call only compares: the state that it sees began before it.
        """
        if self._armed is False and armed:
            self.armed_at, self.took_off_at, self.landed_at, self.number = now, 0, 0, 0
        if self._landed is Landed.ON_GROUND and landed in (Landed.TAKEOFF, Landed.IN_AIR):
            self.took_off_at = now
        if self._landed not in (None, Landed.ON_GROUND) and landed is Landed.ON_GROUND:
            self.landed_at = now
        self._armed = armed
        if landed is not Landed.UNKNOWN:
            self._landed = landed

    def flight_id(self, id: str | None) -> None:
        """Take the drone's id of its flight; empty on the ground, where the last number is kept."""
        if id:
            self.number = int.from_bytes(hashlib.sha256(id.encode()).digest()[:8], "little") or 1


class FlightRecordService(Service):
    """Watches the vehicle arm, take off and land."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._record = FlightRecord()

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_FLIGHT_INFORMATION: MessageStream(self._build)}

    def link_up(self) -> None:
        self._record = FlightRecord()
        self._look()

    def state_changed(self) -> None:
        self._look()

    def _look(self) -> None:
        vehicle = self.host.vehicle
        self._record.look(armed=vehicle.armed, landed=vehicle.landed, now=self.host.times().boot_us)
        self._record.flight_id(self.host.drone.product.state.flight_id)

    def _build(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message:
        record = self._record
        record.flight_id(self.host.drone.product.state.flight_id)
        return dialect.MAVLink_flight_information_message(
            times.boot_ms,
            record.armed_at,
            record.took_off_at,
            record.number,
            landing_time=record.landed_at // 1000 & 0xFFFFFFFF,
        )
