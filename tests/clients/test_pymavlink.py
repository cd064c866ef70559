"""The helpers of pymavlink's mavutil, which programs without a library of their own fly with."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import product, program
from support.world import loopback

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("pymavlink_helpers.py")


async def test_pymavlink_helpers_fly_and_stop_the_drone(tmp_path: Path) -> None:
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, speed: 3}}}}]
    """
    async with product(tmp_path, config) as p:
        async with program(sys.executable, "-u", str(SCRIPT), f"tcp:{address}:5760") as script:
            assert await script.end(timeout=120.0) == 0, str(script)
        assert script.lines == [
            "vehicle 1 0 BRAKE 0",
            "mode ACCEPTED GUIDED",
            "armed 128",
            "takeoff ACCEPTED",
            "loiter ACCEPTED LOITER",
            "stopped",
            "auto TEMPORARILY_REJECTED",
            "rtl ACCEPTED RTL",
            "land ACCEPTED LAND",
            "disarmed 0",
        ]
        assert p.entries("command", "Piloting.CancelMoveTo")
