"""A point on the map."""

from __future__ import annotations

import msgspec


class GeoPoint(msgspec.Struct, frozen=True):
    """A point on the map, deg."""

    latitude: float
    longitude: float

    @property
    def point(self) -> tuple[float, float]:
        """Latitude and longitude."""
        return self.latitude, self.longitude


def point_of(place: GeoPoint | None) -> tuple[float, float] | None:
    """Latitude and longitude, where there is a place."""
    return None if place is None else place.point
