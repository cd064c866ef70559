"""Items 19-33 of the conformance list: take-off by every client's convention, modes, goto, landing."""

from __future__ import annotations

import asyncio
import itertools
import math
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import NAN
from support.params import value_of, write
from support.world import ARMED, HOLD, HOME, LAND, POSITION, RETURN, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.mavlink import dialect as newer
from anafi_mav.vehicle.takeoff import ARM_WAIT, AUTO_DISARM

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
ARM, TAKE_OFF, REPOSITION, SET_MODE = (
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
    dialect.MAV_CMD_NAV_TAKEOFF,
    dialect.MAV_CMD_DO_REPOSITION,
    dialect.MAV_CMD_DO_SET_MODE,
)
FLAVOURS = ("px4", "ardupilot")


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_019_takeoff_before_arming(flavour: str) -> None:
    """QGroundControl: take-off while disarmed, then arm. The height is AMSL to PX4, above ground to ArduCopter."""
    async with world(flavour=flavour) as w:
        z = 8.0 if flavour == "ardupilot" else HOME[2] + 8.0
        ack = await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN, z=z)
        assert ack.result == ACCEPTED
        assert w.drone.flying_state.name == "LANDED"
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 20.0)
        assert abs(w.drone.pose.up - 8.0) < 0.5


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_disarm_withdraws_a_waiting_takeoff(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        assert (await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN)).result == ACCEPTED
        assert (await w.client.command(ARM, 0)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        assert w.commands("ardrone3.Piloting.TakeOff") == []


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_takeoff_without_arming_expires(flavour: str) -> None:
    """QGroundControl arms as soon as its take-off is accepted; who arms after ARM_WAIT wants something else."""
    async with world(flavour=flavour) as w:
        mark, began = w.client.mark(), time.monotonic()
        assert (await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN)).result == ACCEPTED
        text = "Takeoff cancelled: not armed within 10 s"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark, timeout=ARM_WAIT + 5.0)
        assert ARM_WAIT <= time.monotonic() - began < ARM_WAIT + 0.5
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.base_mode & ARMED, since=mark)
        await w.client.wait("HEARTBEAT")
        assert w.commands("ardrone3.Piloting.TakeOff") == []
        assert w.drone.flying_state.name == "LANDED"


async def test_takeoff_before_arming_that_the_drone_ends_is_reported() -> None:
    """Motors that stop again fail the take-off; the next one waits for arming, and is flown."""
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        w.drone.firmware.receive(ardrone3.UserTakeOff(0), asyncio.get_running_loop().time())
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Takeoff failed: "), since=mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
        assert (await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 30.0)
        assert abs(w.drone.pose.up - 2.5) < 0.5


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_climb_that_another_controller_ends_is_reported_as_aborted(flavour: str) -> None:
    """The drone hovers where it is, and the vehicle is usable at once."""
    async with world(flavour=flavour) as w:
        if flavour == "ardupilot":
            assert (await w.client.command(SET_MODE, 1, w.modes.hold)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("moveBy"), 20.0)
        await w.drone.wait_log(lambda e: w.drone.pose.up > 4.0, 20.0)
        w.drone.firmware.receive(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0), asyncio.get_running_loop().time())
        text = "Climb to 20 m aborted: the move was interrupted"
        aborted = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Climb to "), since=mark)
        assert (aborted.text, aborted.severity) == (text, dialect.MAV_SEVERITY_ERROR)
        await w.client.heartbeat(lambda beat: beat.base_mode & ARMED)
        assert w.drone.pose.up < 10.0


async def test_climb_without_a_reported_height_is_reported_as_aborted() -> None:
    async with world() as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.unreported = frozenset({ardrone3.AltitudeChanged.NAME})
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        aborted = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Climb to "), since=mark)
        assert aborted.severity == dialect.MAV_SEVERITY_ERROR
        assert w.commands("ardrone3.Piloting.moveBy") == []
        assert w.drone.pose.up < 2.0


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_armed_state_without_takeoff_expires(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark, began = w.client.mark(), time.monotonic()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.base_mode & ARMED, since=mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=AUTO_DISARM + 5.0)
        # A heartbeat is due at once when the bit changes, and a second later in any case.
        assert AUTO_DISARM <= time.monotonic() - began < AUTO_DISARM + 1.2
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Disarmed: no takeoff", since=mark)
        # No one is armed any more: a take-off waits again instead of beginning.
        assert (await w.client.command(TAKE_OFF, -1, NAN, NAN, NAN)).result == ACCEPTED
        await w.client.wait("HEARTBEAT")
        assert w.commands("ardrone3.Piloting.TakeOff") == []


async def test_conf_020_takeoff_to_the_parameter() -> None:
    """MAVSDK: arm, take-off with everything NaN climbs to MIS_TAKEOFF_ALT."""
    async with world() as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 7.0, 9))
        assert (await w.client.wait("PARAM_VALUE", since=mark)).param_value == 7.0
        await w.client.command(ARM, 1)
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.takeoff, since=mark)
        await w.at_height(7.0)


async def test_conf_021_takeoff_relative() -> None:
    """MAVProxy, dronekit, Mission Planner: latitude and longitude 0, height above the take-off point."""
    async with world() as w:
        await w.client.command(ARM, 1)
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF, 0, 0, 0, 0, x=0.0, y=0.0, z=10.0)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.takeoff, since=mark)
        await w.at_height(10.0)


@pytest.mark.parametrize("place", [(NAN, NAN), HOME[:2]])
async def test_conf_022_takeoff_amsl(place: tuple[float, float]) -> None:
    async with world() as w:
        await w.client.command(ARM, 1)
        mark = w.client.mark()
        ack = await w.client.command(TAKE_OFF, NAN, NAN, NAN, NAN, x=place[0], y=place[1], z=HOME[2] + 6.0)
        assert ack.result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.takeoff, since=mark)
        await w.at_height(6.0)


@pytest.mark.parametrize("height", [0.5, -3.0, 151.0, math.inf])
async def test_takeoff_heights_are_refused_not_clamped(height: float) -> None:
    async with world() as w:
        await w.client.command(ARM, 1)
        mark = w.client.mark()
        assert (await w.client.command(TAKE_OFF, 0, 0, 0, 0, x=0.0, y=0.0, z=height)).result == DENIED
        await w.client.wait("STATUSTEXT", lambda m: " refused: " in m.text, since=mark)
        assert w.commands("ardrone3.Piloting.TakeOff") == []


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_023_land_by_mode(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark, began = w.client.mark(), time.monotonic()
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.land))
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark)
        assert time.monotonic() - began < 1.3
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=20.0)
        assert w.drone.flying_state.name == "LANDED"


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_024_land_by_command(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        assert w.drone.flying_state.name == "LANDING"
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=20.0)


@pytest.mark.parametrize("how", ["SET_MODE", "DO_SET_MODE", "NAV_RETURN_TO_LAUNCH"])
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_025_return(how: str, flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark = w.client.mark()
        numbers = (4, 5) if flavour == "px4" else (6,)
        if how == "SET_MODE":
            w.client.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.returning))
        else:
            ack = await (
                w.client.command(SET_MODE, 1, *numbers)
                if how == "DO_SET_MODE"
                else w.client.command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)
            )
            assert ack.result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        assert len(w.commands("rth.return_to_home")) == 1


@pytest.mark.parametrize("end", [newer.ANAFI_RETURN_END_LANDING, newer.ANAFI_RETURN_END_HOVERING])
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_025_return_lands_or_hovers_by_its_setting(flavour: str, end: int) -> None:
    """From the middle of a goto: it brakes, climbs to ANF_RTH_ALT, flies home, descends to ANF_RTH_END_ALT, and there
    it lands or stays. Till then all of it is one mode, and ANAFI_HOME says how far it is."""
    async with world(flavour=flavour) as w:
        client = w.client
        value = await write(client, "ANF_RTH_END", end, 6 if flavour == "px4" else 9, flavour)
        assert value_of(value, flavour) == end
        if end == newer.ANAFI_RETURN_END_HOVERING:  # the gateway would land it
            await write(client, "ANF_RTL_END", 1, 6 if flavour == "px4" else 9, flavour)
        assert (
            await client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, newer.MAVLINK_MSG_ID_ANAFI_HOME, 20_000)
        ).result == ACCEPTED
        await client.wait("ANAFI_HOME", lambda m: (m.end, m.min_altitude, m.hovering_altitude) == (end, 20.0, 10.0))
        await w.take_off()
        place = geo.destination(*HOME[:2], 30.0, 20.0)
        assert (await client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=5.0)).result == 0
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
        mark, began = client.mark(), w.drone.log[-1].t
        client.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.returning))
        await client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        flying = client.mark()
        over = await w.drone.wait_log(
            lambda e: e.name == "rth.state" and e.args["reason"] == StateReason.FINISHED, 40.0
        )
        assert {m.custom_mode for at, m in client.since(flying, "HEARTBEAT") if at < over.t} == {w.modes.returning}
        assert at_home(w)
        assert w.drone.pose.up == pytest.approx(10.0, abs=0.3)
        heights = [e.args["up"] for e in w.drone.log if e.kind == "pose" and e.t > began]
        assert max(heights) == pytest.approx(20.0, abs=0.5)
        await client.wait("ANAFI_HOME", lambda m: m.state == newer.ANAFI_RETURN_STATE_AVAILABLE, since=flying)
        phases = [(m.state, m.reason) for _, m in client.since(mark, "ANAFI_HOME")]
        begun = phases.index((newer.ANAFI_RETURN_STATE_PENDING, newer.ANAFI_RETURN_REASON_USER_REQUEST))
        assert [phase for phase, _ in itertools.groupby(phases[begun:])] == [
            (newer.ANAFI_RETURN_STATE_PENDING, newer.ANAFI_RETURN_REASON_USER_REQUEST),
            (newer.ANAFI_RETURN_STATE_IN_PROGRESS, newer.ANAFI_RETURN_REASON_USER_REQUEST),
            (newer.ANAFI_RETURN_STATE_AVAILABLE, newer.ANAFI_RETURN_REASON_FINISHED),
        ]
        if end == newer.ANAFI_RETURN_END_HOVERING:
            # The goto of before does not come back: Brake in ArduPilot's words, not Guided.
            await client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, since=flying)
            await client.wait("HEARTBEAT")
            await client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle and beat.base_mode & ARMED)
            assert w.drone.flying_state.name == "HOVERING"
            assert at_home(w)
            assert w.drone.pose.up == pytest.approx(10.0, abs=0.3)
            assert (await client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
            flying = client.mark()
        # A landing that is a return's own is shown as Return to its end.
        mode = w.modes.land if end == newer.ANAFI_RETURN_END_HOVERING else w.modes.returning
        await client.heartbeat(lambda beat: beat.custom_mode == mode and beat.base_mode & ARMED, since=flying)
        await client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=flying, timeout=20.0)
        assert w.drone.flying_state.name == "LANDED"
        assert at_home(w)
        orders = [e.name for e in w.drone.log if e.kind == "command" and e.t > began and not e.name.endswith("PCMD")]
        landing = ["ardrone3.Piloting.Landing"] if end == newer.ANAFI_RETURN_END_HOVERING else []
        assert orders == ["ardrone3.Piloting.CancelMoveTo", "rth.return_to_home", *landing]


def at_home(w: World) -> bool:
    """The drone truly is where it took off."""
    return math.hypot(w.drone.pose.north, w.drone.pose.east) < 0.5


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_026_pause(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        north = geo.destination(*HOME[:2], 60.0, 0.0)
        assert (await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=north[0], y=north[1], z=5.0)).result == 0
        await w.client.wait("LOCAL_POSITION_NED", lambda m: m.vx > 2.0, timeout=10.0)
        mark = w.client.mark()
        assert (await w.client.command(REPOSITION, -1, 1, 0, NAN)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold, since=mark)
        await w.client.wait("LOCAL_POSITION_NED", lambda m: math.hypot(m.vx, m.vy) < 0.2, timeout=10.0)
        assert w.drone.pose.north < 50.0
        assert len(w.commands("ardrone3.Piloting.CancelMoveTo")) == 1


@pytest.mark.parametrize(("main", "sub", "mode"), [(4, 3, HOLD), (4, 5, RETURN), (4, 6, LAND), (3, 0, POSITION)])
@pytest.mark.parametrize("packed", [False, True])
async def test_conf_027_modes(main: int, sub: int, mode: int, packed: bool) -> None:
    async with world() as w:
        await w.take_off()
        if mode == HOLD:
            await w.client.command(SET_MODE, 1, 3, 0)
        mark = w.client.mark()
        ack = await (w.client.command(SET_MODE, 1, mode) if packed else w.client.command(SET_MODE, 1, main, sub))
        assert ack.result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == mode, since=mark)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_028_unknown_mode(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark = w.client.mark()
        acro = (5, 0) if flavour == "px4" else (1,)
        assert (await w.client.command(SET_MODE, 1, *acro)).result == DENIED
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, 5 << 16 if flavour == "px4" else 1))
        for _ in range(2):
            await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Mode refused"), since=mark)
        for _ in range(2):
            await w.client.wait("HEARTBEAT")
        assert {beat.custom_mode for _, beat in w.client.since(mark, "HEARTBEAT")} == {w.modes.hold}


@pytest.mark.parametrize(
    ("frame", "z"), [(0, HOME[2] + 12.0), (5, HOME[2] + 12.0), (3, 12.0), (6, 12.0), (None, HOME[2] + 12.0)]
)
@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_029_goto(frame: int | None, z: float, flavour: str) -> None:
    """The frame decides what the height means; COMMAND_LONG is AMSL. The drone arrives at 12 m in every case."""
    async with world(flavour=flavour) as w:
        await w.take_off()
        place = geo.destination(*HOME[:2], 20.0, -15.0)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=frame, x=place[0], y=place[1], z=z)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda entry: entry.name.endswith("moveToChanged") and entry.args["status"] == 1, 30.0)
        pose = w.drone.pose
        assert (pose.north, pose.east, pose.up) == pytest.approx((20.0, -15.0, 12.0), abs=1.0)


async def test_goto_in_a_terrain_frame_is_refused() -> None:
    async with world() as w:
        await w.take_off()
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=11, x=HOME[0], y=HOME[1], z=12.0)
        assert ack.result == 9  # COMMAND_UNSUPPORTED_MAV_FRAME, which pymavlink does not have yet


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_030_goto_without_fix(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=48.8790, y=2.3677, z=5.0)
        assert ack.result == REJECTED
        assert w.commands("ardrone3.Piloting.moveTo") == []


@pytest.mark.parametrize(
    ("x", "y", "z"),
    [(0.0, 0.0, 10.0), (91.0, 2.0, 10.0), (48.879, 2.3677, 0.5), (48.879, 2.3677, 151.0), (48.879, 2.3677, -1.0)],
)
async def test_goto_nonsense_is_refused(x: float, y: float, z: float) -> None:
    async with world() as w:
        await w.take_off()
        assert (await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=x, y=y, z=z)).result == DENIED
        assert w.commands("ardrone3.Piloting.moveTo") == []


async def test_goto_on_the_ground_is_refused() -> None:
    async with world() as w:
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=48.879, y=2.3677, z=10.0)
        assert ack.result == REJECTED


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_031_change_altitude(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        before = w.drone.pose
        assert (await w.client.command(REPOSITION, -1, 1, 0, NAN, z=HOME[2] + 15.0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: entry.name.endswith("moveToChanged") and entry.args["status"] == 1, 30.0)
        pose = w.drone.pose
        assert pose.up == pytest.approx(15.0, abs=0.5)
        assert (pose.north, pose.east) == pytest.approx((before.north, before.east), abs=0.7)


async def test_change_heading() -> None:
    """QGroundControl's change of heading: DO_REPOSITION with the heading alone, in radians."""
    async with world() as w:
        await w.take_off()
        assert (await w.client.command(REPOSITION, NAN, 1, NAN, math.pi / 2)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: entry.name.endswith("moveToChanged") and entry.args["status"] == 1, 30.0)
        assert w.drone.pose.yaw == pytest.approx(math.pi / 2, abs=0.1)


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_032_landed_state(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = w.client.mark()
        await w.take_off()
        await w.client.command(dialect.MAV_CMD_NAV_LAND)
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == 1, timeout=20.0)
        states = [m.landed_state for _, m in w.client.since(mark, "EXTENDED_SYS_STATE")]
        order = [state for index, state in enumerate(states) if index == 0 or states[index - 1] != state]
        assert order == [1, 3, 2, 4, 1]


@pytest.mark.parametrize("flavour", FLAVOURS)
async def test_conf_033_auto_disarm(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off()
        mark = w.client.mark()
        await w.client.command(dialect.MAV_CMD_NAV_LAND)
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == 1, since=mark, timeout=20.0)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=10.0)


async def test_a_newer_action_ends_the_older_one() -> None:
    """Land during the climb: the drone lands, and the height asked for before is forgotten."""
    async with world() as w:
        await w.client.command(ARM, 1)
        await w.client.command(TAKE_OFF, x=0.0, y=0.0, z=30.0)
        await w.client.wait("ALTITUDE", lambda m: m.altitude_relative > 4.0, timeout=20.0)
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=30.0)
        assert max(entry.args["up"] for entry in w.drone.log if entry.kind == "pose") < 20.0
