"""The device's end: announce a drone, answer handshakes, run one session at a time."""

from __future__ import annotations

import asyncio
import dataclasses
import logging
import socket
from collections.abc import Awaitable, Callable
from typing import TypeAlias

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.handshake import ConnectReply, ConnectRequest, DeviceInfo
from anafi_mav.arsdk.link.session import OnMessage, Session, reason_of
from anafi_mav.arsdk.link.transport import Role, Transport
from anafi_mav.errors import RemoteProtocolError

log = logging.getLogger("anafi_mav.arsdk")

MAX_CONNECTIONS = 64
"""TCP connections served at a time, discovery and handshake each; a drone has one or two controllers around."""

REQUEST_TIMEOUT = 3.0
"""s that a connection to the handshake port may take to say what it wants."""


class DeviceSession(Session):
    """A connection from a controller, whose address is `peer` and whose words are `request`."""

    def __init__(self, transport: Transport, request: ConnectRequest, peer: str) -> None:
        super().__init__(transport, _ignore, (peer, request.d2c_port))
        self.request = request
        self.peer = peer


OnSession: TypeAlias = Callable[[DeviceSession], OnMessage]
"""Called with each new session before its first message; returns who receives them."""


_Handler: TypeAlias = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


def _ignore(message: Message | UnknownMessage, now: float) -> None:
    pass


class Mutable:
    """A server whose air can be gone."""

    session: DeviceSession | None
    """The present or last session."""

    def __init__(self) -> None:
        self.session = None
        self.refuses: Callable[[], bool] = lambda: False
        """Asked at each handshake; True: it is refused."""
        self._mute = False

    @property
    def mute(self) -> bool:
        """True when the device is mute, as after a total loss of radio.

        The session is mute, and a client that connects gets no answer.
        """
        return self._mute

    @mute.setter
    def mute(self, mute: bool) -> None:
        self._mute = mute
        if self.session is not None:
            self.session.mute = mute


class DeviceServer(Mutable):
    """A drone on the network. The newest handshake wins: it ends the session before it."""

    def __init__(
        self,
        address: str,
        c2d_port: int,
        info: DeviceInfo,
        versions: tuple[int, int],
        on_session: OnSession,
        ping_after: float,
    ) -> None:
        super().__init__()
        self.info = info
        """Description sent in discovery; `port` is the real handshake port."""
        self.discovery_port = 0
        self._address = address
        self._c2d_port = c2d_port
        self._versions = versions
        self._on_session = on_session
        self._ping_after = ping_after
        self._servers: list[asyncio.AbstractServer] = []
        self._connections: dict[asyncio.StreamWriter, asyncio.Task[None]] = {}
        self._turn = asyncio.Lock()
        self._closed = False

    @classmethod
    async def start(
        cls,
        address: str,
        *,
        discovery_port: int = handshake.DISCOVERY_PORT,
        handshake_port: int = handshake.HANDSHAKE_PORT,
        c2d_port: int = handshake.C2D_PORT,
        info: DeviceInfo,
        versions: tuple[int, int] = (1, 3),
        on_session: OnSession,
        ping_after: float = 2.0,
    ) -> DeviceServer:
        """Listen on `address`; a port 0 lets the system choose.

        `info.port` is replaced by the handshake port.

        Raises `OSError` when a TCP port is taken, `LocalProtocolError` for versions we do not speak.
        """
        handshake.check_versions(versions)
        self = cls(address, c2d_port, info, versions, on_session, ping_after)
        try:
            shaking = await asyncio.start_server(self._serving(self._shake_hands), address, handshake_port)
            self._servers.append(shaking)
            self.info = dataclasses.replace(info, port=shaking.sockets[0].getsockname()[1])
            telling = await asyncio.start_server(self._serving(self._tell), address, discovery_port)
            self._servers.append(telling)
            self.discovery_port = telling.sockets[0].getsockname()[1]
        except BaseException:
            await self.close()
            raise
        return self

    @property
    def handshake_port(self) -> int:
        """TCP port of the handshake."""
        return self.info.port

    async def close(self) -> None:
        """Stop listening and end the session. Idempotent."""
        self._closed = True
        for server in self._servers:
            server.close()
        # Their handlers then read an end of file and return; cancelled ones would be reported as failed (Python 3.11).
        handlers = list(self._connections.values())
        for writer in list(self._connections):
            writer.close()
        if handlers:
            await asyncio.wait(handlers)
        for server in self._servers:
            await server.wait_closed()
        self._servers.clear()
        if self.session is not None:
            await self.session.close()

    # -- one task per TCP connection

    def _serving(self, handler: _Handler) -> _Handler:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.current_task()
            assert task is not None
            self._connections[writer] = task
            try:
                if len(self._connections) > MAX_CONNECTIONS:
                    return
                await (_hang if self._mute else handler)(reader, writer)
            except OSError as error:
                log.debug("controller gone: %s", error)
            finally:
                del self._connections[writer]
                writer.close()

        return serve

    async def _tell(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(handshake.format_discovery(self.info))
        await _hang(reader, writer)

    async def _shake_hands(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            request = await asyncio.wait_for(_read_request(reader), REQUEST_TIMEOUT)
        except asyncio.TimeoutError:
            return
        except RemoteProtocolError as error:
            reply = _refusal(str(error))
        else:
            if request is None:
                return
            async with self._turn:
                reply = await self._accept(request, writer.get_extra_info("peername")[0])
        writer.write(handshake.format_reply(reply))
        await writer.drain()

    async def _accept(self, request: ConnectRequest, peer: str) -> ConnectReply:
        version = handshake.pick_version(request, self._versions)
        if self._closed:
            return ConnectReply(handshake.REJECTED, 0)  # no warning: it is we who end
        if version is None:
            return _refusal(f"{peer} speaks protocol versions {request.proto_v_min} to {request.proto_v_max}")
        if request.device_id not in ("", self.info.serial):
            return _refusal(f"{peer} asks for {request.device_id!r}, this is {self.info.serial!r}")
        if self.refuses():
            return _refusal(f"{peer}: the session of another controller is alive")
        if self.session is not None:
            self.session.end("another controller connected")
            await self.session.close()
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            sock.bind((self._address, self._c2d_port))
            transport = Transport(Role.DEVICE, version, asyncio.get_running_loop().time(), ping_after=self._ping_after)
            session = DeviceSession(transport, request, peer)
            session.on_message = self._on_session(session)
            await session.open(sock)
        except OSError as error:
            sock.close()
            return _refusal(f"UDP port {self._c2d_port}: {reason_of(error)}")
        except BaseException:
            sock.close()
            raise
        self.session = session
        return ConnectReply(0, sock.getsockname()[1], 0, version)


async def _hang(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Keep a connection as long as the other side does, whatever it says."""
    while await reader.read(handshake.MAX_JSON):
        pass


def _refusal(reason: str) -> ConnectReply:
    log.warning("connection refused: %s", reason)
    return ConnectReply(handshake.REJECTED, 0)


async def _read_request(reader: asyncio.StreamReader) -> ConnectRequest | None:
    """The request; None when the controller left before it was complete."""
    data = b""
    while piece := await reader.read(handshake.MAX_JSON):
        data += piece
        request = handshake.parse_request(data)
        if request is not None:
            return request
    return None
