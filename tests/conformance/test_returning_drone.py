"""A drone that leaves and returns again and again: what the gateway keeps of it in memory."""

from __future__ import annotations

import asyncio
import gc

from support.world import HOME, loopback

from anafi_mav.cli.heap_freezer import HeapFreezer
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

RETURNS = 10

HELD = 6.0
"""s of a connection: a shorter one would count as taken by another controller."""

SETTLED = 3
"""Returns after which lists of bounded length are full."""

TOLERANCE = 200
"""Objects more after the last return: log records that pytest keeps, five for each return.

One that froze the heap would leave a hundred.
"""


def objects() -> int:
    """Count what is alive: objects that the collector knows and those that are frozen."""
    gc.collect()
    return len(gc.get_objects()) + gc.get_freeze_count()


async def test_drone_that_returns_often_leaves_no_objects_and_is_frozen_once() -> None:
    address, drone = loopback(), loopback()
    freezes = 0

    def freeze() -> None:
        nonlocal freezes
        freezes += 1
        gc.freeze()

    freezer = HeapFreezer(freeze)
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone),),
        http=False,
        video=False,
    )
    counts = []
    simulator = Simulator([DroneSpec(address=drone, home=HOME, http_port=None, rtsp_port=None)], remember=False)
    async with simulator, Gateway(config, on_first_connection=freezer.request) as gateway:
        system = gateway.systems[0]
        assert await gateway.ready(10.0)
        for _ in range(RETURNS):
            await asyncio.sleep(HELD)
            simulator.drones[0].faults.mute = True
            await asyncio.sleep(12.0)  # longer than either side keeps a session
            assert not system.active
            simulator.drones[0].faults.mute = False
            await asyncio.sleep(8.0)  # an attempt every two seconds, of three seconds at most
            assert system.active
            counts.append(objects())
        connections = gateway.status().drones[0].connections
    freezer.close()
    assert connections == RETURNS + 1
    assert freezes == 1
    assert counts[-1] < counts[SETTLED] + TOLERANCE, counts
