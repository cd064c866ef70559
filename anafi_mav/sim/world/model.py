"""Flight figures and reported values of each model, as data.

A new model is a new entry of `MODELS`, not a subclass.
What both sides of the wire know of it, by its data sheet, is the record of the same key in `anafi_mav.models`.
Numbers of the airframe come from the table of the anafi_ros paper (size, speeds, battery, flight time); ranges of
settings from Parrot's own events as anafi_ros and GroundSDK record them. Values that no public source gives are
marked "assumed" where they stand.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from anafi_mav import models
from anafi_mav.errors import ConfigError
from anafi_mav.models import Intrinsics, PayloadSensor
from anafi_mav.sim.world import lenses
from anafi_mav.sim.world.lenses import Lens


@dataclass(frozen=True)
class SettingRange:
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
class AirframeModel:
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
class BatteryModel:
    cells: int
    capacity_mah: int
    full_mv: int
    """mV of the full pack at rest."""
    empty_mv: int


@dataclass(frozen=True)
class GimbalModel:
    """Ranges of one gimbal in deg.

    Those of pitch and roll are the same to the body and to the horizon, that of yaw is to the body. (0, 0) is an axis
    that does not turn.
    """

    pitch: tuple[float, float]
    roll: tuple[float, float] = (0.0, 0.0)
    yaw: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Card:
    """Storage for media, as `user_storage` (or, with ids, `user_storage_v2`) describes it."""

    name: str
    capacity: int
    """Bytes."""
    removable: bool = True


@dataclass(frozen=True)
class Envelope:
    """Dimensions and limits of the aircraft (anafi_ros paper)."""

    size_mm: tuple[int, int, int]
    """Unfolded."""
    mass_g: int
    battery_g: int
    wind_resistance: float
    """m/s"""
    ceiling: float
    """m above sea level."""
    temperature: tuple[float, float]
    """degrees Celsius"""


@dataclass(frozen=True)
class AircraftModel:
    """One aircraft of the family."""

    name: str
    """As on the command line, the key of its record: "4k"."""
    title: str
    """First part of the name it gives itself."""
    serial_prefix: str
    software: str
    hardware: str
    airframe: AirframeModel
    envelope: Envelope
    battery: BatteryModel
    gimbals: tuple[GimbalModel, ...]
    """The first carries the cameras."""
    cards: tuple[Card, ...]
    """Media are stored on the last."""
    zoom_max: float
    lenses: tuple[Lens, ...] = ()
    """Cameras of feature camera (143); none: they are protobuf ones."""
    settings: dict[str, SettingRange] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.name not in models.simulated():
            raise ValueError(f"{self.name}: anafi_mav/models.py has no record that says `simulated=True`")
        record = self.record
        missing = [key for key in ("plan_figures", "lens") if getattr(record, key) is None]
        if not record.protobuf and not self.lenses:
            missing.append("lenses")
        if missing:
            raise ValueError(f"{self.name}: a simulated drone needs {' and '.join(missing)}")

    @property
    def record(self) -> models.Model:
        """Record of the model in `anafi_mav.models`."""
        return models.MODELS[self.name]

    @property
    def product_id(self) -> int:
        """Parrot's id, as in the discovery answer."""
        return self.record.id

    @property
    def plan_version(self) -> int:
        """1 or 2: which form of flight plan file it flies."""
        return self.record.plans().version

    @property
    def lens(self) -> Intrinsics:
        """The lens of its main camera."""
        assert self.record.lens is not None
        return self.record.lens

    @property
    def thermal(self) -> bool:
        """True for a drone with a thermal camera."""
        return PayloadSensor.THERMAL in self.record.payloads

    @property
    def modern(self) -> bool:
        """True for the generation that speaks protobuf."""
        return self.record.protobuf


_SETTINGS = {
    "max_altitude": SettingRange(150.0, 0.5, 4000.0),
    "max_tilt": SettingRange(10.0, 1.0, 40.0),
    "max_distance": SettingRange(100.0, 10.0, 4000.0),
    "max_vertical_speed": SettingRange(3.0, 0.1, 4.0),
    "max_rotation_speed": SettingRange(40.0, 3.0, 200.0),
    "max_tilt_rate": SettingRange(116.0, 40.0, 300.0),
    "rth_min_altitude": SettingRange(20.0, 20.0, 100.0),
    "rth_hovering_altitude": SettingRange(10.0, 1.0, 10.0),
    "rth_delay": SettingRange(60.0, 0.0, 120.0),  # default assumed; GroundSDK shows 0..120 s
    "gimbal_speed": SettingRange(90.0, 1.0, 180.0),  # default assumed
    "zoom_speed": SettingRange(0.34, 0.01, 10.0),
}
"""m, deg, m, m/s, deg/s, deg/s, m, m, s, deg/s, tan(deg)/s. The same for all four."""

_CARD = Card("SD", 64_000_000_000)
"""Parrot sells them with 16 GB and takes any; the size is assumed."""
_ROLL = (-38.0, 38.0)
"""deg; assumed (what the electronic stabilisation can take)."""

MODELS: dict[str, AircraftModel] = {
    "4k": AircraftModel(
        name="4k",
        title="ANAFI",
        serial_prefix="PI040416DA9H",
        software="1.8.2",
        hardware="HW_03",
        airframe=AirframeModel(max_speed=15.0, yaw_delay=0.1, climb_delay=0.15, flight_time=25.0 * 60.0),
        envelope=Envelope((242, 315, 65), 320, 125, 13.9, 4500.0, (-10.0, 40.0)),
        battery=BatteryModel(cells=2, capacity_mah=2700, full_mv=8700, empty_mv=6600),
        gimbals=(GimbalModel(pitch=(-90.0, 90.0), roll=_ROLL),),
        cards=(_CARD,),
        zoom_max=3.0,
        lenses=lenses.ANAFI_4K,
        settings=_SETTINGS,
    ),
    "thermal": AircraftModel(
        name="thermal",
        title="ANAFI-Thermal",
        serial_prefix="PI040443AA9K",  # assumed, as those below
        software="1.8.2",
        hardware="HW_01",
        airframe=AirframeModel(max_speed=15.0, yaw_delay=0.1, climb_delay=0.15, flight_time=26.0 * 60.0),
        envelope=Envelope((242, 315, 64), 315, 125, 13.9, 4500.0, (-10.0, 40.0)),
        battery=BatteryModel(cells=2, capacity_mah=2700, full_mv=8700, empty_mv=6600),
        gimbals=(GimbalModel(pitch=(-90.0, 90.0), roll=_ROLL),),
        cards=(_CARD,),
        zoom_max=3.0,
        lenses=lenses.THERMAL,
        settings=_SETTINGS,
    ),
    "usa": AircraftModel(
        name="usa",
        title="ANAFI-USA",
        serial_prefix="PI040456AA0L",
        software="1.8.2",  # assumed
        hardware="HW_01",
        airframe=AirframeModel(max_speed=14.7, yaw_delay=0.1, climb_delay=0.15, flight_time=32.0 * 60.0),
        envelope=Envelope((303, 398, 84), 499, 195, 14.7, 6000.0, (-35.0, 43.0)),
        battery=BatteryModel(cells=3, capacity_mah=3400, full_mv=13200, empty_mv=9900),
        gimbals=(GimbalModel(pitch=(-90.0, 90.0), roll=_ROLL),),
        cards=(_CARD,),
        zoom_max=32.0,
        lenses=lenses.USA,
        settings=_SETTINGS,
    ),
    "ai": AircraftModel(
        name="ai",
        title="ANAFI-Ai",
        serial_prefix="PI040455BA1B",
        software="7.7.0",
        hardware="HW_11",
        airframe=AirframeModel(max_speed=16.0, yaw_delay=0.2, climb_delay=0.15, flight_time=32.0 * 60.0),
        envelope=Envelope((378, 498, 118), 898, 366, 12.7, 5000.0, (-10.0, 40.0)),
        battery=BatteryModel(cells=3, capacity_mah=6800, full_mv=13200, empty_mv=9900),
        # Roll and yaw of the first and the whole second one (it carries the stereo sensor) are assumed.
        gimbals=(
            GimbalModel(pitch=(-116.0, 176.0), roll=(-36.0, 36.0), yaw=(-48.0, 48.0)),
            GimbalModel(pitch=(-107.0, 204.0)),
        ),
        cards=(Card("Internal", 8_000_000_000, removable=False), _CARD),
        zoom_max=6.0,
        settings=_SETTINGS,
    ),
}
"""By name on the command line."""


def model_of(name: str) -> AircraftModel:
    """The figures of a model. Raises `ConfigError` for one that is not simulated."""
    if name in MODELS:
        return MODELS[name]
    if name in models.simulated():
        raise ConfigError(
            "model", f"the simulator has no figures of {name!r}: anafi_mav/sim/world/model.py lacks its entry"
        )
    raise ConfigError("model", f"expected one of {', '.join(MODELS)}, got {name!r}")
