"""The files of recorded sessions: parts of bounded size, of which the oldest are deleted.

    FOLDER/20261122T210000Z/gateway.0001.tlog, arsdk.0001.jsonl, …

A session takes a quarter of the folder's bytes at most: a flood of traffic deletes its own beginning, not the flight of
yesterday, and the four newest sessions stay whatever is received. Of the others the oldest parts are deleted.

Nothing waits for the disk: what is appended is written by a thread, twice a second. When the disk is too slow or full,
data is dropped, counted and reported once. Only files with the names of this module are ever deleted.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from io import FileIO
from pathlib import Path

from anafi_mav.disk_writer import HANGS, DiskWriter

logger = logging.getLogger(__name__)

SESSIONS = 4
"""The newest, of which no file is deleted for another session."""

PART_BYTES = 32_000_000
"""Of one file at most: a flight of half an hour in one part, and what is deleted at once when room is needed."""

SESSION_PARTS = 4
"""Parts that a session has room for at least: two that are written, and two that are full."""

MAX_WAITING = 8_000_000
"""Bytes that may wait for the disk: some ten seconds of 250 drones."""

WRITE_EVERY = 0.5
"""s between two writes; a power cut costs so much of the recording."""

CLOSE_LIMIT = 1.0
"""s that closing waits for the disk."""

SESSION = re.compile(r"\d{8}T\d{6}Z(-\d{1,3})?")
PART = re.compile(r"(gateway\.\d{4,}\.tlog|arsdk\.\d{4,}\.jsonl)")

MAVLINK, ARSDK = "gateway.{:04d}.tlog", "arsdk.{:04d}.jsonl"
"""Names of the parts of the two files."""


class SessionFolder:
    """One session's folder and its files. `start` once, `close` once."""

    def __init__(self, folder: Path, max_bytes: int) -> None:
        """`folder`: of all sessions, whose files together stay below `max_bytes`."""
        self.path = folder
        """Of this session, once `start` has made it."""
        self.counters: Counter[str] = Counter()
        """written_bytes, dropped_bytes (the disk is too slow or full), deleted_files."""
        self.problem = ""
        """Why data was dropped last; empty while none was."""
        self._folder = folder
        self._max_bytes = max_bytes
        self._session_bytes = max_bytes // SESSIONS
        self._part_bytes = min(PART_BYTES, self._session_bytes // SESSION_PARTS)
        self._waiting: dict[str, list[bytes]] = {MAVLINK: [], ARSDK: []}
        self._waiting_bytes = 0
        self._parts: dict[str, tuple[FileIO, int]] = {}
        """Open part of each file, and its bytes."""
        self._numbers: Counter[str] = Counter()
        self.writer = DiskWriter("anafi-mav-recording")
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Make the folder of this session, and begin to write. Raises OSError."""
        stem = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        self._folder.mkdir(parents=True, exist_ok=True)
        for number in range(100):
            self.path = self._folder / (stem if not number else f"{stem}-{number}")
            with contextlib.suppress(FileExistsError):
                self.path.mkdir(mode=0o700)  # positions and serial numbers
                break
        else:
            raise FileExistsError(f"{self.path}: it exists")
        self._task = asyncio.get_running_loop().create_task(self._run(), name="recording")

    def append(self, name: str, data: bytes) -> None:
        """Write later to `MAVLINK` or `ARSDK`. Never blocks."""
        if self._waiting_bytes + len(data) > MAX_WAITING:
            self._drop(len(data), "the disk is too slow")
            return
        self._waiting[name].append(data)
        self._waiting_bytes += len(data)

    async def close(self) -> None:
        """Write what waits, and close the files, as far as the disk answers in time. Idempotent."""
        task, self._task = self._task, None
        if task is None:
            return
        task.cancel()
        await asyncio.wait([task])
        ending = asyncio.get_running_loop().create_task(self._end())
        done, _ = await asyncio.wait([ending], timeout=CLOSE_LIMIT)
        if not done:
            ending.cancel()
            await asyncio.wait([ending])
            self._drop(0, HANGS)
        self.writer.shutdown()

    async def _end(self) -> None:
        await self.flush()
        await asyncio.get_running_loop().run_in_executor(self.writer, self._close_parts)

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(WRITE_EVERY)
            await asyncio.shield(self.flush())

    async def flush(self) -> None:
        """Write what waits now."""
        batch = {name: b"".join(waiting) for name, waiting in self._waiting.items() if waiting}
        if not batch:
            return
        for waiting in self._waiting.values():
            waiting.clear()
        self._waiting_bytes = 0
        before = self.counters["written_bytes"]
        try:
            await asyncio.get_running_loop().run_in_executor(self.writer, self._write, batch)
        except Exception as error:  # the recording goes on as soon as it can
            reason = error.strerror if isinstance(error, OSError) else None
            written = self.counters["written_bytes"] - before
            self._drop(sum(map(len, batch.values())) - written, reason or str(error))

    def _drop(self, size: int, reason: str) -> None:
        self.counters["dropped_bytes"] += size
        if not self.problem:
            logger.warning("%s: recording has gaps: %s", self.path, reason)
        self.problem = reason

    # In the thread.

    def _close_parts(self) -> None:
        for file, _ in self._parts.values():
            with contextlib.suppress(OSError):
                file.close()
        self._parts.clear()
        with contextlib.suppress(OSError):  # not empty
            self.path.rmdir()  # of a start that failed: a service may try again every second

    def _write(self, batch: dict[str, bytes]) -> None:
        for name, data in batch.items():
            file, size = self._parts.get(name, (None, 0))
            if file is None or size + len(data) > self._part_bytes:
                if file is not None:
                    del self._parts[name]  # also if that fails: a closed file takes nothing more
                    file.close()
                self._make_room(len(data))
                self._numbers[name] += 1
                file, size = (self.path / name.format(self._numbers[name])).open("xb", buffering=0), 0
                self._parts[name] = file, size
            rest = memoryview(data)
            while rest:  # what a full disk does not take any more is no part of the file's size
                count = file.write(rest)
                size, rest = size + count, rest[count:]
                self._parts[name] = file, size
                self.counters["written_bytes"] += count

    def _make_room(self, size: int) -> None:
        """Delete the oldest parts of this session, then of others: a new part may become full."""
        held = {Path(file.name) for file, _ in self._parts.values()}
        needed = max(self._part_bytes, size) * (1 + len(held))
        sizes = {part: part.stat().st_size for part in parts_of(self._folder)}
        own = {part: sizes.pop(part) for part in tuple(sizes) if part.parent == self.path}
        kept = self._delete({part: own[part] for part in own if part not in held}, own, self._session_bytes - needed)
        self._delete(sizes, sizes, self._max_bytes - needed - kept)

    def _delete(self, oldest_first: Mapping[Path, int], sizes: Mapping[Path, int], bound: int) -> int:
        """Delete files until those of `sizes` have `bound` bytes at most; return their bytes."""
        total = sum(sizes.values())
        for part, size in oldest_first.items():
            if total <= bound:
                break
            part.unlink()
            total -= size
            self.counters["deleted_files"] += 1
            if part.parent != self.path:
                with contextlib.suppress(OSError):  # not empty
                    part.parent.rmdir()
        return total


def parts_of(folder: Path) -> Iterator[Path]:
    """Yield the parts of all sessions in a folder, oldest first.

    Without those of a session that this user may not read: another user's, as of a gateway that root has started.
    """
    for session in sorted(path for path in folder.iterdir() if SESSION.fullmatch(path.name) and path.is_dir()):
        try:
            own = [part for part in session.iterdir() if PART.fullmatch(part.name) and part.is_file()]
        except PermissionError:
            continue
        yield from sorted(own, key=lambda part: (part.stat().st_mtime, part.name))
