"""Reads setpoints from messages: units, frames, limits. No I/O.

SET_ATTITUDE_TARGET and the two SET_POSITION_TARGET messages are read.

SET_ATTITUDE_TARGET becomes the stick vector u = [vz, roll, pitch, yaw rate] of the anafi_ros paper, the only thing
ARSDK has:

- roll and pitch of the quaternion: tilt, limited by the drone's own MaxTilt;
- yaw of the quaternion: held by a proportional loop on the yaw rate; a body yaw rate that is not ignored is added
  as feed-forward;
- thrust: 0.5 holds height, 0 and 1 are full descent and climb, in between linear; ignored or NaN is 0.5.

SET_POSITION_TARGET_LOCAL_NED and _GLOBAL_INT become a `MotionSetpoint`; every axis may name a position, a velocity and
an acceleration, or nothing, which holds it still. What counts from where (MAVLink MAV_FRAME):

| frame | axes | positions count from | yaw |
|---|---|---|---|
| 1 LOCAL_NED | north, east, down | where the drone took off | from north |
| 7 LOCAL_OFFSET_NED | north, east, down | where the drone is | from north |
| 8 BODY_NED, 9 BODY_OFFSET_NED, 12 BODY_FRD | front, right, down | where the drone is | from the heading |
| 0 GLOBAL, 5 GLOBAL_INT | north, east, down | the earth; height above mean sea level | from north |
| 3 GLOBAL_RELATIVE_ALT, 6 with INT | north, east, down | the earth; height above take-off | from north |

Frames 5 and 6 are deprecated synonyms of 0 and 3 (common.xml SET_POSITION_TARGET_GLOBAL_INT): degE7 in all of them.

Front and right are those of the heading, whatever the tilt.

DEVIATION: MAV_FRAME lets positions in frame 8 count from the local origin. They count from the drone here, as in the
other frames of its body: of the two misunderstandings that is the one that moves the drone a little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from anafi_mav import texts, units
from anafi_mav.mavlink import dialect
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.offboard.setpoints import NOTHING, AttitudeSetpoint, MotionSetpoint, PositionReference, Vector

UNIT_TOLERANCE = 0.1
"""How far a quaternion's length may be from 1: single precision and sloppy sums, not garbage."""

THRUST_TOLERANCE = 1e-3
"""How far thrust may be outside of 0..1: rounding, not another unit."""

MOST_SPEED = 20.0
"""m/s beyond which a velocity is a mistake (cm/s, most likely): the fastest of the family flies 16 m/s."""

MOST_ACCELERATION = 20.0
"""m/s2 likewise: full tilt gives 8.2 m/s2."""

MOST_TURN = 10.0
"""rad/s likewise: an ANAFI turns with 3.5 rad/s at most."""

FARTHEST = 1e6
"""m beyond which a coordinate is a mistake."""


def attitude_setpoint(message: dialect.MAVLink_set_attitude_target_message) -> AttitudeSetpoint | OperatorText:
    """The setpoint in a message, or one sentence on why it cannot be flown."""
    mask = message.type_mask
    if mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE:
        return texts.ATTITUDE_RATES
    try:
        roll, pitch, yaw = units.euler_from_quaternion(*message.q)
    except ValueError:
        return texts.ATTITUDE_NO_ROTATION
    if not abs(math.hypot(*message.q) - 1.0) <= UNIT_TOLERANCE:
        return texts.ATTITUDE_LENGTH
    if abs(roll) > math.pi / 2:
        return texts.ATTITUDE_UPSIDE_DOWN
    yaw_rate = 0.0
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE and math.isfinite(message.body_yaw_rate):
        yaw_rate = message.body_yaw_rate
    thrust = 0.5
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE and math.isfinite(message.thrust):
        if not -THRUST_TOLERANCE <= message.thrust <= 1.0 + THRUST_TOLERANCE:
            return texts.THRUST_RANGE
        thrust = units.clip(message.thrust, 0.0, 1.0)
    return AttitudeSetpoint(roll, pitch, yaw, yaw_rate, 2.0 * thrust - 1.0)


_LOCAL_FRAMES: dict[int, tuple[PositionReference, bool]] = {
    dialect.MAV_FRAME_LOCAL_NED: (PositionReference.LOCAL, False),
    dialect.MAV_FRAME_LOCAL_OFFSET_NED: (PositionReference.VEHICLE, False),
    dialect.MAV_FRAME_BODY_NED: (PositionReference.VEHICLE, True),
    dialect.MAV_FRAME_BODY_OFFSET_NED: (PositionReference.VEHICLE, True),
    dialect.MAV_FRAME_BODY_FRD: (PositionReference.VEHICLE, True),
}


_GLOBAL_FRAMES: dict[int, PositionReference] = {
    dialect.MAV_FRAME_GLOBAL: PositionReference.SEA,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT: PositionReference.TAKEOFF,
    dialect.MAV_FRAME_GLOBAL_INT: PositionReference.SEA,
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: PositionReference.TAKEOFF,
}


_TERRAIN_FRAMES = (dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT, dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)


def local_setpoint(message: dialect.MAVLink_set_position_target_local_ned_message) -> MotionSetpoint | OperatorText:
    """Return the setpoint of a SET_POSITION_TARGET_LOCAL_NED.

    Returns one sentence on the reason if it cannot be flown.
    """
    frame = _LOCAL_FRAMES.get(message.coordinate_frame)
    if frame is None:
        return _no_frame(message.coordinate_frame)
    return _motion(message, *frame, (message.x, message.y, message.z))


def global_setpoint(message: dialect.MAVLink_set_position_target_global_int_message) -> MotionSetpoint | OperatorText:
    """Return the setpoint of a SET_POSITION_TARGET_GLOBAL_INT.

    Returns one sentence on the reason if it cannot be flown.
    """
    origin = _GLOBAL_FRAMES.get(message.coordinate_frame)
    if origin is None:
        return _no_frame(message.coordinate_frame)
    place = (message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
    setpoint = _motion(message, origin, False, place)
    if isinstance(setpoint, MotionSetpoint) and (setpoint.position[0] is None) != (setpoint.position[1] is None):
        return texts.HALF_PLACE
    return setpoint


def _no_frame(frame: int) -> OperatorText:
    if frame in _TERRAIN_FRAMES:
        return texts.TERRAIN_UNSUPPORTED.fill(frame=frame)
    return texts.FRAME_UNSUPPORTED.fill(frame=frame)


def _motion(
    message: dialect.MAVLink_set_position_target_local_ned_message
    | dialect.MAVLink_set_position_target_global_int_message,
    origin: PositionReference,
    body: bool,
    coordinates: tuple[float, float, float],
) -> MotionSetpoint | OperatorText:
    mask = message.type_mask
    position = _wanted(coordinates, mask, dialect.POSITION_TARGET_TYPEMASK_X_IGNORE)
    velocity = _wanted((message.vx, message.vy, message.vz), mask, dialect.POSITION_TARGET_TYPEMASK_VX_IGNORE)
    acceleration = _wanted((message.afx, message.afy, message.afz), mask, dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE)
    yaw = None if mask & dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE else message.yaw
    yaw_rate = None if mask & dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE else message.yaw_rate
    asked = (*position, *velocity, *acceleration, yaw, yaw_rate)
    if all(value is None for value in asked):
        return texts.NOTHING_ASKED
    if not all(value is None or math.isfinite(value) for value in asked):
        return texts.NOT_ALL_NUMBERS
    if acceleration != NOTHING and mask & dialect.POSITION_TARGET_TYPEMASK_FORCE_SET:
        return texts.FORCES
    if _size(position) > FARTHEST:
        return texts.NOT_ON_EARTH
    if _size(velocity) > MOST_SPEED:
        return texts.TOO_FAST.fill(speed=_size(velocity))
    if _size(acceleration) > MOST_ACCELERATION:
        return texts.TOO_MUCH_ACCELERATION.fill(acceleration=_size(acceleration))
    if abs(yaw_rate or 0.0) > MOST_TURN:
        return texts.TURNS_TOO_FAST.fill(rate=abs(yaw_rate or 0.0))
    if yaw is not None:
        yaw = units.wrap_pi(yaw)
    return MotionSetpoint(origin, body, position, velocity, acceleration, yaw, yaw_rate)


def _wanted(values: tuple[float, float, float], mask: int, first: int) -> Vector:
    """Return the values of three axes, None for each that the mask ignores.

    `first` is the mask's bit of x; y and z have the next two.
    """
    x, y, z = (None if mask & first << i else value for i, value in enumerate(values))
    return x, y, z


def _size(values: Sequence[float | None]) -> float:
    return max(abs(value) for value in values if value is not None) if any(v is not None for v in values) else 0.0
