"""Alarms and the take-off checklist (feature alarms). A refused take-off says nothing but which check refused it."""

from __future__ import annotations

from collections.abc import Collection

from anafi_mav.arsdk.messages import alarms
from anafi_mav.arsdk.messages.alarms import State, TakeoffChecklistType, Type
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.wire import Message

ALARMS = (
    Type.USER_EMERGENCY,
    Type.MOTOR_CUTOUT,
    Type.DRONE_INCLINATION_TOO_HIGH,
    Type.MAGNETO_PERTURBATION,
    Type.MAGNETO_LOW_EARTH_FIELD,
    Type.HORIZONTAL_GEOFENCE_REACHED,
    Type.VERTICAL_GEOFENCE_REACHED,
)
"""What a 4K reports."""

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
        self._on: set[Type] = set()

    def set(self, type: Type, on: bool) -> list[Message]:
        """The event of a change; nothing when it was so before."""
        if on == (type in self._on):
            return []
        (self._on.add if on else self._on.discard)(type)
        return [alarms.Alarms(type, _state(on), 0)]

    def report(self) -> list[Message]:
        return [
            alarms.Alarms(type, _state(type in self._on), _flags(index, len(ALARMS)))
            for index, type in enumerate(ALARMS)
        ]


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
