"""Datagrams through the mux: the transport of the video of a Skycontroller 4.

Each end is one channel of `mux_proxy`. The device ("slave") binds a UDP socket at its side and reports its port,
which is sent in the SETUP of RTSP as ours; when the server's port is known, the controller ("master") aims the socket
at it (libmux mux_ip_proxy.c, mux_channel.c; pdraw pdraw_demuxer_stream_mux.cpp).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

from anafi_mav.arsdk.mux.mux import encode_control, encode_frame
from anafi_mav.errors import LinkLost, LocalProtocolError

REMOTE_UPDATE_REQ, REMOTE_UPDATE_ACK = 11, 12
"""args: (address, port) that the slave's socket sends to from now on."""

TIMEOUT = 5.0
"""s to wait for the other end."""

MAX_DATAGRAM = 0xFFFF
"""Bytes; what UDP can carry."""


class DatagramCarrier(Protocol):
    """The mux below; `write_raw` may drop when it is full, as the air drops datagrams."""

    def write_raw(self, frame: bytes) -> None: ...


class UdpTunnel:
    """The controller's end: a UDP socket of the Skycontroller's that is ours."""

    def __init__(
        self,
        carrier: DatagramCarrier,
        own: int,
        address: int,
        on_datagram: Callable[[bytes], None],
        end: Callable[[], None],
    ) -> None:
        self.port = 0
        """Of the socket, at the Skycontroller."""
        self.closed = False
        self._updated: asyncio.Future[None] | None = None
        self._carrier = carrier
        self._own = own
        self._address = address
        self._on_datagram = on_datagram
        self._end = end

    async def aim(self, port: int) -> None:
        """Send to this port of the Skycontroller from now on.

        Raises `LinkLost` when it does not say that it does.
        """
        if not 1 <= port <= 0xFFFF:
            raise LocalProtocolError(f"{port} is no port")
        self._updated = asyncio.get_running_loop().create_future()
        self._carrier.write_raw(encode_control(REMOTE_UPDATE_REQ, self._own, self._address, port))
        try:
            await asyncio.wait_for(self._updated, TIMEOUT)
        except asyncio.TimeoutError:
            raise LinkLost("the Skycontroller does not aim its socket") from None
        finally:
            self._updated = None

    def aimed(self) -> None:
        """The other end has done it."""
        if self._updated is not None and not self._updated.done():
            self._updated.set_result(None)

    def send(self, data: bytes) -> None:
        """One datagram."""
        if not self.closed:
            self._carrier.write_raw(encode_frame(self._own, data))

    def put(self, data: bytes) -> None:
        """A datagram from the other side."""
        if not self.closed:
            self._on_datagram(data)

    def close(self) -> None:
        """Give the socket back. Idempotent."""
        if not self.closed:
            self.closed = True
            if self._updated is not None and not self._updated.done():
                self._updated.set_exception(LinkLost("closed"))
            self._end()


class UdpSocket(asyncio.DatagramProtocol):
    """The device's end: the socket. It hears one host only, from any port, as libmux does."""

    def __init__(self, carrier: DatagramCarrier, own: int, host: str) -> None:
        self._carrier = carrier
        self._own = own
        self._host = host
        self._port = 0
        self._transport: asyncio.DatagramTransport | None = None

    @classmethod
    async def bind(cls, carrier: DatagramCarrier, own: int, host: str) -> UdpSocket:
        """Raises `OSError`."""
        loop = asyncio.get_running_loop()
        _, self = await loop.create_datagram_endpoint(lambda: cls(carrier, own, host), local_addr=("0.0.0.0", 0))
        return self

    @property
    def local_port(self) -> int:
        """Of the socket; 0 once it is closed."""
        return 0 if self._transport is None else int(self._transport.get_extra_info("sockname")[1])

    def aim(self, host: str, port: int) -> None:
        """Hear this host, and send there."""
        self._host, self._port = host, port

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, address: tuple[Any, ...]) -> None:
        if address[0] == self._host:
            self._carrier.write_raw(encode_frame(self._own, data))

    def put(self, data: bytes) -> None:
        """A datagram from the other side."""
        if self._transport is not None and self._port and len(data) <= MAX_DATAGRAM:
            self._transport.sendto(data, (self._host, self._port))

    def close(self) -> None:
        """Idempotent."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None
