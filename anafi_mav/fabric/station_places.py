"""Places for stations: how many at once, and the order of those that wait. No I/O."""

from __future__ import annotations

MAX_WAITING = 256
"""Stations that may wait for a place: more are forgotten until their tokens are listed again."""


class StationPlaces:
    """The stations that are served, and those that wait until another one leaves."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._served: set[str] = set()
        self._waiting: dict[str, None] = {}
        """The oldest is the first."""

    def is_known(self, station: str) -> bool:
        """Return True for a station that is served or waits."""
        return station in self._served or station in self._waiting

    @property
    def has_waiting(self) -> bool:
        """True while a station waits for a place."""
        return bool(self._waiting)

    def arrive(self, station: str) -> bool:
        """Give a station a place; False when all are taken: it waits."""
        if len(self._served) < self._limit:
            self._served.add(station)
            return True
        if len(self._waiting) < MAX_WAITING:
            self._waiting[station] = None
        return False

    def give_way(self, station: str) -> str | None:
        """Let a served station wait, behind those that do; return the one that gets its place."""
        following = self.leave(station)
        if following is not None:
            self._waiting[station] = None
        return following

    def leave(self, station: str) -> str | None:
        """Forget a station; return the one that gets its place, if there is one.

        It is the one that has waited longest.
        """
        self._waiting.pop(station, None)
        self._served.discard(station)
        if not self._waiting or len(self._served) >= self._limit:
            return None
        following = next(iter(self._waiting))
        del self._waiting[following]
        self._served.add(following)
        return following
