"""The flight logs that the drone records, from its web server.

The drone makes one for each flight and lists it after the landing. ARSDK does not report them. They are files of
Parrot's own format, with the places of the flight. Source: GroundSDK (`/api/v1/fdr/lite_records`, HttpFdrClient.java
and FlightLogRestApi.swift).
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from pathlib import Path
from typing import NamedTuple

import msgspec

from anafi_mav.drone.expectation import Commander, loop_time
from anafi_mav.drone.payload.item_list import decode_items
from anafi_mav.drone.payload.media_file import Resource, fetch, file_name
from anafi_mav.drone.payload.media_reader import MediaReader
from anafi_mav.drone.rest import JSON_LIMIT, NotFound, Rest
from anafi_mav.errors import NotSupported

log = logging.getLogger("anafi_mav")

API = "/api/v1/fdr/lite_records"

KEPT = 3.0
"""s that a list is kept: clients request one page by page."""


class FlightLog(msgspec.Struct, frozen=True):
    """One flight log."""

    name: str
    """As "log-1.bin"."""
    date: str = ""
    """ISO 8601 basic, the drone's clock."""
    size: int = 0
    """Bytes."""
    url: str = ""

    @property
    def time(self) -> int:
        """When it was made, s since 1970; 0 when that is not readable."""
        return self.file.time

    @property
    def file(self) -> Resource:
        """The log as a file of the drone's web server."""
        url = self.url if self.url.startswith("/") else f"/{self.url}"
        return Resource(self.name, size=self.size, url=url, datetime=self.date)


class _Listed(NamedTuple):
    """An answer of the drone."""

    logs: tuple[FlightLog, ...]
    time: float
    """Loop time."""
    flying: object
    """The flying state before it was requested."""


_LOG = msgspec.json.Decoder(FlightLog, strict=False)


def _logs(body: bytes) -> tuple[list[FlightLog], int]:
    """Return the logs of a list, and how many are left out. Raises `RemoteProtocolError`."""
    received, unreadable = decode_items(body, _LOG, "flight logs")
    logs = [found for found in received if found.size and found.file.is_usable]
    return logs, unreadable + len(received) - len(logs)


class FlightLogs:
    """The flight logs of one drone, as `drone.flight_logs`.

    Methods raise `NotSupported` when the drone has no such list, `CommandRejected` when its web server refuses,
    `CommandTimeout` and `LinkLost` when it does not answer, `RemoteProtocolError` when the answer is not readable.
    """

    def __init__(self, commander: Commander, rest: Rest, reader: MediaReader, flying: Callable[[], object]) -> None:
        """`reader`: of all files of the drone, for its web server is small.

        `flying`: the flying state. After a landing there is a new log.
        """
        self._commander = commander
        self._rest = rest
        self._reader = reader
        self._flying = flying
        self._requesting = asyncio.Lock()
        self._listed: _Listed | None = None

    async def list(self) -> tuple[FlightLog, ...]:
        """Return the logs of all flights that have ended, oldest first.

        One of unknown size is left out.
        """
        self._commander.require_link()
        async with self._requesting:
            listed = self._listed
            if listed is None or loop_time() - listed.time > KEPT or listed.flying != self._flying():
                flying = self._flying()
                listed = self._listed = _Listed(await self._request(), loop_time(), flying)
            return listed.logs

    async def _request(self) -> tuple[FlightLog, ...]:
        try:
            logs, dropped = _logs(await self._rest.read("GET", API, limit=JSON_LIMIT))
        except NotFound as error:
            raise NotSupported("flight logs") from error
        if dropped:
            log.warning("%s: %d flight logs are not readable and left out", self._commander.name, dropped)
        return tuple(sorted(logs, key=lambda one: (one.time, len(one.name), one.name)))

    async def read(self, log: FlightLog, offset: int, size: int) -> bytes:
        """Return these bytes of a log, which are inside it."""
        self._commander.require_link()
        return await self._reader.read(log.file, offset, size)

    async def read_from(self, log: FlightLog, offset: int = 0) -> AsyncGenerator[bytes, None]:
        """Iterate over the bytes of a log from `offset` on."""
        self._commander.require_link()
        async with aclosing(self._reader.read_from(log.file, offset)) as pieces:
            async for piece in pieces:
                yield piece

    async def download(self, log: FlightLog, directory: Path) -> Path:
        """Download a log to a directory; return its path.

        It has its name only once it is complete.
        """
        self._commander.require_link()
        return await fetch(log.file, directory, self._reader.read_from, None, None)

    async def delete(self, log: FlightLog) -> None:
        """Delete a log on the drone."""
        self._commander.require_link()
        try:
            await self._rest.read("DELETE", f"{API}/{file_name(log.name)}")
        finally:
            self._listed = None
