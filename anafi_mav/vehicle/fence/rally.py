"""Rally points: places to return to instead of home, and which of them. No I/O.

They count only where RTL_TYPE says so. Its numbers are PX4's (PX4-Autopilot src/modules/navigator/rtl_params.c); of
what they say an ANAFI does the part about rally points. By default they do not count.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from anafi_mav import geo
from anafi_mav.vehicle.fence.plan_items import PlanItem, PlanItems, height_ato

CLOSER = 10.0
"""m that another place must be closer by before it replaces the chosen one: half way between two the choice would
otherwise change with every reading."""


class Return(enum.Enum):
    """End of a return."""

    HOME = "home"
    CLOSEST = "home or a rally point, whichever is closest"
    RALLY = "the closest rally point; home if there is none"


RTL_TYPES = {
    0: Return.CLOSEST,
    1: Return.RALLY,
    2: Return.HOME,
    3: Return.CLOSEST,
    4: Return.HOME,
    5: Return.RALLY,
}

DEFAULT_TYPE = 2


@dataclass(frozen=True)
class RallyPoint:
    """A place to return to."""

    number: int
    """Of its item."""
    latitude: float
    longitude: float
    ato: float
    """m above the take-off point."""


class RallyPoints:
    """The rally points of one vehicle, and its setting of what they are for."""

    def __init__(self) -> None:
        self.rtl_type = DEFAULT_TYPE
        """RTL_TYPE, a key of `RTL_TYPES`."""
        self.items = PlanItems()
        self.is_home = False
        """True while a rally point is the drone's home instead of the one that it preferred."""

    @property
    def purpose(self) -> Return:
        """Return the use that a return makes of the rally points."""
        return RTL_TYPES[self.rtl_type]

    def take(self, items: Sequence[PlanItem]) -> None:
        """Other rally points hold."""
        self.items = PlanItems(items)

    def points(self, takeoff_amsl: float | None) -> list[RallyPoint]:
        """Those whose height above the take-off point is known."""
        return [
            RallyPoint(number, item.latitude, item.longitude, ato)
            for number, item in enumerate(self.items)
            if (ato := height_ato(item, takeoff_amsl)) is not None
        ]

    def choose(
        self,
        place: tuple[float, float],
        home: tuple[float, float] | None,
        takeoff_amsl: float | None,
        present: RallyPoint | None,
        usable: Callable[[RallyPoint], bool],
    ) -> RallyPoint | None:
        """Return the rally point for a return that began at `place`; None: home.

        `present` is the point that was chosen last.
        """
        if self.purpose is Return.HOME:
            return None

        def away(point: RallyPoint | None) -> float:
            if point is None:
                assert home is not None
                return geo.distance(*place, *home)
            return geo.distance(*place, point.latitude, point.longitude)

        candidates: list[RallyPoint | None] = [*filter(usable, self.points(takeoff_amsl))]
        if not candidates:
            return None
        if self.purpose is Return.CLOSEST and home is not None:
            candidates.append(None)
        best = min(candidates, key=away)
        return present if present in candidates and away(present) < away(best) + CLOSER else best
