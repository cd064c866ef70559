"""Feature 148, gimbal."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, U8, Bits, Buffer, Message, OpenEnum, command, event, value


class Model(OpenEnum):
    MAIN = 0
    FSTCAM = 1


class State(OpenEnum):
    INACTIVE = 0
    ACTIVE = 1
    PARTIAL = 2


class Error(OpenEnum):
    CALIBRATION_ERROR = 0
    OVERLOAD_ERROR = 1
    COMM_ERROR = 2
    CRITICAL_ERROR = 3


class GimbalCalibrationState(OpenEnum):
    REQUIRED = 0
    IN_PROGRESS = 1
    OK = 2


class GimbalCalibrationResult(OpenEnum):
    SUCCESS = 0
    FAILURE = 1
    CANCELED = 2


class Axis(OpenEnum):
    YAW = 0
    PITCH = 1
    ROLL = 2


class ControlMode(OpenEnum):
    POSITION = 0
    VELOCITY = 1


class FrameOfReference(OpenEnum):
    NONE = 0
    RELATIVE = 1
    ABSOLUTE = 2


@event("gimbal.gimbal_capabilities", 148, 0, 1)
class GimbalCapabilities(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    model: Annotated[Model, ENUM]
    axes: Annotated[int, Bits(U8, Axis)]


@event("gimbal.relative_attitude_bounds", 148, 0, 2)
class RelativeAttitudeBounds(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    min_yaw: Annotated[float, F32]
    max_yaw: Annotated[float, F32]
    min_pitch: Annotated[float, F32]
    max_pitch: Annotated[float, F32]
    min_roll: Annotated[float, F32]
    max_roll: Annotated[float, F32]


@event("gimbal.absolute_attitude_bounds", 148, 0, 10)
class AbsoluteAttitudeBounds(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    min_yaw: Annotated[float, F32]
    max_yaw: Annotated[float, F32]
    min_pitch: Annotated[float, F32]
    max_pitch: Annotated[float, F32]
    min_roll: Annotated[float, F32]
    max_roll: Annotated[float, F32]


@event("gimbal.max_speed", 148, 0, 3)
class MaxSpeed(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    min_bound_yaw: Annotated[float, F32]
    max_bound_yaw: Annotated[float, F32]
    current_yaw: Annotated[float, F32]
    min_bound_pitch: Annotated[float, F32]
    max_bound_pitch: Annotated[float, F32]
    current_pitch: Annotated[float, F32]
    min_bound_roll: Annotated[float, F32]
    max_bound_roll: Annotated[float, F32]
    current_roll: Annotated[float, F32]


@command("gimbal.set_max_speed", 148, 0, 4)
class SetMaxSpeed(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    yaw: Annotated[float, F32]
    pitch: Annotated[float, F32]
    roll: Annotated[float, F32]


@command("gimbal.set_target", 148, 0, 5, Buffer.NON_ACK)
class SetTarget(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    control_mode: Annotated[ControlMode, ENUM]
    yaw_frame_of_reference: Annotated[FrameOfReference, ENUM]
    yaw: Annotated[float, F32]
    pitch_frame_of_reference: Annotated[FrameOfReference, ENUM]
    pitch: Annotated[float, F32]
    roll_frame_of_reference: Annotated[FrameOfReference, ENUM]
    roll: Annotated[float, F32]


@value("gimbal.attitude", 148, 0, 6, of="gimbal_id")
class Attitude(Message, frozen=True):
    """Attitude of a gimbal, relative to the body and to the horizon, deg.

    Pitch + up, yaw + clockwise, roll + clockwise seen from behind.
    """

    gimbal_id: Annotated[int, U8]
    yaw_frame_of_reference: Annotated[FrameOfReference, ENUM]
    pitch_frame_of_reference: Annotated[FrameOfReference, ENUM]
    roll_frame_of_reference: Annotated[FrameOfReference, ENUM]
    yaw_relative: Annotated[float, F32]
    pitch_relative: Annotated[float, F32]
    roll_relative: Annotated[float, F32]
    yaw_absolute: Annotated[float, F32]
    pitch_absolute: Annotated[float, F32]
    roll_absolute: Annotated[float, F32]


@event("gimbal.axis_lock_state", 148, 0, 7)
class AxisLockState(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    locked: Annotated[int, Bits(U8, Axis)]


@command("gimbal.start_offsets_update", 148, 0, 12)
class StartOffsetsUpdate(Message, frozen=True):
    gimbal_id: Annotated[int, U8]


@command("gimbal.stop_offsets_update", 148, 0, 13)
class StopOffsetsUpdate(Message, frozen=True):
    gimbal_id: Annotated[int, U8]


@event("gimbal.offsets", 148, 0, 8)
class Offsets(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    update_state: Annotated[State, ENUM]
    min_bound_yaw: Annotated[float, F32]
    max_bound_yaw: Annotated[float, F32]
    current_yaw: Annotated[float, F32]
    min_bound_pitch: Annotated[float, F32]
    max_bound_pitch: Annotated[float, F32]
    current_pitch: Annotated[float, F32]
    min_bound_roll: Annotated[float, F32]
    max_bound_roll: Annotated[float, F32]
    current_roll: Annotated[float, F32]


@command("gimbal.set_offsets", 148, 0, 9)
class SetOffsets(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    yaw: Annotated[float, F32]
    pitch: Annotated[float, F32]
    roll: Annotated[float, F32]


@command("gimbal.reset_orientation", 148, 0, 11)
class ResetOrientation(Message, frozen=True):
    gimbal_id: Annotated[int, U8]


@event("gimbal.calibration_state", 148, 0, 14)
class CalibrationState(Message, frozen=True):
    state: Annotated[GimbalCalibrationState, ENUM]
    gimbal_id: Annotated[int, U8]


@command("gimbal.calibrate", 148, 0, 15)
class Calibrate(Message, frozen=True):
    gimbal_id: Annotated[int, U8]


@command("gimbal.cancel_calibration", 148, 0, 18)
class CancelCalibration(Message, frozen=True):
    gimbal_id: Annotated[int, U8]


@event("gimbal.calibration_result", 148, 0, 16)
class CalibrationResult(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    result: Annotated[GimbalCalibrationResult, ENUM]


@event("gimbal.alert", 148, 0, 17)
class Alert(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    error: Annotated[int, Bits(U8, Error)]


@event("gimbal.stabilization_state", 148, 0, 19)
class StabilizationState(Message, frozen=True):
    gimbal_id: Annotated[int, U8]
    state: Annotated[State, ENUM]
