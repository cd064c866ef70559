"""Messages that echo the flown setpoint: POSITION_TARGET_* and ATTITUDE_TARGET.

POSITION_TARGET_LOCAL_NED, POSITION_TARGET_GLOBAL_INT and ATTITUDE_TARGET hold the vehicle's interpretation of a
setpoint: positions that count from the drone have become places, headings that count from the nose have become
headings. A value that is not set is NaN, and its bit is set in the mask. While nothing is flown no message is sent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import geo, units
from anafi_mav.mavlink import dialect
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.offboard.setpoints import MotionSetpoint
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan

_X_IGNORE = dialect.POSITION_TARGET_TYPEMASK_X_IGNORE
_VX_IGNORE = dialect.POSITION_TARGET_TYPEMASK_VX_IGNORE
_AX_IGNORE = dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE
_YAW_IGNORE = dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_YAW_RATE_IGNORE = dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE


class _Target:
    """Target of the vehicle, in north, east and down."""

    def __init__(self) -> None:
        self.place: GeoPoint | None = None
        self.height: float | None = None
        self.velocity: list[float | None] = [None, None, None]
        self.acceleration: list[float | None] = [None, None, None]
        self.yaw: float | None = None
        self.yaw_rate: float | None = None

    def mask(self) -> int:
        """Which of the values are not asked for."""
        nowhere = self.place is None
        position = (nowhere, nowhere, self.height is None)
        mask = sum(_X_IGNORE << i for i, unset in enumerate(position) if unset)
        mask |= sum(_VX_IGNORE << i for i, value in enumerate(self.velocity) if value is None)
        mask |= sum(_AX_IGNORE << i for i, value in enumerate(self.acceleration) if value is None)
        mask |= _YAW_IGNORE if self.yaw is None else 0
        return mask | (_YAW_RATE_IGNORE if self.yaw_rate is None else 0)

    def tail(self) -> tuple[float, ...]:
        """Velocity, acceleration, heading and turn rate, as both messages have them."""
        return tuple(NAN if v is None else v for v in (*self.velocity, *self.acceleration, self.yaw, self.yaw_rate))


def _target(vehicle: Vehicle) -> _Target | None:
    flight, target = vehicle.offboard, _Target()
    setpoint, goal = flight.setpoint, flight.goal
    if isinstance(setpoint, MotionSetpoint):
        if goal is not None:
            target.place = goal.place if None not in goal.position[:2] else None
            target.height = goal.height
        turn = flight.motion.yaw if setpoint.body else 0.0
        target.velocity = _over_ground(setpoint.velocity, turn)
        target.acceleration = _over_ground(setpoint.acceleration, turn)
        target.yaw, target.yaw_rate = flight.yaw, setpoint.yaw_rate
        return target
    piloting = vehicle.drone.piloting
    if setpoint is None and piloting.move is not None and (to := piloting.move.target) is not None:
        target.place, target.height = GeoPoint(to.latitude, to.longitude), to.altitude
        return target
    return None


def _over_ground(vector: tuple[float | None, float | None, float | None], turn: float | None) -> list[float | None]:
    """A vector of axes turned clockwise by `turn` in north, east, down.

    One without a horizontal half has none.
    """
    x, y, z = vector
    if x is None and y is None:
        return [None, None, z]
    if turn is None:
        return [None, None, z]
    if turn == 0.0:
        return [x, y, z]
    ahead, aside = x or 0.0, y or 0.0
    cos, sin = math.cos(turn), math.sin(turn)
    return [ahead * cos - aside * sin, ahead * sin + aside * cos, z]


def local_target(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """POSITION_TARGET_LOCAL_NED, in LOCAL_NED."""
    target = _target(vehicle)
    if target is None:
        return None
    north = east = NAN
    if vehicle.origin is None:
        target.place = None
    elif target.place is not None:
        north, east = geo.offset(
            vehicle.origin.latitude, vehicle.origin.longitude, target.place.latitude, target.place.longitude
        )
    down = NAN if target.height is None else -target.height
    return dialect.MAVLink_position_target_local_ned_message(
        times.boot_ms, dialect.MAV_FRAME_LOCAL_NED, target.mask(), north, east, down, *target.tail()
    )


def global_target(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """POSITION_TARGET_GLOBAL_INT, with the height above take-off; only for what is on the map."""
    target = _target(vehicle)
    if target is None or target.place is None:
        return None
    return dialect.MAVLink_position_target_global_int_message(
        times.boot_ms,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        target.mask(),
        units.deg_e7(target.place.latitude),
        units.deg_e7(target.place.longitude),
        NAN if target.height is None else target.height,
        *target.tail(),
    )


def attitude_target(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ATTITUDE_TARGET: the sticks held by setpoints of any kind; thrust 0.5 holds height."""
    flight, limits = vehicle.offboard, vehicle.drone.piloting.limits
    sticks, heading = flight.flown, flight.motion.yaw
    if sticks is None or limits is None or heading is None:
        return None
    yaw = heading if flight.yaw is None else flight.yaw
    share = units.clip(sticks.climb_mps / limits.climb_mps, -1.0, 1.0) if limits.climb_mps > 0.0 else 0.0
    return dialect.MAVLink_attitude_target_message(
        times.boot_ms,
        dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
        | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE,
        units.quaternion_from_euler(sticks.roll_deg * units.RAD_PER_DEG, sticks.pitch_deg * units.RAD_PER_DEG, yaw),
        NAN,
        NAN,
        sticks.yaw_rate_dps * units.RAD_PER_DEG,
        0.5 + share / 2.0,
    )


# Each is sent only while setpoints or moves are flown.
STREAMS: Mapping[int, MessageStream] = {
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: MessageStream(local_target, every=0.5),
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: MessageStream(global_target, every=0.5),
    dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: MessageStream(attitude_target, every=0.5),
}
