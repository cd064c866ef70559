"""A selection of the matrix of `support.flight_matrix`; `tests/bench/flight_matrix.py` flies all of it."""

from __future__ import annotations

import pytest
from support.flavours import both
from support.flight_matrix import fly

CELLS = [
    ("motors", "REPOSITION"),
    ("climb", "mode hold"),
    ("climb", "DISARM"),
    ("goto", "param tilt"),
    ("velocity", "ROI"),
    ("joystick", "pilot stick"),
]
"""What follows a take-off, a stop, a refusal, a parameter, what takes over, and the pilot."""


@both
@pytest.mark.parametrize(("situation", "arrival"), CELLS)
async def test_cell_of_the_flight_matrix_has_no_finding(flavour: str, situation: str, arrival: str) -> None:
    line, findings = await fly(situation, arrival, flavour)
    assert findings == [], line
