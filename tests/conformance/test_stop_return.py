"""A person can end a return, no matter who began it; a program that repeats its Hold ends none of the drone's own."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest
from support.callers import CALLERS, system_of
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    LAND_CMD,
    PX4_HOLD,
    REJECTED,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    goto,
    heard,
    results,
    watched,
)
from support.mav import Client
from support.world import HOLD, RETURN, World, world

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import RthHomeReachability, StateReason
from anafi_mav.errors import AnafiMavError
from anafi_mav.sim.autopilot import power
from anafi_mav.sim.autopilot.homing import ReturnPhase
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.hold_rule import APART

BAD_AIR = Impairment(loss=0.25, delay=0.2)
PX4_POSITION = (1, 3, 0)
CRITICAL = 2
"""MAV_SEVERITY."""


def by_itself(w: World, reason: StateReason = StateReason.LOW_BATTERY) -> None:
    """The drone begins to return for a reason of its own."""
    firmware = w.drone.firmware
    assert firmware.homing.request(reason, firmware.pose, False)


def flag_sticks(w: World) -> None:
    """Centred sticks with flag 1: a firmware that remembers the flag does not hover any more."""
    w.drone.firmware.guidance.pilot(ardrone3.PCMD(1, 0, 0, 0, 0, 0), asyncio.get_running_loop().time())


async def hold(client: Client) -> int:
    return int((await client.command(SET_MODE, *PX4_HOLD, timeout=12.0)).result)


async def in_phase(w: World, phase: ReturnPhase) -> None:
    """Wait until the return of the simulated drone has come to this phase."""

    await w.drone.wait_log(lambda entry: w.drone.firmware.homing.phase is phase, 60.0)


async def text(client: Client, words: str, since: int = 0, timeout: float = 5.0) -> Any:
    return await client.wait("STATUSTEXT", lambda m: words in m.text, since=since, timeout=timeout)


@pytest.mark.parametrize("state", ["motor_ramping", "takingoff"])
async def test_return_during_takeoff_is_flown_from_the_first_hover(state: str) -> None:
    """The drone ignores a return while it takes off; a person who has commanded it must not be left hovering."""
    async with world() as w:
        await w.drone.wait_log(lambda e: e.kind == "pose", 10.0)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == state, 10.0)
        w.client.send_command(RTL)
        await w.client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (RTL, ACCEPTED), since=mark, timeout=10.0)
        assert w.drone.firmware.homing.active
        assert [result for command, result in results(w.client, mark) if command == RTL] == [ACCEPTED]


async def away(w: World) -> None:
    """Fly 40 m north at 8 m, so that a return climbs, cruises and descends."""
    await w.take_off(8.0)
    speed, w.simulator.speed = w.simulator.speed, 8.0
    assert await goto(w, 40.0, 8.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 39.0, 30.0)
    w.simulator.speed = speed


PHASES = [ReturnPhase.PENDING, ReturnPhase.CLIMB, ReturnPhase.CRUISE, ReturnPhase.DESCEND]


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("own", [False, True])
async def test_second_clients_hold_ends_a_return_in_each_phase(phase: ReturnPhase, own: bool) -> None:
    """200 ms each way, a quarter lost."""
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await away(w)
        if phase is ReturnPhase.PENDING:  # a firmware that never hovers keeps the return waiting
            w.drone.faults.quirks = frozenset({Quirk.FLAG_REMEMBERED})
            flag_sticks(w)
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "flying", 5.0)
        if own:
            by_itself(w, StateReason.ICING if phase is ReturnPhase.PENDING else StateReason.LOW_BATTERY)
        else:
            w.client.send_command(RTL)
            if phase is ReturnPhase.PENDING:
                flag_sticks(w)
        await in_phase(w, phase)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        w.drone.faults.up = w.drone.faults.down = BAD_AIR
        mark = other.mark()
        assert await hold(other) == ACCEPTED
        assert heard(w, "abort") != []
        await other.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark)
        assert w.drone.firmware.homing.phase is ReturnPhase.IDLE
        where = w.drone.pose
        await watched(3.0)
        assert abs(w.drone.pose.north - where.north) < 10.0
        assert w.drone.firmware.homing.phase is ReturnPhase.IDLE
        if own:
            await text(w.client, "Return aborted by system 250: ")


async def test_hold_within_five_seconds_of_another_keeps_drones_return() -> None:
    async with world(speed=1.0) as w:
        await away(w)
        assert await hold(w.client) == ACCEPTED
        by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        mark = w.client.mark()
        assert await hold(w.client) == REJECTED
        await text(w.client, "Hold refused: again within 5 s", mark)
        assert heard(w, "abort") == []
        await asyncio.sleep(APART + 0.2)
        assert await hold(w.client) == ACCEPTED


async def test_return_with_a_failed_motor_cannot_be_ended() -> None:
    async with world(speed=1.0) as w:
        await away(w)
        by_itself(w, StateReason.MOTOR_DOWN)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        assert await hold(w.client) == REJECTED
        assert heard(w, "abort") == []


async def test_aborted_return_is_repeated_to_all_until_landed() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await away(w)
        w.drone.faults.battery = 40
        w.drone.inject(rth.HomeReachability(RthHomeReachability.CRITICAL))
        by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        mark = w.client.mark()
        assert await hold(other) == ACCEPTED
        for words in ("Return aborted by system 250: low battery", "No automatic return: battery ", "land now"):
            assert (await text(w.client, words, mark)).severity == CRITICAL
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "Return stopped" in m.text]
        mark = w.client.mark()
        await text(w.client, "Return aborted by system 250: low battery", mark, timeout=20.0)
        await text(w.client, "No automatic return: battery ", mark)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        mark = w.client.mark()
        await watched(16.0)
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "Return aborted" in m.text]


async def test_lost_connection_as_the_reason_is_reported_once() -> None:
    async with world(speed=1.0) as w:
        await away(w)
        by_itself(w, StateReason.CONNECTION_LOST)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        mark = w.client.mark()
        assert await hold(w.client) == ACCEPTED
        await text(w.client, "Return aborted by system 255: connection lost", mark)
        mark = w.client.mark()
        await watched(16.0)
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "Return aborted" in m.text]


@pytest.mark.parametrize("skycontroller", [3])
async def test_return_by_skycontroller_button_is_ended_by_no_client(skycontroller: int) -> None:
    async with world(speed=1.0, skycontroller=skycontroller) as w:
        await away(w)
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        mark = w.client.mark()
        assert await hold(w.client) == REJECTED
        await text(w.client, "Hold refused: Skycontroller pilot is returning", mark)
        assert heard(w, "abort") == []


@pytest.mark.parametrize("caller", CALLERS)
@pytest.mark.parametrize("own", [False, True])
async def test_no_caller_without_a_clients_right_ends_a_return(caller: str, own: bool) -> None:
    async with world(speed=1.0) as w:
        await away(w)
        if own:
            by_itself(w)
        else:
            assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        with contextlib.suppress(AnafiMavError):
            await CALLERS[caller](system_of(w))
        await watched(0.5)
        assert heard(w, "abort") == []
        assert w.drone.firmware.homing.active


@pytest.mark.parametrize("command", [RTL, LAND_CMD])
async def test_ending_gateway_keeps_an_unconfirmed_return_or_landing(command: int) -> None:
    async with world(speed=1.0) as w:
        await away(w)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        w.client.send_command(command)
        await asyncio.sleep(0.1)
        await system_of(w).let_go()
        await watched(0.5)
        assert heard(w, "abort") == []
        assert w.drone.firmware.homing.active if command == RTL else w.drone.firmware.state is FlyingState.LANDING


# An announced return.


async def announced(w: World, seconds: float) -> None:
    """The battery runs low, so that the drone announces its return in so many seconds."""
    firmware = w.drone.firmware
    needed = firmware.endurance.needed(w.drone.pose, (0.0, 0.0))
    firmware.battery.charge = power.CRITICAL + needed + seconds * firmware.endurance.rate
    await w.drone.wait_log(lambda e: e.name == "rth.rth_auto_trigger" and e.args["reason"] != 0, 5.0)
    await text(w.client, "Drone returns home")


def returned(w: World) -> bool:
    return any(e.name == "rth.state" and e.args["reason"] == StateReason.LOW_BATTERY for e in w.drone.log)


async def test_second_hold_of_one_client_cancels_announced_return() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await away(w)
        await announced(w, 20.0)
        mark = w.client.mark()
        assert await hold(w.client) == ACCEPTED
        assert (await text(w.client, "Returns in ", mark)).text.endswith(" s: Hold again cancels")
        assert heard(w, "cancel_auto_trigger", "abort") == []
        await asyncio.sleep(APART + 0.3)
        assert await hold(other) == ACCEPTED  # another client's first
        assert heard(w, "cancel_auto_trigger") == []
        mark = w.client.mark()
        assert await hold(w.client) == ACCEPTED
        assert heard(w, "cancel_auto_trigger") == ["cancel_auto_trigger"]
        await text(w.client, "Return aborted by system 255: low battery", mark)
        await text(w.client, "No automatic return: battery ", mark)
        await watched(16.0)
        assert not returned(w)


async def test_second_hold_counts_neither_too_early_nor_too_late() -> None:
    async with world(speed=1.0) as w:
        await away(w)
        await announced(w, 29.0)
        assert await hold(w.client) == ACCEPTED
        await asyncio.sleep(3.0)
        assert await hold(w.client) == ACCEPTED  # does not count
        await asyncio.sleep(13.0)
        mark = w.client.mark()
        assert await hold(w.client) == ACCEPTED  # counts as the first again
        await text(w.client, "Hold again cancels", mark)
        assert heard(w, "cancel_auto_trigger") == []


async def test_hold_at_one_hertz_never_cancels_an_announced_return() -> None:
    """200 ms each way and a quarter lost, through the countdown and the return that follows."""
    async with world(speed=1.0) as w:
        program = await w.connect(sysid=240)
        await away(w)

        async def repeat() -> None:
            while True:
                program.send_command(SET_MODE, *PX4_HOLD)
                await asyncio.sleep(1.0)

        task = asyncio.ensure_future(repeat())
        try:
            await asyncio.sleep(1.5)
            await announced(w, 14.0)
            w.drone.faults.up = w.drone.faults.down = BAD_AIR
            await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, timeout=30.0)
            await watched(6.0)
        finally:
            task.cancel()
            await asyncio.wait([task])
        assert heard(w, "cancel_auto_trigger", "abort") == []
        assert w.drone.firmware.homing.flying
