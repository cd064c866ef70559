"""Checks the fence items that clients send, and describes a fence in words. No I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.plans.zones import CircleZone, PolygonZone
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan.plan_transfer import PlanKind
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.fence.fence import CIRCLES, HOME_CIRCLE, POLYGONS, fence_of, group_of, inclusion_word
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem, place_fault

SMALLEST_AREA = 1.0
"""m² that a polygon encloses at least.

One with less is a line or a point: a mistake, and no vehicle can be in it.
"""

_RETURN_POINT = dialect.MAV_CMD_NAV_FENCE_RETURN_POINT


def _is_void(item: PlanItem) -> bool:
    """True for a circle of radius 0, in which no vehicle can be.

    Fence editors send it for a circle not yet drawn.
    """
    return (item.command in CIRCLES or item.command == HOME_CIRCLE) and item.params[0] == 0.0


class FenceKind(PlanKind):
    """The list of fence items."""

    mission_type = dialect.MAV_MISSION_TYPE_FENCE
    name = "fence"

    def check_item(self, item: PlanItem) -> PlanFault | None:
        first, second = item.params[:2]
        if item.command in POLYGONS:
            if not (math.isfinite(first) and first == int(first) and 3 <= first <= self.capacity):
                return PlanFault(dialect.MAV_MISSION_INVALID_PARAM1, texts.NOT_CORNERS.fill(value=first))
        elif item.command in CIRCLES or item.command == HOME_CIRCLE:
            if not (math.isfinite(first) and first >= 0.0):  # `taken` leaves one of 0 out
                return PlanFault(dialect.MAV_MISSION_INVALID_PARAM1, texts.NOT_RADIUS.fill(value=first))
        elif item.command != _RETURN_POINT:
            return PlanFault(dialect.MAV_MISSION_UNSUPPORTED, texts.COMMAND_UNSUPPORTED.fill(command=item.command))
        if not (math.isnan(second) or (math.isfinite(second) and second == int(second))):
            return PlanFault(dialect.MAV_MISSION_INVALID_PARAM2, texts.NOT_GROUP.fill(value=second))
        return None if item.command == HOME_CIRCLE or _is_void(item) else place_fault(item)

    def taken(self, items: Sequence[PlanItem], flavour: Flavour) -> Sequence[PlanItem]:
        return [item for item in items if not _is_void(item)]

    def remarks(self, items: Sequence[PlanItem]) -> Sequence[OperatorText]:
        return [texts.FENCE_CIRCLE_IGNORED.fill(number=number) for number, item in enumerate(items) if _is_void(item)]

    def check_plan(self, items: Sequence[PlanItem], flavour: Flavour = PX4) -> PlanFault | None:
        number = 0
        return_points = 0
        while number < len(items):
            item = items[number]
            corners = int(item.params[0]) if item.command in POLYGONS else 1
            same = items[number : number + corners]
            # Only an inclusion polygon has a group (MAVLink common.xml).
            keys = {(one.command, one.params[0], group_of(one) if POLYGONS.get(one.command) else 0) for one in same}
            if item.command in POLYGONS and (len(same) < corners or len(keys) > 1):
                reason = texts.POLYGON_INCOMPLETE.fill(number=number, corners=corners)
                return PlanFault(dialect.MAV_MISSION_INVALID_PARAM1, reason)
            return_points += item.command == _RETURN_POINT
            number += corners
        if return_points > 1:
            return PlanFault(dialect.MAV_MISSION_INVALID, texts.RETURN_POINTS)
        for zone in fence_of(items).zones:
            if isinstance(zone, PolygonZone) and zone.area < SMALLEST_AREA:
                return PlanFault(dialect.MAV_MISSION_INVALID, texts.ZONE_EMPTY.fill(zone=zone.name))
        return None


def summary(items: Sequence[PlanItem]) -> OperatorText:
    """Describe a fence in one line for people, including requests of it that are not supported."""
    zones = fence_of(items).zones
    words = []
    for inclusion in (True, False):
        for kind, word in ((PolygonZone, "polygon"), (CircleZone, "circle")):
            count = sum(isinstance(zone, kind) and zone.inclusion is inclusion for zone in zones)
            if count:
                words.append(f"{count} {inclusion_word(inclusion)} {word}{'s' if count > 1 else ''}")
    if not items:
        return texts.NO_FENCE
    line = texts.FENCE_SUMMARY.fill(zones=", ".join(words) or texts.NO_ZONES)
    groups = [zone.group for zone in zones if zone.inclusion]
    if len(groups) > len(set(groups)):
        line = texts.FENCE_GROUPS.fill(fence=line)
    if any(item.command == _RETURN_POINT for item in items):
        line = texts.FENCE_RETURN_POINT.fill(fence=line)
    return line
