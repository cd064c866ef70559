"""Calibration of the magnetometer: one axis after the other, as if turned by hand."""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages.common import CalibrationAxis

AXIS_TIME = 2.0
"""s that each axis takes."""

_ORDER = (CalibrationAxis.X_AXIS, CalibrationAxis.Y_AXIS, CalibrationAxis.Z_AXIS)


class Compass:
    """The magnetometer. Take-off and returns need it calibrated."""

    def __init__(self) -> None:
        self.required = False
        self._done = 3
        """Axes that are calibrated; below three one is under way when `_running`."""
        self._running = False
        self._next = 0.0

    def require(self, required: bool) -> list[Message]:
        """Set whether a calibration is required, as a magnet beside the drone would do."""
        if self.required is required:
            return []
        self.required = required
        return [self._required()]

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for any other message."""
        if not isinstance(message, common.MagnetoCalibration):
            return None
        self._running = bool(message.calibrate)
        self._done = 0 if self._running else 3
        self._next = time + AXIS_TIME
        return [self._started(), self._axis(), self._axes()]

    def tick(self, time: float) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        if not self._running or time < self._next:
            return []
        self._next = time + AXIS_TIME
        self._done += 1
        messages = [self._axes(), self._axis()]
        if self._done == len(_ORDER):
            self._running = self.required = False
            messages += [self._required(), self._started()]
        return messages

    def _axis(self) -> Message:
        running = self._running and self._done < len(_ORDER)
        return common.MagnetoCalibrationAxisToCalibrateChanged(_ORDER[self._done] if running else CalibrationAxis.NONE)

    def _axes(self) -> Message:
        x, y, z = (int(self._done > index and not (self.required and not self._running)) for index in range(3))
        return common.MagnetoCalibrationStateChanged(x, y, z, 0)

    def _required(self) -> Message:
        return common.MagnetoCalibrationRequiredState(int(self.required))

    def _started(self) -> Message:
        return common.MagnetoCalibrationStartedChanged(int(self._running))

    def states_report(self) -> list[Message]:
        """Return the magnetometer messages of the AllStates answer."""
        return [self._axes(), self._required(), self._axis(), self._started()]
