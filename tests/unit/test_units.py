"""Unit conversions, against values worked out by hand."""

from __future__ import annotations

import math

import pytest

from anafi_mav import geo, units


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (math.pi, -math.pi), (-math.pi, -math.pi), (1.5 * math.pi, -0.5 * math.pi), (7.0, 7.0 - 2 * math.pi)],
)
def test_wrap_pi(angle: float, wrapped: float) -> None:
    assert units.wrap_pi(angle) == pytest.approx(wrapped)


@pytest.mark.parametrize(("angle", "wrapped"), [(0.0, 0.0), (360.0, 0.0), (-1e-17, 0.0), (-90.0, 270.0), (725.0, 5.0)])
def test_wrap_360(angle: float, wrapped: float) -> None:
    assert units.wrap_360(angle) == pytest.approx(wrapped)


def test_integers_saturate() -> None:
    assert units.saturate(40000.0, 16) == 32767
    assert units.saturate(-40000.0, 16) == -32768
    assert units.saturate(-1.0, 16, signed=False) == 0
    assert units.saturate(70000.0, 16, signed=False) == 65535


def test_mavlink_integers() -> None:
    assert units.deg_e7(48.8789) == 488789000
    assert units.millimetres(-1.2346) == -1235
    assert units.centimetres(3.456) == 346
    assert units.centidegrees(-math.pi / 2) == 27000
    assert units.centidegrees(-1e-9) == 0


HALF = math.sqrt(0.5)
C3, S3 = HALF * math.cos(0.3), HALF * math.sin(0.3)


@pytest.mark.parametrize(
    ("euler", "quaternion"),
    [
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        ((math.pi / 2, 0.0, 0.0), (HALF, HALF, 0.0, 0.0)),  # right wing down: about x
        ((0.0, math.pi / 4, 0.0), (math.cos(math.pi / 8), 0.0, math.sin(math.pi / 8), 0.0)),  # nose up: about y
        ((0.0, 0.0, math.pi / 2), (HALF, 0.0, 0.0, HALF)),  # heading east: about z
        (
            (0.0, math.pi / 2, 0.6),
            (C3, -S3, C3, S3),
        ),
    ],
)
def test_quaternions(euler: tuple[float, float, float], quaternion: tuple[float, float, float, float]) -> None:
    assert units.quaternion_from_euler(*euler) == pytest.approx(quaternion)
    assert units.euler_from_quaternion(*quaternion) == pytest.approx(euler, abs=1e-6)
    assert units.euler_from_quaternion(*(-2.0 * part for part in quaternion)) == pytest.approx(euler, abs=1e-6)


@pytest.mark.parametrize("broken", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0), (math.inf, 0.0, 0.0, 0.0)])
def test_quaternion_without_rotation_raises(broken: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="not a rotation"):
        units.euler_from_quaternion(*broken)


def test_geodesy() -> None:
    # One degree of latitude at the equator is 110 574 m, of longitude 111 320 m (WGS84).
    assert geo.offset(0.0, 0.0, 1.0, 0.0) == pytest.approx((110574.4, 0.0), abs=0.1)
    assert geo.offset(0.0, 0.0, 0.0, 1.0) == pytest.approx((0.0, 111319.5), abs=0.1)
    assert geo.offset(48.8789, 2.3677, *geo.destination(48.8789, 2.3677, -30.0, 40.0)) == pytest.approx((-30.0, 40.0))
    assert geo.destination(48.8789, 2.3677, 0.0, 0.0) == (48.8789, 2.3677)


def test_unit_quaternion_has_the_length_one() -> None:
    assert units.unit_quaternion(3.0, 0.0, 0.0, -4.0) == pytest.approx((0.6, 0.0, 0.0, -0.8))
    assert units.unit_quaternion(0.0, 3e38, 0.0, 0.0) == (0.0, 1.0, 0.0, 0.0)


@pytest.mark.parametrize("number", [0.0, math.nan, math.inf, 1e200])
def test_unit_quaternion_of_no_rotation_raises(number: float) -> None:
    with pytest.raises(ValueError, match="not a rotation"):
        units.unit_quaternion(number, 0.0, 0.0, 0.0)
