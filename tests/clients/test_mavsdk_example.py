"""The shipped example, unmodified MAVSDK, against the product in its own processes."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from support.poses import pose_at
from support.product import free_udp_port, product, program
from support.world import loopback

from anafi_mav import geo

pytestmark = pytest.mark.third_party

EXAMPLE = Path(__file__).parents[2] / "examples" / "takeoff_goto_land.py"
HOME = (48.8789, 2.3677, 35.0)


@pytest.mark.parametrize(
    ("arguments", "place", "height"),
    [((), (30.0, 0.0), 10.0), (("--bearing", "120", "--height", "6"), (-15.0, 25.98), 6.0)],
)
async def test_takeoff_goto_land(
    tmp_path: Path, arguments: tuple[str, ...], place: tuple[float, float], height: float
) -> None:
    """`place` is metres north and east of the start."""
    address = loopback()
    port = free_udp_port(address)
    config = f"""
        endpoints: ["udpout://{address}:{port}"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    async with product(tmp_path, config) as p:
        url = f"udpin://{address}:{port}"
        async with program(sys.executable, str(EXAMPLE), url, *arguments) as example:
            assert await example.end(60.0) == 0, example
        steps = ["healthy", "position known", "armed", "taken off", "flown 30 m", "landed and disarmed"]
        assert [line for line in example.lines if line in steps] == steps, example
        (left,) = (line for line in example.lines if line.endswith("m from the target"))
        assert float(left.split()[0]) < 1.0

        # And what really happened: the true pose when the drone heard the order to land.
        assert len(p.entries("command", "Piloting.TakeOff")) == 1
        (landing,) = p.entries("command", "Piloting.Landing")
        pose = pose_at(p.entries("pose"), landing["t"])
        target = geo.destination(*HOME[:2], *place)
        assert geo.distance(*target, pose["lat"], pose["lon"]) < 1.0
        assert pose["ato"] == pytest.approx(height, abs=1.0)
        assert (await p.flying_state("landed"))["args"]["from"] == "landing"


def test_the_example_knows_mavsdk_only() -> None:
    """A newcomer copies it to a machine that has no gateway."""
    assert re.findall(r"^(?:from|import) (anafi\w*)", EXAMPLE.read_text(), re.MULTILINE) == []
