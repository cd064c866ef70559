"""A node between clients and a foreign drone, without sockets."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Parser, frame, pack
from anafi_mav.mavlink.node import Node

OURS, FOREIGN = 1, 5
DRONE = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, 12, 128, 0, 4, 3)
STATION = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)

OPTIONS = {
    "observer": EndpointOptions(access="observe"),
    "flyer": EndpointOptions(access="control"),
    "limited": EndpointOptions(systems=(OURS,)),
    "pilot": EndpointOptions(),
    "drone": EndpointOptions(),
}
"""Of the endpoints: `limited` reaches our own drone alone, `flyer` may fly and maintain nothing."""


class Party:
    """A node with observer, flyer, a client of some systems, a pilot and the channel of a foreign drone."""

    def __init__(self, *, forwards: bool = True) -> None:
        self.node = Node(forwards=forwards)
        self.node.add_host(OURS, 1, lambda inbound: None)
        self.written: dict[str, list[bytes]] = {name: [] for name in OPTIONS}
        self.channels = {
            name: Channel(name, written.append, options=OPTIONS[name]) for name, written in self.written.items()
        }
        for channel in self.channels.values():
            self.node.opened(channel)

    def send(
        self, name: str, message: Any, source: tuple[int, int], seq: int = 0, reached: Collection[int] | None = None
    ) -> None:
        """`reached`: the systems of the key under which a frame arrives; None: it arrives under none."""
        channel = self.channels[name]
        self.node.received(channel, channel.receive(frame(pack(message), seq, *source)), reached)

    def got(self, name: str) -> list[tuple[str, int, int]]:
        """Kind, system and component of what a client has been sent since the last call."""
        data = b"".join(self.written[name])
        self.written[name].clear()
        return [(one.message.get_type(), one.sysid, one.compid) for one in Parser().receive(data)]
