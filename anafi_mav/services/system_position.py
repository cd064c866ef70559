"""Position of a MAVLink system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from anafi_mav.vehicle.base.geo_point import GeoPoint


@dataclass(frozen=True)
class SystemPosition:
    """Position of a system at one moment, as its GLOBAL_POSITION_INT reports it."""

    place: GeoPoint
    amsl: float
    """m."""
    at: float
    """s, monotonic."""


PositionOf = Callable[[int], SystemPosition | None]
"""Returns the position of a system of this gateway; None: it is unknown, or there is no such system."""


def unknown_position(sysid: int) -> None:
    """Return None: the gateway has no other system."""
