"""Pose at 30 Hz from the live video's metadata, judged by the simulator's true poses."""

from __future__ import annotations

import asyncio
import itertools
import math
import statistics
import time
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support import clock
from support.fault_scenarios import goto
from support.mav import CAMERA, NAN, Client
from support.poses import pose_at
from support.rtsp_client import viewer
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.video.rtcp import SenderReport
from anafi_mav.arsdk.video.rtsp import split_url
from anafi_mav.mavlink import dialect
from anafi_mav.sim.skycontroller import PITCH
from anafi_mav.sim.world.quirks import Quirk

ACCEPTED, REJECTED = stock.MAV_RESULT_ACCEPTED, stock.MAV_RESULT_TEMPORARILY_REJECTED
SET, GET, REQUEST = (
    stock.MAV_CMD_SET_MESSAGE_INTERVAL,
    stock.MAV_CMD_GET_MESSAGE_INTERVAL,
    stock.MAV_CMD_REQUEST_MESSAGE,
)
IDS = {kind.msgname: id for id, kind in dialect.mavlink_map.items()}
REPOSITION, RELATIVE = stock.MAV_CMD_DO_REPOSITION, stock.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
POSE = ["ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "VFR_HUD"]
BY_MICROSECONDS = ["ALTITUDE", "ODOMETRY"]
EPOCH = 1_767_268_800.25
QUICK = 0.005
"""s that the machine may keep these tests waiting while each picture is judged; else they are judged by the median."""

LATENCY = 0.1
"""s of a picture's age: what an ANAFI's exposure, encoder and radio take, roughly."""


async def want(client: Client, name: str, hz: float) -> None:
    assert (await client.command(SET, IDS[name], 1e6 / hz)).result == ACCEPTED, name


async def interval(client: Client, name: str) -> float:
    """s, by MESSAGE_INTERVAL."""
    mark = client.mark()
    assert (await client.command(GET, IDS[name])).result == ACCEPTED
    return (
        float((await client.wait("MESSAGE_INTERVAL", lambda m: m.message_id == IDS[name], since=mark)).interval_us)
        / 1e6
    )


def require_video(w: World) -> Any:
    if w.drone.rtsp_port is None:
        pytest.skip(w.drone.rtsp_problem)
    return w.gateway.systems[0].drone.video


def started(w: World) -> float:
    """When the clock of the messages was 0, s of this host."""
    now = asyncio.get_running_loop().time()
    return now - w.gateway.systems[0].times(now).boot_us / 1e6


def truth(w: World, seconds: float) -> dict[str, float]:
    """The true pose at a time since the gateway's start."""
    return pose_at([{"kind": e.kind, "t": e.t, "args": e.args} for e in w.drone.log], started(w) + seconds)


def angle(a: float, b: float) -> float:
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


def times(client: Client, name: str, since: int) -> list[int]:
    return [m.time_boot_ms for _, m in client.since(since, name)]


@pytest.mark.parametrize(
    ("model", "flavour", "quirk"),
    [
        ("4k", "px4", None),
        ("4k", "px4", Quirk.ROLL_INVERTED),
        ("thermal", "px4", None),
        ("usa", "ardupilot", None),
        ("ai", "ardupilot", None),
    ],
)
async def test_pose_at_30_hz_is_the_truth_of_its_time(model: str, flavour: str, quirk: Quirk | None) -> None:
    async with world(model=model, flavour=flavour, speed=1.0, video_latency=LATENCY) as w:
        video = require_video(w)
        await w.take_off(10.0)
        if quirk is not None:
            w.drone.faults.quirks = frozenset({quirk})
        for name in [*POSE, *BY_MICROSECONDS, "ANAFI_PICTURE"]:
            await want(w.client, name, 30.0)
        place = geo.destination(*HOME[:2], 40.0, 60.0)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=RELATIVE, x=place[0], y=place[1], z=12.0)
        assert ack.result == ACCEPTED  # without a heading: it leans to the side
        await w.client.wait("ANAFI_PICTURE", timeout=10.0)
        # Its climb begins with a jerk, of which the log's ten poses a second are no truth.
        await w.client.wait("LOCAL_POSITION_NED", lambda m: m.vz < -1.5, timeout=10.0)
        mark = w.client.mark()
        async with clock.stalls() as stalls:
            await asyncio.sleep(4.0)
        is_quick = stalls.longest < QUICK
        assert video.state.playing
        seen = {name: w.client.since(mark, name) for name in [*POSE, *BY_MICROSECONDS, "ANAFI_PICTURE"]}
        for name, messages in seen.items():
            rate = (len(messages) - 1) / (messages[-1][0] - messages[0][0])
            assert rate == pytest.approx(30.0, rel=0.05), name
            assert await interval(w.client, name) == pytest.approx(1 / 30, rel=0.05), name
        await asyncio.sleep(0.3)  # the log reaches beyond the last picture
        pictures = {m.time_boot_ms: m for _, m in seen["ANAFI_PICTURE"]}
        rolls = 0
        for _, m in seen["ATTITUDE"][::5]:
            pose = truth(w, m.time_boot_ms / 1e3)
            assert angle(m.roll, pose["roll"]) < 0.05
            assert angle(m.pitch, pose["pitch"]) < 0.05
            assert angle(m.yaw, pose["yaw"]) < 0.05
            assert m.time_boot_ms in pictures
            rolls += abs(pose["roll"]) > 0.1
        assert rolls  # the sign was judged
        for _, m in seen["LOCAL_POSITION_NED"][::5]:
            pose = truth(w, m.time_boot_ms / 1e3)
            assert math.hypot(m.x - pose["north"], m.y - pose["east"]) < 0.15
            assert m.z == pytest.approx(-pose["up"], abs=0.1)
            assert (m.vx, m.vy, m.vz) == pytest.approx((pose["vn"], pose["ve"], pose["vd"]), abs=0.2)
        for _, m in seen["GLOBAL_POSITION_INT"][::5]:
            pose = truth(w, m.time_boot_ms / 1e3)
            north, east = geo.offset(HOME[0], HOME[1], m.lat / 1e7, m.lon / 1e7)
            assert math.hypot(north - pose["north"], east - pose["east"]) < 0.15
            assert m.relative_alt / 1e3 == pytest.approx(pose["up"], abs=0.1)
            assert m.alt / 1e3 == pytest.approx(HOME[2] + pose["up"], abs=0.6)
        for _, m in seen["ALTITUDE"][::5]:
            assert m.bottom_clearance == pytest.approx(truth(w, m.time_usec / 1e6)["up"], abs=0.1)
        ages = [m.age for _, m in seen["ANAFI_PICTURE"]]
        assert min(ages) > LATENCY * 1e3 - 20
        assert (max if is_quick else statistics.median)(ages) < LATENCY * 1e3 + 20
        beside: list[float] = []
        for (_, a), (_, b) in itertools.pairwise(seen["ANAFI_PICTURE"]):
            assert b.time_boot_ms > a.time_boot_ms
            ticks = (b.rtp_timestamp - a.rtp_timestamp) % (1 << 32)
            assert ticks / 90 == pytest.approx(b.time_boot_ms - a.time_boot_ms, abs=1.1)
            beside.append(abs(b.drone_time_us - a.drone_time_us - ticks / 90 * 1e3))
            assert b.clock == dialect.ANAFI_PICTURE_CLOCK_REPORT
        assert (max if is_quick else statistics.median)(beside) <= 10_000  # us
        for name in seen:
            await w.client.command(SET, IDS[name], 0)
        while video.state.playing:
            await w.client.wait("ATTITUDE")


async def test_video_opens_only_for_set_message_interval_above_10_hz() -> None:
    async with world(flavour="ardupilot", speed=1.0) as w:
        video = require_video(w)
        for rate in (30, 50):
            w.client.send(stock.MAVLink_request_data_stream_message(1, 1, stock.MAV_DATA_STREAM_ALL, rate, 1))
            w.client.send(stock.MAVLink_request_data_stream_message(1, 1, stock.MAV_DATA_STREAM_EXTRA1, rate, 1))
        await want(w.client, "ATTITUDE_QUATERNION", 10.0)
        await asyncio.sleep(2.0)
        assert not w.drone.log.find("video", "play")
        assert await interval(w.client, "ATTITUDE") == pytest.approx(0.2, rel=0.1)
        await want(w.client, "ATTITUDE", 30.0)
        await w.drone.wait_log(lambda e: e.kind == "video" and e.name == "play", 5.0)
        while await interval(w.client, "ATTITUDE") > 0.04:
            await w.client.wait("ATTITUDE")
        # The group's rate replaces the client's: the video ends.
        w.client.send(stock.MAVLink_request_data_stream_message(1, 1, stock.MAV_DATA_STREAM_EXTRA1, 30, 1))
        while video.state.playing:
            await w.client.wait("ATTITUDE")


async def test_pose_from_events_is_what_the_configuration_demands() -> None:
    async with world(speed=1.0, pose="events") as w:
        require_video(w)
        await want(w.client, "ATTITUDE", 30.0)
        await want(w.client, "ANAFI_PICTURE", 30.0)
        await asyncio.sleep(2.0)
        assert not w.drone.log.find("video", "play")
        assert await interval(w.client, "ATTITUDE") == pytest.approx(0.2, rel=0.1)
        assert (await w.client.command(REQUEST, IDS["ANAFI_PICTURE"])).result == REJECTED


async def test_events_take_over_from_pictures_that_stop_and_back() -> None:
    async with world(speed=1.0, clients=2, video_latency=LATENCY) as w:
        require_video(w)
        fast, slow = w.clients
        await w.take_off(5.0)
        begin = fast.mark()
        for name in ("ATTITUDE", "LOCAL_POSITION_NED"):
            await want(fast, name, 30.0)
        while await interval(fast, "ATTITUDE") > 0.04:
            await fast.wait("ATTITUDE")
        for _ in range(3):
            await asyncio.sleep(1.0)
            mark = fast.mark()
            assert (await fast.command(REQUEST, IDS["ATTITUDE"])).result == ACCEPTED
            await asyncio.sleep(0.5)
            assert len(fast.since(mark, "ATTITUDE")) > 12
            w.drone.faults.no_pictures = True
            await asyncio.sleep(0.15)  # the last one is on its way
            mark, stopped = fast.mark(), asyncio.get_running_loop().time()
            for name in ("ATTITUDE", "LOCAL_POSITION_NED"):
                await fast.wait(name, since=mark, timeout=1.0)
            assert asyncio.get_running_loop().time() - stopped < 1.0
            assert (await fast.command(REQUEST, IDS["ATTITUDE"])).result == ACCEPTED
            await asyncio.sleep(1.0)
            assert await interval(fast, "ATTITUDE") == pytest.approx(0.2, rel=0.2)
            w.drone.faults.no_pictures = False
            while await interval(fast, "ATTITUDE") > 0.04:
                await fast.wait("ATTITUDE")
        for client in (fast, slow):
            for name in ("ATTITUDE", "LOCAL_POSITION_NED"):
                stamps = times(client, name, begin if client is fast else 0)
                assert stamps == sorted(stamps), name
        # The other client kept its events, which are newer than a picture.
        began = started(w)
        ages = [at - began - m.time_boot_ms / 1e3 for at, m in slow.since(0, "ATTITUDE")[-20:]]
        assert max(ages) < 0.05


async def test_pose_without_video_remains_that_of_events() -> None:
    async with world(speed=1.0) as w:
        require_video(w)
        w.drone.faults.no_pictures = True
        await want(w.client, "ATTITUDE", 30.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Pose from events: no video"), timeout=20.0)
        assert await interval(w.client, "ATTITUDE") == pytest.approx(0.2, rel=0.1)


async def test_skycontroller_sticks_arrive_at_100_hz() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        controller = w.drone.skycontroller
        assert controller is not None
        await w.take_off()
        await want(w.client, "ANAFI_CONTROLLER_INPUT", 200.0)
        assert await goto(w, 100.0, 10.0) == ACCEPTED
        await w.client.wait("ANAFI_CONTROLLER_INPUT", lambda m: m.grabbed_axes)
        mark = w.client.mark()
        for percent in range(100):
            controller.stick(PITCH, percent % 9)
            await asyncio.sleep(0.01)
        assert len(w.client.since(mark, "ANAFI_CONTROLLER_INPUT")) == pytest.approx(100, abs=12)


async def test_picture_of_the_relay_is_joined_with_its_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the relay's sender reports and SYSTEM_TIME alone, as docs/pose.md says."""
    monkeypatch.setattr(time, "time", lambda: EPOCH + time.monotonic())  # the clock of tests has no time of day
    async with world(speed=1.0, video_latency=0.117) as w:  # three and a half pictures
        require_video(w)
        await want(w.client, "ANAFI_PICTURE", 30.0)
        information = stock.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
        assert (await w.client.command(REQUEST, information, 1, target=(1, CAMERA))).result == ACCEPTED
        url = split_url((await w.client.wait("VIDEO_STREAM_INFORMATION", since=0)).uri)
        assert url is not None
        async with viewer(url[1]) as watching:
            await watching.describe(url[2])
            eye = await watching.setup(f"{url[2]}/video")
            await watching.play(url[2])
            await eye.look(90)
        system = await w.client.wait("SYSTEM_TIME")
        boot = system.time_unix_usec / 1e6 - system.time_boot_ms / 1e3
        report = [r for r in eye.reports if isinstance(r, SenderReport)][-1]
        shots = [m for _, m in w.client.since(0, "ANAFI_PICTURE")]
        offsets = set()
        for picture in eye.pictures[-30:]:
            ticks = (picture.timestamp - report.timestamp + (1 << 31)) % (1 << 32) - (1 << 31)
            taken = report.time / 1e6 + ticks / 90_000 - boot
            shot = min(shots, key=lambda m, t=taken: abs(m.time_boot_ms / 1e3 - t))
            assert shot.time_boot_ms / 1e3 == pytest.approx(taken, abs=0.005)
            offsets.add((picture.timestamp - shot.rtp_timestamp) % (1 << 32))
        assert len(offsets) == 1  # each picture has found its own
