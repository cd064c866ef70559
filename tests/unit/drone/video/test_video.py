"""The video: what its pictures say, who makes it run, and servers that refuse, fall silent, or talk nonsense."""

from __future__ import annotations

import asyncio
import math
import random
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from itertools import pairwise

import pytest
from msgspec.structs import replace
from support.scripted_device import ScriptedDevice
from support.video_server import KEY, METADATA, PPS, SDP, SPS, Asked, VideoServer, ok, refused
from support.world import loopback

from anafi_mav.arsdk.video.rtcp import ReceiverReport
from anafi_mav.arsdk.video.rtp_h264 import Picture, PictureSender
from anafi_mav.arsdk.video.video_metadata import PROTO_PROFILE, V3_PROFILE, Quaternion
from anafi_mav.drone import Drone
from anafi_mav.drone.video import stream as stream_module
from anafi_mav.drone.video import video as video_module
from anafi_mav.drone.video.rtsp_client import RtspClient
from anafi_mav.drone.video.video import VideoFrame, VideoState
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, NotSupported, RemoteProtocolError
from anafi_mav.sim import DroneSpec, Simulator


@asynccontextmanager
async def watched(server: VideoServer) -> AsyncIterator[tuple[Drone, ScriptedDevice]]:
    """A connected drone with this server."""
    async with server, ScriptedDevice() as device:
        drone = device.drone(rtsp_port=server.port)
        await drone.connect()
        try:
            yield drone, device
        finally:
            await drone.close()


@pytest.mark.parametrize("profile", [V3_PROFILE, PROTO_PROFILE])
async def test_frame_metadata_is_that_of_the_pictures(profile: int) -> None:
    server = VideoServer(profile=profile)
    async with watched(server) as (drone, _):
        assert drone.video.state == VideoState()
        frames: list[VideoFrame] = []
        drone.video.subscribe(frames.append)
        async with drone.video.watching():
            while len(frames) < 20:
                await drone.video.next_frame(10.0)
            state = drone.video.state
            assert state.playing
            assert state.frame == frames[-1]
            observed = frames[-1].metadata
            assert (observed.awb_r_gain, observed.awb_b_gain, observed.exposure_time, observed.iso_gain) == (
                1.5,
                2.0,
                16.5,
                318,
            )
            assert observed.hfov == pytest.approx(1.2043, abs=1e-4)
            assert observed.vfov == pytest.approx(0.7377, abs=1e-4)
            assert observed.wifi == METADATA.wifi
            recent = [frame.arrived for frame in frames if frames[-1].arrived - frame.arrived <= 1.0]
            assert state.rate_hz == pytest.approx((len(recent) - 1) / (recent[-1] - recent[0]))
            # 3000 units of 90 kHz between two, over the wrap of their 32 bits.
            steps = [after.taken - before.taken for before, after in pairwise(frames)]
            assert steps == pytest.approx([1 / 30] * len(steps))
        assert drone.video.state == VideoState()
    assert server.methods() == ["OPTIONS", "DESCRIBE", "SETUP", "PLAY", "TEARDOWN"]
    assert server.asked[2].uri.endswith("/live/stream=1")
    assert [one.headers.get("Session") for one in server.asked] == [None, None, None, "0123ABCD", "0123ABCD"]


async def test_attitudes_are_worked_out_of_the_quaternions() -> None:
    # Half a right angle to the right, and the camera 30 deg down: cos and sin of half of each.
    yaw, pitch = math.radians(22.5), math.radians(-15.0)
    server = VideoServer()
    server.metadata = replace(
        METADATA,
        drone_quat=Quaternion(math.cos(yaw), 0.0, 0.0, math.sin(yaw)),
        quat=Quaternion(math.cos(pitch), 0.0, math.sin(pitch), 0.0),
        timestamp=123_456_789,
    )
    async with watched(server) as (drone, _), drone.video.watching():
        frame = await drone.video.next_frame(10.0)
        assert frame.attitude is not None
        assert frame.attitude.yaw == pytest.approx(math.radians(45.0), abs=1e-3)
        assert frame.camera_attitude is not None
        assert frame.camera_attitude.pitch == pytest.approx(math.radians(-30.0), abs=1e-3)
        assert frame.taken == 123.456789
    assert video_module.attitude(None) is None
    assert video_module.attitude((0.0, 0.0, 0.0, 0.0)) is None
    assert video_module.attitude((math.nan, 0.0, 0.0, 0.0)) is None


async def test_the_drones_description_of_its_video() -> None:
    server = VideoServer()
    async with watched(server) as (drone, _):
        pictures: list[Picture] = []
        drone.video.subscribe_pictures(pictures.append)
        async with drone.video.watching("DefaultVideo"):
            await server.until(lambda: bool(pictures))
            shown = drone.video.state.shown
            assert shown is not None
            assert (shown.title, shown.offered) == ("DefaultVideo", ("Thermal", "DefaultVideo"))
            assert shown.fov_deg == (69.0, 42.0)
            assert shown.principal_point == (0.5, 0.48)
            assert shown.distortion == (0.1, -0.2, 0.3, 0.001, 0.002)
            assert (shown.sps, shown.pps) == (SPS, PPS)
        first = pictures[0]
        assert first.is_key
        assert first.units == (SPS, PPS, KEY)
        async with drone.video.watching("Thermal"):
            assert drone.video.state.shown is not None
            assert drone.video.state.shown.title == "Thermal"
    assert [one.uri.rpartition("/")[2] for one in server.asked if one.method == "SETUP"] == ["stream=1", "stream=0"]


@pytest.mark.parametrize("fov", ["70000,42", "69,1e999", "nan,42", "0,42", "-69,42", "69"])
async def test_impossible_field_of_view_is_unknown(fov: str) -> None:
    server = VideoServer()
    description = SDP.replace("69.00,42.00", fov)
    head = "Content-Type: application/sdp\r\n"
    server.answers["DESCRIBE"] = lambda asked: ok(asked, f"{head}Content-Base: {asked.uri}\r\n", description)
    async with watched(server) as (drone, _), drone.video.watching():
        assert drone.video.state.shown is not None
        assert drone.video.state.shown.fov_deg is None


@pytest.mark.parametrize("point", ["1e300,0.5", "0.5,-1e300", "0.5,inf", "0.5"])
async def test_impossible_principal_point_is_unknown(point: str) -> None:
    server = VideoServer()
    described = SDP.replace("principal-point:0.5,0.48", f"principal-point:{point}")
    server.answers["DESCRIBE"] = lambda asked: ok(asked, "Content-Type: application/sdp\r\n", described)
    async with watched(server) as (drone, _), drone.video.watching("DefaultVideo"):
        assert drone.video.state.shown is not None
        assert drone.video.state.shown.principal_point is None


async def test_video_runs_while_it_is_watched() -> None:
    server = VideoServer()
    async with watched(server) as (drone, _):
        async with drone.video.watching():
            async with drone.video.watching(), drone.video.watching("DefaultVideo"):
                assert server.playing == 1
                with pytest.raises(CommandRejected, match="shows 'DefaultVideo'"):
                    async with drone.video.watching("Thermal"):
                        pass
            assert server.playing == 1
            await drone.video.next_frame(10.0)
        assert server.methods().count("TEARDOWN") == 1
        await server.until(lambda: server.playing == 0)
        with pytest.raises(CommandTimeout):
            await drone.video.next_frame(0.2)
        async with drone.video.watching():
            assert drone.video.state.playing
    assert server.methods().count("SETUP") == server.methods().count("TEARDOWN") == 2


@pytest.mark.parametrize("method", ["OPTIONS", "DESCRIBE", "SETUP", "PLAY"])
async def test_watching_cancelled_before_the_start_leaves_no_session(method: str) -> None:
    server = VideoServer()
    async with watched(server) as (drone, _):
        server.answers = {method: lambda asked: None}
        watching = asyncio.create_task(watch(drone))
        await server.until(lambda: method in server.methods())
        watching.cancel()
        await asyncio.wait({watching})
        assert watching.cancelled()
        assert drone.video.state == VideoState()
        assert ("TEARDOWN" in server.methods()) == (method == "PLAY")
        server.answers = {}
        async with drone.video.watching():
            assert drone.video.state.playing


async def watch(drone: Drone) -> None:
    async with drone.video.watching():
        raise AssertionError("it has not begun")


async def test_the_session_is_kept_alive() -> None:
    server = VideoServer(session_timeout=3)
    async with watched(server) as (drone, _), drone.video.watching():
        await server.until(lambda: server.methods().count("GET_PARAMETER") == 2)
    words = [one for one in server.asked if one.method == "GET_PARAMETER"]
    assert {one.headers["Session"] for one in words} == {"0123ABCD"}

    server = VideoServer(session_timeout=0)
    server.answers["OPTIONS"] = lambda asked: ok(asked, "Public: DESCRIBE\r\n")
    async with watched(server) as (drone, _), drone.video.watching():
        await server.until(lambda: server.methods().count("OPTIONS") == 2)
        assert server.sent >= 20  # not before a second has passed


@pytest.mark.parametrize("generation", [3, 4])
async def test_the_video_behind_a_skycontroller(generation: int) -> None:
    """RTSP at the Skycontroller's own address; with the 4 it goes through the mux, and so do the datagrams."""
    spec = DroneSpec(address=loopback(), http_port=None, skycontroller=generation)
    server = VideoServer(address=spec.address)
    async with Simulator([spec], seed=1), server:
        drone = Drone(spec.address, rtsp_port=server.port, name="behind")
        await drone.connect()
        async with drone.video.watching():
            frame = await drone.video.next_frame(10.0)
            assert frame.metadata.iso_gain == 318
            await server.until(lambda: bool(server.reports))
        await drone.close()
    report = server.reports[0]
    assert isinstance(report, ReceiverReport)
    assert report.blocks[0].lost == 0
    assert server.methods()[-1] == "TEARDOWN"
    setup = server.asked[2]
    assert setup.headers.get("X-com-parrot-link-type") == ("mux" if generation == 4 else None)


# -- servers that do not do it


REFUSALS: list[tuple[str, Callable[[Asked], bytes | None], type[Exception], str]] = [
    ("DESCRIBE", refused("404 Not Found"), CommandRejected, "DESCRIBE .*/live: RTSP 404 Not Found"),
    ("SETUP", refused("453 Not Enough Bandwidth"), CommandRejected, "453"),
    ("PLAY", refused("454 Session Not Found"), CommandRejected, "454"),
    ("DESCRIBE", lambda asked: ok(asked, body="hello"), RemoteProtocolError, "description"),
    ("DESCRIBE", lambda asked: ok(asked, body=SDP.replace("H264", "VP8")), NotSupported, "no video"),
    ("SETUP", lambda asked: ok(asked, "Session: 1\r\n"), RemoteProtocolError, "where its video comes from"),
    (
        "SETUP",
        lambda asked: ok(asked, "Transport: RTP/AVP;unicast;server_port=1-2\r\n"),
        RemoteProtocolError,
        "session",
    ),
    ("OPTIONS", lambda asked: b"220 ftp ready\r\n\r\n", RemoteProtocolError, "no RTSP"),
]


@pytest.mark.parametrize(("method", "answer", "error", "match"), REFUSALS)
async def test_a_server_that_refuses(
    method: str, answer: Callable[[Asked], bytes | None], error: type[Exception], match: str
) -> None:
    server = VideoServer()
    server.answers[method] = answer
    async with watched(server) as (drone, _):
        with pytest.raises(error, match=match):
            async with drone.video.watching():
                pass
        assert drone.video.state == VideoState()
        server.answers.clear()
        with pytest.raises(NotSupported, match="'Rear camera'"):
            async with drone.video.watching("Rear camera"):
                pass
        async with drone.video.watching():
            assert drone.video.state.playing


async def test_no_server_at_all() -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        async with ScriptedDevice() as device:
            drone = device.drone(rtsp_port=closed.getsockname()[1])
            with pytest.raises(LinkLost, match="not connected"):
                async with drone.video.watching():
                    pass
            await drone.connect()
            with pytest.raises(LinkLost, match="refused"):
                async with drone.video.watching():
                    pass
            await drone.close()


async def test_a_server_that_does_not_answer() -> None:
    server = VideoServer()
    server.answers["DESCRIBE"] = lambda asked: None
    async with watched(server) as (drone, _):
        with pytest.raises(CommandTimeout, match="RTSP DESCRIBE within 4 s"):
            async with drone.video.watching():
                pass


async def test_a_server_without_pictures() -> None:
    server = VideoServer(quiet=True)
    async with watched(server) as (drone, _):
        with pytest.raises(CommandTimeout, match="a picture within 2 s"):
            async with drone.video.watching(timeout=2.0):
                pass
        server.quiet = False
        server.metadata = None
        async with drone.video.watching():
            assert drone.video.state.playing
            assert drone.video.state.frame is None
            with pytest.raises(CommandTimeout):
                await drone.video.next_frame(0.3)


async def test_silent_stream_is_ended_and_started_again() -> None:
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        await drone.video.next_frame(10.0)
        server.quiet = True
        await server.until(lambda: "TEARDOWN" in server.methods())
        # What was said is forgotten after a second, long before that.
        assert drone.video.state.frame is None
        assert drone.video.state.rate_hz is None
        assert not drone.video.state.playing
        server.quiet = False
        await drone.video.next_frame(10.0)
        assert drone.video.state.playing
        assert drone.video.state.problem == ""
    assert server.methods().count("PLAY") == 2


@pytest.mark.parametrize(
    "end",
    [
        lambda server: server.hang_up(),
        lambda server: server.say("TEARDOWN rtsp://x/live RTSP/1.0\r\nCSeq: 9\r\nSession: 0123ABCD\r\n\r\n"),
        lambda server: server.say("ANNOUNCE rtsp://x/live RTSP/1.0\r\nCSeq: 9\r\n\r\n"),
        lambda server: server.say("what?\r\n\r\n"),
    ],
    ids=["hang up", "teardown", "announce", "nonsense"],
)
async def test_stream_ended_by_the_server_is_started_again(end: Callable[[VideoServer], None]) -> None:
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        await drone.video.next_frame(10.0)
        end(server)
        await server.until(lambda: server.methods().count("PLAY") == 2)
        await drone.video.next_frame(10.0)


async def test_unreachable_server_is_retried_at_growing_intervals() -> None:
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        await drone.video.next_frame(10.0)
        server.answers["DESCRIBE"] = refused("404 Not Found")
        server.asked.clear()
        ended = asyncio.get_running_loop().time()
        server.hang_up()
        await server.until(lambda: server.methods().count("DESCRIBE") == 3, timeout=20.0)
        times = [ended, *(one.at for one in server.asked if one.method == "DESCRIBE")]
        gaps = [after - before for before, after in pairwise(times)]
        assert all(gap >= least for gap, least in zip(gaps, (0.5, 1.0, 2.0), strict=True)), gaps
        assert "closed the connection" in drone.video.state.problem or "404" in drone.video.state.problem
        assert drone.video.state.frame is None
        server.answers.clear()
        await drone.video.next_frame(20.0)
        assert drone.video.state.problem == ""


async def test_requests_of_the_rtsp_server_are_answered() -> None:
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        server.say("OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\nREDIRECT rtsp://x/ RTSP/1.0\r\nCSeq: 2\r\n\r\n")
        server.say("RTSP/1.0 200 OK\r\nCSeq: 77\r\n\r\n")
        await server.until(lambda: sum(one.startswith("RTSP") for one in server.methods()) == 2)
        answers = [one for one in server.methods() if one.startswith("RTSP")]
        assert answers == ["RTSP/1.0 200 OK", "RTSP/1.0 501 Not Implemented"]
        await drone.video.next_frame(10.0)
    assert drone.video.counters["stray"] >= 1


# -- the link


async def test_connection_to_a_server_that_asks_and_does_not_read_is_closed() -> None:
    """Our answers fill the buffers: a socket that waited until they are read would be left open at each attempt."""
    reset = asyncio.Event()

    async def ask_without_end(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            while True:
                writer.write(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n" * 1000)
                await writer.drain()
        reset.set()

    server = await asyncio.start_server(ask_without_end, "127.0.0.1", 0, limit=1024)
    client = await RtspClient.connect(*server.sockets[0].getsockname())
    assert await asyncio.wait_for(client.ended, 20.0) == "the drone's video server asks and does not listen"
    await client.close()
    await asyncio.wait_for(reset.wait(), 20.0)
    server.close()


async def test_nothing_of_it_survives_the_link() -> None:
    server = VideoServer()
    async with watched(server) as (drone, device), drone.video.watching():
        await drone.video.next_frame(10.0)
        waiting = drone.lost
        await device.session.close()
        await asyncio.wait_for(asyncio.shield(waiting), 5.0)
        assert drone.video.state == VideoState()
        with pytest.raises(LinkLost):
            async with drone.video.watching():
                pass
        # A viewer still wants the video when the drone is back.
        await server.until(lambda: server.playing == 0)
        await drone.connect()
        await drone.video.next_frame(10.0)
    assert server.methods().count("PLAY") == 2


async def test_a_picture_that_comes_behind_the_end_says_nothing() -> None:
    """The sockets are open until the task that owns them gets to run."""
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        await drone.video.next_frame(10.0)
        stream = drone.video._stream
        assert stream is not None
        drone.video.link_lost()
        for datagram in PictureSender(1).send([KEY], 0, METADATA, V3_PROFILE) * 2:
            stream._receive(datagram)
        for datagram in PictureSender(1, 10).send([KEY], 0, METADATA, V3_PROFILE):
            stream._receive(datagram)
        assert stream.receiver.window.ssrc == 1
        assert drone.video.state == VideoState()


async def test_closing_says_goodbye() -> None:
    server = VideoServer()
    async with server, ScriptedDevice() as device:
        drone = device.drone(rtsp_port=server.port)
        await drone.connect()
        stack = drone.video.watching()
        await stack.__aenter__()
        await drone.close()
        assert server.methods()[-1] == "TEARDOWN"
        assert drone.video.state == VideoState()
        await stack.__aexit__(None, None, None)


async def test_close_after_link_loss_does_not_wait_for_teardown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_module, "GOODBYE", 60.0)
    server = VideoServer()
    server.answers["TEARDOWN"] = lambda _: None
    async with watched(server) as (drone, device), drone.video.watching():
        device.session.end("gone")
        await asyncio.wait({drone.lost})
        await asyncio.wait_for(drone.close(), 10.0)  # the next attempt to connect begins now
        await server.until(lambda: server.methods()[-1] == "TEARDOWN")
        server.hang_up()


async def test_only_the_drones_datagrams_count() -> None:
    server = VideoServer()
    loop = asyncio.get_running_loop()
    stranger, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=("127.0.0.1", 0))
    async with watched(server) as (drone, _):
        setup = server._usual
        early: list[int] = []

        def answer(asked: Asked) -> bytes | None:
            # Before the drone has said where its pictures come from: what waits in the socket then.
            early.append(int(asked.headers["Transport"].partition("client_port=")[2].split("-")[0]))
            stranger.sendto(b"\x80" + bytes(40), ("127.0.0.1", early[0]))
            return setup(asked)

        server.answers["SETUP"] = answer
        server.metadata = None
        async with drone.video.watching():
            for _ in range(10):
                stranger.sendto(b"\x80" + bytes(40), ("127.0.0.1", early[0]))
            sent = server.sent
            await server.until(lambda: server.sent > sent + 5)
    stranger.close()
    assert drone.video.counters["malformed"] == 0
    assert drone.video.counters["stray"] == 0
    assert drone.video.counters["foreign"] == 1


# -- nonsense


async def test_noise_raises_nothing(caplog: pytest.LogCaptureFixture) -> None:
    """Mutated and cut answers, descriptions and packets: the client ends its stream or goes on, and tries again."""
    rng = random.Random(5)
    server = VideoServer()
    errors: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: errors.append(context))

    def noisy(asked: Asked) -> bytes:
        data = bytearray(server._usual(asked))
        for _ in range(rng.randrange(4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        return bytes(data[: rng.randrange(len(data))]) if rng.random() < 0.2 else bytes(data)

    server.answers = dict.fromkeys(("OPTIONS", "DESCRIBE", "SETUP", "PLAY", "GET_PARAMETER", "TEARDOWN"), noisy)
    async with watched(server) as (drone, _):
        for _ in range(60):
            with suppress(CommandTimeout, CommandRejected, NotSupported, RemoteProtocolError, LinkLost):
                async with drone.video.watching(timeout=0.3):
                    pass
        server.answers = {}
        async with drone.video.watching():
            assert drone.video.state.playing
    assert errors == []
    assert not [record for record in caplog.records if record.exc_info]


async def test_noise_in_the_pictures_raises_nothing() -> None:
    rng = random.Random(6)
    server = VideoServer()
    async with watched(server) as (drone, _), drone.video.watching():
        client = server.asked[2].headers["Transport"].partition("client_port=")[2].split("-")
        for _ in range(3000):
            data = bytearray(rng.randbytes(rng.randrange(80)))
            if data and rng.random() < 0.8:
                data[0] = 0x80 | rng.randrange(64)
            for transport, port in ((server.rtp, client[0]), (server.rtcp, client[1])):
                transport.sendto(bytes(data), ("127.0.0.1", int(port)))
            if rng.random() < 0.05:
                await asyncio.sleep(0)
        before = server.sent
        await server.until(lambda: server.sent > before + 30)
        await drone.video.next_frame(10.0)
    assert drone.video.counters["malformed"] > 100


async def test_failing_video_subscriber_does_not_affect_others(caplog: pytest.LogCaptureFixture) -> None:
    def fails(frame: VideoFrame) -> None:
        raise RuntimeError("mine")

    async with watched(VideoServer()) as (drone, _), drone.video.watching():
        undo = drone.video.subscribe(fails)
        await drone.video.next_frame(10.0)
        undo()
    assert "a subscriber failed on the video" in caplog.text
