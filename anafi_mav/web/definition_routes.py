"""The camera definition of each drone over HTTP, beside MAVLink FTP.

"/drone/<sysid>/camera_definition.xml", and the same with ".xz". For programs that read no MAVLink FTP, and for people:
CAMERA_INFORMATION names the address in MAVLink FTP, which leads to the file over every link.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from anafi_mav.web.server import HttpServer

PATH = "/drone/{sysid}/camera_definition.xml"

FindDefinition = Callable[[int], tuple[bytes, bytes] | None]
"""Returns the plain and the compressed file of the connected drone with a system id."""


class DefinitionRoutes:
    """Serves the camera definitions of all drones."""

    def __init__(self, server: HttpServer, find: FindDefinition) -> None:
        """`find` returns the files of a connected drone."""
        self._find = find
        path = PATH.format(sysid="{sysid:[0-9]{1,3}}")
        server.add_get(path, self._answering(0, "application/xml"))
        server.add_get(path + ".xz", self._answering(1, "application/x-xz"))

    def _answering(self, which: int, kind: str) -> Callable[[web.Request], Awaitable[web.Response]]:
        async def respond(request: web.Request) -> web.Response:
            files = self._find(int(request.match_info["sysid"]))
            if files is None:
                raise web.HTTPNotFound(text=f"no drone with system id {request.match_info['sysid']} is connected\n")
            # The file changes with what the drone reports; a client compares the version in it.
            return web.Response(body=files[which], content_type=kind, headers={"Cache-Control": "no-cache"})

        return respond
