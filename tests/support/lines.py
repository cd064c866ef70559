"""MAVLink clients for the endpoints that are no TCP server: a serial line and UDP."""

from __future__ import annotations

import asyncio
import os
import tty
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from support.clock import everybodys
from support.mav import Client


class SerialClient(Client):
    """A ground station at the other end of a pseudo-terminal."""

    def __init__(self, master: int, sysid: int = 255) -> None:
        super().__init__(sysid)
        self._master = master
        os.set_blocking(master, False)
        asyncio.get_running_loop().add_reader(master, lambda: self.feed(os.read(master, 4096)))

    def send_raw(self, data: bytes) -> None:
        assert os.write(self._master, data) == len(data)

    async def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._master)


class UdpClient(Client, asyncio.DatagramProtocol):
    """A ground station with a UDP socket: `host` and `port` are its own."""

    peer: tuple[str, int] | None = None

    async def open(self, host: str, peer: tuple[str, int] | None = None) -> UdpClient:
        loop = asyncio.get_running_loop()
        self.peer = peer
        self.transport, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=(host, 0))
        self.port: int = self.transport.get_extra_info("sockname")[1]
        return self

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.peer = self.peer or addr
        self.feed(data)

    def send_raw(self, data: bytes) -> None:
        self.transport.sendto(data, self.peer)

    async def close(self) -> None:
        self.transport.abort()


@asynccontextmanager
async def pseudo_terminal() -> AsyncIterator[tuple[int, str]]:
    """One end of a line, as a file, and the name of the other."""
    master, slave = os.openpty()
    tty.setraw(slave)  # before the gateway opens it: what is echoed until then would come back as garbage
    try:
        with everybodys():  # the kernel hands over what is written in its own time
            yield master, os.ttyname(slave)
    finally:
        os.close(slave)
        os.close(master)
