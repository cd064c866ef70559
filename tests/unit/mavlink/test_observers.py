"""What the frames of an observer do to other clients: they neither deceive nor block them."""

from __future__ import annotations

from typing import Any

import pytest
from support.node_party import DRONE, FOREIGN, OURS, STATION, Party

from anafi_mav.mavlink import dialect

LIE = dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_CRITICAL, b"Battery critical: land now")
LAND = dialect.MAVLink_command_long_message(FOREIGN, 1, dialect.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
LIST = dialect.MAVLink_param_request_list_message(FOREIGN, 1)


def command(id: int) -> Any:
    return dialect.MAVLink_command_long_message(FOREIGN, 1, id, 0, dialect.MAVLINK_MSG_ID_ATTITUDE, -1, 0, 0, 0, 0, 0)


def file_request(opcode: int) -> Any:
    return dialect.MAVLink_file_transfer_protocol_message(0, FOREIGN, 1, bytes((0, 0, 0, opcode)).ljust(251, b"\0"))


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
def test_observer_sends_other_clients_nothing_false(message: Any, source: tuple[int, int]) -> None:
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


@pytest.mark.parametrize(
    "message",
    [
        *(
            command(number)
            for number in (
                dialect.MAV_CMD_DO_SET_PARAMETER,
                dialect.MAV_CMD_PREFLIGHT_SET_SENSOR_OFFSETS,
                dialect.MAV_CMD_FIXED_MAG_CAL_YAW,
                dialect.MAV_CMD_FLASH_BOOTLOADER,
            )
        ),
        dialect.MAVLink_param_map_rc_message(FOREIGN, 1, b"ATC_RAT_RLL_P", -1, 1, 0.1, 1.0, 0.0, 1.0),
        dialect.MAVLink_can_frame_message(FOREIGN, 1, 0, 8, 1, bytes(8)),
        file_request(dialect.MAV_FTP_OPCODE_CREATEFILE),
        file_request(dialect.MAV_FTP_OPCODE_WRITEFILE),
        file_request(dialect.MAV_FTP_OPCODE_OPENFILEWO),
    ],
)
def test_flyer_without_maintenance_changes_no_setting_of_a_foreign_system(message: Any) -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("flyer", LAND, (255, 190))
    party.send("flyer", message, (255, 190), seq=1)
    assert party.got("drone") == [("COMMAND_LONG", 255, 190)]
    assert party.node.counters()["refused_access"] == 1


def test_flyer_uploads_plans_to_our_own_system() -> None:
    party = Party()
    upload = dialect.MAVLink_file_transfer_protocol_message(0, OURS, 1, bytes((0, 0, 0, 6)).ljust(251, b"\0"))
    party.send("flyer", upload, (255, 190))
    assert party.node.counters()["refused_access"] == 0


def test_observers_copy_does_not_stop_a_pilots_command() -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("observer", LAND, (255, 190), seq=7)
    party.send("pilot", LAND, (255, 190), seq=7)
    assert party.got("drone") == [("COMMAND_LONG", 255, 190)]


@pytest.mark.parametrize(
    "message",
    [
        command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL),
        command(dialect.MAV_CMD_CONTROL_HIGH_LATENCY),
        dialect.MAVLink_request_data_stream_message(FOREIGN, 1, dialect.MAV_DATA_STREAM_ALL, 0, 0),
        dialect.MAVLink_param_set_message(FOREIGN, 1, b"_HASH_CHECK", 0.0, dialect.MAV_PARAM_TYPE_UINT32),
        dialect.MAVLink_log_request_end_message(FOREIGN, 1),
        file_request(dialect.MAV_FTP_OPCODE_RESETSESSION),
        file_request(dialect.MAV_FTP_OPCODE_TERMINATESESSION),
    ],
    ids=lambda message: message.get_type(),
)
def test_observer_changes_no_link_of_a_foreign_system(message: Any) -> None:
    """That system has one link to the gateway: its rates and sessions are those of the pilot, too."""
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("observer", message, (200, 190))
    assert party.got("drone") == []
    party.send("pilot", message, (255, 190))
    assert party.got("drone") == [(message.get_type(), 255, 190)]


def test_observer_reads_messages_and_files_of_a_foreign_system() -> None:
    party = Party()
    party.send("drone", DRONE, (FOREIGN, 1))
    party.send("observer", command(dialect.MAV_CMD_REQUEST_MESSAGE), (200, 190))
    party.send("observer", file_request(dialect.MAV_FTP_OPCODE_LISTDIRECTORY), (200, 190), seq=1)
    assert party.got("drone") == [("COMMAND_LONG", 200, 190), ("FILE_TRANSFER_PROTOCOL", 200, 190)]


def test_observer_gets_no_command_to_a_drone_that_is_not_connected() -> None:
    """In the name of that drone it would: its pilot would get no answer, and no connection for a command."""
    party, absent = Party(), []
    party.node.add_absent_host(7, lambda inbound: absent.append(inbound.message.get_type()))
    party.send("observer", STATION, (7, 1))
    land = dialect.MAVLink_command_long_message(7, 1, dialect.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0, 0)
    party.send("pilot", land, (255, 190))
    assert absent == ["COMMAND_LONG"]
    assert party.got("observer") == []


def test_observer_gets_no_answer_to_another_client() -> None:
    party = Party()
    party.send("pilot", STATION, (255, 190))
    party.send("observer", STATION, (255, 190), seq=3)
    party.got("observer")
    value = dialect.MAVLink_command_ack_message(dialect.MAV_CMD_NAV_LAND, 0, 0, 0, 255, 190)
    party.send("drone", value, (FOREIGN, 1))
    assert party.got("pilot") == [("COMMAND_ACK", FOREIGN, 1)]
    assert party.got("observer") == []
