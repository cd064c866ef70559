"""The live picture for browsers (WHEP), with aiortc in place of a browser and a simulated drone."""

from __future__ import annotations

import asyncio
import itertools
import re
import sys

import aiohttp
import pytest
from support import whep
from support.mav import CAMERA
from support.pictures import strip
from support.world import World, world

from anafi_mav.arsdk.video.rtp_h264 import Picture
from anafi_mav.drone import Drone
from anafi_mav.mavlink.dialect import MAV_CMD_VIDEO_START_STREAMING, MAV_RESULT_ACCEPTED
from anafi_mav.relay.admission import MAX_WAITING
from anafi_mav.relay.feed import Feed
from anafi_mav.relay.source import DroneSource
from anafi_mav.sim.video.h264 import encoder
from anafi_mav.web import live_video, webrtc
from anafi_mav.web.live_video import LiveVideo
from anafi_mav.web.server import HttpServer
from anafi_mav.web.webrtc import PictureTrack

UNTIL = 20.0


def root(w: World) -> str:
    assert w.gateway.web is not None
    return f"http://127.0.0.1:{w.gateway.web.port}"


def viewers(w: World) -> int:
    assert w.gateway.relay is not None
    return w.gateway.relay.viewers


async def no_viewers(w: World) -> None:
    end = asyncio.get_running_loop().time() + UNTIL
    while viewers(w):
        assert asyncio.get_running_loop().time() < end
        await asyncio.sleep(0.02)


async def test_browsers_watch_one_session_of_the_drone() -> None:
    async with world(speed=1.0) as w:
        mark = len(w.drone.log)
        async with whep.browser(root(w)) as one, whep.browser(root(w), "alpha") as other:
            for browser in (one, other):
                numbers = [strip(await browser.image())[0] for _ in range(40)]
                assert all(later > earlier for earlier, later in itertools.pairwise(numbers))
            assert viewers(w) == 2
            assert {*re.findall(r"a=candidate:\S+ 1 udp \d+ (\S+) ", one.answer)} == {"127.0.0.1"}
            assert f"profile-level-id={encoder(1280, 720).sps[1:4].hex()}" in one.answer
            assert await whep.delete(one.place) == 200
            await one.ended()
            assert viewers(w) == 1
            assert await whep.delete(one.place) == 404
        await no_viewers(w)
        commands = {entry.name for entry in list(w.drone.log)[mark:] if entry.kind == "command"}
        assert not {name for name in commands if "camera" in name.lower() or "thermal" in name.lower()}


async def test_session_ends_when_the_drone_shows_another_stream() -> None:
    async with world(model="thermal", speed=1.0) as w:
        async with whep.browser(root(w)) as browser:
            assert (await browser.image()).shape == (720, 1280, 3)
            ack = await w.client.command(MAV_CMD_VIDEO_START_STREAMING, 2, target=(1, CAMERA))
            assert ack.result == MAV_RESULT_ACCEPTED
            await browser.ended()
        async with whep.browser(root(w)) as browser:
            assert (await browser.image()).shape == (720, 960, 3)


async def test_requests_that_cannot_be_answered_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    async with world() as w:
        connection, sdp = await whep.offer()
        url = f"{root(w)}/whep/1"
        assert (await whep.post(f"{root(w)}/whep/9", sdp))[:2] == (404, "no drone '9'\n")
        assert (await whep.post(url, sdp, "application/json"))[0] == 415
        assert (await whep.post(url, b"\xff\xfe"))[0] == 400
        for wrong in ("", "v=0\r\n", sdp.replace("m=video", "m=audio"), sdp + sdp, sdp.replace("H264", "H265")):
            assert (await whep.post(url, wrong))[0] == 406
        for cut in range(100, len(sdp), 400):
            assert (await whep.post(url, sdp[:cut]))[0] in (201, 406)
        headers = {"Origin": "http://elsewhere.example", "Content-Type": live_video.SDP}
        async with aiohttp.ClientSession() as client, client.post(url, data=sdp, headers=headers) as answer:
            assert answer.status == 403
        monkeypatch.setattr(live_video, "MAX_BROWSERS", 0)
        assert (await whep.post(url, sdp))[0] == 503
        monkeypatch.setitem(sys.modules, "anafi_mav.web.webrtc", None)
        assert (await whep.post(url, sdp))[:2] == (501, f"{live_video.MISSING}\n")
        await connection.close()


async def test_drone_that_is_not_connected_has_no_picture() -> None:
    server = HttpServer(port=0)
    source = DroneSource(1, "alpha", Drone("127.0.0.1"))
    LiveVideo(server, lambda name: source)
    await server.start()
    connection, sdp = await whep.offer()
    try:
        answer = await whep.post(f"http://127.0.0.1:{server.port}/whep/1", sdp)
        assert answer[:2] == (503, "alpha is not connected\n")
    finally:
        await connection.close()
        await source.close()
        await server.close()


async def test_browser_that_never_connects_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webrtc, "CONNECT_LIMIT", 0.2)
    monkeypatch.setattr(live_video, "MAX_BROWSERS", 1)
    async with world() as w:
        connection, sdp = await whep.offer()
        url = f"{root(w)}/whep/1"
        status, _, place = await whep.post(url, sdp)
        assert status == 201
        assert (await whep.post(url, sdp))[0] == 503
        end = asyncio.get_running_loop().time() + UNTIL
        while (await whep.post(url, sdp))[0] != 201:
            assert asyncio.get_running_loop().time() < end
        assert await whep.delete(root(w) + place) == 404
        await connection.close()


SPS, PPS = bytes.fromhex("6742c01e95a0280f68"), bytes.fromhex("68ce3c80")
KEY_BYTES = 60_000


def fed(feed: Feed, number: int) -> webrtc.PackedPicture:
    """The picture of that number; each 30th is an entry."""
    units = (SPS, PPS, b"\x65" + bytes([1]) * KEY_BYTES) if number % 30 == 0 else (b"\x41" + bytes([1]) * 20_000,)
    packed = feed.add(Picture(3000 * number, units, None, True), number / 30)
    assert packed is not None
    return packed


async def test_new_browser_gets_everything_since_the_last_entry() -> None:
    feed, track = Feed(1, 0, 0), PictureTrack()
    kept = [fed(feed, number) for number in range(35)][30:]
    track.begin(feed, 35 / 30)
    track.show(fed(feed, 35), 35 / 30)
    packets = [await track.recv() for _ in range(6)]
    starts = [bytes(packet)[4] & 0x1F for packet in packets]
    assert starts == [7, 1, 1, 1, 1, 1]  # parameter sets first
    times = [packet.pts for packet in packets]
    # Those at once are 1 ms apart, up to the newest; the next has its own time.
    assert times == [kept[-1].timestamp - 90 * step for step in (4, 3, 2, 1, 0)] + [kept[-1].timestamp + 3000]
    track.stop()


async def test_slow_session_drops_pictures_until_the_next_entry() -> None:
    feed, track = Feed(1, 0, 0), PictureTrack()
    fed(feed, 0)
    track.begin(feed, 0.0)
    number = 0
    for number in range(1, 200):
        track.show(fed(feed, number), number / 30)
        assert track.waiting <= MAX_WAITING + KEY_BYTES
    assert track.counts["dropped pictures"] > 100
    while track.waiting:
        await track.recv()
    for number in range(200, 215):
        track.show(fed(feed, number), number / 30)
    assert bytes(await track.recv())[4] & 0x1F == 7  # it begins at a key picture
    track.stop()
    with pytest.raises(webrtc.MediaStreamError):
        await track.recv()
