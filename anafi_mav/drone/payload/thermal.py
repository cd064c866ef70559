"""Element thermal: the thermal camera of Thermal and USA.

It covers rendering and measurement settings. The Ai has no thermal camera. Temperatures are Kelvin, as on the wire.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import thermal
from anafi_mav.arsdk.messages.thermal import (
    ColorizationMode,
    PaletteMode,
    RelativeRangeMode,
    RenderingMode,
    ShutterTrigger,
    SpotType,
    ThermalMode,
)
from anafi_mav.arsdk.messages.thermal import Range as Sensitivity
from anafi_mav.drone.element import EMPTY, FIRST, LAST, Reducer, finite, members
from anafi_mav.drone.payload.camera_enums import CameraKind
from anafi_mav.drone.settings import Commanding, is_same, number, same_as
from anafi_mav.errors import LocalProtocolError

ACTIVE_CAMERAS: Mapping[ThermalMode, CameraKind] = {
    ThermalMode.DISABLED: CameraKind.MAIN,
    ThermalMode.STANDARD: CameraKind.THERMAL,
    ThermalMode.BLENDED: CameraKind.THERMAL_BLENDED,
}
"""Kind of the camera that takes the pictures in each mode."""

MAX_COLOURS = 256
"""Colours of a palette that are kept. Parrot's own have a dozen; a longer list is a confused peer."""


class Colour(msgspec.Struct, frozen=True):
    """One colour of the palette and its position there; all 0 to 1."""

    red: float
    green: float
    blue: float
    index: float


class Palette(msgspec.Struct, frozen=True):
    """Relation of temperatures to positions in the palette."""

    mode: PaletteMode = PaletteMode.RELATIVE
    lowest_k: float = 0.0
    highest_k: float = 0.0
    outside: ColorizationMode = ColorizationMode.EXTENDED
    """Colours of what is colder or hotter than the bounds (mode ABSOLUTE)."""
    range: RelativeRangeMode = RelativeRangeMode.UNLOCKED
    """Relation of the bounds to the picture (mode RELATIVE)."""
    spot: SpotType = SpotType.HOT
    spot_threshold: float = 0.0
    """0 to 1 (mode SPOT)."""


class ThermalState(msgspec.Struct, frozen=True):
    """Settings and state of the thermal camera."""

    mode: ThermalMode | None = None
    """BLENDED and STANDARD make the thermal camera the one that is streamed and recorded."""
    modes: frozenset[ThermalMode] | None = None
    rendering: RenderingMode | None = None
    blending: float | None = None
    """Share of the thermal picture, 0 to 1."""
    palette: Palette | None = None
    colours: tuple[Colour, ...] = ()
    emissivity: float | None = None
    """0 to 1."""
    background_k: float | None = None
    sensitivity: Sensitivity | None = None
    shutter: ShutterTrigger | None = None


def _palette(message: thermal.PaletteSettings) -> Palette:
    return Palette(
        message.mode,
        message.lowest_temp,
        message.highest_temp,
        message.outside_colorization,
        message.relative_range,
        message.spot_type,
        message.spot_threshold,
    )


def _colour(state: ThermalState, message: thermal.PalettePart) -> ThermalState:
    if message.list_flags & EMPTY:
        return replace(state, colours=())
    known = () if message.list_flags & FIRST else state.colours
    new = Colour(message.red, message.green, message.blue, message.index)
    return replace(state, colours=(*known, new)[:MAX_COLOURS])


class Thermal(Commanding[ThermalState]):
    """The thermal camera's own settings. ANAFI Thermal and USA."""

    NOTHING = ThermalState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        thermal.Mode: lambda state, m: replace(state, mode=m.mode),
        thermal.Capabilities: lambda state, m: replace(state, modes=members(m.modes, ThermalMode)),
        thermal.Rendering: lambda state, m: replace(state, rendering=m.mode, blending=finite(m.blending_rate)),
        thermal.PaletteSettings: lambda state, m: replace(state, palette=_palette(m)),
        thermal.PalettePart: _colour,
        thermal.Emissivity: lambda state, m: replace(state, emissivity=finite(m.emissivity)),
        thermal.BackgroundTemperature: lambda state, m: replace(state, background_k=finite(m.background_temperature)),
        thermal.Sensitivity: lambda state, m: replace(state, sensitivity=m.current_range),
        thermal.ShutterMode: lambda state, m: replace(state, shutter=m.current_trigger),
    }

    async def set_mode(self, mode: ThermalMode) -> ThermalMode:
        """Switch the thermal camera on or off, or blend it with the visible picture."""
        self._commander.require_feature(self.state.mode, "thermal camera")
        return await self._change(thermal.SetMode(mode), thermal.Mode, lambda m: ThermalMode(m.mode), same_as(mode))

    async def set_rendering(self, mode: RenderingMode, blending: float | None = None) -> tuple[RenderingMode, float]:
        """Set the mixture of thermal and visible picture; `blending` None keeps its share.

        Return both.
        """
        self._commander.require_feature(self.state.rendering, "thermal camera")
        if blending is not None:
            number(blending, "share of the thermal picture")
        return await self._change(
            lambda: thermal.SetRendering(mode, (self.state.blending or 0.0) if blending is None else blending),
            thermal.Rendering,
            lambda m: (RenderingMode(m.mode), float(m.blending_rate)),
            lambda result: is_same(result, (mode, result[1] if blending is None else float(blending))),
        )

    async def set_palette(self, palette: Palette) -> Palette:
        """Set the relation of temperatures to colours; return that of the drone."""
        self._commander.require_feature(self.state.palette, "thermal camera")
        for value in (palette.lowest_k, palette.highest_k, palette.spot_threshold):
            number(value, "palette")
        command = thermal.SetPaletteSettings(
            palette.mode,
            palette.lowest_k,
            palette.highest_k,
            palette.outside,
            palette.range,
            palette.spot,
            palette.spot_threshold,
        )
        return await self._change(command, thermal.PaletteSettings, _palette, same_as(palette))

    async def set_colours(self, colours: Sequence[Colour]) -> tuple[Colour, ...]:
        """Set the colours of the palette; return those of the drone."""
        self._commander.require_feature(self.state.mode, "thermal camera")
        if not 1 <= len(colours) <= MAX_COLOURS:
            raise LocalProtocolError(f"expected 1 to {MAX_COLOURS} colours, got {len(colours)}")
        last = len(colours) - 1
        parts = [
            thermal.SetPalettePart(
                *(colour.red, colour.green, colour.blue, colour.index),
                list_flags=(FIRST if place == 0 else 0) | (LAST if place == last else 0),
            )
            for place, colour in enumerate(colours)
        ]

        def command() -> Message:
            for part in parts[:-1]:
                self._commander.send(part, is_setting=True)
            return parts[-1]

        return await self._change(
            command,
            thermal.PalettePart,
            lambda m: self.state.colours if m.list_flags & LAST else None,
            same_as(tuple(colours)),
        )

    async def set_emissivity(self, emissivity: float) -> float:
        """Set the emissivity of the objects, 0 to 1."""
        self._commander.require_feature(self.state.emissivity, "thermal camera")
        command = thermal.SetEmissivity(number(emissivity, "emissivity"))
        return await self._change(command, thermal.Emissivity, lambda m: float(m.emissivity), same_as(emissivity))

    async def set_background(self, kelvin: float) -> float:
        """Set the temperature of the background that objects reflect, K."""
        self._commander.require_feature(self.state.background_k, "thermal camera")
        return await self._change(
            thermal.SetBackgroundTemperature(number(kelvin, "temperature")),
            thermal.BackgroundTemperature,
            lambda m: float(m.background_temperature),
            same_as(kelvin),
        )

    async def set_sensitivity(self, sensitivity: Sensitivity) -> Sensitivity:
        """Set the sensitivity: HIGH covers hotter objects, LOW finer differences."""
        self._commander.require_feature(self.state.sensitivity, "thermal camera")
        return await self._change(
            thermal.SetSensitivity(sensitivity),
            thermal.Sensitivity,
            lambda m: Sensitivity(m.current_range),
            same_as(sensitivity),
        )

    async def set_shutter(self, trigger: ShutterTrigger) -> ShutterTrigger:
        """Set if the sensor calibrates itself or by `trigger_shutter`."""
        self._commander.require_feature(self.state.shutter, "thermal camera")
        return await self._change(
            thermal.SetShutterMode(trigger),
            thermal.ShutterMode,
            lambda m: ShutterTrigger(m.current_trigger),
            same_as(trigger),
        )

    def trigger_shutter(self) -> None:
        """Calibrate the sensor now. The drone does not confirm it."""
        self._commander.require_feature(self.state.shutter, "thermal camera")
        self._commander.send(thermal.TriggShutter())
