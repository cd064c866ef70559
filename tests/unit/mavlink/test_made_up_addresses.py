"""Made-up addresses before an unsigned `udpin`: they take no proved client's place, and no station's way in."""

from __future__ import annotations

import logging
import re
from typing import Any

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.endpoint import make_endpoint, parse_endpoint
from anafi_mav.mavlink.frames import frame, pack
from anafi_mav.mavlink.node import Node

PILOT = ("192.0.2.2", 5000)
BEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
LAND = dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)


class Clock:
    """A clock that the test sets."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now

    def time(self) -> float:
        return self.now


@pytest.mark.parametrize("rate", [4, 7, 100])
def test_made_up_addresses_cost_a_pilot_no_command(rate: int, caplog: pytest.LogCaptureFixture) -> None:
    """The pilot's radio is out from 8 to 16 s, longer than a silent client keeps its place."""
    caplog.set_level(logging.INFO)
    landed: list[float] = []

    def receive(inbound: Any) -> None:
        if inbound.message.get_type() == "COMMAND_LONG":
            landed.append(clock.now)

    clock = Clock()
    node = Node(clock=clock)
    node.add_host(1, 1, receive)
    endpoint: Any = make_endpoint(parse_endpoint("udpin://0.0.0.0:14550?max_clients=8"), node, clock)
    beats = {sysid: frame(pack(BEAT), 0, sysid, 190) for sysid in (200, 255)}
    land = frame(pack(LAND), 0, 255, 190)
    sent = 0
    for number in range(30 * rate):
        clock.now = number / rate
        endpoint._received(beats[200], (f"198.51.{number // 250}.{number % 250}", 1))
        if number % rate == 1 and not 8 <= clock.now < 16:
            endpoint._received(beats[255], PILOT)
            if clock.now >= 16:
                endpoint._received(land, PILOT)
                sent += 1
    assert len(landed) == sent == 14
    assert len(endpoint._peers) <= 2 * 8
    if rate == 4:  # one that was not flooded away before its proof has kept its channel
        assert [channel.heard_at for channel in node.channels if channel.proof is None] == [29.25]
    lines = [record.getMessage() for record in caplog.records if " replaces " in record.getMessage()]
    others = [record.getMessage() for record in caplog.records if record.getMessage() not in lines]
    assert (len(lines), len(others) <= 3) == (3, True), caplog.text  # 30 s
    counted = sum(int((re.search(r"\((\d+) more", line) or [0, 0])[1]) for line in lines)
    assert 9 * rate < len(lines) + counted < node.counters()["evicted_peers"] + endpoint.counters["evicted_peers"]
