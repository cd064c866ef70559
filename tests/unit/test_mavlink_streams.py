"""Stream intervals: defaults, overrides of one channel, and a rate that jitter does not eat."""

from __future__ import annotations

import gc
import random

import pytest

from anafi_mav.errors import LocalProtocolError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.streams import DEFAULT_INTERVALS, Streams

ATTITUDE, SYS_STATUS, UNKNOWN = 30, 1, 9999


class Key:
    """Stands for a channel: anything that can be referred to weakly will do."""


def sent(streams: Streams[Key], channel: Key, id: int, times: list[float]) -> list[float]:
    return [now for now in times if streams.due(channel, id, now)]


def test_every_default_is_a_message_of_the_dialect() -> None:
    assert all(id in dialect.mavlink_map and 0.1 <= interval <= 5.0 for id, interval in DEFAULT_INTERVALS.items())


def test_default_interval_holds_until_it_is_set_and_after_it_is_reset() -> None:
    streams, channel = Streams[Key](), Key()
    assert streams.interval(channel, ATTITUDE) == 0.1
    streams.set(channel, ATTITUDE, 0.5)
    assert streams.interval(channel, ATTITUDE) == 0.5
    streams.set(channel, ATTITUDE, None)
    assert streams.interval(channel, ATTITUDE) is None
    streams.reset(channel, ATTITUDE)
    assert streams.interval(channel, ATTITUDE) == 0.1
    streams.reset(channel, ATTITUDE)  # twice does no harm


def test_a_message_without_default_is_streamed_only_when_asked_for() -> None:
    streams, channel = Streams[Key](), Key()
    assert streams.interval(channel, UNKNOWN) is None
    assert not streams.due(channel, UNKNOWN, 0.0)
    streams.set(channel, UNKNOWN, 1.0)
    assert streams.due(channel, UNKNOWN, 0.0)


def test_channels_do_not_share_intervals_or_times() -> None:
    streams, one, other = Streams[Key](), Key(), Key()
    streams.set(one, ATTITUDE, None)
    assert not streams.due(one, ATTITUDE, 0.0)
    assert streams.due(other, ATTITUDE, 0.0)
    assert streams.interval(other, ATTITUDE) == 0.1


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan"), float("inf")])
def test_an_interval_is_a_positive_number(interval: float) -> None:
    with pytest.raises(LocalProtocolError):
        Streams[Key]().set(Key(), ATTITUDE, interval)


def test_the_first_message_is_due_at_once_and_the_next_not() -> None:
    streams, channel = Streams[Key](), Key()
    assert streams.due(channel, SYS_STATUS, 1000.0)
    assert not streams.due(channel, SYS_STATUS, 1000.05)


@pytest.mark.parametrize(
    ("source", "interval", "expected"),
    [
        (5.0, 0.1, 50),  # a slow source sets the rate
        (5.0, 0.2, 50),  # the same rate
        (30.0, 0.2, 50),  # a fast source is thinned out
        (30.0, 1 / 15, 150),
        (200.0, 1.0, 10),
    ],
)
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_rate_is_the_lower_of_source_and_request(source: float, interval: float, expected: int, jitter: float) -> None:
    # Conformance asks for 20 %; here it is two messages in ten seconds, whatever the jitter.
    random_ = random.Random(7)
    streams, channel = Streams[Key]({ATTITUDE: interval}), Key()
    times = [(k + jitter * random_.uniform(-1, 1)) / source for k in range(round(10 * source))]
    assert abs(len(sent(streams, channel, ATTITUDE, times)) - expected) <= 2


def test_no_burst_after_a_silence() -> None:
    streams, channel = Streams[Key]({ATTITUDE: 1.0}), Key()
    assert sent(streams, channel, ATTITUDE, [0.0, 50.0, 50.1, 50.2, 50.3]) == [0.0, 50.0]


def test_a_channel_that_is_gone_is_forgotten() -> None:
    streams, channel = Streams[Key](), Key()
    streams.set(channel, ATTITUDE, 0.5)
    assert len(streams._channels) == 1
    del channel
    gc.collect()
    assert len(streams._channels) == 0


def test_due_on_asks_each_channel_anew_when_something_changed() -> None:
    streams, one, other = Streams[Key](), Key(), Key()
    channels = [one]
    assert streams.due_on(channels, ATTITUDE, 0.0) == [one]
    assert streams.due_on(channels, ATTITUDE, 0.01) == []
    streams.set(one, ATTITUDE, 0.5)  # begins anew, whatever was left of the old interval
    assert streams.due_on(channels, ATTITUDE, 0.02) == [one]
    assert streams.due_on(channels, ATTITUDE, 0.2) == []
    channels = [one, other]
    assert streams.due_on(channels, ATTITUDE, 0.21) == [other]
    assert streams.due_on(channels, ATTITUDE, 0.26) == [other]  # the grid begins half an interval early
    assert streams.due_on(channels, ATTITUDE, 0.27) == [one]
    streams.set(other, ATTITUDE, None)
    assert streams.due_on(channels, ATTITUDE, 9.0) == [one]
    streams.reset(other, ATTITUDE)
    assert streams.due_on(channels, ATTITUDE, 9.0) == [other]
    assert streams.due_on([], ATTITUDE, 9.0) == []
