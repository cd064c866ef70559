"""Conversion between the simulator's flat world (m north and east of home) and the earth."""

from __future__ import annotations

from dataclasses import dataclass

from anafi_mav import geo


@dataclass(frozen=True)
class WorldOrigin:
    """Origin (0, 0, 0) of the world: deg, deg, height of the ground in m above mean sea level."""

    latitude: float
    longitude: float
    altitude: float

    def place(self, north: float, east: float) -> tuple[float, float]:
        """(latitude, longitude) in deg."""
        return geo.destination(self.latitude, self.longitude, north, east)

    def offset(self, latitude: float, longitude: float) -> tuple[float, float]:
        """(north, east) in m."""
        return geo.offset(self.latitude, self.longitude, latitude, longitude)
