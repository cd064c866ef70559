"""Unmodified MAVSDK: the camera's video streams (conformance A8, 116)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import program
from support.world import world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_video.py")


async def test_conf_116_mavsdk_video_streams() -> None:
    async with world(model="thermal") as w:
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", "3")
        async with program(*words) as script:
            await script.line(lambda line: line == "done", timeout=90.0)
            assert script.said("camera") == ["100"]
            assert w.gateway.relay is not None
            (shown,) = script.said("shown")
            assert shown == f"1 1280 720 VISIBLE_LIGHT rtsp://127.0.0.1:{w.gateway.relay.port}/1/visible"
            assert script.said("then") == ["3 INFRARED"]
            assert script.said("tried") == ["show done", "stop done", "wrong DENIED"]
            assert w.gateway.systems[0].drone.streams.shown.number == 3
