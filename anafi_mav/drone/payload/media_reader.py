"""Reads parts of files from the drone's web server, for any number of readers at a time.

A read is one HTTP answer. It begins where a reader wants it (RFC 9110 §14, Range) and stays a few pieces ahead of its
readers. There are at most `READS` of them; a reader of a third file ends the one that has no waiting reader, and later
continues it by another Range. In flight all of them together have `FLIGHT_RATE`. A web server without ranges sends the
file from its beginning, which is skipped.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Hashable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Protocol

from anafi_mav.drone.payload.media_file import Resource
from anafi_mav.errors import LinkLost, RemoteProtocolError

PIECE = 1 << 17
"""Bytes of a file that are kept together: two bursts of MAVLink FTP."""

KEPT = 32
"""Pieces that are kept of all files: 4 MiB, so that a client can repeat what it has lost."""

READS = 2
"""Files that are read from one drone at a time: its web server is small, and its radio carries the controls too."""

AHEAD = 3
"""Pieces that a read is ahead of its readers."""

FLIGHT_RATE = 250_000.0
"""Bytes of files in a second while the drone flies, of all readers: less than half of its live video's 5 Mbit/s."""

IDLE = 5.0
"""s without a reader after which a read ends."""


OpenedFile = AbstractAsyncContextManager[tuple[int, AsyncIterator[bytes]]]
"""Where the bytes of an answer begin in the file, and the bytes."""


class OpensFiles(Protocol):
    """The part of a media client that is needed here."""

    def open(self, resource: Resource, offset: int = 0) -> OpenedFile:
        """Open a file at `offset`: where its bytes begin, and the bytes."""


class MediaReader:
    """The reads of one drone's files."""

    def __init__(self, client: OpensFiles, is_flying: Callable[[], bool] = lambda: False) -> None:
        self._client = client
        self._is_flying = is_flying
        self._paced_until = 0.0
        """Loop time before which no further bytes are due in flight."""
        self._reads: list[_Read] = []
        """The one that was used last is last."""
        self._pieces: OrderedDict[Hashable, bytes] = OrderedDict()
        self._others = 0
        """Other reads of the drone, that count like the reads of files."""
        self._changed = asyncio.Event()
        """Set, and replaced, when a read has delivered a piece or ended."""

    async def read(self, resource: Resource, offset: int, size: int) -> bytes:
        """Return these bytes of a file, which are inside it."""
        parts = []
        end = offset + size
        while offset < end:
            index, skipped = divmod(offset, PIECE)
            piece = await self._piece(resource, index)
            part = piece[skipped : skipped + end - offset]
            if not part:
                raise RemoteProtocolError(f"{resource.resource_id} ends before byte {end}")
            parts.append(part)
            offset += len(part)
        return b"".join(parts)

    async def read_from(self, resource: Resource, offset: int = 0) -> AsyncGenerator[bytes, None]:
        """Iterate over the bytes of a file from `offset` on.

        One of unknown size is read as it arrives.
        """
        if not resource.size:
            async with self.turn(), self._client.open(resource, offset) as (_, chunks):
                async for chunk in chunks:
                    yield chunk
                    await self.pace(len(chunk))
            return
        while offset < resource.size:
            part = await self.read(resource, offset, min(PIECE - offset % PIECE, resource.size - offset))
            offset += len(part)
            yield part

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Count what runs inside as one of the reads; wait until there are few enough."""
        while len(self._reads) + self._others >= READS:
            await self._free()
        self._others += 1
        try:
            yield
        finally:
            self._others -= 1
            self.notify()

    async def close(self) -> None:
        """End all reads and forget all pieces; waiting readers get `LinkLost`."""
        self._pieces.clear()
        reads, self._reads = self._reads, []
        for read in reads:
            read.problem = LinkLost("the drone's link is closed")
            await read.close()

    async def _piece(self, resource: Resource, index: int) -> bytes:
        key = (resource.resource_id, resource.datetime, resource.size, index)
        while True:
            read = self._reading(resource, index)
            if read is not None:
                read.want(index)
            if (piece := self._pieces.get(key)) is not None:
                self._pieces.move_to_end(key)
                return piece
            if read is None:
                if len(self._reads) + self._others >= READS:
                    await self._free()
                    continue
                read = _Read(self, resource, index)
                self._reads.append(read)
            read.readers += 1
            try:
                await self._changed.wait()
            finally:
                read.readers -= 1
            if read.problem is not None and key not in self._pieces:
                raise read.problem

    def _reading(self, resource: Resource, index: int) -> _Read | None:
        """Return the read that delivers this piece soon, or has just delivered it."""
        for read in self._reads:
            if read.resource == resource and read.next - KEPT < index <= read.next + AHEAD:
                if index < read.next and (*self._key_of(resource), index) not in self._pieces:
                    continue
                self._reads.remove(read)
                self._reads.append(read)
                return read
        return None

    async def _free(self) -> None:
        """End the read that no reader waits for; without one, wait for a change."""
        idle = next((read for read in self._reads if not read.readers), None)
        if idle is None:
            await self._changed.wait()
        else:
            self._reads.remove(idle)
            await idle.close()

    @staticmethod
    def _key_of(resource: Resource) -> tuple[str, str, int]:
        return (resource.resource_id, resource.datetime, resource.size)

    # What a read reports.

    async def pace(self, size: int) -> None:
        """Wait as long as `size` bytes may take; on the ground not at all."""
        if self._is_flying():
            now = asyncio.get_running_loop().time()
            self._paced_until = max(self._paced_until, now) + size / FLIGHT_RATE
            await asyncio.sleep(self._paced_until - now)

    def open(self, resource: Resource, offset: int) -> OpenedFile:
        """Open a file for a read."""
        return self._client.open(resource, offset)

    def delivered(self, resource: Resource, index: int, piece: bytes) -> None:
        """Keep a piece and wake its readers."""
        key = (*self._key_of(resource), index)
        self._pieces[key] = piece
        while len(self._pieces) > KEPT:
            self._pieces.popitem(last=False)
        self.notify()

    def ended(self, read: _Read) -> None:
        """Wake the readers of a read that has ended."""
        if read in self._reads:
            self._reads.remove(read)
        self.notify()

    def notify(self) -> None:
        """Wake all waiting readers."""
        self._changed.set()
        self._changed = asyncio.Event()


class _Read:
    """One HTTP answer: a file from one piece on."""

    def __init__(self, owner: MediaReader, resource: Resource, first: int) -> None:
        self.resource = resource
        self.next = first
        """The piece that arrives next."""
        self.readers = 0
        """How many wait for a piece of it."""
        self.problem: Exception | None = None
        self._owner = owner
        self._wanted = first
        self._more = asyncio.Event()
        self._task = asyncio.get_running_loop().create_task(self._run())

    def want(self, index: int) -> None:
        """Read on until it is ahead of this piece."""
        if index > self._wanted:
            self._wanted = index
            self._more.set()

    async def close(self) -> None:
        """End it.

        A cancellation of the caller meanwhile is the caller's: it must not be taken for the end of the read.
        """
        self._task.cancel()
        await asyncio.wait({self._task})

    async def _run(self) -> None:
        try:
            await self._read()
        except Exception as error:
            self.problem = error
        finally:
            self._owner.ended(self)

    async def _read(self) -> None:
        size, begin = self.resource.size, self.next * PIECE
        async with self._owner.open(self.resource, begin) as (start, chunks):
            skipped, buffer = begin - start, bytearray()
            async for chunk in chunks:
                drop = min(skipped, len(chunk))
                skipped -= drop
                buffer += memoryview(chunk)[drop:]
                while len(buffer) >= (expected := min(PIECE, size - self.next * PIECE)):
                    self._owner_gets(bytes(buffer[:expected]))
                    del buffer[:expected]
                    if self.next * PIECE >= size:
                        return
                    await self._owner.pace(expected)
                    while self.next > self._wanted + AHEAD:
                        self._more.clear()
                        try:
                            await asyncio.wait_for(self._more.wait(), IDLE)
                        except asyncio.TimeoutError:  # no reader wants more
                            return
        ended = self.next * PIECE + len(buffer)
        raise RemoteProtocolError(f"{self.resource.resource_id}: the answer ended at byte {ended}")

    def _owner_gets(self, piece: bytes) -> None:
        self.next += 1
        self._owner.delivered(self.resource, self.next - 1, piece)
