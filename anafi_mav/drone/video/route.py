"""Routes of a video's datagrams: own UDP sockets, or the mux of a Skycontroller 4."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any, Protocol

from anafi_mav.arsdk.link.interface import bind_to_interface
from anafi_mav.arsdk.link.session import reason_of
from anafi_mav.arsdk.mux.mux_link import MuxControllerSession
from anafi_mav.arsdk.mux.mux_udp import UdpTunnel
from anafi_mav.drone.video.rtsp_client import RtspClient
from anafi_mav.errors import LinkLost
from anafi_mav.receive_buffer import limit_reads, read_after_clients

log = logging.getLogger("anafi_mav")

SOCKET_BUFFER = 1 << 20
"""Bytes that the system keeps for us while we are busy: 1.5 s of 5 Mbit/s (pdraw PDRAW_RTP_RXBUF_SIZE)."""

OnDatagram = Callable[[bytes], None]


class DatagramPair(Protocol):
    """Two ways for datagrams: RTP and, beside it, RTCP."""

    ports: tuple[int, int]
    """Ports that the server has to send RTP and RTCP to."""

    @property
    def foreign(self) -> int:
        """Number of datagrams from other senders, which were dropped."""

    async def aim(self, ports: tuple[int, int]) -> None:
        """Hear these ports of the server and nothing else. Raises `LinkLost`."""

    def report(self, data: bytes) -> None:
        """Send a datagram of RTCP."""

    def close(self) -> None:
        """Idempotent."""


class VideoRoute(Protocol):
    """Location of a video server, and the route of its datagrams."""

    HEADERS: tuple[tuple[str, str], ...]
    """Headers of a SETUP beyond the standard."""

    async def connect(self) -> RtspClient:
        """Raises `LinkLost`."""

    async def channels(self, client: RtspClient, on_rtp: OnDatagram, on_rtcp: OnDatagram) -> DatagramPair:
        """Raises `LinkLost`."""


class _Socket(asyncio.DatagramProtocol):
    """One UDP socket. It hears one port of one host, once it is aimed."""

    def __init__(self, local: str, interface: str | None, on_datagram: OnDatagram) -> None:
        self.foreign = 0
        """Datagrams of others."""
        self._on_datagram = on_datagram
        self._peer: tuple[str, int] | None = None
        self._transport: asyncio.DatagramTransport | None = None
        self._sock: socket.socket | None = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._sock.setblocking(False)
            self._sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_BUFFER)
            bind_to_interface(self._sock, interface)
            self._sock.bind((local, 0))
        except BaseException:
            self._sock.close()
            raise
        self.port: int = self._sock.getsockname()[1]

    async def aim(self, peer: tuple[str, int]) -> None:
        """Raises `OSError`."""
        assert self._sock is not None
        self._peer = peer
        # The system drops what comes from elsewhere; what came before that is seen to below.
        self._sock.connect(peer)
        read_after_clients(self._sock)
        await asyncio.get_running_loop().create_datagram_endpoint(lambda: self, sock=self._sock)
        self._sock = None

    def connection_made(self, transport: Any) -> None:
        limit_reads(transport)
        self._transport = transport

    def datagram_received(self, data: bytes, address: tuple[Any, ...]) -> None:
        if address[:2] == self._peer:
            self._on_datagram(data)
        else:
            self.foreign += 1

    def error_received(self, exc: Exception) -> None:
        # A report without a receiver: the pictures may come all the same, and when they do not that is noticed.
        log.debug("video: UDP error: %s", exc)

    def send(self, data: bytes) -> None:
        if self._transport is not None:
            self._transport.sendto(data)

    def close(self) -> None:
        if self._sock is not None:
            self._sock.close()
            self._sock = None
        if self._transport is not None:
            self._transport.abort()
            self._transport = None


class _UdpChannels:
    """Sockets of ours, to a server that we reach ourselves."""

    def __init__(self, client: RtspClient, interface: str | None, on_rtp: OnDatagram, on_rtcp: OnDatagram) -> None:
        self._there = client.there
        self._rtp = _Socket(client.here, interface, on_rtp)
        try:
            self._rtcp = _Socket(client.here, interface, on_rtcp)
        except BaseException:
            self._rtp.close()
            raise
        self.ports = (self._rtp.port, self._rtcp.port)

    @property
    def foreign(self) -> int:
        return self._rtp.foreign + self._rtcp.foreign

    async def aim(self, ports: tuple[int, int]) -> None:
        try:
            await self._rtp.aim((self._there, ports[0]))
            await self._rtcp.aim((self._there, ports[1]))
        except OSError as error:
            raise LinkLost(f"video: {reason_of(error)}") from error

    def report(self, data: bytes) -> None:
        self._rtcp.send(data)

    def close(self) -> None:
        self._rtp.close()
        self._rtcp.close()


class Direct:
    """A server at an address: a drone's own, or that of a Skycontroller 3.

    A Skycontroller 3 forwards the video of its drone.
    """

    HEADERS: tuple[tuple[str, str], ...] = ()

    def __init__(self, address: str, port: int, local_address: str | None, interface: str | None) -> None:
        self._address = address
        self._port = port
        self._local_address = local_address
        self._interface = interface

    async def connect(self) -> RtspClient:
        return await RtspClient.connect(
            self._address, self._port, local_address=self._local_address, interface=self._interface
        )

    async def channels(self, client: RtspClient, on_rtp: OnDatagram, on_rtcp: OnDatagram) -> DatagramPair:
        try:
            return _UdpChannels(client, self._interface, on_rtp, on_rtcp)
        except OSError as error:
            raise LinkLost(f"video: {reason_of(error)}") from error


class _MuxChannels:
    foreign = 0
    """The Skycontroller's socket hears the Skycontroller only."""

    def __init__(self, rtp: UdpTunnel, rtcp: UdpTunnel) -> None:
        self._rtp, self._rtcp = rtp, rtcp
        self.ports = (rtp.port, rtcp.port)

    async def aim(self, ports: tuple[int, int]) -> None:
        await self._rtp.aim(ports[0])
        await self._rtcp.aim(ports[1])

    def report(self, data: bytes) -> None:
        self._rtcp.send(data)

    def close(self) -> None:
        self._rtp.close()
        self._rtcp.close()


class Mux:
    """The server of a Skycontroller 4, which forwards the video of its drone.

    RTSP and datagrams go through the mux. As Olympe does it (olympe features/video/pdraw.py, pdraw
    pdraw_demuxer_stream_mux.cpp).
    """

    HEADERS: tuple[tuple[str, str], ...] = (("X-com-parrot-link-type", "mux"),)

    def __init__(self, session: MuxControllerSession, port: int) -> None:
        self._session = session
        self._port = port

    async def connect(self) -> RtspClient:
        address, port = await self._session.open_tcp("skycontroller", self._port)
        return await RtspClient.connect(address, port)

    async def channels(self, client: RtspClient, on_rtp: OnDatagram, on_rtcp: OnDatagram) -> DatagramPair:
        rtp = await self._session.open_udp("skycontroller", on_rtp)
        try:
            rtcp = await self._session.open_udp("skycontroller", on_rtcp)
        except BaseException:
            rtp.close()
            raise
        return _MuxChannels(rtp, rtcp)
