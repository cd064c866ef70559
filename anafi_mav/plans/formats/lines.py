"""Reads a line drawn on a map (KML, GeoJSON) as a plan with a waypoint at each point.

Of both formats only lines are read. Their heights are ignored: KML's are above the ground or the sea by a mode that
most programs leave out, GeoJSON's are above the ellipsoid (RFC 7946 §3.1.1), and neither knows a take-off point. So
the caller gives one height for the whole line.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import msgspec

from anafi_mav.errors import PlanError
from anafi_mav.plans.plan import MAX_ITEMS, RELATIVE, WAYPOINT, Item, Plan

_GEOJSON = frozenset(
    {"Feature", "FeatureCollection", "GeometryCollection", "LineString"}
    | {"Point", "MultiPoint", "MultiLineString", "Polygon", "MultiPolygon"}
)
MAX_DEPTH = 20
"""Collections inside each other."""


class _Head(msgspec.Struct):
    """Of a JSON file, what says that it is GeoJSON."""

    type: Any = None


def is_geojson(text: str) -> bool:
    """It is JSON, and of the types that GeoJSON has (RFC 7946 §1.4)."""
    try:
        found = msgspec.json.decode(text, type=_Head).type
    except (ValueError, RecursionError):
        return False
    return isinstance(found, str) and found in _GEOJSON


def is_kml(text: str) -> bool:
    """It begins like XML. That it is KML is found out by reading it."""
    return text.lstrip().startswith("<")


def read_geojson(text: str, source: str, height: float | None) -> Plan:
    """The plan along the one LineString of a file; `height` in m above take-off.

    Raises `PlanError`.
    """
    try:
        lines = list(_line_strings(msgspec.json.decode(text), MAX_DEPTH))
    except (ValueError, TypeError, RecursionError, LookupError) as error:
        raise PlanError(source, f"no GeoJSON that can be read: {error}") from error
    return _along(lines, source, height)


def _line_strings(document: Any, depth: int) -> list[list[Any]]:
    if not isinstance(document, dict) or depth == 0:
        return []
    match document.get("type"):
        case "Feature":
            return _line_strings(document.get("geometry"), depth - 1)
        case "FeatureCollection" | "GeometryCollection":
            members = document.get("features", document.get("geometries"))
            return [line for member in members or () for line in _line_strings(member, depth - 1)]
        case "LineString":
            return [list(document["coordinates"])]
        case _:
            return []


def read_kml(text: str, source: str, height: float | None) -> Plan:
    """The plan along the one LineString of a file; `height` in m above take-off.

    Raises `PlanError`.
    """
    # Entities are declared in a document type, which no KML has: the parser expands them without bounds.
    if "<!DOCTYPE" in text:
        raise PlanError(source, "it declares a document type: no KML")
    try:
        root = ElementTree.fromstring(text.lstrip().encode())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise PlanError(source, f"no KML: {error}") from error
    lines = []
    for element in root.iter():
        if _name(element) == "LineString":
            words = "".join(inner.text or "" for inner in element if _name(inner) == "coordinates").split()
            lines.append([word.split(",") for word in words])
    return _along(lines, source, height)


def _name(element: ElementTree.Element) -> str:
    """Without its namespace, of which KML has had several."""
    return element.tag.rpartition("}")[2]


def _along(lines: list[list[Any]], source: str, height: float | None) -> Plan:
    if len(lines) != 1:
        raise PlanError(source, f"it has {len(lines) or 'no'} lines, expected one")
    (line,) = lines
    if height is None:
        raise PlanError(source, "it is a line on a map: a height above take-off has to be said for it, by --height")
    if not 0 < len(line) <= MAX_ITEMS:
        raise PlanError(source, f"its line has {len(line)} points, expected 1 to {MAX_ITEMS}")
    items = []
    for number, point in enumerate(line):
        latitude, longitude = _place(point, number, source)
        items.append(Item(WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, latitude, longitude, height)))
    return Plan(tuple(items))


def _place(point: Any, number: int, source: str) -> tuple[float, float]:
    """Both formats have the longitude first."""
    try:
        longitude, latitude, *_height = (float(value) for value in point)
    except (TypeError, ValueError, OverflowError):
        longitude = latitude = math.nan
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise PlanError(source, f"point {number} of its line is no place")
    return latitude, longitude
