"""Unmodified MAVSDK: gimbal (conformance B2, 116)."""

from __future__ import annotations

import asyncio
import math
import sys
from pathlib import Path

import pytest
from support.gimbal import looks, next_truth, rate, truth
from support.product import program
from support.world import world

from anafi_mav.arsdk.messages.ardrone3 import PoiMode

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_gimbal.py")


async def test_conf_116_mavsdk_gimbal() -> None:
    async with (
        world(model="ai", speed=1.0) as w,
        program(
            sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", stdin=asyncio.subprocess.PIPE
        ) as script,
    ):

        async def at(step: str) -> None:
            await script.line(lambda line: line == f"held {step}", timeout=90.0)

        await at("angles")
        assert script.lines[:2] == ["gimbal 1 Parrot ANAFI Ai", "primary"]
        await looks(w, pitch_absolute=-30.0, yaw_relative=20.0)
        script.say("")
        await at("streamed")
        await looks(w, pitch_absolute=40.0, yaw_relative=-15.0, roll_absolute=5.0)
        script.say("")
        await at("down")
        await looks(w, pitch_absolute=-90.0, yaw_relative=30.0, roll_absolute=0.0)
        script.say("")
        await at("locked")
        await looks(w, pitch_absolute=0.0, yaw_absolute=40.0)
        script.say("")
        await at("rates")
        seen = [await rate(w, name, 3) for name in ("pitch_absolute", "yaw_relative")]
        assert seen == pytest.approx([-10.0, -5.0], rel=0.1)
        script.say("")
        await script.line(lambda line: line == "stopped")
        before = await next_truth(w)
        await at("streaming")
        await next_truth(w)
        assert await rate(w, "pitch_absolute", 5) == pytest.approx(8.0, rel=0.1)
        assert truth(w).yaw_relative == pytest.approx(before.yaw_relative, abs=0.1)
        script.say("")
        await at("region")
        poi = w.commands("ardrone3.Piloting.StartPilotedPOIV2")[-1].args
        assert (poi["mode"], round(poi["altitude"], 1)) == (PoiMode.LOCKED_GIMBAL, 0.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(math.degrees(e.args["yaw"]) - 90.0) < 3.0, 20.0)
        script.say("")
        await script.line(lambda line: line == "released", timeout=30.0)
        assert w.commands("ardrone3.Piloting.StartPilotedPOIV2")[-1].args["mode"] == PoiMode.FREE_GIMBAL
        await looks(w, pitch_absolute=10.0)
