"""Requests whose own condition ends while they wait for control, judged by what the simulated drone received.

A request waits for the end of what it replaces. Its condition is checked on both sides of that wait: whatever ends it
meanwhile, the request is refused and the drone receives nothing of it.
"""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    DENIED,
    GOTO,
    IN_PROGRESS,
    PX4_HOLD,
    REJECTED,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    goto,
    home_being_undone,
    until,
    watched,
)
from support.mav import NAN
from support.missions import put, takeoff, way
from support.params import write
from support.plans import FENCE, square, upload
from support.setpoints import allow_speed, heard, local, motion, streaming
from support.world import HOME, World, world

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.sim.skycontroller import Skycontroller

START, ORBIT = dialect.MAV_CMD_MISSION_START, dialect.MAV_CMD_DO_ORBIT
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
CALIBRATION = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
UP = 8.0
PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""


def now() -> float:
    return asyncio.get_running_loop().time()


async def answer(w: World, mark: int, command: int) -> int:
    """Return the final result of a command."""
    ack = await w.client.wait(
        "COMMAND_ACK", lambda m: m.command == command and m.result != IN_PROGRESS, since=mark, timeout=15.0
    )
    return int(ack.result)


# Another controller takes off.


@pytest.mark.parametrize("armed", [True, False], ids=["armed", "disarmed"])
async def test_takeoff_is_refused_when_another_controller_takes_off_in_its_wait(armed: bool) -> None:
    async with world(speed=1.0) as w:
        if armed:
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)
        await watched(0.5)
        another_controller(w, ardrone3.TakeOff())
        assert await answer(w, mark, TAKEOFF_CMD) == REJECTED
        await watched(6.0)
        assert motion(w, began) == []
        assert w.drone.pose.up < 2.0


async def test_mission_start_without_arming_is_refused_when_another_controller_takes_off_in_its_wait() -> None:
    async with world(speed=1.0) as w:
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0)])
        await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(START)
        await watched(0.5)
        another_controller(w, ardrone3.TakeOff())
        assert await answer(w, mark, START) == REJECTED


async def test_mission_start_without_arming_is_refused_when_the_mission_is_replaced_in_its_wait() -> None:
    """The client that arms afterwards would fly a mission that it did not start."""
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0)])
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(START)
        await watched(0.5)
        await put(w, [takeoff(6.0), way(0.0, 20.0, 6.0)])
        assert await answer(w, mark, START) == REJECTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await watched(5.0)
        assert heard(w, "Start", since=began) == []


async def test_calibration_is_refused_when_another_controller_takes_off_in_its_wait() -> None:
    """It is not begun, and so needs no abort either."""
    async with world(speed=1.0) as w:
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(CALIBRATION, 0.0, 1.0)
        await watched(0.5)
        another_controller(w, ardrone3.TakeOff())
        assert await answer(w, mark, CALIBRATION) == REJECTED
        assert heard(w, "MagnetoCalibration", since=began) == []


# A condition of the take-off ends.


@pytest.mark.parametrize("launch", ["command", "hand"])
async def test_launch_is_refused_when_a_fence_that_excludes_the_drone_is_stored_in_its_wait(launch: str) -> None:
    async with world(speed=1.0) as w:
        if launch == "hand":
            await write(w.client, "ANF_HAND_LAUNCH", 1, dialect.MAV_PARAM_TYPE_INT32)
        else:
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        if launch == "hand":
            w.client.send_command(ARM, 1)
        else:
            w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)
        await watched(0.5)
        assert (await upload(w.client, square(HOME[:2], 10.0, inclusion=False), FENCE)).type == ACCEPTED
        assert await answer(w, mark, ARM if launch == "hand" else TAKEOFF_CMD) == REJECTED
        await watched(2.0)
        assert heard(w, "TakeOff", "UserTakeOff", since=began) == []


# A fence is stored.


@pytest.mark.parametrize("name", ["goto", "orbit"])
async def test_target_is_refused_when_a_fence_that_excludes_it_is_stored_in_the_wait(name: str) -> None:
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        if name == "goto":
            w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] + 0.0005, y=HOME[1], z=UP)
        else:
            w.client.send_command(ORBIT, 30.0, 2.0, 0.0, 0.0, frame=5, x=HOME[0], y=HOME[1], z=HOME[2] + UP)
        await watched(0.5)
        assert (await upload(w.client, square(HOME[:2], 20.0), FENCE)).type == ACCEPTED
        assert await answer(w, mark, GOTO if name == "goto" else ORBIT) == DENIED
        await watched(2.0)
        assert motion(w, began) == []


# The pilot at the Skycontroller.


async def flying_beside_pilot(w: World) -> Skycontroller:
    """Fly north under a goto; return the pilot's Skycontroller."""
    await w.take_off(UP)
    assert await goto(w, 90.0, UP) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
    assert w.drone.skycontroller is not None
    return w.drone.skycontroller


async def test_goto_is_refused_when_the_pilot_moves_a_stick_in_its_wait() -> None:
    """The stick is newer than the command, also when it is centred again by the time the wait is over."""
    async with world(speed=1.0, skycontroller=3) as w:
        pilot = await flying_beside_pilot(w)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] - 0.0005, y=HOME[1], z=UP)
        await watched(0.3)
        pilot.stick(PITCH_STICK, 40)
        await watched(0.3)
        pilot.stick(PITCH_STICK, 0)
        assert await answer(w, mark, GOTO) == REJECTED
        await watched(2.0)
        assert heard(w, "moveTo", "extended_move_to", since=began) == []


async def test_hold_leaves_a_return_that_the_pilot_begins_in_its_wait() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(UP)
        assert await goto(w, 60.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 30.0)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await watched(0.2)
        another_controller(w, rth.ReturnToHome())
        assert await answer(w, mark, SET_MODE) == REJECTED
        await watched(2.0)
        assert heard(w, "abort", since=began) == []
        assert w.drone.firmware.homing.active


async def test_change_of_altitude_is_refused_when_the_pilot_moves_a_stick_before_it_asks_for_control() -> None:
    """It waits first for the move that means the same; the stick is newer than its message all the same."""
    async with world(speed=1.0, skycontroller=3) as w:
        pilot = await flying_beside_pilot(w)
        w.drone.faults.unreported = frozenset({ardrone3.MoveToChanged.NAME})
        client, mark = await w.connect(sysid=250), w.client.mark()
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] - 0.0005, y=HOME[1], z=UP)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.args.get("latitude", 90.0) < HOME[0], 5.0)
        await home_being_undone(w)
        client.send_command(dialect.MAV_CMD_DO_CHANGE_ALTITUDE, UP, 3.0)
        await watched(0.2)
        began = now()
        pilot.stick(PITCH_STICK, 40)
        await watched(0.3)
        pilot.stick(PITCH_STICK, 0)
        ack = await client.wait("COMMAND_ACK", lambda m: m.result != IN_PROGRESS, since=0, timeout=15.0)
        assert ack.result == REJECTED
        assert await answer(w, mark, GOTO) != ACCEPTED
        await watched(2.0)
        assert heard(w, "moveTo", "extended_move_to", since=began) == []


# A return that another controller begins.


@pytest.mark.parametrize("name", ["goto", "turn", "orbit", "mission"])
async def test_task_leaves_a_return_that_another_controller_begins_in_its_wait(name: str) -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [way(30.0, 0.0, UP)])
        await w.take_off(UP)
        assert await goto(w, 30.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 25.0, 30.0)
        await watched(3.0)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        match name:
            case "goto":
                w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] + 0.0005, y=HOME[1], z=UP)
            case "turn":
                w.client.send_command(dialect.MAV_CMD_CONDITION_YAW, 170.0, 10.0, 1.0, 1.0)
            case "orbit":
                w.client.send_command(ORBIT, 10.0, 2.0, 0.0, 0.0, frame=5, x=HOME[0], y=HOME[1], z=HOME[2] + UP)
            case _:
                w.client.send_command(START)
        await watched(1.0)
        another_controller(w, rth.ReturnToHome())
        results = dict(await until(w.client, mark, 2))
        results.pop(dialect.MAV_CMD_DO_SET_HOME)
        assert [*results.values()] == [REJECTED]
        await watched(2.0)
        assert heard(w, "abort", since=began) == []
        assert w.drone.firmware.homing.active


# A place that the request does not name.


@pytest.mark.parametrize("waits", [True, False], ids=["after a wait", "at once"])
async def test_turn_by_goto_at_speed_does_not_fly_back(waits: bool) -> None:
    """DO_REPOSITION with a heading alone ends a stream: the drone turns where it comes to rest."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        allow_speed(w)
        await w.take_off(UP)
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
        async with streaming(w.client, local(0b110111000111, v=(5.0, 0.0, 0.0))):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 4.5, 20.0)
            if waits:
                await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(GOTO, -1, 1, 0, 1.5, frame=6, x=NAN, y=NAN, z=NAN)
        assert await answer(w, mark, GOTO) == ACCEPTED
        await watched(10.0)
        assert w.drone.pose.north > max(e.args["north"] for e in w.drone.log if e.kind == "pose") - 2.0


# What flew before goes on.


async def test_goto_goes_on_in_its_mode_when_a_request_is_refused_after_its_wait() -> None:
    """The drone flies on to the target, so the goto is active again: Continue after a Pause flies it."""
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        assert await goto(w, 60.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(ORBIT, 100.0, 2.0, 0.0, 0.0, frame=5, x=HOME[0], y=HOME[1], z=HOME[2] + UP)
        await watched(0.5)
        assert (await upload(w.client, square(HOME[:2], 80.0), FENCE)).type == ACCEPTED
        assert await answer(w, mark, ORBIT) == DENIED
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.1, 10.0)
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 55.0, 30.0)
