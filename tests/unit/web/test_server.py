"""The gateway's HTTP server over real sockets: what it serves, to whom, and what it refuses."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import zlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import aiohttp
import pytest
from aiohttp import web
from support.world import loopback

from anafi_mav.access_token import AccessToken
from anafi_mav.errors import ConfigError, LocalProtocolError
from anafi_mav.web import server as server_module
from anafi_mav.web.server import FIRST_REQUEST_LIMIT, MAX_BODY, MAX_CONNECTIONS, HttpServer


async def name(request: web.Request) -> web.Response:
    return web.Response(text=request.match_info.get("name", "root"))


async def length(request: web.Request) -> web.Response:
    return web.Response(text=str(len(await request.read())))


@asynccontextmanager
async def serving(
    host: str = "127.0.0.1", port: int | None = 0, names: tuple[str, ...] = ()
) -> AsyncIterator[HttpServer]:
    server = HttpServer(host, port, names=names)
    server.add_page("/", name)
    server.add_get("/files/{name}", name)
    server.add_post("/length", length)
    await server.start()
    try:
        yield server
    finally:
        await server.close()


async def get(server: HttpServer, path: str = "/", **headers: str) -> tuple[int, str, dict[str, str]]:
    url = server.url_for("127.0.0.1", "/")
    assert url is not None
    async with aiohttp.ClientSession() as client, client.get(f"{url[:-1]}{path}", headers=headers) as answer:
        return answer.status, await answer.text(), dict(answer.headers)


async def raw(server: HttpServer, request: bytes) -> bytes:
    """The answer to bytes as they are, until the server closes."""
    reader, writer = await asyncio.open_connection(server.host, server.port)
    writer.write(request)
    answer = await asyncio.wait_for(reader.read(), 60.0)
    writer.close()
    return answer


async def test_route_answers_with_headers_against_foreign_pages() -> None:
    async with serving() as server:
        status, text, headers = await get(server, "/files/a.jpg")
        assert (status, text) == (200, "a.jpg")
        assert "Access-Control-Allow-Origin" not in headers
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8088", 200),
        ("localhost", 200),
        ("LOCALHOST.", 200),
        ("192.168.1.5:80", 200),
        ("[::1]:80", 200),
        ("drones.example:8088", 200),
        ("evil.example", 403),
        ("127.0.0.1.evil.example", 403),
        ("localhost.evil.example", 403),
        ("evil.example@127.0.0.1", 200),  # what precedes @ is no host
        ("[", 403),
        ("", 403),
    ],
)
async def test_foreign_host_header_is_refused(host: str, status: int) -> None:
    async with serving(names=("Drones.Example",)) as server:
        answer = await raw(server, f"GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
        assert answer.startswith(f"HTTP/1.1 {status} ".encode())


async def test_request_of_a_foreign_page_is_refused() -> None:
    async with serving() as server:
        own = f"127.0.0.1:{server.port}"
        assert (await get(server, Origin=f"http://{own}"))[0] == 200
        for origin in ("http://evil.example", "null", f"http://127.0.0.1:{server.port + 1}", "http://["):
            assert (await get(server, Origin=origin))[0] == 403, origin


async def test_refused_request_without_the_token_ends_its_connection() -> None:
    """It would else keep its place among the connections by another request now and then."""
    async with serving() as server:
        server.token = AccessToken("t" * 43)
        for line in ("Host: evil.example", "Host: localhost\r\nOrigin: null", "Host: localhost"):
            answer = await raw(server, f"GET / HTTP/1.1\r\n{line}\r\n\r\n".encode())
            assert answer.startswith((b"HTTP/1.1 403 ", b"HTTP/1.1 401 ")), line
            assert b"\r\nConnection: close\r\n" in answer, line


def fetched(site: str, mode: str, dest: str) -> dict[str, str]:
    return {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": dest}


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
async def test_other_site_opens_pages_and_embeds_nothing(site: str) -> None:
    async with serving() as server:
        assert (await get(server, "/files/a", **fetched(site, "no-cors", "image")))[0] == 403
        assert (await get(server, "/files/a", **fetched(site, "navigate", "document")))[0] == 403
        assert (await get(server, "/", **fetched(site, "no-cors", "image")))[0] == 403
        assert (await get(server, "/", **fetched(site, "navigate", "iframe")))[0] == 403
        assert (await get(server, "/", **fetched(site, "navigate", "document")))[0] == 200
        for own in ("same-origin", "none"):
            assert (await get(server, "/files/a", **fetched(own, "no-cors", "image")))[0] == 200


@pytest.mark.parametrize(
    "path",
    [
        "/files/../../etc/passwd",
        "/files/..",
        "/files/%2e%2e",
        "/files/..%2f..%2fetc%2fpasswd",
        "/files/..%5c..%5cboot.ini",
        "/files/a%00b",
        "/nothing",
    ],
)
async def test_path_outside_of_the_routes_is_not_found(path: str) -> None:
    async with serving() as server:
        answer = await raw(server, f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        assert answer.startswith((b"HTTP/1.1 404 ", b"HTTP/1.1 400 ")), answer


async def test_body_over_the_limit_is_refused() -> None:
    async with serving() as server, aiohttp.ClientSession() as client:
        url = f"http://127.0.0.1:{server.port}/length"
        async with client.post(url, data=bytes(MAX_BODY)) as answer:
            assert (answer.status, await answer.text()) == (200, str(MAX_BODY))
        async with client.post(url, data=bytes(MAX_BODY + 1)) as answer:
            assert answer.status == 413


async def test_garbage_is_answered_and_closed(caplog: pytest.LogCaptureFixture) -> None:
    async with serving() as server:
        assert (await raw(server, b"\0\1\2\r\n\r\n")).startswith(b"HTTP/1.0 400 ")
        assert b" 400 " in await raw(server, b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n")
        assert (await get(server))[0] == 200
    assert [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")] == []


POST = b"POST /length HTTP/1.1\r\nHost: localhost\r\n"


async def test_body_in_a_wrong_encoding_is_a_bad_request(caplog: pytest.LogCaptureFixture) -> None:
    async with serving() as server:
        body = b"Content-Encoding: gzip\r\nContent-Length: 3\r\n\r\nv=0"
        assert (await raw(server, POST + body)).startswith(b"HTTP/1.1 400 ")
    assert [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")] == []


async def test_compressed_body_over_the_limit_is_refused() -> None:
    body = zlib.compress(bytes(1000 * MAX_BODY))
    assert len(body) < MAX_BODY
    async with serving() as server:
        head = f"Content-Encoding: deflate\r\nContent-Length: {len(body)}\r\n\r\n".encode()
        assert (await raw(server, POST + head + body)).startswith((b"HTTP/1.1 413 ", b"HTTP/1.1 400 "))


async def test_client_that_leaves_within_its_body_is_no_error(caplog: pytest.LogCaptureFixture) -> None:
    async with serving() as server:
        reader, writer = await asyncio.open_connection(server.host, server.port)
        writer.write(POST + b"Expect: 100-continue\r\nContent-Length: 1000\r\n\r\n")
        await reader.readuntil(b"\r\n\r\n")
        writer.close()
        while server.connections:  # noqa: ASYNC110
            await asyncio.sleep(0)
    assert [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")] == []


async def test_connection_without_request_is_closed_in_time() -> None:
    async with serving() as server:
        begun = asyncio.get_running_loop().time()
        assert await raw(server, b"GET / HTTP/1.1\r\nHost: loc") == b""
        assert asyncio.get_running_loop().time() - begun == pytest.approx(FIRST_REQUEST_LIMIT, abs=1.0)


async def test_request_without_its_body_frees_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "BODY_LIMIT", 0.05)
    monkeypatch.setattr(server_module, "LINGER_LIMIT", 0.05)
    async with serving() as server:
        head = b"POST /length HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n"
        answers = await asyncio.gather(*(raw(server, head) for _ in range(MAX_CONNECTIONS)))
        assert all(answer.startswith(b"HTTP/1.1 408 ") for answer in answers)
        assert (await get(server))[0] == 200


async def test_client_that_stops_reading_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "STALL_LIMIT", 0.1)
    monkeypatch.setattr(server_module, "STALL_PERIOD", 0.02)
    ended = asyncio.get_running_loop().create_future()

    async def endless(request: web.Request) -> web.StreamResponse:
        response = web.StreamResponse()
        try:
            await response.prepare(request)
            while True:
                await response.write(bytes(1 << 16))
        except ConnectionError:
            ended.set_result(None)
            return response

    server = HttpServer("127.0.0.1", 0)
    server.add_get("/endless", endless)
    await server.start()
    _, writer = await asyncio.open_connection(server.host, server.port)
    writer.write(b"GET /endless HTTP/1.1\r\nHost: localhost\r\n\r\n")
    await asyncio.wait_for(ended, 60.0)  # the reader takes 128 kB and no more
    writer.close()
    await server.close()


async def test_connection_over_the_limit_is_closed() -> None:
    async with serving() as server:
        held = [await asyncio.open_connection("127.0.0.1", server.port) for _ in range(MAX_CONNECTIONS)]
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        with contextlib.suppress(ConnectionError):  # a reset is as good as an end
            assert await reader.read() == b""
        assert server.refused_connections == 1
        for _, other in (*held, (reader, writer)):
            other.close()


async def test_connections_over_the_limit_at_once_are_closed() -> None:
    """The event loop accepts all of them in one iteration."""
    async with serving() as server:
        held = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(MAX_CONNECTIONS + 6)]
        with contextlib.suppress(ConnectionError):  # a reset is as good as an end
            assert await raw(server, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n") == b""
        assert server.refused_connections == 7
        for client in held:
            client.close()


async def test_busy_port_is_named_with_its_key() -> None:
    async with serving() as first:
        with pytest.raises(ConfigError, match=rf"http\.port: 127\.0\.0\.1:{first.port} is in use"):
            await HttpServer("127.0.0.1", first.port).start()


async def test_address_of_another_computer_is_named_with_its_key() -> None:
    with pytest.raises(ConfigError, match=r"http\.host: expected an address of this computer, got 192\.0\.2\.1"):
        await HttpServer("192.0.2.1", 0).start()


async def test_default_port_in_use_is_replaced_by_a_free_one() -> None:
    host = loopback()
    async with serving(host, None) as first, serving(host, None) as second:
        assert first.port == 8088
        assert second.port not in (0, 8088)
        assert second.describe() == f"http://{host}:{second.port}/"


@pytest.mark.parametrize(
    ("bound", "local_host", "host"),
    [
        ("127.0.0.1", "127.0.0.1", "127.0.0.1"),
        ("127.0.0.1", "127.3.4.5", "127.0.0.1"),
        ("127.0.0.1", "localhost", "127.0.0.1"),
        ("127.0.0.1", "192.168.1.5", None),
        ("127.0.0.1", None, None),
        ("0.0.0.0", "192.168.1.5", "192.168.1.5"),
        ("0.0.0.0", "127.0.0.1", "127.0.0.1"),
        ("0.0.0.0", "drones.example", "drones.example"),
        ("0.0.0.0", None, None),
    ],
)
async def test_url_has_the_address_that_the_client_reaches(
    bound: str, local_host: str | None, host: str | None
) -> None:
    async with serving(bound) as server:
        expected = None if host is None else f"http://{host}:{server.port}/a"
        assert server.url_for(local_host, "/a") == expected


@pytest.mark.parametrize(("bound", "host"), [("0.0.0.0", "Drones.Example"), ("127.0.0.1", "127.0.0.1")])
async def test_public_host_replaces_the_host_of_an_open_server(bound: str, host: str) -> None:
    server = HttpServer(bound, 0, public_host="Drones.Example")
    server.add_page("/", name)
    await server.start()
    assert server.url_for("127.0.0.1", "/a") == f"http://{host}:{server.port}/a"
    request = b"GET / HTTP/1.1\r\nHost: drones.example\r\nConnection: close\r\n\r\n"
    assert (await raw(server, request)).startswith(b"HTTP/1.1 200 ")
    await server.close()


async def test_url_without_open_server_is_none() -> None:
    server = HttpServer("0.0.0.0", 0)
    assert server.url_for("127.0.0.1", "/") is None
    with pytest.raises(LocalProtocolError):
        server.url_for("127.0.0.1", "no/root")


async def test_closing_ends_connections_and_frees_the_port() -> None:
    async with serving() as server:
        port = server.port
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await reader.readuntil(b"root")
        await server.close()
        assert await reader.read() == b""
        writer.close()
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.1", port)) != 0
