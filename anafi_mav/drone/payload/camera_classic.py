"""The cameras of 4K, Thermal and USA (feature camera): event reducers and commands."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera as wire
from anafi_mav.arsdk.messages.camera import (
    AutoExposureMeteringMode,
    Availability,
    BracketingPreset,
    BurstValue,
    CameraAntiflickerMode,
    CameraCameraMode,
    CameraEvCompensation,
    CameraPhotoMode,
    CameraRecordingMode,
    CameraStreamingMode,
    CameraStyle,
    Framerate,
    HyperlapseValue,
    IsoSensitivity,
    PhotoFileFormat,
    PhotoResult,
    RecordingResult,
    ShutterSpeed,
    State,
    Supported,
    WhiteBalanceMode,
    WhiteBalanceTemperature,
    ZoomControlMode,
)
from anafi_mav.drone.element import EMPTY, FIRST, REMOVE, Range, Reducer, finite, members
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
    WhiteBalance,
    ev_of,
    ev_step,
    nearest,
    parrot,
    quantities,
    quantity,
    word,
    words,
)
from anafi_mav.drone.payload.camera_state import (
    MAX_OPTIONS,
    UNREPORTED,
    CamerasState,
    CameraState,
    CaptureProgress,
    CaptureUpdate,
    ExposureSettings,
    PhotoOption,
    PhotoSettings,
    RecordingOption,
    RecordingSettings,
    StyleSettings,
    changed,
)
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.errors import NotSupported

FEATURE = "camera"

OptionT = TypeVar("OptionT", PhotoOption, RecordingOption)

_CAMERA_OF_CAPABILITY = 8
"""The number of a recording or photo capability has its camera above these bits (512 is the first of camera 2 in what
anafi_ros recorded)."""


# ------------------------------------------------------------------------------------------------ from the drone


def _capabilities(state: CamerasState, m: wire.CameraCapabilities) -> CamerasState:
    return changed(
        state,
        m.cam_id,
        feature=FEATURE,
        kind=word(CameraKind, m.model),
        modes=words(CameraMode, members(m.camera_modes, CameraCameraMode)),
        exposures=words(ExposureMode, members(m.exposure_modes, wire.ExposureMode)),
        exposure_lockable=m.exposure_lock_supported == Supported.SUPPORTED,
        evs=tuple(
            ev for step in sorted(members(m.ev_compensations, CameraEvCompensation)) if (ev := ev_of(step)) is not None
        ),
        white_balances=words(WhiteBalance, members(m.white_balance_modes, WhiteBalanceMode)),
        white_balance_lockable=m.white_balance_lock_supported == Supported.SUPPORTED,
        styles=words(Style, members(m.styles, CameraStyle)),
        temperatures=quantities(members(m.custom_white_balance_temperatures, WhiteBalanceTemperature)),
        hyperlapses=tuple(int(ratio) for ratio in quantities(members(m.hyperlapse_values, HyperlapseValue))),
        brackets=words(Bracketing, members(m.bracketing_presets, BracketingPreset)),
        bursts=words(Burst, members(m.burst_values, BurstValue)),
        streamings=words(Streaming, members(m.streaming_modes, CameraStreamingMode)),
        meterings=words(Metering, members(m.auto_exposure_metering_modes, AutoExposureMeteringMode)),
        time_lapse_bounds=_from(m.timelapse_interval_min),
        gps_lapse_bounds=_from(m.gpslapse_interval_min),
    )


def _from(shortest: float) -> tuple[float, float] | None:
    """Return the bounds of an interval whose upper one the drone does not report."""
    return (shortest, math.inf) if math.isfinite(shortest) else None


def _recording_option(state: CamerasState, m: wire.RecordingCapabilities) -> CamerasState:
    option = RecordingOption(
        words(RecordingMode, members(m.recording_modes, CameraRecordingMode)),
        words(Resolution, members(m.resolutions, wire.Resolution)),
        quantities(members(m.framerates, Framerate)),
        m.hdr == Supported.SUPPORTED,
        m.id,
    )
    if m.list_flags & (FIRST | EMPTY):
        state = replace(state, cameras={id: replace(one, recordings=()) for id, one in state.cameras.items()})
    id = m.id >> _CAMERA_OF_CAPABILITY
    return changed(state, id, recordings=_with_option(_camera(state, id).recordings, option, m.list_flags))


def _photo_option(state: CamerasState, m: wire.PhotoCapabilities) -> CamerasState:
    option = PhotoOption(
        words(PhotoMode, members(m.photo_modes, CameraPhotoMode)),
        words(PhotoFormat, members(m.photo_formats, wire.PhotoFormat)),
        words(PhotoFile, members(m.photo_file_formats, PhotoFileFormat)),
        m.hdr == Supported.SUPPORTED,
        m.id,
    )
    if m.list_flags & (FIRST | EMPTY):
        state = replace(state, cameras={id: replace(one, photos=()) for id, one in state.cameras.items()})
    id = m.id >> _CAMERA_OF_CAPABILITY
    return changed(state, id, photos=_with_option(_camera(state, id).photos, option, m.list_flags))


def _with_option(options: tuple[OptionT, ...], option: OptionT, flags: int) -> tuple[OptionT, ...]:
    """Return the options of a camera after an event about one of them, with its list flags."""
    if flags & EMPTY:
        return options
    others = [one for one in options if one.number != option.number]
    if not flags & REMOVE:
        others.append(option)
    return tuple(others[:MAX_OPTIONS])


def _camera(state: CamerasState, id: int) -> CameraState:
    return state.cameras.get(id, UNREPORTED)


def _exposure(state: CamerasState, m: wire.ExposureSettings) -> CamerasState:
    settings = ExposureSettings(
        word(ExposureMode, m.mode),
        quantity(m.manual_shutter_speed),
        quantity(m.manual_iso_sensitivity),
        quantity(m.max_iso_sensitivity),
        word(Metering, m.metering_mode),
    )
    return changed(
        state,
        m.cam_id,
        exposure=settings,
        shutters=quantities(members(m.manual_shutter_speed_capabilities, ShutterSpeed)),
        isos=quantities(members(m.manual_iso_sensitivity_capabilities, IsoSensitivity)),
        max_isos=quantities(members(m.max_iso_sensitivities_capabilities, IsoSensitivity)),
    )


def _style(state: CamerasState, m: wire.Style) -> CamerasState:
    settings = StyleSettings(
        word(Style, m.style),
        Range(m.saturation, m.saturation_min, m.saturation_max),
        Range(m.contrast, m.contrast_min, m.contrast_max),
        Range(m.sharpness, m.sharpness_min, m.sharpness_max),
    )
    return changed(state, m.cam_id, style=settings)


def _photo_mode(state: CamerasState, m: wire.PhotoMode) -> CamerasState:
    settings = PhotoSettings(
        word(PhotoMode, m.mode),
        word(PhotoFormat, m.format),
        word(PhotoFile, m.file_format),
        word(Burst, m.burst),
        word(Bracketing, m.bracketing),
        finite(m.capture_interval),
    )
    return changed(state, m.cam_id, photo=settings)


def _recording_mode(state: CamerasState, m: wire.RecordingMode) -> CamerasState:
    hyperlapse = quantity(m.hyperlapse)
    settings = RecordingSettings(
        word(RecordingMode, m.mode),
        word(Resolution, m.resolution),
        quantity(m.framerate),
        None if hyperlapse is None else int(hyperlapse),
        m.bitrate,
    )
    return changed(state, m.cam_id, recording=settings)


def _zoom_speed(state: CamerasState, m: wire.MaxZoomSpeed) -> CamerasState:
    bounds = (m.min, m.max) if math.isfinite(m.min + m.max) else None
    return changed(state, m.cam_id, zoom_speed=finite(m.current), zoom_speed_bounds=bounds)


def _photo_progress(state: CamerasState, m: wire.PhotoProgress) -> CamerasState:
    if m.result == PhotoResult.PHOTO_SAVED:
        return changed(state, m.cam_id, last_photo=m.media_id, photo_count=m.photo_count)
    if m.result == PhotoResult.PHOTO_TAKEN:
        return changed(state, m.cam_id, photo_count=m.photo_count)
    return state


def _recording_progress(state: CamerasState, m: wire.RecordingProgress) -> CamerasState:
    return changed(state, m.cam_id, last_recording=m.media_id) if m.result in _STORED and m.media_id else state


def _recording_state(state: CamerasState, m: wire.RecordingState) -> CamerasState:
    running = m.state == State.ACTIVE
    return changed(
        state,
        m.cam_id,
        recording_available=m.available == Availability.AVAILABLE,
        recording_now=running,
        recording_since_ms=m.start_timestamp if running else None,
    )


def _alignment(state: CamerasState, m: wire.AlignmentOffsets) -> CamerasState:
    offsets = {
        "yaw": (m.current_yaw, m.min_bound_yaw, m.max_bound_yaw),
        "pitch": (m.current_pitch, m.min_bound_pitch, m.max_bound_pitch),
        "roll": (m.current_roll, m.min_bound_roll, m.max_bound_roll),
    }
    known = {axis: Range(*numbers) for axis, numbers in offsets.items() if math.isfinite(sum(numbers))}
    return changed(state, m.cam_id, alignment=known)


REDUCERS: Mapping[type[Message], Reducer] = {
    wire.CameraCapabilities: _capabilities,
    wire.RecordingCapabilities: _recording_option,
    wire.PhotoCapabilities: _photo_option,
    wire.AntiflickerCapabilities: lambda state, m: replace(
        state, antiflickers=words(Antiflicker, members(m.supported_modes, CameraAntiflickerMode))
    ),
    wire.AntiflickerMode: lambda state, m: replace(state, antiflicker=word(Antiflicker, m.mode)),
    wire.CameraStates: lambda state, m: replace(
        state, active=frozenset(id for id in range(32) if m.active_cameras >> id & 1)
    ),
    wire.CameraMode: lambda state, m: changed(state, m.cam_id, mode=word(CameraMode, m.mode)),
    wire.PhotoMode: _photo_mode,
    wire.RecordingMode: _recording_mode,
    wire.PhotoState: lambda state, m: changed(
        state, m.cam_id, photo_available=m.available == Availability.AVAILABLE, taking=m.state == State.ACTIVE
    ),
    wire.PhotoProgress: _photo_progress,
    wire.NextPhotoDelay: lambda state, m: replace(state, next_photo=finite(m.remaining)),
    wire.RecordingState: _recording_state,
    wire.RecordingProgress: _recording_progress,
    wire.Autorecord: lambda state, m: changed(state, m.cam_id, autorecord=m.state == State.ACTIVE),
    wire.ZoomLevel: lambda state, m: changed(state, m.cam_id, zoom=finite(m.level)),
    wire.ZoomInfo: lambda state, m: changed(
        state,
        m.cam_id,
        zoom_available=m.available == Availability.AVAILABLE,
        zoom_max=finite(m.maximum_level),
        zoom_max_lossless=finite(m.high_quality_maximum_level),
    ),
    wire.MaxZoomSpeed: _zoom_speed,
    wire.ZoomVelocityQualityDegradation: lambda state, m: changed(state, m.cam_id, zoom_may_degrade=m.allowed != 0),
    wire.EvCompensation: lambda state, m: changed(state, m.cam_id, ev=ev_of(m.value)),
    wire.ExposureSettings: _exposure,
    wire.Exposure: lambda state, m: changed(
        state,
        m.cam_id,
        shutter_s=quantity(m.shutter_speed),
        iso=quantity(m.iso_sensitivity),
        exposure_locked=m.lock == State.ACTIVE,
    ),
    wire.WhiteBalance: lambda state, m: changed(
        state,
        m.cam_id,
        white_balance=word(WhiteBalance, m.mode),
        temperature_k=quantity(m.temperature),
        white_balance_locked=m.lock == State.ACTIVE,
    ),
    wire.HdrSetting: lambda state, m: changed(state, m.cam_id, hdr=m.value == State.ACTIVE),
    wire.Hdr: lambda state, m: changed(state, m.cam_id, hdr_active=m.state == State.ACTIVE),
    wire.Style: _style,
    wire.StreamingMode: lambda state, m: changed(state, m.cam_id, streaming=word(Streaming, m.value)),
    wire.AlignmentOffsets: _alignment,
}

_STORED = frozenset(
    {
        RecordingResult.STOPPED,
        RecordingResult.STOPPED_NO_STORAGE_SPACE,
        RecordingResult.STOPPED_STORAGE_TOO_SLOW,
        RecordingResult.STOPPED_RECONFIGURED,
    }
)

SAMPLES: tuple[type[Message], ...] = (wire.ZoomLevel,)

FREQUENT: tuple[type[Message], ...] = (
    wire.ZoomLevel,
    wire.PhotoProgress,
    wire.RecordingProgress,
    wire.NextPhotoDelay,
)

ACTIVE_EVENT: type[Message] = wire.CameraStates
"""Reports which cameras work."""

PHOTO_EVENTS: tuple[type[Message], ...] = (wire.PhotoProgress, wire.PhotoState)
RECORDING_EVENTS: tuple[type[Message], ...] = (wire.RecordingProgress, wire.RecordingState)


def photo_news(m: Any) -> CaptureUpdate | None:
    """Return the progress that a photo event reports."""
    if isinstance(m, wire.PhotoState):
        is_active = m.state == State.ACTIVE
        return CaptureUpdate(m.cam_id, CaptureProgress.STARTED if is_active else CaptureProgress.ENDED, is_state=True)
    if m.result == PhotoResult.PHOTO_SAVED:
        return CaptureUpdate(m.cam_id, CaptureProgress.SAVED, m.media_id, count=m.photo_count or None)
    if m.result == PhotoResult.PHOTO_TAKEN:
        return CaptureUpdate(m.cam_id, CaptureProgress.TAKEN, count=m.photo_count or None)
    if m.result == PhotoResult.TAKING_PHOTO:
        return CaptureUpdate(m.cam_id, CaptureProgress.STARTED)
    refused = m.result == PhotoResult.ERROR_BAD_STATE
    return CaptureUpdate(m.cam_id, CaptureProgress.FAILED, reason=spoken(m.result), is_refused=refused)


def recording_news(m: Any) -> CaptureUpdate | None:
    """Return the progress that a recording event reports, or None.

    The state alone ends nothing: the media id arrives with the progress. A full storage is reported as the end of a
    recording that never began, without a media.
    """
    if isinstance(m, wire.RecordingState):
        return CaptureUpdate(m.cam_id, CaptureProgress.STARTED) if m.state == State.ACTIVE else None
    if m.result == RecordingResult.STARTED:
        return CaptureUpdate(m.cam_id, CaptureProgress.STARTED)
    if m.result in _STORED:
        reason = "" if m.result == RecordingResult.STOPPED else spoken(m.result)
        refused = m.result == RecordingResult.STOPPED_NO_STORAGE_SPACE and not m.media_id
        return CaptureUpdate(m.cam_id, CaptureProgress.ENDED, m.media_id, reason, is_refused=refused)
    return CaptureUpdate(m.cam_id, CaptureProgress.FAILED, reason=spoken(m.result))


def camera_of(m: Any) -> int:
    return int(m.cam_id)


# -------------------------------------------------------------------------------------------------- to the drone


def _onoff(on: bool) -> State:
    return State.ACTIVE if on else State.INACTIVE


class ClassicCamera:
    """A command, and the kind of event that answers it.

    Each takes the camera's id and its state.
    """

    @staticmethod
    def mode(id: int, now: CameraState, mode: CameraMode) -> tuple[Message, type[Message]]:
        return wire.SetCameraMode(id, parrot(CameraCameraMode, mode)), wire.CameraMode

    @staticmethod
    def photo(id: int, now: CameraState, wish: PhotoSettings) -> tuple[Message, type[Message]]:
        if wish.megapixels is not None:
            raise NotSupported("choice of the photo resolution")
        if wish.signed is not None or wish.keeps_live_video is not None or wish.other_interval is not None:
            raise NotSupported("photo setting of another camera")
        has = now.photo or PhotoSettings()
        command = wire.SetPhotoMode(
            id,
            parrot(CameraPhotoMode, wish.mode or has.mode or PhotoMode.SINGLE),
            parrot(wire.PhotoFormat, wish.format or has.format or PhotoFormat.FULL_FRAME),
            parrot(PhotoFileFormat, wish.file or has.file or PhotoFile.JPEG),
            parrot(BurstValue, wish.burst or has.burst or Burst.B14_OVER_1S),
            parrot(BracketingPreset, wish.bracketing or has.bracketing or Bracketing.EV1),
            (has.interval or 0.0) if wish.interval is None else wish.interval,
        )
        return command, wire.PhotoMode

    @staticmethod
    def recording(id: int, now: CameraState, wish: RecordingSettings) -> tuple[Message, type[Message]]:
        if wish.bitrate is not None:
            raise NotSupported("choice of the bit rate")
        if wish.codec is not None:
            raise NotSupported("choice of the codec")
        has = now.recording or RecordingSettings()
        command = wire.SetRecordingMode(
            id,
            parrot(CameraRecordingMode, wish.mode or has.mode or RecordingMode.STANDARD),
            parrot(wire.Resolution, wish.resolution or has.resolution or Resolution.R1080P),
            nearest(Framerate, wish.framerate or has.framerate or 30.0),
            nearest(HyperlapseValue, wish.hyperlapse or has.hyperlapse or 15),
        )
        return command, wire.RecordingMode

    @staticmethod
    def exposure(id: int, now: CameraState, wish: ExposureSettings) -> tuple[Message, type[Message]]:
        has = now.exposure or ExposureSettings()
        command = wire.SetExposureSettings(
            id,
            parrot(wire.ExposureMode, wish.mode or has.mode or ExposureMode.AUTOMATIC),
            nearest(ShutterSpeed, wish.shutter_s or has.shutter_s or 1.0 / 60.0),
            nearest(IsoSensitivity, wish.iso or has.iso or 100.0),
            nearest(IsoSensitivity, wish.max_iso or has.max_iso or 3200.0),
            parrot(AutoExposureMeteringMode, wish.metering or has.metering or Metering.STANDARD),
        )
        return command, wire.ExposureSettings

    @staticmethod
    def lock_exposure(
        id: int, now: CameraState, on: bool, at: tuple[float, float] | None
    ) -> tuple[Message, type[Message]]:
        if not on:
            return wire.UnlockExposure(id), wire.Exposure
        return wire.LockExposure(id) if at is None else wire.LockExposureOnRoi(id, *at), wire.Exposure

    @staticmethod
    def ev(id: int, now: CameraState, ev: float) -> tuple[Message, type[Message]]:
        return wire.SetEvCompensation(id, CameraEvCompensation(ev_step(ev))), wire.EvCompensation

    @staticmethod
    def white_balance(
        id: int, now: CameraState, mode: WhiteBalance, temperature_k: float | None
    ) -> tuple[Message, type[Message]]:
        temperature = nearest(WhiteBalanceTemperature, temperature_k or now.temperature_k or 5000.0)
        return wire.SetWhiteBalance(id, parrot(WhiteBalanceMode, mode), temperature), wire.WhiteBalance

    @staticmethod
    def lock_white_balance(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        return wire.SetWhiteBalanceLock(id, _onoff(on)), wire.WhiteBalance

    @staticmethod
    def hdr(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        return wire.SetHdrSetting(id, _onoff(on)), wire.HdrSetting

    @staticmethod
    def style(id: int, now: CameraState, style: Style) -> tuple[Message, type[Message]]:
        return wire.SetStyle(id, parrot(CameraStyle, style)), wire.Style

    @staticmethod
    def style_params(
        id: int, now: CameraState, saturation: float, contrast: float, sharpness: float
    ) -> tuple[Message, type[Message]]:
        return wire.SetStyleParams(id, round(saturation), round(contrast), round(sharpness)), wire.Style

    @staticmethod
    def streaming(id: int, now: CameraState, mode: Streaming) -> tuple[Message, type[Message]]:
        return wire.SetStreamingMode(id, parrot(CameraStreamingMode, mode)), wire.StreamingMode

    @staticmethod
    def autorecord(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        return wire.SetAutorecord(id, _onoff(on)), wire.Autorecord

    @staticmethod
    def storage_policy(id: int, now: CameraState, policy: StoragePolicy) -> tuple[Message, type[Message]]:
        raise NotSupported("choice of the storage")

    @staticmethod
    def zoom_speed(id: int, now: CameraState, speed: float) -> tuple[Message, type[Message]]:
        return wire.SetMaxZoomSpeed(id, speed), wire.MaxZoomSpeed

    @staticmethod
    def zoom_may_degrade(id: int, now: CameraState, allowed: bool) -> tuple[Message, type[Message]]:
        return wire.SetZoomVelocityQualityDegradation(id, int(allowed)), wire.ZoomVelocityQualityDegradation

    @staticmethod
    def alignment(id: int, now: CameraState, yaw: float, pitch: float, roll: float) -> tuple[Message, type[Message]]:
        return wire.SetAlignmentOffsets(id, yaw, pitch, roll), wire.AlignmentOffsets

    @staticmethod
    def antiflicker(mode: Antiflicker) -> tuple[Message, type[Message]]:
        return wire.SetAntiflickerMode(parrot(CameraAntiflickerMode, mode)), wire.AntiflickerMode

    @staticmethod
    def zoom(id: int, level: float) -> Message:
        return wire.SetZoomTarget(id, ZoomControlMode.LEVEL, level)

    @staticmethod
    def zoom_rate(id: int, share: float) -> Message:
        return wire.SetZoomTarget(id, ZoomControlMode.VELOCITY, share)

    reset_zoom = wire.ResetZoom
    take_photo = wire.TakePhoto
    stop_photo = wire.StopPhoto
    start_recording = wire.StartRecording
    stop_recording = wire.StopRecording
    zoom_event: type[Message] = wire.ZoomLevel
    photo_events = PHOTO_EVENTS
    recording_events = RECORDING_EVENTS
    state_events: tuple[type[Message], ...] = (wire.PhotoState, wire.RecordingState)
    photo_news = staticmethod(photo_news)
    recording_news = staticmethod(recording_news)
    camera_of = staticmethod(camera_of)
