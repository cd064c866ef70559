"""Propellers that turn on the ground stop, Landing counts in the end, and a pause holds against every stream."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    CANCELLED,
    DENIED,
    LAND_CMD,
    REJECTED,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    heard,
    until,
    watched,
)
from support.mav import NAN, Client
from support.params import write
from support.world import ARMED, World, world

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.takeoff import LOW

FORCE = 21196
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
DISARM = (ARM, 0)
BAD_AIR = Impairment(loss=0.25, delay=0.2)


def flown(w: World) -> list[str]:
    return [entry.args["to"] for entry in w.drone.log if entry.name == "flying"]


async def state(w: World, name: str, timeout: float = 10.0) -> None:
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == name, timeout)


async def ramping(w: World, *quirks: Quirk) -> None:
    """The motors ramp up for a take-off, and the client sees that."""
    w.drone.faults.quirks = frozenset(quirks)
    assert (await w.client.command(ARM, 1)).result == ACCEPTED
    w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
    await state(w, "motor_ramping")
    await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == dialect.MAV_LANDED_STATE_TAKEOFF)


@pytest.mark.parametrize("force", [0, FORCE])
async def test_disarm_stops_ramping_motors(force: int) -> None:
    async with world(speed=1.0) as w:
        await ramping(w)
        assert (await w.client.command(*DISARM, force)).result == ACCEPTED
        assert flown(w)[-1] == "landed"
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)
        await watched(2.0)
        assert "takingoff" not in flown(w)


async def test_forced_disarm_without_allow_kill_cuts_motors_ignoring_landing() -> None:
    async with world(speed=0.5) as w:
        await ramping(w, Quirk.RAMPING_IGNORES_LANDING)
        assert (await w.client.command(*DISARM, FORCE)).result == ACCEPTED
        assert heard(w, "Emergency") == ["Emergency"]
        assert "takingoff" not in flown(w)


async def test_disarm_with_ignored_landing_is_accepted_after_landing() -> None:
    async with world(speed=1.0) as w:
        await ramping(w, Quirk.RAMPING_IGNORES_LANDING)
        mark = w.client.mark()
        assert (await w.client.command(*DISARM, timeout=20.0)).result == ACCEPTED
        assert flown(w)[-1] == "landed"
        assert heard(w, "Emergency") == []
        progress = [m for _, m in w.client.since(mark, "COMMAND_ACK") if m.result == dialect.MAV_RESULT_IN_PROGRESS]
        assert progress != []


async def test_disarm_before_a_late_takeoff_is_not_accepted_by_a_repeated_landed() -> None:
    """The drone reports LANDED once more before it has received the TakeOff, and the Landing behind it."""
    async with world(speed=1.0) as w:
        w.drone.faults.quirks = frozenset({Quirk.RAMPING_IGNORES_LANDING})
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.up = Impairment(delay=1.0)
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await watched(0.3)
        w.client.send_command(*DISARM)
        await watched(0.2)
        w.drone.inject(ardrone3.FlyingStateChanged(FlyingState.LANDED))
        assert await until(w.client, mark, 2) == [(TAKEOFF_CMD, CANCELLED), (ARM, REJECTED)]
        await state(w, "landed", 20.0)
        assert w.drone.pose.up == pytest.approx(0.0, abs=0.01)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED)


async def test_disarm_just_above_the_ground_lands_the_drone() -> None:
    async with world(speed=0.3) as w:
        await ramping(w)
        await state(w, "takingoff", 20.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and 0.02 < e.args["up"] < 0.3, 20.0)
        assert (await w.client.command(*DISARM, FORCE, timeout=30.0)).result == ACCEPTED
        assert flown(w)[-2:] == ["landing", "landed"]
        assert heard(w, "Emergency") == []


@pytest.mark.parametrize(("force", "result"), [(0, REJECTED), (FORCE, DENIED)])
async def test_disarm_above_half_a_metre_during_the_takeoff_is_refused(force: int, result: int) -> None:
    async with world(speed=0.3) as w:
        await ramping(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > LOW + 0.15, 20.0)
        assert w.drone.flying_state.name == "TAKINGOFF"
        assert (await w.client.command(*DISARM, force)).result == result
        assert heard(w, "Emergency", "Landing", "UserTakeOff") == []
        await w.at_height(5.0)


@pytest.mark.parametrize(("force", "result"), [(0, REJECTED), (FORCE, DENIED)])
async def test_disarm_in_the_air_is_refused_as_before(force: int, result: int) -> None:
    async with world() as w:
        await w.take_off(5.0)
        assert (await w.client.command(*DISARM, force)).result == result
        assert heard(w, "Emergency", "Landing") == []


async def test_disarm_stops_a_hand_launch() -> None:
    async with world(speed=1.0) as w:
        w.drone.firmware.receive(ardrone3.UserTakeOff(1), asyncio.get_running_loop().time())
        await state(w, "usertakeoff")
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == dialect.MAV_LANDED_STATE_TAKEOFF, since=0)
        assert (await w.client.command(*DISARM)).result == ACCEPTED
        assert flown(w)[-1] == "landed"


@pytest.mark.parametrize("command", [(LAND_CMD,), DISARM])
@pytest.mark.parametrize("is_own", [True, False])
async def test_motors_in_a_hand_that_ignore_a_stop_as_they_ramp_up_are_stopped(
    command: tuple[int, ...], is_own: bool
) -> None:
    async with world(speed=1.0, quirks=(Quirk.RAMPING_IGNORES_LANDING.value,)) as w:
        if is_own:
            await write(w.client, "ANF_HAND_LAUNCH", 1, dialect.MAV_PARAM_TYPE_INT32)
            w.client.send_command(ARM, 1)
        else:
            another_controller(w, ardrone3.UserTakeOff(1))
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == dialect.MAV_LANDED_STATE_TAKEOFF)
        mark = w.client.mark()
        w.client.send_command(*command)
        await state(w, "landed")
        assert (command[0], ACCEPTED) in await until(w.client, mark, 2 if is_own else 1)
        assert flown(w) == ["motor_ramping", "usertakeoff", "landed"]


@pytest.mark.parametrize("air", [Impairment(), BAD_AIR])
@pytest.mark.parametrize("quirks", [(), (Quirk.RAMPING_IGNORES_LANDING,)])
async def test_land_while_motors_ramp_lands(quirks: tuple[Quirk, ...], air: Impairment) -> None:
    async with world(speed=1.0) as w:
        await ramping(w, *quirks)
        w.drone.faults.up = w.drone.faults.down = air
        assert (await w.client.command(LAND_CMD, timeout=15.0)).result == ACCEPTED
        await state(w, "landed", 20.0)
        await watched(2.0)
        assert flown(w)[-1] == "landed"


# A pause.


@asynccontextmanager
async def companion(client: Client, *, position: bool = False) -> AsyncIterator[None]:
    """A program in Guided that flies north at 2 m/s, or 300 m north of the drone."""

    async def stream() -> None:
        for _ in itertools.count():
            mask = 0b110111111000 if position else 0b110111000111
            client.send(
                dialect.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, 1, mask, 300.0, 0, -10.0, 2.0, 0, 0, 0, 0, 0, 0, 0
                )
            )
            await asyncio.sleep(1.0 if position else 0.1)

    task = asyncio.ensure_future(stream())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def standing(w: World) -> None:
    """The drone has braked, and then does not fly anywhere for three seconds."""
    await w.drone.wait_log(lambda entry: w.drone.pose.ground_speed < 0.3, 15.0)
    where = w.drone.pose.north
    await watched(3.0)
    assert abs(w.drone.pose.north - where) < 0.7
    assert w.drone.pose.ground_speed < 0.5


PAUSES: dict[str, tuple[int, tuple[float, ...]]] = {
    "DO_PAUSE_CONTINUE": (PAUSE, (0,)),
    "DO_REPOSITION": (dialect.MAV_CMD_DO_REPOSITION, (-1, 0, 0, NAN)),
}


@pytest.mark.parametrize("pause", PAUSES)
@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize("own", [False, True])
async def test_pause_holds_against_setpoints_of_every_client(pause: str, position: bool, own: bool) -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        program = await w.connect(sysid=240)
        await w.take_off(10.0)
        async with companion(program, position=position):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 15.0)
            who = program if own else w.client
            mark = program.mark()
            id, params = PAUSES[pause]
            assert (await who.command(id, *params)).result == ACCEPTED
            await standing(w)
            await w.client.heartbeat(lambda beat: beat.custom_mode == 4)  # Guided stays shown
            await program.wait("STATUSTEXT", lambda m: "paused by a client" in m.text, since=mark)
            # Choosing the shown mode again changes nothing.
            assert (await who.command(SET_MODE, 1, 4)).result == ACCEPTED
            await standing(w)
            assert (await who.command(PAUSE, 1)).result == ACCEPTED
            await w.drone.wait_log(lambda entry: w.drone.pose.vn > 1.0, 15.0)


async def test_refusal_without_a_flying_state_does_not_place_the_drone_in_the_air() -> None:
    def silent(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({ardrone3.FlyingStateChanged.NAME})

    async with world(before=silent) as w:
        for what, command, params in (("Takeoff", TAKEOFF_CMD, ()), ("Disarm", *DISARM[:1], DISARM[1:])):
            mark = w.client.mark()
            ack = await w.client.command(command, *params, x=0.0, y=0.0, z=5.0)
            assert ack.result == REJECTED
            text = await w.client.wait("STATUSTEXT", lambda m: "refused" in m.text, since=mark)
            assert text.text == f"{what} refused: flying state unknown"
