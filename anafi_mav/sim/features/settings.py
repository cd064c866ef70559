"""Settings of the autopilot: a table from setting commands to reporting events.

Each setting is one row. A drone answers every setting command with the value it now has, also when that is the old
one: Parrot's clients wait for an event after the command, never for a value (Olympe's expectations). A value out of
range is limited to the range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, piloting_style, precise_home, rth, wifi
from anafi_mav.arsdk.messages.ardrone3 import HomeTypeSetting
from anafi_mav.arsdk.messages.rth import RthHomeType
from anafi_mav.sim.world.model import AircraftModel, SettingRange
from anafi_mav.units import RAD_PER_DEG

MAX_NAME = 64
"""Characters of a product name that are kept; longer ones are cut."""

_LEGACY_HOME = {
    HomeTypeSetting.TAKEOFF: RthHomeType.TAKEOFF,
    HomeTypeSetting.PILOT: RthHomeType.PILOT,
}
HOME_TYPES = (RthHomeType.TAKEOFF, RthHomeType.CUSTOM, RthHomeType.PILOT)
"""Home types that a user may prefer; without FOLLOWEE, nothing is followed here."""

DEFAULTS: dict[str, Any] = {
    "geofence": 0,
    "banked_turn": 1,
    "home_type": RthHomeType.TAKEOFF,
    "rth_auto_trigger": rth.RthAutoTriggerMode.ON,
    "rth_ending": rth.RthEndingBehavior.HOVERING,
    "precise_home": precise_home.PreciseHomeMode.STANDARD,
    "piloting_style": piloting_style.PilotingStyleStyle.STANDARD,
    "return_on_disconnect": 1,
    "wifi_channel": (wifi.SelectionType.AUTO_ALL, wifi.Band._5_GHZ, 36),
    "wifi_security": (wifi.SecurityType.WPA2, "", wifi.SecurityKeyType.PLAIN),
    "wifi_country": (wifi.CountrySelection.AUTO, "FR"),
    "wifi_environment": wifi.Environment.OUTDOOR,
}
"""Settings without a range, as the drone leaves the factory (assumed where Parrot does not say)."""


class DroneSettings:
    """Values by key; ranges come from the model."""

    def __init__(self, model: AircraftModel, name: str) -> None:
        self._ranges = model.settings
        self._values: dict[str, Any] = {}
        self._name = name
        self.reset()

    def reset(self) -> None:
        """Back to the factory's values."""
        self._values = {key: limits.default for key, limits in self._ranges.items()} | DEFAULTS | {"name": self._name}

    def __getitem__(self, key: str) -> Any:
        return self._values[key]

    def number(self, key: str) -> float:
        return float(self._values[key])

    @property
    def yaw_rate(self) -> float:
        """The fastest turn that is allowed now, rad/s."""
        return self.number("max_rotation_speed") * RAD_PER_DEG

    def limits(self, key: str) -> tuple[float, float, float]:
        """(current, lowest, highest) as most events carry it."""
        low, high = self._ranges[key].low, self._ranges[key].high
        return self.number(key), low, high

    def set(self, key: str, value: Any) -> None:
        """Take a value as the firmware does: clipped, or refused when there is no such choice."""
        limits = self._ranges.get(key)
        if limits is not None:
            self._values[key] = _clip(limits, value, self._values[key])
        elif value in CHOICES.get(key, (value,)):
            self._values[key] = value

    def handle(self, message: Message) -> list[Message] | None:
        """The answer to a setting command; None when it is no setting of this table."""
        row = _BY_COMMAND.get(type(message))
        if row is None:
            return None
        self.set(row.key, row.commands[type(message)](message))
        return list(row.report(self))

    def report(self) -> list[Message]:
        """Every setting's present value."""
        return [event for row in ROWS for event in row.report(self)]


def _clip(limits: SettingRange, value: float, current: float) -> float:
    return current if value != value else limits.clip(value)


class SettingRow(NamedTuple):
    key: str
    commands: dict[type[Message], Callable[[Any], Any]]
    """Commands that set it, and where they carry the value."""
    report: Callable[[DroneSettings], Iterable[Message]]


def _delay(settings: DroneSettings) -> Iterable[Message]:
    current, low, high = (int(value) for value in settings.limits("rth_delay"))
    return rth.Delay(current, low, high), ardrone3.ReturnHomeDelayChanged(current)


def _home_type(settings: DroneSettings) -> Iterable[Message]:
    preferred = settings["home_type"]
    # The old event has no word for a custom place; it keeps to the drone's own choice then.
    legacy = next((old for old, new in _LEGACY_HOME.items() if new is preferred), HomeTypeSetting.TAKEOFF)
    return rth.PreferredHomeType(preferred), ardrone3.HomeTypeChanged(legacy)


CHOICES: dict[str, tuple[Any, ...]] = {
    "geofence": (0, 1),
    "banked_turn": (0, 1),
    "return_on_disconnect": (0, 1),
    "home_type": HOME_TYPES,
    "rth_auto_trigger": tuple(rth.RthAutoTriggerMode),
    "rth_ending": tuple(rth.RthEndingBehavior),
    "precise_home": tuple(precise_home.PreciseHomeMode),
    "piloting_style": tuple(piloting_style.PilotingStyleStyle),
    "wifi_environment": tuple(wifi.Environment),
}
"""Values that are taken; anything else leaves the setting as it is."""

ROWS: tuple[SettingRow, ...] = (
    SettingRow(
        "max_altitude",
        {ardrone3.MaxAltitude: lambda m: m.current},
        lambda s: [ardrone3.MaxAltitudeChanged(*s.limits("max_altitude"))],
    ),
    SettingRow(
        "max_tilt",
        {ardrone3.MaxTilt: lambda m: m.current},
        lambda s: [ardrone3.MaxTiltChanged(*s.limits("max_tilt"))],
    ),
    SettingRow(
        "max_distance",
        {ardrone3.MaxDistance: lambda m: m.value},
        lambda s: [ardrone3.MaxDistanceChanged(*s.limits("max_distance"))],
    ),
    SettingRow(
        "geofence",
        {ardrone3.NoFlyOverMaxDistance: lambda m: m.shouldNotFlyOver},
        lambda s: [ardrone3.NoFlyOverMaxDistanceChanged(s["geofence"])],
    ),
    SettingRow(
        "banked_turn",
        {ardrone3.BankedTurn: lambda m: m.value},
        lambda s: [ardrone3.BankedTurnChanged(s["banked_turn"])],
    ),
    SettingRow(
        "max_vertical_speed",
        {ardrone3.MaxVerticalSpeed: lambda m: m.current},
        lambda s: [ardrone3.MaxVerticalSpeedChanged(*s.limits("max_vertical_speed"))],
    ),
    SettingRow(
        "max_rotation_speed",
        {ardrone3.MaxRotationSpeed: lambda m: m.current},
        lambda s: [ardrone3.MaxRotationSpeedChanged(*s.limits("max_rotation_speed"))],
    ),
    SettingRow(
        "max_tilt_rate",
        {ardrone3.MaxPitchRollRotationSpeed: lambda m: m.current},
        lambda s: [ardrone3.MaxPitchRollRotationSpeedChanged(*s.limits("max_tilt_rate"))],
    ),
    SettingRow(
        "home_type",
        {
            rth.SetPreferredHomeType: lambda m: m.type,
            ardrone3.HomeType: lambda m: _LEGACY_HOME.get(m.type),
        },
        _home_type,
    ),
    SettingRow(
        "rth_delay",
        {rth.SetDelay: lambda m: m.delay, ardrone3.ReturnHomeDelay: lambda m: m.delay},
        _delay,
    ),
    SettingRow(
        "rth_min_altitude",
        {rth.SetMinAltitude: lambda m: m.altitude, ardrone3.ReturnHomeMinAltitude: lambda m: m.value},
        lambda s: [
            rth.MinAltitude(*s.limits("rth_min_altitude")),
            ardrone3.ReturnHomeMinAltitudeChanged(*s.limits("rth_min_altitude")),
        ],
    ),
    SettingRow(
        "rth_auto_trigger",
        {rth.SetAutoTriggerMode: lambda m: m.mode},
        lambda s: [rth.AutoTriggerMode(s["rth_auto_trigger"])],
    ),
    SettingRow(
        "rth_ending",
        {rth.SetEndingBehavior: lambda m: m.ending_behavior},
        lambda s: [rth.EndingBehavior(s["rth_ending"])],
    ),
    SettingRow(
        "rth_hovering_altitude",
        {rth.SetEndingHoveringAltitude: lambda m: m.altitude},
        lambda s: [rth.EndingHoveringAltitude(*s.limits("rth_hovering_altitude"))],
    ),
    SettingRow(
        "precise_home",
        {precise_home.SetMode: lambda m: m.mode},
        lambda s: [precise_home.Mode(s["precise_home"])],
    ),
    SettingRow(
        "piloting_style",
        {piloting_style.SetStyle: lambda m: m.style},
        lambda s: [piloting_style.Style(s["piloting_style"])],
    ),
    SettingRow(
        "return_on_disconnect",
        {common.ReturnHomeOnDisconnect: lambda m: m.value},
        lambda s: [common.ReturnHomeOnDisconnectChanged(s["return_on_disconnect"], 0)],
    ),
    SettingRow(
        "name",
        {common.ProductName: lambda m: m.name[:MAX_NAME]},
        lambda s: [common.ProductNameChanged(s["name"])],
    ),
    SettingRow(
        "wifi_channel",
        {wifi.SetApChannel: lambda m: (m.type, m.band, m.channel)},
        lambda s: [wifi.ApChannelChanged(*s["wifi_channel"])],
    ),
    SettingRow(
        "wifi_security",
        {wifi.SetSecurity: lambda m: (m.type, m.key, m.key_type)},
        lambda s: [wifi.SecurityChanged(*s["wifi_security"])],
    ),
    SettingRow(
        "wifi_country",
        {wifi.SetCountry: lambda m: (m.selection_mode, m.code)},
        lambda s: [wifi.CountryChanged(*s["wifi_country"])],
    ),
    SettingRow(
        "wifi_environment",
        {wifi.SetEnvironment: lambda m: m.environment},
        lambda s: [wifi.EnvironmentChanged(s["wifi_environment"])],
    ),
)

_BY_COMMAND: dict[type[Message], SettingRow] = {command: row for row in ROWS for command in row.commands}
