"""Cameras of the ANAFI family as data: the settings that each accepts, in Parrot's terms.

From the capability events that anafi_ros recorded (its `extra` folder) and, for optics, the table of the anafi_ros
paper. What neither gives is marked "assumed".
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from anafi_mav.arsdk.messages.camera import (
    AutoExposureMeteringMode,
    BracketingPreset,
    BurstValue,
    CameraCameraMode,
    CameraPhotoMode,
    CameraRecordingMode,
    CameraStyle,
    ExposureMode,
    Framerate,
    HyperlapseValue,
    IsoSensitivity,
    Model,
    PhotoFileFormat,
    PhotoFormat,
    Resolution,
    ShutterSpeed,
    WhiteBalanceMode,
)

WIDTHS = {
    Resolution.RES_DCI_4K: 4096,
    Resolution.RES_UHD_4K: 3840,
    Resolution.RES_2_7K: 2704,
    Resolution.RES_1080P: 1920,
    Resolution.RES_720P: 1280,
    Resolution.RES_1080P_SD: 1440,
    Resolution.RES_720P_SD: 960,
}
"""Pixels across."""

BITRATES = {
    Resolution.RES_DCI_4K: 100_000_000,
    Resolution.RES_UHD_4K: 100_000_000,
    Resolution.RES_2_7K: 75_000_000,
    Resolution.RES_1080P: 50_000_000,
}
"""bit/s of a recording; the first is Parrot's, the others assumed."""
LOWEST_BITRATE = 20_000_000
"""bit/s of what is not in `BITRATES`. Assumed."""


@dataclass(frozen=True)
class Recording:
    """Settings of a recording that go together."""

    modes: tuple[CameraRecordingMode, ...]
    resolution: Resolution
    framerates: tuple[Framerate, ...]
    hdr: bool = False


@dataclass(frozen=True)
class Photos:
    """Settings of photos that go together."""

    modes: tuple[CameraPhotoMode, ...]
    formats: tuple[PhotoFormat, ...]
    files: tuple[PhotoFileFormat, ...]
    hdr: bool = False


@dataclass(frozen=True)
class Lens:
    """One camera of the older camera feature (143)."""

    id: int
    model: Model
    exposure_modes: tuple[ExposureMode, ...]
    white_balances: tuple[WhiteBalanceMode, ...]
    styles: tuple[CameraStyle, ...]
    metering: tuple[AutoExposureMeteringMode, ...]
    modes: tuple[CameraCameraMode, ...]
    recordings: tuple[Recording, ...]
    photos: tuple[Photos, ...]
    locks: bool
    """Exposure, exposure of a region and white balance can be locked."""
    isos: tuple[IsoSensitivity, ...]
    shutters: tuple[ShutterSpeed, ...]
    hyperlapses: tuple[HyperlapseValue, ...]
    brackets: tuple[BracketingPreset, ...]
    bursts: tuple[BurstValue, ...]
    timelapse_min: float
    """s"""
    gpslapse_min: float
    """m"""
    width: int
    """Pixels across the sensor: what a zoom can use before it has to invent some."""
    optical_zoom: float
    """How much of the zoom is glass."""
    zoom_max: float
    """1: no zoom."""
    hfov: float
    """deg across a video picture at zoom 1."""
    adjustable: bool
    """The alignment with the other camera can be corrected."""


_STANDARD = (CameraRecordingMode.STANDARD, CameraRecordingMode.HYPERLAPSE)
_FAST = (CameraRecordingMode.SLOW_MOTION, CameraRecordingMode.HIGH_FRAMERATE)
_CINEMA = (Framerate.FPS_24, Framerate.FPS_25, Framerate.FPS_30)
_PHOTOS = Photos(tuple(CameraPhotoMode), tuple(PhotoFormat), tuple(PhotoFileFormat), hdr=True)

_4K = Lens(
    id=0,
    model=Model.MAIN,
    exposure_modes=(
        ExposureMode.AUTOMATIC,
        ExposureMode.AUTOMATIC_PREFER_ISO_SENSITIVITY,
        ExposureMode.AUTOMATIC_PREFER_SHUTTER_SPEED,
    ),
    white_balances=(
        WhiteBalanceMode.AUTOMATIC,
        WhiteBalanceMode.INCANDESCENT,
        WhiteBalanceMode.FLUORESCENT,
        WhiteBalanceMode.SUNNY,
        WhiteBalanceMode.CLOUDY,
        WhiteBalanceMode.CUSTOM,
    ),
    styles=(CameraStyle.STANDARD,),
    metering=(AutoExposureMeteringMode.STANDARD,),
    modes=tuple(CameraCameraMode),
    recordings=(
        Recording(_STANDARD, Resolution.RES_1080P, _CINEMA, hdr=True),
        Recording(_STANDARD[:1], Resolution.RES_DCI_4K, _CINEMA[:1]),
        Recording(_STANDARD, Resolution.RES_UHD_4K, _CINEMA, hdr=True),
        Recording(_STANDARD, Resolution.RES_2_7K, _CINEMA, hdr=True),
        Recording(_FAST, Resolution.RES_1080P, (Framerate.FPS_48, Framerate.FPS_50, Framerate.FPS_60)),
        Recording(_FAST, Resolution.RES_720P, (Framerate.FPS_96, Framerate.FPS_100, Framerate.FPS_120)),
    ),
    photos=(_PHOTOS,),
    locks=False,
    isos=tuple(iso for iso in IsoSensitivity if iso >= IsoSensitivity.ISO_100),
    shutters=tuple(ShutterSpeed),
    hyperlapses=tuple(HyperlapseValue),
    brackets=tuple(BracketingPreset),
    bursts=(BurstValue.BURST_14_OVER_1S,),
    timelapse_min=2.0,
    gpslapse_min=1.0,
    width=5344,
    optical_zoom=1.0,
    zoom_max=3.0,
    hfov=69.0,
    adjustable=False,
)

_THERMAL = replace(
    _4K,
    exposure_modes=tuple(ExposureMode),
    # The seventh beside the 4K's six is assumed.
    white_balances=(*_4K.white_balances, WhiteBalanceMode.SHADED),
    styles=tuple(CameraStyle),
    metering=tuple(AutoExposureMeteringMode),
    locks=True,
    adjustable=True,
)
_THERMAL_BLENDED = replace(
    _THERMAL,
    id=2,
    model=Model.THERMAL_BLENDED,
    exposure_modes=(ExposureMode.AUTOMATIC,),
    white_balances=(WhiteBalanceMode.AUTOMATIC,),
    styles=(CameraStyle.STANDARD,),
    metering=(AutoExposureMeteringMode.STANDARD,),
    modes=(CameraCameraMode.RECORDING,),
    recordings=(Recording(_STANDARD[:1], Resolution.RES_720P_SD, (Framerate.FPS_9,)),),
    photos=(),
    locks=False,
    hyperlapses=(),
    brackets=(),
    bursts=(),
    timelapse_min=0.0,
    gpslapse_min=0.0,
    width=960,
    zoom_max=1.0,
    hfov=57.0,
)
_USA = replace(_THERMAL, width=5344, optical_zoom=5.0, zoom_max=32.0)
_USA_BLENDED = replace(
    _THERMAL_BLENDED,
    recordings=(Recording(_STANDARD[:1], Resolution.RES_720P, (Framerate.FPS_8_6,)),),
    width=1280,
    hfov=50.0,
)


AI = replace(
    _THERMAL,
    recordings=(Recording(_STANDARD[:1], Resolution.RES_UHD_4K, _CINEMA),),
    width=8000,
    zoom_max=6.0,
    hfov=68.0,
    adjustable=False,
)
"""Properties of the Ai's camera; its messages are in `camera2`."""


def _bare(blended: Lens) -> Lens:
    """The thermal sensor alone: seen, never recorded by itself."""
    return replace(blended, id=1, model=Model.THERMAL, recordings=())


ANAFI_4K: tuple[Lens, ...] = (_4K,)
THERMAL: tuple[Lens, ...] = (_THERMAL, _bare(_THERMAL_BLENDED), _THERMAL_BLENDED)
USA: tuple[Lens, ...] = (_USA, _bare(_USA_BLENDED), _USA_BLENDED)
