"""Builders of the messages that describe the camera. No I/O.

The flags of CAMERA_INFORMATION are what the drone reported of its main camera: each is a command that works.
"""

from __future__ import annotations

import math

from anafi_mav import geo, units
from anafi_mav.drone import Drone
from anafi_mav.drone.events import PaletteMode
from anafi_mav.drone.payload.camera import MAIN
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.drone.payload.camera_state import CameraState
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import char_field
from anafi_mav.models import Model, PayloadSensor
from anafi_mav.services.camera.pose_track import CameraPose
from anafi_mav.services.stream import Times
from anafi_mav.services.version_numbers import version_numbers
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan
UNKNOWN = 2**31 - 1
"""INT32_MAX: an unknown position."""
AT_INFINITY = -(2**31)
"""INT32_MIN: the image shows no ground."""

MEBIBYTE = 1024.0 * 1024.0
"""Bytes."""

KELVIN = 273.15
"""0 °C in K."""

GIMBAL = 1
"""Gimbal device of component 1 that carries the camera; ids 1 to 6 are gimbals without MAVLink of their own."""

PHOTO_WIDTHS = {"4k": (5344, 4016), "thermal": (5344, 4016), "usa": (5344, 4016), "ai": (8000, 6000)}
"""Pixels of a photo at full size, by model (Parrot's data sheets)."""

LEVEL_GROUND = math.radians(0.5)
"""The camera shows ground when it looks further down than this; above, a flat world ends nowhere."""

ZOOM_STEP = 1.25
"""Ratio of one step of the zoom: a range of 3 is five steps."""

MAX_STEPS = 100.0
"""Steps of zoom in one command: more than any camera has."""

MODES = {
    CameraMode.PHOTO: dialect.CAMERA_MODE_IMAGE,
    CameraMode.RECORDING: dialect.CAMERA_MODE_VIDEO,
}


def has_thermal(model: Model) -> bool:
    """Return True for a model with a thermal camera."""
    return PayloadSensor.THERMAL in model.payloads


def flags(drone: Drone) -> int:
    """Return the CAMERA_CAP_FLAGS of the drone's main camera."""
    camera, found = drone.camera[MAIN], 0
    modes = camera.modes or frozenset()
    if CameraMode.RECORDING in modes and camera.recording is not None:
        found |= dialect.CAMERA_CAP_FLAGS_CAPTURE_VIDEO
    if CameraMode.PHOTO in modes and camera.photo is not None:
        found |= dialect.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
    if len(modes) > 1:
        found |= dialect.CAMERA_CAP_FLAGS_HAS_MODES
    if camera.zoom_max is not None and camera.zoom_max > 1.0:
        found |= dialect.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
    if has_thermal(drone.identity.model):
        found |= dialect.CAMERA_CAP_FLAGS_HAS_THERMAL_RANGE
    return int(found)


def firmware_version(text: str | None) -> int:
    """Return "1.8.2" as CAMERA_INFORMATION has it: the first number in the lowest byte."""
    return sum(number << 8 * place for place, number in enumerate(version_numbers(text)))


def information(drone: Drone, times: Times, extra_flags: int, uri: str, version: int) -> dialect.MAVLink_message:
    """Return CAMERA_INFORMATION; `extra_flags` are those of other services of the component."""
    identity = drone.identity
    width, height = PHOTO_WIDTHS.get(identity.model.key, (0, 0))
    return dialect.MAVLink_camera_information_message(
        times.boot_ms,
        _characters("Parrot"),
        _characters(identity.model.title),
        firmware_version(identity.firmware),
        NAN,
        NAN,
        NAN,
        width,
        height,
        0,
        flags(drone) | extra_flags,
        version,
        uri.encode(),
        GIMBAL,
        0,
    )


def _characters(text: str) -> list[int]:
    return list(char_field(text, 31).ljust(32, b"\0"))


def zoom_percent(camera: CameraState) -> float:
    """Return the zoom as a share of its range, %; NaN when it is unknown."""
    if camera.zoom is None or camera.zoom_max is None or camera.zoom_max <= 1.0:
        return NAN
    return units.clip(100.0 * (camera.zoom - 1.0) / (camera.zoom_max - 1.0), 0.0, 100.0)


def zoom_factor(camera: CameraState, percent: float) -> float:
    """Return the zoom factor of a share of its range, %; the inverse of `zoom_percent`."""
    return 1.0 + units.clip(percent, 0.0, 100.0) / 100.0 * ((camera.zoom_max or 1.0) - 1.0)


def stepped_zoom(camera: CameraState, steps: float) -> float:
    """Return the zoom factor after some steps in, or out where `steps` is negative."""
    return (camera.zoom or 1.0) * math.pow(ZOOM_STEP, units.clip(steps, -MAX_STEPS, MAX_STEPS))


def settings(drone: Drone, times: Times) -> dialect.MAVLink_message | None:
    """Return CAMERA_SETTINGS; None before the drone has reported the mode."""
    camera = drone.camera[drone.camera.active_id]
    if camera.mode is None:
        return None
    return dialect.MAVLink_camera_settings_message(times.boot_ms, MODES[camera.mode], zoom_percent(camera), NAN, 0)


def field_of_view(drone: Drone) -> tuple[float, float]:
    """Return the horizontal and vertical field of view of the live picture, deg; NaN: unknown."""
    frame, lens = drone.video.state.frame, drone.identity.model.lens
    if frame is not None and frame.metadata.hfov is not None and frame.metadata.vfov is not None:
        return frame.metadata.hfov * units.DEG_PER_RAD, frame.metadata.vfov * units.DEG_PER_RAD
    zoom = drone.camera[MAIN].zoom
    if lens is None or zoom is None or drone.camera.active_id != MAIN:
        return NAN, NAN
    across = 2.0 * math.degrees(math.atan(lens.width / (2.0 * lens.fx * zoom)))
    down = 2.0 * math.degrees(math.atan(lens.height / (2.0 * lens.fy * zoom)))
    return across, down


def fov_status(vehicle: Vehicle, times: Times, pose: CameraPose) -> dialect.MAVLink_message:
    """Return CAMERA_FOV_STATUS.

    The centre of the image is where the optical axis meets a level ground at the height of the take-off point.
    """
    amsl = None if pose.height is None else vehicle.height.amsl(pose.height)
    latitude, longitude = (UNKNOWN, UNKNOWN) if pose.place is None else map(units.deg_e7, pose.place)
    image = (UNKNOWN, UNKNOWN, UNKNOWN)
    if pose.camera is not None and pose.camera[1] > -LEVEL_GROUND:
        image = (AT_INFINITY, AT_INFINITY, AT_INFINITY)
    elif pose.camera is not None and pose.place is not None and pose.height is not None and pose.height > 0.0:
        _, pitch, yaw = pose.camera
        reach = pose.height / math.tan(-pitch)
        there = geo.destination(*pose.place, reach * math.cos(yaw), reach * math.sin(yaw))
        ground = None if amsl is None else amsl - pose.height
        height = UNKNOWN if ground is None else units.millimetres(ground)
        image = (units.deg_e7(there[0]), units.deg_e7(there[1]), height)
    return dialect.MAVLink_camera_fov_status_message(
        times.boot_ms,
        latitude,
        longitude,
        UNKNOWN if amsl is None else units.millimetres(amsl),
        *image,
        list(pose.quaternion or (NAN, NAN, NAN, NAN)),
        *field_of_view(vehicle.drone),
    )


def thermal_range(drone: Drone, times: Times) -> dialect.MAVLink_message | None:
    """Return CAMERA_THERMAL_RANGE; None while the palette follows the picture.

    Its values are the temperatures of the palette's ends. An ANAFI reports no measured temperature, so that the points
    are unknown.
    """
    palette = drone.thermal.state.palette
    shown = drone.streams.shown
    if palette is None or palette.mode != PaletteMode.ABSOLUTE or not shown.kind.is_thermal:
        return None
    return dialect.MAVLink_camera_thermal_range_message(
        times.boot_ms, shown.number, 0, palette.highest_k - KELVIN, NAN, NAN, palette.lowest_k - KELVIN, NAN, NAN
    )
