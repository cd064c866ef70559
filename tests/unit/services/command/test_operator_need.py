"""The role that each message needs while a station is the operator: everything that a system handles stands here."""

from __future__ import annotations

import math
from typing import Any

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import unpack
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.services.command.operator_need import GIMBAL_COMMANDS, GIMBAL_MESSAGES, INPUT_MESSAGES, need_of
from anafi_mav.services.commands import Effect
from anafi_mav.services.gimbal.gimbal_service import GimbalService
from anafi_mav.services.system import System
from anafi_mav.vehicle.operator_control import Need

NOTHING, COMMAND = Need.NOTHING, Need.COMMAND

FREE = [
    "AUTOPILOT_VERSION_REQUEST",
    "COMMAND_ACK",
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

OF_THE_GIMBAL = [
    "GIMBAL_MANAGER_SET_ATTITUDE",
    "GIMBAL_MANAGER_SET_MANUAL_CONTROL",
    "GIMBAL_MANAGER_SET_PITCHYAW",
    "GLOBAL_POSITION_INT",
    "MOUNT_CONFIGURE",
    "MOUNT_CONTROL",
]

INPUTS = [
    "FOLLOW_TARGET",
    "MANUAL_CONTROL",
    "RC_CHANNELS_OVERRIDE",
    "SET_ATTITUDE_TARGET",
    "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_POSITION_TARGET_LOCAL_NED",
]

CHANGES = [
    "COMMAND_CANCEL",
    "LOG_ERASE",
    "MISSION_CLEAR_ALL",
    "MISSION_COUNT",
    "MISSION_ITEM",
    "MISSION_ITEM_INT",
    "MISSION_SET_CURRENT",
    "MISSION_WRITE_PARTIAL_LIST",
    "PARAM_EXT_SET",
    "PARAM_SET",
    "PLAY_TUNE",
    "PLAY_TUNE_V2",
    "SERIAL_CONTROL",
    "SET_GPS_GLOBAL_ORIGIN",
]

BY_CONTENT = ["COMMAND_INT", "COMMAND_LONG", "FILE_TRANSFER_PROTOCOL", "SET_MODE"]


@pytest.fixture
async def system() -> System:
    clock = SystemClock()
    return System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)


def inbound(message: Any, flavour: str = "px4") -> Inbound:
    channel = Channel("test", lambda data: None, options=EndpointOptions(flavour=flavour))
    return Inbound(message, message.get_msgId(), channel, 250, 190, 0.0)


def needed(system: System, message: Any, flavour: str = "px4", component: int = 0) -> Need:
    return need_of(inbound(message, flavour), system.components[component].commands.action_of)


def command(id: int, *params: float, x: float = math.nan, y: float = math.nan, z: float = math.nan) -> Any:
    filled = [*params, *([math.nan] * (4 - len(params)))]
    return dialect.MAVLink_command_long_message(1, 1, id, 0, *filled, x, y, z)


async def test_role_of_every_handled_message_is_decided(system: System) -> None:
    handled = {id for component in system.components for id in component._handlers}
    names = {dialect.mavlink_map[id].msgname: id for id in handled}
    assert sorted(names) == sorted([*FREE, *OF_THE_GIMBAL, *INPUTS, *CHANGES, *BY_CONTENT])
    for need, group in ((NOTHING, [*FREE, *OF_THE_GIMBAL, *INPUTS]), (COMMAND, CHANGES)):
        for name in group:
            assert needed(system, unpack(names[name], b"\0")) is need, name


async def test_inputs_and_gimbal_are_those_of_their_services(system: System) -> None:
    assert {dialect.mavlink_map[id].msgname for id in INPUT_MESSAGES} == set(INPUTS)
    (gimbal,) = [service for service in system.services if isinstance(service, GimbalService)]
    assert gimbal.messages().keys() == GIMBAL_MESSAGES
    assert gimbal.actions().keys() == GIMBAL_COMMANDS


STOPS = {
    "px4": [
        *(command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, sub) for sub in (3, 5, 6)),  # Hold, Return, Land
        command(dialect.MAV_CMD_DO_SET_MODE, 1, 3, 0),  # Position
        command(dialect.MAV_CMD_DO_SET_STANDARD_MODE, dialect.MAV_STANDARD_MODE_SAFE_RECOVERY),
        command(dialect.MAV_CMD_DO_SET_STANDARD_MODE, dialect.MAV_STANDARD_MODE_LAND),
        dialect.MAVLink_set_mode_message(1, 1, 0x03040000),
        dialect.MAVLink_set_mode_message(1, 1, 0x05040000),
        dialect.MAVLink_set_mode_message(1, 1, 0x06040000),
        dialect.MAVLink_set_mode_message(1, 1, 0x00030000),
    ],
    "ardupilot": [
        *(command(dialect.MAV_CMD_DO_SET_MODE, 1, mode) for mode in (17, 5, 6, 9)),  # Brake, Loiter, RTL, Land
        *(dialect.MAVLink_set_mode_message(1, 1, mode) for mode in (17, 5, 6, 9)),
    ],
}

OF_BOTH = [
    command(dialect.MAV_CMD_NAV_LAND),
    command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0),
    command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0),
    command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0),
    command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196),
    command(dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1),
]


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_stop_of_flight_needs_no_role(system: System, flavour: str) -> None:
    for stop in (*OF_BOTH, *STOPS[flavour]):
        assert needed(system, stop, flavour) is NOTHING, stop


async def test_command_that_begins_something_needs_a_role(system: System) -> None:
    px4 = [
        command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 1),
        command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, x=48.0, y=2.0, z=50.0),
        command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1),
        *(command(dialect.MAV_CMD_DO_SET_MODE, 1, main, sub) for main, sub in ((6, 0), (4, 4), (4, 2), (4, 8), (9, 9))),
        dialect.MAVLink_set_mode_message(1, 1, 0x00060000),
        dialect.MAVLink_set_mode_message(1, 1, 0x04040000),
        dialect.MAVLink_set_mode_message(1, 1, 0x7F000000),
    ]
    for message in px4:
        assert needed(system, message) is COMMAND, message
    for mode in (4, 3):  # Guided, Auto
        assert needed(system, command(dialect.MAV_CMD_DO_SET_MODE, 1, mode), "ardupilot") is COMMAND
        assert needed(system, dialect.MAVLink_set_mode_message(1, 1, mode), "ardupilot") is COMMAND


@pytest.mark.parametrize(
    ("message", "effect"),
    [
        (dialect.MAVLink_set_mode_message(1, 1, 0x03040000), Effect.HOLD),
        (dialect.MAVLink_set_mode_message(1, 1, 0x00030000), Effect.HOLD),
        (dialect.MAVLink_set_mode_message(1, 1, 0x06040000), Effect.LAND),
        (dialect.MAVLink_set_mode_message(1, 1, 0x05040000), Effect.RETURN),
        (dialect.MAVLink_set_mode_message(1, 1, 0x04040000), None),
        (dialect.MAVLink_set_mode_message(1, 1, 0x7F000000), None),
        (command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3), Effect.HOLD),
        (command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4), None),
        (command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0), Effect.HOLD),
        (command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 1), None),
        (command(dialect.MAV_CMD_NAV_LAND), Effect.LAND),
        (command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0), Effect.STOP),
        (command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196), Effect.KILL),
        (command(dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1), Effect.KILL),
        (command(dialect.MAV_CMD_REQUEST_MESSAGE, 148), None),
        (command(dialect.MAV_CMD_DO_SET_ROI_NONE), None),
        (command(dialect.MAV_CMD_VIDEO_STOP_CAPTURE), None),
        (dialect.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0), None),
    ],
)
async def test_stop_of_flight_is_a_command_or_a_mode(system: System, message: Any, effect: Effect | None) -> None:
    assert system.stop_of(inbound(message)) is effect


async def test_every_other_action_needs_a_role_and_no_query_does(system: System) -> None:
    stops = {dialect.MAV_CMD_NAV_LAND, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LOITER_UNLIM}
    free = set(GIMBAL_COMMANDS) | stops
    stops_unset = {dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_FLIGHTTERMINATION}
    for index, component in enumerate(system.components):
        for id in component.commands._queries:
            assert needed(system, command(id), component=index) is NOTHING, id
        for id in component.commands._actions.keys() - free - stops_unset:
            assert needed(system, command(id), component=index) is COMMAND, id
    assert needed(system, command(60_000)) is NOTHING  # it is answered as unsupported


async def test_command_int_is_read_as_command_long(system: System) -> None:
    def message(action: float) -> Any:
        return dialect.MAVLink_command_int_message(
            1, 1, 0, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, action, 0.0, 0.0, 0.0, 0, 0, 0.0
        )

    assert needed(system, message(0.0)) is NOTHING
    assert needed(system, message(1.0)) is COMMAND


@pytest.mark.parametrize(("opcode", "need"), [(4, NOTHING), (15, NOTHING), (6, COMMAND), (7, COMMAND), (8, COMMAND)])
async def test_file_that_is_written_needs_a_role(system: System, opcode: int, need: Need) -> None:
    payload = bytes((0, 0, 0, opcode)).ljust(251, b"\0")
    assert needed(system, dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, payload)) is need
