"""Element media: the photos and videos in the drone's storages.

ARSDK reports how many there are and whether they are indexed; everything else is requested from the drone's web
server, which is used only on request of a caller (`/api/v1/media`, developer.parrot.com and Olympe's media module).
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import re
from collections.abc import AsyncGenerator, Mapping
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
from anafi_mav.drone.rest import Rest
from anafi_mav.drone.settings import Commanding
from anafi_mav.errors import RemoteProtocolError

log = logging.getLogger("anafi_mav")

API = "/api/v1/media"
NOTIFICATION_LIMIT = 1 << 20
"""Bytes of one notification; a media with a thousand resources is half of it."""
PIECE = 1 << 18
"""Bytes that are written to the disk at once."""

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
"""Ids of the drone become file names of ours: nothing but plain names may."""


class MediaState(msgspec.Struct, frozen=True):
    """Counts of the media on the drone."""

    index: MediastoreState | None = None
    """The web server answers when it is INDEXED."""
    photos: int | None = None
    videos: int | None = None
    photo_files: int | None = None
    video_files: int | None = None


class Place(msgspec.Struct, frozen=True):
    """A place: deg, deg, m; Parrot writes 500 for unknown."""

    latitude: float = 500.0
    longitude: float = 500.0
    altitude: float = 500.0


class Resource(msgspec.Struct, frozen=True):
    """One file of a media."""

    resource_id: str
    media_id: str = ""
    type: str = ""
    format: str = ""
    """"JPG", "DNG", "MP4"."""
    size: int = 0
    """Bytes."""
    url: str = ""
    thumbnail: str | None = None
    datetime: str = ""
    md5: str | None = None
    """Newer firmware only; `Media.md5` requests it from others."""
    storage: str | int | None = None
    duration: float | None = None
    """ms."""
    replay_url: str | None = None
    width: int | None = None
    height: int | None = None
    gps: Place | None = None


class MediaItem(msgspec.Struct, frozen=True):
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


def _item(told: Any) -> MediaItem | None:
    """Return a media of the drone; None when the data is not readable as one."""
    try:
        return msgspec.convert(told, MediaItem, strict=False)
    except (msgspec.ValidationError, RecursionError):
        return None


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

    def __init__(self, commander: Commander, rest: Rest) -> None:
        super().__init__(commander)
        self._rest = rest

    # -- what there is

    async def list(self, *, newest_first: bool = True) -> tuple[MediaItem, ...]:
        """Return all media."""
        told = await self._ask("GET", f"{API}/medias", sort_order="newest" if newest_first else "oldest")
        if not isinstance(told, list):
            raise RemoteProtocolError("the drone's list of media is none")
        items = [_item(one) for one in told]
        if None in items:
            log.warning("%d media of the drone are not readable", items.count(None))
        return tuple(item for item in items if item is not None)

    async def get(self, media_id: str) -> MediaItem:
        """Return one media. Raises `CommandRejected` when no media has this id."""
        item = _item(await self._ask("GET", f"{API}/medias/{_name(media_id)}"))
        if item is None:
            raise RemoteProtocolError(f"media {media_id} is not readable")
        return item

    async def md5(self, resource: Resource) -> str:
        """Return the MD5 of a file on the drone, hexadecimal."""
        told = resource.md5
        if told is None:
            answer = await self._ask("GET", f"{API}/md5/{_name(resource.resource_id)}")
            told = answer.get("md5") if isinstance(answer, dict) else None
        if not isinstance(told, str) or not told:
            raise RemoteProtocolError(f"no MD5 of {resource.resource_id}")
        return told.lower()

    async def thumbnail(self, of: MediaItem | Resource) -> bytes:
        """Return a small JPEG. Raises `CommandRejected` when the drone has none."""
        self._available()
        if not of.thumbnail:
            raise RemoteProtocolError("no thumbnail was told")
        return await self._rest.read("GET", of.thumbnail)

    # -- files

    async def download(self, resource: Resource, directory: Path) -> Path:
        """Download a file to a directory and compare its MD5; return its path.

        The file has its name only once it is complete. Raises `RemoteProtocolError` when the MD5 differs.
        """
        self._available()
        wanted = await self.md5(resource)
        path = directory / _name(resource.resource_id)
        part = path.with_name(path.name + ".part")
        digest = hashlib.md5(usedforsecurity=False)
        try:
            with await asyncio.to_thread(part.open, "wb") as file:
                async with self._rest.open("GET", resource.url) as pieces:
                    waiting = bytearray()
                    async for piece in pieces:
                        digest.update(piece)
                        waiting += piece
                        if len(waiting) >= PIECE:
                            await asyncio.to_thread(file.write, bytes(waiting))
                            waiting.clear()
                await asyncio.to_thread(file.write, bytes(waiting))
            if digest.hexdigest() != wanted:
                raise RemoteProtocolError(f"{resource.resource_id}: the copy is not what the drone has (MD5)")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return path

    async def download_media(self, media_id: str, directory: Path) -> tuple[Path, ...]:
        """Download every file of a media; return their paths."""
        item = await self.get(media_id)
        return tuple([await self.download(resource, directory) for resource in item.resources])

    # -- away with them

    async def delete(self, media_id: str) -> None:
        """Delete a media with all its files."""
        await self._ask("DELETE", f"{API}/medias/{_name(media_id)}")

    async def delete_resource(self, resource_id: str) -> None:
        """Delete one file."""
        await self._ask("DELETE", f"{API}/resources/{_name(resource_id)}")

    async def delete_all(self) -> None:
        """Delete all media."""
        await self._ask("DELETE", f"{API}/medias")

    # -- news

    async def notifications(self) -> AsyncGenerator[Notification, None]:
        """Iterate over the events of the media store; use it in `contextlib.aclosing`.

        It ends when the drone ends it. Events that are not readable are left out.
        """
        self._available()
        async with self._rest.websocket(f"{API}/notifications", NOTIFICATION_LIMIT) as socket:
            async for frame in socket:
                if frame.type is not aiohttp.WSMsgType.TEXT:
                    continue
                try:
                    yield msgspec.json.decode(frame.data, type=Notification)
                except (msgspec.DecodeError, RecursionError) as error:
                    log.debug("unreadable notification: %s", error)

    def _available(self) -> None:
        self._require(self.state.index, "media store")

    async def _ask(self, method: str, path: str, **query: str) -> Any:
        self._available()
        return await self._rest.json(method, path, query=query)


def _name(id: str) -> str:
    """An id that can stand in a path, there and here."""
    if not _FILE_NAME.fullmatch(id):
        raise RemoteProtocolError(f"{id!r} is no id")
    return id
