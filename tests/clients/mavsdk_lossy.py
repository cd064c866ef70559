"""A long mission by MAVSDK's plugin mission_raw, up and, with "both", down again.

    mavsdk_lossy.py URL COUNT up|both

No two way points are alike. An upload that MAVSDK gives up is tried again. It prints what became of it.
"""

from __future__ import annotations

import asyncio
import sys
import time

from mavsdk.asyncio.plugins.mission_raw import MissionItem, MissionRawAsync
from mavsdk_base import connected, fields, say, tried

TRIES = 3


def way_points(count: int) -> list[MissionItem]:
    return [
        MissionItem(
            seq, 3, 16, int(seq == 0), 1, 0.0, 1.0, 0.0, 1.0 + seq % 300,
            488789000 + 30 * seq, 23677000 - 20 * seq, 10.0 + seq % 40, 0,
        )
        for seq in range(count)
    ]  # fmt: skip


async def main(url: str, count: int, what: str) -> None:
    async with connected(url) as drone:
        mission, wanted, began = MissionRawAsync(drone), way_points(count), time.monotonic()
        for _ in range(TRIES):
            if await tried("upload", mission.upload_mission(wanted)):
                break
        say("seconds", f"{time.monotonic() - began:.1f}")
        if what == "both":
            read = await mission.download_mission()
            say("equal", [fields(one) for one in read] == [fields(one) for one in wanted])
        say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), sys.argv[3]))
