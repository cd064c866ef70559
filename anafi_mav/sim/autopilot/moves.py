"""Running moveBy and moveTo: the request, its target, and the event that ends it.

Distances of a moveBy are in the body frame at its start: front, right, down, clockwise (ardrone3.xml moveBy,
move.xml extended_move_by). A command with a speed of zero along an axis in which it moves, or with a value that is
not a finite number, is in error and never starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from anafi_mav.arsdk.messages import ardrone3, move
from anafi_mav.arsdk.messages.ardrone3 import MoveByError, MoveToStatus, OrientationMode
from anafi_mav.sim.features.settings import DroneSettings
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.model import AirframeModel
from anafi_mav.sim.world.motion import FLOOR, Pose, Turn
from anafi_mav.units import RAD_PER_DEG

CRUISE = 5.0
"""m/s of a moveBy or moveTo that names no speed, and of nothing else. Assumed."""

_NO_TURN = 0.5
"""m: closer than this a target has no direction to face."""


@dataclass(frozen=True)
class Speeds:
    """m/s, m/s, rad/s; 0 is no motion along that axis."""

    horizontal: float
    vertical: float
    yaw: float

    @property
    def usable(self) -> bool:
        values = (self.horizontal, self.vertical, self.yaw)
        return all(math.isfinite(value) and value >= 0.0 for value in values) and any(values)


def own_speeds(settings: DroneSettings) -> Speeds:
    """Return the speeds of a command that contains no speeds."""
    return Speeds(CRUISE, settings.number("max_vertical_speed"), settings.number("max_rotation_speed") * RAD_PER_DEG)


def asked_speeds(
    command: move.ExtendedMoveBy | move.ExtendedMoveTo, airframe: AirframeModel, settings: DroneSettings
) -> Speeds:
    """The speeds of a command, within what the aircraft can do."""
    _, _, climb = settings.limits("max_vertical_speed")
    _, _, turn = settings.limits("max_rotation_speed")
    return Speeds(
        min(command.max_horizontal_speed, airframe.max_speed),
        min(command.max_vertical_speed, climb),
        min(command.max_yaw_rotation_speed, turn) * RAD_PER_DEG,
    )


class MoveBy:
    """A relative move."""

    def __init__(self, forward: float, right: float, down: float, turn: float, speeds: Speeds) -> None:
        self._wanted = (forward, right, down, turn)
        self._speeds = speeds
        self._start: Pose | None = None
        self._start_heading = 0.0

    @property
    def cancels(self) -> bool:
        """A move by nothing only ends the one before it."""
        return not any(self._wanted)

    @property
    def possible(self) -> bool:
        forward, right, down, turn = self._wanted
        speeds = self._speeds
        if not speeds.usable or not all(map(math.isfinite, self._wanted)):
            return False
        wants = (math.hypot(forward, right), abs(down), abs(turn))
        return all(
            speed > 0.0 or want == 0.0
            for want, speed in zip(wants, (speeds.horizontal, speeds.vertical, speeds.yaw), strict=True)
        )

    def begin(self, body: Airframe, pose: Pose) -> None:
        forward, right, down, turn = self._wanted
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        self._start, self._start_heading = pose, body.heading
        body.move(
            pose.north + forward * cos - right * sin,
            pose.east + forward * sin + right * cos,
            max(pose.up - down, FLOOR),
            yaw=body.heading + turn,
            speed=self._speeds.horizontal,
            climb=self._speeds.vertical,
            yaw_rate=self._speeds.yaw,
        )

    def end(self, error: MoveByError, body: Airframe, pose: Pose) -> ardrone3.MoveByEnd:
        """The event that reports what was flown."""
        start = self._start
        if start is None:
            return ardrone3.MoveByEnd(0.0, 0.0, 0.0, 0.0, error)
        north, east = pose.north - start.north, pose.east - start.east
        cos, sin = math.cos(start.yaw), math.sin(start.yaw)
        return ardrone3.MoveByEnd(
            north * cos + east * sin,
            east * cos - north * sin,
            start.up - pose.up,
            body.heading - self._start_heading,
            error,
        )


class MoveTo:
    """A move to a place on earth. Its events repeat the command's own numbers."""

    def __init__(
        self,
        command: ardrone3.MoveTo | move.ExtendedMoveTo,
        speeds: Speeds,
    ) -> None:
        self._command = command
        self._speeds = speeds
        self.mode = OrientationMode(int(command.orientation_mode))

    @property
    def place(self) -> tuple[float, float, float]:
        """deg, deg, m above take-off"""
        return self._command.latitude, self._command.longitude, self._command.altitude

    @property
    def takes_yaw(self) -> bool:
        """The yaw stick still counts."""
        return self.mode is OrientationMode.NONE

    @property
    def possible(self) -> bool:
        latitude, longitude, altitude = self.place
        command = self._command
        return (
            self._speeds.usable
            and self._speeds.horizontal > 0.0
            and abs(latitude) <= 90.0
            and abs(longitude) <= 180.0
            and math.isfinite(altitude)
            and self.mode in tuple(OrientationMode)
            and (self.mode < OrientationMode.HEADING_START or math.isfinite(command.heading))
        )

    def begin(self, body: Airframe, pose: Pose, north: float, east: float) -> None:
        """Start towards the place, which lies at (north, east) in the simulator's plane."""
        command = self._command
        yaw, turn = body.heading, Turn.DURING
        match self.mode:
            case OrientationMode.NONE:
                turn = Turn.STICK
            case OrientationMode.TO_TARGET:
                turn = Turn.FIRST
                direction, distance = pose.bearing(north, east)
                if distance > _NO_TURN:
                    yaw = body.nearest(direction)
            case OrientationMode.HEADING_START:
                yaw, turn = body.nearest(command.heading * RAD_PER_DEG), Turn.FIRST
            case _:
                yaw = body.nearest(command.heading * RAD_PER_DEG)
        body.move(
            north,
            east,
            max(command.altitude, FLOOR),
            yaw=yaw,
            turn=turn,
            speed=self._speeds.horizontal,
            climb=self._speeds.vertical,
            yaw_rate=self._speeds.yaw,
        )

    def changed(self, status: MoveToStatus) -> ardrone3.MoveToChanged:
        latitude, longitude, altitude = self.place
        return ardrone3.MoveToChanged(latitude, longitude, altitude, self.mode, self._command.heading, status)
