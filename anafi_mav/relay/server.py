"""The RTSP server of the gateway: viewers connect here, each to one stream of one drone.

    server = RelayServer("127.0.0.1", None)
    server.add(DroneSource(1, "alpha", drone))
    await server.start()

A stream is `rtsp://HOST:PORT/SYSID/STREAM`; the drone's name does as well as its system id. The server is open to this
computer only unless it is configured otherwise. Viewers on other computers then need the gateway's token as password.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import secrets
import socket
from collections import Counter
from contextlib import suppress

from anafi_mav import __version__
from anafi_mav.access_token import AccessToken
from anafi_mav.arsdk.video import rtcp, rtsp
from anafi_mav.arsdk.video.rtsp import InterleavedData, MalformedRtsp, MessageReader, Response, RtspRequest, Status
from anafi_mav.clock import Clock
from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.errors import ConfigError
from anafi_mav.relay.dialogue import (
    CONTROL,
    SERVER,
    SESSION_TIMEOUT,
    DialogueState,
    ViewerAction,
    ViewerDialogue,
    ViewerRequest,
)
from anafi_mav.relay.digest import DigestChallenge
from anafi_mav.relay.feed import Feed, FeedReader, PackedPicture
from anafi_mav.relay.outlet import Outlet, TcpOutlet, UdpOutlet
from anafi_mav.relay.source import DroneSource, NotShown
from anafi_mav.relay.uri_host import is_loopback, uri_host
from anafi_mav.units import counted

log = logging.getLogger(__name__)

DEFAULT_PORT = 8555
"""Where the configuration names none. 8554 is the simulated drones' and other RTSP servers'."""

MAX_CONNECTIONS = 64
"""At a time; each costs a file descriptor, which MAVLink needs too, and a UDP viewer two more."""
MAX_VIEWERS = 32
"""Sessions at a time: 160 Mbit/s of an ANAFI's stream."""

MAX_UNREAD = 64 * 1024
"""Bytes of responses that may wait for a client that sends requests and does not read."""

READ_SIZE = 4096
"""Bytes that are answered before other tasks run: at most some hundred requests, 2 ms."""
TICK = 1.0
"""s between two sender reports, and between looks at silent viewers."""
MAX_REQUESTS = 64
"""Requests of one viewer in a `TICK`. A player sends five to begin, and then one in some seconds."""

FIRST_LIMIT = 10.0
"""s that a viewer without the token may stay: it takes a place of others."""

STUCK = 10.0
"""s without taking a byte after which a viewer inside its RTSP connection is gone."""

NAME = "anafi-mav"
"""Our CNAME in RTCP reports."""

CLOSE_WAIT = 1.0
"""s that a closed connection has for what it still has to send, and that closing the server waits for all of them."""


class RelayServer:
    """Sources, and the socket that serves them. `start` once, `close` once (twice does no harm)."""

    def __init__(self, host: str, port: int | None, clock: Clock, *, public_host: str | None = None) -> None:
        """Create a server, not open yet.

        `port` 0 is a free one; None is `DEFAULT_PORT`, or a free one where that is taken. `public_host` stands in
        every URI in place of the address that a client's link shows.
        """
        self.host = host
        self.port = 0
        """TCP port while it is open, else 0."""
        self.clock = clock
        self.token: AccessToken | None = None
        """With one, viewers on other computers need it. Set before `start`."""
        self.refused: Counter[str] = Counter()
        """Refused requests by reason: token, which was wrong."""
        self._public_host = public_host
        self._wanted_port = port
        self._sources: dict[str, DroneSource] = {}
        """By system id, and by name."""
        self._server: asyncio.Server | None = None
        self._connections: dict[asyncio.Task[None], _Connection] = {}
        self._ticker: asyncio.Task[None] | None = None

    def add(self, source: DroneSource) -> None:
        """Serve the streams of a drone."""
        self._sources.setdefault(source.name, source)
        self._sources[str(source.sysid)] = source

    async def start(self) -> None:
        """Open the port.

        Raises `ConfigError` at `video.host` or `video.rtsp_port`; nothing is then left open.
        """
        try:
            self._server = await self._listen()
        except OSError as error:
            key = "video.rtsp_port" if error.errno in (errno.EADDRINUSE, errno.EACCES) else "video.host"
            port = DEFAULT_PORT if self._wanted_port is None else self._wanted_port
            problem = f"cannot open {self.host}:{port} for video: {error.strerror or error}"
            raise ConfigError(key, problem) from error
        self.port = self._server.sockets[0].getsockname()[1]
        self._ticker = asyncio.create_task(self._tick(), name="relay")

    async def _listen(self) -> asyncio.Server:
        port = DEFAULT_PORT if self._wanted_port is None else self._wanted_port
        try:
            return await asyncio.start_server(self._serve, self.host, port, family=socket.AF_INET)
        except OSError as error:
            if self._wanted_port is not None or error.errno != errno.EADDRINUSE:
                raise
        return await asyncio.start_server(self._serve, self.host, 0, family=socket.AF_INET)

    async def close(self) -> None:
        """Say goodbye to the viewers, end the drones' sessions and close every socket."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
        ticker, self._ticker = self._ticker, None
        if ticker is not None:
            ticker.cancel()
            await asyncio.wait([ticker])
        for connection in tuple(self._connections.values()):
            connection.end("the gateway ends")
        tasks = tuple(self._connections)
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=CLOSE_WAIT)
        await asyncio.gather(*(source.close() for source in set(self._sources.values())))

    @property
    def viewers(self) -> int:
        """Number of viewers that play."""
        return sum(source.viewers for source in set(self._sources.values()))

    @property
    def sessions(self) -> int:
        """Number of sessions that are set up."""
        return sum(connection.is_set_up for connection in self._connections.values())

    @property
    def is_open_to_network(self) -> bool:
        """True when other computers can connect."""
        return not is_loopback(self.host)

    def url_for(self, local_host: str | None, path: str) -> str | None:
        """Return the URL of a path for a client that sees this computer as `local_host`.

        None when such a client cannot reach it: the server is closed, open to this computer only, or its address
        towards the client is not known (`local_host` None).
        """
        host = uri_host(self.host, local_host, self._public_host)
        return f"rtsp://{host}:{self.port}{path}" if self.port and host is not None else None

    def describe(self) -> str:
        """Return one line for people."""
        count = self.viewers
        return f"rtsp://{self.host}:{self.port}/SYSTEM/STREAM: {counted(count, 'viewer')}"

    def source(self, name: str) -> DroneSource | None:
        """Return the source of a drone, by its system id or its name."""
        return self._sources.get(name)

    def find(self, path: tuple[str, ...]) -> tuple[DroneSource, StreamKind] | None:
        """Return the source and stream of a path; None when there is no such stream."""
        if len(path) != 2:
            return None
        source = self.source(path[0])
        kind = next((kind for kind in StreamKind if kind.value == path[1]), None)
        return (source, kind) if source is not None and kind is not None and source.has(kind) else None

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        if len(self._connections) >= MAX_CONNECTIONS or writer.get_extra_info("peername") is None:
            writer.close()
            return
        connection = self._connections[task] = _Connection(self, reader, writer)
        try:
            with suppress(OSError):
                await connection.run()
        except asyncio.CancelledError:
            pass  # the server closes; a task of asyncio's streams that ends cancelled is logged as a failure
        finally:
            del self._connections[task]
            connection.close()

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK)
            now = self.clock.monotonic()
            for connection in tuple(self._connections.values()):
                connection.tick(now)


class _Connection:
    """One viewer."""

    def __init__(self, server: RelayServer, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._server = server
        self._reader = reader
        self._writer = writer
        self._here: str = writer.get_extra_info("sockname")[0]
        self._there: str = writer.get_extra_info("peername")[0]
        token = None if is_loopback(self._there) else server.token
        challenge = None if token is None else DigestChallenge(token, secrets.token_hex(16))
        self._dialogue = ViewerDialogue(secrets.token_hex(8).upper(), challenge=challenge)
        self._name = "{}:{}".format(*writer.get_extra_info("peername")[:2])
        self._opened = self._heard = self._moved = server.clock.monotonic()
        self._waited = 0
        """Bytes that waited at the last look."""
        self._requests = 0
        """Requests since the last tick."""
        self._responses = 0
        """Bytes of responses since the connection's buffer was empty: so many the viewer may not have read."""
        self._outlet: Outlet | None = None
        self._stream: tuple[DroneSource, StreamKind] | None = None
        self._feed: Feed | None = None
        self._watch: FeedReader | None = None
        """While it plays."""

    @property
    def is_set_up(self) -> bool:
        return self._outlet is not None

    async def run(self) -> None:
        """Answer requests until the connection ends."""
        messages = MessageReader(interleaved=True)
        while data := await self._reader.read(READ_SIZE):
            for event in messages.feed(data):
                if isinstance(event, MalformedRtsp):
                    self._write(Response(event.status, (("Server", SERVER),), reason=event.reason))
                    return
                if isinstance(event, InterleavedData):
                    self._on_report(event.data)
                elif isinstance(event, RtspRequest):
                    if self._is_flooding():
                        self._writer.transport.abort()  # what it has not read would be kept for it
                        return
                    self._heard = self._server.clock.monotonic()
                    await self._answer(self._dialogue.judge(event))
                    if self._writer.is_closing():
                        return
            await asyncio.sleep(0)  # bytes that have arrived already are read without a pause

    def _is_flooding(self) -> bool:
        """Count a request; True when the viewer sends too many, or does not read the responses."""
        self._requests += 1
        if self._requests > MAX_REQUESTS:
            log.info("video: %s sends more than %d requests in %.0f s", self._name, MAX_REQUESTS, TICK)
            return True
        if self._responses > MAX_UNREAD and self._writer.transport.get_write_buffer_size():
            log.info("video: %s does not read the responses", self._name)
            return True
        return False

    def _write(self, response: Response) -> None:
        if self._writer.is_closing():
            return
        data = rtsp.encode(response)
        # The buffer holds pictures, too, when they are sent inside the connection; `PictureGate` bounds those.
        waiting = self._writer.transport.get_write_buffer_size()
        self._responses = len(data) + (self._responses if waiting else 0)
        self._writer.write(data)

    async def _answer(self, wanted: ViewerRequest) -> None:
        if wanted.response is not None:
            if wanted.response.status == Status.UNAUTHORIZED and wanted.request.header("Authorization") is not None:
                self._server.refused["token"] += 1
                log.info("video: %s has a wrong token", self._name)
            self._write(wanted.response)
            return
        request, dialogue = wanted.request, self._dialogue
        try:
            match wanted.action:
                case ViewerAction.DESCRIBE:
                    self._write(await self._describe(wanted))
                case ViewerAction.SETUP:
                    self._write(await self._set_up(wanted))
                case ViewerAction.PLAY:
                    await self._play(request)
                case ViewerAction.PAUSE:
                    self._stop()
                    self._write(dialogue.done(request))
                case _:
                    self._write(dialogue.done(request))
                    self._end_session()
        except NotShown as error:
            log.debug("video: %s: %s", self._name, error)  # a station retries each second
            self._write(dialogue.refused(request, Status.SERVICE_UNAVAILABLE, str(error)))

    async def _describe(self, wanted: ViewerRequest) -> Response:
        found = self._server.find(wanted.path)
        if found is None:
            return self._dialogue.refused(wanted.request, Status.NOT_FOUND)
        source, kind = found
        feed = await source.open(kind)
        text = feed.description(source.name, f"{source.name} {kind.value}", f"anafi-mav {__version__}", CONTROL)
        return self._dialogue.described(wanted.request, text)

    async def _set_up(self, wanted: ViewerRequest) -> Response:
        request = wanted.request
        found = self._server.find(wanted.path)
        if found is None:
            return self._dialogue.refused(request, Status.NOT_FOUND)
        reason = found[0].refusal(found[1])
        if reason is not None:
            raise NotShown(reason)
        if self._outlet is None and self._server.sessions >= MAX_VIEWERS:
            return self._dialogue.refused(request, Status.NOT_ENOUGH_BANDWIDTH, "too many viewers")
        offer = wanted.offers[0]
        outlet: Outlet
        if offer.client_ports is not None:
            try:
                outlet = await UdpOutlet.open(self._here, self._there, offer.client_ports, self._on_report)
            except OSError as error:
                return self._dialogue.refused(request, Status.INTERNAL_ERROR, error.strerror or str(error))
        else:
            assert offer.channels is not None
            outlet = TcpOutlet(self._writer.transport, offer.channels)
        self._end_session()  # not before: a refused SETUP changes nothing
        self._outlet, self._stream = outlet, found
        return self._dialogue.set_up(request, outlet.transport)

    async def _play(self, request: RtspRequest) -> None:
        if self._watch is not None:
            self._write(self._dialogue.playing(request, None))
            return
        assert self._stream is not None
        assert self._outlet is not None
        source, kind = self._stream
        self._feed = await source.open(kind)
        # From here to the end without a pause: no picture may come between what the viewer gets at once and the next.
        now = self._server.clock.monotonic()
        self._watch = FeedReader(self._feed)
        self._write(self._dialogue.playing(request, self._watch.start))
        self._outlet.send(self._watch.begin(now))
        self._moved = now
        source.join(self)
        how = self._outlet.transport.lower
        log.info("video: %s watches %s of %s over %s", self._name, kind.value, source.name, how)
        self._report(now)

    # -- pictures

    def show(self, picture: PackedPicture, now: float) -> None:
        """Send a picture, or drop it."""
        assert self._watch is not None
        assert self._outlet is not None
        datagrams = self._watch.take(picture, self._outlet.waiting, now)
        self._outlet.send(datagrams, picture if datagrams is picture.datagrams else None)

    def end(self, reason: str) -> None:
        """Close, because the stream is not shown any longer."""
        log.info("video: %s: %s", self._name, reason)
        self._report(self._server.clock.monotonic(), goodbye=True)
        self.close()

    def tick(self, now: float) -> None:
        """Report to the viewer, and close when nothing is heard of it."""
        self._requests = 0
        if not self._dialogue.is_admitted and now - self._opened > FIRST_LIMIT:
            self.close()
            return
        if self._watch is None:
            if now - self._heard > SESSION_TIMEOUT:
                self.close()
            return
        self._report(now)
        assert self._outlet is not None
        waiting = self._outlet.waiting
        if not waiting or waiting < self._waited:
            self._moved = now
        self._waited = waiting
        is_inside = self._outlet.transport.channels is not None
        # Inside the connection the system says whether the viewer takes what is sent; datagrams need its reports.
        if now - self._moved > STUCK if is_inside else now - self._heard > SESSION_TIMEOUT:
            self.end("nothing heard of the viewer")

    def _report(self, now: float, *, goodbye: bool = False) -> None:
        if self._watch is None or self._outlet is None or self._feed is None:
            return
        watch = self._watch
        report = self._feed.report(now, self._server.clock.time(), watch.packets, watch.octets)
        self._outlet.report(rtcp.encode_sender_report(report, NAME, goodbye=goodbye))

    def _on_report(self, data: bytes) -> None:
        """Note that the viewer lives; a goodbye of its RTP is followed by its TEARDOWN."""
        if rtcp.decode_reports(data):
            self._heard = self._server.clock.monotonic()

    # -- the end

    def _stop(self) -> None:
        """Stop sending pictures."""
        if self._watch is None:
            return
        dropped = self._watch.counts["dropped pictures"]
        log.info("video: %s stops after %d pictures, %d dropped", self._name, self._watch.counts["pictures"], dropped)
        self._watch = None
        if self._stream is not None:
            self._stream[0].leave(self)

    def _end_session(self) -> None:
        self._stop()
        if self._outlet is not None:
            self._outlet.close()
            self._outlet = None
        self._stream = self._feed = None

    def close(self) -> None:
        """End session and connection. Idempotent.

        A viewer that does not read what waits for it would keep the connection open, and its place: it is aborted.
        """
        self._end_session()
        self._dialogue.state = DialogueState.INIT
        if not self._writer.is_closing():
            self._writer.close()
            asyncio.get_running_loop().call_later(CLOSE_WAIT, self._writer.transport.abort)
