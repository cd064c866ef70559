"""The tlog format: MAVLink frames, each with its time. No I/O.

Eight bytes before each frame are the time in microseconds since 1970, big-endian (QGroundControl MAVLinkLogManager,
pymavlink mavlogfile).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

from anafi_mav.mavlink.frames import CHECKSUM, HEADER_1, HEADER_2, MAGIC_1, MAGIC_2, SIGNATURE, SIGNED

_TIME = struct.Struct(">Q")

LATEST = 1 << 52
"""us since 1970, in the year 2112: a larger number is no time, and the file is searched on."""


class TlogEntry(NamedTuple):
    """One frame of a tlog."""

    time: float
    """s since 1970."""
    frame: bytes


def encode(entry: TlogEntry) -> bytes:
    """Return the bytes of an entry."""
    return _TIME.pack(round(entry.time * 1e6)) + entry.frame


class TlogReader:
    """Finds the entries in the bytes of a file. Other bytes are skipped and counted."""

    def __init__(self) -> None:
        self.skipped = 0
        """Bytes that belong to no entry."""
        self._pending = b""

    def receive(self, data: bytes) -> Iterator[TlogEntry]:
        """Yield the entries that end in `data`; the rest is kept for the next call."""
        buffer, start = self._pending + data, 0
        while len(buffer) - start >= _TIME.size + 3:
            length = self._length(buffer, start)
            if length == 0:
                self.skipped += 1
                start += 1
                continue
            if len(buffer) - start < length:
                break
            (time,) = _TIME.unpack_from(buffer, start)
            yield TlogEntry(time / 1e6, buffer[start + _TIME.size : start + length])
            start += length
        self._pending = buffer[start:]

    @staticmethod
    def _length(buffer: bytes, start: int) -> int:
        """Return the bytes of the entry at `start`; 0 when there is none."""
        if _TIME.unpack_from(buffer, start)[0] > LATEST:
            return 0
        magic, size, flags = buffer[start + _TIME.size : start + _TIME.size + 3]
        if magic == MAGIC_1:
            return _TIME.size + HEADER_1 + size + CHECKSUM
        if magic == MAGIC_2:
            return _TIME.size + HEADER_2 + size + CHECKSUM + (SIGNATURE if flags & SIGNED else 0)
        return 0
