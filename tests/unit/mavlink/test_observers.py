"""What the frames of an observer do to other clients: they neither deceive nor block them."""

from __future__ import annotations

from typing import Any

import pytest

from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import Parser, frame, pack
from anafi_mav.mavlink.node import Node

OURS, FOREIGN = 1, 5
DRONE = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, 12, 128, 0, 4, 3)
STATION = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
LIE = dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_CRITICAL, b"Battery critical: land now")
LAND = dialect.MAVLink_command_long_message(FOREIGN, 1, dialect.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
LIST = dialect.MAVLink_param_request_list_message(FOREIGN, 1)


class Party:
    """A node with an observer, a pilot and the channel of a foreign drone."""

    def __init__(self) -> None:
        self.node = Node()
        self.node.add_host(OURS, 1, lambda inbound: None)
        self.written: dict[str, list[bytes]] = {"observer": [], "pilot": [], "drone": []}
        self.channels = {
            name: Channel(
                name, written.append, options=EndpointOptions(access="observe" if name == "observer" else "all")
            )
            for name, written in self.written.items()
        }
        for channel in self.channels.values():
            self.node.opened(channel)

    def send(self, name: str, message: Any, source: tuple[int, int], seq: int = 0) -> None:
        channel = self.channels[name]
        self.node.received(channel, channel.receive(frame(pack(message), seq, *source)))

    def got(self, name: str) -> list[tuple[str, int, int]]:
        """Kind, system and component of what a client has been sent since the last call."""
        data = b"".join(self.written[name])
        self.written[name].clear()
        return [(one.message.get_type(), one.sysid, one.compid) for one in Parser().receive(data)]


@pytest.mark.parametrize(
    ("message", "source"),
    [
        (LIE, (OURS, 191)),
        (STATION, (OURS, 191)),
        (LIE, (FOREIGN, 1)),
        (DRONE, (FOREIGN, 1)),
        (STATION, (FOREIGN, 1)),
        (DRONE, (77, 1)),
        (LIE, (77, 1)),
        (STATION, (255, 190)),
        (LIST, (255, 190)),
    ],
)
def test_observer_tells_other_clients_nothing_false(message: Any, source: tuple[int, int]) -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("pilot", STATION, (255, 190))
    party.got("pilot"), party.got("drone")
    party.send("observer", message, source, seq=9)
    assert party.got("pilot") == party.got("drone") == []
    assert party.node.counters()["refused_observer"] == 1


def test_observer_reads_a_foreign_system_under_its_own_name() -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("observer", STATION, (200, 190))
    assert party.got("pilot") == [("HEARTBEAT", FOREIGN, 1), ("HEARTBEAT", 200, 190)]
    party.send("observer", LIST, (200, 190), seq=1)
    assert party.got("drone") == [("HEARTBEAT", 200, 190), ("PARAM_REQUEST_LIST", 200, 190)]


def test_observers_copy_does_not_stop_a_pilots_command() -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("observer", LAND, (255, 190), seq=7)
    party.send("pilot", LAND, (255, 190), seq=7)
    assert party.got("drone") == [("COMMAND_LONG", 255, 190)]
