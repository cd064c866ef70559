"""What is kept of a mission that is flown, so that another run of the gateway knows the drone's plan again."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import Any

import msgspec
from typing_extensions import Self

from anafi_mav.plans.translate import Leg


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file on the drone, and what it is of which mission."""

    mission: int
    """Opaque id."""
    uid: str
    """What the drone calls the file."""
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
    def of(cls, mission: int, uid: str, leg: Leg, line: int, following: int | None, jumps: Mapping[int, int]) -> Self:
        return cls(mission, uid, leg.content.decode(), leg.origins, leg.done, line, following, tuple(jumps.items()))

    @classmethod
    def read(cls, kept: Any) -> Self | None:
        """What `written` made; None when it is anything else: people can write files."""
        try:
            record = msgspec.convert(kept, cls)
        except msgspec.ValidationError:
            return None
        lines = len(record.content.splitlines()) - 1
        sound = len(record.origins) == len(record.done) == lines and -1 <= record.line < lines
        numbers = chain(record.origins, *record.done, *record.jumps, [record.next or 0])
        return record if sound and min(numbers) >= 0 else None

    @property
    def written(self) -> Any:
        """As plain JSON values."""
        return msgspec.to_builtins(self)

    @property
    def leg(self) -> Leg:
        return Leg(self.content.encode(), self.origins, self.done)
