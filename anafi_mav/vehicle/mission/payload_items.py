"""Items of a mission that need its gimbal or camera: is one still to come? No I/O."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import DO_JUMP, Item

ENDLESS = -1.0
"""Repetitions of a DO_JUMP that never ends (MAVLink common.xml)."""

_AIMS = frozenset(
    {
        mav_enums.MAV_CMD_DO_MOUNT_CONFIGURE,
        mav_enums.MAV_CMD_DO_MOUNT_CONTROL,
        mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
    }
)
"""Items that aim the gimbal at angles, which ends a region of interest. DO_GIMBAL_MANAGER_CONFIGURE is not among them:
it moves nothing, and a release at the end of a mission is not to keep the gimbal."""

_LOOKS = frozenset(
    {
        mav_enums.MAV_CMD_DO_SET_ROI_LOCATION,
        mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
        mav_enums.MAV_CMD_DO_SET_ROI_NONE,
        mav_enums.MAV_CMD_DO_SET_ROI,
        SET_VIEW_MODE,
    }
)
"""Items that begin or end a region of interest: the drone aims the gimbal at it by itself."""

_CAMERA = frozenset(
    {
        mav_enums.MAV_CMD_DO_DIGICAM_CONTROL,
        mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL,
        mav_enums.MAV_CMD_SET_CAMERA_MODE,
        mav_enums.MAV_CMD_SET_CAMERA_ZOOM,
        mav_enums.MAV_CMD_IMAGE_START_CAPTURE,
        mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE,
        mav_enums.MAV_CMD_VIDEO_START_CAPTURE,
        mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE,
        mav_enums.MAV_CMD_PANORAMA_CREATE,
        SET_STILL_MODE,
    }
)

_GIMBAL = _AIMS | _LOOKS | {mav_enums.MAV_CMD_PANORAMA_CREATE}


class PayloadItems:
    """The items of one mission that need the gimbal or the camera.

    It is made once for each mission, because the questions are asked several times a second.
    """

    def __init__(self, items: Sequence[Item] = ()) -> None:
        self._gimbal = [index for index, item in enumerate(items) if item.command in _GIMBAL]
        self._camera = [index for index, item in enumerate(items) if item.command in _CAMERA]
        self._looking = [items[index].command in _LOOKS and _is_region(items[index]) for index in self._gimbal]
        self._jumps = [
            (index, int(item.params[0]), item.params[1] or 0.0)
            for index, item in enumerate(items)
            if item.command == DO_JUMP and item.params[0] is not None
        ]

    def needs_gimbal(self, first: int, jumps: Mapping[int, int]) -> bool:
        """Return True while an item from `first` on needs the gimbal, or a region is in force.

        `jumps`: how often each DO_JUMP was done; one with repetitions left repeats the items behind its target.
        """
        before = bisect_left(self._gimbal, first)
        if before > 0 and self._looking[before - 1]:
            return True
        return _reaches(self._gimbal, self._earliest(first, jumps))

    def needs_camera(self, first: int, jumps: Mapping[int, int]) -> bool:
        """Return True while an item from `first` on needs the camera; `jumps` as above."""
        return _reaches(self._camera, self._earliest(first, jumps))

    def _earliest(self, first: int, jumps: Mapping[int, int]) -> int:
        """Return the earliest item that is still to be flown."""
        found = first
        for index, target, repetitions in reversed(self._jumps):
            if index >= found and target < found and (repetitions == ENDLESS or jumps.get(index, 0) < repetitions):
                found = target
        return found


def _reaches(items: Sequence[int], first: int) -> bool:
    return bool(items) and items[-1] >= first


def _is_region(item: Item) -> bool:
    """Return True for an item that begins a region, False for one that ends it."""
    if item.command == SET_VIEW_MODE:
        return item.params[0] == 2.0
    if item.command == mav_enums.MAV_CMD_DO_SET_ROI:
        return item.params[0] == mav_enums.MAV_ROI_LOCATION or bool(item.params[4] or item.params[5])
    return item.command != mav_enums.MAV_CMD_DO_SET_ROI_NONE
