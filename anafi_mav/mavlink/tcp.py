"""TCP endpoints: `tcpin` serves clients, `tcpout` is one."""

from __future__ import annotations

import asyncio
import socket

from anafi_mav.clock import Clock
from anafi_mav.mavlink.base import MAX_PEERS, Endpoint, EndpointUrl, Reopening, Sink, StreamPeer, close_peers

CONNECT_TIMEOUT = 5.0
"""s for one attempt: a host that drops our packets would hold us for minutes."""

UNANSWERED_MS = 30_000
"""A peer that takes nothing for so long is gone (pulled cable, dead battery); TCP itself waits a quarter of an hour."""


class TcpPeer(StreamPeer):
    """A TCP connection. A dead one ends after half a minute."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        connection = transport.get_extra_info("socket")
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNANSWERED_MS)
        super().connection_made(transport)


class TcpIn(Endpoint):
    """Listens; every client is a channel."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._server: asyncio.Server | None = None
        self._peers: set[StreamPeer] = set()

    @property
    def local_port(self) -> int | None:
        if self._server is None or not self._server.sockets:
            return None
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    async def open(self) -> None:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: _Client(self), self.parsed.place, self.parsed.number)

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        await close_peers(self._peers)

    def describe(self) -> str:
        count = len(self._peers)
        return f"{self.shown_url}: {count} client{'' if count == 1 else 's'}"

    def admit(self, transport: asyncio.BaseTransport) -> StreamPeer | None:
        """The peer for a new connection; None if there are too many, or it comes while we close."""
        if self._server is None:
            return None
        if len(self._peers) >= MAX_PEERS:
            self.counters["refused_peers"] += 1
            return None
        host, port = transport.get_extra_info("peername")[:2]
        peer = TcpPeer(self.parsed, f"{self.url} from {host}:{port}", self._sink)
        self._peers.add(peer)
        peer.lost.add_done_callback(lambda _: self._peers.discard(peer))
        return peer


class _Client(asyncio.Protocol):
    """An accepted connection until it is known whether there is room for it."""

    def __init__(self, endpoint: TcpIn) -> None:
        self._endpoint = endpoint

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        peer = self._endpoint.admit(transport)
        if peer is None:
            transport.abort()
            return
        transport.set_protocol(peer)
        peer.connection_made(transport)


class TcpOut(Reopening):
    """Connects; reconnects whenever the connection ends."""

    async def _connect(self) -> StreamPeer:
        loop = asyncio.get_running_loop()
        peer = TcpPeer(self.parsed, self.url, self._sink)
        attempt = loop.create_connection(lambda: peer, self.parsed.place, self.parsed.number)
        try:
            await asyncio.wait_for(attempt, CONNECT_TIMEOUT)
        except asyncio.TimeoutError:  # no OSError before Python 3.11
            raise OSError(f"no answer within {CONNECT_TIMEOUT:g} s") from None
        except BaseException:
            peer.abort()  # cancelled in the moment in which it succeeded
            raise
        return peer
