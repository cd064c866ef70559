"""TCP endpoints: `tcpin` serves clients, `tcpout` is one."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import re
import socket
from collections.abc import Callable

from anafi_mav.clock import Clock
from anafi_mav.mavlink.base import EndpointUrl, Reopening, Sink, StreamPeer, close_peers
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.listener import Listener
from anafi_mav.units import counted

logger = logging.getLogger(__name__)

CONNECT_TIMEOUT = 5.0
"""s for one attempt: a host that drops our packets would hold us for minutes."""

UNANSWERED_MS = 30_000
"""A peer that takes nothing for so long is gone (pulled cable, dead battery); TCP itself waits a quarter of an hour."""


_BROWSER = re.compile(rb"[A-Z]{3,16} |\x16\x03")
"""Beginning of a request of HTTP (RFC 9112 §3), or of a handshake of TLS (RFC 8446 §5.1)."""
_BROWSER_OR_NOT = re.compile(rb"[A-Z]{0,16}|\x16")
"""Too little to decide."""


class TcpPeer(StreamPeer):
    """A TCP connection. A dead one ends after half a minute."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        connection = transport.get_extra_info("socket")
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNANSWERED_MS)
        super().connection_made(transport)


class _ServedPeer(TcpPeer):
    """A connection of a client of `tcpin`, unless it is a browser's.

    The page of any web site can make a browser of this computer send a request to a port of it, with a body of the
    page's choice: MAVLink frames. Nothing is received from a connection that begins as HTTP or TLS.
    """

    def __init__(
        self,
        url: EndpointUrl,
        name: str,
        sink: Sink,
        proved: Callable[[_ServedPeer], None],
        refuse: Callable[[TcpPeer], None],
    ) -> None:
        """`proved` is called for a verified frame while `is_known` is False.

        `refuse` drops the connection of a browser.
        """
        super().__init__(url, name, sink)
        self.is_known = False
        """True when it has a place of a known client."""
        self._proved = proved
        self._refuse = refuse
        self._beginning: bytes | None = b""
        """The first bytes, while it is not known whether a browser sent them; None afterwards."""

    def data_received(self, data: bytes) -> None:
        if self._beginning is not None:
            data = self._beginning + data
            if _BROWSER.match(data):
                self._refuse(self)
                return
            if _BROWSER_OR_NOT.fullmatch(data):
                self._beginning = data
                return
            self._beginning = None
        super().data_received(data)
        if not self.is_known and self.channel.proved_at is not None:
            self._proved(self)


class TcpIn(Listener):
    """Listens; every client is a channel."""

    IDLE_LIMIT = 600.0
    """A station sends a heartbeat a second; the connection of one that has sent none for ten minutes is left over."""
    IDLE_LEVEL = logging.WARNING
    """Its client may be there and only listen: it has to learn why the connection ended."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        self._server: asyncio.Server | None = None
        self._peers: set[TcpPeer] = set()
        """With those that have just been dropped and not ended yet."""

    @property
    def local_port(self) -> int | None:
        if self._server is None or not self._server.sockets:
            return None
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    async def open(self) -> None:
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: _Client(self), self.parsed.place, self.parsed.number)
        if not self._server.sockets:  # asyncio passes over a kind of addresses that the system does not have
            raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))
        self._start_sweep()

    async def close(self) -> None:
        self._stop_sweep()
        if self._server is not None:
            self._server.close()
            self._server = None
        await close_peers(self._peers)

    def describe(self) -> str:
        count = len(self._table)
        return f"{self.shown_url}: {counted(count, 'client')}"

    def admit(self, transport: asyncio.BaseTransport) -> TcpPeer | None:
        """The peer for a new connection; None if it may not connect, or comes while we close."""
        address = transport.get_extra_info("peername")
        if self._server is None or address is None:  # it has ended already
            return None
        name, now = f"{address[0]}:{address[1]}", self._clock.monotonic()
        if not self._is_allowed(address[0]):
            return None
        peer = _ServedPeer(self.parsed, f"{self.url} from {name}", self._sink, self._proved, self._refuse_browser)
        self._protect(peer.channel)
        known = peer.is_known = not peer.channel.is_signed  # a connection proves the address
        if not self._make_room(name, now, known=known):
            return None
        self._peers.add(peer)
        self._table.add(peer, now, known=known)
        peer.lost.add_done_callback(lambda _: self._forget(peer))
        return peer

    def _proved(self, peer: _ServedPeer) -> None:
        """Give a client that holds the key a place of a known one, once there is one."""
        now = self._clock.monotonic()
        if peer in self._table and self._make_room(self._shown(peer), now, known=True):
            self._table.add(peer, now, known=True)
            peer.is_known = True

    def _refuse_browser(self, peer: TcpPeer) -> None:
        self.counters["refused_browsers"] += 1
        # A page can send many: one line is enough.
        level = logging.DEBUG if self.counters["refused_browsers"] > 1 else logging.WARNING
        logger.log(level, "%s: %s dropped: it sends HTTP or TLS, as a browser does", self.url, self._shown(peer))
        self._drop(peer)

    def _forget(self, peer: TcpPeer) -> None:
        self._peers.discard(peer)
        self._table.remove(peer)

    def _channel_of(self, peer: TcpPeer) -> Channel:
        return peer.channel

    def _shown(self, peer: TcpPeer) -> str:
        return peer.channel.name.removeprefix(f"{self.url} from ")

    def _drop(self, peer: TcpPeer) -> None:
        self._table.remove(peer)
        peer.abort()


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
        self._protect(peer.channel)
        attempt = loop.create_connection(lambda: peer, self.parsed.place, self.parsed.number)
        try:
            await asyncio.wait_for(attempt, CONNECT_TIMEOUT)
        except asyncio.TimeoutError:  # no OSError before Python 3.11
            raise OSError(f"no answer within {CONNECT_TIMEOUT:g} s") from None
        except BaseException:
            peer.abort()  # cancelled in the moment in which it succeeded
            raise
        return peer
