"""The velocity loop on all four models, judged by the simulator's true poses (part 3 of the offboard contract)."""

from __future__ import annotations

import math

import pytest
from support.steps import velocity_step

from anafi_mav.sim.world.wind import WindSpec

WINDS = [
    WindSpec(),
    WindSpec(5.0, 0.0, gusts=0.0),  # from ahead
    WindSpec(5.0, 200.0),  # from behind and the side, gusty
]


@pytest.mark.parametrize("wind", WINDS, ids=["calm", "headwind", "gusts"])
async def test_a_step_of_five_metres_a_second(wind: WindSpec) -> None:
    """At MaxTilt 35 degrees: settled within 3 s, overshoot below 20 %, steady error below 0.3 m/s."""
    figures = await velocity_step(wind)
    assert [f.model for f in figures] == ["4k", "thermal", "usa", "ai"]
    for flown in figures:
        assert flown.settled <= 3.0, flown
        assert flown.overshoot < 0.2, flown
        assert flown.steady < 0.3, flown


async def test_a_step_across_the_nose() -> None:
    """Towards the south-east with the nose to the west, in wind from the north: every sign of the rotations."""
    for flown in await velocity_step(WindSpec(5.0, 0.0), course=math.radians(135.0), yaw=math.radians(-90.0)):
        assert flown.settled <= 3.0, flown
        assert flown.overshoot < 0.2, flown
        assert flown.steady < 0.3, flown
