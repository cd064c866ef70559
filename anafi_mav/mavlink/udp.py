"""UDP endpoints: `udpout` sends to one address from the start, `udpin` answers its peers."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from anafi_mav.clock import Clock
from anafi_mav.mavlink.base import (
    CLOSE_WAIT,
    MAX_PEERS,
    RETRY_FIRST,
    RETRY_LAST,
    WRITE_AHEAD,
    Endpoint,
    EndpointUrl,
    Outbox,
    Sink,
    reason,
    routed_host,
    seen_host,
)
from anafi_mav.mavlink.channel import Channel

logger = logging.getLogger(__name__)

MAX_DATAGRAM = 512
"""Bytes of frames that share a datagram with `frames=many`. A smaller buffer loses the rest: gomavlib has 512,
mavlink-router 1120, MAVSDK 2048 (gomavlib pkg/frame/reader.go, mavlink-router endpoint.cpp, MAVSDK
udp_connection.hpp). A frame has 280 at most."""

ONE_FRAME = 0
"""The limit of an `Outbox` that gathers nothing. The default: gomavlib since 3.3.2, and so mavp2p, reads the first
frame of a datagram and loses the others."""

PEER_SILENCE = 30.0
"""s after which a peer of `udpin` is gone: thirty heartbeats missed (MAVLink heartbeat.md: 1 Hz, four or five missed
are a lost link; a ground station whose laptop slept for a moment keeps its stream rates)."""

PEER_REPLACEABLE = 5.0
"""s of silence after which a peer makes room for a new one when all places are taken."""

SWEEP_EVERY = 5.0
"""s between looks for silent peers."""


def _datagram_limit(url: EndpointUrl) -> int:
    return MAX_DATAGRAM if url.frames == "many" else ONE_FRAME


class _Datagrams(asyncio.DatagramProtocol):
    """Glue between a datagram transport and an endpoint."""

    def __init__(
        self,
        received: Callable[[bytes, Any], None],
        failed: Callable[[Exception], None],
        paused: Callable[[bool], None],
    ) -> None:
        self.lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._received = received
        self._failed = failed
        self._paused = paused

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert hasattr(transport, "set_write_buffer_limits")  # asyncio's datagram transports have it, their type not
        transport.set_write_buffer_limits(high=WRITE_AHEAD)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._received(data, addr)

    def error_received(self, exc: Exception) -> None:
        self._failed(exc)

    def pause_writing(self) -> None:
        self._paused(True)

    def resume_writing(self) -> None:
        self._paused(False)

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.lost.done():
            self.lost.set_result(None)


async def _shut(transport: asyncio.DatagramTransport | None) -> None:
    """Close a socket and return when its port is free."""
    if transport is not None:
        protocol = transport.get_protocol()
        assert isinstance(protocol, _Datagrams)
        transport.abort()
        await asyncio.wait([protocol.lost], timeout=CLOSE_WAIT)


class UdpOut(Endpoint):
    """One channel, open from start to end, whether a peer listens there or not.

    The socket is connected: only that peer is heard. It is opened again on any network error but "connection
    refused",
    because a connected socket keeps the local address it had, and a laptop changes networks.
    """

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._outbox = Outbox(self._write, _datagram_limit(url))
        self.channel = Channel(url.text, self._outbox.add, flavour=url.flavour, datagrams=True)
        self._transport: asyncio.DatagramTransport | None = None
        self._reopening: asyncio.Task[None] | None = None
        self._problem = ""

    async def open(self) -> None:
        try:
            await self._connect()
        except (socket.gaierror, PermissionError):  # no such host; a broadcast address
            raise
        except OSError as error:  # no network yet
            self._reopen(error)
        self._sink.opened(self.channel)

    async def close(self) -> None:
        if self._reopening is not None:
            self._reopening.cancel()
            await asyncio.wait([self._reopening])
            self._reopening = None
        self._outbox.flush()
        transport, self._transport = self._transport, None
        await _shut(transport)
        if self.channel.is_open:
            self.channel.close()
            self._sink.closed(self.channel)

    def describe(self) -> str:
        return f"{self.url}: {self._problem}, retrying" if self._problem else self.url

    async def _connect(self) -> None:
        transport, self._transport = self._transport, None
        await _shut(transport)
        self.channel.resume()  # the one that may have paused it is gone
        address = (self.parsed.place, self.parsed.number)
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Datagrams(self._received, self._failed, self._paused), remote_addr=address
        )
        self.channel.local_host = seen_host(
            self._transport.get_extra_info("sockname"), self._transport.get_extra_info("peername")
        )
        self._problem = ""

    def _write(self, raw: bytes) -> None:
        if self._transport is None:
            self.counters["send_errors"] += 1
        else:
            self._transport.sendto(raw)

    def _received(self, data: bytes, address: Any) -> None:
        with self._outbox:
            self._sink.received(self.channel, self.channel.receive(data))

    def _paused(self, paused: bool) -> None:
        if paused:
            self.channel.pause()
        else:
            self.channel.resume()

    def _failed(self, error: Exception) -> None:
        self.counters["send_errors"] += 1
        if not isinstance(error, ConnectionRefusedError):
            self._reopen(error)

    def _reopen(self, error: Exception) -> None:
        problem = reason(error)
        if problem != self._problem:
            logger.warning("%s: %s", self.url, problem)
        self._problem = problem
        if self._reopening is None or self._reopening.done():
            self._reopening = asyncio.get_running_loop().create_task(self._try_again())

    async def _try_again(self) -> None:
        pause = RETRY_FIRST
        while True:
            await asyncio.sleep(pause)
            pause = min(2 * pause, RETRY_LAST)
            self.counters["reopened"] += 1
            try:
                await self._connect()
            except OSError as error:
                self._problem = reason(error)
            else:
                logger.warning("%s: open again", self.url)
                return


@dataclass
class _Peer:
    channel: Channel
    outbox: Outbox
    heard: float


class UdpIn(Endpoint):
    """Listens; each address that sends a MAVLink frame is a channel.

    It is one until it has been silent for `PEER_SILENCE`.
    """

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._transport: asyncio.DatagramTransport | None = None
        self._peers: dict[Any, _Peer] = {}
        self._is_paused = False
        self._sweep: asyncio.TimerHandle | None = None

    @property
    def local_port(self) -> int | None:
        if self._transport is None:
            return None
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    async def open(self) -> None:
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Datagrams(self._received, self._failed, self._paused),
            local_addr=(self.parsed.place, self.parsed.number),
        )
        self._arm_sweep()

    async def close(self) -> None:
        if self._sweep is not None:
            self._sweep.cancel()
            self._sweep = None
        for address in tuple(self._peers):
            self._forget(address)
        transport, self._transport = self._transport, None
        await _shut(transport)

    def describe(self) -> str:
        count = len(self._peers)
        return f"{self.shown_url}: {count} peer{'' if count == 1 else 's'}"

    def expire(self, now: float) -> None:
        """Forget the peers that have been silent for too long."""
        for address, peer in tuple(self._peers.items()):
            if now - peer.heard > PEER_SILENCE:
                self._forget(address)

    def _arm_sweep(self) -> None:
        self.expire(self._clock.monotonic())
        self._sweep = asyncio.get_running_loop().call_later(SWEEP_EVERY, self._arm_sweep)

    def _received(self, data: bytes, address: Any) -> None:
        now = self._clock.monotonic()
        peer = self._peers.get(address)
        if peer is None:
            # Not a peer before it has sent something true: garbage must not open channels.
            outbox = Outbox(self._writer(address), _datagram_limit(self.parsed))
            channel = Channel(f"{self.url} from {address[0]}:{address[1]}", outbox.add, datagrams=True)
            channel.flavour = self.parsed.flavour
            channel.local_host = routed_host(address)
            frames = channel.receive(data)
            if not frames:
                self.counters.update(channel.parser.counters)
                return
            if not self._make_room(now):
                self.counters["refused_peers"] += 1
                return
            peer = self._peers[address] = _Peer(channel, outbox, now)
            if self._is_paused:
                channel.pause()
            self._sink.opened(channel)
        else:
            channel = peer.channel
            frames = channel.receive(data)
            if frames:
                peer.heard = now
        with peer.outbox:
            self._sink.received(channel, frames)

    def _make_room(self, now: float) -> bool:
        if len(self._peers) < MAX_PEERS:
            return True
        address = min(self._peers, key=lambda address: self._peers[address].heard)
        if now - self._peers[address].heard < PEER_REPLACEABLE:
            return False
        self._forget(address)
        return True

    def _forget(self, address: Any) -> None:
        peer = self._peers.pop(address)
        peer.channel.close()
        peer.outbox.flush()
        self._sink.closed(peer.channel)

    def _writer(self, address: Any) -> Callable[[bytes], None]:
        def write(raw: bytes) -> None:
            if self._transport is not None:
                self._transport.sendto(raw, address)

        return write

    def _failed(self, error: Exception) -> None:
        self.counters["send_errors"] += 1

    def _paused(self, paused: bool) -> None:
        self._is_paused = paused
        for peer in tuple(self._peers.values()):
            if paused:
                peer.channel.pause()
            else:
                peer.channel.resume()
