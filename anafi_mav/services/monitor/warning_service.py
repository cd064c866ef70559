"""What the drone warns about, as texts for people: said when it begins or changes, not again and again.

Parrot's three levels become severities: WARNING is a warning, CRITICAL is critical; what the drone is about to do by
itself, and nobody can talk it out of, is an alert, motors that were cut in the air are an emergency.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping

from anafi_mav.drone import Drone
from anafi_mav.drone.events import (
    AlertLevel,
    AlertState,
    AutoTriggerReason,
    BatteryAlert,
    BatteryAlertChanged,
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
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

_LEVELS: Mapping[int, Severity] = {1: Severity.WARNING, 2: Severity.CRITICAL}
"""WarningLevel and AlertLevel have the same numbers."""

_COVERED = (AlertState.NONE, AlertState.CRITICAL_BATTERY, AlertState.LOW_BATTERY, AlertState.ALMOST_EMPTY_BATTERY)
"""Alerts that say nothing, or what the battery's own alerts say."""


def _when(seconds: int | None) -> str:
    return "now" if not seconds else f"in {seconds} s"


def _battery(alert: BatteryAlert, level: AlertLevel, percent: int | None) -> str:
    if alert != BatteryAlert.POWER_LEVEL:
        return f"Battery {spoken(alert)}: {spoken(level)}"
    left = "" if percent is None else f" ({percent} %)"
    return f"Battery {'low' if level == AlertLevel.WARNING else spoken(level)}{left}"


def standing(drone: Drone) -> Iterator[tuple[Hashable, Severity, str]]:
    """(what about, how serious, the text) of each warning that holds."""
    alerts, battery, home = drone.alerts.state, drone.battery.state, drone.home.state
    if alerts.forced_landing not in (None, ForcedLandingReason.NONE):
        text = f"Landing by itself {_when(alerts.forced_landing_delay_s)}: {spoken(alerts.forced_landing)}"
        yield ("landing", alerts.forced_landing), Severity.ALERT, text
    if home.auto_trigger not in (None, AutoTriggerReason.NONE):
        text = f"Returning home by itself {_when(home.auto_trigger_delay_s)}: {spoken(home.auto_trigger)}"
        yield ("return", home.auto_trigger), Severity.WARNING, text
    if home.reachability in (HomeReachability.CRITICAL, HomeReachability.NOT_REACHABLE):
        yield ("reach", home.reachability), Severity.CRITICAL, f"Home: {spoken(home.reachability)}"
    for alert, level in battery.alerts.items():
        if level > AlertLevel.NONE:
            severity = _LEVELS.get(level, Severity.CRITICAL)
            yield ("battery", alert, level), severity, _battery(alert, level, battery.percent)
    for name, degree in (("Wind", alerts.wind), ("Vibration", alerts.vibration), ("Icing", alerts.icing)):
        if degree is not None and degree > WarningLevel.OK:
            yield (name, degree), _LEVELS.get(degree, Severity.CRITICAL), f"{name}: {spoken(degree)}"
    if alerts.too_dark_to_hover:
        yield "dark", Severity.WARNING, "Too dark to hold the position without GPS"
    if alerts.too_high_to_hover:
        yield "high", Severity.WARNING, "Too high to hold the position without GPS"
    if alerts.motor_error not in (None, MotorError.NO_ERROR):
        yield ("motor", alerts.motor_error), Severity.CRITICAL, f"Motor: {spoken(alerts.motor_error)}"
    if alerts.alert is not None and alerts.alert not in _COVERED:
        yield ("alert", alerts.alert), Severity.CRITICAL, f"Alert: {spoken(alerts.alert)}"
    for alarm, raised in alerts.alarms.items():
        if raised:
            yield ("alarm", alarm), Severity.WARNING, f"Alarm: {spoken(alarm)}"
    for sensor, works in drone.calibration.state.sensors.items():
        if not works:
            yield ("sensor", sensor), Severity.WARNING, f"Sensor {spoken(sensor)} does not work"
    if drone.calibration.state.magneto_required:
        yield "magnetometer", Severity.WARNING, "The magnetometer has to be calibrated"
    if drone.piloting.state.flying == FlyingState.EMERGENCY:
        yield "emergency", Severity.EMERGENCY, "Motors cut"


_RELEVANT: frozenset[type[Message]] = frozenset(
    {*Alerts.REDUCERS, *Calibration.REDUCERS, *Home.REDUCERS, BatteryAlertChanged, FlyingStateChanged}
)
"""Of the battery its alerts alone: its voltage comes every second and warns of nothing."""


class WarningService(Service):
    """Tells what is new among the warnings."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._told: frozenset[Hashable] = frozenset()

    def link_up(self) -> None:
        self._told = frozenset()
        self._tell()

    def subscriptions(self) -> Subscriptions:
        return dict.fromkeys(_RELEVANT, lambda message, now: self._tell())

    def _tell(self) -> None:
        holding = list(standing(self.host.drone))
        for key, severity, text in holding:
            if key not in self._told:
                self.host.text(severity, text)
        self._told = frozenset(key for key, _, _ in holding)
