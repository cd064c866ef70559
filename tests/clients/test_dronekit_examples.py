"""The call sequences of dronekit's example programs, unmodified dronekit: each ends by itself, without an error.

docs/connecting.md lists the examples themselves.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.product import program
from support.setpoints import allow_speed, heard
from support.world import world

SCRIPT = Path(__file__).with_name("dronekit_examples.py")
PACE = 4.0

NAMES = ("set_attitude_target", "guided_set_speed_yaw", "simple_goto")

pytestmark = pytest.mark.third_party


async def test_flights_of_dronekits_examples_end_by_themselves() -> None:
    async with world(speed=PACE, flavour="ardupilot") as w:
        allow_speed(w)
        words = (sys.executable, "-u", str(SCRIPT), f"tcp:{w.address}:5760", str(PACE))
        farthest = {}
        async with program(*words) as script:
            for number, name in enumerate(NAMES, 1):
                await script.line(lambda line, name=name: line == f"begin {name}", timeout=60.0)
                begun = w.drone.log[-1].t
                await script.line(lambda line, name=name: line == f"down {name}", timeout=120.0)
                assert w.drone.flying_state.name == "LANDED"
                assert len(heard(w, "TakeOff")) == number, name
                poses = [e.args for e in w.drone.log if e.kind == "pose" and e.t > begun]
                farthest[name] = max(pose["north"] for pose in poses)
                assert max(pose["up"] for pose in poses) > 2.0, name
            assert await script.end() == 0, script
        # Three seconds of 2 m/s, by one message a second, at four times the speed: 24 m but for the acceleration.
        assert farthest["guided_set_speed_yaw"] > 15.0
        assert len(heard(w, "return_to_home")) == 1  # simple_goto's, which ends landed
