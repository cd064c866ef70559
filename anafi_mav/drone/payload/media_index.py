"""The list of the drone's media, kept until the drone reports a change.

A list of a thousand media takes the drone seconds. Its websocket reports each change; while that is closed, a list is
kept for `UNHEARD` only. The websocket is opened with the first list, because a drone without a web server has none.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from typing import Any, Protocol

import msgspec

from anafi_mav.drone.payload.media_file import Resource
from anafi_mav.errors import AnafiMavError, LinkLost

log = logging.getLogger("anafi_mav")

UNHEARD = 5.0
"""s that a list is kept while the drone's notifications are not received."""

LISTEN_TIMEOUT = 1.0
"""s that the first list waits for the websocket. Olympe gives it 0.5 s, five times."""


SORTED_IN_LOOP = 200
"""Media that are sorted in the event loop, some 100 KB of a list; more in a thread: the loop controls drones."""


class HasFiles(Protocol):
    """The part of a media that is needed here."""

    @property
    def resources(self) -> tuple[Resource, ...]:
        """Its files."""


class ListsMedia(Protocol):
    """The part of a media client that is needed here."""

    async def list(self, *, newest_first: bool = True) -> Sequence[Any]:
        """Return all media."""

    def listen(self) -> AbstractAsyncContextManager[AsyncIterator[object]]:
        """Open the drone's notifications."""


class Listing(msgspec.Struct, frozen=True):
    """All media at one moment."""

    items: tuple[Any, ...]
    """Each is a `MediaItem`, oldest first."""
    files: Mapping[str, Mapping[str, Resource]]
    """The files by day and by name, both sorted."""

    def file(self, name: str) -> Resource | None:
        """Return the file with this name, of any day."""
        return next((day[name] for day in self.files.values() if name in day), None)


class MediaIndex:
    """The listing of one drone."""

    def __init__(self, client: ListsMedia) -> None:
        self._client = client
        self._kept: tuple[Listing, object, float] | None = None
        """The listing, the drone's counters when it was made, and when that was."""
        self._changes = 0
        self._fetching: asyncio.Task[tuple[Listing, int]] | None = None
        """Returns the listing, and `_changes` when it was requested."""
        self._listening: asyncio.Task[None] | None = None
        self._open = False
        """True while the drone's notifications are received."""

    def kept(self, counters: object) -> Listing | None:
        """Return the listing if it is still true; else None.

        `counters` are those that the drone has reported last.
        """
        if self._kept is None:
            return None
        listing, then, made = self._kept
        is_recent = self._open or asyncio.get_running_loop().time() - made < UNHEARD
        return listing if is_recent and counters == then else None

    async def get(self, counters: object) -> Listing:
        """Return the listing, from the drone where it is not kept.

        Simultaneous callers share one request; one from before a change is followed by another.
        """
        changes = self._changes
        while (kept := self.kept(counters)) is None:
            listing, requested_at = await self._fetched(counters)
            if requested_at >= changes:
                return listing
        return kept

    async def _fetched(self, counters: object) -> tuple[Listing, int]:
        """Return the result of the request under way, or of a new one."""
        if self._fetching is None or self._fetching.done():
            self._fetching = asyncio.get_running_loop().create_task(self._fetch(counters))
        fetching = self._fetching
        try:
            return await asyncio.shield(fetching)
        except asyncio.CancelledError:
            if fetching.cancelled():
                raise LinkLost("the drone's link is closed") from None
            raise

    def changed(self) -> None:
        """Forget the listing."""
        self._kept = None
        self._changes += 1

    async def close(self) -> None:
        """Stop listening and forget the listing; waiting callers get `LinkLost`."""
        self.changed()
        tasks = [task for task in (self._fetching, self._listening) if task is not None]
        self._fetching = self._listening = None
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _fetch(self, counters: object) -> tuple[Listing, int]:
        if self._listening is None or self._listening.done():
            opened = asyncio.Event()
            self._listening = asyncio.get_running_loop().create_task(self._listen(opened))
            await asyncio.wait(
                {self._listening, waiting := asyncio.ensure_future(opened.wait())},
                timeout=LISTEN_TIMEOUT,
                return_when=asyncio.FIRST_COMPLETED,
            )
            waiting.cancel()
        changes = self._changes
        items = tuple(await self._client.list(newest_first=False))
        if len(items) < SORTED_IN_LOOP:
            listing = _listing(items)
        else:
            listing = await asyncio.to_thread(_listing, items)
        if self._changes == changes:  # else it may be older than the change
            self._kept = (listing, counters, asyncio.get_running_loop().time())
        return listing, changes

    async def _listen(self, opened: asyncio.Event) -> None:
        try:
            async with self._client.listen() as notifications:
                self.changed()
                self._open = True
                opened.set()
                async for _ in notifications:
                    self.changed()
        except AnafiMavError as error:
            log.debug("no notifications of the media store: %s", error)
        finally:
            self._open = False


def _listing(items: tuple[Any, ...]) -> Listing:
    return Listing(items, by_day([file for item in items for file in item.resources]))


def by_day(files: Sequence[Resource]) -> dict[str, dict[str, Resource]]:
    """Return files by day and name, both sorted."""
    days: dict[str, dict[str, Resource]] = {}
    for file in sorted(files, key=lambda file: (file.date, file.resource_id)):
        days.setdefault(file.date, {})[file.resource_id] = file
    return days
