"""Motion of a simulated drone: constants, modes and poses. `airframe` moves it.

Frames: position and velocity are north, east, down in metres from the place the simulator was given as home; attitude
is roll (right wing down), pitch (nose up), yaw (clockwise from north) in rad. The ground is a plane at down = 0.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

from anafi_mav.units import RAD_PER_DEG

STEP = 1.0 / 60.0
"""s. 0.1, 0.15 and 0.2 s are whole numbers of steps, and so is the time between two pictures at 30 Hz."""

G = 9.81
FULL_TILT = 40.0 * RAD_PER_DEG
"""The largest tilt the family flies; MaxTilt cannot be set higher."""

TAKE_OFF_HEIGHT = 1.0
"""m above ground at which a take-off ends."""
FLOOR = 0.3
"""m above ground that neither sticks nor moves go below; only a landing does. Assumed."""
NO_FENCE = 1e9
"""m: the radius of a fence that is off."""


class Mode(enum.IntEnum):
    """Motion mode of one drone."""

    OFF = 0
    """Motors off or idle, on the ground."""
    STICKS = 1
    """`sticks` say where to; all zero is a hover."""
    MOVE = 2
    """To `target`, then stay there."""
    TAKE_OFF = 3
    """Up to `TAKE_OFF_HEIGHT`, sticks ignored."""
    LAND = 4
    """Down to the ground; the sticks still steer sideways."""
    FALL = 5
    """Motors cut in the air."""


class Turn(enum.IntEnum):
    """Control of the heading in a MOVE."""

    STICK = 0
    """As the yaw stick says."""
    FIRST = 1
    """To the wanted heading before the move begins."""
    DURING = 2
    """To the wanted heading on the way."""


class Pose(NamedTuple):
    """True pose of a drone: metres, m/s, rad. `up` is the height above the take-off plane."""

    north: float
    east: float
    up: float
    roll: float
    pitch: float
    yaw: float
    vn: float
    ve: float
    vd: float

    @property
    def ground_speed(self) -> float:
        return math.hypot(self.vn, self.ve)

    def bearing(self, north: float, east: float) -> tuple[float, float]:
        """(direction in rad, distance in m) of a point."""
        north, east = north - self.north, east - self.east
        return math.atan2(east, north), math.hypot(north, east)
