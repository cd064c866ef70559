"""Element battery."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import battery, common
from anafi_mav.arsdk.messages.battery import AlertLevel, BatteryAlert
from anafi_mav.drone.element import Element, Reducer, with_item


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

    def worst_alert(self) -> AlertLevel:
        """The most serious level among the alerts; NONE when there are none."""
        return max(self.alerts.values(), default=AlertLevel.NONE)


def _alert(state: BatteryState, message: battery.Alert) -> BatteryState:
    return replace(state, alerts=with_item(state.alerts, message.alert, message.level, message.list_flags))


class Battery(Element[BatteryState]):
    """The battery. No verbs."""

    NOTHING = BatteryState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        common.BatteryStateChanged: lambda state, message: replace(state, percent=message.percent),
        battery.Voltage: lambda state, message: replace(state, voltage_mv=message.voltage),
        battery.Temperature: lambda state, message: replace(state, temperature_k=message.temperature),
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
        battery.CellVoltage: lambda state, message: replace(
            state, cell_voltages_mv=with_item(state.cell_voltages_mv, message.index, message.cell_voltage, 0)
        ),
        battery.Alert: _alert,
    }
