"""Unmodified dronekit flying by setpoints and by RC channels, on both flavours (conformance 118, 106, 104)."""

from __future__ import annotations

import sys
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest
from support.flavours import both
from support.product import program
from support.setpoints import allow_speed, held
from support.world import TAKE_OFF_SPEED, world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("dronekit_setpoints.py")


@both
async def test_conf_118_setpoints(flavour: str) -> None:
    async with world(speed=TAKE_OFF_SPEED, flavour=flavour) as w:
        words = (sys.executable, "-u", str(SCRIPT), f"tcp:{w.address}:5760", flavour)
        async with program(*words, stdin=PIPE) as script:
            await script.line(lambda line: line == "up", timeout=90.0)
            w.simulator.speed = 1.0
            allow_speed(w)
            if flavour == "px4":
                await held(w, script, "setpoints before Offboard")
            pose = await held(w, script, "velocity", calm=5.0)
            assert (pose.vn, pose.ve, pose.vd) == pytest.approx((2.0, 0.0, 0.0), abs=0.3)
            pose = await held(w, script, "position", calm=9.0)
            assert (pose.north, pose.east, pose.up) == pytest.approx((4.0, -5.0, 10.0), abs=0.7)
            await script.line(lambda line: line.startswith("idle"), timeout=30.0)
            assert (await held(w, script, "channels", calm=3.0)).ve > 1.0
            await script.line(lambda line: line == "mode RTL", timeout=30.0)
            assert len(w.commands("rth.return_to_home")) == 1
            assert await script.end() == 0, script
