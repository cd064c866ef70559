"""Settings of the simulated drone: clamped, reported after every command, back to the factory's values on demand."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, piloting_style, precise_home, rth

# Command, event, and the lowest, the highest and the factory's value (arsdk.md 2.5).
RANGES: list[tuple[Callable[[float], Message], type[Message], float, float, float]] = [
    (ardrone3.MaxTilt, ardrone3.MaxTiltChanged, 1.0, 40.0, 10.0),
    (ardrone3.MaxAltitude, ardrone3.MaxAltitudeChanged, 0.5, 4000.0, 150.0),
    (ardrone3.MaxDistance, ardrone3.MaxDistanceChanged, 10.0, 4000.0, 100.0),
    (ardrone3.MaxVerticalSpeed, ardrone3.MaxVerticalSpeedChanged, 0.1, 4.0, 3.0),
    (ardrone3.MaxRotationSpeed, ardrone3.MaxRotationSpeedChanged, 3.0, 200.0, 40.0),
    (ardrone3.MaxPitchRollRotationSpeed, ardrone3.MaxPitchRollRotationSpeedChanged, 40.0, 300.0, 116.0),
    (rth.SetMinAltitude, rth.MinAltitude, 20.0, 100.0, 20.0),
    (rth.SetEndingHoveringAltitude, rth.EndingHoveringAltitude, 1.0, 10.0, 10.0),
]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize(("command", "event", "low", "high", "default"), RANGES)
def test_a_range(
    bench: Bench,
    command: Callable[[float], Message],
    event: Callable[..., Message],
    low: float,
    high: float,
    default: float,
) -> None:
    def answer(value: float) -> Message:
        return bench.send(command(value))[0]

    assert event(default, low, high) in bench.firmware.settings.report()
    middle = (low + high) / 2.0
    assert answer(middle) == event(middle, low, high)
    assert answer(middle) == event(middle, low, high)  # reported again, though nothing changed
    assert answer(low - 1.0) == event(low, low, high)
    assert answer(high + 1.0) == event(high, low, high)
    assert answer(math.nan) == event(high, low, high)
    assert answer(-math.inf) == event(low, low, high)
    bench.send(common.Reset())
    assert event(default, low, high) in bench.firmware.settings.report()


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (ardrone3.NoFlyOverMaxDistance(1), ardrone3.NoFlyOverMaxDistanceChanged(1)),
        (ardrone3.NoFlyOverMaxDistance(7), ardrone3.NoFlyOverMaxDistanceChanged(0)),
        (ardrone3.BankedTurn(0), ardrone3.BankedTurnChanged(0)),
        (rth.SetEndingBehavior(rth.RthEndingBehavior.LANDING), rth.EndingBehavior(rth.RthEndingBehavior.LANDING)),
        (rth.SetAutoTriggerMode(rth.RthAutoTriggerMode.OFF), rth.AutoTriggerMode(rth.RthAutoTriggerMode.OFF)),
        (
            precise_home.SetMode(precise_home.PreciseHomeMode.DISABLED),
            precise_home.Mode(precise_home.PreciseHomeMode.DISABLED),
        ),
        (
            piloting_style.SetStyle(piloting_style.PilotingStyleStyle.CAMERA_OPERATED),
            piloting_style.Style(piloting_style.PilotingStyleStyle.CAMERA_OPERATED),
        ),
        (common.ReturnHomeOnDisconnect(0), common.ReturnHomeOnDisconnectChanged(0, 0)),
        (common.ProductName("Étienne"), common.ProductNameChanged("Étienne")),
    ],
)
def test_a_choice(bench: Bench, command: Message, answer: Message) -> None:
    assert bench.send(command) == [answer]


def test_return_delay_is_reported_by_both_features(bench: Bench) -> None:
    assert bench.send(rth.SetDelay(500)) == [rth.Delay(120, 0, 120), ardrone3.ReturnHomeDelayChanged(120)]
    assert bench.send(ardrone3.ReturnHomeDelay(7)) == [rth.Delay(7, 0, 120), ardrone3.ReturnHomeDelayChanged(7)]


def test_a_name_has_a_limit(bench: Bench) -> None:
    assert bench.send(common.ProductName("x" * 1000)) == [common.ProductNameChanged("x" * 64)]


def test_reset_reports_each_setting_then_its_end(bench: Bench) -> None:
    bench.send(ardrone3.MaxTilt(35.0))
    answer = bench.send(common.Reset())
    assert ardrone3.MaxTiltChanged(10.0, 1.0, 40.0) in answer
    assert answer[-1] == common.ResetChanged()
    assert answer[:-1] == bench.firmware.settings.report()


def test_a_limit_counts_at_once(bench: Bench) -> None:
    bench.take_off()
    bench.send(ardrone3.MaxVerticalSpeed(0.5))
    bench.sticks(3.0, gaz=100)
    assert bench.pose.vd == pytest.approx(-0.5, abs=0.01)
