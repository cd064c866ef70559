"""Alarms, warnings and the take-off checklist.

A refused take-off says nothing but which check refused it.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import alarms, ardrone3
from anafi_mav.arsdk.messages.alarms import State, TakeoffChecklistType, Type
from anafi_mav.arsdk.messages.ardrone3 import LastMotorError, Motion, MotorError, WarningLevel
from anafi_mav.arsdk.messages.generic import ListFlags

ALARMS = (
    Type.USER_EMERGENCY,
    Type.MOTOR_CUTOUT,
    Type.DRONE_INCLINATION_TOO_HIGH,
    Type.MAGNETO_PERTURBATION,
    Type.MAGNETO_LOW_EARTH_FIELD,
    Type.HORIZONTAL_GEOFENCE_REACHED,
    Type.VERTICAL_GEOFENCE_REACHED,
)
"""Alarms that a 4K reports."""

CHECKS = (
    TakeoffChecklistType.UPDATE_ONGOING,
    TakeoffChecklistType.GYRO,
    TakeoffChecklistType.MAGNETO,
    TakeoffChecklistType.BARO,
    TakeoffChecklistType.GPS,
    TakeoffChecklistType.ULTRASOUND,
    TakeoffChecklistType.VCAM,
    TakeoffChecklistType.DRONE_INCLINATION_TOO_HIGH,
    TakeoffChecklistType.BATTERY_CRITICAL,
    TakeoffChecklistType.BATTERY_IS_TOO_HOT,
    TakeoffChecklistType.BATTERY_IS_TOO_COLD,
    TakeoffChecklistType.MAGNETO_CALIBRATION,
    TakeoffChecklistType.MOTOR_DOWN,
)


class Alarms:
    """Which alarms sound."""

    def __init__(self) -> None:
        self._on = 0
        """Bits by type."""

    def set(self, type: Type, on: bool) -> list[Message]:
        """The event of a change; nothing when it was so before."""
        if on == bool(self._on >> type & 1):
            return []
        self._on ^= 1 << type
        return [alarms.Alarms(type, _state(on), 0)]

    def report(self) -> list[Message]:
        return [
            alarms.Alarms(type, _state(bool(self._on >> type & 1)), _flags(index, len(ALARMS)))
            for index, type in enumerate(ALARMS)
        ]


CARRIED = 0.02
"""m that a landed drone must have moved to count as carried."""

STEADY_AFTER = 1.0
"""s without such a move."""


class Warnings:
    """Warnings about wind, vibration and motors, and the motion state of a carried drone."""

    def __init__(self) -> None:
        self.wind = WarningLevel.OK
        self.vibration = WarningLevel.OK
        self.motion = Motion.STEADY
        self.motor_error = MotorError.NO_ERROR
        self.motors = 0
        self.last_motor_error = LastMotorError.NO_ERROR
        self._place = (0.0, 0.0)
        self._moved_at = float("-inf")

    def set_wind(self, level: WarningLevel) -> list[Message]:
        if level is self.wind:
            return []
        self.wind = level
        return [ardrone3.WindStateChanged(level)]

    def set_vibration(self, level: WarningLevel) -> list[Message]:
        if level is self.vibration:
            return []
        self.vibration = level
        return [ardrone3.VibrationLevelChanged(level)]

    def set_motors(self, error: MotorError, motors: int) -> list[Message]:
        """Bit 0 of `motors` is the front left one (ardrone3.xml MotorErrorStateChanged)."""
        if error is MotorError.NO_ERROR:
            motors = 0
        if (error, motors) == (self.motor_error, self.motors):
            return []
        is_new = error is not self.motor_error
        self.motor_error, self.motors = error, motors
        messages: list[Message] = [ardrone3.MotorErrorStateChanged(motors, error)]
        if is_new and error is not MotorError.NO_ERROR:
            self.last_motor_error = _LAST.get(error.name, LastMotorError.NO_ERROR)
            messages.append(ardrone3.MotorErrorLastErrorChanged(self.last_motor_error))
        return messages

    def carried(self, place: tuple[float, float], time: float, landed: bool) -> list[Message]:
        """Update the motion state from the position of a landed drone.

        In the air the motion state has no meaning and does not change (ardrone3.xml MotionState).
        """
        if not landed:
            self._place = place
            return []
        if math.dist(place, self._place) > CARRIED:
            self._place, self._moved_at = place, time
        motion = Motion.MOVING if time - self._moved_at < STEADY_AFTER else Motion.STEADY
        if motion is self.motion:
            return []
        self.motion = motion
        return [ardrone3.MotionState(motion)]

    def settings_report(self) -> list[Message]:
        """Return the motor messages of the AllSettings answer."""
        return [
            ardrone3.MotorErrorStateChanged(self.motors, self.motor_error),
            ardrone3.MotorErrorLastErrorChanged(self.last_motor_error),
        ]

    def states_report(self) -> list[Message]:
        """Return the other messages, of the AllStates answer."""
        return [
            ardrone3.MotionState(self.motion),
            ardrone3.WindStateChanged(self.wind),
            ardrone3.VibrationLevelChanged(self.vibration),
        ]


_LAST = {error.name: error for error in LastMotorError}
"""Parrot numbers the same errors twice, differently; the names are the same."""


def checklist(blockers: Collection[TakeoffChecklistType]) -> list[Message]:
    """The whole list, with `blockers` as what prevents a take-off."""
    return [
        alarms.TakeoffChecklist(check, _state(check in blockers), _flags(index, len(CHECKS)))
        for index, check in enumerate(CHECKS)
    ]


def check_changed(check: TakeoffChecklistType, blocks: bool) -> Message:
    """One line of the list."""
    return alarms.TakeoffChecklist(check, _state(blocks), 0)


def _state(on: bool) -> State:
    return State.ON if on else State.OFF


def _flags(index: int, count: int) -> int:
    return (index == 0) << ListFlags.FIRST | (index == count - 1) << ListFlags.LAST
