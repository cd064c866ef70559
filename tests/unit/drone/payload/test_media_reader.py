"""The reads of the drone's files: pieces by hand, at most two answers at a time, with and without ranges."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from anafi_mav.drone.payload import media_reader
from anafi_mav.drone.payload.media_file import Resource, fetch
from anafi_mav.drone.payload.media_reader import AHEAD, PIECE, READS, MediaReader
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, RemoteProtocolError

SIZE = 40 * PIECE + 7


def content_of(name: str, size: int = SIZE) -> bytes:
    """Bytes that are different at each offset and in each file."""
    block = hashlib.sha256(name.encode()).digest()
    return b"".join(hashlib.sha256(block + n.to_bytes(4, "big")).digest() for n in range(size // 32 + 1))[:size]


def resource(name: str, size: int = SIZE) -> Resource:
    return Resource(name, url=f"/data/{name}", size=size, datetime="20261122T101112+0100")


class Server:
    """A web server in memory that counts what is open, and what was read."""

    def __init__(self, *, ranges: bool = True) -> None:
        self.ranges = ranges
        self.files: dict[str, bytes] = {}
        self.opened: list[tuple[str, int]] = []
        self.open_now = self.most_open = self.sent = 0
        self.closed = asyncio.Event()
        self.end_after: int | None = None
        """Bytes after which an answer ends."""

    def add(self, name: str, size: int = SIZE) -> Resource:
        self.files[name] = content_of(name, size)
        return resource(name, size)

    @asynccontextmanager
    async def open(self, resource: Resource, offset: int = 0) -> AsyncIterator[tuple[int, AsyncIterator[bytes]]]:
        if resource.resource_id not in self.files:
            raise CommandRejected("GET: HTTP 404")
        self.opened.append((resource.resource_id, offset))
        self.open_now += 1
        self.most_open = max(self.most_open, self.open_now)
        start = offset if self.ranges else 0
        try:
            yield start, self._chunks(self.files[resource.resource_id][start : self.end_after])
        finally:
            self.open_now -= 1
            self.closed.set()

    async def _chunks(self, data: bytes) -> AsyncIterator[bytes]:
        for begin in range(0, len(data), 50_000):
            await asyncio.sleep(0)
            self.sent += len(data[begin : begin + 50_000])
            yield data[begin : begin + 50_000]


@pytest.fixture
def server() -> Server:
    return Server()


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


async def settled() -> None:
    for _ in range(200):
        await asyncio.sleep(0)


async def test_whole_file_is_one_answer(server: Server) -> None:
    wanted = server.add("a")
    reader = MediaReader(server)
    async with aclosing(reader.read_from(wanted)) as parts:
        assert b"".join([part async for part in parts]) == server.files["a"]
    assert server.opened == [("a", 0)]


async def test_part_is_read_by_a_range_of_whole_pieces(server: Server) -> None:
    wanted = server.add("a")
    reader = MediaReader(server)
    begin = 20 * PIECE - 5
    assert await reader.read(wanted, begin, 10) == server.files["a"][begin : begin + 10]
    assert await reader.read(wanted, SIZE - 3, 3) == server.files["a"][-3:]
    assert server.opened == [("a", 19 * PIECE), ("a", 40 * PIECE)]
    await reader.close()


async def test_server_without_ranges_is_read_from_the_beginning() -> None:
    server = Server(ranges=False)
    wanted = server.add("a")
    reader = MediaReader(server)
    begin = 20 * PIECE - 5
    assert await reader.read(wanted, begin, 10) == server.files["a"][begin : begin + 10]
    await reader.close()


async def test_read_stays_a_few_pieces_ahead(server: Server) -> None:
    wanted = server.add("a")
    reader = MediaReader(server)
    await reader.read(wanted, 0, 100)
    await settled()
    assert server.sent <= (AHEAD + 2) * PIECE
    await reader.close()
    assert server.open_now == 0


@pytest.mark.parametrize("size", [SIZE, 0], ids=["sized", "unsized"])
async def test_third_file_waits_for_its_turn(server: Server, size: int) -> None:
    """Also among files whose size the drone does not report."""
    wanted = [replace(server.add(name), size=size) for name in "abcd"]
    reader = MediaReader(server)

    async def whole(one: Resource) -> bytes:
        async with aclosing(reader.read_from(one)) as parts:
            return b"".join([part async for part in parts])

    contents = await asyncio.gather(*(whole(one) for one in wanted))
    assert contents == [server.files[name] for name in "abcd"]
    assert server.most_open == READS


async def test_readers_of_one_place_share_an_answer(server: Server) -> None:
    wanted = server.add("a")
    reader = MediaReader(server)
    parts = await asyncio.gather(*(reader.read(wanted, 1000 * n, 1000) for n in range(20)))
    assert b"".join(parts) == server.files["a"][:20_000]
    assert server.opened == [("a", 0)]
    await reader.close()


async def test_failing_answer_fails_its_readers(server: Server) -> None:
    reader = MediaReader(server)
    with pytest.raises(CommandRejected, match="404"):
        await reader.read(resource("none"), 0, 10)
    wanted = server.add("a")
    server.end_after = 2 * PIECE  # the answer ends while it is ahead of its reader
    assert len(await reader.read(wanted, 0, 2 * PIECE)) == 2 * PIECE
    with pytest.raises(RemoteProtocolError, match="ended at byte"):
        await reader.read(wanted, 2 * PIECE, 10)


async def test_closed_link_ends_waiting_readers(server: Server) -> None:
    wanted = server.add("a")
    reader = MediaReader(server)
    reading = asyncio.ensure_future(reader.read(wanted, 0, SIZE))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    await reader.close()
    with pytest.raises(LinkLost):
        await reading
    assert server.open_now == 0


async def test_read_without_readers_ends(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(media_reader, "IDLE", 0.0)
    wanted = server.add("a")
    reader = MediaReader(server)
    await reader.read(wanted, 0, 10)
    await asyncio.wait_for(server.closed.wait(), 5.0)
    assert await reader.read(wanted, 30 * PIECE, 10) == server.files["a"][30 * PIECE :][:10]
    await reader.close()


async def test_interrupted_download_continues_where_it_ended(server: Server, tmp_path: Path) -> None:
    wanted = server.add("a.MP4")
    md5 = hashlib.md5(server.files["a.MP4"]).hexdigest()
    reader, progress = MediaReader(server), []
    server.end_after = 10 * PIECE
    with pytest.raises(RemoteProtocolError):
        await fetch(wanted, tmp_path, reader.read_from, md5)
    assert [name.rpartition(".")[2] for name in names(tmp_path)] == ["part"]
    server.end_after = None
    path = await fetch(wanted, tmp_path, reader.read_from, md5, lambda done, of: progress.append((done, of)))
    assert server.opened[-1] == ("a.MP4", 10 * PIECE)
    assert progress[0][0] > 10 * PIECE
    assert progress[-1] == (SIZE, SIZE)
    assert path.read_bytes() == server.files["a.MP4"]
    assert names(tmp_path) == [path.name]


async def test_download_of_another_file_does_not_continue(server: Server, tmp_path: Path) -> None:
    """After a format the drone counts its ids from the beginning."""
    reader = MediaReader(server)
    wanted = server.add("a.MP4")
    server.end_after = 10 * PIECE
    with pytest.raises(RemoteProtocolError):
        await fetch(wanted, tmp_path, reader.read_from, "0" * 32)
    server.end_after = None
    await reader.close()
    server.files["a.MP4"] = content_of("other")
    md5 = hashlib.md5(server.files["a.MP4"]).hexdigest()
    assert (await fetch(wanted, tmp_path, reader.read_from, md5)).read_bytes() == server.files["a.MP4"]


async def test_download_with_a_wrong_md5_leaves_nothing(server: Server, tmp_path: Path) -> None:
    with pytest.raises(RemoteProtocolError, match="MD5"):
        await fetch(server.add("a.JPG", 1000), tmp_path, MediaReader(server).read_from, "0" * 32)
    assert names(tmp_path) == []


async def test_answer_that_times_out_fails_its_reader(server: Server) -> None:
    wanted = server.add("a")

    class Silent(Server):
        @asynccontextmanager
        async def open(self, resource: Resource, offset: int = 0) -> AsyncIterator[tuple[int, AsyncIterator[bytes]]]:
            self.opened.append((resource.resource_id, offset))
            raise CommandTimeout("GET", 10.0)
            yield

    silent = Silent()
    with pytest.raises(CommandTimeout):
        await MediaReader(silent).read(wanted, 0, 10)
    assert len(silent.opened) == 1


async def test_reads_in_flight_share_a_rate(server: Server) -> None:
    wanted = [server.add(name, 4 * PIECE) for name in "ab"]
    flying = True
    reader, loop = MediaReader(server, lambda: flying), asyncio.get_running_loop()
    begun = loop.time()
    parts = await asyncio.gather(*(reader.read(one, 0, 4 * PIECE) for one in wanted))
    assert parts == [server.files[name] for name in "ab"]
    # Each file's last piece is not waited for, and the other's waits need not be over.
    assert loop.time() - begun >= 5 * PIECE / media_reader.FLIGHT_RATE - 0.01
    flying, landed = False, loop.time()
    await reader.read(server.add("c", 4 * PIECE), 0, 4 * PIECE)
    assert loop.time() - landed < PIECE / media_reader.FLIGHT_RATE


async def test_reader_that_is_cancelled_while_it_ends_another_read_ends() -> None:
    """A take-off cancels a copy of files; it must not go on because an idle read was just being closed."""
    server = Server()
    reader = MediaReader(server)
    for number in range(READS):
        await reader.read(server.add(f"{number}.MP4"), 0, 10)
    third = asyncio.create_task(reader.read(server.add("3.MP4"), 0, 10))
    await asyncio.sleep(0)  # it ends the read that no reader waits for
    third.cancel()
    with pytest.raises(asyncio.CancelledError):
        await third
    await reader.close()
