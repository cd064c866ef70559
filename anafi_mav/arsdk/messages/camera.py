"""Feature 143, camera: the EO and thermal cameras of 4K, Thermal and USA."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import (
    ENUM,
    F32,
    I8,
    STRING,
    U8,
    U16,
    U32,
    U64,
    Bits,
    Buffer,
    Message,
    OpenEnum,
    command,
    event,
    value,
)
from anafi_mav.arsdk.messages.generic import ListFlags


class Model(OpenEnum):
    MAIN = 0
    THERMAL = 1
    THERMAL_BLENDED = 2


class Supported(OpenEnum):
    NOT_SUPPORTED = 0
    SUPPORTED = 1


class Availability(OpenEnum):
    NOT_AVAILABLE = 0
    AVAILABLE = 1


class State(OpenEnum):
    INACTIVE = 0
    ACTIVE = 1


class ExposureMode(OpenEnum):
    AUTOMATIC = 0
    AUTOMATIC_PREFER_ISO_SENSITIVITY = 1
    AUTOMATIC_PREFER_SHUTTER_SPEED = 2
    MANUAL_ISO_SENSITIVITY = 3
    MANUAL_SHUTTER_SPEED = 4
    MANUAL = 5


class ShutterSpeed(OpenEnum):
    SHUTTER_1_OVER_10000 = 0
    SHUTTER_1_OVER_8000 = 1
    SHUTTER_1_OVER_6400 = 2
    SHUTTER_1_OVER_5000 = 3
    SHUTTER_1_OVER_4000 = 4
    SHUTTER_1_OVER_3200 = 5
    SHUTTER_1_OVER_2500 = 6
    SHUTTER_1_OVER_2000 = 7
    SHUTTER_1_OVER_1600 = 8
    SHUTTER_1_OVER_1250 = 9
    SHUTTER_1_OVER_1000 = 10
    SHUTTER_1_OVER_800 = 11
    SHUTTER_1_OVER_640 = 12
    SHUTTER_1_OVER_500 = 13
    SHUTTER_1_OVER_400 = 14
    SHUTTER_1_OVER_320 = 15
    SHUTTER_1_OVER_240 = 16
    SHUTTER_1_OVER_200 = 17
    SHUTTER_1_OVER_160 = 18
    SHUTTER_1_OVER_120 = 19
    SHUTTER_1_OVER_100 = 20
    SHUTTER_1_OVER_80 = 21
    SHUTTER_1_OVER_60 = 22
    SHUTTER_1_OVER_50 = 23
    SHUTTER_1_OVER_40 = 24
    SHUTTER_1_OVER_30 = 25
    SHUTTER_1_OVER_25 = 26
    SHUTTER_1_OVER_15 = 27
    SHUTTER_1_OVER_10 = 28
    SHUTTER_1_OVER_8 = 29
    SHUTTER_1_OVER_6 = 30
    SHUTTER_1_OVER_4 = 31
    SHUTTER_1_OVER_3 = 32
    SHUTTER_1_OVER_2 = 33
    SHUTTER_1_OVER_1_5 = 34
    SHUTTER_1 = 35


class IsoSensitivity(OpenEnum):
    ISO_50 = 0
    ISO_64 = 1
    ISO_80 = 2
    ISO_100 = 3
    ISO_125 = 4
    ISO_160 = 5
    ISO_200 = 6
    ISO_250 = 7
    ISO_320 = 8
    ISO_400 = 9
    ISO_500 = 10
    ISO_640 = 11
    ISO_800 = 12
    ISO_1200 = 13
    ISO_1600 = 14
    ISO_2500 = 15
    ISO_3200 = 16


class CameraEvCompensation(OpenEnum):
    EV_MINUS_3_00 = 0
    EV_MINUS_2_67 = 1
    EV_MINUS_2_33 = 2
    EV_MINUS_2_00 = 3
    EV_MINUS_1_67 = 4
    EV_MINUS_1_33 = 5
    EV_MINUS_1_00 = 6
    EV_MINUS_0_67 = 7
    EV_MINUS_0_33 = 8
    EV_0_00 = 9
    EV_0_33 = 10
    EV_0_67 = 11
    EV_1_00 = 12
    EV_1_33 = 13
    EV_1_67 = 14
    EV_2_00 = 15
    EV_2_33 = 16
    EV_2_67 = 17
    EV_3_00 = 18


class WhiteBalanceMode(OpenEnum):
    AUTOMATIC = 0
    CANDLE = 1
    SUNSET = 2
    INCANDESCENT = 3
    WARM_WHITE_FLUORESCENT = 4
    HALOGEN = 5
    FLUORESCENT = 6
    COOL_WHITE_FLUORESCENT = 7
    FLASH = 8
    DAYLIGHT = 9
    SUNNY = 10
    CLOUDY = 11
    SNOW = 12
    HAZY = 13
    SHADED = 14
    GREEN_FOLIAGE = 15
    BLUE_SKY = 16
    CUSTOM = 17


class WhiteBalanceTemperature(OpenEnum):
    T_1500 = 0
    T_1750 = 1
    T_2000 = 2
    T_2250 = 3
    T_2500 = 4
    T_2750 = 5
    T_3000 = 6
    T_3250 = 7
    T_3500 = 8
    T_3750 = 9
    T_4000 = 10
    T_4250 = 11
    T_4500 = 12
    T_4750 = 13
    T_5000 = 14
    T_5250 = 15
    T_5500 = 16
    T_5750 = 17
    T_6000 = 18
    T_6250 = 19
    T_6500 = 20
    T_6750 = 21
    T_7000 = 22
    T_7250 = 23
    T_7500 = 24
    T_7750 = 25
    T_8000 = 26
    T_8250 = 27
    T_8500 = 28
    T_8750 = 29
    T_9000 = 30
    T_9250 = 31
    T_9500 = 32
    T_9750 = 33
    T_10000 = 34
    T_10250 = 35
    T_10500 = 36
    T_10750 = 37
    T_11000 = 38
    T_11250 = 39
    T_11500 = 40
    T_11750 = 41
    T_12000 = 42
    T_12250 = 43
    T_12500 = 44
    T_12750 = 45
    T_13000 = 46
    T_13250 = 47
    T_13500 = 48
    T_13750 = 49
    T_14000 = 50
    T_14250 = 51
    T_14500 = 52
    T_14750 = 53
    T_15000 = 54


class CameraStyle(OpenEnum):
    STANDARD = 0
    PLOG = 1
    INTENSE = 2
    PASTEL = 3


class CameraCameraMode(OpenEnum):
    RECORDING = 0
    PHOTO = 1


class CameraRecordingMode(OpenEnum):
    STANDARD = 0
    HYPERLAPSE = 1
    SLOW_MOTION = 2
    HIGH_FRAMERATE = 3


class CameraPhotoMode(OpenEnum):
    SINGLE = 0
    BRACKETING = 1
    BURST = 2
    TIME_LAPSE = 3
    GPS_LAPSE = 4


class Resolution(OpenEnum):
    RES_DCI_4K = 0
    RES_UHD_4K = 1
    RES_2_7K = 2
    RES_1080P = 3
    RES_720P = 4
    RES_480P = 5
    RES_1080P_SD = 6
    RES_720P_SD = 7
    RES_UHD_8K = 8
    RES_5K = 9


class Framerate(OpenEnum):
    FPS_24 = 0
    FPS_25 = 1
    FPS_30 = 2
    FPS_48 = 3
    FPS_50 = 4
    FPS_60 = 5
    FPS_96 = 6
    FPS_100 = 7
    FPS_120 = 8
    FPS_9 = 9
    FPS_15 = 10
    FPS_20 = 11
    FPS_192 = 12
    FPS_200 = 13
    FPS_240 = 14
    FPS_10 = 15
    FPS_8_6 = 16


class PhotoFormat(OpenEnum):
    FULL_FRAME = 0
    RECTILINEAR = 1


class PhotoFileFormat(OpenEnum):
    JPEG = 0
    DNG = 1
    DNG_JPEG = 2


class CameraAntiflickerMode(OpenEnum):
    OFF = 0
    AUTO = 1
    MODE_50HZ = 2
    MODE_60HZ = 3


class HyperlapseValue(OpenEnum):
    RATIO_15 = 0
    RATIO_30 = 1
    RATIO_60 = 2
    RATIO_120 = 3
    RATIO_240 = 4


class BurstValue(OpenEnum):
    BURST_14_OVER_4S = 0
    BURST_14_OVER_2S = 1
    BURST_14_OVER_1S = 2
    BURST_10_OVER_4S = 3
    BURST_10_OVER_2S = 4
    BURST_10_OVER_1S = 5
    BURST_4_OVER_4S = 6
    BURST_4_OVER_2S = 7
    BURST_4_OVER_1S = 8


class BracketingPreset(OpenEnum):
    PRESET_1EV = 0
    PRESET_2EV = 1
    PRESET_3EV = 2
    PRESET_1EV_2EV = 3
    PRESET_1EV_3EV = 4
    PRESET_2EV_3EV = 5
    PRESET_1EV_2EV_3EV = 6


class CameraStreamingMode(OpenEnum):
    LOW_LATENCY = 0
    HIGH_RELIABILITY = 1
    HIGH_RELIABILITY_LOW_FRAMERATE = 2


class PhotoResult(OpenEnum):
    TAKING_PHOTO = 0
    PHOTO_TAKEN = 1
    PHOTO_SAVED = 2
    ERROR_NO_STORAGE_SPACE = 3
    ERROR_BAD_STATE = 4
    ERROR = 5


class RecordingResult(OpenEnum):
    STARTED = 0
    STOPPED = 1
    STOPPED_NO_STORAGE_SPACE = 2
    STOPPED_STORAGE_TOO_SLOW = 3
    ERROR_BAD_STATE = 4
    ERROR = 5
    STOPPED_RECONFIGURED = 6


class ZoomControlMode(OpenEnum):
    LEVEL = 0
    VELOCITY = 1


class AutoExposureMeteringMode(OpenEnum):
    STANDARD = 0
    CENTER_TOP = 1


@event("camera.camera_capabilities", 143, 0, 1)
class CameraCapabilities(Message, frozen=True):
    cam_id: Annotated[int, U8]
    model: Annotated[Model, ENUM]
    exposure_modes: Annotated[int, Bits(U8, ExposureMode)]
    exposure_lock_supported: Annotated[Supported, ENUM]
    exposure_roi_lock_supported: Annotated[Supported, ENUM]
    ev_compensations: Annotated[int, Bits(U64, CameraEvCompensation)]
    white_balance_modes: Annotated[int, Bits(U32, WhiteBalanceMode)]
    custom_white_balance_temperatures: Annotated[int, Bits(U64, WhiteBalanceTemperature)]
    white_balance_lock_supported: Annotated[Supported, ENUM]
    styles: Annotated[int, Bits(U16, CameraStyle)]
    camera_modes: Annotated[int, Bits(U8, CameraCameraMode)]
    hyperlapse_values: Annotated[int, Bits(U16, HyperlapseValue)]
    bracketing_presets: Annotated[int, Bits(U16, BracketingPreset)]
    burst_values: Annotated[int, Bits(U16, BurstValue)]
    streaming_modes: Annotated[int, Bits(U8, CameraStreamingMode)]
    timelapse_interval_min: Annotated[float, F32]
    gpslapse_interval_min: Annotated[float, F32]
    auto_exposure_metering_modes: Annotated[int, Bits(U16, AutoExposureMeteringMode)]


@event("camera.recording_capabilities", 143, 0, 2)
class RecordingCapabilities(Message, frozen=True):
    id: Annotated[int, U16]
    recording_modes: Annotated[int, Bits(U16, CameraRecordingMode)]
    resolutions: Annotated[int, Bits(U16, Resolution)]
    framerates: Annotated[int, Bits(U32, Framerate)]
    hdr: Annotated[Supported, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("camera.photo_capabilities", 143, 0, 3)
class PhotoCapabilities(Message, frozen=True):
    id: Annotated[int, U16]
    photo_modes: Annotated[int, Bits(U16, CameraPhotoMode)]
    photo_formats: Annotated[int, Bits(U16, PhotoFormat)]
    photo_file_formats: Annotated[int, Bits(U16, PhotoFileFormat)]
    hdr: Annotated[Supported, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("camera.antiflicker_capabilities", 143, 0, 4)
class AntiflickerCapabilities(Message, frozen=True):
    supported_modes: Annotated[int, Bits(U8, CameraAntiflickerMode)]


@command("camera.set_exposure_settings", 143, 0, 5)
class SetExposureSettings(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[ExposureMode, ENUM]
    shutter_speed: Annotated[ShutterSpeed, ENUM]
    iso_sensitivity: Annotated[IsoSensitivity, ENUM]
    max_iso_sensitivity: Annotated[IsoSensitivity, ENUM]
    metering_mode: Annotated[AutoExposureMeteringMode, ENUM]


@command("camera.lock_exposure", 143, 0, 6)
class LockExposure(Message, frozen=True):
    cam_id: Annotated[int, U8]


@command("camera.lock_exposure_on_roi", 143, 0, 7)
class LockExposureOnRoi(Message, frozen=True):
    cam_id: Annotated[int, U8]
    roi_center_x: Annotated[float, F32]
    roi_center_y: Annotated[float, F32]


@command("camera.unlock_exposure", 143, 0, 8)
class UnlockExposure(Message, frozen=True):
    cam_id: Annotated[int, U8]


@event("camera.exposure_settings", 143, 0, 9)
class ExposureSettings(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[ExposureMode, ENUM]
    manual_shutter_speed: Annotated[ShutterSpeed, ENUM]
    manual_shutter_speed_capabilities: Annotated[int, Bits(U64, ShutterSpeed)]
    manual_iso_sensitivity: Annotated[IsoSensitivity, ENUM]
    manual_iso_sensitivity_capabilities: Annotated[int, Bits(U64, IsoSensitivity)]
    max_iso_sensitivity: Annotated[IsoSensitivity, ENUM]
    max_iso_sensitivities_capabilities: Annotated[int, Bits(U64, IsoSensitivity)]
    metering_mode: Annotated[AutoExposureMeteringMode, ENUM]


@event("camera.exposure", 143, 0, 10, Buffer.NON_ACK)
class Exposure(Message, frozen=True):
    cam_id: Annotated[int, U8]
    shutter_speed: Annotated[ShutterSpeed, ENUM]
    iso_sensitivity: Annotated[IsoSensitivity, ENUM]
    lock: Annotated[State, ENUM]
    lock_roi_x: Annotated[float, F32]
    lock_roi_y: Annotated[float, F32]
    lock_roi_width: Annotated[float, F32]
    lock_roi_height: Annotated[float, F32]


@command("camera.set_white_balance", 143, 0, 11)
class SetWhiteBalance(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[WhiteBalanceMode, ENUM]
    temperature: Annotated[WhiteBalanceTemperature, ENUM]


@command("camera.set_white_balance_lock", 143, 0, 12)
class SetWhiteBalanceLock(Message, frozen=True):
    cam_id: Annotated[int, U8]
    state: Annotated[State, ENUM]


@event("camera.white_balance", 143, 0, 13)
class WhiteBalance(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[WhiteBalanceMode, ENUM]
    temperature: Annotated[WhiteBalanceTemperature, ENUM]
    lock: Annotated[State, ENUM]


@command("camera.set_ev_compensation", 143, 0, 14)
class SetEvCompensation(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[CameraEvCompensation, ENUM]


@event("camera.ev_compensation", 143, 0, 15)
class EvCompensation(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[CameraEvCompensation, ENUM]


@command("camera.set_antiflicker_mode", 143, 0, 16)
class SetAntiflickerMode(Message, frozen=True):
    mode: Annotated[CameraAntiflickerMode, ENUM]


@event("camera.antiflicker_mode", 143, 0, 17)
class AntiflickerMode(Message, frozen=True):
    mode: Annotated[CameraAntiflickerMode, ENUM]
    value: Annotated[CameraAntiflickerMode, ENUM]


@command("camera.set_style", 143, 0, 18)
class SetStyle(Message, frozen=True):
    cam_id: Annotated[int, U8]
    style: Annotated[CameraStyle, ENUM]


@command("camera.set_style_params", 143, 0, 19)
class SetStyleParams(Message, frozen=True):
    cam_id: Annotated[int, U8]
    saturation: Annotated[int, I8]
    contrast: Annotated[int, I8]
    sharpness: Annotated[int, I8]


@event("camera.style", 143, 0, 20)
class Style(Message, frozen=True):
    cam_id: Annotated[int, U8]
    style: Annotated[CameraStyle, ENUM]
    saturation: Annotated[int, I8]
    saturation_min: Annotated[int, I8]
    saturation_max: Annotated[int, I8]
    contrast: Annotated[int, I8]
    contrast_min: Annotated[int, I8]
    contrast_max: Annotated[int, I8]
    sharpness: Annotated[int, I8]
    sharpness_min: Annotated[int, I8]
    sharpness_max: Annotated[int, I8]


@command("camera.set_zoom_target", 143, 0, 21, Buffer.NON_ACK)
class SetZoomTarget(Message, frozen=True):
    cam_id: Annotated[int, U8]
    control_mode: Annotated[ZoomControlMode, ENUM]
    target: Annotated[float, F32]


@command("camera.reset_zoom", 143, 0, 48)
class ResetZoom(Message, frozen=True):
    cam_id: Annotated[int, U8]


@value("camera.zoom_level", 143, 0, 22, of="cam_id")
class ZoomLevel(Message, frozen=True):
    cam_id: Annotated[int, U8]
    level: Annotated[float, F32]


@event("camera.zoom_info", 143, 0, 23)
class ZoomInfo(Message, frozen=True):
    cam_id: Annotated[int, U8]
    available: Annotated[Availability, ENUM]
    high_quality_maximum_level: Annotated[float, F32]
    maximum_level: Annotated[float, F32]


@event("camera.max_zoom_speed", 143, 0, 24)
class MaxZoomSpeed(Message, frozen=True):
    cam_id: Annotated[int, U8]
    min: Annotated[float, F32]
    max: Annotated[float, F32]
    current: Annotated[float, F32]


@command("camera.set_max_zoom_speed", 143, 0, 25)
class SetMaxZoomSpeed(Message, frozen=True):
    cam_id: Annotated[int, U8]
    max: Annotated[float, F32]


@event("camera.zoom_velocity_quality_degradation", 143, 0, 26)
class ZoomVelocityQualityDegradation(Message, frozen=True):
    cam_id: Annotated[int, U8]
    allowed: Annotated[int, U8]


@command("camera.set_zoom_velocity_quality_degradation", 143, 0, 27)
class SetZoomVelocityQualityDegradation(Message, frozen=True):
    cam_id: Annotated[int, U8]
    allow: Annotated[int, U8]


@command("camera.set_hdr_setting", 143, 0, 28)
class SetHdrSetting(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[State, ENUM]


@event("camera.hdr_setting", 143, 0, 29)
class HdrSetting(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[State, ENUM]


@event("camera.hdr", 143, 0, 30)
class Hdr(Message, frozen=True):
    cam_id: Annotated[int, U8]
    available: Annotated[Availability, ENUM]
    state: Annotated[State, ENUM]


@command("camera.set_camera_mode", 143, 0, 31)
class SetCameraMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[CameraCameraMode, ENUM]


@event("camera.camera_mode", 143, 0, 32)
class CameraMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[CameraCameraMode, ENUM]


@command("camera.set_recording_mode", 143, 0, 33)
class SetRecordingMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[CameraRecordingMode, ENUM]
    resolution: Annotated[Resolution, ENUM]
    framerate: Annotated[Framerate, ENUM]
    hyperlapse: Annotated[HyperlapseValue, ENUM]


@event("camera.recording_mode", 143, 0, 34)
class RecordingMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[CameraRecordingMode, ENUM]
    resolution: Annotated[Resolution, ENUM]
    framerate: Annotated[Framerate, ENUM]
    hyperlapse: Annotated[HyperlapseValue, ENUM]
    bitrate: Annotated[int, U32]


@command("camera.set_photo_mode", 143, 0, 35)
class SetPhotoMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[CameraPhotoMode, ENUM]
    format: Annotated[PhotoFormat, ENUM]
    file_format: Annotated[PhotoFileFormat, ENUM]
    burst: Annotated[BurstValue, ENUM]
    bracketing: Annotated[BracketingPreset, ENUM]
    capture_interval: Annotated[float, F32]


@event("camera.photo_mode", 143, 0, 36)
class PhotoMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    mode: Annotated[CameraPhotoMode, ENUM]
    format: Annotated[PhotoFormat, ENUM]
    file_format: Annotated[PhotoFileFormat, ENUM]
    burst: Annotated[BurstValue, ENUM]
    bracketing: Annotated[BracketingPreset, ENUM]
    capture_interval: Annotated[float, F32]


@command("camera.set_streaming_mode", 143, 0, 37)
class SetStreamingMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[CameraStreamingMode, ENUM]


@event("camera.streaming_mode", 143, 0, 38)
class StreamingMode(Message, frozen=True):
    cam_id: Annotated[int, U8]
    value: Annotated[CameraStreamingMode, ENUM]


@command("camera.take_photo", 143, 0, 39)
class TakePhoto(Message, frozen=True):
    cam_id: Annotated[int, U8]


@command("camera.stop_photo", 143, 0, 50)
class StopPhoto(Message, frozen=True):
    cam_id: Annotated[int, U8]


@event("camera.photo_progress", 143, 0, 40)
class PhotoProgress(Message, frozen=True):
    cam_id: Annotated[int, U8]
    result: Annotated[PhotoResult, ENUM]
    photo_count: Annotated[int, U8]
    media_id: Annotated[str, STRING]


@event("camera.photo_state", 143, 0, 41)
class PhotoState(Message, frozen=True):
    cam_id: Annotated[int, U8]
    available: Annotated[Availability, ENUM]
    state: Annotated[State, ENUM]


@command("camera.start_recording", 143, 0, 42)
class StartRecording(Message, frozen=True):
    cam_id: Annotated[int, U8]


@command("camera.stop_recording", 143, 0, 43)
class StopRecording(Message, frozen=True):
    cam_id: Annotated[int, U8]


@event("camera.recording_progress", 143, 0, 44)
class RecordingProgress(Message, frozen=True):
    cam_id: Annotated[int, U8]
    result: Annotated[RecordingResult, ENUM]
    media_id: Annotated[str, STRING]


@event("camera.recording_state", 143, 0, 45)
class RecordingState(Message, frozen=True):
    cam_id: Annotated[int, U8]
    available: Annotated[Availability, ENUM]
    state: Annotated[State, ENUM]
    start_timestamp: Annotated[int, U64]


@command("camera.set_autorecord", 143, 0, 46)
class SetAutorecord(Message, frozen=True):
    cam_id: Annotated[int, U8]
    state: Annotated[State, ENUM]


@event("camera.autorecord", 143, 0, 47)
class Autorecord(Message, frozen=True):
    cam_id: Annotated[int, U8]
    state: Annotated[State, ENUM]


@event("camera.camera_states", 143, 0, 49)
class CameraStates(Message, frozen=True):
    active_cameras: Annotated[int, U32]


@event("camera.next_photo_delay", 143, 0, 51, Buffer.NON_ACK)
class NextPhotoDelay(Message, frozen=True):
    mode: Annotated[CameraPhotoMode, ENUM]
    remaining: Annotated[float, F32]


@event("camera.alignment_offsets", 143, 0, 52)
class AlignmentOffsets(Message, frozen=True):
    cam_id: Annotated[int, U8]
    min_bound_yaw: Annotated[float, F32]
    max_bound_yaw: Annotated[float, F32]
    current_yaw: Annotated[float, F32]
    min_bound_pitch: Annotated[float, F32]
    max_bound_pitch: Annotated[float, F32]
    current_pitch: Annotated[float, F32]
    min_bound_roll: Annotated[float, F32]
    max_bound_roll: Annotated[float, F32]
    current_roll: Annotated[float, F32]


@command("camera.set_alignment_offsets", 143, 0, 53)
class SetAlignmentOffsets(Message, frozen=True):
    cam_id: Annotated[int, U8]
    yaw: Annotated[float, F32]
    pitch: Annotated[float, F32]
    roll: Annotated[float, F32]


@command("camera.reset_alignment_offsets", 143, 0, 54)
class ResetAlignmentOffsets(Message, frozen=True):
    cam_id: Annotated[int, U8]
