"""Element alerts: what the drone warns about, and what it says keeps it on the ground."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages import alarms, ardrone3
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import AlertState, ForcedLandingReason, MotorError, WarningLevel
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.arsdk.messages.common import Sensor
from anafi_mav.drone.element import Element, Reducer, with_item
from anafi_mav.drone.status.battery import BatteryState
from anafi_mav.drone.status.calibration import CalibrationState


class AlertsState(msgspec.Struct, frozen=True):
    """Warnings of the drone, and its own list of what prevents a take-off."""

    alert: AlertState | None = None
    """The one alert of older firmware."""
    alarms: Mapping[alarms.Type, bool] = {}
    """Alarm -> is raised."""
    checklist: Mapping[TakeoffChecklistType, bool] = {}
    """Check -> keeps the drone on the ground."""
    forced_landing: ForcedLandingReason | None = None
    """Why the drone is about to land by itself; NONE when it is not."""
    forced_landing_delay_s: int | None = None
    """Seconds until it does, 0 = now; None while `forced_landing` is NONE."""
    motor_error: MotorError | None = None
    motors: int | None = None
    """The motors `motor_error` is about: bit n is motor n."""
    too_dark_to_hover: bool | None = None
    """No GPS, and too dark for the vertical camera to hold the position."""
    too_high_to_hover: bool | None = None
    """No GPS, and too high for the vertical camera to hold the position."""
    wind: WarningLevel | None = None
    vibration: WarningLevel | None = None
    icing: WarningLevel | None = None


def _forced_landing(state: AlertsState, message: ardrone3.ForcedLandingAutoTrigger) -> AlertsState:
    planned = message.reason != ForcedLandingReason.NONE
    return replace(state, forced_landing=message.reason, forced_landing_delay_s=message.delay if planned else None)


class Alerts(Element[AlertsState]):
    """Warnings that the drone reports.

    No verbs: `Drone.blockers` sums up what prevents a take-off.
    """

    NOTHING = AlertsState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.AlertStateChanged: lambda state, message: replace(state, alert=message.state),
        alarms.Alarms: lambda state, message: replace(
            state, alarms=with_item(state.alarms, message.type, message.state != 0, message.list_flags)
        ),
        alarms.TakeoffChecklist: lambda state, message: replace(
            state, checklist=with_item(state.checklist, message.check, message.state != 0, message.list_flags)
        ),
        ardrone3.ForcedLandingAutoTrigger: _forced_landing,
        ardrone3.MotorErrorStateChanged: lambda state, message: replace(
            state, motor_error=message.motorError, motors=message.motorIds
        ),
        ardrone3.HoveringWarning: lambda state, message: replace(
            state,
            too_dark_to_hover=message.no_gps_too_dark != 0,
            too_high_to_hover=message.no_gps_too_high != 0,
        ),
        ardrone3.WindStateChanged: lambda state, message: replace(state, wind=message.state),
        ardrone3.VibrationLevelChanged: lambda state, message: replace(state, vibration=message.state),
        ardrone3.IcingLevelChanged: lambda state, message: replace(state, icing=message.state),
    }


def spoken(value: OpenEnum) -> str:
    """Parrot's name of a value as words: MOTOR_RAMPING -> "motor ramping"."""
    return value.name.lower().replace("_", " ")


_FLIES_WITHOUT = (Sensor.GPS,)
"""Sensors that a drone takes off without."""


_HARMLESS = (None, AlertState.NONE, AlertState.USER, AlertState.LOW_BATTERY)
"""Alerts with which a drone takes off. USER is a past emergency stop; the flying state EMERGENCY reports it better. A
firmware that kept it would stay on the ground until it is switched off."""


class BlockerKind(enum.Enum):
    """Kind of a reason that prevents a take-off; the value is the beginning of its text."""

    CHECK = ""
    """A line of the take-off checklist."""
    MAGNETOMETER = "magnetometer calibration required"
    CALIBRATING = "the magnetometer is being calibrated"
    SENSOR = "sensor "
    BATTERY = "battery "
    ALERT = "alert "
    MOTOR = "motor "


class Blocker(NamedTuple):
    """One reported reason that can prevent a take-off; `str` gives it in words."""

    kind: BlockerKind
    value: OpenEnum | None = None
    """Which check, sensor, alert or error."""

    def __str__(self) -> str:
        if self.kind is BlockerKind.BATTERY and self.value == BatteryAlert.POWER_LEVEL:
            return "battery critical"
        return self.kind.value + ("" if self.value is None else spoken(self.value))

    @property
    def is_charge(self) -> bool:
        """True when the reason is a low charge, which a drone reports in three ways at once."""
        return (self.kind, self.value) in _CHARGE


_CHARGE: tuple[tuple[BlockerKind, OpenEnum], ...] = (
    (BlockerKind.CHECK, TakeoffChecklistType.BATTERY_CRITICAL),
    (BlockerKind.BATTERY, BatteryAlert.POWER_LEVEL),
    (BlockerKind.ALERT, AlertState.CRITICAL_BATTERY),
    (BlockerKind.ALERT, AlertState.ALMOST_EMPTY_BATTERY),
)


def takeoff_blockers(alerts: AlertsState, battery: BatteryState, calibration: CalibrationState) -> list[Blocker]:
    """Return the reported reasons that can prevent a take-off; empty when nothing is known.

    ARSDK refuses a take-off without an answer. The take-off checklist (alarms.xml 175-0-2) is the drone's own list of
    reasons and decides alone about alerts and sensors, whose last report may be old; firmware without it leaves the
    alert, the calibration and the sensors. A critical battery counts in any case.
    """
    reasons = [Blocker(BlockerKind.CHECK, check) for check, blocks in alerts.checklist.items() if blocks]
    if TakeoffChecklistType.MAGNETO_CALIBRATION not in alerts.checklist and calibration.magneto_required:
        reasons.append(Blocker(BlockerKind.MAGNETOMETER))
    if calibration.started:
        reasons.append(Blocker(BlockerKind.CALIBRATING))
    if not alerts.checklist:
        failed = [sensor for sensor, ok in calibration.sensors.items() if not ok and sensor not in _FLIES_WITHOUT]
        reasons += [Blocker(BlockerKind.SENSOR, sensor) for sensor in failed]
    critical = [alert for alert, level in battery.alerts.items() if level == AlertLevel.CRITICAL]
    reasons += [Blocker(BlockerKind.BATTERY, alert) for alert in critical]
    if not alerts.checklist:
        if alerts.alert not in _HARMLESS:
            reasons.append(Blocker(BlockerKind.ALERT, alerts.alert))
        if BatteryAlert.POWER_LEVEL not in battery.alerts and battery.charge_level == AlertLevel.CRITICAL:
            reasons.append(Blocker(BlockerKind.BATTERY, BatteryAlert.POWER_LEVEL))
    if alerts.motor_error not in (None, MotorError.NO_ERROR):
        reasons.append(Blocker(BlockerKind.MOTOR, alerts.motor_error))
    charge = [reason for reason in reasons if reason.is_charge]
    return [reason for reason in reasons if reason not in charge[1:]]
