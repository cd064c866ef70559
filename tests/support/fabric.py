"""A zenoh network on loopback: routers as processes of their own, a link that stalls, and stations."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.clock import SystemClock
from anafi_mav.fabric.ground import FabricGround
from anafi_mav.mavlink.endpoint import parse_endpoint
from support.clock import only_reacts
from support.mav import Client

ROUTER = """
import json, sys, zenoh
config = zenoh.Config.from_file(sys.argv[2]) if sys.argv[2:] else zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
with zenoh.open(config):
    print("ready", flush=True)
    sys.stdin.read()
"""
"""The Python package as a router, until its stdin ends."""


def free_port() -> int:
    """Return a TCP port of the loopback address that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class RouterProcess:
    """A router that can be killed and started again at the same port."""

    def __init__(self, port: int, settings: Mapping[str, Any], link: str, file: Path | None) -> None:
        self.port = port
        self._file = [] if file is None else [str(file)]
        self.url = f"zenoh://127.0.0.1:{port}"
        self._settings = {
            "mode": "router",
            "listen/endpoints": [f"{link}/127.0.0.1:{port}"],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            **settings,
        }
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start it, and wait until it listens."""
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", ROUTER, json.dumps(self._settings), *self._file,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        only_reacts(self._process)
        assert self._process.stdout is not None
        assert await asyncio.wait_for(self._process.stdout.readline(), 60.0) == b"ready\n"

    async def kill(self) -> None:
        """End it at once."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


@asynccontextmanager
async def router(
    settings: Mapping[str, Any] | None = None, link: str = "tcp", file: Path | None = None
) -> AsyncIterator[RouterProcess]:
    """A router for the length of a block. `settings` come after those of a configuration `file`."""
    held = RouterProcess(free_port(), settings or {}, link, file)
    await held.start()
    try:
        yield held
    finally:
        await held.kill()


class StallingRelay:
    """TCP to TCP. While it is stalled, bytes of both directions wait, as in a network that has lost its way."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._moving = asyncio.Event()
        self._moving.set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def start(self) -> int:
        """Listen; return the port."""
        self._server = await asyncio.start_server(self._connected, "127.0.0.1", 0)
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    def stall(self) -> None:
        """Let nothing pass from now on."""
        self._moving.clear()

    def resume(self) -> None:
        """Let everything pass that waits, and go on."""
        self._moving.set()

    async def close(self) -> None:
        """End all connections."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._server is not None:
            self._server.close()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        onward_reader, onward_writer = await asyncio.open_connection("127.0.0.1", self._to)
        for source, sink in ((reader, onward_writer), (onward_reader, writer)):
            self._tasks.add(asyncio.get_running_loop().create_task(self._copy(source, sink)))

    async def _copy(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        try:
            with suppress(OSError):
                while data := await source.read(65536):
                    await self._moving.wait()
                    sink.write(data)
                    await sink.drain()
        finally:
            sink.close()


@asynccontextmanager
async def ground(url: str, scheme: str = "udpin") -> AsyncIterator[int]:
    """A ground process's fabric in this one, for the length of a block: the port for stations."""
    fabric = FabricGround(parse_endpoint(url), [parse_endpoint(f"{scheme}://127.0.0.1:0")], SystemClock())
    await fabric.start()
    try:
        (port,) = (endpoint.local_port for endpoint in fabric.endpoints)
        assert port is not None
        yield port
    finally:
        await fabric.close()


class FabricStation(Client):
    """A ground station at the port of a ground process: it sends a heartbeat a second."""

    async def join(self, port: int, *, tcp: bool = False, timeout: float = 20.0) -> FabricStation:
        """Connect, and wait until it has received a vehicle's heartbeat.

        `tcp`: for a burst that a UDP socket would lose, because gateway, ground and client share one event loop.
        """
        if tcp:
            await self.connect(port)
        else:
            self.connect_udp("127.0.0.1", port)
        self._beating = asyncio.get_running_loop().create_task(self._beat())
        await self.heartbeat(lambda beat: True, timeout=timeout)
        return self

    async def close(self) -> None:
        """Fall silent."""
        self._beating.cancel()
        await super().close()

    async def _beat(self) -> None:
        while True:
            self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            await asyncio.sleep(1.0)
