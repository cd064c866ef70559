"""Geodesy on the WGS84 ellipsoid (pyproj).

Degrees and metres; bearings clockwise from north. No I/O.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
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


def offsets(
    from_latitude: float, from_longitude: float, points: Sequence[tuple[float, float]]
) -> npt.NDArray[np.floating[Any]]:
    """`offset` to many points (latitude, longitude) at once: an array of rows (north, east)."""
    latitudes, longitudes = np.array(points, dtype=float).reshape(-1, 2).T
    start = np.full(latitudes.shape, from_longitude), np.full(latitudes.shape, from_latitude)
    bearings, _, distances = _WGS84.inv(*start, longitudes, latitudes)
    angles = np.radians(bearings)
    return np.column_stack((distances * np.cos(angles), distances * np.sin(angles)))


def distance(from_latitude: float, from_longitude: float, to_latitude: float, to_longitude: float) -> float:
    """Length of the geodesic between two points, m."""
    return float(_WGS84.inv(from_longitude, from_latitude, to_longitude, to_latitude)[2])
