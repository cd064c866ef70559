"""Relays that make a loopback link poor: datagrams lost and late, a TCP connection late and stalled."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Coroutine
from contextlib import suppress

MAX_WAITING = 4096
"""Datagrams or pieces that a relay holds at once; a link has no more room."""


class LossyRelay:
    """UDP to UDP: each datagram of both directions is lost by chance, or arrives `delay` s later."""

    def __init__(self, target: tuple[str, int], *, loss: float = 0.05, delay: float = 0.05, seed: int = 1) -> None:
        self.passed = self.lost = 0
        self.lose_next = b""
        """The next datagram with these bytes is lost; none: by chance only."""
        self.is_cut = False
        """True: all datagrams from and to the first client are lost."""
        self.has_cut = {"up": asyncio.Event(), "down": asyncio.Event()}
        """Set once the cut has lost a datagram to the router, and from it."""
        self._to = target
        self.loss, self._delay = loss, delay
        self._chance = random.Random(seed)
        self._listener: asyncio.DatagramTransport | None = None
        self._onward: dict[tuple[str, int], asyncio.DatagramTransport] = {}
        """To the router, for each sender."""
        self._opening: dict[tuple[str, int], list[bytes]] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self) -> int:
        """Listen; return the port."""
        loop = asyncio.get_running_loop()
        self._listener, _ = await loop.create_datagram_endpoint(
            lambda: _Receiver(self._from_client), local_addr=("127.0.0.1", 0)
        )
        port: int = self._listener.get_extra_info("sockname")[1]
        return port

    async def close(self) -> None:
        """Close all sockets."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for transport in (self._listener, *self._onward.values()):
            if transport is not None:
                transport.close()

    def _is_lost(self, way: str, client: tuple[str, int]) -> bool:
        is_lost = self.is_cut and client == next(iter(self._onward), None)
        if is_lost:
            self.has_cut[way].set()
        return is_lost

    def _from_client(self, data: bytes, client: tuple[str, int]) -> None:
        if self._is_lost("up", client):
            return
        if client in self._onward:
            self._later(self._onward[client], data, None)
        elif client in self._opening:
            self._opening[client].append(data)
        else:
            self._opening[client] = [data]
            self._tasks.add(asyncio.get_running_loop().create_task(self._open(client)))

    async def _open(self, client: tuple[str, int]) -> None:
        def back(data: bytes, _: tuple[str, int]) -> None:
            assert self._listener is not None
            if not self._is_lost("down", client):
                self._later(self._listener, data, client)

        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Receiver(back), remote_addr=self._to
        )
        self._onward[client] = transport
        for data in self._opening.pop(client):
            self._later(transport, data, None)

    def _later(self, transport: asyncio.DatagramTransport, data: bytes, to: tuple[str, int] | None) -> None:
        is_chosen = bool(self.lose_next) and self.lose_next in data
        if is_chosen or self._chance.random() < self.loss:
            self.lost += 1
            self.lose_next = b"" if is_chosen else self.lose_next
            return
        self.passed += 1

        def send() -> None:
            if not transport.is_closing():
                transport.sendto(data, to)

        asyncio.get_running_loop().call_later(self._delay, send)


class _Receiver(asyncio.DatagramProtocol):
    """Hands datagrams on."""

    def __init__(self, receive: Callable[[bytes, tuple[str, int]], None]) -> None:
        self._receive = receive

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._receive(data, addr)


class StallingRelay:
    """TCP to TCP: bytes of both directions arrive `delay` s later, and not at all while it is stalled.

    It stalls on `stall`, and by itself for `stall_time` s every `stall_every` s. `reset` ends its connections.
    """

    def __init__(
        self, port: int, *, delay: float = 0.0, stall_time: float = 0.0, stall_every: float | None = None
    ) -> None:
        self.stalls = 0
        self.unanswered = 0
        """So many of the next connections are accepted and get no answer."""
        self._ends: set[asyncio.StreamWriter] = set()
        self._to = port
        self._delay = delay
        self._stall_time, self._stall_every = stall_time, stall_every
        self._moving = asyncio.Event()
        self._moving.set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def start(self, at: int = 0) -> int:
        """Listen, at any free port or at this one; return the port."""
        self._server = await asyncio.start_server(self._connected, "127.0.0.1", at)
        if self._stall_every is not None:
            self._run(self._stall_again(self._stall_every))
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    def stall(self) -> None:
        """Let nothing pass from now on."""
        self.stalls += 1
        self._moving.clear()

    def reset(self) -> None:
        """End all connections, each with a reset."""
        for end in self._ends:
            end.transport.abort()
        self._ends.clear()

    def resume(self) -> None:
        """Let everything pass that waits, and go on."""
        self._moving.set()

    async def close(self) -> None:
        """End all connections."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.reset()
        if self._server is not None:
            self._server.close()

    def _run(self, work: Coroutine[None, None, None]) -> None:
        self._tasks.add(asyncio.get_running_loop().create_task(work))

    async def _stall_again(self, every: float) -> None:
        while True:
            await asyncio.sleep(every - self._stall_time)
            self.stall()
            await asyncio.sleep(self._stall_time)
            self.resume()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._ends.add(writer)
        if self.unanswered:
            self.unanswered -= 1
            return
        onward_reader, onward_writer = await asyncio.open_connection("127.0.0.1", self._to)
        self._ends.add(onward_writer)
        for source, sink in ((reader, onward_writer), (onward_reader, writer)):
            waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(MAX_WAITING)
            self._run(self._read(source, waiting))
            self._run(self._write(waiting, sink))

    async def _read(self, source: asyncio.StreamReader, waiting: asyncio.Queue[tuple[float, bytes]]) -> None:
        data = b"-"
        while data:
            try:
                data = await source.read(65536)
            except OSError:
                data = b""
            await waiting.put((asyncio.get_running_loop().time() + self._delay, data))

    async def _write(self, waiting: asyncio.Queue[tuple[float, bytes]], sink: asyncio.StreamWriter) -> None:
        try:
            with suppress(OSError):
                while True:
                    due, data = await waiting.get()
                    if not data:
                        return
                    await asyncio.sleep(max(0.0, due - asyncio.get_running_loop().time()))
                    await self._moving.wait()
                    sink.write(data)
                    await sink.drain()
        finally:
            sink.close()
