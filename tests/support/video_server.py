"""A video server that does what a test commands, over real sockets. Its RTSP and SDP are written by hand here, so that
no mistake of ours is on both sides; what its pictures say is `arsdk`'s, which Parrot's own library reads."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from dataclasses import dataclass, field

from anafi_mav.arsdk.video.rtcp import Report, decode_reports
from anafi_mav.arsdk.video.rtp_h264 import PictureSender
from anafi_mav.arsdk.video.video_metadata import (
    PROTO_PROFILE,
    V3_PROFILE,
    FlyingState,
    FrameMetadata,
    Location,
    Ned,
    Quaternion,
    WifiLink,
)

SPS, PPS = bytes.fromhex("6742c01e95a0280f68"), bytes.fromhex("68ce3c80")
KEY, SLICE = b"\x65" + bytes(3000), b"\x41" + bytes(500)

# A 4K, from Parrot's own names of attributes (libvideo-metadata vmeta_session.h).
SDP = (
    "v=0\r\n"
    "o=- 1 1 IN IP4 192.168.42.1\r\n"
    "s=ANAFI\r\n"
    "c=IN IP4 0.0.0.0\r\n"
    "t=0 0\r\n"
    "a=control:*\r\n"
    "a=X-com-parrot-serial:PI040416DA9H000001\r\n"
    "m=video 0 RTP/AVP 96\r\n"
    "i=Thermal\r\n"
    "a=rtpmap:96 H264/90000\r\n"
    "a=control:stream=0\r\n"
    "m=video 0 RTP/AVP 96\r\n"
    "i=DefaultVideo\r\n"
    "a=rtpmap:96 H264/90000\r\n"
    "a=fmtp:96 packetization-mode=1;profile-level-id=42c01e;sprop-parameter-sets=Z0LAHpWgKA9o,aM48gA==\r\n"
    "a=control:stream=1\r\n"
    "a=X-com-parrot-default-media:1\r\n"
    "a=X-com-parrot-picture-fov:69.00,42.00\r\n"
    "a=X-com-parrot-principal-point:0.5,0.48\r\n"
    "a=X-com-parrot-perspective-distortion:0.1,-0.2,0.3,0.001,0.002\r\n"
    "m=audio 0 RTP/AVP 0\r\n"
    "i=Sound\r\n"
)

METADATA = FrameMetadata(
    drone_quat=Quaternion(1.0, 0.0, 0.0, 0.0),
    location=Location(latitude=48.8789, longitude=2.3677, altitude_amsl=35.0, satellites=14),
    ground_distance=1.5,
    speed=Ned(1.0, -0.5, 0.25),
    battery_percentage=54,
    flying_state=FlyingState.HOVERING,
    quat=Quaternion(1.0, 0.0, 0.0, 0.0),
    exposure_time=16.5,
    iso_gain=318,
    awb_r_gain=1.5,
    awb_b_gain=2.0,
    hfov=1.2043,
    vfov=0.7377,
    wifi=WifiLink(goodput=19330, quality=5, rssi=-15),
)


@dataclass
class Asked:
    """One request."""

    method: str
    uri: str
    headers: dict[str, str]
    at: float = 0.0
    """Loop time."""


@dataclass
class VideoServer:
    """`async with VideoServer() as server:` listens on a port that the system chooses."""

    profile: int = V3_PROFILE
    metadata: FrameMetadata | None = METADATA
    session_timeout: int | None = 60
    address: str = "127.0.0.1"
    asked: list[Asked] = field(default_factory=list)
    answers: dict[str, Callable[[Asked], bytes | None]] = field(default_factory=dict)
    """By method, what is answered instead of the usual; None: nothing."""
    quiet: bool = False
    """True: no pictures are sent."""
    reports: list[Report] = field(default_factory=list)
    """What clients reported about RTP."""
    sent: int = 0
    """Pictures."""
    playing: int = 0
    """Sessions that are being shown a video."""

    async def __aenter__(self) -> VideoServer:
        self._updated = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self.writers: list[asyncio.StreamWriter] = []
        self._server = await asyncio.start_server(self._serve, self.address, 0)
        self.port = self._server.sockets[0].getsockname()[1]
        loop = asyncio.get_running_loop()
        self.rtp, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=(self.address, 0))
        self.rtcp, _ = await loop.create_datagram_endpoint(lambda: _Reports(self), local_addr=(self.address, 0))
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for writer in self.writers:
            writer.close()
        self.rtp.close()
        self.rtcp.close()

    def methods(self) -> list[str]:
        return [one.method for one in self.asked]

    async def until(self, true: Callable[[], bool], timeout: float = 10.0) -> None:
        """Looked at after every request and every picture."""

        async def look() -> None:
            while not true():
                self._updated.clear()
                await self._updated.wait()

        await asyncio.wait_for(look(), timeout)

    def hang_up(self) -> None:
        for writer in self.writers:
            writer.close()

    def say(self, text: str) -> None:
        """To the client that came last."""
        self.writers[-1].write(text.encode())

    def ports(self) -> tuple[int, int]:
        return self.rtp.get_extra_info("sockname")[1], self.rtcp.get_extra_info("sockname")[1]

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.append(writer)
        show: asyncio.Task[None] | None = None
        client = writer.get_extra_info("peername")[0]
        try:
            while head := (await reader.readuntil(b"\r\n\r\n")).decode():
                first, *lines = head.strip().split("\r\n")
                if first.startswith("RTSP/1.0"):
                    self.asked.append(Asked(first, "", {}))
                    continue
                method, uri, _ = first.split()
                now = asyncio.get_running_loop().time()
                asked = Asked(method, uri, dict(line.split(": ", 1) for line in lines), now)
                self.asked.append(asked)
                answer = self.answers.get(method, self._usual)(asked)
                if answer is not None:
                    writer.write(answer)
                if method == "PLAY" and show is None:
                    setup = next(one for one in reversed(self.asked) if one.method == "SETUP")
                    port = int(setup.headers["Transport"].partition("client_port=")[2].split("-")[0])
                    show = asyncio.create_task(self._show((client, port)))
                    self._tasks.add(show)
                if method == "TEARDOWN" and show is not None:
                    show.cancel()
                self._updated.set()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            if show is not None:
                show.cancel()
            self._updated.set()

    def _usual(self, asked: Asked) -> bytes:
        extra, body = "", ""
        if asked.method == "OPTIONS":
            extra = "Public: OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER\r\n"
        if asked.method == "DESCRIBE":
            body = SDP
            extra = f"Content-Type: application/sdp\r\nContent-Base: {asked.uri}\r\n"
        if asked.method == "SETUP":
            timeout = "" if self.session_timeout is None else f";timeout={self.session_timeout}"
            extra = "Transport: {};server_port={}-{}\r\nSession: 0123ABCD{}\r\n".format(
                asked.headers["Transport"], *self.ports(), timeout
            )
        return ok(asked, extra, body)

    async def _show(self, client: tuple[str, int]) -> None:
        sender = PictureSender(random.getrandbits(32), sequence=65530)  # so that it wraps at once
        timestamp = (1 << 32) - 6000  # so does this
        self.playing += 1
        try:
            while True:
                if not self.quiet:
                    units = [SPS, PPS, KEY] if self.sent % 30 == 0 else [SLICE]
                    for datagram in sender.send(units, timestamp, self.metadata, self.profile):
                        self.rtp.sendto(datagram, client)
                    self.sent += 1
                    self._updated.set()
                timestamp += 3000
                await asyncio.sleep(1 / 30)
        finally:
            self.playing -= 1


class _Reports(asyncio.DatagramProtocol):
    def __init__(self, server: VideoServer) -> None:
        self._server = server

    def datagram_received(self, data: bytes, address: object) -> None:
        self._server.reports += decode_reports(data)
        self._server._updated.set()


def ok(asked: Asked, extra: str = "", body: str = "") -> bytes:
    """RTSP 200."""
    length = f"Content-Length: {len(body)}\r\n" if body else ""
    return f"RTSP/1.0 200 OK\r\nCSeq: {asked.headers['CSeq']}\r\n{extra}{length}\r\n{body}".encode()


def refused(status: str) -> Callable[[Asked], bytes]:
    return lambda asked: f"RTSP/1.0 {status}\r\nCSeq: {asked.headers['CSeq']}\r\n\r\n".encode()


__all__ = ["KEY", "METADATA", "PPS", "PROTO_PROFILE", "SDP", "SLICE", "SPS", "V3_PROFILE", "Asked", "VideoServer", "ok"]
