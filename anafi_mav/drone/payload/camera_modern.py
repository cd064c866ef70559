"""The cameras of the Ai (protobuf feature camera2): event reducers and commands.

Every setting is a field of one configuration; the drone answers a change with its state. Fields that an event does
not carry are left as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages.proto import antiflicker as mains
from anafi_mav.arsdk.messages.proto import camera2 as wire
from anafi_mav.drone.element import MAX_ITEMS, Range, Reducer, field_of_view, finite
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
    WordT,
    bare,
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

FEATURE = "camera2"


# ------------------------------------------------------------------------------------------------ from the drone


def _list(state: CamerasState, m: wire.CameraList) -> CamerasState:
    for id, model in list(m.cameras.items())[:MAX_ITEMS]:
        state = changed(state, id, feature=FEATURE, kind=word(CameraKind, model))
    return state


def _state(state: CamerasState, m: wire.State) -> CamerasState:
    id = m.camera_id or 0
    changes: dict[str, Any] = {"feature": FEATURE}
    now = state.cameras.get(id, UNREPORTED)
    if m.photo is not None:
        changes |= {
            "photo_available": m.photo.state != wire.PhotoState.UNAVAILABLE,
            "taking": m.photo.state == wire.PhotoState.ACTIVE,
            "photo_count": m.photo.photo_count,
        }
    if m.recording is not None:
        running = m.recording.state == wire.RecordingState.ACTIVE
        changes |= {
            "recording_available": m.recording.state != wire.RecordingState.UNAVAILABLE,
            "recording_now": running,
            "recording_for_ms": m.recording.duration if running else None,
        }
    if m.white_balance_lock is not None:
        lock = m.white_balance_lock
        changes |= {
            "white_balance_locked": lock.mode == wire.WhiteBalanceLockMode.LOCKED,
            "white_balance_lockable": wire.WhiteBalanceLockMode.LOCKED in lock.supported_modes,
        }
    if m.exposure_lock is not None:
        changes |= {
            "exposure_locked": m.exposure_lock.mode != wire.ExposureLockMode.UNLOCKED,
            "exposure_lockable": wire.ExposureLockMode.FULL_LOCK in m.exposure_lock.supported_modes,
        }
    if m.zoom is not None:
        changes |= {
            "zoom_available": True,
            "zoom_max": finite(m.zoom.zoom_level_max),
            "zoom_max_lossless": finite(m.zoom.zoom_high_quality_level_max),
        }
    if m.config is not None:
        changes |= _config(now, m.config)
    # Those of its present settings count until those of all are reported.
    rules = m.default_capabilities or (m.current_capabilities if now.modes is None else None)
    if rules is not None:
        changes |= _rules(rules.rules, changes.get("style", now.style))
    state = changed(state, id, **changes)
    if m.active is None or id not in state.cameras:
        return state
    return replace(state, active=state.active | {id} if m.active else state.active - {id})


def _given(**values: Any) -> dict[str, Any]:
    """Those that were said."""
    return {name: value for name, value in values.items() if value is not None}


def _number_of_pixels(value: OpenEnum | None) -> float | None:
    """Megapixels."""
    if value is None:
        return None
    number, _, _ = bare(value).partition("_MEGA")
    try:
        return float(number.replace("_", "."))
    except ValueError:
        return None


def _config(now: CameraState, c: wire.Config) -> dict[str, Any]:
    photo = _given(
        mode=word(PhotoMode, c.photo_mode),
        format=word(PhotoFormat, c.photo_format),
        file=word(PhotoFile, c.photo_file_format),
        burst=word(Burst, c.photo_burst_value),
        bracketing=word(Bracketing, c.photo_bracketing_preset),
        megapixels=_number_of_pixels(c.photo_resolution),
        signed=None if c.photo_signature is None else c.photo_signature == wire.DigitalSignature.DRONE,
        keeps_live_video=None
        if c.photo_streaming_mode is None
        else c.photo_streaming_mode == wire.PhotoStreamingMode.CONTINUOUS,
    )
    photo |= _intervals(now.photo or PhotoSettings(), photo.get("mode"), c)
    recording = _given(
        mode=word(RecordingMode, c.video_recording_mode),
        resolution=word(Resolution, c.video_recording_resolution),
        framerate=quantity(c.video_recording_framerate),
        bitrate=c.video_recording_bitrate,
        codec=word(VideoCodec, c.video_recording_codec),
    )
    exposure = _given(
        mode=word(ExposureMode, c.exposure_mode),
        shutter_s=quantity(c.exposure_manual_shutter_speed),
        iso=quantity(c.exposure_manual_iso_sensitivity),
        max_iso=quantity(c.exposure_maximum_iso_sensitivity),
        metering=word(Metering, c.exposure_metering),
    )
    hdr_of = c.photo_dynamic_range if word(CameraMode, c.camera_mode) is CameraMode.PHOTO else None
    hdr_of = hdr_of if hdr_of is not None else c.video_recording_dynamic_range
    style = _given(
        style=word(Style, c.image_style),
        saturation=_level(now.style.saturation if now.style else None, c.image_saturation),
        contrast=_level(now.style.contrast if now.style else None, c.image_contrast),
        sharpness=_level(now.style.sharpness if now.style else None, c.image_sharpness),
    )
    changes = _given(
        mode=word(CameraMode, c.camera_mode),
        ev=ev_of(c.ev_compensation),
        white_balance=word(WhiteBalance, c.white_balance_mode),
        temperature_k=quantity(c.white_balance_temperature),
        hdr=None if hdr_of is None else hdr_of != wire.DynamicRange.STANDARD,
        zoom_speed=None if c.zoom_max_speed is None else finite(c.zoom_max_speed),
        autorecord=None if c.auto_record_mode is None else c.auto_record_mode == wire.AutoRecordMode.FLIGHT,
        storage_policy=word(StoragePolicy, c.storage_policy),
    )
    if c.zoom_velocity_control_quality_mode is not None:
        allowed = wire.ZoomVelocityControlQualityMode.ALLOW_DEGRADATION
        changes["zoom_may_degrade"] = c.zoom_velocity_control_quality_mode == allowed
    for name, fields, empty in (
        ("photo", photo, PhotoSettings()),
        ("recording", recording, RecordingSettings()),
        ("exposure", exposure, ExposureSettings()),
        ("style", style, StyleSettings()),
    ):
        if fields:
            changes[name] = replace(getattr(now, name) or empty, **fields)
    return changes


def _intervals(now: PhotoSettings, mode: PhotoMode | None, c: wire.Config) -> dict[str, float]:
    """Return the intervals of both series as `PhotoSettings` has them in a photo mode.

    `mode` None: the mode of before.
    """
    time, distance = (
        before if reported is None or finite(reported) is None else reported
        for reported, before in zip(
            (c.photo_time_lapse_interval, c.photo_gps_lapse_interval), _by_series(now, now.mode), strict=True
        )
    )
    interval, other = (distance, time) if (mode or now.mode) is PhotoMode.GPS_LAPSE else (time, distance)
    return _given(interval=interval, other_interval=other)


def _by_series(settings: PhotoSettings, mode: PhotoMode | None) -> tuple[float | None, float | None]:
    """Return the intervals of time-lapse (s) and GPS-lapse (m) of settings in a photo mode."""
    interval, other = settings.interval, settings.other_interval
    return (other, interval) if mode is PhotoMode.GPS_LAPSE else (interval, other)


def _level(now: Range | None, value: float | None) -> Range | None:
    """Return a picture level with its known range.

    Until the capabilities have arrived the range is Parrot's -1 to 1.
    """
    if value is None or not math.isfinite(value):
        return None
    return Range(value, -1.0, 1.0) if now is None else replace(now, current=value)


def _rules(rules: tuple[wire.CapabilitiesRule, ...], style: StyleSettings | None) -> dict[str, Any]:
    """Return the possible values of the settings that the rules name.

    Each rule is a set of values that go together.
    """
    rules = rules[:MAX_OPTIONS]

    def union(name: str) -> list[Any] | None:
        named = [values for rule in rules if (values := getattr(rule, name)) is not None]
        return [value for values in named for value in values] if named else None

    def words_of(kind: type[WordT], name: str) -> frozenset[WordT] | None:
        values = union(name)
        return None if values is None else words(kind, values)

    def quantities_of(name: str) -> tuple[float, ...] | None:
        values = union(name)
        return None if values is None else quantities(values)

    def has(name: str, value: OpenEnum) -> bool | None:
        values = union(name)
        return None if values is None else value in values

    def bounds(name: str) -> tuple[float, float] | None:
        ranges = [one for rule in rules if (one := getattr(rule, name)) is not None]
        return (min(one.min for one in ranges), max(one.max for one in ranges)) if ranges else None

    evs, sizes, bitrates = union("ev_compensations"), union("photo_resolutions"), union("video_recording_bitrates")
    photos = tuple(
        PhotoOption(
            words(PhotoMode, rule.photo_modes),
            words(PhotoFormat, rule.photo_formats or ()),
            words(PhotoFile, rule.photo_file_formats or ()),
            wire.DynamicRange.HDR8 in (rule.photo_dynamic_ranges or ()),
        )
        for rule in rules
        if rule.photo_modes
    )
    recordings = tuple(
        RecordingOption(
            words(RecordingMode, rule.video_recording_modes),
            words(Resolution, rule.video_recording_resolutions or ()),
            quantities(rule.video_recording_framerates or ()),
            wire.DynamicRange.HDR8 in (rule.video_recording_dynamic_ranges or ()),
        )
        for rule in rules
        if rule.video_recording_modes
    )
    changes = _given(
        modes=words_of(CameraMode, "camera_modes"),
        exposures=words_of(ExposureMode, "exposure_modes"),
        evs=None if evs is None else tuple(ev for step in sorted(set(evs)) if (ev := ev_of(step)) is not None),
        white_balances=words_of(WhiteBalance, "white_balance_modes"),
        styles=words_of(Style, "image_styles"),
        temperatures=quantities_of("white_balance_temperatures"),
        bursts=words_of(Burst, "photo_burst_values"),
        brackets=words_of(Bracketing, "photo_bracketing_presets"),
        megapixels=None
        if sizes is None
        else tuple(sorted({size for one in sizes if (size := _number_of_pixels(one))})),
        signable=has("photo_signatures", wire.DigitalSignature.DRONE),
        live_video_keepable=has("photo_streaming_modes", wire.PhotoStreamingMode.CONTINUOUS),
        codecs=words_of(VideoCodec, "video_recording_codecs"),
        storage_policies=words_of(StoragePolicy, "storage_policies"),
        bitrates=None if bitrates is None else tuple(sorted(set(bitrates))),
        shutters=quantities_of("exposure_manual_shutter_speeds"),
        isos=quantities_of("exposure_manual_iso_sensitivities"),
        max_isos=quantities_of("exposure_maximum_iso_sensitivities"),
        meterings=words_of(Metering, "exposure_meterings"),
        photos=photos or None,
        recordings=recordings or None,
        zoom_speed_bounds=bounds("zoom_max_speed_range"),
        time_lapse_bounds=bounds("photo_time_lapse_interval_range"),
        gps_lapse_bounds=bounds("photo_gps_lapse_interval_range"),
    )
    if style is not None:
        levels = {}
        for name in ("saturation", "contrast", "sharpness"):
            known, limits = getattr(style, name), bounds(f"image_{name}_range")
            if known is not None and limits is not None:
                levels[name] = Range(known.current, *limits)
        changes["style"] = replace(style, **levels)
    return changes


def _antiflicker(state: CamerasState, m: mains.State) -> CamerasState:
    if m.default_capabilities is not None:
        state = replace(state, antiflickers=words(Antiflicker, m.default_capabilities.supported_modes))
    if m.disabled is not None:
        return replace(state, antiflicker=Antiflicker.OFF)
    if m.automatic is not None:
        return replace(state, antiflicker=Antiflicker.AUTO)
    if m.fixed is not None:
        return replace(state, antiflicker=word(Antiflicker, m.fixed))
    return state


def _photo(state: CamerasState, m: wire.Photo) -> CamerasState:
    stored = m.type == wire.PhotoEvent.STOP and m.media_id
    return changed(state, m.camera_id, last_photo=m.media_id) if stored else state


def _recording(state: CamerasState, m: wire.Recording) -> CamerasState:
    stored = m.type == wire.RecordingEvent.STOP and m.media_id
    return changed(state, m.camera_id, last_recording=m.media_id) if stored else state


REDUCERS: Mapping[type[Message], Reducer] = {
    wire.CameraList: _list,
    wire.State: _state,
    wire.ZoomLevel: lambda state, m: changed(
        state,
        m.camera_id,
        zoom=finite(m.level),
        hfov_deg=field_of_view(m.hfov),
    ),
    wire.Exposure: lambda state, m: changed(
        state, m.camera_id, shutter_s=quantity(m.shutter_speed), iso=quantity(m.iso_sensitivity)
    ),
    wire.NextPhotoInterval: lambda state, m: replace(state, next_photo=finite(m.interval)),
    wire.Photo: _photo,
    wire.Recording: _recording,
    mains.State: _antiflicker,
}

SAMPLES: tuple[type[Message], ...] = (wire.ZoomLevel, wire.Exposure)

FREQUENT: tuple[type[Message], ...] = (
    wire.ZoomLevel,
    wire.Exposure,
    wire.NextPhotoInterval,
    wire.Photo,
    wire.Recording,
)

_DONE = (wire.PhotoStopReason.USER_REQUEST, wire.PhotoStopReason.CAPTURE_DONE)


def photo_news(m: Any) -> CaptureUpdate | None:
    """Return the progress that a photo event reports, or None.

    The events are START, then STOP with the media id, once for a series as for a single picture.
    """
    if m.type == wire.PhotoEvent.START:
        return CaptureUpdate(m.camera_id, CaptureProgress.STARTED)
    if m.type == wire.PhotoEvent.TAKING_PHOTO:
        return CaptureUpdate(m.camera_id, CaptureProgress.TAKEN)
    if m.type != wire.PhotoEvent.STOP:
        return None
    if m.stop_reason == wire.PhotoStopReason.ALREADY:  # its media id is that of an earlier photo
        return CaptureUpdate(m.camera_id, CaptureProgress.FAILED, reason=spoken(m.stop_reason), is_refused=True)
    if m.media_id:
        reason = "" if m.stop_reason in _DONE else spoken(m.stop_reason)
        return CaptureUpdate(m.camera_id, CaptureProgress.SAVED, m.media_id, reason, is_last=True)
    if m.stop_reason in _DONE:
        return CaptureUpdate(m.camera_id, CaptureProgress.ENDED)
    return CaptureUpdate(m.camera_id, CaptureProgress.FAILED, reason=spoken(m.stop_reason))


def recording_news(m: Any) -> CaptureUpdate | None:
    """Return the progress that a recording event reports, or None.

    The state begins and ends nothing: it has no media id.
    """
    if isinstance(m, wire.State):
        return None
    if m.type == wire.RecordingEvent.START:
        return CaptureUpdate(m.camera_id, CaptureProgress.STARTED)
    if m.type != wire.RecordingEvent.STOP:
        return None
    asked = m.stop_reason == wire.RecordingStopReason.USER_REQUEST
    if m.media_id or asked:
        return CaptureUpdate(m.camera_id, CaptureProgress.ENDED, m.media_id, "" if asked else spoken(m.stop_reason))
    return CaptureUpdate(m.camera_id, CaptureProgress.FAILED, reason=spoken(m.stop_reason))


def camera_of(m: Any) -> int:
    return int(m.camera_id or 0)


# -------------------------------------------------------------------------------------------------- to the drone


def _configure(id: int, **config: Any) -> tuple[Message, type[Message]]:
    return wire.Configure(camera_id=id, config=wire.Config(**config)), wire.State


def _optional(values: type[Any], wanted: Any) -> Any:
    return None if wanted is None else parrot(values, wanted)


def _pixels(wanted: float) -> wire.PhotoResolution:
    known = [(abs(number - wanted), one) for one in wire.PhotoResolution if (number := _number_of_pixels(one))]
    return min(known)[1]


class ModernCamera:
    """A command, and the kind of event that answers it.

    Each takes the camera's id and its state.
    """

    @staticmethod
    def mode(id: int, now: CameraState, mode: CameraMode) -> tuple[Message, type[Message]]:
        return _configure(id, camera_mode=parrot(wire.CameraMode, mode))

    @staticmethod
    def photo(id: int, now: CameraState, wish: PhotoSettings) -> tuple[Message, type[Message]]:
        time, distance = _by_series(wish, wish.mode or (now.photo.mode if now.photo is not None else None))
        signature = wire.DigitalSignature.DRONE if wish.signed else wire.DigitalSignature.NONE
        live = wire.PhotoStreamingMode.CONTINUOUS if wish.keeps_live_video else wire.PhotoStreamingMode.INTERRUPT
        return _configure(
            id,
            photo_mode=_optional(wire.PhotoMode, wish.mode),
            photo_format=_optional(wire.PhotoFormat, wish.format),
            photo_file_format=_optional(wire.PhotoFileFormat, wish.file),
            photo_burst_value=_optional(wire.BurstValue, wish.burst),
            photo_bracketing_preset=_optional(wire.BracketingPreset, wish.bracketing),
            photo_resolution=None if wish.megapixels is None else _pixels(wish.megapixels),
            photo_signature=None if wish.signed is None else signature,
            photo_streaming_mode=None if wish.keeps_live_video is None else live,
            photo_time_lapse_interval=time,
            photo_gps_lapse_interval=distance,
        )

    @staticmethod
    def recording(id: int, now: CameraState, wish: RecordingSettings) -> tuple[Message, type[Message]]:
        if wish.hyperlapse is not None:
            raise NotSupported("hyperlapse")
        return _configure(
            id,
            video_recording_mode=_optional(wire.VideoRecordingMode, wish.mode),
            video_recording_resolution=_optional(wire.VideoResolution, wish.resolution),
            video_recording_framerate=None if wish.framerate is None else nearest(wire.Framerate, wish.framerate),
            video_recording_bitrate=wish.bitrate,
            video_recording_codec=_optional(wire.VideoCodec, wish.codec),
        )

    @staticmethod
    def exposure(id: int, now: CameraState, wish: ExposureSettings) -> tuple[Message, type[Message]]:
        return _configure(
            id,
            exposure_mode=_optional(wire.ExposureMode, wish.mode),
            exposure_manual_shutter_speed=None
            if wish.shutter_s is None
            else nearest(wire.ShutterSpeed, wish.shutter_s),
            exposure_manual_iso_sensitivity=None if wish.iso is None else nearest(wire.IsoSensitivity, wish.iso),
            exposure_maximum_iso_sensitivity=None
            if wish.max_iso is None
            else nearest(wire.IsoSensitivity, wish.max_iso),
            exposure_metering=_optional(wire.ExposureMetering, wish.metering),
        )

    @staticmethod
    def lock_exposure(
        id: int, now: CameraState, on: bool, at: tuple[float, float] | None
    ) -> tuple[Message, type[Message]]:
        if not on:
            return wire.LockExposure(camera_id=id), wire.State
        if at is None:
            return wire.LockExposure(camera_id=id, mode=wire.ExposureLockMode.FULL_LOCK), wire.State
        centre = wire.ExposureRoiCenter(x=at[0], y=at[1])
        return wire.LockExposure(camera_id=id, mode=wire.ExposureLockMode.ROI_LOCK, roi=centre), wire.State

    @staticmethod
    def ev(id: int, now: CameraState, ev: float) -> tuple[Message, type[Message]]:
        return _configure(id, ev_compensation=wire.EvCompensation(ev_step(ev)))

    @staticmethod
    def white_balance(
        id: int, now: CameraState, mode: WhiteBalance, temperature_k: float | None
    ) -> tuple[Message, type[Message]]:
        temperature = None if temperature_k is None else nearest(wire.WhiteBalanceTemperature, temperature_k)
        return _configure(
            id, white_balance_mode=parrot(wire.WhiteBalanceMode, mode), white_balance_temperature=temperature
        )

    @staticmethod
    def lock_white_balance(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        mode = wire.WhiteBalanceLockMode.LOCKED if on else wire.WhiteBalanceLockMode.UNLOCKED
        return wire.LockWhiteBalance(camera_id=id, mode=mode), wire.State

    @staticmethod
    def hdr(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        wanted = wire.DynamicRange.HDR8 if on else wire.DynamicRange.STANDARD
        return _configure(id, photo_dynamic_range=wanted, video_recording_dynamic_range=wanted)

    @staticmethod
    def style(id: int, now: CameraState, style: Style) -> tuple[Message, type[Message]]:
        return _configure(id, image_style=parrot(wire.ImageStyle, style))

    @staticmethod
    def style_params(
        id: int, now: CameraState, saturation: float, contrast: float, sharpness: float
    ) -> tuple[Message, type[Message]]:
        return _configure(id, image_saturation=saturation, image_contrast=contrast, image_sharpness=sharpness)

    @staticmethod
    def streaming(id: int, now: CameraState, mode: Streaming) -> tuple[Message, type[Message]]:
        raise NotSupported("streaming mode")

    @staticmethod
    def autorecord(id: int, now: CameraState, on: bool) -> tuple[Message, type[Message]]:
        return _configure(id, auto_record_mode=wire.AutoRecordMode.FLIGHT if on else wire.AutoRecordMode.DISABLED)

    @staticmethod
    def storage_policy(id: int, now: CameraState, policy: StoragePolicy) -> tuple[Message, type[Message]]:
        return _configure(id, storage_policy=parrot(wire.StoragePolicy, policy))

    @staticmethod
    def zoom_speed(id: int, now: CameraState, speed: float) -> tuple[Message, type[Message]]:
        return _configure(id, zoom_max_speed=speed)

    @staticmethod
    def zoom_may_degrade(id: int, now: CameraState, allowed: bool) -> tuple[Message, type[Message]]:
        mode = wire.ZoomVelocityControlQualityMode
        return _configure(
            id,
            zoom_velocity_control_quality_mode=mode.ALLOW_DEGRADATION if allowed else mode.STOP_BEFORE_DEGRADATION,
        )

    @staticmethod
    def alignment(id: int, now: CameraState, yaw: float, pitch: float, roll: float) -> tuple[Message, type[Message]]:
        offsets = wire.AlignmentOffsets(yaw=yaw, pitch=pitch, roll=roll)
        return wire.SetAlignmentOffsets(camera_id=id, alignment_offsets=offsets), wire.State

    @staticmethod
    def antiflicker(mode: Antiflicker) -> tuple[Message, type[Message]]:
        return mains.SetMode(mode=parrot(mains.Mode, mode)), mains.State

    @staticmethod
    def zoom(id: int, level: float) -> Message:
        return wire.SetZoomTarget(camera_id=id, control_mode=wire.ZoomControlMode.LEVEL, target=level)

    @staticmethod
    def zoom_rate(id: int, share: float) -> Message:
        return wire.SetZoomTarget(camera_id=id, control_mode=wire.ZoomControlMode.VELOCITY, target=share)

    @staticmethod
    def reset_zoom(id: int) -> Message:
        return wire.ResetZoom(camera_id=id)

    @staticmethod
    def take_photo(id: int) -> Message:
        return wire.StartPhoto(camera_id=id)

    @staticmethod
    def stop_photo(id: int) -> Message:
        return wire.StopPhoto(camera_id=id)

    @staticmethod
    def start_recording(id: int) -> Message:
        return wire.StartRecording(camera_id=id)

    @staticmethod
    def stop_recording(id: int) -> Message:
        return wire.StopRecording(camera_id=id)

    zoom_event: type[Message] = wire.ZoomLevel
    photo_events: tuple[type[Message], ...] = (wire.Photo,)
    recording_events: tuple[type[Message], ...] = (wire.Recording, wire.State)
    state_events: tuple[type[Message], ...] = (wire.State,)
    photo_news = staticmethod(photo_news)
    recording_news = staticmethod(recording_news)
    camera_of = staticmethod(camera_of)
