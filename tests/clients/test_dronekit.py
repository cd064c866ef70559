"""Unmodified dronekit on the ArduPilot flavour (conformance 117): its script in a process of its own."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import pytest
from support.missions import apart
from support.product import product, program
from support.world import loopback

from anafi_mav import geo

pytestmark = pytest.mark.third_party

HOME = (48.8789, 2.3677, 35.0)
SCRIPT = Path(__file__).with_name("dronekit_flight.py")


async def test_conf_117_dronekit(tmp_path: Path) -> None:
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    place = geo.destination(*HOME[:2], 30.0, 0.0)
    words = (sys.executable, "-u", str(SCRIPT), f"tcp:{address}:5760", f"{place[0]:.7f}", f"{place[1]:.7f}")
    async with product(tmp_path, config) as p, program(*words) as script:
        await script.line(lambda line: line.startswith("ready"), timeout=40.0)
        await script.line(lambda line: line == "armable True", timeout=20.0)
        await script.line(lambda line: line == "there", timeout=60.0)
        assert len(p.entries("command", "Piloting.TakeOff")) == 1
        await p.entry("pose", "", lambda pose: geo.distance(*place, pose["lat"], pose["lon"]) < 1.5)
        await script.line(lambda line: line == "landed", timeout=60.0)
        await p.flying_state("landed")
        assert [line for line in script.lines if line.startswith("mode ")] == ["mode BRAKE", "mode LOITER", "mode RTL"]
        assert len(p.entries("command", "rth.return_to_home")) == 1


async def test_conf_075_117_dronekit_missions(tmp_path: Path) -> None:
    """Up, down and flown; what the drone did is from its own log."""
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    words = (sys.executable, "-u", str(SCRIPT.with_name("dronekit_mission.py")), f"tcp:{address}:5760")
    async with product(tmp_path, config) as p, program(*words, str(HOME[0]), str(HOME[1])) as script:
        await script.line(lambda line: line == "landed", timeout=150.0)
        said = dict(line.split(" ", 1) for line in script.lines if " " in line)
        assert said["read"] == said["sent"]
        assert said["home"] == f"{HOME[0]} {HOME[1]} {HOME[2]:.0f}"
        assert said["end"] == str(len(said["sent"].split("), (")))  # counted from home
        await p.flying_state("landed")
        track = [entry["args"] for entry in p.entries("pose")]
        for place in ((HOME[0] + 0.00018, HOME[1], 6.0), (HOME[0], HOME[1] + 0.0001, 9.0)):
            # Between two poses the drone goes straight on, however rarely a busy machine lets it log one.
            from_it = [(*geo.offset(*place[:2], at["lat"], at["lon"]), at["ato"] - place[2]) for at in track]
            assert min(apart((0.0, 0.0, 0.0), one, two) for one, two in itertools.pairwise(from_it)) < 2.0
        names = [entry["args"]["command"] for entry in p.entries("plan", "item")]
        lines = [name.removeprefix("condition_") for name in names]
        assert lines[-7:] == [
            "waypoint", "delay", "set_still_mode", "start_photo", "change_speed", "waypoint", "return_to_launch",
        ]  # fmt: skip
        assert len(p.entries("command", "Piloting.TakeOff")) == 1  # dronekit's own, the mission's is in the air
