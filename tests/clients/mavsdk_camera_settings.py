"""MAVSDK's camera plugin and the camera's settings as its users read and set them.

    mavsdk_camera_settings.py URL

It prints a line a step; the test that runs it compares them with the simulator's own state.
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from mavsdk.asyncio.plugins.camera import CameraAsync
from mavsdk.plugins.camera import CameraError, Option, Setting
from mavsdk_base import LIMIT, connected, held, say, tried

CAMERA = 100

LOOK_EVERY = 0.2
"""s between looks at what MAVSDK holds: it reports no end of a definition's loading (camera_impl.cpp
refresh_params_with_lock)."""

CHOSEN = ("CAM_EV", "CAM_WBMODE", "CAM_ZOOMLOSSY", "CAM_VIDMODE")
"""Settings that are given each of their options."""


async def possible(camera: CameraAsync) -> dict[str, Any]:
    """The settings that can be changed now, with their options."""
    return {one.setting_id: one for one in await camera.get_possible_setting_options(CAMERA)}


async def current(camera: CameraAsync, name: str) -> str:
    setting = await camera.get_setting(CAMERA, Setting(setting_id=name))
    return str(setting.option.option_id)


async def loaded(camera: CameraAsync) -> dict[str, Any]:
    """The settings once the definition is there and each value has been read: until then a value is an error."""
    while True:
        try:
            settings = await possible(camera)
            for name in settings:
                await current(camera, name)
            return settings
        except CameraError:
            await asyncio.sleep(LOOK_EVERY)


async def reads(camera: CameraAsync, name: str, value: float) -> None:
    while float(await current(camera, name)) != value:  # noqa: ASYNC110 - MAVSDK has no event for it
        await asyncio.sleep(LOOK_EVERY)


async def give(camera: CameraAsync, name: str, value: str) -> None:
    await camera.set_setting(CAMERA, Setting(setting_id=name, option=Option(option_id=value)))


async def main(url: str) -> None:
    async with connected(url) as drone:
        camera = CameraAsync(drone)
        settings = await asyncio.wait_for(loaded(camera), LIMIT)
        say("listed", *sorted(settings))
        say("range", *(name for name in sorted(settings) if settings[name].is_range))
        say("reads", "CAM_ISOMAX", await current(camera, "CAM_ISOMAX"))
        for name in CHOSEN:
            options = [option.option_id for option in settings[name].options]
            for value in options:
                await give(camera, name, value)
            say("options", name, *options)
            say("reads", name, await current(camera, name))
            await held(name)
        say("after", *sorted(option.option_id for option in (await possible(camera))["CAM_VIDRES"].options))
        await give(camera, "CAM_ZOOMSPEED", "1.5")
        await held("CAM_ZOOMSPEED")
        await tried("recording", give(camera, "CAM_VIDMODE", "0"))
        await held("recording")
        await asyncio.wait_for(reads(camera, "CAM_EV", -1.0), LIMIT)
        await asyncio.wait_for(reads(camera, "CAM_ANTIFLICKER", 2.0), LIMIT)
        say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
