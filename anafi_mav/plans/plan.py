"""Flight plan independent of the file formats of QGroundControl, MAVLink and Parrot.

It holds what these and Mission Planner mean. Items are MAVLink's (common.xml MAV_CMD), with one difference: the
target of a DO_JUMP is the index of an item in `items`, counted from 0, whatever a file or a protocol counts from.
None is "not set": null or nan in files.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from anafi_mav import mav_enums

WAYPOINT = mav_enums.MAV_CMD_NAV_WAYPOINT
DO_JUMP = mav_enums.MAV_CMD_DO_JUMP

SLOWEST, FASTEST = 0.1, 100.0
"""m/s. A speed beyond these is a number in the wrong field, or in another unit.

Within them the drone limits itself.
"""

HEADED = frozenset(
    {
        mav_enums.MAV_CMD_NAV_WAYPOINT,
        mav_enums.MAV_CMD_NAV_LOITER_UNLIM,
        mav_enums.MAV_CMD_NAV_LOITER_TIME,
        mav_enums.MAV_CMD_NAV_LAND,
        mav_enums.MAV_CMD_NAV_TAKEOFF,
    }
)
"""Items whose param4 is a heading (deg from north, None: not set). ArduPilot's clients send 0 for "not set"."""

NORTH = 360.0
"""Heading north (deg) where 0 means "not set"."""

GLOBAL, MISSION, RELATIVE, GLOBAL_INT, RELATIVE_INT, TERRAIN, TERRAIN_INT = (
    mav_enums.MAV_FRAME_GLOBAL,
    mav_enums.MAV_FRAME_MISSION,
    mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mav_enums.MAV_FRAME_GLOBAL_INT,
    mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mav_enums.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    mav_enums.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)

MAX_ITEMS = 5000
"""Items of a plan, as many as a transfer carries."""

MAX_BYTES = 16 * 1024 * 1024
"""Of a file: a plan of 5000 items with a survey's drawing takes a few."""

Params = tuple[float | None, float | None, float | None, float | None, float | None, float | None, float | None]


@dataclass(frozen=True)
class Item:
    """One item of a mission."""

    command: int
    """MAV_CMD, or one of Parrot's own."""
    frame: int
    """MAV_FRAME."""
    params: Params
    """param1..param7; of an item with a place the last three are latitude (deg), longitude (deg), height (m)."""
    autocontinue: bool = True
    extra: str = field(default="", compare=False)
    """Data that QGroundControl's editor keeps with the item, as JSON."""


@dataclass(frozen=True)
class Point:
    """A place with a height (m), whose zero is said where it is used."""

    latitude: float
    longitude: float
    height: float = 0.0


@dataclass(frozen=True)
class FencePolygon:
    """A zone of a fence."""

    inclusion: bool
    corners: tuple[tuple[float, float], ...]
    """(latitude, longitude)."""
    group: int = 0
    """Of inclusion zones: inside is what all zones of one group have in common."""


@dataclass(frozen=True)
class FenceCircle:
    """A zone of a fence."""

    inclusion: bool
    centre: tuple[float, float] | None
    """None: home."""
    radius: float
    """m."""
    group: int = 0


@dataclass(frozen=True)
class Block:
    """Items that an editor made of something simpler, which it can go on editing."""

    kind: str
    """As QGroundControl names it: "survey", "CorridorScan", "StructureScan"."""
    first: int
    count: int
    data: str
    """As QGroundControl stores it, JSON."""


@dataclass(frozen=True)
class Plan:
    """All that a file of any of the formats can say."""

    items: tuple[Item, ...] = ()
    home: Point | None = None
    """Planned start; height above mean sea level."""
    zones: tuple[FencePolygon | FenceCircle, ...] = ()
    breach_return: Point | None = None
    """Height above home."""
    rally: tuple[Point, ...] = ()
    """Heights above home."""
    cruise_speed: float | None = None
    """m/s, of aeroplanes."""
    hover_speed: float | None = None
    """m/s, which the planner assumed."""
    blocks: tuple[Block, ...] = ()
    """In the order of their items, which they do not share."""
    editor: str = field(default="", compare=False)
    """Other data that QGroundControl's editor keeps, as JSON."""

    def __post_init__(self) -> None:
        # The order of zones means nothing, and QGroundControl keeps polygons and circles apart.
        ordered = sorted(self.zones, key=lambda zone: isinstance(zone, FenceCircle))
        object.__setattr__(self, "zones", tuple(ordered))


@dataclass(frozen=True)
class Loss:
    """Something of a plan that a format cannot hold."""

    what: str
    """A clause: "the heading is not set; written as 0, which is north"."""
    item: int | None = None
    """Of which item; None: of the plan."""

    def __str__(self) -> str:
        return self.what if self.item is None else f"item {self.item}: {self.what}"


def shifted(item: Item, by: int) -> Item:
    """Return the item for a list with `by` more items before it.

    Only the target of a jump changes: it is the only index of a list.
    """
    target, two, three, four, five, six, seven = item.params
    if item.command != DO_JUMP or target is None:
        return item
    return replace(item, params=(target + by, two, three, four, five, six, seven))


def with_heading(item: Item, heading: float | None) -> Item:
    """Return the item with another param4."""
    one, two, three, _, five, six, seven = item.params
    return replace(item, params=(one, two, three, heading, five, six, seven))


def without_zero_heading(item: Item) -> Item:
    """Return the item of a list in which a heading of 0 means "not set", and `NORTH` is north."""
    heading = item.params[3]
    if item.command not in HEADED or heading not in (0.0, NORTH):
        return item
    return with_heading(item, None if heading == 0.0 else 0.0)
