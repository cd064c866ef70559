"""Element battery."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, battery, common
from anafi_mav.arsdk.messages.ardrone3 import AlertState
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.drone.element import REMOVE, Element, Reducer, with_item

_CHARGE_LEVELS: Mapping[AlertState, AlertLevel] = {
    AlertState.NONE: AlertLevel.NONE,
    AlertState.LOW_BATTERY: AlertLevel.WARNING,
    AlertState.CRITICAL_BATTERY: AlertLevel.CRITICAL,
    AlertState.ALMOST_EMPTY_BATTERY: AlertLevel.CRITICAL,
}
"""The other alerts take the place of the battery's without ending it (GroundSDK AnafiAlarms)."""


class BatteryState(msgspec.Struct, frozen=True):
    """Charge and health of the battery."""

    percent: int | None = None
    """Charge left, %."""
    voltage_mv: int | None = None
    temperature_k: int | None = None
    health_percent: int | None = None
    """State of health, % of the capacity when new."""
    cycles: int | None = None
    serial: str | None = None
    full_charge_mah: int | None = None
    remaining_mah: int | None = None
    cell_count: int | None = None
    design_mah: int | None = None
    """Capacity when new; Ai only, as the next two."""
    cell_min_mv: int | None = None
    cell_max_mv: int | None = None
    cell_voltages_mv: Mapping[int, int] = {}
    """By cell index; empty on models that do not report single cells."""
    alerts: Mapping[BatteryAlert, AlertLevel] = {}
    """Those of the battery alone; `levels` has the charge of every model."""
    charge_level: AlertLevel | None = None
    """Level of a low charge by the drone's one alert (AlertStateChanged); None: not reported."""

    def levels(self) -> Mapping[BatteryAlert, AlertLevel]:
        """Return the level of each alert.

        Parrot names the 4K and the Ai as models that report a battery's alerts, and that only when a level changes
        (battery.xml 149-0-1). Without a report the charge has the level of the drone's one alert, as in GroundSDK.
        """
        charge = {} if self.charge_level is None else {BatteryAlert.POWER_LEVEL: self.charge_level}
        return {**charge, **self.alerts}

    def charge_alert(self) -> AlertLevel | None:
        """Return the level of a low charge; None: not reported."""
        return self.levels().get(BatteryAlert.POWER_LEVEL)

    def worst_alert(self) -> AlertLevel | None:
        """Return the most serious level of the alerts; None: none is reported."""
        return max(self.levels().values(), default=None)


def _alert(state: BatteryState, message: battery.Alert) -> BatteryState:
    level = min(message.level, AlertLevel.CRITICAL)  # one that is newer than our tables is not less
    return replace(state, alerts=with_item(state.alerts, message.alert, level, message.list_flags))


def _cell(state: BatteryState, message: battery.CellVoltage) -> BatteryState:
    flags = 0 if message.cell_voltage else REMOVE
    return replace(
        state, cell_voltages_mv=with_item(state.cell_voltages_mv, message.index, message.cell_voltage, flags)
    )


class Battery(Element[BatteryState]):
    """The battery. No verbs.

    A voltage or a temperature of zero is none that a gauge measures: unknown.
    """

    NOTHING = BatteryState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.BatteryStateChanged: lambda state, message: replace(state, percent=message.percent),
        battery.Voltage: lambda state, message: replace(state, voltage_mv=message.voltage or None),
        battery.Temperature: lambda state, message: replace(state, temperature_k=message.temperature or None),
        battery.Health: lambda state, message: replace(state, health_percent=message.state_of_health),
        battery.CycleCount: lambda state, message: replace(state, cycles=message.count),
        battery.Serial: lambda state, message: replace(state, serial=message.serial),
        battery.Description: lambda state, message: replace(
            state,
            serial=message.serial,
            cell_count=message.cell_count,
            design_mah=message.design,
            cell_min_mv=message.cell_min_voltage,
            cell_max_mv=message.cell_max_voltage,
        ),
        battery.Capacity: lambda state, message: replace(
            state, full_charge_mah=message.full_charge, remaining_mah=message.remaining
        ),
        battery.CellVoltage: _cell,
        battery.Alert: _alert,
        ardrone3.AlertStateChanged: lambda state, message: replace(
            state, charge_level=_CHARGE_LEVELS.get(message.state, state.charge_level)
        ),
    }

    SAMPLES: ClassVar[tuple[type[Message], ...]] = (battery.Voltage, battery.CellVoltage, battery.Temperature)
    """Events that come all the time."""
