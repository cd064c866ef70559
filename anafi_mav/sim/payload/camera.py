"""One camera of the older feature (143): its settings, each answered with what is then set.

What a camera cannot do leaves its setting as it was and is answered all the same, as Parrot's camera.xml demands of
every command. Taking photos and recording is `capture`'s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.camera import (
    AutoExposureMeteringMode,
    Availability,
    BracketingPreset,
    BurstValue,
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
from anafi_mav.sim.payload.optics import Optics, seconds, sensitivity, white_balance, zoomed
from anafi_mav.sim.world.lenses import BITRATES, LOWEST_BITRATE, WIDTHS, Lens, Photos, Recording
from anafi_mav.sim.world.model import SettingRange
from anafi_mav.units import RAD_PER_DEG, clip

STYLE_RANGE = (-3, 3)
ALIGNMENT_RANGE = (-5.0, 5.0)
"""deg; assumed."""
ROI_SIZE = 0.1
"""Share of the picture that a locked exposure is made for. Assumed."""

_MANUAL_SHUTTER = (ExposureMode.MANUAL, ExposureMode.MANUAL_SHUTTER_SPEED)
_MANUAL_ISO = (ExposureMode.MANUAL, ExposureMode.MANUAL_ISO_SENSITIVITY)
_AUTOMATIC = (
    ExposureMode.AUTOMATIC,
    ExposureMode.AUTOMATIC_PREFER_ISO_SENSITIVITY,
    ExposureMode.AUTOMATIC_PREFER_SHUTTER_SPEED,
)
_LAPSES = (CameraPhotoMode.TIME_LAPSE, CameraPhotoMode.GPS_LAPSE)
_STATES = tuple(State)


def bits(values: Iterable[int]) -> int:
    return sum(1 << value for value in values)


class Camera:
    """Settings of one camera."""

    def __init__(self, lens: Lens, zoom_speed: SettingRange) -> None:
        self.lens = lens
        self.id = lens.id
        self.active = lens.id == 0
        """True when the thermal mode has selected this camera."""
        self.mode = CameraCameraMode.RECORDING
        self.photo_mode = CameraPhotoMode.SINGLE
        self.photo_format = PhotoFormat.FULL_FRAME
        self.photo_file = PhotoFileFormat.JPEG
        self.burst = BurstValue.BURST_14_OVER_1S
        self.bracketing = BracketingPreset.PRESET_1EV_2EV_3EV
        self.interval = lens.timelapse_min
        """s or m of a lapse."""
        recording = _at_start(lens)
        self.recording_mode = CameraRecordingMode.STANDARD
        self.resolution = recording.resolution if recording else Resolution.RES_1080P
        self.framerate = recording.framerates[-1] if recording else Framerate.FPS_30
        self.hyperlapse = HyperlapseValue.RATIO_15
        self.autorecord = State.INACTIVE
        self.zoom = 1.0
        self._zoom_rate = 0.0
        """Share of the zoom speed that is wanted, -1 to 1."""
        self._zoom_limits = zoom_speed
        self._zoom_speed = zoom_speed.default
        self._degradation = 0
        self._reported_zoom: Message | None = None
        self._exposure_mode = ExposureMode.AUTOMATIC
        self._shutter = ShutterSpeed.SHUTTER_1_OVER_60
        self._iso = IsoSensitivity.ISO_100
        self._max_iso = lens.isos[-1]
        self._metering = AutoExposureMeteringMode.STANDARD
        self._lock = State.INACTIVE
        self._roi = (-1.0, -1.0)
        self._white_balance = WhiteBalanceMode.AUTOMATIC
        self._temperature = WhiteBalanceTemperature.T_5000
        self._white_balance_lock = State.INACTIVE
        self._ev = CameraEvCompensation.EV_0_00
        self._style = CameraStyle.STANDARD
        self._style_params: dict[CameraStyle, tuple[int, int, int]] = {}
        self._hdr = State.INACTIVE
        self._streaming = CameraStreamingMode.LOW_LATENCY
        self._alignment = (0.0, 0.0, 0.0)

    def handle(self, message: Message) -> list[Message] | None:
        """Return the answer to a setting command, or None for any other message."""
        handler = _HANDLERS.get(type(message))
        return None if handler is None else list(handler(self, message))

    # -- zoom

    @property
    def fine_zoom(self) -> float:
        """Return the largest zoom without interpolated pixels.

        There the picture uses as many pixels of the sensor as it has itself.
        """
        pixels = WIDTHS[self.resolution] if self.mode is CameraCameraMode.RECORDING else WIDTHS[Resolution.RES_UHD_4K]
        return clip(self.lens.width / pixels * self.lens.optical_zoom, 1.0, self.lens.zoom_max)

    @property
    def zooming(self) -> bool:
        return self._zoom_rate != 0.0

    def advance_zoom(self, seconds: float) -> None:
        """A wanted velocity at work.

        The speed setting is a tangent a second (Parrot's "tan(deg) / sec"), read here as how fast the tangent of half
        the picture's angle changes. Assumed: Parrot does not say of which angle.
        """
        if not self.zooming or seconds <= 0.0:
            return
        full = math.tan(self.lens.hfov / 2.0 * RAD_PER_DEG)
        end = self.lens.zoom_max if self._degradation else max(self.fine_zoom, self.zoom)
        tangent = full / self.zoom - self._zoom_rate * self._zoom_speed * seconds
        self.zoom = clip(full / tangent if tangent > 0.0 else end, 1.0, end)

    def _set_zoom(self, m: camera.SetZoomTarget) -> Iterable[Message]:
        if not math.isfinite(m.target):
            return
        if m.control_mode is ZoomControlMode.LEVEL:
            self.zoom, self._zoom_rate = clip(m.target, 1.0, self.lens.zoom_max), 0.0
        elif m.control_mode is ZoomControlMode.VELOCITY:
            self._zoom_rate = clip(m.target, -1.0, 1.0)
        yield self.zoom_report()

    def _reset_zoom(self, m: Message) -> Iterable[Message]:
        self.zoom, self._zoom_rate = 1.0, 0.0
        yield self.zoom_report()

    def _set_zoom_speed(self, m: camera.SetMaxZoomSpeed) -> Iterable[Message]:
        if m.max == m.max:
            self._zoom_speed = self._zoom_limits.clip(m.max)
        yield self._zoom_speed_report()

    def _set_degradation(self, m: camera.SetZoomVelocityQualityDegradation) -> Iterable[Message]:
        self._degradation = int(bool(m.allow))
        yield camera.ZoomVelocityQualityDegradation(self.id, self._degradation)

    # -- the picture

    def _set_exposure(self, m: camera.SetExposureSettings) -> Iterable[Message]:
        lens, mode = self.lens, m.mode
        fits = (
            mode in lens.exposure_modes
            and (mode not in _MANUAL_SHUTTER or m.shutter_speed in lens.shutters)
            and (mode not in _MANUAL_ISO or m.iso_sensitivity in lens.isos)
            and (mode not in _AUTOMATIC or m.max_iso_sensitivity in lens.isos)
            and (mode is ExposureMode.MANUAL or m.metering_mode in lens.metering)
        )
        unlocked = fits and mode is not self._exposure_mode and self._lock is State.ACTIVE
        if fits:
            # Each value counts in the modes that use it and is ignored in the others.
            self._exposure_mode = mode
            self._shutter = m.shutter_speed if mode in _MANUAL_SHUTTER else self._shutter
            self._iso = m.iso_sensitivity if mode in _MANUAL_ISO else self._iso
            self._max_iso = m.max_iso_sensitivity if mode in _AUTOMATIC else self._max_iso
            self._metering = self._metering if mode is ExposureMode.MANUAL else m.metering_mode
            if unlocked:
                self._lock, self._roi = State.INACTIVE, (-1.0, -1.0)
        yield self._exposure_report()
        if fits:
            yield self._exposure_now()

    def _lock_exposure(self, m: Message) -> Iterable[Message]:
        if isinstance(m, camera.UnlockExposure):
            self._lock, self._roi = State.INACTIVE, (-1.0, -1.0)
        elif self.lens.locks and self._exposure_mode is not ExposureMode.MANUAL:
            self._lock, self._roi = State.ACTIVE, (-1.0, -1.0)
            if isinstance(m, camera.LockExposureOnRoi) and math.isfinite(m.roi_center_x + m.roi_center_y):
                self._roi = clip(m.roi_center_x, 0.0, 1.0), clip(m.roi_center_y, 0.0, 1.0)
        yield self._exposure_now()

    def _set_white_balance(self, m: camera.SetWhiteBalance) -> Iterable[Message]:
        custom = m.mode is WhiteBalanceMode.CUSTOM
        if m.mode in self.lens.white_balances and (not custom or m.temperature in tuple(WhiteBalanceTemperature)):
            if m.mode is not self._white_balance:
                self._white_balance_lock = State.INACTIVE
            self._white_balance = m.mode
            self._temperature = m.temperature if custom else self._temperature
        yield self._white_balance_report()

    def _set_white_balance_lock(self, m: camera.SetWhiteBalanceLock) -> Iterable[Message]:
        if self.lens.locks and self._white_balance is not WhiteBalanceMode.CUSTOM and m.state in _STATES:
            self._white_balance_lock = m.state
        yield self._white_balance_report()

    def _set_ev(self, m: camera.SetEvCompensation) -> Iterable[Message]:
        if m.value in tuple(CameraEvCompensation):
            self._ev = m.value
        yield camera.EvCompensation(self.id, self._ev)

    def _set_style(self, m: camera.SetStyle) -> Iterable[Message]:
        if m.style in self.lens.styles:
            self._style = m.style
        yield self._style_report()

    def _set_style_params(self, m: camera.SetStyleParams) -> Iterable[Message]:
        low, high = STYLE_RANGE
        saturation, contrast, sharpness = (
            min(max(value, low), high) for value in (m.saturation, m.contrast, m.sharpness)
        )
        self._style_params[self._style] = (saturation, contrast, sharpness)
        yield self._style_report()

    def _set_hdr(self, m: camera.SetHdrSetting) -> Iterable[Message]:
        if m.value in _STATES:
            self._hdr = m.value
        yield camera.HdrSetting(self.id, self._hdr)
        yield self._hdr_report()

    def _set_streaming(self, m: camera.SetStreamingMode) -> Iterable[Message]:
        if m.value in tuple(CameraStreamingMode):
            self._streaming = m.value
        yield camera.StreamingMode(self.id, self._streaming)

    def _set_autorecord(self, m: camera.SetAutorecord) -> Iterable[Message]:
        if m.state in _STATES:
            self.autorecord = m.state
        yield camera.Autorecord(self.id, self.autorecord)

    def _set_alignment(self, m: camera.SetAlignmentOffsets) -> Iterable[Message]:
        if self.lens.adjustable and math.isfinite(m.yaw + m.pitch + m.roll):
            yaw, pitch, roll = (clip(angle, *ALIGNMENT_RANGE) for angle in (m.yaw, m.pitch, m.roll))
            self._alignment = (yaw, pitch, roll)
        yield from self._alignment_report()

    def _reset_alignment(self, m: Message) -> Iterable[Message]:
        self._alignment = (0.0, 0.0, 0.0)
        yield from self._alignment_report()

    # -- modes; `capture` looks after what is going on in them

    def set_mode(self, mode: CameraCameraMode) -> bool:
        """False: it has no such mode."""
        if mode in self.lens.modes:
            self.mode = mode
        return mode in self.lens.modes

    def set_recording(self, m: camera.SetRecordingMode) -> bool:
        """False: these do not go together on this camera."""
        hyperlapse = m.mode is CameraRecordingMode.HYPERLAPSE
        fits = _recording(self.lens, m.mode, m.resolution, m.framerate) is not None
        if not fits or (hyperlapse and m.hyperlapse not in self.lens.hyperlapses):
            return False
        self.recording_mode, self.resolution, self.framerate = m.mode, m.resolution, m.framerate
        self.hyperlapse = m.hyperlapse if hyperlapse else self.hyperlapse
        return True

    def set_photo(self, m: camera.SetPhotoMode) -> bool:
        """False: these do not go together on this camera.

        An interval that is too short is taken to the limit.
        """
        lens = self.lens
        fits = (
            _photos(lens, m.mode, m.format, m.file_format) is not None
            and (m.mode is not CameraPhotoMode.BURST or m.burst in lens.bursts)
            and (m.mode is not CameraPhotoMode.BRACKETING or m.bracketing in lens.brackets)
            and (m.mode not in _LAPSES or math.isfinite(m.capture_interval))
        )
        if not fits:
            return False
        self.photo_mode, self.photo_format, self.photo_file = m.mode, m.format, m.file_format
        self.burst = m.burst if m.mode is CameraPhotoMode.BURST else self.burst
        self.bracketing = m.bracketing if m.mode is CameraPhotoMode.BRACKETING else self.bracketing
        if m.mode in _LAPSES:
            shortest = lens.timelapse_min if m.mode is CameraPhotoMode.TIME_LAPSE else lens.gpslapse_min
            self.interval = max(m.capture_interval, shortest)
        return True

    # -- reports

    def mode_report(self) -> list[Message]:
        """The modes and what follows from them; zoom only if its bounds have changed."""
        return [camera.CameraMode(self.id, self.mode), self._hdr_report(), *self.zoom_change()]

    def recording_report(self) -> Message:
        bitrate = BITRATES.get(self.resolution, LOWEST_BITRATE)
        return camera.RecordingMode(
            self.id, self.recording_mode, self.resolution, self.framerate, self.hyperlapse, bitrate
        )

    def photo_report(self) -> Message:
        return camera.PhotoMode(
            self.id,
            self.photo_mode,
            self.photo_format,
            self.photo_file,
            self.burst,
            self.bracketing,
            self.interval,
        )

    def zoom_report(self) -> Message:
        return camera.ZoomLevel(self.id, self.zoom)

    def zoom_change(self) -> list[Message]:
        """Report the bounds of the zoom if they differ from those last reported."""
        now = self._zoom_info()
        if now == self._reported_zoom or self.lens.zoom_max == 1.0:
            return []
        self._reported_zoom = now
        return [now]

    def hdr_change(self) -> Message:
        return self._hdr_report()

    def _zoom_info(self) -> Message:
        return camera.ZoomInfo(self.id, Availability.AVAILABLE, self.fine_zoom, self.lens.zoom_max)

    def _zoom_speed_report(self) -> Message:
        return camera.MaxZoomSpeed(self.id, self._zoom_limits.low, self._zoom_limits.high, self._zoom_speed)

    def _hdr_report(self) -> Message:
        where: Photos | Recording | None
        if self.mode is CameraCameraMode.PHOTO:
            where = _photos(self.lens, self.photo_mode, self.photo_format, self.photo_file)
        else:
            where = _recording(self.lens, self.recording_mode, self.resolution, self.framerate)
        if where is None or not where.hdr:
            return camera.Hdr(self.id, Availability.NOT_AVAILABLE, State.INACTIVE)
        return camera.Hdr(self.id, Availability.AVAILABLE, self._hdr)

    def _exposure_report(self) -> Message:
        lens = self.lens
        shutters = bits(lens.shutters) if set(_MANUAL_SHUTTER) & set(lens.exposure_modes) else 0
        isos = bits(lens.isos) if set(_MANUAL_ISO) & set(lens.exposure_modes) else 0
        return camera.ExposureSettings(
            self.id,
            self._exposure_mode,
            self._shutter,
            shutters,
            self._iso,
            isos,
            self._max_iso,
            bits(lens.isos),
            self._metering,
        )

    def optics(self) -> Optics:
        """Return the optical settings with which the picture is taken."""
        shutter, iso = self._exposed()
        return Optics(
            hfov=zoomed(self.lens.hfov, self.zoom),
            zoom=self.zoom,
            exposure=seconds(shutter),
            iso=sensitivity(iso),
            gains=white_balance(self._white_balance, self._temperature),
        )

    def _exposed(self) -> tuple[ShutterSpeed, IsoSensitivity]:
        """Return shutter speed and ISO: the ones set, or those of the automatic (`optics`)."""
        manual = self._exposure_mode
        shutter = self._shutter if manual in _MANUAL_SHUTTER else ShutterSpeed.SHUTTER_1_OVER_60
        return shutter, self._iso if manual in _MANUAL_ISO else IsoSensitivity.ISO_100

    def _exposure_now(self) -> Message:
        shutter, iso = self._exposed()
        size = ROI_SIZE if self._roi[0] >= 0.0 else -1.0
        return camera.Exposure(self.id, shutter, iso, self._lock, *self._roi, size, size)

    def _white_balance_report(self) -> Message:
        return camera.WhiteBalance(self.id, self._white_balance, self._temperature, self._white_balance_lock)

    def _style_report(self) -> Message:
        saturation, contrast, sharpness = self._style_params.get(self._style, (0, 0, 0))
        return camera.Style(
            self.id, self._style, saturation, *STYLE_RANGE, contrast, *STYLE_RANGE, sharpness, *STYLE_RANGE
        )

    def _alignment_report(self) -> Iterable[Message]:
        if self.lens.adjustable:
            yaw, pitch, roll = self._alignment
            bounds = ALIGNMENT_RANGE
            yield camera.AlignmentOffsets(self.id, *bounds, yaw, *bounds, pitch, *bounds, roll)

    def capabilities(self) -> Message:
        lens = self.lens
        locks = Supported.SUPPORTED if lens.locks else Supported.NOT_SUPPORTED
        custom = WhiteBalanceMode.CUSTOM in lens.white_balances
        return camera.CameraCapabilities(
            cam_id=self.id,
            model=lens.model,
            exposure_modes=bits(lens.exposure_modes),
            exposure_lock_supported=locks,
            exposure_roi_lock_supported=locks,
            ev_compensations=bits(CameraEvCompensation),
            white_balance_modes=bits(lens.white_balances),
            custom_white_balance_temperatures=bits(WhiteBalanceTemperature) if custom else 0,
            white_balance_lock_supported=locks,
            styles=bits(lens.styles),
            camera_modes=bits(lens.modes),
            hyperlapse_values=bits(lens.hyperlapses),
            bracketing_presets=bits(lens.brackets),
            burst_values=bits(lens.bursts),
            streaming_modes=bits(CameraStreamingMode),
            timelapse_interval_min=lens.timelapse_min,
            gpslapse_interval_min=lens.gpslapse_min,
            auto_exposure_metering_modes=bits(lens.metering),
        )

    def settings_report(self) -> list[Message]:
        """Every setting: at the connection, and again when the camera becomes the active one."""
        zoomable = self.lens.zoom_max > 1.0
        self._reported_zoom = self._zoom_info()
        return [
            self._exposure_report(),
            self._exposure_now(),
            self._white_balance_report(),
            camera.EvCompensation(self.id, self._ev),
            self._style_report(),
            *([self.zoom_report(), self._reported_zoom, self._zoom_speed_report()] if zoomable else []),
            *([camera.ZoomVelocityQualityDegradation(self.id, self._degradation)] if zoomable else []),
            camera.HdrSetting(self.id, self._hdr),
            self._hdr_report(),
            camera.CameraMode(self.id, self.mode),
            self.recording_report(),
            self.photo_report(),
            camera.StreamingMode(self.id, self._streaming),
            camera.Autorecord(self.id, self.autorecord),
            *self._alignment_report(),
        ]


def _at_start(lens: Lens) -> Recording | None:
    """4K if it can, as the aircraft comes."""
    return next((one for one in lens.recordings if one.resolution is Resolution.RES_UHD_4K), None) or next(
        iter(lens.recordings), None
    )


def _recording(lens: Lens, mode: CameraRecordingMode, resolution: Resolution, framerate: Framerate) -> Recording | None:
    for one in lens.recordings:
        if mode in one.modes and resolution is one.resolution and framerate in one.framerates:
            return one
    return None


def _photos(lens: Lens, mode: CameraPhotoMode, format: PhotoFormat, file: PhotoFileFormat) -> Photos | None:
    for one in lens.photos:
        if mode in one.modes and format in one.formats and file in one.files:
            return one
    return None


_HANDLERS: dict[type[Message], Callable[[Camera, Any], Iterable[Message]]] = {
    camera.SetExposureSettings: Camera._set_exposure,
    camera.LockExposure: Camera._lock_exposure,
    camera.LockExposureOnRoi: Camera._lock_exposure,
    camera.UnlockExposure: Camera._lock_exposure,
    camera.SetWhiteBalance: Camera._set_white_balance,
    camera.SetWhiteBalanceLock: Camera._set_white_balance_lock,
    camera.SetEvCompensation: Camera._set_ev,
    camera.SetStyle: Camera._set_style,
    camera.SetStyleParams: Camera._set_style_params,
    camera.SetZoomTarget: Camera._set_zoom,
    camera.ResetZoom: Camera._reset_zoom,
    camera.SetMaxZoomSpeed: Camera._set_zoom_speed,
    camera.SetZoomVelocityQualityDegradation: Camera._set_degradation,
    camera.SetHdrSetting: Camera._set_hdr,
    camera.SetStreamingMode: Camera._set_streaming,
    camera.SetAutorecord: Camera._set_autorecord,
    camera.SetAlignmentOffsets: Camera._set_alignment,
    camera.ResetAlignmentOffsets: Camera._reset_alignment,
}
