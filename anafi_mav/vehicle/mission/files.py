"""The files of missions on a drone: uploaded once, known by what is in them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.errors import CommandRejected
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.vehicle.mission.path import lines_of

MAX_FILES = 16
"""Files that are remembered; the drone keeps more, and one that is forgotten is uploaded again."""


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
