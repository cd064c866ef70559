"""The time of a picture on this host's clock, from RTP timestamps and RTCP sender reports."""

from __future__ import annotations

import pytest

from anafi_mav.drone.video.picture_clock import PictureClock

FIRST = 4_294_900_000
"""RTP timestamp that wraps 0.75 s later."""


def ticks(seconds: float) -> int:
    """RTP timestamp of the drone's time `seconds`."""
    return (FIRST + round(seconds * 90_000)) % (1 << 32)


def test_picture_time_without_reports_is_arrival_of_the_fastest() -> None:
    clock = PictureClock()
    assert clock.on_picture(ticks(0.0), 100.0) == pytest.approx(100.0)
    assert clock.on_picture(ticks(0.1), 100.15) == pytest.approx(100.1)  # 50 ms later than the first
    assert clock.on_picture(ticks(0.2), 100.17) == pytest.approx(100.17)  # the fastest so far
    assert clock.on_picture(ticks(0.3), 100.3) == pytest.approx(100.27)
    assert not clock.has_reports


def test_picture_time_with_reports_lacks_the_delay_of_the_camera() -> None:
    clock = PictureClock()
    # The drone's clock is at 0 when ours is at 100; a report takes 5 ms, a picture 120 ms.
    clock.on_report(ticks(0.0), 100.005)
    for number in range(60):
        taken = number / 30
        assert clock.on_picture(ticks(taken), 100.0 + taken + 0.12) == pytest.approx(100.005 + taken, abs=1e-4)
    assert clock.has_reports


def test_picture_time_follows_a_clock_that_drifts() -> None:
    clock = PictureClock()
    # The drone's quartz is slow by 50 ppm: 10 ms late after 200 s, with windows of 30 s wrong by 3 ms at most.
    for number in range(2000):
        ours = 0.1 * number
        shot = clock.on_picture(ticks(ours * (1 - 50e-6)), 100.0 + ours)
        assert 99.996 + ours < shot <= 100.0 + ours + 1e-4


def test_picture_time_after_a_jump_of_the_timestamps_is_its_arrival() -> None:
    clock = PictureClock()
    clock.on_report(ticks(50.0), 100.0)
    assert clock.on_picture(ticks(50.0), 100.1) == pytest.approx(100.0)
    assert clock.on_picture(ticks(0.0), 100.2) == pytest.approx(100.2)
    assert not clock.has_reports
    assert clock.on_picture(ticks(0.1), 100.32) == pytest.approx(100.3)
