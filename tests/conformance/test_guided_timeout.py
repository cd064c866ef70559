"""GUID_TIMEOUT: how long one velocity of ArduPilot's Guided is flown, judged by where the simulated drone went."""

from __future__ import annotations

import asyncio

import pytest
from support.params import read, value_of, write
from support.setpoints import POSITION_ONLY, VELOCITY_ONLY, engage, heard, local, said, streaming
from support.world import world

NORTH = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))


async def test_velocity_once_a_second_flies_on_in_guided() -> None:
    """dronekit's documented pattern, send_ned_velocity: one message a second."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        assert value_of(await read(w.client, "GUID_TIMEOUT"), "ardupilot") == 1.5
        await w.take_off()
        for _ in range(5):
            w.client.send(NORTH)
            await asyncio.sleep(1.0)
        level = [e for e in heard(w, "PCMD") if not e.args["pitch"]]
        begun = next(e.t for e in heard(w, "PCMD") if e.args["pitch"] > 0)
        assert [e for e in level if e.t > begun] == []
        await said(w.client, "Setpoints stopped: hovering")
        assert w.drone.pose.north > 6.5


@pytest.mark.parametrize("seconds", [0.5, 3.0])
async def test_guided_timeout_follows_the_clients_parameter(seconds: float) -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        assert value_of(await write(w.client, "GUID_TIMEOUT", seconds, 9, "ardupilot"), "ardupilot") == seconds
        await w.take_off()
        mark, sent = w.client.mark(), asyncio.get_running_loop().time()
        w.client.send(NORTH)
        await said(w.client, "Setpoints stopped: hovering", mark)
        deflected = [e.t - sent for e in heard(w, "PCMD", since=sent) if e.args["pitch"]]
        assert seconds - 0.3 < max(deflected) <= seconds


async def test_position_after_a_velocity_ends_half_a_second_after_its_sender() -> None:
    """The velocity before it would have lasted for 3 s: the drone must not go on to the place for so long."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        assert value_of(await write(w.client, "GUID_TIMEOUT", 3.0, 9, "ardupilot"), "ardupilot") == 3.0
        await w.take_off()
        mark = w.client.mark()
        async with streaming(w.client, NORTH):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 1.0, 10.0)
        async with streaming(w.client, local(POSITION_ONLY, at=(60.0, 0.0, -5.0))) as sent:
            pass
        await said(w.client, "Setpoints stopped: hovering", mark)
        assert asyncio.get_running_loop().time() - sent[-1] < 0.6


async def test_velocity_once_a_second_stops_in_between_in_offboard() -> None:
    """PX4's flavour is stricter: half a second, whatever ANF_GUIDED_T is."""
    async with world(speed=1.0) as w:
        assert value_of(await read(w.client, "COM_OF_LOSS_T")) == 0.5
        await w.take_off()
        async with streaming(w.client, NORTH):
            await engage(w.client, "px4")
            mark = w.client.mark()
        await said(w.client, "Setpoints stopped: hovering", mark)
