"""The relay on real sockets, before a video server of ours that does what a test commands."""

from __future__ import annotations

import asyncio
import contextlib
import resource
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from socket import SO_RCVBUF, SOL_SOCKET

import pytest
from support.own_address import own_address
from support.rtsp_client import LIMIT, Viewer, viewer
from support.scripted_device import ScriptedDevice
from support.video_server import KEY, PPS, SLICE, SPS, VideoServer, refused

from anafi_mav.access_token import AccessToken
from anafi_mav.arsdk.video import rtcp
from anafi_mav.arsdk.video.rtcp import Goodbye, SenderReport
from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.drone.video.video import STALE
from anafi_mav.errors import ConfigError
from anafi_mav.relay import server as server_module
from anafi_mav.relay import source as source_module
from anafi_mav.relay.server import RelayServer
from anafi_mav.relay.source import DroneSource

LIVE = "1/visible"


@dataclass
class Studio:
    relay: RelayServer
    server: VideoServer
    drone: Drone


@asynccontextmanager
async def studio(
    server: VideoServer | None = None, host: str = "127.0.0.1", token: AccessToken | None = None
) -> AsyncIterator[Studio]:
    """A connected drone with its own video server, and the relay."""
    async with AsyncExitStack() as stack:
        server = await stack.enter_async_context(server or VideoServer())
        device = await stack.enter_async_context(ScriptedDevice())
        drone = device.drone(rtsp_port=server.port)
        await drone.connect()
        stack.push_async_callback(drone.close)
        relay = RelayServer(host, 0, SystemClock())
        relay.token = token
        relay.add(DroneSource(1, "alpha", drone))
        await relay.start()
        stack.push_async_callback(relay.close)
        yield Studio(relay, server, drone)


def port_of(client: Viewer) -> str:
    return f":{client.writer.get_extra_info('sockname')[1]}"


async def setup(client: Viewer, transport: str) -> object:
    return await (client.setup_inside if transport == "TCP" else client.setup)(f"{LIVE}/video")


@pytest.mark.parametrize("transport", ["UDP", "TCP"])
async def test_viewer_sees_the_drones_pictures(transport: str) -> None:
    async with studio() as held, viewer(held.relay.port) as client:
        description = await client.describe(LIVE)
        (media,) = description.media
        assert (description.name, media.control, media.sps, media.pps) == ("alpha", "video", SPS, PPS)
        eye = await (client.setup_inside if transport == "TCP" else client.setup)(f"{LIVE}/video")
        answer = await client.play(LIVE)
        pictures = await eye.first(35)
        assert pictures[0].units == (SPS, PPS, KEY)
        assert {picture.units for picture in pictures} == {(SPS, PPS, KEY), (SLICE,)}
        assert all(picture.complete for picture in pictures)
        first = f"seq={eye.sequences[0]};rtptime={pictures[0].timestamp}"
        assert (answer.header("RTP-Info") or "").endswith(first)
        await eye.until(lambda: any(isinstance(one, SenderReport) for one in eye.reports))
        assert (await client.ask("TEARDOWN", LIVE)).status == 200
        assert held.relay.viewers == 0
        assert held.server.playing == 1  # it lingers


async def test_drone_has_one_session_for_all_viewers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source_module, "LINGER", 0.2)
    async with studio() as held:
        async with AsyncExitStack() as stack:
            eyes = []
            for path in ("1/visible", "alpha/visible", "1/visible"):
                client = await stack.enter_async_context(viewer(held.relay.port))
                await client.describe(path)
                eyes.append(await client.setup(f"{path}/video"))
                await client.play(path)
            for eye in eyes:
                (first, *_) = await eye.first(3)
                assert first.is_key
            assert held.relay.viewers == 3
            assert held.server.methods().count("PLAY") == 1
        # All have hung up: the session at the drone ends.
        await held.server.until(lambda: held.server.methods()[-1] == "TEARDOWN")
        assert held.relay.viewers == 0
        async with viewer(held.relay.port) as client:  # and begins for the next one
            await client.describe(LIVE)
        assert held.server.methods().count("PLAY") == 2


async def test_two_drones_with_one_address_are_distinguished() -> None:
    async with studio() as held, AsyncExitStack() as stack:
        server = await stack.enter_async_context(VideoServer())
        device = await stack.enter_async_context(ScriptedDevice())
        drone = device.drone(rtsp_port=server.port)
        await drone.connect()
        stack.push_async_callback(drone.close)
        assert drone.address == held.drone.address
        held.relay.add(DroneSource(2, "bravo", drone))
        for path, one, other in (("2/visible", server, held.server), ("1/visible", held.server, server)):
            client = await stack.enter_async_context(viewer(held.relay.port))
            played = other.methods().count("PLAY")
            assert (await client.describe(path)).name == ("bravo" if one is server else "alpha")
            eye = await client.setup(f"{path}/video")
            await client.play(path)
            await eye.first(3)
            assert one.methods().count("PLAY") == 1
            assert other.methods().count("PLAY") == played


async def test_new_viewer_gets_pictures_since_the_last_key_at_once() -> None:
    async with studio() as held, viewer(held.relay.port) as first, viewer(held.relay.port) as second:
        await first.describe(LIVE)
        eye = await first.setup(f"{LIVE}/video")
        await first.play(LIVE)
        await eye.first(10)
        held.server.quiet = True  # no picture follows: what the second one sees was kept
        other = await second.setup_inside(f"{LIVE}/video")
        await second.play(LIVE)
        kept = await other.first(10)
        assert kept[0].units == (SPS, PPS, KEY)
        assert kept[-1].timestamp - kept[0].timestamp == (len(kept) - 1) * 90


async def test_new_viewer_gets_no_old_pictures_while_the_video_pauses() -> None:
    """What was kept before the pause would look live."""
    async with studio() as held, viewer(held.relay.port) as first, viewer(held.relay.port) as second:
        await first.describe(LIVE)
        eye = await first.setup(f"{LIVE}/video")
        await first.play(LIVE)
        await eye.first(10)
        held.server.quiet = True
        await asyncio.sleep(STALE + 0.1)  # of silence
        other = await second.setup_inside(f"{LIVE}/video")
        answer = await second.ask("PLAY", LIVE)
        assert answer.status == 503
        assert "a picture" in answer.reason
        assert not other.pictures
        held.server.quiet = False
        await second.play(LIVE)
        await other.first(3)


async def test_slow_viewer_does_not_delay_others(monkeypatch: pytest.MonkeyPatch) -> None:
    big = SLICE[:1] + bytes(60_000)
    monkeypatch.setattr("support.video_server.SLICE", big)
    async with studio() as held, viewer(held.relay.port) as slow, viewer(held.relay.port) as quick:
        await slow.describe(LIVE)
        response = await slow.ask("SETUP", f"{LIVE}/video", Transport="RTP/AVP/TCP;interleaved=0-1")
        slow.session = (response.header("Session") or "").partition(";")[0]
        slow.writer.transport.pause_reading()  # it reads nothing any more
        slow.writer.write(f"PLAY {slow.base}{LIVE} RTSP/1.0\r\nCSeq: 9\r\nSession: {slow.session}\r\n\r\n".encode())
        eye = await quick.setup_inside(f"{LIVE}/video")
        await quick.play(LIVE)
        pictures = await eye.first(150)
        assert all(picture.complete for picture in pictures[1:])
        steps = {b - a for a, b in zip(eye.sequences, eye.sequences[1:], strict=False)}
        assert steps <= {1, -65535}
        (one,) = [c for c in held.relay._connections.values() if c._watch and c._watch.counts["dropped pictures"]]
        assert one._outlet is not None
        assert one._outlet.waiting < server_module.MAX_UNREAD + (2 << 20)


async def test_slow_viewer_inside_its_connection_gets_no_old_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 5 Mbit/s its newest picture is 3 s old at most, whatever the system would keep for a connection."""
    monkeypatch.setattr("support.video_server.SLICE", SLICE[:1] + bytes(60_000))
    async with studio() as held, viewer(held.relay.port) as slow, viewer(held.relay.port) as quick:
        socket = slow.writer.get_extra_info("socket")
        socket.setsockopt(SOL_SOCKET, SO_RCVBUF, 1 << 14)
        await slow.describe(LIVE)
        response = await slow.ask("SETUP", f"{LIVE}/video", Transport="RTP/AVP/TCP;interleaved=0-1")
        session = (response.header("Session") or "").partition(";")[0]
        slow.writer.transport.pause_reading()  # it reads nothing any more
        slow.writer.write(f"PLAY {slow.base}{LIVE} RTSP/1.0\r\nCSeq: 9\r\nSession: {session}\r\n\r\n".encode())
        eye = await quick.setup_inside(f"{LIVE}/video")
        await quick.play(LIVE)
        await eye.first(150)  # 9 MB
        (watch,) = [c._watch for c in held.relay._connections.values() if c._watch and c._name.endswith(port_of(slow))]
        assert watch.octets < 3.0 * 5e6 / 8


async def test_video_that_does_not_start_is_refused_with_the_reason() -> None:
    server = VideoServer()
    server.answers["DESCRIBE"] = refused("454 Session Not Found")
    async with studio(server) as held, viewer(held.relay.port) as client:
        answer = await client.ask("DESCRIBE", LIVE)
        assert answer.status == 503
        assert "454" in answer.reason
        await held.drone.close()
        answer = await client.ask("DESCRIBE", LIVE)
        assert (answer.status, answer.reason) == (503, "alpha is not connected")


async def test_unknown_streams_are_not_found() -> None:
    async with studio() as held, viewer(held.relay.port) as client:
        for path in ("1/thermal", "2/visible", "1", "1/visible/extra", "visible", ""):
            assert (await client.ask("DESCRIBE", path)).status == 404
        assert (await client.ask("SETUP", "1/thermal", Transport="RTP/AVP/TCP")).status == 404
        assert held.server.methods() == []


async def test_viewers_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "MAX_VIEWERS", 1)
    monkeypatch.setattr(server_module, "MAX_CONNECTIONS", 3)
    async with studio() as held, viewer(held.relay.port) as one, viewer(held.relay.port) as two:
        await one.describe(LIVE)
        await one.setup(f"{LIVE}/video")
        answer = await two.ask("SETUP", f"{LIVE}/video", Transport="RTP/AVP/TCP")
        assert (answer.status, answer.reason) == (453, "too many viewers")
        await one.setup(f"{LIVE}/video")  # its own place is free for it
        async with viewer(held.relay.port) as three, viewer(held.relay.port) as four:
            assert (await three.ask("OPTIONS", LIVE)).status == 200
            assert await asyncio.wait_for(four.reader.read(), LIMIT) == b""


async def test_silent_viewer_of_datagrams_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "SESSION_TIMEOUT", 1.5)
    monkeypatch.setattr(server_module, "TICK", 0.2)
    async with studio() as held, viewer(held.relay.port) as silent, viewer(held.relay.port) as reports:
        eyes = []
        for client in (silent, reports):
            await client.describe(LIVE)
            eyes.append(await client.setup(f"{LIVE}/video"))
            await client.play(LIVE)

        async def keep_reporting() -> None:
            transport = list(held.relay._connections.values())[1]._outlet
            assert transport is not None
            ports = transport.transport.server_ports
            assert ports is not None
            while True:
                data = rtcp.encode_receiver_report(rtcp.ReceiverReport(7), "viewer")
                eyes[1].report(data, ports[1])
                await asyncio.sleep(0.3)

        task = asyncio.create_task(keep_reporting())
        await eyes[0].until(lambda: any(isinstance(one, Goodbye) for one in eyes[0].reports))
        assert await asyncio.wait_for(silent.reader.read(), LIMIT) == b""
        await eyes[1].look(60)
        task.cancel()


async def test_port_in_use_is_named() -> None:
    async with studio() as held:
        with pytest.raises(ConfigError) as caught:
            await RelayServer("127.0.0.1", held.relay.port, SystemClock()).start()
        assert caught.value.key_path == "video.rtsp_port"
        assert str(held.relay.port) in caught.value.problem
        with pytest.raises(ConfigError) as caught:
            await RelayServer("192.0.2.1", 0, SystemClock()).start()
        assert caught.value.key_path == "video.host"


async def test_garbage_of_a_viewer_ends_its_connection_only() -> None:
    async with studio() as held, viewer(held.relay.port) as client, viewer(held.relay.port) as other:
        await client.describe(LIVE)
        eye = await client.setup_inside(f"{LIVE}/video")
        await client.play(LIVE)
        client.writer.write(b"$\x01\x00\x04\xff\xff\xff\xff$\x07\x00\x00")  # reports that are none
        await eye.look(3)
        other.writer.write(b"\x16\x03\x01\x00\r\n\r\n")
        assert (await asyncio.wait_for(other.reader.read(), LIMIT)).startswith(b"RTSP/1.0 400 ")
        await eye.look(3)


async def test_web_page_in_a_browser_gets_no_picture() -> None:
    """A page of any web site can make a browser send this: a body of RTSP, with a description that it could read."""
    async with studio() as held, viewer(held.relay.port) as client:
        body = f"DESCRIBE {client.base}{LIVE} RTSP/1.0\r\nCSeq: 1\r\n\r\n".encode()
        head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{held.relay.port}\r\nContent-Length: {len(body)}\r\n\r\n"
        client.writer.write(head.encode() + body)
        answer = await asyncio.wait_for(client.reader.read(), LIMIT)
        assert answer.startswith(b"RTSP/1.0 505 ")  # which is no HTTP: the page cannot read it
        assert b"v=0" not in answer


@pytest.mark.parametrize("transport", ["UDP", "TCP"])
async def test_playing_viewer_that_reads_no_responses_is_aborted(
    transport: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server_module, "MAX_REQUESTS", 1 << 30)
    async with studio() as held, viewer(held.relay.port) as client:
        await client.describe(LIVE)
        await setup(client, transport)
        await client.play(LIVE)
        transport_of = client.writer.transport
        assert isinstance(transport_of, asyncio.Transport)
        transport_of.pause_reading()
        request = f"OPTIONS {client.base}{LIVE} RTSP/1.0\r\nCSeq: 9\r\nSession: {client.session}\r\n\r\n".encode()

        async def flood() -> None:
            while True:
                client.writer.write(request * 500)
                await client.writer.drain()

        with pytest.raises(ConnectionError):
            await asyncio.wait_for(flood(), 6 * LIMIT)
        assert held.relay.viewers == 0


async def test_viewer_that_stops_reading_frees_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """A suspended player keeps its connection alive and takes no picture."""
    monkeypatch.setattr("support.video_server.SLICE", SLICE[:1] + bytes(60_000))
    monkeypatch.setattr(server_module, "STUCK", 1.0)
    async with studio() as held, viewer(held.relay.port) as stuck:
        await stuck.describe(LIVE)
        response = await stuck.ask("SETUP", f"{LIVE}/video", Transport="RTP/AVP/TCP;interleaved=0-1")
        session = response.header("Session") or ""
        stuck.writer.transport.pause_reading()
        stuck.writer.write(f"PLAY {stuck.base}{LIVE} RTSP/1.0\r\nCSeq: 9\r\nSession: {session}\r\n\r\n".encode())
        (connection,) = held.relay._connections
        await asyncio.wait({connection}, timeout=6 * LIMIT)
        assert not held.relay._connections


async def test_set_up_without_room_for_sockets_keeps_the_former_transport() -> None:
    async with studio() as held, viewer(held.relay.port) as client:
        await client.describe(LIVE)
        eye = await client.setup(f"{LIVE}/video")
        limits = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
        try:
            answer = await client.ask("SETUP", f"{LIVE}/video", Transport="RTP/AVP;unicast;client_port=5004-5005")
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, limits)
        assert answer.status == 500
        await client.play(LIVE)
        await eye.first(3)


async def test_viewer_with_too_many_requests_is_aborted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "TICK", 3600.0)
    async with studio() as held, viewer(held.relay.port) as client:
        client.writer.write(f"OPTIONS {client.base}{LIVE} RTSP/1.0\r\nCSeq: 9\r\n\r\n".encode() * 1000)
        answers = b""
        with contextlib.suppress(ConnectionError):
            while data := await asyncio.wait_for(client.reader.read(1 << 16), LIMIT):
                answers += data
        assert answers.count(b"RTSP/1.0 200") <= server_module.MAX_REQUESTS
        async with viewer(held.relay.port) as other:
            await other.describe(LIVE)


# -- the token

TOKEN = AccessToken("t" * 43)


@pytest.mark.parametrize("transport", ["UDP", "TCP"])
async def test_viewer_on_another_computer_sees_pictures_with_the_token(transport: str) -> None:
    """UDP here ends at the answer to SETUP: the client's ports are those of loopback."""
    here = own_address()
    async with studio(host="0.0.0.0", token=TOKEN) as held, viewer(held.relay.port, here) as client:
        assert (await client.ask("OPTIONS", LIVE)).status == 200
        assert (await client.ask("DESCRIBE", LIVE)).status == 401
        client.password = TOKEN.text
        assert (await client.describe(LIVE)).name == "alpha"
        if transport == "TCP":
            eye = await client.setup_inside(f"{LIVE}/video")
            await client.play(LIVE)
            assert all(picture.complete for picture in await eye.first(3))
            assert (await client.ask("TEARDOWN", LIVE)).status == 200
        else:
            await client.setup(f"{LIVE}/video")
        assert held.relay.refused == {}


async def test_viewer_on_another_computer_without_the_token_gets_nothing(caplog: pytest.LogCaptureFixture) -> None:
    here = own_address()
    caplog.set_level("DEBUG")
    async with studio(host="0.0.0.0", token=TOKEN) as held, viewer(held.relay.port, here) as client:
        for password in (None, "wrong", f"{TOKEN.text}x"):
            client.password = password
            for method in ("DESCRIBE", "SETUP", "PLAY", "PAUSE", "TEARDOWN", "GET_PARAMETER", "SET_PARAMETER"):
                answer = await client.ask(method, f"{LIVE}/video", Transport="RTP/AVP/TCP;unicast;interleaved=0-1")
                assert answer.status == 401
                assert (answer.header("WWW-Authenticate") or "").startswith("Digest ")
                assert TOKEN.text not in str(answer)
        assert held.relay.refused == {"token": 14}
        assert (held.relay.sessions, held.server.playing) == (0, 0)
    assert TOKEN.text not in caplog.text
    assert "has a wrong token" in caplog.text


async def test_answer_to_the_challenge_of_another_connection_is_refused() -> None:
    here = own_address()
    async with (
        studio(host="0.0.0.0", token=TOKEN) as held,
        viewer(held.relay.port, here) as first,
        viewer(held.relay.port, here) as second,
    ):
        for client in (first, second):
            assert (await client.ask("DESCRIBE", LIVE)).status == 401
        assert first.challenge != second.challenge
        first.password = TOKEN.text
        recorded = first.authorization("DESCRIBE", first.base + LIVE)
        assert (await second.ask("DESCRIBE", LIVE, Authorization=recorded)).status == 401
        assert (await first.ask("DESCRIBE", LIVE, Authorization=recorded)).status == 200


async def test_viewer_of_this_computer_needs_no_token() -> None:
    async with studio(host="0.0.0.0", token=TOKEN) as held, viewer(held.relay.port) as client:
        assert (await client.describe(LIVE)).name == "alpha"


async def test_connection_without_the_token_keeps_no_place() -> None:
    here = own_address()
    async with studio(host="0.0.0.0", token=TOKEN) as held, viewer(held.relay.port, here) as client:
        began = held.relay.clock.monotonic()
        assert (await client.ask("DESCRIBE", LIVE)).status == 401
        assert await client.reader.read() == b""
        assert 10.0 < held.relay.clock.monotonic() - began < 12.0
