"""The page for browsers and its list of drones, over real sockets."""

from __future__ import annotations

import re

import aiohttp
import pytest
from support.world import loopback, world

from anafi_mav.config import Config, DroneConfig, HttpConfig
from anafi_mav.errors import ConfigError
from anafi_mav.gateway import Gateway
from anafi_mav.web.live_page import FILES, DroneEntry, LivePage
from anafi_mav.web.server import HttpServer

ALPHA = DroneEntry(name="alpha", sysid=1, model="ANAFI 4K", connected=True, problem="", stream="visible")
BRAVO = DroneEntry(name="bravo", sysid=7, model="", connected=False, problem="no answer yet", stream="")


async def test_page_and_all_that_it_names_are_served() -> None:
    server = HttpServer(port=0)
    LivePage(server, list)
    await server.start()
    try:
        async with aiohttp.ClientSession(f"http://127.0.0.1:{server.port}") as client:
            for path, (_, kind) in FILES.items():
                async with client.get(path) as answer:
                    assert answer.status == 200
                    assert answer.headers["Content-Type"] == f"{kind}; charset=utf-8"
                    text = await answer.text()
                    assert {*re.findall(r'(?:href|src)="([^"]+)"', text)} <= {*FILES, "/drones", "/status"}
    finally:
        await server.close()


async def test_list_has_each_drone_in_order() -> None:
    server = HttpServer(port=0)
    LivePage(server, lambda: [BRAVO, ALPHA])
    await server.start()
    try:
        async with aiohttp.ClientSession() as client, client.get(f"http://127.0.0.1:{server.port}/drones") as answer:
            assert answer.content_type == "application/json"
            assert await answer.json() == [
                {
                    "name": "bravo",
                    "sysid": 7,
                    "model": "",
                    "connected": False,
                    "problem": "no answer yet",
                    "stream": "",
                },
                {
                    "name": "alpha",
                    "sysid": 1,
                    "model": "ANAFI 4K",
                    "connected": True,
                    "problem": "",
                    "stream": "visible",
                },
            ]
    finally:
        await server.close()


async def test_gateway_lists_its_drone_and_closes_the_server() -> None:
    async with world(sysid=7) as w, aiohttp.ClientSession() as client:
        server = w.gateway.web
        assert server is not None
        async with client.get(f"http://127.0.0.1:{server.port}/drones") as answer:
            (entry,) = await answer.json()
        assert entry == {
            "name": "alpha",
            "sysid": 7,
            "model": "ANAFI 4K",
            "connected": True,
            "problem": "",
            "stream": "visible",
        }
        assert w.gateway.lines()[-1] == f"web page http://127.0.0.1:{server.port}/"
    assert server.port == 0


async def test_gateway_with_a_busy_web_port_opens_nothing() -> None:
    host = loopback()
    taken = HttpServer(host, 0)
    await taken.start()
    config = Config(
        endpoints=(f"tcpin://{host}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=host),),
        http=HttpConfig(host=host, port=taken.port),
    )
    gateway = Gateway(config)
    try:
        with pytest.raises(ConfigError, match=r"^http\.port: "):
            await gateway.start()
        assert gateway.systems == ()
        again = Gateway(Config(endpoints=config.endpoints, drones=config.drones, http=False))
        await again.open()  # the endpoint and the state folder are free
        await again.close()
        assert again.web is None
    finally:
        await taken.close()
