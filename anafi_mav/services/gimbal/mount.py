"""Modes, angles and places of the mount protocol, replaced by gimbal v2. No I/O."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from typing import TypeAlias

from anafi_mav import geo
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import ActionGroup, Command
from anafi_mav.services.gimbal.targets import Frames
from anafi_mav.vehicle.base.geo_point import GeoPoint

Handler: TypeAlias = Callable[[Command], Awaitable[None]]

MODES = (
    dialect.MAV_MOUNT_MODE_NEUTRAL,
    dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING,
    dialect.MAV_MOUNT_MODE_GPS_POINT,
    dialect.MAV_MOUNT_MODE_SYSID_TARGET,
    dialect.MAV_MOUNT_MODE_HOME_LOCATION,
)
"""MAV_MOUNT_MODE that an ANAFI has; it neither retracts its gimbal nor turns it by a radio's channels."""

MESSAGE_MODES = (
    dialect.MAV_MOUNT_MODE_NEUTRAL,
    dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING,
    dialect.MAV_MOUNT_MODE_GPS_POINT,
)
"""Those of them that MOUNT_CONFIGURE and MOUNT_CONTROL have; dronekit sends the last two."""

HORIZON = Frames(0, locks_horizon=True, heading=None)
"""A mount keeps pitch and roll to the horizon, and yaw to the nose."""

DEGREES = 180.0
"""A larger coordinate of DO_MOUNT_CONTROL is in degE7: common.xml says so, and some clients send deg."""


_PLACES = (
    dialect.MAV_MOUNT_MODE_GPS_POINT,
    dialect.MAV_MOUNT_MODE_SYSID_TARGET,
    dialect.MAV_MOUNT_MODE_HOME_LOCATION,
)
"""Modes that turn the drone to a place, as a region of interest does."""


def group_of_control(command: Command) -> ActionGroup:
    """Return the group of a DO_MOUNT_CONTROL.

    A place turns the drone, angles turn the gimbal alone.
    """
    return ActionGroup.FLIGHT if command.z in _PLACES else ActionGroup.GIMBAL


def group_of_configure(command: Command) -> ActionGroup:
    """Return the group of a DO_MOUNT_CONFIGURE.

    Of its modes, that of home alone turns the drone at once.
    """
    home = command.params[0] == dialect.MAV_MOUNT_MODE_HOME_LOCATION
    return ActionGroup.FLIGHT if home else ActionGroup.GIMBAL


def point(latitude: float, longitude: float) -> GeoPoint | None:
    """Return the place of a DO_MOUNT_CONTROL; None when it has none."""
    if not math.isfinite(latitude) or not math.isfinite(longitude):
        return None
    scale = 1e7 if max(abs(latitude), abs(longitude)) > DEGREES else 1.0
    return GeoPoint(latitude / scale, longitude / scale)


def direction(here: GeoPoint, there: GeoPoint, climb: float) -> tuple[float, float]:
    """Return bearing from north and elevation (rad) of a straight path that climbs so far (m)."""
    north, east = geo.offset(*here, *there)
    return math.atan2(east, north), math.atan2(climb, math.hypot(north, east))
