"""The cores of pose from pictures: the height of an earlier moment, and the source of each channel."""

from __future__ import annotations

import pytest

from anafi_mav.services.telemetry.height_track import HeightTrack
from anafi_mav.services.telemetry.pose_sources import PoseSources

ATTITUDE, ODOMETRY = 30, 331


class Key:
    """A channel."""


def test_height_between_two_reports_is_on_their_line() -> None:
    track = HeightTrack()
    assert track.at(1.0, 0.0) is None
    for at, height in ((1.0, 10.0), (1.2, 11.0), (1.4, 11.0)):
        track.add(at, height)
    assert track.at(1.1, 99.0) == pytest.approx(10.5)
    assert track.at(1.3, 99.0) == pytest.approx(11.0)


def test_height_outside_the_reports_is_carried_by_the_climb() -> None:
    track = HeightTrack()
    track.add(1.0, 10.0)
    assert track.at(1.1, 2.0) == pytest.approx(10.2)
    assert track.at(0.9, 2.0) == pytest.approx(9.8)
    assert track.at(2.1, 2.0) is None
    assert track.at(-0.1, 2.0) is None
    track.add(0.5, 70.0)  # late
    assert track.at(1.0, 0.0) == 10.0
    track.clear()
    assert track.at(1.0, 0.0) is None


def test_channel_with_a_request_has_pictures_while_they_arrive() -> None:
    sources, one, other = PoseSources[Key](), Key(), Key()
    channels = [one, other]
    assert sources.on_events(channels, 0.0) is channels
    sources.request(one, ATTITUDE, wanted=True)
    assert sources.is_wanted(channels)
    assert not sources.is_wanted([other])  # the other is muted
    assert sources.on_events(channels, 0.0) == [one, other]
    sources.on_picture(1.0)
    assert sources.on_pictures(channels, 0.9, 0.5, 1.0) == [one]
    assert sources.on_events(channels, 1.0) == [other]
    assert sources.has_pictures(one, channels, 1.0)
    assert sources.on_events(channels, 1.5) == [other]
    assert sources.on_events(channels, 1.51) == [one, other]
    assert not sources.has_pictures(one, channels, 1.51)


def test_channel_waits_for_a_picture_newer_than_its_last_event() -> None:
    sources, one = PoseSources[Key](), Key()
    channels = [one]
    sources.request(one, ATTITUDE, wanted=True)
    sources.on_picture(1.0)
    assert sources.on_pictures(channels, 0.9, 0.95, 1.0) == []
    assert sources.newest(one) == float("-inf")
    sources.on_picture(1.03)
    assert sources.on_pictures(channels, 0.94, 1.02, 1.03) == []  # a later event goes to others, not here
    sources.on_answer(one, 1.0)  # but what was answered counts
    sources.on_picture(1.1)
    assert sources.on_pictures(channels, 0.99, 1.1, 1.1) == []
    assert sources.on_pictures(channels, 1.01, 1.1, 1.1) == [one]
    assert sources.newest(one) == 1.01
    # After a silence of the video the events of that time count.
    assert sources.on_events(channels, 2.0) == [one]
    sources.on_picture(2.1)
    assert sources.on_pictures(channels, 1.99, 2.05, 2.1) == []
    assert sources.on_pictures(channels, 2.06, 2.05, 2.1) == [one]


def test_channel_keeps_pictures_until_its_last_request_ends() -> None:
    sources, one = PoseSources[Key](), Key()
    channels = [one]
    sources.request(one, ATTITUDE, wanted=True)
    sources.request(one, ODOMETRY, wanted=True)
    sources.on_picture(1.0)
    sources.request(one, ATTITUDE, wanted=False)
    assert sources.has_pictures(one, channels, 1.0)
    sources.request(one, ODOMETRY, wanted=False)
    assert not sources.has_pictures(one, channels, 1.0)
    assert not sources.is_wanted(channels)
    sources.request(one, ODOMETRY, wanted=False)


def test_disconnected_drone_and_closed_channel_end_pictures() -> None:
    sources, one = PoseSources[Key](), Key()
    channels = [one]
    sources.request(one, ATTITUDE, wanted=True)
    sources.on_picture(1.0)
    assert sources.on_pictures(channels, 1.0, 0.0, 1.0) == [one]
    sources.link_down()
    assert sources.on_events(channels, 1.0) == [one]
    sources.on_picture(5.0)
    assert sources.on_events(channels, 5.0) == []
    assert sources.newest(one) == 1.0
    sources.close(one)
    assert sources.on_events(channels, 5.0) is channels
    assert sources.newest(one) == float("-inf")
