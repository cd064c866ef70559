"""A point on the map."""

from __future__ import annotations

import msgspec


class Place(msgspec.Struct, frozen=True):
    """A point on the map, deg."""

    latitude: float
    longitude: float

    @property
    def point(self) -> tuple[float, float]:
        """Latitude and longitude."""
        return self.latitude, self.longitude
