"""One flight task flies the drone, whatever arrives in the same event-loop iteration."""

from __future__ import annotations

import asyncio

import pytest
from support.fault_scenarios import ACCEPTED, ARM, PX4_OFFBOARD, SET_MODE, TAKEOFF_CMD, goto
from support.setpoints import COPTER_GUIDED, POSITION_ONLY, VELOCITY_ONLY, earth, local, streaming
from support.world import world

UP = 8.0
NORTH = earth(POSITION_ONLY, 6, 20.0, 0.0, UP)
"""A single position: 20 m north of the drone."""
EAST = local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))


@pytest.mark.parametrize("together", [False, True], ids=["later", "same iteration"])
async def test_newer_velocity_of_another_client_replaces_single_goto(together: bool) -> None:
    """The goto is flown to its end or not at all: never as a stream that is cut off by silence."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(UP)
        assert await goto(w, 0.0, UP) == ACCEPTED
        first, second = w.clients
        began = asyncio.get_running_loop().time()
        first.send(NORTH)
        if not together:
            await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("moveTo"), 5.0, since=began)
        second.send(EAST)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["ve"] > 1.0, 10.0, since=began)
        stops = asyncio.get_running_loop().time()
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["ve"]) < 0.05, 10.0, since=stops)
        assert w.drone.pose.east > 1.0
        assert abs(w.drone.pose.north) < 2.0
        mark = first.mark()
        assert (await first.heartbeat(lambda beat: True, since=mark)).custom_mode == COPTER_GUIDED


async def test_offboard_during_the_motor_ramp_follows_the_takeoff() -> None:
    """QGroundControl's sequence: the take-off waits for arming; the mode is chosen before the drone has lifted off."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 6.0, 30.0)
