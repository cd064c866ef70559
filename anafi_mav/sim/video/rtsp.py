"""The drone's video server: RTSP on TCP 554, pictures in RTP over UDP.

``/live`` has a stream for each camera, ``/replay/<resource id>`` plays a recording and stops at its end. Pictures are
sent thirty times a second of the host's clock, whatever the speed of the simulated world, and only while a client
plays; each contains the state of drone and camera at its moment. They are taken in steps of the simulated world: no two
show the same moment, however late this process runs. A client that joins gets a key picture first. A session whose
client is silent for a minute, in RTSP and RTCP, is removed; it survives the end of its RTSP connection,
as Parrot's client expects.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
import random
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from anafi_mav.arsdk.video import rtsp
from anafi_mav.arsdk.video.rtsp import (
    MalformedRtsp,
    MessageReader,
    Response,
    RtpInfo,
    RtspRequest,
    RtspTransport,
    Status,
)
from anafi_mav.arsdk.video.sdp import format_description
from anafi_mav.arsdk.video.video_metadata import FrameMetadata, Quaternion
from anafi_mav.sim.autopilot.firmware import Firmware
from anafi_mav.sim.payload.media import MediaKind
from anafi_mav.sim.video import video
from anafi_mav.sim.video.camera_view import FRAME_RATE, CameraView
from anafi_mav.sim.video.playback import Send, Track
from anafi_mav.sim.video.video import CameraStream, streams_of

if TYPE_CHECKING:
    from anafi_mav.sim.video.h264 import Blocks

SERVER = "Parrot Streaming Server"
SESSION_TIMEOUT = 60
"""s; RTSP's own default."""
MAX_SESSIONS = 16
"""At a time; an aircraft has one or two."""
MAX_CONNECTIONS = 32
READ_SIZE = 4096
PERIOD = 1.0 / FRAME_RATE
"""s of the host's clock between two pictures."""

_LIVE, _REPLAY = "live", "replay/"
_LEVEL, _REPLAY_HFOV = Quaternion(1.0, 0.0, 0.0, 0.0), math.radians(69.0)
"""View of a recording's pictures."""
_PUBLIC = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER"


@dataclass(frozen=True)
class _Resource:
    """Resource at a URL."""

    name: str
    streams: tuple[CameraStream, ...]
    seconds: float | None = None
    """Length of a recording; None: live."""


@dataclass
class _Session:
    """RTSP session that a client has set up."""

    id: str
    resource: _Resource
    tracks: dict[str, tuple[Track, str]] = field(default_factory=dict)
    """By control: the track, and its URL as the client wrote it."""
    playing: bool = False
    position: float = 0.0
    """s of a recording."""
    until: float = 0.0
    """s of a recording at which it stops."""
    timer: asyncio.TimerHandle | None = None


class _Refused(Exception):
    """A request that is answered with an error."""

    def __init__(self, status: Status) -> None:
        super().__init__(status)
        self.status = status


class VideoServer:
    """One drone's.

    `note` hears what clients do; `hears` says whether the air carries anything; `send` is the air.
    """

    def __init__(
        self,
        firmware: Firmware,
        chance: random.Random,
        note: Callable[[str, dict[str, Any]], None],
        hears: Callable[[], bool],
        send: Send,
        session_timeout: int = SESSION_TIMEOUT,
        latency: float = 0.0,
    ) -> None:
        """`latency`: s from a picture to its first packet."""
        self._firmware = firmware
        self._latency = latency
        self._profile = video.profile(firmware.model)
        self._chance = chance
        self._note = note
        self._hears = hears
        self._send = send
        self._session_timeout = session_timeout
        self._server: asyncio.AbstractServer | None = None
        self._connections: set[asyncio.Task[None]] = set()
        self._sessions: dict[str, _Session] = {}
        self._taken = 0
        """Pictures since the start."""
        self._due = 0.0
        """s of the host's clock until the next picture."""
        self._address = ""
        self.port = 0

    async def start(self, address: str, port: int) -> None:
        """Listen.

        Raises `OSError` when the port is taken or not permitted; 0 lets the system choose.
        """
        self._address = address
        server = await asyncio.start_server(self._serve, address, port)
        self._server = server
        self.port = server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Stop, without a word to the clients. Idempotent."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
        for session in tuple(self._sessions.values()):
            self._forget(session, "closed")
        tasks = tuple(self._connections)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if server is not None:
            await server.wait_closed()

    # -- connections

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        if len(self._connections) >= MAX_CONNECTIONS:
            writer.close()
            return
        self._connections.add(task)
        try:
            with contextlib.suppress(OSError, asyncio.TimeoutError):
                await self._converse(reader, writer)
        except asyncio.CancelledError:
            pass  # the server closes; a task of asyncio's streams that ends cancelled is logged as a failure
        finally:
            self._connections.discard(task)
            writer.close()

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        messages = MessageReader()
        peer: str = writer.get_extra_info("peername")[0]
        while data := await asyncio.wait_for(reader.read(READ_SIZE), SESSION_TIMEOUT):
            for event in messages.feed(data):
                if isinstance(event, MalformedRtsp):
                    self._note("malformed", {"reason": event.reason})
                    writer.write(rtsp.encode(Response(event.status, (("Server", SERVER),))))
                    await asyncio.wait_for(writer.drain(), SESSION_TIMEOUT)
                    return
                if isinstance(event, RtspRequest) and self._hears():
                    writer.write(rtsp.encode(await self._answer(event, peer)))
            await asyncio.wait_for(writer.drain(), SESSION_TIMEOUT)

    async def _answer(self, request: RtspRequest, peer: str) -> Response:
        headers: list[tuple[str, str]] = []
        if request.cseq is not None:
            headers.append(("CSeq", str(request.cseq)))
        headers.append(("Server", SERVER))
        id, _ = rtsp.parse_session(request.header("Session") or "")
        if id in self._sessions:
            self._heard(self._sessions[id])
        try:
            if request.cseq is None:
                raise _Refused(Status.BAD_REQUEST)
            handler = _HANDLERS.get(request.method)
            if handler is None:
                known = request.method in rtsp.METHODS
                raise _Refused(Status.METHOD_NOT_ALLOWED if known else Status.NOT_IMPLEMENTED)
            more, body = await handler(self, request, peer)
        except _Refused as refusal:
            if refusal.status is Status.METHOD_NOT_ALLOWED:
                headers.append(("Allow", _PUBLIC))
            return Response(refusal.status, tuple(headers))
        return Response(Status.OK, (*headers, *more), body)

    # -- methods: each gives further headers, and a body

    async def _options(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        return [("Public", _PUBLIC)], b""

    async def _describe(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        resource, control = self._find(request.uri)
        if control:
            raise _Refused(Status.NOT_FOUND)
        base = request.uri.rstrip("/")
        description = video.describe(
            self._firmware, self._address, base, resource.name, resource.streams, resource.seconds
        )
        return [("Content-Base", base), ("Content-Type", "application/sdp")], format_description(description)

    async def _setup(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        resource, control = self._find(request.uri)
        stream = next((stream for stream in resource.streams if stream.control == control), None)
        if stream is None:
            raise _Refused(Status.ONLY_AGGREGATE_ALLOWED if control == "" else Status.NOT_FOUND)
        offers = rtsp.parse_transport(request.header("Transport") or "")
        ports = next((offer.client_ports for offer in offers if offer.lower == "UDP" and offer.unicast), None)
        if ports is None:
            raise _Refused(Status.UNSUPPORTED_TRANSPORT)
        if request.header("Session") is not None:
            session = self._session(request)
            if session.resource.name != resource.name:
                raise _Refused(Status.METHOD_NOT_VALID)
        elif len(self._sessions) >= MAX_SESSIONS:
            raise _Refused(Status.NOT_ENOUGH_BANDWIDTH)
        else:
            session = _Session(f"{self._chance.getrandbits(64):016X}", resource)
        heard = functools.partial(self._heard, session)
        track = Track(stream, self._chance, self._profile, self._firmware.identity.serial, self._send, heard)
        try:
            await track.open(self._address, peer, ports)
        except OSError:
            raise _Refused(Status.INTERNAL_ERROR) from None
        before = session.tracks.pop(control, None)
        if before is not None:
            before[0].close()
        session.tracks[control] = (track, request.uri)
        self._sessions[session.id] = session
        self._heard(session)
        self._note("setup", {"session": session.id, "stream": stream.title, "client": [peer, *ports]})
        transport = RtspTransport(client_ports=ports, server_ports=track.ports, ssrc=track.ssrc)
        return [("Transport", rtsp.format_transport(transport)), self._header(session)], b""

    async def _play(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        session = self._session(request)
        if not session.tracks:
            raise _Refused(Status.METHOD_NOT_VALID)
        wanted = rtsp.parse_range(request.header("Range") or "npt=now-")
        if wanted is None:
            raise _Refused(Status.INVALID_RANGE)
        now = asyncio.get_running_loop().time()
        seconds = session.resource.seconds
        range_text = rtsp.format_range(None)
        if seconds is not None:
            start, stop = wanted
            if start is not None and start > seconds:
                raise _Refused(Status.INVALID_RANGE)
            session.position = session.position if start is None else start
            session.until = min(seconds, seconds if stop is None else stop)
            range_text = rtsp.format_range(session.position, session.until)
        if not self.playing:
            self._due = -math.inf
        session.playing = seconds is None or session.position < session.until
        infos = []
        for track, url in session.tracks.values():
            track.begin(now)
            infos.append(RtpInfo(url, track.sequence, track.timestamp(now)))
        self._note("play", {"session": session.id, "streams": self._titles(session), "range": range_text})
        headers = [("RTP-Info", rtsp.format_rtp_info(infos)), ("Range", range_text), ("Scale", "1.00")]
        return [*headers, self._header(session)], b""

    async def _pause(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        session = self._session(request)
        self._stop(session, "pause")
        live = session.resource.seconds is None
        range_text = rtsp.format_range(None) if live else rtsp.format_range(session.position)
        return [("Range", range_text), self._header(session)], b""

    async def _teardown(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        session = self._session(request)
        _, control = self._find(request.uri)
        header = self._header(session)
        if control == "" or list(session.tracks) == [control]:
            self._forget(session, "teardown")
        elif control in session.tracks:
            track, _ = session.tracks.pop(control)
            self._note("end", {"session": session.id, "reason": "teardown", **track.summary()})
            track.close()
        else:
            raise _Refused(Status.NOT_FOUND)
        return [header], b""

    async def _get_parameter(self, request: RtspRequest, peer: str) -> tuple[list[tuple[str, str]], bytes]:
        if request.header("Session") is None:
            return [], b""
        return [self._header(self._session(request))], b""

    # -- resources and sessions

    def _find(self, uri: str) -> tuple[_Resource, str]:
        """Return the resource of a URL and the name of its stream; "" means all streams."""
        url = rtsp.split_url(uri)
        path = "" if url is None else url[2].rstrip("/")
        if path == _LIVE or path.startswith(_LIVE + "/"):
            return _Resource(_LIVE, streams_of(self._firmware.model)), path[len(_LIVE) + 1 :]
        id, _, control = path.removeprefix(_REPLAY).partition("/")
        store = self._firmware.payload.media
        recorded = store.resource(id) if path.startswith(_REPLAY) and store.indexed else None
        if recorded is None or recorded.kind is not MediaKind.MP4:
            raise _Refused(Status.NOT_FOUND)
        media = store.media(recorded.media_id)
        streams = streams_of(self._firmware.model)
        thermal = media is not None and media.thermal
        return _Resource(_REPLAY + id, streams[-1:] if thermal else streams[:1], recorded.seconds), control

    def _session(self, request: RtspRequest) -> _Session:
        """The session that a request names."""
        id, _ = rtsp.parse_session(request.header("Session") or "")
        session = self._sessions.get(id)
        if session is None:
            raise _Refused(Status.SESSION_NOT_FOUND)
        return session

    def _header(self, session: _Session) -> tuple[str, str]:
        return "Session", rtsp.format_session(session.id, self._session_timeout)

    def _heard(self, session: _Session) -> None:
        """Its client lives."""
        if session.id not in self._sessions:
            return
        if session.timer is not None:
            session.timer.cancel()
        loop = asyncio.get_running_loop()
        session.timer = loop.call_later(self._session_timeout, self._forget, session, "timeout")

    def _forget(self, session: _Session, reason: str) -> None:
        self._sessions.pop(session.id, None)
        if session.timer is not None:
            session.timer.cancel()
        session.playing = False
        for track, _ in session.tracks.values():
            self._note("end", {"session": session.id, "reason": reason, **track.summary()})
            track.close()
        session.tracks.clear()

    def _stop(self, session: _Session, reason: str) -> None:
        if session.playing:
            session.playing = False
            self._note(reason, {"session": session.id, "streams": self._titles(session)})
        for track, _ in session.tracks.values():
            track.end()

    @staticmethod
    def _titles(session: _Session) -> list[str]:
        return [track.stream.title for track, _ in session.tracks.values()]

    # -- pictures

    @property
    def playing(self) -> bool:
        """True while a client plays."""
        return any(session.playing for session in self._sessions.values())

    def tick(self, now: float, passed: float) -> None:
        """Take the picture that is due; the world has moved on for `passed` s of the host's clock.

        One at most: a world that moves in longer steps than `PERIOD` has fewer pictures, and none twice.
        """
        if not self._sessions or not passed or not self.playing:
            return
        self._due -= passed
        if self._due > 0.5 * passed:  # the next tick is nearer to its time
            return
        self._due = self._due + PERIOD if self._due > -PERIOD else PERIOD
        self._take(now)

    def _take(self, now: float) -> None:
        self._taken += 1
        live: dict[str, tuple[FrameMetadata, Blocks]] = {}
        for session in tuple(self._sessions.values()):
            if not session.playing:
                continue
            recorded = session.resource.seconds is not None
            for track, _ in session.tracks.values():
                track.report(now)
                title = track.stream.title
                if recorded:
                    # A recording keeps nothing but its place: its pictures have no metadata and look north.
                    self._send_picture(track, now, None, track.camera.draw(self._replayed(session)))
                    continue
                if title not in live:
                    said = video.metadata(self._firmware, track.stream)
                    live[title] = said, track.camera.draw(self._seen(track.stream, said))
                self._send_picture(track, now, *live[title])
            if recorded:
                session.position += PERIOD
                if session.position >= session.until - 0.5 / FRAME_RATE:
                    session.position = session.until
                    self._stop(session, "finished")

    def _seen(self, stream: CameraStream, said: FrameMetadata) -> CameraView:
        """Return the moment that a live picture shows: that of its metadata."""
        assert said.timestamp is not None
        assert said.quat is not None
        assert said.hfov is not None
        name = self._firmware.identity.name
        if stream.spectrum != "visible":
            name = f"{name} {stream.spectrum}"
        return CameraView(name, self._taken, said.timestamp // 1000, said.quat, said.hfov)

    def _replayed(self, session: _Session) -> CameraView:
        """Return the moment that a picture of a recording shows."""
        number, time = round(session.position * FRAME_RATE), round(session.position * 1000.0)
        return CameraView(self._firmware.identity.name, number, time, _LEVEL, _REPLAY_HFOV)

    def _send_picture(self, track: Track, taken: float, metadata: FrameMetadata | None, blocks: Blocks) -> None:
        """Send a picture once it is encoded."""
        if self._latency > 0.0:
            asyncio.get_running_loop().call_later(self._latency, track.send, taken, metadata, blocks)
        else:
            track.send(taken, metadata, blocks)


_HANDLERS: dict[str, Callable[[VideoServer, RtspRequest, str], Awaitable[tuple[list[tuple[str, str]], bytes]]]] = {
    "OPTIONS": VideoServer._options,
    "DESCRIBE": VideoServer._describe,
    "SETUP": VideoServer._setup,
    "PLAY": VideoServer._play,
    "PAUSE": VideoServer._pause,
    "TEARDOWN": VideoServer._teardown,
    "GET_PARAMETER": VideoServer._get_parameter,
}
