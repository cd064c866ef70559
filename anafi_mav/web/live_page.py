"""The pages for browsers: the list of drones at "/", the live picture at "/drone/SYSID".

Their files lie in the folder `page` and are read once. The list of drones is JSON at "/drones", which the pages request
every second. The picture comes from `live_video`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import msgspec
from aiohttp import web

from anafi_mav.web.server import HttpServer, RequestCallback

FOLDER = Path(__file__).parent / "page"

HTML = "text/html"

FILES: Final = {
    "/": ("index.html", HTML),
    "/live.css": ("live.css", "text/css"),
    "/answers.js": ("answers.js", "text/javascript"),
    "/live.js": ("live.js", "text/javascript"),
    "/drone.js": ("drone.js", "text/javascript"),
    "/picture.js": ("picture.js", "text/javascript"),
}
"""Path: file and its type. Nothing else of the folder is served."""

DRONE_PAGE: Final = (r"/drone/{sysid:\d{1,3}}", "drone.html")
"""The path of each drone, and its file."""


class DroneEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One drone as the page lists it."""

    name: str
    sysid: int
    model: str
    """Title for people; empty while the drone has never been connected."""
    connected: bool
    problem: str
    """Reason why it is not connected; empty while it is."""
    stream: str
    """The stream that it shows; empty: no picture can be watched."""


class LivePage:
    """Serves the pages and their list."""

    def __init__(self, server: HttpServer, drones: Callable[[], Sequence[DroneEntry]]) -> None:
        """`drones` returns the entries in the order of the configuration."""
        self._drones = drones
        for path, (name, kind) in FILES.items():
            add = server.add_page if kind == HTML else server.add_get
            add(path, serve_file((FOLDER / name).read_bytes(), kind))
        path, name = DRONE_PAGE
        server.add_page(path, serve_file((FOLDER / name).read_bytes(), HTML))
        server.add_get("/drones", self._list)

    async def _list(self, request: web.Request) -> web.Response:
        body = msgspec.json.encode(list(self._drones()))
        return web.Response(body=body, content_type="application/json", headers={"Cache-Control": "no-store"})


def serve_file(content: bytes, kind: str) -> RequestCallback:
    async def answer(request: web.Request) -> web.Response:
        return web.Response(body=content, content_type=kind, charset="utf-8", headers={"Cache-Control": "no-cache"})

    return answer
