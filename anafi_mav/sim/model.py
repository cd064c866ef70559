"""What is known of an aircraft model, as data. A new model is a new entry of `MODELS`, never a subclass.

Numbers of the airframe come from the table of the anafi_ros paper (size, speeds, battery, flight time); ranges of
settings from Parrot's own events as anafi_ros and GroundSDK record them. Values that no public source gives are
marked "assumed" where they stand.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Range:
    """A setting: what it is when the drone leaves the factory, and what it may be."""

    default: float
    low: float
    high: float

    def clip(self, value: float) -> float:
        """`value` as the firmware would take it; a NaN asks for nothing and gives the default."""
        if value != value:
            return self.default
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Airframe:
    """How it flies (see `motion`)."""

    max_speed: float
    """Ground speed at full tilt, m/s; sets the drag."""
    yaw_delay: float
    """s between a yaw command and the first reaction."""
    climb_delay: float
    """s between a climb command and the first reaction."""
    flight_time: float
    """s of hovering that a full battery lasts."""


@dataclass(frozen=True)
class Battery:
    cells: int
    capacity_mah: int
    full_mv: int
    """mV of the full pack at rest."""
    empty_mv: int


@dataclass(frozen=True)
class Model:
    """One aircraft of the family."""

    name: str
    """As on the command line: "4k"."""
    product_id: int
    """Parrot's id, as in the discovery answer."""
    title: str
    serial_prefix: str
    software: str
    hardware: str
    airframe: Airframe
    battery: Battery
    gimbal_pitch: tuple[float, float]
    """deg, relative to the body and to the horizon."""
    zoom_max: float
    settings: dict[str, Range] = field(default_factory=dict)


_SETTINGS = {
    "max_altitude": Range(150.0, 0.5, 4000.0),
    "max_tilt": Range(10.0, 1.0, 40.0),
    "max_distance": Range(100.0, 10.0, 4000.0),
    "max_vertical_speed": Range(3.0, 0.1, 4.0),
    "max_rotation_speed": Range(40.0, 3.0, 200.0),
    "max_tilt_rate": Range(116.0, 40.0, 300.0),
    "rth_min_altitude": Range(20.0, 20.0, 100.0),
    "rth_hovering_altitude": Range(10.0, 1.0, 10.0),
    "rth_delay": Range(60.0, 0.0, 120.0),  # default assumed; GroundSDK shows 0..120 s
    "gimbal_speed": Range(90.0, 1.0, 180.0),  # default assumed
    "zoom_speed": Range(0.34, 0.01, 10.0),
}
"""m, deg, m, m/s, deg/s, deg/s, m, m, s, deg/s, tan(deg)/s. Same for the three models without an `a` in their id."""

MODELS: dict[str, Model] = {
    "4k": Model(
        name="4k",
        product_id=0x0914,
        title="ANAFI",
        serial_prefix="PI040416DA9H",
        software="1.8.2",
        hardware="HW_03",
        airframe=Airframe(max_speed=15.0, yaw_delay=0.1, climb_delay=0.15, flight_time=25.0 * 60.0),
        battery=Battery(cells=2, capacity_mah=2700, full_mv=8700, empty_mv=6600),
        gimbal_pitch=(-90.0, 90.0),
        zoom_max=3.0,
        settings=_SETTINGS,
    ),
}
"""By name on the command line."""

KNOWN_MODELS = ("4k", "thermal", "usa", "ai")
"""The family; those without an entry in `MODELS` are refused with that reason."""
