"""The camera's settings as the simulator has them, in the numbers of the extended parameters.

Written by hand, from Parrot's names: nothing of the gateway's tables is used.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

from anafi_mav.arsdk.messages.proto import antiflicker
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.payload.camera2 import Camera2

WORDS: dict[str, tuple[str, ...]] = {
    "CAM_MODE": ("PHOTO", "RECORDING"),
    "CAM_PHOTOMODE": ("SINGLE", "BRACKETING", "BURST", "TIME_LAPSE", "GPS_LAPSE"),
    "CAM_PHOTOPROJ": ("FULL_FRAME", "RECTILINEAR", "FULL_FRAME_STABILIZED"),
    "CAM_PHOTOFMT": ("JPEG", "DNG", "DNG_JPEG"),
    "CAM_PHOTOBURST": tuple(f"{count}_OVER_{seconds}S" for count in (14, 10, 4) for seconds in (4, 2, 1)),
    "CAM_PHOTOBRKT": ("1EV", "2EV", "3EV", "1EV_2EV", "1EV_3EV", "2EV_3EV", "1EV_2EV_3EV"),
    "CAM_VIDMODE": ("STANDARD", "HYPERLAPSE", "SLOW_MOTION", "HIGH_FRAMERATE"),
    "CAM_VIDRES": ("DCI_4K", "UHD_4K", "2_7K", "1080P", "720P", "480P", "1080P_SD", "720P_SD", "UHD_8K", "5K"),
    "CAM_VIDCODEC": ("H264", "H265"),
    "CAM_STORAGE": ("PRIORITY_REMOVABLE", "REMOVABLE", "PRIORITY_INTERNAL", "INTERNAL"),
    "CAM_PHOTOSIGN": ("NONE", "DRONE"),
    "CAM_PHOTOLIVE": ("INTERRUPT", "CONTINUOUS"),
    "CAM_EXPMODE": (
        "AUTOMATIC",
        "MANUAL",
        "AUTOMATIC_PREFER_ISO_SENSITIVITY",
        "AUTOMATIC_PREFER_SHUTTER_SPEED",
        "MANUAL_ISO_SENSITIVITY",
        "MANUAL_SHUTTER_SPEED",
    ),
    "CAM_METERING": ("STANDARD", "CENTER_TOP"),
    "CAM_WBMODE": ("AUTOMATIC", "CUSTOM", "SUNNY", "CLOUDY", "SHADED", "INCANDESCENT", "FLUORESCENT"),
    "CAM_STYLE": ("STANDARD", "PLOG", "INTENSE", "PASTEL", "CUSTOM", "PHOTOGRAMMETRY"),
    "CAM_STREAMING": ("LOW_LATENCY", "HIGH_RELIABILITY", "HIGH_RELIABILITY_LOW_FRAMERATE"),
    "CAM_ANTIFLICKER": ("OFF", "AUTO", "50HZ", "60HZ"),
    "CAM_AUTOREC": ("INACTIVE", "ACTIVE"),
    "CAM_HDR": ("INACTIVE", "ACTIVE"),
    "CAM_AELOCK": ("INACTIVE", "ACTIVE"),
    "CAM_WBLOCK": ("INACTIVE", "ACTIVE"),
}
"""Parrot's names by our numbers, without what they begin with."""

OTHER_NAMES = {
    "2160P": "UHD_4K",
    "50_HZ": "50HZ",
    "60_HZ": "60HZ",
    "DISABLED": "INACTIVE",
    "FLIGHT": "ACTIVE",
    "HDR8": "ACTIVE",
    "UNLOCKED": "INACTIVE",
    "LOCKED": "ACTIVE",
    "FULL_LOCK": "ACTIVE",
}
"""The Ai's words for the same."""

PREFIX = re.compile(r"^(SHUTTER_|ISO_|FPS_|RES_|BURST_|PRESET_|RATIO_|T_(?=\d)|MODE_|_)")

OLDER: dict[str, tuple[str, str]] = {
    "CAM_MODE": ("CameraMode", "mode"),
    "CAM_PHOTOMODE": ("PhotoMode", "mode"),
    "CAM_PHOTOPROJ": ("PhotoMode", "format"),
    "CAM_PHOTOFMT": ("PhotoMode", "file_format"),
    "CAM_PHOTOBURST": ("PhotoMode", "burst"),
    "CAM_PHOTOBRKT": ("PhotoMode", "bracketing"),
    "CAM_PHOTOLAPSE": ("PhotoMode", "capture_interval"),
    "CAM_PHOTODIST": ("PhotoMode", "capture_interval"),
    "CAM_VIDMODE": ("RecordingMode", "mode"),
    "CAM_VIDRES": ("RecordingMode", "resolution"),
    "CAM_VIDFPS": ("RecordingMode", "framerate"),
    "CAM_VIDLAPSE": ("RecordingMode", "hyperlapse"),
    "CAM_AUTOREC": ("Autorecord", "state"),
    "CAM_HDR": ("HdrSetting", "value"),
    "CAM_EXPMODE": ("ExposureSettings", "mode"),
    "CAM_EV": ("EvCompensation", "value"),
    "CAM_SHUTTERSPD": ("ExposureSettings", "manual_shutter_speed"),
    "CAM_ISO": ("ExposureSettings", "manual_iso_sensitivity"),
    "CAM_ISOMAX": ("ExposureSettings", "max_iso_sensitivity"),
    "CAM_METERING": ("ExposureSettings", "metering_mode"),
    "CAM_AELOCK": ("Exposure", "lock"),
    "CAM_WBMODE": ("WhiteBalance", "mode"),
    "CAM_WBTEMP": ("WhiteBalance", "temperature"),
    "CAM_WBLOCK": ("WhiteBalance", "lock"),
    "CAM_STYLE": ("Style", "style"),
    "CAM_SATURATION": ("Style", "saturation"),
    "CAM_CONTRAST": ("Style", "contrast"),
    "CAM_SHARPNESS": ("Style", "sharpness"),
    "CAM_ZOOMSPEED": ("MaxZoomSpeed", "current"),
    "CAM_ZOOMLOSSY": ("ZoomVelocityQualityDegradation", "allowed"),
    "CAM_STREAMING": ("StreamingMode", "value"),
    "CAM_ALIGN_YAW": ("AlignmentOffsets", "current_yaw"),
    "CAM_ALIGN_PITCH": ("AlignmentOffsets", "current_pitch"),
    "CAM_ALIGN_ROLL": ("AlignmentOffsets", "current_roll"),
}
"""Report and field of the older cameras."""

NEWER = {
    "CAM_MODE": "camera_mode",
    "CAM_PHOTOMODE": "photo_mode",
    "CAM_PHOTOPROJ": "photo_format",
    "CAM_PHOTOFMT": "photo_file_format",
    "CAM_PHOTORES": "photo_resolution",
    "CAM_PHOTOBURST": "photo_burst_value",
    "CAM_PHOTOLAPSE": "photo_time_lapse_interval",
    "CAM_PHOTODIST": "photo_gps_lapse_interval",
    "CAM_PHOTOBRKT": "photo_bracketing_preset",
    "CAM_VIDMODE": "video_recording_mode",
    "CAM_VIDRES": "video_recording_resolution",
    "CAM_VIDFPS": "video_recording_framerate",
    "CAM_PHOTOSIGN": "photo_signature",
    "CAM_PHOTOLIVE": "photo_streaming_mode",
    "CAM_VIDCODEC": "video_recording_codec",
    "CAM_STORAGE": "storage_policy",
    "CAM_VIDRATE": "video_recording_bitrate",
    "CAM_AUTOREC": "auto_record_mode",
    "CAM_EXPMODE": "exposure_mode",
    "CAM_EV": "ev_compensation",
    "CAM_SHUTTERSPD": "exposure_manual_shutter_speed",
    "CAM_ISO": "exposure_manual_iso_sensitivity",
    "CAM_ISOMAX": "exposure_maximum_iso_sensitivity",
    "CAM_METERING": "exposure_metering",
    "CAM_WBMODE": "white_balance_mode",
    "CAM_WBTEMP": "white_balance_temperature",
    "CAM_STYLE": "image_style",
    "CAM_SATURATION": "image_saturation",
    "CAM_CONTRAST": "image_contrast",
    "CAM_SHARPNESS": "image_sharpness",
    "CAM_ZOOMSPEED": "zoom_max_speed",
}
"""Field of the Ai's configuration."""

THERMAL = {
    "CAM_THERMAL": ("Mode", "mode"),
    "CAM_THM_RENDER": ("Rendering", "mode"),
    "CAM_THM_BLEND": ("Rendering", "blending_rate"),
    "CAM_THM_PALETTE": ("PaletteSettings", "mode"),
    "CAM_THM_LOW": ("PaletteSettings", "lowest_temp"),
    "CAM_THM_HIGH": ("PaletteSettings", "highest_temp"),
    "CAM_THM_OUTSIDE": ("PaletteSettings", "outside_colorization"),
    "CAM_THM_RANGE": ("PaletteSettings", "relative_range"),
    "CAM_THM_SPOT": ("PaletteSettings", "spot_type"),
    "CAM_THM_SPOTLIM": ("PaletteSettings", "spot_threshold"),
    "CAM_THM_EMISS": ("Emissivity", "emissivity"),
    "CAM_THM_BACKGR": ("BackgroundTemperature", "background_temperature"),
    "CAM_THM_SENS": ("Sensitivity", "current_range"),
    "CAM_THM_SHUTTER": ("ShutterMode", "current_trigger"),
}
KELVIN = {"CAM_THM_LOW", "CAM_THM_HIGH", "CAM_THM_BACKGR"}


def sim_value(drone: SimulatedDrone, name: str) -> float:
    """The value of a setting in the simulator, of the camera at work."""
    payload = drone.firmware.payload
    if name in THERMAL:
        assert payload.thermal is not None
        value = float(_field(payload.thermal.states_report(), *THERMAL[name]))
        return round(value - 273.15, 3) if name in KELVIN else value
    if isinstance(payload.cameras, Camera2):
        return _of_newer(drone, payload.cameras, name)
    if name == "CAM_ANTIFLICKER":
        return _number(name, _field(payload.cameras.states_report(), "AntiflickerMode", "mode"))
    (active,) = (
        bit for bit in range(3) if _field(payload.cameras.states_report(), "CameraStates", "active_cameras") >> bit & 1
    )
    message, field = OLDER[name]
    for id in (active, 0):  # a thermal camera has fewer settings; the others are shown of the main camera
        reports = payload.cameras[id].settings_report()
        if any(type(report).__name__ == message for report in reports):
            return _number(name, _field(reports, message, field))
    raise AssertionError(name)


def _of_newer(drone: SimulatedDrone, camera: Camera2, name: str) -> float:
    config = camera.config()
    state: Any = camera.state()
    if name == "CAM_ANTIFLICKER":
        return _antiflicker_of_newer(drone)
    if name == "CAM_AELOCK":
        return _number(name, state.exposure_lock.mode)
    if name == "CAM_WBLOCK":
        return _number(name, state.white_balance_lock.mode)
    if name == "CAM_ZOOMLOSSY":
        return float(config.zoom_velocity_control_quality_mode.name == "ALLOW_DEGRADATION")
    if name == "CAM_HDR":
        photo = config.camera_mode.name == "PHOTO"
        value = config.photo_dynamic_range if photo else config.video_recording_dynamic_range
        return float(value.name == "HDR8")
    return _number(name, getattr(config, NEWER[name]))


def _antiflicker_of_newer(drone: SimulatedDrone) -> float:
    services = drone.firmware.payload.services
    assert services is not None
    (mains,) = services.handle(antiflicker.GetState()) or ()
    assert isinstance(mains, antiflicker.State)
    if mains.fixed is not None:
        return _number("CAM_ANTIFLICKER", mains.fixed)
    return 0.0 if mains.disabled is not None else 1.0


def _field(reports: list[Any], message: str, field: str) -> Any:
    (found,) = (report for report in reports if type(report).__name__ == message)
    return getattr(found, field)


def _number(name: str, value: Any) -> float:
    """Our number for Parrot's value."""
    if not hasattr(value, "name"):
        return float(value)
    word = PREFIX.sub("", value.name)
    word = OTHER_NAMES.get(word, word)
    if name in WORDS:
        return float(WORDS[name].index(word))
    if name == "CAM_EV":
        return (int(value) - 9) / 3.0
    number, over, divisor = word.partition("_OVER_")
    number = number.partition("_MEGA")[0].replace("_POINT_", ".").replace("_", ".")
    divisor = divisor.replace("_POINT_", ".").replace("_", ".")
    return float(Fraction(number) / Fraction(divisor)) if over else float(number)
