"""State that the cameras of a drone report, in the vocabulary of `camera_enums`.

It is the same whichever of Parrot's features reports it.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import Any

import msgspec
from msgspec.structs import replace

from anafi_mav.drone.element import Range, with_item
from anafi_mav.drone.payload.camera_enums import (
    Antiflicker,
    Bracketing,
    Burst,
    CameraKind,
    CameraMode,
    ExposureMode,
    Metering,
    PhotoFile,
    PhotoFormat,
    PhotoMode,
    RecordingMode,
    Resolution,
    StoragePolicy,
    Streaming,
    Style,
    VideoCodec,
    WhiteBalance,
)

MAX_OPTIONS = 64
"""Combinations of settings that are kept of a camera; Parrot's have a dozen, more is a confused peer."""


class PhotoSettings(msgspec.Struct, frozen=True):
    """Photo settings; in `Camera.set_photo` a field that is None stays as it is."""

    mode: PhotoMode | None = None
    format: PhotoFormat | None = None
    file: PhotoFile | None = None
    burst: Burst | None = None
    bracketing: Bracketing | None = None
    interval: float | None = None
    """Between two pictures: m in mode GPS_LAPSE, else s of a TIME_LAPSE.

    The older cameras have one number for both.
    """
    other_interval: float | None = None
    """Interval of the other series: s in mode GPS_LAPSE, else m. Ai only."""
    megapixels: float | None = None
    """Ai only."""
    signed: bool | None = None
    """True when photos carry the drone's digital signature. Ai only."""
    keeps_live_video: bool | None = None
    """True when the live video goes on while a photo is taken. Ai only."""

    def interval_of(self, series: PhotoMode) -> float | None:
        """Return the interval of a series; None if the camera does not report it in its mode."""
        if self.mode is series:
            return self.interval
        is_of_distance = PhotoMode.GPS_LAPSE in (self.mode, series)
        return self.other_interval if is_of_distance or self.other_interval is None else self.interval


class RecordingSettings(msgspec.Struct, frozen=True):
    """Recording settings; in `Camera.set_recording` a field that is None stays as it is."""

    mode: RecordingMode | None = None
    resolution: Resolution | None = None
    framerate: float | None = None
    """Frames a second."""
    hyperlapse: int | None = None
    """One frame of so many. Not on the Ai."""
    bitrate: int | None = None
    """bit/s; the drone's choice."""
    codec: VideoCodec | None = None
    """Ai only."""


class ExposureSettings(msgspec.Struct, frozen=True):
    """Exposure settings; in `Camera.set_exposure` a field that is None stays as it is."""

    mode: ExposureMode | None = None
    shutter_s: float | None = None
    """Shutter time for the modes that set it by hand."""
    iso: float | None = None
    """Sensitivity for the modes that set it by hand."""
    max_iso: float | None = None
    metering: Metering | None = None


class StyleSettings(msgspec.Struct, frozen=True):
    """The style of the picture and its levels."""

    style: Style | None = None
    saturation: Range | None = None
    contrast: Range | None = None
    sharpness: Range | None = None


class PhotoOption(msgspec.Struct, frozen=True):
    """A combination of photo settings that the camera accepts."""

    modes: frozenset[PhotoMode]
    formats: frozenset[PhotoFormat]
    files: frozenset[PhotoFile]
    hdr: bool
    number: int = 0
    """Parrot's, within the camera's list. Not on the Ai."""


class RecordingOption(msgspec.Struct, frozen=True):
    """A combination of recording settings that the camera accepts."""

    modes: frozenset[RecordingMode]
    resolutions: frozenset[Resolution]
    framerates: tuple[float, ...]
    hdr: bool
    number: int = 0
    """Parrot's, within the camera's list. Not on the Ai."""


class CameraState(msgspec.Struct, frozen=True):
    """One camera: its mode, settings, lens and light, and what it can do."""

    feature: str | None = None
    """Parrot's feature that reports it: "camera" or "camera2"."""
    kind: CameraKind | None = None
    mode: CameraMode | None = None
    modes: frozenset[CameraMode] | None = None
    # -- pictures
    photo: PhotoSettings | None = None
    photos: tuple[PhotoOption, ...] = ()
    bursts: frozenset[Burst] = frozenset()
    brackets: frozenset[Bracketing] = frozenset()
    time_lapse_bounds: tuple[float, float] | None = None
    """s; the upper one is infinite where the drone reports the lower one only."""
    gps_lapse_bounds: tuple[float, float] | None = None
    """m; likewise."""
    megapixels: tuple[float, ...] = ()
    """Photo resolutions to choose from; Ai only."""
    signable: bool | None = None
    """True when the camera can sign photos."""
    live_video_keepable: bool | None = None
    """True when the live video can go on while a photo is taken."""
    photo_available: bool | None = None
    """True when a photo can be taken now."""
    taking: bool | None = None
    """A photo is being taken, or a series of them."""
    photo_count: int | None = None
    """Pictures of the series so far."""
    last_photo: str | None = None
    """Media id of the last stored photo since the connection."""
    # -- films
    recording: RecordingSettings | None = None
    recordings: tuple[RecordingOption, ...] = ()
    hyperlapses: tuple[int, ...] = ()
    """Ratios to choose from. Not on the Ai."""
    bitrates: tuple[int, ...] = ()
    """bit/s to choose from; Ai only."""
    codecs: frozenset[VideoCodec] = frozenset()
    """To choose from; Ai only."""
    recording_available: bool | None = None
    recording_now: bool | None = None
    recording_since_ms: int | None = None
    """When it began, by the drone's clock, ms since 1970; None on the Ai, which reports a duration."""
    recording_for_ms: int | None = None
    """Duration when the state was reported; Ai only."""
    last_recording: str | None = None
    autorecord: bool | None = None
    """Record from take-off to landing."""
    storage_policy: StoragePolicy | None = None
    storage_policies: frozenset[StoragePolicy] = frozenset()
    # -- lens
    zoom: float | None = None
    """Factor; 1: no zoom."""
    zoom_available: bool | None = None
    zoom_max: float | None = None
    zoom_max_lossless: float | None = None
    """The largest factor that the sensor resolves."""
    zoom_speed: float | None = None
    """The fastest zoom, tan(deg)/s."""
    zoom_speed_bounds: tuple[float, float] | None = None
    zoom_may_degrade: bool | None = None
    """True when a zoom by rate goes beyond `zoom_max_lossless`."""
    hfov_deg: float | None = None
    """Ai only."""
    # -- light
    ev: float | None = None
    """Exposure compensation, EV."""
    evs: tuple[float, ...] = ()
    """Values that `ev` accepts."""
    exposure: ExposureSettings | None = None
    exposures: frozenset[ExposureMode] | None = None
    shutters: tuple[float, ...] = ()
    """s; times to choose from in the present mode of the camera."""
    isos: tuple[float, ...] = ()
    max_isos: tuple[float, ...] = ()
    meterings: frozenset[Metering] = frozenset()
    shutter_s: float | None = None
    """At present, in steps; the exact times are in the video's metadata only."""
    iso: float | None = None
    """At present, in steps."""
    exposure_locked: bool | None = None
    exposure_lockable: bool | None = None
    white_balance: WhiteBalance | None = None
    white_balances: frozenset[WhiteBalance] | None = None
    temperatures: tuple[float, ...] = ()
    """K to choose from."""
    temperature_k: float | None = None
    """Of white balance CUSTOM."""
    white_balance_locked: bool | None = None
    white_balance_lockable: bool | None = None
    hdr: bool | None = None
    """Requested."""
    hdr_active: bool | None = None
    """In effect; None where the drone reports the request only."""
    style: StyleSettings | None = None
    styles: frozenset[Style] | None = None
    streaming: Streaming | None = None
    """Not on the Ai."""
    streamings: frozenset[Streaming] | None = None
    alignment: Mapping[str, Range] = {}
    """Corrections against the other camera by axis ("yaw", "pitch", "roll"), deg."""

    @property
    def zoom_speed_range(self) -> Range | None:
        """`zoom_speed` with its bounds; None before both are reported."""
        if self.zoom_speed is None or self.zoom_speed_bounds is None:
            return None
        return Range(self.zoom_speed, *self.zoom_speed_bounds)


UNREPORTED = CameraState()
"""A camera that the drone has not reported."""


class CamerasState(msgspec.Struct, frozen=True):
    """All cameras by id."""

    cameras: Mapping[int, CameraState] = {}
    active: frozenset[int] = frozenset()
    """Ids of the cameras that work now: a thermal mode changes them."""
    antiflicker: Antiflicker | None = None
    antiflickers: frozenset[Antiflicker] | None = None
    next_photo: float | None = None
    """Until the next picture of a series: s, or m of a GPS_LAPSE."""

    @property
    def is_recording(self) -> bool:
        """True while a camera records a video."""
        return any(camera.recording_now for camera in self.cameras.values())

    @property
    def is_taking(self) -> bool:
        """True while a camera takes or saves a photo, or a series of them."""
        return any(camera.taking for camera in self.cameras.values())


def changed(state: CamerasState, id: int, **changes: Any) -> CamerasState:
    """Return the state with these fields of one camera; the same state if none changes."""
    known = state.cameras.get(id)
    if known is not None and all(getattr(known, name) == value for name, value in changes.items()):
        return state
    camera = replace(UNREPORTED if known is None else known, **changes)
    return replace(state, cameras=with_item(state.cameras, id, camera, 0))


class CaptureProgress(enum.Enum):
    """Progress of a requested photo or recording."""

    STARTED = enum.auto()
    TAKEN = enum.auto()
    """Photo: the shutter has opened."""
    SAVED = enum.auto()
    """Photo: the media is stored."""
    ENDED = enum.auto()
    """Photo: nothing more comes. Recording: the film is stored."""
    FAILED = enum.auto()


class CaptureUpdate(msgspec.Struct, frozen=True):
    """One event about a picture or a film."""

    camera: int
    progress: CaptureProgress
    media: str = ""
    """Media id, of SAVED and ENDED."""
    reason: str = ""
    """Reason of FAILED, and of an end that was not requested."""
    count: int | None = None
    """Pictures so far, of TAKEN and SAVED, modulo 256; None where the drone does not report it."""
    is_last: bool = False
    """SAVED: it is also the end of the photo or series."""
    is_refused: bool = False
    """FAILED: a command was refused for the camera's state; a photo that is being taken goes on.

    ENDED: the recording never began.
    """
    is_state: bool = False
    """STARTED and ENDED of a photo: reported by the camera's state. Parrot promises no order between that and the
    reports of the progress."""
