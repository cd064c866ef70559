"""Record of a flown mission, by which a restarted gateway recognises the drone's plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

import msgspec
from typing_extensions import Self

from anafi_mav.plans.plan import DO_JUMP, Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.vehicle.mission.path import way_points
from anafi_mav.vehicle.mission.progress import MissionProgress


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


class Keeper:
    """Keeps an up-to-date record of the plan that the drone flies.

    Also while the gateway is at an item behind the drone's file.
    """

    def __init__(self) -> None:
        self.write: Callable[[MissionRecord | None], None] = lambda record: None
        """Takes what is to be remembered from now on."""
        self._kept: MissionRecord | None = None

    def found(self, record: MissionRecord) -> None:
        """This was remembered by another run."""
        self._kept = record

    def forget(self) -> None:
        """Another run has nothing to know."""
        self._kept = None
        self.write(None)

    def keep(self, mission: int, uid: str, progress: MissionProgress, following: int | None) -> None:
        """Remember how far a mission is.

        `following` is the item behind the file that the drone flies.
        """
        if progress.leg is not None:
            self._kept = MissionRecord.of(mission, uid, progress.leg, progress.line, following, progress.jumps)
        elif self._kept is not None:
            self._kept = self._kept.flown_up_to(progress.current, progress.jumps)
        else:
            return
        self.write(self._kept)


def _leads_somewhere(leg: FlightPlanFile) -> bool:
    """All way points are places."""
    try:
        points = [*way_points(leg)]
    except (ValueError, IndexError):
        return False
    return all(
        math.isfinite(one) for point in points for one in (point.place.latitude, point.place.longitude, point.ato)
    )
