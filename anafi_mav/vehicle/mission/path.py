"""Turns a mission into files, from the drone's position on; checks and uploads them.

The check reads the lines of the files, because those are flown. A file is uploaded once, and known by its content.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from anafi_mav import geo, mav_enums, texts
from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.errors import CommandRejected, PlanError
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import Cursor, FlightPlanFile, GatewayStep, Start, translate
from anafi_mav.units import DEG_PER_RAD
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import LOWEST, check_estimate, check_limits, check_place
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity

BREATH = 20
"""Way points after which others get their turn: a large polygon takes a while."""

PANORAMA_SPEED = 30.0
"""deg/s of a panorama that names no speed. Assumed, as Parrot does not document it."""

ACCEPTANCE = 5.0
"""m around a way point that names no radius (Parrot's flight plan page)."""

MAX_FILES = 16
"""Files that are remembered; the drone keeps more, and one that is forgotten is uploaded again."""

REMEMBERED = 256
"""Next way points that are remembered: telemetry asks for each of them several times a second."""

AWAY = 10.0
"""m from the drone's place to that of a take-off item, more than an error of GPS at the same place."""

_AMSL_FRAMES = (mav_enums.MAV_FRAME_GLOBAL, mav_enums.MAV_FRAME_GLOBAL_INT)

_COMMAND, _PARAM1, _RADIUS, _LATITUDE, _LONGITUDE, _HEIGHT = 3, 4, 5, 8, 9, 10
"""Columns of a line (arsdk.md §3.3, Parrot's flight plan page)."""


@dataclass(frozen=True)
class WayPoint:
    """One that a file leads to."""

    item: int
    """Of the mission."""
    place: GeoPoint
    ato: float
    """m above the take-off point."""
    radius: float
    """m around it that count as reached."""


def _start(vehicle: Aircraft) -> Start:
    """Return the state of the drone at the start of the flight."""
    state, place, amsl = vehicle.drone.piloting.state, vehicle.place, vehicle.height.ato(0.0)
    if place is None:
        raise Refused(texts.MISSION, texts.NO_FIX)
    flies = vehicle.in_air or vehicle.descent is not None  # a landing is ended before a mission begins
    if flies and state.altitude is None:
        raise Refused(texts.MISSION, texts.HEIGHT_UNKNOWN)
    return Start(
        place.latitude,
        place.longitude,
        (state.altitude or 0.0) if flies else 0.0,
        flying=flies,
        takeoff_amsl=None if amsl is None else -amsl,
        heading=0.0 if state.attitude is None else state.attitude.yaw * DEG_PER_RAD % 360.0,
    )


async def lay_out(
    vehicle: Aircraft, items: Sequence[Item], first: int | Cursor, jumps: Mapping[int, int] | None = None
) -> tuple[list[FlightPlanFile | GatewayStep], Cursor | None]:
    """Return the parts flown from an item on, starting at the drone's position, and the rest.

    Raises `Refused`.

    `jumps`: how often which jump was taken before. In a thread: 5 000 items take half a second.
    """
    start, version = _start(vehicle), vehicle.drone.flight_plan.version
    try:
        flight = await asyncio.to_thread(translate, items, 1 if version == 1 else 2, start, first, {**(jumps or {})})
    except PlanError as error:
        what = texts.MISSION if error.item is None else texts.ITEM.fill(number=error.item + texts.FIRST_LABEL)
        raise Refused(what, texts.from_below(error.problem)) from error
    if not flight.parts:
        raise Refused(texts.MISSION, texts.MISSION_OVER)
    _check_estimates(vehicle, items, flight.parts)
    return [*flight.parts], flight.rest


def _check_estimates(vehicle: Aircraft, items: Sequence[Item], parts: Sequence[FlightPlanFile | GatewayStep]) -> None:
    """Raise `Refused` if an item's AMSL height may be below ground because AMSL is an estimate."""
    if not vehicle.height.estimated:
        return
    for part in parts:
        for point in way_points(part) if isinstance(part, FlightPlanFile) else ():
            if items[point.item].frame in _AMSL_FRAMES:
                try:
                    check_estimate(vehicle, point.ato)
                except Refused as error:
                    raise Refused(texts.ITEM.fill(number=point.item + texts.FIRST_LABEL), error.reason) from error


def lines_of(leg: FlightPlanFile) -> list[str]:
    """The lines of a file without its first and without their numbers."""
    return [line.split("\t", 1)[-1] for line in leg.content.decode().splitlines()[1:]]


def way_points(leg: FlightPlanFile, after: int = -1) -> Iterator[WayPoint]:
    """Yield the way points of the lines after one of them.

    All heights are above take-off: the translation writes no others.
    """
    lines = leg.content.decode().splitlines()[1:]
    for line, item in zip(lines[after + 1 :], leg.origins[after + 1 :], strict=False):
        columns = line.split("\t")
        if int(columns[_COMMAND]) == mav_enums.MAV_CMD_NAV_WAYPOINT:
            place = GeoPoint(float(columns[_LATITUDE]), float(columns[_LONGITUDE]))
            radius = float(columns[_RADIUS])
            yield WayPoint(item, place, float(columns[_HEIGHT]), radius if radius > 0.0 else ACCEPTANCE)


def seconds_of_last_line(leg: FlightPlanFile) -> float:
    """Return the duration of a file's last line, s; 0 unless it is a wait or a panorama."""
    columns = lines_of(leg)[-1].split("\t")
    one, two, three, four = map(float, columns[_PARAM1 - 1 : _PARAM1 + 3])
    match int(columns[_COMMAND - 1]):
        case mav_enums.MAV_CMD_NAV_DELAY | mav_enums.MAV_CMD_CONDITION_DELAY:
            return one
        case mav_enums.MAV_CMD_PANORAMA_CREATE:
            turns = ((one, three), (two, four))
            return max(abs(angle) / (speed if speed > 0.0 else PANORAMA_SPEED) for angle, speed in turns)
    return 0.0


@functools.lru_cache(maxsize=REMEMBERED)
def next_place(content: bytes, after: int) -> tuple[GeoPoint, float] | None:
    """Return place and height (m above take-off) of the first way point after a line."""
    for line in content.decode().splitlines()[after + 2 :]:
        columns = line.split("\t")
        if int(columns[_COMMAND]) == mav_enums.MAV_CMD_NAV_WAYPOINT:
            return GeoPoint(float(columns[_LATITUDE]), float(columns[_LONGITUDE])), float(columns[_HEIGHT])
    return None


async def check_path(
    vehicle: Aircraft,
    items: Sequence[Item],
    parts: Sequence[FlightPlanFile | GatewayStep],
    after: int = -1,
    *,
    warns: bool = True,
) -> None:
    """Raise `Refused` if a way point, or the straight way to it, is where the drone may not be.

    `items` are the mission, `after` is the line of the first file after which it is flown. A text warns of the lowest
    way point below the height at which an ANAFI hovers by itself, as PX4 does below home: over a slope that falls it is
    meant, elsewhere it is the ground. Another warns of a take-off item whose place is elsewhere: ArduCopter rises
    straight up.
    """
    where, seen, lowest, away = vehicle.place, 0, None, None
    for part in parts:
        if isinstance(part, FlightPlanFile):
            for point in way_points(part, after):
                _check(vehicle, where, point)
                if items[point.item].command == mav_enums.MAV_CMD_NAV_TAKEOFF and point.place != where:
                    away = point
                where, seen = point.place, seen + 1
                lowest = point if lowest is None or point.ato < lowest.ato else lowest
                if seen % BREATH == 0:
                    await asyncio.sleep(0)
        after = -1
    if warns and lowest is not None and lowest.ato < LOWEST:
        item = lowest.item + texts.FIRST_LABEL
        vehicle.text(Severity.WARNING, texts.MISSION_LOW.fill(item=item, height=lowest.ato))
    if warns and away is not None and (here := vehicle.place) is not None:
        metres = geo.distance(here.latitude, here.longitude, away.place.latitude, away.place.longitude)
        if metres > AWAY:
            item = away.item + texts.FIRST_LABEL
            vehicle.text(Severity.WARNING, texts.MISSION_TAKEOFF_AWAY.fill(item=item, metres=metres))


def _check(vehicle: Aircraft, start: GeoPoint | None, point: WayPoint) -> None:
    try:
        check_place(vehicle, point.place, start=start)
        check_limits(vehicle, point.ato)
    except Refused as error:
        raise Refused(texts.ITEM.fill(number=point.item + texts.FIRST_LABEL), error.reason, lasting=True) from error


class FilesOnDrone:
    """The flight-plan files that were uploaded to one drone."""

    def __init__(self, plan: FlightPlan) -> None:
        self._plan = plan
        self._names: dict[bytes, str] = {}
        """By a digest of what is in them, oldest first."""
        self._newest: tuple[FlightPlanFile, str, Sequence[Item]] | None = None
        """With the mission that it was made of."""

    async def beginning_with(self, leg: FlightPlanFile, mission: Sequence[Item]) -> tuple[FlightPlanFile, str, int]:
        """Return the file on the drone that continues with this leg of a mission.

        Returns the file, its name, and the line before the leg. It is uploaded if needed. An Ai can begin in the
        middle of the newest file, when the leg is the end of that file. The other models, and legs before which a
        setting was changed that still holds, get a file of their own. `mission` is the very object that the leg is
        of: the file of another mission has the same lines for other items, so it is never continued in its middle.

        A file of which a start may still begin is uploaded again: the drone's reports name the file alone.
        """
        if self._newest is not None and self._plan.starts_anywhere:
            whole, name, of = self._newest
            line = len(whole.origins) - len(leg.origins) - 1
            if of is mission and line >= 0 and _ends_with(whole, line + 1, leg) and await self._has(name):
                return whole, name, line
        digest = hashlib.sha256(leg.content).digest()
        name = self._names.pop(digest, "")
        if not name or not await self._has(name):
            name = await self._plan.upload(leg.content)
        self._names[digest] = name
        while len(self._names) > MAX_FILES:
            del self._names[next(iter(self._names))]
        self._newest = leg, name, mission
        return leg, name, -1

    async def _has(self, name: str) -> bool:
        try:
            await self._plan.get(name)
        except CommandRejected:
            return False
        return not self._plan.is_undecided(name)  # a start may have been withdrawn meanwhile


def _ends_with(whole: FlightPlanFile, line: int, leg: FlightPlanFile) -> bool:
    """From this line on it is the leg: the same text, which stands for the same items."""
    same = whole.origins[line:] == leg.origins and whole.done[line:] == leg.done
    return same and lines_of(whole)[line:] == lines_of(leg)
