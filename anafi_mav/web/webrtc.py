"""A browser's session: the drone's pictures as they are, by WebRTC.

The only module that imports aiortc, an optional dependency; `live_video` loads it when a browser first needs it.
aiortc encrypts the packets and sends lost ones again. The pictures pass through it as they are.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription
from aiortc.mediastreams import MediaStreamError, MediaStreamTrack
from av.packet import Packet

from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.relay.admission import Admission, PictureGate
from anafi_mav.relay.feed import Feed, PackedPicture
from anafi_mav.relay.source import DroneSource, NotShown
from anafi_mav.web.h264_offer import OfferError, finish_answer, reduce_offer

log = logging.getLogger(__name__)
logging.getLogger("aioice").setLevel(logging.WARNING)  # at INFO it has ten lines for each browser

CONNECT_LIMIT = 10.0
"""s from the answer until the browser's packets have arrived. Chromium takes 0.1 s on the same computer."""

BURST_RATE = 10e6
"""Bytes/s of the pictures that a new browser gets at once. A socket of Chromium holds 200 kB, less than a second of
an ANAFI's stream."""

CLOCK_RATE = 90_000
"""Hz of the pictures' timestamps (RFC 6184)."""

_START_CODE = b"\0\0\0\1"
_TIME_BASE = Fraction(1, CLOCK_RATE)


class PictureTrack(MediaStreamTrack):
    """The pictures for one browser, as aiortc's sender takes them."""

    kind = "video"

    def __init__(self) -> None:
        super().__init__()
        self.counts: Counter[str] = Counter()
        """pictures, dropped pictures (the browser's session was too slow)."""
        self.waiting = 0
        """Bytes of pictures that the sender has not taken."""
        self._gate = PictureGate()
        self._queue: deque[tuple[bytes, int]] = deque()
        self._wake = asyncio.Event()
        self._feed: Feed | None = None

    def begin(self, feed: Feed, now: float) -> None:
        """Send everything since the last entry at once."""
        self._feed = feed
        self._gate.begin(now, has_entry=bool(feed.kept))
        for number, picture in enumerate(feed.kept):
            self._put(picture.units, feed.burst_time(number))

    def show(self, picture: PackedPicture, now: float) -> None:
        """Send a picture, or drop it."""
        assert self._feed is not None
        admission = self._gate.admit(picture.is_entry, self.waiting, now)
        if admission is Admission.DROP:
            self.counts["dropped pictures"] += 1
            return
        units = picture.units
        if admission is Admission.PASS_WITHOUT_ENTRY and self._feed.sps:
            units = (self._feed.sps, self._feed.pps, *units)
        self._put(units, picture.timestamp)

    def _put(self, units: tuple[bytes, ...], timestamp: int) -> None:
        data = b"".join(_START_CODE + unit for unit in units)
        self.counts["pictures"] += 1
        self.waiting += len(data)
        self._queue.append((data, timestamp))
        self._wake.set()

    async def recv(self) -> Packet[Any]:
        """Return the next picture; called by aiortc's sender, once it has sent the one before."""
        while not self._queue:
            if self.readyState != "live":
                raise MediaStreamError
            self._wake.clear()
            await self._wake.wait()
        data, timestamp = self._queue.popleft()
        self.waiting -= len(data)
        if self._queue:
            await asyncio.sleep(len(data) / BURST_RATE)
        packet = Packet(data)
        packet.pts = timestamp
        packet.time_base = _TIME_BASE
        return packet

    def stop(self) -> None:
        """End it; what waits is dropped. Idempotent."""
        super().stop()
        self._queue.clear()
        self.waiting = 0
        self._wake.set()


class BrowserSession:
    """One browser that watches one stream. `answer` once, `close` once (twice does no harm)."""

    def __init__(self, source: DroneSource, kind: StreamKind, address: str, on_end: Callable[[], None]) -> None:
        """`address` is the one that the browser reaches us by: no socket is opened at another.

        `on_end` is called once, when the session ends, for whatever reason.
        """
        self.track = PictureTrack()
        self._source = source
        self._kind = kind
        self._address = address
        self._on_end = on_end
        self._connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self._limit: asyncio.TimerHandle | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._has_ended = False

    async def answer(self, offer: str, sps: bytes) -> str:
        """Return the answer to a browser's offer; raises `OfferError`."""
        reduced = reduce_offer(offer, sps)
        connection = self._connection
        sender = connection.addTrack(self.track)
        # aiortc gathers addresses of all interfaces and has no option for less.
        gatherer = sender.transport.transport.iceGatherer
        _gather_at(gatherer._connection, self._address)
        try:
            await connection.setRemoteDescription(RTCSessionDescription(reduced.sdp, "offer"))
            await connection.setLocalDescription(await connection.createAnswer())
        except Exception as error:  # of aiortc's parser, which raises what it meets
            log.debug("an offer that aiortc does not take", exc_info=True)
            raise OfferError(f"the offer cannot be answered: {error}") from error
        hosts = {candidate.ip for candidate in gatherer.getLocalCandidates()}
        if hosts != {self._address}:
            raise OfferError(f"no socket at {self._address}")
        connection.on("connectionstatechange", self._on_state)
        self._limit = asyncio.get_running_loop().call_later(CONNECT_LIMIT, self.end, "the browser did not connect")
        return finish_answer(connection.localDescription.sdp, reduced.profile)

    def _on_state(self) -> None:
        state = self._connection.connectionState
        if state == "connected":
            if self._limit is not None:
                self._limit.cancel()
            self._start(self._begin())
        elif state in ("failed", "closed"):
            self.end("the browser has disconnected")

    async def _begin(self) -> None:
        try:
            feed = await self._source.open(self._kind)
        except NotShown as error:
            self.end(str(error))
            return
        if self._has_ended:
            return
        # From here to the end without a pause: no picture may come between what the browser gets at once and the next.
        self.track.begin(feed, asyncio.get_running_loop().time())
        self._source.join(self)
        log.info("video: a browser watches %s of %s", self._kind.value, self._source.name)

    def show(self, picture: PackedPicture, now: float) -> None:
        """Send a picture, or drop it."""
        self.track.show(picture, now)

    def end(self, reason: str) -> None:
        """Close, because of this. Idempotent."""
        if not self._has_ended:
            log.info("video: browser of %s: %s", self._source.name, reason)
            self._start(self.close())

    async def close(self) -> None:
        """Leave the source and close the sockets."""
        if not self._has_ended:
            self._has_ended = True
            self._source.leave(self)
            if self._limit is not None:
                self._limit.cancel()
            self.track.stop()
            self._on_end()
        await self._connection.close()

    def _start(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _gather_at(connection: Any, address: str) -> None:
    """Let an ICE connection of aioice open a socket at one address only."""
    gather = connection.get_component_candidates

    async def gather_here(component: int, addresses: list[str], timeout: int = 5) -> Any:
        return await gather(component, [address], timeout)

    connection.get_component_candidates = gather_here
