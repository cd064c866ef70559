"""A point on the map."""

from __future__ import annotations

from typing import NamedTuple


class GeoPoint(NamedTuple):
    """A point on the map, deg."""

    latitude: float
    longitude: float
