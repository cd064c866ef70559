"""The commands that begin and end flights, and SET_MODE: of the autopilot alone."""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.command.actions import change_mode, flight_actions
from anafi_mav.services.commands import EFFECT_OF_MODE, Action, Effect
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import MessageHandler, Service, client_of
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import Extent, Right


class FlightService(Service):
    """Arming, take-off, landing, return, goto and changes of the mode."""

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION if self.host.vehicle.allow_kill else 0

    def actions(self) -> Mapping[int, Action]:
        return flight_actions(self.host.vehicle)

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_SET_MODE: self._set_mode}

    def _set_mode(self, inbound: Inbound) -> None:
        """SET_MODE has no acknowledgement: the heartbeat shows the mode, a text the refusal."""
        mode: FlightMode | None = flavour_of(inbound.channel).mode_of_number(inbound.message.custom_mode)
        client, vehicle, now = client_of(inbound), self.host.vehicle, self.host.clock.monotonic()
        is_hold = mode is not None and EFFECT_OF_MODE[mode] is Effect.HOLD
        counted = not is_hold or vehicle.holds.arrive(client, now)
        self.host.run_action(client, change_mode(vehicle, mode, Right(client, Extent.ALL, now, counted)))
