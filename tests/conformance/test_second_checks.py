"""Conditions that are checked again after a wait, judged by what the simulated drone received.

What is requested waits for the end of what flew before. If the drone lands, returns or is disarmed meanwhile, the
request is refused, and the drone receives nothing of it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    GOTO,
    LAND_CMD,
    REJECTED,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    goto,
    home_being_undone,
    return_by_itself,
    until,
    watched,
)
from support.mav import NAN
from support.missions import put, takeoff, way
from support.params import send_set, write
from support.plans import clear
from support.setpoints import VELOCITY_ONLY, heard, local, motion, said, streaming, texts
from support.world import HOME, World, world

from anafi_mav.arsdk.messages import ardrone3, piloting_style, rth
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.vehicle.takeoff import AUTO_DISARM

FAILED = dialect.MAV_RESULT_FAILED
START, ORBIT = dialect.MAV_CMD_MISSION_START, dialect.MAV_CMD_DO_ORBIT
OFFBOARD, FOLLOW = (1, 6, 0), (1, 4, 8)
FORCE = 21196
CAMERA = piloting_style.PilotingStyleStyle.CAMERA_OPERATED
UP = 8.0


def now() -> float:
    return asyncio.get_running_loop().time()


def flown(w: World, since: float) -> list[str]:
    """Commands since then that fly the drone, and not those that stop it."""
    return [e.name for e in (*motion(w, since), *heard(w, "Start", "TakeOff", "StartPilotedPOIV2", since=since))]


async def moving(w: World) -> None:
    """Fly to a far place, and be on the way."""
    assert await goto(w, 90.0, UP) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)


# The motor cut.


async def test_motor_cut_is_followed_by_nothing_of_what_it_replaces() -> None:
    """A goto that the drone has not confirmed: its cancellation would arrive behind the cut."""
    async with world(speed=1.0, allow_kill=True) as w:
        await w.take_off(UP)
        w.drone.faults.unreported = frozenset({ardrone3.MoveToChanged.NAME})
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] + 0.0005, y=HOME[1], z=UP)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(".moveTo"), 5.0)
        assert (await w.client.command(ARM, 0, FORCE)).result == ACCEPTED
        await watched(2.0)
        names = [e.name.rpartition(".")[2] for e in w.drone.log if e.kind == "command"]
        assert [one for one in names[names.index("Emergency") + 1 :] if one != "PCMD"] == []


async def test_command_during_a_motor_cut_is_refused_and_sends_nothing() -> None:
    async with world(speed=1.0, allow_kill=True) as w:
        await w.take_off(UP)
        w.drone.faults.down = Impairment(delay=1.0)
        w.client.send_command(ARM, 0, FORCE)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(".Emergency"), 5.0)
        mark, began = w.client.mark(), now()
        assert await goto(w, 90.0, UP) == REJECTED
        await said(w.client, "Command refused: motor cut in progress", mark)
        assert flown(w, began) == []


# The pilot's switch.


async def test_goto_that_the_drone_has_not_confirmed_is_over_when_the_pilot_is_given_the_aircraft() -> None:
    """It was answered with FAILED: no text may report its end once more."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(UP)
        w.drone.faults.unreported = frozenset({ardrone3.MoveToChanged.NAME})
        assert await goto(w, 30.0, UP) == FAILED
        w.drone.faults.unreported = frozenset()
        mark = w.client.mark()
        await write(w.client, "ANF_SC_OFFBOARD", 0, dialect.MAV_PARAM_TYPE_INT32)
        await watched(2.0)
        assert [text for text in texts(w.client, mark) if text.startswith("Goto")] == []


@pytest.mark.parametrize("command", [LAND_CMD, RTL], ids=["landing", "return"])
async def test_switch_to_the_pilot_leaves_a_landing_or_return_that_is_not_confirmed(command: int) -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(UP)
        assert await goto(w, 20.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        mark = w.client.mark()
        w.client.send_command(command)
        await watched(0.1)
        send_set(w.client, "ANF_SC_OFFBOARD", 0, dialect.MAV_PARAM_TYPE_INT32)
        assert await until(w.client, mark, 1) == [(command, ACCEPTED)]
        await watched(3.0)
        assert w.drone.firmware.homing.active or w.drone.flying_state.name in ("LANDING", "LANDED")
        assert heard(w, "abort") == []


async def test_return_that_begins_while_the_switch_ends_a_goto_goes_on() -> None:
    """The switch waits for the end of what flew; meanwhile another controller leads the drone home."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(UP)
        await moving(w)
        await home_being_undone(w)
        began = now()
        send_set(w.client, "ANF_SC_OFFBOARD", 0, dialect.MAV_PARAM_TYPE_INT32)
        await watched(0.2)
        another_controller(w, rth.ReturnToHome())
        await watched(3.0)
        assert heard(w, "abort", since=began) == []
        assert w.drone.firmware.homing.active


# A take-off that is to end a landing.


async def test_takeoff_command_whose_landing_has_ended_on_the_ground_is_refused() -> None:
    """It waits for the end of what flew, and the drone touches down meanwhile: nothing may be confirmed."""
    async with world(speed=1.0) as w:
        await w.take_off(3.0)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] < 0.25, 20.0, since=now())
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)
        assert (TAKEOFF_CMD, REJECTED) in await until(w.client, mark, 2)
        assert w.drone.flying_state.name == "LANDED"
        await watched(4.0)
        assert heard(w, "TakeOff", since=began) == []
        assert w.drone.pose.up < 0.1


async def test_takeoff_whose_arming_lapses_in_the_wait_is_refused() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await watched(AUTO_DISARM - 2.0)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        assert (TAKEOFF_CMD, REJECTED) in await until(w.client, mark, 2)
        await watched(4.0)
        assert heard(w, "TakeOff", since=began) == []


async def test_takeoff_whose_client_arms_in_the_wait_is_flown() -> None:
    async with world(speed=1.0) as w:
        await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await watched(0.5)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (TAKEOFF_CMD, ACCEPTED) in await until(w.client, mark, 3)
        await w.at_height(5.0)
        assert "not armed" not in " ".join(m.text for _, m in w.client.since(mark, "STATUSTEXT"))


# A mission.


async def test_mission_start_whose_arming_lapses_in_the_wait_is_refused() -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0)])
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await watched(AUTO_DISARM - 2.0)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(START)
        assert (START, REJECTED) in await until(w.client, mark, 2)
        await watched(4.0)
        assert flown(w, began) == []
        assert w.drone.pose.up < 0.1


@pytest.mark.parametrize("own", [True, False])
async def test_mission_start_whose_client_arms_in_the_wait_is_flown(own: bool) -> None:
    """The arming of another client starts no motor."""
    async with world(speed=1.0, web=True, clients=2) as w:
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0)])
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(START)
        await watched(0.5)
        assert (await w.clients[0 if own else 1].command(ARM, 1)).result == ACCEPTED
        assert (START, ACCEPTED) in await until(w.client, mark, 3 if own else 2)
        await watched(8.0)
        assert bool(flown(w, began)) is own


async def test_mission_mode_on_the_ground_whose_mission_is_deleted_in_its_wait_is_not_entered() -> None:
    async with world(speed=1.0) as w:
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0)])
        await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(START)  # disarmed: it would wait for arming
        await watched(0.5)
        assert (await clear(w.client, dialect.MAV_MISSION_TYPE_MISSION)).type == dialect.MAV_MISSION_ACCEPTED
        assert (START, REJECTED) in await until(w.client, mark, 2)
        await watched(2.0)
        assert (await w.client.heartbeat(lambda beat: True)).custom_mode == w.modes.idle


# What acquires control, and what happens in its wait.


async def offboard(w: World) -> None:
    w.client.send_command(SET_MODE, *OFFBOARD)


async def follow(w: World) -> None:
    w.client.send_command(SET_MODE, *FOLLOW)


async def orbit(w: World) -> None:
    w.client.send_command(ORBIT, 10.0, 2.0, 0.0, 0.0, frame=5, x=HOME[0], y=HOME[1], z=HOME[2] + UP)


async def mission(w: World) -> None:
    w.client.send_command(START)


async def far(w: World) -> None:
    w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] - 0.0005, y=HOME[1], z=UP)


async def turn(w: World) -> None:
    w.client.send_command(dialect.MAV_CMD_CONDITION_YAW, 170.0, 10.0, 1.0, 1.0)


TASKS = {"goto": far, "turn": turn, "offboard": offboard, "follow": follow, "orbit": orbit, "mission": mission}

MEANWHILE: dict[str, tuple[Callable[[World], Any], str, str]] = {
    "landing": (
        lambda w: another_controller(w, ardrone3.Landing()),
        "drone is landing",
        "goto turn offboard follow orbit mission",
    ),
    "own return": (return_by_itself, " refused: drone is returning", "goto turn offboard follow orbit mission"),
    "lost fix": (lambda w: setattr(w.drone.faults, "gps", False), " refused: no GPS fix", "follow orbit"),
    "camera sticks": (
        lambda w: another_controller(w, piloting_style.SetStyle(CAMERA)),
        " refused: sticks relative to camera",
        "offboard follow",
    ),
}
"""What ends a condition, the reason of the refusal, and the tasks that need it."""


@pytest.mark.parametrize(
    ("meanwhile", "name"),
    [(meanwhile, name) for meanwhile, (_, _, names) in MEANWHILE.items() for name in names.split()],
)
async def test_task_whose_conditions_end_in_its_wait_is_refused(meanwhile: str, name: str) -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [way(30.0, 0.0, UP)])
        await w.take_off(UP)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            await watched(0.3)
            await home_being_undone(w)
            mark = w.client.mark()
            await TASKS[name](w)
            await watched(1.0)
            began = now()
            end, reason, _ = MEANWHILE[meanwhile]
            end(w)
            results = dict(await until(w.client, mark, 2))
            results.pop(dialect.MAV_CMD_DO_SET_HOME)
            assert [*results.values()] == [REJECTED]
            await said(w.client, reason, mark)
            await watched(2.0)
        assert flown(w, began) == []
        beat = await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert beat.custom_mode in (w.modes.hold, w.modes.land, w.modes.returning)


async def test_follow_chosen_during_a_goto_stops_the_drone_until_a_target_is_known() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        await moving(w)
        assert (await w.client.command(SET_MODE, *FOLLOW)).result == ACCEPTED
        await watched(3.0)
        assert w.drone.pose.vn == pytest.approx(0.0, abs=0.2)


# Setpoints.


async def test_offboard_whose_setpoints_stop_in_its_wait_is_refused() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            await watched(0.3)
            await home_being_undone(w)
            mark, began = w.client.mark(), now()
            await offboard(w)
            await watched(1.0)
        assert (SET_MODE, REJECTED) in await until(w.client, mark, 2)
        assert flown(w, began) == []


async def test_offboard_chosen_on_the_ground_is_refused_when_the_drone_rises_in_its_wait() -> None:
    """Another controller takes off: its flight is not the session's."""
    async with world(speed=1.0) as w:
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            await watched(0.3)
            await home_being_undone(w)
            mark, began = w.client.mark(), now()
            await offboard(w)
            await watched(4.2)
            another_controller(w, ardrone3.TakeOff())
            assert (SET_MODE, REJECTED) in await until(w.client, mark, 2)
            assert w.drone.flying_state.name in ("MOTOR_RAMPING", "TAKINGOFF")
            await watched(4.0)
        assert motion(w, began) == []


async def test_offboard_while_a_mission_is_about_to_take_off_is_refused_and_the_mission_flies() -> None:
    """The drone has the start, and has not reported it: its take-off would be none of the session's."""
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(UP), way(30.0, 0.0, UP)])
        pilot = await w.connect(sysid=254)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.down = Impairment(delay=1.0)
        async with streaming(pilot, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            w.client.send_command(START)
            await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(".Start"), 10.0)
            mark = pilot.mark()
            assert (await pilot.command(SET_MODE, *OFFBOARD)).result == REJECTED
            await said(pilot, "Offboard refused: drone is about to take off", mark)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 40.0)


async def test_offboard_during_a_takeoff_is_refused_while_sticks_follow_the_camera() -> None:
    async with world(speed=1.0) as w:
        another_controller(w, piloting_style.SetStyle(CAMERA))
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)).result == ACCEPTED
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            await watched(0.3)
            assert (await w.client.command(SET_MODE, *OFFBOARD)).result == REJECTED
