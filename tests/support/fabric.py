"""A zenoh network on loopback: routers as processes of their own, and stations."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect
from typing_extensions import Self

from anafi_mav.clock import SystemClock
from anafi_mav.fabric.ground import FabricGround
from anafi_mav.mavlink.endpoint import parse_endpoint
from support.clock import only_reacts
from support.mav import Client
from support.world import loopback

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

OTHER_PORT = 7447
"""zenoh's own: outside of the ports that the system gives to sockets of other tests."""


def free_port() -> int:
    """Return a TCP port of the loopback address that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class RouterProcess:
    """A router that can be killed and started again at the same port."""

    def __init__(self, port: int, settings: Mapping[str, Any], link: str, file: Path | None, also: str) -> None:
        self.port = port
        self.other = (loopback(), OTHER_PORT)
        """Address of a second listener."""
        self._file = [] if file is None else [str(file)]
        self.url = f"zenoh://127.0.0.1:{port}"
        self._settings = {
            "mode": "router",
            "listen/endpoints": [
                f"{link}/127.0.0.1:{port}",
                *([f"{also}/{self.other[0]}:{self.other[1]}"] if also else []),
            ],
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
    settings: Mapping[str, Any] | None = None, link: str = "tcp", file: Path | None = None, *, also: str = ""
) -> AsyncIterator[RouterProcess]:
    """A router for the length of a block. `settings` come after those of a configuration `file`.

    `also`: another kind of zenoh's links that it listens for, at `other`.
    """
    held = RouterProcess(free_port(), settings or {}, link, file, also)
    await held.start()
    try:
        yield held
    finally:
        await held.kill()


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

    async def join(self, port: int, *, tcp: bool = False, host: str = "", timeout: float = 20.0) -> Self:
        """Connect, and wait until it has received a vehicle's heartbeat.

        `tcp`: for a burst that a UDP socket would lose, because gateway, ground and client share one event loop.
        `host`: a gateway's own address, by TCP.
        """
        if tcp or host:
            await self.connect(port, host or "127.0.0.1")
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


class StationOfSystem(FabricStation):
    """A station of one system among several: what the helpers send to system 1 goes to that one."""

    def __init__(self, system: int) -> None:
        super().__init__()
        self.system = system
        self._sent = dialect.MAVLink(None)
        self._again = dialect.MAVLink(None, self.sysid, self.compid)

    def send_raw(self, data: bytes) -> None:
        for message in self._sent.parse_buffer(data):
            if hasattr(message, "target_system"):
                message.target_system = self.system
            super().send_raw(message.pack(self._again))
            self._again.seq = (self._again.seq + 1) % 256

    def feed(self, data: bytes) -> None:
        before = len(self.received)
        super().feed(data)
        self.received[before:] = [one for one in self.received[before:] if one[1].get_srcSystem() == self.system]
