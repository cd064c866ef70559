"""Receives ground stations' sticks (MAVLink manual_control.md; conformance A10, C15).

`stick_messages` decodes them, `vehicle.manual_flight` flies by them.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.dropped_inputs import InputStream
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import Host, MessageHandler, Service, input_objection
from anafi_mav.services.setpoint.stick_intent import StickIntent
from anafi_mav.services.setpoint.stick_messages import RcChannels, manual_sticks
from anafi_mav.vehicle.manual_flight import Sticks
from anafi_mav.vehicle.offboard.silence import SILENCE

MAX_CLIENTS = 8
"""Clients whose channels are remembered."""


class ManualControlService(Service):
    """MANUAL_CONTROL and RC_CHANNELS_OVERRIDE, as they arrive."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.manual
        self._channels: dict[Hashable, tuple[RcChannels, float]] = {}
        """By client, and when they were last said."""
        self._intent = StickIntent()

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: self._manual_control,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: self._override,
        }

    def link_down(self) -> None:
        self._channels.clear()
        self._intent.forget()

    def _manual_control(self, inbound: Inbound) -> None:
        sticks = manual_sticks(inbound.message)
        if isinstance(sticks, str):
            self.host.drop_input(inbound.client, InputStream.STICKS, sticks)
        elif sticks is not None:
            self._fly(inbound, sticks)

    def _override(self, inbound: Inbound) -> None:
        client, now = inbound.client, self.host.clock.monotonic()
        before, at = self._channels.pop(client, (RcChannels(), -math.inf))
        channels = (before if now - at < SILENCE else RcChannels()).after(inbound.message)
        if isinstance(channels, str):
            self.host.drop_input(client, InputStream.STICKS, channels)
        elif channels.released:
            self._flight.silent(client)
        else:
            self._channels[client] = (channels, now)
            if len(self._channels) > MAX_CLIENTS:
                del self._channels[next(iter(self._channels))]
            self._fly(inbound, channels.sticks)

    def _fly(self, inbound: Inbound, sticks: Sticks) -> None:
        """Pass sticks on; those that a person means and that are not flown are reported."""
        client = inbound.client
        is_meant = self._intent.is_meant(client, sticks, inbound.now)
        reason = input_objection(self.host.vehicle, inbound)
        if reason is None:
            reason = self._flight.receive(client, sticks, overrides=flavour_of(inbound.channel).joystick_overrides)
        if reason is None:
            self.host.use_input(client, InputStream.STICKS)
        elif is_meant:
            self.host.drop_input(client, InputStream.STICKS, reason)
