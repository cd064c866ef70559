"""Optical settings of a camera's picture, as numbers instead of Parrot's steps.

The light never changes: the automatic always chooses 1/60 s at ISO 100.
"""

from __future__ import annotations

import enum
import math
import re
from dataclasses import dataclass

from anafi_mav.units import RAD_PER_DEG

AUTOMATIC_EXPOSURE = 1.0 / 60.0
"""s"""
AUTOMATIC_ISO = 100

_DAYLIGHT = 5000.0
"""K of the automatic white balance. Assumed."""
_GAINS = (1.60, 2.05)
"""Gains of red and blue at that temperature, as recorded from a 4K."""

_TEMPERATURES = {
    "CANDLE": 1850.0,
    "SUNSET": 2500.0,
    "INCANDESCENT": 2800.0,
    "WARM_WHITE_FLUORESCENT": 3000.0,
    "HALOGEN": 3200.0,
    "FLUORESCENT": 4000.0,
    "COOL_WHITE_FLUORESCENT": 4200.0,
    "FLASH": 5500.0,
    "DAYLIGHT": 5500.0,
    "SUNNY": 5500.0,
    "CLOUDY": 6500.0,
    "SHADED": 7500.0,
}
"""K by Parrot's name of a white balance. Assumed; what is not here counts as automatic."""


@dataclass(frozen=True)
class Optics:
    """One camera as it is set now."""

    hfov: float
    """rad across the picture, zoom included."""
    zoom: float = 1.0
    exposure: float = AUTOMATIC_EXPOSURE
    """s"""
    iso: int = AUTOMATIC_ISO
    gains: tuple[float, float] = _GAINS
    """White balance of red and blue against green."""

    def vfov(self, width: int, height: int) -> float:
        """rad from the upper to the lower edge of a picture of these sides."""
        return 2.0 * math.atan(math.tan(self.hfov / 2.0) * height / width)


def zoomed(hfov: float, zoom: float) -> float:
    """rad across a picture that has `hfov` (deg) at zoom 1."""
    return 2.0 * math.atan(math.tan(hfov / 2.0 * RAD_PER_DEG) / zoom)


def seconds(shutter: enum.IntEnum) -> float:
    """Convert a shutter speed to s by its name.

    Names are like SHUTTER_1_OVER_60, SHUTTER_1_OVER_1_5, _1_OVER_1_POINT_5, _1.
    """
    match = re.fullmatch(r"(?:SHUTTER)?_1(?:_OVER_(\d+)(?:_(?:POINT_)?(\d))?)?", shutter.name)
    assert match is not None, shutter.name
    return 1.0 if match[1] is None else 1.0 / float(f"{match[1]}.{match[2] or 0}")


def sensitivity(iso: enum.IntEnum) -> int:
    """ISO of a sensitivity by its name: ISO_100, _100."""
    return int(iso.name.rpartition("_")[2])


def white_balance(mode: enum.IntEnum, temperature: enum.IntEnum) -> tuple[float, float]:
    """Gains of red and blue; `temperature` (T_5000, _5000) counts where the mode is CUSTOM.

    Warm light has much red, so that its gain is small. The square root is assumed.
    """
    kelvin = _TEMPERATURES.get(mode.name, _DAYLIGHT)
    if mode.name == "CUSTOM":
        kelvin = float(temperature.name.rpartition("_")[2])
    red, blue = _GAINS
    return red * math.sqrt(kelvin / _DAYLIGHT), blue * math.sqrt(_DAYLIGHT / kelvin)
