"""The call sequences of MAVSDK's example programs, unmodified MAVSDK: each ends by itself, without an error.

docs/connecting.md lists the examples themselves.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import program
from support.setpoints import allow_speed, heard
from support.world import world

SCRIPT = Path(__file__).with_name("mavsdk_examples.py")
PACE = 6.0

HIGHEST = {
    "goto": 18.5,
    "offboard_attitude": 2.0,
    "offboard_position_ned": 5.0,
    "offboard_velocity_body": 2.0,
    "offboard_velocity_ned": 2.0,
    "offboard_position_velocity_ned": 10.0,
    "do_orbit": 10.0,
    "mission": 10.0,
}
"""m above take-off that each reaches at least, less half a metre. Velocities climb for a time and no height."""

pytestmark = pytest.mark.third_party


@pytest.mark.parametrize("names", [tuple(HIGHEST)[:4], tuple(HIGHEST)[4:]], ids=["first", "rest"])
async def test_flights_of_mavsdks_examples_end_by_themselves(names: tuple[str, ...]) -> None:
    async with world(speed=PACE, web=True) as w:
        allow_speed(w)
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{w.address}:5760", str(PACE), *names)
        async with program(*words) as script:
            for number, name in enumerate(names, 1):
                await script.line(lambda line, name=name: line == f"begin {name}", timeout=60.0)
                begun = w.drone.log[-1].t
                await script.line(lambda line, name=name: line == f"end {name}", timeout=90.0)
                await script.line(lambda line, name=name: line == f"down {name}", timeout=60.0)
                assert w.drone.flying_state.name == "LANDED"
                assert len(heard(w, "TakeOff")) <= number, name
                highest = max(e.args["up"] for e in w.drone.log if e.kind == "pose" and e.t > begun)
                assert highest > HIGHEST[name] - 0.5, name
            assert await script.end() == 0, script
        assert len(heard(w, "TakeOff")) == len(names) - ("mission" in names)  # the mission's is in its file
        assert len(heard(w, "return_to_home")) == ("do_orbit" in names)
