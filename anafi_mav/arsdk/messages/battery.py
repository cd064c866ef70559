"""Feature 149, battery."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, STRING, U8, U16, U32, Bits, Buffer, Message, OpenEnum, event
from anafi_mav.arsdk.messages.generic import ListFlags


class BatteryAlert(OpenEnum):
    POWER_LEVEL = 0
    TOO_HOT = 1
    TOO_COLD = 2
    GAUGE_TOO_OLD = 3
    AUTHENTICATION_FAILURE = 4
    LOST_COMM = 5


class AlertLevel(OpenEnum):
    NONE = 0
    WARNING = 1
    CRITICAL = 2


@event("battery.alert", 149, 0, 1)
class Alert(Message, frozen=True):
    alert: Annotated[BatteryAlert, ENUM]
    level: Annotated[AlertLevel, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("battery.health", 149, 0, 2)
class Health(Message, frozen=True):
    state_of_health: Annotated[int, U8]


@event("battery.voltage", 149, 0, 3, Buffer.NON_ACK)
class Voltage(Message, frozen=True):
    """mV."""

    voltage: Annotated[int, U16]


@event("battery.cycle_count", 149, 0, 4)
class CycleCount(Message, frozen=True):
    count: Annotated[int, U32]


@event("battery.serial", 149, 0, 5)
class Serial(Message, frozen=True):
    serial: Annotated[str, STRING]


@event("battery.description", 149, 0, 6)
class Description(Message, frozen=True):
    serial: Annotated[str, STRING]
    date: Annotated[str, STRING]
    design: Annotated[int, U32]
    cell_count: Annotated[int, U16]
    cell_min_voltage: Annotated[int, U16]
    cell_max_voltage: Annotated[int, U16]


@event("battery.temperature", 149, 0, 7, Buffer.NON_ACK)
class Temperature(Message, frozen=True):
    """K."""

    temperature: Annotated[int, U16]


@event("battery.capacity", 149, 0, 8)
class Capacity(Message, frozen=True):
    full_charge: Annotated[int, U32]
    remaining: Annotated[int, U32]


@event("battery.cell_voltage", 149, 0, 9, Buffer.NON_ACK)
class CellVoltage(Message, frozen=True):
    index: Annotated[int, U16]
    cell_voltage: Annotated[int, U16]


@event("battery.version", 149, 0, 10)
class Version(Message, frozen=True):
    hw_revision: Annotated[int, U16]
    fw_version: Annotated[str, STRING]
    gauge_version: Annotated[str, STRING]
    usb_version: Annotated[str, STRING]


@event("battery.reliability", 149, 0, 11)
class Reliability(Message, frozen=True):
    is_charge_level_reliable: Annotated[int, U8]


@event("battery.cell_config", 149, 0, 12)
class CellConfig(Message, frozen=True):
    config: Annotated[str, STRING]
    series: Annotated[int, U8]
    parallel: Annotated[int, U8]
