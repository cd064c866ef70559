"""A fence: where the vehicle may be, from MAVLink's fence items. No I/O, no clock.

Inside means: in all inclusion zones of at least one group (param2 of the items; MAVLink common.xml
MAV_CMD_NAV_FENCE_*), and in no exclusion zone. Every zone is looked at in a plane of its own, with distances and
bearings from one of its corners along geodesics: exact to a centimetre over the ten kilometres that an ANAFI flies.
A polygon that crosses itself is inside where a ray from the point crosses it an odd number of times.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from anafi_mav import geo
from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import PX4, Flavour
from anafi_mav.services.plan_items import Fault, PlanItem, place_fault
from anafi_mav.services.plan_transfer import PlanKind

Point = tuple[float, float]
"""Latitude and longitude, deg."""

SMALLEST_AREA = 1.0
"""m². A polygon that encloses less is a line or a point: a slip, and nobody can be in it."""

SHORTEST = 0.01
"""m of a way outside that count: two zones that meet leave no gap by rounding."""

_RETURN_POINT = dialect.MAV_CMD_NAV_FENCE_RETURN_POINT
_POLYGONS = {
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
_HOME_CIRCLE = dialect.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION


@dataclass(frozen=True)
class Circle:
    """A zone around a point, or around home where that is None."""

    name: str
    inclusion: bool
    group: int
    centre: Point | None
    radius: float
    """m."""

    def depth(self, point: Point, home: Point | None) -> float:
        """How far inside the boundary a point is (m), negative outside. A circle around an unknown home is endless."""
        centre = home if self.centre is None else self.centre
        return math.inf if centre is None else self.radius - geo.distance(*centre, *point)

    def crossings(self, start: Point, end: Point, home: Point | None) -> list[float]:
        """Where the straight way from one point to another meets the boundary: shares of the way."""
        centre = home if self.centre is None else self.centre
        if centre is None:
            return []
        (n, e), (to_n, to_e) = geo.offset(*centre, *start), geo.offset(*centre, *end)
        dn, de = to_n - n, to_e - e
        # |start + t way|² = radius²
        a, b, c = dn * dn + de * de, n * dn + e * de, n * n + e * e - self.radius * self.radius
        root = b * b - a * c
        if a == 0.0 or root < 0.0:
            return []
        return [t for t in ((-b - math.sqrt(root)) / a, (-b + math.sqrt(root)) / a) if 0.0 < t < 1.0]


class Polygon:
    """A zone with straight sides."""

    def __init__(self, name: str, inclusion: bool, group: int, corners: Sequence[Point]) -> None:
        self.name, self.inclusion, self.group = name, inclusion, group
        self.corners = tuple(corners)
        self._origin = self.corners[0]
        starts = geo.offsets(*self._origin, self.corners)
        self._starts: npt.NDArray[Any] = starts
        self._ends: npt.NDArray[Any] = np.roll(starts, -1, axis=0)
        self._sides = self._ends - starts
        self._squares = np.maximum(np.einsum("ij,ij->i", self._sides, self._sides), 1e-12)

    @property
    def area(self) -> float:
        """m²."""
        n, e = self._starts[:, 0], self._starts[:, 1]
        return abs(float(n @ self._ends[:, 1] - e @ self._ends[:, 0])) / 2.0

    def depth(self, point: Point, home: Point | None) -> float:
        """How far inside the boundary a point is (m), negative outside."""
        here = np.array(geo.offset(*self._origin, *point))
        back = here - self._starts
        along = np.clip(np.einsum("ij,ij->i", back, self._sides) / self._squares, 0.0, 1.0)
        misses = back - along[:, None] * self._sides
        distance = math.sqrt(float(np.min(np.einsum("ij,ij->i", misses, misses))))
        # Sides that the ray from the point towards the east crosses.
        below, above = self._starts[:, 0] <= here[0], self._ends[:, 0] <= here[0]
        crossing = below != above
        at = (
            self._starts[crossing, 1]
            + (here[0] - self._starts[crossing, 0]) / self._sides[crossing, 0] * (self._sides[crossing, 1])
        )
        inside = int(np.count_nonzero(at > here[1])) % 2 == 1
        return distance if inside else -distance

    def crossings(self, start: Point, end: Point, home: Point | None) -> list[float]:
        """Where the straight way from one point to another meets the boundary: shares of the way."""
        first, last = (np.array(geo.offset(*self._origin, *point)) for point in (start, end))
        way = last - first
        back = self._starts - first
        cross = way[0] * self._sides[:, 1] - way[1] * self._sides[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):  # parallel sides are met at their ends by their neighbours
            along = (back[:, 0] * self._sides[:, 1] - back[:, 1] * self._sides[:, 0]) / cross
            across = (back[:, 0] * way[1] - back[:, 1] * way[0]) / cross
            meets = (along > 0.0) & (along < 1.0) & (across >= 0.0) & (across <= 1.0)
        return [float(t) for t in along[meets]]


Zone = Circle | Polygon


@dataclass(frozen=True)
class Margin:
    """How far it is to the nearest boundary that matters."""

    metres: float
    """Positive inside; at least that far in every direction. Infinite without a fence."""
    zone: str
    """Which zone's, for people; empty without a fence."""


NOWHERE = Margin(math.inf, "")


class Fence:
    """Zones together. `home` is the middle of a circle around home; while it is unknown there is no such circle."""

    def __init__(self, zones: Iterable[Zone] = ()) -> None:
        self.zones = tuple(zones)

    def margin(self, point: Point, home: Point | None = None) -> Margin:
        """How far inside the fence a point is."""
        groups: dict[int, Margin] = {}
        result = NOWHERE
        for zone in self.zones:
            depth = zone.depth(point, home)
            if zone.inclusion:
                if depth < groups.get(zone.group, NOWHERE).metres or zone.group not in groups:
                    groups[zone.group] = Margin(depth, zone.name)
            elif -depth < result.metres:
                result = Margin(-depth, zone.name)
        if groups:
            best = max(groups.values(), key=lambda margin: margin.metres)
            if best.metres < result.metres:
                result = best
        return result

    def leaves(self, start: Point, end: Point, home: Point | None = None) -> Margin | None:
        """Where the straight way from one point to another is outside: the first such margin; None: nowhere.

        Between two boundaries that it crosses, a way is inside or outside as a whole.
        """
        if not self.zones:
            return None
        north, east = geo.offset(*start, *end)
        length = math.hypot(north, east)
        met = sorted(t for zone in self.zones for t in zone.crossings(start, end, home))
        for before, after in pairwise((0.0, *met, 1.0)):
            if (after - before) * length < SHORTEST and before > 0.0:
                continue
            share = (before + after) / 2.0
            margin = self.margin(geo.destination(*start, north * share, east * share), home)
            if margin.metres < 0.0:
                return margin
        margin = self.margin(end, home)
        return margin if margin.metres < 0.0 else None


def fence_of(items: Iterable[PlanItem]) -> Fence:
    """The fence in items that `FenceKind` found good."""
    zones: list[Zone] = []
    polygon: list[PlanItem] = []
    for number, item in enumerate(items):
        if item.command in _POLYGONS:
            polygon.append(item)
            if len(polygon) == int(item.params[0]):
                corners = [(corner.latitude, corner.longitude) for corner in polygon]
                inclusion = _POLYGONS[item.command]
                name = f"{_word(inclusion)} polygon of items {number - len(polygon) + 1} to {number}"
                zones.append(Polygon(name, inclusion, _group(item), corners))
                polygon = []
        elif item.command in _CIRCLES:
            inclusion = _CIRCLES[item.command]
            name = f"{_word(inclusion)} circle of item {number}"
            zones.append(Circle(name, inclusion, _group(item), (item.latitude, item.longitude), item.params[0]))
        elif item.command == _HOME_CIRCLE:
            zones.append(Circle(f"circle around home of item {number}", True, _group(item), None, item.params[0]))
    return Fence(zones)


def _word(inclusion: bool) -> str:
    return "inclusion" if inclusion else "exclusion"


def _group(item: PlanItem) -> int:
    """Inclusion group; clients that know no groups leave param2 0 or unset."""
    return 0 if math.isnan(item.params[1]) else int(item.params[1])


class FenceKind(PlanKind):
    """The list of fence items."""

    mission_type = dialect.MAV_MISSION_TYPE_FENCE
    name = "fence"

    def check_item(self, item: PlanItem) -> Fault | None:
        first, second = item.params[:2]
        if item.command in _POLYGONS:
            if not (math.isfinite(first) and first == int(first) and 3 <= first <= self.capacity):
                return Fault(dialect.MAV_MISSION_INVALID_PARAM1, f"{first:g} is no number of corners")
        elif item.command in _CIRCLES or item.command == _HOME_CIRCLE:
            if not (math.isfinite(first) and first > 0.0):
                return Fault(dialect.MAV_MISSION_INVALID_PARAM1, f"{first:g} is no radius")
        elif item.command != _RETURN_POINT:
            return Fault(dialect.MAV_MISSION_UNSUPPORTED, f"command {item.command} is no part of a fence")
        if not (math.isnan(second) or (math.isfinite(second) and second == int(second))):
            return Fault(dialect.MAV_MISSION_INVALID_PARAM2, f"{second:g} is no inclusion group")
        return None if item.command == _HOME_CIRCLE else place_fault(item)

    def check_plan(self, items: Sequence[PlanItem], flavour: Flavour = PX4) -> Fault | None:
        number = 0
        return_points = 0
        while number < len(items):
            item = items[number]
            corners = int(item.params[0]) if item.command in _POLYGONS else 1
            same = items[number : number + corners]
            # Only an inclusion polygon has a group (MAVLink common.xml).
            keys = {(one.command, one.params[0], _group(one) if _POLYGONS.get(one.command) else 0) for one in same}
            if item.command in _POLYGONS and (len(same) < corners or len(keys) > 1):
                reason = f"the polygon that begins with item {number} has not its {corners} corners"
                return Fault(dialect.MAV_MISSION_INVALID_PARAM1, reason)
            return_points += item.command == _RETURN_POINT
            number += corners
        if return_points > 1:
            return Fault(dialect.MAV_MISSION_INVALID, "it has more than one return point")
        for zone in fence_of(items).zones:
            if isinstance(zone, Polygon) and zone.area < SMALLEST_AREA:
                return Fault(dialect.MAV_MISSION_INVALID, f"the {zone.name} encloses nothing, or crosses itself")
        return None


def summary(items: Sequence[PlanItem]) -> str:
    """A fence in a line, for people; what it asks for that is not done is told."""
    zones = fence_of(items).zones
    words = []
    for inclusion in (True, False):
        for kind, word in ((Polygon, "polygon"), (Circle, "circle")):
            count = sum(isinstance(zone, kind) and zone.inclusion is inclusion for zone in zones)
            if count:
                words.append(f"{count} {_word(inclusion)} {word}{'s' if count > 1 else ''}")
    line = ", ".join(words) or "no zones"
    groups = [zone.group for zone in zones if zone.inclusion]
    if len(groups) > len(set(groups)):
        line += "; inside is what all inclusion zones of one group have in common"
    if any(item.command == _RETURN_POINT for item in items):
        line += "; the return point is kept and not used"
    return line
