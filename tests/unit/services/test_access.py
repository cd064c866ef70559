"""Access: the level of everything that a system handles is decided here, in writing."""

from __future__ import annotations

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import MAINTENANCE_COMMANDS, Access, needed_access
from anafi_mav.mavlink.frames import unpack
from anafi_mav.mavlink.node import Node
from anafi_mav.services.system import System

OBSERVE = [
    "AUTOPILOT_VERSION_REQUEST",
    "HEARTBEAT",
    "LOG_REQUEST_DATA",
    "LOG_REQUEST_END",
    "LOG_REQUEST_LIST",
    "MISSION_ACK",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST_PARTIAL_LIST",
    "PARAM_EXT_REQUEST_LIST",
    "PARAM_EXT_REQUEST_READ",
    "PARAM_REQUEST_LIST",
    "PARAM_REQUEST_READ",
    "PING",
    "REQUEST_DATA_STREAM",
    "REQUEST_EVENT",
    "TIMESYNC",
]

CONTROL = [
    "COMMAND_ACK",
    "COMMAND_CANCEL",
    "FOLLOW_TARGET",
    "GIMBAL_MANAGER_SET_ATTITUDE",
    "GIMBAL_MANAGER_SET_MANUAL_CONTROL",
    "GIMBAL_MANAGER_SET_PITCHYAW",
    "GLOBAL_POSITION_INT",
    "MANUAL_CONTROL",
    "MISSION_CLEAR_ALL",
    "MISSION_COUNT",
    "MISSION_ITEM",
    "MISSION_ITEM_INT",
    "MISSION_SET_CURRENT",
    "MISSION_WRITE_PARTIAL_LIST",
    "MOUNT_CONFIGURE",
    "MOUNT_CONTROL",
    "PARAM_EXT_SET",
    "PLAY_TUNE",
    "PLAY_TUNE_V2",
    "RC_CHANNELS_OVERRIDE",
    "SET_ATTITUDE_TARGET",
    "SET_GPS_GLOBAL_ORIGIN",
    "SET_MODE",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
]

ALL = ["LOG_ERASE", "PARAM_SET", "SERIAL_CONTROL"]

BY_CONTENT = ["COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL"]


@pytest.fixture
async def system() -> System:
    clock = SystemClock()
    return System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)


async def test_every_handled_message_has_a_decided_level(system: System) -> None:
    handled = {id for component in system.components for id in component._handlers}
    names = {dialect.mavlink_map[id].msgname: id for id in handled}
    assert sorted(names) == sorted([*OBSERVE, *CONTROL, *ALL, *BY_CONTENT])
    for level, group in ((Access.OBSERVE, OBSERVE), (Access.CONTROL, CONTROL), (Access.ALL, ALL)):
        for name in group:
            assert needed_access(unpack(names[name], b"\0")) is level, name


async def test_commands_that_act_need_control_and_queries_do_not(system: System) -> None:
    def needed(command: int) -> Access:
        return needed_access(dialect.MAVLink_command_long_message(1, 1, command, 0, 0, 0, 0, 0, 0, 0, 0))

    for component in system.components:
        queries = component.commands._queries.keys() - {dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL}
        assert {needed(command) for command in queries} == {Access.OBSERVE}
        for command in component.commands._actions:
            assert needed(command) is (Access.ALL if command in MAINTENANCE_COMMANDS else Access.CONTROL), command
    assert needed(60_000) is needed(dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL) is Access.CONTROL


@pytest.mark.parametrize(
    ("opcode", "level"),
    [
        *((opcode, Access.OBSERVE) for opcode in (0, 1, 2, 3, 4, 5, 14, 15, 16, 128, 129)),
        *((opcode, Access.CONTROL) for opcode in (6, 7, 11)),
        *((opcode, Access.ALL) for opcode in (8, 9, 10, 12, 13, 17, 99)),
    ],
)
def test_file_transfer_needs_the_level_of_its_opcode(opcode: int, level: Access) -> None:
    payload = bytes((0, 0, 0, opcode)).ljust(251, b"\0")
    assert needed_access(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, payload)) is level


def test_hash_check_writes_no_parameter_and_unknown_needs_control() -> None:
    for name, level in ((b"_HASH_CHECK", Access.OBSERVE), (b"ANF_MAX_TILT", Access.ALL)):
        kind = dialect.MAVLINK_MSG_ID_PARAM_SET
        assert needed_access(unpack(kind, bytes((0, 0, 0, 0, 1, 1)) + name)) is level
    assert needed_access(None) is Access.CONTROL
