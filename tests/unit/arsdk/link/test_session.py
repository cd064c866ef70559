"""Controller and device over real sockets on the loopback."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from support.clock import Loop

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link import handshake
from anafi_mav.arsdk.link.controller import ControllerSession, connect
from anafi_mav.arsdk.link.device import MAX_CONNECTIONS, DeviceServer, DeviceSession
from anafi_mav.arsdk.link.frame import FrameType, encode_frame
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.link.session import OnMessage
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.errors import LinkLost, LocalProtocolError, RemoteProtocolError

HOST = "127.0.0.1"
INFO = DeviceInfo(0x0914, "PI040416DA9H000001", 0, "ANAFI-H000001")
HOVERING = ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING)
STICKS = ardrone3.PCMD(1, 0, 50, 0, -20, 0)


class Heard:
    """Receiver of messages that a test can wait on."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[Message | UnknownMessage] = asyncio.Queue()

    def __call__(self, message: Message | UnknownMessage, now: float) -> None:
        self.queue.put_nowait(message)

    async def next(self) -> Message | UnknownMessage:
        return await asyncio.wait_for(self.queue.get(), 3)


class Drone:
    """A device that records what it gets and answers AllStates."""

    def __init__(self) -> None:
        self.sessions: list[DeviceSession] = []
        self.heard = Heard()

    def on_session(self, session: DeviceSession) -> OnMessage:
        self.sessions.append(session)

        def on_message(message: Message | UnknownMessage, now: float) -> None:
            self.heard(message, now)
            if isinstance(message, common.AllStates):
                session.send(HOVERING)
                session.send(ardrone3.AltitudeChanged(1.5))
                session.send(common.AllStatesChanged())

        return on_message


@contextlib.asynccontextmanager
async def flying(**options: Any) -> AsyncIterator[tuple[Drone, DeviceServer]]:
    drone = Drone()
    ports = {"discovery_port": 0, "handshake_port": 0, "c2d_port": 0}
    server = await DeviceServer.start(HOST, info=INFO, on_session=drone.on_session, **(ports | options))
    try:
        yield drone, server
    finally:
        await server.close()


async def join(server: DeviceServer, on_message: OnMessage | None = None, **options: Any) -> ControllerSession:
    return await connect(HOST, discovery_port=server.discovery_port, on_message=on_message or Heard(), **options)


async def reason(session: ControllerSession | DeviceSession) -> str:
    return await asyncio.wait_for(asyncio.shield(session.lost), 3)


@pytest.mark.parametrize("version", [1, 2, 3])
async def test_messages_go_both_ways(version: int) -> None:
    heard = Heard()
    async with flying() as (drone, server):
        session = await join(server, heard, versions=(version, version))
        assert session.version == version
        assert session.device == server.info
        assert drone.sessions[0].request.controller_name == "anafi-mav"
        session.send(common.AllStates())
        session.send(STICKS)
        commands = [await drone.heard.next() for _ in range(2)]
        assert common.AllStates() in commands
        assert STICKS in commands
        answers = [await heard.next() for _ in range(3)]
        assert ardrone3.AltitudeChanged(1.5) in answers
        acknowledged = [answer for answer in answers if not isinstance(answer, ardrone3.AltitudeChanged)]
        assert acknowledged == [HOVERING, common.AllStatesChanged()]
        await session.close()
        await session.close()
        assert await reason(session) == "closed"


@pytest.mark.parametrize(("theirs", "ours", "version"), [((1, 3), (1, 3), 3), ((1, 1), (1, 3), 1), ((2, 3), (1, 2), 2)])
async def test_the_highest_common_version_is_spoken(
    theirs: tuple[int, int], ours: tuple[int, int], version: int
) -> None:
    async with flying(versions=theirs) as (drone, server):
        session = await join(server, versions=ours)
        assert (session.version, drone.sessions[0].version) == (version, version)
        await session.close()


async def test_no_common_version_is_a_refusal() -> None:
    async with flying(versions=(1, 2)) as (drone, server):
        with pytest.raises(LinkLost, match=r"refused the connection \(status -1\)"):
            await join(server, versions=(3, 3))
        assert drone.sessions == []


async def test_connect_without_a_drone_raises_link_lost() -> None:
    with socket.socket() as closed:
        closed.bind((HOST, 0))
        with pytest.raises(LinkLost, match=r"cannot connect to 127\.0\.0\.1:\d+: Connection refused"):
            await connect(HOST, discovery_port=closed.getsockname()[1], on_message=Heard())


async def test_our_own_wrong_versions_raise() -> None:
    with pytest.raises(LocalProtocolError):
        await connect(HOST, versions=(3, 4), on_message=Heard())


@contextlib.asynccontextmanager
async def answering(text: bytes | None) -> AsyncIterator[int]:
    """A TCP port that sends this to every client; None: nothing, and hangs up."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if text is not None:
            writer.write(text)
            await reader.read()
        writer.close()

    server = await asyncio.start_server(answer, HOST, 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        await server.wait_closed()


async def test_peer_of_another_protocol_raises_remote_error() -> None:
    async with answering(b"220 ftp.example.org ready\r\n\0") as port:
        with pytest.raises(RemoteProtocolError, match="unreadable discovery: b'220 ftp"):
            await connect(HOST, discovery_port=port, on_message=Heard())


async def test_silent_drone_is_a_lost_link() -> None:
    async with answering(b"") as port:
        with pytest.raises(LinkLost, match=r"no answer from 127\.0\.0\.1 within 0\.2 s"):
            await connect(HOST, discovery_port=port, on_message=Heard(), timeout=0.2)
    async with answering(None) as port:
        with pytest.raises(LinkLost, match="closed the connection without a complete answer"):
            await connect(HOST, discovery_port=port, on_message=Heard())


async def test_version_not_offered_raises_remote_error() -> None:
    reply = handshake.format_reply(handshake.ConnectReply(0, 2233, 0, 3))
    async with flying() as (_, server), answering(reply) as port:
        with pytest.raises(RemoteProtocolError, match="chose protocol version 3, offered were 1 to 2"):
            await join(server, handshake_port=port, versions=(1, 2))


async def raw_handshake(server: DeviceServer, *pieces: bytes) -> dict[str, Any]:
    reader, writer = await asyncio.open_connection(HOST, server.handshake_port)
    for piece in pieces:
        writer.write(piece)
        await writer.drain()
        await asyncio.sleep(0)
    answer = await asyncio.wait_for(reader.read(), 3)
    writer.close()
    result = json.loads(answer)
    assert isinstance(result, dict)
    return result


async def test_a_request_may_arrive_in_pieces() -> None:
    request = b'{ "controller_name": "olympe", "controller_type": "desktop", "d2c_port": 9988, "proto_v_max": 3 }'
    async with flying() as (drone, server):
        answer = await raw_handshake(server, *[request[i : i + 7] for i in range(0, len(request), 7)])
        assert answer == {"status": 0, "c2d_port": answer["c2d_port"], "qos_mode": 0, "proto_v": 3}
        assert drone.sessions[0].request.controller_name == "olympe"


@pytest.mark.parametrize(
    "request_text",
    [
        b'{"d2c_port": 9988, "device_id": "PI040416DA9H999999"}',  # another drone is wanted
        b'{"d2c_port": 0}',
        b'{"controller_name": "x"}',
        b"hello\0",
    ],
)
async def test_wrong_requests_are_refused(request_text: bytes) -> None:
    async with flying() as (drone, server):
        assert (await raw_handshake(server, request_text))["status"] == handshake.REJECTED
        assert drone.sessions == []


async def test_connections_are_bounded() -> None:
    async with flying() as (_, server):
        kept = [await asyncio.open_connection(HOST, server.discovery_port) for _ in range(MAX_CONNECTIONS)]
        for reader, _ in kept:
            await asyncio.wait_for(reader.readuntil(b"\0"), 3)
        reader, writer = await asyncio.open_connection(HOST, server.discovery_port)
        assert await asyncio.wait_for(reader.read(), 3) == b""
        for _, other in [*kept, (reader, writer)]:
            other.close()


async def test_the_newest_handshake_wins() -> None:
    async with flying() as (drone, server):
        first = await join(server, ping_after=0.05)
        heard = Heard()
        second = await join(server, heard)
        assert await reason(drone.sessions[0]) == "another controller connected"
        # its datagrams are not taken for the second one's
        first.send(ardrone3.Emergency())
        second.send(common.AllStates())
        assert await drone.heard.next() == common.AllStates()
        assert [type(await heard.next()) for _ in range(3)].count(common.AllStatesChanged) == 1
        assert "unanswered" in await reason(first) or "closed" in await reason(first)
        assert drone.heard.queue.empty()
        assert not second.lost.done()
        await first.close()
        await second.close()


async def test_drone_disconnecting_closes_the_session() -> None:
    async with flying() as (_, server):
        session = await join(server)
        await server.close()
        assert await reason(session) == "the drone closed the connection"
        await session.close()


async def test_a_closed_udp_port_ends_the_session_at_once() -> None:
    async with flying() as (drone, server):
        session = await join(server, ping_after=30.0, silence_limit=None)
        await drone.sessions[0].close()
        session.send(STICKS)
        assert await reason(session) == "the drone's UDP port is closed"
        await session.close()


async def test_silent_drone_is_lost_and_resumes_when_heard() -> None:
    async with flying(ping_after=0.05) as (drone, server):
        session = await join(server, ping_after=0.05, silence_limit=0.12)
        await asyncio.sleep(0.3)  # pings keep both ends alive: there is no event to wait for
        assert not session.lost.done()
        assert not drone.sessions[0].lost.done()
        server.mute = True
        session.send(ardrone3.Emergency())
        assert re.match(r"nothing received for 0\.\d s", await reason(session))
        assert (await reason(drone.sessions[0])).startswith("3 pings unanswered")
        with pytest.raises(LinkLost, match="no answer"):
            await join(server, timeout=0.1)
        server.mute = False
        again = await join(server)
        again.send(common.AllStates())
        # nothing of before the loss is sent again
        assert await drone.heard.next() == common.AllStates()
        await session.close()
        await again.close()


async def test_datagrams_that_wait_are_no_silence() -> None:
    """With 250 drones the loop runs a timer before it has read every socket."""
    async with flying() as (_, server):
        session = await join(server, ping_after=0.05, silence_limit=0.12)
        never_read(session)
        await asyncio.sleep(0.5)  # long enough for a loss
        assert not session.lost.done()
        await session.close()


def never_read(session: ControllerSession) -> None:
    """Let the event loop not look at the session's socket."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, Loop)
    for fd in tuple(loop.waits.get_map()):
        with socket.socket(fileno=os.dup(fd)) as same:
            if same.type == socket.SOCK_DGRAM and same.getsockname() == session.address:
                loop.waits.unregister(fd)


async def test_timer_that_is_too_early_reads_no_socket() -> None:
    """What was heard has put the deadline off. The event loop reads the socket when it is its turn."""
    heard = Heard()
    async with flying() as (drone, server):
        session = await join(server, heard, ping_after=0.5)
        loop, send = asyncio.get_running_loop(), drone.sessions[0].send
        loop.call_later(0.3, send, ardrone3.AltitudeChanged(1.0))
        assert await heard.next() == ardrone3.AltitudeChanged(1.0)
        began = loop.time()
        never_read(session)
        send(ardrone3.AltitudeChanged(2.0))
        assert await heard.next() == ardrone3.AltitudeChanged(2.0)  # read before the ping
        assert loop.time() - began >= 0.49  # the first timer is due after 0.2 s, the ping after 0.5 s
        await session.close()


async def test_datagrams_that_wait_are_not_read_one_in_each_iteration() -> None:
    """A busy computer has long iterations: an acknowledgement must not wait for one of each datagram before it."""
    async with flying() as (drone, server):
        session = await join(server)
        gives: list[Callable[[bytes], None]] = []
        drone.sessions[0].air = lambda data, came_in, give: gives.append(give)
        drone.sessions[0].send(HOVERING)
        while not gives:  # noqa: ASYNC110
            await asyncio.sleep(0)
        for number in range(40):
            gives[0](encode_frame(session.version, FrameType.NOACK, 5, number, b""))
        iterations = 0
        while session.counters["garbage.queue"] < 40:
            await asyncio.sleep(0)
            iterations += 1
        assert iterations <= 20  # more than 40 with one datagram in each
        await session.close()


async def test_others_are_not_heard() -> None:
    heard = Heard()
    async with flying() as (drone, server):
        session = await join(server, heard)
        frame = bytes.fromhex("0d 04 0b 0000 05 04 01 00 0400")  # Emergency
        event = bytes.fromhex("0d 04 7e 0000 09 08 01 04 0100 02000000")
        loop = asyncio.get_running_loop()
        stranger, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=(HOST, 0))
        stranger.sendto(frame, drone.sessions[0].address)
        stranger.sendto(event, session.address)
        session.send(common.AllStates())
        assert await drone.heard.next() == common.AllStates()
        assert await heard.next() in (HOVERING, ardrone3.AltitudeChanged(1.5))
        assert drone.heard.queue.empty()
        assert drone.sessions[0].counters["foreign"] == 1
        stranger.close()
        await session.close()


async def test_a_failing_receiver_costs_no_other_message() -> None:
    failures: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: failures.append(context))
    heard = Heard()

    def on_message(message: Message | UnknownMessage, now: float) -> None:
        if message == HOVERING:
            raise ValueError("a bug of ours")
        heard(message, now)

    async with flying() as (drone, server):
        session = await join(server, on_message)
        drone.sessions[0].send(HOVERING)
        drone.sessions[0].send(common.AllStatesChanged())
        assert await heard.next() == common.AllStatesChanged()
        assert [str(failure["exception"]) for failure in failures] == ["a bug of ours"]
        assert "FlyingStateChanged" in failures[0]["message"]
        await session.close()


async def test_a_message_cancelled_in_the_same_turn_never_leaves() -> None:
    async with flying() as (drone, server):
        session = await join(server)
        session.cancel(session.send(ardrone3.TakeOff()))
        session.send(ardrone3.Landing())
        assert await drone.heard.next() == ardrone3.Landing()
        await session.close()


async def test_messages_sent_before_close_leave() -> None:
    async with flying() as (drone, server):
        session = await join(server)
        session.send(STICKS)
        await session.close()
        assert await drone.heard.next() == STICKS
        session.send(STICKS)
        session.cancel(1)
        await asyncio.sleep(0.05)  # nothing may come: there is no event to wait for
        assert drone.heard.queue.empty()


async def test_our_own_wrong_arguments_raise() -> None:
    async with flying() as (_, server):
        session = await join(server)
        with pytest.raises(LocalProtocolError, match="PCMD"):
            session.send(ardrone3.PCMD(1, 200, 0, 0, 0, 0))
        await session.close()


async def test_busy_session_rarely_sets_its_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = Heard()
    async with flying() as (drone, server):
        session = await join(server, heard)
        loop = asyncio.get_running_loop()
        armed = 0
        call_at: Callable[..., asyncio.TimerHandle] = loop.call_at

        def counting(when: float, callback: Callable[..., object], *args: object, **options: Any) -> Any:
            nonlocal armed
            armed += getattr(callback, "__func__", None) is type(session)._expire
            return call_at(when, callback, *args, **options)

        monkeypatch.setattr(loop, "call_at", counting)
        for count in range(500):
            drone.sessions[0].send(ardrone3.AltitudeChanged(float(count)))
            assert await heard.next() == ardrone3.AltitudeChanged(float(count))
        assert armed < 20
        await session.close()


async def test_ports_are_free_after_close() -> None:
    async with flying() as (drone, server):
        session = await join(server)
        _, c2d_port = drone.sessions[0].address
        await server.close()
        await server.close()
        again = await DeviceServer.start(
            HOST,
            discovery_port=server.discovery_port,
            handshake_port=server.handshake_port,
            c2d_port=c2d_port,
            info=INFO,
            on_session=drone.on_session,
        )
        second = await join(again)
        assert drone.sessions[1].address == (HOST, c2d_port)
        await second.close()
        await session.close()
        await again.close()


async def test_a_taken_udp_port_is_a_refusal() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HOST, 0))
        async with flying(c2d_port=taken.getsockname()[1]) as (_, server):
            with pytest.raises(LinkLost, match="refused"):
                await join(server)
            assert server.session is None


async def test_a_taken_port_raises() -> None:
    async with flying() as (_, server):
        with pytest.raises(OSError, match="address already in use"):
            await DeviceServer.start(
                HOST,
                discovery_port=server.discovery_port,
                handshake_port=0,
                info=INFO,
                on_session=Drone().on_session,
            )


async def test_calls_after_a_read_follow_all_its_messages() -> None:
    """Both reports of the height travel in one datagram."""
    order: list[str] = []
    async with flying() as (drone, server):
        session = await join(server)
        arrived = asyncio.get_running_loop().create_future()

        def on_message(message: Message | UnknownMessage, now: float) -> None:
            if isinstance(message, ardrone3.AltitudeChanged):
                order.append(f"height {message.altitude:g}")
                if message.altitude == 1.0:
                    session.after_read(lambda: order.append("failing") or 1 / 0)  # type: ignore[func-returns-value]
                    session.after_read(lambda: order.append("after"))
                else:
                    asyncio.get_running_loop().call_soon(arrived.set_result, None)

        session.on_message = on_message
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: order.append("reported"))
        drone.sessions[0].send(ardrone3.AltitudeChanged(1.0))
        drone.sessions[0].send(ardrone3.AltitudeChanged(2.0))
        await asyncio.wait_for(arrived, 3)
        asyncio.get_running_loop().set_exception_handler(None)
        assert order == ["height 1", "height 2", "failing", "reported", "after"]
        await session.close()


async def test_call_after_a_read_is_soon_while_nothing_is_read() -> None:
    called: list[bool] = []
    async with flying() as (_, server):
        session = await join(server)
        session.after_read(lambda: called.append(True))
        assert called == []
        await asyncio.sleep(0)
        assert called == [True]
        await session.close()
