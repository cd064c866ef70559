"""A goto that ends short of its target: every client is notified, and the same command is flown again."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    GOTO,
    IN_PROGRESS,
    REJECTED,
    another_controller,
    goto,
    heard,
    return_by_itself,
    until,
)
from support.mav import NAN
from support.setpoints import POSITION_ONLY, earth, engage, said, streaming, texts
from support.world import HOLD, HOME, RETURN, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.skyctrl import Source

DENIED = dialect.MAV_RESULT_DENIED

PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

AWAY = 200.0
"""m north: the move takes longer than a test."""


async def on_its_way(w: World) -> None:
    await w.take_off(10.0)
    assert await goto(w, AWAY, 10.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)


async def test_goto_that_the_drone_aborts_is_reported_and_flown_when_sent_again() -> None:
    """The same command within the time of a retransmission: it is no retransmission of what did not happen."""
    async with world(speed=1.0) as w:
        await on_its_way(w)
        mark = w.client.mark()
        w.drone.faults.gps = False
        await said(w.client, "Goto ended: drone aborted the move", mark)
        w.drone.faults.gps = True
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type >= dialect.GPS_FIX_TYPE_3D_FIX, since=w.client.mark())
        assert await goto(w, AWAY, 10.0) == ACCEPTED
        assert len(heard(w, "moveTo")) == 2


async def test_goto_after_one_that_has_failed_is_flown_once_and_answered_when_sent_again() -> None:
    async with world(speed=1.0) as w:
        await on_its_way(w)
        mark = w.client.mark()
        another_controller(w, ardrone3.CancelMoveTo())
        await said(w.client, "Goto ended: ", mark)
        for _ in range(2):
            assert await goto(w, 100.0, 10.0) == ACCEPTED
        await asyncio.sleep(1.0)  # what is sent twice arrives
        assert len(heard(w, "moveTo")) == 2


async def test_height_command_after_a_goto_that_was_cancelled_elsewhere_keeps_the_place() -> None:
    """Not the target of the goto, although no location has arrived since."""
    async with world(speed=1.0) as w:
        await on_its_way(w)
        mark = w.client.mark()
        await w.client.wait("GLOBAL_POSITION_INT", since=mark)
        another_controller(w, ardrone3.CancelMoveTo())
        await said(w.client, "Goto ended: ", mark)
        ack = await w.client.command(dialect.MAV_CMD_DO_CHANGE_ALTITUDE, 20.0, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        assert ack.result == ACCEPTED
        target = w.commands("ardrone3.Piloting.moveTo")[-1].args
        assert geo.offset(*HOME[:2], target["latitude"], target["longitude"])[0] < 50.0


@pytest.mark.parametrize(("north", "height"), [(20.0, 1000.0), (9000.0, 10.0)], ids=["height", "place"])
async def test_goto_that_is_refused_during_the_climb_leaves_the_one_that_waits(north: float, height: float) -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=10.0)).result == ACCEPTED
        mark, place = w.client.mark(), geo.destination(*HOME[:2], 15.0, 0.0)
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=10.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.result == IN_PROGRESS, since=mark)
        assert await goto(w, north, height) == DENIED
        assert w.drone.pose.up < 8.0
        assert (await until(w.client, mark, 2))[-1] == (GOTO, ACCEPTED)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["north"] - 15.0) < 1.0, 20.0)


async def test_goto_ended_by_the_pilot_is_reported_and_refused_when_sent_again() -> None:
    async with world(skycontroller=3, speed=1.0) as w:
        await on_its_way(w)
        pilot = w.drone.skycontroller
        assert pilot is not None
        mark = w.client.mark()
        pilot.stick(PITCH_STICK, 40)
        await said(w.client, "Goto ended: Skycontroller pilot in control", mark)
        assert pilot.source is Source.SKY_CONTROLLER
        assert await goto(w, AWAY, 10.0) == REJECTED


@pytest.mark.parametrize("returns", [True, False])
async def test_goto_ended_by_the_drones_return_is_refused_meanwhile_and_flown_after_it(returns: bool) -> None:
    """The same command within the time of a retransmission: what was accepted is not done any longer."""
    async with world(speed=1.0) as w:
        await on_its_way(w)
        mark = w.client.mark()
        return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, since=mark)
        if not returns:
            another_controller(w, rth.Abort())
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        assert await goto(w, AWAY, 10.0) == (REJECTED if returns else ACCEPTED)
        if returns:
            await said(w.client, "Goto refused: drone is returning", mark)
        assert len(heard(w, "moveTo")) == (1 if returns else 2)


@pytest.mark.parametrize(
    "command", [(dialect.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0), (dialect.MAV_CMD_DO_PAUSE_CONTINUE, 1)]
)
async def test_turn_or_continuation_is_refused_when_sent_again_during_the_drones_return(
    command: tuple[float, ...],
) -> None:
    async with world(speed=1.0) as w:
        await on_its_way(w)
        if command[0] == dialect.MAV_CMD_DO_PAUSE_CONTINUE:
            assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == ACCEPTED
        id, *params = command
        assert (await w.client.command(int(id), *params)).result == ACCEPTED
        return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        assert (await w.client.command(int(id), *params)).result == REJECTED


async def test_goto_replaced_by_a_command_of_a_client_has_no_text_about_its_end() -> None:
    async with world(speed=1.0) as w:
        await on_its_way(w)
        mark = w.client.mark()
        assert await goto(w, 100.0, 10.0) == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3)).result == ACCEPTED
        assert await goto(w, AWAY, 10.0) == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.wait("HEARTBEAT")
        await asyncio.sleep(1.0)  # the drone's events about what was replaced
        assert [text for text in texts(w.client, mark) if text.startswith("Goto")] == []


@pytest.mark.parametrize("seed", [2, 16])
async def test_goto_to_the_place_of_a_cancelled_move_is_acknowledged_as_it_is_flown(seed: int) -> None:
    """The drone reports the end of the cancelled move twice, the second time after the goto was sent."""
    async with world(speed=1.0, quirks=(f"scramble:{seed}",)) as w:
        await w.take_off(10.0)
        place = geo.destination(*HOME[:2], 40.0, 0.0)
        x, y = round(place[0] * 1e7) / 1e7, round(place[1] * 1e7) / 1e7
        async with streaming(w.client, earth(POSITION_ONLY, 6, place=(x, y), height=10.0)):
            await engage(w.client, "px4")
            await asyncio.sleep(1.5)  # on the way
        await asyncio.sleep(0.46)  # the silence that ends the move
        ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, x=x, y=y, z=10.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["north"] - 40.0) < 1.0, 20.0)
