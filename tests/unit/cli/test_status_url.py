"""`anafi-mav status --url`: which token goes where."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import pytest
from aiohttp import web
from support.product import program

from anafi_mav.access_token import VARIABLE, AccessToken, load_token
from anafi_mav.cli.status import AskedGateway, fetch, find
from anafi_mav.config import Config, DroneConfig
from anafi_mav.config.schema import HttpConfig
from anafi_mav.errors import AnafiMavError, ConfigError
from anafi_mav.gateway import Gateway
from anafi_mav.state_lock import STATE_WRITER, StateLock
from anafi_mav.web.server import HttpServer

ELSEWHERE = "http://192.168.1.7:8088/"
GIVEN = "g" * 43


@pytest.fixture
def own(tmp_path: Path) -> str:
    """The token of this computer's gateway."""
    return load_token(tmp_path).text


def token_for(folder: Path, url: str, token: str | None = None) -> str | None:
    found = find(str(folder), url, token).token
    return None if found is None else found.text


@pytest.mark.parametrize(
    "url", [ELSEWHERE, "https://drones.example/", "http://127.0.0.1.example:8088", "http://[fe80::1]/"]
)
def test_token_of_this_computer_goes_to_no_other(tmp_path: Path, own: str, url: str) -> None:
    with pytest.raises(ConfigError, match=f"another computer: expected its token in {VARIABLE} or --token") as error:
        find(str(tmp_path), url)
    assert own not in str(error.value)
    assert token_for(tmp_path, url, GIVEN) == GIVEN


@pytest.mark.parametrize("url", ["http://127.0.0.1:8088", "http://localhost:9/", "https://[::1]:8443/"])
def test_token_of_this_computer_goes_to_loopback(tmp_path: Path, own: str, url: str) -> None:
    assert token_for(tmp_path, url) == own
    assert token_for(tmp_path, url, GIVEN) == GIVEN


def test_token_of_this_computer_goes_to_its_gateway(tmp_path: Path, own: str) -> None:
    lock = StateLock(tmp_path)
    assert lock.acquire() is None
    try:
        lock.write((), ELSEWHERE)
        assert token_for(tmp_path, ELSEWHERE.rstrip("/")) == own
        with pytest.raises(ConfigError, match="another computer"):
            find(str(tmp_path), ELSEWHERE.replace("8088", "8089"))
    finally:
        lock.release()


@pytest.mark.parametrize(
    "url", ["192.168.1.7:8088", "http://", "ftp://127.0.0.1/", "http://[::1", "http://127.0.0.1:99999"]
)
def test_text_that_is_no_url_is_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(ConfigError, match="--url: expected a URL"):
        find(str(tmp_path), url)


@pytest.mark.parametrize("host", ["a..b", "a" * 64])
def test_host_that_no_name_server_can_be_asked_for_is_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(ConfigError, match="--url: expected the host of a URL"):
        find(str(tmp_path), f"http://{host}/", GIVEN)


def test_token_with_a_line_end_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--token: expected a text of ASCII"):
        find(str(tmp_path), ELSEWHERE, "x\r\nHost: y")


async def test_gateway_that_is_starting_is_found(tmp_path: Path) -> None:
    """Its web server answers as soon as it is open, while the simulator still starts."""
    drone = DroneConfig(name="alpha", sysid=1, address="127.0.0.1")
    endpoints, http = ("udpout://127.0.0.1:9",), HttpConfig(port=0)
    gateway = Gateway(Config(endpoints=endpoints, drones=(drone,), state=str(tmp_path), http=http, video=False))
    await gateway.open()
    try:
        assert await STATE_WRITER.drain(5.0)
        assert gateway.web is not None
        assert find(str(tmp_path), None).url == gateway.web.describe()
    finally:
        await gateway.close()


@pytest.fixture
async def asked() -> AsyncIterator[tuple[HttpServer, list[str | None]]]:
    """A server that notes the Authorization headers of requests for a status, and sends none."""
    server, seen = HttpServer(port=0), list[str | None]()

    async def refuse(request: web.Request) -> web.Response:
        seen.append(request.headers.get("Authorization"))
        raise web.HTTPNotFound

    server.add_get("/status.json", refuse)
    await server.start()
    yield server, seen
    await server.close()


async def test_token_of_the_environment_is_sent(asked: tuple[HttpServer, list[str | None]]) -> None:
    server, seen = asked
    words = (sys.executable, "-m", "anafi_mav", "status", "--url", server.describe())
    async with program(*words, env={VARIABLE: GIVEN}) as held:
        await held.end()
        assert GIVEN not in str(held)
    assert seen == [f"Bearer {GIVEN}"]


async def test_redirection_takes_the_token_nowhere(asked: tuple[HttpServer, list[str | None]]) -> None:
    server, seen = asked
    first = HttpServer(port=0)

    async def redirect(request: web.Request) -> web.Response:
        raise web.HTTPFound(server.describe() + "status.json")

    first.add_get("/status.json", redirect)
    await first.start()
    try:
        async with aiohttp.ClientSession() as session:
            with pytest.raises(AnafiMavError, match="302"):
                await fetch(session, AskedGateway(first.describe(), AccessToken(GIVEN)))
    finally:
        await first.close()
    assert seen == []
