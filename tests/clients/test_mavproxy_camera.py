"""Unmodified MAVProxy: its camera module, on the ArduPilot flavour (conformance 120)."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
from pathlib import Path

import pytest
from support.cameras import photos, videos
from support.product import Process, program
from support.world import World, world

from anafi_mav.arsdk.messages.camera import CameraCameraMode
from anafi_mav.arsdk.messages.thermal import ThermalMode
from anafi_mav.sim.log import LogEntry

pytestmark = pytest.mark.third_party

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"


async def done(w: World, mavproxy: Process, line: str, command: str, **args: object) -> None:
    """Type a command; wait until the drone receives this of Parrot's. MAVProxy shows refusals of cameras only."""
    since = w.drone.log[-1].t

    def received(entry: LogEntry) -> bool:
        wanted = {name: entry.args.get(name) for name in args} == args
        return entry.kind == "command" and entry.name == command and wanted

    mavproxy.say(line)
    await w.drone.log.wait(received, 15.0, since=since)


async def test_camera_module_takes_photos_records_zooms_and_switches(tmp_path: Path) -> None:
    """It imports wx for a map, also where none is drawn. An empty package stands in, after MAVProxy has started."""
    async with world(model="thermal", flavour="ardupilot", web=True, speed=1.0) as w:
        environment = {"HOME": str(tmp_path), "PYTHONPATH": str(tmp_path)}
        words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{w.address}:5760", f"--state-basedir={tmp_path}")
        async with program(*words, stdin=asyncio.subprocess.PIPE, env=environment) as mavproxy:
            await mavproxy.line(lambda line: "online system 1" in line)
            (tmp_path / "wx").mkdir()
            (tmp_path / "wx" / "__init__.py").touch()
            mavproxy.say("module load camera")
            await mavproxy.line(lambda line: line.endswith("Loaded module camera"), timeout=20.0)
            mavproxy.say("camera discover")
            await mavproxy.line(lambda line: "discovery requested" in line)
            for _ in range(20):
                since = len(mavproxy.lines)
                mavproxy.say("camera info")
                if await mavproxy.look(lambda line: "Parrot ANAFI Thermal" in line, since=since, timeout=0.5):
                    break
            else:
                raise AssertionError(f"no camera: {mavproxy}")

            await done(w, mavproxy, "camera mode photo", "camera.set_camera_mode", value=CameraCameraMode.PHOTO)
            since = len(mavproxy.lines)
            await done(w, mavproxy, "camera photo", "camera.take_photo")
            await mavproxy.line(lambda line: bool(re.search("image 0 captured at mftp://", line)), since=since)
            await done(w, mavproxy, "camera photo 2 0", "camera.take_photo")
            await mavproxy.line(lambda line: "image 1 captured" in line, since=since)
            await done(w, mavproxy, "camera stopphotos", "camera.stop_photo")
            assert [media.mode for media in photos(w)] == ["SINGLE", "TIMELAPSE"]

            await done(w, mavproxy, "camera zoom 50", "camera.set_zoom_target", control_mode=0)
            await done(w, mavproxy, "camera zoom in", "camera.set_zoom_target", control_mode=1, target=1.0)
            await done(w, mavproxy, "camera zoom stop", "camera.set_zoom_target", control_mode=1, target=0.0)
            await done(w, mavproxy, "camera source thermal", "thermal.set_mode", mode=ThermalMode.BLENDED)
            await done(w, mavproxy, "camera source rgb", "thermal.set_mode", mode=ThermalMode.DISABLED)

            await done(w, mavproxy, "camera mode video", "camera.set_camera_mode", value=CameraCameraMode.RECORDING)
            await done(w, mavproxy, "camera record start", "camera.start_recording")
            await done(w, mavproxy, "camera record stop", "camera.stop_recording")
            assert len(videos(w)) == 1
            assert not [line for line in mavproxy.lines if "rejected" in line], mavproxy
            assert not [line for line in mavproxy.lines if "Traceback" in line], mavproxy
