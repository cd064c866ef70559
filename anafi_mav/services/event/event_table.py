"""The event definitions of events.json: numbers, texts and arguments.

Ground stations read them there. The format is libevents' (mavlink/libevents README.md, validation/schema.json), and
the protocol of health and arming checks is the one that PX4 has: a summary of the arming checks, the checks that did
not pass, a summary of the health.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from anafi_mav.drone.events import AlertState, BatteryAlert, MotorError, Sensor, TakeoffChecklistType
from anafi_mav.services.flavours import Flavour
from anafi_mav.vehicle.base.modes import FlightMode

NAMESPACE = "anafi"
COMPONENT = 1
"""Highest 8 bits of an event's id: the component that sends it."""

ARGUMENT_BYTES = 40
"""Of the message."""

VERSION = 2
"""Of the file's format."""


class Level(enum.IntEnum):
    """Level of an event: the same internally and externally."""

    ERROR = 3
    WARNING = 4
    INFO = 6
    PROTOCOL = 8
    """Not to be shown: part of a protocol."""


class HealthComponent(enum.IntFlag):
    """Components whose health is reported, as bits. libevents requires NONE as the first."""

    NONE = 1
    GPS = 2
    BATTERY = 4
    MAGNETOMETER = 8
    MOTORS = 16
    SENSORS = 32
    SYSTEM = 64

    @property
    def index(self) -> int:
        """Number of the bit."""
        return self.value.bit_length() - 1


_HEALTH_NAMES = {
    HealthComponent.NONE: "None",
    HealthComponent.GPS: "GPS",
    HealthComponent.BATTERY: "Battery",
    HealthComponent.MAGNETOMETER: "Magnetometer",
    HealthComponent.MOTORS: "Motors",
    HealthComponent.SENSORS: "Sensors",
    HealthComponent.SYSTEM: "System",
}

MODE_GROUPS = (
    FlightMode.HOLD,
    FlightMode.POSITION,
    FlightMode.GUIDED,
    FlightMode.TAKEOFF,
    FlightMode.MISSION,
    FlightMode.RETURN,
    FlightMode.LAND,
    FlightMode.OFFBOARD,
    FlightMode.FOLLOW,
    FlightMode.ORBIT,
)
"""A group of modes is one mode here; the place is its number."""


def mode_bits(modes: frozenset[FlightMode] | set[FlightMode]) -> int:
    """These modes as bits of their groups."""
    return sum(1 << index for index, mode in enumerate(MODE_GROUPS) if mode in modes)


ALL_MODES = mode_bits(set(MODE_GROUPS))

_BASIC = {"uint8_t": "B", "uint32_t": "I"}


@dataclass(frozen=True)
class Enum:
    """A type of arguments."""

    name: str
    type: str
    entries: Mapping[int, tuple[str, str]]
    """value -> (name, description)."""
    bits: bool = False


def _of(name: str, values: Any) -> Enum:
    """Parrot's enum as a type."""
    entries = {
        int(value): (value.name.lower(), value.name.lower().removeprefix("error_").replace("_", " "))
        for value in values
    }
    return Enum(name, "uint8_t", entries)


_LOW = {int(BatteryAlert.POWER_LEVEL): ("power_level", "critical")}
"""The check names an alert at its critical level only."""

_BATTERY_ALERTS = _of("battery_alert_t", BatteryAlert)

ENUMS = (
    Enum(
        "health_component_t",
        "uint32_t",
        {part.value: (str(part.name).lower(), _HEALTH_NAMES[part]) for part in HealthComponent},
        bits=True,
    ),
    Enum(
        "navigation_mode_group_t",
        "uint32_t",
        {1 << index: (mode.value.lower(), mode.value) for index, mode in enumerate(MODE_GROUPS)},
        bits=True,
    ),
    _of("takeoff_check_t", TakeoffChecklistType),
    _of("sensor_t", Sensor),
    Enum(_BATTERY_ALERTS.name, _BATTERY_ALERTS.type, {**_BATTERY_ALERTS.entries, **_LOW}),
    _of("alert_t", AlertState),
    _of("motor_error_t", MotorError),
)

_TYPES = {one.name: one.type for one in ENUMS} | {name: name for name in _BASIC}


@dataclass(frozen=True)
class Event:
    """Definition of one event; the fields except `number` are those of events.json."""

    number: int
    """Lower 24 bits of its id; never used for another event."""
    name: str
    message: str
    level: Level
    group: str = "default"
    type: str = ""
    arguments: tuple[tuple[str, str], ...] = ()
    """(name, type)."""
    description: str = ""

    @property
    def id(self) -> int:
        return COMPONENT << 24 | self.number

    @property
    def log_levels(self) -> int:
        """Internal in the high, external in the low nibble (MAVLink common.xml EVENT)."""
        return self.level << 4 | self.level

    def pack(self, *values: int) -> bytes:
        """The arguments as they lie in the message: one after the other, little endian, no padding."""
        codes = "".join(_BASIC[_TYPES[kind]] for _, kind in self.arguments)
        return struct.pack("<" + codes, *values).ljust(ARGUMENT_BYTES, b"\0")


CHECK_ARGUMENTS = (("modes", "navigation_mode_group_t"), ("health_component_index", "uint8_t"))
"""Arguments that every check has first (libevents)."""


def _check(number: int, name: str, message: str, level: Level = Level.ERROR, value: str = "", text: str = "") -> Event:
    """Return the event of a check that did not pass.

    `value` is the type of the value that is reported with it.
    """
    arguments = (*CHECK_ARGUMENTS, ("value", value)) if value else CHECK_ARGUMENTS
    return Event(number, name, message, level, "arming_check", arguments=arguments, description=text)


ARMING_SUMMARY = Event(
    1,
    "arming_check_summary",
    "Arming check summary event",
    Level.PROTOCOL,
    "arming_check",
    "summary",
    (
        ("chunk_idx", "uint8_t"),
        ("error", "health_component_t"),
        ("warning", "health_component_t"),
        ("can_arm", "navigation_mode_group_t"),
        ("can_run", "navigation_mode_group_t"),
    ),
)
HEALTH_SUMMARY = Event(
    2,
    "health_summary",
    "Health report summary event",
    Level.PROTOCOL,
    "health",
    "summary",
    (
        ("chunk_idx", "uint8_t"),
        ("is_present", "health_component_t"),
        ("error", "health_component_t"),
        ("warning", "health_component_t"),
    ),
)
SILENT = _check(10, "check_flying_state", "Flying state unknown")
EMERGENCY = _check(11, "check_emergency", "Emergency stop")
CHECKLIST = _check(
    12,
    "check_takeoff_checklist",
    "Take-off checklist: {3}",
    value="takeoff_check_t",
    text="The drone refuses to take off.",
)
MAGNETOMETER = _check(
    13,
    "check_magnetometer",
    "Magnetometer calibration required",
    text="Turn the drone about its three axes while the calibration runs.",
)
SENSOR = _check(14, "check_sensor", "Sensor failed: {3}", value="sensor_t")
BATTERY = _check(15, "check_battery", "Battery: {3}", value="battery_alert_t")
ALERT = _check(16, "check_alert", "Alert: {3}", value="alert_t")
MOTOR = _check(17, "check_motor", "Motor: {3}", value="motor_error_t")
NO_FIX = _check(
    18,
    "check_gps",
    "No GPS fix",
    Level.WARNING,
    text="Return home and flight to a position are not possible.",
)

CALIBRATING = _check(19, "check_calibrating", "Magnetometer calibration in progress")
FENCE = _check(20, "check_fence", "Fence does not allow takeoff here")
OTHER = _check(21, "check_other", "Takeoff not possible", text="A message gives the reason when a client arms.")

ARMED = Event(100, "armed", "Armed", Level.INFO)
DISARMED = Event(101, "disarmed", "Disarmed", Level.INFO)
TAKEOFF = Event(102, "takeoff_detected", "Takeoff detected", Level.INFO)
LANDED = Event(103, "landing_detected", "Landing detected", Level.INFO)

EVENTS: Sequence[Event] = (
    ARMING_SUMMARY,
    HEALTH_SUMMARY,
    SILENT,
    EMERGENCY,
    CHECKLIST,
    MAGNETOMETER,
    SENSOR,
    BATTERY,
    ALERT,
    MOTOR,
    NO_FIX,
    CALIBRATING,
    FENCE,
    OTHER,
    ARMED,
    DISARMED,
    TAKEOFF,
    LANDED,
)


def events_file(flavour: Flavour) -> dict[str, Any]:
    """Return events.json, with the mode numbers of a client's flavour."""
    groups: dict[str, dict[str, Any]] = {}
    for event in EVENTS:
        entry: dict[str, Any] = {"name": event.name, "message": event.message}
        if event.description:
            entry["description"] = event.description
        if event.type:
            entry["type"] = event.type
        if event.arguments:
            entry["arguments"] = [{"name": name, "type": kind} for name, kind in event.arguments]
        groups.setdefault(event.group, {"events": {}})["events"][str(event.number)] = entry
    enums = {}
    for one in ENUMS:
        entries = {str(value): {"name": name, "description": text} for value, (name, text) in one.entries.items()}
        enums[one.name] = {"type": one.type, "entries": entries} | ({"is_bitfield": True} if one.bits else {})
    component = {
        "namespace": NAMESPACE,
        "enums": enums,
        "event_groups": groups,
        "supported_protocols": ["health_and_arming_check"],
        "navigation_mode_groups": {"groups": mode_groups(flavour)},
    }
    return {"version": VERSION, "components": {str(COMPONENT): component}}


def mode_groups(flavour: Flavour) -> dict[str, list[int]]:
    """Group -> the custom_modes in it.

    A number that means several modes stands in the first one's group.
    """
    taken: set[int] = set()
    groups = {}
    for index, mode in enumerate(MODE_GROUPS):
        numbers = {flavour.custom_mode(mode)} | {number for number, other in flavour.modes.items() if other is mode}
        if free := sorted(numbers - taken):
            groups[str(index)] = free
            taken.update(free)
    return groups
