"""The simulated drone's video server over real sockets: playing, pausing, recordings, and what it refuses."""

from __future__ import annotations

import asyncio
import itertools
import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from support import clock
from support.pictures import decode, strip
from support.rtsp_client import LIMIT, Viewer, viewer
from support.sim_bench import Bench

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.video import rtcp, rtsp
from anafi_mav.arsdk.video.video_metadata import FlyingState
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import MediaKind
from anafi_mav.sim.video.camera_view import KEY_INTERVAL
from anafi_mav.sim.video.rtsp import MAX_CONNECTIONS, MAX_SESSIONS, VideoServer
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.motion import STEP

TICK = 90000 / 30
"""Between the timestamps of two pictures."""


class Studio:
    """A drone on a bench with its video server."""

    def __init__(self, model: str) -> None:
        self.bench = Bench(model)
        self.notes: list[tuple[str, dict[str, Any]]] = []
        self.heard = True
        self.sent = 0
        """Datagrams of the server."""
        self.server: VideoServer
        self._noted = asyncio.Event()

    def note(self, name: str, args: dict[str, Any]) -> None:
        self.notes.append((name, args))
        self._noted.set()

    def send(self, data: bytes, deliver: Callable[[bytes], None]) -> None:
        """The air."""
        self.sent += 1
        if self.heard:
            deliver(data)
        self._noted.set()

    def observed(self, name: str) -> list[dict[str, Any]]:
        return [args for noted, args in self.notes if noted == name]

    async def until(self, happened: Callable[[], bool]) -> None:
        async def wait() -> None:
            while not happened():
                self._noted.clear()
                await self._noted.wait()

        await asyncio.wait_for(wait(), LIMIT)

    async def turn(self) -> None:
        """Let the server's time pass; the drone on the bench is turned by the test."""
        while True:
            await asyncio.sleep(STEP)
            self.server.tick(asyncio.get_running_loop().time(), STEP)

    def film(self, seconds: float) -> str:
        """A recording on the card; the id of its file."""
        store = self.bench.firmware.payload.media
        media = store.begin(video=True, mode="STANDARD", date="20261121T101112+0100")
        store.add(media, [store.develop(media, MediaKind.MP4, 1, Scene(), media.date, seconds)])
        return media.resources[0].id


@asynccontextmanager
async def studio(model: str = "4k", session_timeout: int = 60) -> AsyncIterator[Studio]:
    held = Studio(model)
    held.server = VideoServer(
        held.bench.firmware,
        random.Random(1),
        held.note,
        lambda: held.heard,
        held.send,
        session_timeout,
    )
    await held.server.start("127.0.0.1", 0)
    world = asyncio.create_task(held.turn())
    try:
        yield held
    finally:
        world.cancel()
        await held.server.close()


@asynccontextmanager
async def watching(model: str = "4k") -> AsyncIterator[tuple[Studio, Viewer]]:
    async with studio(model) as held, viewer(held.server.port) as client:
        yield held, client


# -- playing


async def test_the_live_stream_plays() -> None:
    async with watching() as (held, client):
        options = await client.ask("OPTIONS")
        assert "SETUP" in (options.header("Public") or "")
        described = await client.describe()
        assert [media.control for media in described.media] == ["video"]
        eye = await client.setup("live/video")
        setup = held.observed("setup")
        assert setup == [{"session": client.session, "stream": "DefaultVideo", "client": ["127.0.0.1", *eye.ports]}]
        answer = await client.play()
        assert answer.header("Range") == "npt=now-"
        assert answer.header("Session") == f"{client.session};timeout=60"
        (info,) = rtsp.parse_rtp_info(answer.header("RTP-Info") or "")
        assert info.url == f"{client.base}live/video"

        seen = await eye.first(KEY_INTERVAL + 5)

        assert eye.sequences[0] == info.sequence
        assert all(picture.complete for picture in seen)
        assert [number for number, picture in enumerate(seen) if picture.is_key] == [0, KEY_INTERVAL]
        assert seen[0].units[:2] == (described.media[0].sps, described.media[0].pps)
        assert info.timestamp is not None
        assert (seen[0].timestamp - info.timestamp) % (1 << 32) < TICK
        # Thirty a second of the machine's clock: over 34 intervals, timestamps and arrival agree.
        passed = (seen[-1].timestamp - seen[0].timestamp) % (1 << 32) / 90000.0
        assert passed == pytest.approx(eye.arrived[len(seen) - 1] - eye.arrived[0], abs=0.2)
        assert passed >= (len(seen) - 1.5) / 30
        said = seen[0].metadata
        assert said is not None
        assert said.flying_state is FlyingState.LANDED
        # The sender's report says which time a timestamp is: here the same clock.
        await eye.until(lambda: eye.reports)
        report = eye.reports[0]
        assert isinstance(report, rtcp.SenderReport)
        # (The time is reported in whole microseconds, which may end the 90 kHz tick before the one of the time itself.)
        assert (report.timestamp - int(report.time * 0.09)) % (1 << 32) in (0, 1)
        assert said.timestamp == max(1, round(held.bench.firmware.time * 1e6))


async def test_pictures_show_the_moment_of_their_metadata(tmp_path: Path) -> None:
    async with watching() as (held, client):
        eye = await client.setup("live/video")
        await client.play()
        held.bench.take_off()
        held.bench.climb(8.0)
        pictures = await eye.first(KEY_INTERVAL + 5)
        images = decode(tmp_path / "stream.264", [list(picture.units) for picture in pictures])
        read = [strip(image) for image in images]
        times = [picture.metadata.timestamp for picture in pictures if picture.metadata is not None]
        assert [time for _, time in read] == [time // 1000 for time in times if time is not None]
        # The first has number 1: without a viewer none was drawn.
        assert [number for number, _ in read] == [*range(1, 1 + len(pictures))]


async def test_each_picture_has_its_capture_time() -> None:
    async with watching() as (held, client):
        eye = await client.setup("live/video")
        await client.play()
        held.bench.take_off()
        held.bench.climb(8.0)
        begin = len(eye.pictures)
        await eye.look(2)
        said = eye.pictures[begin + 1].metadata
        assert said is not None
        assert said.ground_distance == pytest.approx(held.bench.pose.up, abs=1e-4)
        assert said.flying_state is FlyingState.HOVERING


async def recorded(speed: float, pictures: int) -> list[int]:
    """Return the times of so many pictures in a row, in us of the simulated clock."""
    spec = DroneSpec(address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None, rtsp_port=0)
    async with Simulator([spec], speed=speed, seed=1) as simulator:
        port = simulator.drones[0].rtsp_port
        assert port is not None
        async with viewer(port) as client:
            eye = await client.setup("live/video")
            await client.play()
            seen = await eye.first(pictures)
    times = [picture.metadata.timestamp for picture in seen if picture.metadata is not None]
    return [time for time in times if time is not None]


@pytest.mark.parametrize(("speed", "steps"), [(1.0, 2), (0.5, 1), (0.25, 1), (10.0, 20)])
async def test_pictures_are_whole_steps_of_the_motion_apart(speed: float, steps: int) -> None:
    """1/30 s of the clock each, at a higher speed on average; below a speed of 0.5 one for each step."""
    times = await recorded(speed, 60)
    assert len(times) == 60
    apart = [(after - before) / 1e6 / STEP for before, after in itertools.pairwise(times)]
    assert all(abs(gap - round(gap)) < 0.01 for gap in apart), apart
    if speed <= 1.0:
        assert {round(gap) for gap in apart} == {steps}, apart
    else:
        assert abs(sum(apart) / len(apart) - steps) <= 1.0, apart
        # Beside a child process of an earlier test the clock runs like the machine's, where one picture is late.
        assert not clock.childless() or all(abs(round(gap) - steps) <= 1 for gap in apart), apart


async def test_pictures_of_a_world_that_turns_late_are_of_different_moments() -> None:
    """A busy machine: steps are made up for two at a time, or not at all."""
    held = Studio("4k")
    held.server = VideoServer(held.bench.firmware, random.Random(1), held.note, lambda: True, held.send)
    await held.server.start("127.0.0.1", 0)
    async with viewer(held.server.port) as client:
        eye = await client.setup("live/video")
        await client.play()
        chance, made = random.Random(1), 0
        while made < 200:
            steps = chance.randrange(3)
            for _ in range(steps):
                held.bench.turn()
            held.server.tick(float(made), steps * STEP)
            made += steps
        seen = await eye.first(95)
    await held.server.close()
    times = [picture.metadata.timestamp for picture in seen if picture.metadata is not None]
    assert len(set(times)) == len(times) >= 95
    assert held.observed("end")[0]["pictures"] == pytest.approx(100, abs=5)


async def test_pause_stops_pictures_and_play_starts_with_a_key_picture() -> None:
    async with watching() as (held, client):
        eye = await client.setup("live/video")
        await client.play()
        await eye.look(3)
        assert (await client.ask("PAUSE")).status == 200
        assert not held.server.playing
        await client.play()
        await eye.until(lambda: sum(picture.is_key for picture in eye.pictures) == 2)
        assert [name for name, _ in held.notes] == ["setup", "play", "pause", "play"]


async def test_both_cameras_of_an_ai_in_one_session() -> None:
    async with watching("ai") as (held, client):
        front = await client.setup("live/front")
        await client.play()
        await front.look(2)
        disparity = await client.setup("live/disparity")
        answer = await client.play()
        assert len(rtsp.parse_rtp_info(answer.header("RTP-Info") or "")) == 2
        (picture, *_) = await disparity.first(2)
        assert picture.is_key
        await front.look(2)
        keys = [number for number, picture in enumerate(front.pictures) if picture.is_key]
        assert all(number % KEY_INTERVAL == 0 for number in keys)  # it went on
        assert picture.metadata is not None
        assert picture.metadata.starfish is not None
        assert (await client.ask("TEARDOWN", "live/disparity")).status == 200
        await front.look(2)
        assert (await client.ask("TEARDOWN")).status == 200
        ended = {args["stream"]: args["reason"] for args in held.observed("end")}
        assert ended == {"Front camera": "teardown", "Disparity map": "teardown"}
        assert (await client.ask("GET_PARAMETER")).status == 454


async def test_two_clients_watch_the_same_camera() -> None:
    async with watching() as (held, client), viewer(held.server.port) as other:
        one = await client.setup("live/video")
        await client.play()
        await one.look(3)
        two = await other.setup("live/video")
        await other.play()
        (first, *_) = await two.first(3)
        assert first.is_key
        shared = {picture.timestamp for picture in one.pictures} & {picture.timestamp for picture in two.pictures}
        assert shared  # one clock
        assert (await client.ask("TEARDOWN")).status == 200
        await two.look(3)


async def test_the_metadata_may_be_longer_than_the_picture() -> None:
    async with watching("ai") as (_, client):
        eye = await client.setup("live/disparity")
        await client.play()
        for picture in await eye.look(5):
            assert picture.metadata is not None
            assert picture.metadata.position == (0.0, 0.0, 0.0)


# -- recordings


async def test_a_recording_plays_to_its_end() -> None:
    async with watching() as (held, client):
        resource = f"replay/{held.film(0.5)}"
        described = await client.describe(resource)
        assert (described.duration, [media.title for media in described.media]) == (0.5, ["DefaultVideo"])
        eye = await client.setup(f"{resource}/video")
        assert (await client.play(resource)).header("Range") == "npt=0.000-0.500"
        await held.until(lambda: bool(held.observed("finished")))
        await eye.until(lambda: len(eye.pictures) >= 15)
        assert len(eye.pictures) == 15
        assert eye.pictures[0].is_key
        assert eye.pictures[0].metadata is None
        # At the end there is nothing left; from the middle there is the rest.
        assert (await client.play(resource)).header("Range") == "npt=0.500-0.500"
        assert (await client.play(resource, Range="npt=0.3-")).header("Range") == "npt=0.300-0.500"
        await held.until(lambda: len(held.observed("finished")) == 2)
        await eye.until(lambda: len(eye.pictures) >= 21)
        assert len(eye.pictures) == 21
        assert eye.pictures[15].is_key


async def test_a_recording_can_be_paused() -> None:
    async with watching() as (held, client):
        resource = f"replay/{held.film(60.0)}"
        eye = await client.setup(f"{resource}/video")
        await client.play(resource)
        await eye.look(3)
        where, _ = rtsp.parse_range((await client.ask("PAUSE", resource)).header("Range") or "") or (None, None)
        assert where is not None
        assert 0.1 <= where < 30.0
        start, stop = rtsp.parse_range((await client.play(resource)).header("Range") or "") or (None, None)
        assert (start, stop) == (where, 60.0)
        assert (await client.ask("PLAY", resource, Range="npt=61-")).status == 457
        assert (await client.ask("PLAY", resource, Range="clock=1-")).status == 457


async def test_rtsp_of_an_unknown_recording_is_not_found() -> None:
    async with watching() as (held, client):
        store = held.bench.firmware.payload.media
        photo = store.begin(video=False, mode="SINGLE", date="20261121T101112+0100")
        store.add(photo, [store.develop(photo, MediaKind.JPG, 1, Scene(), photo.date)])
        film = held.film(1.0)
        for path in ("replay/1.MP4", f"replay/{photo.resources[0].id}", "replay/", "replay", "", "other", "live/x"):
            assert (await client.ask("DESCRIBE", path)).status == 404, path
        store.unplug()
        assert (await client.ask("DESCRIBE", f"replay/{film}")).status == 404


# -- sessions


async def test_silent_rtsp_client_expires_and_active_one_stays() -> None:
    async with studio(session_timeout=1) as held, viewer(held.server.port) as silent, viewer(held.server.port) as other:
        await silent.setup("live/video")
        await silent.play()
        eye = await other.setup("live/video")
        await other.play()
        client = asyncio.create_task(speak(other))
        await held.until(lambda: bool(held.observed("end")))
        assert [(end["session"], end["reason"]) for end in held.observed("end")] == [(silent.session, "timeout")]
        await eye.look(2)
        client.cancel()
        assert (await silent.ask("PLAY")).status == 454


async def speak(client: Viewer) -> None:
    while True:
        assert (await client.ask("GET_PARAMETER")).status == 200
        await asyncio.sleep(0.3)


async def test_reports_of_the_client_keep_its_session_and_are_counted() -> None:
    async with studio(session_timeout=1) as held, viewer(held.server.port) as client:
        eye = await client.setup("live/video")
        server = next(iter(held.server._sessions.values())).tracks["video"][0]
        await client.play()
        block = rtcp.ReportBlock(server.ssrc, 0, 7, 0, 0)
        report = rtcp.encode_receiver_report(rtcp.ReceiverReport(1, (block,)), "me")
        while len(eye.pictures) < 45:  # a second and a half, half as long again as the session would live
            eye.report(report, server.ports[1])
            eye.report(b"\xff\xff", server.ports[1])
            await eye.look(5)
        assert held.observed("end") == []
        assert (await client.ask("TEARDOWN")).status == 200
        (end,) = held.observed("end")
        assert (end["lost"], end["reason"]) == (7, "teardown")
        assert end["reports"] >= 5
        assert end["pictures"] >= 45


async def test_a_session_outlives_its_connection() -> None:
    async with studio() as held, viewer(held.server.port) as first, viewer(held.server.port) as second:
        eye = await first.setup("live/video")
        await first.play()
        await eye.look(1)
        first.writer.close()
        await eye.look(3)
        second.session = first.session
        assert (await second.ask("TEARDOWN")).status == 200


async def test_the_server_ends_with_clients_looking() -> None:
    async with viewer_of_a_closed_server() as (held, client):
        assert held.observed("end")[0]["reason"] == "closed"
        assert await asyncio.wait_for(client.reader.read(), LIMIT) == b""


@asynccontextmanager
async def viewer_of_a_closed_server() -> AsyncIterator[tuple[Studio, Viewer]]:
    async with studio() as held, viewer(held.server.port) as client:
        eye = await client.setup("live/video")
        await client.play()
        await eye.look(2)
        await held.server.close()
        yield held, client


# -- what is refused


async def test_requests_that_make_no_sense_are_refused() -> None:
    async with watching() as (_, client):
        transport = "RTP/AVP;unicast;client_port=5000-5001"
        assert (await client.ask("RECORD")).status == 501
        refused = await client.ask("ANNOUNCE")
        assert refused.status == 405
        assert "PLAY" in (refused.header("Allow") or "")
        assert (await client.ask("PLAY")).status == 454
        assert (await client.ask("PAUSE", Session="nonsense")).status == 454
        assert (await client.ask("TEARDOWN")).status == 454
        assert (await client.ask("SETUP", Transport=transport)).status == 460
        assert (await client.ask("SETUP", "live/other", Transport=transport)).status == 404
        assert (await client.ask("DESCRIBE", "live/video")).status == 404
        for offer in ("", "RTP/AVP/TCP;unicast;interleaved=0-1", "RTP/AVP;multicast", "RTP/AVP;unicast"):
            assert (await client.ask("SETUP", "live/video", Transport=offer)).status == 461, offer
        assert (await client.ask("SETUP", "live/video", Transport=transport, Session="nonsense")).status == 454
        assert (await client.ask("GET_PARAMETER")).status == 200


async def test_a_request_without_a_number_is_bad() -> None:
    async with watching() as (_, client):
        client.writer.write(b"OPTIONS * RTSP/1.0\r\n\r\n")
        assert (await client.answer()).status == 400
        await client.describe()  # and the connection goes on


@pytest.mark.parametrize(
    ("garbage", "status"),
    [
        (b"\x16\x03\x01\x02\x00", 400),
        (b"GET /live HTTP/1.1\r\nHost: a\r\n\r\n", 505),
        (b"DESCRIBE " + b"a" * 20000, 413),
        (b"PLAY rtsp://a/live RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 99999999\r\n\r\n", 413),
        (b"PLAY rtsp://a/live RTSP/1.0\r\n" + b"A: b\r\n" * 100 + b"\r\n", 413),
    ],
)
async def test_garbage_is_answered_and_the_connection_closed(garbage: bytes, status: int) -> None:
    async with watching() as (held, client), viewer(held.server.port) as other:
        client.writer.write(garbage)
        assert (await client.answer()).status == status
        assert await asyncio.wait_for(client.reader.read(), LIMIT) == b""
        await held.until(lambda: bool(held.observed("malformed")))
        await other.describe()


async def test_noise_in_requests_never_stops_the_server() -> None:
    generator = random.Random(8)
    request = b"SETUP rtsp://127.0.0.1/live/video RTSP/1.0\r\nCSeq: 1\r\n"
    request += b"Transport: RTP/AVP;unicast;client_port=5000-5001\r\n\r\n"
    async with studio() as held:
        for _ in range(60):
            async with viewer(held.server.port) as client:
                broken = bytearray(request)
                for _ in range(generator.randrange(1, 6)):
                    broken[generator.randrange(len(broken))] = generator.randrange(256)
                client.writer.write(bytes(broken))
                await client.writer.drain()
        async with viewer(held.server.port) as client:
            await client.describe()


async def test_sessions_and_connections_are_bounded() -> None:
    async with studio() as held, viewer(held.server.port) as client:
        for _ in range(MAX_SESSIONS):
            client.session = ""
            await client.setup("live/video")
        client.session = ""
        refused = await client.ask("SETUP", "live/video", Transport="RTP/AVP;unicast;client_port=5000-5001")
        assert refused.status == 453
        others = [await asyncio.open_connection("127.0.0.1", held.server.port) for _ in range(MAX_CONNECTIONS)]
        # One too many: it is closed without a word.
        assert await asyncio.wait_for(others[-1][0].read(), LIMIT) == b""
        for _, writer in others:
            writer.close()


# -- the air


async def test_rtsp_server_without_a_radio_link_is_silent() -> None:
    async with watching() as (held, client):
        eye = await client.setup("live/video")
        await client.play()
        await eye.look(2)
        held.heard = False
        before = len(eye.pictures)
        client.writer.write(b"OPTIONS * RTSP/1.0\r\nCSeq: 99\r\n\r\n")
        mark = held.sent
        await held.until(lambda: held.sent >= mark + 5)
        assert len(eye.pictures) - before <= 1
        held.heard = True
        (after, *_) = await eye.look(2)
        assert not after.complete  # the packets between are missing
        assert (await client.ask("GET_PARAMETER")).status == 200  # the first answer is to this one


async def test_the_air_of_the_link_carries_the_video_too() -> None:
    spec = DroneSpec(address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None, rtsp_port=0)
    async with Simulator([spec], seed=1) as simulator:
        drone = simulator.drones[0]
        assert drone.rtsp_port is not None
        async with viewer(drone.rtsp_port) as client:
            eye = await client.setup("live/video")
            await client.play()
            await eye.look(2)
            drone.faults.down = Impairment(loss=1.0)
            mark = len(eye.pictures)
            await drone.wait_log(lambda entry: entry.kind == "pose", since=drone.log[-1].t + 0.2)
            assert len(eye.pictures) - mark <= 1
            drone.faults.down = Impairment()
            await eye.look(2)
            drone.faults.mute = True
            mark = len(eye.pictures)
            await drone.wait_log(lambda entry: entry.kind == "pose", since=drone.log[-1].t + 0.2)
            assert len(eye.pictures) - mark <= 1
        assert [entry.name for entry in drone.log if entry.kind == "video"] == ["setup", "play"]


async def test_a_taken_port_leaves_a_drone_without_video() -> None:
    taken = await asyncio.start_server(lambda reader, writer: None, "127.0.0.1", 0)
    port = taken.sockets[0].getsockname()[1]
    spec = DroneSpec(
        address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None, rtsp_port=port
    )
    async with Simulator([spec]) as simulator:
        drone = simulator.drones[0]
        assert drone.rtsp_port is None
        assert drone.rtsp_problem == f"no video on port {port}: Address already in use"
    taken.close()
    await taken.wait_closed()


async def test_a_flight_in_the_log_is_the_flight_in_the_video() -> None:
    spec = DroneSpec(
        model="ai", address="127.0.0.1", discovery_port=0, handshake_port=0, c2d_port=0, http_port=None, rtsp_port=0
    )
    async with Simulator([spec], seed=1) as simulator:
        drone = simulator.drones[0]
        assert drone.rtsp_port is not None
        async with viewer(drone.rtsp_port) as client:
            eye = await client.setup("live/front")
            await client.play()
            drone.firmware.receive(ardrone3.TakeOff(), asyncio.get_running_loop().time())
            await eye.until(
                lambda: any(
                    picture.metadata is not None and picture.metadata.flying_state is FlyingState.HOVERING
                    for picture in eye.pictures
                )
            )
        poses = [(entry.args["time"], entry.args["up"]) for entry in drone.log if entry.kind == "pose"]
        compared = 0
        for picture in eye.pictures:
            said = picture.metadata
            assert said is not None
            assert said.timestamp is not None
            taken = said.timestamp / 1e6
            around = [(one, two) for (t, one), (u, two) in itertools.pairwise(poses) if t <= taken < u]
            if around and said.altitude_ato is not None:
                low, high = sorted(around[0])
                assert low - 0.01 <= said.altitude_ato <= high + 0.01
                compared += said.altitude_ato > 0.1
        assert compared > 5
