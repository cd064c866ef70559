"""Media: listed, copied, deleted and reported by the simulator; and a web server that talks nonsense."""

from __future__ import annotations

import asyncio
import hashlib
import threading
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, aclosing
from pathlib import Path

import pytest
from aiohttp import web
from support.scripted_device import ScriptedDevice
from support.simulated import Pair, connected
from support.web_answers import json_answer, serving

from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.drone import Drone
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoFile, PhotoMode
from anafi_mav.drone.payload.camera_state import PhotoSettings
from anafi_mav.drone.payload.item_list import MAX_ITEMS, MAX_OBJECTS, MAX_VALUES
from anafi_mav.drone.payload.media import MediaItem, Notification, Resource
from anafi_mav.drone.payload.media_file import fetch
from anafi_mav.drone.payload.media_index import SORTED_IN_LOOP, MediaIndex
from anafi_mav.drone.rest import JSON_LIMIT, MUX_RANGE, Rest
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, NotSupported, RemoteProtocolError


async def photograph(drone: Drone) -> str:
    await drone.camera.set_mode(CameraMode.PHOTO)
    await drone.camera.set_photo(PhotoSettings(mode=PhotoMode.SINGLE, file=PhotoFile.DNG_JPEG))
    media = await drone.camera.take_photo()
    assert media
    return media


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


@pytest.fixture
async def pair() -> AsyncIterator[Pair]:
    async with connected("4k") as pair:
        yield pair


async def test_a_photo_is_listed_copied_and_deleted(pair: Pair, tmp_path: Path) -> None:
    drone = pair.drone
    assert await drone.media.list() == ()
    id = await photograph(drone)
    (item,) = await drone.media.list()
    assert (item.media_id, item.type) == (id, "PHOTO")
    assert item == await drone.media.get(id)
    assert {one.format for one in item.resources} == {"JPG", "DNG"}
    assert item.gps is not None
    paths = await drone.media.download_media(id, tmp_path)
    assert sorted(path.name for path in paths) == sorted(one.resource_id for one in item.resources)
    for path, resource in zip(paths, item.resources, strict=True):
        content = path.read_bytes()
        assert len(content) == resource.size
        assert hashlib.md5(content).hexdigest() == await drone.media.md5(resource)
    assert names(tmp_path) == sorted(path.name for path in paths)
    assert (await drone.media.thumbnail(item)).startswith(b"\xff\xd8")
    await drone.media.delete_resource(item.resources[0].resource_id)
    assert len((await drone.media.get(id)).resources) == 1
    await drone.media.delete(id)
    with pytest.raises(CommandRejected, match="404"):
        await drone.media.get(id)
    await photograph(drone)
    await drone.media.delete_all()
    assert await drone.media.list() == ()
    assert (drone.media.state.index, drone.media.state.photos) == (MediastoreState.INDEXED, 0)


async def test_new_media_is_notified(pair: Pair) -> None:
    drone = pair.drone
    heard: list[Notification] = []
    ready = asyncio.Event()

    async def listen() -> None:
        async with aclosing(drone.media.notifications()) as notifications:
            ready.set()
            async for notification in notifications:
                heard.append(notification)
                if notification.name == "media_removed":
                    return

    listening = asyncio.ensure_future(listen())
    await ready.wait()
    ids = []
    # The socket opens while the first are taken: what counts is that it hears one from its beginning to its end.
    while "media_created" not in {one.name for one in heard}:
        ids.append(await photograph(drone))
    created = next(one for one in heard if one.name == "media_created")
    assert created.media is not None
    assert created.media.media_id in ids
    await drone.media.delete(created.media.media_id)
    await asyncio.wait_for(listening, 5.0)


async def test_not_yet_indexed(pair: Pair) -> None:
    pair.real.firmware.payload.media.state = MediastoreState.INDEXING
    with pytest.raises(CommandRejected, match="indexed"):
        await pair.drone.media.list()


# -- a web server that talks nonsense


async def test_media_that_are_not_readable_are_left_out() -> None:
    listed = [{"media_id": "1"}, 5, {"media_id": 7, "resources": 3}, {"no": "id"}, {"media_id": "2", "new": [None]}]
    async with serving(medias=json_answer(listed), f5=json_answer([1])) as (drone, _):
        assert drone.media.state.videos == 1
        assert drone.media.state.photo_files == 4
        assert [item.media_id for item in await drone.media.list()] == ["1", "2"]
        with pytest.raises(RemoteProtocolError):
            await drone.media.get("5")
        for wrong in ("../../etc/passwd", "", "a/b", ".hidden", "x" * 200):
            with pytest.raises(RemoteProtocolError):
                await drone.media.get(wrong)


async def test_files_that_cannot_be_shown_are_left_out(caplog: pytest.LogCaptureFixture) -> None:
    good = {"resource_id": "1.JPG", "size": 9}
    bad: list[dict[str, object]] = [{"resource_id": id} for id in ("a/b", "a\tb", "a\0", "x" * 231, "..")]
    bad += [{"resource_id": "2.JPG", "size": size} for size in (-1, 1 << 63)]
    many = [{"media_id": str(n), "resources": [good, *bad]} for n in range(500)]  # decoded in a thread
    async with serving(medias=json_answer(many)) as (drone, _):
        for _ in range(2):
            items = await drone.media.list()
            assert {tuple(file.resource_id for file in item.resources) for item in items} == {("1.JPG",)}
        assert [record.message for record in caplog.records if "left out" in record.message] == [
            "3500 media or files of the drone are not readable and left out"
        ]


async def test_long_list_is_sorted_in_a_thread() -> None:
    threads = set()

    class Item:
        @property
        def resources(self) -> tuple[Resource, ...]:
            threads.add(threading.get_ident())
            return (Resource("1.JPG"),)

    class Client:
        async def list(self, *, newest_first: bool = True) -> list[Item]:
            return [Item()] * SORTED_IN_LOOP

        def listen(self) -> AbstractAsyncContextManager[AsyncIterator[object]]:
            raise LinkLost("no notifications")

    listing = await MediaIndex(Client()).get(None)
    assert listing.file("1.JPG") == Resource("1.JPG")
    assert threading.get_ident() not in threads


async def test_list_requested_after_a_deletion_is_not_an_older_one() -> None:
    """A list that is on its way when a file is deleted still has the file."""
    requests: asyncio.Queue[asyncio.Future[list[MediaItem]]] = asyncio.Queue()

    class Client:
        async def list(self, *, newest_first: bool = True) -> list[MediaItem]:
            answer: asyncio.Future[list[MediaItem]] = asyncio.get_running_loop().create_future()
            requests.put_nowait(answer)
            return await answer

        def listen(self) -> AbstractAsyncContextManager[AsyncIterator[object]]:
            raise LinkLost("no notifications")

    index = MediaIndex(Client())
    before = asyncio.create_task(index.get(None))
    first = await requests.get()
    index.changed()
    after = asyncio.create_task(index.get(None))
    await asyncio.sleep(0)
    first.set_result([MediaItem("1", resources=(Resource("1.JPG"),))])
    assert (await before).file("1.JPG") is not None
    second = await asyncio.wait_for(requests.get(), 5.0)
    second.set_result([])
    assert (await after).file("1.JPG") is None


async def test_failed_deletion_forgets_the_listing() -> None:
    """The drone may have deleted the file, or some of the files, all the same."""
    async with serving(f5=web.Response(status=500), medias=json_answer([])) as (drone, _):
        for delete in (drone.media.delete, drone.media.delete_resource):
            await drone.media.listing()
            assert drone.media.kept_listing is not None
            with pytest.raises(CommandRejected, match="500"):
                await delete("5")
            assert drone.media.kept_listing is None


async def test_answer_to_a_deletion_need_not_be_json() -> None:
    async with serving(f5=web.Response(body=b"deleted"), medias=web.Response(body=b"deleted")) as (drone, _):
        await drone.media.delete("5")
        await drone.media.delete_resource("5")
        await drone.media.delete_all()


async def test_missing_md5_differs_from_failed_md5_request() -> None:
    answers = {
        "path": json_answer({"md5": "../../x"}),
        "short": json_answer({"md5": "0" * 31}),
        "error": web.Response(status=500),
    }
    async with serving(good=json_answer({"md5": "A" * 32}), **answers) as (drone, _):
        assert await drone.media.known_md5(Resource("good")) == "a" * 32
        assert await drone.media.known_md5(Resource("none")) is None
        for name, problem in (
            ("path", RemoteProtocolError),
            ("short", RemoteProtocolError),
            ("error", CommandRejected),
        ):
            with pytest.raises(problem):
                await drone.media.known_md5(Resource(name))


async def test_media_whose_text_is_no_utf_8_is_left_out() -> None:
    listed = b'[{"media_id": "1"}, {"media_id": "2", "run_id": "\xe9"}, {"media_id": "3"}]'
    async with serving(medias=web.Response(body=listed), f5=web.Response(body=b'"\xe9"')) as (drone, _):
        assert [item.media_id for item in await drone.media.list()] == ["1", "3"]
        with pytest.raises(RemoteProtocolError):
            await drone.media.get("5")


@pytest.mark.parametrize("body", [b'{"error": "refus\xe9"}', b"[" * 4096, b'{"error": %s' % (b"[" * 4096)])
async def test_refusal_with_an_unreadable_body_is_a_refusal(body: bytes) -> None:
    async with serving(medias=web.Response(status=403, body=body)) as (drone, _):
        with pytest.raises(CommandRejected, match="HTTP 403"):
            await drone.media.list()


async def test_answer_that_never_ends_is_a_timeout() -> None:
    async def drip(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
        while not writer.is_closing():
            writer.write(b" ")
            await asyncio.sleep(3.0)
        writer.close()

    async with await asyncio.start_server(drip, "127.0.0.1", 0) as server:
        rest = Rest("127.0.0.1", server.sockets[0].getsockname()[1])
        with pytest.raises(CommandTimeout, match=r"PUT /plan within 60 s"):
            await asyncio.wait_for(rest.json("PUT", "/plan", b"QGC WPL 120"), 100.0)
        await rest.close()


async def test_status_line_that_is_no_utf_8_is_replaced() -> None:
    async def refuse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 403 Refus\xe9\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
        writer.close()

    async with await asyncio.start_server(refuse, "127.0.0.1", 0) as server:
        rest = Rest("127.0.0.1", server.sockets[0].getsockname()[1])
        with pytest.raises(CommandRejected) as refusal:
            await rest.json("GET", "/")
        await rest.close()
    assert str(refusal.value) == "GET /: HTTP 403 Refus?"


@pytest.mark.parametrize(("size", "is_waited_for"), [(0, False), (1 << 32, True)])
async def test_md5_of_a_large_file_is_waited_for(
    size: int, is_waited_for: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drone reads the whole file for it."""
    monkeypatch.setattr("anafi_mav.drone.rest.ANSWER_TIMEOUT", 0.05)
    async with serving(work=0.3, video=json_answer({"md5": "a" * 32})) as (drone, _):
        if is_waited_for:
            assert await drone.media.known_md5(Resource("video", size=size)) == "a" * 32
        else:
            with pytest.raises(CommandTimeout):
                await drone.media.known_md5(Resource("video", size=size))


async def test_md5_that_is_not_answered_names_a_limit_in_whole_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of a file of 14 kB was "within 10.0014 s"."""
    monkeypatch.setattr("anafi_mav.drone.rest.ANSWER_TIMEOUT", 0.0)
    async with serving(work=2.0, video=json_answer({"md5": "a" * 32})) as (drone, _):
        with pytest.raises(CommandTimeout, match=r" within 1 s$"):
            await drone.media.known_md5(Resource("video", size=14_000))


@pytest.mark.parametrize("body", [b"{", b"\xff\xfe", b"[" * 100_000, b'"text"', b"null"])
async def test_answers_that_are_no_list(body: bytes) -> None:
    async with serving(medias=web.Response(body=body)) as (drone, _):
        with pytest.raises(RemoteProtocolError):
            await drone.media.list()


async def test_an_answer_without_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("anafi_mav.drone.rest.ANSWER_LIMIT", 1000)
    async with serving(medias=web.Response(body=b" " * 1001)) as (drone, _):
        with pytest.raises(RemoteProtocolError, match="1000"):
            await drone.media.list()


async def test_list_of_too_many_items_is_refused() -> None:
    async with serving(medias=web.Response(body=b"[" + b"0," * MAX_ITEMS + b"0]")) as (drone, _):
        with pytest.raises(RemoteProtocolError, match=f"length <= {MAX_ITEMS}"):
            await drone.media.list()


@pytest.mark.parametrize("values", [b"{}," * MAX_OBJECTS, b"0," * MAX_VALUES], ids=["objects", "values"])
async def test_list_with_too_many_values_in_an_item_is_refused_undecoded(values: bytes) -> None:
    """The interpreter decodes an item in one step, in which the event loop waits for a thread, too."""
    body = b'[{"media_id": "a", "more": [' + values + b"0]}]"
    async with serving(medias=web.Response(body=body)) as (drone, _):
        with pytest.raises(RemoteProtocolError, match="too long"):
            await drone.media.list()


async def test_file_of_unknown_size_has_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A web server that sends on for ever would fill the disk."""
    monkeypatch.setattr("anafi_mav.drone.rest.UNSIZED_LIMIT", 1000)
    answers = {"video": web.Response(body=b"0" * 1001), "photo": web.Response(body=b"0" * 1000)}
    async with serving(**answers) as (drone, _):
        with pytest.raises(RemoteProtocolError, match="no size, and more than 1000 bytes"):
            await fetch(Resource("video", url="/video"), tmp_path, drone.media.reader.read_from, None)
        assert names(tmp_path) == []
        await fetch(Resource("photo", url="/photo"), tmp_path, drone.media.reader.read_from, None)
        assert names(tmp_path) == ["photo"]


async def test_answer_that_would_stop_the_event_loop_is_refused() -> None:
    async with serving(f5=web.Response(body=b'{"media_id": "5"}' + b" " * JSON_LIMIT)) as (drone, _):
        with pytest.raises(RemoteProtocolError, match=f"more than {JSON_LIMIT} bytes"):
            await drone.media.get("5")


async def test_a_copy_that_is_not_what_the_drone_has(tmp_path: Path) -> None:
    right = hashlib.md5(b"picture").hexdigest()
    async with serving(file=web.Response(body=b"picture"), short=web.Response(body=b"pict")) as (drone, _):
        good = Resource("A.JPG", url="/data/file", md5=right.upper())
        assert (await drone.media.download(good, tmp_path)).read_bytes() == b"picture"
        with pytest.raises(RemoteProtocolError, match="MD5"):
            await drone.media.download(Resource("B.JPG", url="/data/short", md5=right), tmp_path)
        with pytest.raises(CommandRejected, match="404"):
            await drone.media.download(Resource("C.JPG", url="/data/none", md5=right), tmp_path)
        for url in ("http://elsewhere/data", "//elsewhere/data", ""):
            with pytest.raises(RemoteProtocolError):
                await drone.media.download(Resource("D.JPG", url=url, md5=right), tmp_path)
        with pytest.raises(RemoteProtocolError):
            await drone.media.download(Resource("../E.JPG", url="/data/file", md5=right), tmp_path)
        with pytest.raises(RemoteProtocolError):
            await drone.media.thumbnail(MediaItem("1"))
    assert names(tmp_path) == ["A.JPG"]


async def test_a_redirection_is_not_followed() -> None:
    async with serving(medias=web.Response(status=302)) as (drone, _):
        with pytest.raises(CommandRejected, match="302"):
            await drone.media.list()


async def test_notifications_that_are_not_readable_are_left_out() -> None:
    async with serving() as (drone, _):
        heard = [one async for one in drone.media.notifications()]
        assert [one.name for one in heard] == ["media_created"]
        assert heard[0].media is None


async def test_without_a_web_server_or_a_media_store() -> None:
    async with ScriptedDevice() as device:
        drone = device.drone()
        await drone.connect()
        with pytest.raises(NotSupported):
            await drone.media.list()
        await drone.close()
        with pytest.raises(LinkLost):
            await drone.media.list()
    rest = Rest("127.0.0.1", 1)
    with pytest.raises(LinkLost):
        await rest.json("GET", "/")
    await rest.close()


@pytest.mark.parametrize("has_ranges", [True, False])
async def test_file_behind_the_mux_is_requested_in_ranges(has_ranges: bool) -> None:
    """The mux passes on what the drone sends, whether it is read or not."""
    content = b"".join(hashlib.sha256(number.to_bytes(4, "big")).digest() for number in range(5 * MUX_RANGE // 64))
    requests: list[str | None] = []

    async def answer(request: web.Request) -> web.Response:
        requests.append(request.headers.get("Range"))
        if not has_ranges or request.http_range.start is None:
            return web.Response(body=content)
        first, end, _ = request.http_range.indices(len(content))
        found = f"bytes {first}-{end - 1}/{len(content)}"
        return web.Response(status=206, body=content[first:end], headers={"Content-Range": found})

    app = web.Application()
    app.router.add_get("/file", answer)
    runner = web.AppRunner(app)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    rest = Rest("127.0.0.1", 1)
    await rest.aim("127.0.0.1", runner.addresses[0][1], is_behind_mux=True)
    try:
        async with rest.open_file("/file", 0, len(content)) as (start, pieces):
            assert start == 0
            read = await anext(pieces)
            assert requests == [f"bytes=0-{MUX_RANGE - 1}"]
            read += b"".join([piece async for piece in pieces])
        assert read == content
        async with rest.open_file("/file", 100, len(content)) as (start, pieces):
            assert content[start:] == b"".join([piece async for piece in pieces])
    finally:
        await rest.close()
        await runner.cleanup()
    whole = [f"bytes=0-{MUX_RANGE - 1}", f"bytes=100-{MUX_RANGE + 99}"]
    if has_ranges:
        end = len(content)
        whole[1:1] = [f"bytes={MUX_RANGE}-{2 * MUX_RANGE - 1}", f"bytes={2 * MUX_RANGE}-{end - 1}"]
        whole += [f"bytes={MUX_RANGE + 100}-{2 * MUX_RANGE + 99}", f"bytes={2 * MUX_RANGE + 100}-{end - 1}"]
    assert requests == whole
