"""A goto that ends short of its target: every client is notified, and the same command is flown again."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, REJECTED, goto, heard
from support.mav import NAN
from support.setpoints import POSITION_ONLY, earth, engage, said, streaming, texts
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages.skyctrl import Source

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
