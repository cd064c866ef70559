"""Thermal camera's settings (feature thermal): mode, palette, rendering, scene parameters.

Scene parameters are emissivity and background temperature.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import thermal
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.thermal import (
    ColorizationMode,
    PaletteMode,
    Range,
    RelativeRangeMode,
    RenderingMode,
    ShutterTrigger,
    SpotType,
    ThermalMode,
)
from anafi_mav.units import clip

MAX_PALETTE = 256
"""Colours of a palette; more are not taken."""

_DEFAULT_PALETTE = ((0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0))
"""Black is cold, white is hot. Assumed."""

Colour = tuple[float, float, float, float]
"""Red, green, blue and where in the palette, all 0 to 1."""


class Thermal:
    """Of a Thermal or a USA. Everything is kept and reported; none of it changes a picture."""

    def __init__(self, on_mode: Callable[[ThermalMode], Iterable[Message]]) -> None:
        """Create the settings; `on_mode` receives the mode that is set.

        The messages it returns are sent after the mode.
        """
        self.mode = ThermalMode.DISABLED
        self._on_mode = on_mode
        self._palette: list[Colour] = list(_DEFAULT_PALETTE)
        self._arriving: list[Colour] | None = None
        self._settings = thermal.PaletteSettings(
            PaletteMode.RELATIVE,
            263.15,
            413.15,
            ColorizationMode.EXTENDED,
            RelativeRangeMode.UNLOCKED,
            SpotType.HOT,
            0.5,
        )
        self._rendering = thermal.Rendering(RenderingMode.BLENDED, 0.5)
        self._emissivity = 1.0
        self._background = 293.15
        self._sensitivity = Range.LOW
        self._shutter = ShutterTrigger.AUTO

    def handle(self, message: Message) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for any other message."""
        handler = _HANDLERS.get(type(message))
        return None if handler is None else list(handler(self, message))

    def _set_mode(self, m: thermal.SetMode) -> Iterable[Message]:
        changed = m.mode in tuple(ThermalMode) and m.mode is not self.mode
        if changed:
            self.mode = m.mode
        yield thermal.Mode(self.mode)
        if changed:
            yield from self._on_mode(self.mode)

    def _set_palette_part(self, m: thermal.SetPalettePart) -> Iterable[Message]:
        """Handle one part of a palette and answer it.

        Parts arrive as a list; the palette changes when the last one has arrived.
        """
        if m.list_flags & 1 << ListFlags.FIRST or self._arriving is None:
            self._arriving = []
        numbers = (m.red, m.green, m.blue, m.index)
        if m.list_flags & 1 << ListFlags.EMPTY:
            yield thermal.PalettePart(0.0, 0.0, 0.0, 0.0, m.list_flags)
        elif all(math.isfinite(number) for number in numbers) and len(self._arriving) < MAX_PALETTE:
            red, green, blue, index = (clip(number, 0.0, 1.0) for number in numbers)
            self._arriving.append((red, green, blue, index))
            yield thermal.PalettePart(red, green, blue, index, m.list_flags)
        if m.list_flags & (1 << ListFlags.LAST | 1 << ListFlags.EMPTY):
            self._palette, self._arriving = self._arriving, None

    def _set_palette(self, m: thermal.SetPaletteSettings) -> Iterable[Message]:
        known = (
            m.mode in tuple(PaletteMode)
            and m.outside_colorization in tuple(ColorizationMode)
            and m.relative_range in tuple(RelativeRangeMode)
            and m.spot_type in tuple(SpotType)
        )
        if known and 0.0 <= m.lowest_temp <= m.highest_temp < math.inf and m.spot_threshold == m.spot_threshold:
            self._settings = thermal.PaletteSettings(
                m.mode,
                m.lowest_temp,
                m.highest_temp,
                m.outside_colorization,
                m.relative_range,
                m.spot_type,
                clip(m.spot_threshold, 0.0, 1.0),
            )
        yield self._settings

    def _set_rendering(self, m: thermal.SetRendering) -> Iterable[Message]:
        if m.mode in tuple(RenderingMode) and m.blending_rate == m.blending_rate:
            self._rendering = thermal.Rendering(m.mode, clip(m.blending_rate, 0.0, 1.0))
        yield self._rendering

    def _set_emissivity(self, m: thermal.SetEmissivity) -> Iterable[Message]:
        if m.emissivity == m.emissivity:
            self._emissivity = clip(m.emissivity, 0.0, 1.0)
        yield thermal.Emissivity(self._emissivity)

    def _set_background(self, m: thermal.SetBackgroundTemperature) -> Iterable[Message]:
        if 0.0 <= m.background_temperature < math.inf:
            self._background = m.background_temperature
        yield thermal.BackgroundTemperature(self._background)

    def _set_sensitivity(self, m: thermal.SetSensitivity) -> Iterable[Message]:
        if m.range in tuple(Range):
            self._sensitivity = m.range
        yield thermal.Sensitivity(self._sensitivity)

    def _set_shutter(self, m: thermal.SetShutterMode) -> Iterable[Message]:
        if m.trigger in tuple(ShutterTrigger):
            self._shutter = m.trigger
        yield thermal.ShutterMode(self._shutter)

    def _trigger_shutter(self, m: Message) -> Iterable[Message]:
        return ()

    def _palette_report(self) -> list[Message]:
        if not self._palette:
            return [thermal.PalettePart(0.0, 0.0, 0.0, 0.0, 1 << ListFlags.EMPTY)]
        last = len(self._palette) - 1
        return [
            thermal.PalettePart(*colour, (n == 0) << ListFlags.FIRST | (n == last) << ListFlags.LAST)
            for n, colour in enumerate(self._palette)
        ]

    def states_report(self) -> list[Message]:
        """Return this part's messages of the AllStates answer."""
        return [
            thermal.Capabilities(sum(1 << mode for mode in ThermalMode)),
            thermal.Mode(self.mode),
            *self._palette_report(),
            self._settings,
            self._rendering,
            thermal.Emissivity(self._emissivity),
            thermal.BackgroundTemperature(self._background),
            thermal.Sensitivity(self._sensitivity),
            thermal.ShutterMode(self._shutter),
        ]


_HANDLERS: dict[type[Message], Callable[[Thermal, Any], Iterable[Message]]] = {
    thermal.SetMode: Thermal._set_mode,
    thermal.SetPalettePart: Thermal._set_palette_part,
    thermal.SetPaletteSettings: Thermal._set_palette,
    thermal.SetRendering: Thermal._set_rendering,
    thermal.SetEmissivity: Thermal._set_emissivity,
    thermal.SetBackgroundTemperature: Thermal._set_background,
    thermal.SetSensitivity: Thermal._set_sensitivity,
    thermal.SetShutterMode: Thermal._set_shutter,
    thermal.TriggShutter: Thermal._trigger_shutter,
}
