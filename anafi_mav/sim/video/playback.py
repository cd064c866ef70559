"""One stream on its way to one client: two UDP sockets, RTP and its reports."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from anafi_mav.arsdk.video import rtcp
from anafi_mav.arsdk.video.rtcp import ReceiverReport, SenderReport
from anafi_mav.arsdk.video.rtp_h264 import CLOCK_RATE, PictureSender
from anafi_mav.arsdk.video.video_metadata import FrameMetadata
from anafi_mav.sim.video.camera_view import KEY_INTERVAL
from anafi_mav.sim.video.video import CameraStream

if TYPE_CHECKING:
    from anafi_mav.sim.video.h264 import Blocks

REPORT_PERIOD = 1.0
"""s between two sender reports."""
MAX_UNSENT = 1 << 18
"""Bytes that wait for the machine's own network; more are lost, as in the air."""

Send = Callable[[bytes, Callable[[bytes], None]], None]
"""Hands a datagram to the air, which may deliver it."""


class _Reports(asyncio.DatagramProtocol):
    """Hears what the client says of the stream."""

    def __init__(self, peer: str, on_report: Callable[[], None]) -> None:
        self._peer = peer
        self._on_report = on_report
        self.lost = 0
        """Packets that the client says are missing."""
        self.heard = 0
        """Reports of the client."""

    def datagram_received(self, data: bytes, address: tuple[str, int]) -> None:
        if address[0] != self._peer:
            return
        for report in rtcp.decode_reports(data):
            if isinstance(report, ReceiverReport):
                self.heard += 1
                self._on_report()
                if report.blocks:
                    self.lost = report.blocks[0].lost


class Track:
    """One of them."""

    def __init__(
        self,
        stream: CameraStream,
        chance: random.Random,
        profile: int,
        name: str,
        send: Send,
        on_report: Callable[[], None],
    ) -> None:
        """`on_report` hears that the client reports, and so lives."""
        from anafi_mav.sim.video.camera_picture import CameraPicture
        from anafi_mav.sim.video.h264 import encoder

        self.stream = stream
        self._sender = PictureSender(chance.getrandbits(32), chance.getrandbits(16))
        self.camera = CameraPicture(stream.width, stream.height, stream.spectrum)
        self._encoder = encoder(stream.width, stream.height)
        self._before: Blocks | None = None
        """The picture that was sent last."""
        self._keys = 0
        """Key pictures sent."""
        self._profile = profile
        self._name = name
        self._air = send
        self._number: int | None = None
        """Of the next picture; None: it does not play."""
        self._sent = 0
        self._next_report = 0.0
        self._sockets: tuple[asyncio.DatagramTransport, asyncio.DatagramTransport] | None = None
        self._clients: tuple[tuple[str, int], tuple[str, int]] = (("", 0), ("", 0))
        self._on_report = on_report
        self._reports = _Reports("", on_report)

    async def open(self, address: str, peer: str, ports: tuple[int, int]) -> None:
        """Bind the sockets; `ports` are the client's for RTP and RTCP. Raises `OSError`."""
        loop = asyncio.get_running_loop()
        self._clients = (peer, ports[0]), (peer, ports[1])
        self._reports = _Reports(peer, self._on_report)
        rtp, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=(address, 0))
        try:
            reports, _ = await loop.create_datagram_endpoint(lambda: self._reports, local_addr=(address, 0))
        except BaseException:
            rtp.close()
            raise
        self._sockets = rtp, reports

    def close(self) -> None:
        """Idempotent."""
        self.end()
        if self._sockets is not None:
            for socket in self._sockets:
                socket.close()
            self._sockets = None

    @property
    def ssrc(self) -> int:
        return self._sender.ssrc

    @property
    def ports(self) -> tuple[int, int]:
        """Ours, for RTP and RTCP."""
        assert self._sockets is not None
        rtp, reports = (cast("int", socket.get_extra_info("sockname")[1]) for socket in self._sockets)
        return rtp, reports

    @property
    def sequence(self) -> int:
        """Of the next packet."""
        return self._sender.sequence

    @staticmethod
    def timestamp(now: float) -> int:
        """Of a picture taken then."""
        return int(now * CLOCK_RATE) & 0xFFFFFFFF

    def begin(self, now: float) -> None:
        """Play, with a key picture first; one that plays goes on."""
        if self._number is None:
            self._number, self._next_report = 0, now

    def end(self) -> None:
        """Stop playing."""
        self._number = None

    def send(self, taken: float, metadata: FrameMetadata | None, blocks: Blocks) -> None:
        """Send the next picture, `taken` now or a little earlier."""
        if self._number is None or self._sockets is None:
            return
        units = self._units(self._number, blocks)
        self._number += 1
        self._sent += 1
        rtp, _ = self._sockets
        for datagram in self._sender.send(units, self.timestamp(taken), metadata, self._profile):
            self._air(datagram, _Letterbox(rtp, self._clients[0]))

    def report(self, now: float) -> None:
        """Send a sender report when one is due."""
        if self._number is not None and self._sockets is not None and now >= self._next_report:
            self._next_report = now + REPORT_PERIOD
            sender, (_, reports) = self._sender, self._sockets
            report = SenderReport(sender.ssrc, int(now * 1e6), self.timestamp(now), sender.packets, sender.octets)
            self._air(rtcp.encode_sender_report(report, self._name), _Letterbox(reports, self._clients[1]))

    def _units(self, number: int, blocks: Blocks) -> list[bytes]:
        """Return the NAL units of a picture.

        The first of all, and one each second, is a key picture.
        """
        before, self._before = self._before, blocks
        place = number % KEY_INTERVAL
        if place == 0 or before is None:
            self._keys += 1
            return [self._encoder.sps, self._encoder.pps, self._encoder.key(blocks, self._keys % 2)]
        return [self._encoder.between(blocks, before, place)]

    def summary(self) -> dict[str, Any]:
        """For the log: what was sent, and what the client said of it."""
        return {
            "stream": self.stream.title,
            "pictures": self._sent,
            "packets": self._sender.packets,
            "reports": self._reports.heard,
            "lost": self._reports.lost,
        }


class _Letterbox:
    """Delivers a datagram, unless the stream is closed or the machine's network is full."""

    __slots__ = ("_address", "_socket")

    def __init__(self, socket: asyncio.DatagramTransport, address: tuple[str, int]) -> None:
        self._socket = socket
        self._address = address

    def __call__(self, data: bytes) -> None:
        # The type's description lacks what asyncio's datagram transports have.
        unsent = cast("asyncio.WriteTransport", self._socket).get_write_buffer_size()
        if not self._socket.is_closing() and unsent < MAX_UNSENT:
            self._socket.sendto(data, self._address)
