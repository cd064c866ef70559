"""The small pictures of the drone's photos and videos as a folder: `<day>/<file>.jpg`."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Awaitable, Callable, Sequence

from anafi_mav.drone import Drone
from anafi_mav.drone.payload.media import Listing, Resource
from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import Entry, FileError, FileRefused, MadeFile
from anafi_mav.services.media.media_folder import entries, find, refusing, when_listed

ENDING = ".jpg"

KEPT = 16
"""Thumbnails that are kept, some 30 KB each: a client opens one, reads it in parts and goes on to the next."""


class ThumbnailFolder:
    """The thumbnails of one drone."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self._kept: OrderedDict[Resource, bytes] = OrderedDict()

    def clear(self) -> None:
        """Forget all thumbnails."""
        self._kept.clear()

    def list(self, path: str) -> Sequence[Entry] | Awaitable[Sequence[Entry]]:
        """Return the thumbnails of a day.

        The drone reports no size of a thumbnail: 0 until it was opened.
        """
        return when_listed(self._drone, lambda listing: entries(listing, path, self._entry))

    async def open(self, path: str) -> MadeFile:
        return MadeFile(await self._content(path))

    async def checksum(self, path: str) -> int:
        return crc32(await self._content(path))

    def remove(self, path: str, may_change: Callable[[], bool]) -> None:
        """Refuse: a thumbnail goes with its file."""
        raise FileRefused(FileError.FILE_PROTECTED)

    async def _content(self, path: str) -> bytes:
        with refusing():
            resource = self._find(await self._drone.media.listing(), path)
            if (content := self._kept.get(resource)) is None:
                content = await self._drone.media.thumbnail(resource)
                self._kept[resource] = content
                while len(self._kept) > KEPT:
                    self._kept.popitem(last=False)
            return content

    @staticmethod
    def _find(listing: Listing, path: str) -> Resource:
        if not path.endswith(ENDING):
            raise FileRefused(FileError.FILE_NOT_FOUND)
        resource = find(listing, path.removesuffix(ENDING))
        if not resource.thumbnail:
            raise FileRefused(FileError.FILE_NOT_FOUND)
        return resource

    def _entry(self, file: Resource) -> Entry:
        return Entry(file.resource_id + ENDING, len(self._kept.get(file, b"")), file.time)
