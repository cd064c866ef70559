"""Setpoints as the drone flies them: attitudes, velocities, positions. No I/O.

`services.setpoint.setpoint_messages` makes them of MAVLink's messages and says which frames and fields mean what.
"""

from __future__ import annotations

import enum
from typing import TypeAlias

from msgspec import Struct

NO_MOTION = 0.01
"""rad, rad/s, m/s, m/s2 and share of full climb up to which a setpoint asks for no motion: single precision."""


class AttitudeSetpoint(Struct, frozen=True):
    """Setpoint of one SET_ATTITUDE_TARGET."""

    roll: float
    """rad, right wing down +."""
    pitch: float
    """rad, nose up +."""
    yaw: float
    """rad, clockwise from north."""
    yaw_rate: float
    """rad/s, clockwise +; feed-forward."""
    climb: float
    """-1 full descent .. 1 full climb."""

    @property
    def is_still(self) -> bool:
        """True when it asks for no motion; its heading does not count."""
        return all(abs(value) <= NO_MOTION for value in (self.roll, self.pitch, self.yaw_rate, self.climb))


class PositionReference(enum.Enum):
    """Origin of positions."""

    LOCAL = "the origin of the local frame"
    VEHICLE = "where the drone is"
    SEA = "the earth, heights from mean sea level"
    TAKEOFF = "the earth, heights from the take-off point"


Vector: TypeAlias = "tuple[float | None, float | None, float | None]"
"""x, y and z; None where the setpoint says nothing."""

NOTHING: Vector = (None, None, None)


class MotionSetpoint(Struct, frozen=True):
    """Setpoint of one SET_POSITION_TARGET_*."""

    origin: PositionReference
    body: bool = False
    """Axes are front, right, down of the heading; otherwise north, east, down."""
    position: Vector = NOTHING
    """m; on the earth latitude and longitude in deg, and the height in m, upwards."""
    velocity: Vector = NOTHING
    """m/s."""
    acceleration: Vector = NOTHING
    """m/s2."""
    yaw: float | None = None
    """rad, clockwise from north, with `body` from the heading."""
    yaw_rate: float | None = None
    """rad/s, clockwise +."""

    @property
    def is_still(self) -> bool:
        """True when it asks for no motion: no place, no heading, and zeros."""
        rates = (*self.velocity, *self.acceleration, self.yaw_rate)
        return self.position == NOTHING and self.yaw is None and all(abs(value or 0.0) <= NO_MOTION for value in rates)

    @property
    def moves(self) -> bool:
        """Nothing but a position, with a heading at most: a move that the drone makes by itself."""
        return (
            self.position != NOTHING
            and self.velocity == NOTHING
            and self.acceleration == NOTHING
            and self.yaw_rate is None
            and (self.position[0] is None) == (self.position[1] is None)
        )

    @property
    def needs_loop(self) -> bool:
        """True when it is flown by a loop over the horizontal velocity."""
        if self.moves:
            return False
        placed = self.position[:2] != (None, None)
        return placed or any(part for part in (*self.velocity[:2], *self.acceleration[:2]))

    @property
    def on_earth(self) -> bool:
        """Positions are latitudes and longitudes."""
        return self.origin in (PositionReference.SEA, PositionReference.TAKEOFF)


Setpoint: TypeAlias = "AttitudeSetpoint | MotionSetpoint"
