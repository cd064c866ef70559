"""The watch over heartbeats of ground stations: a channel that closes, a host that stalled, a restart."""

from __future__ import annotations

import pytest

from anafi_mav.vehicle.link_loss import GcsWatch

AFTER = 10.0
"""s without a heartbeat after which ground stations are lost."""


def two_stations() -> GcsWatch:
    watch = GcsWatch()
    watch.heard(100.0, "a")
    watch.heard(103.0, "b")
    return watch


def test_closed_channel_of_the_last_station_is_a_loss() -> None:
    watch = two_stations()
    assert watch.closed("a", 104.0, AFTER, is_certain=True) is None  # b was heard a second ago
    assert watch.closed("b", 105.0, AFTER, is_certain=True) == 2.0
    assert watch.lost


def test_station_silent_for_as_long_as_the_policy_allows_is_no_other_station() -> None:
    assert two_stations().closed("b", 110.0 - 0.01, AFTER, is_certain=True) is None
    assert two_stations().closed("b", 110.0, AFTER, is_certain=True) == 7.0


def test_closed_channel_is_no_loss_while_its_station_may_return() -> None:
    watch = GcsWatch()
    watch.heard(100.0, "a")
    assert watch.closed("a", 101.0, AFTER, is_certain=False) is None
    assert not watch.lost
    assert watch.expires_at(AFTER) == 110.0  # silence decides


def test_closed_channel_without_a_station_is_no_loss() -> None:
    watch = GcsWatch()
    assert watch.closed("a", 101.0, AFTER, is_certain=True) is None
    assert not watch.lost


def test_loss_is_reported_once() -> None:
    watch = GcsWatch()
    watch.heard(100.0, "a")
    assert watch.expire(110.0, AFTER)
    assert watch.closed("a", 111.0, AFTER, is_certain=True) is None


@pytest.mark.parametrize("seconds", [0.0, 4.0])
def test_time_in_which_the_host_stalled_is_no_silence(seconds: float) -> None:
    watch = two_stations()
    watch.stalled(seconds)
    assert watch.expires_at(AFTER) == 113.0 + seconds
    assert watch.closed("b", 110.0 + seconds - 0.01, AFTER, is_certain=True) is None  # a counts until then
    assert two_stations().closed("b", 110.0, AFTER, is_certain=True) is not None


def test_stall_before_the_first_heartbeat_begins_no_watch() -> None:
    watch = GcsWatch()
    watch.stalled(4.0)
    assert not watch.expire(1e9, AFTER)


def test_stations_of_before_a_restart_are_expected_again() -> None:
    watch = two_stations()
    watch.restart(200.0)
    assert watch.expires_at(AFTER) == 210.0
    assert watch.closed("b", 201.0, AFTER, is_certain=True) is None  # a is expected, too
    assert watch.closed("a", 202.0, AFTER, is_certain=True) == 2.0
