"""Flight by the newest setpoint, without a drone: headings are resolved once, attitudes become sticks."""

from __future__ import annotations

import math
from typing import Any

import pytest

from anafi_mav.drone import Limits
from anafi_mav.texts import MOTION_UNKNOWN
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.velocity_loop import MotionEstimate, VelocityController
from anafi_mav.vehicle.offboard.setpoints import AttitudeSetpoint, MotionSetpoint, PositionReference
from anafi_mav.vehicle.offboard.stream import Steering

LIMITS = Limits(tilt_deg=35.0, climb_mps=4.0, yaw_rate_dps=90.0)
NO_VEHICLE: Any = None
"""A setpoint without a position asks the vehicle for nothing."""


def heading_of(motion: MotionEstimate, yaw: float, now: float) -> None:
    motion.on_attitude(0.0, 0.0, yaw, now)


def turned(yaw: float | None, *, body: bool = True) -> MotionSetpoint:
    return MotionSetpoint(PositionReference.VEHICLE, body, velocity=(0.0, 0.0, 0.0), yaw=yaw)


def test_heading_from_the_nose_is_resolved_once() -> None:
    """Repeated it turns no further; another one counts from the present heading."""
    motion = MotionEstimate()
    steering = Steering(VelocityController(motion))
    heading_of(motion, 1.0, 0.0)
    first = steering.resolve(turned(0.5), NO_VEHICLE)
    assert first.heading.yaw == pytest.approx(1.5)
    heading_of(motion, 1.4, 0.2)
    assert first.resolve(turned(0.5), NO_VEHICLE).heading.yaw == pytest.approx(1.5)
    assert first.resolve(turned(0.6), NO_VEHICLE).heading.yaw == pytest.approx(2.0)
    assert first.resolve(turned(0.5, body=False), NO_VEHICLE).heading.yaw == 0.5
    assert first.resolve(turned(None), NO_VEHICLE).heading.yaw is None
    assert steering.resolve(turned(0.5), NO_VEHICLE).heading.yaw == pytest.approx(1.9)  # of another engagement


def test_heading_from_an_unknown_nose_is_refused() -> None:
    with pytest.raises(Refused, match="heading"):
        Steering(VelocityController(MotionEstimate())).resolve(turned(0.5), NO_VEHICLE)


def test_velocity_of_a_drone_whose_motion_is_unknown_is_refused() -> None:
    steering = Steering(VelocityController(MotionEstimate()))
    setpoint = MotionSetpoint(PositionReference.LOCAL, velocity=(1.0, 0.0, 0.0))
    with pytest.raises(Refused, match=MOTION_UNKNOWN):
        steering.close_loop(setpoint, LIMITS, 0.0, located=True)


def test_attitude_becomes_sticks() -> None:
    """Degrees; the turn is 1.5 /s of the heading error and the rate; the climb is a share of the drone's limit."""
    motion = MotionEstimate()
    heading_of(motion, math.radians(10.0), 0.0)
    setpoint = AttitudeSetpoint(math.radians(5.0), math.radians(-8.0), math.radians(30.0), math.radians(2.0), -0.5)
    steering = Steering(VelocityController(motion)).lean(setpoint, LIMITS, 0.1)
    sticks = steering.sticks
    assert sticks is not None
    assert (sticks.roll_deg, sticks.pitch_deg) == pytest.approx((5.0, -8.0))
    assert (sticks.yaw_rate_dps, sticks.climb_mps) == pytest.approx((1.5 * 20.0 + 2.0, -2.0))
    assert (steering.goal, steering.heading.yaw) == (None, math.radians(30.0))
    late = steering.lean(setpoint, LIMITS, 1.1).sticks  # the heading is too old to turn by
    assert late is not None
    assert late.yaw_rate_dps == pytest.approx(2.0)


def test_move_leaves_no_sticks_of_before() -> None:
    motion = MotionEstimate()
    setpoint = AttitudeSetpoint(0.1, 0.0, 0.0, 0.0, 0.0)
    leaning = Steering(VelocityController(motion)).lean(setpoint, LIMITS, 0.0)
    assert leaning.sticks is not None
    assert leaning.resolve(turned(None), NO_VEHICLE).sticks is None
