"""A plain RTSP client for tests of video servers: requests by hand, pictures as they arrive."""

from __future__ import annotations

import asyncio
import hashlib
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from anafi_mav.arsdk.video import rtcp, rtsp
from anafi_mav.arsdk.video.rtp_h264 import Picture, PictureReceiver
from anafi_mav.arsdk.video.rtsp import InterleavedData, MessageReader, Response, RtspRequest
from anafi_mav.arsdk.video.sdp import SessionDescription, parse_description

LIMIT = 10.0
"""s for anything that is awaited."""


class Eye(asyncio.DatagramProtocol):
    """One stream's two sockets."""

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self.arrived: list[float] = []
        self.reports: list[rtcp.Report] = []
        self.sequences: list[int] = []
        self._receiver = PictureReceiver()
        self._more = asyncio.Event()
        self.ports = (0, 0)
        self._transports: list[asyncio.DatagramTransport] = []

    async def open(self) -> None:
        loop = asyncio.get_running_loop()
        eye = self

        class Reports(asyncio.DatagramProtocol):
            def datagram_received(self, data: bytes, address: object) -> None:
                eye.heard(data, address)

        rtp, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=("127.0.0.1", 0))
        reports, _ = await loop.create_datagram_endpoint(Reports, local_addr=("127.0.0.1", 0))
        self._transports = [rtp, reports]
        self.ports = rtp.get_extra_info("sockname")[1], reports.get_extra_info("sockname")[1]

    def datagram_received(self, data: bytes, address: object) -> None:
        now = asyncio.get_running_loop().time()
        self.sequences.append(int.from_bytes(data[2:4], "big"))
        got = self._receiver.receive(data, now)
        self.pictures += got
        self.arrived += [now] * len(got)
        self._more.set()

    def heard(self, data: bytes, address: object) -> None:
        self.reports += rtcp.decode_reports(data)
        self._more.set()

    async def look(self, count: int) -> list[Picture]:
        """Wait until so many pictures more have come, and give them."""
        begin = len(self.pictures)
        await self.until(lambda: len(self.pictures) >= begin + count)
        return self.pictures[begin : begin + count]

    async def first(self, count: int) -> list[Picture]:
        """The first so many pictures of all."""
        await self.until(lambda: len(self.pictures) >= count)
        return self.pictures[:count]

    async def until(self, happened: object) -> None:
        assert callable(happened)

        async def wait() -> None:
            while not happened():
                self._more.clear()
                await self._more.wait()

        await asyncio.wait_for(wait(), LIMIT)

    def report(self, data: bytes, port: int) -> None:
        """Send a datagram of RTCP to the server."""
        self._transports[1].sendto(data, ("127.0.0.1", port))

    def close(self) -> None:
        for transport in self._transports:
            transport.close()


class Viewer:
    """One connection to a video server."""

    def __init__(self, port: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.base = f"rtsp://{writer.get_extra_info('peername')[0]}:{port}/"
        self.password: str | None = None
        """With one, each request answers the newest challenge."""
        self.challenge = ""
        """Of the newest 401."""
        self.session = ""
        self.reader = reader
        self.writer = writer
        self.ended = asyncio.Event()
        """The server has closed the connection, which is noticed after `setup_inside` only."""
        self._messages = MessageReader(interleaved=True)
        self._eyes: list[Eye] = []
        self._cseq = 0
        self._pump: asyncio.Task[None] | None = None
        self._answers: asyncio.Queue[Response] = asyncio.Queue()

    async def ask(self, method: str, path: str = "live", **headers: str) -> Response:
        """A request and its answer; `_` in a header's name is a dash."""
        self._cseq += 1
        lines = [("CSeq", str(self._cseq)), *((name.replace("_", "-"), value) for name, value in headers.items())]
        if self.session and "Session" not in headers:
            lines.append(("Session", self.session))
        if self.password is not None and "Authorization" not in headers:
            lines.append(("Authorization", self.authorization(method, self.base + path)))
        self.writer.write(rtsp.encode(RtspRequest(method, self.base + path, tuple(lines))))
        response = await self.answer()
        assert response.cseq == self._cseq
        self.challenge = response.header("WWW-Authenticate") or self.challenge
        return response

    def authorization(self, method: str, uri: str) -> str:
        """The header that answers the newest challenge, as ffmpeg writes it."""

        def md5(text: str) -> str:
            return hashlib.md5(text.encode()).hexdigest()

        given = dict(re.findall(r'(\w+)="([^"]*)"', self.challenge))
        realm, nonce = given.get("realm", ""), given.get("nonce", "")
        first, second = md5(f"viewer:{realm}:{self.password}"), md5(f"{method}:{uri}")
        response = md5(f"{first}:{nonce}:00000001:0a4f113b:auth:{second}")
        return (
            f'Digest username="viewer", realm="{realm}", nonce="{nonce}", uri="{uri}", response="{response}", '
            'algorithm="MD5", qop="auth", cnonce="0a4f113b", nc=00000001'
        )

    async def answer(self) -> Response:
        if self._pump is not None:
            return await asyncio.wait_for(self._answers.get(), LIMIT)
        while True:
            data = await asyncio.wait_for(self.reader.read(4096), LIMIT)
            assert data, "the server hung up"
            for event in self._messages.feed(data):
                assert isinstance(event, Response)
                return event

    async def describe(self, path: str = "live") -> SessionDescription:
        response = await self.ask("DESCRIBE", path, Accept="application/sdp")
        assert response.status == 200
        description = parse_description(response.body)
        assert description is not None
        return description

    async def setup(self, path: str) -> Eye:
        """Set up a stream, and remember the session."""
        eye = Eye()
        await eye.open()
        self._eyes.append(eye)
        response = await self.ask("SETUP", path, Transport="RTP/AVP;unicast;client_port={}-{}".format(*eye.ports))
        assert response.status == 200, response
        self.session, _ = rtsp.parse_session(response.header("Session") or "")
        return eye

    async def setup_inside(self, path: str) -> Eye:
        """Set up a stream inside the connection, which is read by itself from now on."""
        eye = Eye()
        response = await self.ask("SETUP", path, Transport="RTP/AVP/TCP;unicast;interleaved=0-1")
        assert response.status == 200, response
        assert "interleaved=0-1" in (response.header("Transport") or "")
        self.session, _ = rtsp.parse_session(response.header("Session") or "")

        async def pump() -> None:
            while data := await self.reader.read(1 << 16):
                for event in self._messages.feed(data):
                    if isinstance(event, InterleavedData):
                        (eye.heard if event.channel else eye.datagram_received)(event.data, None)
                    else:
                        assert isinstance(event, Response)
                        self._answers.put_nowait(event)
            self.ended.set()

        self._pump = asyncio.create_task(pump())
        return eye

    async def play(self, path: str = "live", **headers: str) -> Response:
        response = await self.ask("PLAY", path, **headers)
        assert response.status == 200, response
        return response

    def close(self) -> None:
        for eye in self._eyes:
            eye.close()
        if self._pump is not None:
            self._pump.cancel()
        self.writer.close()


@asynccontextmanager
async def viewer(port: int, host: str = "127.0.0.1") -> AsyncIterator[Viewer]:
    reader, writer = await asyncio.open_connection(host, port)
    held = Viewer(port, reader, writer)
    try:
        yield held
    finally:
        held.close()
