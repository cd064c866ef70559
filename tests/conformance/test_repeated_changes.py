"""A change that a client commands once more is carried out, whatever has changed the value meanwhile."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, watched
from support.flavours import both
from support.mav import NAN, Client
from support.missions import CORNERS, put
from support.params import read, write
from support.world import HOME, World, world

from anafi_mav import geo

REPOSITION, ORBIT = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_ORBIT
SPEED, SET_HOME, ENABLE = (
    dialect.MAV_CMD_DO_CHANGE_SPEED,
    dialect.MAV_CMD_DO_SET_HOME,
    dialect.MAV_CMD_DO_FENCE_ENABLE,
)
PAUSE, CHOOSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE, dialect.MAV_CMD_DO_SET_MISSION_CURRENT
FAR = geo.destination(*HOME[:2], 150.0, 0.0)


async def goto(w: World, speed: float = -1.0) -> None:
    ack = await w.client.command(REPOSITION, speed, 1, 0, NAN, frame=6, x=FAR[0], y=FAR[1], z=10.0)
    assert ack.result == ACCEPTED


async def flies_at(w: World, speed: float, timeout: float = 20.0) -> None:
    """Wait until the drone itself flies at this speed (m/s over ground)."""

    def at(entry: object) -> bool:
        return abs(math.hypot(w.drone.pose.vn, w.drone.pose.ve) - speed) < 0.3

    await w.drone.wait_log(at, timeout, since=w.drone.log[-1].t)


async def change_speed(client: Client, speed: float) -> None:
    assert (await client.command(SPEED, 1, speed, -1, 0)).result == ACCEPTED


async def set_home(client: Client, place: tuple[float, float]) -> None:
    ack = await client.command(SET_HOME, 0, frame=0, x=place[0], y=place[1], z=HOME[2])
    assert ack.result == ACCEPTED


async def home_of(client: Client) -> tuple[float, float]:
    """Return the home that clients receive (deg)."""
    mark = client.mark()
    assert (await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 242)).result == ACCEPTED
    message = await client.wait("HOME_POSITION", since=mark)
    return message.latitude / 1e7, message.longitude / 1e7


@pytest.mark.parametrize("by", ["another client", "a parameter"])
async def test_speed_is_changed_once_more_after_another_change(by: str) -> None:
    async with world(clients=2, flavour="ardupilot") as w:
        await w.take_off(10.0)
        one, other = w.clients
        await change_speed(one, 3.0)
        if by == "a parameter":
            await write(one, "ANF_CRUISE_SPEED", 8.0, flavour="ardupilot")
        else:
            await change_speed(other, 8.0)
        await change_speed(one, 3.0)
        await goto(w)
        await flies_at(w, 3.0)
        with pytest.raises(Exception, match="did not confirm"):
            await flies_at(w, 8.0, 3.0)


async def test_home_is_set_once_more_after_another_clients() -> None:
    async with world(clients=2) as w:
        await w.take_off(10.0)
        one, other = w.clients
        north, east = (geo.destination(*HOME[:2], *offset) for offset in ((30.0, 0.0), (0.0, 30.0)))
        await set_home(one, north)
        await set_home(other, east)
        await set_home(one, north)
        assert await home_of(one) == pytest.approx(north, abs=1e-6)


async def test_home_here_moves_with_the_drone() -> None:
    async with world() as w:
        await w.take_off(10.0)
        await goto(w)
        places = []
        for north in (20.0, 40.0):
            await w.drone.wait_log(lambda entry, north=north: w.drone.pose.north > north, 20.0)  # type: ignore[misc]
            assert (await w.client.command(SET_HOME, 1)).result == ACCEPTED
            places.append(await home_of(w.client))
        assert geo.distance(*places[0], *places[1]) > 5.0


@pytest.mark.parametrize("by", ["another client", "a parameter"])
async def test_fence_is_enabled_once_more_after_it_was_disabled(by: str) -> None:
    async with world(flavour="ardupilot", clients=2) as w:
        one, other = w.clients
        assert (await one.command(ENABLE, 1)).result == ACCEPTED
        if by == "a parameter":
            await write(one, "ANF_FENCE_ON", 0, flavour="ardupilot")
        else:
            assert (await other.command(ENABLE, 0)).result == ACCEPTED
        assert (await read(one, "ANF_FENCE_ON")).param_value == 0
        assert (await one.command(ENABLE, 1)).result == ACCEPTED
        assert (await read(one, "ANF_FENCE_ON")).param_value == 1


@both
async def test_speed_replaces_that_which_a_goto_has_named(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(10.0)
        await goto(w, 3.0)
        await flies_at(w, 3.0)
        await change_speed(w.client, 7.0)
        await flies_at(w, 7.0)


@both
async def test_speed_that_is_changed_in_a_pause_replaces_that_which_the_goto_has_named(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(10.0)
        await goto(w, 8.0)
        await flies_at(w, 8.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        await change_speed(w.client, 2.0)
        assert (await w.client.command(PAUSE, 1)).result == ACCEPTED
        await flies_at(w, 2.0)
        await watched(2.0)
        assert math.hypot(w.drone.pose.vn, w.drone.pose.ve) < 3.0
        await goto(w, 5.0)  # a newer one's own speed counts again
        await flies_at(w, 5.0)


async def test_speed_of_before_replaces_that_which_an_orbit_has_named() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        await change_speed(w.client, 4.0)
        ack = await w.client.command(ORBIT, 20.0, 2.0, 5, NAN, frame=0, x=NAN, y=NAN, z=NAN)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda entry: math.hypot(w.drone.pose.north, w.drone.pose.east) > 19.0, 30.0)
        await flies_at(w, 2.0, 30.0)
        await change_speed(w.client, 4.0)
        await flies_at(w, 4.0, 20.0)


@pytest.mark.parametrize("by", ["another client", "a message"])
async def test_item_is_chosen_once_more_after_another_choice(by: str) -> None:
    async with world(web=True, clients=2) as w:
        one, other = w.clients
        await put(w, CORNERS)
        assert (await one.command(CHOOSE, 2)).result == ACCEPTED
        if by == "a message":
            one.send(dialect.MAVLink_mission_set_current_message(1, 1, 1))
            await one.wait("MISSION_CURRENT", lambda m: m.seq == 1)
        else:
            assert (await other.command(CHOOSE, 1)).result == ACCEPTED
        mark = one.mark()
        assert (await one.command(CHOOSE, 2)).result == ACCEPTED
        await one.wait("MISSION_CURRENT", lambda m: m.seq == 2, since=mark)
