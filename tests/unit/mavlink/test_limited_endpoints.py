"""Frames of a client whose endpoint has `systems`: they reach no other system, addressed to all or not."""

from __future__ import annotations

from typing import Any

import pytest
from support.node_party import DRONE, FOREIGN, OURS, STATION, Party

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound

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


@pytest.mark.parametrize("target", [0, FOREIGN])
def test_frame_under_the_key_of_our_system_reaches_no_other(target: int) -> None:
    """On a zenoh network the router lets a station send under the keys of some systems."""
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.got("drone"), party.got("pilot")
    party.send("flyer", disarm(target), (255, 190), reached={OURS})
    party.send("pilot", disarm(target), (254, 190), reached={OURS})
    assert party.got("drone") == []


def test_client_of_some_systems_takes_no_command_to_an_absent_one_in_its_name() -> None:
    """The command gets its answer from the gateway, as the system is not behind that endpoint."""
    party, absent = Party(), OURS + 1
    answered: list[Inbound] = []
    party.node.add_absent_host(absent, answered.append)
    party.send("limited", DRONE, (absent, 50))
    party.got("limited")
    party.send("pilot", disarm(absent), (255, 190))
    assert [inbound.message.command for inbound in answered] == [dialect.MAV_CMD_COMPONENT_ARM_DISARM]
    assert party.got("limited") == []


def test_node_that_does_not_forward_keeps_clients_apart() -> None:
    party = Party(forwards=False)
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("pilot", disarm(FOREIGN), (255, 190))
    assert party.got("drone") == party.got("pilot") == []


@pytest.mark.parametrize(
    "message",
    [
        dialect.MAVLink_auth_key_message(b"open sesame"),
        dialect.MAVLink_wifi_config_ap_message(b"field", b"open sesame"),
        dialect.MAVLink_change_operator_control_message(OURS, 0, 0, b"open sesame"),
    ],
    ids=lambda message: message.get_type(),
)
def test_log_of_messages_names_no_password(message: Any, caplog: pytest.LogCaptureFixture) -> None:
    party = Party()
    with caplog.at_level("DEBUG"):
        party.send("pilot", message, (255, 190))
    assert message.get_type() in caplog.text
    assert "sesame" not in caplog.text
