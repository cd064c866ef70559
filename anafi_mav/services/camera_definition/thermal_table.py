"""The settings of the thermal camera as extended parameters. ANAFI Thermal and USA.

Parrot reports temperatures in K and knows no ranges for them. Here they are degC, as in CAMERA_THERMAL_RANGE.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from msgspec.structs import replace

from anafi_mav.drone import Drone, Palette
from anafi_mav.drone.events import (
    ColorizationMode,
    PaletteMode,
    RelativeRangeMode,
    RenderingMode,
    ShutterTrigger,
    SpotType,
    ThermalMode,
    ThermalSensitivity,
)
from anafi_mav.drone.payload.thermal import ACTIVE_CAMERAS
from anafi_mav.errors import NotSupported
from anafi_mav.services.camera_definition.camera_setting import CameraSetting, Guard, Option, ValueLimits, View
from anafi_mav.services.camera_definition.param_ext_codec import ExtType

ZERO_C = 273.15
"""K."""

COLDEST, HOTTEST = -100.0, 1000.0
"""degC, range of temperatures that can be written. The sensor's own is -10 to 400 degC (Parrot's data sheet); a palette
may reach beyond it."""

OFF = frozenset({int(ThermalMode.DISABLED)})
ON = frozenset({int(ThermalMode.STANDARD), int(ThermalMode.BLENDED)})

RESOLUTION = 1e-3
"""degC, of a temperature that travels as K in single precision."""

_PALETTE_MODES = {PaletteMode.ABSOLUTE: "Absolute", PaletteMode.RELATIVE: "Relative", PaletteMode.SPOT: "Spot"}


def _has_thermal(options: tuple[Option, ...]) -> Callable[[View], tuple[Option, ...]]:
    """Return options that exist where the drone has a thermal camera.

    It reports no capabilities for them.
    """
    return lambda view: options if view.thermal.mode is not None else ()


async def _set_mode(drone: Drone, mode: ThermalMode) -> None:
    if await drone.thermal.set_mode(mode) is mode:
        await drone.camera.until_active(ACTIVE_CAMERAS[mode])  # the next setting is of that camera


def _set_palette(drone: Drone, **changes: object) -> Awaitable[object]:
    palette = drone.thermal.state.palette
    if palette is None:
        raise NotSupported("thermal palette")
    return drone.thermal.set_palette(replace(palette, **changes))


def _of_palette(read: Callable[[Palette], float | None]) -> Callable[[View], float | None]:
    return lambda view: None if view.thermal.palette is None else read(view.thermal.palette)


def _celsius(kelvin: float | None) -> float | None:
    """Return degC; a float on the wire holds K to 1e-4 only."""
    return None if kelvin is None else round(kelvin - ZERO_C, 3)


def _share(view: View) -> ValueLimits | None:
    return None if view.thermal.mode is None else ValueLimits(0.0, 1.0)


def _temperatures(view: View) -> ValueLimits | None:
    return None if view.thermal.mode is None else ValueLimits(COLDEST, HOTTEST)


def _set_rendering(drone: Drone, mode: RenderingMode | None = None, share: float | None = None) -> Awaitable[object]:
    now = drone.thermal.state.rendering
    if now is None:
        raise NotSupported("thermal rendering")
    return drone.thermal.set_rendering(now if mode is None else mode, share)


THERMAL_SETTINGS: tuple[CameraSetting, ...] = (
    CameraSetting(
        "CAM_THERMAL",
        ExtType.CHOICE,
        "Thermal camera",
        read=lambda view: view.thermal.mode,
        write=lambda drone, id, value: _set_mode(drone, ThermalMode(round(value))),
        options=lambda view: tuple(
            Option(mode, text)
            for mode, text in (
                (ThermalMode.DISABLED, "Off"),
                (ThermalMode.BLENDED, "On"),
                (ThermalMode.STANDARD, "Sensor only"),
            )
            if mode in (view.thermal.modes or ())
        ),
        guard=Guard.CAPTURE,
    ),
    CameraSetting(
        "CAM_THM_RENDER",
        ExtType.CHOICE,
        "Thermal rendering",
        read=lambda view: view.thermal.rendering,
        write=lambda drone, id, value: _set_rendering(drone, RenderingMode(round(value))),
        options=_has_thermal(
            (
                Option(RenderingMode.VISIBLE, "Visible"),
                Option(RenderingMode.THERMAL, "Thermal"),
                Option(RenderingMode.BLENDED, "Blended"),
                Option(RenderingMode.MONOCHROME, "Thermal on monochrome"),
            )
        ),
        default=RenderingMode.BLENDED,
        guard=Guard.CAPTURE,
        only_in={"CAM_THERMAL": frozenset({int(ThermalMode.BLENDED)})},
    ),
    CameraSetting(
        "CAM_THM_BLEND",
        ExtType.REAL32,
        "Share of the thermal picture",
        read=lambda view: view.thermal.blending,
        write=lambda drone, id, value: _set_rendering(drone, share=value),
        limits=_share,
        decimals=2,
        default=0.5,
        only_in={
            "CAM_THERMAL": frozenset({int(ThermalMode.BLENDED)}),
            "CAM_THM_RENDER": frozenset({int(RenderingMode.BLENDED)}),
        },
    ),
    CameraSetting(
        "CAM_THM_PALETTE",
        ExtType.CHOICE,
        "Thermal palette",
        read=_of_palette(lambda palette: palette.mode),
        write=lambda drone, id, value: _set_palette(drone, mode=PaletteMode(round(value))),
        options=_has_thermal(tuple(Option(mode, text) for mode, text in _PALETTE_MODES.items())),
        default=PaletteMode.RELATIVE,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_LOW",
        ExtType.REAL32,
        "Lowest temperature of the palette",
        read=_of_palette(lambda palette: _celsius(palette.lowest_k)),
        write=lambda drone, id, value: _set_palette(drone, lowest_k=value + ZERO_C),
        limits=_temperatures,
        unit="degC",
        decimals=1,
        resolution=RESOLUTION,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_HIGH",
        ExtType.REAL32,
        "Highest temperature of the palette",
        read=_of_palette(lambda palette: _celsius(palette.highest_k)),
        write=lambda drone, id, value: _set_palette(drone, highest_k=value + ZERO_C),
        limits=_temperatures,
        unit="degC",
        decimals=1,
        resolution=RESOLUTION,
        default=100.0,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_OUTSIDE",
        ExtType.CHOICE,
        "Colours beyond the palette",
        read=_of_palette(lambda palette: palette.outside),
        write=lambda drone, id, value: _set_palette(drone, outside=ColorizationMode(round(value))),
        options=_has_thermal(
            (Option(ColorizationMode.LIMITED, "None"), Option(ColorizationMode.EXTENDED, "Last colour"))
        ),
        default=ColorizationMode.EXTENDED,
        only_in={"CAM_THERMAL": ON, "CAM_THM_PALETTE": frozenset({int(PaletteMode.ABSOLUTE)})},
    ),
    CameraSetting(
        "CAM_THM_RANGE",
        ExtType.CHOICE,
        "Range of the palette",
        read=_of_palette(lambda palette: palette.range),
        write=lambda drone, id, value: _set_palette(drone, range=RelativeRangeMode(round(value))),
        options=_has_thermal(
            (Option(RelativeRangeMode.LOCKED, "Fixed"), Option(RelativeRangeMode.UNLOCKED, "Picture"))
        ),
        default=RelativeRangeMode.UNLOCKED,
        only_in={"CAM_THERMAL": ON, "CAM_THM_PALETTE": frozenset({int(PaletteMode.RELATIVE)})},
    ),
    CameraSetting(
        "CAM_THM_SPOT",
        ExtType.CHOICE,
        "Spots",
        read=_of_palette(lambda palette: palette.spot),
        write=lambda drone, id, value: _set_palette(drone, spot=SpotType(round(value))),
        options=_has_thermal((Option(SpotType.COLD, "Cold"), Option(SpotType.HOT, "Hot"))),
        default=SpotType.HOT,
        only_in={"CAM_THERMAL": ON, "CAM_THM_PALETTE": frozenset({int(PaletteMode.SPOT)})},
    ),
    CameraSetting(
        "CAM_THM_SPOTLIM",
        ExtType.REAL32,
        "Threshold of spots",
        read=_of_palette(lambda palette: palette.spot_threshold),
        write=lambda drone, id, value: _set_palette(drone, spot_threshold=value),
        limits=_share,
        decimals=2,
        default=0.5,
        only_in={"CAM_THERMAL": ON, "CAM_THM_PALETTE": frozenset({int(PaletteMode.SPOT)})},
    ),
    CameraSetting(
        "CAM_THM_EMISS",
        ExtType.REAL32,
        "Emissivity",
        read=lambda view: view.thermal.emissivity,
        write=lambda drone, id, value: drone.thermal.set_emissivity(value),
        limits=_share,
        decimals=2,
        default=1.0,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_BACKGR",
        ExtType.REAL32,
        "Background temperature",
        read=lambda view: _celsius(view.thermal.background_k),
        write=lambda drone, id, value: drone.thermal.set_background(value + ZERO_C),
        limits=_temperatures,
        unit="degC",
        decimals=1,
        resolution=RESOLUTION,
        default=20.0,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_SENS",
        ExtType.CHOICE,
        "Thermal sensitivity",
        read=lambda view: view.thermal.sensitivity,
        write=lambda drone, id, value: drone.thermal.set_sensitivity(ThermalSensitivity(round(value))),
        options=_has_thermal(
            (Option(ThermalSensitivity.HIGH, "Wide range"), Option(ThermalSensitivity.LOW, "Fine differences"))
        ),
        default=ThermalSensitivity.LOW,
        only_in={"CAM_THERMAL": ON},
    ),
    CameraSetting(
        "CAM_THM_SHUTTER",
        ExtType.CHOICE,
        "Thermal calibration",
        read=lambda view: view.thermal.shutter,
        write=lambda drone, id, value: drone.thermal.set_shutter(ShutterTrigger(round(value))),
        options=_has_thermal((Option(ShutterTrigger.AUTO, "Automatic"), Option(ShutterTrigger.MANUAL, "By command"))),
        guard=Guard.NONE,
        only_in={"CAM_THERMAL": ON},
    ),
)
