"""Where a drone that follows belongs. Axes: north, east; angles in degrees here."""

from __future__ import annotations

import math
from typing import Any

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.services.setpoint.target_messages import sighting, station_sighting
from anafi_mav.vehicle.follow import FORESIGHT, FollowSettings, Sighting, TargetFollower

NAN = math.nan


def following(angle: float = 180.0, *, speed: float = 2.0, seconds: int = 30, **settings: Any) -> TargetFollower:
    """A target that has walked north for a while, and is at (2 * seconds, 0) at time `seconds`."""
    follower = TargetFollower(FollowSettings(angle=angle, responsiveness=0.0, **settings))
    for second in range(seconds + 1):
        follower.see(speed * second, 0.0, 100.0, (speed, 0.0), float(second))
        follower.aim(speed * second - 8.0, 0.0, 8.0, float(second))
    return follower


@pytest.mark.parametrize(
    ("angle", "place"), [(180.0, (52.0, 0.0)), (0.0, (68.0, 0.0)), (90.0, (60.0, 8.0)), (-90.0, (60.0, -8.0))]
)
def test_the_side_of_the_target(angle: float, place: tuple[float, float]) -> None:
    wanted = following(angle).aim(50.0, 0.0, 8.0, 30.0)
    assert wanted is not None
    assert (wanted.x.position, wanted.y.position) == pytest.approx(place, abs=0.01)
    assert (wanted.x.velocity, wanted.y.velocity) == pytest.approx((2.0, 0.0))
    assert wanted.height == 8.0


def test_the_nose_points_to_the_target() -> None:
    wanted = following().aim(60.0, -5.0, 8.0, 30.0)
    assert wanted is not None
    assert wanted.yaw == pytest.approx(math.pi / 2)  # the target is to the east


def test_lost_target_moves_on_briefly_then_stops() -> None:
    follower = following()
    assert follower.target(30.5) == pytest.approx((61.0, 0.0))
    assert follower.target(99.0) == pytest.approx((60.0 + 2.0 * FORESIGHT, 0.0))
    wanted = follower.aim(50.0, 0.0, 8.0, 32.0)
    assert wanted is not None
    assert wanted.x.velocity == 0.0


def test_unmoved_target_is_followed_from_the_drones_direction() -> None:
    follower = TargetFollower(FollowSettings(distance=10.0))
    assert follower.aim(0.0, 30.0, 8.0, 0.0) is None
    follower.see(0.0, 0.0, None, None, 1.0)
    wanted = follower.aim(0.0, 30.0, 8.0, 1.0)
    assert wanted is not None
    assert (wanted.x.position, wanted.y.position) == pytest.approx((0.0, 10.0), abs=1e-6)


def test_velocity_of_a_target_without_velocity_is_estimated() -> None:
    follower = TargetFollower(FollowSettings(responsiveness=0.0))
    for second in range(5):
        follower.see(0.0, 3.0 * second, None, None, float(second))
    assert follower.speed == pytest.approx(3.0)
    wanted = follower.aim(0.0, 0.0, 8.0, 4.0)
    assert wanted is not None
    assert wanted.y.velocity == pytest.approx(3.0)


def test_repeated_target_position_keeps_the_estimated_velocity() -> None:
    """MAVSDK repeats the last one each second, right before its user reports the next."""
    follower = TargetFollower(FollowSettings(responsiveness=0.0))
    for second in range(8):
        follower.see(1.5 * second, 0.0, None, None, float(second))
        follower.see(1.5 * second, 0.0, None, None, second + 0.995)
    assert follower.speed == pytest.approx(1.5)
    assert follower.target(8.0) == pytest.approx((12.0, 0.0))
    for tenth in range(20):
        follower.see(10.5, 0.0, None, None, 8.0 + 0.1 * tenth)
    assert follower.speed == 0.0
    assert follower.target(10.0) == pytest.approx((10.5, 0.0))


def test_target_whose_position_is_repeated_with_a_velocity_stands() -> None:
    """QGroundControl repeats the last fix four times a second, also when its receiver has no newer one."""
    follower = following(speed=8.0)
    for quarter in range(1, 5):
        follower.see(240.0, 0.0, 100.0, (8.0, 0.0), 30.0 + 0.25 * quarter)
    assert follower.target(31.0) == pytest.approx((248.0, 0.0))
    for quarter in range(5, 40):
        follower.see(240.0, 0.0, 100.0, (8.0, 0.0), 30.0 + 0.25 * quarter)
    wanted = follower.aim(232.0, 0.0, 8.0, 40.0)
    assert wanted is not None
    assert (wanted.x.position, wanted.x.velocity) == (pytest.approx(232.0), 0.0)
    follower.see(242.0, 0.0, 100.0, (8.0, 0.0), 40.25)
    assert follower.target(40.5) == pytest.approx((244.0, 0.0))


def test_target_that_stops_at_its_last_position_stands_there() -> None:
    follower = following()
    follower.see(60.0, 0.0, 100.0, (0.0, 0.0), 30.5)
    assert follower.target(31.0) == pytest.approx((60.0, 0.0))


def test_two_positions_at_once_make_no_rocket() -> None:
    follower = TargetFollower(FollowSettings(responsiveness=0.0))
    follower.see(0.0, 0.0, None, None, 0.0)
    follower.see(1.5, 0.0, None, None, 0.005)
    assert follower.speed == 0.0
    follower.see(60.0, 0.0, None, None, 1.0)
    assert follower.speed == pytest.approx(20.0)


def test_drone_does_not_rush_around_a_turning_target() -> None:
    """It turns round: from behind to behind is half a circle, 25 m at 8 m distance and 5 m/s at most."""
    follower = following(tangential_speed=5.0)
    follower.see(60.0, 0.0, None, (-2.0, 0.0), 31.0)
    travelled = 0.0
    last = follower.aim(52.0, 0.0, 8.0, 31.0)
    for step in range(1, 20):
        now = 31.0 + 0.2 * step
        follower.see(60.0 - 2.0 * 0.2 * step, 0.0, None, (-2.0, 0.0), now)
        wanted = follower.aim(52.0, 0.0, 8.0, now)
        target, before = follower.target(now), follower.target(now - 0.2)
        assert wanted is not None
        assert last is not None
        assert target is not None
        assert before is not None
        travelled = math.hypot(
            (wanted.x.position or 0.0) - (last.x.position or 0.0), (wanted.y.position or 0.0) - (last.y.position or 0.0)
        )
        assert travelled <= (5.0 + 2.0) * 0.2 + 0.1
        last = wanted


def test_a_calm_follower_smoothes() -> None:
    calm, quick = TargetFollower(FollowSettings(responsiveness=0.8)), TargetFollower(FollowSettings(responsiveness=0.1))
    for follower in (calm, quick):
        follower.see(0.0, 0.0, None, (0.0, 0.0), 0.0)
        follower.see(10.0, 0.0, None, (0.0, 0.0), 1.0)
    assert calm.target(1.0) == pytest.approx((2.0, 0.0))
    assert quick.target(1.0) == pytest.approx((9.0, 0.0))


def target(capabilities: int, vel: tuple[float, float, float] = (1.0, 2.0, 0.0), alt: float = 40.0) -> Any:
    return dialect.MAVLink_follow_target_message(
        0, capabilities, 488789000, 23677000, alt, vel, [NAN] * 3, [1.0, NAN, NAN, NAN], [NAN] * 3, [NAN] * 3, 0
    )


def test_follow_target_is_read() -> None:
    assert sighting(target(1)) == Sighting(48.8789, 2.3677, 40.0, None)  # MAVSDK says so, whatever its velocity field
    assert sighting(target(3)) == Sighting(48.8789, 2.3677, 40.0, (1.0, 2.0))
    assert sighting(target(1, (NAN, NAN, NAN), NAN)) == Sighting(48.8789, 2.3677, None, None)


def test_position_of_a_station_is_read() -> None:
    def position(vx: int, vy: int) -> Any:
        return dialect.MAVLink_global_position_int_message(0, 488789000, 23677000, 40000, 0, vx, vy, 0, 0)

    assert station_sighting(position(100, -250)) == Sighting(48.8789, 2.3677, 40.0, (1.0, -2.5))
    assert station_sighting(position(0, 0)) == Sighting(48.8789, 2.3677, 40.0, None)  # QGroundControl's "unknown"
    assert station_sighting(position(0, 2100)) == "moves at 21 m/s"


@pytest.mark.parametrize(
    ("capabilities", "vel"), [(0, (0, 0, 0)), (2, (0, 0, 0)), (3, (NAN, 0, 0)), (3, (math.inf, 0, 0)), (3, (50, 0, 0))]
)
def test_invalid_follow_target_is_refused(capabilities: int, vel: tuple[float, float, float]) -> None:
    assert isinstance(sighting(target(capabilities, vel)), str)
