"""The status of the gateway over HTTP: a page, JSON, and metrics for Prometheus.

All of it is read only: nothing on it commands a drone.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import msgspec
from aiohttp import web

from anafi_mav.status_record import PATH, GatewayStatus
from anafi_mav.web.live_page import FOLDER, HTML, serve_file
from anafi_mav.web.metrics import CONTENT_TYPE, exposition
from anafi_mav.web.server import HttpServer

PAGE = "/status"
METRICS = "/metrics"

MAX_AGE = 0.5
"""s that a record is served again: pages ask once a second, each of them."""

NEVER_STORED = {"Cache-Control": "no-store"}


class StatusRoutes:
    """Serves the status."""

    def __init__(self, server: HttpServer, status: Callable[[], GatewayStatus]) -> None:
        """`status` makes the record."""
        self._make = status
        self._made: tuple[float, GatewayStatus] | None = None
        """The last record, and when it was made (s, loop clock)."""
        server.add_page(PAGE, serve_file((FOLDER / "status.html").read_bytes(), HTML))
        server.add_get("/status.js", serve_file((FOLDER / "status.js").read_bytes(), "text/javascript"))
        server.add_get(PATH, self._json)
        server.add_get(METRICS, self._metrics)

    def _status(self) -> GatewayStatus:
        """Return a record that is at most `MAX_AGE` old."""
        now = asyncio.get_running_loop().time()
        if self._made is None or now - self._made[0] > MAX_AGE:
            self._made = (now, self._make())
        return self._made[1]

    async def _json(self, request: web.Request) -> web.Response:
        body = msgspec.json.encode(self._status())
        return web.Response(body=body, content_type="application/json", headers=NEVER_STORED)

    async def _metrics(self, request: web.Request) -> web.Response:
        # In a thread: text for 250 drones takes longer than a setpoint may wait.
        body = await asyncio.to_thread(exposition, self._status())
        return web.Response(
            body=body.encode(), headers={"Content-Type": CONTENT_TYPE + "; charset=utf-8", **NEVER_STORED}
        )
