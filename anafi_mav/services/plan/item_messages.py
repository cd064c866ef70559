"""Items of a plan as MISSION_ITEM_INT, MISSION_ITEM and plan `Item`, both ways. No I/O.

MISSION_ITEM_INT is the form that is kept. What comes as MISSION_ITEM, with places in single precision, becomes the
integers that give the same floats back (MAVLink mission.md; conformance C5, D2).

A message has single precision, and only NaN, or INT32_MAX in x and y, means "not set"; places are kept to 1e-7
degree, about a centimetre. A value from the wire becomes the shortest decimal number that means the same, so that a
speed of 0.3 m/s is 0.3 again.
"""

from __future__ import annotations

import math
import struct
from typing import Any

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.plans.plan import Item
from anafi_mav.vehicle.fence.plan_items import DEGREES, UNSET, PlanFault, PlanItem, has_place

_FLOAT = struct.Struct("<f")

LARGEST: float = _FLOAT.unpack(b"\xff\xff\x7f\x7f")[0]
"""Largest number in single precision."""

EXACT = 2.0**24
"""Whole numbers below it are the same in single precision."""


def _integer(value: float, scale: float) -> int | None:
    """x or y of a MISSION_ITEM as MISSION_ITEM_INT has it; None when that cannot hold it."""
    if math.isnan(value):
        return UNSET
    if not abs(value * scale) < UNSET:
        return None
    return round(value * scale)


def item_of(message: Any) -> PlanItem | PlanFault:
    """Return the item of a MISSION_ITEM or MISSION_ITEM_INT, or its fault."""
    x: int | None = message.x
    y: int | None = message.y
    if message.get_msgId() == dialect.MAVLINK_MSG_ID_MISSION_ITEM:
        scale = DEGREES if has_place(message.command, message.frame) else 1.0
        x, y = _integer(message.x, scale), _integer(message.y, scale)
    if x is None:
        return PlanFault(dialect.MAV_MISSION_INVALID_PARAM5_X, texts.BAD_LATITUDE)
    if y is None:
        return PlanFault(dialect.MAV_MISSION_INVALID_PARAM6_Y, texts.BAD_LONGITUDE)
    params = (message.param1, message.param2, message.param3, message.param4)
    return PlanItem(message.command, message.frame, params, x, y, message.z, message.autocontinue, message.current)


def item_int(
    item: PlanItem, seq: int, sysid: int, compid: int, mission_type: int
) -> dialect.MAVLink_mission_item_int_message:
    """MISSION_ITEM_INT to one client."""
    return dialect.MAVLink_mission_item_int_message(
        sysid, compid, seq, item.frame, item.command, item.current, item.autocontinue,
        *item.params, item.x, item.y, item.z, mission_type,
    )  # fmt: skip


def item_float(
    item: PlanItem, seq: int, sysid: int, compid: int, mission_type: int
) -> dialect.MAVLink_mission_item_message:
    """MISSION_ITEM to one client: places are as exact as single precision is, about 0.4 m."""
    scale = DEGREES if item.has_place else 1.0
    x, y = (math.nan if value == UNSET else value / scale for value in (item.x, item.y))
    return dialect.MAVLink_mission_item_message(
        sysid, compid, seq, item.frame, item.command, item.current, item.autocontinue,
        *item.params, x, y, item.z, mission_type,
    )  # fmt: skip


def to_wire(item: Item) -> PlanItem:
    """An item as it travels.

    Raises `ValueError` for a number that MISSION_ITEM_INT cannot carry.
    """
    one, two, three, four, five, six, seven = item.params
    placed = has_place(item.command, item.frame)
    params = _single(one), _single(two), _single(three), _single(four)
    return PlanItem(
        item.command,
        item.frame,
        params,
        _whole(five, placed),
        _whole(six, placed),
        _single(seven),
        int(item.autocontinue),
    )


def from_wire(item: PlanItem) -> Item:
    """The item that travelled."""
    scale = DEGREES if item.has_place else 1.0
    one, two, three, four = (_shortest(value) for value in item.params)
    five, six = (None if value == UNSET else value / scale for value in (item.x, item.y))
    return Item(item.command, item.frame, (one, two, three, four, five, six, _shortest(item.z)), item.autocontinue != 0)


def as_carried(item: Item) -> Item:
    """Return an item as it is after being carried in a message. Raises `ValueError`."""
    return from_wire(to_wire(item))


def _single(value: float | None) -> float:
    if value is None:
        return math.nan
    if abs(value) > LARGEST:
        raise ValueError(f"{value:g} is too large a number for MAVLink")
    return _in_single_precision(value)


def _in_single_precision(value: float) -> float:
    try:
        return float(_FLOAT.unpack(_FLOAT.pack(value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def _whole(value: float | None, placed: bool) -> int:
    if value is None:
        return UNSET
    whole = round(value * DEGREES if placed else value)
    if not abs(whole) < UNSET:
        raise ValueError(f"{value:g} is too large a number for MAVLink")
    return whole


def _shortest(value: float) -> float | None:
    if value.is_integer() and abs(value) < EXACT:
        return value
    if not math.isfinite(value):
        return None if math.isnan(value) else value
    single = _in_single_precision(value)
    # Nine digits distinguish all numbers of single precision.
    return next(near for digits in range(1, 10) if _in_single_precision(near := float(f"{value:.{digits}g}")) == single)
