"""Media and video of two drones with one address at once: run in a network namespace by `test_namespaces`.

    python two_of_one_address.py ADDRESS INTERFACE INTERFACE FOLDER

Prints what each of the two interfaces showed as one JSON object.
"""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

from anafi_mav.drone import Drone
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode
from anafi_mav.drone.payload.camera_state import PhotoSettings


async def visit(address: str, interface: str, folder: Path, watching: asyncio.Event, other: asyncio.Event) -> Any:
    drone = Drone(address, interface=interface, name=interface)
    await drone.connect()
    try:
        async with drone.video.watching():
            watching.set()
            await other.wait()
            frames = [await drone.video.next_frame(10.0) for _ in range(30)]
            shown = drone.video.state.shown
            assert shown is not None
            await drone.camera.set_mode(CameraMode.PHOTO)
            await drone.camera.set_photo(PhotoSettings(mode=PhotoMode.SINGLE))
            media = await drone.camera.take_photo()
            assert media is not None
        files = await drone.media.download_media(media, folder)
        return {
            "serial": drone.identity.serial,
            "streams": shown.offered,
            "frames": len({frame.taken for frame in frames}),
            "foreign": drone.video.counters["foreign"] + drone.video.counters["stray"],
            "files": [path.name for path in files],
            "bytes": sum(path.stat().st_size for path in files),
        }
    finally:
        watching.set()
        await drone.close()


async def main(address: str, left: str, right: str, folder: str) -> None:
    events = asyncio.Event(), asyncio.Event()
    observed = await asyncio.gather(
        visit(address, left, Path(folder) / left, *events), visit(address, right, Path(folder) / right, *events[::-1])
    )
    sys.stdout.write(json.dumps(dict(zip((left, right), observed, strict=True))) + "\n")


if __name__ == "__main__":
    for interface in sys.argv[2:4]:
        (Path(sys.argv[4]) / interface).mkdir()
    asyncio.run(main(*sys.argv[1:]))
