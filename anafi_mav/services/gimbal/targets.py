"""Reads angles and rates of the gimbal from messages: units, frames, signs. No I/O.

MAVLink and Parrot have the same signs: pitch + up, yaw + to the right, roll + to the right. Parrot's axes point
forward, right and down, those of the absolute frame north, east and down (gimbal.xml, frame_of_reference). Rates and
angles of messages are rad and rad/s, those of commands deg and deg/s.

| flag of GIMBAL_MANAGER_FLAGS | frame that the drone holds the axis in |
|---|---|
| PITCH_LOCK, ROLL_LOCK | the horizon; without it the body |
| YAW_LOCK | north; without it the nose |
| YAW_IN_EARTH_FRAME, YAW_IN_VEHICLE_FRAME | that of the number alone; without either YAW_LOCK decides |
| NEUTRAL | the drone's reference orientation, before every angle and rate |
| RETRACT | an ANAFI has none: refused |

ArduPilot's clients set no lock, and its mounts keep pitch and roll to the horizon: so does this in their flavour.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from anafi_mav import texts, units
from anafi_mav.drone import Aim
from anafi_mav.drone.events import Axis, FrameOfReference
from anafi_mav.mavlink import dialect
from anafi_mav.texts import OperatorText

ABSOLUTE, RELATIVE = FrameOfReference.ABSOLUTE, FrameOfReference.RELATIVE

WIDEST = 360.0
"""deg. A larger angle is a number in another unit; one beyond the range of the gimbal is clipped by the drone."""

FASTEST = 1000.0
"""deg/s likewise; one beyond the speed setting is clipped."""

UNIT_TOLERANCE = 0.1
"""How far a quaternion's length may be from 1: single precision and sloppy sums, not garbage."""

UPRIGHT = math.cos(math.radians(0.1))
"""Sine of a pitch that counts as straight up or down: nearer to it the single precision of a message decides how a
rotation is divided into roll and yaw."""

DEVICES = (0, 1, 154)
"""Gimbal device ids that mean the gimbal: all, its own, and the component that gimbals usually are."""


@dataclass(frozen=True)
class GimbalTarget:
    """Angles (deg) and rates (deg/s) of the axes that a client names. An axis is in one of them."""

    angles: Mapping[Axis, Aim] = field(default_factory=dict)
    rates: Mapping[Axis, Aim] = field(default_factory=dict)
    neutral: bool = False
    """The reference orientation, instead of both."""

    def on(self, axes: frozenset[Axis]) -> GimbalTarget:
        """Return the target without the axes that a gimbal does not have."""
        return GimbalTarget(
            {axis: aim for axis, aim in self.angles.items() if axis in axes},
            {axis: aim for axis, aim in self.rates.items() if axis in axes},
            self.neutral,
        )

    @property
    def is_empty(self) -> bool:
        """True when nothing is commanded."""
        return not (self.angles or self.rates or self.neutral)

    @property
    def held(self) -> frozenset[Axis]:
        """Axes with a zero rate beside the angles of others."""
        return frozenset(axis for axis, aim in self.rates.items() if aim.value == 0.0) if self.angles else frozenset()

    @property
    def is_zero_rate(self) -> bool:
        """True when nothing but zero rates is commanded."""
        return bool(self.rates) and not self.angles and all(aim.value == 0.0 for aim in self.rates.values())


@dataclass(frozen=True)
class Frames:
    """Reading of GIMBAL_MANAGER_FLAGS."""

    flags: int
    locks_horizon: bool
    """Pitch and roll are kept to the horizon whatever the flags are."""
    heading: float | None
    """deg of the nose from north; None while unknown."""

    def hold(self, axis: Axis) -> FrameOfReference:
        """Return the frame that an axis is held in."""
        lock = {
            Axis.ROLL: dialect.GIMBAL_MANAGER_FLAGS_ROLL_LOCK,
            Axis.PITCH: dialect.GIMBAL_MANAGER_FLAGS_PITCH_LOCK,
            Axis.YAW: dialect.GIMBAL_MANAGER_FLAGS_YAW_LOCK,
        }[axis]
        locked = bool(self.flags & lock) or (self.locks_horizon and axis is not Axis.YAW)
        return ABSOLUTE if locked else RELATIVE

    def aim(self, axis: Axis, angle: float) -> Aim | None:
        """Return the target of one axis; None when it needs the heading, and that is unknown."""
        held = self.hold(axis)
        if axis is not Axis.YAW:
            return Aim(angle, held)
        given = held
        if self.flags & dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME:
            given = ABSOLUTE
        elif self.flags & dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME:
            given = RELATIVE
        if given is not held:
            if self.heading is None:
                return None
            angle += self.heading if held is ABSOLUTE else -self.heading
        return Aim(wrap_180(angle), held)


def wrap_180(angle: float) -> float:
    """Return the same angle (deg) in (-180, 180]."""
    return 180.0 - (180.0 - angle) % 360.0


def read(
    frames: Frames,
    angles: Mapping[Axis, float],
    rates: Mapping[Axis, float],
) -> GimbalTarget | OperatorText:
    """Return the target of angles (deg), rates (deg/s) and flags, or a reason to refuse it.

    NaN is "not set". An axis with an angle turns to it with the drone's own speed, whatever its rate is.
    """
    flags = frames.flags
    if flags & dialect.GIMBAL_MANAGER_FLAGS_RETRACT:
        return texts.NO_RETRACT
    if flags & dialect.GIMBAL_MANAGER_FLAGS_NEUTRAL:
        return GimbalTarget(neutral=True)
    both = dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME | dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME
    if flags & both == both:
        return texts.TWO_YAW_FRAMES
    angles = {axis: angle for axis, angle in angles.items() if not math.isnan(angle)}
    rates = {axis: rate for axis, rate in rates.items() if not math.isnan(rate) and axis not in angles}
    if not angles and not rates:
        return texts.NOTHING_ASKED
    if any(abs(angle) > WIDEST for angle in angles.values()):
        return texts.GIMBAL_ANGLE
    if any(abs(rate) > FASTEST for rate in rates.values()):
        return texts.GIMBAL_RATE
    aims = {}
    for axis, angle in angles.items():
        aim = frames.aim(axis, angle)
        if aim is None:
            return texts.HEADING_UNKNOWN
        aims[axis] = aim
    return GimbalTarget(aims, {axis: Aim(rate, frames.hold(axis)) for axis, rate in rates.items()})


def of_quaternion(q: Sequence[float]) -> Mapping[Axis, float] | None:
    """Return the angles (deg) of a quaternion (w, x, y, z); None for no rotation.

    Empty when it is not set. Of the two sets of angles that every rotation has, it is the one without a roll beyond
    90 deg, which no gimbal has. So the Ai looks up and back with a pitch of 150 deg. Straight up and down, where roll
    and yaw turn about one axis, roll is 0.
    """
    if all(math.isnan(value) for value in q):
        return {}
    length = math.hypot(*q)
    if not abs(length - 1.0) <= UNIT_TOLERANCE:  # also if one of them is not a number
        return None
    w, x, y, z = (value / length for value in q)
    sine = 2.0 * (w * y - z * x)
    if abs(sine) >= UPRIGHT:
        yaw = math.copysign(2.0, -sine) * math.atan2(x, w) * units.DEG_PER_RAD
        return {Axis.ROLL: 0.0, Axis.PITCH: math.copysign(90.0, sine), Axis.YAW: wrap_180(yaw)}
    roll, pitch, yaw = (angle * units.DEG_PER_RAD for angle in units.euler_from_quaternion(w, x, y, z))
    if abs(roll) > 90.0:
        roll, pitch, yaw = roll + 180.0, 180.0 - pitch, yaw + 180.0
    return {Axis.ROLL: wrap_180(roll), Axis.PITCH: wrap_180(pitch), Axis.YAW: wrap_180(yaw)}


def from_attitude(
    message: dialect.MAVLink_gimbal_manager_set_attitude_message, frames: Frames
) -> GimbalTarget | OperatorText:
    """Return the target of a GIMBAL_MANAGER_SET_ATTITUDE, or a reason to refuse it."""
    angles = of_quaternion(message.q)
    if angles is None:
        return texts.ATTITUDE_LENGTH
    rates = {
        Axis.ROLL: message.angular_velocity_x * units.DEG_PER_RAD,
        Axis.PITCH: message.angular_velocity_y * units.DEG_PER_RAD,
        Axis.YAW: message.angular_velocity_z * units.DEG_PER_RAD,
    }
    return read(frames, angles, rates)


def from_pitch_yaw(
    message: dialect.MAVLink_gimbal_manager_set_pitchyaw_message, frames: Frames
) -> GimbalTarget | OperatorText:
    """Return the target of a GIMBAL_MANAGER_SET_PITCHYAW, or a reason to refuse it."""
    angles = {Axis.PITCH: message.pitch * units.DEG_PER_RAD, Axis.YAW: message.yaw * units.DEG_PER_RAD}
    rates = {Axis.PITCH: message.pitch_rate * units.DEG_PER_RAD, Axis.YAW: message.yaw_rate * units.DEG_PER_RAD}
    return read(frames, angles, rates)


def from_manual(
    message: dialect.MAVLink_gimbal_manager_set_manual_control_message,
    frames: Frames,
    ranges: Mapping[Axis, tuple[float, float]],
    speeds: Mapping[Axis, float],
) -> GimbalTarget | OperatorText:
    """Return the target of a GIMBAL_MANAGER_SET_MANUAL_CONTROL, or a reason to refuse it.

    Its values are shares, -1..1: of the ranges (deg) on either side of 0, and of the speeds (deg/s) that are set. The
    range of yaw is that from the nose, whichever frame the axis is held in.
    """
    if not frames.flags & dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME:
        frames = replace(frames, flags=frames.flags | dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME)
    shares = (message.pitch, message.yaw, message.pitch_rate, message.yaw_rate)
    if any(abs(share) > 1.0 for share in shares):
        return texts.GIMBAL_SHARE
    angles = {}
    for axis, share in ((Axis.PITCH, message.pitch), (Axis.YAW, message.yaw)):
        low, high = ranges.get(axis, (0.0, 0.0))
        angles[axis] = share * (high if share > 0.0 else -low)
    rates = {
        axis: share * speeds.get(axis, 0.0)
        for axis, share in ((Axis.PITCH, message.pitch_rate), (Axis.YAW, message.yaw_rate))
    }
    return read(frames, angles, rates)


def is_device(id: float) -> bool:
    """Return True for a gimbal device id that means the gimbal; NaN is "not set"."""
    return math.isnan(id) or id in DEVICES
