"""A scripted drone whose web server gives the answers that a test wants."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from aiohttp import web

from anafi_mav.arsdk.messages import common, mediastore
from anafi_mav.arsdk.messages.mediastore import MediastoreState
from anafi_mav.drone import Drone
from support.scripted_device import STATES, ScriptedDevice


@asynccontextmanager
async def serving(work: float = 0.0, **answers: web.Response) -> AsyncIterator[tuple[Drone, ScriptedDevice]]:
    """A scripted drone whose web server gives these answers by the last part of the path.

    It needs `work` s for each.
    """

    async def answer(request: web.Request) -> web.StreamResponse:
        await asyncio.sleep(work)
        name = request.path.rpartition("/")[2]
        found = answers.get(name) or answers.get(f"f{name}")
        return web.Response(status=404) if found is None else web.Response(body=found.body, status=found.status)

    async def websocket(request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        for text in ("nonsense", "[]", '{"data": {}}', '{"name": "media_created", "data": {"media": 5}}'):
            await socket.send_str(text)
        await socket.send_bytes(b"\0")
        await socket.close()
        return socket

    app = web.Application()
    app.router.add_get("/api/v1/media/notifications", websocket)
    app.router.add_route("*", "/{path:.*}", answer)
    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    async with ScriptedDevice() as device:
        device.script[common.AllStates] = lambda _: [
            *STATES,
            mediastore.State(MediastoreState.INDEXED),
            mediastore.Counters(1, 2, 3, 4),
            common.AllStatesChanged(),
        ]
        drone = device.drone(http_port=runner.addresses[0][1])
        await drone.connect()
        try:
            yield drone, device
        finally:
            await drone.close()
            await runner.cleanup()


def json_answer(value: object) -> web.Response:
    return web.Response(body=json.dumps(value).encode())
