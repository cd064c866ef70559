"""Progress of a mission: current item, finished items, and the drone's file. No I/O.

The drone reports the lines of its file that it has executed; a `FlightPlanFile` maps them to items of the mission. An
item is done when the drone has reported it, or when the gateway has flown it itself, and never because time or other
items passed. `PayloadItems` answers whether an item is still to come that needs the mission's gimbal or camera.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import DO_JUMP, Item
from anafi_mav.plans.translation.translate import Course, FlightPlanFile
from anafi_mav.vehicle.mission.record import MissionRecord

ENDINGS = (mav_enums.MAV_CMD_NAV_LAND, mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)
"""Items that end in a landing or a return, which is the plan's own and does not interrupt the mission."""

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


class Mission:
    """The items of one upload. Compared by identity."""

    def __init__(self, items: Sequence[Item] = (), identity: int = 0) -> None:
        self.items = tuple(items)
        self.identity = identity
        """Opaque id; 0 before any mission was read."""
        self.payload = PayloadItems(self.items)


@dataclass(frozen=True)
class MissionProgress:
    """How far a mission is."""

    current: int = 0
    """The item that is flown, or will be when the mission continues."""
    leg: FlightPlanFile | None = None
    """The file that the drone flies, or flew last; None: none since the mission or its current item was chosen."""
    uid: str = ""
    """The drone's name of that file."""
    line: int = -1
    """The line of that file that was executed last."""
    course: Course = field(default_factory=Course)
    """What remains, beginning with the part that is flown."""
    jumps: Mapping[int, int] = field(default_factory=dict)
    """Items that jump, and how often each was done since the mission or its current item was chosen."""
    chosen: bool = False
    """A client has set the current item since the mission was uploaded."""
    skipped: frozenset[int] = frozenset()
    """Lines of the file that the drone has left out."""
    left: MissionProgress | None = None
    """Progress in a file that the drone has paused, when the mission is to begin elsewhere next.

    Another controller may still let the drone resume it.
    """
    kept: MissionRecord | None = None
    """The record that was stored last for a restarted gateway."""

    @property
    def leg_done(self) -> bool:
        """The drone has executed the whole file."""
        return self.leg is not None and self.line == len(self.leg.origins) - 1

    @property
    def at_last_line(self) -> bool:
        """All but one line of the file are executed."""
        return self.leg is not None and self.line == len(self.leg.origins) - 2

    def in_file(self, uid: str, leg: FlightPlanFile, line: int) -> MissionProgress:
        """Return the progress in a file of which `line` was executed last; -1 for none."""
        current = leg.origins[line + 1] if line + 1 < len(leg.origins) else self.current
        skipped = self.skipped if leg is self.leg else frozenset[int]()
        return replace(self, leg=leg, uid=uid, line=line, current=current, skipped=skipped, left=None)

    def at_item(self, item: int) -> MissionProgress:
        """Return the progress at an item that the gateway flies, or whose file it loads."""
        return replace(self, leg=None, line=-1, current=item, skipped=frozenset(), left=None)

    def with_done(self, items: Sequence[Item], done: Sequence[int]) -> MissionProgress:
        """Return the progress after these items are done: jumps among them count."""
        jumps = dict(self.jumps)
        for item in done:
            if items[item].command == DO_JUMP:
                jumps[item] = jumps.get(item, 0) + 1
        return replace(self, jumps=jumps)

    def with_skipped(self, line: int) -> tuple[MissionProgress, int | None]:
        """Return the progress after the drone has left out a line, and the item not reached."""
        leg = self.leg
        if leg is None or not self.line < line < len(leg.origins):
            return self, None
        return replace(self, skipped=self.skipped | {line}), leg.origins[line]

    def with_executed(self, items: Sequence[Item], line: int) -> tuple[MissionProgress, tuple[int, ...]]:
        """Return the progress after the drone has executed a line, and the items that are done.

        A line that was reported before, or that the file does not have, is ignored. Lines in between that were never
        reported, because the link was lost, may have been flown: they are not reported as done.
        """
        leg = self.leg
        if leg is None or not self.line < line < len(leg.origins):
            return self, ()
        passed = [item for done in leg.done[self.line + 1 : line + 1] for item in done]
        done = leg.done[line]
        if line in self.skipped:
            done = tuple(item for item in done if item != leg.origins[line])
        current = leg.origins[line + 1] if line + 1 < len(leg.origins) else self.current
        before = self.with_done(items, passed) if passed else self
        return replace(before, line=line, current=current), done

    def record(self, mission: int) -> MissionRecord | None:
        """Return the record for a restarted gateway; None without a file of the drone."""
        if self.leg is not None:
            return MissionRecord.of(mission, self.uid, self.leg, self.line, self.course.following, self.jumps)
        return None if self.kept is None else self.kept.flown_up_to(self.current, self.jumps)
