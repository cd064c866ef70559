"""One video stream from its beginning to its end: RTSP session, datagrams, pictures.

Nothing is decoded. A stream without keep-alives is ended by the drone after a timeout that it reports; one whose
pictures stop arriving is ended here.
"""

from __future__ import annotations

import asyncio
import random
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

import msgspec

from anafi_mav.arsdk.video import rtsp, sdp
from anafi_mav.arsdk.video.rtcp import ReceiverReport, SenderReport, decode_reports, encode_receiver_report
from anafi_mav.arsdk.video.rtp_h264 import CLOCK_RATE, Picture, PictureReceiver
from anafi_mav.arsdk.video.rtp_reception import Reception
from anafi_mav.arsdk.video.rtsp import Response, RtspTransport
from anafi_mav.arsdk.video.sdp import MediaDescription, SessionDescription
from anafi_mav.drone.element import field_of_view, finite
from anafi_mav.drone.video.picture_clock import PictureClock
from anafi_mav.drone.video.route import DatagramPair, VideoRoute
from anafi_mav.drone.video.rtsp_client import RtspClient
from anafi_mav.errors import AnafiMavError, CommandTimeout, LinkLost, NotSupported, RemoteProtocolError

SILENCE = 4.0
"""s without a picture after which a stream is over. A camera that changes its mode shows nothing for a second."""

SESSION_TIMEOUT = 60
"""s that a session lives without a word from us when the server does not say (RFC 2326 12.37)."""
KEEP_ALIVE = 0.4
"""Part of that time after which we say something, as librtsp does: one lost word must not end a video."""
MIN_KEEP_ALIVE = 1.0
"""s; a server that reports a timeout of zero is not to be flooded."""

MAX_MISSED = 3
"""Words without an answer after which a session is over (librtsp RTSP_CLIENT_MAX_FAILED_KEEP_ALIVE)."""

REPORT_PERIOD = 1.0
"""s between two reports of how the pictures arrive."""

GOODBYE = 1.0
"""s to wait for the answer to a TEARDOWN."""

NAME = "anafi-mav"
"""Our CNAME in RTCP reports."""

LIVE = "live"
"""The path of what the cameras see now; `replay/<resource>` is a recording."""


class Shown(msgspec.Struct, frozen=True):
    """A stream as the video server describes it; None: not described."""

    title: str
    """Name for `Video.watching`: "DefaultVideo", "Front camera", …"""
    offered: tuple[str, ...]
    """The titles of all streams of this drone."""
    fov_deg: tuple[float, float] | None = None
    """Horizontal and vertical field of view of the unzoomed picture."""
    principal_point: tuple[float, float] | None = None
    """Intersection of the optical axis with the picture, share of its width and height."""
    distortion: tuple[float, ...] | None = None
    """Radial r1, r2, r3 and tangential t1, t2."""
    sps: bytes = b""
    """H.264 sequence parameter set, a NAL unit; empty: not said. With `pps` what a decoder needs to begin."""
    pps: bytes = b""
    """H.264 picture parameter set."""


class VideoStream:
    """A stream of a route. `run` it in a task and cancel that to end it."""

    def __init__(
        self,
        route: VideoRoute,
        title: str | None,
        on_picture: Callable[[Picture, float], None],
        wanted: Callable[[], bool],
    ) -> None:
        """Create a stream; `title` None is the drone's own choice.

        Pictures are passed on with the loop's time of their arrival. When the stream is no longer `wanted` it ends,
        also if cancelling it had no effect (`asyncio.wait_for` before Python 3.12).
        """
        self.shown: Shown | None = None
        """Known before the first picture comes."""
        self.counters: Counter[str] = Counter()
        self.receiver = PictureReceiver()
        self.clock = PictureClock()
        self._route = route
        self._title = title
        self._wanted = wanted
        self._on_picture = on_picture
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._last_picture = 0.0
        self._source = random.getrandbits(32)
        """Our SSRC in RTCP reports."""
        self._reception: Reception | None = None

    async def run(self) -> None:
        """Show the video until it is not wanted any more.

        Raises `LinkLost` when it ends by itself, `CommandTimeout` when the drone does not answer or shows nothing,
        `CommandRejected`, `NotSupported`, `RemoteProtocolError`.
        """
        client = await self._route.connect()
        channels: DatagramPair | None = None
        goodbye: tuple[str, str] | None = None
        try:
            url = f"{client.url}/{LIVE}"
            public = (await client.ask("OPTIONS", url)).header("Public") or ""
            url, description = _described(await client.ask("DESCRIBE", url, [("Accept", "application/sdp")]), url)
            media = _chosen(description, self._title)
            self.shown = _shown(description, media)
            channels = await self._route.channels(client, self._receive, self._hear)
            offer = RtspTransport(client_ports=channels.ports)
            response = await client.ask(
                "SETUP",
                rtsp.join_url(url, media.control),
                [("Transport", rtsp.format_transport(offer)), *self._route.HEADERS],
            )
            session, timeout = _session(response)
            goodbye = url, session
            await channels.aim(_server_ports(response))
            await client.ask("PLAY", url, [("Session", session), ("Range", rtsp.format_range(None))])
            self._last_picture = self._loop.time()
            keep = "GET_PARAMETER" if "GET_PARAMETER" in public else "OPTIONS"
            reports = asyncio.create_task(self._report(channels))
            try:
                await self._watch(client, keep, url, session, timeout)
            finally:
                reports.cancel()
        finally:
            if self._timer is not None:
                self._timer.cancel()
            if channels is not None:
                self.counters["foreign"] += channels.foreign
                channels.close()
            try:
                if goodbye is not None and not client.ended.done():
                    with suppress(AnafiMavError):
                        await client.ask("TEARDOWN", goodbye[0], [("Session", goodbye[1])], GOODBYE)
            finally:
                await client.close()
                self.counters.update(client.counters)

    async def _watch(self, client: RtspClient, keep: str, url: str, session: str, timeout: int) -> None:
        """Keep the session alive for as long as pictures come."""
        period = max(MIN_KEEP_ALIVE, KEEP_ALIVE * timeout)
        next_word, missed = self._loop.time() + period, 0
        while self._wanted():
            silent_at = self._last_picture + SILENCE
            now = self._loop.time()
            if now >= silent_at:
                raise CommandTimeout("a picture", SILENCE)
            if now >= next_word:
                try:
                    await client.ask(keep, url, [("Session", session)])
                    missed = 0
                except CommandTimeout:
                    missed += 1
                    if missed == MAX_MISSED:
                        raise
                next_word = self._loop.time() + period
                continue
            await asyncio.wait({client.ended}, timeout=min(silent_at, next_word) - now)
            if client.ended.done():
                raise LinkLost(client.ended.result())

    # -- datagrams

    def _receive(self, data: bytes) -> None:
        now = self._loop.time()
        self._show(self.receiver.receive(data, now), now)
        ssrc = self.receiver.window.ssrc
        if ssrc is not None:
            if self._reception is None or self._reception.ssrc != ssrc:
                self._reception = Reception(ssrc, CLOCK_RATE)
            self._reception.receive(data, now)

    def _hear(self, data: bytes) -> None:
        for report in decode_reports(data):
            if not isinstance(report, SenderReport):
                continue
            now = self._loop.time()
            if self.receiver.window.ssrc in (None, report.ssrc):
                self.clock.on_report(report.timestamp, now)
            if self._reception is not None:
                self._reception.hear(report, now)

    async def _report(self, channels: DatagramPair) -> None:
        while True:
            await asyncio.sleep(REPORT_PERIOD)
            block = None if self._reception is None else self._reception.block(self._loop.time())
            if block is not None:
                channels.report(encode_receiver_report(ReceiverReport(self._source, (block,)), NAME))

    def _expire(self) -> None:
        self._timer = None
        now = self._loop.time()
        self._show(self.receiver.expire(now), now)

    def _show(self, pictures: list[Picture], now: float) -> None:
        deadline = self.receiver.deadline()
        if deadline is not None and self._timer is None:
            self._timer = self._loop.call_at(deadline, self._expire)
        for picture in pictures:
            if not self._wanted():
                return  # the sockets close only when the task that owns them gets to run
            self._last_picture = now
            self._on_picture(picture, now)


def _described(response: Response, url: str) -> tuple[str, SessionDescription]:
    """Return the description in a DESCRIBE response, and the base URL of its streams."""
    description = sdp.parse_description(response.body)
    if description is None:
        raise RemoteProtocolError("the drone's description of its video is none")
    base = response.header("Content-Base") or response.header("Content-Location") or url
    control = description.control
    return rtsp.join_url(base, control) if control else base.rstrip("/"), description


def _chosen(description: SessionDescription, wanted: str | None) -> MediaDescription:
    media = [one for one in description.media if one.encoding.upper() == "H264" and one.clock_rate == CLOCK_RATE]
    if not media:
        raise NotSupported("video")
    if wanted is None:
        return next((one for one in media if one.attribute(sdp.DEFAULT_MEDIA) == "1"), media[0])
    for one in media:
        if one.title == wanted:
            return one
    raise NotSupported(f"video {wanted!r} (it has {', '.join(repr(one.title) for one in media)})")


def _session(response: Response) -> tuple[str, int]:
    session, timeout = rtsp.parse_session(response.header("Session") or "")
    if not session:
        raise RemoteProtocolError("the drone's video server opens no session")
    return session, SESSION_TIMEOUT if timeout is None else timeout


def _server_ports(response: Response) -> tuple[int, int]:
    offers = rtsp.parse_transport(response.header("Transport") or "")
    if not offers or offers[0].lower != "UDP" or offers[0].server_ports is None:
        raise RemoteProtocolError("the drone's video server does not say where its video comes from")
    return offers[0].server_ports


def _shown(description: SessionDescription, media: MediaDescription) -> Shown:
    fov, point, distortion = (
        _numbers(media.attribute(name) or description.attribute(name))
        for name in (sdp.PICTURE_FOV, sdp.PRINCIPAL_POINT, sdp.PERSPECTIVE_DISTORTION)
    )
    return Shown(
        title=media.title,
        offered=tuple(one.title for one in description.media),
        fov_deg=(fov[0], fov[1]) if len(fov) == 2 and all(map(field_of_view, fov)) else None,
        principal_point=(point[0], point[1]) if len(point) == 2 else None,
        distortion=distortion if len(distortion) == 5 else None,
        sps=media.sps,
        pps=media.pps,
    )


def _numbers(text: str | None) -> tuple[float, ...]:
    """Return the numbers between commas; empty when one of them is no measure."""
    try:
        numbers = tuple(float(piece) for piece in (text or "").split(","))
    except ValueError:
        return ()
    return () if None in map(finite, numbers) else numbers
