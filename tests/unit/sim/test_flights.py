"""The simulated drone flies as on the day when `sim_flights.json` was recorded."""

from __future__ import annotations

import math

import pytest
from support.sim_flights import FLIGHTS, recorded

RECORDED = recorded()

NEAR = 0.1
"""m between a pose and the recorded one, at every noted time."""

ALIGNED = 3.0
"""deg; at 200 deg/s one step of 60 a second turns the nose by more."""


def test_every_flight_is_recorded() -> None:
    assert set(RECORDED) == set(FLIGHTS)


@pytest.mark.parametrize("name", FLIGHTS)
def test_flight_stays_within_0_1_m_of_the_record(name: str) -> None:
    flown = FLIGHTS[name].fly()
    assert [row[0] for row in flown] == [row[0] for row in RECORDED[name]]
    apart = [math.dist(now[1:4], then[1:4]) for now, then in zip(flown, RECORDED[name], strict=True)]
    turned = [abs(now[4] - then[4]) for now, then in zip(flown, RECORDED[name], strict=True)]
    assert max(apart) < NEAR, f"after {flown[apart.index(max(apart))][0]} s"
    assert max(turned) < ALIGNED
