"""What was asked for once, or is still being streamed, does not get in the way of a newer order."""

from __future__ import annotations

import asyncio
import itertools
from typing import Any

import pytest
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    LAND_CMD,
    PX4_HOLD,
    RTL,
    SET_MODE,
    deaf,
    goto,
    home_being_undone,
    watched,
)
from support.flavours import both
from support.missions import ROUND, put
from support.setpoints import (
    COPTER_BRAKE,
    COPTER_GUIDED,
    POSITION_ONLY,
    VELOCITY_ONLY,
    arrived,
    earth,
    engage,
    heard,
    local,
    motion,
    said,
    streaming,
    texts,
)
from support.world import ARMED, HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import rth
from anafi_mav.mavlink import dialect
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.vehicle.offboard.moves import RETRY
from anafi_mav.vehicle.takeoff import AUTO_DISARM

SPEED, ALTITUDE, YAW, PAUSE, MISSION_START = (
    dialect.MAV_CMD_DO_CHANGE_SPEED,
    dialect.MAV_CMD_DO_CHANGE_ALTITUDE,
    dialect.MAV_CMD_CONDITION_YAW,
    dialect.MAV_CMD_DO_PAUSE_CONTINUE,
    dialect.MAV_CMD_MISSION_START,
)
COPTER_LOITER = 5

SLOW = Impairment(delay=0.4)
"""What the drone says of an order comes that much later."""


def now() -> float:
    return asyncio.get_running_loop().time()


def moves(w: World) -> list[tuple[float, float]]:
    """Places that the drone was sent to, m north and east of home."""
    names = ("ardrone3.Piloting.moveTo", "move.extended_move_to")
    sent = [e.args for e in w.drone.log if e.kind == "command" and e.name in names]
    return [geo.offset(*HOME[:2], args["latitude"], args["longitude"]) for args in sent]


# -- places of before


@pytest.mark.parametrize(
    ("orders", "up"),
    [
        ([(SPEED, 1, 3.0, -1)], 12.0),
        ([(ALTITUDE, 15.0, 3.0)], 15.0),
        ([(YAW, 90.0, 0.0, 0.0, 0.0)], 12.0),
        ([(PAUSE, 0), (PAUSE, 1)], 12.0),
    ],
    ids=["speed", "height", "heading", "pause and continue"],
)
async def test_reached_position_is_not_flown_to_again(orders: list[Any], up: float) -> None:
    """What changes a move changes the one that is under way, a single setpoint's too."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        began = now()
        assert await goto(w, 6.0, 8.0) == ACCEPTED
        await arrived(w, began)
        began = now()
        w.client.send(earth(POSITION_ONLY, 6, 0.0, 60.0, 12.0))
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 3.0, 10.0, since=began)
        for order in orders:
            assert (await w.client.command(*order)).result == ACCEPTED
        assert moves(w)[-1] == pytest.approx((0.0, 60.0), abs=0.1)
        await arrived(w, now())
        pose = w.drone.pose
        assert (pose.north, pose.east, pose.up) == pytest.approx((0.0, 60.0, up), abs=0.5)


# -- streams of before


@pytest.mark.parametrize("together", [False, True], ids=["later", "together"])
async def test_setpoints_do_not_end_a_landing_before_it_begins(together: bool) -> None:
    """A program that sends one velocity a second, as MAVProxy's does, flies the drone for half of each second only."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        w.drone.faults.down = SLOW
        mark, began = w.client.mark(), now()
        w.client.send_command(LAND_CMD)
        if not together:
            await w.drone.wait_log(lambda e: e.name.endswith(".Landing"), 5.0, since=began)
        w.client.send(local(VELOCITY_ONLY, v=(2.0, 0.0, -1.0)))
        ack = await w.client.wait("COMMAND_ACK", lambda m: m.command == LAND_CMD and m.result != 5, since=mark)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
        assert motion(w, began) == []


@both
@pytest.mark.parametrize("order", [RTL, PAUSE])
async def test_held_stick_does_not_end_a_command_before_start(flavour: str, order: int) -> None:
    """It is streamed all the time; the mode that it flies in is over when something else is ordered."""
    async with world(speed=1.0, flavour=flavour) as w:
        await w.take_off(8.0)
        assert (await w.client.command(SET_MODE, *((1, 3, 0) if flavour == "px4" else (1, COPTER_LOITER)))).result == 0
        stick = dialect.MAVLink_manual_control_message(1, 600, 0, 500, 0, 0)
        async with streaming(w.client, stick, 0.04):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)
            w.drone.faults.down = SLOW
            mark, began = w.client.mark(), now()
            w.client.send_command(order, 0)
            await w.client.wait("COMMAND_ACK", lambda m: m.command == order and m.result == ACCEPTED, since=mark)
            await watched(1.0)
        ordered = next((e.t for e in heard(w, "return_to_home", since=began)), began)
        later = [e for e in heard(w, "PCMD", since=ordered) if e.t > ordered]
        assert {e.args["pitch"] for e in later[2:]} <= {0}


@pytest.mark.parametrize("order", [LAND_CMD, RTL, PAUSE])
async def test_command_ended_by_link_loss_restores_no_old_mode(order: int) -> None:
    """The setpoint that comes when the drone is there again finds it in Brake, not in Guided."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        assert await goto(w, 30.0, 8.0) == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == COPTER_GUIDED)
        w.drone.faults.mute = True
        w.client.send_command(order, 0)
        await silent(w)
        w.drone.faults.mute = False
        mark = w.client.mark()
        beat = await w.client.heartbeat(lambda beat: True, since=mark, timeout=10.0)
        assert beat.custom_mode == COPTER_BRAKE
        since = now()
        w.client.send(local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0)))
        await said(w.client, ", not Guided", mark)
        assert motion(w, since) == []


async def silent(w: World) -> None:
    """No heartbeat any more, for as long as two would take."""
    while True:
        mark = w.client.mark()
        await watched(2.1)
        if not w.client.since(mark, "HEARTBEAT"):
            return


# -- single setpoints of before


async def test_failed_single_position_is_not_repeated() -> None:
    """Its sender was notified that it is not flown, and is silent since."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        w.drone.faults.magneto_required = True
        await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.UNAVAILABLE, 5.0)
        mark = w.client.mark()
        w.client.send(earth(POSITION_ONLY, 6, 20.0, 0.0, 10.0))
        await said(w.client, "Setpoint dropped", mark)
        w.drone.faults.magneto_required = False
        tried = len(moves(w))
        await watched(3.0 * RETRY)
        assert len(moves(w)) == tried
        assert abs(w.drone.pose.north) < 0.5


async def test_failed_stream_of_positions_is_repeated() -> None:
    """As long as it is asked for."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        w.drone.faults.magneto_required = True
        await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.UNAVAILABLE, 5.0)
        mark, began = w.client.mark(), now()
        async with streaming(w.client, earth(POSITION_ONLY, 6, 20.0, 0.0, 10.0)):
            await said(w.client, "Setpoint dropped", mark)
            w.drone.faults.magneto_required = False
            await arrived(w, began)
        assert w.drone.pose.north == pytest.approx(20.0, abs=0.5)


# -- an armed state of before


async def test_heartbeat_stays_armed_before_a_mission_lifts_off() -> None:
    """The start is on a bad way to the drone when the ten seconds since arming are over."""
    async with world(flavour="ardupilot", web=True) as w:
        await put(w, ROUND)
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await watched(AUTO_DISARM - 1.0)
        deaf(w, 2.0)
        w.client.send_command(MISSION_START, 0, 0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] != "landed", 30.0)
        await w.client.wait("HEARTBEAT")
        assert not any("Disarmed" in text for text in texts(w.client, mark))
        beats = [beat for _, beat in w.client.since(mark, "HEARTBEAT")]
        first = next(number for number, beat in enumerate(beats) if beat.base_mode & ARMED)
        assert all(beat.base_mode & ARMED for beat in beats[first:])


@pytest.mark.parametrize(
    "setpoint",
    [earth(POSITION_ONLY, 6, 20.0, 0.0, 8.0), local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))],
    ids=["position", "velocity"],
)
async def test_guided_setpoint_that_has_waited_too_long_is_dropped(setpoint: Any) -> None:
    """It waits until a home is undone; its sender may be silent since."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(8.0)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send(setpoint)
        await said(w.client, "waited too long", mark)
        await watched(2.0)
        assert motion(w, began) == []


async def test_newest_position_of_a_stream_is_not_flown_after_a_hold() -> None:
    """A place that follows another one at once waits until the drone may receive it: a Hold ends that wait."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        north = itertools.count(20.0, 0.5)
        async with streaming(w.client, lambda: local(POSITION_ONLY, at=(next(north), 0.0, -8.0))):
            await engage(w.client, "px4")
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 15.0)
            assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
            began = now()
            await watched(3.0)
        assert motion(w, began) == []
