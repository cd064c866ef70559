"""State of gimbal and camera that a flown file has set, and its check against the drone.

While a mission is paused its gimbal and camera are free for clients. A file that is resumed sets nothing again that
its executed lines have set: its other photos would look elsewhere, or would not be taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from anafi_mav import mav_enums
from anafi_mav.drone import Drone
from anafi_mav.drone.events import Axis, FrameOfReference
from anafi_mav.plans.formats.parrot import SET_VIEW_MODE
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.units import clip

AIMED = 3.0
"""deg from the pitch that a file has set, at which the gimbal still counts as aimed so."""

_COMMAND, _FIRST_PARAM = 3, 4
"""Columns of a line (arsdk.md §3.3, Parrot's flight plan page)."""

_REGIONS = (
    mav_enums.MAV_CMD_DO_SET_ROI_LOCATION,
    mav_enums.MAV_CMD_DO_SET_ROI_NONE,
    mav_enums.MAV_CMD_DO_SET_ROI,
    SET_VIEW_MODE,
)
"""Commands after which the drone aims the gimbal by itself."""

_ENDLESS = 0.0
"""Count of photos that are taken until they are stopped."""


@dataclass(frozen=True)
class PayloadState:
    """Gimbal and camera after some lines of a file."""

    pitch: float | None = None
    """deg to the horizon, up +; None: not set, or the drone aims at a region of interest."""
    takes_photos: bool = False
    """Photos are taken until a later line ends them."""
    records: bool = False
    """A video is recorded until a later line ends it."""

    def holds(self, drone: Drone) -> bool:
        """Return True if the drone's gimbal and camera are as set."""
        gimbal, cameras = drone.gimbal.main, drone.camera.state.cameras.values()
        if self.pitch is not None and gimbal.attitude is not None:
            wanted = clip(self.pitch, *gimbal.bounds(Axis.PITCH, FrameOfReference.ABSOLUTE))
            if abs(gimbal.attitude.absolute.pitch - wanted) > AIMED:
                return False
        if self.takes_photos and not any(camera.taking for camera in cameras):
            return False
        return not self.records or any(camera.recording_now for camera in cameras)


def payload_after(leg: FlightPlanFile, line: int, version: int) -> PayloadState:
    """Return the payload after a line of a file of this version was executed; -1: none was."""
    pitch: float | None = None
    takes_photos = records = False
    for text in leg.content.decode().splitlines()[1 : line + 2]:
        columns = text.split("\t")
        command, params = int(columns[_COMMAND]), [float(word) for word in columns[_FIRST_PARAM : _FIRST_PARAM + 3]]
        if command in _REGIONS:
            pitch = None
        elif command == mav_enums.MAV_CMD_DO_MOUNT_CONTROL:
            pitch = pitch if math.isnan(params[0]) else params[0]
        elif command == mav_enums.MAV_CMD_IMAGE_START_CAPTURE:
            takes_photos = params[1 if version == 1 else 2] == _ENDLESS
        elif command == mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE:
            takes_photos = False
        elif command == mav_enums.MAV_CMD_VIDEO_START_CAPTURE:
            records = True
        elif command == mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE:
            records = False
    return PayloadState(pitch, takes_photos, records)
