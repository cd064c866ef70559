"""Receives ground stations' sticks (MAVLink manual_control.md; conformance A10, C15).

`stick_messages` decodes them, `vehicle.manual_flight` flies by them.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import Host, MessageHandler, Service, client_of
from anafi_mav.services.setpoint.stick_messages import RcChannels, manual_sticks
from anafi_mav.vehicle.base.silence import SILENCE

MAX_CLIENTS = 8
"""Clients whose channels are remembered."""


class ManualControlService(Service):
    """MANUAL_CONTROL and RC_CHANNELS_OVERRIDE, as they arrive."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._flight = host.vehicle.manual
        self._flight.warn_throttled = host.warn_throttled
        self._flight.run_action = host.run_action
        self._channels: dict[Hashable, tuple[RcChannels, float]] = {}
        """By client, and when they were last said."""

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_MANUAL_CONTROL: self._manual_control,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: self._override,
        }

    def link_down(self) -> None:
        self._channels.clear()

    def _manual_control(self, inbound: Inbound) -> None:
        sticks = manual_sticks(inbound.message)
        if isinstance(sticks, str):
            self.host.warn_throttled(texts.MANUAL_CONTROL_IGNORED.fill(reason=sticks))
        elif sticks is not None:
            self._flight.receive(client_of(inbound), sticks, overrides=flavour_of(inbound.channel).joystick_overrides)

    def _override(self, inbound: Inbound) -> None:
        client, now = client_of(inbound), self.host.clock.monotonic()
        before, at = self._channels.pop(client, (RcChannels(), -math.inf))
        channels = (before if now - at < SILENCE else RcChannels()).after(inbound.message)
        if isinstance(channels, str):
            self.host.warn_throttled(texts.RC_OVERRIDE_IGNORED.fill(reason=channels))
        elif channels.released:
            self._flight.silent(client)
        else:
            self._channels[client] = (channels, now)
            if len(self._channels) > MAX_CLIENTS:
                del self._channels[next(iter(self._channels))]
            self._flight.receive(client, channels.sticks, overrides=flavour_of(inbound.channel).joystick_overrides)
