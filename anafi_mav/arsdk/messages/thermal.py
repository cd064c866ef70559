"""Feature 152, thermal: the thermal camera of Thermal and USA. Temperatures are Kelvin."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, F32, U8, Bits, Message, OpenEnum, command, event
from anafi_mav.arsdk.messages.generic import ListFlags


class ThermalMode(OpenEnum):
    DISABLED = 0
    STANDARD = 1
    BLENDED = 2


class PaletteMode(OpenEnum):
    ABSOLUTE = 0
    RELATIVE = 1
    SPOT = 2


class ColorizationMode(OpenEnum):
    LIMITED = 0
    EXTENDED = 1


class RelativeRangeMode(OpenEnum):
    LOCKED = 0
    UNLOCKED = 1


class SpotType(OpenEnum):
    COLD = 0
    HOT = 1


class RenderingMode(OpenEnum):
    VISIBLE = 0
    THERMAL = 1
    BLENDED = 2
    MONOCHROME = 3


class Range(OpenEnum):
    HIGH = 0
    LOW = 1


class ShutterTrigger(OpenEnum):
    AUTO = 0
    MANUAL = 1


@command("thermal.set_mode", 152, 0, 1)
class SetMode(Message, frozen=True):
    mode: Annotated[ThermalMode, ENUM]


@event("thermal.mode", 152, 0, 2)
class Mode(Message, frozen=True):
    mode: Annotated[ThermalMode, ENUM]


@event("thermal.capabilities", 152, 0, 3)
class Capabilities(Message, frozen=True):
    modes: Annotated[int, Bits(U8, ThermalMode)]


@command("thermal.set_palette_part", 152, 0, 4)
class SetPalettePart(Message, frozen=True):
    red: Annotated[float, F32]
    green: Annotated[float, F32]
    blue: Annotated[float, F32]
    index: Annotated[float, F32]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("thermal.palette_part", 152, 0, 5)
class PalettePart(Message, frozen=True):
    red: Annotated[float, F32]
    green: Annotated[float, F32]
    blue: Annotated[float, F32]
    index: Annotated[float, F32]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@command("thermal.set_palette_settings", 152, 0, 6)
class SetPaletteSettings(Message, frozen=True):
    """The bounds are Kelvin."""

    mode: Annotated[PaletteMode, ENUM]
    lowest_temp: Annotated[float, F32]
    highest_temp: Annotated[float, F32]
    outside_colorization: Annotated[ColorizationMode, ENUM]
    relative_range: Annotated[RelativeRangeMode, ENUM]
    spot_type: Annotated[SpotType, ENUM]
    spot_threshold: Annotated[float, F32]


@event("thermal.palette_settings", 152, 0, 7)
class PaletteSettings(Message, frozen=True):
    """The bounds are Kelvin."""

    mode: Annotated[PaletteMode, ENUM]
    lowest_temp: Annotated[float, F32]
    highest_temp: Annotated[float, F32]
    outside_colorization: Annotated[ColorizationMode, ENUM]
    relative_range: Annotated[RelativeRangeMode, ENUM]
    spot_type: Annotated[SpotType, ENUM]
    spot_threshold: Annotated[float, F32]


@command("thermal.set_rendering", 152, 0, 8)
class SetRendering(Message, frozen=True):
    mode: Annotated[RenderingMode, ENUM]
    blending_rate: Annotated[float, F32]


@event("thermal.rendering", 152, 0, 9)
class Rendering(Message, frozen=True):
    mode: Annotated[RenderingMode, ENUM]
    blending_rate: Annotated[float, F32]


@command("thermal.set_emissivity", 152, 0, 10)
class SetEmissivity(Message, frozen=True):
    """0 to 1."""

    emissivity: Annotated[float, F32]


@event("thermal.emissivity", 152, 0, 11)
class Emissivity(Message, frozen=True):
    emissivity: Annotated[float, F32]


@command("thermal.set_background_temperature", 152, 0, 12)
class SetBackgroundTemperature(Message, frozen=True):
    """Kelvin."""

    background_temperature: Annotated[float, F32]


@event("thermal.background_temperature", 152, 0, 13)
class BackgroundTemperature(Message, frozen=True):
    """Kelvin."""

    background_temperature: Annotated[float, F32]


@command("thermal.set_sensitivity", 152, 0, 14)
class SetSensitivity(Message, frozen=True):
    range: Annotated[Range, ENUM]


@event("thermal.sensitivity", 152, 0, 15)
class Sensitivity(Message, frozen=True):
    current_range: Annotated[Range, ENUM]


@command("thermal.set_shutter_mode", 152, 0, 16)
class SetShutterMode(Message, frozen=True):
    trigger: Annotated[ShutterTrigger, ENUM]


@event("thermal.shutter_mode", 152, 0, 17)
class ShutterMode(Message, frozen=True):
    current_trigger: Annotated[ShutterTrigger, ENUM]


@command("thermal.trigg_shutter", 152, 0, 18)
class TriggShutter(Message, frozen=True):
    pass
