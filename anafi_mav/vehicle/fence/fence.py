"""A fence from MAVLink's fence items: the region in which the vehicle may be.

Its geometry is `plans.zones`. No I/O, no clock.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from anafi_mav import mav_enums
from anafi_mav.plans.zones import CircleZone, Fence, PolygonZone, Zone
from anafi_mav.vehicle.fence.plan_items import PlanItem

POLYGONS = {
    mav_enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mav_enums.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
HOME_CIRCLE = mav_enums.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION


def fence_of(items: Iterable[PlanItem]) -> Fence:
    """Return the fence in items that `FenceKind` accepted."""
    zones: list[Zone] = []
    polygon: list[PlanItem] = []
    for number, item in enumerate(items):
        if item.command in POLYGONS:
            polygon.append(item)
            if len(polygon) == int(item.params[0]):
                corners = [(corner.latitude, corner.longitude) for corner in polygon]
                inclusion = POLYGONS[item.command]
                name = f"{inclusion_word(inclusion)} {number - len(polygon) + 1}-{number}"
                zones.append(PolygonZone(name, inclusion, group_of(item), corners))
                polygon = []
        elif item.command in CIRCLES:
            inclusion = CIRCLES[item.command]
            name = f"{inclusion_word(inclusion)} {number}"
            zones.append(CircleZone(name, inclusion, group_of(item), (item.latitude, item.longitude), item.params[0]))
        elif item.command == HOME_CIRCLE:
            zones.append(CircleZone(f"home circle {number}", True, group_of(item), None, item.params[0]))
    return Fence(zones)


def inclusion_word(inclusion: bool) -> str:
    return "inclusion" if inclusion else "exclusion"


def group_of(item: PlanItem) -> int:
    """Inclusion group; clients that know no groups leave param2 0 or unset."""
    return 0 if math.isnan(item.params[1]) else int(item.params[1])
