"""Reports of the drone that arrive late, or never: no answer is untrue, and nothing older than a stop flies on.

What a drone does is its own log's word.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    CANCELLED,
    FAILED,
    LAND_CMD,
    PX4_HOLD,
    PX4_OFFBOARD,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    goto,
    heard,
    on_command,
    results,
    until,
    watched,
)
from support.mav import CAMERA
from support.missions import ACTIVE, on_the_way, put, start, state, takeoff, way
from support.missions import LAND as LAND_ITEM
from support.params import write
from support.setpoints import POSITION_ONLY, VELOCITY_ONLY, local, streaming
from support.world import ARMED, HOLD, HOME, OFFBOARD, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, rth
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.drone.piloting.moves import MoveEnd
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk

ROI, YAW, ALTITUDE = (
    dialect.MAV_CMD_DO_SET_ROI_LOCATION,
    dialect.MAV_CMD_CONDITION_YAW,
    dialect.MAV_CMD_DO_CHANGE_ALTITUDE,
)
SET_HOME = dialect.MAV_CMD_DO_SET_HOME
BRAKE = (1, 17)
FORCED = 21196
FLYING, MOVED_BY, MOVED_TO, PLAYING = (
    ardrone3.FlyingStateChanged.NAME,
    ardrone3.MoveByEnd.NAME,
    ardrone3.MoveToChanged.NAME,
    common.MavlinkFilePlayingStateChanged.NAME,
)
FAR = local(POSITION_ONLY, at=(80.0, 0.0, -21.0))
AHEAD = local(POSITION_ONLY, frame=dialect.MAV_FRAME_BODY_OFFSET_NED, at=(60.0, 0.0, 0.0))


def now() -> float:
    return asyncio.get_running_loop().time()


def flown(w: World) -> list[str]:
    """The flying states of the drone itself, in order."""
    return [entry.args["to"] for entry in w.drone.log if entry.name == "flying"]


async def flies(w: World, state: str, since: float = -math.inf) -> None:
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == state, 20.0, since=since)


def away(w: World) -> float:
    """m from home."""
    return math.hypot(w.drone.pose.north, w.drone.pose.east)


async def turned_with_a_late_end(w: World, late: float) -> None:
    """Let the drone turn by 20 degrees; it reports the end of that only later."""
    w.drone.faults.late = {MOVED_BY: late}
    began = now()
    w.client.send_command(YAW, 20, 30, 1, 1)
    await flies(w, "flying", began)
    await flies(w, "hovering", now())


async def test_late_end_of_a_turn_is_not_the_end_of_the_next_move() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        async with streaming(w.client, AHEAD):
            await turned_with_a_late_end(w, 0.9)
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and away(w) > 3.0, 20.0)
        await watched(1.0)  # a silence of 0.5 s ends setpoints
        stopped = away(w)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await watched(3.0)
        assert away(w) < stopped + 4.0  # the way in which it brakes


async def test_hold_ends_a_climb_that_a_late_end_of_a_turn_precedes() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 3)
        await turned_with_a_late_end(w, 0.8)
        mark = w.client.mark()
        w.client.send_command(ALTITUDE, 40.0, 6)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 8.0, 20.0)
        assert (ALTITUDE, ACCEPTED) not in results(w.client, mark)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        up = w.drone.pose.up
        await watched(4.0)
        assert w.drone.pose.up < up + 2.0


@pytest.mark.parametrize("late", [1.5, 2.2])
async def test_hold_ends_a_climb_that_the_late_end_of_an_equal_one_crosses(late: float) -> None:
    """Nothing in that end tells the two apart but when it arrives: sooner than a drone climbs, or later."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 3)
        w.drone.faults.late = {MOVED_BY: late}
        began = now()
        w.client.send_command(ALTITUDE, 11.0, 6)
        await flies(w, "flying", began)
        await flies(w, "hovering", now())
        await asyncio.sleep(0.7)  # of the client, between its commands
        mark = w.client.mark()
        w.client.send_command(ALTITUDE, 17.0, 6)
        await watched(late - 0.7 + 0.1)
        assert ((ALTITUDE, ACCEPTED) in results(w.client, mark)) == (late > 2.0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        up = w.drone.pose.up
        await watched(5.0)
        assert w.drone.pose.up < min(up + 2.0, 16.0)


@pytest.mark.parametrize("late", [1.2, 1.65])
async def test_turn_is_not_accepted_by_the_late_end_of_a_like_one_before_it_can_be_over(late: float) -> None:
    """It arrives after the time of the fastest drone, and before that of the rate which was commanded.

    `late`: s after the drone's receipt of the second turn.
    """
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        w.drone.faults.unreported = frozenset({MOVED_BY})
        began = now()
        w.client.send_command(YAW, 40, 30, 1, 1)
        await flies(w, "flying", began)
        await flies(w, "hovering", now())
        w.drone.faults.unreported = frozenset()
        mark, heading, began = w.client.mark(), w.drone.pose.yaw, now()
        w.client.send_command(YAW, 41, 30, 1, 1)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("ove_by"), 5.0, since=began)
        end = ardrone3.MoveByEnd(0.0, 0.0, 0.0, math.radians(40.0), ardrone3.MoveByError.OK)
        asyncio.get_running_loop().call_later(late, w.drone.inject, end)
        while (YAW, ACCEPTED) not in (found := results(w.client, mark)):
            await until(w.client, mark, len(found) + 1)
        assert math.degrees(w.drone.pose.yaw - heading) > 38.0


async def test_turn_that_is_faster_than_commanded_is_accepted_although_it_replaced_another_one() -> None:
    """As of a drone with a limit of its own, and of a simulator whose time is accelerated."""
    async with world(speed=4.0) as w:
        await w.take_off(5.0)
        began, mark = now(), w.client.mark()
        w.client.send_command(YAW, 60, 20, 1, 1)
        await flies(w, "flying", began)
        w.client.send_command(YAW, 45, 30, 1, 1)
        while (YAW, ACCEPTED) not in (found := results(w.client, mark)):
            await until(w.client, mark, len(found) + 1)
        assert found[0] == (YAW, CANCELLED)


@pytest.mark.parametrize("command", [(SET_MODE, *BRAKE), (dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0), (RTL,)])
async def test_unconfirmed_stop_does_not_return_the_drone_to_an_older_stream(command: tuple[float, ...]) -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        companion = await w.connect(sysid=240)
        await w.take_off(21.0)
        async with streaming(companion, FAR):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
            w.drone.faults.unreported = frozenset({MOVED_TO, FLYING, rth.State.NAME})
            ack = await w.client.command(*command, timeout=10.0)
            moves = len(heard(w, "moveTo"))
            await watched(5.0)
        assert ack.result == FAILED
        assert len(heard(w, "moveTo")) == moves


@pytest.mark.parametrize("lands", [False, True])
async def test_hold_is_accepted_after_a_goto_whose_end_is_never_reported(lands: bool) -> None:
    """The drone hovers, and has received the cancellation; after a landing no goto is left that could be flown."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        assert await goto(w, 80.0, 5.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
        w.drone.faults.unreported = frozenset({MOVED_TO})
        began = now()
        if lands:
            assert (await w.client.command(LAND_CMD)).result == ACCEPTED
            await flies(w, "landed", began)
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
            await w.take_off(5.0)
        else:
            assert (await w.client.command(SET_MODE, *PX4_HOLD, timeout=10.0)).result == ACCEPTED
            assert flown(w)[-1] == "hovering"
        began = now()
        assert (await w.client.command(SET_MODE, *PX4_HOLD, timeout=10.0)).result == ACCEPTED
        assert now() - began < 0.5
        stopped = w.drone.pose.north
        await watched(3.0)
        assert abs(w.drone.pose.north - stopped) < 1.0


async def test_goto_whose_end_is_never_reported_ends_for_its_caller_with_the_stop() -> None:
    """The end that is reported after all is not that of a later goto to the same place."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        piloting = w.gateway.systems[0].drone.piloting
        place = (*geo.destination(*HOME[:2], 80.0, 0.0), 5.0)
        began = now()
        move = await piloting.move_to(*place)
        await flies(w, "flying", began)
        w.drone.faults.unreported = frozenset({MOVED_TO})
        await watched(0.5)
        await piloting.stop()
        assert await asyncio.wait_for(move.result(), 0.5) is MoveEnd.CANCELED
        again = asyncio.ensure_future(piloting.move_to(*place))
        await flies(w, "flying", now())
        late = ardrone3.MoveToChanged(*place, ardrone3.OrientationMode.NONE, 0.0, ardrone3.MoveToStatus.CANCELED)
        w.drone.inject(late)
        await watched(0.5)
        assert not again.done()
        again.cancel()


@pytest.mark.parametrize("answer", [None, PlayingState.PAUSED, PlayingState.PLAYING])
async def test_hold_of_a_mission_whose_pause_is_not_reported_is_what_the_drone_then_says(
    answer: PlayingState | None,
) -> None:
    """It is asked for its states. Where these do not mention the plan, a hover counts."""
    async with world(speed=1.0, web=True) as w:
        await on_the_way(w, 2)
        (uid,) = {e.args["filepath"] for e in w.drone.log if e.name == PLAYING}
        w.drone.faults.unreported = frozenset({PLAYING})
        mark = w.client.mark()
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await w.drone.wait_log(lambda e: e.name == common.AllStates.NAME, 5.0, since=now())
        if answer is not None:
            w.drone.faults.unreported = frozenset()
            w.drone.inject(common.MavlinkFilePlayingStateChanged(answer, uid, common.MavlinkType.FLIGHT_PLAN))
            w.drone.faults.unreported = frozenset({PLAYING})
        result = FAILED if answer is PlayingState.PLAYING else ACCEPTED
        assert await until(w.client, mark, 1) == [(SET_MODE, result)]
        await w.drone.wait_log(lambda e: e.name == FLYING and e.args["state"].name == "HOVERING", 10.0)
        if answer is not PlayingState.PLAYING:
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
            assert await goto(w, 40.0, 8.0) == ACCEPTED  # it has the drone again


async def test_setpoints_fly_a_drone_that_reports_no_pause_of_its_plan() -> None:
    """Offboard is accepted once its setpoints move the drone, which takes none while its plan plays."""
    async with world(speed=1.0, web=True) as w:
        await on_the_way(w, 2)
        w.drone.faults.unreported = frozenset({PLAYING})
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD, timeout=10.0)).result == ACCEPTED
            east = w.drone.pose.east
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > east + 4.0, 10.0)
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD)


@pytest.mark.parametrize("flown", ["a panorama", "a following"])
async def test_hold_is_accepted_of_what_the_drone_never_reports_as_ended(flown: str) -> None:
    async with world(speed=1.0) as w:
        await w.take_off(15.0)
        if flown == "a panorama":
            ack = await w.client.command(dialect.MAV_CMD_PANORAMA_CREATE, 360, 60, 10, 10, target=(1, CAMERA))
            assert ack.result == ACCEPTED
        else:
            another_controller(w, follow_me.TargetFramingPosition(50, 50))
            another_controller(w, follow_me.Start(follow_me.Mode.LOOK_AT))
            await w.drone.wait_log(
                lambda e: e.name == follow_me.State.NAME and e.args["mode"] != follow_me.Mode.NONE, 5.0
            )
        await watched(1.0)
        w.drone.faults.unreported = frozenset({follow_me.State.NAME, animation.State.NAME})
        assert (await w.client.command(SET_MODE, *PX4_HOLD, timeout=10.0)).result == ACCEPTED
        began = now()
        assert await goto(w, 20.0, 15.0) == ACCEPTED
        assert now() - began < 0.5


async def test_mission_that_landed_without_a_report_of_its_end_has_ended() -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(5.0), way(8.0, 0.0, 5.0), LAND_ITEM])
        await start(w)
        await state(w, ACTIVE, seq=1)
        began = now()
        w.drone.faults.unreported = frozenset({PLAYING})
        await flies(w, "landed", began)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
        await w.take_off(5.0)  # then it holds, and flies no mission
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED


async def test_hold_is_accepted_at_once_after_a_return_whose_end_on_the_ground_was_not_reported() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        assert await goto(w, 30.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 20.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        w.drone.faults.unreported = frozenset({rth.State.NAME, ardrone3.NavigateHomeStateChanged.NAME})
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await flies(w, "landed", now())
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
        w.drone.faults.unreported = frozenset()
        await w.take_off(5.0)
        began = now()
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert now() - began < 0.5


async def test_return_is_flown_although_the_end_of_the_one_before_was_never_reported() -> None:
    """Another controller has ended it; the drone hovers, and reports its states when it is asked."""
    async with world(speed=1.0) as w:
        await w.take_off(22.0)
        assert await goto(w, 60.0, 22.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 55.0, 60.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        began = now()
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] < 50.0, 60.0, since=began)
        w.drone.faults.unreported = frozenset({rth.State.NAME, ardrone3.NavigateHomeStateChanged.NAME})
        another_controller(w, rth.Abort())
        await w.drone.wait_log(lambda e: e.name == FLYING and e.args["state"].name == "HOVERING", 10.0, since=now())
        w.drone.faults.unreported = frozenset()
        began = now()
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] < 10.0, 60.0, since=began)


async def test_home_is_not_refused_by_a_report_of_the_one_before() -> None:
    """The drone has sent it before it received the new place, and acknowledges that first."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        w.drone.faults.late = {rth.CustomLocation.NAME: 0.3}
        first, second = geo.destination(*HOME[:2], 20.0, 0.0), geo.destination(*HOME[:2], 40.0, 0.0)
        assert (await w.client.command(SET_HOME, 0, frame=6, x=first[0], y=first[1], z=0.0)).result == ACCEPTED
        w.drone.inject(rth.CustomLocation(*first, 0.0))
        mark = w.client.mark()
        assert (await w.client.command(SET_HOME, 0, frame=6, x=second[0], y=second[1], z=0.0)).result == ACCEPTED
        await w.client.wait("HOME_POSITION", lambda m: abs(m.latitude - round(second[0] * 1e7)) <= 40, since=mark)


async def test_landing_that_is_reported_late_is_not_ended_by_an_older_stream() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        companion = await w.connect(sysid=240)
        await w.take_off(20.0)
        async with streaming(companion, local(VELOCITY_ONLY, v=(1.0, 0.0, -0.5))):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 20.0)
            w.drone.faults.late = {FLYING: 6.0}
            before = len(flown(w))
            w.client.send_command(LAND_CMD)
            await flies(w, "landed", now())
        assert flown(w)[before:] == ["landing", "landed"]


@pytest.mark.parametrize("command", [(LAND_CMD,), (ARM, 0)])
async def test_stop_ends_a_takeoff_of_another_controller_that_is_not_reported_yet(command: tuple[int, ...]) -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.late = {FLYING: 1.5}
        another_controller(w, ardrone3.TakeOff())
        await flies(w, "takingoff")
        ack = await w.client.command(*command)
        assert ack.result == ACCEPTED
        await flies(w, "landed", now())


@pytest.mark.parametrize("command", [(LAND_CMD,), (ARM, 0), (ARM, 0, FORCED)])
async def test_stop_ends_a_takeoff_that_ignores_the_landing_as_motors_ramp_up(command: tuple[int, ...]) -> None:
    async with world(speed=1.0, quirks=(Quirk.RAMPING_IGNORES_LANDING.value,)) as w:
        w.drone.faults.late = {FLYING: 0.3}
        another_controller(w, ardrone3.TakeOff())
        assert (await w.client.command(*command)).result == ACCEPTED
        await flies(w, "landed")
        assert w.drone.pose.up < 0.5
        await watched(2.5)
        another_controller(w, ardrone3.TakeOff())  # a flight that was not begun when the stop was commanded
        await watched(5.0)
        assert flown(w)[-1] == "hovering"


async def test_takeoff_after_its_command_has_failed_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    async with world(speed=1.0) as w:
        receive = w.drone.firmware.receive

        def late(message: Any, at: float) -> None:
            if isinstance(message, ardrone3.TakeOff):
                asyncio.get_running_loop().call_later(6.0, receive, message, at)
            else:
                receive(message, at)

        monkeypatch.setattr(w.drone.firmware, "receive", late)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        ack = await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0, timeout=15.0)
        assert ack.result == FAILED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Takeoff begun late, or by another controller")
        assert (await w.client.command(LAND_CMD, timeout=15.0)).result == ACCEPTED


async def test_takeoff_that_late_reports_of_an_earlier_one_refuse_is_reported() -> None:
    """The drone's states are 3 s old: those of the first, which a landing has ended, are taken for the second's."""
    async with world(speed=1.0) as w:
        w.drone.faults.late = {FLYING: 3.0}
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await flies(w, "motor_ramping")
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        mark = w.client.mark()
        ack = await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=4.0, timeout=15.0)
        await flies(w, "hovering")
        await watched(3.5)  # until that is reported
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert ack.result == ACCEPTED or "Takeoff begun late, or by another controller" in texts


async def test_takeoff_just_after_a_landing_was_commanded_on_the_ground_is_flown() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=4.0, timeout=15.0)).result == ACCEPTED
        await w.at_height(4.0)


async def test_land_is_sent_while_the_end_of_a_landing_is_not_reported_yet() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)
        w.drone.faults.late = {FLYING: 1.0}
        began = now()
        another_controller(w, ardrone3.PCMD(0, 0, 0, 0, 100, 0))
        await flies(w, "flying", began)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await flies(w, "landed", began)


async def test_return_is_sent_while_the_end_of_the_one_before_is_not_reported_yet() -> None:
    """Hold has ended it without a report, and the states that are requested then are on their way."""
    async with world(speed=1.0) as w:
        await w.take_off(25.0)
        assert await goto(w, 60.0, 25.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 40.0, 40.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        w.drone.faults.unreported = frozenset({rth.State.NAME})
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.4)
        began = now()
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await w.drone.wait_log(lambda e: e.name == rth.Abort.NAME, 10.0, since=began)
        await watched(0.2)  # the end is not reported
        w.drone.faults.unreported = frozenset()
        await w.drone.wait_log(lambda e: e.name == common.AllStates.NAME, 10.0, since=began)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] < 3.0, 60.0, since=began)


@pytest.mark.parametrize("delay", [0.2, 0.6])
async def test_takeoff_that_a_landing_has_prevented_is_not_accepted(delay: float) -> None:
    """Both are sent while the motors ramp up, the take-off before the landing is confirmed."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == dialect.MAV_LANDED_STATE_TAKEOFF)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=delay)
        mark = w.client.mark()
        w.client.send_command(LAND_CMD)
        await w.client.wait("COMMAND_ACK", lambda ack: ack.command == TAKEOFF_CMD, since=mark)  # it is cancelled
        ack = await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=4.0, timeout=15.0)
        await watched(5.0)
        assert (ack.result == ACCEPTED) == (w.drone.pose.up > 0.5)


@pytest.mark.parametrize("newer", [(TAKEOFF_CMD,), (SET_MODE, *PX4_HOLD)])
async def test_hand_launch_that_another_command_replaces_stops_although_it_ignores_that_first(
    newer: tuple[int, ...],
) -> None:
    """A drone that ignores UserTakeOff(0) while its motors ramp up is sent it again before it waits for the throw."""
    async with world(speed=1.0, quirks=(Quirk.RAMPING_IGNORES_LANDING.value,)) as w:
        await write(w.client, "ANF_HAND_LAUNCH", 1, 6)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        began, mark = now(), w.client.mark()
        w.client.send_command(ARM, 1)
        await watched(0.1)  # of the client, between its commands
        w.client.send_command(*newer)
        assert (ARM, CANCELLED) in await until(w.client, mark, 2)
        await flies(w, "usertakeoff", began)
        await flies(w, "landed", began)
        await watched(2.0)
        assert flown(w)[-1] == "landed"


@pytest.mark.parametrize("gap", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("stop", [(LAND_CMD,), (ARM, 0)])
async def test_takeoff_is_not_accepted_that_a_landing_before_its_motors_has_prevented(
    stop: tuple[int, ...], gap: float
) -> None:
    """The stop is sent before the motors of a first take-off are reported, and the second take-off after that."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=1.0)
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await watched(1.9)  # of the client, between its commands
        w.client.send_command(*stop)
        await watched(gap)
        ack = await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=4.0, timeout=15.0)
        await watched(6.0)
        assert (ack.result == ACCEPTED) == (w.drone.pose.up > 0.5)


@pytest.mark.parametrize(("is_after_hand_launch", "has_height"), [(False, True), (True, True), (False, False)])
async def test_forced_disarm_cuts_no_motors_in_the_air(is_after_hand_launch: bool, has_height: bool) -> None:
    """By the fresh height, which some firmware reports above the take-off point alone.

    The flying state that is reported is two seconds old. `allow_kill` is off.
    """

    def before(drone: SimulatedDrone) -> None:
        if not has_height:
            drone.faults.unreported = frozenset({ardrone3.AltitudeAboveGroundChanged.NAME})

    async with world(speed=1.0, before=before) as w:
        if is_after_hand_launch:
            await write(w.client, "ANF_HAND_LAUNCH", 1, 6)
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            assert (await w.client.command(ARM, 0)).result == ACCEPTED
            await flies(w, "landed", now() - 1.0)
            await watched(11.0)  # until that launch is over for good
        w.drone.faults.late = {FLYING: 2.0}
        began = now()
        another_controller(w, ardrone3.TakeOff())
        ramping = dialect.MAV_LANDED_STATE_TAKEOFF
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == ramping, timeout=10.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 0.5, 10.0)
        await w.client.command(ARM, 0, FORCED, timeout=20.0)
        assert heard(w, "Emergency") == []
        await flies(w, "landed", began)


@pytest.mark.parametrize("degrees", [0, 1])
async def test_turn_by_nearly_nothing_ends_a_turn(degrees: int) -> None:
    """The drone reports at once that it is there, as it does of a turn that was cancelled."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        w.client.send_command(YAW, 90, 30, 1, 1)
        await flies(w, "flying", now())
        mark, began = w.client.mark(), now()
        w.client.send_command(YAW, degrees, 30, 1, 1)
        assert (YAW, ACCEPTED) in await until(w.client, mark, 2, 30.0)
        assert now() - began < 10.0


@pytest.mark.parametrize("gap", [0.1, 0.3])
async def test_stop_that_a_region_of_interest_replaces_ends_an_older_stream(gap: float) -> None:
    """The drone has obeyed Brake, and its report is on the way when the region is commanded."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        companion = await w.connect(sysid=240)
        await w.take_off(21.0)
        async with streaming(companion, FAR):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
            w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.25)
            w.client.send_command(SET_MODE, *BRAKE)
            await watched(gap)  # of the client, between its two commands
            mark = w.client.mark()
            w.client.send_command(ROI, 0, 0, 0, 0, frame=6, x=48.8795, y=2.3677, z=0.0)
            await w.client.wait("COMMAND_ACK", lambda ack: (ack.command, ack.result) == (ROI, ACCEPTED), since=mark)
            await watched(6.0)
        assert w.drone.pose.north < 30.0


@pytest.mark.parametrize("is_same", [True, False])
async def test_second_region_of_interest_within_a_round_trip_replaces_the_first(is_same: bool) -> None:
    async with world(speed=1.0) as w:
        other = w.client if is_same else await w.connect(sysid=240)
        await w.take_off(8.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        began = on_command(w, ardrone3.StartPilotedPOIV2.NAME, lambda: None)
        w.client.send_command(ROI, 0, 0, 0, 0, frame=6, x=48.8795, y=2.3677, z=0.0)
        await asyncio.sleep(0.1)  # of the clients, between their two commands
        mark = other.mark()
        other.send_command(ROI, 0, 0, 0, 0, frame=6, x=48.8789, y=2.3690, z=0.0)
        await began
        while (ROI, ACCEPTED) not in (found := results(other, mark)):
            assert len(found) < 2, found
            await until(other, mark, len(found) + 1)
        await watched(1.0)
        assert w.drone.firmware.poi.status.name == "RUNNING"
        assert heard(w, "StopPilotedPOI") == []
