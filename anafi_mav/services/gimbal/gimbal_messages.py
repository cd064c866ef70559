"""Builds the messages of gimbal manager and gimbal device. No I/O.

Parrot's angles have MAVLink's signs. Roll and pitch are those to the horizon in every message; yaw is to the nose, or
to north where the axis is locked to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import units
from anafi_mav.drone import GimbalState
from anafi_mav.drone.events import Axis, FrameOfReference, GimbalCalibrationState, GimbalError
from anafi_mav.mavlink import dialect
from anafi_mav.services.gimbal.control import GimbalControl
from anafi_mav.services.gimbal.targets import wrap_180
from anafi_mav.services.stream import Times
from anafi_mav.services.version_numbers import version_numbers
from anafi_mav.vehicle.vehicle import Vehicle

DEVICE = 1
"""Our gimbal device id: a gimbal without a MAVLink component of its own has one of 1 to 6 (common.xml)."""

NAN = math.nan

_AXIS_CAPABILITIES = {
    Axis.ROLL: dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_AXIS
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_FOLLOW
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_LOCK,
    Axis.PITCH: dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_FOLLOW
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_LOCK,
    Axis.YAW: dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_FOLLOW
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK
    | dialect.GIMBAL_MANAGER_CAP_FLAGS_SUPPORTS_YAW_IN_EARTH_FRAME,
}

_LOCKS = {
    Axis.ROLL: dialect.GIMBAL_DEVICE_FLAGS_ROLL_LOCK,
    Axis.PITCH: dialect.GIMBAL_DEVICE_FLAGS_PITCH_LOCK,
    Axis.YAW: dialect.GIMBAL_DEVICE_FLAGS_YAW_LOCK,
}

_AT_LIMIT = {
    Axis.ROLL: dialect.GIMBAL_DEVICE_ERROR_FLAGS_AT_ROLL_LIMIT,
    Axis.PITCH: dialect.GIMBAL_DEVICE_ERROR_FLAGS_AT_PITCH_LIMIT,
    Axis.YAW: dialect.GIMBAL_DEVICE_ERROR_FLAGS_AT_YAW_LIMIT,
}

_FAILURES = {
    GimbalError.CALIBRATION_ERROR: dialect.GIMBAL_DEVICE_ERROR_FLAGS_ENCODER_ERROR,
    GimbalError.OVERLOAD_ERROR: dialect.GIMBAL_DEVICE_ERROR_FLAGS_MOTOR_ERROR,
    GimbalError.COMM_ERROR: dialect.GIMBAL_DEVICE_ERROR_FLAGS_COMMS_ERROR,
    GimbalError.CRITICAL_ERROR: dialect.GIMBAL_DEVICE_ERROR_FLAGS_MOTOR_ERROR,
}
"""Of Parrot's errors (gimbal.xml 148-0-17). A critical one is one of the hardware."""


def ranges(gimbal: GimbalState) -> Mapping[Axis, tuple[float, float]]:
    """Return the range of each axis that turns, deg: of yaw from the nose, else the horizon."""
    frames = {Axis.YAW: FrameOfReference.RELATIVE}
    return {axis: gimbal.bounds(axis, frames.get(axis, FrameOfReference.ABSOLUTE)) for axis in gimbal.axes or ()}


def _range_fields(gimbal: GimbalState) -> tuple[float, float, float, float, float, float]:
    """Return minimum and maximum of roll, pitch and yaw, rad.

    0 of an axis that does not turn, NaN while unknown.
    """
    known = ranges(gimbal)
    roll, pitch, yaw = (known.get(axis, (0.0, 0.0)) for axis in (Axis.ROLL, Axis.PITCH, Axis.YAW))
    return (*_radians(*roll), *_radians(*pitch), *_radians(*yaw))


def _radians(low: float, high: float) -> tuple[float, float]:
    if not math.isfinite(low + high):
        return NAN, NAN
    return low * units.RAD_PER_DEG, high * units.RAD_PER_DEG


def device_capabilities(gimbal: GimbalState) -> int:
    """Return GIMBAL_DEVICE_CAP_FLAGS of the axes that the drone reports.

    There is no retracted position.
    """
    flags = dialect.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL
    for axis in gimbal.axes or ():
        flags |= _AXIS_CAPABILITIES.get(axis, 0)
    return flags


def information(gimbal: GimbalState, times: Times) -> dialect.MAVLink_message | None:
    """GIMBAL_MANAGER_INFORMATION; None before the drone has reported its gimbal."""
    if gimbal.axes is None:
        return None
    flags = device_capabilities(gimbal) | dialect.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_GLOBAL
    return dialect.MAVLink_gimbal_manager_information_message(times.boot_ms, flags, DEVICE, *_range_fields(gimbal))


def device_information(vehicle: Vehicle, gimbal: GimbalState, times: Times) -> dialect.MAVLink_message | None:
    """GIMBAL_DEVICE_INFORMATION; None before the drone has reported its gimbal.

    Its firmware is the drone's.
    """
    if gimbal.axes is None:
        return None
    identity, flags = vehicle.drone.identity, device_capabilities(gimbal)
    major, minor, patch = version_numbers(identity.firmware)
    return dialect.MAVLink_gimbal_device_information_message(
        times.boot_ms,
        b"Parrot",
        identity.model.title.encode()[:32],
        b"",
        patch << 16 | minor << 8 | major,
        0,
        0,
        flags,
        0,
        *_range_fields(gimbal),
        DEVICE,
        flags,
    )


def device_flags(gimbal: GimbalState, *, neutral: bool) -> int:
    """Return GIMBAL_DEVICE_FLAGS: the frame that each axis holds, and exactly one frame of yaw."""
    attitude, axes = gimbal.attitude, gimbal.axes or frozenset()
    flags = dialect.GIMBAL_DEVICE_FLAGS_NEUTRAL if neutral else 0
    if attitude is not None:
        for axis, lock in _LOCKS.items():
            if axis in axes and attitude.frames[axis] == FrameOfReference.ABSOLUTE:
                flags |= lock
    if Axis.YAW in axes:
        flags |= dialect.GIMBAL_DEVICE_FLAGS_ACCEPTS_YAW_IN_EARTH_FRAME
    earth = flags & dialect.GIMBAL_DEVICE_FLAGS_YAW_LOCK
    return flags | (
        dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME if earth else dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
    )


def manager_status(
    gimbal: GimbalState, control: GimbalControl, sysid: int, times: Times, *, neutral: bool
) -> dialect.MAVLink_message | None:
    """GIMBAL_MANAGER_STATUS; a mission that has control is the autopilot of this system."""
    if gimbal.axes is None:
        return None
    primary, secondary = control.primary, control.secondary
    if control.is_of_mission:
        primary = (sysid, dialect.MAV_COMP_ID_AUTOPILOT1)
    return dialect.MAVLink_gimbal_manager_status_message(
        times.boot_ms, device_flags(gimbal, neutral=neutral), DEVICE, *primary, *secondary
    )


def attitude_status(gimbal: GimbalState, times: Times, *, neutral: bool) -> dialect.MAVLink_message | None:
    """GIMBAL_DEVICE_ATTITUDE_STATUS. ARSDK reports no rates of the gimbal: NaN.

    Frames and errors are the reported ones, also beside the attitude of a picture, which has neither.
    """
    pose = times.pose
    flags, body = device_flags(gimbal, neutral=neutral), pose.attitude
    earth = bool(flags & dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME)
    if pose.frame is None:
        q = reported_rotation(gimbal, earth=earth)
    else:
        q = pictured_rotation(pose.frame.camera_rotation, None if body is None else body.yaw, earth=earth)
    if q is None:
        return None
    return dialect.MAVLink_gimbal_device_attitude_status_message(
        0,
        0,
        times.boot_ms,
        flags,
        q,
        NAN,
        NAN,
        NAN,
        failure_flags(gimbal),
        NAN if body is None else units.wrap_pi(body.yaw),
        NAN,
        DEVICE,
    )


def reported_rotation(gimbal: GimbalState, *, earth: bool) -> tuple[float, ...] | None:
    """Return the gimbal's rotation as its event reports it: from north, or from the heading."""
    attitude = gimbal.attitude
    if attitude is None:
        return None
    absolute = attitude.absolute
    angles = (absolute.roll, absolute.pitch, absolute.yaw if earth else attitude.relative.yaw)
    return units.quaternion_from_euler(*(angle * units.RAD_PER_DEG for angle in angles))


def pictured_rotation(
    quaternion: tuple[float, float, float, float] | None, heading: float | None, *, earth: bool
) -> tuple[float, ...] | None:
    """Return a picture's rotation: from north, or from the heading (rad) of the same picture.

    The metadata have it from north. It is turned back as a quaternion: straight down a heading cannot be subtracted
    from an angle of yaw.
    """
    if quaternion is None or earth:
        return quaternion
    if heading is None:
        return None
    w, x, y, z = quaternion
    cosine, sine = math.cos(heading / 2.0), math.sin(heading / 2.0)
    return cosine * w + sine * z, cosine * x + sine * y, cosine * y - sine * x, cosine * z - sine * w


def failure_flags(gimbal: GimbalState) -> int:
    """Return GIMBAL_DEVICE_ERROR_FLAGS: reported errors, and axes at the end of their range."""
    flags = 0
    for error in gimbal.errors or ():
        flags |= _FAILURES.get(error, 0)
    for axis in gimbal.axes or ():
        if gimbal.is_at_end(axis):
            flags |= _AT_LIMIT.get(axis, 0)
    if gimbal.calibration == GimbalCalibrationState.IN_PROGRESS:
        flags |= dialect.GIMBAL_DEVICE_ERROR_FLAGS_CALIBRATION_RUNNING
    return flags


def mount_orientation(gimbal: GimbalState, heading: float | None, times: Times) -> dialect.MAVLink_message | None:
    """MOUNT_ORIENTATION, for clients older than the gimbal protocol.

    Its `yaw_absolute` is the yaw to the nose on the vehicle's heading (rad; None: unknown), from the north of ATTITUDE:
    the gimbal's own absolute yaw is to magnetic north.
    """
    attitude = gimbal.attitude
    if attitude is None:
        return None
    absolute, yaw = attitude.absolute, attitude.relative.yaw
    to_north = NAN if heading is None else wrap_180(heading * units.DEG_PER_RAD + yaw)
    return dialect.MAVLink_mount_orientation_message(times.boot_ms, absolute.roll, absolute.pitch, yaw, to_north)


def mount_status(gimbal: GimbalState, mode: int) -> dialect.MAVLink_message | None:
    """MOUNT_STATUS, ArduPilot's older message: cdeg, yaw from the nose."""
    attitude = gimbal.attitude
    if attitude is None:
        return None
    pitch = units.saturate(attitude.absolute.pitch * 100.0, 32)
    roll = units.saturate(attitude.absolute.roll * 100.0, 32)
    yaw = units.saturate(attitude.relative.yaw * 100.0, 32)
    return dialect.MAVLink_mount_status_message(0, 0, pitch, roll, yaw, mode)
