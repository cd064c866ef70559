"""`QGC WPL 110`, the text format of MAVProxy, Mission Planner and pymavlink.

One line for each item, twelve columns between tabs. Item 0 of a mission is home, as in an ArduPilot (QGroundControl
MissionController.cc reads it so); a first item that is no NAV_WAYPOINT is not home. A file whose items are all of a
fence, or all rally points, is one of those: MAVProxy keeps them so. 120 in the first line is Parrot's, see `parrot`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Decimal

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats.lists import fence_items, points_of, rally_items, zones_of
from anafi_mav.plans.plan import (
    GLOBAL,
    HEADED,
    MAX_ITEMS,
    NORTH,
    WAYPOINT,
    Item,
    Loss,
    Params,
    Plan,
    Point,
    shifted,
    with_heading,
    without_zero_heading,
)
from anafi_mav.units import counted

HEADER = "QGC WPL 110"

COLUMNS = 12

LONGEST = 20
"""Digits of a whole number. Python converts no more than 4300."""

UNSET = "NaN"
"""As .NET spells it. Mission Planner drops a line with any other spelling and loads the others (its FlightPlanner.cs
reads each with double.Parse, and shows "Line invalid"), Python's readers take all."""

_FENCE = range(mav_enums.MAV_CMD_NAV_FENCE_RETURN_POINT, mav_enums.MAV_CMD_NAV_FENCE_RETURN_POINT + 6)
_RALLY = (mav_enums.MAV_CMD_NAV_RALLY_POINT,)


def rows(text: str, source: str) -> list[Item]:
    """Return the items of a file in the sequence of its lines; the first line is not checked.

    Raises `PlanError`.
    """
    lines = [line for line in text.splitlines()[1:] if line.strip() and not line.startswith("#")]
    if len(lines) > MAX_ITEMS + 1:
        raise PlanError(source, f"{len(lines)} items are more than {MAX_ITEMS}")
    return [_row(number, line.split(), source) for number, line in enumerate(lines)]


def _row(number: int, words: list[str], source: str) -> Item:
    if len(words) != COLUMNS:
        raise PlanError(source, f"{len(words)} columns, expected {COLUMNS}", number)
    whole = []
    for column, name, top in ((2, "frame", 0xFF), (3, "command", 0xFFFF), (11, "autocontinue", 1)):
        word = words[column]
        if not (word.isascii() and word.isdigit() and len(word) <= LONGEST and int(word) <= top):
            raise PlanError(source, f"{word[:20]!r} is no {name}", number)
        whole.append(int(word))
    numbers = [_number(word, number, source) for word in words[4:11]]
    frame, command, autocontinue = whole
    return Item(command, frame, _params(numbers), autocontinue == 1)


def _params(numbers: list[float | None]) -> Params:
    one, two, three, four, five, six, seven = numbers
    return one, two, three, four, five, six, seven


def _number(word: str, item: int, source: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        value = math.inf
    if math.isinf(value) or not word.isascii():
        raise PlanError(source, f"{word[:20]!r} is no number", item)
    return None if math.isnan(value) else value


def text_of(header: str, items: list[Item], current: int | None = 0, unset: str = UNSET) -> bytes:
    """Return a file of these items.

    `current` is the one that is marked, `unset` stands for a value that is not set.
    """
    lines = [header]
    for number, item in enumerate(items):
        numbers = "\t".join(_decimals(item.params, unset))
        head = f"{number}\t{int(number == current)}\t{item.frame}\t{item.command}"
        lines.append(f"{head}\t{numbers}\t{int(item.autocontinue)}")
    return ("\n".join(lines) + "\n").encode()


def _decimals(values: Iterable[float | None], unset: str) -> list[str]:
    """All digits that make the same numbers again, and no exponent: not every reader knows them."""
    digits = [unset if value is None else repr(float(value)) for value in values]
    return [format(Decimal(text), "f") if "e" in text else text for text in digits]


def read(text: str, source: str) -> Plan:
    """The plan in a file. Raises `PlanError`."""
    items = rows(text, source)
    if items and all(item.command in _FENCE for item in items):
        zones, back = zones_of(items, source)
        return Plan(zones=zones, breach_return=back)
    if items and all(item.command in _RALLY for item in items):
        return Plan(rally=points_of(items, source))
    if not items or items[0].command != WAYPOINT:
        return Plan(tuple(_without_zeros(items)))
    first, *rest = items
    latitude, longitude, height = first.params[4:]
    home = None
    if latitude is not None and longitude is not None and (latitude, longitude) != (0.0, 0.0):
        home = Point(latitude, longitude, height or 0.0)
    return Plan(tuple(shifted(item, -1) for item in _without_zeros(rest)), home)


def _without_zeros(items: list[Item]) -> list[Item]:
    """Read headings of 0 as not set, unless an item has another heading.

    Mission Planner and an ArduPilot's MAVProxy write 0 in every line. With such headings the drone would fly a survey
    sideways, its nose to the north.
    """
    if not {item.params[3] for item in items if item.command in HEADED} <= {0.0, NORTH}:
        return items
    return [without_zero_heading(item) for item in items]


def _with_north(items: tuple[Item, ...]) -> list[Item]:
    """Write headings of 0 as 360 where they would be read as not set."""
    if not {item.params[3] for item in items if item.command in HEADED} <= {0.0, NORTH}:
        return [*items]
    return [with_heading(item, NORTH) if item.command in HEADED else item for item in items]


def write(plan: Plan) -> tuple[bytes, list[Loss]]:
    """A file of the plan's mission, or of its fence or rally points if it has nothing else."""
    losses: list[Loss] = []
    if plan.items or not (plan.zones or plan.rally):
        home = plan.home or Point(0.0, 0.0)
        first = Item(WAYPOINT, GLOBAL, (0.0, 0.0, 0.0, 0.0, home.latitude, home.longitude, home.height))
        data = text_of(HEADER, [first, *(shifted(item, 1) for item in _with_north(plan.items))])
        if plan.zones or plan.breach_return:
            losses.append(Loss(f"the fence of {counted(len(plan.zones), 'zone')}: a file of its own would hold it"))
        if plan.rally:
            losses.append(Loss(f"{counted(len(plan.rally), 'rally point')}: a file of their own would hold them"))
    else:
        data = text_of(HEADER, fence_items(plan) if plan.zones else rally_items(plan))
        if plan.zones and plan.rally:
            losses.append(Loss(f"{counted(len(plan.rally), 'rally point')}: a file of their own would hold them"))
        if plan.home is not None:
            losses.append(Loss("the planned home"))
    return data, losses + editor_losses(plan)


def editor_losses(plan: Plan) -> list[Loss]:
    """Return the losses of data that only QGroundControl's own format holds."""
    losses = [
        Loss(f"the {block.kind} of {block.count} items from here on can no longer be edited as one", block.first)
        for block in plan.blocks
    ]
    if plan.hover_speed is not None or plan.cruise_speed is not None:
        losses.append(Loss("the speeds that the planner assumed"))
    return losses
