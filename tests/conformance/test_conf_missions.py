"""Conformance items 49, 72 to 74, 122 and 141: missions as clients fly them, over real sockets, in both flavours.

Where the drone went and what it did is taken from the simulator, never from the gateway's word.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.plans import ACCEPTED, MISSION, UNSUPPORTED_FRAME, around
from support.world import HOME, World, world

both = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])

PLACE = (HOME[0], HOME[1])


# Items that are orders.


async def order(client: Client, current: int, x: float, y: float, z: float, *, frame: int = 3, as_int: bool) -> Any:
    """A mission item that belongs to no mission; its MISSION_ACK."""
    mark = client.mark()
    fields = (1, 1, 0, frame, 16, current, 1, 0.0, 0.0, 0.0, 0.0)
    if as_int:
        client.send(dialect.MAVLink_mission_item_int_message(*fields, round(x * 1e7), round(y * 1e7), z, MISSION))
    else:
        client.send(dialect.MAVLink_mission_item_message(*fields, x, y, z, MISSION))
    return await client.wait("MISSION_ACK", since=mark)


async def settled(w: World, wanted: tuple[float, float, float]) -> None:
    """Wait until the drone itself is at a place, m north, east and up of where it took off."""
    await w.drone.wait_log(
        lambda entry: math.dist((w.drone.pose.north, w.drone.pose.east, w.drone.pose.up), wanted) < 0.7, timeout=30.0
    )


@both
@pytest.mark.parametrize("as_int", [False, True])
async def test_conf_141_items_that_are_orders(flavour: str, as_int: bool) -> None:
    """current 2 goes to a place (dronekit's simple_goto), 3 changes the height (MAVProxy's); the plan is untouched."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        place = around(PLACE, (20.0, -10.0))[0]
        ack = await order(w.client, 2, *place, 8.0, as_int=as_int)
        assert (ack.type, ack.target_system, ack.target_component) == (ACCEPTED, 255, 190)
        await settled(w, (20.0, -10.0, 8.0))
        assert (await order(w.client, 3, 0.0, 0.0, 12.0, as_int=as_int)).type == ACCEPTED
        await settled(w, (20.0, -10.0, 12.0))
        assert (await order(w.client, 2, *place, 8.0, frame=10, as_int=as_int)).type == UNSUPPORTED_FRAME
        current = await w.client.wait("MISSION_CURRENT")
        assert current.seq == 0
