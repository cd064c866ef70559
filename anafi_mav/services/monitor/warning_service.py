"""Warnings of drone and Skycontroller as texts, sent when a warning begins or changes.

They are not repeated. Parrot's three levels become severities: WARNING is a warning, CRITICAL is critical; an action
that the drone is about to take by itself, and that cannot be prevented, is an alert, motors that were cut in the air
are an emergency.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.events import (
    AlertLevel,
    AlertState,
    AutoTriggerReason,
    BatteryAlert,
    BatteryAlertChanged,
    ControllerBatteryChanged,
    ControllerBatteryStatus,
    ControllerShutdown,
    FlyingState,
    FlyingStateChanged,
    ForcedLandingReason,
    HomeReachability,
    Message,
    MotorError,
    WarningLevel,
)
from anafi_mav.drone.status.alerts import Alerts, spoken
from anafi_mav.drone.status.calibration import Calibration
from anafi_mav.drone.status.home import Home
from anafi_mav.services.service import Host, Service
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

_LEVELS: Mapping[int, Severity] = {1: Severity.WARNING, 2: Severity.CRITICAL}
"""WarningLevel and AlertLevel have the same numbers."""

_CONTROLLER_LEVELS = {
    ControllerBatteryStatus.DISCHARGING_LOW: (Severity.WARNING, "low"),
    ControllerBatteryStatus.DISCHARGING_CRITICAL: (Severity.CRITICAL, "critical"),
}
"""A Skycontroller works for a few minutes when it is low, and switches off when it is critical (skyctrl.xml 4-8-3)."""

_COVERED = (AlertState.NONE, AlertState.CRITICAL_BATTERY, AlertState.LOW_BATTERY, AlertState.ALMOST_EMPTY_BATTERY)
"""Alerts that say nothing, or what `BatteryState.levels` says."""


def _when(seconds: int | None) -> OperatorText:
    return texts.IN_SECONDS.fill(seconds=seconds) if seconds else texts.NOW


def _battery(alert: BatteryAlert, level: AlertLevel, percent: int | None) -> OperatorText:
    if alert != BatteryAlert.POWER_LEVEL:
        return texts.BATTERY_ALERT.fill(alert=spoken(alert), level=spoken(level))
    word = "low" if level == AlertLevel.WARNING else spoken(level)
    if percent is None:
        return texts.BATTERY_LEVEL.fill(level=word)
    return texts.BATTERY_PERCENT.fill(level=word, percent=percent)


def _controller_battery(word: str, percent: int | None) -> OperatorText:
    if percent is None:
        return texts.CONTROLLER_BATTERY.fill(level=word)
    return texts.CONTROLLER_PERCENT.fill(level=word, percent=percent)


def standing(drone: Drone) -> Iterator[tuple[Hashable, Severity, OperatorText]]:
    """(what about, how serious, the text) of each warning that holds."""
    alerts, battery, home = drone.alerts.state, drone.battery.state, drone.home.state
    if alerts.forced_landing not in (None, ForcedLandingReason.NONE):
        text = texts.LANDS_BY_ITSELF.fill(
            when=_when(alerts.forced_landing_delay_s), reason=spoken(alerts.forced_landing)
        )
        yield ("landing", alerts.forced_landing), Severity.ALERT, text
    if home.auto_trigger not in (None, AutoTriggerReason.NONE):
        text = texts.RETURNS_HOME_BY_ITSELF.fill(
            when=_when(home.auto_trigger_delay_s), reason=spoken(home.auto_trigger)
        )
        yield ("return", home.auto_trigger), Severity.WARNING, text
    if home.reachability in (HomeReachability.CRITICAL, HomeReachability.NOT_REACHABLE):
        yield (
            ("reach", home.reachability),
            Severity.CRITICAL,
            texts.HOME_REACH.fill(reachability=spoken(home.reachability)),
        )
    for alert, level in battery.levels().items():
        if level > AlertLevel.NONE:
            severity = _LEVELS.get(level, Severity.CRITICAL)
            yield ("battery", alert, level), severity, _battery(alert, level, battery.percent)
    controller = drone.controller.state
    if controller.battery in _CONTROLLER_LEVELS:
        severity, word = _CONTROLLER_LEVELS[controller.battery]
        yield ("controller", word), severity, _controller_battery(word, controller.battery_percent)
    for name, degree in (("Wind", alerts.wind), ("Vibration", alerts.vibration), ("Icing", alerts.icing)):
        if degree is not None and degree > WarningLevel.OK:
            yield (
                (name, degree),
                _LEVELS.get(degree, Severity.CRITICAL),
                texts.CONDITION.fill(name=name, degree=spoken(degree)),
            )
    if alerts.too_dark_to_hover:
        yield "dark", Severity.WARNING, texts.TOO_DARK
    if alerts.too_high_to_hover:
        yield "high", Severity.WARNING, texts.TOO_HIGH
    if alerts.motor_error not in (None, MotorError.NO_ERROR):
        yield ("motor", alerts.motor_error), Severity.CRITICAL, texts.MOTOR_ERROR.fill(error=spoken(alerts.motor_error))
    if alerts.alert is not None and alerts.alert not in _COVERED:
        yield ("alert", alerts.alert), Severity.CRITICAL, texts.ALERT.fill(alert=spoken(alerts.alert))
    for alarm, raised in alerts.alarms.items():
        if raised:
            yield ("alarm", alarm), Severity.WARNING, texts.ALARM.fill(alarm=spoken(alarm))
    for sensor, works in drone.calibration.state.sensors.items():
        if not works:
            yield ("sensor", sensor), Severity.WARNING, texts.SENSOR_FAILED.fill(sensor=spoken(sensor))
    if drone.calibration.state.magneto_required:
        yield "magnetometer", Severity.WARNING, texts.CALIBRATE_MAGNETOMETER
    if drone.piloting.state.flying == FlyingState.EMERGENCY:
        yield "emergency", Severity.EMERGENCY, texts.MOTORS_CUT


_RELEVANT: frozenset[type[Message]] = frozenset(
    {
        *Alerts.REDUCERS,
        *Calibration.REDUCERS,
        *Home.REDUCERS,
        BatteryAlertChanged,
        ControllerBatteryChanged,
        FlyingStateChanged,
    }
)
"""Of the battery its alerts alone: its voltage comes every second and warns of nothing."""


class WarningService(Service):
    """Sends a text for each new warning."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._announced: frozenset[Hashable] = frozenset()

    def link_up(self) -> None:
        self._announced = frozenset()
        self._tell()

    def subscriptions(self) -> Subscriptions:
        return {**dict.fromkeys(_RELEVANT, lambda message, now: self._tell()), ControllerShutdown: self._shut_down}

    def _shut_down(self, message: ControllerShutdown, now: float) -> None:
        """Report a Skycontroller that is about to leave: the drone's link ends with it."""
        self.host.text(Severity.CRITICAL, texts.CONTROLLER_SHUTDOWN.fill(reason=spoken(message.reason)))

    def _tell(self) -> None:
        holding = list(standing(self.host.drone))
        for key, severity, text in holding:
            if key not in self._announced:
                self.host.text(severity, text)
        self._announced = frozenset(key for key, _, _ in holding)
