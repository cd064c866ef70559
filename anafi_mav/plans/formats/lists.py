"""Conversion of fences and rally points to and from MAVLink items.

MAVLink and MAVProxy's files use these items (common.xml MAV_CMD_NAV_*).
"""

from __future__ import annotations

from collections.abc import Sequence

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.plan import GLOBAL, RELATIVE, FenceCircle, FencePolygon, Item, Plan, Point

RETURN_POINT = mav_enums.MAV_CMD_NAV_FENCE_RETURN_POINT
HOME_CIRCLE = 5005
"""MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION of MAVLink's development.xml."""
_POLYGONS = {
    mav_enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mav_enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
    HOME_CIRCLE: True,
}


def fence_items(plan: Plan) -> list[Item]:
    """The fence as a list of items."""
    items = []
    for zone in plan.zones:
        if isinstance(zone, FencePolygon):
            command = next(command for command, inclusion in _POLYGONS.items() if inclusion is zone.inclusion)
            for latitude, longitude in zone.corners:
                count = float(len(zone.corners))
                items.append(Item(command, GLOBAL, (count, float(zone.group), 0.0, 0.0, latitude, longitude, 0.0)))
        else:
            around_home = zone.centre is None
            command = (
                next(c for c, inside in _CIRCLES.items() if inside is zone.inclusion)
                if not around_home
                else HOME_CIRCLE
            )
            latitude, longitude = zone.centre or (0.0, 0.0)
            items.append(Item(command, GLOBAL, (zone.radius, float(zone.group), 0.0, 0.0, latitude, longitude, 0.0)))
    if (back := plan.breach_return) is not None:
        items.append(Item(RETURN_POINT, RELATIVE, (0.0, 0.0, 0.0, 0.0, back.latitude, back.longitude, back.height)))
    return items


def rally_items(plan: Plan) -> list[Item]:
    """The rally points as a list of items."""
    return [
        Item(
            mav_enums.MAV_CMD_NAV_RALLY_POINT,
            RELATIVE,
            (0.0, 0.0, 0.0, 0.0, point.latitude, point.longitude, point.height),
        )
        for point in plan.rally
    ]


def zones_of(items: Sequence[Item], source: str) -> tuple[tuple[FencePolygon | FenceCircle, ...], Point | None]:
    """The zones and the return point that items describe. Raises `PlanError`."""
    zones: list[FencePolygon | FenceCircle] = []
    back: Point | None = None
    number = 0
    while number < len(items):
        item = items[number]
        first, second = item.params[:2]
        group = int(second or 0)
        if item.command in _POLYGONS:
            count = int(first or 0)
            same = items[number : number + count]
            if count < 3 or len(same) < count or any(one.command != item.command for one in same):
                raise PlanError(source, f"the polygon that begins here has not its {count} corners", number)
            corners = tuple(_place(number + offset, one, source) for offset, one in enumerate(same))
            zones.append(FencePolygon(_POLYGONS[item.command], corners, group))
            number += count
            continue
        if item.command in _CIRCLES:
            if first is None or first <= 0.0:
                raise PlanError(source, "a circle without a radius", number)
            centre = None if item.command == HOME_CIRCLE else _place(number, item, source)
            zones.append(FenceCircle(_CIRCLES[item.command], centre, first, group))
        elif item.command == RETURN_POINT:
            back = Point(*_place(number, item, source), item.params[6] or 0.0)
        else:
            raise PlanError(source, f"command {item.command} is no part of a fence", number)
        number += 1
    return tuple(zones), back


def points_of(items: Sequence[Item], source: str) -> tuple[Point, ...]:
    """The rally points that items describe. Raises `PlanError`."""
    return tuple(Point(*_place(number, item, source), item.params[6] or 0.0) for number, item in enumerate(items))


def _place(number: int, item: Item, source: str) -> tuple[float, float]:
    latitude, longitude = item.params[4:6]
    if latitude is None or longitude is None:
        raise PlanError(source, "it has no place", number)
    return latitude, longitude
