"""Unmodified MAVProxy: its modules gimbal (older mounts) and camera (gimbal protocol, version 2)."""

from __future__ import annotations

import asyncio
import math
import shutil
import sys
from pathlib import Path

import pytest
from support.gimbal import looks, next_truth, rate, truth
from support.product import Process, program
from support.world import HOME, world

from anafi_mav import geo

pytestmark = pytest.mark.third_party

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"
EAST = geo.destination(HOME[0], HOME[1], 0.0, 20.0)


async def accepted(mavproxy: Process, line: str, name: str) -> None:
    """Type a command; MAVProxy shows that the vehicle accepted it."""
    since = len(mavproxy.lines)
    mavproxy.say(line)
    await mavproxy.line(lambda shown: shown.endswith(f"Got COMMAND_ACK: {name}: ACCEPTED"), since=since, timeout=15.0)


async def test_gimbal_and_mount_of_mavproxy_turn_the_gimbal(tmp_path: Path) -> None:
    """On the ArduPilot flavour, an Ai. Its gimbal module sends a rate once a second.

    It imports wx for a map, also where none is drawn. An empty package stands in, after MAVProxy has started without.
    """
    async with world(model="ai", flavour="ardupilot", speed=1.0) as w:
        environment = {"HOME": str(tmp_path), "PYTHONPATH": str(tmp_path)}
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env=environment) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line)
            (tmp_path / "wx").mkdir()
            (tmp_path / "wx" / "__init__.py").touch()
            for module in ("gimbal", "camera"):
                mavproxy.say(f"module load {module}")
                await mavproxy.line(lambda line, module=module: line.endswith(f"Loaded module {module}"), timeout=20.0)

            # gimbal: roll, pitch, yaw.
            await accepted(mavproxy, "gimbal angle 5 -30 20", "DO_MOUNT_CONTROL")
            await looks(w, roll_absolute=5.0, pitch_absolute=-30.0, yaw_relative=20.0)
            mavproxy.say("gimbal rate 0 10 -5")
            await w.drone.wait_log(lambda e: e.name == "gimbal.set_target" and e.args["control_mode"] == 1, 5.0)
            await next_truth(w)
            seen = [await rate(w, name, 12) for name in ("pitch_absolute", "yaw_relative")]  # over two messages
            assert seen == pytest.approx([10.0, -5.0], rel=0.1)
            await accepted(mavproxy, "gimbal mode neutral", "DO_MOUNT_CONFIGURE")
            await looks(w, roll_absolute=0.0, pitch_absolute=0.0, yaw_relative=0.0)

            # camera: pitch, yaw; it names device 1.
            mavproxy.say("camera discover")
            await accepted(mavproxy, "camera mount angle 25 -10 body", "DO_GIMBAL_MANAGER_PITCHYAW")
            await looks(w, pitch_absolute=25.0, yaw_relative=-10.0)
            await accepted(mavproxy, "camera mount rate -8 4 body", "DO_GIMBAL_MANAGER_PITCHYAW")
            seen = [await rate(w, name, 5) for name in ("pitch_absolute", "yaw_relative")]
            assert seen == pytest.approx([-8.0, 4.0], rel=0.1)
            await accepted(mavproxy, "camera mount angle -15 30 earth", "DO_GIMBAL_MANAGER_PITCHYAW")
            await looks(w, pitch_absolute=-15.0, yaw_absolute=30.0)
            await accepted(mavproxy, "camera mount center", "DO_GIMBAL_MANAGER_PITCHYAW")
            await looks(w, pitch_absolute=0.0)

            await w.take_off(20.0)
            await accepted(mavproxy, f"gimbal roi {EAST[0]:.7f} {EAST[1]:.7f} 0", "DO_MOUNT_CONTROL")
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(math.degrees(e.args["yaw"]) - 90.0) < 5.0, 20.0)
            await looks(w, pitch_absolute=-45.0)
            assert truth(w).roll_absolute == 0.0
            assert not [line for line in mavproxy.lines if "Traceback" in line], mavproxy
