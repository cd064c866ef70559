"""Wind: a steady one and gusts around it, the same in every run with the same seed.

Gusts are two Ornstein-Uhlenbeck processes (north and east) of `TIME_CONSTANT`; their standard deviation is a share of
the steady speed. There is no wind on the ground.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from functools import cached_property

from anafi_mav.arsdk.messages.ardrone3 import WarningLevel
from anafi_mav.errors import ConfigError
from anafi_mav.units import RAD_PER_DEG

MAX_SPEED = 40.0
"""m/s; a hurricane."""

GUSTS = 0.15
"""Standard deviation of the gusts as a share of the speed, unless said otherwise: open country in daytime."""

TIME_CONSTANT = 2.0
"""s"""

STRONG = 0.75
"""Share of what the model stands from which the wind is reported as a warning. Assumed."""

_SMOOTHING = 2.0
"""s over which the drone judges the wind."""
_HYSTERESIS = 0.5
"""m/s that it must fall below a threshold to count as weaker."""


@dataclass(frozen=True)
class WindSpec:
    """Configuration of the wind. Raises `ConfigError` for an impossible one."""

    speed: float = 0.0
    """m/s"""
    direction: float = 0.0
    """deg clockwise from north where it comes from, as forecasts have it."""
    gusts: float = GUSTS
    """Standard deviation as a share of `speed`."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.speed <= MAX_SPEED:
            raise ConfigError("speed", f"expected m/s from 0 to {MAX_SPEED:g}, got {self.speed:g}")
        if not 0.0 <= self.direction <= 360.0:
            raise ConfigError("direction", f"expected degrees from 0 to 360, got {self.direction:g}")
        if not 0.0 <= self.gusts <= 1.0:
            raise ConfigError("gusts", f"expected a share of the speed from 0 to 1, got {self.gusts:g}")

    @cached_property
    def steady(self) -> tuple[float, float]:
        """Velocity of the air towards (north, east), m/s."""
        angle = self.direction * RAD_PER_DEG
        return -self.speed * math.cos(angle), -self.speed * math.sin(angle)


CALM = WindSpec()


class Wind:
    """The air around one drone."""

    def __init__(self, spec: WindSpec, chance: random.Random) -> None:
        self.spec = spec
        self._chance = chance
        self._gust = [0.0, 0.0]

    def advance(self, seconds: float) -> tuple[float, float]:
        """Let time pass; the velocity of the air towards (north, east), m/s."""
        north, east = self.spec.steady
        spread = self.spec.gusts * self.spec.speed
        if spread == 0.0:
            self._gust = [0.0, 0.0]
            return north, east
        keep = math.exp(-seconds / TIME_CONSTANT)
        push = spread * math.sqrt(1.0 - keep * keep)
        self._gust = [keep * gust + push * self._chance.gauss(0.0, 1.0) for gust in self._gust]
        return north + self._gust[0], east + self._gust[1]


class WindWatch:
    """Wind warning of the drone, from the wind measured in the air."""

    def __init__(self, resistance: float) -> None:
        """`resistance`: m/s that the model stands."""
        self._thresholds = {WarningLevel.CRITICAL: resistance, WarningLevel.WARNING: STRONG * resistance}
        self._mean = 0.0
        self._level = WarningLevel.OK

    def feel(self, speed: float, seconds: float) -> WarningLevel:
        """It blew with `speed` m/s for so long."""
        if speed == self._mean == 0.0:
            return WarningLevel.OK
        self._mean += (speed - self._mean) * (1.0 - math.exp(-seconds / _SMOOTHING))
        found = WarningLevel.OK
        for level, threshold in self._thresholds.items():
            slack = _HYSTERESIS if self._level >= level else 0.0
            if self._mean >= threshold - slack:
                found = level
                break
        self._level = found
        return found
