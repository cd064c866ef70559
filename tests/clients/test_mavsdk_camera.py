"""Unmodified MAVSDK: camera (conformance A8, 116)."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest
from support.cameras import photos, videos
from support.product import program
from support.sim_settings import sim_value
from support.world import world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_camera.py")


async def test_conf_116_mavsdk_camera() -> None:
    async with (
        world(model="usa", web=True, speed=1.0) as w,
        program(
            sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", stdin=asyncio.subprocess.PIPE
        ) as script,
    ):
        await script.line(lambda line: line == "held zoom", timeout=90.0)
        single, series = photos(w)
        assert script.lines == [
            "camera 100 Parrot ANAFI USA",
            f"photo 0 True mftp://[;comp=100]/media/{single.date[:4]}-{single.date[4:6]}-{single.date[6:8]}/"
            f"{single.resources[0].id}",
            "interval",
            "photos 0 1 2",
            "held zoom",
        ]
        assert (single.mode, series.mode) == ("SINGLE", "TIMELAPSE")
        script.say("")
        await script.line(lambda line: line == "recorded", timeout=60.0)
        assert "recording FORMATTED" in script.lines
        assert len(videos(w)) == 1
        await script.line(lambda line: line.startswith("tried format"), timeout=60.0)
        assert {"tried track ACTION_UNSUPPORTED", "setting CAM_STYLE 3"} <= set(script.lines)
        assert sim_value(w.drone, "CAM_STYLE") == 3.0
        # It takes an IN_PROGRESS for the end of the command, and the real end then aborts it.
        assert script.lines[-1] == "tried format done"
        await w.drone.wait_log(lambda e: e.name == "user_storage.format_result", 10.0)
        assert not photos(w)
