"""The simulator's flat world on the earth: metres north and east of the given home, and back."""

from __future__ import annotations

from dataclasses import dataclass

from anafi_mav import geo


@dataclass(frozen=True)
class Origin:
    """Where (0, 0, 0) lies: deg, deg, and the ground's height in m above mean sea level."""

    latitude: float
    longitude: float
    altitude: float

    def place(self, north: float, east: float) -> tuple[float, float]:
        """(latitude, longitude) in deg."""
        return geo.destination(self.latitude, self.longitude, north, east)

    def offset(self, latitude: float, longitude: float) -> tuple[float, float]:
        """(north, east) in m."""
        return geo.offset(self.latitude, self.longitude, latitude, longitude)
