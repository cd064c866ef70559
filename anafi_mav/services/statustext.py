"""STATUSTEXT: what people read.

Long texts travel in chunks of 50 bytes (MAVLink common.xml STATUSTEXT).
"""

from __future__ import annotations

import itertools

from anafi_mav.mavlink import dialect
from anafi_mav.vehicle.base.severity import Severity

CHUNK = 50
"""Bytes of text that one message carries."""

LONGEST = 500
"""Bytes of a text: ten lines of a ground station, and far below the 255 chunks that could be numbered."""


def _clean(text: str) -> bytes:
    """Return the text as one line without control characters.

    NUL ends a text on the wire, and QGroundControl drops what ends in a tab.
    """
    line = " ".join("".join(character if character.isprintable() else " " for character in text).split())
    data = line.encode()
    if len(data) > LONGEST:
        data = data[: LONGEST - 3].decode(errors="ignore").encode() + b"..."
    return data


def _chunks(data: bytes) -> list[bytes]:
    """Divide a text into chunks that hold whole characters.

    QGroundControl reads each by itself. A chunk shorter than 50 bytes would end the text, so spaces fill one: beside
    its last space, if it has one.
    """
    chunks = []
    while len(data) > CHUNK:
        chunk = data[:CHUNK].decode(errors="ignore").encode()
        data = data[len(chunk) :]
        at = chunk.rfind(b" ")
        at = len(chunk) if at < 0 else at
        chunks.append(chunk[:at] + b" " * (CHUNK - len(chunk)) + chunk[at:])
    return [*chunks, data]


class TextNumbers:
    """Numbers that tie the chunks of one long text together.

    1..65535; 0 means a text in one piece.
    """

    def __init__(self) -> None:
        self._next = itertools.cycle(range(1, 1 << 16))

    def messages(self, severity: Severity, text: str) -> list[dialect.MAVLink_statustext_message]:
        """Return the message, or the sequence of chunks, that carries `text`.

        The list is empty for an empty text.
        """
        data = _clean(text)
        if not data:
            return []
        if len(data) <= CHUNK:
            return [dialect.MAVLink_statustext_message(int(severity), data)]
        number = next(self._next)
        chunks = _chunks(data)
        if len(chunks[-1]) == CHUNK:
            chunks.append(b"")  # a chunk shorter than 50 bytes is what ends a text
        return [
            dialect.MAVLink_statustext_message(int(severity), chunk, id=number, chunk_seq=index)
            for index, chunk in enumerate(chunks)
        ]
