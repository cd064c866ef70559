"""The drone's web server: media, notifications, flight logs and flight plans.

Parrot's REST API as developer.parrot.com and Olympe have it (ANAFI media, ``/api/v1/media``; ``/api/v1/upload``), and
GroundSDK (flight logs, ``/api/v1/fdr/lite_records``: HttpFdrClient.java and FlightLogRestApi.swift).
Parrot publishes no answers to mistakes but 541; ours are the plain ones of HTTP with ``{"error": "…"}``.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from aiohttp import WSCloseCode, web
from aiohttp.typedefs import Handler

from anafi_mav.sim.payload.flight_log_store import FlightLogStore
from anafi_mav.sim.payload.media import PART, MediaKind, MediaStore
from anafi_mav.sim.plan.plan_store import FlightPlanStore

MAX_BODY = 1 << 20
"""Bytes of a request body that are read; a flight plan of a thousand items is a tenth of it."""

SENT_PART = 1 << 16
"""Bytes of a file that are sent at a time."""

MAX_UNREAD = 1000
"""Notifications that wait for a client that does not read; then its socket is closed."""

MAX_WORD = 4096
"""Bytes of a websocket message from a client: they mean nothing here."""

SHUTDOWN = 1.0
"""s that open requests get when the server closes."""

NOT_INDEXED = 541
"""Parrot's status for a question about media while there is no index."""

_TYPES = {MediaKind.JPG: "image/jpeg", MediaKind.DNG: "image/x-adobe-dng", MediaKind.MP4: "video/mp4"}

_ORDERS = {"oldest": False, "newest": True}


class WebServer:
    """One drone's HTTP server.

    `properties` are what it says of itself, `date` the time on its clock. `has_ranges` returns False while it ignores
    Range in requests.
    """

    def __init__(
        self,
        media: MediaStore,
        plans: FlightPlanStore,
        flight_logs: FlightLogStore,
        properties: Mapping[str, str],
        date: Callable[[], str],
        has_ranges: Callable[[], bool] = lambda: True,
    ) -> None:
        self._media = media
        self._plans = plans
        self._flight_logs = flight_logs
        self._properties = dict(properties)
        self._date = date
        self.has_ranges = has_ranges
        self._audible = asyncio.Event()
        self._audible.set()
        self.refuses_sockets = False
        """True: no notifications, as a firmware without them."""
        self.served: Counter[str] = Counter()
        """Requests of some kinds so far: "medias", the list."""
        self._listeners: dict[web.WebSocketResponse, tuple[asyncio.Queue[str], asyncio.Transport | None]] = {}
        app = web.Application(client_max_size=MAX_BODY, middlewares=[self._through_the_air])
        api = "/api/v1"
        app.add_routes(
            [
                web.get(f"{api}/info/properties", self._info),
                web.get(f"{api}/media/medias", self._medias),
                web.delete(f"{api}/media/medias", self._delete_all),
                web.get(f"{api}/media/medias/{{id}}", self._one),
                web.delete(f"{api}/media/medias/{{id}}", self._delete),
                web.delete(f"{api}/media/resources/{{id}}", self._delete_resource),
                web.get(f"{api}/media/md5/{{id}}", self._md5),
                web.get(f"{api}/media/notifications", self._notifications),
                web.get("/data/media/{id}", self._file),
                web.get("/data/thumb/{id}", self._thumbnail),
                web.put(f"{api}/upload/flightplan", self._upload),
                web.get(f"{api}/upload/flightplans", self._list_plans),
                web.get(f"{api}/upload/flightplan/{{id}}", self._plan),
                web.delete(f"{api}/upload/flightplan/{{id}}", self._delete_plan),
                web.get(f"{api}/fdr/lite_records", self._list_flight_logs),
                web.delete(f"{api}/fdr/lite_records/{{name}}", self._delete_flight_log),
                web.get("/data/fdr/{name}", self._flight_log),
            ]
        )
        app.on_shutdown.append(lambda app: self.close_sockets())
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN)
        self.port = 0

    async def start(self, address: str, port: int) -> None:
        """Listen.

        Raises `OSError` when the port is taken or not permitted; 0 lets the system choose.
        """
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, address, port).start()
        except BaseException:
            await self._runner.cleanup()
            raise
        self.port = self._runner.addresses[0][1]
        self._media.notify = self._notify

    @property
    def mute(self) -> bool:
        """True: the air is gone, and what is asked waits until it is back."""
        return not self._audible.is_set()

    @mute.setter
    def mute(self, mute: bool) -> None:
        if mute:
            self._audible.clear()
        else:
            self._audible.set()

    async def close(self) -> None:
        """Stop. Idempotent."""
        self._media.notify = _deaf
        self._audible.set()
        await self._runner.cleanup()

    @web.middleware
    async def _through_the_air(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        await self._audible.wait()
        response = await handler(request)
        await self._audible.wait()
        return response

    # -- media

    async def _info(self, request: web.Request) -> web.Response:
        return web.json_response(self._properties)

    async def _medias(self, request: web.Request) -> web.Response:
        self.served["medias"] += 1
        if not self._media.indexed:
            return _not_indexed()
        query = request.query
        order = query.get("sort_order", "oldest")
        if order not in _ORDERS:
            return _refuse(400, f"sort_order: expected oldest or newest, got {order!r}")
        found = [media.describe() for media in self._media]
        if "run_id" in query:
            found = [media for media in found if media["run_id"] == query["run_id"]]
        if "media_type" in query:
            found = [media for media in found if media["type"] == query["media_type"].upper()]
        if "storage" in query:
            found = [media for media in found if media["resources"][0]["storage"] == query["storage"]]
        if "custom_id" in query:
            found = []  # nothing here has one
        return web.json_response(found[::-1] if _ORDERS[order] else found)

    async def _one(self, request: web.Request) -> web.Response:
        if not self._media.indexed:
            return _not_indexed()
        media = self._media.media(request.match_info["id"])
        return _unknown("media") if media is None else web.json_response(media.describe())

    async def _delete(self, request: web.Request) -> web.Response:
        if not self._media.indexed:
            return _not_indexed()
        return web.Response() if self._media.remove(request.match_info["id"]) else _unknown("media")

    async def _delete_all(self, request: web.Request) -> web.Response:
        if not self._media.indexed:
            return _not_indexed()
        self._media.remove_all()
        return web.Response()

    async def _delete_resource(self, request: web.Request) -> web.Response:
        if not self._media.indexed:
            return _not_indexed()
        return web.Response() if self._media.remove_resource(request.match_info["id"]) else _unknown("resource")

    async def _md5(self, request: web.Request) -> web.Response:
        if not self._media.indexed:
            return _not_indexed()
        resource = self._media.resource(request.match_info["id"])
        if resource is None:
            return _unknown("resource")
        # A video may have gigabytes: the drone's link must not wait for their digest.
        md5 = resource.md5() if resource.size < PART else await asyncio.to_thread(resource.md5)
        return web.json_response({"resource_id": resource.id, "media_id": resource.media_id, "md5": md5})

    async def _file(self, request: web.Request) -> web.StreamResponse:
        resource = self._media.resource(request.match_info["id"]) if self._media.indexed else None
        if resource is None:
            return _unknown("file")
        return await self._send(request, resource.size, resource.parts, _TYPES[resource.kind])

    async def _send(
        self, request: web.Request, size: int, parts: Callable[[int, int, int], Iterator[bytes]], content_type: str
    ) -> web.StreamResponse:
        """Send a file part by part.

        All of it, or the one range that the client wants (RFC 9110 §14).
        """
        first, end = 0, size
        headers = {"Accept-Ranges": "bytes"} if self.has_ranges() else {}
        status = 200
        if self.has_ranges() and "Range" in request.headers:
            try:
                first, end, _ = request.http_range.indices(size)
            except ValueError:  # a range that cannot be read is none (RFC 9110 §14.2)
                pass
            else:
                if first >= end:
                    return web.Response(status=416, headers={"Content-Range": f"bytes */{size}"})
                status, headers["Content-Range"] = 206, f"bytes {first}-{end - 1}/{size}"
        response = web.StreamResponse(status=status, headers=headers)
        response.content_type = content_type
        response.content_length = end - first
        await response.prepare(request)
        with contextlib.suppress(ConnectionError):  # the client has left
            for part in parts(first, end, SENT_PART):
                await self._audible.wait()
                await response.write(part)
            await response.write_eof()
        return response

    async def _thumbnail(self, request: web.Request) -> web.Response:
        resource = self._media.by_thumbnail(request.match_info["id"]) if self._media.indexed else None
        if resource is None:
            return _unknown("file")
        return web.Response(body=resource.thumbnail(), content_type="image/jpeg")

    # -- notifications

    def _notify(self, name: str, data: dict[str, Any]) -> None:
        if not self._listeners:
            return
        text = json.dumps({"name": name, "data": data})
        for socket, (queue, transport) in list(self._listeners.items()):
            try:
                queue.put_nowait(text)
            except asyncio.QueueFull:
                # A reader that is too slow is disconnected, and reads everything again when it is back.
                del self._listeners[socket]
                if transport is not None:
                    transport.abort()

    async def _notifications(self, request: web.Request) -> web.StreamResponse:
        if self.refuses_sockets:
            return _unknown("page")
        socket = web.WebSocketResponse(heartbeat=30.0, max_msg_size=MAX_WORD)
        await socket.prepare(request)
        queue: asyncio.Queue[str] = asyncio.Queue(MAX_UNREAD)
        self._listeners[socket] = (queue, request.transport)
        writer = asyncio.create_task(_write(socket, queue, self._audible))
        try:
            async for _ in socket:
                pass  # What a client says here means nothing.
        finally:
            self._listeners.pop(socket, None)
            writer.cancel()
        return socket

    async def close_sockets(self) -> None:
        """Close the websockets of all clients."""
        for socket in list(self._listeners):
            with contextlib.suppress(ConnectionError):
                await socket.close(code=WSCloseCode.GOING_AWAY)

    # -- flight plans

    async def _upload(self, request: web.Request) -> web.Response:
        if request.content_length is not None and request.content_length > MAX_BODY:
            return _refuse(413, f"expected at most {MAX_BODY} bytes, got {request.content_length}")
        try:
            data = await request.read()  # answers 413 by itself when more comes than was announced
        except ConnectionError as error:
            return _refuse(400, f"expected the whole flight plan: {error}")  # for the log: its client is gone
        if not data.strip():
            return _refuse(400, "expected a flight plan, got an empty body")
        try:
            text = data.decode()
        except UnicodeDecodeError as error:
            return _refuse(400, f"expected text: {error}")
        if "\0" in text:
            return _refuse(400, "expected text, got a NUL byte")
        if self._plans.refuses():
            return _refuse(403, "expected no flight plan to be paused")
        # Whether it can be flown is looked at when it is started, as on the aircraft.
        return web.json_response(self._plans.put(data, self._date()))

    async def _list_plans(self, request: web.Request) -> web.Response:
        return web.json_response([{"uid": plan.uid, "date": plan.date} for plan in self._plans.list()])

    async def _plan(self, request: web.Request) -> web.Response:
        plan = self._plans.find(request.match_info["id"])
        if plan is None:
            return _unknown("flight plan")
        return web.json_response({"uid": plan.uid, "date": plan.date, "size": len(plan.data)})

    async def _delete_plan(self, request: web.Request) -> web.Response:
        return web.Response() if self._plans.remove(request.match_info["id"]) else _unknown("flight plan")

    # -- flight logs

    async def _list_flight_logs(self, request: web.Request) -> web.Response:
        self.served["flight logs"] += 1
        return web.json_response([log.describe() for log in self._flight_logs])

    async def _flight_log(self, request: web.Request) -> web.StreamResponse:
        log = self._flight_logs.find(request.match_info["name"])
        if log is None:
            return _unknown("file")
        return await self._send(request, log.size, log.parts, "application/octet-stream")

    async def _delete_flight_log(self, request: web.Request) -> web.Response:
        return web.Response() if self._flight_logs.remove(request.match_info["name"]) else _unknown("flight log")


async def _write(socket: web.WebSocketResponse, queue: asyncio.Queue[str], audible: asyncio.Event) -> None:
    with contextlib.suppress(ConnectionError):
        while True:
            text = await queue.get()
            await audible.wait()
            await socket.send_str(text)


def _deaf(name: str, data: dict[str, Any]) -> None:
    """Ignore a notification: used after the server has closed."""


def _refuse(status: int, error: str) -> web.Response:
    return web.json_response({"error": error}, status=status)


def _unknown(what: str) -> web.Response:
    return _refuse(404, f"no such {what}")


def _not_indexed() -> web.Response:
    return web.json_response({"error": "media are not indexed"}, status=NOT_INDEXED, reason="Not Indexed")
