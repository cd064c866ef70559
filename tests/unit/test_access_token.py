"""The token of a web server that other computers can reach: who passes, and where it is kept."""

from __future__ import annotations

import asyncio
import os
import re
import stat
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import pytest
from aiohttp import web
from support.world import loopback

from anafi_mav.access_token import FILE, AccessToken, load_token, read_token
from anafi_mav.config import Config, DroneConfig, HttpConfig, VideoConfig
from anafi_mav.gateway import Gateway
from anafi_mav.web.server import HttpServer

TOKEN = AccessToken("t" * 43)


async def page(request: web.Request) -> web.Response:
    return web.Response(text="page")


@pytest.fixture
async def server() -> AsyncIterator[HttpServer]:
    server = HttpServer(port=0)
    server.token = TOKEN
    server.add_page("/", page)
    server.add_get("/status.json", page)
    server.add_post("/whep/1", page)
    await server.start()
    yield server
    await server.close()


def at(server: HttpServer, path: str) -> str:
    return f"http://127.0.0.1:{server.port}{path}"


async def test_request_without_the_token_is_refused_and_counted(server: HttpServer) -> None:
    async with aiohttp.ClientSession() as client:
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Authorization": f"Basic {TOKEN.text}"}):
            for request in (
                client.get(at(server, "/status.json"), headers=headers),
                client.post(at(server, "/whep/1")),
            ):
                async with request as answer:
                    assert answer.status == 401
                    assert answer.headers["WWW-Authenticate"].startswith("Bearer")
                    assert TOKEN.text not in await answer.text()
    assert server.refused["token"] == 6


async def test_connection_without_the_token_keeps_no_place(server: HttpServer) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"GET /status.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    answer = await reader.read()  # to the end of the connection, for which a client could also be silent for long
    assert answer.startswith(b"HTTP/1.1 401 ")
    assert b"\r\nConnection: close\r\n" in answer
    assert server.connections == 0
    writer.close()


async def test_bearer_token_passes(server: HttpServer) -> None:
    async with aiohttp.ClientSession(headers={"Authorization": f"Bearer {TOKEN.text}"}) as client:
        for path in ("/", "/status.json"):
            async with client.get(at(server, path)) as answer:
                assert answer.status == 200
        async with client.post(at(server, "/whep/1")) as answer:
            assert answer.status == 200


async def test_link_with_the_token_gives_a_cookie_for_everything(server: HttpServer) -> None:
    jar = aiohttp.CookieJar(unsafe=True)  # of an IP address
    async with aiohttp.ClientSession(cookie_jar=jar) as client:
        async with client.get(at(server, f"/?token={TOKEN.text}"), allow_redirects=False) as answer:
            assert (answer.status, answer.headers["Location"]) == (303, "/")
            cookie = answer.headers["Set-Cookie"]
            assert "HttpOnly" in cookie
            assert "SameSite=Lax" in cookie
        async with client.get(at(server, "/status.json")) as answer:
            assert answer.status == 200
        async with client.post(at(server, "/whep/1")) as answer:
            assert answer.status == 200


async def test_token_in_the_query_of_anything_but_a_page_is_refused(server: HttpServer) -> None:
    async with aiohttp.ClientSession() as client:
        for path in (f"/status.json?token={TOKEN.text}", f"//evil.example/?token={TOKEN.text}", "/?token=wrong"):
            async with client.get(at(server, path), allow_redirects=False) as answer:
                assert answer.status == 401


def test_token_is_kept_for_its_owner_alone(tmp_path: Path) -> None:
    made = load_token(tmp_path)
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600
    assert load_token(tmp_path).text == made.text
    assert made.text not in repr(made)
    (tmp_path / FILE).write_text("short\n")
    assert read_token(tmp_path) is None
    assert load_token(tmp_path).text != made.text


def test_token_that_others_could_read_is_replaced(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    seen = load_token(tmp_path).text
    (tmp_path / FILE).chmod(0o640)
    assert load_token(tmp_path).text != seen
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600
    assert "other users could read it" in caplog.text
    assert seen not in caplog.text


@pytest.mark.skipif(os.name != "posix", reason="the pipes are those of POSIX")
def test_pipe_in_place_of_the_token_is_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / FILE)
    made = load_token(tmp_path)
    assert (tmp_path / FILE).is_file()
    found = read_token(tmp_path)
    assert found is not None
    assert found.text == made.text


async def test_gateway_open_to_the_network_needs_the_token_it_keeps(tmp_path: Path) -> None:
    host = loopback()
    config = Config(
        endpoints=(f"tcpin://{host}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=host),),
        http=HttpConfig(host="0.0.0.0", port=0),
        video=VideoConfig(rtsp_port=0),
        state=str(tmp_path),
    )
    gateway = Gateway(config)
    await gateway.open()
    try:
        assert gateway.web is not None
        kept = read_token(tmp_path)
        assert kept is not None
        async with aiohttp.ClientSession() as client:
            paths = {path for _, path in gateway.web.routes}
            assert {"/", "/status", "/status.json", "/metrics", "/drones", "/whep/{drone}"} <= paths
            for method, path in gateway.web.routes:
                filled = re.sub(r"{[^}]*}", "1", path)
                async with client.request(method, at(gateway.web, filled)) as answer:
                    assert answer.status == 401, f"{method} {path}"
            bearer = {"Authorization": f"Bearer {kept.text}"}
            async with client.get(at(gateway.web, "/metrics"), headers=bearer) as answer:
                assert answer.status == 200
    finally:
        await gateway.close()


@pytest.mark.parametrize(("video", "web"), [("0.0.0.0", "127.0.0.1"), ("127.0.0.1", "0.0.0.0"), ("0.0.0.0", "0.0.0.0")])
async def test_video_and_web_open_to_the_network_have_one_token(tmp_path: Path, video: str, web: str) -> None:
    host = loopback()
    config = Config(
        endpoints=(f"tcpin://{host}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=host),),
        http=HttpConfig(host=web, port=0),
        video=VideoConfig(host=video, rtsp_port=0),
        state=str(tmp_path),
    )
    gateway = Gateway(config)
    await gateway.open()
    try:
        kept = read_token(tmp_path)
        assert kept is not None
        assert gateway.relay is not None
        assert gateway.web is not None
        for server, address in ((gateway.relay, video), (gateway.web, web)):
            found = None if server.token is None else server.token.text
            assert found == (kept.text if address == "0.0.0.0" else None)
    finally:
        await gateway.close()
