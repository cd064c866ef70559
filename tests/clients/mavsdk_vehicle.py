"""A vehicle that is none of ours: MAVSDK as an autopilot that takes missions.

    mavsdk_vehicle.py URL

It prints each mission that it was given, as one line.
"""

from __future__ import annotations

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mission_raw_server import MissionRawServerAsync


async def main(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.AUTOPILOT)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        component = await mavsdk.server_component()
        assert component is not None
        server = MissionRawServerAsync(component)
        print("ready", flush=True)
        async for _result, plan in server.subscribe_incoming_mission():
            items = [
                (i.seq, i.frame, i.command, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z)
                for i in plan.mission_items
            ]
            print("mission", items, flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
