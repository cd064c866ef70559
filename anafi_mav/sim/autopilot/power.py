"""The battery: it empties while the drone flies, slowly on the ground, and says so.

A full pack hovers for the model's flight time; on the ground the electronics take a tenth of that. Voltage falls
linearly with the charge between the model's two ends and sags under load. The thresholds of the alerts are
assumed: Parrot publishes none.
"""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import battery, common
from anafi_mav.arsdk.messages.ardrone3 import AlertState
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.sim.world.model import AircraftModel

LOW, CRITICAL, EMPTY = 20, 10, 4
"""Percent: warning, no take-off any more, forced landing."""

_GROUND_SHARE = 0.1
_SAG_MV = 250
CYCLES = 12
HEALTH = 97


class Battery:
    """Charge in percent and what follows from it."""

    def __init__(self, model: AircraftModel) -> None:
        self._model = model
        self.charge = 100.0
        self._reported = 100
        self._flying = False

    @property
    def percent(self) -> int:
        return round(self.charge)

    @property
    def alert(self) -> AlertState:
        if self.percent <= EMPTY:
            return AlertState.ALMOST_EMPTY_BATTERY
        if self.percent <= CRITICAL:
            return AlertState.CRITICAL_BATTERY
        return AlertState.LOW_BATTERY if self.percent <= LOW else AlertState.NONE

    @property
    def level(self) -> AlertLevel:
        return _level(self.percent)

    @property
    def millivolts(self) -> int:
        pack = self._model.battery
        sag = _SAG_MV if self._flying else 0
        return round(pack.empty_mv + (pack.full_mv - pack.empty_mv) * self.charge / 100.0) - sag

    def drain(self, seconds: float, flying: bool, forced: int | None) -> list[Message]:
        """Let time pass; `forced` holds the charge at a percentage. The messages are what changed."""
        self._flying = flying
        share = 1.0 if flying else _GROUND_SHARE
        self.charge = max(0.0, self.charge - seconds * share * 100.0 / self._model.airframe.flight_time)
        if forced is not None:
            self.charge = float(min(max(forced, 0), 100))
        percent = self.percent
        if percent == self._reported:
            return []
        before = _level(self._reported)
        self._reported = percent
        messages: list[Message] = [common.BatteryStateChanged(percent)]
        if self.level is not before:
            messages.append(self._alert_message())
        return messages

    def voltage(self) -> Message:
        return battery.Voltage(self.millivolts)

    def _alert_message(self) -> Message:
        return battery.Alert(BatteryAlert.POWER_LEVEL, self.level, 1 << ListFlags.FIRST | 1 << ListFlags.LAST)

    def states_report(self) -> list[Message]:
        """Return the battery messages of the AllStates answer."""
        return [
            common.BatteryStateChanged(self.percent),
            self._alert_message(),
            battery.Health(HEALTH),
            self.voltage(),
            battery.CycleCount(CYCLES),
            battery.Serial(f"SIM{self._model.battery.capacity_mah:07d}"),
        ]


def _level(percent: int) -> AlertLevel:
    if percent <= CRITICAL:
        return AlertLevel.CRITICAL
    return AlertLevel.WARNING if percent <= LOW else AlertLevel.NONE
