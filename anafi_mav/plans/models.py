"""What flight plans have to know of the drones: figures of the anafi_ros paper's table of models."""

from __future__ import annotations

from dataclasses import dataclass

from anafi_mav.plans.parrot import Version


@dataclass(frozen=True)
class Model:
    """A drone."""

    name: str
    version: Version
    """Of the flight plan that it flies."""
    max_speed: float
    """m/s over ground."""
    ceiling: float
    """m above mean sea level."""
    flight_time: float
    """s of a full battery."""


MODELS = {
    "4k": Model("ANAFI 4K", 1, 15.0, 4500.0, 25 * 60.0),
    "thermal": Model("ANAFI Thermal", 1, 15.0, 4500.0, 26 * 60.0),
    "usa": Model("ANAFI USA", 1, 14.7, 6000.0, 32 * 60.0),
    "ai": Model("ANAFI Ai", 2, 16.0, 5000.0, 32 * 60.0),
}
