"""Ways of a viewer's packets: datagrams of UDP, or frames inside its RTSP connection.

Neither ever waits: what a viewer does not read stays in a queue of its own, whose size `FeedReader` receives.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol, cast

from anafi_mav.arsdk.video.rtsp import RtspTransport, encode_interleaved
from anafi_mav.relay.feed import PackedPicture, frame

SLICE, PACE = 32, 0.001
"""Datagrams that leave at once, and s between two such lots: 45 MB/s. A key picture takes two or three of them. A
player's socket holds 200 kB by default, and what a new viewer gets at once is more than that."""

SEND_BUFFER = 1 << 20
"""Bytes of datagrams that the system may keep for one viewer."""

CONNECTION_BUFFER = 1 << 18
"""Bytes that the system may keep inside a connection, which Linux doubles for its own use: some 0.5 s of 5 Mbit/s. By
itself it keeps up to 4 MB for a viewer that reads slowly, whose pictures are then seconds old, and none is dropped."""

OnReport = Callable[[bytes], None]


class Outlet(Protocol):
    """The way of one viewer's packets."""

    transport: RtspTransport
    """As the response to SETUP names it."""

    @property
    def waiting(self) -> int:
        """Bytes that have not left yet."""

    def send(self, datagrams: Sequence[bytes], picture: PackedPicture | None = None) -> None:
        """Send packets; `picture` is the one that they are, unchanged."""

    def report(self, data: bytes) -> None:
        """Send a packet of RTCP."""

    def close(self) -> None:
        """Idempotent. Does not close the RTSP connection."""


class TcpOutlet:
    """Frames inside the RTSP connection."""

    def __init__(self, connection: asyncio.WriteTransport, channels: tuple[int, int], ssrc: int | None = None) -> None:
        self.transport = RtspTransport(lower="TCP", channels=channels, ssrc=ssrc)
        _limit_buffer(connection, CONNECTION_BUFFER)
        self._connection = connection
        self._channels = channels

    @property
    def waiting(self) -> int:
        return self._connection.get_write_buffer_size()

    def send(self, datagrams: Sequence[bytes], picture: PackedPicture | None = None) -> None:
        if not datagrams or self._connection.is_closing():
            return
        channel = self._channels[0]
        self._connection.write(frame(datagrams, channel) if picture is None else picture.framed(channel))

    def report(self, data: bytes) -> None:
        if not self._connection.is_closing():
            self._connection.write(encode_interleaved(self._channels[1], data))

    def close(self) -> None:
        pass


class _Reports(asyncio.DatagramProtocol):
    def __init__(self, on_report: OnReport) -> None:
        self._on_report = on_report

    def datagram_received(self, data: bytes, address: Any) -> None:
        self._on_report(data)


class UdpOutlet:
    """Two sockets, RTP and RTCP, to the host that the RTSP connection comes from."""

    def __init__(self, sockets: tuple[asyncio.DatagramTransport, asyncio.DatagramTransport], ports: tuple[int, int]):
        self._rtp, self._rtcp = sockets
        own = tuple(cast("int", one.get_extra_info("sockname")[1]) for one in sockets)
        self.transport = RtspTransport(client_ports=ports, server_ports=(own[0], own[1]))
        self._queue: deque[bytes] = deque()
        self._queued = 0
        self._timer: asyncio.TimerHandle | None = None

    @classmethod
    async def open(cls, local: str, peer: str, ports: tuple[int, int], on_report: OnReport) -> UdpOutlet:
        """Bind the sockets. Raises `OSError`."""
        rtp = await _bind(local, peer, ports[0], asyncio.DatagramProtocol)
        try:
            rtcp = await _bind(local, peer, ports[1], lambda: _Reports(on_report))
        except BaseException:
            rtp.close()
            raise
        return cls((rtp, rtcp), ports)

    @property
    def waiting(self) -> int:
        return self._queued + _unsent(self._rtp)

    def send(self, datagrams: Sequence[bytes], picture: PackedPicture | None = None) -> None:
        if self._timer is None and len(datagrams) <= SLICE:
            for datagram in datagrams:
                self._rtp.sendto(datagram)
            return
        self._queue.extend(datagrams)
        self._queued += sum(map(len, datagrams))
        if self._timer is None:
            self._pace()

    def _pace(self) -> None:
        self._timer = None
        for _ in range(min(SLICE, len(self._queue))):
            datagram = self._queue.popleft()
            self._queued -= len(datagram)
            self._rtp.sendto(datagram)
        if self._queue:
            self._timer = asyncio.get_running_loop().call_later(PACE, self._pace)

    def report(self, data: bytes) -> None:
        self._rtcp.sendto(data)

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._queue.clear()
        self._queued = 0
        self._rtp.close()
        self._rtcp.close()


async def _bind(
    local: str, peer: str, port: int, protocol: Callable[[], asyncio.DatagramProtocol]
) -> asyncio.DatagramTransport:
    """Return a socket that sends to one port of the peer and receives from that port only."""
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        protocol, local_addr=(local, 0), remote_addr=(peer, port)
    )
    _limit_buffer(transport, SEND_BUFFER)
    return transport


def _limit_buffer(transport: asyncio.BaseTransport, size: int) -> None:
    """Have the system keep `size` bytes at most that have not left."""
    with contextlib.suppress(OSError):
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, size)


def _unsent(transport: asyncio.DatagramTransport) -> int:
    # The type's description lacks what asyncio's datagram transports have.
    return cast("asyncio.WriteTransport", transport).get_write_buffer_size()
