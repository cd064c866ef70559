"""COMMAND_CANCEL: what is cancelled does not happen, and what happens is not said to be cancelled."""

from __future__ import annotations

from typing import Any

import pytest
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    CANCELLED,
    GOTO,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    being_tried,
    deaf,
    goto,
    heard,
    home_being_undone,
    now_mute,
    until,
    watched,
)
from support.mav import NAN, Client
from support.missions import put, way
from support.world import HOME, RETURN, World, world

from anafi_mav import geo
from anafi_mav.mavlink import dialect

MAV_CMD_DO_FLIGHTTERMINATION, PAUSE, STANDARD_MODE, START = (
    dialect.MAV_CMD_DO_FLIGHTTERMINATION,
    dialect.MAV_CMD_DO_PAUSE_CONTINUE,
    dialect.MAV_CMD_DO_SET_STANDARD_MODE,
    dialect.MAV_CMD_MISSION_START,
)


def call_off(client: Client, command: int) -> None:
    client.send(dialect.MAVLink_command_cancel_message(1, 1, command))


async def begin_goto(w: World) -> int:
    """Take off and send a goto that the drone does not receive yet; return the mark before it."""
    await w.take_off()
    deaf(w, 1.5)
    mark = w.client.mark()
    place = geo.destination(*HOME[:2], 40.0, 0.0)
    w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=10.0)
    await being_tried(w.client, mark, GOTO)
    return mark


async def test_cancelled_goto_is_not_flown() -> None:
    async with world(speed=1.0) as w:
        mark = await begin_goto(w)
        call_off(w.client, GOTO)
        assert await until(w.client, mark, 1) == [(GOTO, CANCELLED)]
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("CancelMoveTo"))
        assert heard(w, "moveTo") == []


@pytest.mark.parametrize(
    "change",
    [(dialect.MAV_CMD_DO_CHANGE_SPEED, 1.0, 5.0), (dialect.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0)],
    ids=["speed", "heading"],
)
async def test_change_of_a_goto_that_is_cancelled_in_its_wait_leaves_the_goto(change: tuple[Any, ...]) -> None:
    """The drone flies on to the place: a height keeps that, and the end of the move is reported."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        assert await goto(w, 90.0, 8.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        await home_being_undone(w)
        mark = w.client.mark()
        w.client.send_command(*change)
        await watched(0.5)
        call_off(w.client, change[0])
        assert (change[0], CANCELLED) in await until(w.client, mark, 2)
        ack = await w.client.command(dialect.MAV_CMD_DO_CHANGE_ALTITUDE, 12.0, 3.0, timeout=12.0)
        assert ack.result == ACCEPTED
        target = w.commands("ardrone3.Piloting.moveTo")[-1].args
        assert geo.offset(*HOME[:2], target["latitude"], target["longitude"])[0] > 89.0


@pytest.mark.parametrize("order", [(ARM, 0.0, 21196.0), (MAV_CMD_DO_FLIGHTTERMINATION, 1.0)])
async def test_motor_cut_cannot_be_cancelled(order: tuple[Any, ...]) -> None:
    async with world(allow_kill=True) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        deaf(w, 1.5)
        mark = w.client.mark()
        w.client.send_command(*order)
        await being_tried(w.client, mark, order[0])
        call_off(other, order[0])
        assert await until(w.client, mark, 1) == [(order[0], ACCEPTED)]
        assert w.drone.flying_state.name in ("EMERGENCY", "LANDED")


@pytest.mark.parametrize("order", [(TAKEOFF_CMD,), (SET_MODE, 1.0, 4.0, 2.0), (STANDARD_MODE, 8.0)])
async def test_received_takeoff_cannot_be_cancelled(order: tuple[Any, ...]) -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        muted = now_mute(w, "ardrone3.Piloting.TakeOff", 0.7)
        mark = w.client.mark()
        w.client.send_command(*order)
        await muted
        call_off(w.client, order[0])
        assert await until(w.client, mark, 1) == [(order[0], ACCEPTED)]
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "takingoff")


async def test_received_return_cannot_be_cancelled() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        muted = now_mute(w, "rth.return_to_home", 0.5)
        mark = w.client.mark()
        w.client.send_command(RTL)
        await muted
        call_off(w.client, RTL)
        assert await until(w.client, mark, 1) == [(RTL, ACCEPTED)]
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)


async def test_stop_is_not_cancelled_by_another_client() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        deaf(w, 1.5)
        mark = w.client.mark()
        w.client.send_command(PAUSE, 0)
        await being_tried(w.client, mark, PAUSE)
        call_off(other, PAUSE)
        assert await until(w.client, mark, 1) == [(PAUSE, ACCEPTED)]
        await watched(0.2)
        assert heard(w, "CancelMoveTo") == ["CancelMoveTo"]


async def test_start_of_another_client_that_waits_for_a_cancelled_one_is_flown() -> None:
    """The cancellation is repeated, as MAVLink allows, until its sender has seen its acknowledgement."""
    async with world(speed=1.0, web=True) as w:
        other = await w.connect(sysid=250)
        await put(w, [way(40.0, 0.0, 6.0), way(40.0, 30.0, 6.0)])
        await w.take_off()
        deaf(w, 1.5)
        mark, others = w.client.mark(), other.mark()
        w.client.send_command(START)
        await being_tried(w.client, mark, START)
        other.send_command(START)
        await being_tried(other, others, START)
        for _ in range(3):
            call_off(w.client, START)
            await watched(0.1)
        assert await until(w.client, mark, 1) == [(START, CANCELLED)]
        assert await until(other, others, 1) == [(START, ACCEPTED)]
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "playing")


async def test_mission_start_that_is_cancelled_on_the_ground_warns_of_the_takeoff() -> None:
    """The drone has received it, and pauses once it hovers: as after a Hold."""
    async with world(speed=1.0, web=True) as w:
        await put(w, [way(40.0, 0.0, 6.0), way(40.0, 30.0, 6.0)])
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        muted = now_mute(w, "common.Mavlink.Start", 0.3)
        mark = w.client.mark()
        w.client.send_command(START)
        await muted
        call_off(w.client, START)
        assert await until(w.client, mark, 1) == [(START, CANCELLED)]
        text = "Cancelled: takeoff possible, to 1 m"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 10.0)
        await watched(2.0)
        assert w.drone.pose.up < 1.5


async def test_goto_is_cancelled_by_another_client() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        mark = await begin_goto(w)
        call_off(other, GOTO)
        assert await until(w.client, mark, 1) == [(GOTO, CANCELLED)]
