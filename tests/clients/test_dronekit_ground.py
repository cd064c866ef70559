"""What dronekit2's own tests ask of a vehicle on the ground, by a program of ours with the same calls."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import product, program
from support.world import loopback

pytestmark = pytest.mark.third_party

HOME = (48.8789, 2.3677, 35.0)
SCRIPT = Path(__file__).with_name("dronekit_ground.py")


async def test_dronekit_on_the_ground_gets_each_answer_once(tmp_path: Path) -> None:
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    words = (sys.executable, "-u", str(SCRIPT), f"tcp:{address}:5760", str(HOME[0]), str(HOME[1]))
    async with product(tmp_path, config) as p, program(*words) as script:
        await script.line(lambda line: line == "end", timeout=120.0)
        said = [line for line in script.lines if line.split(" ", 1)[0] in WORDS]
        assert said == [
            "home None",  # reported when it is requested, as ArduCopter does
            "mission_float True ftp True",
            "garbage None",
            "channels 18 int",
            f"empty 0 at {HOME[0]} {HOME[1]}",
            "mission [16, 22, 16, 115, 16] autocontinue {1}",
            "next 0",  # home, before a start
            "next 3",
            "compass [0]",
            "level [0]",
            "reboot [0]",
            "end",
        ]
        assert len(p.entries("command", "Common.Reboot")) == 1


WORDS = {
    "home", "mission_float", "garbage", "channels", "empty", "mission", "next", "compass", "level", "reboot", "end",
}  # fmt: skip
