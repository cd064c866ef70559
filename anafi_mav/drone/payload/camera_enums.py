"""Common vocabulary of two camera features: camera and camera2.

The cameras of 4K, Thermal and USA have the feature camera, those of the Ai camera2. Both have much the same values
under other numbers: photo is 1 in one and 0 in the other, styles are shifted by one, the lists of ISO values and
framerates differ after a few entries. Names agree but for a prefix ("FPS_24", "_24"), so that values are translated
by name. A value of ours is that bare name; quantities are numbers.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeVar

from anafi_mav.arsdk.codec.wire import OpenEnum
from anafi_mav.errors import LocalProtocolError, NotSupported
from anafi_mav.units import is_finite


class CameraKind(enum.Enum):
    """Kind of a camera."""

    MAIN = "MAIN"
    THERMAL = "THERMAL"
    THERMAL_BLENDED = "THERMAL_BLENDED"


class CameraMode(enum.Enum):
    """Mode of a camera."""

    RECORDING = "RECORDING"
    PHOTO = "PHOTO"


class PhotoMode(enum.Enum):
    """Kind of photo or series."""

    SINGLE = "SINGLE"
    BRACKETING = "BRACKETING"
    BURST = "BURST"
    TIME_LAPSE = "TIME_LAPSE"
    GPS_LAPSE = "GPS_LAPSE"


class PhotoFormat(enum.Enum):
    """Projection of a photo."""

    FULL_FRAME = "FULL_FRAME"
    RECTILINEAR = "RECTILINEAR"
    FULL_FRAME_STABILIZED = "FULL_FRAME_STABILIZED"
    """Ai only."""


class PhotoFile(enum.Enum):
    """File format of a photo."""

    JPEG = "JPEG"
    DNG = "DNG"
    """Not on the Ai."""
    DNG_JPEG = "DNG_JPEG"


class Burst(enum.Enum):
    """Pictures over seconds."""

    B14_OVER_4S = "14_OVER_4S"
    B14_OVER_2S = "14_OVER_2S"
    B14_OVER_1S = "14_OVER_1S"
    B10_OVER_4S = "10_OVER_4S"
    B10_OVER_2S = "10_OVER_2S"
    B10_OVER_1S = "10_OVER_1S"
    B4_OVER_4S = "4_OVER_4S"
    B4_OVER_2S = "4_OVER_2S"
    B4_OVER_1S = "4_OVER_1S"

    @property
    def pictures(self) -> int:
        """Number of pictures."""
        return int(self.value.partition("_")[0])


class Bracketing(enum.Enum):
    """Steps of exposure to both sides."""

    EV1 = "1EV"
    EV2 = "2EV"
    EV3 = "3EV"
    EV1_EV2 = "1EV_2EV"
    EV1_EV3 = "1EV_3EV"
    EV2_EV3 = "2EV_3EV"
    EV1_EV2_EV3 = "1EV_2EV_3EV"

    @property
    def pictures(self) -> int:
        """Number of pictures: one for each step to either side, and one between them."""
        return 2 * self.value.count("EV") + 1


class RecordingMode(enum.Enum):
    """Kind of video."""

    STANDARD = "STANDARD"
    HYPERLAPSE = "HYPERLAPSE"
    SLOW_MOTION = "SLOW_MOTION"
    HIGH_FRAMERATE = "HIGH_FRAMERATE"


class Resolution(enum.Enum):
    """Of a video."""

    DCI_4K = "DCI_4K"
    UHD_4K = "UHD_4K"
    """The Ai calls it 2160p."""
    R2_7K = "2_7K"
    R1080P = "1080P"
    R720P = "720P"
    R480P = "480P"
    R1080P_SD = "1080P_SD"
    R720P_SD = "720P_SD"
    UHD_8K = "UHD_8K"
    R5K = "5K"


class VideoCodec(enum.Enum):
    """Codec of a video. Ai only."""

    H264 = "H264"
    H265 = "H265"


class StoragePolicy(enum.Enum):
    """Storage that pictures and videos are written to. Ai only."""

    PRIORITY_REMOVABLE = "PRIORITY_REMOVABLE"
    """Internal storage without a card."""
    REMOVABLE = "REMOVABLE"
    PRIORITY_INTERNAL = "PRIORITY_INTERNAL"
    """Card when the internal storage is full."""
    INTERNAL = "INTERNAL"


class ExposureMode(enum.Enum):
    """Quantities that the camera exposes by, and those that are set by hand."""

    AUTOMATIC = "AUTOMATIC"
    AUTOMATIC_PREFER_ISO = "AUTOMATIC_PREFER_ISO_SENSITIVITY"
    AUTOMATIC_PREFER_SHUTTER = "AUTOMATIC_PREFER_SHUTTER_SPEED"
    MANUAL_ISO = "MANUAL_ISO_SENSITIVITY"
    MANUAL_SHUTTER = "MANUAL_SHUTTER_SPEED"
    MANUAL = "MANUAL"


class Metering(enum.Enum):
    """Part of the picture that the exposure is measured in."""

    STANDARD = "STANDARD"
    CENTER_TOP = "CENTER_TOP"


class WhiteBalance(enum.Enum):
    """Light that the camera balances for."""

    AUTOMATIC = "AUTOMATIC"
    CANDLE = "CANDLE"
    SUNSET = "SUNSET"
    INCANDESCENT = "INCANDESCENT"
    WARM_WHITE_FLUORESCENT = "WARM_WHITE_FLUORESCENT"
    HALOGEN = "HALOGEN"
    FLUORESCENT = "FLUORESCENT"
    COOL_WHITE_FLUORESCENT = "COOL_WHITE_FLUORESCENT"
    FLASH = "FLASH"
    DAYLIGHT = "DAYLIGHT"
    SUNNY = "SUNNY"
    CLOUDY = "CLOUDY"
    SNOW = "SNOW"
    HAZY = "HAZY"
    SHADED = "SHADED"
    GREEN_FOLIAGE = "GREEN_FOLIAGE"
    BLUE_SKY = "BLUE_SKY"
    CUSTOM = "CUSTOM"
    """By temperature."""


class Style(enum.Enum):
    """Style of the picture."""

    STANDARD = "STANDARD"
    PLOG = "PLOG"
    INTENSE = "INTENSE"
    PASTEL = "PASTEL"
    CUSTOM = "CUSTOM"
    """Ai only."""
    PHOTOGRAMMETRY = "PHOTOGRAMMETRY"
    """Ai only."""


class Streaming(enum.Enum):
    """Priority of the live video."""

    LOW_LATENCY = "LOW_LATENCY"
    HIGH_RELIABILITY = "HIGH_RELIABILITY"
    HIGH_RELIABILITY_LOW_FRAMERATE = "HIGH_RELIABILITY_LOW_FRAMERATE"


class Antiflicker(enum.Enum):
    """Mains frequency that the exposure adapts to."""

    OFF = "OFF"
    AUTO = "AUTO"
    HZ_50 = "50HZ"
    HZ_60 = "60HZ"


_PREFIXES = ("SHUTTER_", "ISO_", "FPS_", "RES_", "BURST_", "PRESET_", "RATIO_", "T_", "MODE_", "_")
_ALIASES = {
    "2160P": "UHD_4K",
    "50_HZ": "50HZ",
    "60_HZ": "60HZ",
    "DISABLED": "OFF",
}
_AUTO = {"AUTOMATIC": "AUTO"}
"""Of antiflicker only."""

WordT = TypeVar("WordT", bound=enum.Enum)
ParrotT = TypeVar("ParrotT", bound=OpenEnum)


@lru_cache(maxsize=512, typed=True)
def bare(value: OpenEnum) -> str:
    """Parrot's name of a value without what belongs to its list."""
    name = value.name
    for prefix in _PREFIXES:
        if name.startswith(prefix) and name[len(prefix) : len(prefix) + 1].isalnum():
            # "T_5000" and "RES_UHD_4K" have a prefix, "TIME_LAPSE" has none.
            name = name[len(prefix) :]
            break
    name = name.replace("_POINT_", "_")
    return _ALIASES.get(name, name)


def word(words: type[WordT], value: OpenEnum | None) -> WordT | None:
    """Translate Parrot's value to ours; None when it has no equivalent or is not reported."""
    if value is None:
        return None
    name = bare(value)
    if words is Antiflicker:
        name = _AUTO.get(name, name)
    try:
        return words(name)
    except ValueError:
        return None


def words(kind: type[WordT], values: Iterable[OpenEnum]) -> frozenset[WordT]:
    """Ours for Parrot's, without those that we have no word for."""
    return _shared_words(frozenset(ours for value in values if (ours := word(kind, value)) is not None))


@lru_cache(maxsize=512)
def _shared_words(values: frozenset[Any]) -> frozenset[Any]:
    """Return the first set with these values: drones report the same ones, and share them."""
    return values


def parrot(values: type[ParrotT], wanted: enum.Enum) -> ParrotT:
    """Parrot's for ours. Raises `NotSupported` when this feature has no such value."""
    for value in values:
        if word(type(wanted), value) is wanted:
            return value
    raise NotSupported(str(wanted.value).lower().replace("_", " "))


@lru_cache(maxsize=512, typed=True)
def quantity(value: OpenEnum | None) -> float | None:
    """Return the number that a value stands for; None when it is not known.

    s of a shutter, ISO, K, frames a second.
    """
    if value is None:
        return None
    numerator, over, denominator = bare(value).partition("_OVER_")
    try:
        if over:
            return float(Fraction(numerator) / Fraction(denominator.replace("_", ".")))
        return float(numerator.replace("_", "."))
    except (ValueError, ZeroDivisionError):
        return None


def quantities(values: Iterable[OpenEnum]) -> tuple[float, ...]:
    """Return the numbers that these values stand for, ascending, each once."""
    return _shared_numbers(tuple(sorted({number for value in values if (number := quantity(value))})))


@lru_cache(maxsize=512)
def _shared_numbers(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return the first tuple of these numbers: drones report the same ones, and share them."""
    return values


def nearest(values: type[ParrotT], wanted: float) -> ParrotT:
    """The value whose number is nearest, by ratio."""
    if not (is_finite(wanted) and wanted > 0.0):
        raise LocalProtocolError("expected a finite number above zero")
    known = [(abs(math.log(number / wanted)), value) for value in values if (number := quantity(value))]
    return min(known)[1]


EV_STEPS = 3
"""Steps of the exposure compensation in one EV; both features count them from -3 EV on."""
_EV_ZERO = 9


def ev_of(value: int | None) -> float | None:
    """EV of a step; None for one outside of -3 to 3."""
    return None if value is None or not 0 <= value <= 2 * _EV_ZERO else (value - _EV_ZERO) / EV_STEPS


def ev_step(ev: float) -> int:
    """The nearest step."""
    if not is_finite(ev):
        raise LocalProtocolError("expected EV: a finite number")
    return min(max(round(ev * EV_STEPS) + _EV_ZERO, 0), 2 * _EV_ZERO)
