"""Unmodified MAVSDK: plugins geofence and mission_raw for fences and rally points, in both flavours (B2, 76, 77)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.flavours import both
from support.plans import FENCE, RALLY, download
from support.product import program
from support.world import HOME, world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_plans.py")


@both
async def test_conf_076_077_mavsdk(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        place = (HOME[0], HOME[1])
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", *map(str, place))
        async with program(*words) as script:
            await script.line(lambda line: line == "done", timeout=120.0)
            (sent,) = script.said("fence sent")
            assert sent.count("INCLUSION") == sent.count("EXCLUSION") == 1
            assert script.said("fence read") == script.said("fence kept") == [sent]
            assert script.said("fence cleared") == ["[] []"]
            assert len(script.said("fence refused")) == len(script.said("raw refused")) == 1
            assert script.said("raw fence") == ["True"]
            assert script.said("raw rally") == ["5 True", "1000 True"]
            assert script.said("raw kept") == ["3"]

        # And another client reads the same.
        circles = await download(w.client, FENCE)
        assert [(m.command, m.param1, m.param2) for m in circles] == [(5003, 80.0 + n, float(n)) for n in range(3)]
        points = await download(w.client, RALLY)
        assert [m.x for m in points] == [round((place[0] + 1e-5 * n) * 1e7) for n in range(1000)]
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if "aborted" in m.text]
