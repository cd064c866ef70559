"""Translation of a mission to Parrot's files and to items that the gateway flies itself.

`examine` judges a mission when it is uploaded; `translate` writes the files when it begins. The translation of each
command is in the table of `rules`; `flight_plan_writer` writes the lines; this module follows the
items, with their jumps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats.parrot import Version
from anafi_mav.plans.plan import DO_JUMP, GLOBAL, GLOBAL_INT, Item, Loss
from anafi_mav.plans.rules.flight_plan_writer import FlightPlanWriter
from anafi_mav.plans.rules.parts import (
    FaultKind,
    FlightPlanFile,
    GatewayStep,
    ItemSettings,
    Start,
    TranslationFault,
    TranslationRefused,
)
from anafi_mav.plans.rules.rule import Fidelity, Rule
from anafi_mav.plans.rules.rules import TABLE

__all__ = [
    "Course",
    "Cursor",
    "FaultKind",
    "Fidelity",
    "FlightPlanFile",
    "GatewayStep",
    "Start",
    "TranslatedMission",
    "TranslationFault",
    "TranslationReport",
    "examine",
    "translate",
]

MAX_LINES = 2000
"""Lines that are written at once: more than a battery flies, and a file of some 100 kB."""

MAX_VISITS = 20_000
"""Items that are examined for that, again in each pass of a loop: many may need no line."""

MAX_IDLE = 100
"""Items, beyond twice those of the mission, that may come one after the other in loops without anything being flown or
photographed: what they set has been set by then."""

_ENDLESS = -1.0
MAX_JUMPS = 0xFFFF
"""Of a mission, those without end not counted: each is a turn of a loop here, and no battery flies so many."""


@dataclass(frozen=True)
class TranslationReport:
    """Result of examining a mission for a drone when it is uploaded."""

    faults: tuple[TranslationFault, ...]
    """Not empty: it is refused."""
    approximations: tuple[Loss, ...]
    stepped: tuple[Loss, ...]
    """Items that the gateway itself flies, and why; not empty: the mission stops where the gateway does."""


@dataclass(frozen=True)
class Cursor:
    """Position in a mission at which a flight continues that was too long to be written at once."""

    item: int
    jumps: tuple[tuple[int, int], ...]
    """Item of a jump, and how often it was taken."""
    settings: ItemSettings
    restarts: bool = False
    """True when photos and videos of the settings are started again."""


@dataclass(frozen=True)
class TranslatedMission:
    """Translated flight: its parts and its remaining items."""

    parts: tuple[FlightPlanFile | GatewayStep, ...]
    """Empty when nothing is to be done, such as a take-off in the air."""
    notes: tuple[Loss, ...]
    """Differences from the mission."""
    rest: Cursor | None
    """Cursor for the next `translate` after the parts have been flown; None at the end of the mission."""
    done: tuple[int, ...] = ()
    """Items completed before anything is flown, if there are no parts. Otherwise the parts list them."""


@dataclass(frozen=True)
class Course:
    """The remaining parts of a mission, beginning with the one that is flown."""

    parts: tuple[FlightPlanFile | GatewayStep, ...] = ()
    rest: Cursor | None = None
    """Where the mission continues behind the parts, when it was too long to be laid out at once."""
    later: int | None = None
    """The item behind all this, which is not flown without a client's command."""

    @property
    def over(self) -> bool:
        """True when no remaining part starts by itself."""
        return not self.parts and self.rest is None

    @property
    def stepped(self) -> bool:
        """The gateway flies some of it, or begins the next file."""
        return len(self.parts) > 1 or self.rest is not None or any(isinstance(part, GatewayStep) for part in self.parts)

    @property
    def first(self) -> int | None:
        """The item that the first part begins with; None when no part starts by itself."""
        if self.parts:
            return _item_of(self.parts[0])
        return None if self.rest is None else self.rest.item

    @property
    def following(self) -> int | None:
        """The item behind the part that is flown; None: nothing follows."""
        if len(self.parts) > 1:
            return _item_of(self.parts[1])
        return self.later if self.rest is None else self.rest.item

    def without_first(self) -> Course:
        """Return the course once its first part is flown."""
        return replace(self, parts=self.parts[1:])

    def ending_with_this_part(self) -> Course:
        """Return the course of a drone without a link: its file. The parts behind it do not start."""
        return Course(self.parts[:1], later=self.following)


def _item_of(part: FlightPlanFile | GatewayStep) -> int:
    """Return the item that a part begins with."""
    return part.item if isinstance(part, GatewayStep) else part.origins[0]


def examine(items: Sequence[Item], version: Version) -> TranslationReport:
    """Return the faults and approximations of a mission for drones of this version."""
    faults, said = _judged(items, version)
    faults = faults or _wrong_ways(items, version)
    if faults:
        return TranslationReport(tuple(faults), (), ())
    place = next((item.params for item in items if TABLE[item.command].place and item.params[4]), None)
    latitude, longitude = (0.0, 0.0) if place is None else (place[4] or 0.0, place[5] or 0.0)
    start = Start(latitude, longitude, 0.0, flying=not _way_up(items, 0, {}), takeoff_amsl=0.0, is_assumed=True)
    try:
        flight = _fly(items, version, start, Cursor(0, (), ItemSettings()))
    except TranslationRefused as error:  # by what came before it on the way, which is not what stands before it
        return TranslationReport((error.fault,), (), ())
    flown = _reached(items) if flight.rest else {*flight.done, *chain(*map(_done, flight.parts))}
    never = [Loss("never reached", number) for number in range(len(items)) if number not in flown]
    # Of a long mission, only the beginning has been flown here.
    notes = dict.fromkeys([*flight.notes, *(loss for loss in said if flight.rest and loss.item in flown), *never])
    return TranslationReport((), tuple(notes), tuple(_stepped(items, flown, flight)))


def _done(part: FlightPlanFile | GatewayStep) -> Iterator[int]:
    return chain(*part.done) if isinstance(part, FlightPlanFile) else iter(part.done)


def translate(
    items: Sequence[Item],
    version: Version,
    start: Start,
    first: int | Cursor = 0,
    jumps: Mapping[int, int] | None = None,
) -> TranslatedMission:
    """Write what is flown from an item on, or from where another flight ended.

    `jumps` are items that jump, and how often they have when it begins at an item.

    What items before `first` have set holds, and photos and videos that they began and did not end are begun. Raises
    `PlanError` for what `examine` finds wrong, and when heights above mean sea level cannot be had.
    """
    wrong = _judged(items, version)[0] or _wrong_ways(items, version)
    if wrong:
        raise PlanError("mission", wrong[0].reason, wrong[0].item)
    try:
        cursor = first if isinstance(first, Cursor) else _cursor(items, version, start, first, jumps or {})
        return _fly(items, version, start, cursor)
    except TranslationRefused as error:
        raise PlanError("mission", error.fault.reason, error.fault.item) from None


# What is wrong with it.


def _judged(items: Sequence[Item], version: Version) -> tuple[list[TranslationFault], list[Loss]]:
    """Judge each item by itself, after the items before it in the list.

    Returns at most one fault of each item, and the parts that are left out.
    """
    writer = FlightPlanWriter(version, Start(0.0, 0.0, 0.0, flying=True, takeoff_amsl=0.0, is_assumed=True), items)
    writer.muted = True
    faults = []
    for writer.item, item in enumerate(items):
        fault = _wrong_item(writer, item, len(items))
        if fault is not None:
            faults.append(fault)
    writer.end_modes()
    return faults, list(writer.notes)


def _wrong_item(writer: FlightPlanWriter, item: Item, count: int) -> TranslationFault | None:
    row = TABLE.get(item.command)
    if row is None or row.verdict is Fidelity.REFUSED:
        name = Rule(item.command, Fidelity.REFUSED, "").name
        return TranslationFault(
            writer.item, f"{name}: {row.why if row else 'unsupported in flight plans'}", FaultKind.COMMAND
        )
    for number, value in enumerate(item.params, 1):
        if value is not None and not math.isfinite(value):
            return TranslationFault(writer.item, f"param{number} is not a number", FaultKind.PARAM, number)
    if not item.autocontinue:
        return TranslationFault(writer.item, "autocontinue 0 is unsupported", FaultKind.COMMAND)
    if item.command == DO_JUMP:
        return _wrong_jump(writer.item, item, count)
    try:
        _write(writer, item)
    except TranslationRefused as error:
        return error.fault
    return None


def _write(writer: FlightPlanWriter, item: Item) -> None:
    row = TABLE[item.command]
    assert row.write is not None, "what is not refused is written"
    try:
        row.write(writer, item)
    except TranslationRefused as error:
        raise TranslationRefused(replace(error.fault, reason=f"{row.name}: {error.fault.reason}")) from None


def _wrong_jump(number: int, item: Item, count: int) -> TranslationFault | None:
    target, often = item.params[:2]
    if target is None or not target.is_integer() or not 0 <= target < count:
        return TranslationFault(number, "jump target does not exist", FaultKind.PARAM, 1)
    if often is None or not often.is_integer() or not _ENDLESS <= often <= MAX_JUMPS:
        reason = "no jump count" if often is None else f"invalid jump count {often:g}"
        return TranslationFault(number, reason, FaultKind.PARAM, 2)
    return None


def _wrong_ways(items: Sequence[Item], version: Version) -> list[TranslationFault]:
    """Return the faults that no single item has by itself."""
    if not items:
        return []
    ways = _reached(items)
    faults = []
    if sum(max(item.params[1] or 0.0, 0.0) for item in items if item.command == DO_JUMP) > MAX_JUMPS:
        last = max(number for number, item in enumerate(items) if item.command == DO_JUMP)
        faults.append(TranslationFault(last, f"more than {MAX_JUMPS} jumps in the mission", FaultKind.PARAM, 2))
    for number, item in enumerate(items):
        if item.command == mav_enums.MAV_CMD_NAV_LAND and number in ways:
            after = next((other for other in range(number + 1, len(items)) if other not in ways), None)
            if after is not None:
                faults.append(TranslationFault(after, "follows a landing, which ends the plan", FaultKind.PLAN))
                break
    if not any(TABLE[items[number].command].moves for number in ways):
        faults.append(TranslationFault(0, "no item moves the drone", FaultKind.PLAN))
    for loop in _endless(items, ways):
        if not _flies(items, version, loop):
            last = max(number for number in loop if items[number].command == DO_JUMP)
            faults.append(TranslationFault(last, "endless loop, no flight", FaultKind.PLAN))
    return faults


def _endless(items: Sequence[Item], ways: set[int]) -> Iterator[list[int]]:
    """Yield the endless loops, each as the items from one of them round to it.

    A flight stays in one of them when all jump counts are used.
    """
    walks: dict[int, int] = {}
    """Items that were come by, and on which walk."""
    for start in sorted(ways):
        number = start
        while number < len(items) and number not in walks:
            walks[number] = start
            number = _after(items, number)
        if walks.get(number) != start:
            continue  # it ended, or has come to where another walk was
        loop = [number]
        while (following := _after(items, loop[-1])) != number:
            loop.append(following)
        yield loop


def _after(items: Sequence[Item], number: int) -> int:
    """The item that follows one for good."""
    item = items[number]
    if item.command == DO_JUMP and item.params[1] == _ENDLESS:
        return int(item.params[0] or 0.0)
    return len(items) if TABLE[item.command].ends else number + 1


def _flies(items: Sequence[Item], version: Version, loop: Sequence[int]) -> bool:
    """Something of a loop takes its time. The first turn leads to where the second begins."""
    writer = FlightPlanWriter(version, Start(0.0, 0.0, 0.0, flying=True, takeoff_amsl=0.0), items)
    for turn in range(2):
        before = writer.flown
        for writer.item in loop:
            if TABLE[items[writer.item].command].moves:
                _write(writer, items[writer.item])
            if turn and writer.flown > before:
                return True
    return False


def _reached(items: Sequence[Item]) -> set[int]:
    """The items that could ever be flown; a count that is used up may keep some from it."""
    reached: set[int] = set()
    open_ways = [0]
    while open_ways:
        number = open_ways.pop()
        if number in reached or number >= len(items):
            continue
        reached.add(number)
        item = items[number]
        if item.command == DO_JUMP and item.params[1] != 0.0:
            open_ways.append(int(item.params[0] or 0.0))
            if item.params[1] == _ENDLESS:
                continue
        if not TABLE[item.command].ends:
            open_ways.append(number + 1)
    return reached


def _stepped(items: Sequence[Item], flown: set[int], flight: TranslatedMission) -> Iterator[Loss]:
    for number in sorted(flown):
        row = TABLE[items[number].command]
        if row.verdict is Fidelity.STEPPED:
            yield Loss(f"{row.name}: {row.why}", number)
    if flight.rest is not None:
        jumps = [number for number, item in enumerate(items) if item.command == DO_JUMP and item.params[1]]
        what = f"flown in files of {MAX_LINES} lines"
        yield Loss(f"{what} because of the jump" if jumps else what, max(jumps) if jumps else None)


# The way through it.


def _cursor(items: Sequence[Item], version: Version, start: Start, first: int, jumps: Mapping[int, int]) -> Cursor:
    """Return the cursor at an item, with the settings of all items before it.

    In a later turn of a loop these are also the items behind it, up to the jump.
    """
    if not 0 <= first < len(items):
        raise PlanError("mission", f"the mission has {len(items)} items", first)
    writer = FlightPlanWriter(version, start, items)
    writer.muted = True
    before = [*range(first)]
    back = [
        n for n, often in jumps.items() if often and first <= n < len(items) and (items[n].params[0] or 0.0) <= first
    ]
    if back:
        before = [*range(max(back)), *range(int(items[max(back)].params[0] or 0.0), first)]
    for writer.item in before:
        if items[writer.item].command != DO_JUMP:
            _write(writer, items[writer.item])
    return Cursor(first, tuple(sorted(jumps.items())), writer.settings, restarts=True)


def _fly(items: Sequence[Item], version: Version, start: Start, cursor: Cursor) -> TranslatedMission:
    writer = FlightPlanWriter(version, start, items, cursor.settings)
    writer.films_again = cursor.restarts
    jumps = dict(cursor.jumps)
    index, visits, busy, lively = cursor.item, 0, 0, 0
    """`busy`: what has been flown and photographed by then, and `lively`: when it became more."""
    if not start.flying and items:
        _rise(writer, items, _way_up(items, index, jumps), index)
    while index < len(items) and writer.written < MAX_LINES and visits < MAX_VISITS:
        item, writer.item = items[index], index
        row = TABLE[item.command]
        following = index + 1
        visits += 1
        if writer.flown + writer.photographed > busy:
            busy, lively = writer.flown + writer.photographed, visits
        if item.command == DO_JUMP:
            target, often = int(item.params[0] or 0.0), item.params[1]
            if often == _ENDLESS:
                following = target
            elif jumps.get(index, 0) < (often or 0.0):
                if visits - lively > 2 * len(items) + MAX_IDLE:
                    writer.refuse("loop without flight", kind=FaultKind.PLAN)
                jumps[index], following = jumps.get(index, 0) + 1, target
        else:
            if row.verdict is Fidelity.STEPPED:
                writer.step()
            _write(writer, item)
        writer.finish()
        index = len(items) if row.ends else following
    writer.close()
    if index >= len(items):
        writer.end_modes()
    rest = Cursor(index, tuple(sorted(jumps.items())), writer.settings) if index < len(items) else None
    return TranslatedMission(
        tuple(writer.parts), tuple(writer.notes), rest, () if writer.parts else tuple(writer.waiting)
    )


def _way_up(items: Sequence[Item], first: int, jumps: Mapping[int, int]) -> Sequence[int]:
    """Return the items flown up to the one that says how high to rise from the ground.

    They begin with `first`; each is listed once. Empty when there is nowhere to fly to. Jumps are followed as in
    flight, each once.
    """
    way: dict[int, None] = {}
    passed: dict[int, int] = {}
    """Items that lead on from now on, and a later item that they lead to: a long way is not walked again and again."""
    number = first
    while number < len(items):
        item, row = items[number], TABLE[items[number].command]
        is_again = number in way
        way[number] = None
        if item.command == mav_enums.MAV_CMD_NAV_TAKEOFF or row.place:
            return [*way]
        is_endless = item.command == DO_JUMP and item.params[1] == _ENDLESS
        if row.ends or (is_endless and is_again):
            return ()
        following = number + 1
        if not is_endless:
            passed[number] = following
        if is_endless or (item.command == DO_JUMP and jumps.get(number, 0) < (item.params[1] or 0.0)):
            following = int(item.params[0] or 0.0)
        number = _behind(passed, following)
    return ()


def _behind(passed: dict[int, int], number: int) -> int:
    """Return the first item from a number on that has not been passed; shorten the way to it."""
    while (later := passed.get(number)) is not None:
        passed[number] = passed.get(later, later)
        number = later
    return number


def _height_named(item: Item, height: float) -> str:
    """Return an item's height with its reference.

    `height` is m above take-off. That of an item above mean sea level is unknown to `examine`, so the item's own
    number stands for it.
    """
    named = item.params[6]
    if item.frame in (GLOBAL, GLOBAL_INT) and named is not None:
        return f"{named:g} m AMSL"
    return f"{height:g} m above take-off"


def _rise(writer: FlightPlanWriter, items: Sequence[Item], way: Sequence[int], first: int) -> None:
    """Write the take-off from the ground.

    Without an item that takes off, the drone climbs straight up to the height of the first way point. `way` leads
    there from `first`.
    """
    writer.item = first
    if not way:
        raise PlanError("mission", "no place to fly to from the ground", first)
    number = way[-1]
    if items[number].command == mav_enums.MAV_CMD_NAV_TAKEOFF:
        if any(TABLE[items[before].command].moves for before in way[:-1]):
            writer.say("the drone takes off first")
        writer.take_off(None)
        return
    writer.item = number
    there = writer.destination(items[number])
    climbs = there.height > writer.place.height
    writer.say(
        f"no take-off item: the drone climbs to {_height_named(items[number], there.height)} first"
        if climbs
        else "no take-off item"
    )
    writer.item = first
    writer.take_off(replace(writer.place, height=there.height) if climbs else None)
