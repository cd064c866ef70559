"""The Ai's camera: the same camera at work, in the protobuf language of `camera2`.

What a photo or a recording does is `capture`'s, whose events are put into the newer words here. Settings are the
fields of `camera2.Config`: a command names those it means, and the answer is a `State` with all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.camera import CameraCameraMode, CameraPhotoMode, PhotoResult, RecordingResult
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.sim.payload.camera import Camera
from anafi_mav.sim.payload.camera2_settings import CHOICES, COMMON, DEFAULTS, PHOTO, RANGES, RECORDING
from anafi_mav.sim.payload.capture import Capture, Studio
from anafi_mav.sim.payload.optics import (
    AUTOMATIC_EXPOSURE,
    AUTOMATIC_ISO,
    Optics,
    seconds,
    sensitivity,
    white_balance,
    zoomed,
)
from anafi_mav.sim.world.lenses import AI
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.units import RAD_PER_DEG, clip

CAMERA = 0
"""Its id; there is one."""

_MODES = {
    camera2.CameraMode.PHOTO: CameraCameraMode.PHOTO,
    camera2.CameraMode.RECORDING: CameraCameraMode.RECORDING,
}
"""The two languages count them the other way round."""

_RESOLUTIONS = {
    camera2.VideoResolution._2160P: camera.Resolution.RES_UHD_4K,
    camera2.VideoResolution._1080P: camera.Resolution.RES_1080P,
    camera2.VideoResolution._720P: camera.Resolution.RES_720P,
}

_PHOTO_STOPS = {
    PhotoResult.ERROR_NO_STORAGE_SPACE: camera2.PhotoStopReason.INSUFFICIENT_STORAGE_SPACE,
    PhotoResult.ERROR_BAD_STATE: camera2.PhotoStopReason.ALREADY,
    PhotoResult.ERROR: camera2.PhotoStopReason.CONFIGURATION_CHANGE,
}
_RECORDING_STOPS = {
    RecordingResult.STOPPED: camera2.RecordingStopReason.USER_REQUEST,
    RecordingResult.STOPPED_NO_STORAGE_SPACE: camera2.RecordingStopReason.INSUFFICIENT_STORAGE_SPACE,
    RecordingResult.STOPPED_RECONFIGURED: camera2.RecordingStopReason.CONFIGURATION_CHANGE,
    RecordingResult.ERROR_BAD_STATE: camera2.RecordingStopReason.ALREADY,
}
_MODE_FIELDS = {
    "camera_mode",
    "photo_mode",
    "photo_format",
    "photo_file_format",
    "photo_burst_value",
    "photo_bracketing_preset",
    "photo_time_lapse_interval",
    "photo_gps_lapse_interval",
    "video_recording_resolution",
    "video_recording_framerate",
}
"""Settings that cannot change under a photo, and end a recording."""


_MANUAL_SHUTTER = ("MANUAL_SHUTTER_SPEED", "MANUAL")
_MANUAL_ISO = ("MANUAL_ISO_SENSITIVITY", "MANUAL")
"""Exposure modes in which what was set by hand counts."""


class Camera2:
    """The Ai's front camera."""

    def __init__(self, model: AircraftModel, studio: Studio) -> None:
        self._camera = Camera(AI, model.settings["zoom_speed"])
        self._capture = Capture(self._camera, studio)
        self._config: dict[str, Any] = dict(DEFAULTS)
        self._exposure_lock = camera2.ExposureLockMode.UNLOCKED
        self._white_balance_lock = camera2.WhiteBalanceLockMode.UNLOCKED
        self._metadata = camera2.MediaMetadata(copyright="", custom_id="", custom_title="")
        self._media_id = ""
        self._photos = 0
        self._stopped = False
        """The user has asked for the end of the photos that are being taken."""
        self._time = 0.0
        """Of the last tick."""
        self._now = 0.0
        """Of the last tick or command."""
        self._flying = False
        self._apply()

    @property
    def busy(self) -> bool:
        """It is at work for the card."""
        return self._capture.busy

    @property
    def shots(self) -> int:
        """Pictures that have been taken of what is being photographed."""
        return self._capture.shots

    def optics(self, id: int) -> Optics:
        """Return the optical settings with which the picture is taken."""
        config, at_work = self._config, self._camera
        mode = config["exposure_mode"].name
        shutter = config["exposure_manual_shutter_speed"] if mode in _MANUAL_SHUTTER else None
        iso = config["exposure_manual_iso_sensitivity"] if mode in _MANUAL_ISO else None
        return Optics(
            hfov=zoomed(AI.hfov, at_work.zoom),
            zoom=at_work.zoom,
            exposure=AUTOMATIC_EXPOSURE if shutter is None else seconds(shutter),
            iso=AUTOMATIC_ISO if iso is None else sensitivity(iso),
            gains=white_balance(config["white_balance_mode"], config["white_balance_temperature"]),
        )

    # -- time

    def tick(self, time: float, flying: bool) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        seconds, self._time = time - self._time, time
        self._now = time
        messages = self._translate(self._capture.tick(time)) if self._capture.busy else []
        if self._camera.zooming:
            self._camera.advance_zoom(seconds)
        if flying != self._flying:
            self._flying = flying
            wanted = self._config["auto_record_mode"] is camera2.AutoRecordMode.FLIGHT
            recording = self._camera.mode is CameraCameraMode.RECORDING
            if wanted and recording and flying != self._capture.recording:
                act = self._capture.start_recording if flying else self._capture.stop_recording
                messages += self._translate(act(time))
        return messages

    def telemetry(self) -> list[Message]:
        """Return the messages sent five times a second."""
        return [self._zoom_level()]

    def work(self, act: Callable[[Capture], Iterable[Message]], time: float) -> list[Message]:
        """Let it do something; what it says of it."""
        self._now = time
        return self._translate(act(self._capture))

    # -- commands

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """Return the answer to a command of this service, or None for any other message.

        A command for a camera that does not exist is not answered.
        """
        handler = _HANDLERS.get(type(message))
        if handler is None:
            return None
        if getattr(message, "camera_id", CAMERA) != CAMERA:
            return []
        self._now = time
        return list(handler(self, message, time))

    def operate(self, message: Message, time: float) -> list[Message]:
        """Execute a camera command of a flight plan, given as a message of the older cameras.

        The autopilot sends these, because flight plans use the older messages.
        """
        self._now = time
        match message:
            case camera.SetCameraMode():
                photo = message.value is CameraCameraMode.PHOTO
                mode = camera2.CameraMode.PHOTO if photo else camera2.CameraMode.RECORDING
                return list(self._configure(camera2.Configure(config=camera2.Config(camera_mode=mode)), time))
            case camera.SetPhotoMode():
                config = camera2.Config(
                    photo_mode=camera2.PhotoMode(int(message.mode)),
                    photo_time_lapse_interval=(
                        message.capture_interval if message.mode is CameraPhotoMode.TIME_LAPSE else None
                    ),
                    photo_gps_lapse_interval=(
                        message.capture_interval if message.mode is CameraPhotoMode.GPS_LAPSE else None
                    ),
                )
                return list(self._configure(camera2.Configure(config=config), time))
            case camera.TakePhoto():
                return list(self._start_photo(message, time))
            case camera.StopPhoto():
                return list(self._stop_photo(message, time))
            case camera.StartRecording():
                return list(self._start_recording(message, time))
            case camera.StopRecording():
                return list(self._stop_recording(message, time))
            case camera.SetZoomTarget():
                self._camera.handle(message)
        return []

    def _list(self, m: camera2.ListCameras, time: float) -> Iterable[Message]:
        main = camera2.CameraModel.MAIN
        wanted = not m.model_filter or main in m.model_filter
        yield camera2.CameraList(cameras={CAMERA: main} if wanted else {})

    def _get_state(self, m: camera2.GetState, time: float) -> Iterable[Message]:
        yield self.state(default=m.include_default_capabilities)

    def _configure(self, m: camera2.Configure, time: float) -> Iterable[Message]:
        wanted = {} if m.config is None else {f: v for f in CHOICES | RANGES if (v := getattr(m.config, f)) is not None}
        taken: dict[str, Any] = {}
        for name, value in wanted.items():
            if name in RANGES:
                low, high = RANGES[name]
                if math.isfinite(value):
                    taken[name] = clip(value, low, high)
            elif value in CHOICES[name]:
                taken[name] = value
        changes = any(self._config[name] != value for name, value in taken.items() if name in _MODE_FIELDS)
        if changes and self._capture.shooting:
            taken = {name: value for name, value in taken.items() if name not in _MODE_FIELDS}
        elif changes and self._capture.recording:
            yield from self._translate(self._capture.interrupt(time))
        self._config |= taken
        if self._config["photo_mode"] is camera2.PhotoMode.BURST:
            self._config["photo_file_format"] = camera2.PhotoFileFormat.JPEG
        self._apply()
        yield camera2.State(
            camera_id=CAMERA,
            config=self.config(),
            photo=self._photo_state(),
            recording=self._recording_state(),
            zoom=self._zoom(),
        )

    def _apply(self) -> None:
        """Hand the settings to the active camera."""
        config, at_work = self._config, self._camera
        at_work.mode = _MODES[config["camera_mode"]]
        at_work.photo_mode = CameraPhotoMode(int(config["photo_mode"]))
        at_work.photo_file = camera.PhotoFileFormat(int(config["photo_file_format"]))
        at_work.burst = camera.BurstValue(int(config["photo_burst_value"]))
        at_work.bracketing = camera.BracketingPreset(int(config["photo_bracketing_preset"]))
        lapse = config["photo_mode"] is camera2.PhotoMode.GPS_LAPSE
        at_work.interval = config["photo_gps_lapse_interval" if lapse else "photo_time_lapse_interval"]
        at_work.resolution = _RESOLUTIONS[config["video_recording_resolution"]]
        allow = camera2.ZoomVelocityControlQualityMode.ALLOW_DEGRADATION
        at_work.handle(camera.SetMaxZoomSpeed(0, config["zoom_max_speed"]))
        at_work.handle(
            camera.SetZoomVelocityQualityDegradation(0, int(config["zoom_velocity_control_quality_mode"] is allow))
        )

    def _start_photo(self, m: Message, time: float) -> Iterable[Message]:
        self._photos, self._stopped = 0, False
        yield from self._translate(self._capture.take_photo(time))

    def _stop_photo(self, m: Message, time: float) -> Iterable[Message]:
        self._stopped = True
        yield from self._translate(self._capture.stop_photo(time))

    def _start_recording(self, m: Message, time: float) -> Iterable[Message]:
        yield from self._translate(self._capture.start_recording(time))

    def _stop_recording(self, m: Message, time: float) -> Iterable[Message]:
        yield from self._translate(self._capture.stop_recording(time))

    def _lock_exposure(self, m: camera2.LockExposure, time: float) -> Iterable[Message]:
        if m.mode in tuple(camera2.ExposureLockMode):
            self._exposure_lock = m.mode
        yield camera2.State(camera_id=CAMERA, exposure_lock=self._exposure_lock_state())

    def _lock_white_balance(self, m: camera2.LockWhiteBalance, time: float) -> Iterable[Message]:
        if m.mode in tuple(camera2.WhiteBalanceLockMode):
            self._white_balance_lock = m.mode
        yield camera2.State(camera_id=CAMERA, white_balance_lock=self._white_balance_lock_state())

    def _set_metadata(self, m: camera2.SetMediaMetadata, time: float) -> Iterable[Message]:
        if m.metadata is not None:
            before, after = self._metadata, m.metadata
            self._metadata = camera2.MediaMetadata(
                copyright=before.copyright if after.copyright is None else after.copyright,
                custom_id=before.custom_id if after.custom_id is None else after.custom_id,
                custom_title=before.custom_title if after.custom_title is None else after.custom_title,
            )
        yield camera2.State(camera_id=CAMERA, media_metadata=self._metadata)

    def _set_zoom(self, m: camera2.SetZoomTarget, time: float) -> Iterable[Message]:
        mode, target = m.control_mode, m.target
        if mode is camera2.ZoomControlMode.HFOV:
            if not 0.0 < target < 180.0:
                return
            mode = camera2.ZoomControlMode.LEVEL
            target = math.tan(AI.hfov / 2.0 * RAD_PER_DEG) / math.tan(target / 2.0 * RAD_PER_DEG)
        if mode in tuple(camera2.ZoomControlMode):
            self._camera.handle(camera.SetZoomTarget(0, camera.ZoomControlMode(int(mode)), target))
            yield self._zoom_level()

    def _reset_zoom(self, m: Message, time: float) -> Iterable[Message]:
        self._camera.handle(camera.ResetZoom(0))
        yield self._zoom_level()

    # -- the older words in the newer ones

    def _translate(self, messages: Iterable[Message]) -> list[Message]:
        translated: list[Message] = []
        for message in messages:
            match message:
                case camera.PhotoProgress():
                    translated += self._photo(message)
                case camera.PhotoState():
                    translated.append(camera2.State(camera_id=CAMERA, photo=self._photo_state()))
                case camera.RecordingProgress():
                    translated.append(self._recording(message))
                case camera.RecordingState():
                    translated.append(camera2.State(camera_id=CAMERA, recording=self._recording_state()))
                case camera.NextPhotoDelay():
                    mode = camera2.PhotoMode(int(message.mode))
                    translated.append(
                        camera2.NextPhotoInterval(camera_id=CAMERA, mode=mode, interval=message.remaining)
                    )
        return translated

    def _photo(self, m: camera.PhotoProgress) -> Iterable[Message]:
        event = camera2.PhotoEvent
        if m.result is PhotoResult.TAKING_PHOTO:
            self._media_id = ""
            yield camera2.Photo(camera_id=CAMERA, type=event.START)
        elif m.result is PhotoResult.PHOTO_TAKEN:
            self._photos = m.photo_count
            yield camera2.Photo(camera_id=CAMERA, type=event.TAKING_PHOTO)
        elif m.result is PhotoResult.PHOTO_SAVED:
            self._media_id = m.media_id
            if self._capture.lapsing:
                if not self._stopped:
                    return
                reason = camera2.PhotoStopReason.USER_REQUEST
            else:
                reason = camera2.PhotoStopReason.CAPTURE_DONE
            yield camera2.Photo(camera_id=CAMERA, type=event.STOP, media_id=m.media_id, stop_reason=reason)
        else:
            yield camera2.Photo(
                camera_id=CAMERA, type=event.STOP, media_id=self._media_id, stop_reason=_PHOTO_STOPS[m.result]
            )

    def _recording(self, m: camera.RecordingProgress) -> Message:
        if m.result is RecordingResult.STARTED:
            return camera2.Recording(camera_id=CAMERA, type=camera2.RecordingEvent.START)
        return camera2.Recording(
            camera_id=CAMERA,
            type=camera2.RecordingEvent.STOP,
            media_id=m.media_id,
            stop_reason=_RECORDING_STOPS.get(m.result, camera2.RecordingStopReason.INTERNAL_ERROR),
        )

    # -- reports

    def config(self) -> camera2.Config:
        return camera2.Config(**self._config)

    def state(self, *, default: bool = False) -> Message:
        """Everything of it."""
        return camera2.State(
            camera_id=CAMERA,
            active=True,
            default_capabilities=_CAPABILITIES if default else None,
            current_capabilities=_CAPABILITIES,
            config=self.config(),
            photo=self._photo_state(),
            recording=self._recording_state(),
            white_balance_lock=self._white_balance_lock_state(),
            exposure_lock=self._exposure_lock_state(),
            zoom=self._zoom(),
            zoom_is_locked=False,
            media_metadata=self._metadata,
        )

    def states_changed(self) -> list[Message]:
        """Report the photo and recording states, after other events changed them."""
        return [
            camera2.State(camera_id=CAMERA, photo=self._photo_state(), recording=self._recording_state()),
        ]

    def states_report(self) -> list[Message]:
        """Return no message for AllStates: clients query this camera instead."""
        return []

    def _photo_state(self) -> camera2.StatePhoto:
        reported = self._capture.photo_state()
        assert isinstance(reported, camera.PhotoState)
        state = camera2.PhotoState.UNAVAILABLE
        if reported.available is camera.Availability.AVAILABLE:
            active = reported.state is camera.State.ACTIVE
            state = camera2.PhotoState.ACTIVE if active else camera2.PhotoState.INACTIVE
        storage = camera2.StorageType.REMOVABLE
        return camera2.StatePhoto(state=state, photo_count=self._photos, storage=storage)

    def _recording_state(self) -> camera2.StateRecording:
        reported = self._capture.recording_state()
        assert isinstance(reported, camera.RecordingState)
        bitrate = self._config["video_recording_bitrate"]
        storage = camera2.StorageType.REMOVABLE
        if reported.available is not camera.Availability.AVAILABLE:
            return camera2.StateRecording(video_bitrate=bitrate, storage=storage)
        if reported.state is camera.State.ACTIVE:
            duration = round(self._capture.recorded(self._now) * 1000.0)
            state = camera2.RecordingState.ACTIVE
            return camera2.StateRecording(state=state, video_bitrate=bitrate, storage=storage, duration=duration)
        state = camera2.RecordingState.INACTIVE
        return camera2.StateRecording(state=state, video_bitrate=bitrate, storage=storage)

    def _exposure_lock_state(self) -> camera2.StateExposureLock:
        return camera2.StateExposureLock(supported_modes=tuple(camera2.ExposureLockMode), mode=self._exposure_lock)

    def _white_balance_lock_state(self) -> camera2.StateWhiteBalanceLock:
        modes = tuple(camera2.WhiteBalanceLockMode)
        return camera2.StateWhiteBalanceLock(supported_modes=modes, mode=self._white_balance_lock)

    def _zoom(self) -> camera2.StateZoom:
        return camera2.StateZoom(zoom_level_max=AI.zoom_max, zoom_high_quality_level_max=self._camera.fine_zoom)

    def _zoom_level(self) -> Message:
        zoom = self._camera.zoom
        return camera2.ZoomLevel(camera_id=CAMERA, level=zoom, hfov=zoomed(AI.hfov, zoom) / RAD_PER_DEG)


def _rule(index: int, mode: camera2.CameraMode, names: Iterable[str]) -> camera2.CapabilitiesRule:
    """Return the rule that lists the settings allowed together in one mode.

    The field of a list has the setting's name and an s, that of a range the suffix `_range`.
    """
    fields: dict[str, Any] = {"index": index, "camera_modes": (mode,)}
    for name in names:
        if name in RANGES:
            low, high = RANGES[name]
            fields[f"{name}_range"] = camera2.DoubleRange(min=low, max=high)
        else:
            plural = "exposure_manual_iso_sensitivities" if name.endswith("manual_iso_sensitivity") else f"{name}s"
            if name == "exposure_maximum_iso_sensitivity":
                plural = "exposure_maximum_iso_sensitivities"
            if name == "storage_policy":
                plural = "storage_policies"
            fields[plural] = CHOICES[name]
    return camera2.CapabilitiesRule(**fields)


_BURST = camera2.PhotoMode.BURST
_STILLS = _rule(0, camera2.CameraMode.PHOTO, (*PHOTO, *COMMON))
_CAPABILITIES = camera2.Capabilities(
    rules=(
        replace(_STILLS, photo_modes=tuple(mode for mode in camera2.PhotoMode if mode is not _BURST)),
        replace(_STILLS, index=1, photo_modes=(_BURST,), photo_file_formats=(camera2.PhotoFileFormat.JPEG,)),
        _rule(2, camera2.CameraMode.RECORDING, (*RECORDING, *COMMON)),
    )
)

_HANDLERS: dict[type[Message], Callable[[Camera2, Any, float], Iterable[Message]]] = {
    camera2.ListCameras: Camera2._list,
    camera2.GetState: Camera2._get_state,
    camera2.Configure: Camera2._configure,
    camera2.StartPhoto: Camera2._start_photo,
    camera2.StopPhoto: Camera2._stop_photo,
    camera2.StartRecording: Camera2._start_recording,
    camera2.StopRecording: Camera2._stop_recording,
    camera2.LockExposure: Camera2._lock_exposure,
    camera2.LockWhiteBalance: Camera2._lock_white_balance,
    camera2.SetMediaMetadata: Camera2._set_metadata,
    camera2.SetZoomTarget: Camera2._set_zoom,
    camera2.ResetZoom: Camera2._reset_zoom,
}
