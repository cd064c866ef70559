"""The drone's photos and videos as a folder of MAVLink FTP.

A file is `<day>/<file>` and is read from the drone while a client reads it. A day is "2026-11-22" by the drone's clock.
Nothing is kept here but checksums: `drone.media` keeps the list and the pieces that were read last.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import aclosing, contextmanager
from dataclasses import dataclass
from typing import TypeVar

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.payload.media import Listing, Resource
from anafi_mav.drone.rest import MediaNotIndexed, NotFound
from anafi_mav.errors import AnafiMavError
from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import MAX_SIZE, Entry, FileError, FileRefused, FileSource

MAX_CHECKSUMS = 64
"""Checksums that are kept: a client compares a day's photos twice at most."""

T = TypeVar("T")


class MediaFolder:
    """All files of one drone."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self._checksums: OrderedDict[Resource, int] = OrderedDict()
        self._listed: tuple[Listing, dict[str, Sequence[Entry]]] | None = None
        """The last list, and the entries of its directories that a client has requested."""
        self._summing = asyncio.Lock()
        """A checksum reads a whole file: one at a time."""

    def list(self, path: str) -> Sequence[Entry] | Awaitable[Sequence[Entry]]:
        return when_listed(self._drone, lambda listing: self._entries(listing, path))

    def _entries(self, listing: Listing, path: str) -> Sequence[Entry]:
        """Return the entries of a directory; a client requests them page by page, so they are kept."""
        if self._listed is None or self._listed[0] is not listing:
            self._listed = (listing, {})
        directories = self._listed[1]
        if path not in directories:
            directories[path] = entries(listing, path, file_entry)
        return directories[path]

    def open(self, path: str) -> FileSource | Awaitable[FileSource]:
        def opened(listing: Listing) -> FileSource:
            resource = find(listing, path)
            if resource.size > MAX_SIZE:
                raise FileRefused(FileError.FAIL, texts.FILE_TOO_LARGE)
            if not resource.size:  # the drone has not reported it, and a client would end at once
                raise FileRefused(FileError.FAIL, texts.FILE_OF_UNKNOWN_SIZE)
            return _OpenFile(self._drone, resource)

        return when_listed(self._drone, opened)

    async def checksum(self, path: str) -> int:
        """Read a whole file, and compare it with the drone's MD5 where the drone has one."""
        with refusing():
            resource = find(await self._drone.media.listing(), path)
            async with self._summing:
                if resource not in self._checksums:
                    self._checksums[resource] = await self._sum(resource)
                    while len(self._checksums) > MAX_CHECKSUMS:
                        self._checksums.popitem(last=False)
                return self._checksums[resource]

    async def _sum(self, resource: Resource) -> int:
        md5 = await self._drone.media.known_md5(resource)
        crc, digest = 0, hashlib.md5(usedforsecurity=False)
        async with aclosing(self._drone.media.read_from(resource)) as pieces:
            async for piece in pieces:
                crc = crc32(piece, crc)
                digest.update(piece)
        if md5 is not None and digest.hexdigest() != md5:
            raise FileRefused(FileError.FAIL, texts.FILE_DAMAGED)
        return crc

    async def remove(self, path: str, may_change: Callable[[], bool]) -> None:
        """Delete a file on the drone. Refused while a camera records or saves.

        Also to a client that may not change anything any longer: the list may take seconds.
        """
        with refusing():
            resource = find(await self._drone.media.listing(), path)
            if (reason := busy(self._drone)) is not None:
                raise FileRefused(FileError.FAIL, texts.REFUSED.fill(what=texts.DELETE, reason=reason))
            if not may_change():
                raise FileRefused(FileError.FILE_PROTECTED)
            await self._drone.media.delete_resource(resource.resource_id)


@dataclass(frozen=True)
class _OpenFile:
    drone: Drone
    resource: Resource

    @property
    def size(self) -> int:
        return self.resource.size

    async def read(self, offset: int, size: int) -> bytes:
        with refusing():
            return await self.drone.media.read(self.resource, offset, size)


def busy(drone: Drone) -> texts.OperatorText | None:
    """Return the reason why media must not be deleted now; None when they may be."""
    cameras = drone.camera.state
    if cameras.is_recording:
        return texts.CAMERA_RECORDS
    return texts.CAMERA_SAVING if cameras.is_taking else None


def when_listed(drone: Drone, then: Callable[[Listing], T]) -> T | Awaitable[T]:
    """Apply `then` to the list of media, at once when it is kept."""
    kept = drone.media.kept_listing
    return _after_listing(drone, then) if kept is None else then(kept)


async def _after_listing(drone: Drone, then: Callable[[Listing], T]) -> T:
    with refusing():
        return then(await drone.media.listing())


def find(listing: Listing, path: str) -> Resource:
    """Return the file at `<day>/<file>`. Raises `FileRefused`."""
    day, _, name = path.partition("/")
    resource = listing.files.get(day, {}).get(name)
    if resource is None:
        raise FileRefused(FileError.FILE_NOT_FOUND)
    return resource


def entries(listing: Listing, path: str, entry: Callable[[Resource], Entry]) -> list[Entry]:
    """Return the days, or the files of a day. Raises `FileRefused`."""
    if not path:
        return [Entry(day, None) for day in listing.files]
    if path not in listing.files:
        raise FileRefused(FileError.FILE_NOT_FOUND)
    return [entry(file) for file in listing.files[path].values()]


def file_entry(file: Resource) -> Entry:
    """Return a file's name, size and time."""
    return Entry(file.resource_id, file.size, file.time)


@contextmanager
def refusing() -> Iterator[None]:
    """Turn the errors of the drone's web server into those of FTP."""
    try:
        yield
    except FileRefused:
        raise
    except AnafiMavError as error:
        if isinstance(error, MediaNotIndexed):
            raise FileRefused(FileError.FAIL, texts.MEDIA_NOT_INDEXED) from error
        if isinstance(error, NotFound):
            raise FileRefused(FileError.FILE_NOT_FOUND) from error
        raise FileRefused(FileError.FAIL, texts.MEDIA_UNAVAILABLE.fill(error=texts.from_below(error))) from error
