"""The gimbal: pitch and roll on two axes, turning no faster than its speed setting, each in the frame last asked for.

All angles in degrees with Parrot's signs: pitch up, roll clockwise seen from behind. The picture's yaw is the drone's.
A velocity target is a share (-1..1) of the speed setting and holds until the next target or the end of the range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from anafi_mav.arsdk.messages import gimbal
from anafi_mav.arsdk.messages.gimbal import Axis, ControlMode, FrameOfReference, GimbalCalibrationState
from anafi_mav.arsdk.wire import Message
from anafi_mav.sim.model import Model
from anafi_mav.sim.motion import Pose
from anafi_mav.units import DEG_PER_RAD, clip, wrap_pi

ROLL_RANGE = (-38.0, 38.0)
"""deg; assumed (what the electronic stabilisation can take)."""
OFFSET_RANGE = (-10.0, 10.0)
"""deg; assumed."""
CALIBRATION_TIME = 3.0
"""s; assumed."""


@dataclass
class _AxisState:
    low: float
    high: float
    frame: FrameOfReference = FrameOfReference.ABSOLUTE
    angle: float = 0.0
    """deg in `frame`"""
    target: float = 0.0
    rate: float | None = None
    """deg/s of a velocity target; None: towards `target`."""

    def advance(self, seconds: float, speed: float) -> None:
        target, reach = self.target, speed * seconds
        if self.rate is not None:
            target, reach = math.copysign(math.inf, self.rate), abs(self.rate) * seconds
        self.angle = clip(clip(target, self.angle - reach, self.angle + reach), self.low, self.high)

    def aim(self, mode: ControlMode, frame: FrameOfReference, value: float, speed: float, body: float) -> None:
        """Take a target; `body` is the drone's own angle on this axis, for a change of frame."""
        if frame not in (FrameOfReference.RELATIVE, FrameOfReference.ABSOLUTE) or not math.isfinite(value):
            return
        if frame is not self.frame:
            self.angle += body if frame is FrameOfReference.ABSOLUTE else -body
            self.frame = frame
        if mode is ControlMode.VELOCITY:
            self.rate = clip(value, -1.0, 1.0) * speed
        else:
            self.rate, self.target = None, clip(value, self.low, self.high)

    def both(self, body: float) -> tuple[float, float]:
        """(relative to the body, relative to the horizon)."""
        if self.frame is FrameOfReference.ABSOLUTE:
            return self.angle - body, self.angle
        return self.angle, self.angle + body


class Gimbal:
    """Gimbal 0 of a model with two axes."""

    def __init__(self, model: Model) -> None:
        self._speed = model.settings["gimbal_speed"]
        self._pitch_range = model.gimbal_pitch
        self._speeds = {Axis.PITCH: self._speed.default, Axis.ROLL: self._speed.default}
        self._pitch = _AxisState(*model.gimbal_pitch)
        self._roll = _AxisState(*ROLL_RANGE)
        self._offsets = {Axis.PITCH: 0.0, Axis.ROLL: 0.0}
        self._updating = gimbal.State.INACTIVE
        self._calibrating_until: float | None = None
        self._time = 0.0

    def advance(self, time: float) -> None:
        """Turn until `time` (s)."""
        seconds, self._time = time - self._time, time
        self._pitch.advance(seconds, self._speeds[Axis.PITCH])
        self._roll.advance(seconds, self._speeds[Axis.ROLL])

    def tick(self, time: float) -> list[Message]:
        """What has come due by now (s)."""
        if self._calibrating_until is None or time < self._calibrating_until:
            return []
        self._calibrating_until = None
        return [
            self._calibration(),
            gimbal.CalibrationResult(0, gimbal.GimbalCalibrationResult.SUCCESS),
        ]

    def handle(self, message: Message, pose: Pose, time: float) -> list[Message] | None:
        """The answer to a command of this feature; None when it is none."""
        self.advance(time)
        match message:
            case gimbal.SetTarget():
                self._aim(message, pose)
                return []
            case gimbal.SetMaxSpeed():
                self._speeds[Axis.PITCH] = self._speed.clip(message.pitch)
                self._speeds[Axis.ROLL] = self._speed.clip(message.roll)
                return [self._max_speed()]
            case gimbal.ResetOrientation():
                for axis, body in ((self._pitch, pose.pitch), (self._roll, pose.roll)):
                    axis.aim(ControlMode.POSITION, FrameOfReference.ABSOLUTE, 0.0, 0.0, body * DEG_PER_RAD)
                return []
            case gimbal.StartOffsetsUpdate():
                self._updating = gimbal.State.ACTIVE
                return [self._offset_report()]
            case gimbal.StopOffsetsUpdate():
                self._updating = gimbal.State.INACTIVE
                return [self._offset_report()]
            case gimbal.SetOffsets():
                self._offsets = {
                    Axis.PITCH: clip(message.pitch, *OFFSET_RANGE),
                    Axis.ROLL: clip(message.roll, *OFFSET_RANGE),
                }
                return [self._offset_report()]
            case gimbal.Calibrate():
                self._calibrating_until = time + CALIBRATION_TIME
                return [self._calibration()]
            case gimbal.CancelCalibration():
                self._calibrating_until = None
                return [
                    self._calibration(),
                    gimbal.CalibrationResult(0, gimbal.GimbalCalibrationResult.CANCELED),
                ]
        return None

    def _aim(self, message: gimbal.SetTarget, pose: Pose) -> None:
        mode = message.control_mode
        self._pitch.aim(
            mode,
            message.pitch_frame_of_reference,
            message.pitch,
            self._speeds[Axis.PITCH],
            pose.pitch * DEG_PER_RAD,
        )
        self._roll.aim(
            mode, message.roll_frame_of_reference, message.roll, self._speeds[Axis.ROLL], pose.roll * DEG_PER_RAD
        )

    def attitude(self, pose: Pose) -> gimbal.Attitude:
        pitch_relative, pitch_absolute = self._pitch.both(pose.pitch * DEG_PER_RAD)
        roll_relative, roll_absolute = self._roll.both(pose.roll * DEG_PER_RAD)
        return gimbal.Attitude(
            0,
            FrameOfReference.RELATIVE,
            self._pitch.frame,
            self._roll.frame,
            0.0,
            pitch_relative,
            roll_relative,
            wrap_pi(pose.yaw) * DEG_PER_RAD,
            pitch_absolute,
            roll_absolute,
        )

    def _max_speed(self) -> Message:
        low, high = self._speed.low, self._speed.high
        pitch, roll = self._speeds[Axis.PITCH], self._speeds[Axis.ROLL]
        return gimbal.MaxSpeed(0, 0.0, 0.0, 0.0, low, high, pitch, low, high, roll)

    def _offset_report(self) -> Message:
        pitch, roll = self._offsets[Axis.PITCH], self._offsets[Axis.ROLL]
        return gimbal.Offsets(0, self._updating, 0.0, 0.0, 0.0, *OFFSET_RANGE, pitch, *OFFSET_RANGE, roll)

    def _calibration(self) -> Message:
        busy = self._calibrating_until is not None
        return gimbal.CalibrationState(GimbalCalibrationState.IN_PROGRESS if busy else GimbalCalibrationState.OK, 0)

    def states_report(self, pose: Pose) -> list[Message]:
        """What AllStates tells of the gimbal."""
        return [
            gimbal.GimbalCapabilities(0, gimbal.Model.MAIN, 1 << Axis.PITCH | 1 << Axis.ROLL),
            gimbal.RelativeAttitudeBounds(0, 0.0, 0.0, *self._pitch_range, *ROLL_RANGE),
            gimbal.AbsoluteAttitudeBounds(0, 0.0, 0.0, *self._pitch_range, *ROLL_RANGE),
            self._max_speed(),
            self.attitude(pose),
            gimbal.AxisLockState(0, 0),
            self._offset_report(),
            self._calibration(),
            gimbal.Alert(0, 0),
        ]
