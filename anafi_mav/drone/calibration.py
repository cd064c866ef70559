"""Element calibration: the magnetometer's calibration and the health of the sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages.common import CalibrationAxis, Sensor
from anafi_mav.arsdk.wire import Message
from anafi_mav.drone.element import Element, Reducer, with_item

_REQUIRED, _RECOMMENDED = 1, 2


class CalibrationState(msgspec.Struct, frozen=True):
    magneto_required: bool | None = None
    """The drone does not take off before its magnetometer is calibrated."""
    magneto_recommended: bool | None = None
    started: bool | None = None
    """A calibration is running."""
    failed: bool | None = None
    """The last calibration failed."""
    axis: CalibrationAxis | None = None
    """The axis to turn the drone about now."""
    sensors: Mapping[Sensor, bool] = {}
    """Sensor -> works."""

    @property
    def sensors_ok(self) -> bool | None:
        """Do all reported sensors work? None when the drone reported none."""
        return all(self.sensors.values()) if self.sensors else None


class Calibration(Element[CalibrationState]):
    NOTHING = CalibrationState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.MagnetoCalibrationRequiredState: lambda state, message: replace(
            state,
            magneto_required=message.required == _REQUIRED,
            magneto_recommended=message.required == _RECOMMENDED,
        ),
        common.MagnetoCalibrationStartedChanged: lambda state, message: replace(state, started=message.started != 0),
        common.MagnetoCalibrationStateChanged: lambda state, message: replace(
            state, failed=message.calibrationFailed != 0
        ),
        common.MagnetoCalibrationAxisToCalibrateChanged: lambda state, message: replace(state, axis=message.axis),
        common.SensorsStatesListChanged: lambda state, message: replace(
            state, sensors=with_item(state.sensors, message.sensorName, message.sensorState != 0, 0)
        ),
    }
