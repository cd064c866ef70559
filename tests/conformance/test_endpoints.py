"""Every kind of endpoint carries a flight; garbage on every open port changes nothing but a counter."""

from __future__ import annotations

import asyncio
import itertools
import random
import socket
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.lines import SerialClient, UdpClient, pseudo_terminal
from support.mav import Client
from support.world import ARMED, HOLD, HOME, loopback, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.link.frame import FrameType, encode_frame
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator

ACCEPTED = 0
LINK_TIMEOUT = 3.0
"""s without a heartbeat after which MAVSDK calls a system lost; QGroundControl waits a little longer."""
ARM, TAKE_OFF, REPOSITION, LAND = (
    mav_enums.MAV_CMD_COMPONENT_ARM_DISARM,
    mav_enums.MAV_CMD_NAV_TAKEOFF,
    mav_enums.MAV_CMD_DO_REPOSITION,
    mav_enums.MAV_CMD_NAV_LAND,
)


@asynccontextmanager
async def flown(address: str, *endpoints: str) -> AsyncIterator[tuple[Gateway, SimulatedDrone]]:
    """A gateway with these endpoints and a drone of its own at `address`."""
    config = Config(
        endpoints=endpoints, drones=(DroneConfig(name="alpha", sysid=1, address=address),), http=False, video=False
    )
    spec = DroneSpec(address=address, home=HOME, http_port=None)
    async with Simulator([spec], speed=4.0, seed=1) as simulator, Gateway(config) as gateway:
        assert await gateway.ready(10.0), gateway.lines()
        yield gateway, simulator.drones[0]


async def take_off(client: Client, height: float) -> None:
    assert (await client.command(ARM, 1)).result == ACCEPTED
    assert (await client.command(TAKE_OFF, x=0.0, y=0.0, z=height)).result == ACCEPTED
    await client.heartbeat(lambda beat: beat.custom_mode == HOLD, timeout=20.0)


async def fly_to(client: Client, place: tuple[float, float], height: float) -> None:
    ack = await client.command(REPOSITION, -1, 1, 0, frame=6, x=place[0], y=place[1], z=height)
    assert ack.result == ACCEPTED

    def is_there(m: Any) -> bool:
        """At the place and at rest: a busy machine lets it fly on before the next command."""
        near = geo.distance(*place, m.lat / 1e7, m.lon / 1e7) < 0.5 and abs(m.relative_alt / 1000 - height) < 0.3
        return near and max(abs(m.vx), abs(m.vy), abs(m.vz)) < 20  # cm/s

    await client.wait("GLOBAL_POSITION_INT", is_there, timeout=20.0)


async def land(client: Client) -> None:
    mark = client.mark()
    assert (await client.command(LAND)).result == ACCEPTED
    await client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=20.0)


def has_flown(drone: SimulatedDrone, place: tuple[float, float], height: float) -> None:
    """By the simulator's own log: these orders in this order, and it was there when it was commanded to land."""
    orders = [entry for entry in drone.log if entry.kind == "command" and entry.name.startswith("ardrone3.Piloting.")]
    names = [entry.name.removeprefix("ardrone3.Piloting.") for entry in orders]
    assert [name for name in names if name in ("TakeOff", "moveTo", "Landing")] == ["TakeOff", "moveTo", "Landing"]
    (landing,) = (entry for entry in orders if entry.name.endswith("Landing"))
    pose = [entry for entry in drone.log if entry.kind == "pose" and entry.t <= landing.t][-1].args
    assert geo.distance(*place, pose["lat"], pose["lon"]) < 1.0
    assert pose["ato"] == pytest.approx(height, abs=0.5)
    assert drone.flying_state.name == "LANDED"


PLACE = geo.destination(*HOME[:2], 12.0, -16.0)
"""20 m from home."""


async def test_a_flight_over_a_serial_line() -> None:
    async with pseudo_terminal() as (master, name), flown(loopback(), f"serial://{name}:57600") as (_, drone):
        client = SerialClient(master)
        await take_off(client, 5.0)
        await fly_to(client, PLACE, 8.0)
        await land(client)
        has_flown(drone, PLACE, 8.0)
        assert client.bad == 0
        await client.close()


async def test_a_flight_over_tcp_with_two_clients() -> None:
    """Each gives orders and gets the answers to its own; both see the whole flight."""
    async with world(speed=4.0) as w:
        first, second = w.client, await w.connect(254)
        await take_off(first, 5.0)
        await fly_to(second, PLACE, 8.0)
        await land(first)
        has_flown(w.drone, PLACE, 8.0)
        for client, commands in ((first, {ARM, TAKE_OFF, LAND}), (second, {REPOSITION})):
            acks = [message for _, message in client.since(0, "COMMAND_ACK")]
            assert {ack.target_system for ack in acks} == {client.sysid}
            assert {ack.command for ack in acks} == commands
            seen = {message.landed_state for _, message in client.since(0, "EXTENDED_SYS_STATE")}
            assert {1, 2} <= seen
            assert client.bad == 0


async def test_a_flight_over_udp_both_ways_round() -> None:
    """Orders over `udpin`; a client that listens where `udpout` sends sees them obeyed."""
    host = loopback()
    watcher = await UdpClient(254).open(host)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        port = probe.getsockname()[1]
    endpoints = (f"udpin://{host}:{port}", f"udpout://{host}:{watcher.port}")
    async with flown(loopback(), *endpoints) as (_, drone):
        client = await UdpClient(255).open(host, (host, port))
        await take_off(client, 5.0)
        await fly_to(client, PLACE, 8.0)
        await land(client)
        has_flown(drone, PLACE, 8.0)
        assert {1, 2} <= {message.landed_state for _, message in watcher.since(0, "EXTENDED_SYS_STATE")}
        assert not watcher.since(0, "COMMAND_ACK")
        await client.close()
        await watcher.close()


# Garbage.


def mavlink_garbage(seed: int) -> Iterator[bytes]:
    """Noise, pieces of frames, frames with one byte wrong, and the other protocol. An order that got through arms."""
    chance = random.Random(seed)
    for length in (0, 1, 2, 7, 12, 279, 280, 281, 1500, 9000):
        yield chance.randbytes(length)
    sender = stock.MAVLink(None, 255, 190)
    order = stock.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(sender)
    old = stock.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(sender, force_mavlink1=True)
    for frame in (order, old):
        yield from (frame[:cut] for cut in range(1, len(frame)))  # in this order no two of them make a whole
        yield from (frame[cut:] for cut in range(1, len(frame)))
        for position in range(len(frame)):  # a checksum of 16 bits notices every burst of up to 16
            broken = bytearray(frame)
            broken[position] ^= chance.randint(1, 255)
            yield bytes(broken)
    for version in (1, 2, 3):
        yield encode_frame(version, FrameType.WITHACK, 11, 1, bytes((1, 0, 1, 0)))  # ardrone3.Piloting.TakeOff
    yield b"\xfd" * 600
    yield b"\xfe" * 600


def arsdk_garbage(seed: int) -> Iterator[bytes]:
    """What no decoder of protocol version 3 can make sense of. Sequence numbers are far from those in use."""
    chance = random.Random(seed)
    for length in (1, 2, 5, 6, 40, 1400, 9000):
        yield bytes((200,)) + chance.randbytes(length - 1)
    whole = encode_frame(3, FrameType.NOACK, 127, 40_000, bytes(12))
    for cut in range(1, len(whole)):
        yield whole[:cut]
    yield encode_frame(3, 9, 127, 40_000, b"")  # no such type
    yield encode_frame(3, FrameType.NOACK, 99, 40_000, bytes(4))  # no such queue
    yield encode_frame(3, FrameType.NOACK, 127, 40_000, b"\x01\x04")  # half a command
    yield encode_frame(3, FrameType.NOACK, 127, 40_100, bytes((1, 4, 1, 0, 99)))  # a flying state of one byte
    yield encode_frame(1, FrameType.NOACK, 127, 0, bytes(12))  # another version
    yield stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(stock.MAVLink(None, 255, 190))
    yield b"\x0d" * 500


def open_ports() -> set[tuple[str, str, int]]:
    """(protocol, address, port) of each IPv4 socket of this process that another client could send to."""
    mine = set()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the one that reads this folder
            mine.add(str(entry.readlink()))
    found = set()
    for protocol, wanted in (("udp", None), ("tcp", "0A")):  # 0A: listening
        for line in Path(f"/proc/net/{protocol}").read_text().splitlines()[1:]:
            fields = line.split()
            address, port = fields[1].split(":")
            if f"socket:[{fields[9]}]" in mine and wanted in (None, fields[3]):
                found.add((protocol, socket.inet_ntoa(bytes.fromhex(address)[::-1]), int(port, 16)))
    return found


class Watch:
    """What must stay the same while garbage comes in. Nothing else may come in meanwhile."""

    def __init__(self, gateway: Gateway, drone: SimulatedDrone, client: Client) -> None:
        self.gateway, self.drone, self.client = gateway, drone, client
        self.began = client.mark()
        self.started = time.monotonic()
        self.beat = self.look(client.since(0, "HEARTBEAT")[-1][1])
        self.before = gateway.counters()
        self.heard = len(self.commands())

    @staticmethod
    def look(beat: Any) -> tuple[int, int, int]:
        return beat.base_mode, beat.custom_mode, beat.system_status

    def commands(self) -> list[str]:
        return [entry.name for entry in self.drone.log if entry.kind == "command"]

    async def unchanged(self, *counters: str) -> Counter[str]:
        """Two more heartbeats later: as many messages as ever, none of them new; and these counters went up."""
        for _ in range(2):
            await self.client.heartbeat(lambda beat: True, timeout=10.0)
        duration = time.monotonic() - self.started
        for kind, rate in (("HEARTBEAT", 1.0), ("ATTITUDE", 5.0), ("GLOBAL_POSITION_INT", 5.0)):
            times = [self.started, *(at for at, _ in self.client.since(self.began, kind))]
            assert len(times) > 0.6 * rate * duration, kind  # a busy machine slows us all down
            assert max(later - earlier for earlier, later in itertools.pairwise(times)) < LINK_TIMEOUT, kind
        assert {self.look(m) for _, m in self.client.since(self.began, "HEARTBEAT")} == {self.beat}
        assert {m.landed_state for _, m in self.client.since(self.began, "EXTENDED_SYS_STATE")} == {1}
        assert not self.client.since(self.began, "COMMAND_ACK")
        assert not self.client.since(self.began, "STATUSTEXT")
        assert self.client.bad == 0
        assert self.commands()[self.heard :] == []
        growth = self.gateway.counters() - self.before
        assert not growth["frames"], growth
        for counter in counters:
            assert growth[counter] > 0, growth
        return growth


async def still_works(client: Client) -> None:
    """A client on this endpoint is heard. 300 zeros first: what looked like the beginning of a frame ends in them."""
    client.send_raw(bytes(300))
    mark = client.mark()
    assert (await client.command(ARM, 0)).result == ACCEPTED
    assert client.since(mark, "COMMAND_ACK")


async def throw(send: Callable[[bytes], None], pieces: Iterator[bytes]) -> None:
    """Send them all, no faster than they are read."""
    for count, piece in enumerate(pieces):
        send(piece)
        if count % 10 == 9:
            await asyncio.sleep(0.001)


async def own_socket(drone: SimulatedDrone, client: Client) -> Callable[[bytes], None]:
    """Return what sends a datagram to the gateway from the socket of the drone's own session."""
    session = drone.session
    assert session is not None
    air, seen = session.air, []
    assert air is not None

    def watch(datagram: bytes, inbound: bool, deliver: Callable[[bytes], None]) -> None:
        if not inbound:
            seen.append(deliver)
        air(datagram, inbound, deliver)

    session.air = watch
    await client.wait("ATTITUDE")  # telemetry has left the drone
    session.air = air
    return seen[0]


async def test_serial_line_that_was_full_is_served_without_errors(caplog: pytest.LogCaptureFixture) -> None:
    host = loopback()
    async with (
        pseudo_terminal() as (master, name),
        flown(loopback(), f"tcpin://{host}:5760", f"serial://{name}:57600") as (g, _),
    ):
        client = await Client().connect(5760, host)
        while not g.counters()["dropped_frames"]:  # no one reads
            await client.heartbeat(lambda beat: True)
        line = SerialClient(master, 250)
        for _ in range(3):
            await line.heartbeat(lambda beat: True)
        await line.close()
        await client.close()
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


def page_request(method: str, body: bytes) -> bytes:
    """A request that the page of any web site can make a browser send, with a body of the page's choice."""
    head = f"{method} / HTTP/1.1\r\nHost: 127.0.0.1:5760\r\nOrigin: https://example.org\r\nContent-Length: {len(body)}"
    return head.encode() + b"\r\n\r\n" + body


@pytest.mark.parametrize(
    "split",
    [
        pytest.param((), id="whole"),
        pytest.param((1, 3), id="first bytes alone"),
        pytest.param((20, 110), id="body alone"),
    ],
)
@pytest.mark.parametrize("first", ["POST", "OPTIONS", "TLS"])
async def test_web_page_in_a_browser_commands_nothing_over_tcp(first: str, split: tuple[int, ...]) -> None:
    async with world() as w:
        arm = stock.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(stock.MAVLink(None, 255, 190))
        data = b"\x16\x03\x01\x02\x00" + bytes(120) + 3 * arm if first == "TLS" else page_request(first, 3 * arm)
        reader, writer = await asyncio.open_connection(w.address, 5760)
        for begin, end in itertools.pairwise((0, *split, len(data))):
            writer.write(data[begin:end])
            await asyncio.sleep(0.1)
        mark = w.client.mark()
        for _ in range(2):
            await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert [beat for _, beat in w.client.since(mark, "HEARTBEAT") if beat.base_mode & ARMED] == []
        with suppress(ConnectionError):
            while await reader.read(1 << 16):  # until the gateway ends the connection
                pass
        writer.close()
        assert w.gateway.counters()["refused_browsers"] == 1
        assert w.gateway.status().endpoints[0].refused == {"HTTP or TLS of a browser, not MAVLink": 1}


async def test_client_of_tcp_that_begins_with_other_bytes_is_served() -> None:
    """As behind a serial server, which may begin in the middle of a frame or with a greeting."""
    async with world() as w:
        for beginning in (b"A", b"OK\r\n", b"ABC\x00", b"\x16", b"\x16\x00", b"X" * 40):
            client = await w.connect(250)
            client.send_raw(beginning)
            await still_works(client)


async def test_garbage_on_every_mavlink_port() -> None:
    host, stranger = loopback(), loopback()
    peer = await UdpClient(254).open(host)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        port = probe.getsockname()[1]
    urls = (f"tcpin://{host}:5760", f"udpin://{host}:{port}", f"udpout://{host}:{peer.port}")
    async with pseudo_terminal() as (master, name), flown(loopback(), *urls, f"serial://{name}:57600") as (g, drone):
        client = await Client().connect(5760, host)
        await client.heartbeat(lambda beat: True)
        await peer.heartbeat(lambda beat: True)
        assert peer.peer is not None

        watch = Watch(g, drone, client)
        over_tcp = await Client(253).connect(5760, host)
        await throw(over_tcp.send_raw, mavlink_garbage(1))
        growth = await watch.unchanged("garbage_bytes", "bad_checksums")
        assert growth["garbage_bytes"] > 10_000

        watch = Watch(g, drone, client)
        over_udp = await UdpClient(252).open(stranger, (host, port))
        await throw(over_udp.send_raw, mavlink_garbage(2))
        await watch.unchanged("garbage_bytes", "bad_checksums")
        assert not over_udp.received  # a sender of nothing true is no peer

        watch = Watch(g, drone, client)
        await throw(peer.send_raw, mavlink_garbage(3))
        await watch.unchanged("garbage_bytes", "bad_checksums")

        watch = Watch(g, drone, client)
        outsider = await UdpClient(251).open(stranger, peer.peer)
        await throw(outsider.send_raw, mavlink_garbage(4))  # not from where `udpout` sends to: not even counted
        growth = await watch.unchanged()
        assert not growth["garbage_bytes"]

        watch = Watch(g, drone, client)
        line = SerialClient(master, 250)
        for piece in mavlink_garbage(5):
            for start in range(0, len(piece), 512):  # a terminal holds 4 KB
                line.send_raw(piece[start : start + 512])
                await asyncio.sleep(0.001)
        await watch.unchanged("garbage_bytes", "bad_checksums")

        for other in (over_tcp, over_udp, peer, line, client):
            await still_works(other)
        for other in (over_tcp, over_udp, outsider, peer, line, client):
            await other.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="sockets are looked up in /proc")
async def test_garbage_on_the_drones_side() -> None:
    """The gateway's ARSDK socket hears its drone alone, and survives it too."""
    host, at = loopback(), loopback()
    ports_before = open_ports()
    async with flown(at, f"tcpin://{host}:5760") as (g, drone):
        client = await Client().connect(5760, host)
        await client.heartbeat(lambda beat: True)
        ports = {entry for entry in open_ports() - ports_before if entry[1] != at}
        assert ("tcp", host, 5760) in ports
        (data,) = ports - {("tcp", host, 5760)}  # and nothing else is open
        assert data[0] == "udp"
        assert data[1] != "0.0.0.0"

        watch = Watch(g, drone, client)
        for source in (host, at):  # from elsewhere, and from another port of the drone's own address
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.bind((source, 0))
                await throw(lambda piece, s=stranger: s.sendto(piece, data[1:]), arsdk_garbage(6))
        growth = await watch.unchanged("alpha.received")
        assert not [name for name in growth if "garbage" in name]

        watch = Watch(g, drone, client)
        session = drone.session
        assert session is not None
        # Nothing but the drone's own socket is heard.
        await throw(await own_socket(drone, client), arsdk_garbage(7))
        await watch.unchanged(
            *(f"alpha.garbage.{why}" for why in ("header", "type", "size", "version", "queue", "payload"))
        )
        assert drone.session is session
        await still_works(client)
        await client.close()
