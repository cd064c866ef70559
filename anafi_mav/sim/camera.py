"""The camera's settings: every command is answered with what is then set. Pictures are not taken yet.

Capabilities are those recorded from an ANAFI 4K by anafi_ros (its `extra` folder). Taking photos and recording are
reported as not available, and their commands get no answer, until the simulator has something to photograph.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.camera import (
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
    ExposureMode,
    Framerate,
    HyperlapseValue,
    IsoSensitivity,
    PhotoFileFormat,
    PhotoFormat,
    Resolution,
    ShutterSpeed,
    State,
    Supported,
    WhiteBalanceMode,
    WhiteBalanceTemperature,
    ZoomControlMode,
)
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.wire import Message
from anafi_mav.sim.model import Model
from anafi_mav.units import clip

BITRATE = 100_000_000
"""bit/s of a 4K recording."""
STYLE_RANGE = (-3, 3)


def _bits(values: Iterable[int]) -> int:
    return sum(1 << value for value in values)


_EXPOSURE_MODES = (
    ExposureMode.AUTOMATIC,
    ExposureMode.AUTOMATIC_PREFER_ISO_SENSITIVITY,
    ExposureMode.AUTOMATIC_PREFER_SHUTTER_SPEED,
)
_WHITE_BALANCES = (
    WhiteBalanceMode.AUTOMATIC,
    WhiteBalanceMode.INCANDESCENT,
    WhiteBalanceMode.FLUORESCENT,
    WhiteBalanceMode.SUNNY,
    WhiteBalanceMode.CLOUDY,
    WhiteBalanceMode.CUSTOM,
)
_STANDARD = (CameraRecordingMode.STANDARD, CameraRecordingMode.HYPERLAPSE)
_FAST = (CameraRecordingMode.SLOW_MOTION, CameraRecordingMode.HIGH_FRAMERATE)
_CINEMA = (Framerate.FPS_24, Framerate.FPS_25, Framerate.FPS_30)
_RECORDINGS: tuple[tuple[Iterable[int], Resolution, Iterable[int], Supported], ...] = (
    (_STANDARD, Resolution.RES_1080P, _CINEMA, Supported.SUPPORTED),
    (_STANDARD[:1], Resolution.RES_DCI_4K, _CINEMA[:1], Supported.NOT_SUPPORTED),
    (_STANDARD, Resolution.RES_UHD_4K, _CINEMA, Supported.SUPPORTED),
    (_STANDARD, Resolution.RES_2_7K, _CINEMA, Supported.SUPPORTED),
    (_FAST, Resolution.RES_1080P, (Framerate.FPS_48, Framerate.FPS_50, Framerate.FPS_60), Supported.NOT_SUPPORTED),
    (_FAST, Resolution.RES_720P, (Framerate.FPS_96, Framerate.FPS_100, Framerate.FPS_120), Supported.NOT_SUPPORTED),
)
"""Recording capabilities by id: modes, resolution, framerates, HDR."""

ISO = tuple(iso for iso in IsoSensitivity if iso >= IsoSensitivity.ISO_100)


class Camera:
    """Camera 0."""

    def __init__(self, model: Model) -> None:
        self._zoom_speed = model.settings["zoom_speed"]
        self._zoom_max = model.zoom_max
        self._max_zoom_speed = self._zoom_speed.default
        self._zoom = 1.0
        self._exposure = (
            ExposureMode.AUTOMATIC,
            ShutterSpeed.SHUTTER_1_OVER_60,
            IsoSensitivity.ISO_100,
            IsoSensitivity.ISO_3200,
            camera.AutoExposureMeteringMode.STANDARD,
        )
        self._exposure_lock = State.INACTIVE
        self._white_balance = (WhiteBalanceMode.AUTOMATIC, WhiteBalanceTemperature.T_5000)
        self._white_balance_lock = State.INACTIVE
        self._ev = CameraEvCompensation.EV_0_00
        self._antiflicker = CameraAntiflickerMode.AUTO
        self._style = (CameraStyle.STANDARD, 0, 0, 0)
        self._degradation = 0
        self._hdr = State.INACTIVE
        self._mode = CameraCameraMode.RECORDING
        self._recording = (
            CameraRecordingMode.STANDARD,
            Resolution.RES_UHD_4K,
            Framerate.FPS_30,
            HyperlapseValue.RATIO_15,
        )
        self._photo = (
            CameraPhotoMode.SINGLE,
            PhotoFormat.FULL_FRAME,
            PhotoFileFormat.JPEG,
            BurstValue.BURST_14_OVER_1S,
            BracketingPreset.PRESET_1EV_2EV_3EV,
            2.0,
        )
        self._streaming = CameraStreamingMode.LOW_LATENCY
        self._autorecord = State.INACTIVE
        self._alignment = (0.0, 0.0, 0.0)

    def handle(self, message: Message) -> list[Message] | None:
        """The answer to a command of this feature; None when it is none."""
        handler = _HANDLERS.get(type(message))
        return None if handler is None else list(handler(self, message))

    # -- commands

    def _set_exposure(self, m: camera.SetExposureSettings) -> Iterable[Message]:
        if m.mode in _EXPOSURE_MODES:
            self._exposure = (m.mode, m.shutter_speed, m.iso_sensitivity, m.max_iso_sensitivity, m.metering_mode)
        yield self._exposure_report()

    def _lock_exposure(self, m: Message) -> Iterable[Message]:
        self._exposure_lock = State.INACTIVE if isinstance(m, camera.UnlockExposure) else State.ACTIVE
        yield self._exposure_now()

    def _set_white_balance(self, m: camera.SetWhiteBalance) -> Iterable[Message]:
        if m.mode in _WHITE_BALANCES:
            self._white_balance = (m.mode, m.temperature)
        yield self._white_balance_report()

    def _set_white_balance_lock(self, m: camera.SetWhiteBalanceLock) -> Iterable[Message]:
        self._white_balance_lock = m.state
        yield self._white_balance_report()

    def _set_ev(self, m: camera.SetEvCompensation) -> Iterable[Message]:
        self._ev = CameraEvCompensation(round(clip(m.value, 0, CameraEvCompensation.EV_3_00)))
        yield camera.EvCompensation(0, self._ev)

    def _set_antiflicker(self, m: camera.SetAntiflickerMode) -> Iterable[Message]:
        self._antiflicker = m.mode
        yield self._antiflicker_report()

    def _set_style(self, m: camera.SetStyle) -> Iterable[Message]:
        self._style = (m.style, *self._style[1:])
        yield self._style_report()

    def _set_style_params(self, m: camera.SetStyleParams) -> Iterable[Message]:
        low, high = STYLE_RANGE
        saturation, contrast, sharpness = (
            min(max(value, low), high) for value in (m.saturation, m.contrast, m.sharpness)
        )
        self._style = (self._style[0], saturation, contrast, sharpness)
        yield self._style_report()

    def _set_zoom(self, m: camera.SetZoomTarget) -> Iterable[Message]:
        if m.control_mode is ZoomControlMode.LEVEL and m.target == m.target:
            self._zoom = clip(m.target, 1.0, self._zoom_max)
        yield camera.ZoomLevel(0, self._zoom)

    def _reset_zoom(self, m: Message) -> Iterable[Message]:
        self._zoom = 1.0
        yield camera.ZoomLevel(0, self._zoom)

    def _set_zoom_speed(self, m: camera.SetMaxZoomSpeed) -> Iterable[Message]:
        self._max_zoom_speed = self._zoom_speed.clip(m.max)
        yield self._zoom_speed_report()

    def _set_degradation(self, m: camera.SetZoomVelocityQualityDegradation) -> Iterable[Message]:
        self._degradation = int(bool(m.allow))
        yield camera.ZoomVelocityQualityDegradation(0, self._degradation)

    def _set_hdr(self, m: camera.SetHdrSetting) -> Iterable[Message]:
        self._hdr = m.value
        yield camera.HdrSetting(0, self._hdr)
        yield camera.Hdr(0, Availability.AVAILABLE, self._hdr)

    def _set_mode(self, m: camera.SetCameraMode) -> Iterable[Message]:
        self._mode = m.value
        yield camera.CameraMode(0, self._mode)

    def _set_recording(self, m: camera.SetRecordingMode) -> Iterable[Message]:
        if any(
            m.mode in modes and m.resolution is resolution and m.framerate in rates
            for modes, resolution, rates, _ in _RECORDINGS
        ):
            self._recording = (m.mode, m.resolution, m.framerate, m.hyperlapse)
        yield camera.RecordingMode(0, *self._recording, BITRATE)

    def _set_photo(self, m: camera.SetPhotoMode) -> Iterable[Message]:
        self._photo = (m.mode, m.format, m.file_format, m.burst, m.bracketing, m.capture_interval)
        yield camera.PhotoMode(0, *self._photo)

    def _set_streaming(self, m: camera.SetStreamingMode) -> Iterable[Message]:
        self._streaming = m.value
        yield camera.StreamingMode(0, self._streaming)

    def _set_autorecord(self, m: camera.SetAutorecord) -> Iterable[Message]:
        self._autorecord = m.state
        yield camera.Autorecord(0, self._autorecord)

    def _set_alignment(self, m: camera.SetAlignmentOffsets) -> Iterable[Message]:
        self._alignment = (m.yaw, m.pitch, m.roll)
        yield self._alignment_report()

    def _reset_alignment(self, m: Message) -> Iterable[Message]:
        self._alignment = (0.0, 0.0, 0.0)
        yield self._alignment_report()

    # -- reports

    def _exposure_report(self) -> Message:
        mode, shutter, iso, max_iso, metering = self._exposure
        return camera.ExposureSettings(
            0, mode, shutter, _bits(ShutterSpeed), iso, _bits(ISO), max_iso, _bits(ISO), metering
        )

    def _exposure_now(self) -> Message:
        return camera.Exposure(0, self._exposure[1], self._exposure[2], self._exposure_lock, 0.0, 0.0, 0.0, 0.0)

    def _white_balance_report(self) -> Message:
        return camera.WhiteBalance(0, *self._white_balance, self._white_balance_lock)

    def _antiflicker_report(self) -> Message:
        automatic = self._antiflicker is CameraAntiflickerMode.AUTO
        return camera.AntiflickerMode(
            self._antiflicker, CameraAntiflickerMode.MODE_50HZ if automatic else self._antiflicker
        )

    def _style_report(self) -> Message:
        style, saturation, contrast, sharpness = self._style
        return camera.Style(0, style, saturation, *STYLE_RANGE, contrast, *STYLE_RANGE, sharpness, *STYLE_RANGE)

    def _zoom_speed_report(self) -> Message:
        return camera.MaxZoomSpeed(0, self._zoom_speed.low, self._zoom_speed.high, self._max_zoom_speed)

    def _alignment_report(self) -> Message:
        yaw, pitch, roll = self._alignment
        return camera.AlignmentOffsets(0, -5.0, 5.0, yaw, -5.0, 5.0, pitch, -5.0, 5.0, roll)

    def states_report(self) -> list[Message]:
        """What AllStates tells of the camera."""
        last = len(_RECORDINGS) - 1
        recordings = [
            camera.RecordingCapabilities(
                id,
                _bits(modes),
                _bits([resolution]),
                _bits(rates),
                hdr,
                (id == 0) << ListFlags.FIRST | (id == last) << ListFlags.LAST,
            )
            for id, (modes, resolution, rates, hdr) in enumerate(_RECORDINGS)
        ]
        return [
            camera.CameraCapabilities(
                cam_id=0,
                model=camera.Model.MAIN,
                exposure_modes=_bits(_EXPOSURE_MODES),
                exposure_lock_supported=Supported.NOT_SUPPORTED,
                exposure_roi_lock_supported=Supported.NOT_SUPPORTED,
                ev_compensations=_bits(CameraEvCompensation),
                white_balance_modes=_bits(_WHITE_BALANCES),
                custom_white_balance_temperatures=_bits(WhiteBalanceTemperature),
                white_balance_lock_supported=Supported.NOT_SUPPORTED,
                styles=_bits([CameraStyle.STANDARD]),
                camera_modes=_bits(CameraCameraMode),
                hyperlapse_values=_bits(HyperlapseValue),
                bracketing_presets=_bits(BracketingPreset),
                burst_values=_bits([BurstValue.BURST_14_OVER_1S]),
                streaming_modes=_bits(CameraStreamingMode),
                timelapse_interval_min=2.0,
                gpslapse_interval_min=1.0,
                auto_exposure_metering_modes=_bits([camera.AutoExposureMeteringMode.STANDARD]),
            ),
            *recordings,
            camera.PhotoCapabilities(
                0,
                _bits(CameraPhotoMode),
                _bits(PhotoFormat),
                _bits([PhotoFileFormat.JPEG, PhotoFileFormat.DNG_JPEG]),
                Supported.SUPPORTED,
                1 << ListFlags.FIRST | 1 << ListFlags.LAST,
            ),
            camera.AntiflickerCapabilities(_bits(CameraAntiflickerMode)),
            self._exposure_report(),
            self._exposure_now(),
            self._white_balance_report(),
            camera.EvCompensation(0, self._ev),
            self._antiflicker_report(),
            self._style_report(),
            camera.ZoomLevel(0, self._zoom),
            camera.ZoomInfo(0, Availability.AVAILABLE, 1.4, self._zoom_max),
            self._zoom_speed_report(),
            camera.ZoomVelocityQualityDegradation(0, self._degradation),
            camera.HdrSetting(0, self._hdr),
            camera.Hdr(0, Availability.AVAILABLE, self._hdr),
            camera.CameraMode(0, self._mode),
            camera.RecordingMode(0, *self._recording, BITRATE),
            camera.PhotoMode(0, *self._photo),
            camera.StreamingMode(0, self._streaming),
            camera.PhotoState(0, Availability.NOT_AVAILABLE, State.INACTIVE),
            camera.RecordingState(0, Availability.NOT_AVAILABLE, State.INACTIVE, 0),
            camera.Autorecord(0, self._autorecord),
            camera.CameraStates(1),
            self._alignment_report(),
        ]


_HANDLERS: dict[type[Message], Callable[[Camera, Any], Iterable[Message]]] = {
    camera.SetExposureSettings: Camera._set_exposure,
    camera.LockExposure: Camera._lock_exposure,
    camera.LockExposureOnRoi: Camera._lock_exposure,
    camera.UnlockExposure: Camera._lock_exposure,
    camera.SetWhiteBalance: Camera._set_white_balance,
    camera.SetWhiteBalanceLock: Camera._set_white_balance_lock,
    camera.SetEvCompensation: Camera._set_ev,
    camera.SetAntiflickerMode: Camera._set_antiflicker,
    camera.SetStyle: Camera._set_style,
    camera.SetStyleParams: Camera._set_style_params,
    camera.SetZoomTarget: Camera._set_zoom,
    camera.ResetZoom: Camera._reset_zoom,
    camera.SetMaxZoomSpeed: Camera._set_zoom_speed,
    camera.SetZoomVelocityQualityDegradation: Camera._set_degradation,
    camera.SetHdrSetting: Camera._set_hdr,
    camera.SetCameraMode: Camera._set_mode,
    camera.SetRecordingMode: Camera._set_recording,
    camera.SetPhotoMode: Camera._set_photo,
    camera.SetStreamingMode: Camera._set_streaming,
    camera.SetAutorecord: Camera._set_autorecord,
    camera.SetAlignmentOffsets: Camera._set_alignment,
    camera.ResetAlignmentOffsets: Camera._reset_alignment,
}
