"""Circles by hand: where a drone is on one, what it is asked for, where its nose points."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from anafi_mav import geo
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.velocity_loop import MotionEstimate
from anafi_mav.vehicle.circle import Circle, Facing, Lap, entry, fastest, heading_at, outline

CENTRE = GeoPoint(48.8789, 2.3677)


def circle(direction: int = 1, facing: Facing = Facing.CENTRE, angle: float | None = None) -> Circle:
    return Circle(CENTRE, 20.0, direction, 4.0, 15.0, facing, heading=0.5, angle=angle)


def at(north: float, east: float) -> MotionEstimate:
    """A drone that is so far from the centre."""
    motion = MotionEstimate()
    motion.on_place(*CENTRE)
    motion.north, motion.east = north, east
    return motion


@pytest.mark.parametrize("direction", [1, -1])
def test_north_of_the_centre(direction: int) -> None:
    """Clockwise from above leads east there. 4 m/s on 20 m take 0.8 m/s2 to the south, and turn by 0.2 rad/s."""
    wanted = Lap(circle(direction)).demand(at(23.0, 0.0))
    assert wanted is not None
    assert (wanted.x.position, wanted.y.position) == pytest.approx((20.0, 0.0))
    assert (wanted.x.velocity, wanted.y.velocity) == pytest.approx((0.0, direction * 4.0), abs=1e-9)
    assert (wanted.x.acceleration, wanted.y.acceleration) == pytest.approx((-0.8, 0.0), abs=1e-9)
    assert abs(wanted.yaw or 0.0) == pytest.approx(math.pi)  # it looks south
    assert (wanted.yaw_rate, wanted.height) == (pytest.approx(direction * 0.2), 15.0)


def test_east_of_the_centre() -> None:
    wanted = Lap(circle()).demand(at(0.0, 10.0))
    assert wanted is not None
    assert (wanted.x.position, wanted.y.position) == pytest.approx((0.0, 20.0), abs=1e-9)
    assert (wanted.x.velocity, wanted.y.velocity) == pytest.approx((-4.0, 0.0), abs=1e-9)  # on to the south
    assert wanted.yaw == pytest.approx(-math.pi / 2)  # it looks west


@pytest.mark.parametrize(
    ("direction", "facing", "heading"),
    [
        (1, Facing.CENTRE, -math.pi / 2),
        (1, Facing.TANGENT, math.pi),
        (-1, Facing.TANGENT, 0.0),
        (1, Facing.KEEP, 0.5),
        (1, Facing.FREE, None),
    ],
)
def test_where_the_nose_points_east_of_the_centre(direction: int, facing: Facing, heading: float | None) -> None:
    found = heading_at(circle(direction, facing), math.pi / 2)
    if heading is None:
        assert found is None
    else:
        assert math.cos(found or 0.0) == pytest.approx(math.cos(heading), abs=1e-9)
        assert math.sin(found or 0.0) == pytest.approx(math.sin(heading), abs=1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_lap_is_counted_in_the_flown_direction(direction: int) -> None:
    lap = Lap(circle(direction, angle=math.pi))
    for step in range(9):
        bearing = direction * step * math.pi / 8
        lap.demand(at(20.0 * math.cos(bearing), 20.0 * math.sin(bearing)))
        assert lap.flown == pytest.approx(step * math.pi / 8)
        assert lap.done == (step == 8)
    lap.demand(at(0.0, direction * 20.0))  # blown back by a quarter
    assert lap.flown == pytest.approx(math.pi / 2)


def test_lap_without_a_position_has_no_demand() -> None:
    assert Lap(circle()).demand(MotionEstimate()) is None


def test_the_nearest_point_of_the_circle() -> None:
    start = entry(circle(), GeoPoint(*geo.destination(*CENTRE, 0.0, -50.0)))
    assert geo.offset(*CENTRE, *start) == pytest.approx((0.0, -20.0), abs=0.01)
    start = entry(circle(), CENTRE)
    assert geo.offset(*CENTRE, *start) == pytest.approx((20.0, 0.0), abs=0.01)


def test_the_outline_is_on_the_circle() -> None:
    points = outline(circle())
    assert len(points) == 33
    assert points[0] == points[-1]
    assert {round(geo.distance(*CENTRE, *point), 1) for point in points} == {20.0}
    # 32 pieces of 2 * 20 m * sin(pi / 32) each.
    pieces = {round(geo.distance(*a, *b), 2) for a, b in pairwise(points)}
    assert pieces == {3.92}


def test_the_tilt_limits_the_speed() -> None:
    """Half of g tan 10 deg is 0.865 m/s2: the root of 0.865 times 20 is 4.16 m/s."""
    assert fastest(20.0, 10.0) == pytest.approx(4.159, abs=0.002)
    assert fastest(80.0, 10.0) == pytest.approx(2 * 4.159, abs=0.004)
