"""Unmodified dronekit on the ArduPilot flavour (conformance 117): its script in a process of its own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import product, program
from support.world import loopback

from anafi_mav import geo

HOME = (48.8789, 2.3677, 35.0)
SCRIPT = Path(__file__).with_name("dronekit_flight.py")


@pytest.mark.timeout(180)
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
