"""Element calibration: the magnetometer's calibration and the health of the sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages.common import CalibrationAxis, Sensor
from anafi_mav.drone.element import Reducer, with_item
from anafi_mav.drone.expectation import ANSWER_TIMEOUT
from anafi_mav.drone.settings import ANSWERED_WITHIN, Commanding
from anafi_mav.errors import AnafiMavError, CommandRejected

_REQUIRED, _RECOMMENDED = 1, 2

TURNING_TIMEOUT = 60.0
"""s between two reports of a calibration.

Meanwhile the user turns the drone by hand about one axis after the other.
"""


_AXES = (CalibrationAxis.X_AXIS, CalibrationAxis.Y_AXIS, CalibrationAxis.Z_AXIS)


class CalibrationState(msgspec.Struct, frozen=True):
    """Calibration of the magnetometer and health of the sensors."""

    magneto_required: bool | None = None
    """The drone does not take off before its magnetometer is calibrated."""
    magneto_recommended: bool | None = None
    started: bool | None = None
    """A calibration is running."""
    failed: bool | None = None
    """The last calibration failed."""
    axis: CalibrationAxis | None = None
    """The axis to turn the drone about now."""
    done: frozenset[CalibrationAxis] | None = None
    """The axes that are calibrated."""
    turned: frozenset[CalibrationAxis] | None = None
    """The axes that were reported as calibrated while the last calibration ran; None: it has reported none."""
    sensors: Mapping[Sensor, bool] = {}
    """Sensor -> works."""

    @property
    def is_magnetometer_done(self) -> bool:
        """True when the last calibration has ended and nothing shows that it failed or was aborted.

        An aborted one may leave the axes of the calibration before, so that all but the last are to be reported before
        the end.
        """
        has_axes = self.done is None or self.done == frozenset(_AXES)
        has_turned = self.turned is None or len(self.turned) >= len(_AXES) - 1
        return not (self.started or self.failed or self.magneto_required) and has_axes and has_turned

    @property
    def sensors_ok(self) -> bool | None:
        """True when all reported sensors work; None when the drone reported none."""
        return all(self.sensors.values()) if self.sensors else None


def _started(state: CalibrationState, message: common.MagnetoCalibrationStartedChanged) -> CalibrationState:
    begins = message.started != 0 and not state.started
    return replace(state, started=message.started != 0, turned=None if begins else state.turned)


def _axes(state: CalibrationState, message: common.MagnetoCalibrationStateChanged) -> CalibrationState:
    flags = (message.xAxisCalibration, message.yAxisCalibration, message.zAxisCalibration)
    done = frozenset(axis for axis, flag in zip(_AXES, flags, strict=True) if flag)
    turned = done if state.started else state.turned
    return replace(state, failed=message.calibrationFailed != 0, done=done, turned=turned)


class Calibration(Commanding[CalibrationState]):
    """Calibration of the magnetometer, which a person does by turning the drone."""

    NOTHING = CalibrationState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.MagnetoCalibrationRequiredState: lambda state, message: replace(
            state,
            magneto_required=message.required == _REQUIRED,
            magneto_recommended=message.required == _RECOMMENDED,
        ),
        common.MagnetoCalibrationStartedChanged: _started,
        common.MagnetoCalibrationStateChanged: _axes,
        common.MagnetoCalibrationAxisToCalibrateChanged: lambda state, message: replace(state, axis=message.axis),
        common.SensorsStatesListChanged: lambda state, message: replace(
            state, sensors=with_item(state.sensors, message.sensorName, message.sensorState != 0, 0)
        ),
    }

    async def start_magnetometer(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Begin to calibrate the magnetometer.

        Returns when the drone waits to be turned about `state.axis`.
        """
        self._commander.require_feature(self.state.started, "magnetometer calibration")
        await self._change(
            common.MagnetoCalibration(1),
            common.MagnetoCalibrationStartedChanged,
            lambda message: True if message.started else None,
            timeout=timeout,
        )

    async def abort_magnetometer(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Abort the calibration; returns when none is running."""
        self._commander.require_feature(self.state.started, "magnetometer calibration")
        await self._change(
            common.MagnetoCalibration(0),
            common.MagnetoCalibrationStartedChanged,
            lambda message: None if message.started else True,
            timeout=timeout,
            stops=True,
        )

    async def magnetometer_done(self, timeout: float = TURNING_TIMEOUT) -> None:
        """Wait for the end of a running calibration, at once when none runs.

        Raises `CommandRejected` when it failed or was aborted, `CommandTimeout` after so long without progress. The
        drone reports its end alike in each case, and the last axis before or after that: an end without all axes is a
        success only if they are not reported at all, and the drone requires no calibration `ANSWERED_WITHIN` later.
        """
        self._commander.require_feature(self.state.started, "magnetometer calibration")
        failure = CommandRejected("failed or aborted")

        def judge(message: Any) -> bool | AnafiMavError | None:
            if isinstance(message, common.MagnetoCalibrationStateChanged) and message.calibrationFailed:
                return failure
            if self.state.started:
                answer.expire_after(timeout, common.MagnetoCalibration.NAME)
                return None
            if self.state.is_magnetometer_done and self.state.done is not None:
                return True
            answer.future.get_loop().call_later(ANSWERED_WITHIN, settle)
            return None

        def settle() -> None:
            if self.state.is_magnetometer_done:
                answer.succeed(True)
            elif not self.state.started:
                answer.fail(failure)

        if not self.state.started:
            if not self.state.is_magnetometer_done:
                raise failure
            return
        answer = self._commander.expect(
            (
                common.MagnetoCalibrationStartedChanged,
                common.MagnetoCalibrationStateChanged,
                common.MagnetoCalibrationAxisToCalibrateChanged,
                common.MagnetoCalibrationRequiredState,
            ),
            judge,
        )
        answer.expire_after(timeout, common.MagnetoCalibration.NAME)
        await answer.wait()
