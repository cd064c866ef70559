"""camera2 (arsdk.camera): the cameras of the Ai.

Other than in `camera`, photo is mode 0 and recording mode 1. `Config`, `CapabilitiesRule`, `State` and `MediaMetadata`
carry only what is meant: None is "leave it", or "not said".
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import msgspec

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import (
    BOOL,
    DOUBLE,
    ENUM,
    FLOAT,
    RECORD,
    STRING,
    UINT32,
    UINT64,
    Field,
    Map,
    Submessage,
    Wrapped,
)
from anafi_mav.arsdk.messages.proto import thermal_rendering
from anafi_mav.arsdk.messages.proto.camera2_values import (
    AudioRecordingMode,
    AutoRecordMode,
    BracketingPreset,
    BurstValue,
    CameraMode,
    CameraModel,
    CameraSubtype,
    CameraType,
    DigitalSignature,
    DynamicRange,
    EvCompensation,
    ExposureLockMode,
    ExposureMetering,
    ExposureMode,
    Framerate,
    ImageStyle,
    IsoSensitivity,
    LowLightMode,
    LowLightModeSelection,
    PhotoEvent,
    PhotoFileFormat,
    PhotoFormat,
    PhotoMode,
    PhotoResolution,
    PhotoState,
    PhotoStopReason,
    PhotoStreamingMode,
    RecordingEvent,
    RecordingState,
    RecordingStopReason,
    ShutterSpeed,
    Spectrum,
    StoragePolicy,
    StorageType,
    StreamReceiver,
    VideoCodec,
    VideoRecordingMode,
    VideoResolution,
    WhiteBalanceLockMode,
    WhiteBalanceMode,
    WhiteBalanceTemperature,
    ZoomControlMode,
    ZoomGotoPresetEnum,
    ZoomPresetEnum,
    ZoomVelocityControlQualityMode,
)

COMMAND = ProtobufEnvelope("arsdk.camera.Command", "camera2.Command")
EVENT = ProtobufEnvelope("arsdk.camera.Event", "camera2.Event")


class Config(Submessage, frozen=True, kw_only=True):
    SELECTED: ClassVar[int] = 1

    camera_mode: Annotated[CameraMode | None, Field(2, ENUM)] = None
    photo_mode: Annotated[PhotoMode | None, Field(3, ENUM)] = None
    photo_dynamic_range: Annotated[DynamicRange | None, Field(4, ENUM)] = None
    photo_resolution: Annotated[PhotoResolution | None, Field(5, ENUM)] = None
    photo_format: Annotated[PhotoFormat | None, Field(6, ENUM)] = None
    photo_file_format: Annotated[PhotoFileFormat | None, Field(7, ENUM)] = None
    photo_burst_value: Annotated[BurstValue | None, Field(8, ENUM)] = None
    photo_bracketing_preset: Annotated[BracketingPreset | None, Field(9, ENUM)] = None
    photo_time_lapse_interval: Annotated[float | None, Field(10, DOUBLE)] = None
    photo_gps_lapse_interval: Annotated[float | None, Field(11, DOUBLE)] = None
    photo_streaming_mode: Annotated[PhotoStreamingMode | None, Field(12, ENUM)] = None
    video_recording_mode: Annotated[VideoRecordingMode | None, Field(13, ENUM)] = None
    video_recording_dynamic_range: Annotated[DynamicRange | None, Field(14, ENUM)] = None
    video_recording_codec: Annotated[VideoCodec | None, Field(15, ENUM)] = None
    video_recording_resolution: Annotated[VideoResolution | None, Field(16, ENUM)] = None
    video_recording_framerate: Annotated[Framerate | None, Field(17, ENUM)] = None
    audio_recording_mode: Annotated[AudioRecordingMode | None, Field(19, ENUM)] = None
    exposure_mode: Annotated[ExposureMode | None, Field(22, ENUM)] = None
    exposure_manual_shutter_speed: Annotated[ShutterSpeed | None, Field(23, ENUM)] = None
    exposure_manual_iso_sensitivity: Annotated[IsoSensitivity | None, Field(24, ENUM)] = None
    exposure_maximum_iso_sensitivity: Annotated[IsoSensitivity | None, Field(25, ENUM)] = None
    white_balance_mode: Annotated[WhiteBalanceMode | None, Field(26, ENUM)] = None
    white_balance_temperature: Annotated[WhiteBalanceTemperature | None, Field(27, ENUM)] = None
    ev_compensation: Annotated[EvCompensation | None, Field(28, ENUM)] = None
    image_style: Annotated[ImageStyle | None, Field(29, ENUM)] = None
    image_contrast: Annotated[float | None, Field(30, DOUBLE)] = None
    image_saturation: Annotated[float | None, Field(31, DOUBLE)] = None
    image_sharpness: Annotated[float | None, Field(32, DOUBLE)] = None
    zoom_max_speed: Annotated[float | None, Field(33, DOUBLE)] = None
    zoom_velocity_control_quality_mode: Annotated[ZoomVelocityControlQualityMode | None, Field(34, ENUM)] = None
    auto_record_mode: Annotated[AutoRecordMode | None, Field(35, ENUM)] = None
    photo_signature: Annotated[DigitalSignature | None, Field(39, ENUM)] = None
    exposure_metering: Annotated[ExposureMetering | None, Field(40, ENUM)] = None
    storage_policy: Annotated[StoragePolicy | None, Field(41, ENUM)] = None
    video_recording_bitrate: Annotated[int | None, Field(42, UINT32)] = None
    spectrum: Annotated[Spectrum | None, Field(43, ENUM)] = None
    low_light_mode_selection: Annotated[LowLightModeSelection | None, Field(44, ENUM)] = None
    low_light_mode: Annotated[LowLightMode | None, Field(45, ENUM)] = None


class ExposureRoiCenter(Submessage, frozen=True, kw_only=True):
    x: Annotated[float, Field(1, DOUBLE)] = 0.0
    y: Annotated[float, Field(2, DOUBLE)] = 0.0


class MediaMetadata(Submessage, frozen=True, kw_only=True):
    SELECTED: ClassVar[int] = 1

    copyright: Annotated[str | None, Field(2, STRING)] = None
    custom_id: Annotated[str | None, Field(3, STRING)] = None
    custom_title: Annotated[str | None, Field(4, STRING)] = None


class Vec2(Submessage, frozen=True, kw_only=True):
    x: Annotated[float, Field(1, FLOAT)] = 0.0
    y: Annotated[float, Field(2, FLOAT)] = 0.0


class AlignmentOffsets(Submessage, frozen=True, kw_only=True):
    pitch: Annotated[float | None, Wrapped(1, DOUBLE)] = None
    roll: Annotated[float | None, Wrapped(2, DOUBLE)] = None
    yaw: Annotated[float | None, Wrapped(3, DOUBLE)] = None


class ExposureRoi(Submessage, frozen=True, kw_only=True):
    center: Annotated[ExposureRoiCenter | None, Field(1, RECORD)] = None
    width: Annotated[float, Field(2, DOUBLE)] = 0.0
    height: Annotated[float, Field(3, DOUBLE)] = 0.0


class Capabilities(Submessage, frozen=True, kw_only=True):
    rules: Annotated[tuple[CapabilitiesRule, ...], Field(1, RECORD)] = ()
    thermal_alignment_offset_ranges: Annotated[CapabilitiesAlignmentOffsetRanges | None, Field(2, RECORD)] = None
    thermal_mixing_modes: Annotated[tuple[thermal_rendering.MixingMode, ...], Field(3, ENUM)] = ()


class CapabilitiesRule(Submessage, frozen=True, kw_only=True):
    SELECTED: ClassVar[int] = 2

    index: Annotated[int | None, Field(1, UINT64)] = None
    camera_modes: Annotated[tuple[CameraMode, ...] | None, Field(3, ENUM)] = None
    photo_modes: Annotated[tuple[PhotoMode, ...] | None, Field(4, ENUM)] = None
    photo_dynamic_ranges: Annotated[tuple[DynamicRange, ...] | None, Field(5, ENUM)] = None
    photo_resolutions: Annotated[tuple[PhotoResolution, ...] | None, Field(6, ENUM)] = None
    photo_formats: Annotated[tuple[PhotoFormat, ...] | None, Field(7, ENUM)] = None
    photo_file_formats: Annotated[tuple[PhotoFileFormat, ...] | None, Field(8, ENUM)] = None
    photo_burst_values: Annotated[tuple[BurstValue, ...] | None, Field(9, ENUM)] = None
    photo_bracketing_presets: Annotated[tuple[BracketingPreset, ...] | None, Field(10, ENUM)] = None
    photo_time_lapse_interval_range: Annotated[DoubleRange | None, Field(11, RECORD)] = None
    photo_gps_lapse_interval_range: Annotated[DoubleRange | None, Field(12, RECORD)] = None
    photo_streaming_modes: Annotated[tuple[PhotoStreamingMode, ...] | None, Field(13, ENUM)] = None
    video_recording_modes: Annotated[tuple[VideoRecordingMode, ...] | None, Field(14, ENUM)] = None
    video_recording_dynamic_ranges: Annotated[tuple[DynamicRange, ...] | None, Field(15, ENUM)] = None
    video_recording_codecs: Annotated[tuple[VideoCodec, ...] | None, Field(16, ENUM)] = None
    video_recording_resolutions: Annotated[tuple[VideoResolution, ...] | None, Field(17, ENUM)] = None
    video_recording_framerates: Annotated[tuple[Framerate, ...] | None, Field(18, ENUM)] = None
    audio_recording_modes: Annotated[tuple[AudioRecordingMode, ...] | None, Field(20, ENUM)] = None
    exposure_modes: Annotated[tuple[ExposureMode, ...] | None, Field(23, ENUM)] = None
    exposure_manual_shutter_speeds: Annotated[tuple[ShutterSpeed, ...] | None, Field(24, ENUM)] = None
    exposure_manual_iso_sensitivities: Annotated[tuple[IsoSensitivity, ...] | None, Field(25, ENUM)] = None
    exposure_maximum_iso_sensitivities: Annotated[tuple[IsoSensitivity, ...] | None, Field(26, ENUM)] = None
    white_balance_modes: Annotated[tuple[WhiteBalanceMode, ...] | None, Field(27, ENUM)] = None
    white_balance_temperatures: Annotated[tuple[WhiteBalanceTemperature, ...] | None, Field(28, ENUM)] = None
    ev_compensations: Annotated[tuple[EvCompensation, ...] | None, Field(29, ENUM)] = None
    image_styles: Annotated[tuple[ImageStyle, ...] | None, Field(30, ENUM)] = None
    image_contrast_range: Annotated[DoubleRange | None, Field(31, RECORD)] = None
    image_saturation_range: Annotated[DoubleRange | None, Field(32, RECORD)] = None
    image_sharpness_range: Annotated[DoubleRange | None, Field(33, RECORD)] = None
    zoom_max_speed_range: Annotated[DoubleRange | None, Field(34, RECORD)] = None
    zoom_velocity_control_quality_modes: Annotated[
        tuple[ZoomVelocityControlQualityMode, ...] | None, Field(35, ENUM)
    ] = None
    auto_record_modes: Annotated[tuple[AutoRecordMode, ...] | None, Field(36, ENUM)] = None
    photo_signatures: Annotated[tuple[DigitalSignature, ...] | None, Field(40, ENUM)] = None
    exposure_meterings: Annotated[tuple[ExposureMetering, ...] | None, Field(41, ENUM)] = None
    storage_policies: Annotated[tuple[StoragePolicy, ...] | None, Field(42, ENUM)] = None
    video_recording_bitrates: Annotated[tuple[int, ...] | None, Field(43, UINT32)] = None
    spectrums: Annotated[tuple[Spectrum, ...] | None, Field(44, ENUM)] = None
    low_light_mode_selections: Annotated[tuple[LowLightModeSelection, ...] | None, Field(45, ENUM)] = None
    low_light_modes: Annotated[tuple[LowLightMode, ...] | None, Field(46, ENUM)] = None


class DoubleRange(Submessage, frozen=True, kw_only=True):
    min: Annotated[float, Field(1, DOUBLE)] = 0.0
    max: Annotated[float, Field(2, DOUBLE)] = 0.0


class CapabilitiesAlignmentOffsetRanges(Submessage, frozen=True, kw_only=True):
    pitch: Annotated[DoubleRange | None, Field(1, RECORD)] = None
    roll: Annotated[DoubleRange | None, Field(2, RECORD)] = None
    yaw: Annotated[DoubleRange | None, Field(3, RECORD)] = None


class StatePhoto(Submessage, frozen=True, kw_only=True):
    """`duration` is milliseconds."""

    state: Annotated[PhotoState, Field(1, ENUM)] = PhotoState.UNAVAILABLE
    photo_count: Annotated[int, Field(3, UINT32)] = 0
    storage: Annotated[StorageType, Field(4, ENUM)] = StorageType.INTERNAL
    duration: Annotated[int | None, Wrapped(5, UINT64)] = None


class StateRecording(Submessage, frozen=True, kw_only=True):
    """`duration` is milliseconds."""

    state: Annotated[RecordingState, Field(1, ENUM)] = RecordingState.UNAVAILABLE
    video_bitrate: Annotated[int, Field(3, UINT32)] = 0
    storage: Annotated[StorageType, Field(4, ENUM)] = StorageType.INTERNAL
    duration: Annotated[int | None, Wrapped(5, UINT64)] = None


class StateWhiteBalanceLock(Submessage, frozen=True, kw_only=True):
    supported_modes: Annotated[tuple[WhiteBalanceLockMode, ...], Field(1, ENUM)] = ()
    mode: Annotated[WhiteBalanceLockMode, Field(2, ENUM)] = WhiteBalanceLockMode.UNLOCKED


class StateExposureLock(Submessage, frozen=True, kw_only=True):
    supported_modes: Annotated[tuple[ExposureLockMode, ...], Field(1, ENUM)] = ()
    mode: Annotated[ExposureLockMode, Field(2, ENUM)] = ExposureLockMode.UNLOCKED


class StateZoom(Submessage, frozen=True, kw_only=True):
    zoom_level_max: Annotated[float, Field(1, DOUBLE)] = 0.0
    zoom_high_quality_level_max: Annotated[float, Field(2, DOUBLE)] = 0.0
    presets: Annotated[tuple[StateZoomPreset, ...], Field(3, RECORD)] = ()
    cam_ranges: Annotated[tuple[StateZoomCameraRange, ...], Field(4, RECORD)] = ()


class StateZoomPreset(Submessage, frozen=True, kw_only=True):
    preset: Annotated[ZoomPresetEnum, Field(1, ENUM)] = ZoomPresetEnum.WIDE
    value: Annotated[float, Field(2, FLOAT)] = 0.0


class StateZoomCameraRange(Submessage, frozen=True, kw_only=True):
    phys_cam: Annotated[CameraSubtype, Field(1, ENUM)] = CameraSubtype.WIDE
    level_min: Annotated[float, Field(2, FLOAT)] = 0.0
    level_max: Annotated[float, Field(3, FLOAT)] = 0.0
    high_quality_level_max: Annotated[float, Field(4, FLOAT)] = 0.0
    hfov_min: Annotated[float | None, Wrapped(5, FLOAT)] = None
    hfov_max: Annotated[float | None, Wrapped(6, FLOAT)] = None


class StateEffectiveFramerate(Submessage, frozen=True, kw_only=True):
    effective_framerate: Annotated[Framerate, Field(1, ENUM)] = Framerate._24


class StateUserLfic(Submessage, frozen=True, kw_only=True):
    coords: Annotated[Vec2 | None, Field(1, RECORD)] = None


@COMMAND.message("SetZoomTarget", 1)
class SetZoomTarget(ProtobufMessage, frozen=True, kw_only=True):
    """Set the zoom, or the zoom velocity in mode VELOCITY.

    `target`: the zoom, 1 and up, or in mode VELOCITY -1 to 1 of `Config.zoom_max_speed`, held until the next one.
    """

    camera_id: Annotated[int, Field(1, UINT64)] = 0
    control_mode: Annotated[ZoomControlMode, Field(2, ENUM)] = ZoomControlMode.LEVEL
    target: Annotated[float, Field(3, DOUBLE)] = 0.0


@COMMAND.message("ListCameras", 16)
class ListCameras(ProtobufMessage, frozen=True, kw_only=True):
    """Answered by `CameraList`."""

    model_filter: Annotated[tuple[CameraModel, ...], Field(1, ENUM)] = ()


@COMMAND.message("GetState", 17)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    """Answered by `State`."""

    camera_id: Annotated[int, Field(1, UINT64)] = 0
    include_default_capabilities: Annotated[bool, Field(2, BOOL)] = False


@COMMAND.message("Configure", 18)
class Configure(ProtobufMessage, frozen=True, kw_only=True):
    """Change settings. Answered by `State` with the configuration."""

    camera_id: Annotated[int, Field(1, UINT64)] = 0
    config: Annotated[Config | None, Field(2, RECORD)] = None


@COMMAND.message("StartPhoto", 19)
class StartPhoto(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0


@COMMAND.message("StopPhoto", 20)
class StopPhoto(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0


@COMMAND.message("StartRecording", 21)
class StartRecording(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0


@COMMAND.message("StopRecording", 22)
class StopRecording(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0


@COMMAND.message("LockExposure", 23)
class LockExposure(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    mode: Annotated[ExposureLockMode, Field(2, ENUM)] = ExposureLockMode.UNLOCKED
    roi: Annotated[ExposureRoiCenter | None, Field(3, RECORD)] = None


@COMMAND.message("LockWhiteBalance", 24)
class LockWhiteBalance(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    mode: Annotated[WhiteBalanceLockMode, Field(2, ENUM)] = WhiteBalanceLockMode.UNLOCKED


@COMMAND.message("SetMediaMetadata", 25)
class SetMediaMetadata(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    metadata: Annotated[MediaMetadata | None, Field(2, RECORD)] = None


@COMMAND.message("ResetZoom", 26)
class ResetZoom(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0


@COMMAND.message("ZoomGotoPreset", 27)
class ZoomGotoPreset(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    goto_preset: Annotated[ZoomGotoPresetEnum, Field(2, ENUM)] = ZoomGotoPresetEnum.FIRST


@COMMAND.message("SetUserLfic", 28)
class SetUserLfic(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    coords: Annotated[Vec2 | None, Field(2, RECORD)] = None


@COMMAND.message("NotifyStreamCamera", 29)
class NotifyStreamCamera(ProtobufMessage, frozen=True, kw_only=True):
    receiver: Annotated[StreamReceiver, Field(1, ENUM)] = StreamReceiver.DEFAULT
    type: Annotated[CameraType, Field(2, ENUM)] = CameraType.DEFAULT
    requester: Annotated[str, Field(3, STRING)] = ""


@COMMAND.message("SetAlignmentOffsets", 30)
class SetAlignmentOffsets(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    alignment_offsets: Annotated[AlignmentOffsets | None, Field(2, RECORD)] = None


@COMMAND.message("SetThermalPalette", 31)
class SetThermalPalette(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    palette: Annotated[thermal_rendering.Palette | None, Field(2, RECORD)] = None


@COMMAND.message("SetThermalRendering", 32)
class SetThermalRendering(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    rendering: Annotated[thermal_rendering.Rendering | None, Field(2, RECORD)] = None


@EVENT.message("Exposure", 1)
class Exposure(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    shutter_speed: Annotated[ShutterSpeed, Field(2, ENUM)] = ShutterSpeed._1_OVER_10000
    iso_sensitivity: Annotated[IsoSensitivity, Field(3, ENUM)] = IsoSensitivity._25
    exposure_lock_region: Annotated[ExposureRoi | None, Field(4, RECORD)] = None


@EVENT.message("ZoomLevel", 2)
class ZoomLevel(ProtobufMessage, frozen=True, kw_only=True):
    """About five a second."""

    camera_id: Annotated[int, Field(1, UINT64)] = 0
    level: Annotated[float, Field(2, DOUBLE)] = 0.0
    hfov: Annotated[float | None, Wrapped(3, DOUBLE)] = None


@EVENT.message("NextPhotoInterval", 3)
class NextPhotoInterval(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    mode: Annotated[PhotoMode, Field(2, ENUM)] = PhotoMode.SINGLE
    interval: Annotated[float, Field(3, DOUBLE)] = 0.0


@EVENT.message("WhiteBalance", 4)
class WhiteBalance(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    temperature: Annotated[WhiteBalanceTemperature, Field(2, ENUM)] = WhiteBalanceTemperature._1500


@EVENT.message("CameraList", 16)
class CameraList(ProtobufMessage, frozen=True, kw_only=True):
    """Model by camera id."""

    cameras: Annotated[dict[int, CameraModel], Map(1, UINT64, ENUM)] = msgspec.field(default_factory=dict)


@EVENT.message("State", 17)
class State(ProtobufMessage, frozen=True, kw_only=True):
    """The key is `camera_id`."""

    SELECTED: ClassVar[int] = 2

    camera_id: Annotated[int | None, Field(1, UINT64)] = None
    active: Annotated[bool | None, Field(3, BOOL)] = None
    default_capabilities: Annotated[Capabilities | None, Field(4, RECORD)] = None
    current_capabilities: Annotated[Capabilities | None, Field(5, RECORD)] = None
    config: Annotated[Config | None, Field(6, RECORD)] = None
    photo: Annotated[StatePhoto | None, Field(7, RECORD)] = None
    recording: Annotated[StateRecording | None, Field(8, RECORD)] = None
    white_balance_lock: Annotated[StateWhiteBalanceLock | None, Field(9, RECORD)] = None
    exposure_lock: Annotated[StateExposureLock | None, Field(10, RECORD)] = None
    zoom: Annotated[StateZoom | None, Field(11, RECORD)] = None
    zoom_is_locked: Annotated[bool | None, Wrapped(18, BOOL)] = None
    media_metadata: Annotated[MediaMetadata | None, Field(12, RECORD)] = None
    effective_framerate: Annotated[StateEffectiveFramerate | None, Field(13, RECORD)] = None
    user_lfic: Annotated[StateUserLfic | None, Field(14, RECORD)] = None
    thermal_alignment_offsets: Annotated[AlignmentOffsets | None, Field(15, RECORD)] = None
    thermal_palette: Annotated[thermal_rendering.Palette | None, Field(16, RECORD)] = None
    thermal_rendering: Annotated[thermal_rendering.Rendering | None, Field(17, RECORD)] = None


@EVENT.message("Photo", 18)
class Photo(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    type: Annotated[PhotoEvent, Field(2, ENUM)] = PhotoEvent.START
    media_id: Annotated[str, Field(3, STRING)] = ""
    stop_reason: Annotated[PhotoStopReason, Field(4, ENUM)] = PhotoStopReason.USER_REQUEST
    resource_id: Annotated[str, Field(5, STRING)] = ""


@EVENT.message("Recording", 19)
class Recording(ProtobufMessage, frozen=True, kw_only=True):
    camera_id: Annotated[int, Field(1, UINT64)] = 0
    type: Annotated[RecordingEvent, Field(2, ENUM)] = RecordingEvent.START
    media_id: Annotated[str, Field(3, STRING)] = ""
    stop_reason: Annotated[RecordingStopReason, Field(4, ENUM)] = RecordingStopReason.USER_REQUEST


@EVENT.message("RequestStreamCamera", 20)
class RequestStreamCamera(ProtobufMessage, frozen=True, kw_only=True):
    receiver: Annotated[StreamReceiver, Field(1, ENUM)] = StreamReceiver.DEFAULT
    type: Annotated[CameraType, Field(2, ENUM)] = CameraType.DEFAULT
    requester: Annotated[str, Field(3, STRING)] = ""


__all__ = [
    "COMMAND",
    "EVENT",
    "AlignmentOffsets",
    "AudioRecordingMode",
    "AutoRecordMode",
    "BracketingPreset",
    "BurstValue",
    "CameraList",
    "CameraMode",
    "CameraModel",
    "CameraSubtype",
    "CameraType",
    "Capabilities",
    "CapabilitiesAlignmentOffsetRanges",
    "CapabilitiesRule",
    "Config",
    "Configure",
    "DigitalSignature",
    "DoubleRange",
    "DynamicRange",
    "EvCompensation",
    "Exposure",
    "ExposureLockMode",
    "ExposureMetering",
    "ExposureMode",
    "ExposureRoi",
    "ExposureRoiCenter",
    "Framerate",
    "GetState",
    "ImageStyle",
    "IsoSensitivity",
    "ListCameras",
    "LockExposure",
    "LockWhiteBalance",
    "LowLightMode",
    "LowLightModeSelection",
    "MediaMetadata",
    "NextPhotoInterval",
    "NotifyStreamCamera",
    "Photo",
    "PhotoEvent",
    "PhotoFileFormat",
    "PhotoFormat",
    "PhotoMode",
    "PhotoResolution",
    "PhotoState",
    "PhotoStopReason",
    "PhotoStreamingMode",
    "Recording",
    "RecordingEvent",
    "RecordingState",
    "RecordingStopReason",
    "RequestStreamCamera",
    "ResetZoom",
    "SetAlignmentOffsets",
    "SetMediaMetadata",
    "SetThermalPalette",
    "SetThermalRendering",
    "SetUserLfic",
    "SetZoomTarget",
    "ShutterSpeed",
    "Spectrum",
    "StartPhoto",
    "StartRecording",
    "State",
    "StateEffectiveFramerate",
    "StateExposureLock",
    "StatePhoto",
    "StateRecording",
    "StateUserLfic",
    "StateWhiteBalanceLock",
    "StateZoom",
    "StateZoomCameraRange",
    "StateZoomPreset",
    "StopPhoto",
    "StopRecording",
    "StoragePolicy",
    "StorageType",
    "StreamReceiver",
    "Vec2",
    "VideoCodec",
    "VideoRecordingMode",
    "VideoResolution",
    "WhiteBalance",
    "WhiteBalanceLockMode",
    "WhiteBalanceMode",
    "WhiteBalanceTemperature",
    "ZoomControlMode",
    "ZoomGotoPreset",
    "ZoomGotoPresetEnum",
    "ZoomLevel",
    "ZoomPresetEnum",
    "ZoomVelocityControlQualityMode",
]
