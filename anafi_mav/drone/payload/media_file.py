"""One file of the drone's media, and its download to a folder of this computer."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from datetime import datetime
from pathlib import Path

import msgspec

from anafi_mav.drone.payload.media_part import WRITTEN, PartFile
from anafi_mav.errors import RemoteProtocolError

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
"""Ids of the drone become file names of ours: nothing but plain names may."""

_DATE = re.compile(r"([0-9]{4})([0-9]{2})([0-9]{2})T")

_TIME = re.compile(r"[0-9]{8}T[0-9]{6}([+-][0-9]{4}|Z)?")
"""ISO 8601 basic."""

_TYPES = {"JPG": "image/jpeg", "DNG": "image/x-adobe-dng", "MP4": "video/mp4", "PNG": "image/png"}

MAX_FILE = 1 << 63
"""Bytes that no file has: offsets of files are signed."""

UNDATED = "undated"
"""Folder of a file without a readable time."""


UNKNOWN = 500.0
"""Coordinate that the drone does not know."""


class Place(msgspec.Struct, frozen=True, gc=False):
    """A place: deg, deg, m above mean sea level."""

    latitude: float = UNKNOWN
    longitude: float = UNKNOWN
    altitude: float = UNKNOWN

    @property
    def is_known(self) -> bool:
        """True when latitude and longitude are known."""
        return abs(self.latitude) <= 90.0 and abs(self.longitude) <= 180.0

    @property
    def altitude_amsl(self) -> float | None:
        """m above mean sea level; None: unknown."""
        return None if self.altitude == UNKNOWN else self.altitude


class Resource(msgspec.Struct, frozen=True, gc=False):
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

    @property
    def is_usable(self) -> bool:
        """True when its id can be a file name and its size that of a file."""
        return _FILE_NAME.fullmatch(self.resource_id) is not None and 0 <= self.size < MAX_FILE

    @property
    def date(self) -> str:
        """Day on which it was made by the drone's clock, "2026-11-22".

        "undated" when that is not readable.
        """
        found = _DATE.match(self.datetime)
        return UNDATED if found is None else "-".join(found.groups())

    @property
    def time(self) -> int:
        """When it was made by the drone's clock, s since 1970; 0 when that is not readable."""
        try:
            return max(int(datetime.strptime(self.datetime, "%Y%m%dT%H%M%S%z").timestamp()), 0)
        except (ValueError, OverflowError):
            return 0

    @property
    def identity(self) -> str | None:
        """Size and time, for a file name: with the id they identify a file, also after a format.

        None when one of them is unknown.
        """
        if not self.size or not _TIME.fullmatch(self.datetime):
            return None
        return f"{self.size}-{self.datetime}"


def content_type(name: str) -> str:
    """Return the media type of a file by the end of its name."""
    return _TYPES.get(name.rpartition(".")[2].upper(), "application/octet-stream")


def file_name(id: str) -> str:
    """Return an id that can stand in a path, there and here. Raises `RemoteProtocolError`."""
    if not _FILE_NAME.fullmatch(id):
        raise RemoteProtocolError(f"{id!r} is no id")
    return id


async def fetch(
    resource: Resource,
    directory: Path,
    read_from: Callable[[Resource, int], AsyncGenerator[bytes, None]],
    md5: str | None,
    progress: Callable[[int, int], None] | None = None,
    name: str | None = None,
) -> Path:
    """Download a file to a directory, compare its MD5 if that is known, and return its path.

    It has its name only once it is complete. Until then it is a `.part`, from which the next call continues: never one
    of another file, because its MD5 is in the name, or else size and time. Raises `RemoteProtocolError` when size or
    MD5 differ or no byte arrives; a part with another MD5 is deleted. Raises `CommandRejected` while another download
    writes it, and `OSError` of the disk.
    `name`: of the copy, instead of the file's own.
    """
    name = name or file_name(resource.resource_id)
    identity = md5[:12] if md5 is not None else resource.identity
    part = PartFile(directory / f"{name}.{identity or resource.size}.part")
    waiting = bytearray()
    try:
        done = await part.open(resource.size, continues=identity is not None)
        if not resource.size or done < resource.size:
            async with aclosing(read_from(resource, done)) as pieces:
                async for piece in pieces:
                    waiting += piece
                    if resource.size and done + len(waiting) > resource.size:
                        raise RemoteProtocolError(f"{name}: more than its {resource.size} bytes arrive")
                    if len(waiting) >= WRITTEN:
                        done = await part.write(_taken(waiting))
                    if progress is not None:
                        progress(done + len(waiting), resource.size)
        await part.write(_taken(waiting))
        await part.finish(directory / name, resource.size, md5)
    except asyncio.CancelledError:  # by a take-off for example, which must not wait for a disk
        part.abandon(bytes(waiting))
        raise
    except BaseException:
        await part.close(bytes(waiting))
        raise
    await part.close(b"")
    return directory / name


def _taken(waiting: bytearray) -> bytes:
    data = bytes(waiting)
    waiting.clear()
    return data
