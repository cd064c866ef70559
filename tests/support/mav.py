"""A MAVLink client with nothing of ours between it and the wire: asyncio sockets and pymavlink's own parser.

It speaks pymavlink's stock dialect, so that a mistake in our generated one shows; ours reads only the messages that
the stock one has never heard of.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
import time
from collections.abc import Callable, Collection
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from support.mavlink_reader import CAMERA, Reader, Received, kind_of

__all__ = ["CAMERA", "EPOCH", "NAN", "Client", "kind_of"]

NAN = math.nan

EPOCH = 1_420_070_400
"""s from 1970 to 2015, where time stamps of signatures begin."""


class Client:
    """A ground station: keeps every frame it received, sends what a test commands it to."""

    def __init__(self, sysid: int = 255, compid: int = 190) -> None:
        self.sysid, self.compid = sysid, compid
        self.received = Received()
        """(monotonic time, message), oldest first; messages carry their raw bytes in get_msgbuf()."""
        self._reader = Reader(sysid, compid)
        self._parser = self._reader.parser
        self._out = dialect.MAVLink(None, sysid, compid)
        self._waiting: dict[asyncio.Future[None], tuple[str, ...]] = {}
        """Who waits for the next message of which kinds."""
        self._writer: asyncio.StreamWriter | None = None
        self._socket: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def bad(self) -> int:
        """Pieces received that were no messages."""
        return self._reader.bad

    async def connect(self, port: int, host: str = "127.0.0.1") -> Client:
        reader, self._writer = await asyncio.open_connection(host, port)
        self._task = asyncio.get_running_loop().create_task(self._read(reader))
        return self

    def connect_udp(self, host: str, port: int) -> Client:
        """It is heard of when it has said something."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.connect((host, port))
        asyncio.get_running_loop().add_reader(self._socket, lambda end: self.feed(end.recv(65536)), self._socket)
        return self

    async def _read(self, reader: asyncio.StreamReader) -> None:
        while data := await reader.read(65536):
            self.feed(data)

    def feed(self, data: bytes) -> None:
        """Bytes from the gateway."""
        before = len(self.received)
        self._reader.read(data, time.monotonic(), self.received)
        if self._waiting:
            self._tell(self.received.kinds[before:])

    def _tell(self, news: Collection[str]) -> None:
        for waiter, kinds in self._waiting.items():
            if not waiter.done() and any(kind in news for kind in kinds):
                waiter.set_result(None)

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
        if self._writer is not None:
            self._writer.close()
        if self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()

    def send_raw(self, data: bytes) -> None:
        if self._socket is not None:
            self._socket.send(data)
            return
        assert self._writer is not None
        self._writer.write(data)

    def send(self, message: Any) -> None:
        """One frame of MAVLink 2."""
        self.send_raw(self.pack(message))

    def pack(self, message: Any) -> bytes:
        """Return the next frame, for a segment with several of them."""
        # One object in pymavlink: what is sent follows the timestamps of what was received.
        self._out.signing.timestamp = max(self._out.signing.timestamp, self._parser.signing.timestamp)
        data: bytes = message.pack(self._out)
        self._out.seq = (self._out.seq + 1) % 256
        return data

    def expect_key(self, secret: bytes) -> None:
        """Verify signed frames with this key and still read unsigned ones, as QGroundControl does while it waits."""
        self._parser.signing.secret_key = secret
        self._parser.signing.allow_unsigned_callback = lambda *_: True

    def sign(self, secret: bytes | None, *, link: int = 9) -> None:
        """Sign what is sent from now on, and read signed frames only, both as pymavlink does; None: neither."""
        for mav in (self._out, self._parser):
            mav.signing.secret_key = secret
            mav.signing.link_id = link
            mav.signing.timestamp = int((time.time() - EPOCH) * 1e5)
            mav.signing.allow_unsigned_callback = None
        self._parser.signing.stream_timestamps.clear()
        self._out.signing.sign_outgoing = secret is not None

    def mark(self) -> int:
        """Now, as a place in what was received."""
        return len(self.received)

    def since(self, mark: int, kind: str) -> list[tuple[float, Any]]:
        """What was received of one kind from a mark on."""
        found = enumerate(self.received.kinds[mark:], mark)
        return [self.received[place] for place, one in found if one == kind]

    async def wait(
        self,
        kind: str | tuple[str, ...],
        accept: Callable[[Any], bool] = lambda message: True,
        *,
        since: int | None = None,
        timeout: float = 5.0,
    ) -> Any:
        """The first message of a kind, or of several, from a mark (default: from now) on that `accept` likes."""
        return self.received[await self.place(kind, accept, since=since, timeout=timeout)][1]

    async def place(
        self,
        kind: str | tuple[str, ...],
        accept: Callable[[Any], bool] = lambda message: True,
        *,
        since: int | None = None,
        timeout: float = 5.0,
    ) -> int:
        """Where the message that `wait` returns stands in what was received."""
        kinds = (kind,) if isinstance(kind, str) else kind
        position = self.mark() if since is None else since
        start = position
        deadline = time.monotonic() + timeout
        while True:
            for place, one in enumerate(self.received.kinds[position:], position):
                if one in kinds and accept(self.received[place][1]):
                    return place
            position = self.mark()
            if not await self._news(kinds, deadline):
                observed = {*kinds, "STATUSTEXT", "COMMAND_ACK"}
                seen = [
                    str(self.received[place][1])
                    for place in range(start, position)
                    if self.received.kinds[place] in observed
                ]
                raise AssertionError(f"no such {kind} within {timeout} s; seen: {seen[-8:]}")

    async def _news(self, kinds: tuple[str, ...], deadline: float) -> bool:
        """Wait until a message of one of these kinds comes; False when none has come by the deadline."""
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[None] = loop.create_future()
        timer = loop.call_at(deadline, _end, waiter)
        self._waiting[waiter] = kinds
        try:
            await waiter
            return True
        except asyncio.TimeoutError:
            return False
        finally:
            timer.cancel()
            del self._waiting[waiter]

    async def silence(self, kind: str, seconds: float, *, timeout: float = 20.0) -> None:
        """Wait until nothing of a kind has come for so long."""
        deadline = time.monotonic() + timeout
        with contextlib.suppress(AssertionError):
            while time.monotonic() < deadline:
                await self.wait(kind, timeout=seconds)
        assert time.monotonic() < deadline, f"{kind} does not end"

    async def command(
        self,
        id: int,
        *params: float,
        frame: int | None = None,
        x: float = NAN,
        y: float = NAN,
        z: float = NAN,
        target: tuple[int, int] = (1, 1),
        timeout: float = 8.0,
    ) -> Any:
        """Send a command (COMMAND_INT when a frame is given) and return its final COMMAND_ACK."""
        mark = self.mark()
        self.send_command(id, *params, frame=frame, x=x, y=y, z=z, target=target)
        return await self.wait(
            "COMMAND_ACK",
            lambda ack: ack.command == id and ack.result != dialect.MAV_RESULT_IN_PROGRESS,
            since=mark,
            timeout=timeout,
        )

    def send_command(
        self,
        id: int,
        *params: float,
        frame: int | None = None,
        x: float = NAN,
        y: float = NAN,
        z: float = NAN,
        target: tuple[int, int] = (1, 1),
        confirmation: int = 0,
    ) -> None:
        p = [*params, *([NAN] * (4 - len(params)))]
        if frame is None:
            self.send(dialect.MAVLink_command_long_message(*target, id, confirmation, *p, x, y, z))
        else:
            places = [2**31 - 1 if math.isnan(v) else round(v * 1e7) for v in (x, y)]
            self.send(dialect.MAVLink_command_int_message(*target, frame, id, 0, 0, *p, *places, z))

    async def heartbeat(self, accept: Callable[[Any], bool], *, since: int | None = None, timeout: float = 5.0) -> Any:
        """The vehicle's next heartbeat that `accept` likes."""
        return await self.wait("HEARTBEAT", accept, since=since, timeout=timeout)


def _end(waiter: asyncio.Future[None]) -> None:
    if not waiter.done():
        waiter.set_exception(asyncio.TimeoutError())
