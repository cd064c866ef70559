"""What a client leaves behind in the gateway when its connection is closed: over hours there are many of them."""

from __future__ import annotations

import asyncio
import gc

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ARM, LAND_CMD, PX4_HOLD, SET_MODE
from support.mav import CAMERA
from support.world import World, world

from anafi_mav.mavlink.channel import Channel

COMMANDS = ((ARM, (0.0,), 1), (SET_MODE, PX4_HOLD, 1), (LAND_CMD, (), 1))


def closed() -> list[Channel]:
    gc.collect()
    return [found for found in gc.get_objects() if isinstance(found, Channel) and not found.is_open]


async def command_all(w: World, sysid: int) -> None:
    """Send each command as a client of its own, which then closes its connection."""
    client = await w.connect(sysid)
    for command, params, component in COMMANDS:
        await client.command(command, *params, target=(1, component))
    await client.command(dialect.MAV_CMD_SET_CAMERA_ZOOM, 1, 2, target=(1, CAMERA))
    await client.command(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1, 0, target=(1, CAMERA))
    w.clients.remove(client)
    await client.close()


async def test_commands_of_a_client_do_not_keep_its_closed_channel() -> None:
    async with world() as w:
        before = len(closed())  # of other tests
        for sysid in (201, 202, 203):
            await command_all(w, sysid)
        for command, params, component in COMMANDS:  # the newest commands are those of a client that stays
            await w.client.command(command, *params, target=(1, component))
        end = asyncio.get_running_loop().time() + 5.0
        while len(closed()) > before:  # the gateway closes a channel when it has read the end of the connection
            assert asyncio.get_running_loop().time() < end, closed()
            await asyncio.sleep(0.1)
