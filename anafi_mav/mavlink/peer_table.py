"""Places of the clients of one endpoint: which is idle, and which gives way. No I/O."""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

PeerT = TypeVar("PeerT", bound=Hashable)

REPLACEABLE = 5.0
"""s of silence after which a known client gives its place to another when all are taken: four or five missed
heartbeats are a lost link (MAVLink heartbeat.md)."""

PLACES_EVERY = 10.0
"""s between two lines of one kind: each made-up client may cause one."""


class PeerTable(Generic[PeerT]):
    """The clients that have a place, by their silence.

    A client is known when it has proved to be there, or to hold the key. Known clients and others have as many places
    each, so that made-up addresses and connections take none from known clients.
    """

    def __init__(self, places: int, idle_limit: float, heard_at: Callable[[PeerT], float | None]) -> None:
        """`places`: of known clients, and as many of others.

        `idle_limit`: s of silence after which a client loses its place; 0: never. `heard_at` returns when a client was
        heard last; None: never.
        """
        self._places = places
        self._idle_limit = idle_limit
        self._heard_at = heard_at
        self._since: dict[PeerT, float] = {}
        """When each client got its place."""
        self._known: set[PeerT] = set()

    def __len__(self) -> int:
        return len(self._since)

    def __contains__(self, peer: object) -> bool:
        return peer in self._since

    def is_full(self, *, known: bool) -> bool:
        """Return True when all places of known clients, or of others, are taken."""
        return len(self._known if known else self._since.keys() - self._known) >= self._places

    def add(self, peer: PeerT, now: float, *, known: bool) -> None:
        """Give a new client a place, or a known client one of those in place of its other."""
        self._since[peer] = now
        if known:
            self._known.add(peer)

    def remove(self, peer: PeerT) -> None:
        """Free the place of a client. Twice does no harm."""
        self._since.pop(peer, None)
        self._known.discard(peer)

    def silence(self, peer: PeerT, now: float) -> float:
        """Return for how long a client has been silent, s."""
        return now - self._newest(peer)

    def replaceable(self, now: float, *, known: bool) -> PeerT | None:
        """Return the client that gives way to one of its kind: the one silent for longest.

        None when no known client has been silent for long enough. The others give way at once.
        """
        kind = [peer for peer in self._since if (peer in self._known) is known]
        longest = min(kind, key=self._newest, default=None)
        if longest is None or (known and self.silence(longest, now) < REPLACEABLE):
            return None
        return longest

    def idle(self, now: float) -> list[PeerT]:
        """Return the clients that have been silent for longer than the limit."""
        if not self._idle_limit:
            return []
        return [peer for peer in self._since if self.silence(peer, now) > self._idle_limit]

    def _newest(self, peer: PeerT) -> float:
        """Return when a client was heard last, or got its place."""
        since, heard_at = self._since[peer], self._heard_at(peer)
        return since if heard_at is None else max(since, heard_at)


class PlaceLog:
    """Lines in the log about which client has got a place, or none.

    One of each kind in `PLACES_EVERY` s, with the number of those left out: a flood of clients fills no log.
    """

    def __init__(self, logger: logging.Logger, url: str) -> None:
        self._logger = logger
        self._url = url
        self._lines: dict[str, tuple[float, int]] = {}
        """Of each kind: when the next line may be written, and how many were left out."""

    def warn(self, kind: str, text: str, now: float) -> None:
        """Write a line, or count it; `kind`: which lines it counts with."""
        due, left_out = self._lines.get(kind, (now, 0))
        if now < due:
            self._lines[kind] = due, left_out + 1
            return
        self._lines[kind] = now + PLACES_EVERY, 0
        self._logger.warning("%s: %s%s", self._url, text, f" ({left_out} more since the last line)" if left_out else "")
