"""Path of a plan for pictures: its places in metres around its start.

Jumps are not followed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from anafi_mav import geo, mav_enums
from anafi_mav.plans.plan import GLOBAL, GLOBAL_INT, RELATIVE, RELATIVE_INT, WAYPOINT, Item, Plan

AMSL, ABOVE_TAKEOFF = (GLOBAL, GLOBAL_INT), (RELATIVE, RELATIVE_INT)

_WAYS = frozenset(
    {
        WAYPOINT,
        mav_enums.MAV_CMD_NAV_LOITER_UNLIM,
        mav_enums.MAV_CMD_NAV_LOITER_TURNS,
        mav_enums.MAV_CMD_NAV_LOITER_TIME,
        mav_enums.MAV_CMD_NAV_LAND,
        mav_enums.MAV_CMD_NAV_TAKEOFF,
        mav_enums.MAV_CMD_NAV_SPLINE_WAYPOINT,
    }
)
"""Commands that lead to their place."""

LOOKS = frozenset({mav_enums.MAV_CMD_DO_SET_ROI, mav_enums.MAV_CMD_DO_SET_ROI_LOCATION})
"""Commands whose place is looked at."""


@dataclass(frozen=True)
class Stop:
    """A place on the way."""

    item: int
    """Which item leads there."""
    latitude: float
    longitude: float
    height: float | None
    """m above take-off; None when that cannot be known from the plan."""


def place_of(item: Item) -> tuple[float, float] | None:
    """Latitude and longitude of an item that has a place, deg."""
    latitude, longitude = item.params[4:6]
    if item.command not in _WAYS | LOOKS or latitude is None or longitude is None or (latitude, longitude) == (0, 0):
        return None
    return (latitude, longitude) if abs(latitude) <= 90.0 and abs(longitude) <= 180.0 else None


def height_of(item: Item, plan: Plan) -> float | None:
    """m above take-off.

    AMSL heights count from that of the planned home; without one they are not known.
    """
    height = item.params[6]
    if height is None or item.frame in ABOVE_TAKEOFF:
        return height
    if item.frame in AMSL and plan.home is not None:
        return height - plan.home.height
    return None


def way(plan: Plan) -> Iterator[Stop]:
    """Yield the places that the plan flies to, in the sequence of its items."""
    before: tuple[float, float] | None = None if plan.home is None else (plan.home.latitude, plan.home.longitude)
    for number, item in enumerate(plan.items):
        if item.command not in _WAYS:
            continue
        place = place_of(item) or before
        if place is None:
            continue
        height = 0.0 if item.command == mav_enums.MAV_CMD_NAV_LAND else height_of(item, plan)
        yield Stop(number, *place, height)
        before = place


def length(stops: list[Stop]) -> float:
    """m along the ground."""
    return sum(geo.distance(one.latitude, one.longitude, two.latitude, two.longitude) for one, two in pairwise(stops))
