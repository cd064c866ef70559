"""Video streams (conformance A8): described by MAVLink, watched by RTSP, chosen by command."""

from __future__ import annotations

from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support import flavours
from support.mav import CAMERA, NAN, Client
from support.missions import ACTIVE, put, said, start, state, takeoff, way
from support.plans import Item
from support.rtsp_client import viewer
from support.video_server import VideoServer
from support.world import HOME, loopback, world

from anafi_mav.arsdk.messages.thermal import RenderingMode, ThermalMode
from anafi_mav.arsdk.video.rtcp import Goodbye
from anafi_mav.arsdk.video.rtsp import split_url
from anafi_mav.config import VideoConfig
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode
from anafi_mav.drone.payload.camera_state import PhotoSettings
from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.errors import CommandRejected

RUNNING, THERMAL = stock.VIDEO_STREAM_STATUS_FLAGS_RUNNING, stock.VIDEO_STREAM_STATUS_FLAGS_THERMAL
ACCEPTED, DENIED = stock.MAV_RESULT_ACCEPTED, stock.MAV_RESULT_DENIED
TARGET = (1, CAMERA)

STREAMS = {
    "4k": [("Visible", 1280, 720, 0)],
    "thermal": [("Visible", 1280, 720, 0), ("Thermal", 960, 720, THERMAL), ("Blended", 960, 720, THERMAL)],
    "usa": [("Visible", 1280, 720, 0), ("Thermal", 960, 720, THERMAL), ("Blended", 960, 720, THERMAL)],
    "ai": [("Visible", 1920, 1080, 0), ("Disparity", 176, 90, 0)],
}


async def informed(client: Client, id: float = 0) -> list[Any]:
    """The streams as REQUEST_MESSAGE gives them."""
    return await _asked(client, stock.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION, "VIDEO_STREAM_INFORMATION", id)


async def reported(client: Client, id: float = 0) -> list[Any]:
    """The state of the streams as REQUEST_MESSAGE gives it."""
    return await _asked(client, stock.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS, "VIDEO_STREAM_STATUS", id)


async def _asked(client: Client, message: int, name: str, id: float) -> list[Any]:
    mark = client.mark()
    ack = await client.command(stock.MAV_CMD_REQUEST_MESSAGE, message, id, target=TARGET)
    found = [one for _, one in client.since(mark, name)]
    assert (ack.result == ACCEPTED) == bool(found)
    assert all((one.get_srcSystem(), one.get_srcComponent()) == TARGET for one in found)
    return found


async def show(client: Client, id: int) -> Any:
    return (await client.command(stock.MAV_CMD_VIDEO_START_STREAMING, id, target=TARGET)).result


@asynccontextmanager
async def opened(uri: str) -> Any:
    """A viewer that plays what is at a URI."""
    url = split_url(uri)
    assert url is not None
    async with viewer(url[1]) as client:
        await client.describe(url[2])
        eye = await client.setup(f"{url[2]}/video")
        await client.play(url[2])
        yield client, eye


async def refusal(uri: str) -> tuple[int, str]:
    url = split_url(uri)
    assert url is not None
    async with viewer(url[1]) as client:
        answer = await client.ask("DESCRIBE", url[2])
        return answer.status, answer.reason


@flavours.both
@pytest.mark.parametrize("model", STREAMS)
async def test_conf_091_streams_are_described_one_by_one_and_all(flavour: str, model: str) -> None:
    async with world(model=model, flavour=flavour) as w:
        expected = STREAMS[model]
        for id in (0, NAN):
            streams = await informed(w.client, id)
            assert [(s.name, s.resolution_h, s.resolution_v, s.flags & THERMAL) for s in streams] == expected
        assert [(s.stream_id, s.count, s.type, s.encoding) for s in streams] == [
            (number, len(expected), stock.VIDEO_STREAM_TYPE_RTSP, 1) for number in range(1, len(expected) + 1)
        ]
        assert [bool(s.flags & RUNNING) for s in streams] == [True] + [False] * (len(expected) - 1)
        for stream in streams:
            (same,) = await informed(w.client, stream.stream_id)
            assert same.to_dict() == stream.to_dict()
            (status,) = await reported(w.client, stream.stream_id)
            assert (status.flags, status.resolution_h) == (stream.flags, stream.resolution_h)
        for id in (len(expected) + 1, -1, 1.5):
            assert await informed(w.client, id) == []
            assert await reported(w.client, id) == []
        for command, name in (
            (stock.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION, "VIDEO_STREAM_INFORMATION"),
            (stock.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS, "VIDEO_STREAM_STATUS"),
        ):
            mark = w.client.mark()
            assert (await w.client.command(command, 1, target=TARGET)).result == ACCEPTED
            assert [one.stream_id for _, one in w.client.since(mark, name)] == [1]
            assert (await w.client.command(command, 9, target=TARGET)).result == DENIED


@pytest.mark.parametrize("model", ["thermal", "usa", "ai"])
async def test_conf_091_each_uri_opens_once_its_stream_is_shown(model: str) -> None:
    async with world(model=model, clients=2, speed=1.0) as w:
        client, other = w.clients
        streams = await informed(client)
        for stream in [*streams[1:], streams[0]]:
            mark, observed = client.mark(), other.mark()
            before = [one.uri for one in await informed(client) if one.flags & RUNNING]
            status, reason = await refusal(stream.uri)
            assert (status, "alpha shows its" in reason) == (503, True)
            # Neither that nor its refusal has changed what is shown.
            assert [one.uri for one in await informed(client) if one.flags & RUNNING] == before
            assert await show(client, stream.stream_id) == ACCEPTED
            for station, since in ((client, mark), (other, observed)):
                await station.wait(
                    "VIDEO_STREAM_STATUS",
                    lambda m, id=stream.stream_id: m.stream_id == id and m.flags & RUNNING,
                    since=since,
                )
            flags = [one.flags for one in await reported(client)]
            assert [bool(flag & RUNNING) for flag in flags] == [one.uri == stream.uri for one in streams]
            async with opened(stream.uri) as (_, eye):
                assert (await eye.first(3))[0].is_key
        if model != "ai":
            modes = [entry.args["mode"] for entry in w.commands("thermal.set_mode")]
            assert modes == [ThermalMode.BLENDED, ThermalMode.DISABLED]
            rendered = [entry.args["mode"] for entry in w.commands("thermal.set_rendering")]
            assert rendered == [RenderingMode.THERMAL, RenderingMode.BLENDED]


async def test_conf_137_stream_of_a_camera_that_does_not_exist_is_denied() -> None:
    async with world(model="thermal") as w:
        start, stop = stock.MAV_CMD_VIDEO_START_STREAMING, stock.MAV_CMD_VIDEO_STOP_STREAMING
        for camera, result in ((2, DENIED), (101, DENIED), (100, ACCEPTED), (NAN, ACCEPTED)):
            for command in (start, stop):
                assert (await w.client.command(command, 2, camera, target=TARGET)).result == result
            shown = [one.stream_id for one in await informed(w.client) if one.flags & RUNNING]
            assert shown == [2 if result == ACCEPTED else 1]


async def test_conf_137_thermal_stream_follows_the_thermal_camera() -> None:
    async with world(model="thermal", speed=1.0) as w:
        visible, thermal, _ = await informed(w.client)
        drone = w.gateway.systems[0].drone
        async with opened(visible.uri) as (viewing, eye):
            await eye.first(3)
            mark = w.client.mark()
            await drone.thermal.set_mode(ThermalMode.STANDARD)  # as the pilot's app does
            await w.client.wait(
                "VIDEO_STREAM_STATUS", lambda m: m.stream_id == thermal.stream_id and m.flags & RUNNING, since=mark
            )
            # Its viewers are notified that nothing more comes.
            await eye.until(lambda: any(isinstance(one, Goodbye) for one in eye.reports))
            assert await viewing.reader.read() == b""
        assert (await refusal(visible.uri))[0] == 503
        async with opened(thermal.uri) as (_, eye):
            assert (await eye.first(3))[0].is_key
        last = [e for e in w.drone.log if e.kind == "video" and e.name == "play"][-1]
        assert last.args["streams"] == ["ParrotThermalVideo"]


async def test_conf_137_stream_stays_while_a_camera_records() -> None:
    async with world(model="thermal") as w:
        drone = w.gateway.systems[0].drone
        await drone.camera.set_mode(CameraMode.RECORDING)
        await drone.camera.start_recording()
        mark = w.client.mark()
        assert await show(w.client, 2) == stock.MAV_RESULT_TEMPORARILY_REJECTED
        text = await w.client.wait("STATUSTEXT", lambda m: "stream" in m.text.lower(), since=mark)
        assert text.text == "Video stream refused: camera is recording"
        assert await show(w.client, 1) == ACCEPTED  # that one is shown
        assert await show(w.client, 0) == ACCEPTED
        assert await show(w.client, 4) == DENIED
        assert w.commands("thermal.set_mode") == []
        await drone.camera.stop_recording()
        assert await show(w.client, 2) == ACCEPTED


async def test_conf_137_thermal_stream_ends_no_photos() -> None:
    async with world(model="thermal") as w:
        drone = w.gateway.systems[0].drone
        await drone.camera.set_mode(CameraMode.PHOTO)
        await drone.camera.set_photo(PhotoSettings(mode=PhotoMode.TIME_LAPSE, interval=2.0))
        await drone.camera.take_photo()
        mark = w.client.mark()
        assert await show(w.client, 2) == stock.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "Video stream refused: camera takes photos", since=mark)
        with pytest.raises(CommandRejected, match="photos"):
            await drone.streams.show(StreamKind.THERMAL)
        assert w.commands("thermal.set_mode") == []
        await drone.camera.stop_photo()
        assert await show(w.client, 2) == ACCEPTED


async def test_conf_137_stream_stays_while_a_mission_needs_the_camera() -> None:
    photo = Item(stock.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p1=0.0, p2=0.0, p3=1.0, p4=1.0, frame=2)
    async with world(model="thermal", web=True, speed=8.0) as w:
        await put(w, [takeoff(5.0), way(60.0, 0.0, 5.0), photo, way(60.0, 5.0, 5.0)])
        await start(w)
        await state(w, ACTIVE, seq=1)
        mark = w.client.mark()
        assert await show(w.client, 2) == stock.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "Video stream refused: mission uses camera", since=mark)
        assert (await w.client.command(stock.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == ACCEPTED
        assert await show(w.client, 3) == ACCEPTED


async def test_conf_091_stop_of_one_client_ends_no_view_of_another() -> None:
    async with world(clients=2, speed=1.0) as w:
        (stream,) = await informed(w.client)
        async with opened(stream.uri) as (_, eye):
            await eye.first(3)
            for id in (0, 1):
                ack = await w.clients[1].command(stock.MAV_CMD_VIDEO_STOP_STREAMING, id, target=TARGET)
                assert ack.result == ACCEPTED
            await eye.look(30)
            ack = await w.clients[1].command(stock.MAV_CMD_VIDEO_STOP_STREAMING, 2, target=TARGET)
            assert ack.result == DENIED
            (status,) = await reported(w.client)
            assert status.framerate == pytest.approx(30.0, abs=3.0)
            assert status.bitrate > 0


async def test_conf_091_viewer_stays_while_the_link_fades() -> None:
    async with world(speed=1.0) as w:
        (stream,) = await informed(w.client)
        async with opened(stream.uri) as (_, eye):
            await eye.first(3)
            w.drone.faults.mute = True
            await w.client.silence("HEARTBEAT", 3.0)
            assert (await refusal(stream.uri)) == (503, "alpha is not connected")
            w.drone.faults.mute = False
            await w.client.heartbeat(lambda beat: True, timeout=20.0)
            await eye.look(30)


async def test_conf_091_switch_without_a_link_is_reported_after_it() -> None:
    async with world(model="ai", speed=8.0) as w:
        assert await show(w.client, 2) == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(stock.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)).result == ACCEPTED
        # It shows its main camera when it is back: the stereo camera is the choice of a connection.
        await w.client.wait(
            "VIDEO_STREAM_STATUS", lambda m: m.stream_id == 1 and m.flags & RUNNING, since=mark, timeout=30.0
        )


@pytest.mark.parametrize(
    ("video", "host"),
    [
        (VideoConfig(), "127.0.0.1"),
        (VideoConfig(host="0.0.0.0"), None),
        (VideoConfig(host="0.0.0.0", public_host="gateway.example"), "gateway.example"),
    ],
)
async def test_conf_091_uri_has_the_host_of_the_clients_link(video: VideoConfig, host: str | None) -> None:
    async with world(video=video) as w:
        (stream,) = await informed(w.client)
        assert w.gateway.relay is not None
        # The clients of these tests are on this computer, at an address of their own.
        assert split_url(stream.uri) == (host or w.address, w.gateway.relay.port, "1/visible")


@pytest.mark.parametrize(
    ("video", "local_host", "text"),
    [
        (VideoConfig(), "192.0.2.7", "Video open to this computer only: set video.host"),
        (VideoConfig(host="0.0.0.0"), None, "Video without URI: set video.public_host"),
    ],
)
async def test_conf_091_client_without_a_usable_uri_gets_one_text(
    video: VideoConfig, local_host: str | None, text: str
) -> None:
    async with world(video=video) as w:
        (channel,) = w.gateway.systems[0].channels
        channel.local_host = local_host  # as of a client on another computer, or on a serial line
        mark = w.client.mark()
        for _ in range(2):
            assert [stream.uri for stream in await informed(w.client)] == [""]
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT")] == [text]


async def test_conf_091_camera_has_no_streams_without_the_server() -> None:
    async with world(video=False) as w:
        mark = w.client.mark()
        (about,) = await _asked(w.client, stock.MAVLINK_MSG_ID_CAMERA_INFORMATION, "CAMERA_INFORMATION", 0)
        assert not about.flags & stock.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
        assert [stream.uri for stream in await informed(w.client)] == [""]
        assert w.client.since(mark, "STATUSTEXT") == []


async def test_end_of_the_gateway_hovers_before_video_ends() -> None:
    server = VideoServer(address=loopback())
    server.answers["TEARDOWN"] = lambda _: None  # it never answers
    async with server, world(speed=1.0, drone_address=server.address, rtsp_port=server.port) as w:
        (stream,) = await informed(w.client)
        await w.take_off()
        async with opened(stream.uri) as (_, eye):
            await eye.look(1)
            far = {"x": HOME[0] + 0.001, "y": HOME[1], "z": 8.0, "frame": stock.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
            ack = await w.client.command(stock.MAV_CMD_DO_REPOSITION, -1, 1, **far)
            assert ack.result == ACCEPTED
            await w.gateway.close()
        hovered = w.commands("ardrone3.Piloting.CancelMoveTo")[0].t
        (ended,) = [asked.at for asked in server.asked if asked.method == "TEARDOWN"]
        assert hovered < ended
