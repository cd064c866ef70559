"""Check of a plan for a drone model before a flight: lint, without a drone.

The mission is translated as for a flight from the planned home, and the lines that the drone would fly are followed.
Times and distances are estimates, with the assumptions below.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from anafi_mav import geo, mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.models import Model
from anafi_mav.plans import zones
from anafi_mav.plans.formats.waypoints import rows
from anafi_mav.plans.plan import WAYPOINT, FenceCircle, Item, Plan, Point
from anafi_mav.plans.rules.parts import UnknownHeight
from anafi_mav.plans.translation.translate import (
    FlightPlanFile,
    GatewayStep,
    Start,
    TranslatedMission,
    TranslationFault,
    examine,
    translate,
)

CRUISE = 5.0
"""m/s without a speed of the mission's or the planner's. Assumed: Parrot publishes none."""

CLIMB, SINK = 3.0, 1.0
"""m/s up (the firmware's own limit, MaxVerticalSpeed) and down to a landing. Assumed."""

TAKE_OFF_TIME, STEP_TIME, PHOTO_TIME = 5.0, 5.0, 2.0
"""s of a take-off, of an item that the gateway flies, of a photo. Assumed."""

PANORAMA_SPEED = 30.0
"""deg/s of a panorama that names none. Assumed."""

FAR, TOO_FAR = 1000.0, 4000.0
"""m from home. The drone has a limit for its first way point that Parrot does not publish (component
FirstWaypointTooFar); the second is the largest MaxDistance that can be set (ardrone3.xml)."""

RESERVE = 0.2
"""Part of the battery that a plan should leave."""


class FindingSeverity(enum.Enum):
    ERROR = "error"
    """It would be refused, end before its end, or break a limit."""
    WARNING = "warning"
    """It flies, but not quite as it is drawn, or with little to spare."""


@dataclass(frozen=True)
class Problem:
    """One of them."""

    severity: FindingSeverity
    what: str
    """A clause."""
    item: int | None = None
    """Of which item, counted from 0; None: of the plan."""

    def __str__(self) -> str:
        return self.what if self.item is None else f"item {self.item}: {self.what}"


@dataclass(frozen=True)
class FlightLimits:
    """Settings of the drone that a plan has to keep; defaults are the firmware's."""

    max_altitude: float = 150.0
    """m above the take-off."""
    max_distance: float | None = None
    """m from home; None: the drone's geofence is off."""
    return_height: float = 20.0
    """m above the take-off: an Ai begins a plan at this height or higher."""


@dataclass(frozen=True)
class Findings:
    """Result of a check: problems, distance and time."""

    problems: tuple[Problem, ...]
    """Those of items in their order, then those of the plan."""
    distance: float | None = None
    """m along the way, the return included; None: the plan cannot be flown, or has no end."""
    seconds: float | None = None
    """From the take-off to the landing."""

    @property
    def errors(self) -> bool:
        return any(problem.severity is FindingSeverity.ERROR for problem in self.problems)


def check(plan: Plan, model: Model, limits: FlightLimits | None = None) -> Findings:
    """Find all faults of a plan.

    Raises `ValueError` for a model whose plans are not known.
    """
    figures = model.plans()
    if not plan.items:
        return Findings((_error("it has no mission"),))
    report = examine(plan.items, figures.version)
    if report.faults:
        return Findings(tuple(_fault(fault) for fault in report.faults))
    problems = [_warning(loss.what, loss.item) for loss in report.approximations]
    problems += [_warning(f"flown by the gateway: {loss.what}", loss.item) for loss in report.stepped]
    first = _first_place(plan.items)
    home = plan.home or (None if first is None else Point(first.latitude, first.longitude))
    start = Start(
        home.latitude if home else 0.0,
        home.longitude if home else 0.0,
        0.0,
        flying=False,
        takeoff_amsl=None if plan.home is None else plan.home.height,
    )
    try:
        flight = translate(plan.items, figures.version, start)
    except UnknownHeight as error:  # here, not when it is flown
        problems.append(_warning(f"{error.problem}: its path cannot be checked", error.item))
        return Findings(_ordered(problems))
    except PlanError as error:
        problems.append(_error(error.problem, error.item))
        return Findings(_ordered(problems))
    follower = _Follower(plan, model, limits or FlightLimits(), start)
    problems += follower.follow(flight)
    if flight.rest is not None:
        problems.append(_warning("it is flown until the battery is low"))
        return Findings(_ordered(problems))
    problems += follower.battery()
    return Findings(_ordered(problems), follower.distance, follower.seconds)


def _error(what: str, item: int | None = None) -> Problem:
    return Problem(FindingSeverity.ERROR, what, item)


def _warning(what: str, item: int | None = None) -> Problem:
    return Problem(FindingSeverity.WARNING, what, item)


def _fault(fault: TranslationFault) -> Problem:
    return _error(fault.reason, fault.item)


def _ordered(problems: list[Problem]) -> tuple[Problem, ...]:
    """Return each problem once, by item; an item that has an error has no warnings."""
    wrong = {problem.item for problem in problems if problem.severity is FindingSeverity.ERROR} - {None}
    once = {
        problem: None for problem in problems if problem.severity is FindingSeverity.ERROR or problem.item not in wrong
    }
    return tuple(sorted(once, key=lambda problem: math.inf if problem.item is None else problem.item))


def fence_of(plan: Plan) -> zones.Fence:
    """The fence of a plan; its zones are numbered from 0."""
    found: list[zones.Zone] = []
    for number, zone in enumerate(plan.zones):
        kind = f"{'inclusion' if zone.inclusion else 'exclusion'}"
        if isinstance(zone, FenceCircle):
            name = f"{kind} circle {number}"
            found.append(zones.CircleZone(name, zone.inclusion, zone.group, zone.centre, zone.radius))
        else:
            found.append(zones.PolygonZone(f"{kind} polygon {number}", zone.inclusion, zone.group, zone.corners))
    return zones.Fence(found)


class _Follower:
    """Follows a flight."""

    def __init__(self, plan: Plan, model: Model, limits: FlightLimits, start: Start) -> None:
        self._model, self._figures, self._limits = model, model.plans(), limits
        self._planned = plan.home is not None
        self._home = (start.latitude, start.longitude)
        self._amsl = start.takeoff_amsl
        self._here = Point(start.latitude, start.longitude, 0.0)
        self._speed = plan.hover_speed or CRUISE
        self._fence = fence_of(plan)
        self._first = True
        self._landed = False
        self.distance = 0.0
        self.seconds = 0.0

    def follow(self, flight: TranslatedMission) -> Iterator[Problem]:
        if self._fence.margin(self._home, self._home).metres < 0.0:
            yield _error("it begins outside the fence")
        for part in flight.parts:
            if isinstance(part, GatewayStep):
                self.seconds += STEP_TIME
                continue
            lines = rows(part.content.decode(), "translation")
            if self._figures.version == 2:
                yield from self._way_in(lines, part)
            for line, origin in zip(lines, part.origins, strict=True):
                yield from self._line(line, origin)
        if not self._landed:
            yield _warning("it ends in the air: the drone hovers there until the battery is low")

    def _way_in(self, lines: list[Item], leg: FlightPlanFile) -> Iterator[Problem]:
        """Up here, and over to above the first way point (Parrot's flight plan page)."""
        found = next(((number, line) for number, line in enumerate(lines) if line.command == WAYPOINT), None)
        if found is None:
            return
        number, line = found
        origin, to = leg.origins[number], _point(line)
        height = max(self._limits.return_height, to.height, self._here.height)
        if height > to.height:
            yield _warning(
                f"an Ai begins at {height:g} m above take-off: it rises there first, goes over to above it and sinks",
                origin,
            )
        yield from self._go(replace(self._here, height=height), origin)
        yield from self._go(replace(to, height=height), origin)

    def _line(self, line: Item, origin: int) -> Iterator[Problem]:
        one, two, three = line.params[:3]
        match line.command:
            case mav_enums.MAV_CMD_NAV_WAYPOINT:
                to = _point(line)
                if self._first and self._planned:
                    yield from self._first_way(to, origin)
                self._first = False
                yield from self._go(to, origin)
            case mav_enums.MAV_CMD_NAV_TAKEOFF:
                self.seconds += TAKE_OFF_TIME
            case mav_enums.MAV_CMD_NAV_LAND:
                self.seconds += max(self._here.height, 0.0) / SINK
                self._landed = True
            case mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                back = Point(*self._home, max(self._limits.return_height, self._here.height))
                self._move(replace(self._here, height=back.height))
                self._move(back)
                self.seconds += back.height / SINK
                self._landed = True
            case mav_enums.MAV_CMD_NAV_DELAY | mav_enums.MAV_CMD_CONDITION_DELAY:
                self.seconds += one or 0.0
            case mav_enums.MAV_CMD_DO_CHANGE_SPEED:
                self._speed = two or self._speed
                if self._speed > self._figures.max_speed:
                    most = self._figures.max_speed
                    yield _error(
                        f"{self._speed:g} m/s is more than the {most:g} that an {self._model.title} flies", origin
                    )
                    self._speed = most
            case mav_enums.MAV_CMD_PANORAMA_CREATE:
                self.seconds += abs(one or 0.0) / (three or PANORAMA_SPEED)
            case mav_enums.MAV_CMD_IMAGE_START_CAPTURE if (two if self._figures.version == 1 else three) == 1.0:
                self.seconds += PHOTO_TIME

    def _first_way(self, to: Point, origin: int) -> Iterator[Problem]:
        far = geo.distance(*self._home, to.latitude, to.longitude)
        if FAR < far <= TOO_FAR:
            yield _warning(f"it is {far:.0f} m from home: the drone may refuse to begin so far away", origin)

    def _go(self, to: Point, origin: int) -> Iterator[Problem]:
        if to.height > self._limits.max_altitude:
            limit = self._limits.max_altitude
            yield _error(f"{to.height:g} m above take-off is higher than the limit of {limit:g} m", origin)
        if to.height < 0.0:
            yield _error(f"{to.height:g} m is below the take-off", origin)
        if self._amsl is not None and self._amsl + to.height > self._figures.ceiling:
            sea = self._amsl + to.height
            yield _error(f"{sea:.0f} m above the sea is higher than an {self._model.title} flies", origin)
        far = geo.distance(*self._home, to.latitude, to.longitude)
        if far > TOO_FAR:
            yield _error(f"it is {far / 1000.0:.1f} km from home, where no setting lets the drone fly", origin)
        elif self._limits.max_distance is not None and far > self._limits.max_distance:
            yield _error(f"it is {far:.0f} m from home, the limit is {self._limits.max_distance:g} m", origin)
        outside = self._fence.leaves(
            (self._here.latitude, self._here.longitude), (to.latitude, to.longitude), self._home
        )
        if outside is not None:
            yield _error(f"the way there leaves the fence ({outside.zone})", origin)
        self._move(to)

    def _move(self, to: Point) -> None:
        along = geo.distance(self._here.latitude, self._here.longitude, to.latitude, to.longitude)
        up = abs(to.height - self._here.height)
        self.distance += math.hypot(along, up)
        self.seconds += max(along / self._speed, up / CLIMB)
        self._here = to

    def battery(self) -> Iterator[Problem]:
        most = self._figures.flight_time
        taken = f"it takes {self.seconds / 60.0:.0f} min of the {most / 60.0:.0f} that an {self._model.title} flies"
        if self.seconds > most:
            yield _error(taken)
        elif self.seconds > most * (1.0 - RESERVE):
            yield _warning(taken)


def _point(item: Item) -> Point:
    latitude, longitude, height = item.params[4:]
    return Point(latitude or 0.0, longitude or 0.0, height or 0.0)


def _first_place(items: tuple[Item, ...]) -> Point | None:
    return next((_point(item) for item in items if item.command == WAYPOINT and item.params[4]), None)
