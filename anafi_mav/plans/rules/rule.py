"""Row of the table of commands; the rows are in `rules`."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from anafi_mav import mav_enums
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import Item
from anafi_mav.plans.rules.flight_plan_writer import FlightPlanWriter


class Fidelity(enum.Enum):
    """How a mission's item is flown."""

    EXACT = "as the mission has it; a value that is left out is named in the row, and said at upload"
    APPROXIMATED = "nearly, which is said at upload"
    STEPPED = "by the gateway itself, between two files"
    REFUSED = "not at all: the mission is refused"


Write = Callable[[FlightPlanWriter, Item], None]

_NOTHING = frozenset({None, 0.0})


@dataclass(frozen=True)
class Rule:
    """One command."""

    command: int
    verdict: Fidelity
    how: str
    """Lines that it becomes and values that are refused; or the reason for its verdict."""
    write: Write | None = None
    moves: bool = False
    """It flies, or takes its time."""
    place: bool = False
    """It flies to a place, with a height."""
    ends: bool = False
    """Nothing comes after it."""

    @property
    def why(self) -> str:
        """The first sentence of `how`, as a clause."""
        first = self.how.partition(". ")[0].rstrip(".")
        return first[:1].lower() + first[1:]

    @property
    def name(self) -> str:
        entry = mav_enums.enums["MAV_CMD"].get(self.command)
        known = {SET_VIEW_MODE: "SET_VIEW_MODE", SET_STILL_MODE: "SET_STILL_CAPTURE_MODE"}.get(self.command)
        return known or (f"command {self.command}" if entry is None else entry.name.removeprefix("MAV_CMD_"))


def only(
    writer: FlightPlanWriter, item: Item, number: int, what: str, allowed: frozenset[float | None] = _NOTHING
) -> None:
    """Refuse the item when a parameter is set to what the drone cannot do."""
    value = item.params[number - 1]
    if value not in allowed:
        writer.refuse(f"{what} ({value:g})", number)
