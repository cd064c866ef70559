"""Signed endpoints of a node over real sockets."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.lines import UdpClient
from support.mav import Client
from support.signed import SECRET
from support.world import loopback

from anafi_mav.clock import SystemClock
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import frame, pack
from anafi_mav.mavlink.key_ring import KeyRing, path_of, write_key
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.mavlink.router import EVERY_COMPONENT
from anafi_mav.mavlink.signing import TICKS, ticks

BEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
STOCK_BEAT = stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


GATEWAY = """
import asyncio, sys
from pathlib import Path
from anafi_mav.clock import SystemClock
from anafi_mav.mavlink.key_ring import KeyRing
from anafi_mav.mavlink.node import Node

async def main():
    node = Node(keys=KeyRing(Path(sys.argv[1]), SystemClock()))
    node.add_host(1, 0, lambda inbound: print(inbound.message.get_type(), flush=True))
    await node.start([f"tcpin://{sys.argv[2]}:5760?signing=field"])
    print("ready", flush=True)
    await asyncio.sleep(60.0)

asyncio.run(main())
"""
"""A node that prints what reaches its system, until it is killed."""


class Station:
    """A node with a key ring, and what reaches its system."""

    def __init__(self, folder: Path | None, sysid: int, *, saves: bool = True) -> None:
        self.sysid = sysid
        self.inbound: list[Inbound] = []
        keys = None if folder is None else KeyRing(folder, SystemClock(), saves=saves)
        self.node = Node(keys=keys)
        self.node.add_host(sysid, EVERY_COMPONENT, self.inbound.append)

    @asynccontextmanager
    async def started(self, *urls: str) -> AsyncIterator[Station]:
        await self.node.start(urls)
        try:
            yield self
        finally:
            await self.node.close()

    def send(self) -> None:
        self.node.send(BEAT, sysid=self.sysid, compid=1)


async def until(ready: Callable[[], object]) -> None:
    for _ in range(2000):
        if ready():
            return
        await asyncio.sleep(0.005)  # what a node has received has no event of its own
    raise AssertionError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_key(tmp_path / "keys", "field", SECRET + bytes(8))
    return tmp_path / "keys"


async def test_program_beside_the_gateway_signs_and_writes_no_file(folder: Path) -> None:
    address = loopback()
    async with Station(folder, 1).started(f"tcpin://{address}:5760?signing=field") as gateway:
        saved = path_of(folder, "field").read_bytes()

        async def talk() -> None:
            gateway.inbound.clear()
            async with Station(folder, 252, saves=False).started(f"tcpout://{address}:5760?signing=field") as program:
                await until(lambda: program.node.channels)
                program.send()
                await until(lambda: gateway.inbound)
                gateway.send()
                await until(lambda: program.inbound)

        await talk()
        await talk()  # the second start is not a replay of the first
        assert path_of(folder, "field").read_bytes() == saved
        assert gateway.node.endpoints[0].signing_note == ", signed with key field"


async def test_verified_frame_reaches_an_unsigned_endpoint_without_signature(folder: Path) -> None:
    address = loopback()
    urls = (f"tcpin://{address}:5760?signing=field", f"tcpin://{address}:5761")
    async with Station(folder, 1).started(*urls) as gateway:
        signed, plain = await Client(200).connect(5760, address), await Client(201).connect(5761, address)
        signed.sign(SECRET)
        await until(lambda: len(gateway.node.channels) == 2)
        signed.send(STOCK_BEAT)
        beat = await plain.wait("HEARTBEAT", since=0)
        assert (beat.get_srcSystem(), beat.get_signed(), plain.bad) == (200, False, 0)
        # And the other way round: a program of this computer is trusted, so the gateway signs for it.
        plain.send(STOCK_BEAT)
        beat = await signed.wait("HEARTBEAT", since=0)
        assert (beat.get_srcSystem(), beat.get_signed(), signed.bad) == (201, True, 0)
        await signed.close()
        await plain.close()


async def test_unsigned_sender_opens_no_channel_on_signed_udpin(folder: Path) -> None:
    address = loopback()
    async with Station(folder, 1).started(f"udpin://{address}:14550?signing=field") as gateway:
        client = await UdpClient(255).open(address, (address, 14550))
        client.send(STOCK_BEAT)
        client.send(stock.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7))
        await until(lambda: gateway.node.counters()["refused_unsigned"])
        await until(lambda: gateway.node.counters()["frames"])
        assert gateway.node.channels == []
        assert gateway.inbound == []
        assert client.received == []
        # As QGroundControl does: it finds its key by a signed frame, and signs from then on.
        gateway.node.send(BEAT, sysid=1, compid=1)
        gateway.node.send(BEAT, sysid=1, compid=100)
        await client.close()
        client = await UdpClient(255).open(address, (address, 14550))
        client.expect_key(SECRET)
        for _ in range(50):
            client.send(STOCK_BEAT)
        beat = await client.wait("CAMERA_HEARTBEAT", since=0)
        assert beat.get_signed()
        await until(lambda: gateway.node.counters()["refused_unsigned"] == 51)
        assert len(client.received) < 50
        client.sign(SECRET)
        client.send(STOCK_BEAT)
        await until(lambda: gateway.node.channels)
        await client.close()


async def test_absent_key_and_program_without_keys_name_the_option(folder: Path) -> None:
    for station, problem in (
        (Station(folder, 1), "endpoints[0].signing: no key other in"),
        (Station(None, 1), "endpoints[0].signing: expected none: this program has no keys"),
    ):
        with pytest.raises(ConfigError) as caught:
            await station.node.start([f"tcpin://{loopback()}:5760?signing=other"])
        assert str(caught.value).startswith(problem)
        await station.node.close()


async def test_connections_without_the_key_keep_no_place(folder: Path) -> None:
    address = loopback()
    radio = frame(pack(dialect.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)), 0, 51, 68)
    async with Station(folder, 1).started(f"tcpin://{address}:5760?signing=field&max_clients=2") as gateway:
        strangers = [await asyncio.open_connection(address, 5760) for _ in range(2)]
        for _, writer in strangers:
            writer.write(radio)
        await until(lambda: sum(channel.parser.counters["frames"] for channel in gateway.node.channels) == 2)
        programs = [Station(folder, sysid, saves=False) for sysid in (251, 252)]
        async with AsyncExitStack() as stack:
            for program in programs:
                await stack.enter_async_context(program.started(f"tcpout://{address}:5760?signing=field"))
                await until(lambda program=program: program.node.channels)
                program.send()
                await until(lambda program=program: [i for i in gateway.inbound if i.sysid == program.sysid])
            late = [await asyncio.open_connection(address, 5760) for _ in range(4)]
            await until(lambda: gateway.node.counters()["evicted_peers"] == 4)
            before = len(gateway.inbound)
            for program in programs:
                program.send()
            await until(lambda: len(gateway.inbound) == before + 2)  # no program lost its place
        for _, writer in (*strangers, *late):
            writer.close()


async def test_no_frame_is_accepted_again_after_the_process_was_killed(folder: Path) -> None:
    """The station's clock is a minute ahead, so that the saved timestamp is behind its frames."""
    address, recorded = loopback(), []

    @asynccontextmanager
    async def gateway() -> AsyncIterator[asyncio.StreamReader]:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", GATEWAY, str(folder), address, stdout=asyncio.subprocess.PIPE
        )
        assert process.stdout is not None
        try:
            assert await process.stdout.readline() == b"ready\n"
            yield process.stdout
        finally:
            process.kill()
            await process.wait()

    command = stock.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    station = stock.MAVLink(None, 255, 190)
    station.signing.secret_key, station.signing.sign_outgoing = SECRET, True
    station.signing.timestamp = ticks(time.time()) + 60 * TICKS
    async with gateway() as accepted:
        _, writer = await asyncio.open_connection(address, 5760)
        reading = asyncio.ensure_future(accepted.readline())
        while not reading.done():  # as a station that repeats what has no answer
            recorded.append(command.pack(station))
            writer.write(recorded[-1])
            await asyncio.wait([reading], timeout=0.02)
        assert reading.result() == b"COMMAND_LONG\n"
        writer.close()
    async with gateway() as accepted:
        _, writer = await asyncio.open_connection(address, 5760)
        for raw in recorded:
            writer.write(raw)
        station.signing.timestamp += 120 * TICKS
        reading = asyncio.ensure_future(accepted.readline())
        while not reading.done():
            writer.write(stock.MAVLink_request_data_stream_message(1, 1, 0, 1, 1).pack(station))
            await asyncio.wait([reading], timeout=0.02)
        assert reading.result() == b"REQUEST_DATA_STREAM\n"  # and no command before it
        writer.close()
