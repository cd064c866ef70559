"""Settings that the Ai's camera accepts, by the field of `camera2.Config`.

From the table of the anafi_ros paper (48 megapixels, ISO 50 to 6400, 1/10000 to 1/15 s, 4K and 1080p at 24 to 120
frames a second, H.265) and Olympe's examples for it (720p; bursts are JPEG); what these leave open is assumed.
"""

from __future__ import annotations

from typing import Any

from anafi_mav.arsdk.messages.proto import camera2

_WHITE_BALANCES = (
    camera2.WhiteBalanceMode.CUSTOM,
    camera2.WhiteBalanceMode.AUTOMATIC,
    camera2.WhiteBalanceMode.INCANDESCENT,
    camera2.WhiteBalanceMode.FLUORESCENT,
    camera2.WhiteBalanceMode.SUNNY,
    camera2.WhiteBalanceMode.CLOUDY,
    camera2.WhiteBalanceMode.SHADED,
)
_ISOS = tuple(
    iso for iso in camera2.IsoSensitivity if camera2.IsoSensitivity._50 <= iso <= camera2.IsoSensitivity._6400
)
_SHUTTERS = tuple(speed for speed in camera2.ShutterSpeed if speed <= camera2.ShutterSpeed._1_OVER_15)
_BITRATE = 100_000_000
"""bit/s"""

CHOICES: dict[str, tuple[Any, ...]] = {
    "camera_mode": tuple(camera2.CameraMode),
    "photo_mode": tuple(camera2.PhotoMode),
    "photo_dynamic_range": (camera2.DynamicRange.STANDARD, camera2.DynamicRange.HDR8),
    "photo_resolution": (camera2.PhotoResolution._48_MEGA_PIXELS, camera2.PhotoResolution._12_MEGA_PIXELS),
    "photo_format": tuple(camera2.PhotoFormat),
    "photo_file_format": tuple(camera2.PhotoFileFormat),
    "photo_burst_value": tuple(camera2.BurstValue),
    "photo_bracketing_preset": tuple(camera2.BracketingPreset),
    "photo_streaming_mode": tuple(camera2.PhotoStreamingMode),
    "photo_signature": tuple(camera2.DigitalSignature),
    "video_recording_mode": tuple(camera2.VideoRecordingMode),
    "video_recording_dynamic_range": tuple(camera2.DynamicRange),
    "video_recording_codec": tuple(camera2.VideoCodec),
    "video_recording_resolution": (
        camera2.VideoResolution._2160P,
        camera2.VideoResolution._1080P,
        camera2.VideoResolution._720P,
    ),
    "video_recording_framerate": tuple(rate for rate in camera2.Framerate if rate <= camera2.Framerate._120),
    "video_recording_bitrate": (_BITRATE,),
    "audio_recording_mode": (camera2.AudioRecordingMode.MUTE,),
    "auto_record_mode": tuple(camera2.AutoRecordMode),
    "exposure_mode": tuple(camera2.ExposureMode),
    "exposure_manual_shutter_speed": _SHUTTERS,
    "exposure_manual_iso_sensitivity": _ISOS,
    "exposure_maximum_iso_sensitivity": _ISOS,
    "exposure_metering": tuple(camera2.ExposureMetering),
    "white_balance_mode": _WHITE_BALANCES,
    "white_balance_temperature": tuple(camera2.WhiteBalanceTemperature),
    "ev_compensation": tuple(camera2.EvCompensation),
    "image_style": tuple(style for style in camera2.ImageStyle if style <= camera2.ImageStyle.PASTEL),
    "zoom_velocity_control_quality_mode": tuple(camera2.ZoomVelocityControlQualityMode),
    "storage_policy": (camera2.StoragePolicy.PRIORITY_REMOVABLE, camera2.StoragePolicy.REMOVABLE),
}
"""Values of a setting; another leaves it as it is."""

RANGES: dict[str, tuple[float, float]] = {
    "photo_time_lapse_interval": (1.0, 3600.0),
    "photo_gps_lapse_interval": (1.0, 1000.0),
    "image_contrast": (-1.0, 1.0),
    "image_saturation": (-1.0, 1.0),
    "image_sharpness": (-1.0, 1.0),
    "zoom_max_speed": (0.01, 10.0),
}
"""s, m, then numbers without a unit, tan(deg)/s; what is beyond is taken to the limit."""

DEFAULTS: dict[str, Any] = {
    "camera_mode": camera2.CameraMode.RECORDING,
    "photo_mode": camera2.PhotoMode.SINGLE,
    "photo_dynamic_range": camera2.DynamicRange.STANDARD,
    "photo_resolution": camera2.PhotoResolution._12_MEGA_PIXELS,
    "photo_format": camera2.PhotoFormat.RECTILINEAR,
    "photo_file_format": camera2.PhotoFileFormat.JPEG,
    "photo_burst_value": camera2.BurstValue._14_OVER_1S,
    "photo_bracketing_preset": camera2.BracketingPreset._1EV_2EV_3EV,
    "photo_time_lapse_interval": 2.0,
    "photo_gps_lapse_interval": 10.0,
    "photo_streaming_mode": camera2.PhotoStreamingMode.INTERRUPT,
    "photo_signature": camera2.DigitalSignature.NONE,
    "video_recording_mode": camera2.VideoRecordingMode.STANDARD,
    "video_recording_dynamic_range": camera2.DynamicRange.STANDARD,
    "video_recording_codec": camera2.VideoCodec.H264,
    "video_recording_resolution": camera2.VideoResolution._2160P,
    "video_recording_framerate": camera2.Framerate._30,
    "video_recording_bitrate": _BITRATE,
    "audio_recording_mode": camera2.AudioRecordingMode.MUTE,
    "auto_record_mode": camera2.AutoRecordMode.DISABLED,
    "exposure_mode": camera2.ExposureMode.AUTOMATIC,
    "exposure_manual_shutter_speed": camera2.ShutterSpeed._1_OVER_60,
    "exposure_manual_iso_sensitivity": camera2.IsoSensitivity._100,
    "exposure_maximum_iso_sensitivity": camera2.IsoSensitivity._3200,
    "exposure_metering": camera2.ExposureMetering.STANDARD,
    "white_balance_mode": camera2.WhiteBalanceMode.AUTOMATIC,
    "white_balance_temperature": camera2.WhiteBalanceTemperature._5000,
    "ev_compensation": camera2.EvCompensation._0_00,
    "image_style": camera2.ImageStyle.STANDARD,
    "image_contrast": 0.0,
    "image_saturation": 0.0,
    "image_sharpness": 0.0,
    "zoom_max_speed": 0.34,
    "zoom_velocity_control_quality_mode": camera2.ZoomVelocityControlQualityMode.STOP_BEFORE_DEGRADATION,
    "storage_policy": camera2.StoragePolicy.PRIORITY_REMOVABLE,
}
"""As it leaves the factory."""

PHOTO = tuple(name for name in (*CHOICES, *RANGES) if name.startswith("photo_"))
"""Settings that count in photo mode only."""
RECORDING = tuple(name for name in (*CHOICES, *RANGES) if name.startswith(("video_", "audio_")))
COMMON = tuple(
    name for name in (*CHOICES, *RANGES) if name not in PHOTO and name not in RECORDING and name != "camera_mode"
)
"""Settings that count in both modes."""
