"""Record of a flown mission, by which a restarted gateway recognises the drone's plan."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import msgspec
from typing_extensions import Self

from anafi_mav.plans.plan import DO_JUMP, Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.vehicle.mission.path import way_points


class MissionRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file on the drone, and what it is of which mission."""

    mission: int
    """Opaque id."""
    uid: str
    """The drone's name of the file."""
    content: str
    origins: tuple[int, ...]
    done: tuple[tuple[int, ...], ...]
    line: int
    """Executed last; -1 for none."""
    next: int | None
    """The item that follows the file, when the gateway has to begin it."""
    jumps: tuple[tuple[int, int], ...] = ()
    """Items that jump, and how often each was done by then."""

    @classmethod
    def of(
        cls, mission: int, uid: str, leg: FlightPlanFile, line: int, following: int | None, jumps: Mapping[int, int]
    ) -> Self:
        return cls(mission, uid, leg.content.decode(), leg.origins, leg.done, line, following, tuple(jumps.items()))

    def flown_up_to(self, item: int, jumps: Mapping[int, int]) -> Self:
        """The same when nothing of the file is left to fly: it goes on at an item."""
        return msgspec.structs.replace(self, line=len(self.origins) - 1, next=item, jumps=tuple(jumps.items()))

    @classmethod
    def read(cls, kept: Any, items: Sequence[Item]) -> Self | None:
        """Return the record that `written` made for this mission; None if it is invalid.

        It may be invalid because people can write files.
        """
        try:
            record = msgspec.convert(kept, cls)
        except msgspec.ValidationError:
            return None
        lines = len(record.content.splitlines()) - 1
        whole = len(record.origins) == len(record.done) == lines > 0 and -1 <= record.line < lines
        named = chain(record.origins, *record.done, [] if record.next is None else [record.next])
        there = all(0 <= item < len(items) for item in named)
        jumped = all(
            0 <= item < len(items) and items[item].command == DO_JUMP and often >= 0 for item, often in record.jumps
        )
        return record if whole and there and jumped and _leads_somewhere(record.leg) else None

    @property
    def written(self) -> Any:
        """As plain JSON values."""
        return msgspec.to_builtins(self)

    @property
    def leg(self) -> FlightPlanFile:
        return FlightPlanFile(self.content.encode(), self.origins, self.done)


def _leads_somewhere(leg: FlightPlanFile) -> bool:
    """All way points are places."""
    try:
        points = [*way_points(leg)]
    except (ValueError, IndexError):
        return False
    return all(
        math.isfinite(one) for point in points for one in (point.place.latitude, point.place.longitude, point.ato)
    )
