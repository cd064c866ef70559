"""Simulated gimbals, limited by the speed setting.

Each axis turns in the frame of reference last commanded. All angles in degrees with Parrot's signs: pitch up, roll
clockwise seen from behind, yaw clockwise from above; absolute is to the horizon and to north. An axis that cannot be
turned moves with the body, or with the picture that the electronics keep level. Yaw turns no further from the nose
than its range, in either frame: an absolute yaw target is to north, and the body drags the axis along at the end of its
range (assumed; Parrot publishes no range of yaw).

A velocity target is a share (-1..1) of the speed setting and holds until the next target or the end of the range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import gimbal
from anafi_mav.arsdk.messages.gimbal import Axis, ControlMode, FrameOfReference, GimbalCalibrationState
from anafi_mav.sim.world.model import AircraftModel, GimbalModel, SettingRange
from anafi_mav.sim.world.motion import Pose
from anafi_mav.units import DEG_PER_RAD, clip, wrap_pi

OFFSET_RANGE = (-10.0, 10.0)
"""deg; assumed."""
CALIBRATION_TIME = 3.0
"""s; assumed."""

_FIXED = (0.0, 0.0)
_FRAMES = (FrameOfReference.RELATIVE, FrameOfReference.ABSOLUTE)


@dataclass
class _AxisState:
    low: float
    high: float
    frame: FrameOfReference = FrameOfReference.ABSOLUTE
    angle: float = 0.0
    """deg in `frame`"""
    target: float = 0.0
    rate: float | None = None
    """Share of the speed of a velocity target; None: towards `target`."""
    is_ranged_by_body: bool = False
    """Its range counts from the body in the absolute frame, too; otherwise it is the same in both frames."""

    @property
    def fixed(self) -> bool:
        return (self.low, self.high) == _FIXED

    @property
    def turns(self) -> bool:
        """It can turn and is not where it is to be."""
        return (self.rate is not None or self.angle != self.target) and not self.fixed

    def advance(self, seconds: float, speed: float) -> None:
        target, reach = self.target, speed * seconds
        if self.rate is not None:
            target, reach = math.copysign(math.inf, self.rate), abs(self.rate) * speed * seconds
        self.angle = self._bounded(clip(target, self.angle - reach, self.angle + reach))

    def aim(self, mode: ControlMode, frame: FrameOfReference, value: float, body: float) -> None:
        """Take a target; `body` is the drone's own angle on this axis, for a change of frame."""
        if self.fixed or frame not in _FRAMES or mode not in tuple(ControlMode) or not math.isfinite(value):
            return
        if frame is not self.frame:
            self.angle += body if frame is FrameOfReference.ABSOLUTE else -body
            if self.is_ranged_by_body:
                self.angle = _wrap(self.angle)
            self.frame = frame
        if mode is ControlMode.VELOCITY:
            self.rate = clip(value, -1.0, 1.0)
        else:
            self.rate, self.target = None, self._bounded(self._near(value))

    def drag(self, body: float) -> None:
        """Keep the axis within its range from the body, whose own angle is `body`."""
        if self.is_ranged_by_body and self.frame is FrameOfReference.ABSOLUTE and not self.fixed:
            self.angle = body + clip(_wrap(self.angle - body), self.low, self.high)
            self.target = self._near(self.target)

    def _near(self, value: float) -> float:
        """Return a target as the axis reaches it by the shorter way."""
        turns_round = self.is_ranged_by_body and self.frame is FrameOfReference.ABSOLUTE
        return self.angle + _wrap(value - self.angle) if turns_round else value

    def _bounded(self, angle: float) -> float:
        if self.is_ranged_by_body and self.frame is FrameOfReference.ABSOLUTE:
            return angle  # `drag` bounds it
        return clip(angle, self.low, self.high)

    def both(self, body: float) -> tuple[float, float]:
        """(relative to the body, absolute)."""
        if self.frame is FrameOfReference.ABSOLUTE:
            return self.angle - body, self.angle
        return self.angle, self.angle + body


def _body(pose: Pose) -> dict[Axis, float]:
    """The drone's own angles, deg."""
    return {Axis.YAW: pose.yaw * DEG_PER_RAD, Axis.PITCH: pose.pitch * DEG_PER_RAD, Axis.ROLL: pose.roll * DEG_PER_RAD}


class Gimbal:
    """One gimbal."""

    def __init__(self, id: int, model: GimbalModel, speed: SettingRange) -> None:
        self.id = id
        self._model = gimbal.Model.FSTCAM if id else gimbal.Model.MAIN
        self._limits = speed
        self._speed = speed.default
        self._axes = {
            Axis.YAW: _AxisState(*model.yaw, frame=FrameOfReference.RELATIVE, is_ranged_by_body=True),
            Axis.PITCH: _AxisState(*model.pitch),
            Axis.ROLL: _AxisState(*model.roll),
        }
        self._offsets = dict.fromkeys(Axis, 0.0)
        self._updating = gimbal.State.INACTIVE
        self._calibrating_until: float | None = None

    @property
    def calibrating(self) -> bool:
        return self._calibrating_until is not None

    def advance(self, seconds: float) -> None:
        """Turn for so long."""
        for axis in self._axes.values():
            if axis.turns:
                axis.advance(seconds, self._speed)

    def tick(self, time: float) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        if self._calibrating_until is None or time < self._calibrating_until:
            return []
        self._calibrating_until = None
        return [self._calibration(), self._result(gimbal.GimbalCalibrationResult.SUCCESS)]

    # -- commands

    def set_target(self, m: gimbal.SetTarget, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        if self.calibrating:
            return ()
        body = _body(pose)
        wanted = {
            Axis.YAW: (m.yaw_frame_of_reference, m.yaw),
            Axis.PITCH: (m.pitch_frame_of_reference, m.pitch),
            Axis.ROLL: (m.roll_frame_of_reference, m.roll),
        }
        for axis, (frame, value) in wanted.items():
            self._axes[axis].aim(m.control_mode, frame, value, body[axis])
        return ()

    def set_max_speed(self, m: gimbal.SetMaxSpeed, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        # Parrot's gimbal.xml: yaw and roll are deprecated, the value of pitch is used for all axes.
        if m.pitch == m.pitch:
            self._speed = self._limits.clip(m.pitch)
        yield self._max_speed()

    def reset_orientation(self, m: Message, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        for axis in self._axes.values():
            axis.aim(ControlMode.POSITION, axis.frame, 0.0, 0.0)
        return ()

    def update_offsets(self, m: Message, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        self._updating = gimbal.State.ACTIVE if isinstance(m, gimbal.StartOffsetsUpdate) else gimbal.State.INACTIVE
        yield self._offset_report()

    def set_offsets(self, m: gimbal.SetOffsets, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        if self._updating is gimbal.State.ACTIVE:
            for axis, value in ((Axis.YAW, m.yaw), (Axis.PITCH, m.pitch), (Axis.ROLL, m.roll)):
                if not self._axes[axis].fixed and math.isfinite(value):
                    self._offsets[axis] = clip(value, *OFFSET_RANGE)
        yield self._offset_report()

    def calibrate(self, m: Message, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        if flying:
            yield self._calibration()
            yield self._result(gimbal.GimbalCalibrationResult.FAILURE)
            return
        self._calibrating_until = time + CALIBRATION_TIME
        yield self._calibration()

    def cancel_calibration(self, m: Message, pose: Pose, time: float, flying: bool) -> Iterable[Message]:
        if not self.calibrating:
            yield self._calibration()
            return
        self._calibrating_until = None
        yield self._calibration()
        yield self._result(gimbal.GimbalCalibrationResult.CANCELED)

    # -- reports

    def attitude(self, pose: Pose) -> gimbal.Attitude:
        yaw_axis, pitch_axis, roll_axis = self._axes.values()
        yaw_axis.drag(pose.yaw * DEG_PER_RAD)
        yaw = yaw_axis.both(pose.yaw * DEG_PER_RAD)
        pitch = pitch_axis.both(pose.pitch * DEG_PER_RAD)
        roll = roll_axis.both(pose.roll * DEG_PER_RAD)
        return gimbal.Attitude(
            self.id,
            yaw_axis.frame,
            pitch_axis.frame,
            roll_axis.frame,
            _wrap(yaw[0]),
            pitch[0],
            roll[0],
            _wrap(yaw[1]),
            pitch[1],
            roll[1],
        )

    def _per_axis(self, values: Callable[[Axis], tuple[float, ...]]) -> list[float]:
        """Return the values of the three axes in Parrot's sequence; zeros for a fixed axis."""
        numbers: list[float] = []
        for axis, state in self._axes.items():
            wanted = values(axis)
            numbers += [0.0] * len(wanted) if state.fixed else wanted
        return numbers

    def _max_speed(self) -> Message:
        low, high = self._limits.low, self._limits.high
        return gimbal.MaxSpeed(self.id, *self._per_axis(lambda axis: (low, high, self._speed)))

    def _offset_report(self) -> Message:
        return gimbal.Offsets(
            self.id, self._updating, *self._per_axis(lambda axis: (*OFFSET_RANGE, self._offsets[axis]))
        )

    def _calibration(self) -> Message:
        state = GimbalCalibrationState.IN_PROGRESS if self.calibrating else GimbalCalibrationState.OK
        return gimbal.CalibrationState(state, self.id)

    def _result(self, result: gimbal.GimbalCalibrationResult) -> Message:
        return gimbal.CalibrationResult(self.id, result)

    def states_report(self, pose: Pose) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        bounds = self._per_axis(lambda axis: (self._axes[axis].low, self._axes[axis].high))
        to_north = self._per_axis(
            lambda axis: (-180.0, 180.0) if axis is Axis.YAW else (self._axes[axis].low, self._axes[axis].high)
        )
        turning = sum(1 << axis for axis, state in self._axes.items() if not state.fixed)
        return [
            gimbal.GimbalCapabilities(self.id, self._model, turning),
            gimbal.RelativeAttitudeBounds(self.id, *bounds),
            gimbal.AbsoluteAttitudeBounds(self.id, *to_north),
            self._max_speed(),
            self.attitude(pose),
            gimbal.AxisLockState(self.id, 0),
            self._offset_report(),
            self._calibration(),
            gimbal.Alert(self.id, 0),
        ]


class Gimbals:
    """All gimbals of a model, by id."""

    def __init__(self, model: AircraftModel) -> None:
        speed = model.settings["gimbal_speed"]
        self._gimbals = [Gimbal(id, one, speed) for id, one in enumerate(model.gimbals)]
        self._time = 0.0

    def advance(self, time: float) -> None:
        """Turn until `time` (s)."""
        seconds, self._time = time - self._time, time
        for one in self._gimbals:
            one.advance(seconds)

    def tick(self, time: float) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        return [message for one in self._gimbals for message in one.tick(time)]

    def handle(self, message: Message, pose: Pose, time: float, flying: bool) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for any other message.

        A command for a gimbal that does not exist is not answered.
        """
        handler = _HANDLERS.get(type(message))
        if handler is None:
            return None
        self.advance(time)
        id: int = message.gimbal_id  # type: ignore[attr-defined] # all of them have it
        if id >= len(self._gimbals):
            return []
        return list(handler(self._gimbals[id], message, pose, time, flying))

    def attitude(self, pose: Pose, id: int = 0) -> gimbal.Attitude:
        return self._gimbals[id].attitude(pose)

    def attitudes(self, pose: Pose) -> list[Message]:
        return [one.attitude(pose) for one in self._gimbals]

    def states_report(self, pose: Pose) -> list[Message]:
        """Return the gimbal messages of the AllStates answer."""
        return [message for one in self._gimbals for message in one.states_report(pose)]


def _wrap(angle: float) -> float:
    return wrap_pi(angle / DEG_PER_RAD) * DEG_PER_RAD


_HANDLERS: dict[type[Message], Callable[[Gimbal, Any, Pose, float, bool], Iterable[Message]]] = {
    gimbal.SetTarget: Gimbal.set_target,
    gimbal.SetMaxSpeed: Gimbal.set_max_speed,
    gimbal.ResetOrientation: Gimbal.reset_orientation,
    gimbal.StartOffsetsUpdate: Gimbal.update_offsets,
    gimbal.StopOffsetsUpdate: Gimbal.update_offsets,
    gimbal.SetOffsets: Gimbal.set_offsets,
    gimbal.Calibrate: Gimbal.calibrate,
    gimbal.CancelCalibration: Gimbal.cancel_calibration,
}
