"""Wind on the simulated drone."""

from __future__ import annotations

import math
import random
import statistics

import pytest

from anafi_mav.arsdk.messages.ardrone3 import WarningLevel
from anafi_mav.errors import ConfigError
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.motion import STEP, Pose
from anafi_mav.sim.world.wind import CALM, Wind, WindSpec, WindWatch

RAD = math.pi / 180.0


class Hover:
    """A drone that hovers at 50 m in wind."""

    def __init__(self, spec: WindSpec, model: str = "4k") -> None:
        self.body = Airframe(MODELS[model].airframe)
        self.wind = Wind(spec, random.Random(4))
        self.body.down = -50.0
        self.body.limits(tilt_rate=300.0 * RAD, ceiling=4000.0)
        self.body.hover()

    def run(self, seconds: float) -> Pose:
        for _ in range(round(seconds / STEP)):
            self.body.blow(*self.wind.advance(STEP))
            self.body.step()
        return self.body.pose


@pytest.mark.parametrize(
    ("direction", "north", "east"), [(0.0, -5.0, 0.0), (90.0, 0.0, -5.0), (225.0, 3.5355, 3.5355), (360.0, -5.0, 0.0)]
)
def test_wind_comes_from_its_direction(direction: float, north: float, east: float) -> None:
    assert WindSpec(5.0, direction).steady == pytest.approx((north, east), abs=1e-4)


def test_gusts_have_the_requested_spread() -> None:
    wind = Wind(WindSpec(10.0, 0.0, 0.2), random.Random(1))
    north = [wind.advance(0.5)[0] for _ in range(8000)]
    assert statistics.mean(north) == pytest.approx(-10.0, abs=0.15)
    assert statistics.stdev(north) == pytest.approx(2.0, abs=0.15)
    again = Wind(WindSpec(10.0, 0.0, 0.2), random.Random(1))
    assert [again.advance(0.5)[0] for _ in range(100)] == north[:100]


def test_steady_wind_is_balanced_by_tilt() -> None:
    hover = Hover(WindSpec(8.0, 0.0, 0.0))
    pose = hover.run(15.0)
    # Drag grows with the square and is tan 40 deg at 15 m/s: tan(tilt) = tan 40 (8/15)^2 = 0.2387, 13.4 deg, nose down
    # into a wind from ahead.
    assert pose.pitch / RAD == pytest.approx(-13.42, abs=0.1)
    assert math.hypot(pose.north, pose.east) < 0.5
    assert hover.body.is_still


def test_gusts_do_not_displace_a_hover() -> None:
    hover = Hover(WindSpec(10.0, 270.0))
    places = [hover.run(1.0) for _ in range(60)]
    assert max(math.hypot(pose.north, pose.east) for pose in places) < 2.0
    assert max(pose.ground_speed for pose in places) < 1.0


def test_too_strong_wind_carries_the_drone_away() -> None:
    pose = Hover(WindSpec(20.0, 0.0, 0.0)).run(60.0)
    # Full tilt balances 15 m/s of air: what is beyond goes over ground, to the south.
    assert pose.vn == pytest.approx(-5.0, abs=0.1)
    assert pose.pitch / RAD == pytest.approx(-40.0, abs=0.1)
    assert pose.north < -200.0


def test_full_tilt_with_and_against_the_wind() -> None:
    for pitch, speed in ((-40.0, 15.0 - 5.0), (40.0, -15.0 - 5.0)):
        hover = Hover(WindSpec(5.0, 0.0, 0.0))
        hover.body.sticks(0.0, pitch * RAD, 0.0, 0.0)
        assert hover.run(30.0).vn == pytest.approx(speed, abs=0.1)


def test_move_in_wind_ends_at_its_target() -> None:
    hover = Hover(WindSpec(8.0, 90.0))
    hover.run(3.0)
    hover.body.move(20.0, 10.0, 50.0, speed=5.0, climb=2.0, yaw_rate=1.0)
    for _ in range(60):
        pose = hover.run(0.5)
        if hover.body.has_arrived:
            break
    assert hover.body.has_arrived
    assert (pose.north, pose.east) == pytest.approx((20.0, 10.0), abs=0.6)


def test_drone_on_the_ground_is_unmoved_by_wind() -> None:
    hover = Hover(WindSpec(15.0, 0.0))
    hover.body.down = 0.0
    hover.body.off()
    pose = hover.run(10.0)
    assert (pose.north, pose.east, pose.vn, pose.ve) == (0.0, 0.0, 0.0, 0.0)


def test_wind_warning_level_follows_the_felt_wind() -> None:
    watch = WindWatch(13.9)  # a 4K; three quarters are 10.4

    def after(speed: float, seconds: float) -> WarningLevel:
        return watch.feel(speed, seconds)

    assert after(10.0, 60.0) is WarningLevel.OK
    assert after(10.8, 60.0) is WarningLevel.WARNING
    assert after(10.1, 60.0) is WarningLevel.WARNING  # not yet clearly weaker
    assert after(9.8, 60.0) is WarningLevel.OK
    assert after(14.0, 60.0) is WarningLevel.CRITICAL
    assert after(0.0, 0.05) is WarningLevel.CRITICAL  # a lull: 13.7
    assert after(0.0, 60.0) is WarningLevel.OK


@pytest.mark.parametrize(
    ("values", "key"),
    [((-1.0,), "speed"), ((41.0,), "speed"), ((5.0, 361.0), "direction"), ((5.0, 0.0, 1.1), "gusts")],
)
def test_invalid_wind_is_refused(values: tuple[float, ...], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        WindSpec(*values)
    assert caught.value.key_path == key
    assert CALM.steady == (0.0, 0.0)
