"""The drone's web server, as far as a connecting controller needs it: an empty media index and its notifications.

Parrot's REST API (developer.parrot.com, ANAFI media): ``GET /api/v1/media/medias`` and the websocket
``/api/v1/media/notifications``. Everything else is 404 until it exists.
"""

from __future__ import annotations

import contextlib

from aiohttp import WSCloseCode, web

MAX_BODY = 1 << 20
"""Bytes of a request body that are read; a flight plan of a thousand items is a tenth of it."""

SHUTDOWN = 1.0
"""s that open requests get when the server closes."""


class WebServer:
    """One drone's HTTP server."""

    def __init__(self) -> None:
        self._sockets: set[web.WebSocketResponse] = set()
        app = web.Application(client_max_size=MAX_BODY)
        app.router.add_get("/api/v1/media/medias", self._medias)
        app.router.add_get("/api/v1/media/notifications", self._notifications)
        app.on_shutdown.append(self._close_sockets)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN)
        self.port = 0

    async def start(self, address: str, port: int) -> None:
        """Listen. Raises `OSError` when the port is taken or not permitted; 0 lets the system choose."""
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, address, port).start()
        except BaseException:
            await self._runner.cleanup()
            raise
        self.port = self._runner.addresses[0][1]

    async def close(self) -> None:
        """Stop. Idempotent."""
        await self._runner.cleanup()

    async def _medias(self, request: web.Request) -> web.Response:
        return web.json_response([])

    async def _notifications(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(heartbeat=30.0)
        await socket.prepare(request)
        self._sockets.add(socket)
        try:
            async for _ in socket:
                pass  # What a client says here means nothing.
        finally:
            self._sockets.discard(socket)
        return socket

    async def _close_sockets(self, app: web.Application) -> None:
        for socket in list(self._sockets):
            with contextlib.suppress(ConnectionError):
                await socket.close(code=WSCloseCode.GOING_AWAY)
