"""The part of a file that is being downloaded, in a folder whose disk may be slow.

The event loop controls all drones and never touches the file. One thread for each download does, job by job in their
order. A caller that is cancelled does not wait for it: the thread ends its job, writes the rest and closes the file.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from anafi_mav.disk_writer import DiskWriter
from anafi_mav.errors import CommandRejected, RemoteProtocolError
from anafi_mav.state_lock import try_lock

log = logging.getLogger("anafi_mav")

WRITTEN = 1 << 20
"""Bytes that are written to the disk at once."""

T = TypeVar("T")


class PartFile:
    """A file that has another name until it is complete."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._thread = DiskWriter("media")
        self._digest = hashlib.md5(usedforsecurity=False)
        self._fd: int | None = None
        self._size = 0
        self._limit = 0
        """Bytes from which the next download may continue; 0: it begins again."""

    async def open(self, size: int, *, continues: bool) -> int:
        """Open it to write behind its end, and lock it; return its bytes.

        They are those of an interrupted download when it `continues`, and not more than `size`; else it is emptied.
        Raises `CommandRejected` while another download has it.
        """
        return await self._run(self._open, size if continues else 0)

    async def write(self, data: bytes) -> int:
        """Append bytes; return those of the file."""
        return await self._run(self._write, data)

    async def finish(self, path: Path, size: int, md5: str | None) -> None:
        """Compare size (0: unknown) and MD5 (None: unknown), and give it its name.

        Raises `RemoteProtocolError`. A part with another MD5 is deleted.
        """
        await self._run(self._finish, path, size, md5)

    async def close(self, rest: bytes) -> None:
        """Append the rest as far as possible and close it.

        One without a byte is deleted, and one that no download can continue.
        """
        await self._run(self._close, rest)
        self._thread.shutdown()

    def abandon(self, rest: bytes) -> None:
        """Do the same later, in the thread."""
        self._thread.submit(self._close, rest)
        self._thread.shutdown()

    async def _run(self, job: Callable[..., T], *arguments: Any) -> T:
        # Shielded: a job that is cancelled before it begins would leave a hole in the file.
        return await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._thread, job, *arguments))

    # In the thread.

    def _open(self, size: int) -> int:
        fd = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        try:
            try:
                is_ours = try_lock(fd)
            except OSError:  # a file system without locks: the MD5 shows what two writers have made
                is_ours = True
            if not is_ours or not self._path.exists() or not os.path.samestat(os.fstat(fd), self._path.stat()):
                raise CommandRejected(f"{self._path.name} is written by another download")
            present = os.fstat(fd).st_size
            if present > size:
                os.ftruncate(fd, 0)
            elif present:
                self._read_present()
        except BaseException:
            os.close(fd)
            raise
        self._fd, self._limit = fd, size
        return self._size

    def _read_present(self) -> None:
        with self._path.open("rb") as present:
            while data := present.read(WRITTEN):
                self._digest.update(data)
                self._size += len(data)

    def _write(self, data: bytes) -> int:
        if self._fd is None:
            return self._size
        rest = memoryview(data)
        while rest:
            written = os.write(self._fd, rest)
            self._digest.update(rest[:written])
            self._size += written
            rest = rest[written:]
        return self._size

    def _finish(self, path: Path, size: int, md5: str | None) -> None:
        assert self._fd is not None
        os.fsync(self._fd)
        fd, self._fd = self._fd, None
        os.close(fd)
        if size and self._size != size:
            raise RemoteProtocolError(f"{path.name}: expected {size} bytes, got {self._size}")
        if not self._size or md5 not in (None, self._digest.hexdigest()):
            self._path.unlink()
            problem = "the copy is not what the drone has (MD5)" if self._size else "the drone sends no bytes"
            raise RemoteProtocolError(f"{path.name}: {problem}")
        self._path.replace(path)

    def _close(self, rest: bytes) -> None:
        if self._fd is None:
            return
        try:
            self._write(rest)
        except OSError as error:  # those before it are kept
            log.debug("%s: %s", self._path, error)
        fd, self._fd = self._fd, None
        os.close(fd)
        if not self._size or not self._limit:
            with suppress(OSError):  # its folder is deleted
                self._path.unlink()
