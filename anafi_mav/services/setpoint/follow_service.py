"""Receives FOLLOW_TARGET (conformance A10, B2).

`vehicle.follow` computes the drone's place.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.service import Host, MessageHandler, Service, input_objection
from anafi_mav.services.setpoint.target_messages import sighting
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.subscriptions import ValueSubscriptions


class FollowService(Service):
    """Service for targets that this system can be commanded to follow."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.follow
        self._flight.warn_throttled = host.warn_throttled
        self._flight.drop = self._drop

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_FOLLOW_TARGET: self._target}

    def value_subscriptions(self) -> ValueSubscriptions:
        return self._flight.value_subscriptions()

    def _target(self, inbound: Inbound) -> None:
        if not self._flight.engaged:
            return  # the message names no drone: others may follow its sender
        client, reason = inbound.client, input_objection(self.host.vehicle, inbound)
        if reason is None:
            seen = sighting(inbound.message)
            reason = seen if isinstance(seen, OperatorText) else self._flight.receive(client, seen)
        if reason is None:
            self.host.use_input(client, InputStream.TARGET)
        else:
            self._drop(client, reason)

    def _drop(self, client: Hashable, reason: OperatorText) -> None:
        self.host.drop_input(client, InputStream.TARGET, reason)
