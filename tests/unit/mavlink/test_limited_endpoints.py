"""Frames of a client whose endpoint has `systems`: they reach no other system, addressed to all or not."""

from __future__ import annotations

from typing import Any

import pytest
from support.node_party import DRONE, FOREIGN, OURS, STATION, Party

from anafi_mav.mavlink import dialect

FOLLOW = dialect.MAVLink_follow_target_message(0, 0, 0, 0, 0.0, [0] * 3, [0] * 3, [0] * 4, [0] * 3, [0] * 3, 0)


def disarm(system: int) -> Any:
    return dialect.MAVLink_command_long_message(system, 0, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("message", "source"),
    [
        (disarm(0), (255, 190)),
        (disarm(0), (OURS, 191)),
        (disarm(FOREIGN), (255, 190)),
        (dialect.MAVLink_manual_control_message(0, 900, 0, 500, 0, 0), (255, 190)),
        (FOLLOW, (255, 190)),
        (DRONE, (77, 1)),
    ],
)
def test_client_of_some_systems_reaches_no_other_by_a_frame_to_all(message: Any, source: tuple[int, int]) -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.got("drone"), party.got("pilot")
    party.send("limited", message, source, seq=1)
    assert party.got("drone") == party.got("pilot") == []


def test_client_of_some_systems_is_seen_and_its_systems_are_heard() -> None:
    """A station's heartbeat, and what a part of its drone, as a companion computer, sends to no target."""
    party = Party()
    party.send("limited", STATION, (255, 190))
    text = dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_INFO, b"Companion started")
    party.send("limited", text, (OURS, 191), seq=1)
    ack = dialect.MAVLink_command_ack_message(dialect.MAV_CMD_NAV_LAND, 0)  # as of older autopilots, without a target
    party.send("limited", ack, (OURS, 191), seq=2)
    assert party.got("pilot") == [("HEARTBEAT", 255, 190), ("STATUSTEXT", OURS, 191), ("COMMAND_ACK", OURS, 191)]
