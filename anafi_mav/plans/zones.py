"""Zones of a fence on the ground, and the crossings of their boundaries.

No I/O, no clock.

Inside means: in all inclusion zones of at least one group (param2 of the items; MAVLink common.xml
MAV_CMD_NAV_FENCE_*), and in no exclusion zone. Every zone is computed in a plane of its own, with distances and
bearings from one of its corners along geodesics: exact to a centimetre over the ten kilometres that an ANAFI flies.
A polygon that crosses itself is inside where a ray from the point crosses it an odd number of times.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from anafi_mav import geo

LatLon = tuple[float, float]
"""Latitude and longitude, deg."""

SHORTEST = 0.01
"""m of a way outside that count: two zones that meet leave no gap by rounding."""


@dataclass(frozen=True)
class CircleZone:
    """Circular zone around a point, or around home when `centre` is None."""

    name: str
    inclusion: bool
    group: int
    centre: LatLon | None
    radius: float
    """m."""

    def depth(self, point: LatLon, home: LatLon | None) -> float:
        """How far inside the boundary a point is (m), negative outside.

        A circle around an unknown home is endless.
        """
        centre = home if self.centre is None else self.centre
        return math.inf if centre is None else self.radius - geo.distance(*centre, *point)

    def crossings(self, start: LatLon, end: LatLon, home: LatLon | None) -> list[float]:
        """Return where the straight way between two points crosses the boundary: shares of the way."""
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


class Side(NamedTuple):
    """A side of a polygon, from one corner to the next. m from the polygon's first corner."""

    north: float
    east: float
    end_north: float
    way_north: float
    way_east: float


class PolygonZone:
    """A zone with straight sides."""

    def __init__(self, name: str, inclusion: bool, group: int, corners: Sequence[LatLon]) -> None:
        self.name, self.inclusion, self.group = name, inclusion, group
        self.corners = tuple(corners)
        self._origin = self.corners[0]
        places = [geo.offset(*self._origin, *corner) for corner in self.corners]
        ends = [*places[1:], places[0]]
        self._sides = [
            Side(north, east, end_north, end_north - north, end_east - east)
            for (north, east), (end_north, end_east) in zip(places, ends, strict=True)
        ]

    @property
    def area(self) -> float:
        """m²."""
        return abs(sum(side.north * side.way_east - side.east * side.way_north for side in self._sides)) / 2.0

    def depth(self, point: LatLon, home: LatLon | None) -> float:
        """How far inside the boundary a point is (m), negative outside."""
        north, east = geo.offset(*self._origin, *point)
        nearest, inside = math.inf, False
        for n, e, end_n, way_n, way_e in self._sides:
            dn, de = north - n, east - e
            along = min(max((dn * way_n + de * way_e) / max(way_n * way_n + way_e * way_e, 1e-12), 0.0), 1.0)
            missed_n, missed_e = dn - along * way_n, de - along * way_e
            nearest = min(nearest, missed_n * missed_n + missed_e * missed_e)
            # The ray from the point towards the east crosses the side.
            if (n <= north) != (end_n <= north) and e + dn / way_n * way_e > east:
                inside = not inside
        return math.sqrt(nearest) if inside else -math.sqrt(nearest)

    def crossings(self, start: LatLon, end: LatLon, home: LatLon | None) -> list[float]:
        """Return where the straight way between two points crosses the boundary: shares of the way."""
        (north, east), (to_north, to_east) = (geo.offset(*self._origin, *point) for point in (start, end))
        far_n, far_e = to_north - north, to_east - east
        found = []
        for n, e, _, way_n, way_e in self._sides:
            cross = far_n * way_e - far_e * way_n
            if cross == 0.0:
                continue  # parallel sides are met at their ends by their neighbours
            along = ((n - north) * way_e - (e - east) * way_n) / cross
            across = ((n - north) * far_e - (e - east) * far_n) / cross
            if 0.0 < along < 1.0 and 0.0 <= across <= 1.0:
                found.append(along)
        return found


Zone = CircleZone | PolygonZone


@dataclass(frozen=True)
class Margin:
    """How far it is to the nearest boundary that matters."""

    metres: float
    """Positive inside; at least that far in every direction. Infinite without a fence."""
    zone: str
    """Which zone's, for people; empty without a fence."""


NOWHERE = Margin(math.inf, "")


class Fence:
    """Zones together.

    `home` is the middle of a circle around home; while it is unknown there is no such circle.
    """

    def __init__(self, zones: Iterable[Zone] = ()) -> None:
        self.zones = tuple(zones)
        self.is_around_home = any(isinstance(zone, CircleZone) and zone.centre is None for zone in self.zones)
        """True when a zone moves with home."""

    def margin(self, point: LatLon, home: LatLon | None = None) -> Margin:
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

    def leaves(self, start: LatLon, end: LatLon, home: LatLon | None = None) -> Margin | None:
        """Return the first margin outside the fence on the straight way between two points.

        Returns None if the way is inside.

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
