"""TCP connections and datagrams through the mux, for web server and video.

They reach a drone behind a Skycontroller 4.

The controller ("master") asks for a host by name ("drone", "skycontroller"), gets an address, and opens a channel for
each connection; the device ("slave") connects there and passes bytes both ways. A slave's channel has the number of
the master's with the highest bit set (libmux mux_channel.c, mux_ip_proxy.c). After each megabyte the sender may ask
for an acknowledgement and waits for it. The ends of datagrams are in `mux_udp`.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
from collections.abc import Callable
from typing import Protocol

from anafi_mav.arsdk.mux.mux import MuxControl, encode_control, encode_frame
from anafi_mav.arsdk.mux.mux_udp import REMOTE_UPDATE_ACK, UdpSocket, UdpTunnel
from anafi_mav.errors import LinkLost

log = logging.getLogger("anafi_mav.arsdk")

RESOLVE_REQ, RESOLVE_ACK = 9, 10
"""args: (proxy, transport, application, port) and (proxy, transport, application, address, port), behind them the
host's name with a NUL. The address is in network order as it lies in memory."""
OPEN, CLOSE = 0, 1
IP_CONNECT, IP_DISCONNECT, IP_CONNECTED, IP_DISCONNECTED, IP_REQ_ACK, IP_ACK = 13, 14, 15, 16, 17, 18

MASTER, SLAVE = 1, 2
"""Types of channel, the first argument of `OPEN`."""
FIRST_CHANNEL = 1024
_SLAVE_BIT = 1 << 31
_TCP, _UDP = 0, 1
_NOBODY = 0xFFFFFFFF

MAX_CHANNELS = 64
"""Connections at a time; a web client has a handful."""
CHUNK = 1 << 14
"""Bytes of one frame, so that a download does not keep telemetry waiting."""
MAX_AHEAD = 1 << 20
"""Bytes sent on a channel before an acknowledgement is awaited (libmux MUX_CHANNEL_IP_ACK_BYTES_INTL)."""
MAX_UNREAD = 1 << 24
"""Bytes that wait for a local client that does not read; then its connection ends. The mux of all channels is one TCP
connection, so that to read it later would keep the drone's telemetry waiting."""
TIMEOUT = 5.0
"""s to wait for a resolution or an acknowledgement."""


class StreamCarrier(Protocol):
    """The mux below; `write_raw` may drop when it is full, so `drained` is awaited before."""

    def write_raw(self, frame: bytes) -> None: ...

    async def drained(self) -> None: ...


def _number(address: str) -> int:
    return int.from_bytes(ipaddress.IPv4Address(address).packed, "little")


def _text(address: int) -> str:
    return str(ipaddress.IPv4Address(address.to_bytes(4, "little")))


class _Channel:
    """One connection: a TCP stream at one side, a channel at the other."""

    def __init__(
        self, carrier: StreamCarrier, own: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.own = own
        self.writer = writer
        self.acknowledged = asyncio.Event()
        self._carrier = carrier
        self._reader = reader

    def put(self, data: bytes) -> None:
        """Bytes from the other side."""
        if self.writer.is_closing():
            return
        if self.writer.transport.get_write_buffer_size() > MAX_UNREAD:
            log.warning("mux: a connection ends: %d MB wait for its client", MAX_UNREAD >> 20)
            self.writer.transport.abort()
            return
        self.writer.write(data)

    def close(self) -> None:
        """End the connection. Idempotent."""
        self.writer.close()

    async def pump(self, ask: bool) -> None:
        """Pass on what is read, to its end; `ask` for acknowledgements, which only a master may."""
        ahead = 0
        with contextlib.suppress(OSError):
            while data := await self._reader.read(CHUNK):
                await self._carrier.drained()
                self._carrier.write_raw(encode_frame(self.own, data))
                ahead += len(data)
                if ask and ahead >= MAX_AHEAD:
                    ahead = 0
                    self.acknowledged.clear()
                    self._carrier.write_raw(encode_control(IP_REQ_ACK, self.own))
                    await asyncio.wait_for(self.acknowledged.wait(), TIMEOUT)


class Slave:
    """The device's end: connects where it is asked to."""

    def __init__(
        self, carrier: StreamCarrier, resolve: Callable[[str], str | None], port: Callable[[int], int]
    ) -> None:
        """Store the resolvers of hosts and ports.

        `resolve` gives a host's address (None: unknown), `port` the real port for a port of a host.
        """
        self._carrier = carrier
        self._resolve = resolve
        self._port = port
        self._channels: dict[int, _Channel | UdpSocket | None] = {}
        """By the master's number; None while it is being connected."""
        self._known: set[int] = set()
        """Addresses that we gave away; others are not connected to."""
        self._early: dict[int, bytearray] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def control(self, message: MuxControl, payload: bytes) -> None:
        """A control message of the mux; what is not the proxy's is ignored."""
        master = message.channel
        match message.id:
            case 9:  # RESOLVE_REQ
                name = payload.partition(b"\0")[0].decode(errors="replace")
                address = self._resolve(name)
                number = _NOBODY if address is None else _number(address)
                if address is not None:
                    self._known.add(number)
                proxy, transport, application, port = message.args[:4]
                self._carrier.write_raw(
                    encode_control(RESOLVE_ACK, 0, proxy, transport, application, number, port, payload=payload)
                )
            case 0 if message.args[0] == MASTER and FIRST_CHANNEL <= master < _SLAVE_BIT:
                if len(self._channels) < MAX_CHANNELS and master not in self._channels:
                    self._channels[master] = None
                    self._early[master] = bytearray()
                    self._carrier.write_raw(encode_control(OPEN, master | _SLAVE_BIT, SLAVE))
            case 13 if self._channels.get(master, master) is None:  # IP_CONNECT, and not connected yet
                transport, _, where, port = message.args[:4]
                connecting = self._bind(master, where) if transport == _UDP else self._connect(master, where, port)
                task = asyncio.create_task(connecting)
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
            case 11 if message.args[0] in self._known:  # REMOTE_UPDATE_REQ
                held = self._channels.get(master)
                if isinstance(held, UdpSocket):
                    where, port = message.args[:2]
                    held.aim(_text(where), port & 0xFFFF)
                    self._carrier.write_raw(encode_control(REMOTE_UPDATE_ACK, master | _SLAVE_BIT, where, port))
            case 1 | 14:  # CLOSE, IP_DISCONNECT
                self._drop(master)
            case 17 if master in self._channels:  # IP_REQ_ACK: what came before has been taken
                self._carrier.write_raw(encode_control(IP_ACK, master | _SLAVE_BIT))

    def data(self, channel: int, data: bytes) -> None:
        """Bytes of a channel."""
        held = self._channels.get(channel)
        if held is not None:
            held.put(data)
        elif channel in self._early and len(self._early[channel]) + len(data) <= MAX_AHEAD:
            self._early[channel] += data

    async def _connect(self, master: int, address: int, port: int) -> None:
        host, slave = _text(address), master | _SLAVE_BIT
        try:
            if address not in self._known:
                raise ConnectionRefusedError("no address of ours")
            reader, writer = await asyncio.open_connection(host, self._port(port & 0xFFFF))
        except OSError as error:
            log.debug("mux: no connection to %s:%d: %s", host, port, error)
            self._carrier.write_raw(encode_control(IP_DISCONNECTED, slave))
            self._drop(master)
            return
        channel = _Channel(self._carrier, slave, reader, writer)
        if self._channels.get(master, channel) is not None:  # closed meanwhile, or asked for twice
            writer.close()
            return
        self._channels[master] = channel
        self._carrier.write_raw(encode_control(IP_CONNECTED, slave))
        channel.put(bytes(self._early.pop(master, b"")))
        try:
            await channel.pump(ask=False)
        finally:
            if self._channels.get(master) is channel:
                self._carrier.write_raw(encode_control(IP_DISCONNECTED, slave))
            writer.close()

    async def _bind(self, master: int, address: int) -> None:
        slave = master | _SLAVE_BIT
        try:
            if address not in self._known:
                raise ConnectionRefusedError("no address of ours")
            held = await UdpSocket.bind(self._carrier, slave, _text(address))
        except OSError as error:
            log.debug("mux: no socket: %s", error)
            self._carrier.write_raw(encode_control(IP_DISCONNECTED, slave))
            self._drop(master)
            return
        if self._channels.get(master, held) is not None:  # closed meanwhile, or asked for twice
            held.close()
            return
        self._early.pop(master, None)
        self._channels[master] = held
        self._carrier.write_raw(encode_control(IP_CONNECTED, slave, held.local_port))

    def _drop(self, master: int) -> None:
        self._early.pop(master, None)
        channel = self._channels.pop(master, None)
        if channel is not None:
            channel.close()

    async def close(self) -> None:
        """End every connection."""
        for master in list(self._channels):
            self._drop(master)
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


class Master:
    """The controller's end: passes each local connection to a port behind the mux."""

    def __init__(self, carrier: StreamCarrier) -> None:
        self._carrier = carrier
        self._channels: dict[int, _Channel | UdpTunnel] = {}
        self._connected: dict[int, asyncio.Future[int]] = {}
        """Done with the port at the other side, where it has one for us."""
        self._resolving: dict[int, asyncio.Future[int]] = {}
        self._servers: list[asyncio.AbstractServer] = []
        self._doors: dict[tuple[str, int], tuple[str, int]] = {}
        """Local address for each port behind the mux."""
        self._shut = False
        self._tasks: set[asyncio.Task[None]] = set()
        self._next_channel = FIRST_CHANNEL
        self._next_proxy = 1

    async def open(self, host: str, port: int) -> tuple[str, int]:
        """Return the local address that leads to a port of "drone" or "skycontroller".

        It stays the same for as long as the connection lasts. Raises `LinkLost`.
        """
        if (host, port) in self._doors:
            return self._doors[host, port]
        address = await self._resolve(host, _TCP, port)

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            try:
                await self._serve(reader, writer, address, port)
            finally:
                writer.close()

        def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            # A task of ours: one that `start_server` makes prints a traceback when it is cancelled (Python 3.11.7).
            task = asyncio.create_task(serve(reader, writer))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

        server = await asyncio.start_server(accept, "127.0.0.1", 0)
        if self._shut:
            server.close()
            raise LinkLost("not connected")
        self._servers.append(server)
        name: tuple[str, int] = server.sockets[0].getsockname()
        self._doors[host, port] = name
        return name

    async def open_udp(self, host: str, on_datagram: Callable[[bytes], None]) -> UdpTunnel:
        """A UDP socket at the Skycontroller's side, to talk to "skycontroller" or "drone".

        Raises `LinkLost`.
        """
        address = await self._resolve(host, _UDP, 0)
        if len(self._channels) >= MAX_CHANNELS:
            raise LinkLost("too many connections over the mux")
        number, self._next_channel = self._next_channel, self._next_channel + 1
        tunnel = UdpTunnel(self._carrier, number, address, on_datagram, lambda: self._end(number))
        self._channels[number] = tunnel
        connected = self._connected[number] = asyncio.get_running_loop().create_future()
        self._carrier.write_raw(encode_control(OPEN, number, MASTER))
        self._carrier.write_raw(encode_control(IP_CONNECT, number, _UDP, 0, address, 0))
        try:
            tunnel.port = await asyncio.wait_for(connected, TIMEOUT)
        except BaseException as error:
            tunnel.close()
            if isinstance(error, asyncio.TimeoutError):
                raise LinkLost("the Skycontroller opens no socket") from None
            raise
        return tunnel

    async def _resolve(self, host: str, transport: int, port: int) -> int:
        if self._shut:
            raise LinkLost("not connected")
        proxy, self._next_proxy = self._next_proxy, self._next_proxy + 1
        answer: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        self._resolving[proxy] = answer
        payload = host.encode() + b"\0"
        self._carrier.write_raw(encode_control(RESOLVE_REQ, 0, proxy, transport, 0, port, payload=payload))
        try:
            address = await asyncio.wait_for(answer, TIMEOUT)
        except asyncio.TimeoutError:
            raise LinkLost(f"the Skycontroller does not say where {host} is") from None
        finally:
            del self._resolving[proxy]
        if address == _NOBODY:
            raise LinkLost(f"the Skycontroller knows no {host}")
        return address

    def _end(self, number: int) -> None:
        self._channels.pop(number, None)
        self._connected.pop(number, None)
        self._carrier.write_raw(encode_control(IP_DISCONNECT, number))
        self._carrier.write_raw(encode_control(CLOSE, number, MASTER))

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, address: int, port: int) -> None:
        if len(self._channels) >= MAX_CHANNELS:
            return
        number, self._next_channel = self._next_channel, self._next_channel + 1
        channel = _Channel(self._carrier, number, reader, writer)
        self._channels[number] = channel
        connected = self._connected[number] = asyncio.get_running_loop().create_future()
        self._carrier.write_raw(encode_control(OPEN, number, MASTER))
        self._carrier.write_raw(encode_control(IP_CONNECT, number, _TCP, 0, address, port))
        try:
            with contextlib.suppress(asyncio.TimeoutError, LinkLost):
                await asyncio.wait_for(connected, TIMEOUT)
                await channel.pump(ask=True)
        finally:
            self._end(number)

    def control(self, message: MuxControl, payload: bytes) -> None:
        """A control message of the mux; what is not the proxy's is ignored."""
        number = message.channel & ~_SLAVE_BIT
        held = self._channels.get(number)
        if message.id == RESOLVE_ACK:
            answer = self._resolving.get(message.args[0])
            if answer is not None and not answer.done():
                answer.set_result(message.args[3])
        elif message.id == IP_CONNECTED:
            connected = self._connected.get(number)
            if connected is not None and not connected.done():
                connected.set_result(message.args[0] & 0xFFFF)
        elif message.id == IP_DISCONNECTED:
            connected = self._connected.get(number)
            if connected is not None and not connected.done():
                connected.set_exception(LinkLost("nothing listens there"))
            elif held is not None:
                held.close()
        elif message.id == IP_ACK and isinstance(held, _Channel):
            held.acknowledged.set()
        elif message.id == REMOTE_UPDATE_ACK and isinstance(held, UdpTunnel):
            held.aimed()

    def data(self, channel: int, data: bytes) -> None:
        """Bytes of a channel."""
        held = self._channels.get(channel & ~_SLAVE_BIT)
        if held is not None:
            held.put(data)

    def shut(self) -> None:
        """Stop listening and end every connection. Idempotent."""
        self._shut = True
        for server in self._servers:
            server.close()
        for channel in tuple(self._channels.values()):
            channel.close()
        for task in tuple(self._tasks):
            task.cancel()

    async def close(self) -> None:
        """`shut`, and wait until all of it has ended."""
        self.shut()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for server in self._servers:
            await server.wait_closed()
