"""ARSDK over the mux, both ends: discovery, connection and session on one TCP connection.

See `mux`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Callable
from typing import Any, cast

from anafi_mav.arsdk.link import controller, handshake
from anafi_mav.arsdk.link.controller import (
    CONTROLLER_NAME,
    CONTROLLER_TYPE,
    CheckDevice,
    ControllerSession,
    accept_any,
)
from anafi_mav.arsdk.link.device import MAX_CONNECTIONS, DeviceSession, Mutable, OnSession
from anafi_mav.arsdk.link.handshake import ConnectRequest, DeviceInfo
from anafi_mav.arsdk.link.interface import open_connection
from anafi_mav.arsdk.link.session import OnMessage, reason_of
from anafi_mav.arsdk.link.transport import Role, Transport
from anafi_mav.arsdk.link.watchdog import Watchdog
from anafi_mav.arsdk.mux import mux, mux_proxy
from anafi_mav.arsdk.mux.mux_udp import UdpTunnel
from anafi_mav.errors import HandshakeRefused, LinkLost, RemoteProtocolError

log = logging.getLogger("anafi_mav.arsdk")

READ_SIZE = 1 << 16
PEER = ("mux", 0)
"""Name of the other end, in place of the address of a UDP session."""

MAX_WAITING = 1 << 18
"""Bytes that may wait for a slow TCP connection; beyond it frames are dropped as the air drops datagrams, and the
transport repeats those that count."""


class MuxStream:
    """A TCP connection with frames on it. Handshakes are answered here."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer
        self._decoder = mux.Decoder()
        self.proxy: mux_proxy.Master | mux_proxy.Slave | None = None
        """Receiver of the frames of TCP connections."""
        self.guard: Watchdog | None = None
        """Asked before each frame: the watchdog's process may be writing one."""
        self.write_raw(mux.encode_control(mux.HANDSHAKE, 0, 0, mux.VERSION))

    def write_raw(self, frame: bytes) -> None:
        if self.writer.is_closing() or self.writer.transport.get_write_buffer_size() >= MAX_WAITING:
            return
        if self.guard is None:
            self.writer.write(frame)
        elif self.guard.acquire():
            self.writer.write(frame)
            self.guard.release()

    def whole(self) -> bool:
        """True while no part of a frame waits to be written."""
        return self.writer.transport.get_write_buffer_size() == 0

    async def drained(self) -> None:
        """Wait until there is room for more."""
        if not self.writer.is_closing():
            await self.writer.drain()

    def write(self, channel: int, payload: bytes) -> None:
        """One frame."""
        self.write_raw(mux.encode_frame(channel, payload))

    async def read(self) -> list[mux.MuxFrame] | None:
        """Frames of channels that are not the mux's own; None at the end of the connection.

        Raises `OSError`.
        """
        data = await self.reader.read(READ_SIZE)
        if not data:
            return None
        frames = []
        for frame in self._decoder.feed(data):
            if frame.channel >= mux_proxy.FIRST_CHANNEL:
                if self.proxy is not None:
                    self.proxy.data(frame.channel, frame.payload)
                continue
            if frame.channel != mux.CONTROL:
                frames.append(frame)
                continue
            control = mux.decode_control(frame.payload)
            if control is None:
                continue
            if control.id == mux.HANDSHAKE and not control.args[0]:
                self.write_raw(mux.encode_control(mux.HANDSHAKE, 0, 1, mux.VERSION))
            elif self.proxy is not None:
                self.proxy.control(control, frame.payload[mux.CONTROL_SIZE :])
        return frames


class _Endpoint:
    """The transport channel, where a session has a UDP socket."""

    def __init__(self, stream: MuxStream, closed: Callable[[Exception | None], None]) -> None:
        self._stream = stream
        self._closed = closed
        self._aborted = False

    def sendto(self, data: bytes, address: object) -> None:
        self._stream.write(mux.TRANSPORT, data)

    def abort(self) -> None:
        if not self._aborted:
            self._aborted = True
            asyncio.get_running_loop().call_soon(self._closed, None)

    def get_extra_info(self, name: str) -> Any:
        return self._stream.writer.get_extra_info(name)


class MuxControllerSession(ControllerSession):
    """A connection to a Skycontroller over the mux."""

    def __init__(
        self,
        transport: Transport,
        on_message: OnMessage,
        device: DeviceInfo,
        stream: MuxStream,
        early: list[mux.MuxFrame],
    ) -> None:
        self._stream = stream
        self._early = early
        self._proxy = stream.proxy = mux_proxy.Master(stream)
        super().__init__(transport, on_message, device, (stream.reader, stream.writer))

    def begin(self) -> None:
        """Send and receive from now on."""
        self.connection_made(cast(asyncio.BaseTransport, _Endpoint(self._stream, self.connection_lost)))
        self._flush()

    def watch(self) -> None:
        """See `ControllerSession.watch`."""
        super().watch()
        self._stream.guard = self._watchdog

    def _whole(self) -> Callable[[], bool] | None:
        return self._stream.whole

    def _wrapped(self, frame: bytes) -> bytes:
        return mux.encode_frame(mux.TRANSPORT, frame)

    async def open_tcp(self, host: str, port: int) -> tuple[str, int]:
        """An address on this machine that leads to a port of "drone" or "skycontroller".

        Raises `LinkLost`.
        """
        return await self._proxy.open(host, port)

    async def open_udp(self, host: str, on_datagram: Callable[[bytes], None]) -> UdpTunnel:
        """A UDP socket at the Skycontroller's side, to talk to "skycontroller" or "drone".

        Raises `LinkLost`.
        """
        return await self._proxy.open_udp(host, on_datagram)

    def end(self, reason: str) -> None:
        """See `Session.end`."""
        super().end(reason)
        self._proxy.shut()

    async def close(self) -> None:
        """See `Session.close`."""
        await super().close()
        await self._proxy.close()

    async def _watch_discovery(self, reader: asyncio.StreamReader) -> None:
        frames: list[mux.MuxFrame] | None = self._early
        with contextlib.suppress(OSError):
            while frames is not None:
                for frame in frames:
                    if frame.channel == mux.TRANSPORT:
                        self.datagram_received(frame.payload, PEER)
                frames = await self._stream.read()
        self.closed_by_peer = not self.lost.done()
        self.end("the Skycontroller closed the connection")


async def connect(
    host: str,
    *,
    port: int = mux.PORT,
    versions: tuple[int, int] = (1, 3),
    local_address: str | None = None,
    interface: str | None = None,
    on_message: OnMessage,
    check_device: CheckDevice = accept_any,
    ping_after: float = 0.5,
    silence_limit: float | None = 2.5,
    fades: bool = False,
) -> MuxControllerSession:
    """Connect to the device behind the mux at `host`; the caller limits the time.

    Otherwise as `controller.connect`.
    """
    try:
        reader, writer = await open_connection(host, port, local_address=local_address, interface=interface)
    except OSError as error:
        raise LinkLost(f"cannot connect to {host}:{port}: {reason_of(error)}") from error
    try:
        stream = MuxStream(reader, writer)
        device = await _introduced(stream, port)
        check_device(device)
        request = json.dumps({"proto_v_min": versions[0], "proto_v_max": versions[1]})
        texts = (CONTROLLER_NAME, CONTROLLER_TYPE, device.serial, request)
        stream.write(mux.BACKEND, mux.encode_pomp(mux.CONN_REQ, [("%s", text) for text in texts]))
        (status, text), early = await _answer(stream, mux.BACKEND, mux.CONN_RESP, (int, str))
        if status != 0:
            raise HandshakeRefused(f"{host}:{port}", status)
        version = _version(text)
        if not versions[0] <= version <= versions[1]:
            raise RemoteProtocolError(f"{host}:{port} chose protocol version {version}, offered were {versions}")
        transport = Transport(
            Role.CONTROLLER,
            version,
            asyncio.get_running_loop().time(),
            ping_after=ping_after,
            silence_limit=silence_limit,
            fades=fades,
            gives_up=False,  # who waits for a command takes it back in time; an order to stop has to arrive
        )
    except BaseException:
        writer.close()
        raise
    session = MuxControllerSession(transport, on_message, device, stream, early)
    session.begin()
    return session


async def look(host: str, *, port: int = mux.PORT, interface: str | None = None) -> DeviceInfo:
    """Return the description of the device behind the mux at `host`.

    The caller limits the time. Raises as `connect` does.
    """
    try:
        reader, writer = await open_connection(host, port, interface=interface)
    except OSError as error:
        raise LinkLost(f"cannot connect to {host}:{port}: {reason_of(error)}") from error
    try:
        return await _introduced(MuxStream(reader, writer), port)
    finally:
        writer.close()


async def look_either(
    host: str, *, mux_port: int = mux.PORT, interface: str | None = None, timeout: float = 2.0
) -> DeviceInfo:
    """Return the description of a device; try discovery, then the mux.

    As `controller.look`; when nothing listens on the discovery port, a Skycontroller 4 is looked for on the mux.
    """
    try:
        return await controller.look(host, interface=interface, timeout=timeout)
    except LinkLost as error:
        if not isinstance(error.__cause__, ConnectionRefusedError):
            raise
    try:
        return await asyncio.wait_for(look(host, port=mux_port, interface=interface), timeout)
    except asyncio.TimeoutError:
        raise LinkLost(f"no answer from {host}:{mux_port} within {timeout:g} s") from None


async def _introduced(stream: MuxStream, port: int) -> DeviceInfo:
    stream.write(mux.DISCOVERY, mux.encode_pomp(mux.DISCOVER))
    (name, model_id, serial), _ = await _answer(stream, mux.DISCOVERY, mux.DEVICE_ADDED, (str, int, str))
    return DeviceInfo(model_id, serial, port, name)


async def connect_either(
    host: str,
    *,
    mux_port: int = mux.PORT,
    local_address: str | None = None,
    interface: str | None = None,
    on_message: OnMessage,
    check_device: CheckDevice = accept_any,
    fades: bool = False,
    timeout: float = 3.0,
    **options: Any,
) -> ControllerSession:
    """Connect to a device by discovery, or else through the mux.

    As `controller.connect`; when nothing listens on the discovery port, a Skycontroller 4 is tried on the mux.
    """
    try:
        return await controller.connect(
            host,
            local_address=local_address,
            interface=interface,
            on_message=on_message,
            check_device=check_device,
            fades=fades,
            timeout=timeout,
            **options,
        )
    except LinkLost as error:
        if not isinstance(error.__cause__, ConnectionRefusedError):
            raise
        refused = error
    attempt = connect(
        host,
        port=mux_port,
        local_address=local_address,
        interface=interface,
        on_message=on_message,
        check_device=check_device,
        fades=fades,
    )
    try:
        return await asyncio.wait_for(attempt, timeout)
    except asyncio.TimeoutError:
        raise LinkLost(f"no answer from {host}:{mux_port} within {timeout:g} s") from None
    except LinkLost as error:
        # Nothing there either: the first word is what most people wait for.
        raise (refused if isinstance(error.__cause__, ConnectionRefusedError) else error) from None


async def _answer(
    stream: MuxStream, channel: int, id: int, types: tuple[type, ...]
) -> tuple[list[Any], list[mux.MuxFrame]]:
    """The arguments of the awaited message, and the frames behind it.

    Raises `LinkLost` at the connection's end.
    """
    while True:
        try:
            frames = await stream.read()
        except OSError as error:
            raise LinkLost(f"mux: {reason_of(error)}") from error
        if frames is None:
            raise LinkLost("the mux closed the connection without an answer")
        for index, frame in enumerate(frames):
            message = mux.decode_pomp(frame.payload) if frame.channel == channel else None
            if message is None or message[0] != id:
                continue
            arguments = message[1]
            if len(arguments) < len(types) or not all(map(isinstance, arguments, types)):
                raise RemoteProtocolError(f"unreadable answer on mux channel {channel}: {arguments!r}")
            return arguments[: len(types)], frames[index + 1 :]


def _version(text: str) -> int:
    """proto_v of a connection's answer; one that names none means version 1."""
    with contextlib.suppress(ValueError, RecursionError):
        members = json.loads(text)
        if isinstance(members, dict) and isinstance(members.get("proto_v", 1), int):
            return int(members.get("proto_v", 1))
    return 1


class MuxDeviceSession(DeviceSession):
    """A connection from a controller over the mux."""

    def __init__(self, transport: Transport, request: ConnectRequest, peer: str, stream: MuxStream) -> None:
        super().__init__(transport, request, peer)
        self._peer = PEER
        self.stream = stream

    def begin(self) -> None:
        """Send and receive from now on."""
        self.connection_made(cast(asyncio.BaseTransport, _Endpoint(self.stream, self.connection_lost)))
        self._flush()


class MuxServer(Mutable):
    """A device on the mux, one session at a time: a new session ends the previous one.

    As `device.DeviceServer`.

    A client that only requests the introduction does not affect the session; this is assumed of the real device.
    """

    def __init__(
        self,
        info: DeviceInfo,
        versions: tuple[int, int],
        on_session: OnSession,
        ping_after: float,
        address: str,
        tcp_port: Callable[[int], int],
    ) -> None:
        super().__init__()
        self.info = info
        self._address = address
        self._tcp_port = tcp_port
        self._versions = versions
        self._on_session = on_session
        self._ping_after = ping_after
        self._server: asyncio.AbstractServer | None = None
        self._streams: dict[MuxStream, asyncio.Task[None]] = {}

    @classmethod
    async def start(
        cls,
        address: str,
        *,
        port: int = mux.PORT,
        info: DeviceInfo,
        versions: tuple[int, int] = (1, 3),
        on_session: OnSession,
        ping_after: float = 2.0,
        tcp_port: Callable[[int], int] = int,
    ) -> MuxServer:
        """Listen on `address`; port 0 lets the system choose.

        `tcp_port` says which port of that address stands for a port of the drone. Raises `OSError` when the port is
        taken.
        """
        handshake.check_versions(versions)
        self = cls(info, versions, on_session, ping_after, address, tcp_port)
        self._server = await asyncio.start_server(self._serve, address, port)
        return self

    @property
    def discovery_port(self) -> int:
        """The one port there is."""
        return 0 if self._server is None else int(cast(asyncio.Server, self._server).sockets[0].getsockname()[1])

    handshake_port = discovery_port

    async def close(self) -> None:
        """Stop listening and end the session. Idempotent."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
        for stream in self._streams:
            stream.writer.close()
        if self._streams:
            await asyncio.wait(tuple(self._streams.values()))
        if server is not None:
            await server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._streams) >= MAX_CONNECTIONS:
            writer.close()
            return
        stream = MuxStream(reader, writer)
        self._streams[stream] = cast("asyncio.Task[None]", asyncio.current_task())
        proxy = stream.proxy = mux_proxy.Slave(stream, self._resolve, self._tcp_port)
        session: MuxDeviceSession | None = None
        try:
            while (frames := await stream.read()) is not None:
                for frame in frames:
                    if self._mute:
                        continue
                    if frame.channel == mux.TRANSPORT and session is not None:
                        session.datagram_received(frame.payload, PEER)
                    elif frame.channel in (mux.DISCOVERY, mux.BACKEND):
                        session = await self._hear(stream, frame, session)
        except OSError as error:
            log.debug("controller gone: %s", error)
        finally:
            writer.close()
            if session is not None:
                session.end("the controller closed the connection")
            await proxy.close()
            del self._streams[stream]

    def _resolve(self, host: str) -> str | None:
        return self._address if host in ("drone", "skycontroller") else None

    async def _hear(
        self, stream: MuxStream, frame: mux.MuxFrame, session: MuxDeviceSession | None
    ) -> MuxDeviceSession | None:
        """A message on one of the channels before the session."""
        message = mux.decode_pomp(frame.payload)
        if message is None:
            return session
        id, arguments = message
        if frame.channel == mux.DISCOVERY:
            if id == mux.DISCOVER:
                info = self.info
                added: list[tuple[str, mux.Argument]] = [
                    ("%s", info.name),
                    ("%u", info.model_id),
                    ("%s", info.serial),
                ]
                stream.write(mux.DISCOVERY, mux.encode_pomp(mux.DEVICE_ADDED, added))
            return session
        if id != mux.CONN_REQ or len(arguments) < 4 or not all(isinstance(one, str) for one in arguments):
            return session
        if self.refuses():
            self._refuse(stream)
            return session
        before = self.session
        if before is not None:
            before.end("another controller connected")
            await before.close()
        if isinstance(before, MuxDeviceSession) and before.stream is not stream:
            before.stream.writer.close()
        return self._accept(stream, cast("list[str]", arguments))

    def _refuse(self, stream: MuxStream) -> None:
        refusal: list[tuple[str, mux.Argument]] = [("%d", handshake.REJECTED), ("%s", "")]
        stream.write(mux.BACKEND, mux.encode_pomp(mux.CONN_RESP, refusal))

    def _accept(self, stream: MuxStream, arguments: list[str]) -> MuxDeviceSession | None:
        name, kind, serial, text = arguments[:4]
        low, high = 1, 1
        with contextlib.suppress(ValueError, RecursionError):
            members = json.loads(text)
            if isinstance(members, dict):
                low, high = (
                    value if isinstance(value := members.get(key, 1), int) else 1
                    for key in ("proto_v_min", "proto_v_max")
                )
        request = ConnectRequest(name, kind, 0, serial, 0, low, high)
        version = handshake.pick_version(request, self._versions)
        if version is None or serial not in ("", self.info.serial):
            self._refuse(stream)
            return None
        transport = Transport(Role.DEVICE, version, asyncio.get_running_loop().time(), ping_after=self._ping_after)
        peer = stream.writer.get_extra_info("peername")[0]
        session = MuxDeviceSession(transport, request, peer, stream)
        session.on_message = self._on_session(session)
        reply: list[tuple[str, mux.Argument]] = [("%d", 0), ("%s", json.dumps({"proto_v": version}))]
        stream.write(mux.BACKEND, mux.encode_pomp(mux.CONN_RESP, reply))
        session.begin()
        self.session = session
        return session
