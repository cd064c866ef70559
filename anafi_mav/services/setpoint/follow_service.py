"""Receives FOLLOW_TARGET (conformance A10, B2).

`vehicle.follow` computes the drone's place.
"""

from __future__ import annotations

from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, MessageHandler, Service, client_of
from anafi_mav.services.setpoint.target_messages import sighting
from anafi_mav.vehicle.base.subscriptions import Subscriptions


class FollowService(Service):
    """Service for targets that this system can be commanded to follow."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.follow
        self._flight.warn_throttled = host.warn_throttled

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_FOLLOW_TARGET: self._target}

    def subscriptions(self) -> Subscriptions:
        return self._flight.subscriptions()

    def _target(self, inbound: Inbound) -> None:
        seen = sighting(inbound.message)
        if not isinstance(seen, str):
            self._flight.receive(client_of(inbound), seen)
        elif self._flight.engaged:
            self.host.warn_throttled(texts.TARGET_IGNORED.fill(reason=seen))
