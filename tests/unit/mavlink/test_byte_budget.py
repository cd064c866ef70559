"""Byte budget: when frames may leave, and how streams are slowed down until they fit."""

from __future__ import annotations

import asyncio
import math

import pytest

from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.base import shaped_channel
from anafi_mav.mavlink.byte_budget import MAX_SLOWDOWN, MIN_BURST, WINDOW, ByteBudget, StreamPace
from anafi_mav.mavlink.frames import Parser
from anafi_mav.mavlink.streams import Streams

RATE = 2000


def test_burst_leaves_immediately_and_the_rest_at_the_rate() -> None:
    budget = ByteBudget(RATE)
    assert budget.spend(MIN_BURST, 100.0) == 0.0
    assert budget.spend(50, 100.0) == pytest.approx(0.025)
    assert budget.spend(50, 100.025) == pytest.approx(0.025)
    assert budget.spend(MIN_BURST, 200.0) == 0.0  # what was not used is not kept
    assert budget.spend(20, 200.0) == pytest.approx(0.01)


def settle(demand: float, answers: float = 0.0, fixed: float = 0.0) -> tuple[float, float]:
    """Slowdown and bytes/s of streams after two minutes, with streams of `demand` bytes/s when not slowed down."""
    pace, streamed = StreamPace(RATE), 0.0
    for step in range(round(120 / WINDOW) + 1):
        streamed = demand / pace.slowdown + fixed
        pace.count(round(streamed * WINDOW), is_stream=True)
        pace.count(round(answers * WINDOW), is_stream=False)
        pace.adjust(step * WINDOW)
    return pace.slowdown, streamed


@pytest.mark.parametrize("drones", [1, 2, 5, 10])
def test_streams_of_a_fleet_are_slowed_down_until_they_fit(drones: int) -> None:
    slowdown, streamed = settle(2158.0 * drones, fixed=42.0 * drones)
    assert slowdown > 1.0
    assert 0.6 * RATE < streamed <= 0.8 * RATE


def test_streams_that_fit_keep_their_rates_and_get_them_back() -> None:
    assert settle(1500.0) == (1.0, 1500.0)
    assert settle(1e6)[0] == MAX_SLOWDOWN
    pace = StreamPace(RATE)
    pace.slowdown = 20.0
    for step in range(20):
        pace.adjust(step * WINDOW)
    assert pace.slowdown == 1.0


def test_answers_slow_streams_down_further() -> None:
    assert settle(2200.0, answers=900.0)[1] < settle(2200.0)[1]
    assert settle(2200.0, answers=5000.0)[1] > 0.3 * RATE  # but do not end them


def test_slowed_stream_leaves_at_its_longer_interval() -> None:
    pace = StreamPace(RATE)
    streams, channel = Streams[StreamPace]({30: 0.2}, pace=lambda channel: channel), pace
    pace.slowdown = 4.0
    times = [step / 10 for step in range(100)]
    assert sum(bool(streams.due_on([channel], (30,), now)) for now in times) == pytest.approx(10.0 / 0.8, abs=2)
    assert streams.interval(channel, 30) == 0.2


async def test_channel_with_a_budget_sends_answers_before_streams() -> None:
    written: list[tuple[float, bytes]] = []
    loop = asyncio.get_running_loop()
    options = EndpointOptions(bytes_per_second=RATE)
    channel = shaped_channel("a radio", lambda raw: written.append((loop.time(), raw)), options)
    attitude = dialect.MAVLink_attitude_message(1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
    began = loop.time()
    for _ in range(200):  # 8000 bytes
        channel.send(attitude, 1, 1, give_way=True)
    channel.send(dialect.MAVLink_command_ack_message(400, 0), 1, 1)
    await asyncio.sleep(5.0)
    kinds = [Parser().receive(raw)[0].id for _, raw in written]
    assert kinds.index(dialect.MAVLINK_MSG_ID_COMMAND_ACK) <= MIN_BURST // 40 + 1
    for at, _ in written:
        assert sum(len(raw) for then, raw in written if then <= at) <= MIN_BURST + 40 + RATE * (at - began) + 1e-6
    assert channel.counters["dropped_frames"] == 201 - len(written)
    assert math.isclose(written[-1][0] - began, 0.5, abs_tol=0.2)  # the queue holds what leaves in half a second


@pytest.mark.parametrize(("rate", "systems"), [(500, 1), (RATE, 10)])
async def test_heartbeats_keep_their_rate_behind_any_load(rate: int, systems: int) -> None:
    """Streams and answers are four times the budget; a heartbeat a second is due for each system."""
    loop = asyncio.get_running_loop()
    beats: list[tuple[float, int, int]] = []

    def write(raw: bytes) -> None:
        received = Parser().receive(raw)[0]
        if received.id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            beats.append((loop.time(), received.sysid, received.message.custom_mode))

    channel = shaped_channel("a radio", write, EndpointOptions(bytes_per_second=rate))
    attitude = dialect.MAVLink_attitude_message(1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
    ack = dialect.MAVLink_command_ack_message(400, 0)
    began = loop.time()
    for second in range(10):
        for sysid in range(1, systems + 1):
            channel.send(dialect.MAVLink_heartbeat_message(2, 12, 0, second, 4, 3), sysid, 1, give_way=True)
        for _ in range(10):
            for _ in range(rate // 200):
                channel.send(attitude, 1, 1, give_way=True)
                channel.send(ack, 1, 1)
            await asyncio.sleep(0.1)
    for at, _, second in beats:
        assert at - (began + second) < 0.6
    for sysid in range(1, systems + 1):
        assert [second for _, sender, second in beats if sender == sysid] == [*range(10)]
