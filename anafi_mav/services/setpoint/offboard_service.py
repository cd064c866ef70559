"""Receives setpoints of programs and sends back the flown ones (MAVLink offboard.md, C16).

`setpoint_messages` decodes the messages, `vehicle.offboard.flight` flies them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import Host, MessageHandler, Service, input_objection
from anafi_mav.services.setpoint.offboard_echo import STREAMS
from anafi_mav.services.setpoint.setpoint_messages import attitude_setpoint, global_setpoint, local_setpoint
from anafi_mav.services.stream import MessageStream
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueSubscriptions
from anafi_mav.vehicle.offboard.setpoints import Setpoint


class OffboardService(Service):
    """MAVLink service for SET_ATTITUDE_TARGET and SET_POSITION_TARGET_*, and their echoes.

    The positions are those of SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT.
    """

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.offboard
        self._flight.warn_throttled = host.warn_throttled
        self._flight.drop = self._drop

    def capabilities(self) -> int:
        return (
            dialect.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
            | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        )

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: self._takes(attitude_setpoint),
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._takes(local_setpoint),
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._takes(global_setpoint),
        }

    def streams(self) -> Mapping[int, MessageStream]:
        return STREAMS

    def subscriptions(self) -> Subscriptions:
        return self._flight.subscriptions()

    def value_subscriptions(self) -> ValueSubscriptions:
        return self._flight.value_subscriptions()

    def _takes(self, read: Callable[[Any], Setpoint | OperatorText]) -> MessageHandler:
        def take(inbound: Inbound) -> None:
            client, reason = inbound.client, input_objection(self.host.vehicle, inbound)
            if reason is None:
                setpoint = read(inbound.message)
                if isinstance(setpoint, OperatorText):
                    reason = setpoint
                else:
                    guided = flavour_of(inbound.channel).guided_setpoints
                    reason = self._flight.receive(client, setpoint, guided=guided)
            if reason is None:
                self.host.use_input(client, InputStream.SETPOINT)
            else:
                self._drop(client, reason)

        return take

    def _drop(self, client: Hashable, reason: OperatorText) -> None:
        self.host.drop_input(client, InputStream.SETPOINT, reason)
