"""Geodesy on the WGS84 ellipsoid (pyproj).

Degrees and metres; bearings clockwise from north. No I/O.
"""

from __future__ import annotations

import math

from pyproj import Geod

_WGS84 = Geod(ellps="WGS84")


def destination(latitude: float, longitude: float, north: float, east: float) -> tuple[float, float]:
    """The point (deg, deg) that lies `north` and `east` metres away along the geodesic."""
    distance = math.hypot(north, east)
    if distance == 0.0:
        return latitude, longitude
    bearing = math.degrees(math.atan2(east, north))
    lon, lat, _ = _WGS84.fwd(longitude, latitude, bearing, distance)
    return float(lat), float(lon)


def offset(from_latitude: float, from_longitude: float, to_latitude: float, to_longitude: float) -> tuple[float, float]:
    """(north, east) in metres from one point to another; the inverse of `destination`."""
    bearing, _, distance = _WGS84.inv(from_longitude, from_latitude, to_longitude, to_latitude)
    angle = math.radians(float(bearing))
    return float(distance) * math.cos(angle), float(distance) * math.sin(angle)


def distance(from_latitude: float, from_longitude: float, to_latitude: float, to_longitude: float) -> float:
    """Length of the geodesic between two points, m."""
    return float(_WGS84.inv(from_longitude, from_latitude, to_longitude, to_latitude)[2])
