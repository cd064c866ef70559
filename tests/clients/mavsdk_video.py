"""MAVSDK's plugin camera as users of its video streams write it: ``mavsdk_video.py URL STREAM``.

It finds the camera, lists its streams, shows STREAM and stops it. It prints a line a step.
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from mavsdk.asyncio.plugins.camera import CameraAsync
from mavsdk_base import connected, say, tried, until


def running(update: Any) -> bool:
    return bool(update.video_stream_info.status == update.video_stream_info.VideoStreamStatus.IN_PROGRESS)


async def main(url: str, stream: int) -> None:
    async with connected(url) as drone:
        camera = CameraAsync(drone)
        found = await until(camera.subscribe_camera_list(), lambda update: bool(update.cameras))
        (about,) = found.cameras
        say("camera", about.component_id)
        shown = await until(camera.subscribe_video_stream_info(), running)
        info = shown.video_stream_info
        settings = info.settings
        size = settings.horizontal_resolution_pix, settings.vertical_resolution_pix
        say("shown", info.stream_id, *size, info.spectrum.name, settings.uri)
        await tried("show", camera.start_video_streaming(about.component_id, stream))
        updated = await until(
            camera.subscribe_video_stream_info(),
            lambda update: running(update) and update.video_stream_info.stream_id == stream,
        )
        say("then", updated.video_stream_info.stream_id, updated.video_stream_info.spectrum.name)
        await tried("stop", camera.stop_video_streaming(about.component_id, stream))
        await tried("wrong", camera.start_video_streaming(about.component_id, 9))
    say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
