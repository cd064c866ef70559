"""The settings of the cameras as extended parameters, in the order of stations' lists.

Names that QGroundControl looks for by name: CAM_MODE, CAM_EXPMODE, CAM_EV, CAM_ISO, CAM_SHUTTERSPD, CAM_WBMODE
(VehicleCameraControl.h). The numbers of a choice are ours and stay: stations store them. Parrot's own numbers differ
between the Ai and the other models.
"""

from __future__ import annotations

import enum
from collections.abc import Awaitable, Callable, Iterable, Mapping
from fractions import Fraction
from typing import TypeVar

from anafi_mav.drone import (
    Antiflicker,
    Bracketing,
    Burst,
    CameraMode,
    Drone,
    ExposureMode,
    ExposureSettings,
    Metering,
    PhotoFile,
    PhotoFormat,
    PhotoMode,
    PhotoSettings,
    Range,
    RecordingMode,
    RecordingSettings,
    Resolution,
    StoragePolicy,
    Streaming,
    Style,
    StyleSettings,
    VideoCodec,
    WhiteBalance,
)
from anafi_mav.errors import CommandRejected, NotSupported
from anafi_mav.services.camera_definition.camera_setting import CameraSetting, Guard, Option, ValueLimits, View
from anafi_mav.services.camera_definition.param_ext_codec import ExtType
from anafi_mav.services.camera_definition.setting_fit import fitting_photo, fitting_recording

WordT = TypeVar("WordT", bound=enum.Enum)
Choice = Mapping[WordT, tuple[int, str]]
"""Number and text of each value."""

LONGEST_INTERVAL = 3600.0
"""s or m, the longest interval of a series. The Ai reports it; other drones may report the shortest one only, or the
largest number that there is."""

MODES: Choice[CameraMode] = {CameraMode.PHOTO: (0, "Photo"), CameraMode.RECORDING: (1, "Video")}
"""Numbers of MAVLink's CAMERA_MODE."""

PHOTO_MODES: Choice[PhotoMode] = {
    PhotoMode.SINGLE: (0, "Single"),
    PhotoMode.BRACKETING: (1, "Bracketing"),
    PhotoMode.BURST: (2, "Burst"),
    PhotoMode.TIME_LAPSE: (3, "Time-lapse"),
    PhotoMode.GPS_LAPSE: (4, "GPS-lapse"),
}
PHOTO_FORMATS: Choice[PhotoFormat] = {
    PhotoFormat.FULL_FRAME: (0, "Full frame"),
    PhotoFormat.RECTILINEAR: (1, "Rectilinear"),
    PhotoFormat.FULL_FRAME_STABILIZED: (2, "Full frame, stabilised"),
}
PHOTO_FILES: Choice[PhotoFile] = {
    PhotoFile.JPEG: (0, "JPEG"),
    PhotoFile.DNG: (1, "DNG"),
    PhotoFile.DNG_JPEG: (2, "DNG and JPEG"),
}
BURSTS: Choice[Burst] = {
    Burst.B14_OVER_4S: (0, "14 in 4 s"),
    Burst.B14_OVER_2S: (1, "14 in 2 s"),
    Burst.B14_OVER_1S: (2, "14 in 1 s"),
    Burst.B10_OVER_4S: (3, "10 in 4 s"),
    Burst.B10_OVER_2S: (4, "10 in 2 s"),
    Burst.B10_OVER_1S: (5, "10 in 1 s"),
    Burst.B4_OVER_4S: (6, "4 in 4 s"),
    Burst.B4_OVER_2S: (7, "4 in 2 s"),
    Burst.B4_OVER_1S: (8, "4 in 1 s"),
}
BRACKETS: Choice[Bracketing] = {
    Bracketing.EV1: (0, "1 EV"),
    Bracketing.EV2: (1, "2 EV"),
    Bracketing.EV3: (2, "3 EV"),
    Bracketing.EV1_EV2: (3, "1, 2 EV"),
    Bracketing.EV1_EV3: (4, "1, 3 EV"),
    Bracketing.EV2_EV3: (5, "2, 3 EV"),
    Bracketing.EV1_EV2_EV3: (6, "1, 2, 3 EV"),
}
VIDEO_MODES: Choice[RecordingMode] = {
    RecordingMode.STANDARD: (0, "Standard"),
    RecordingMode.HYPERLAPSE: (1, "Hyperlapse"),
    RecordingMode.SLOW_MOTION: (2, "Slow motion"),
    RecordingMode.HIGH_FRAMERATE: (3, "High frame rate"),
}
RESOLUTIONS: Choice[Resolution] = {
    Resolution.UHD_8K: (8, "8K"),
    Resolution.R5K: (9, "5K"),
    Resolution.DCI_4K: (0, "4096 x 2160 (DCI 4K)"),
    Resolution.UHD_4K: (1, "3840 x 2160 (UHD 4K)"),
    Resolution.R2_7K: (2, "2704 x 1524 (2.7K)"),
    Resolution.R1080P: (3, "1920 x 1080"),
    Resolution.R720P: (4, "1280 x 720"),
    Resolution.R480P: (5, "856 x 480"),
    Resolution.R1080P_SD: (6, "1440 x 1080"),
    Resolution.R720P_SD: (7, "960 x 720"),
}
EXPOSURES: Choice[ExposureMode] = {
    ExposureMode.AUTOMATIC: (0, "Automatic"),
    ExposureMode.MANUAL: (1, "Manual"),
    ExposureMode.AUTOMATIC_PREFER_ISO: (2, "Automatic, prefer low ISO"),
    ExposureMode.AUTOMATIC_PREFER_SHUTTER: (3, "Automatic, prefer fast shutter"),
    ExposureMode.MANUAL_ISO: (4, "Manual ISO"),
    ExposureMode.MANUAL_SHUTTER: (5, "Manual shutter"),
}
METERINGS: Choice[Metering] = {Metering.STANDARD: (0, "Whole picture"), Metering.CENTER_TOP: (1, "Upper centre")}
WHITE_BALANCES: Choice[WhiteBalance] = {
    WhiteBalance.AUTOMATIC: (0, "Automatic"),
    WhiteBalance.CUSTOM: (1, "Temperature"),
    WhiteBalance.SUNNY: (2, "Sunny"),
    WhiteBalance.CLOUDY: (3, "Cloudy"),
    WhiteBalance.SHADED: (4, "Shade"),
    WhiteBalance.INCANDESCENT: (5, "Incandescent"),
    WhiteBalance.FLUORESCENT: (6, "Fluorescent"),
    WhiteBalance.DAYLIGHT: (7, "Daylight"),
    WhiteBalance.SUNSET: (8, "Sunset"),
    WhiteBalance.CANDLE: (9, "Candle"),
    WhiteBalance.WARM_WHITE_FLUORESCENT: (10, "Warm white fluorescent"),
    WhiteBalance.COOL_WHITE_FLUORESCENT: (11, "Cool white fluorescent"),
    WhiteBalance.HALOGEN: (12, "Halogen"),
    WhiteBalance.FLASH: (13, "Flash"),
    WhiteBalance.SNOW: (14, "Snow"),
    WhiteBalance.HAZY: (15, "Haze"),
    WhiteBalance.GREEN_FOLIAGE: (16, "Foliage"),
    WhiteBalance.BLUE_SKY: (17, "Blue sky"),
}
STYLES: Choice[Style] = {
    Style.STANDARD: (0, "Standard"),
    Style.PLOG: (1, "P-Log"),
    Style.INTENSE: (2, "Intense"),
    Style.PASTEL: (3, "Pastel"),
    Style.CUSTOM: (4, "Custom"),
    Style.PHOTOGRAMMETRY: (5, "Photogrammetry"),
}
CODECS: Choice[VideoCodec] = {VideoCodec.H264: (0, "H.264"), VideoCodec.H265: (1, "H.265")}
STORAGES: Choice[StoragePolicy] = {
    StoragePolicy.PRIORITY_REMOVABLE: (0, "Card, else internal"),
    StoragePolicy.REMOVABLE: (1, "Card"),
    StoragePolicy.PRIORITY_INTERNAL: (2, "Internal, else card"),
    StoragePolicy.INTERNAL: (3, "Internal"),
}
STREAMINGS: Choice[Streaming] = {
    Streaming.LOW_LATENCY: (0, "Low latency"),
    Streaming.HIGH_RELIABILITY: (1, "High reliability"),
    Streaming.HIGH_RELIABILITY_LOW_FRAMERATE: (2, "High reliability, low frame rate"),
}
ANTIFLICKERS: Choice[Antiflicker] = {
    Antiflicker.OFF: (0, "Off"),
    Antiflicker.AUTO: (1, "Automatic"),
    Antiflicker.HZ_50: (2, "50 Hz"),
    Antiflicker.HZ_60: (3, "60 Hz"),
}

OFF_ON = (Option(0, "Off"), Option(1, "On"))


def number_of(choice: Choice[WordT], word: WordT | None) -> float | None:
    """Return the number of a value; None for one that is not reported."""
    return None if word is None else choice[word][0]


def word_of(choice: Choice[WordT], value: float) -> WordT:
    """Return the value of a number. Raises `NotSupported` for one that has no value."""
    for word, (number, _) in choice.items():
        if number == value:
            return word
    raise NotSupported(f"value {value:g}")


def choices(choice: Choice[WordT], accepted: Iterable[WordT] | None) -> tuple[Option, ...]:
    """Return the options for the accepted values, in the sequence of the choice."""
    known = frozenset(accepted or ())
    return tuple(Option(*entry) for word, entry in choice.items() if word in known)


def switch(reported: bool | None) -> tuple[Option, ...]:
    """Return Off and On for a switch that the camera reports."""
    return () if reported is None else OFF_ON


def flag(value: bool | None) -> float | None:
    return None if value is None else float(value)


def limits_of(setting: Range | None, step: float | None = None) -> ValueLimits | None:
    """Return the range that the drone reports with a setting."""
    return None if setting is None else ValueLimits(setting.min, setting.max, step)


def shutter_text(seconds: float) -> str:
    """Return "1/60" for a time below one second, "2" for one of seconds."""
    if seconds >= 1.0:
        return f"{seconds:g}"
    return f"1/{float(Fraction(1.0 / seconds).limit_denominator(2)):g}"


def ev_text(ev: float) -> str:
    """Return "+1/3", "-2" or "+1 2/3"."""
    thirds = round(abs(ev) * 3)
    whole, part = divmod(thirds, 3)
    text = " ".join([*([str(whole)] if whole or not part else []), *([f"{part}/3"] if part else [])])
    return f"{'-' if ev < 0.0 else '+'}{text}" if thirds else "0"


# -- readers


def photo(view: View) -> PhotoSettings:
    return view.camera.photo or PhotoSettings()


def recording(view: View) -> RecordingSettings:
    return view.camera.recording or RecordingSettings()


def exposure(view: View) -> ExposureSettings:
    return view.camera.exposure or ExposureSettings()


def style(view: View) -> StyleSettings:
    return view.camera.style or StyleSettings()


def current(setting: Range | None) -> float | None:
    return None if setting is None else setting.current


# -- writers


def set_photo(drone: Drone, id: int, wish: PhotoSettings) -> Awaitable[object]:
    return drone.camera.set_photo(fitting_photo(drone.camera[id], wish), id)


def set_recording(drone: Drone, id: int, wish: RecordingSettings) -> Awaitable[object]:
    return drone.camera.set_recording(fitting_recording(drone.camera[id], wish), id)


def set_exposure(drone: Drone, id: int, wish: ExposureSettings) -> Awaitable[object]:
    return drone.camera.set_exposure(wish, id)


def set_temperature(drone: Drone, id: int, kelvin: float) -> Awaitable[object]:
    mode = drone.camera[id].white_balance
    if mode is None:
        raise NotSupported("white balance")
    return drone.camera.set_white_balance(mode, kelvin, id)


def set_level(drone: Drone, id: int, name: str, value: float) -> Awaitable[object]:
    """Set one of the three levels of the style; the others stay."""
    levels = drone.camera[id].style or StyleSettings()
    saturation, contrast, sharpness = (
        value if name == one else (current(getattr(levels, one)) or 0.0)
        for one in ("saturation", "contrast", "sharpness")
    )
    return drone.camera.set_style_params(saturation, contrast, sharpness, id)


def set_axis(drone: Drone, id: int, axis: str, value: float) -> Awaitable[object]:
    """Set one axis of the alignment; the others stay."""
    now = drone.camera[id].alignment
    yaw, pitch, roll = (value if axis == one else (current(now.get(one)) or 0.0) for one in ("yaw", "pitch", "roll"))
    return drone.camera.set_alignment(yaw, pitch, roll, id)


def level(name: str, parameter: str, title: str) -> CameraSetting:
    def limits(view: View) -> ValueLimits | None:
        # The older cameras count whole steps (camera.xml style), the Ai has a continuous scale.
        step = 1.0 if view.camera.feature == "camera" else None
        return limits_of(getattr(style(view), name), step)

    return CameraSetting(
        parameter,
        ExtType.REAL32,
        title,
        read=lambda view: current(getattr(style(view), name)),
        write=lambda drone, id, value: set_level(drone, id, name, value),
        limits=limits,
        decimals=2,
    )


def axis(name: str, parameter: str, title: str) -> CameraSetting:
    return CameraSetting(
        parameter,
        ExtType.REAL32,
        title,
        read=lambda view: current(view.camera.alignment.get(name)),
        write=lambda drone, id, value: set_axis(drone, id, name, value),
        limits=lambda view: limits_of(view.camera.alignment.get(name)),
        unit="deg",
        decimals=2,
    )


def bounded(bounds: tuple[float, float] | None) -> ValueLimits | None:
    """Return the range of an interval."""
    if bounds is None or bounds[0] <= 0.0:
        return None  # a camera without such a series reports 0
    return ValueLimits(bounds[0], min(bounds[1], LONGEST_INTERVAL))


def interval(mode: PhotoMode, view: View) -> float | None:
    """Return the interval of a series; None while the camera does not report it.

    The older cameras have one number for both, and report that of the photo mode.
    """
    return photo(view).interval_of(mode)


def set_interval(drone: Drone, id: int, mode: PhotoMode, value: float) -> Awaitable[object]:
    now = drone.camera[id].photo
    if now is None or now.interval_of(mode) is None:
        raise CommandRejected("other photo mode")
    is_other = PhotoMode.GPS_LAPSE in (now.mode, mode) and now.mode is not mode
    return set_photo(drone, id, PhotoSettings(other_interval=value) if is_other else PhotoSettings(interval=value))


def union(sets: Iterable[Iterable[WordT]]) -> frozenset[WordT]:
    return frozenset(value for values in sets for value in values)


def numbers(values: Iterable[float], text: Callable[[float], str]) -> tuple[Option, ...]:
    return tuple(Option(value, text(value)) for value in values)


def plain(value: float) -> str:
    return f"{value:g}"


PHOTO = frozenset({MODES[CameraMode.PHOTO][0]})
VIDEO = frozenset({MODES[CameraMode.RECORDING][0]})
AUTOMATIC = frozenset(
    EXPOSURES[mode][0]
    for mode in (
        ExposureMode.AUTOMATIC,
        ExposureMode.AUTOMATIC_PREFER_ISO,
        ExposureMode.AUTOMATIC_PREFER_SHUTTER,
    )
)
MANUAL, MANUAL_ISO, MANUAL_SHUTTER = (
    frozenset({EXPOSURES[mode][0]})
    for mode in (ExposureMode.MANUAL, ExposureMode.MANUAL_ISO, ExposureMode.MANUAL_SHUTTER)
)

CAMERA_SETTINGS: tuple[CameraSetting, ...] = (
    CameraSetting(
        "CAM_MODE",
        ExtType.CHOICE,
        "Camera mode",
        read=lambda view: number_of(MODES, view.camera.mode),
        write=lambda drone, id, value: drone.camera.set_mode(word_of(MODES, value), id),
        options=lambda view: choices(MODES, view.camera.modes),
        default=1,
        guard=Guard.CAPTURE,
        is_listed=False,
    ),
    # -- photos
    CameraSetting(
        "CAM_PHOTOMODE",
        ExtType.CHOICE,
        "Photo mode",
        read=lambda view: number_of(PHOTO_MODES, photo(view).mode),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(mode=word_of(PHOTO_MODES, value))),
        options=lambda view: choices(PHOTO_MODES, union(one.modes for one in view.camera.photos)),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_PHOTOPROJ",
        ExtType.CHOICE,
        "Photo projection",
        read=lambda view: number_of(PHOTO_FORMATS, photo(view).format),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(format=word_of(PHOTO_FORMATS, value))),
        options=lambda view: choices(PHOTO_FORMATS, union(one.formats for one in view.camera.photos)),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_PHOTOFMT",
        ExtType.CHOICE,
        "Photo file",
        read=lambda view: number_of(PHOTO_FILES, photo(view).file),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(file=word_of(PHOTO_FILES, value))),
        options=lambda view: choices(PHOTO_FILES, union(one.files for one in view.camera.photos)),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_PHOTORES",
        ExtType.INT32,
        "Photo resolution",
        read=lambda view: photo(view).megapixels,
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(megapixels=value)),
        options=lambda view: numbers(view.camera.megapixels, lambda size: f"{size:g} MP"),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_PHOTOBURST",
        ExtType.CHOICE,
        "Burst",
        read=lambda view: number_of(BURSTS, photo(view).burst),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(burst=word_of(BURSTS, value))),
        options=lambda view: choices(BURSTS, view.camera.bursts),
        default=2,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO, "CAM_PHOTOMODE": frozenset({PHOTO_MODES[PhotoMode.BURST][0]})},
    ),
    CameraSetting(
        "CAM_PHOTOBRKT",
        ExtType.CHOICE,
        "Bracketing",
        read=lambda view: number_of(BRACKETS, photo(view).bracketing),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(bracketing=word_of(BRACKETS, value))),
        options=lambda view: choices(BRACKETS, view.camera.brackets),
        default=6,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO, "CAM_PHOTOMODE": frozenset({PHOTO_MODES[PhotoMode.BRACKETING][0]})},
    ),
    CameraSetting(
        "CAM_PHOTOLAPSE",
        ExtType.REAL32,
        "Time-lapse interval",
        read=lambda view: interval(PhotoMode.TIME_LAPSE, view),
        write=lambda drone, id, value: set_interval(drone, id, PhotoMode.TIME_LAPSE, value),
        limits=lambda view: bounded(view.camera.time_lapse_bounds),
        unit="s",
        decimals=1,
        default=2.0,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO, "CAM_PHOTOMODE": frozenset({PHOTO_MODES[PhotoMode.TIME_LAPSE][0]})},
    ),
    CameraSetting(
        "CAM_PHOTODIST",
        ExtType.REAL32,
        "GPS-lapse distance",
        read=lambda view: interval(PhotoMode.GPS_LAPSE, view),
        write=lambda drone, id, value: set_interval(drone, id, PhotoMode.GPS_LAPSE, value),
        limits=lambda view: bounded(view.camera.gps_lapse_bounds),
        unit="m",
        decimals=1,
        default=10.0,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO, "CAM_PHOTOMODE": frozenset({PHOTO_MODES[PhotoMode.GPS_LAPSE][0]})},
    ),
    # -- videos
    CameraSetting(
        "CAM_PHOTOSIGN",
        ExtType.CHOICE,
        "Sign photos",
        read=lambda view: flag(photo(view).signed),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(signed=value != 0.0)),
        options=lambda view: OFF_ON if view.camera.signable else (),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_PHOTOLIVE",
        ExtType.CHOICE,
        "Live video while a photo is taken",
        read=lambda view: flag(photo(view).keeps_live_video),
        write=lambda drone, id, value: set_photo(drone, id, PhotoSettings(keeps_live_video=value != 0.0)),
        options=lambda view: OFF_ON if view.camera.live_video_keepable else (),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": PHOTO},
    ),
    CameraSetting(
        "CAM_VIDMODE",
        ExtType.CHOICE,
        "Video mode",
        read=lambda view: number_of(VIDEO_MODES, recording(view).mode),
        write=lambda drone, id, value: set_recording(drone, id, RecordingSettings(mode=word_of(VIDEO_MODES, value))),
        options=lambda view: choices(VIDEO_MODES, union(one.modes for one in view.camera.recordings)),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO},
    ),
    CameraSetting(
        "CAM_VIDRES",
        ExtType.CHOICE,
        "Video resolution",
        read=lambda view: number_of(RESOLUTIONS, recording(view).resolution),
        write=lambda drone, id, value: set_recording(
            drone, id, RecordingSettings(resolution=word_of(RESOLUTIONS, value))
        ),
        options=lambda view: choices(RESOLUTIONS, union(one.resolutions for one in view.camera.recordings)),
        default=1,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO},
    ),
    CameraSetting(
        "CAM_VIDFPS",
        ExtType.REAL32,
        "Video frame rate",
        read=lambda view: recording(view).framerate,
        write=lambda drone, id, value: set_recording(drone, id, RecordingSettings(framerate=value)),
        options=lambda view: numbers(
            sorted({rate for one in view.camera.recordings for rate in one.framerates}), plain
        ),
        unit="Hz",
        default=30.0,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO},
    ),
    CameraSetting(
        "CAM_VIDLAPSE",
        ExtType.INT32,
        "Hyperlapse",
        read=lambda view: recording(view).hyperlapse,
        write=lambda drone, id, value: set_recording(drone, id, RecordingSettings(hyperlapse=round(value))),
        options=lambda view: numbers(view.camera.hyperlapses, lambda ratio: f"1 of {ratio:g}"),
        default=15,
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO, "CAM_VIDMODE": frozenset({VIDEO_MODES[RecordingMode.HYPERLAPSE][0]})},
    ),
    CameraSetting(
        "CAM_VIDRATE",
        ExtType.INT32,
        "Video bit rate",
        read=lambda view: recording(view).bitrate,
        write=lambda drone, id, value: set_recording(drone, id, RecordingSettings(bitrate=round(value))),
        options=lambda view: numbers(view.camera.bitrates, lambda rate: f"{rate / 1e6:g} Mbit/s"),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO},
    ),
    CameraSetting(
        "CAM_VIDCODEC",
        ExtType.CHOICE,
        "Video codec",
        read=lambda view: number_of(CODECS, recording(view).codec),
        write=lambda drone, id, value: set_recording(drone, id, RecordingSettings(codec=word_of(CODECS, value))),
        options=lambda view: choices(CODECS, view.camera.codecs),
        guard=Guard.CAPTURE,
        only_in={"CAM_MODE": VIDEO},
    ),
    CameraSetting(
        "CAM_STORAGE",
        ExtType.CHOICE,
        "Storage",
        read=lambda view: number_of(STORAGES, view.camera.storage_policy),
        write=lambda drone, id, value: drone.camera.set_storage_policy(word_of(STORAGES, value), id),
        options=lambda view: choices(STORAGES, view.camera.storage_policies),
        guard=Guard.CAPTURE,
    ),
    CameraSetting(
        "CAM_AUTOREC",
        ExtType.CHOICE,
        "Record from take-off to landing",
        read=lambda view: flag(view.camera.autorecord),
        write=lambda drone, id, value: drone.camera.set_autorecord(value != 0.0, id),
        options=lambda view: switch(view.camera.autorecord),
        guard=Guard.NONE,
    ),
    CameraSetting(
        "CAM_HDR",
        ExtType.CHOICE,
        "HDR",
        read=lambda view: flag(view.camera.hdr),
        write=lambda drone, id, value: drone.camera.set_hdr(value != 0.0, id),
        options=lambda view: switch(view.camera.hdr),
        # Parrot names no setting that ends a recording (STOPPED_RECONFIGURED); this one changes how the sensor is read.
        guard=Guard.CAPTURE,
    ),
    # -- light
    CameraSetting(
        "CAM_EXPMODE",
        ExtType.CHOICE,
        "Exposure mode",
        read=lambda view: number_of(EXPOSURES, exposure(view).mode),
        write=lambda drone, id, value: set_exposure(drone, id, ExposureSettings(mode=word_of(EXPOSURES, value))),
        options=lambda view: choices(EXPOSURES, view.camera.exposures),
    ),
    CameraSetting(
        "CAM_EV",
        ExtType.REAL32,
        "Exposure compensation",
        read=lambda view: view.camera.ev,
        write=lambda drone, id, value: drone.camera.set_ev(value, id),
        options=lambda view: numbers(view.camera.evs, ev_text),
        unit="EV",
        only_in={"CAM_EXPMODE": AUTOMATIC | MANUAL_ISO | MANUAL_SHUTTER},
    ),
    CameraSetting(
        "CAM_SHUTTERSPD",
        ExtType.REAL32,
        "Shutter time",
        read=lambda view: exposure(view).shutter_s,
        write=lambda drone, id, value: set_exposure(drone, id, ExposureSettings(shutter_s=value)),
        options=lambda view: numbers(view.camera.shutters, shutter_text),
        unit="s",
        default=1.0 / 60.0,
        only_in={"CAM_EXPMODE": MANUAL | MANUAL_SHUTTER},
    ),
    CameraSetting(
        "CAM_ISO",
        ExtType.INT32,
        "ISO",
        read=lambda view: exposure(view).iso,
        write=lambda drone, id, value: set_exposure(drone, id, ExposureSettings(iso=value)),
        options=lambda view: numbers(view.camera.isos, plain),
        default=100,
        only_in={"CAM_EXPMODE": MANUAL | MANUAL_ISO},
    ),
    CameraSetting(
        "CAM_ISOMAX",
        ExtType.INT32,
        "Highest ISO",
        read=lambda view: exposure(view).max_iso,
        write=lambda drone, id, value: set_exposure(drone, id, ExposureSettings(max_iso=value)),
        options=lambda view: numbers(view.camera.max_isos, plain),
        default=3200,
        only_in={"CAM_EXPMODE": AUTOMATIC},
    ),
    CameraSetting(
        "CAM_METERING",
        ExtType.CHOICE,
        "Metering",
        read=lambda view: number_of(METERINGS, exposure(view).metering),
        write=lambda drone, id, value: set_exposure(drone, id, ExposureSettings(metering=word_of(METERINGS, value))),
        options=lambda view: choices(METERINGS, view.camera.meterings),
        only_in={"CAM_EXPMODE": AUTOMATIC | MANUAL_ISO | MANUAL_SHUTTER},
    ),
    CameraSetting(
        "CAM_AELOCK",
        ExtType.CHOICE,
        "Lock exposure",
        read=lambda view: flag(view.camera.exposure_locked),
        write=lambda drone, id, value: drone.camera.lock_exposure(value != 0.0, id=id),
        options=lambda view: OFF_ON if view.camera.exposure_lockable else (),
        only_in={"CAM_EXPMODE": AUTOMATIC | MANUAL_ISO | MANUAL_SHUTTER},
    ),
    CameraSetting(
        "CAM_WBMODE",
        ExtType.CHOICE,
        "White balance",
        read=lambda view: number_of(WHITE_BALANCES, view.camera.white_balance),
        write=lambda drone, id, value: drone.camera.set_white_balance(word_of(WHITE_BALANCES, value), id=id),
        options=lambda view: choices(WHITE_BALANCES, view.camera.white_balances),
    ),
    CameraSetting(
        "CAM_WBTEMP",
        ExtType.INT32,
        "White balance temperature",
        read=lambda view: view.camera.temperature_k,
        write=set_temperature,
        options=lambda view: numbers(view.camera.temperatures, lambda kelvin: f"{kelvin:g} K"),
        unit="K",
        default=5000,
        only_in={"CAM_WBMODE": frozenset({WHITE_BALANCES[WhiteBalance.CUSTOM][0]})},
    ),
    CameraSetting(
        "CAM_WBLOCK",
        ExtType.CHOICE,
        "Lock white balance",
        read=lambda view: flag(view.camera.white_balance_locked),
        write=lambda drone, id, value: drone.camera.lock_white_balance(value != 0.0, id),
        options=lambda view: OFF_ON if view.camera.white_balance_lockable else (),
        only_in={
            "CAM_WBMODE": frozenset(
                number for balance, (number, _) in WHITE_BALANCES.items() if balance is not WhiteBalance.CUSTOM
            )
        },
    ),
    CameraSetting(
        "CAM_ANTIFLICKER",
        ExtType.CHOICE,
        "Anti-flicker",
        read=lambda view: number_of(ANTIFLICKERS, view.cameras.antiflicker),
        write=lambda drone, id, value: drone.camera.set_antiflicker(word_of(ANTIFLICKERS, value)),
        options=lambda view: choices(ANTIFLICKERS, view.cameras.antiflickers),
        default=1,
    ),
    # -- picture
    CameraSetting(
        "CAM_STYLE",
        ExtType.CHOICE,
        "Style",
        read=lambda view: number_of(STYLES, style(view).style),
        write=lambda drone, id, value: drone.camera.set_style(word_of(STYLES, value), id),
        options=lambda view: choices(STYLES, view.camera.styles),
    ),
    level("saturation", "CAM_SATURATION", "Saturation"),
    level("contrast", "CAM_CONTRAST", "Contrast"),
    level("sharpness", "CAM_SHARPNESS", "Sharpness"),
    # -- zoom and live video
    CameraSetting(
        "CAM_ZOOMSPEED",
        ExtType.REAL32,
        "Highest zoom speed (tan(deg)/s)",
        read=lambda view: view.camera.zoom_speed,
        write=lambda drone, id, value: drone.camera.set_zoom_speed(value, id),
        limits=lambda view: limits_of(view.camera.zoom_speed_range),
        decimals=2,
        default=0.34,
        guard=Guard.NONE,
    ),
    CameraSetting(
        "CAM_ZOOMLOSSY",
        ExtType.CHOICE,
        "Zoom beyond the lossless range",
        read=lambda view: flag(view.camera.zoom_may_degrade),
        write=lambda drone, id, value: drone.camera.set_zoom_may_degrade(value != 0.0, id),
        options=lambda view: switch(view.camera.zoom_may_degrade),
        guard=Guard.NONE,
    ),
    CameraSetting(
        "CAM_STREAMING",
        ExtType.CHOICE,
        "Live video",
        read=lambda view: number_of(STREAMINGS, view.camera.streaming),
        write=lambda drone, id, value: drone.camera.set_streaming(word_of(STREAMINGS, value), id),
        options=lambda view: choices(STREAMINGS, view.camera.streamings),
        guard=Guard.NONE,
    ),
    axis("yaw", "CAM_ALIGN_YAW", "Alignment, yaw"),
    axis("pitch", "CAM_ALIGN_PITCH", "Alignment, pitch"),
    axis("roll", "CAM_ALIGN_ROLL", "Alignment, roll"),
)
