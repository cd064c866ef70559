"""Missions as the transfer machine sees them: what is taken, and how each flavour's clients count their items. No I/O.

A mission is kept verbatim, in one numbering: the first real item is 0. ArduPilot's clients count home as item 0, so
their lists, the targets of their jumps and whatever names an item to them are one further (MAVLink mission.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal

import msgspec

from anafi_mav.mavlink import dialect
from anafi_mav.plans.parrot import COMMANDS
from anafi_mav.plans.plan import Item
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan_items import (
    AMSL_FRAMES,
    DEGREES,
    RELATIVE_FRAMES,
    UNSET,
    Fault,
    PlanItem,
)
from anafi_mav.services.plan_transfer import PlanKind

Version = Literal[1, 2]

_HEADED = (dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_CMD_NAV_LAND, dialect.MAV_CMD_NAV_TAKEOFF)
"""Items whose param4 is a heading, which ArduPilot's clients leave at 0 without meaning north."""


def offset(flavour: Flavour) -> int:
    """What a client of this flavour calls our item 0."""
    return 1 if flavour.zero_home else 0


def neutral(item: PlanItem) -> Item:
    """An item as `plans` knows it."""
    x: float | None = item.x
    y: float | None = item.y
    if item.x == UNSET:
        x = None
    elif item.has_place:
        x = item.latitude
    if item.y == UNSET:
        y = None
    elif item.has_place:
        y = item.longitude
    one, two, three, four, z = (None if math.isnan(value) else value for value in (*item.params, item.z))
    return Item(item.command, item.frame, (one, two, three, four, x, y, z), bool(item.autocontinue))


def _with_param(item: PlanItem, number: int, value: float) -> PlanItem:
    params = list(item.params)
    params[number - 1] = value
    one, two, three, four = params
    return msgspec.structs.replace(item, params=(one, two, three, four))


def _shifted(item: PlanItem, by: int) -> PlanItem:
    """An item in a list that counts `by` more before it."""
    if item.command != dialect.MAV_CMD_DO_JUMP or not math.isfinite(item.params[0]):
        return item
    return _with_param(item, 1, item.params[0] + by)


class MissionKind(PlanKind):
    """The list of mission items. `home` makes ArduPilot's item 0, `version` is of the file that the drone flies."""

    mission_type = dialect.MAV_MISSION_TYPE_MISSION
    name = "mission"

    def __init__(self, home: Callable[[], PlanItem], version: Callable[[], Version]) -> None:
        self._home = home
        self._version = version

    def check_plan(self, items: Sequence[PlanItem], flavour: Flavour = PX4) -> Fault | None:
        return _examine(items, self._version(), offset(flavour))

    def shown(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        if not items or not flavour.zero_home:
            return items
        return (self._home(), *(_shifted(_with_zero(item), 1) for item in items))

    def taken(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        if not flavour.zero_home:
            return items
        return [_shifted(_without_zero(item), -1) for item in items[1:]]

    def always_shown(self, seq: int, flavour: Flavour) -> PlanItem | None:
        """dronekit reads home as item 0, and waits for it when there is nothing else; ArduCopter always has it."""
        return self._home() if flavour.zero_home and seq == 0 else None


def _without_zero(item: PlanItem) -> PlanItem:
    return _with_param(item, 4, math.nan) if item.command in _HEADED and item.params[3] == 0.0 else item


def _with_zero(item: PlanItem) -> PlanItem:
    return _with_param(item, 4, 0.0) if item.command in _HEADED and math.isnan(item.params[3]) else item


_FLOWN = frozenset(COMMANDS[1]) | frozenset(COMMANDS[2]) | {19, 115, 177, 530, 531, 1000, 1001}


def _examine(items: Sequence[PlanItem], version: Version, first: int) -> Fault | None:
    for number, item in enumerate(items, first):
        if item.command not in _FLOWN:
            return Fault(dialect.MAV_MISSION_UNSUPPORTED, f"item {number}: command {item.command} is not flown")
        if item.frame not in (dialect.MAV_FRAME_MISSION, *AMSL_FRAMES, *RELATIVE_FRAMES):
            return Fault(dialect.MAV_MISSION_UNSUPPORTED_FRAME, f"item {number}: frame {item.frame} is not flown")
        if item.command == dialect.MAV_CMD_NAV_WAYPOINT and item.x != UNSET:
            if not abs(item.x) <= 90 * DEGREES:
                return Fault(dialect.MAV_MISSION_INVALID_PARAM5_X, f"item {number}: its latitude is none")
            if not abs(item.y) <= 180 * DEGREES:
                return Fault(dialect.MAV_MISSION_INVALID_PARAM6_Y, f"item {number}: its longitude is none")
    return None
