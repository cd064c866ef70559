"""Flight by one setpoint after the other: goal, heading and sticks of the newest. No I/O.

Positions and headings that count from the drone are resolved once: the same setpoint again means the same place.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.drone import Limits, PilotingCommand
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.velocity_loop import STILL, VelocityController, turn_towards
from anafi_mav.vehicle.offboard.goals import Goal, demand, resolve
from anafi_mav.vehicle.offboard.setpoints import NOTHING, AttitudeSetpoint, MotionSetpoint


class AskedHeading(NamedTuple):
    """A heading as it was asked for, and what it meant when it first arrived (rad from north)."""

    body: bool
    asked: float | None
    yaw: float | None


NO_HEADING = AskedHeading(False, None, None)


class Steering(Struct, frozen=True):
    """Flight by an engagement's newest setpoint; replaced as a whole by the next one's."""

    controller: VelocityController
    """Remembers the demands of this engagement."""
    goal: Goal | None = None
    """The position, resolved; None when the setpoint has none."""
    heading: AskedHeading = NO_HEADING
    sticks: PilotingCommand | None = None
    """The sticks that are held; None while the drone makes a move by itself."""
    warned_of: float = STILL
    """m/s of velocity up to which it has been said whether MaxTilt is enough."""

    def lean(self, setpoint: AttitudeSetpoint, limits: Limits, now: float) -> Steering:
        """Return the flight by an attitude."""
        motion, turn = self.controller.motion, setpoint.yaw_rate
        if motion.yaw is not None and motion.knows_heading(now):
            turn = turn_towards(setpoint.yaw, motion.yaw, turn)
        sticks = PilotingCommand(
            roll_deg=setpoint.roll * units.DEG_PER_RAD,
            pitch_deg=setpoint.pitch * units.DEG_PER_RAD,
            yaw_rate_dps=turn * units.DEG_PER_RAD,
            climb_mps=setpoint.climb * limits.climb_mps,
        )
        return replace(self, goal=None, heading=AskedHeading(False, setpoint.yaw, setpoint.yaw), sticks=sticks)

    def resolve(self, setpoint: MotionSetpoint, vehicle: Aircraft) -> Steering:
        """Return the flight to a setpoint's position and heading, without sticks.

        Both are as resolved when they first arrived. Raises `Refused`.
        """
        motion, goal, heading = self.controller.motion, self.goal, self.heading
        if setpoint.position == NOTHING:
            goal = None
        elif goal is None or not goal.is_of(setpoint):
            goal = resolve(setpoint, vehicle, motion)
        if heading[:2] != (setpoint.body, setpoint.yaw):
            yaw = setpoint.yaw
            if yaw is not None and setpoint.body:
                if motion.yaw is None:
                    raise Refused(texts.SETPOINT, texts.HEADING_UNKNOWN)
                yaw = units.wrap_pi(motion.yaw + yaw)
            heading = AskedHeading(setpoint.body, setpoint.yaw, yaw)
        return replace(self, goal=goal, heading=heading, sticks=None)

    def close_loop(self, setpoint: MotionSetpoint, limits: Limits, now: float, *, located: bool) -> Steering:
        """Return the flight by the sticks of the velocity loop.

        `located`: GPS locates the drone. Raises `Refused` when the loop lacks a value.
        """
        wanted = demand(setpoint, self.goal, self.heading.yaw, located=located)
        sticks = self.controller.sticks(wanted, limits, now)
        if sticks is None:
            raise Refused(texts.SETPOINT, texts.MOTION_UNKNOWN)
        return replace(self, sticks=sticks)

    @property
    def is_short_of_tilt(self) -> bool:
        """True when MaxTilt has been costing speed for a while."""
        return self.controller.short_of is not None and self.controller.motion.trusts_tilt
