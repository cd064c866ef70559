"""Checks and changes that the camera's commands have in common: owner, mode, storage."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.events import FsState, PhyState
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.services.flavours import Flavour
from anafi_mav.services.service import Host
from anafi_mav.texts import OperatorText, Reason
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.vehicle import Vehicle

PROBLEMS: dict[PhyState, Reason] = {
    PhyState.UNDETECTED: texts.NO_STORAGE,
    PhyState.TOO_SMALL: texts.STORAGE_TOO_SMALL,
    PhyState.TOO_SLOW: texts.STORAGE_TOO_SLOW,
    PhyState.USB_MASS_STORAGE: texts.STORAGE_USB,
}
FILE_SYSTEM_PROBLEMS: dict[FsState, Reason] = {
    FsState.FORMAT_NEEDED: texts.STORAGE_UNFORMATTED,
    FsState.FORMATTING: texts.STORAGE_FORMATTING,
    FsState.ERROR: texts.STORAGE_ERROR,
    FsState.PASSWORD_NEEDED: texts.STORAGE_PASSWORD,
    FsState.CHECKING: texts.STORAGE_CHECKING,
}
PASSING = (texts.STORAGE_FORMATTING, texts.STORAGE_CHECKING)
"""Problems that end by themselves; others need another card."""


def is_at_autopilot(flavour: Flavour) -> bool:
    """Return True for flavours whose clients address camera commands to component 1."""
    return flavour.camera_at_autopilot


def require_free(vehicle: Vehicle, what: OperatorText) -> None:
    """Refuse a change of the camera while the items of a flown mission need it."""
    if vehicle.mission_needs_camera:
        raise Refused(what, texts.MISSION_USES_CAMERA)


def require_idle(drone: Drone, what: OperatorText) -> None:
    """Refuse a change that would end a recording or the photos that are being taken."""
    if any(camera.recording_now for camera in drone.camera.state.cameras.values()):
        raise Refused(what, texts.CAMERA_RECORDS)
    if any(camera.taking for camera in drone.camera.state.cameras.values()):
        raise Refused(what, texts.CAMERA_TAKES_PHOTOS)


async def enter_mode(host: Host, mode: CameraMode, what: OperatorText) -> None:
    """Change between photos and videos.

    No command is sent for the mode that the camera has. It has the reported one when it has answered every change, or
    when nothing may change it now.
    """
    camera = host.drone.camera
    id = camera.active_id
    state = camera[id]
    if state.mode is mode and camera.is_settled:
        return
    if mode not in (state.modes or ()):  # the thermal camera only records
        raise Refused(what, texts.CAMERA_LACKS_MODE)
    try:
        require_free(host.vehicle, what)
        require_idle(host.drone, what)
    except Refused:
        if state.mode is mode:
            return
        raise
    if await camera.set_mode(mode, id) is not mode:
        raise Refused(what, texts.CAMERA_MODE_KEPT)


def media_storage(drone: Drone) -> int | None:
    """Return the drone's number of the storage that the active camera writes to; None: absent."""
    return drone.storage.for_media(drone.camera[drone.camera.active_id].storage_policy)


def storage_problem(drone: Drone, id: int | None) -> Reason | None:
    """Return the reason why nothing can be stored; None for a storage that is ready or unknown."""
    if id is None:
        return texts.NO_STORAGE
    state = drone.storage[id]
    if state.physical is not None and state.physical in PROBLEMS:
        return PROBLEMS[state.physical]
    if state.file_system is not None and state.file_system in FILE_SYSTEM_PROBLEMS:
        return FILE_SYSTEM_PROBLEMS[state.file_system]
    return None


def require_storage(drone: Drone, what: OperatorText) -> None:
    """Refuse a photo or recording that could not be stored."""
    if (problem := storage_problem(drone, media_storage(drone))) is not None:
        raise Refused(what, problem, lasting=problem not in PASSING)
