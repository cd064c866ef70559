"""The controller's end: find a drone, shake hands, run a session with it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
from collections.abc import Callable, Sequence
from typing import TypeAlias, TypeVar

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.link import handshake, watchdog
from anafi_mav.arsdk.link.handshake import ConnectReply, ConnectRequest, DeviceInfo
from anafi_mav.arsdk.link.interface import bind_to_interface, open_connection
from anafi_mav.arsdk.link.session import OnMessage, Session, reason_of
from anafi_mav.arsdk.link.transport import Role, Transport
from anafi_mav.arsdk.link.watchdog import Watchdog
from anafi_mav.errors import HandshakeRefused, LinkLost, RemoteProtocolError

log = logging.getLogger("anafi_mav.arsdk")

CONTROLLER_NAME = "anafi-mav"
CONTROLLER_TYPE = "computer"

ParsedT = TypeVar("ParsedT")

CheckDevice: TypeAlias = Callable[[DeviceInfo], None]
"""Receives the description of a device before the handshake; an `AnafiMavError` that it raises ends the attempt."""


def accept_any(device: DeviceInfo) -> None:
    """Accept each device: the `CheckDevice` of a client that wants no particular one."""


class ControllerSession(Session):
    """A connection to a drone.

    It owns the discovery connection too, whose end is the drone's way to say goodbye.
    """

    def __init__(
        self,
        transport: Transport,
        on_message: OnMessage,
        device: DeviceInfo,
        discovery: tuple[asyncio.StreamReader, asyncio.StreamWriter],
    ) -> None:
        super().__init__(transport, on_message)
        self.on_stall: Callable[[], None] = lambda: None
        """Called when the host stalled and the watchdog has sent what stood by."""
        self.closed_by_peer = False
        """The session ended because the other side closed its TCP connection."""
        self._watchdog: Watchdog | None = None
        self._starting: asyncio.Task[None] | None = None
        self._standby: Sequence[Message] = ()
        self._standby_seq = -1
        self.device = device
        """Description that the drone sent in discovery."""
        self._discovery = discovery[1]
        self._watch = asyncio.create_task(self._watch_discovery(discovery[0]))

    async def _watch_discovery(self, reader: asyncio.StreamReader) -> None:
        with contextlib.suppress(OSError):
            while await reader.read(handshake.MAX_JSON):
                pass
        self.closed_by_peer = not self.lost.done()
        self.end("the drone closed the connection")

    def end(self, reason: str) -> None:
        """See `Session.end`; the discovery connection goes too."""
        super().end(reason)
        self._watch.cancel()
        self._discovery.close()
        if self._watchdog is not None:
            self._watchdog.close()

    async def close(self) -> None:
        """See `Session.close`."""
        await super().close()
        await asyncio.wait([self._watch])
        if self._watchdog is not None and self._starting is not None:
            await asyncio.wait([self._starting])
            await self._watchdog.ended()

    # -- what is sent for us when the host stalls

    def watch(self) -> None:
        """Start the process that sends the standby frames when the event loop stalls (POSIX only)."""
        if self._watchdog is None and watchdog.LIMIT is not None and os.name == "posix" and not self.lost.done():
            self._watchdog = Watchdog(self._stalled, watchdog.LIMIT)
            self._guard = self
            self._starting = asyncio.create_task(self._start_watchdog(self._watchdog))

    def stand_by(self, messages: Sequence[Message]) -> None:
        """Have these commands sent when the event loop stalls; none: nothing is sent."""
        self._standby = messages
        self._renew()

    async def _start_watchdog(self, guard: Watchdog) -> None:
        assert self._endpoint is not None
        try:
            await guard.start(self._endpoint.get_extra_info("socket"), self.version, self._whole())
        except OSError as error:
            log.warning("no watchdog over the axes of the Skycontroller: %s", error)

    def _whole(self) -> Callable[[], bool] | None:
        """See `Watchdog.start`."""
        return None

    def _wrapped(self, frame: bytes) -> bytes:
        """A frame as it lies on the wire."""
        return frame

    def _renew(self) -> None:
        if self._watchdog is not None and not self.lost.done():
            frames = self._transport.encode_ahead(self._standby)
            self._standby_seq = self._transport.next_seq
            self._watchdog.stand_by([(seq, self._wrapped(frame)) for seq, frame in frames])

    def may_send(self) -> bool:
        """False after a stall, until the watchdog's process has done its work."""
        return self._watchdog is None or not self._watchdog.standing_by or self._watchdog.secure()

    def sent(self) -> None:
        """Renew the standby frames: their sequence numbers follow those of the sent datagrams."""
        standing_by = self._watchdog is not None and self._watchdog.standing_by
        if standing_by and self._transport.next_seq != self._standby_seq:
            self._renew()

    def _stalled(self) -> None:
        """The watchdog has sent what stood by: of our own, nothing of before is sent any more.

        A landing or a stop is that was commanded after the stall, while the watchdog's process still sent.
        """
        assert self._watchdog is not None, "it calls this"
        used, self._standby = len(self._transport.encode_ahead(self._standby)), ()
        self._transport.abandon("the host stalled", used, stops_since=self._watchdog.in_stall)
        self._loop.call_soon(self.on_stall)


async def look(
    host: str,
    *,
    discovery_port: int = handshake.DISCOVERY_PORT,
    local_address: str | None = None,
    interface: str | None = None,
    timeout: float = 2.0,
) -> DeviceInfo:
    """Return the discovery description of the device at `host`.

    A controller that is connected to the device does not notice it. Raises as `connect` does.
    """
    try:
        return await asyncio.wait_for(_look(host, discovery_port, local_address, interface), timeout)
    except asyncio.TimeoutError:
        raise LinkLost(f"no answer from {host} within {timeout:g} s") from None


async def _look(host: str, port: int, local_address: str | None, interface: str | None) -> DeviceInfo:
    reader, writer = await _open(host, port, local_address, interface)
    try:
        return await _read(reader, handshake.parse_discovery, f"{host}:{port}")
    finally:
        writer.close()


async def connect(
    host: str,
    *,
    discovery_port: int = handshake.DISCOVERY_PORT,
    handshake_port: int | None = None,
    versions: tuple[int, int] = (1, 3),
    local_address: str | None = None,
    interface: str | None = None,
    on_message: OnMessage,
    check_device: CheckDevice = accept_any,
    ping_after: float = 0.5,
    silence_limit: float | None = 2.5,
    fades: bool = False,
    timeout: float = 3.0,
) -> ControllerSession:
    """Connect to the drone at `host`.

    With `handshake_port` None the port from discovery is used. `versions` is the (lowest, highest) ARSDK protocol
    version offered. `local_address` and `interface` bind all our sockets; None: whatever routes to the drone.
    `on_message` may be called before this returns; `fades`: see `Transport`.

    Raises `LinkLost` when nothing answers within `timeout` seconds, `HandshakeRefused` when the drone refuses,
    `RemoteProtocolError` when what answers is no drone, and what `check_device` raises.
    """
    handshake.check_versions(versions)
    opening = _connect(
        host,
        discovery_port,
        handshake_port,
        versions,
        local_address,
        interface,
        on_message,
        check_device,
        ping_after,
        silence_limit,
        fades,
    )
    try:
        return await asyncio.wait_for(opening, timeout)
    except asyncio.TimeoutError:
        raise LinkLost(f"no answer from {host} within {timeout:g} s") from None
    except LinkLost:
        raise
    except OSError as error:  # the network went away between two steps
        raise LinkLost(f"cannot connect to {host}: {reason_of(error)}") from error


async def _connect(
    host: str,
    discovery_port: int,
    handshake_port: int | None,
    versions: tuple[int, int],
    local_address: str | None,
    interface: str | None,
    on_message: OnMessage,
    check_device: CheckDevice,
    ping_after: float,
    silence_limit: float | None,
    fades: bool,
) -> ControllerSession:
    reader, writer = await _open(host, discovery_port, local_address, interface)
    try:
        device = await _read(reader, handshake.parse_discovery, f"{host}:{discovery_port}")
        check_device(device)
        names = writer.get_extra_info("sockname"), writer.get_extra_info("peername")
        if None in names:
            raise LinkLost(f"{host}:{discovery_port} closed the connection")
        here, there = (name[0] for name in names)
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            bind_to_interface(sock, interface)
            sock.bind((here, 0))
            request = ConnectRequest(
                CONTROLLER_NAME,
                CONTROLLER_TYPE,
                d2c_port=sock.getsockname()[1],
                device_id=device.serial,
                proto_v_min=versions[0],
                proto_v_max=versions[1],
            )
            reply = await _shake_hands(there, handshake_port or device.port, here, interface, request)
            # Connected, the socket hears that drone only, and hears at once when the port there is closed.
            sock.connect((there, reply.c2d_port))
        except BaseException:
            sock.close()
            raise
    except BaseException:
        writer.close()
        raise
    transport = Transport(
        Role.CONTROLLER,
        reply.proto_v,
        asyncio.get_running_loop().time(),
        ping_after=ping_after,
        silence_limit=silence_limit,
        fades=fades,
        gives_up=False,  # who waits for a command takes it back in time; an order to stop has to arrive
    )
    session = ControllerSession(transport, on_message, device, (reader, writer))
    try:
        await session.open(sock)
    except BaseException:
        session.end("closed")
        sock.close()
        raise
    return session


async def _shake_hands(
    host: str, port: int, local_address: str, interface: str | None, request: ConnectRequest
) -> ConnectReply:
    reader, writer = await _open(host, port, local_address, interface)
    try:
        writer.write(handshake.format_request(request))
        reply = await _read(reader, handshake.parse_reply, f"{host}:{port}")
    finally:
        writer.close()
    if reply.status != 0:
        raise HandshakeRefused(f"{host}:{port}", reply.status)
    if not request.proto_v_min <= reply.proto_v <= request.proto_v_max:
        raise RemoteProtocolError(
            f"{host}:{port} chose protocol version {reply.proto_v}, "
            f"offered were {request.proto_v_min} to {request.proto_v_max}"
        )
    return reply


async def _open(
    host: str, port: int, local_address: str | None, interface: str | None
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    try:
        return await open_connection(host, port, local_address=local_address, interface=interface)
    except OSError as error:
        raise LinkLost(f"cannot connect to {host}:{port}: {reason_of(error)}") from error


async def _read(reader: asyncio.StreamReader, parse: Callable[[bytes], ParsedT | None], where: str) -> ParsedT:
    data = b""
    while True:
        try:
            piece = await reader.read(handshake.MAX_JSON)
        except OSError as error:
            raise LinkLost(f"{where}: {reason_of(error)}") from error
        if not piece:
            raise LinkLost(f"{where} closed the connection without a complete answer")
        data += piece
        parsed = parse(data)
        if parsed is not None:
            return parsed
