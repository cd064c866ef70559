"""The files that a component shows over MAVLink FTP, by path.

A tree is put together from the files that services make on request and from folders, whose files are read from
elsewhere when a client reads them. Whatever takes time returns an awaitable; what is at hand returns its value.
"""

from __future__ import annotations

import enum
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import parse_qs

from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.checksum import crc32
from anafi_mav.services.flavours import Flavour
from anafi_mav.texts import OperatorText

Query = Mapping[str, str]
"""Query part of a path, after its question mark, as ArduPilot's clients write it."""

MAX_QUERY = 8
"""Words of a query: ArduPilot knows three."""

MAX_SIZE = 2**32 - 1
"""Bytes of a file that MAVLink FTP can address (ftp.md: size and offset have 32 bits)."""


class FileError(enum.IntEnum):
    """MAV_FTP_ERR, the ones in use."""

    FAIL = 1
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    EOF = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


class FileRefused(AnafiMavError):
    """A file or directory cannot be listed, opened, read or removed."""

    def __init__(self, error: FileError, text: OperatorText | None = None) -> None:
        """`text` explains it to the client; None: the error says enough."""
        super().__init__(str(text or error.name))
        self.error = error
        self.text = text


@dataclass(frozen=True)
class Entry:
    """One line of a directory."""

    name: str
    size: int | None
    """Bytes; None: a directory."""
    modified: int = 0
    """s since 1970; 0: unknown."""


class FileSource(Protocol):
    """An open file. Its content stays as it was when it was opened."""

    @property
    def size(self) -> int:
        """Bytes."""

    def read(self, offset: int, size: int) -> bytes | Awaitable[bytes]:
        """Return exactly these bytes, which are inside the file.

        Raises `FileRefused`, at once or when awaited.
        """


class Folder(Protocol):
    """A directory with everything below it, read from elsewhere.

    Paths are relative: "", "2026-11-22/a.jpg".

    All methods raise `FileRefused`, at once or when awaited.
    """

    def list(self, path: str) -> Sequence[Entry] | Awaitable[Sequence[Entry]]:
        """Return the entries, in the same sequence until they change."""

    def open(self, path: str) -> FileSource | Awaitable[FileSource]:
        """Open a file to read."""

    def checksum(self, path: str) -> int | Awaitable[int]:
        """Return MAVLink's CRC-32 of a file."""

    def remove(self, path: str, may_change: Callable[[], bool]) -> Awaitable[None] | None:
        """Remove a file, unless `may_change` returns False just before it."""


@dataclass(frozen=True)
class MadeFile:
    """A file that was made whole when it was opened."""

    content: bytes

    @property
    def size(self) -> int:
        return len(self.content)

    def read(self, offset: int, size: int) -> bytes:
        return self.content[offset : offset + size]


@dataclass(frozen=True)
class ServedFile:
    """One file of a service."""

    make: Callable[[Flavour, Query], bytes | None]
    """Returns the content for clients of a flavour; None when the query is not supported."""
    packed: bool = False
    """Shown to clients of flavours with `packed_files` alone."""
    metadata: int | None = None
    """COMP_METADATA_TYPE. Such a file is made once for each connection, and served compressed as well."""
    write: Callable[[Inbound, bytes], bool | Awaitable[bool]] | None = None
    """Replaces it with a client's content; None: read only.

    False, at once or when awaited, for content that is not usable."""
    room: int = 0
    """Bytes that may be written to it."""


class FileTree:
    """A tree of made files and folders.

    Paths are absolute, or begin with a virtual directory as "@PARAM".
    """

    def __init__(
        self, makers: Mapping[str, Callable[[Query], bytes | None]], folders: Mapping[str, Folder] | None = None
    ) -> None:
        """`makers` by path, e.g. "/general.json" or "/@PARAM/param.pck".

        `folders` by path, directly below the root.
        """
        self._makers = dict(makers)
        self._folders = dict(folders or {})
        self._directories: dict[str, list[str]] = {"/": []}
        """Names of the files and directories in each directory, sorted."""
        for path in (*self._makers, *self._folders):
            parts = path.strip("/").split("/")
            for depth, name in enumerate(parts):
                above = "/" + "/".join(parts[:depth])
                names = self._directories.setdefault(above, [])
                if name not in names:
                    names.append(name)
                    names.sort()

    def open(self, path: str) -> FileSource | Awaitable[FileSource]:
        """Open a file to read. Raises `FileRefused`, at once or when awaited."""
        plain, _, query = path.partition("?")
        if (found := self._in_folder(plain)) is not None:
            folder, below = found
            return folder.open(below)
        content = self._made(plain, query)
        if content is None:
            raise FileRefused(FileError.FILE_NOT_FOUND)
        return MadeFile(content)

    def checksum(self, path: str) -> int | Awaitable[int]:
        """Return MAVLink's CRC-32 of a file. Raises `FileRefused`, at once or when awaited."""
        plain, _, query = path.partition("?")
        if (found := self._in_folder(plain)) is not None:
            folder, below = found
            return folder.checksum(below)
        content = self._made(plain, query)
        if content is None:
            raise FileRefused(FileError.FILE_NOT_FOUND)
        return crc32(content)

    def remove(self, path: str, may_change: Callable[[], bool] = lambda: True) -> Awaitable[None] | None:
        """Remove a file of a folder. Raises `FileRefused`, at once or when awaited.

        `may_change`: False once the client may not remove it any longer.
        """
        if (found := self._in_folder(path)) is not None:
            folder, below = found
            return folder.remove(below, may_change)
        raise FileRefused(FileError.FILE_PROTECTED)

    def room(self, path: str) -> int | None:
        """None: the files of the tree itself can only be read."""
        return None

    def write(self, path: str, content: bytes) -> bool:
        """False, likewise."""
        return False

    def refused(self, refusal: FileRefused) -> None:
        """Ignore the reason of a refusal: the tree itself knows no client."""

    def has(self, path: str) -> bool:
        """True for a made file."""
        return absolute(path) in self._makers

    def list(self, path: str) -> Sequence[Entry] | Awaitable[Sequence[Entry]]:
        """Return the entries of a directory. Raises `FileRefused`, at once or when awaited."""
        if (found := self._in_folder(path)) is not None:
            folder, below = found
            return folder.list(below)
        directory = absolute(path)
        names = None if directory is None else self._directories.get(directory)
        if directory is None or names is None:
            raise FileRefused(FileError.FILE_NOT_FOUND)
        entries = []
        for name in names:
            content = self._made(f"{directory.rstrip('/')}/{name}", "")
            entries.append(Entry(name, None if content is None else len(content)))
        return entries

    def _made(self, path: str, query: str) -> bytes | None:
        """Return the content of a made file; None when it does not exist."""
        maker = self._makers.get(absolute(path) or "")
        if maker is None:
            return None
        try:
            words = parse_qs(query, max_num_fields=MAX_QUERY) if query else {}
        except ValueError:
            return None
        return maker({name: values[-1] for name, values in words.items()})

    def _in_folder(self, path: str) -> tuple[Folder, str] | None:
        """Return the folder of a path and the rest of the path; None outside all folders."""
        _, _, inside = (absolute(path) or "").partition("/")
        top, _, below = inside.partition("/")
        folder = self._folders.get(f"/{top}")
        return None if folder is None else (folder, below)


def absolute(path: str) -> str | None:
    """Return the normalised path from the root; None for one that leads out of it."""
    parts = [part for part in path.split("/") if part not in ("", ".")]
    return None if ".." in parts else "/" + "/".join(parts)
