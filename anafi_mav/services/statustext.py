"""STATUSTEXT: what people read. Long texts travel in chunks of 50 bytes (MAVLink common.xml STATUSTEXT)."""

from __future__ import annotations

import enum
import itertools

from anafi_mav.mavlink import dialect

CHUNK = 50
"""Bytes of text that one message carries."""


class Severity(enum.IntEnum):
    """MAV_SEVERITY, the ones in use."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class TextNumbers:
    """Numbers that tie the chunks of one long text together: 1..65535, 0 means a text in one piece."""

    def __init__(self) -> None:
        self._next = itertools.cycle(range(1, 1 << 16))

    def messages(self, severity: Severity, text: str) -> list[dialect.MAVLink_statustext_message]:
        """The message, or the chunks in order, that carry `text`."""
        data = text.encode()
        if len(data) <= CHUNK:
            return [dialect.MAVLink_statustext_message(int(severity), data)]
        number = next(self._next)
        chunks = [data[start : start + CHUNK] for start in range(0, len(data), CHUNK)]
        if len(chunks[-1]) == CHUNK:
            chunks.append(b"")  # a chunk shorter than 50 bytes is what ends a text
        return [
            dialect.MAVLink_statustext_message(int(severity), chunk, id=number, chunk_seq=index)
            for index, chunk in enumerate(chunks)
        ]
