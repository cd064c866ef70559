"""Heading of a move to a place.

PX4's MPC_YAW_MODE and ArduPilot's WP_YAW_BEHAVIOR. No I/O.
"""

from __future__ import annotations

import enum
import math

from anafi_mav import geo, units
from anafi_mav.drone.events import OrientationMode
from anafi_mav.vehicle.base.geo_point import GeoPoint

NO_TURN = 2.0
"""m from the target below which the drone does not turn to it: the error of the GPS location decides the bearing
there."""


class MoveHeading(enum.IntEnum):
    """Heading of a move whose command names none. The numbers are those of ANF_YAW_MODE."""

    KEEP = 0
    """The heading does not change."""
    TO_TARGET = 1
    """Turn to the target on the way."""
    TO_TARGET_FIRST = 2
    """Turn to the target, then move. A heading that the command names is also turned to first."""


def oriented(
    rule: MoveHeading, here: GeoPoint | None, target: GeoPoint, yaw: float | None
) -> tuple[OrientationMode, float | None]:
    """Return the orientation of a moveTo, and its heading (deg from north) where it has one.

    `yaw` (rad) is the heading that the command names; None: it names none. `here` None: the place is unknown.
    """
    if yaw is not None:
        heading = units.wrap_360(yaw * units.DEG_PER_RAD)
        is_first = rule is MoveHeading.TO_TARGET_FIRST
        return OrientationMode.HEADING_START if is_first else OrientationMode.HEADING_DURING, heading
    if rule is MoveHeading.KEEP or here is None:
        return OrientationMode.NONE, None
    north, east = geo.offset(here.latitude, here.longitude, target.latitude, target.longitude)
    if math.hypot(north, east) < NO_TURN:
        return OrientationMode.NONE, None
    if rule is MoveHeading.TO_TARGET_FIRST:
        return OrientationMode.TO_TARGET, None
    return OrientationMode.HEADING_DURING, units.wrap_360(math.atan2(east, north) * units.DEG_PER_RAD)
