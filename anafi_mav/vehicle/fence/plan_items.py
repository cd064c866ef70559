"""One item of a mission, fence or rally list, with the fields of MISSION_ITEM_INT. No I/O."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import msgspec

from anafi_mav import mav_enums, texts
from anafi_mav.texts import OperatorText

MAX_ITEMS = 5000
"""Items of a list: more than any client sends, small enough to be checked and stored at once."""

DEGREES = 1e7
"""MISSION_ITEM_INT's x and y per degree, in items with a place."""

UNSET = 2**31 - 1
"""x and y that stand for "not set" (MAVLink mission.md); NaN in MISSION_ITEM."""

AMSL_FRAMES = (mav_enums.MAV_FRAME_GLOBAL, mav_enums.MAV_FRAME_GLOBAL_INT)
RELATIVE_FRAMES = (mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)

PLACED = frozenset(command for command, entry in mav_enums.enums["MAV_CMD"].items() if entry.has_location)
"""Commands with a place, in items and in COMMAND_INT: MAVLink's hasLocation."""

_CONTENT = struct.Struct("<HBB4fiif")


@dataclass(frozen=True)
class PlanFault:
    """Why an item or a plan is not taken."""

    result: int
    """MAV_MISSION_RESULT."""
    reason: OperatorText
    """A clause for people, which names the item where it is one item's fault."""


class PlanItem(msgspec.Struct, frozen=True):
    """Fields of a MISSION_ITEM_INT that belong to the item itself.

    Its number is its place in the list.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float]
    """param1..param4, NaN where they are not set."""
    x: int
    y: int
    z: float
    autocontinue: int = 1
    current: int = 0

    @property
    def latitude(self) -> float:
        """deg, of an item with a place."""
        return self.x / DEGREES

    @property
    def longitude(self) -> float:
        """deg, of an item with a place."""
        return self.y / DEGREES

    @property
    def has_place(self) -> bool:
        """x and y are degrees times 1e7, not plain numbers."""
        return has_place(self.command, self.frame)


def has_place(command: int, frame: int) -> bool:
    """x and y of an item are degrees times 1e7, not plain numbers."""
    return frame != mav_enums.MAV_FRAME_MISSION and command in PLACED


def opaque_id(items: Iterable[PlanItem]) -> int:
    """Return a number that identifies a list of items by its content; 0 for an empty list.

    A checksum, as PX4 does it, so that it outlives the gateway: the same for the same list, another for another.
    Which item is current does not count: it is progress.
    """
    checksum, empty = 0, True
    for item in items:
        empty = False
        checksum = zlib.crc32(
            _CONTENT.pack(item.command, item.frame, item.autocontinue, *item.params, item.x, item.y, item.z), checksum
        )
    return 0 if empty else checksum or 1


class PlanItems(tuple[PlanItem, ...]):
    """A list of items that is in force."""

    @cached_property
    def identity(self) -> int:
        """`opaque_id` of the list."""
        return opaque_id(self)


def place_fault(item: PlanItem) -> PlanFault | None:
    """Return the fault of an item's place, for an item that needs one."""
    if item.frame not in (*AMSL_FRAMES, *RELATIVE_FRAMES):
        return PlanFault(mav_enums.MAV_MISSION_UNSUPPORTED_FRAME, texts.FRAME_UNSUPPORTED.fill(frame=item.frame))
    if not abs(item.latitude) <= 90.0:
        return PlanFault(mav_enums.MAV_MISSION_INVALID_PARAM5_X, texts.BAD_LATITUDE)
    if not abs(item.longitude) <= 180.0:
        return PlanFault(mav_enums.MAV_MISSION_INVALID_PARAM6_Y, texts.BAD_LONGITUDE)
    if item.x == 0 and item.y == 0:
        return PlanFault(mav_enums.MAV_MISSION_INVALID_PARAM5_X, texts.AT_NULL)
    return None


def height_ato(item: PlanItem, takeoff_amsl: float | None) -> float | None:
    """Return the height of an item, m above take-off.

    Returns None for an AMSL height while that of the take-off point is unknown.
    """
    if item.frame in RELATIVE_FRAMES:
        return item.z
    return None if takeoff_amsl is None else item.z - takeoff_amsl
