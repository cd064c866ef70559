"""The flight logs of the simulated drone, as its web server lists them.

The aircraft's files are Parrot's own binary format, which is not published. Here each second of a flight is one block
of text, made when it is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

BLOCK = 1024
"""Bytes of a second of flight. Assumed: GroundSDK's tests have logs of 22 and 600 MB."""


@dataclass(frozen=True)
class FlightLogFile:
    """One flight."""

    number: int
    date: str
    """Of the landing, ISO 8601 basic."""
    blocks: int

    @property
    def name(self) -> str:
        return f"log-{self.number}.bin"

    @property
    def size(self) -> int:
        """Bytes."""
        return self.blocks * BLOCK

    def describe(self) -> dict[str, Any]:
        """As in the answers of the web server."""
        return {"name": self.name, "date": self.date, "size": self.size, "url": f"/data/fdr/{self.name}"}

    def parts(self, first: int, end: int, size: int) -> Iterator[bytes]:
        """Bytes `first` to `end` of the file, `size` at a time."""
        for offset in range(first, end, size):
            stop = min(offset + size, end)
            blocks = range(offset // BLOCK, -(-stop // BLOCK))
            skipped = offset - blocks.start * BLOCK
            yield b"".join(map(self._block, blocks))[skipped : skipped + stop - offset]

    def _block(self, index: int) -> bytes:
        return f"{self.name} {self.date} second {index} ".encode().ljust(BLOCK - 1, b".") + b"\n"


class FlightLogStore:
    """All flight logs, oldest first."""

    def __init__(self) -> None:
        self._logs: dict[str, FlightLogFile] = {}
        self._made = 0

    def __iter__(self) -> Iterator[FlightLogFile]:
        return iter(list(self._logs.values()))

    def add(self, date: str, seconds: float) -> FlightLogFile:
        """Store the log of a flight that has just ended."""
        self._made += 1
        log = FlightLogFile(self._made, date, max(round(seconds), 1))
        self._logs[log.name] = log
        return log

    def find(self, name: str) -> FlightLogFile | None:
        return self._logs.get(name)

    def remove(self, name: str) -> bool:
        """Delete a log; return False when it does not exist."""
        return self._logs.pop(name, None) is not None

    def clear(self) -> None:
        """Delete all logs: the drone is reset to factory settings."""
        self._logs.clear()
