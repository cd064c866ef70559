"""The files that a vehicle shows over MAVLink FTP, by path.

None is on a disk: each is made on request.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import parse_qs

from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.flavours import Flavour

Query = Mapping[str, str]
"""Query part of a path, after its question mark, as ArduPilot's clients write it."""

MAX_QUERY = 8
"""Words of a query: ArduPilot knows three."""


@dataclass(frozen=True)
class Entry:
    """One line of a directory."""

    name: str
    size: int | None
    """Bytes; None: a directory."""


@dataclass(frozen=True)
class ServedFile:
    """One file of a service."""

    make: Callable[[Flavour, Query], bytes | None]
    """Returns the content for clients of a flavour; None when the query is not supported."""
    packed: bool = False
    """Shown to clients of flavours with `packed_files` alone."""
    metadata: int | None = None
    """COMP_METADATA_TYPE. Such a file is made once for each connection, and served compressed as well."""
    write: Callable[[Inbound, bytes], bool] | None = None
    """Replaces it with a client's content; False when that is not usable. None: read only."""
    room: int = 0
    """Bytes that may be written to it."""


class FileTree:
    """A tree of made files. Paths are absolute, or begin with a virtual directory as "@PARAM"."""

    def __init__(self, makers: Mapping[str, Callable[[Query], bytes | None]]) -> None:
        """`makers` by path, e.g. "/general.json" or "/@PARAM/param.pck"."""
        self._makers = dict(makers)
        self._directories: dict[str, list[str]] = {"/": []}
        """Names of the files and directories in each directory, sorted."""
        for path in self._makers:
            parts = path.strip("/").split("/")
            for depth, name in enumerate(parts):
                above = "/" + "/".join(parts[:depth])
                names = self._directories.setdefault(above, [])
                if name not in names:
                    names.append(name)
                    names.sort()

    def read(self, path: str) -> bytes | None:
        """The content; None when there is no such file."""
        plain, _, query = path.partition("?")
        maker = self._makers.get(absolute(plain) or "")
        if maker is None:
            return None
        try:
            words = parse_qs(query, max_num_fields=MAX_QUERY) if query else {}
        except ValueError:
            return None
        return maker({name: values[-1] for name, values in words.items()})

    def room(self, path: str) -> int | None:
        """None: the files of the tree itself can only be read."""
        return None

    def write(self, path: str, content: bytes) -> bool:
        """False, likewise."""
        return False

    def has(self, path: str) -> bool:
        """True for a file."""
        return absolute(path) in self._makers

    def list(self, path: str) -> list[Entry] | None:
        """The entries; None when there is no such directory."""
        directory = absolute(path)
        names = None if directory is None else self._directories.get(directory)
        if directory is None or names is None:
            return None
        entries = []
        for name in names:
            below = f"{directory.rstrip('/')}/{name}"
            content = self.read(below) if below in self._makers else None
            entries.append(Entry(name, None if content is None else len(content)))
        return entries


def absolute(path: str) -> str | None:
    """Return the normalised path from the root; None for one that leads out of it."""
    parts = [part for part in path.split("/") if part not in ("", ".")]
    return None if ".." in parts else "/" + "/".join(parts)
