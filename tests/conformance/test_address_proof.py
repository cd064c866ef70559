"""What a station at another computer's address gets from `udpin` before and after it has proved to be there.

It sends from a real address of this computer that is none of the loopback network's.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.lines import UdpClient
from support.params import fetch
from support.plans import download
from support.world import loopback

from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

BEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def outer_address() -> str:
    """Return an address of this computer beyond loopback; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.254", 9))
        except OSError:
            pytest.skip("this computer has no address beyond loopback")
        address: str = probe.getsockname()[0]
    if address.startswith("127."):
        pytest.skip("this computer has no address beyond loopback")
    return address


INNER_PORT = 14550
"""Of the endpoint at a loopback address."""


@asynccontextmanager
async def reached(inner: str = "127.0.0.1") -> AsyncIterator[tuple[Gateway, str, int]]:
    """A gateway with a drone, and the place where it waits for datagrams from outside; `inner` is one from inside."""
    address, drone = outer_address(), loopback()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((address, 0))
        port = probe.getsockname()[1]
    config = Config(
        endpoints=(f"udpin://{address}:{port}", f"udpin://{inner}:{INNER_PORT if inner != '127.0.0.1' else 0}"),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone),),
        http=False,
        video=False,
    )
    async with Simulator([DroneSpec(model="4k", address=drone)], seed=1), Gateway(config) as gateway:
        assert await gateway.ready(10.0)
        yield gateway, address, port


def size(client: UdpClient) -> int:
    """Bytes of all frames that a client has received."""
    return sum(len(message.get_msgbuf()) for _, message in client.received)


async def test_one_frame_draws_ten_times_its_bytes_at_most() -> None:
    async with reached() as (gateway, host, port):
        greeter = await UdpClient(250).open(host, (host, port))
        greeter.send(BEAT)
        asker = await UdpClient(251).open(host, (host, port))
        asker.send_command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        sent = len(asker.pack(dialect.MAVLink_command_long_message(1, 1, 512, 0, 148, *[float("nan")] * 6)))
        lister = await UdpClient(252).open(host, (host, port))
        lister.send(dialect.MAVLink_param_request_list_message(1, 1))
        await asyncio.sleep(20.0)
        assert {message.get_type() for _, message in greeter.received} == {"HEARTBEAT"}
        assert 5 * 21 < size(greeter) <= 10 * 21
        assert {message.get_type() for _, message in asker.received} == {"AUTOPILOT_VERSION", "COMMAND_ACK"}
        assert size(asker) <= 10 * sent
        assert size(lister) <= 10 * 14
        assert gateway.counters()["withheld_frames"] == 0  # streams and lists are not even made
        for client in (greeter, asker, lister):
            await client.close()


async def test_station_with_a_heartbeat_a_second_is_served() -> None:
    async with reached() as (_, host, port):
        station = await UdpClient(250).open(host, (host, port))
        began = time.monotonic()
        for _ in range(6):
            station.send(BEAT)
            await asyncio.sleep(1.0)
        first = {kind: station.since(0, kind)[0][0] - began for kind in ("HEARTBEAT", "ATTITUDE", "HOME_POSITION")}
        assert first["HEARTBEAT"] < 1.1
        assert first["ATTITUDE"] < 2.5
        assert first["HOME_POSITION"] < 4.5
        assert station.since(0, "STATUSTEXT")  # the banner has waited, too
        station.send(dialect.MAVLink_param_request_list_message(1, 1))
        await station.wait("PARAM_VALUE")
        assert (await station.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == 0
        await station.close()


async def connect(client: UdpClient) -> float:
    """Connect as QGroundControl does; return how long it took, s."""
    began = time.monotonic()

    async def beat() -> None:
        while True:
            client.send(BEAT)
            await asyncio.sleep(1.0)

    beating = asyncio.ensure_future(beat())
    await client.heartbeat(lambda beat: True, since=0)
    for id in (148, 300, 435):  # AUTOPILOT_VERSION, PROTOCOL_VERSION, AVAILABLE_MODES
        await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, id)
    await fetch(client)
    for kind in range(3):
        await download(client, kind)
    await client.wait("HOME_POSITION", since=0)
    beating.cancel()
    return time.monotonic() - began


async def test_station_from_outside_is_ready_hardly_later() -> None:
    inner = loopback()
    async with reached(inner) as (_, host, port):
        known = await UdpClient(250).open(inner, (inner, INNER_PORT))
        before = await connect(known)
        stranger = await UdpClient(251).open(host, (host, port))
        assert await connect(stranger) <= before + 2.5
        for client in (known, stranger):
            await client.close()
