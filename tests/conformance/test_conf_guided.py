"""Guided flight by single commands: conformance items 29, 31, 80-83, 143 and both flavours' take-off (20-22)."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import CANCELLED, IN_PROGRESS, another_controller, return_by_itself
from support.flavours import both
from support.missions import put, start, takeoff, way
from support.params import write
from support.setpoints import NO_YAW_RATE, VELOCITY_ONLY, engage, local, streaming, texts
from support.world import ARMED, HOME, World, world

from anafi_mav import geo, units
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.mavlink import dialect as newer
from anafi_mav.vehicle.base.requester import Source

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
REPOSITION = dialect.MAV_CMD_DO_REPOSITION
SPEED = dialect.MAV_CMD_DO_CHANGE_SPEED
CHANGE_MODE = dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
RELATIVE_YAW = newer.MAV_DO_REPOSITION_FLAGS_RELATIVE_YAW
YAW = dialect.MAV_CMD_CONDITION_YAW
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
ALTITUDE = dialect.MAV_CMD_DO_CHANGE_ALTITUDE
SET_HOME = dialect.MAV_CMD_DO_SET_HOME
ROI, NO_ROI, OLD_ROI = (
    dialect.MAV_CMD_DO_SET_ROI_LOCATION,
    dialect.MAV_CMD_DO_SET_ROI_NONE,
    dialect.MAV_CMD_DO_SET_ROI,
)
MOVE_TO = "ardrone3.Piloting.moveTo"
GLOBAL, RELATIVE = dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
NAN = math.nan

NORTH_60 = geo.destination(HOME[0], HOME[1], 60.0, 0.0)
"""60 m north of where the drone takes off."""


def sent(w: World, name: str) -> list[Any]:
    """The arguments of what the drone received under Parrot's name."""
    return [e.args for e in w.drone.log if e.kind == "command" and e.name == name]


async def go_north(w: World, frame: int = RELATIVE, z: float = 10.0) -> None:
    ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=frame, x=NORTH_60[0], y=NORTH_60[1], z=z)
    assert ack.result == ACCEPTED


async def heading(w: World, degrees: float) -> None:
    """The drone's true heading has come to this."""
    wanted = degrees * units.RAD_PER_DEG
    await w.drone.wait_log(
        lambda e: e.kind == "pose" and abs(units.wrap_pi(e.args["yaw"] - wanted)) < 0.05,
        20.0,
        since=w.drone.log[-1].t,
    )


# -- take-off


@pytest.mark.parametrize(
    ("parameters", "z", "up"),
    [
        ({"x": 0.0, "y": 0.0}, 4.0, 4.0),  # MAVProxy, dronekit, Mission Planner
        ({"x": NAN, "y": NAN}, 4.0, 4.0),  # MAVSDK on ArduPilot
        ({"x": HOME[0], "y": HOME[1], "frame": RELATIVE}, 4.0, 4.0),
        ({"x": HOME[0], "y": HOME[1], "frame": GLOBAL}, HOME[2] + 6.0, 6.0),
    ],
)
async def test_conf_021_take_off_heights_of_arducopter(parameters: dict[str, Any], z: float, up: float) -> None:
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, z=z, **parameters)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - up) < 0.2, 20.0)


# -- speed, height, heading, pause


@both
async def test_conf_082_speed_command_changes_the_running_move(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(10.0)
        await go_north(w)
        assert len(sent(w, "ardrone3.Piloting.moveTo")) == 1
        assert (await w.client.command(SPEED, 1, 3.0, -1, 0)).result == ACCEPTED
        (move,) = sent(w, "move.extended_move_to")
        assert move["max_horizontal_speed"] == 3.0
        assert (move["latitude"], move["longitude"]) == pytest.approx(NORTH_60, abs=1e-7)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(math.hypot(e.args["vn"], e.args["ve"]) - 3.0) < 0.2)
        # Unchanged by "no change", given back by "default".
        for nothing in (-1.0, NAN):
            assert (await w.client.command(SPEED, 1, nothing, -1, 0)).result == ACCEPTED
        assert len(sent(w, "move.extended_move_to")) == 1
        assert (await w.client.command(SPEED, 0, -2.0, -1, 0)).result == ACCEPTED
        assert len(sent(w, "ardrone3.Piloting.moveTo")) == 2


@both
async def test_conf_082_hold_that_arrives_with_a_change_of_speed_stops_the_move(flavour: str) -> None:
    """A parameter and a Hold in one segment: the move that is to change its speed ends."""
    async with world(flavour=flavour, speed=1.0) as w:
        await w.take_off(10.0)
        await go_north(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
        moves, mark = len(sent(w, "move.extended_move_to")), w.client.mark()
        speed = dialect.MAVLink_param_set_message(1, 1, b"ANF_CRUISE_SPEED", 4.0, dialect.MAV_PARAM_TYPE_REAL32)
        hold = dialect.MAVLink_command_long_message(1, 1, PAUSE, 0, 0, 0, 0, 0, 0, 0, 0)
        w.client.send_raw(w.client.pack(speed) + w.client.pack(hold))
        ack = await w.client.wait("COMMAND_ACK", lambda m: m.result != IN_PROGRESS, since=mark)
        assert (ack.command, ack.result) == (PAUSE, ACCEPTED)
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=w.drone.log[-1].t + 1.0
        )
        assert len(sent(w, "move.extended_move_to")) == moves
        assert w.drone.pose.north < 40.0


@both
async def test_conf_082_goto_repeated_after_a_parameter_has_changed_its_speed_is_accepted(flavour: str) -> None:
    """The acknowledgement was lost, and the drone flies there: it is no other client's goto that flies."""
    async with world(flavour=flavour, speed=1.0) as w:
        await w.take_off(10.0)
        await go_north(w)
        await write(w.client, "ANF_CRUISE_SPEED", 4.0, flavour=flavour)
        await w.drone.wait_log(lambda e: e.name == "move.extended_move_to")
        await go_north(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 30.0, 20.0)


@both
async def test_conf_082_a_speed_counts_for_later_moves_too(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        assert (await w.client.command(SPEED, 0, 4.0, 0, 0)).result == ACCEPTED
        assert (await w.client.command(SPEED, 2, 1.5, 0, 0)).result == ACCEPTED
        await w.take_off(5.0)
        await go_north(w)
        (move,) = sent(w, "move.extended_move_to")
        assert (move["max_horizontal_speed"], move["max_vertical_speed"]) == (4.0, 1.5)


@both
async def test_conf_082_commanded_speed_ends_with_the_landing(flavour: str) -> None:
    """The next flight, of another program perhaps, has the speeds of the parameters."""
    async with world(flavour=flavour) as w:
        await write(w.client, "ANF_CRUISE_SPEED", 2.0, flavour=flavour)
        await w.take_off(5.0)
        assert (await w.client.command(SPEED, 1, 12.0, -1, 0)).result == ACCEPTED
        assert (await w.client.command(SPEED, 2, 3.0, -1, 0)).result == ACCEPTED
        await go_north(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=30.0)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"ANF_CRUISE_SPEED", -1))
        value = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_CRUISE_SPEED", since=mark)
        assert value.param_value == 2.0
        if flavour == "ardupilot":
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, w.modes.hold)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: w.drone.pose.up > 4.7, 30.0)
        await go_north(w)
        first, second = sent(w, "move.extended_move_to")
        assert (first["max_horizontal_speed"], first["max_vertical_speed"]) == (12.0, 3.0)
        assert second["max_horizontal_speed"] == 2.0
        assert second["max_vertical_speed"] == w.drone.firmware.settings.number("max_vertical_speed")


@both
@pytest.mark.parametrize("mode", ["mission", "return", "landing"])
async def test_conf_082_speed_of_what_the_drone_flies_alone_is_refused(flavour: str, mode: str) -> None:
    """No command changes it: ACCEPTED would promise a speed that is not flown."""
    async with world(flavour=flavour, web=True) as w:
        if mode == "mission":
            await put(w, [takeoff(10.0), way(60.0, 0.0, 10.0)])
            await start(w)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 30.0)
        else:
            await w.take_off(10.0)
            await go_north(w)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 20.0)
            command = dialect.MAV_CMD_NAV_LAND if mode == "landing" else dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
            assert (await w.client.command(command)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(SPEED, 1, 3.0, -1, 0)).result == REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Speed refused: fixed in mode "), since=mark)


@pytest.mark.parametrize(
    "parameters", [(1, 0.0, -1), (1, -3.0, -1), (1, math.inf, -1), (7, 3.0, -1), (1, 3.0, 50.0), (math.inf, 3.0, -1)]
)
@both
async def test_conf_082_invalid_speeds_are_refused(flavour: str, parameters: tuple[float, ...]) -> None:
    async with world(flavour=flavour) as w:
        assert (await w.client.command(SPEED, *parameters)).result == DENIED


async def test_conf_143_change_of_altitude() -> None:
    async with world() as w:
        await w.take_off(5.0)
        assert (await w.client.command(ALTITUDE, 12.0, RELATIVE)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["up"] - 12.0) < 0.3, 20.0)
        assert (await w.client.command(ALTITUDE, HOME[2] + 8.0, GLOBAL)).result == ACCEPTED
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and abs(e.args["up"] - 8.0) < 0.3, 20.0, since=w.drone.log[-1].t
        )
        for bad in ((0.5, RELATIVE), (1000.0, RELATIVE), (NAN, RELATIVE), (10.0, NAN)):
            assert (await w.client.command(ALTITUDE, *bad)).result == DENIED
        ack = await w.client.command(ALTITUDE, 10.0, dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT)
        assert ack.result == 9  # COMMAND_UNSUPPORTED_MAV_FRAME
        await go_north(w, z=8.0)
        assert (await w.client.command(ALTITUDE, 15.0, RELATIVE)).result == ACCEPTED
        last = sent(w, "ardrone3.Piloting.moveTo")[-1]
        assert (last["latitude"], last["altitude"]) == (pytest.approx(NORTH_60[0], abs=1e-7), 15.0)


@pytest.mark.parametrize(
    ("parameters", "ends"),
    [((90, 0, 0, 0), 90.0), ((350, 30, 0, 0), 350.0), ((40, 0, -1, 1), 320.0), ((40, 0, 1, 1), 40.0)],
)
async def test_conf_143_condition_yaw(parameters: tuple[float, ...], ends: float) -> None:
    async with world() as w:
        await w.take_off(5.0)
        assert (await w.client.command(YAW, *parameters, timeout=20.0)).result == ACCEPTED
        await heading(w, ends)


async def test_conf_143_condition_yaw_turns_in_the_requested_direction() -> None:
    async with world() as w:
        await w.take_off(5.0)
        assert (await w.client.command(YAW, 90, 60, -1, 0, timeout=20.0)).result == ACCEPTED
        (move,) = sent(w, "move.extended_move_by")
        assert move["d_psi"] == pytest.approx(-1.5 * math.pi, abs=0.05)
        assert move["max_yaw_rotation_speed"] == 60.0


@both
async def test_conf_143_condition_yaw_of_a_turning_drone_ends_at_the_heading(flavour: str) -> None:
    """A stream has turned it to the left since its last report of the heading."""
    async with world(flavour=flavour, telemetry_rate=1.0) as w:
        await w.take_off(5.0)
        turning = local(VELOCITY_ONLY & ~NO_YAW_RATE, yaw_rate=-0.6)
        async with streaming(w.client, turning):
            await engage(w.client, flavour)
            reported = (await w.client.wait("ATTITUDE", lambda m: -2.0 < m.yaw < -0.6)).yaw
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["yaw"] < reported - 0.25)
        assert (await w.client.command(YAW, 90, 0, 0, 0, timeout=20.0)).result == ACCEPTED
        assert w.drone.pose.yaw * units.DEG_PER_RAD == pytest.approx(90.0, abs=2.0)


@pytest.mark.parametrize("name", ["ANF_CRUISE_SPEED", "ANF_CLIMB_SPEED"])
async def test_conf_082_speed_at_which_no_move_would_end_is_not_set(name: str) -> None:
    """As in the command, whose least is 0.1 m/s; 0 is the drone's own speed."""
    async with world() as w:
        for value, kept in ((2.0, 2.0), (0.01, 2.0), (0.0, 0.0)):
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
            await w.client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark)
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
            assert (await w.client.wait("PARAM_VALUE", lambda m: m.param_id == name, since=mark)).param_value == kept


@pytest.mark.parametrize("reference", [3.0, 0.5, -1.0, math.inf])
async def test_conf_143_condition_yaw_of_an_unknown_reference_is_denied(reference: float) -> None:
    """Taken for absolute it would turn the wrong way; ArduCopter refuses it too."""
    async with world() as w:
        await w.take_off(5.0)
        assert (await w.client.command(YAW, 90, 60, 1, reference)).result == DENIED
        assert sent(w, "move.extended_move_by") == []


async def test_conf_143_relative_yaw_sent_twice_turns_twice() -> None:
    """A person means each of two equal turns by an angle; one with a confirmation is a retransmission."""
    async with world() as w:
        await w.take_off(5.0)
        for _ in range(2):
            assert (await w.client.command(YAW, 30, 0, 1, 1, timeout=20.0)).result == ACCEPTED
        await heading(w, 60.0)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_command_long_message(1, 1, YAW, 1, 30, 0, 1, 1, NAN, NAN, NAN))
        assert (await w.client.wait("COMMAND_ACK", lambda m: m.command == YAW, since=mark)).result == ACCEPTED
        # The climb to 5 m and two turns.
        assert len([move for move in sent(w, "ardrone3.Piloting.moveBy") if any(move.values())]) == 3


async def test_conf_143_reposition_by_relative_yaw_sent_twice_turns_twice() -> None:
    """A COMMAND_INT has no confirmation: two equal turns by an angle are two, as in PX4 and ArduCopter."""
    async with world() as w:
        await w.take_off(5.0)
        for wanted, margin in ((30.0, 0.03), (60.0, 0.05)):
            mark, turn = w.client.mark(), (-1, CHANGE_MODE | RELATIVE_YAW, 0, 30.0 * units.RAD_PER_DEG)
            assert (await w.client.command(REPOSITION, *turn, frame=RELATIVE)).result == ACCEPTED
            yaw = wanted * units.RAD_PER_DEG
            await w.client.wait("ATTITUDE", lambda m, yaw=yaw, margin=margin: abs(m.yaw - yaw) < margin, since=mark)


async def test_conf_143_relative_yaw_can_be_cancelled() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        w.client.send_command(YAW, 180, 10, 1, 1)
        await w.drone.wait_log(lambda e: e.name.endswith("extended_move_by"))
        w.client.send(newer.MAVLink_command_cancel_message(1, 1, YAW))
        ack = await w.client.wait("COMMAND_ACK", lambda m: m.command == YAW and m.result != IN_PROGRESS, since=mark)
        assert ack.result == CANCELLED


async def test_conf_143_condition_yaw_on_the_way() -> None:
    async with world() as w:
        await w.take_off(10.0)
        await go_north(w)
        assert (await w.client.command(YAW, 90, 0, 0, 0)).result == ACCEPTED
        last = sent(w, "ardrone3.Piloting.moveTo")[-1]
        assert (last["latitude"], last["heading"]) == (pytest.approx(NORTH_60[0], abs=1e-7), pytest.approx(90.0))


async def test_conf_143_pause_and_continue() -> None:
    async with world() as w:
        assert (await w.client.command(PAUSE, 1)).result == REJECTED  # nothing was paused
        await w.take_off(10.0)
        await go_north(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", since=w.drone.log[-1].t - 1)
        stopped = w.drone.pose.north
        assert stopped < 50.0
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["north"] - 60.0) < 1.0, 30.0)
        assert (await w.client.command(PAUSE, 1)).result == REJECTED


async def test_conf_081_zero_heading_is_north_for_px4_ignored_for_arducopter() -> None:
    for flavour, headings in (("px4", [("HEADING_DURING", 0.0)]), ("ardupilot", [("NONE", 0.0)])):
        async with world(flavour=flavour) as w:
            assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
            assert (await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 4.5, 20.0)
            ack = await w.client.command(
                REPOSITION, -1, 1, 0, 0.0, frame=RELATIVE, x=NORTH_60[0], y=NORTH_60[1], z=10.0
            )
            assert ack.result == ACCEPTED
            moves = sent(w, "ardrone3.Piloting.moveTo")
            assert [(m["orientation_mode"].name, m["heading"]) for m in moves] == headings


# -- regions of interest


@pytest.mark.parametrize(("frame", "z"), [(GLOBAL, HOME[2] + 2.0), (RELATIVE, HOME[2] + 2.0), (None, HOME[2] + 2.0)])
async def test_conf_080_region_of_interest(frame: int | None, z: float) -> None:
    """East of the drone and below it: nose to the east, camera down. z is AMSL in every frame (conformance B1)."""
    east = geo.destination(HOME[0], HOME[1], 0.0, 20.0)
    async with world() as w:
        await w.take_off(22.0)
        ack = await w.client.command(ROI, frame=frame, x=east[0], y=east[1], z=z)
        assert ack.result == ACCEPTED
        (poi,) = sent(w, "ardrone3.Piloting.StartPilotedPOIV2")
        assert poi["altitude"] == pytest.approx(2.0, abs=0.01)
        await heading(w, 90.0)
        # 20 m away and 20 m below.
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["gimbal_pitch"] + 45.0) < 2.0, 10.0)
        assert (await w.client.command(NO_ROI, frame=GLOBAL, x=NAN, y=NAN, z=NAN)).result == ACCEPTED
        assert len(sent(w, "ardrone3.Piloting.StopPilotedPOI")) == 1


async def test_conf_080_region_of_interest_of_older_clients() -> None:
    """Mission Planner: DO_SET_ROI as INT in frame 0; MAVProxy clears it with 0/0."""
    east = geo.destination(HOME[0], HOME[1], 0.0, 20.0)
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 4.8, 20.0)
        await w.client.heartbeat(lambda beat: True)
        location = dialect.MAV_ROI_LOCATION
        ack = await w.client.command(OLD_ROI, location, frame=GLOBAL, x=east[0], y=east[1], z=HOME[2])
        assert ack.result == ACCEPTED
        await heading(w, 90.0)
        assert (await w.client.command(OLD_ROI, location, frame=GLOBAL, x=0.0, y=0.0, z=0.0)).result == ACCEPTED
        assert (await w.client.command(OLD_ROI, dialect.MAV_ROI_TARGET, x=1.0, y=1.0, z=0.0)).result == DENIED


async def test_conf_080_no_region_of_interest_on_the_ground() -> None:
    async with world() as w:
        assert (await w.client.command(ROI, x=NORTH_60[0], y=NORTH_60[1], z=HOME[2])).result == REJECTED
        assert (await w.client.command(ROI, x=NAN, y=NAN, z=HOME[2])).result == DENIED


# -- home


@pytest.mark.parametrize("frame", [GLOBAL, RELATIVE, None])
@both
async def test_conf_083_set_home(flavour: str, frame: int | None) -> None:
    """PX4 takes z as AMSL in every frame, and MAVSDK counts on it (conformance B1); ArduPilot goes by the frame."""
    z = 3.0 if (flavour, frame) == ("ardupilot", RELATIVE) else HOME[2] + 3.0
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        ack = await w.client.command(SET_HOME, 0, frame=frame, x=NORTH_60[0], y=NORTH_60[1], z=z)
        assert ack.result == ACCEPTED
        near = 40 if frame is None else 1  # 1e-7 deg; a COMMAND_LONG has single precision
        observed = await w.client.wait(
            "HOME_POSITION", lambda m: abs(m.latitude - round(NORTH_60[0] * 1e7)) <= near, since=mark, timeout=1.0
        )
        assert abs(observed.longitude - round(NORTH_60[1] * 1e7)) <= near
        (custom,) = sent(w, "rth.set_custom_location")
        assert custom["altitude"] == pytest.approx(3.0, abs=0.01)


@both
async def test_conf_083_set_home_here_and_nowhere(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        await go_north(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 30.0, 30.0)
        mark = w.client.mark()
        assert (await w.client.command(SET_HOME, 1)).result == ACCEPTED
        await w.client.wait(
            "HOME_POSITION",
            lambda m: geo.distance(HOME[0], HOME[1], m.latitude / 1e7, m.longitude / 1e7) > 20.0,
            since=mark,
            timeout=1.0,
        )
        assert (await w.client.command(SET_HOME, 0, x=0.0, y=0.0, z=HOME[2])).result == DENIED
        assert (await w.client.command(SET_HOME, 0)).result == DENIED
        assert (await w.client.heartbeat(lambda beat: True)).custom_mode == w.modes.hold


@both
@pytest.mark.parametrize("end", ["landing", "return", "pilot"])
async def test_turn_that_something_else_ends_has_failed(flavour: str, end: str) -> None:
    """The turn had begun, so that it was not refused: a landing or return of the drone's own, or the pilot's stick."""
    async with world(flavour=flavour, skycontroller=3 if end == "pilot" else None) as w:
        await w.take_off(8.0)
        mark, yaw = w.client.mark(), w.drone.pose.yaw
        w.client.send_command(dialect.MAV_CMD_CONDITION_YAW, 170.0, 10.0, 1.0, 1.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(w.drone.pose.yaw - yaw) > 0.2, 20.0)
        pilot = w.drone.skycontroller
        if end == "landing":
            another_controller(w, ardrone3.Landing())
        elif end == "return":
            return_by_itself(w)
        elif pilot is not None:
            pilot.stick(3, 40)
        ack = await w.client.wait(
            "COMMAND_ACK",
            lambda m: m.command == dialect.MAV_CMD_CONDITION_YAW and m.result != 5,
            since=mark,
            timeout=20.0,
        )
        assert ack.result == dialect.MAV_RESULT_FAILED
        reason = {"landing": "drone is landing", "return": "drone is returning", "pilot": "Skycontroller pilot"}[end]
        assert any(text.startswith(f"Turn failed: {reason}") for text in texts(w.client, mark))


async def test_height_commanded_as_a_move_ends_is_flown_at_its_target() -> None:
    """The command is read before the end of the move, in one event-loop iteration, and carried out after it."""
    async with world() as w:
        await w.take_off(10.0)
        system, commands = w.gateway.systems[0], []

        def command(event: Message) -> None:
            """A task of before the event runs before what the event itself makes run."""
            if (
                isinstance(event, ardrone3.MoveToChanged)
                and event.status == ardrone3.MoveToStatus.DONE
                and not commands
            ):
                work = system.vehicle.guided.reposition(None, 5.0, None, by=Source.GATEWAY)
                commands.append(asyncio.create_task(work))

        system.drone.on_event = command
        await go_north(w)
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 30.0)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == MOVE_TO and e.args["altitude"] == 5.0)
        await commands[0]
        places = [(geo.distance(*NORTH_60, m["latitude"], m["longitude"]), m["altitude"]) for m in sent(w, MOVE_TO)]
        assert [(pytest.approx(0.0, abs=0.1), 10.0), (pytest.approx(0.0, abs=0.1), 5.0)] == places
