"""A gateway that is restarted while its drone lands or returns behind a Skycontroller: whose landing it is then.

Judged by what the simulated drone did.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import pytest
from support.fault_scenarios import ACCEPTED, LAND_CMD, PX4_HOLD, REJECTED, RTL, SET_MODE, goto, heard
from support.missions import ACTIVE, MISSION_MODE, PAUSED, mode, put, said, start, state, takeoff, way
from support.missions import LAND as LAND_ITEM
from support.plans import Item
from support.world import ARMED, World, world

from anafi_mav import mav_enums
from anafi_mav.gateway import Gateway

RETURN_HOME, TAKEOFF_LAND = range(2)
"""Buttons of a Skycontroller."""


@asynccontextmanager
async def restarted(w: World) -> AsyncIterator[World]:
    """The gateway has ended, and another one is about to find the drone in the air."""
    await w.gateway.close()
    async with Gateway(w.gateway.config) as gateway:
        again = World(w.simulator, gateway, w.address, w.flavour)
        await again.connect()
        try:
            yield again
        finally:
            for client in again.clients:
                await client.close()


@asynccontextmanager
async def going_on(w: World) -> AsyncIterator[World]:
    yield w


async def in_air(w: World) -> None:
    await w.client.heartbeat(lambda beat: beat.base_mode & ARMED, since=0, timeout=20.0)


async def flies(w: World, state: str) -> None:
    if w.drone.flying_state.name.lower() != state:
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == state, 60.0)


def press(w: World, button: int) -> None:
    assert w.drone.skycontroller is not None
    w.drone.skycontroller.press(button)


async def plan_lands(w: World) -> None:
    await put(w, [takeoff(12.0), way(9.0, 0.0, 12.0), LAND_ITEM])
    await start(w)
    await flies(w, "landing")


async def client_lands(w: World) -> None:
    await w.take_off(12.0)
    assert (await w.client.command(LAND_CMD)).result == ACCEPTED


async def pilot_lands(w: World) -> None:
    await w.take_off(12.0)
    press(w, TAKEOFF_LAND)
    await flies(w, "landing")


async def land_unseen_by_button(w: World) -> None:
    """The pilot's button lands a drone that the gateway does not hear; then it does, and shows the landing."""
    press(w, TAKEOFF_LAND)
    await flies(w, "landing")
    mark = w.client.mark()
    w.drone.faults.mute = False
    await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark, timeout=20.0)


async def far_away(w: World) -> None:
    await w.take_off(12.0)
    assert await goto(w, 80.0, 12.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 79.0, 60.0)


async def client_returns(w: World) -> None:
    await far_away(w)
    assert (await w.client.command(RTL)).result == ACCEPTED


async def pilot_returns(w: World) -> None:
    await far_away(w)
    press(w, RETURN_HOME)
    await w.drone.wait_log(lambda e: e.name.startswith("rth.state") and "in_progress" in str(e.args).lower(), 10.0)


DESCENTS: dict[str, tuple[Callable[[World], Awaitable[None]], int]] = {
    "landing of a plan": (plan_lands, ACCEPTED),
    "landing of a client": (client_lands, ACCEPTED),
    "return of a client": (client_returns, ACCEPTED),
    "landing of the pilot": (pilot_lands, REJECTED),
    "return of the pilot": (pilot_returns, REJECTED),
}


@pytest.mark.parametrize("descent", DESCENTS)
async def test_hold_after_a_restart_ends_what_it_ended_before(descent: str) -> None:
    begin, expected = DESCENTS[descent]
    async with world(speed=1.0, web=True, skycontroller=3) as first:
        await begin(first)
        async with restarted(first) as w:
            await in_air(w)
            assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == expected
            if expected == ACCEPTED:
                await flies(w, "hovering")
                assert w.drone.pose.up > 1.0
            else:
                assert heard(w, "abort", "CancelMoveTo") == []


@pytest.mark.parametrize("restarts", [True, False])
async def test_landing_of_a_plan_that_began_unseen_is_ended_by_hold(restarts: bool) -> None:
    """The drone flies its plan on while the gateway is absent, or not heard. Only the plan lands there."""
    async with world(speed=1.0, web=True, skycontroller=3) as first:
        await put(first, [takeoff(12.0), way(60.0, 0.0, 12.0), LAND_ITEM])
        await start(first)
        await first.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 60.0)
        first.drone.faults.mute = True
        async with restarted(first) if restarts else going_on(first) as w:
            await flies(w, "landing")
            mark = w.client.mark()
            w.drone.faults.mute = False
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark, timeout=20.0)
            assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
            await flies(w, "hovering")


async def test_landing_by_button_that_began_unseen_on_the_way_of_a_plan_is_ended_by_no_client() -> None:
    async with world(speed=1.0, web=True, skycontroller=3) as w:
        await put(w, [takeoff(12.0), way(60.0, 0.0, 12.0), LAND_ITEM])
        await start(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 60.0)
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 4.0)
        await land_unseen_by_button(w)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == REJECTED


async def test_plan_without_way_points_that_was_paused_before_its_landing_stays_paused() -> None:
    """It lands wherever the drone is: a drone that hovers there has not flown its last line."""
    wait = Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=60.0, frame=2)
    async with world(speed=1.0, web=True) as first:
        await first.take_off(12.0)
        await put(first, [wait, LAND_ITEM])
        assert (await first.client.command(SET_MODE, 1, 4, 4)).result == ACCEPTED
        await mode(first, MISSION_MODE["px4"], since=0)
        assert (await first.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        async with restarted(first) as w:
            await state(w, PAUSED, since=0)
            await said(w, "Mission not flying: paused at item 1")


@pytest.mark.parametrize("restarts", [True, False])
async def test_landing_by_button_that_stopped_a_clients_return_unseen_is_ended_by_no_client(restarts: bool) -> None:
    async with world(speed=1.0, web=True, skycontroller=3) as first:
        await client_returns(first)
        await first.client.heartbeat(lambda beat: beat.custom_mode == first.modes.returning, since=0)
        first.drone.faults.mute = True
        async with restarted(first) if restarts else going_on(first) as w:
            if not restarts:
                await w.client.silence("HEARTBEAT", 4.0)
            await land_unseen_by_button(w)
            assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == REJECTED


async def test_mission_that_was_paused_where_it_lands_stays_paused_in_a_clients_landing() -> None:
    wait = Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=60.0, frame=2)
    async with world(speed=1.0, web=True) as first:
        await put(first, [takeoff(12.0), wait, way(0.0, 0.0, 14.0), LAND_ITEM])
        await start(first)
        await state(first, ACTIVE, seq=1)
        assert (await first.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert (await first.client.command(LAND_CMD)).result == ACCEPTED
        async with restarted(first) as w:
            await said(w, "Mission not flying: paused at item 2")
            await flies(w, "landed")
            await state(w, PAUSED, seq=1, since=0)
