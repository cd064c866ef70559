"""TCP connections through the mux: the web server of a drone behind a Skycontroller 4.

The controller ("master") asks for a host by name ("drone", "skycontroller"), gets an address, and opens a channel for
each connection; the device ("slave") connects there and passes bytes both ways. A slave's channel has the number of
the master's with the highest bit set (libmux mux_channel.c, mux_ip_proxy.c). After each megabyte the sender may ask for
an acknowledgement and waits for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
from collections.abc import Callable
from typing import Protocol

from anafi_mav.arsdk.mux import Control, encode_control, encode_frame
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
_TCP = 0
_NOBODY = 0xFFFFFFFF

MAX_CHANNELS = 64
"""Connections at a time; a web client has a handful."""
CHUNK = 1 << 14
"""Bytes of one frame, so that a download does not keep telemetry waiting."""
MAX_AHEAD = 1 << 20
"""Bytes sent on a channel before an acknowledgement is awaited (libmux MUX_CHANNEL_IP_ACK_BYTES_INTL)."""
TIMEOUT = 5.0
"""s to wait for a resolution or an acknowledgement."""


class Carrier(Protocol):
    """The mux below; `write_raw` may drop when it is full, so `drained` is awaited before."""

    def write_raw(self, frame: bytes) -> None: ...

    async def drained(self) -> None: ...


def _number(address: str) -> int:
    return int.from_bytes(ipaddress.IPv4Address(address).packed, "little")


class _Channel:
    """One connection: a TCP stream at one side, a channel at the other."""

    def __init__(self, carrier: Carrier, own: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.own = own
        self.writer = writer
        self.acknowledged = asyncio.Event()
        self._carrier = carrier
        self._reader = reader

    def put(self, data: bytes) -> None:
        """Bytes from the other side."""
        if not self.writer.is_closing():
            self.writer.write(data)

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

    def __init__(self, carrier: Carrier, resolve: Callable[[str], str | None], port: Callable[[int], int]) -> None:
        """`resolve` gives a host's address (None: unknown), `port` where the port of a host really is."""
        self._carrier = carrier
        self._resolve = resolve
        self._port = port
        self._channels: dict[int, _Channel | None] = {}
        """By the master's number; None while it is being connected."""
        self._known: set[int] = set()
        """Addresses that we gave away; others are not connected to."""
        self._early: dict[int, bytearray] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def control(self, message: Control, payload: bytes) -> None:
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
            case 13 if master in self._channels and message.args[0] == _TCP:
                task = asyncio.create_task(self._connect(master, message.args[2], message.args[3]))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
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
        host = str(ipaddress.IPv4Address(address.to_bytes(4, "little")))
        slave = master | _SLAVE_BIT
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
        self._channels[master] = channel
        self._carrier.write_raw(encode_control(IP_CONNECTED, slave))
        channel.put(bytes(self._early.pop(master, b"")))
        try:
            await channel.pump(ask=False)
        finally:
            if self._channels.get(master) is channel:
                self._carrier.write_raw(encode_control(IP_DISCONNECTED, slave))
            writer.close()

    def _drop(self, master: int) -> None:
        self._early.pop(master, None)
        channel = self._channels.pop(master, None)
        if channel is not None:
            channel.writer.close()

    async def close(self) -> None:
        """End every connection."""
        for master in list(self._channels):
            self._drop(master)
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


class Master:
    """The controller's end: listens on this machine and passes each connection to a port behind the mux."""

    def __init__(self, carrier: Carrier) -> None:
        self._carrier = carrier
        self._channels: dict[int, _Channel] = {}
        self._connected: dict[int, asyncio.Future[None]] = {}
        self._resolving: dict[int, asyncio.Future[int]] = {}
        self._servers: list[asyncio.AbstractServer] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._next_channel = FIRST_CHANNEL
        self._next_proxy = 1

    async def open(self, host: str, port: int) -> tuple[str, int]:
        """The address on this machine that leads to a port of "drone" or "skycontroller". Raises `LinkLost`."""
        proxy, self._next_proxy = self._next_proxy, self._next_proxy + 1
        answer = self._resolving[proxy] = asyncio.get_running_loop().create_future()
        payload = host.encode() + b"\0"
        self._carrier.write_raw(encode_control(RESOLVE_REQ, 0, proxy, _TCP, 0, port, payload=payload))
        try:
            address = await asyncio.wait_for(answer, TIMEOUT)
        except asyncio.TimeoutError:
            raise LinkLost(f"the Skycontroller does not say where {host} is") from None
        finally:
            del self._resolving[proxy]
        if address == _NOBODY:
            raise LinkLost(f"the Skycontroller knows no {host}")

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            self._tasks.add(task)
            try:
                await self._serve(reader, writer, address, port)
            finally:
                self._tasks.discard(task)
                writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        self._servers.append(server)
        name: tuple[str, int] = server.sockets[0].getsockname()
        return name

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, address: int, port: int) -> None:
        if len(self._channels) >= MAX_CHANNELS:
            return
        number, self._next_channel = self._next_channel, self._next_channel + 1
        channel = self._channels[number] = _Channel(self._carrier, number, reader, writer)
        connected = self._connected[number] = asyncio.get_running_loop().create_future()
        self._carrier.write_raw(encode_control(OPEN, number, MASTER))
        self._carrier.write_raw(encode_control(IP_CONNECT, number, _TCP, 0, address, port))
        try:
            with contextlib.suppress(asyncio.TimeoutError, LinkLost):
                await asyncio.wait_for(connected, TIMEOUT)
                await channel.pump(ask=True)
        finally:
            self._channels.pop(number, None)
            self._connected.pop(number, None)
            self._carrier.write_raw(encode_control(IP_DISCONNECT, number))
            self._carrier.write_raw(encode_control(CLOSE, number, MASTER))

    def control(self, message: Control, payload: bytes) -> None:
        """A control message of the mux; what is not the proxy's is ignored."""
        number = message.channel & ~_SLAVE_BIT
        if message.id == RESOLVE_ACK:
            answer = self._resolving.get(message.args[0])
            if answer is not None and not answer.done():
                answer.set_result(message.args[3])
        elif message.id == IP_CONNECTED:
            connected = self._connected.get(number)
            if connected is not None and not connected.done():
                connected.set_result(None)
        elif message.id == IP_DISCONNECTED:
            connected, channel = self._connected.get(number), self._channels.get(number)
            if connected is not None and not connected.done():
                connected.set_exception(LinkLost("nothing listens there"))
            if channel is not None:
                channel.writer.close()
        elif message.id == IP_ACK and number in self._channels:
            self._channels[number].acknowledged.set()

    def data(self, channel: int, data: bytes) -> None:
        """Bytes of a channel."""
        held = self._channels.get(channel & ~_SLAVE_BIT)
        if held is not None:
            held.put(data)

    async def close(self) -> None:
        """Stop listening and end every connection."""
        for server in self._servers:
            server.close()
        for channel in tuple(self._channels.values()):
            channel.writer.close()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for server in self._servers:
            await server.wait_closed()
