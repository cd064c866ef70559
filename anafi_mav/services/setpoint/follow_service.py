"""Receives FOLLOW_TARGET, and positions of stations that are followed (conformance A10, B2).

QGroundControl sends an ArduPilot its GLOBAL_POSITION_INT instead of FOLLOW_TARGET. `vehicle.follow` computes the
drone's place.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import Host, MessageHandler, Service, input_objection
from anafi_mav.services.setpoint.target_messages import sighting, station_sighting
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.subscriptions import ValueSubscriptions
from anafi_mav.vehicle.follow import Sighting


class FollowService(Service):
    """Service for targets that this system can be commanded to follow."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.follow
        self._flight.warn_throttled = host.warn_throttled
        self._flight.drop = self._drop

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_FOLLOW_TARGET: self._target,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._station,
        }

    def value_subscriptions(self) -> ValueSubscriptions:
        return self._flight.value_subscriptions()

    def uses_target(self, inbound: Inbound) -> bool:
        """Return True while the drone follows the sender.

        Of positions those of the station that chose the mode count: other systems on its link are no targets.
        """
        if inbound.id == dialect.MAVLINK_MSG_ID_FOLLOW_TARGET:
            return self._flight.engaged
        return self._flight.requester == inbound.client and flavour_of(inbound.channel).station_position_leads

    def _target(self, inbound: Inbound) -> None:
        if self.uses_target(inbound):
            self._receive(inbound, sighting(inbound.message))

    def _station(self, inbound: Inbound) -> None:
        if self.uses_target(inbound):
            self._receive(inbound, station_sighting(inbound.message))

    def _receive(self, inbound: Inbound, seen: Sighting | OperatorText) -> None:
        client, reason = inbound.client, input_objection(self.host.vehicle, inbound)
        if reason is None:
            reason = seen if isinstance(seen, OperatorText) else self._flight.receive(client, seen)
        if reason is None:
            self.host.use_input(client, InputStream.TARGET)
        else:
            self._drop(client, reason)

    def _drop(self, client: Hashable, reason: OperatorText) -> None:
        self.host.drop_input(client, InputStream.TARGET, reason)
