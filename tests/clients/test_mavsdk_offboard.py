"""Unmodified MAVSDK: offboard, manual_control and follow_me, judged by where the simulated drone truly was."""

from __future__ import annotations

import asyncio
import itertools
import math
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from support.product import Process, program
from support.setpoints import allow_speed, heard, held
from support.world import HOME, TAKE_OFF_SPEED, World, world

from anafi_mav import geo
from anafi_mav.texts import OFFBOARD_STOPPED_HOVER

SCRIPT = Path(__file__).with_name("mavsdk_offboard.py")

pytestmark = pytest.mark.third_party


@asynccontextmanager
async def flown(what: str) -> AsyncIterator[tuple[World, Process]]:
    """The world goes at the clock's speed from when the drone is up."""
    async with (
        world(speed=TAKE_OFF_SPEED) as w,
        program(sys.executable, "-u", str(SCRIPT), what, f"tcpout://{w.address}:5760", stdin=PIPE) as script,
    ):
        await script.line(lambda line: line == "up", timeout=60.0)
        w.simulator.speed = 1.0
        yield w, script


async def test_mavsdk_offboard() -> None:
    async with flown("offboard") as (w, script):
        allow_speed(w)
        pose = await held(w, script, "attitude", calm=2.5)
        assert [line for line in script.lines if line.startswith("tried")] == [
            "tried start without setpoints NO_SETPOINT_SET",
            "tried start with rates COMMAND_DENIED",
            "tried start done",
        ]
        assert pose.vn > 1.0  # nose down
        assert abs(pose.ve) < 0.3
        assert pose.up > 8.5  # thrust above a half
        pose = await held(w, script, "velocity ned", calm=5.0)
        assert (pose.vn, pose.ve, pose.vd) == pytest.approx((0.0, 2.0, 0.5), abs=0.3)
        assert math.degrees(pose.yaw) == pytest.approx(90.0, abs=6.0)
        pose = await held(w, script, "velocity body", calm=4.0)
        assert (pose.vn, pose.ve, pose.vd) == pytest.approx((0.0, 2.0, -0.5), abs=0.3)
        pose = await held(w, script, "position ned", calm=6.0)
        assert (pose.north, pose.east, pose.up) == pytest.approx((8.0, -6.0, 12.0), abs=0.7)
        assert abs(math.degrees(pose.yaw)) < 6.0
        for name, height in (("relative", 9.0), ("amsl", 11.0)):
            pose = await held(w, script, f"position global {name}", calm=6.0)
            assert geo.offset(*HOME[:2], *w.drone.firmware.place()) == pytest.approx((20.0, 0.0), abs=0.7)
            assert pose.up == pytest.approx(height, abs=0.5)
        pose = await held(w, script, "position and velocity", calm=6.0)
        assert (pose.north, pose.east, pose.up) == pytest.approx((30.0, 0.0, 11.0), abs=1.0)
        pose = await held(w, script, "acceleration", calm=2.0)
        assert pose.ve > 0.8
        assert abs(pose.vn) < 0.4
        # By now it has begun again as often as it was held up, and for no other reason.
        silences = [m for _, m in w.client.since(0, "STATUSTEXT") if m.text == OFFBOARD_STOPPED_HOVER]
        assert len(script.said("resumed")) == len(silences), script
        await script.line(lambda line: line.startswith("stopped"), timeout=20.0)
        assert await script.end() == 0, script


async def test_mavsdk_manual_control() -> None:
    async with flown("manual") as (w, script):
        pose = await held(w, script, "forward", calm=2.0)
        assert pose.vn > 0.8
        assert abs(pose.ve) < 0.3
        pose = await held(w, script, "right", calm=2.0)
        assert pose.ve > 0.8
        pose = await held(w, script, "up", calm=2.0)
        assert pose.vd < -1.0
        since = asyncio.get_running_loop().time()
        await held(w, script, "clockwise", calm=2.0)
        yaws = [entry.args["yaw"] for entry in w.drone.log if entry.kind == "pose" and entry.t >= since]
        assert sum(math.remainder(two - one, math.tau) for one, two in itertools.pairwise(yaws)) > 0.2
        await script.line(lambda line: line == "held still")
        since = asyncio.get_running_loop().time()
        await w.drone.wait_log(lambda entry: len(sticks(w, since)) >= 5 and set(sticks(w, since)[-5:]) == {LEVEL}, 10.0)
        await held(w, script, "still")
        assert await script.end() == 0, script


LEVEL = (0, 0, 0, 0)


def sticks(w: World, since: float) -> list[tuple[int, ...]]:
    """Roll, pitch, yaw and gaz that the drone was commanded from then on."""
    return [
        tuple(entry.args[axis] for axis in ("roll", "pitch", "yaw", "gaz")) for entry in heard(w, "PCMD", since=since)
    ]


async def test_mavsdk_follow_me() -> None:
    async with flown("follow") as (w, script):
        allow_speed(w)
        await script.line(lambda line: line.startswith("target"), timeout=60.0)
        before = w.drone.pose
        pose = await held(w, script, "following")
        first, *_, target = map(float, script.said("target"))
        assert script.lines[1:4] == ["config 8.0 8.0 180.0", "tried start done", "following True"]
        assert target - pose.north == pytest.approx(6.0, abs=1.5)
        assert pose.east == pytest.approx(0.0, abs=1.0)
        assert pose.up == pytest.approx(10.0, abs=0.5)
        # As far as its target in the same time, however long that was: when it steps is up to the machine.
        assert target - first >= 12.0
        assert pose.north - before.north == pytest.approx(target - first, abs=2.0)
        await script.line(lambda line: line == "stopped", timeout=30.0)
        assert await script.end() == 0, script
