"""Who backs off when two controllers want one drone."""

from __future__ import annotations

import pytest

from anafi_mav.drone.contention import Contention


def middle() -> float:
    return 0.5


def test_guest_yields_after_first_short_connection() -> None:
    guest = Contention(middle)
    guest.connected(airborne=True)
    assert guest.lost(4.2)
    assert guest.stay_away() == 30.0


def test_controller_from_before_takeoff_yields_after_five_short_connections() -> None:
    first = Contention(middle)
    first.connected(airborne=False)
    assert not first.lost(100.0)
    pauses = []
    for count in range(7):
        first.connected(airborne=True)
        assert first.lost(1.0) == (count > 0)  # the first alone may have been bad radio
        pauses.append(first.stay_away())
    assert pauses == [None, None, None, None, 30.0, 60.0, 120.0]


def test_guest_after_seeing_a_landing_waits_in_next_flight() -> None:
    guest = Contention(middle)
    guest.connected(airborne=True)
    guest.on_ground()
    assert not guest.lost(1.0)
    assert guest.lost(1.0, dismissed=True)
    assert guest.stay_away() is None


def test_pauses_double_to_five_minutes_until_a_long_connection() -> None:
    guest = Contention(middle)
    guest.connected(airborne=True)
    pauses = []
    for _ in range(6):
        guest.lost(0.0)
        pauses.append(guest.stay_away())
    assert pauses == [30.0, 60.0, 120.0, 240.0, 300.0, 300.0]
    assert not guest.lost(5.1)
    assert guest.stay_away() is None
    guest.lost(1.0)
    assert guest.stay_away() == 30.0


def test_long_connection_ends_a_row_of_short_ones_however_it_is_lost() -> None:
    first = Contention(middle)
    first.connected(airborne=False)
    first.lost(1.0)
    assert not first.lost(100.0, displaced=False)  # the drone was switched off, for example
    assert not first.lost(1.0)
    assert not first.lost(1.0, displaced=False)  # no other controller, and no proof of peace either
    assert first.lost(1.0)


@pytest.mark.parametrize(("chance", "pause"), [(0.0, 24.0), (0.5, 30.0), (1.0, 36.0)])
def test_pauses_vary_by_a_fifth(chance: float, pause: float) -> None:
    guest = Contention(lambda: chance)
    guest.connected(airborne=True)
    guest.lost(1.0)
    assert guest.stay_away() == pytest.approx(pause)


def test_incomplete_connection_counts_as_a_guests() -> None:
    stranger = Contention(middle)
    assert stranger.lost(0.5)
    assert stranger.stay_away() == 30.0
