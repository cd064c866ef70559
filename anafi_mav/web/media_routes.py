"""The media of each drone over HTTP.

The paths are those of the drone's own web server, behind "/drone/<sysid>". So a client of Parrot's media API reads
them here as well, while the gateway is the drone's one controller: the list is the kept one, and at most two files are
read from a drone at a time, those of MAVLink FTP included. Ranges are served whatever the drone's own server can.

Files are deleted for programs of this computer only, never for a browser, not even for a page of this server.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
from collections.abc import Awaitable, Callable
from contextlib import aclosing

import msgspec
from aiohttp import web
from msgspec.structs import replace

from anafi_mav.drone import Drone
from anafi_mav.drone.payload.media import API, Listing, MediaItem, Resource
from anafi_mav.drone.payload.media_file import content_type
from anafi_mav.drone.payload.media_index import SORTED_IN_LOOP
from anafi_mav.drone.rest import NOT_INDEXED, MediaNotIndexed, NotFound
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LinkLost, NotSupported
from anafi_mav.relay.uri_host import is_loopback
from anafi_mav.web.server import HttpServer

log = logging.getLogger("anafi_mav.web")

BROWSER_HEADERS = ("Origin", "Sec-Fetch-Site", "Sec-Fetch-Mode")
"""A browser adds one of these to each request that a page can make it send (Fetch standard, Fetch Metadata)."""

PROXY_HEADERS = ("Forwarded", "Via", "X-Forwarded-For", "X-Real-IP")
"""A reverse proxy on this computer adds one of these, where it is set up to name its clients (RFC 7239, RFC 9110)."""

_NO_SUFFIX = re.compile(r"bytes=-0+")

Answer = Callable[[web.Request, Drone], Awaitable[web.StreamResponse]]
"""Answers a request for the media of a drone."""


class MediaRoutes:
    """Serves the media of all drones."""

    def __init__(self, server: HttpServer, find: Callable[[int], Drone | None]) -> None:
        """`find` returns the drone with a system id, connected or not."""
        self._find = find
        self._encoded: dict[str, tuple[Listing, list[bytes]]] = {}
        """The last list of each drone, and its media as JSON, oldest first."""
        base = "/drone/{sysid:[0-9]{1,3}}"
        server.add_get(f"{base}{API}/medias", self._answering(self._list))
        server.add_get(f"{base}{API}/md5/{{name}}", self._answering(self._md5))
        server.add_get(f"{base}/data/media/{{name}}", self._answering(self._file))
        server.add_get(f"{base}/data/thumb/{{name}}", self._answering(self._thumbnail))
        server.add_delete(f"{base}{API}/resources/{{name}}", self._answering(self._delete))

    def _answering(self, answer: Answer) -> Callable[[web.Request], Awaitable[web.StreamResponse]]:
        async def respond(request: web.Request) -> web.StreamResponse:
            drone = self._find(int(request.match_info["sysid"]))
            if drone is None:
                return _refuse(404, f"no drone has system id {request.match_info['sysid']}")
            try:
                return await answer(request, drone)
            except (NotFound, NotSupported) as error:
                return _refuse(404, str(error))
            except MediaNotIndexed as error:
                return _refuse(NOT_INDEXED, str(error))
            except CommandRejected as error:
                return _refuse(409, str(error))
            except (LinkLost, CommandTimeout) as error:
                return _refuse(503, str(error))
            except AnafiMavError as error:
                return _refuse(502, str(error))

        return respond

    async def _list(self, request: web.Request, drone: Drone) -> web.Response:
        listing, sysid = await drone.media.listing(), request.match_info["sysid"]
        kept = self._encoded.get(sysid)
        if kept is None or kept[0] is not listing:
            if len(listing.items) < SORTED_IN_LOOP:
                kept = listing, _encoded(listing)
            else:
                kept = listing, await asyncio.to_thread(_encoded, listing)
            self._encoded[sysid] = kept
        items = reversed(kept[1]) if request.query.get("sort_order") == "newest" else kept[1]
        return web.Response(body=b"[" + b",".join(items) + b"]", content_type="application/json")

    async def _md5(self, request: web.Request, drone: Drone) -> web.Response:
        resource = await _resource(request, drone)
        fields = {"resource_id": resource.resource_id, "media_id": resource.media_id}
        return web.json_response({**fields, "md5": await drone.media.md5(resource)})

    async def _file(self, request: web.Request, drone: Drone) -> web.StreamResponse:
        """Send a file, or the one range of it that the client wants (RFC 9110 §14)."""
        resource = await _resource(request, drone)
        first, end, status = 0, resource.size, 200
        headers = {"Accept-Ranges": "bytes"}
        if "Range" in request.headers and resource.size:
            with contextlib.suppress(ValueError):  # a range that cannot be read is none (RFC 9110 §14.2)
                # The last 0 bytes are no bytes (RFC 9110 §14.1.2). aiohttp has them as slice(0, None), like "bytes=0-".
                is_empty = _NO_SUFFIX.fullmatch(request.headers["Range"]) is not None
                first, end = (1, 0) if is_empty else request.http_range.indices(resource.size)[:2]
                status, headers["Content-Range"] = 206, f"bytes {first}-{end - 1}/{resource.size}"
            if first >= end:
                return web.Response(status=416, headers={"Content-Range": f"bytes */{resource.size}"})
        response = web.StreamResponse(status=status, headers=headers)
        response.content_type = content_type(resource.resource_id)
        if resource.size:
            response.content_length = end - first
        if request.method == "HEAD":
            await response.prepare(request)
            return response
        try:
            async with aclosing(drone.media.read_from(resource, first)) as pieces:
                async for piece in pieces:
                    if not response.prepared:  # a drone that refuses must still be answered with its reason
                        await response.prepare(request)
                    await response.write(piece[: end - first] if resource.size else piece)
                    first += len(piece)
                    if resource.size and first >= end:
                        break
            if not response.prepared:  # a file without a byte
                await response.prepare(request)
        except AnafiMavError as error:
            if not response.prepared:
                raise
            # The bytes of an error would become part of the file. A closed connection is an answer that is too short.
            log.info("%s: %s ends early: %s", drone.name, resource.resource_id, error)
            if request.transport is not None:
                request.transport.abort()
            return response
        except ConnectionError:  # the client has left
            return response
        await response.write_eof()
        return response

    async def _thumbnail(self, request: web.Request, drone: Drone) -> web.Response:
        resource = await _resource(request, drone)
        return web.Response(body=await drone.media.thumbnail(resource), content_type="image/jpeg")

    async def _delete(self, request: web.Request, drone: Drone) -> web.Response:
        if any(name in request.headers for name in BROWSER_HEADERS):
            return _refuse(403, "a browser may not delete; use `anafi-mav media delete`")
        is_forwarded = any(name in request.headers for name in PROXY_HEADERS)
        if request.remote is None or not is_loopback(request.remote) or is_forwarded:
            return _refuse(403, "files are deleted for programs of the gateway's computer only")
        resource = await _resource(request, drone)
        cameras = drone.camera.state
        if cameras.is_recording or cameras.is_taking:
            return _refuse(409, "a camera is recording" if cameras.is_recording else "a camera is saving photos")
        await drone.media.delete_resource(resource.resource_id)
        return web.Response()


async def _resource(request: web.Request, drone: Drone) -> Resource:
    name = request.match_info["name"]
    resource = (await drone.media.listing()).file(name)
    if resource is None:
        raise web.HTTPNotFound(text='{"error": "no such file"}', content_type="application/json")
    return resource


def _encoded(listing: Listing) -> list[bytes]:
    """Return each media as JSON; one by one, so that a thread does it beside the event loop."""
    return [msgspec.json.encode(_with_our_paths(item)) for item in listing.items]


def _with_our_paths(item: MediaItem) -> MediaItem:
    """Return a media with the paths of this server: those of the drone may be any."""
    resources = tuple(
        replace(
            file,
            url=f"/data/media/{file.resource_id}",
            thumbnail=f"/data/thumb/{file.resource_id}" if file.thumbnail else None,
            replay_url=None,
        )
        for file in item.resources
    )
    return replace(item, resources=resources, thumbnail=None, replay_url=None)


def _refuse(status: int, error: str) -> web.Response:
    return web.json_response({"error": error}, status=status)
