"""Items of a plan on the wire: conversion between `plans.plan.Item` and `PlanItem`.

A message has single precision, and only NaN, or INT32_MAX in x and y, means "not set"; places are kept to 1e-7
degree, about a centimetre. A value from the wire becomes the shortest decimal number that means the same, so that a
speed of 0.3 m/s is 0.3 again.
"""

from __future__ import annotations

import math
import struct

from anafi_mav.plans.plan import Item
from anafi_mav.vehicle.fence.plan_items import DEGREES, UNSET, PlanItem, has_place

_FLOAT = struct.Struct("<f")

LARGEST: float = _FLOAT.unpack(b"\xff\xff\x7f\x7f")[0]
"""Largest number in single precision."""

EXACT = 2.0**24
"""Whole numbers below it are the same in single precision."""


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
        _integer(five, placed),
        _integer(six, placed),
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


def _integer(value: float | None, placed: bool) -> int:
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
