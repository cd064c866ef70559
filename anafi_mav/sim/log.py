"""Log of a simulated drone, for tests and for analysis.

An entry is one line of JSON in the file: ``{"t": 12.345, "drone": "127.0.42.1", "kind": "command",
"name": "ardrone3.Piloting.PCMD", "args": {"flag": 1, ...}}``. `t` is the monotonic clock of the host in seconds,
which all its processes share. Kinds: command (received), event (sent or meant to be sent, telemetry left out),
state (flying state), plan (progress of a flight plan), session (up, lost), scenario (a step begins or
ends), pose (the true pose, 10 Hz, and the simulated time in s).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Callable, Iterator
from io import FileIO
from pathlib import Path
from typing import Any

import msgspec

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.errors import CommandTimeout

logger = logging.getLogger("anafi_mav.sim")


class LogEntry(msgspec.Struct, frozen=True):
    t: float
    drone: str
    """Address of the drone."""
    kind: str
    name: str
    args: dict[str, Any]


class LogFile:
    """A file of entries, one JSON object a line, written whole lines at a time.

    It ends with one warning when the disk takes no more: the drones fly on.
    """

    def __init__(self, path: Path) -> None:
        """Raises `OSError` when the file cannot be opened."""
        self._encoder = msgspec.json.Encoder()
        self._path = path
        self._file: FileIO | None = FileIO(path, "wb")
        self._lines = bytearray()

    def add(self, entry: LogEntry) -> None:
        if self._file is not None:
            self._lines += self._encoder.encode(entry)
            self._lines += b"\n"

    def flush(self) -> None:
        """Hand everything to the system. The simulation calls it after each turn."""
        if not self._lines or self._file is None:
            return
        try:
            while self._lines:
                del self._lines[: self._file.write(self._lines) or 0]
        except OSError as error:
            logger.warning("%s: %s: the log ends here", self._path, error.strerror)
            self._lines.clear()
            self.close()

    def close(self) -> None:
        """Write what waits, and close the file. Idempotent."""
        self.flush()
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                file.close()


class Log:
    """One drone's entries: the last ones in memory, all of them in the file if there is one."""

    def __init__(self, drone: str, capacity: int, file: LogFile | None) -> None:
        self._drone = drone
        self._entries: deque[LogEntry] = deque(maxlen=capacity)
        self._file = file
        self._waiting: list[tuple[Callable[[LogEntry], bool], asyncio.Future[LogEntry]]] = []

    @property
    def used(self) -> bool:
        """False when an entry would be kept nowhere and awaited by nothing: it need not be made."""
        return bool(self._entries.maxlen or self._file is not None or self._waiting)

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[LogEntry]:
        return iter(list(self._entries))

    def __getitem__(self, index: int) -> LogEntry:
        return self._entries[index]

    def find(self, kind: str, name: str = "", *, since: float = float("-inf")) -> list[LogEntry]:
        """Entries of this kind whose name ends in `name`, not older than `since`."""
        return [e for e in self._entries if e.kind == kind and e.t >= since and e.name.endswith(name)]

    def add(self, now: float, kind: str, name: str, args: dict[str, Any]) -> None:
        if not self.used:
            return
        entry = LogEntry(now, self._drone, kind, name, args)
        self._entries.append(entry)
        if self._file is not None:
            self._file.add(entry)
        for waiting in list(self._waiting):
            predicate, future = waiting
            if not future.done() and predicate(entry):
                future.set_result(entry)

    def add_message(self, now: float, kind: str, message: Message | UnknownMessage) -> None:
        """A message under Parrot's name with Parrot's arguments; in the file enums are numbers."""
        if not self.used:
            return
        if isinstance(message, UnknownMessage):
            self.add(now, kind, str(message.id), {"payload": message.payload.hex()})
        else:
            self.add(now, kind, message.NAME, {name: getattr(message, name) for name in message.__struct_fields__})

    async def wait(
        self, predicate: Callable[[LogEntry], bool], timeout: float, *, since: float = float("-inf")
    ) -> LogEntry:
        """The first entry not older than `since` that satisfies `predicate`, now or later.

        Raises `CommandTimeout` when none came within `timeout` seconds.
        """
        for entry in self._entries:
            if entry.t >= since and predicate(entry):
                return entry
        future: asyncio.Future[LogEntry] = asyncio.get_running_loop().create_future()
        waiting = (predicate, future)
        self._waiting.append(waiting)
        try:
            return await asyncio.wait_for(future, timeout)
        except asyncio.TimeoutError:
            raise CommandTimeout("an entry of the simulator's log", timeout) from None
        finally:
            self._waiting.remove(waiting)
