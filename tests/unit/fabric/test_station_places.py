"""Places for stations: who waits, who follows, who is forgotten."""

from __future__ import annotations

from anafi_mav.fabric.station_places import MAX_WAITING, StationPlaces


def test_station_without_a_place_gets_that_of_the_next_that_leaves() -> None:
    places = StationPlaces(1)
    assert [places.arrive(name) for name in ("a", "b", "c")] == [True, False, False]
    assert places.leave("a") == "b"
    assert places.leave("b") == "c"
    assert places.leave("c") is None
    assert not places.is_known("a")


def test_waiting_station_that_leaves_is_forgotten() -> None:
    places = StationPlaces(1)
    for name in ("a", "b", "c"):
        places.arrive(name)
    assert places.leave("b") is None
    assert places.leave("a") == "c"


def test_waiting_stations_are_bounded() -> None:
    places = StationPlaces(0)
    for number in range(MAX_WAITING + 1):
        places.arrive(str(number))
    assert places.is_known(str(MAX_WAITING - 1))
    assert not places.is_known(str(MAX_WAITING))


def test_station_that_gives_way_waits_behind_the_others() -> None:
    places = StationPlaces(1)
    for name in ("a", "b", "c"):
        places.arrive(name)
    assert places.has_waiting
    assert places.give_way("a") == "b"
    assert places.is_known("a")
    assert [places.leave(name) for name in ("b", "c", "a")] == ["c", "a", None]
    assert not places.has_waiting
