"""MAVSDK's plugin camera as its users write it.

    mavsdk_camera.py URL

It prints a line a step; the test that runs it judges them by the simulated camera.
"""

from __future__ import annotations

import asyncio
import sys

from mavsdk.asyncio.plugins.camera import CameraAsync, Mode, PhotosRange, Setting
from mavsdk_base import connected, held, say, tried, until


async def main(url: str) -> None:
    async with connected(url) as drone:
        camera = CameraAsync(drone)
        (found,) = (await until(camera.subscribe_camera_list(), lambda seen: bool(seen.cameras))).cameras
        id = found.component_id
        say("camera", id, found.vendor_name, found.model_name)

        await camera.set_mode(id, Mode.PHOTO)
        await until(camera.subscribe_mode(), lambda update: update.mode == Mode.PHOTO)
        captured = asyncio.ensure_future(until(camera.subscribe_capture_info()))
        await asyncio.sleep(0.1)  # MAVSDK reports no event when a subscription has begun
        await camera.take_photo(id)
        photo = await captured
        say("photo", photo.index, photo.is_success, photo.file_url)
        await camera.start_photo_interval(id, 2.0)
        await until(camera.subscribe_capture_info(), lambda info: info.index == 2)
        await camera.stop_photo_interval(id)
        say("interval")
        photos = await camera.list_photos(id, PhotosRange.SINCE_CONNECTION)
        say("photos", *sorted(info.index for info in photos)[:3])

        await camera.zoom_range(id, 50.0)
        await held("zoom")

        await camera.set_mode(id, Mode.VIDEO)
        await until(camera.subscribe_mode(), lambda update: update.mode == Mode.VIDEO)
        await camera.start_video(id)
        recording = await until(camera.subscribe_storage(), lambda update: update.storage.video_on)
        say("recording", recording.storage.storage_status.name)
        await camera.stop_video(id)
        say("recorded")

        say("current", len(await camera.get_current_settings(id)))
        options = await camera.get_possible_setting_options(id)
        wanted = next(one for one in options if one.setting_id == "CAM_STYLE")
        option = wanted.options[-1]
        await camera.set_setting(id, Setting(wanted.setting_id, wanted.setting_description, option, wanted.is_range))
        say("setting", wanted.setting_id, option.option_id)

        await tried("track", camera.track_point(id, 0.5, 0.5, 0.1))
        await tried("format", camera.format_storage(id, 1))


asyncio.run(main(sys.argv[1]))
