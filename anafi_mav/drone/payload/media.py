"""Element media: the photos and videos in the drone's storages.

ARSDK reports how many there are and whether they are indexed; everything else is requested from the drone's web
server, which is used only on request of a caller (`/api/v1/media`, developer.parrot.com and Olympe's media module).
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any, ClassVar

import aiohttp
import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import mediastore
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.drone.element import Reducer
from anafi_mav.drone.expectation import Commander
from anafi_mav.drone.payload.item_list import decode_items
from anafi_mav.drone.payload.media_file import Place as Place
from anafi_mav.drone.payload.media_file import Resource as Resource
from anafi_mav.drone.payload.media_file import fetch, file_name
from anafi_mav.drone.payload.media_index import Listing as Listing
from anafi_mav.drone.payload.media_index import MediaIndex
from anafi_mav.drone.payload.media_reader import MediaReader, OpenedFile
from anafi_mav.drone.rest import UNREADABLE, NotFound, Rest
from anafi_mav.drone.settings import Commanding
from anafi_mav.errors import RemoteProtocolError

log = logging.getLogger("anafi_mav")

API = "/api/v1/media"
NOTIFICATION_LIMIT = 1 << 20
"""Bytes of one notification; a media with a thousand resources is half of it."""
THREAD_LIMIT = 100_000
"""Bytes of a list from which it is decoded in a thread: the event loop controls all drones."""
MD5_RATE = 10e6
"""Bytes of a file in a second of which the drone makes an MD5, at least: it reads the whole file from its card."""
MD5_LIMIT = 1800.0
"""s that an MD5 may take, whatever size the drone reports."""
_MD5 = re.compile("[0-9a-f]{32}")
THUMBNAIL_LIMIT = 1 << 18
"""Bytes of a thumbnail; an ANAFI's are about a tenth of it."""


class MediaState(msgspec.Struct, frozen=True):
    """Counts of the media on the drone."""

    index: MediastoreState | None = None
    """The web server answers when it is INDEXED."""
    photos: int | None = None
    videos: int | None = None
    photo_files: int | None = None
    video_files: int | None = None


class MediaItem(msgspec.Struct, frozen=True, gc=False):
    """One media: a photo, a series or a video, with its files."""

    media_id: str
    type: str = ""
    """"PHOTO" or "VIDEO"."""
    datetime: str = ""
    """ISO 8601 basic, the drone's clock."""
    size: int = 0
    """Bytes of all its files."""
    duration: float | None = None
    """ms."""
    run_id: str = ""
    custom_id: str | None = None
    thumbnail: str | None = None
    gps: Place | None = None
    photo_mode: str | None = None
    video_mode: str | None = None
    replay_url: str | None = None
    thermal: bool = False
    resources: tuple[Resource, ...] = ()


class Notification(msgspec.Struct, frozen=True):
    """An event of the media store.

    "media_created", "resource_removed", "indexing_state_changed", …
    """

    name: str
    data: dict[str, Any] = {}

    @property
    def media(self) -> MediaItem | None:
        """The media that the event describes, if any."""
        return _item(self.data.get("media"))


def _item(received: Any) -> MediaItem | None:
    """Return a media of the drone; None when the data is not readable as one."""
    try:
        return _usable(msgspec.convert(received, MediaItem, strict=False))
    except (msgspec.ValidationError, RecursionError):
        return None


def _usable(item: MediaItem) -> MediaItem:
    """Return a media without unusable files: an id that is no file name, an impossible size."""
    resources = tuple(file for file in item.resources if file.is_usable)
    return item if len(resources) == len(item.resources) else replace(item, resources=resources)


_ITEM = msgspec.json.Decoder(MediaItem, strict=False)


def _items(body: bytes) -> tuple[tuple[MediaItem, ...], int]:
    """Return the media of a list, and how many of them and of their files are left out.

    Decoded one by one, so that a thread does it beside the event loop. Raises `RemoteProtocolError`.
    """
    received, dropped = decode_items(body, _ITEM, "media")
    items = tuple(map(_usable, received))
    dropped += sum(len(item.resources) for item in received) - sum(len(item.resources) for item in items)
    return items, dropped


class MediaClient:
    """The media of one drone's web server, without ARSDK: also behind a gateway.

    All methods raise `CommandRejected` while the drone has not indexed its media or when the web server refuses,
    `CommandTimeout` and `LinkLost` when it does not answer, `RemoteProtocolError` when the answer is not readable.
    """

    def __init__(self, rest: Rest) -> None:
        self._rest = rest
        self._warned = False

    async def list(self, *, newest_first: bool = True) -> tuple[MediaItem, ...]:
        """Return all media."""
        query = {"sort_order": "newest" if newest_first else "oldest"}
        body = await self._rest.read("GET", f"{API}/medias", query=query)
        items, dropped = _items(body) if len(body) < THREAD_LIMIT else await asyncio.to_thread(_items, body)
        if dropped and not self._warned:  # a list is requested again and again
            self._warned = True
            log.warning("%d media or files of the drone are not readable and left out", dropped)
        return items

    async def get(self, media_id: str) -> MediaItem:
        """Return one media. Raises `CommandRejected` when no media has this id."""
        item = _item(await self._rest.json("GET", f"{API}/medias/{file_name(media_id)}"))
        if item is None:
            raise RemoteProtocolError(f"media {media_id} is not readable")
        return item

    async def md5(self, resource: Resource) -> str:
        """Return the MD5 of a file on the drone, hexadecimal."""
        md5 = resource.md5
        if not md5:
            place = f"{API}/md5/{file_name(resource.resource_id)}"
            work = min(math.ceil(resource.size / MD5_RATE), MD5_LIMIT)  # whole: the text of a timeout names the sum
            answer = await self._rest.json("GET", place, work=work)
            md5 = answer.get("md5") if isinstance(answer, dict) else None
        if not isinstance(md5, str) or not _MD5.fullmatch(md5.lower()):  # it becomes part of a file name of ours
            raise RemoteProtocolError(f"the MD5 of {resource.resource_id} is not readable")
        return md5.lower()

    async def known_md5(self, resource: Resource) -> str | None:
        """Return the MD5 of a file; None when the drone has none (status 404).

        Any other failure is raised: a copy that could have been compared must not pass for one that could not.
        """
        try:
            return await self.md5(resource)
        except NotFound:
            return None

    async def thumbnail(self, of: MediaItem | Resource) -> bytes:
        """Return a small JPEG. Raises `CommandRejected` when the drone has none."""
        if not of.thumbnail:
            raise RemoteProtocolError("the drone has no thumbnail of it")
        return await self._rest.read("GET", of.thumbnail, limit=THUMBNAIL_LIMIT)

    def open(self, resource: Resource, offset: int = 0) -> OpenedFile:
        """Open a file at `offset`.

        Where its bytes begin (0 where the web server has no ranges), and the bytes.
        """
        return self._rest.open_file(resource.url, offset, resource.size)

    async def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
        """Iterate over the bytes of a file from `offset` on, for its only reader."""
        async with self.open(resource, offset) as (start, chunks):
            skipped = offset - start
            async for chunk in chunks:
                if len(chunk) > skipped:
                    yield chunk[skipped:]
                skipped = max(skipped - len(chunk), 0)

    async def delete(self, media_id: str) -> None:
        """Delete a media with all its files."""
        await self._rest.read("DELETE", f"{API}/medias/{file_name(media_id)}")

    async def delete_resource(self, resource_id: str) -> None:
        """Delete one file."""
        await self._rest.read("DELETE", f"{API}/resources/{file_name(resource_id)}")

    async def delete_all(self) -> None:
        """Delete all media."""
        await self._rest.read("DELETE", f"{API}/medias")

    @asynccontextmanager
    async def listen(self) -> AsyncIterator[AsyncIterator[Notification]]:
        """Open the drone's notifications.

        The events of the media store follow until the drone ends it.
        """
        async with self._rest.websocket(f"{API}/notifications", NOTIFICATION_LIMIT) as socket:
            yield _notifications(socket)


async def _notifications(socket: aiohttp.ClientWebSocketResponse) -> AsyncIterator[Notification]:
    async for frame in socket:
        if frame.type is not aiohttp.WSMsgType.TEXT:
            continue
        try:
            yield msgspec.json.decode(frame.data, type=Notification)
        except UNREADABLE as error:
            log.debug("unreadable notification: %s", error)


class Media(Commanding[MediaState]):
    """Photos and videos on the drone, from its web server.

    All of them raise `CommandRejected` while the drone has not indexed its media or when the web server refuses,
    `CommandTimeout` and `LinkLost` when it does not answer, `RemoteProtocolError` when the answer is not readable.
    """

    NOTHING = MediaState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        mediastore.State: lambda state, m: replace(state, index=m.state),
        mediastore.Counters: lambda state, m: replace(
            state,
            photos=m.photo_media_count,
            videos=m.video_media_count,
            photo_files=m.photo_resource_count,
            video_files=m.video_resource_count,
        ),
    }

    def __init__(self, commander: Commander, rest: Rest, is_flying: Callable[[], bool]) -> None:
        """While `is_flying`, files are read at `FLIGHT_RATE`: the radio carries the controls."""
        super().__init__(commander)
        self._client = MediaClient(rest)
        self.reader = MediaReader(self._client, is_flying)
        """Reads all files of the drone's web server, also those that are no media."""
        self._index = MediaIndex(self._client)

    # -- what there is

    async def list(self, *, newest_first: bool = True) -> tuple[MediaItem, ...]:
        """Return all media."""
        return await self._available().list(newest_first=newest_first)

    async def get(self, media_id: str) -> MediaItem:
        """Return one media. Raises `CommandRejected` when no media has this id."""
        return await self._available().get(media_id)

    @property
    def kept_listing(self) -> Listing | None:
        """All files as `listing` returns them, while they are known without a question to the drone."""
        return self._index.kept(self.state)

    async def listing(self) -> Listing:
        """Return all files by day and name; requested from the drone only after a change."""
        self._available()
        return await self._index.get(self.state)

    async def md5(self, resource: Resource) -> str:
        """Return the MD5 of a file on the drone, hexadecimal."""
        return await self._available().md5(resource)

    async def known_md5(self, resource: Resource) -> str | None:
        """Return the MD5 of a file; None when the drone has none."""
        return await self._available().known_md5(resource)

    async def thumbnail(self, of: MediaItem | Resource) -> bytes:
        """Return a small JPEG. Raises `CommandRejected` when the drone has none."""
        client = self._available()
        async with self.reader.turn():
            return await client.thumbnail(of)

    # -- files

    async def read(self, resource: Resource, offset: int, size: int) -> bytes:
        """Return these bytes of a file. At most two files are read from the drone at a time."""
        self._available()
        return await self.reader.read(resource, offset, size)

    async def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
        """Iterate over the bytes of a file from `offset` on."""
        self._available()
        async for piece in self.reader.read_from(resource, offset):
            yield piece

    async def download(
        self, resource: Resource, directory: Path, progress: Callable[[int, int], None] | None = None
    ) -> Path:
        """Download a file to a directory and compare its MD5; return its path.

        The file has its name only once it is complete; one that was interrupted is continued. `progress` is called
        with the bytes so far and those of the file. Raises `RemoteProtocolError` when the MD5 differs.
        """
        client = self._available()
        md5 = await client.md5(resource)
        return await fetch(resource, directory, self.reader.read_from, md5, progress)

    async def download_media(self, media_id: str, directory: Path) -> tuple[Path, ...]:
        """Download every file of a media; return their paths."""
        item = await self.get(media_id)
        return tuple([await self.download(resource, directory) for resource in item.resources])

    async def close(self) -> None:
        """End the reads of files and lists."""
        await self._index.close()
        await self.reader.close()

    # -- away with them

    async def delete(self, media_id: str) -> None:
        """Delete a media with all its files."""
        client = self._available()
        try:
            await client.delete(media_id)
        finally:
            self._index.changed()

    async def delete_resource(self, resource_id: str) -> None:
        """Delete one file."""
        client = self._available()
        try:
            await client.delete_resource(resource_id)
        finally:
            self._index.changed()

    async def delete_all(self) -> None:
        """Delete all media."""
        client = self._available()
        try:
            await client.delete_all()
        finally:
            self._index.changed()

    # -- news

    def listen(self) -> AbstractAsyncContextManager[AsyncIterator[Notification]]:
        """Open the drone's notifications.

        The events of the media store follow until the drone ends it.
        """
        return self._available().listen()

    async def notifications(self) -> AsyncGenerator[Notification, None]:
        """Iterate over the events of the media store; use it in `contextlib.aclosing`.

        It ends when the drone ends it. Events that are not readable are left out.
        """
        async with self.listen() as notifications:
            async for notification in notifications:
                yield notification

    def _available(self) -> MediaClient:
        self._commander.require_feature(self.state.index, "media store")
        return self._client
