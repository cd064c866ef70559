"""Setpoints of programs, as they arrive (MAVLink offboard.md; conformance C16). What they mean is in `offboard`."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.offboard import attitude_setpoint
from anafi_mav.services.service import MessageHandler, Service, client_of


class OffboardService(Service):
    """SET_ATTITUDE_TARGET."""

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: self._set_attitude_target}

    def _set_attitude_target(self, inbound: Inbound) -> None:
        setpoint = attitude_setpoint(inbound.message)
        if isinstance(setpoint, str):
            self.host.complain(f"Setpoint refused: {setpoint}")
        elif not self.host.vehicle.offboard.setpoint(client_of(inbound), setpoint):
            self.host.complain("Setpoints refused: another program flies")
