"""Missions for a whole fleet by MAVSDK's plugin mission_raw: each system flies its file, all of them at once.

They begin one after the other.

    mavsdk_fleet_missions.py URL FILE ...

The first file is for system 1, the next for system 2 and so on.
"""

from __future__ import annotations

import asyncio
import os
import sys
import traceback
from pathlib import Path
from typing import Any

from mavsdk.asyncio import Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk_base import ground_station, say


async def systems(mavsdk: Mavsdk, wanted: int) -> dict[int, Any]:
    """The systems by their ids, once all are there."""
    async for _ in mavsdk.on_new_system():
        found = {await system.get_system_id(): system for system in await mavsdk.get_systems()}
        if set(found) >= set(range(1, wanted + 1)):
            return found
    raise AssertionError("no more systems")


BEGINNING = asyncio.Lock()
"""Held by who uploads and starts. With six drones at once in blocking calls MAVSDK 4.1 hung once in some 80 runs: their
answers had come, and none of its calls ended any more, with a result or a timeout."""


async def fly(number: int, system: Any, path: Path) -> None:
    mission, telemetry, action = MissionRawAsync(system), TelemetryAsync(system), ActionAsync(system)
    async for health in telemetry.subscribe_health():
        if health.is_armable and health.is_global_position_ok and health.is_home_position_ok:
            break
    items = (await mission.import_qgroundcontrol_mission(str(path))).mission_items
    async with BEGINNING:
        await mission.upload_mission(items)
        say("uploaded", number, len(items))
        await action.arm()
        await mission.start_mission()
        say("started", number)
    async for progress in mission.subscribe_mission_progress():
        if progress.total and progress.current == progress.total:
            break
    say("finished", number)


async def main(url: str, paths: list[Path]) -> None:
    async with ground_station() as mavsdk:
        # In this order: it is notified of systems that are new from when it listens.
        found, _ = await asyncio.gather(systems(mavsdk, len(paths)), mavsdk.add_any_connection(url))
        flights = [fly(number, found[number], path) for number, path in enumerate(paths, start=1)]
        try:
            await asyncio.gather(*flights)
        except Exception:
            # MAVSDK crashes or hangs when it is taken down under another call of its own.
            traceback.print_exc()
            sys.stderr.flush()
            os._exit(1)
        say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], [Path(word) for word in sys.argv[2:]]))
