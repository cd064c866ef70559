"""UDP endpoints: `udpout` sends to one address from the start, `udpin` answers its peers."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from anafi_mav.clock import Clock
from anafi_mav.mavlink.address_proof import AddressProof, Introductions
from anafi_mav.mavlink.base import (
    CLOSE_WAIT,
    RETRY_FIRST,
    RETRY_LAST,
    WRITE_AHEAD,
    Endpoint,
    EndpointUrl,
    Outbox,
    Sink,
    is_loopback,
    reason,
    routed_host,
    seen_host,
    shaped_channel,
)
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.frames import ReceivedFrame, Verdict
from anafi_mav.mavlink.listener import Listener
from anafi_mav.mavlink.router import targets
from anafi_mav.receive_buffer import limit_reads, read_waiting
from anafi_mav.units import counted

logger = logging.getLogger(__name__)

ONE_FRAME = 0
"""The limit of an `Outbox` that gathers nothing. The default: gomavlib since 3.3.2, and so mavp2p, reads the first
frame of a datagram and loses the others."""


PAUSE = 0.005
"""s between two datagrams of several frames, unless they are full. A datagram takes the kernel 10 us and more,
whatever is in it, and telemetry may take 20 ms."""


EVERYBODY = "255.255.255.255"
"""The broadcast address of every network. Without a network the kernel does not refuse it yet."""

_ONE_STATION = "expected the address of one station, not of a broadcast"

HOLDS = 5.0
"""s without an error after which a socket that was opened again counts as working. The kernel looks for a computer that
is switched off for 3 s (Linux net.ipv4.neigh), and reports it then."""


def _datagram_limit(url: EndpointUrl) -> int:
    return url.options.datagram_bytes if url.options.frames == "many" else ONE_FRAME


async def _family(url: EndpointUrl) -> socket.AddressFamily:
    """Return the kind of addresses to choose from: of IPv4, where a name has one.

    Ground stations listen on IPv4, and with UDP it does not show when none listens. Debian's `localhost` has ::1
    first.
    """
    if _is_address(url.place):
        return socket.AF_UNSPEC
    loop = asyncio.get_running_loop()
    try:
        await loop.getaddrinfo(url.place, url.number, family=socket.AF_INET, type=socket.SOCK_DGRAM)
    except socket.gaierror:
        return socket.AF_UNSPEC
    return socket.AF_INET


def _is_address(place: str) -> bool:
    try:
        ipaddress.ip_address(place.partition("%")[0])
    except ValueError:
        return False
    return True


def _explained(error: Exception) -> str:
    """Return the reason of a network error.

    That of a broadcast address, to which the kernel refuses to connect, says what is expected instead.
    """
    return reason(error) + (f": {_ONE_STATION}" if isinstance(error, PermissionError) else "")


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
        self._transport: asyncio.BaseTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert hasattr(transport, "set_write_buffer_limits")  # asyncio's datagram transports have it, their type not
        transport.set_write_buffer_limits(high=WRITE_AHEAD)
        limit_reads(transport)
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._received(data, addr)
        read_waiting(self._transport, self._received, self._failed)

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
    refused", because a connected socket keeps the local address it had, and a laptop changes networks. The log has an
    error once, however often it returns while the peer's computer is off.
    """

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._outbox = Outbox(self._write, _datagram_limit(url), PAUSE)
        self.channel = shaped_channel(
            url.text, self._outbox.add, url.options, write_all=self._outbox.add_all, datagrams=True
        )
        self._transport: asyncio.DatagramTransport | None = None
        self._reopening: asyncio.Task[None] | None = None
        self._problem = ""
        self._reported = ""
        """The problem in the log; empty while it is over."""
        self._broken = asyncio.Event()
        """Set when the present socket has failed."""

    async def open(self) -> None:
        self._protect(self.channel)
        try:
            await self._connect()
        except socket.gaierror:  # no such host
            raise
        except OSError as error:
            if isinstance(error, PermissionError) or self.parsed.place == EVERYBODY:
                raise OSError(f"{reason(error)}: {_ONE_STATION}") from error
            self._reopen(error)  # no network yet
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
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Datagrams(self._received, self._failed, self._paused),
            remote_addr=(self.parsed.place, self.parsed.number),
            family=await _family(self.parsed),
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
        self._problem = _explained(error)
        if self._problem != self._reported:
            logger.warning("%s: %s", self.url, self._problem)
        self._reported = self._problem
        self._broken.set()
        if self._reopening is None or self._reopening.done():
            self._reopening = asyncio.get_running_loop().create_task(self._try_again())

    async def _try_again(self) -> None:
        pause = RETRY_FIRST
        while True:
            await asyncio.sleep(pause)
            pause = min(2 * pause, RETRY_LAST)
            self.counters["reopened"] += 1
            self._broken.clear()
            try:
                await self._connect()
            except OSError as error:
                self._problem = _explained(error)
                continue
            try:
                await asyncio.wait_for(self._broken.wait(), HOLDS)
            except asyncio.TimeoutError:
                logger.warning("%s: open again", self.url)
                self._reported = ""
                return


@dataclass
class _Peer:
    channel: Channel
    outbox: Outbox


class UdpIn(Listener):
    """Listens; each address that sends a MAVLink frame is a channel.

    It is one until it has been silent for too long.
    """

    IDLE_LIMIT = 30.0
    """Thirty heartbeats missed: a ground station whose laptop slept for a moment keeps its stream rates."""
    IDLE_LEVEL = logging.INFO
    """UDP has no other end of a connection."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._transport: asyncio.DatagramTransport | None = None
        self._peers: dict[Any, _Peer] = {}
        self._is_paused = False
        # Old frames are easily recorded: they take no turn of a sender that does not sign yet.
        self._introductions = {verdict: Introductions() for verdict in (Verdict.UNSIGNED, Verdict.REPLAYED)}

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
            family=await _family(self.parsed),
        )
        self._start_sweep()

    async def close(self) -> None:
        self._stop_sweep()
        for address in tuple(self._peers):
            self._drop(address)
        transport, self._transport = self._transport, None
        await _shut(transport)

    def describe(self) -> str:
        count = len(self._peers)
        return f"{self.shown_url}: {counted(count, 'peer')}"

    def _received(self, data: bytes, address: Any) -> None:
        now = self._clock.monotonic()
        peer = self._peers.get(address)
        if peer is None:
            if not self._is_allowed(address[0]):
                return
            # Not a peer before it has sent something true: garbage must not open channels.
            outbox = Outbox(self._writer(address), _datagram_limit(self.parsed), PAUSE)
            name = f"{self.url} from {self._shown(address)}"
            channel = shaped_channel(name, outbox.add, self.parsed.options, write_all=outbox.add_all, datagrams=True)
            self._protect(channel)
            channel.proof = None if channel.is_signed or is_loopback(address[0]) else AddressProof()
            frames = channel.receive(data)
            if not channel.is_proved_by(frames):
                self.counters.update(channel.parser.counters)
                self._introduce(channel, outbox, address, now)
                return
            known = channel.proof is None
            if not self._make_room(self._shown(address), now, known=known):
                return
            channel.local_host = routed_host(address)
            peer = self._peers[address] = _Peer(channel, outbox)
            self._table.add(address, now, known=known)
            if self._is_paused:
                channel.pause()
            self._sink.opened(channel)
        else:
            channel = peer.channel
            frames = channel.receive(data)
        if frames and channel.proof is not None:
            self._weigh(channel, frames, address, now)
        with peer.outbox:
            self._sink.received(channel, frames)

    def _introduce(self, channel: Channel, outbox: Outbox, address: Any, now: float) -> None:
        """Send a refused sender one signed heartbeat.

        QGroundControl finds its key by a signed frame, and a station whose timestamps are behind follows ours.
        """
        for verdict, introductions in self._introductions.items():
            if channel.parser.counters[verdict.value] and introductions.allow(address, now):
                with outbox:
                    self._sink.introduce(channel)
                channel.close()  # gives its link id back
                return

    def _weigh(self, channel: Channel, frames: list[ReceivedFrame], address: Any, now: float) -> None:
        """Count a datagram of an address that has not proved to be there.

        After the proof it waits until there is a place for a known client.
        """
        assert channel.proof is not None
        size, systems = sum(len(received.raw) for received in frames), {targets(r.message)[0] for r in frames}
        proved = channel.proof.received(size, addressed=bool(systems - {0}), broadcast=0 in systems, now=now)
        if proved and self._make_room(self._shown(address), now, known=True):
            self._table.add(address, now, known=True)
            channel.prove()
            self._sink.proved(channel)
        else:
            channel.send_heartbeats()

    def _channel_of(self, address: Any) -> Channel:
        return self._peers[address].channel

    def _shown(self, address: Any) -> str:
        return f"{address[0]}:{address[1]}"

    def _drop(self, address: Any) -> None:
        self._table.remove(address)
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
