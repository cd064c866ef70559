"""Execution of a flight plan's PANORAMA_CREATE (2800).

The drone turns, the camera tilts, pictures are taken. The item gives angles and speeds; that a picture is taken every
thirty degrees is assumed.
"""

from __future__ import annotations

import math

from anafi_mav.sim.payload.camera_operator import CameraOperator
from anafi_mav.sim.plan.plan_file import PlanLine
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.motion import Pose
from anafi_mav.units import RAD_PER_DEG, clip

SPEED = 30.0
"""deg/s of an item that names none. Assumed."""

STEP = 30.0
"""deg between two pictures. Assumed."""

_MOST_TURN, _MOST_TILT = 3600.0, 180.0
"""deg; ten turns."""


class Panorama:
    """One item."""

    def __init__(
        self, item: PlanLine, body: Airframe, operator: CameraOperator, pose: Pose, time: float, speed: float
    ) -> None:
        """Begin the panorama; `speed` (m/s) is available to hold the position against wind."""
        turn = clip(item.p1, -_MOST_TURN, _MOST_TURN) if math.isfinite(item.p1) else 0.0
        self._tilt = clip(item.p2, -_MOST_TILT, _MOST_TILT) if math.isfinite(item.p2) else 0.0
        self._tilt_speed = item.p4 if item.p4 > 0.0 else SPEED
        self._turn = turn * RAD_PER_DEG
        self._body = body
        self._operator = operator
        self._began = time
        self._heading, self._first_tilt = body.heading, operator.tilt
        self._count = math.ceil(max(abs(turn), abs(self._tilt)) / STEP) + 1
        self._taken = 0
        operator.panorama_begin("", self._count)
        body.move(
            pose.north,
            pose.east,
            pose.up,
            yaw=body.heading + self._turn,
            speed=speed,
            climb=1.0,
            yaw_rate=(item.p3 if item.p3 > 0.0 else SPEED) * RAD_PER_DEG,
        )

    def tick(self, time: float, arrived: bool) -> bool:
        """Tilt the camera and take the pictures that are due; True when all of them are taken."""
        tilted = min(self._tilt_speed * (time - self._began), abs(self._tilt))
        self._operator.aim(self._first_tilt + math.copysign(tilted, self._tilt))
        if self._turn:
            share = (self._body.heading - self._heading) / self._turn
        else:
            share = tilted / abs(self._tilt) if self._tilt else 1.0
        done = arrived and time > self._began and tilted >= abs(self._tilt)  # not by what was flown before
        while self._taken < self._count and (done or share >= self._taken / max(self._count - 1, 1) - 0.003):
            self._taken += 1
            self._operator.panorama_shot()
        return done

    def end(self) -> None:
        """It is over, or something else takes over."""
        self._operator.panorama_end()
