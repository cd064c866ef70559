"""The live picture for browsers by WHEP: WebRTC set up by one HTTP request.

    POST /whep/SYSID     SDP offer -> 201, SDP answer, Location of the session
    DELETE Location      ends the session

A browser gets the stream that the drone shows. When the drone shows another one, the session ends and the page asks
again. The pictures come from the relay, which has one session at the drone for all viewers.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
import secrets
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Final

from aiohttp import web

from anafi_mav.relay.source import DroneSource, NotShown
from anafi_mav.web.h264_offer import OfferError
from anafi_mav.web.server import HttpServer

if TYPE_CHECKING:
    from anafi_mav.web.webrtc import BrowserSession

log = logging.getLogger(__name__)

MAX_BROWSERS = 16
"""At a time, of all drones: 80 Mbit/s of an ANAFI's stream, each packet encrypted in Python."""

SDP: Final = "application/sdp"

MISSING = "The live picture needs aiortc: pip install 'anafi-mav[web]'"


class LiveVideo:
    """The routes, and the sessions of browsers."""

    def __init__(self, server: HttpServer, find: Callable[[str], DroneSource | None]) -> None:
        """`find` returns the source of a drone, by its system id or name."""
        self._find = find
        self._sessions: dict[str, BrowserSession] = {}
        server.add_post("/whep/{drone}", self._open)
        server.add_delete("/whep/{drone}/{session}", self._end)
        server.on_close(self.close)

    @property
    def browsers(self) -> int:
        """Number of sessions."""
        return len(self._sessions)

    @staticmethod
    async def load() -> None:
        """Import aiortc, where it is installed, before the drones are connected.

        The libraries of PyAV stop the event loop for 0.1 s when they are loaded, on a small computer for longer.
        """
        try:
            await _load()
        except ImportError:
            pass
        except Exception:
            log.warning("aiortc cannot be imported", exc_info=True)

    async def close(self) -> None:
        """End all sessions. Idempotent."""
        await asyncio.gather(*(session.close() for session in tuple(self._sessions.values())))

    async def _open(self, request: web.Request) -> web.Response:
        drone = request.match_info["drone"]
        source = self._find(drone)
        if source is None:
            return _refused(404, f"no drone {drone[:40]!r}")
        if request.content_type != SDP:
            return _refused(415, f"expected {SDP}")
        try:
            offer = (await request.read()).decode()
        except UnicodeDecodeError:
            return _refused(400, "the offer is no text")
        try:
            webrtc = await _load()
        except ImportError:
            log.debug("aiortc cannot be imported", exc_info=True)
            return _refused(501, MISSING)
        try:
            return await self._answer(request, webrtc, source, offer)
        except NotShown as error:
            return _refused(503, str(error))
        except OfferError as error:
            return _refused(406, str(error))

    async def _answer(self, request: web.Request, webrtc: ModuleType, source: DroneSource, offer: str) -> web.Response:
        kind = source.shown
        feed = await source.open(kind)
        # From here to the entry in the table without a pause: the limit holds for requests at the same time, too.
        if len(self._sessions) >= MAX_BROWSERS:
            return _refused(503, f"{MAX_BROWSERS} browsers watch already")
        if request.transport is None:
            return _refused(400, "the browser has disconnected")
        address = request.transport.get_extra_info("sockname")[0]
        key = secrets.token_urlsafe(16)
        session: BrowserSession = webrtc.BrowserSession(source, kind, address, lambda: self._sessions.pop(key, None))
        self._sessions[key] = session
        try:
            answer = await session.answer(offer, feed.sps)
        except BaseException:
            await session.close()
            raise
        place = f"/whep/{source.sysid}/{key}"
        return web.Response(status=201, text=answer, content_type=SDP, headers={"Location": place})

    async def _end(self, request: web.Request) -> web.Response:
        session = self._sessions.get(request.match_info["session"])
        if session is None:
            return _refused(404, "no such session")
        await session.close()
        return web.Response()


def _refused(status: int, reason: str) -> web.Response:
    return web.Response(status=status, text=f"{reason}\n")


async def _load() -> ModuleType:
    """Import the module that needs aiortc.

    In a thread: it takes half a second, and the drones are flown meanwhile.
    """
    return await asyncio.to_thread(importlib.import_module, "anafi_mav.web.webrtc")
