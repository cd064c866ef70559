"""The simulated drone's web server over real sockets: media, notifications, plans, and what it refuses."""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import pytest

from anafi_mav.sim.http import MAX_BODY, MAX_UNREAD, WebServer
from anafi_mav.sim.payload.flight_log_store import BLOCK, FlightLogStore
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import Media, MediaKind, MediaStore
from anafi_mav.sim.plan.plan_store import FlightPlanStore

DATE = "20261121T101112+0100"
API = "/api/v1"
PLAN = b"QGC WPL 120\n0\t0\t3\t22\t0\t0\t0\t0\t48.8\t2.3\t10\t1\n"


class Site:
    """A server with its stores, and a client of it."""

    def __init__(self) -> None:
        self.media = MediaStore("run", "ANAFI", 0, lambda message: None)
        self.plans = FlightPlanStore()
        self.flight_logs = FlightLogStore()
        self.server = WebServer(self.media, self.plans, self.flight_logs, {"model": "4k"}, lambda: DATE)
        self.client: aiohttp.ClientSession

    def photo(self, *kinds: MediaKind) -> Media:
        media = self.media.begin(video=False, mode="SINGLE", date=DATE)
        files = [self.media.develop(media, kind, 1, Scene(), DATE) for kind in kinds or (MediaKind.JPG,)]
        self.media.add(media, files)
        return media

    def film(self) -> Media:
        media = self.media.begin(video=True, mode="STANDARD", date=DATE)
        self.media.add(media, [self.media.develop(media, MediaKind.MP4, 1, Scene(), DATE, 2.5)])
        return media

    async def ask(self, method: str, path: str, **options: Any) -> tuple[int, Any]:
        """Status, and the JSON or the bytes of the answer."""
        async with self.client.request(method, path, **options) as answer:
            data = await answer.read()
            return answer.status, json.loads(data) if answer.content_type == "application/json" else data

    async def raw(self, text: bytes) -> bytes:
        """The first line of the answer to a request as it stands."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.server.port)
        writer.write(text)
        line = await asyncio.wait_for(reader.readline(), 5.0)
        writer.close()
        return line


@pytest.fixture
async def site() -> AsyncIterator[Site]:
    site = Site()
    await site.server.start("127.0.0.1", 0)
    async with aiohttp.ClientSession(f"http://127.0.0.1:{site.server.port}") as site.client:
        yield site
    await site.server.close()


async def test_request_during_a_link_loss_waits(site: Site) -> None:
    async with site.client.ws_connect(f"{API}/media/notifications") as socket:
        site.server.mute = True
        asking = asyncio.ensure_future(site.ask("GET", f"{API}/media/medias"))
        hearing = asyncio.ensure_future(socket.receive_json())
        media = site.photo()
        done, _ = await asyncio.wait({asking, hearing}, timeout=0.2)
        assert not done
        site.server.mute = False
        assert (await asyncio.wait_for(asking, 5.0)) == (200, [media.describe()])
        assert (await asyncio.wait_for(hearing, 5.0))["name"] == "media_created"


# -- media


async def test_media_are_listed(site: Site) -> None:
    assert await site.ask("GET", f"{API}/media/medias") == (200, [])
    photo, film = site.photo(MediaKind.JPG, MediaKind.DNG), site.film()
    status, listed = await site.ask("GET", f"{API}/media/medias")
    assert (status, listed) == (200, [photo.describe(), film.describe()])
    assert listed[1]["duration"] == 2500

    async def ids(query: str) -> list[str]:
        return [media["media_id"] for media in (await site.ask("GET", f"{API}/media/medias?{query}"))[1]]

    assert await ids("sort_order=newest") == [film.id, photo.id]
    assert await ids("sort_order=oldest") == [photo.id, film.id]
    assert await ids("media_type=VIDEO") == [film.id]
    assert await ids("run_id=run") == [photo.id, film.id]
    assert await ids("run_id=other") == []
    assert await ids("storage=1") == []
    assert await ids("custom_id=mine") == []
    assert (await site.ask("GET", f"{API}/media/medias?sort_order=best"))[0] == 400
    assert await site.ask("GET", f"{API}/media/medias/{film.id}") == (200, film.describe())
    assert await site.ask("GET", f"{API}/info/properties") == (200, {"model": "4k"})


async def test_files_are_what_the_list_says(site: Site) -> None:
    for media in (site.photo(MediaKind.JPG, MediaKind.DNG), site.film()):
        for resource in media.describe()["resources"]:
            async with site.client.get(resource["url"]) as answer:
                data = await answer.read()
                assert int(answer.headers["Content-Length"]) == resource["size"] == len(data)
            status, observed = await site.ask("GET", f"{API}/media/md5/{resource['resource_id']}")
            assert (status, observed["media_id"]) == (200, media.id)
            assert observed["md5"] == hashlib.md5(data).hexdigest()
            status, thumbnail = await site.ask("GET", resource["thumbnail"])
            assert (status, thumbnail[:2]) == (200, b"\xff\xd8")


async def test_deleted_media_are_absent(site: Site) -> None:
    first, second, third = site.photo(MediaKind.JPG, MediaKind.DNG), site.photo(), site.film()
    raw = first.resources[1].id
    assert (await site.ask("DELETE", f"{API}/media/resources/{raw}"))[0] == 200
    assert (await site.ask("GET", f"/data/media/{raw}"))[0] == 404
    assert (await site.ask("DELETE", f"{API}/media/resources/{raw}"))[0] == 404
    assert (await site.ask("DELETE", f"{API}/media/medias/{second.id}"))[0] == 200
    assert (await site.ask("DELETE", f"{API}/media/medias/{second.id}"))[0] == 404
    assert [m["media_id"] for m in (await site.ask("GET", f"{API}/media/medias"))[1]] == [first.id, third.id]
    assert (await site.ask("DELETE", f"{API}/media/medias"))[0] == 200
    assert await site.ask("GET", f"{API}/media/medias") == (200, [])
    assert len(site.media) == 0


@pytest.mark.parametrize(
    "path",
    [
        f"{API}/media/medias/1",
        f"{API}/media/md5/1",
        "/data/media/1.JPG",
        "/data/thumb/1.JPG",
        f"{API}/upload/flightplan/1",
        "/",
        "/api/v2/media/medias",
    ],
)
async def test_request_for_an_unknown_path_is_refused(site: Site, path: str) -> None:
    assert (await site.ask("GET", path))[0] == 404


async def test_media_list_without_an_index_is_refused(site: Site) -> None:
    photo = site.photo()
    site.media.unplug()
    for method, path in (
        ("GET", "medias"),
        ("GET", f"medias/{photo.id}"),
        ("DELETE", f"medias/{photo.id}"),
        ("DELETE", "medias"),
        ("DELETE", f"resources/{photo.resources[0].id}"),
        ("GET", f"md5/{photo.resources[0].id}"),
    ):
        assert (await site.ask(method, f"{API}/media/{path}"))[0] == 541
    assert (await site.ask("GET", f"/data/media/{photo.resources[0].id}"))[0] == 404
    site.media.index(0.0)
    site.media.tick(1.0)
    assert (await site.ask("GET", f"{API}/media/medias/{photo.id}"))[0] == 200


# -- notifications


async def test_media_changes_reach_every_websocket(site: Site) -> None:
    async with (
        site.client.ws_connect(f"{API}/media/notifications") as one,
        site.client.ws_connect(f"{API}/media/notifications") as two,
    ):
        await one.send_str("what a client says means nothing")
        burst = site.media.begin(video=False, mode="BURST", date=DATE)
        files = [site.media.develop(burst, MediaKind.JPG, number, Scene(), DATE) for number in (1, 2)]
        site.media.add(burst, files)
        await site.ask("DELETE", f"{API}/media/medias")
        for listener in (one, two):
            observed = [await listener.receive_json(timeout=5.0) for _ in range(3)]
            assert [event["name"] for event in observed] == ["media_created", "resource_created", "all_media_removed"]
            assert observed[0]["data"]["media"]["media_id"] == burst.id
            assert [file["resource_id"] for file in observed[0]["data"]["media"]["resources"]] == [files[0].id]
            assert observed[1]["data"]["resource"]["resource_id"] == files[1].id
            assert observed[2]["data"] == {}


async def test_websocket_that_does_not_read_is_closed(site: Site) -> None:
    async with site.client.ws_connect(f"{API}/media/notifications") as deaf:
        for _ in range(MAX_UNREAD + 1):
            site.media.notify("media_removed", {"media_id": "x"})
        kinds = [(await deaf.receive(timeout=5.0)).type]
        while kinds[-1] is aiohttp.WSMsgType.TEXT:
            kinds.append((await deaf.receive(timeout=5.0)).type)
        assert kinds[-1] in (aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.ERROR)
        assert len(kinds) < MAX_UNREAD
    async with site.client.ws_connect(f"{API}/media/notifications") as again:
        site.media.notify("media_removed", {"media_id": "y"})
        assert (await again.receive_json(timeout=5.0))["data"] == {"media_id": "y"}


async def test_a_client_that_talks_too_much_is_closed(site: Site) -> None:
    async with site.client.ws_connect(f"{API}/media/notifications") as chatty:
        await chatty.send_str("x" * 100_000)
        message = await chatty.receive(timeout=5.0)
        assert (message.type, message.data) == (aiohttp.WSMsgType.CLOSE, aiohttp.WSCloseCode.MESSAGE_TOO_BIG)


# -- flight plans


async def test_a_plan_is_kept(site: Site) -> None:
    status, uid = await site.ask("PUT", f"{API}/upload/flightplan", data=PLAN)
    assert status == 200
    assert site.plans.get(uid) == PLAN
    assert await site.ask("GET", f"{API}/upload/flightplans") == (200, [{"uid": uid, "date": DATE}])
    status, observed = await site.ask("GET", f"{API}/upload/flightplan/{uid}")
    assert (status, observed["uid"]) == (200, uid)
    assert (await site.ask("DELETE", f"{API}/upload/flightplan/{uid}"))[0] == 200
    assert (await site.ask("DELETE", f"{API}/upload/flightplan/{uid}"))[0] == 404
    assert await site.ask("GET", f"{API}/upload/flightplans") == (200, [])


@pytest.mark.parametrize(
    ("data", "status", "words"),
    [
        (b"", 400, "empty"),
        (b" \r\n", 400, "empty"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe", 400, "text"),
        (b"QGC WPL 120\0", 400, "NUL"),
        (b"x" * (MAX_BODY + 1), 413, str(MAX_BODY)),
    ],
)
async def test_upload_of_an_invalid_plan_is_refused(site: Site, data: bytes, status: int, words: str) -> None:
    got, observed = await site.ask("PUT", f"{API}/upload/flightplan", data=data)
    assert got == status
    assert words in observed["error"]
    assert site.plans.list() == ()


async def test_a_body_of_unknown_length_has_the_same_limit(site: Site) -> None:
    async def endless() -> AsyncIterator[bytes]:
        for _ in range(MAX_BODY // 65536 + 2):
            yield b"x" * 65536

    assert (await site.ask("PUT", f"{API}/upload/flightplan", data=endless()))[0] == 413
    assert site.plans.list() == ()


async def test_upload_that_its_client_gives_up_is_no_error(site: Site, caplog: pytest.LogCaptureFixture) -> None:
    _, writer = await asyncio.open_connection("127.0.0.1", site.server.port)
    writer.write(
        b"PUT " + f"{API}/upload/flightplan".encode() + b" HTTP/1.1\r\nHost: x\r\nContent-Length: 99\r\n\r\nQGC"
    )
    await writer.drain()
    assert (await site.ask("GET", f"{API}/media/medias"))[0] == 200  # by now it reads the upload, too
    writer.transport.abort()
    assert (await site.ask("GET", f"{API}/media/medias"))[0] == 200
    await site.server.close()  # waits for its handlers
    assert not site.plans.list()
    assert caplog.records == []


async def test_the_wrong_method(site: Site) -> None:
    assert (await site.ask("POST", f"{API}/upload/flightplan", data=PLAN))[0] == 405
    assert (await site.ask("PUT", f"{API}/media/medias", data=b"x"))[0] == 405


@pytest.mark.parametrize(
    "path",
    [
        b"/data/media/../../etc/passwd",
        b"/data/media/..%2f..%2f..%2fetc%2fpasswd",
        b"/data/media/%2e%2e/%2e%2e/etc/passwd",
        b"/data/thumb/..%5c..%5cwindows",
        b"/data/media//etc/passwd",
        b"/api/v1/upload/flightplan/..%2f..%2fsecret",
        b"/data/media/%00",
    ],
)
async def test_no_path_leads_out(site: Site, path: bytes) -> None:
    line = await site.raw(b"GET " + path + b" HTTP/1.1\r\nHost: x\r\n\r\n")
    assert line.split()[1] in (b"404", b"400")


@pytest.mark.parametrize(
    "text",
    [b"\0\1\2\r\n\r\n", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"PUT / HTTP/1.1\r\nContent-Length: -5\r\n\r\n"],
)
async def test_bytes_that_are_no_http_are_refused(site: Site, text: bytes) -> None:
    line = await site.raw(text)
    assert line.split()[1] == b"400"
    assert await site.ask("GET", f"{API}/media/medias") == (200, [])


@pytest.mark.parametrize(
    ("wanted", "first", "end"), [("bytes=0-99", 0, 100), ("bytes=2000-", 2000, None), ("bytes=-5", -5, None)]
)
async def test_range_of_a_video_is_sent(site: Site, wanted: str, first: int, end: int | None) -> None:
    (file,) = site.film().resources
    content = file.content()
    async with site.client.get(f"/data/media/{file.id}", headers={"Range": wanted}) as answer:
        assert answer.status == 206
        assert await answer.read() == content[first:end]
        begin = first % len(content)
        last = len(content) - 1 if end is None else end - 1
        assert answer.headers["Content-Range"] == f"bytes {begin}-{last}/{len(content)}"


async def test_range_behind_the_end_is_refused(site: Site) -> None:
    (file,) = site.film().resources
    async with site.client.get(f"/data/media/{file.id}", headers={"Range": f"bytes={file.size}-"}) as answer:
        assert (answer.status, answer.headers["Content-Range"]) == (416, f"bytes */{file.size}")


async def test_server_without_ranges_sends_the_whole_file(site: Site) -> None:
    """Quirk NO_HTTP_RANGE."""
    site.server.has_ranges = lambda: False
    (file,) = site.film().resources
    async with site.client.get(f"/data/media/{file.id}", headers={"Range": "bytes=5-"}) as answer:
        assert (answer.status, "Accept-Ranges" in answer.headers) == (200, False)
        assert await answer.read() == file.content()


async def test_flight_logs_are_listed_read_and_deleted(site: Site) -> None:
    assert await site.ask("GET", f"{API}/fdr/lite_records") == (200, [])
    for seconds in (3.4, 100.0):
        site.flight_logs.add(DATE, seconds)
    status, (first, second) = await site.ask("GET", f"{API}/fdr/lite_records")
    assert (status, first) == (
        200,
        {"name": "log-1.bin", "date": DATE, "size": 3 * BLOCK, "url": "/data/fdr/log-1.bin"},
    )
    status, whole = await site.ask("GET", second["url"])
    assert (status, len(whole)) == (200, 100 * BLOCK)
    assert whole[BLOCK * 70 :].startswith(f"log-2.bin {DATE} second 70 .".encode())
    for first_byte, end in ((0, 1), (1000, 70_000), (65_536, 65_537), (1, 102_400)):
        wanted = {"Range": f"bytes={first_byte}-{end - 1}"}
        assert await site.ask("GET", second["url"], headers=wanted) == (206, whole[first_byte:end])
    for path in (f"{API}/fdr/lite_records/log-3.bin", "/data/fdr/log-3.bin"):
        assert (await site.ask("DELETE" if "api" in path else "GET", path))[0] == 404
    assert (await site.ask("DELETE", f"{API}/fdr/lite_records/log-1.bin"))[0] == 200
    status, left = await site.ask("GET", f"{API}/fdr/lite_records")
    assert [log["name"] for log in left] == ["log-2.bin"]
