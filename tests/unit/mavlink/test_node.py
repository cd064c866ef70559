"""The node over real sockets: who gets what, and what a bad neighbour may not do to the others."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
import termios
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support import clock
from support.fault_scenarios import watched
from support.laptop import LaptopClock
from support.lines import SerialClient, UdpClient, pseudo_terminal
from support.mav import Client
from support.world import loopback

from anafi_mav.endpoint_options import CLIENTS
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import QUEUE_BYTES, Channel
from anafi_mav.mavlink.frames import Parser, ReceivedFrame, frame, pack
from anafi_mav.mavlink.node import Inbound, Node
from anafi_mav.mavlink.router import EVERY_COMPONENT
from anafi_mav.mavlink.udp import HOLDS, UdpOut

ATTITUDE = dialect.MAVLink_attitude_message(1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
BEAT = stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


LISTENER = 200
"""A system that nothing is addressed to: its host gets broadcasts alone."""


class Bench:
    """A node and what it reported to its owner."""

    def __init__(self) -> None:
        self.inbound: list[Inbound] = []
        self.changes: list[tuple[str, bool]] = []
        self.clock = LaptopClock()
        self.node = Node(on_channel=self._channel, clock=self.clock)
        self.node.add_host(LISTENER, EVERY_COMPONENT, self.inbound.append)

    def _channel(self, channel: Channel, opened: bool) -> None:
        self.changes.append((channel.name, opened))

    def got(self, kind: str, sysid: int) -> list[Any]:
        return [i.message for i in self.inbound if i.message.get_type() == kind and i.sysid == sysid]

    async def until(self, ready: Callable[[], bool], timeout: float = 5.0) -> None:
        deadline = asyncio.get_running_loop().time() + timeout
        while not ready():
            assert asyncio.get_running_loop().time() < deadline, (self.changes, self.node.counters())
            await asyncio.sleep(0.005)  # what the node has seen has no event of its own


@asynccontextmanager
async def bench(*urls: str) -> AsyncIterator[Bench]:
    held = Bench()
    await held.node.start(urls)
    try:
        yield held
    finally:
        await held.node.close()


def udp_port(host: str) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        port: int = probe.getsockname()[1]
        return port


def ping(sysid: int, component: int, number: int) -> Any:
    return stock.MAVLink_ping_message(number, number, sysid, component)


def numbers(client: Client) -> list[int]:
    return [message.seq for _, message in client.since(0, "PING")]


@asynccontextmanager
async def three(host: str) -> AsyncIterator[tuple[Bench, Client, Client, Client]]:
    """Systems 10 and 20 by TCP, 30 by UDP; the node has heard of all of them."""
    port = udp_port(host)
    async with bench(f"tcpin://{host}:5760", f"udpin://{host}:{port}") as d:
        ten, twenty = await Client(10).connect(5760, host), await Client(20).connect(5760, host)
        thirty = await UdpClient(30).open(host, (host, port))
        await d.until(lambda: len(d.node.channels) == 2)
        for client in (ten, twenty, thirty):
            client.send(BEAT)
        await d.until(lambda: all(d.got("HEARTBEAT", sysid) for sysid in (10, 20, 30)))
        yield d, ten, twenty, thirty
        for client in (ten, twenty, thirty):
            await client.close()


async def test_broadcast_reaches_all_channels_except_the_senders() -> None:
    async with three(loopback()) as (d, ten, twenty, thirty):
        ten.send(ping(0, 0, 1))
        await twenty.wait("PING", since=0)
        await thirty.wait("PING", since=0)
        assert [message.seq for message in d.got("PING", 10)] == [1]
        twenty.send(ping(0, 0, 2))  # what is behind it on the same way has overtaken nothing
        await ten.wait("PING", since=0)
        assert numbers(ten) == [2]
        # A frame is passed on as it is, its sender's name and number on it.
        (_, heard) = twenty.since(0, "PING")[0]
        assert (heard.get_srcSystem(), heard.get_srcComponent(), heard.get_seq()) == (10, 190, 1)


async def test_a_message_with_a_target_goes_there_alone() -> None:
    async with three(loopback()) as (d, ten, twenty, thirty):
        ten.send(ping(30, 190, 1))
        await thirty.wait("PING", since=0)
        thirty.send(ping(10, 0, 2))
        await ten.wait("PING", since=0)
        ten.send(ping(99, 1, 3))  # no one's
        ten.send(ping(0, 0, 4))
        await twenty.wait("PING", since=0)
        await thirty.wait("PING", lambda message: message.seq == 4, since=0)
        assert (numbers(ten), numbers(twenty), numbers(thirty)) == ([2], [4], [1, 4])
        assert [message.seq for message in d.got("PING", 10)] == [4]
        assert d.got("PING", 30) == []


@pytest.mark.parametrize("scheme", ["udpin", "udpout"])
async def test_datagrams_that_wait_are_read_in_one_iteration(scheme: str) -> None:
    """On a busy computer a command waits behind what its client sent before: not one iteration for each datagram."""
    host = loopback()
    port = udp_port(host)
    client = await UdpClient(30).open(host, (host, port) if scheme == "udpin" else None)
    async with bench(f"{scheme}://{host}:{port if scheme == 'udpin' else client.port}") as d:
        if scheme == "udpout":
            d.node.send(ATTITUDE, sysid=1, compid=1)
            await d.until(lambda: client.peer is not None)
        for number in range(20):
            client.send(ping(0, 0, number))
        iterations = 0
        while not d.got("PING", 30):
            await asyncio.sleep(0)
            iterations += 1
        assert [message.seq for message in d.got("PING", 30)] == list(range(20)), iterations
    await client.close()


async def test_message_for_our_system_is_not_forwarded() -> None:
    async with three(loopback()) as (d, ten, twenty, thirty):
        d.node.add_host(1, 1, d.inbound.append)
        ten.send(ping(1, 1, 1))
        await d.until(lambda: len(d.got("PING", 10)) == 1)
        (inbound,) = (i for i in d.inbound if i.message.get_type() == "PING")
        assert (inbound.sysid, inbound.compid, inbound.channel in d.node.channels) == (10, 190, True)
        d.node.send(dialect.MAVLink_ping_message(9, 9, 10, 190), sysid=1, compid=1, to=inbound.channel)
        answer = await ten.wait("PING", since=0)
        assert (answer.seq, answer.get_srcSystem()) == (9, 1)
        d.node.remove_hosts(1)
        ten.send(ping(1, 1, 2))  # its drone is away: no one's now
        ten.send(ping(0, 0, 3))
        await twenty.wait("PING", since=0)
        await thirty.wait("PING", since=0)
        assert [message.seq for message in d.got("PING", 10)] == [1, 3]
        assert (numbers(twenty), numbers(thirty)) == ([3], [3])


async def test_message_for_our_system_reaches_no_vehicle_that_had_its_name_before() -> None:
    async with three(loopback()) as (d, ten, twenty, thirty):
        d.node.add_host(10, 190, d.inbound.append)
        d.node.send(BEAT, sysid=10, compid=190)
        twenty.send(ping(10, 190, 1))
        twenty.send(ping(0, 0, 2))
        await thirty.wait("PING", since=0)
        await ten.wait("PING", lambda message: message.seq == 2, since=0)
        assert numbers(ten) == [2]
        assert [message.seq for message in d.got("PING", 20)] == [1, 2, 2]  # to all: both of our hosts


async def test_component_added_as_host_receives_its_messages() -> None:
    """A camera component beside the autopilot: one line at its owner's, and nothing else knows of it."""
    async with three(loopback()) as (d, ten, twenty, _):
        autopilot: list[Inbound] = []
        camera: list[Inbound] = []
        d.node.add_host(1, 1, autopilot.append)
        d.node.add_host(1, dialect.MAV_COMP_ID_CAMERA, camera.append)
        for component, number in ((1, 1), (dialect.MAV_COMP_ID_CAMERA, 2), (dialect.MAV_COMP_ID_GIMBAL, 3), (0, 4)):
            ten.send(ping(1, component, number))
        ten.send(ping(0, 0, 5))
        await twenty.wait("PING", since=0)
        assert [inbound.message.seq for inbound in autopilot] == [1, 4, 5]
        assert [inbound.message.seq for inbound in camera] == [2, 4, 5]
        d.node.stop_delivering()
        ten.send(ping(1, 0, 6))
        ten.send(ping(0, 0, 7))
        await twenty.wait("PING", lambda message: message.seq == 7, since=0)
        assert (len(autopilot), len(camera)) == (3, 3)


COUNT, FRAME, ANSWER = 120_000, 40, 15
"""4.8 MB of ATTITUDE: more than what two sockets and we ourselves hold for one peer. Bytes of each frame, and of a
COMMAND_ACK without its trailing zeros."""


def newest(frames: list[ReceivedFrame]) -> int:
    """The time of the last frame."""
    time: int = frames[-1].message.time_boot_ms
    return time


async def test_what_waited_for_a_suspended_computer_is_late() -> None:
    """A goto of the evening before, which TCP repeats when the computer wakes, is not carried out."""
    host = loopback()
    async with bench(f"tcpin://{host}:5760") as d:
        client = await Client(10).connect(5760, host)
        client.send(BEAT)
        await d.until(lambda: d.got("HEARTBEAT", 10) != [])
        client.send_command(stock.MAV_CMD_DO_REPOSITION, target=(0, 0))
        client.send(ping(0, 0, 1))
        d.clock.slept += 3600.0  # nothing is read before the next iteration
        await d.until(lambda: d.got("COMMAND_LONG", 10) != [])
        await client.silence("PING", 0.5)  # the sockets are drained
        client.send_command(stock.MAV_CMD_DO_REPOSITION, target=(0, 0))
        await d.until(lambda: len(d.got("COMMAND_LONG", 10)) == 2)
        assert [i.is_late for i in d.inbound if i.message.get_type() == "COMMAND_LONG"] == [True, False]
        assert d.got("PING", 10) == []
        await client.close()


async def test_stalled_reader_does_not_delay_other_clients() -> None:
    host = loopback()
    async with bench(f"tcpin://{host}:5760") as d:
        # A window that was shut is opened by the kernel, after a while.
        with clock.everybodys(), socket.socket() as still:
            still.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            still.connect((host, 5760))
            await d.until(lambda: len(d.node.channels) == 1)
            (slow,) = d.node.channels
            brisk, writer = await asyncio.open_connection(host, 5760)
            await d.until(lambda: len(d.node.channels) == 2)
            reading = asyncio.ensure_future(asyncio.wait_for(brisk.readexactly(COUNT * FRAME + ANSWER), 30.0))
            for number in range(COUNT):
                ATTITUDE.time_boot_ms = number
                d.node.send(ATTITUDE, sysid=1, compid=1, give_way=True)
                if number % 100 == 0:
                    await asyncio.sleep(0)
            d.node.send(dialect.MAVLink_command_ack_message(400, 1), sysid=1, compid=1)
            frames = Parser().receive(await reading)
            assert [received.raw[4] for received in frames] == [n % 256 for n in range(COUNT + 1)]

            sent, dropped = slow.counters["sent_frames"], slow.counters["dropped_frames"]
            waiting = COUNT + 1 - sent - dropped
            assert dropped > 0
            assert waiting > 1
            assert (waiting - 1) * FRAME + ANSWER <= QUEUE_BYTES
            # When it reads again it gets what the sockets held, then the answer, then the newest telemetry.
            still.setblocking(False)
            parser, frames = Parser(), []
            while not frames or frames[-1].message.get_type() == "COMMAND_ACK" or newest(frames) < COUNT - 1:
                data = await asyncio.wait_for(asyncio.get_running_loop().sock_recv(still, 65536), 10.0)
                frames += parser.receive(data)
            kinds = [received.message.get_type() for received in frames]
            assert len(frames) - kinds.index("COMMAND_ACK") == waiting
            assert newest(frames[: kinds.index("COMMAND_ACK")]) < COUNT - waiting
            # To its reader nothing is missing: numbers are given when frames leave.
            assert [received.raw[4] for received in frames] == [n % 256 for n in range(len(frames))]
        writer.close()


def test_forwarded_telemetry_gives_way_to_forwarded_answers() -> None:
    written: list[bytes] = []
    source, target = Channel("source", lambda raw: None), Channel("target", written.append)
    node = Node()
    node.add_telemetry({dialect.MAVLINK_MSG_ID_ATTITUDE})
    for channel in (source, target):
        node.opened(channel)
    target.pause()
    ack = dialect.MAVLink_command_ack_message(400, 0)
    frames = [frame(pack(message), number, 42, 1) for number, message in enumerate((ATTITUDE, ack, ATTITUDE))]
    node.received(source, Parser().receive(b"".join(frames)))
    target.resume()
    assert [raw[4] for raw in written] == [1, 0, 2]


async def test_tcpout_reconnects() -> None:
    host = loopback()
    accepted: asyncio.Queue[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = asyncio.Queue()

    async def listen() -> asyncio.Server:
        return await asyncio.start_server(lambda r, w: accepted.put_nowait((r, w)), host, 5760)

    url = f"tcpout://{host}:5760"
    async with bench(url) as d:
        await d.until(lambda: "Connection refused" in d.node.endpoints[0].describe())
        assert d.node.endpoints[0].describe() == f"{url}: not connected (Connection refused), retrying"
        server = await listen()
        for round in (1, 2):
            reader, writer = await asyncio.wait_for(accepted.get(), 10.0)
            await d.until(lambda: d.node.endpoints[0].describe() == f"{url}: connected")
            d.node.send(ATTITUDE, sysid=1, compid=1)
            client = Client()
            client.feed(await asyncio.wait_for(reader.read(1000), 5.0))
            assert [message.get_type() for _, message in client.received] == ["ATTITUDE"]
            writer.write(BEAT.pack(stock.MAVLink(None, 10 * round, 1)))
            await d.until(lambda round=round: bool(d.got("HEARTBEAT", 10 * round)))
            writer.close()
            await d.until(lambda: not d.node.channels)
        assert d.changes == [(url, True), (url, False)] * 2
        assert d.node.counters()["frames"] == 2  # of channels that are gone, too
        server.close()


async def test_closing_in_the_moment_of_connecting() -> None:
    """The channel is open a turn of the loop before its endpoint knows that it is connected."""
    host = loopback()
    server = await asyncio.start_server(lambda reader, writer: None, host, 5760)
    node = Node()
    opened = asyncio.Event()
    node.on_channel = lambda channel, is_open: opened.set()
    await node.start([f"tcpout://{host}:5760"])
    await opened.wait()
    await asyncio.wait_for(node.close(), 2.0)
    assert node.channels == []
    server.close()


async def test_udpin_adds_peers_by_their_datagrams() -> None:
    host, elsewhere = loopback(), loopback()
    port = udp_port(host)
    async with bench(f"udpin://{host}:{port}") as d:
        one = await UdpClient(10).open(host, (host, port))
        two = await UdpClient(20).open(elsewhere, (host, port))
        noise = await UdpClient(30).open(host, (host, port))
        noise.send_raw(b"hello")
        for client in (one, two):
            client.send(BEAT)
        await d.until(lambda: len(d.node.channels) == 2)
        url = f"udpin://{host}:{port}"
        names = {f"{url} from {host}:{one.port}", f"{url} from {elsewhere}:{two.port}"}
        assert {channel.name for channel in d.node.channels} == names
        assert d.node.endpoints[0].describe() == f"{url}: 2 peers"
        d.node.send(ATTITUDE, sysid=1, compid=1)
        for client in (one, two):
            message = await client.wait("ATTITUDE", since=0)
            assert message.get_seq() == 0
        assert noise.received == []
        one.send(BEAT)
        await two.wait("HEARTBEAT", lambda beat: beat.get_seq() == 1, since=0)
        assert len(d.node.channels) == 2
        assert d.node.counters()["garbage_bytes"] == 5
        for client in (one, two, noise):
            await client.close()


async def test_a_full_endpoint_refuses_and_the_others_stay() -> None:
    host = loopback()
    async with bench(f"tcpin://{host}:5760") as d:
        clients = [await Client(n + 1).connect(5760, host) for n in range(CLIENTS)]
        await d.until(lambda: len(d.node.channels) == CLIENTS)
        reader, writer = await asyncio.open_connection(host, 5760)
        with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
            await asyncio.wait_for(reader.readexactly(1), 5.0)
        writer.close()
        assert d.node.counters()["refused_peers"] == 1
        d.node.send(ATTITUDE, sysid=1, compid=1)
        for client in clients:
            await client.wait("ATTITUDE", since=0)
            await client.close()


@pytest.mark.parametrize("scheme", ["tcpin", "udpin"])
async def test_idle_clients_lock_no_client_out(scheme: str, caplog: pytest.LogCaptureFixture) -> None:
    host = loopback()
    port = udp_port(host)

    async def join(sysid: int) -> Client:
        if scheme == "tcpin":
            return await Client(sysid).connect(port, host)
        return await UdpClient(sysid).open(host, (host, port))

    async with bench(f"{scheme}://{host}:{port}?max_clients=3") as d:
        station = await join(255)
        station.send(BEAT)
        await d.until(lambda: bool(d.got("HEARTBEAT", 255)))
        idle = [await join(n) for n in (1, 2, 3)]
        for client in idle:
            if scheme == "udpin":
                client.send(BEAT)
        await d.until(lambda: d.node.counters()["refused_peers"] == 1)  # no one has been silent for long enough
        for _ in range(6):
            await asyncio.sleep(1.0)
            station.send(BEAT)
        new = await join(20)
        new.send(BEAT)
        await d.until(lambda: bool(d.got("HEARTBEAT", 20)))
        assert d.node.counters()["evicted_peers"] == 1
        d.node.send(ATTITUDE, sysid=1, compid=1)
        for client in (station, new):
            await client.wait("ATTITUDE", since=0)
        assert d.node.endpoints[0].describe().endswith(": 3 clients" if scheme == "tcpin" else ": 3 peers")
        for client in (station, new, *idle):
            await client.close()
    assert sum(" replaces " in record.getMessage() for record in caplog.records) == 1


@pytest.mark.parametrize("scheme", ["tcpin", "udpin"])
@pytest.mark.parametrize(("limit", "dropped"), [(8, True), (0, False)])
async def test_idle_client_is_dropped_after_its_limit(scheme: str, limit: int, dropped: bool) -> None:
    host = loopback()
    port = udp_port(host)
    async with bench(f"{scheme}://{host}:{port}?idle_limit={limit}") as d:
        clients = []
        for sysid in (10, 20):
            client = Client(sysid)
            clients.append(client.connect_udp(host, port) if scheme == "udpin" else await client.connect(port, host))
            client.send(BEAT)
        await d.until(lambda: len(d.node.channels) == 2)
        for _ in range(20):
            await asyncio.sleep(1.0)
            clients[1].send(BEAT)
        await d.until(lambda: len(d.node.channels) == (1 if dropped else 2))
        assert d.node.counters()["idle_peers"] == (1 if dropped else 0)
        for client in clients:
            await client.close()


@pytest.mark.parametrize("scheme", ["tcpin", "udpin"])
async def test_address_that_is_not_allowed_is_refused(scheme: str, caplog: pytest.LogCaptureFixture) -> None:
    host, stranger = loopback(), loopback()
    port = udp_port(host)
    async with bench(f"{scheme}://{host}:{port}?allowed_peers=127.0.0.1,10.0.0.0/8") as d:
        if scheme == "udpin":
            other = await UdpClient(20).open(stranger, (host, port))
            for _ in range(2):
                other.send(BEAT)
            await d.until(lambda: d.node.counters()["refused_addresses"] == 2)
            await other.close()
        else:
            for count in (1, 2):
                reader, writer = await asyncio.open_connection(host, port, local_addr=(stranger, 0))
                with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
                    await asyncio.wait_for(reader.readexactly(1), 5.0)
                writer.close()
                assert d.node.counters()["refused_addresses"] == count
        friend = Client(10)
        friend = friend.connect_udp(host, port) if scheme == "udpin" else await friend.connect(port, host)
        friend.send(BEAT)
        await d.until(lambda: bool(d.got("HEARTBEAT", 10)))
        assert not d.got("HEARTBEAT", 20)
        await friend.close()
    assert sum("not one of allowed_peers" in record.getMessage() for record in caplog.records) == 1


@pytest.mark.parametrize("scheme", ["udpout", "udpin"])
async def test_host_with_addresses_of_both_kinds_is_used_by_its_ipv4_address(
    monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    """As localhost of Debian is: ground stations listen on IPv4, and send to it."""
    host, resolve = loopback(), socket.getaddrinfo

    def both(name: Any, port: Any, family: int = 0, *rest: Any, **options: Any) -> Any:
        if name != "station.test":
            return resolve(name, port, family, *rest, **options)
        families = {socket.AF_INET6: "::1", socket.AF_INET: host}
        return [
            found
            for kind, address in families.items()
            if family in (0, kind)
            for found in resolve(address, port, kind, *rest, **options)
        ]

    monkeypatch.setattr(socket, "getaddrinfo", both)
    client = await UdpClient(10).open(host)
    port = client.port if scheme == "udpout" else udp_port(host)
    async with bench(f"{scheme}://station.test:{port}") as d:
        if scheme == "udpout":
            d.node.send(BEAT, sysid=1, compid=1)
            await client.wait("HEARTBEAT", since=0)
        else:
            client.peer = (host, port)
            client.send(BEAT)
            await d.until(lambda: bool(d.got("HEARTBEAT", 10)))
    await client.close()


async def test_serial_line_connected_later_is_opened(tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    async with bench(f"serial://{device}:57600") as d:
        expected = f"serial://{device}:57600: not connected (No such file or directory), retrying"
        assert d.node.endpoints[0].describe() == expected
        async with pseudo_terminal() as (master, name):
            device.symlink_to(name)
            await d.until(lambda: len(d.node.channels) == 1, 10.0)
            client = SerialClient(master, 10)
            client.send(BEAT)
            await d.until(lambda: bool(d.got("HEARTBEAT", 10)))
            d.node.send(ATTITUDE, sysid=1, compid=1)
            await client.wait("ATTITUDE", since=0)
            await client.close()


async def test_station_that_is_switched_off_is_in_the_log_once(caplog: pytest.LogCaptureFixture) -> None:
    """The kernel reports it every three seconds, which loopback cannot show; another socket helps after a change."""
    host = loopback()
    client = await UdpClient(10).open(host)
    async with bench(f"udpout://{host}:{client.port}") as d:
        (endpoint,) = d.node.endpoints
        assert isinstance(endpoint, UdpOut)
        away = OSError(errno.EHOSTUNREACH, os.strerror(errno.EHOSTUNREACH))
        for _ in range(5):
            assert endpoint._transport is not None
            protocol = endpoint._transport.get_protocol()
            assert isinstance(protocol, asyncio.DatagramProtocol)
            protocol.error_received(away)
            assert endpoint.describe() == f"{endpoint.url}: {os.strerror(errno.EHOSTUNREACH)}, retrying"
            await d.until(lambda: not endpoint._problem, 10.0)
            await watched(3.0)  # "open again" may not be in the log
            d.node.send(BEAT, sysid=1, compid=1)
            await client.wait("HEARTBEAT")
        await d.until(lambda: f"{endpoint.url}: open again" in caplog.messages, 2 * HOLDS)
    await client.close()
    assert endpoint.counters["reopened"] == 5
    said = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert said == [f"{endpoint.url}: {os.strerror(errno.EHOSTUNREACH)}", f"{endpoint.url}: open again"]


@pytest.mark.parametrize("is_at_start", [True, False])
async def test_serial_line_that_vanishes_while_it_is_opened_is_opened_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_at_start: bool
) -> None:
    """termios then reports an error that is no OSError."""
    device, flush, failures = tmp_path / "ttyUSB0", termios.tcflush, [termios.error(errno.EIO, os.strerror(errno.EIO))]

    def tcflush(file: int, queue: int) -> None:
        if failures:
            raise failures.pop()
        flush(file, queue)

    monkeypatch.setattr(termios, "tcflush", tcflush)
    async with pseudo_terminal() as (_, name):
        if is_at_start:
            device.symlink_to(name)
        async with bench(f"serial://{device}:57600") as d:
            if not is_at_start:
                device.symlink_to(name)
            await d.until(lambda: not failures, 10.0)
            assert f"not connected ({os.strerror(errno.EIO)}), retrying" in d.node.endpoints[0].describe()
            await d.until(lambda: len(d.node.channels) == 1, 10.0)


async def test_a_failing_service_costs_no_connection() -> None:
    host = loopback()
    reported: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: reported.append(context))

    def fail(inbound: Inbound) -> None:
        raise RuntimeError("a mistake of ours")

    async with bench(f"tcpin://{host}:5760") as d:
        d.node.add_host(1, 1, fail)
        client = await Client().connect(5760, host)
        await d.until(lambda: len(d.node.channels) == 1)
        client.send(BEAT)
        await d.until(lambda: bool(reported))
        assert len(d.inbound) == 1  # the other hosts have got it
        d.node.remove_hosts(1)
        client.send(BEAT)
        await d.until(lambda: len(d.inbound) == 2)
        await client.close()
    assert [str(context["exception"]) for context in reported] == ["a mistake of ours"]


async def test_failed_start_leaves_nothing_open() -> None:
    host = loopback()
    with socket.create_server((host, 5761)):
        node = Node()
        with pytest.raises(ConfigError) as caught:
            await node.start([f"tcpin://{host}:5760", f"tcpin://{host}:5761"])
        assert str(caught.value) == f"endpoints[1]: cannot open tcpin://{host}:5761: Address already in use"
        assert node.endpoints == []
        with pytest.raises(ConfigError) as caught:
            await node.start([f"tcpin://{host}:5760", "tcpin://nobody"])
        assert caught.value.key_path == "endpoints[1]"
        socket.create_server((host, 5760)).close()


async def test_broadcast_address_is_refused_with_a_reason() -> None:
    with pytest.raises(ConfigError) as caught:
        await Node().start(["udpout://127.255.255.255:14550"])
    assert caught.value.key_path == "endpoints[0]"
    assert caught.value.problem.endswith("Permission denied: expected the address of one station, not of a broadcast")


async def test_broadcast_address_is_refused_before_there_is_a_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """As at boot: the kernel does not report the mistake then, and a start would wait for the network in vain."""

    async def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENETUNREACH, os.strerror(errno.ENETUNREACH))

    monkeypatch.setattr(asyncio.get_running_loop(), "create_datagram_endpoint", fail)
    with pytest.raises(ConfigError, match="Network is unreachable: expected the address of one station"):
        await Node().start(["udpout://255.255.255.255:14550"])


async def test_broadcast_address_of_a_network_that_comes_later_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = iter([OSError(errno.ENETUNREACH, "unreachable")])

    async def fail(*_: object, **__: object) -> None:
        raise next(errors, PermissionError(errno.EACCES, "denied"))

    monkeypatch.setattr(asyncio.get_running_loop(), "create_datagram_endpoint", fail)
    async with bench("udpout://192.0.2.255:14550") as d:
        (endpoint,) = d.node.endpoints
        assert "Network is unreachable, retrying" in endpoint.describe()
        await d.until(lambda: "expected the address of one station" in endpoint.describe())


async def test_listening_on_a_kind_of_address_that_the_system_lacks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with ipv6.disable=1 of Linux: asyncio would make a server without a socket."""
    make = socket.socket

    def without_ipv6(family: int = -1, *more: int) -> socket.socket:
        if family == socket.AF_INET6:
            raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))
        return make(family, *more)

    monkeypatch.setattr(socket, "socket", without_ipv6)
    of_python_3_13 = "could not bind on any address"
    reason = f"cannot open tcpin://\\[::1\\]:5760: (Address family not supported|{of_python_3_13})"
    with pytest.raises(ConfigError, match=reason):
        await Node().start(["tcpin://[::1]:5760"])


async def test_closing_ends_every_connection_and_frees_the_port() -> None:
    host = loopback()
    async with bench(f"tcpin://{host}:5760") as d:
        reader, writer = await asyncio.open_connection(host, 5760)
        await d.until(lambda: len(d.node.channels) == 1)
        (channel,) = d.node.channels
    with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
        await asyncio.wait_for(reader.readexactly(1), 5.0)
    writer.close()
    assert d.node.channels == []
    channel.send(ATTITUDE, 1, 1)
    assert channel.counters["dropped_frames"] == 1
    socket.create_server((host, 5760)).close()


@pytest.mark.parametrize(
    ("query", "most", "limit"),
    [
        ("", 40, 512),
        ("?frames=one", 40, 512),
        ("?frames=many", 4, 512),
        ("?frames=many&datagram_bytes=1400", 1, 1400),
    ],
)
@pytest.mark.parametrize("scheme", ["udpout", "udpin"])
async def test_frames_of_one_iteration_leave_in_configured_datagrams(
    scheme: str, query: str, most: int, limit: int
) -> None:
    """One frame per datagram, or as many as the limit allows. Nothing waits for the next iteration."""
    host = loopback()
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.setblocking(False)
        client.bind((host, 0))
        port = client.getsockname()[1] if scheme == "udpout" else udp_port(host)
        async with bench(f"{scheme}://{host}:{port}{query}") as d:
            if scheme == "udpin":
                await loop.sock_connect(client, (host, port))
                await loop.sock_sendall(client, BEAT.pack(stock.MAVLink(None, 255, 190)))
                await d.until(lambda: bool(d.node.channels))
            parser = stock.MAVLink(None)
            for first in (0, 40):
                for number in range(first, first + 40):
                    d.node.send(ATTITUDE if number % 2 else PING_OF[number % 256], sysid=7, compid=1)
                sequence: list[int] = []
                sizes: list[int] = []
                while len(sequence) < 40:
                    data = await asyncio.wait_for(loop.sock_recv(client, 2048), 2.0)
                    sizes.append(len(data))
                    sequence += [message.get_seq() for message in parser.parse_buffer(data)]
                assert sequence == list(range(first, first + 40))
                assert max(sizes) <= limit
                assert len(sizes) == 40 if most == 40 else len(sizes) <= most  # of 40 frames with 40 and 26 bytes
            d.node.send(ATTITUDE, sysid=7, compid=1)
            data = await asyncio.wait_for(loop.sock_recv(client, 2048), 2.0)
            assert len(data) == 12 + 28


PING_OF = [dialect.MAVLink_ping_message(number, number, 1, 1) for number in range(256)]


async def test_the_last_words_leave_before_a_socket_closes() -> None:
    host = loopback()
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.setblocking(False)
        client.bind((host, 0))
        async with bench(f"udpout://{host}:{client.getsockname()[1]}", f"tcpin://{host}:5760") as d:
            stream = await Client().connect(5760, host)
            await d.until(lambda: len(d.node.channels) == 2)
            d.node.send(ATTITUDE, sysid=7, compid=1)
        assert len(await asyncio.wait_for(loop.sock_recv(client, 2048), 2.0)) == 12 + 28
        await stream.wait("ATTITUDE", since=0)
        await stream.close()
