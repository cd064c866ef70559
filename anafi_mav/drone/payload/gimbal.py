"""Element gimbal: where the cameras look.

All angles are degrees with Parrot's signs: pitch + up, yaw + clockwise seen from above, roll + clockwise seen from
behind. Each axis has a frame of its own: relative to the drone's body, or absolute, to the horizon and to north.

On the wire a velocity is a share of the axis' speed setting, not deg/s (gimbal.xml 148-0-5); here it is deg/s and
converted with the speed that the drone reports. Targets are not acknowledged and can be lost, so that the verbs that
wait repeat them until the attitude shows that they came.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import HEADER, Message
from anafi_mav.arsdk.messages import gimbal
from anafi_mav.arsdk.messages.gimbal import (
    Axis,
    ControlMode,
    Error,
    FrameOfReference,
    GimbalCalibrationResult,
    GimbalCalibrationState,
    Model,
)
from anafi_mav.drone.element import Range, Reducer, members, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Expectation, require_number
from anafi_mav.drone.settings import Commanding, is_limited, same_as
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError, CommandRejected, LocalProtocolError, NotSupported
from anafi_mav.units import clip, is_finite

MAIN = 0
"""Id of the gimbal that carries the cameras; the Ai's stereo camera has one of its own."""

ARRIVED_DEG = 0.5
INVISIBLE_SHARE = 1e-4
"""Share of an axis' highest rate that no attitude confirms: 0.02 deg/s of 180 is `STILL_DEG` in `ANSWER_TIMEOUT`."""

STILL_DEG = 0.1
"""Between two attitudes of a gimbal that stands."""
SETTLING = 3
"""Attitudes before a gimbal that stands is believed: the first may be older than the command."""
CALIBRATION_TIMEOUT = 60.0
"""s."""


class Aim(msgspec.Struct, frozen=True):
    """Target of one axis: an angle (deg) for `aim` and `point`, a rate (deg/s) for `turn`."""

    value: float
    frame: FrameOfReference = FrameOfReference.ABSOLUTE


class Angles(msgspec.Struct, frozen=True):
    """Angles of the three axes, deg: yaw + clockwise, pitch + up, roll + right."""

    yaw: float
    pitch: float
    roll: float

    def of(self, axis: Axis) -> float:
        """Return the angle of one axis."""
        return (self.yaw, self.pitch, self.roll)[axis]


class GimbalAttitude(msgspec.Struct, frozen=True):
    """Attitude of a gimbal in both frames."""

    frames: Mapping[Axis, FrameOfReference]
    """Frame that each axis holds: RELATIVE moves with the body, ABSOLUTE stays with the horizon or north."""
    relative: Angles
    """To the body."""
    absolute: Angles
    """To the horizon; yaw to magnetic north."""

    def angle(self, axis: Axis, frame: FrameOfReference) -> float:
        """Return the angle of one axis in a frame, deg."""
        return (self.relative if frame == FrameOfReference.RELATIVE else self.absolute).of(axis)


class GimbalState(msgspec.Struct, frozen=True):
    """One gimbal: its attitude, ranges and calibration."""

    model: Model | None = None
    axes: frozenset[Axis] | None = None
    """Axes that turn."""
    attitude: GimbalAttitude | None = None
    relative_bounds: Mapping[Axis, tuple[float, float]] = {}
    absolute_bounds: Mapping[Axis, tuple[float, float]] = {}
    max_speed: Mapping[Axis, Range] = {}
    """deg/s."""
    offsets: Mapping[Axis, Range] = {}
    """Corrections by hand, deg."""
    offsets_open: bool | None = None
    """True while `set_offsets` is accepted."""
    locked: frozenset[Axis] | None = None
    """Axes that do not turn at present."""
    calibration: GimbalCalibrationState | None = None
    calibration_result: GimbalCalibrationResult | None = None
    """Of the last calibration since the connection."""
    errors: frozenset[Error] | None = None
    stabilized: bool | None = None

    def bounds(self, axis: Axis, frame: FrameOfReference) -> tuple[float, float]:
        """Return the range of one axis in a frame, deg; infinite while not reported."""
        known = self.relative_bounds if frame == FrameOfReference.RELATIVE else self.absolute_bounds
        return known.get(axis, (-math.inf, math.inf))

    def is_at_end(self, axis: Axis, direction: float = 0.0) -> bool:
        """True when an axis stands at the end of its range in a direction, + or -; 0: in either.

        The range of yaw is that from the body, whichever frame it holds.
        """
        attitude = self.attitude
        if attitude is None:
            return False
        frame = FrameOfReference.RELATIVE if axis == Axis.YAW else attitude.frames[axis]
        low, high = self.bounds(axis, frame)
        angle = attitude.angle(axis, frame)
        is_high, is_low = angle >= high - ARRIVED_DEG, angle <= low + ARRIVED_DEG
        return (is_high and direction >= 0.0) or (is_low and direction <= 0.0)


UNREPORTED = GimbalState()
"""A gimbal that the drone has not reported."""


def _ranges(message: gimbal.MaxSpeed | gimbal.Offsets) -> dict[Axis, Range]:
    values = {
        Axis.YAW: (message.current_yaw, message.min_bound_yaw, message.max_bound_yaw),
        Axis.PITCH: (message.current_pitch, message.min_bound_pitch, message.max_bound_pitch),
        Axis.ROLL: (message.current_roll, message.min_bound_roll, message.max_bound_roll),
    }
    return {axis: Range(*numbers) for axis, numbers in values.items() if all(map(math.isfinite, numbers))}


def _bounds(message: gimbal.RelativeAttitudeBounds | gimbal.AbsoluteAttitudeBounds) -> dict[Axis, tuple[float, float]]:
    values = {
        Axis.YAW: (message.min_yaw, message.max_yaw),
        Axis.PITCH: (message.min_pitch, message.max_pitch),
        Axis.ROLL: (message.min_roll, message.max_roll),
    }
    return {axis: (low, high) for axis, (low, high) in values.items() if low <= high}


def _attitude(message: gimbal.Attitude) -> GimbalAttitude | None:
    relative = Angles(message.yaw_relative, message.pitch_relative, message.roll_relative)
    absolute = Angles(message.yaw_absolute, message.pitch_absolute, message.roll_absolute)
    # One sum instead of six questions: this comes as often as anything. It is not finite if one of them is not.
    if not math.isfinite(relative.yaw + relative.pitch + relative.roll + absolute.yaw + absolute.pitch + absolute.roll):
        return None
    frames = {
        Axis.YAW: message.yaw_frame_of_reference,
        Axis.PITCH: message.pitch_frame_of_reference,
        Axis.ROLL: message.roll_frame_of_reference,
    }
    return GimbalAttitude(frames, relative, absolute)


def main_frames(values: Values) -> bytes | None:
    """Return the frames of reference that the main gimbal's axes hold, as on the wire.

    None when the values are of another gimbal. Frames are compared thirty times a second, and hardly ever change.
    """
    data = values.data
    number = values.layout.places[gimbal.Attitude].start + HEADER.size
    return data[number + 1 : number + 1 + _FRAMES] if data[number] == MAIN else None


_FRAMES = 3 * 4
"""Bytes of three enums, behind the number of the gimbal."""


class GimbalCalibration:
    """A calibration of a gimbal that the drone has begun."""

    def __init__(self, result: Expectation[bool]) -> None:
        self._result = result
        result.future.add_done_callback(lambda _: result.close())  # perhaps nothing waits for the end

    async def done(self) -> None:
        """Wait for the end; returns when the calibration succeeded.

        Raises `CommandRejected` when it failed, `CommandTimeout`, `LinkLost`.
        """
        await self._result.wait()


Gimbals = Mapping[int, GimbalState]


def _with(state: Gimbals, id: int, **changes: object) -> Gimbals:
    return with_item(state, id, replace(state.get(id, UNREPORTED), **changes), 0)


class Gimbal(Commanding[Gimbals]):
    """All gimbals of the drone.

    `gimbal[id]` is the state of one gimbal; the verbs use the main one by default.
    """

    NOTHING: ClassVar[Gimbals] = {}
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        gimbal.GimbalCapabilities: lambda state, m: _with(
            state, m.gimbal_id, model=m.model, axes=members(m.axes, Axis)
        ),
        gimbal.Attitude: lambda state, m: _with(state, m.gimbal_id, attitude=_attitude(m)),
        gimbal.RelativeAttitudeBounds: lambda state, m: _with(state, m.gimbal_id, relative_bounds=_bounds(m)),
        gimbal.AbsoluteAttitudeBounds: lambda state, m: _with(state, m.gimbal_id, absolute_bounds=_bounds(m)),
        gimbal.MaxSpeed: lambda state, m: _with(state, m.gimbal_id, max_speed=_ranges(m)),
        gimbal.Offsets: lambda state, m: _with(
            state, m.gimbal_id, offsets=_ranges(m), offsets_open=m.update_state == gimbal.State.ACTIVE
        ),
        gimbal.AxisLockState: lambda state, m: _with(state, m.gimbal_id, locked=members(m.locked, Axis)),
        gimbal.CalibrationState: lambda state, m: _with(state, m.gimbal_id, calibration=m.state),
        gimbal.CalibrationResult: lambda state, m: _with(state, m.gimbal_id, calibration_result=m.result),
        gimbal.Alert: lambda state, m: _with(state, m.gimbal_id, errors=members(m.error, Error)),
        gimbal.StabilizationState: lambda state, m: _with(
            state, m.gimbal_id, stabilized=m.state == gimbal.State.ACTIVE
        ),
    }

    def __getitem__(self, id: int) -> GimbalState:
        """The state of this gimbal, an empty one when the drone has not reported it."""
        return self.state.get(id, UNREPORTED)

    @property
    def main(self) -> GimbalState:
        """State of the gimbal that carries the cameras."""
        return self[MAIN]

    # -- where to look

    def aim(self, *, yaw: Aim | None = None, pitch: Aim | None = None, roll: Aim | None = None, id: int = MAIN) -> None:
        """Send angles (deg) once, without waiting: for targets that arrive in a stream.

        None leaves an axis alone.

        Angles beyond the bounds are clipped to them. Raises `NotSupported` for an axis that this gimbal does not
        have.
        """
        targets = self._targets({Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}, id)
        self._order(id, self._command(targets, ControlMode.POSITION, id))

    def turn(
        self, *, yaw: Aim | None = None, pitch: Aim | None = None, roll: Aim | None = None, id: int = MAIN
    ) -> None:
        """Turn with these rates, deg/s, sent once.

        The drone holds them until the next target or the end of the range. Rates beyond the speed setting are clipped
        to it. Zero stops an axis, but the message can be lost: `stop` makes sure.
        """
        rates = {Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}
        shares = {axis: self._share(axis, aim, id) for axis, aim in rates.items() if aim is not None}
        self._order(id, self._command(shares, ControlMode.VELOCITY, id))

    async def point(
        self,
        *,
        yaw: Aim | None = None,
        pitch: Aim | None = None,
        roll: Aim | None = None,
        id: int = MAIN,
        timeout: float | None = None,
    ) -> GimbalAttitude:
        """Point the gimbal at angles (deg); return its attitude once they are reached.

        Without a `timeout` it has the time that the turn takes. Raises `CommandRejected` when a newer target replaces
        this one.
        """
        targets = self._targets({Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}, id)
        if timeout is None:
            timeout = ANSWER_TIMEOUT + self._way(targets, id)

        def judge(message: gimbal.Attitude) -> GimbalAttitude | None:
            attitude = _attitude(message) if message.gimbal_id == id else None
            if attitude is None:
                return None
            there = all(
                abs(_turn(attitude.angle(axis, aim.frame), aim.value)) <= ARRIVED_DEG for axis, aim in targets.items()
            )
            return attitude if there else None

        answer = self._commander.expect((gimbal.Attitude,), judge)
        return await self._insist(id, self._command(targets, ControlMode.POSITION, id), answer, timeout)

    async def steer(
        self,
        *,
        yaw: Aim | None = None,
        pitch: Aim | None = None,
        roll: Aim | None = None,
        id: int = MAIN,
        timeout: float = ANSWER_TIMEOUT,
    ) -> GimbalAttitude:
        """Point the gimbal at angles (deg); return once it turns towards them, or is there.

        For operators, who do not wait for the end of a turn. The drone turns on by itself. Raises `CommandRejected`
        when a newer target replaces this one.
        """
        targets = self._targets({Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}, id)
        return await self._begin(targets, ControlMode.POSITION, id, timeout)

    async def sweep(
        self,
        *,
        yaw: Aim | None = None,
        pitch: Aim | None = None,
        roll: Aim | None = None,
        id: int = MAIN,
        timeout: float = ANSWER_TIMEOUT,
    ) -> GimbalAttitude:
        """Turn with these rates (deg/s); return once the gimbal turns, or cannot turn further.

        The drone turns on until the next target, see `turn`.
        """
        rates = {Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}
        shares = {axis: self._share(axis, aim, id) for axis, aim in rates.items() if aim is not None}
        return await self._begin(shares, ControlMode.VELOCITY, id, timeout)

    async def _begin(self, targets: Mapping[Axis, Aim], mode: ControlMode, id: int, timeout: float) -> GimbalAttitude:
        state = self[id]
        for axis in targets:
            if axis in (state.locked or ()):
                raise CommandRejected(f"gimbal axis {axis.name.lower()} is locked")
        judge = _Turning(id, targets, state, is_rate=mode == ControlMode.VELOCITY)
        answer = self._commander.expect((gimbal.Attitude,), judge)
        return await self._insist(id, self._command(targets, mode, id), answer, timeout)

    def halt(self, id: int = MAIN) -> None:
        """Send a stop of all axes once, without waiting."""
        self._order(id, self._stop_command(id))

    async def stop(self, id: int = MAIN, timeout: float = ANSWER_TIMEOUT) -> GimbalAttitude:
        """Stop all axes; return the attitude once the gimbal stands."""
        command = self._stop_command(id)
        answer = self._commander.expect((gimbal.Attitude,), _Standing(id, self._axes(id)))
        return await self._insist(id, command, answer, timeout)

    def _stop_command(self, id: int) -> gimbal.SetTarget:
        axes = self._axes(id)
        attitude = self[id].attitude
        frames = {} if attitude is None else attitude.frames
        still = {axis: Aim(0.0, frames.get(axis, FrameOfReference.RELATIVE)) for axis in axes}
        return self._command(still, ControlMode.VELOCITY, id)

    async def reset_orientation(self, id: int = MAIN, timeout: float = 2 * ANSWER_TIMEOUT) -> GimbalAttitude:
        """Turn to the drone's reference orientation; return the attitude once the gimbal rests."""
        standing = _Standing(id, self._axes(id))
        self._orders[id] += 1
        return await self._commander.confirm(gimbal.ResetOrientation(id), (gimbal.Attitude,), standing, timeout)

    # -- settings

    async def set_max_speed(self, degrees_per_second: float, id: int = MAIN) -> Mapping[Axis, Range]:
        """Set the highest rate, deg/s, one for all axes; return the setting of each axis.

        gimbal.xml 148-0-4.
        """
        if not is_finite(degrees_per_second):
            raise LocalProtocolError("a speed is not a number")
        self._commander.require_feature(self[id].max_speed, gimbal.SetMaxSpeed.NAME)
        return await self._change(
            gimbal.SetMaxSpeed(id, degrees_per_second, degrees_per_second, degrees_per_second),
            gimbal.MaxSpeed,
            lambda message: self[id].max_speed if message.gimbal_id == id else None,
            lambda speeds: all(is_limited(speed, degrees_per_second) for speed in speeds.values()),
        )

    async def open_offsets(self, on: bool, id: int = MAIN) -> bool:
        """Begin or end the correction by offsets; while it is open the gimbal keeps to them."""
        self._commander.require_feature(self[id].offsets_open, gimbal.StartOffsetsUpdate.NAME)
        return await self._change(
            gimbal.StartOffsetsUpdate(id) if on else gimbal.StopOffsetsUpdate(id),
            gimbal.Offsets,
            lambda message: message.update_state == gimbal.State.ACTIVE if message.gimbal_id == id else None,
            same_as(on),
        )

    async def set_offsets(
        self, *, yaw: float | None = None, pitch: float | None = None, roll: float | None = None, id: int = MAIN
    ) -> Mapping[Axis, Range]:
        """Set the offsets, deg, while they are open; None keeps one. Return those of the drone."""
        self._commander.require_feature(self[id].offsets, gimbal.SetOffsets.NAME)
        wishes = {Axis.YAW: yaw, Axis.PITCH: pitch, Axis.ROLL: roll}
        wanted = {axis: value for axis, value in wishes.items() if value is not None}
        if not is_finite(*wanted.values()):
            raise LocalProtocolError("an offset is not a number")

        def command() -> Message:
            offsets = {axis: setting.current for axis, setting in self[id].offsets.items()} | wanted
            return gimbal.SetOffsets(id, *(offsets.get(axis, 0.0) for axis in wishes))

        return await self._change(
            command,
            gimbal.Offsets,
            lambda message: self[id].offsets if message.gimbal_id == id else None,
            lambda offsets: all(is_limited(offset, wanted[axis]) for axis, offset in offsets.items() if axis in wanted),
        )

    # -- calibration

    async def calibrate(self, id: int = MAIN, timeout: float = CALIBRATION_TIMEOUT) -> None:
        """Calibrate the gimbal; returns when that succeeded.

        Raises `CommandRejected` when it failed.
        """
        calibration = await self.start_calibration(id, timeout)
        await calibration.done()

    async def start_calibration(self, id: int = MAIN, timeout: float = CALIBRATION_TIMEOUT) -> GimbalCalibration:
        """Begin to calibrate the gimbal; returns when the drone does so.

        Raises `CommandRejected` when it has failed at once. `timeout`: of the whole calibration, s.
        """
        require_number(timeout)
        self._commander.require_feature(self[id].calibration, gimbal.Calibrate.NAME)

        def begins(message: gimbal.CalibrationResult | gimbal.CalibrationState) -> bool | None:
            if message.gimbal_id != id:
                return None
            if isinstance(message, gimbal.CalibrationState) and message.state != GimbalCalibrationState.IN_PROGRESS:
                return None
            return True

        def judge(message: gimbal.CalibrationResult) -> bool | AnafiMavError | None:
            if message.gimbal_id != id:
                return None
            if message.result == GimbalCalibrationResult.SUCCESS:
                return True
            return CommandRejected(f"gimbal calibration: {message.result.name.lower()}")

        result = self._commander.expect((gimbal.CalibrationResult,), judge)
        calibration = GimbalCalibration(result)
        try:
            await self._commander.confirm(
                gimbal.Calibrate(id), (gimbal.CalibrationResult, gimbal.CalibrationState), begins
            )
            if result.future.done():
                await calibration.done()
            else:
                result.expire_after(timeout, gimbal.Calibrate.NAME)
        except BaseException:
            result.close()
            raise
        return calibration

    async def cancel_calibration(self, id: int = MAIN) -> None:
        """Cancel the calibration; returns when none is running."""
        self._commander.require_feature(self[id].calibration, gimbal.CancelCalibration.NAME)
        await self._change(
            gimbal.CancelCalibration(id),
            gimbal.CalibrationState,
            lambda message: (
                True if message.gimbal_id == id and message.state != GimbalCalibrationState.IN_PROGRESS else None
            ),
            stops=True,
        )

    # -- inside

    def _axes(self, id: int) -> frozenset[Axis]:
        axes = self[id].axes
        self._commander.require_feature(axes, f"gimbal {id}")
        return axes or frozenset()

    def _targets(self, wanted: Mapping[Axis, Aim | None], id: int) -> dict[Axis, Aim]:
        axes = self._axes(id)
        targets = {}
        for axis, aim in wanted.items():
            if aim is None:
                continue
            if axis not in axes:
                raise NotSupported(f"gimbal axis {axis.name.lower()}")
            if not is_finite(aim.value) or aim.frame == FrameOfReference.NONE:
                raise LocalProtocolError("no target for the gimbal")
            targets[axis] = Aim(clip(aim.value, *self[id].bounds(axis, aim.frame)), aim.frame)
        return targets

    def _share(self, axis: Axis, aim: Aim, id: int) -> Aim:
        if axis not in self._axes(id):
            raise NotSupported(f"gimbal axis {axis.name.lower()}")
        if not is_finite(aim.value) or aim.frame == FrameOfReference.NONE:
            raise LocalProtocolError("no rate for the gimbal")
        speed = self[id].max_speed.get(axis)
        if speed is None:
            raise NotSupported("reported gimbal speed")
        # A speed setting of zero is an axis that may not turn at all.
        return Aim(clip(aim.value / speed.current, -1.0, 1.0) if speed.current > 0.0 else 0.0, aim.frame)

    def _way(self, targets: Mapping[Axis, Aim], id: int) -> float:
        """s that the gimbal needs to get there at its speed setting."""
        state = self[id]
        if state.attitude is None:
            return 0.0
        seconds = 0.0
        for axis, aim in targets.items():
            speed = state.max_speed.get(axis)
            if speed is not None and speed.current > 0.0:
                seconds = max(seconds, abs(aim.value - state.attitude.angle(axis, aim.frame)) / speed.current)
        return seconds

    @staticmethod
    def _command(targets: Mapping[Axis, Aim], mode: ControlMode, id: int) -> gimbal.SetTarget:
        idle = Aim(0.0, FrameOfReference.NONE)
        yaw, pitch, roll = (targets.get(axis, idle) for axis in (Axis.YAW, Axis.PITCH, Axis.ROLL))
        return gimbal.SetTarget(id, mode, yaw.frame, yaw.value, pitch.frame, pitch.value, roll.frame, roll.value)


class _Turning:
    """A judge: the attitude at which every axis turns as commanded, or has no further to turn.

    The first attitude may be older than the command, so that the movement is measured from the last one before it.
    """

    def __init__(
        self,
        id: int,
        targets: Mapping[Axis, Aim],
        state: GimbalState,
        *,
        is_rate: bool,
    ) -> None:
        self._id = id
        self._targets = targets
        self._state = state
        self._is_rate = is_rate
        self._start = state.attitude

    def __call__(self, message: gimbal.Attitude) -> GimbalAttitude | None:
        attitude = _attitude(message) if message.gimbal_id == self._id else None
        if attitude is None:
            return None
        if self._start is None:
            self._start = attitude
            return None
        turned = all(self._turned(axis, aim, self._start, attitude) for axis, aim in self._targets.items())
        return attitude if turned else None

    def _turned(self, axis: Axis, aim: Aim, start: GimbalAttitude, now: GimbalAttitude) -> bool:
        before, after = start.angle(axis, aim.frame), now.angle(axis, aim.frame)
        way = aim.value if self._is_rate else _turn(after, aim.value)
        if abs(way) <= (INVISIBLE_SHARE if self._is_rate else ARRIVED_DEG):
            return True
        if replace(self._state, attitude=now).is_at_end(axis, way):
            return True
        if self._is_rate:
            return _turn(before, after) * way > 0.0 and abs(_turn(before, after)) > STILL_DEG
        return abs(_turn(before, aim.value)) - abs(way) > STILL_DEG


class _Standing:
    """A judge: the attitude at which the gimbal has come to rest.

    It is in the frame that each axis holds. An axis that the gimbal does not have turns with the drone.
    """

    def __init__(self, id: int, axes: frozenset[Axis]) -> None:
        self._id = id
        self._axes = axes
        self._last: GimbalAttitude | None = None
        self._seen = 0

    def __call__(self, message: gimbal.Attitude) -> GimbalAttitude | None:
        attitude = _attitude(message) if message.gimbal_id == self._id else None
        if attitude is None:
            return None
        last, self._last = self._last, attitude
        self._seen += 1
        if last is None or self._seen < SETTLING:
            return None
        is_still = all(
            abs(_turn(last.angle(axis, attitude.frames[axis]), attitude.angle(axis, attitude.frames[axis])))
            <= STILL_DEG
            for axis in self._axes
        )
        return attitude if is_still else None


def _turn(start: float, end: float) -> float:
    """The shorter way from one angle to another, deg."""
    return (end - start + 180.0) % 360.0 - 180.0
