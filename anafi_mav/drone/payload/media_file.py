"""One file of the drone's media, and its download to a folder of this computer."""

from __future__ import annotations

import asyncio
import hashlib
import os
import re
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from anafi_mav.errors import CommandRejected, RemoteProtocolError
from anafi_mav.state_lock import try_lock

WRITTEN = 1 << 20
"""Bytes that are written to the disk at once."""

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
"""Ids of the drone become file names of ours: nothing but plain names may."""

_DATE = re.compile(r"([0-9]{4})([0-9]{2})([0-9]{2})T")

_TYPES = {"JPG": "image/jpeg", "DNG": "image/x-adobe-dng", "MP4": "video/mp4", "PNG": "image/png"}

UNDATED = "undated"
"""Folder of a file without a readable time."""


UNKNOWN = 500.0
"""Coordinate that the drone does not know."""


class Place(msgspec.Struct, frozen=True):
    """A place: deg, deg, m above mean sea level."""

    latitude: float = UNKNOWN
    longitude: float = UNKNOWN
    altitude: float = UNKNOWN

    @property
    def is_known(self) -> bool:
        """True when latitude and longitude are known."""
        return abs(self.latitude) <= 90.0 and abs(self.longitude) <= 180.0


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

    @property
    def date(self) -> str:
        """Day on which it was made by the drone's clock, "2026-11-22".

        "undated" when that is not readable.
        """
        found = _DATE.match(self.datetime)
        return UNDATED if found is None else "-".join(found.groups())


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

    It has its name only once it is complete. Until then it is a `.part` with its MD5 or size in the name, from which
    the next call continues: never one of another file. Raises `RemoteProtocolError` when size or MD5 differ; a part
    with another MD5 is deleted. Raises `CommandRejected` while another download writes it, and `OSError` of the disk.
    `name`: of the copy, instead of the file's own.
    """
    name = name or file_name(resource.resource_id)
    mark = md5[:12] if md5 is not None and re.fullmatch("[0-9a-f]{32}", md5) else str(resource.size)
    path, part = directory / name, directory / f"{name}.{mark}.part"
    digest = hashlib.md5(usedforsecurity=False)
    opened = await asyncio.to_thread(_open_part, part)
    try:
        with opened as file:
            done = await asyncio.to_thread(_digest_part, part, file, digest, resource.size)
            waiting = bytearray()
            try:
                if not resource.size or done < resource.size:
                    async with aclosing(read_from(resource, done)) as pieces:
                        async for piece in pieces:
                            waiting += piece
                            if resource.size and done + len(waiting) > resource.size:
                                raise RemoteProtocolError(f"{name}: more than its {resource.size} bytes arrive")
                            if len(waiting) >= WRITTEN:
                                data = bytes(waiting)
                                waiting.clear()
                                done += await asyncio.to_thread(_write, file, data, digest)
                            if progress is not None:
                                progress(done + len(waiting), resource.size)
            finally:  # also the bytes before an interruption: the next call continues behind them
                done += _write(file, bytes(waiting), digest)
            await asyncio.to_thread(_sync, file)
        if resource.size and done != resource.size:
            raise RemoteProtocolError(f"{name}: expected {resource.size} bytes, got {done}")
        if md5 is not None and digest.hexdigest() != md5:
            part.unlink()
            raise RemoteProtocolError(f"{name}: the copy is not what the drone has (MD5)")
        part.replace(path)
    finally:
        if part.exists() and not part.stat().st_size:
            part.unlink()
    return path


def _open_part(part: Path) -> BinaryIO:
    """Open a part to write behind its end, and lock it.

    Raises `CommandRejected` while another download has it.
    """
    file = part.open("ab")
    try:
        try:
            is_ours = try_lock(file.fileno())
        except OSError:  # a file system without locks: the MD5 shows what two writers have made
            is_ours = True
        if not is_ours or not part.exists() or not os.path.samestat(os.fstat(file.fileno()), part.stat()):
            raise CommandRejected(f"{part.name} is written by another download")
    except BaseException:
        file.close()
        raise
    return file


def _digest_part(part: Path, file: BinaryIO, digest: Any, size: int) -> int:
    """Return the bytes of an interrupted download, and put them into the digest."""
    if not size or part.stat().st_size > size:
        file.truncate(0)
        return 0
    done = 0
    with part.open("rb") as present:
        while data := present.read(WRITTEN):
            digest.update(data)
            done += len(data)
    return done


def _sync(file: Any) -> None:
    file.flush()
    os.fsync(file.fileno())


def _write(file: Any, data: bytes, digest: Any) -> int:
    file.write(data)
    digest.update(data)
    return len(data)
