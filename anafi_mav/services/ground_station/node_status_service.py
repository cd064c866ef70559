"""LINK_NODE_STATUS on request: the state of the channel that carried the request.

Conformance F 155.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from anafi_mav.clock import NEVER
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.service import Host, Request, Service

LOOK_EVERY = 0.9
"""s, at least, over which the rates are taken. The services tick once a second."""


class _Look(NamedTuple):
    at: float
    sent: int
    received: int


class NodeStatusService(Service):
    """Looks at the channels' counters once a second."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._looks: dict[Channel, tuple[_Look, _Look]] = {}
        """The last look at a channel and the one before."""
        self._next_look = 0.0

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_LINK_NODE_STATUS: self._status}

    def tick(self, now: float) -> float:
        if now < self._next_look:
            return NEVER
        self._next_look = now + LOOK_EVERY
        for channel in self.host.channels:
            look = _Look(now, channel.sent_bytes, channel.received_bytes)
            _, before = self._looks.get(channel, (look, look))
            self._looks[channel] = (before, look)
        return NEVER

    def link_down(self) -> None:
        self._looks.clear()

    def channel_closed(self, channel: Channel) -> None:
        self._looks.pop(channel, None)

    def _status(self, inbound: Inbound, command: Command) -> dialect.MAVLink_message:
        channel = inbound.channel
        sent_rate = received_rate = 0.0
        if channel in self._looks:
            before, last = self._looks[channel]
            if last.at > before.at:
                sent_rate = (last.sent - before.sent) / (last.at - before.at)
                received_rate = (last.received - before.received) / (last.at - before.at)
        parsed = channel.parser.counters
        return dialect.MAVLink_link_node_status_message(
            timestamp=self.host.times().boot_ms,
            tx_buf=round(100.0 * channel.free),
            rx_buf=100,  # what arrives is taken at once
            tx_rate=round(sent_rate),
            rx_rate=round(received_rate),
            rx_parse_err=parsed["garbage_bytes"] & 0xFFFF,
            tx_overflows=channel.dropped_bytes & 0xFFFF,
            rx_overflows=0,
            messages_sent=channel.counters["sent_frames"] & 0xFFFFFFFF,
            messages_received=parsed["frames"] & 0xFFFFFFFF,
            messages_lost=parsed["lost_frames"] & 0xFFFFFFFF,
        )
