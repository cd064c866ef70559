"""Piloted point of interest: the nose faces a point while the pilot flies the drone.

If requested the camera follows the point too. Rules of ardrone3.xml StartPilotedPOIV2: it runs at once from a hover,
else it waits for one and is aborted after a while; the yaw stick does nothing meanwhile; without GPS, magnetometer or
flight it is unavailable and ignored. That any other guided motion, a landing or a return ends it is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, poi
from anafi_mav.arsdk.messages.ardrone3 import PoiMode, PoiStatus
from anafi_mav.arsdk.messages.poi import Indicator
from anafi_mav.sim.world.motion import Pose
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.units import DEG_PER_RAD, RAD_PER_DEG, clip, wrap_pi

PENDING_LIMIT = 10.0
"""s that a start waits for the hover. Assumed."""

UNKNOWN = 500.0

GAIN = 2.5
"""1/s from an error of heading to a yaw rate."""

ALIGNED = 2.0 * RAD_PER_DEG
"""The nose is on the point when this close."""

_TOO_NEAR = 0.5
"""m: a point right below or above has no bearing."""


class Look(NamedTuple):
    """Direction and distance of a point: rad, rad/s, rad above the horizon, m over ground."""

    bearing: float
    bearing_rate: float
    elevation: float
    distance: float

    def yaw_rate(self, yaw: float, fastest: float) -> float:
        """rad/s clockwise that brings the nose there and keeps it there, from this heading (rad)."""
        if self.distance < _TOO_NEAR:
            return 0.0
        return clip(GAIN * wrap_pi(self.bearing - yaw) + self.bearing_rate, -fastest, fastest)


def look(pose: Pose, north: float, east: float, up: float) -> Look:
    """How a point (m) is seen from a drone that moves."""
    bearing, distance = pose.bearing(north, east)
    away_north, away_east = north - pose.north, east - pose.east
    rate = (away_east * pose.vn - away_north * pose.ve) / max(distance, _TOO_NEAR) ** 2
    return Look(bearing, rate, math.atan2(up - pose.up, distance), distance)


class Poi:
    """The point, if there is one. `aim` points the camera (deg above the horizon)."""

    def __init__(
        self,
        origin: WorldOrigin,
        emit: Callable[[Message], None],
        aim: Callable[[float], None],
        fastest: Callable[[], float],
        modern: bool,
    ) -> None:
        """Create it; `fastest` returns the greatest yaw rate allowed (rad/s).

        `modern` drones report the unmet conditions.
        """
        self._origin = origin
        self._emit = emit
        self._aim = aim
        self._fastest = fastest
        self._modern = modern
        self.status = PoiStatus.UNAVAILABLE
        self._place = (UNKNOWN, UNKNOWN, UNKNOWN)
        self._mode = PoiMode.LOCKED_GIMBAL
        self._point = (0.0, 0.0, 0.0)
        self._until = 0.0
        self._legacy = False
        self._missing = _bits(Indicator.DRONE_FLYING)

    @property
    def running(self) -> bool:
        return self.status is PoiStatus.RUNNING

    @property
    def point(self) -> tuple[float, float, float]:
        """Position of the point: m from the simulator's origin."""
        return self._point

    @property
    def holds_gimbal(self) -> bool:
        """Commands to the gimbal do not count."""
        return self.running and self._mode is PoiMode.LOCKED_GIMBAL

    def start(
        self, message: ardrone3.StartPilotedPOI | ardrone3.StartPilotedPOIV2, hovering: bool, time: float
    ) -> bool:
        """Begin, or wait for the hover; False when it is ignored."""
        place = (message.latitude, message.longitude, message.altitude)
        if self.status is PoiStatus.UNAVAILABLE or not _possible(*place):
            return False
        self._legacy = isinstance(message, ardrone3.StartPilotedPOI)
        mode = message.mode if isinstance(message, ardrone3.StartPilotedPOIV2) else PoiMode.LOCKED_GIMBAL
        if mode not in tuple(PoiMode):
            return False
        self._place, self._mode = place, mode
        self._point = (*self._origin.offset(message.latitude, message.longitude), message.altitude)
        self._until = time + PENDING_LIMIT
        self._set(PoiStatus.PENDING)
        if hovering:
            self._set(PoiStatus.RUNNING)
        return True

    def stop(self) -> None:
        """StopPilotedPOI, or something that takes over; without a point nothing is said."""
        if self.status in (PoiStatus.RUNNING, PoiStatus.PENDING):
            self._set(PoiStatus.AVAILABLE)

    def sensors(self, fix: bool, magneto: bool, guided: bool) -> None:
        """Update the conditions that the point of interest needs.

        They are a fix, a calibrated magnetometer, and a drone in the air that takes commands.
        """
        needs = {
            Indicator.DRONE_GPS: fix,
            Indicator.DRONE_MAGNETO: magneto,
            Indicator.DRONE_FLYING: guided,
        }
        missing = _bits(*(need for need, met in needs.items() if not met))
        if missing != self._missing:
            self._missing = missing
            if self._modern:
                self._emit(poi.Info(missing))
        if missing:
            if self.status is not PoiStatus.UNAVAILABLE:
                self._set(PoiStatus.UNAVAILABLE)
        elif self.status is PoiStatus.UNAVAILABLE:
            self._set(PoiStatus.AVAILABLE)

    def tick(self, time: float, pose: Pose, hovering: bool) -> float | None:
        """Return the yaw rate (rad/s) that faces the point, or None when none is active."""
        if self.status is PoiStatus.PENDING:
            if hovering:
                self._set(PoiStatus.RUNNING)
            elif time >= self._until:
                self._set(PoiStatus.AVAILABLE)
        if not self.running:
            return None
        seen = look(pose, *self._point)
        if self._mode is not PoiMode.FREE_GIMBAL:
            self._aim(seen.elevation * DEG_PER_RAD)
        there = abs(wrap_pi(seen.bearing - pose.yaw)) < ALIGNED
        if there and self._mode is PoiMode.LOCKED_ONCE_GIMBAL:
            self._mode = PoiMode.FREE_GIMBAL
        elif there and self._mode is PoiMode.LOCKED_ONCE_GIMBAL_AND_EXIT:
            self.stop()
            return 0.0
        return seen.yaw_rate(pose.yaw, self._fastest())

    def _set(self, status: PoiStatus) -> None:
        self.status = status
        if status not in (PoiStatus.PENDING, PoiStatus.RUNNING):
            self._place = (UNKNOWN, UNKNOWN, UNKNOWN)
        self._emit(ardrone3.PilotedPOIV2(*self._place, self._mode, status))
        if self._legacy:
            self._emit(ardrone3.PilotedPOI(*self._place, status))

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        report: list[Message] = [ardrone3.PilotedPOIV2(*self._place, self._mode, self.status)]
        return [*report, poi.Info(self._missing)] if self._modern else report


def _bits(*indicators: Indicator) -> int:
    return sum(1 << indicator for indicator in indicators)


def _possible(latitude: float, longitude: float, altitude: float) -> bool:
    return abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(altitude)
