"""OpenCV with ffmpeg opens the URIs that the gateway sends, each after its stream was chosen, over TCP and UDP."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.mav import CAMERA, Client
from support.own_address import own_address
from support.process import gateway_process, simulator_process
from support.world import VIDEO_PORT, loopback

from anafi_mav.access_token import read_token

pytestmark = pytest.mark.third_party

PICTURES = 40

SCRIPT = """
import json, os, sys
import cv2
for line in sys.stdin:
    transport, uri, count = line.split()
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = f"rtsp_transport;{transport}"
    capture = cv2.VideoCapture(uri, cv2.CAP_FFMPEG)
    shapes = []
    while len(shapes) < int(count) and capture.grab():
        ok, picture = capture.retrieve()
        shapes.append(picture.shape if ok else None)
    capture.release()
    print(json.dumps(shapes), flush=True)
"""
CONFIG = """
state: {state}
endpoints: ["tcpin://{gateway}:5760"]
video: {{host: {video}, rtsp_port: 0}}
http: off
drones: [{{name: alpha, sysid: 1, address: {drone}, rtsp_port: {port}}}]
"""
SIZES = {
    "thermal": [(1280, 720), (960, 720), (960, 720)],
    "ai": [(1920, 1080), (176, 90)],
}


class Player:
    """A program that uses OpenCV; each line that it reads is a stream to watch."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process

    async def watch(self, transport: str, uri: str) -> list[Any]:
        """Return the shapes of the first pictures."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{transport} {uri} {PICTURES}\n".encode())
        shapes: list[Any] = json.loads(await asyncio.wait_for(self._process.stdout.readline(), 60.0))
        return shapes


@asynccontextmanager
async def player() -> AsyncIterator[Player]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", SCRIPT), stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    try:
        yield Player(process)
    finally:
        process.kill()
        await process.wait()


async def described(client: Client) -> list[Any]:
    mark = client.mark()
    ack = await client.command(
        stock.MAV_CMD_REQUEST_MESSAGE, stock.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION, 0, target=(1, CAMERA)
    )
    assert ack.result == stock.MAV_RESULT_ACCEPTED
    return [message for _, message in client.since(mark, "VIDEO_STREAM_INFORMATION")]


@pytest.mark.parametrize("model", SIZES)
async def test_opencv_opens_each_stream_after_its_choice(model: str, tmp_path: Path) -> None:
    drone, gateway, config = loopback(), loopback(), tmp_path / "fleet.yaml"
    text = CONFIG.format(gateway=gateway, video=gateway, drone=drone, port=VIDEO_PORT, state=tmp_path / "state")
    config.write_text(text)
    options = ("--model", model, "--http-port", "0", "--rtsp-port", str(VIDEO_PORT))
    async with (
        simulator_process(drone, tmp_path / "sim.jsonl", *options),
        gateway_process(config, 100.0),
        player() as viewer,
    ):
        client = await Client().connect(5760, gateway)
        try:
            await client.heartbeat(lambda beat: True, timeout=20.0)
            streams = await described(client)
            assert [(one.resolution_h, one.resolution_v) for one in streams] == SIZES[model]
            for stream in reversed(streams):  # the last one that is chosen is the one shown at first
                assert stream.uri.startswith(f"rtsp://{gateway}:")
                start = stock.MAV_CMD_VIDEO_START_STREAMING
                ack = await client.command(start, stream.stream_id, target=(1, CAMERA), timeout=20.0)
                assert ack.result == stock.MAV_RESULT_ACCEPTED
                for transport in ("tcp", "udp"):
                    shapes = await viewer.watch(transport, stream.uri)
                    assert shapes == [[stream.resolution_v, stream.resolution_h, 3]] * PICTURES
                others = [one.uri for one in streams if one is not stream]
                assert [await viewer.watch("tcp", uri) for uri in others[:1]] == [[]]
        finally:
            await client.close()


async def test_opencv_on_another_computer_needs_the_token(tmp_path: Path) -> None:
    drone, gateway, config, here = loopback(), loopback(), tmp_path / "fleet.yaml", own_address()
    state = tmp_path / "state"
    config.write_text(CONFIG.format(gateway=gateway, video="0.0.0.0", drone=drone, port=VIDEO_PORT, state=state))
    options = ("--model", "4k", "--http-port", "0", "--rtsp-port", str(VIDEO_PORT))
    async with (
        simulator_process(drone, tmp_path / "sim.jsonl", *options),
        gateway_process(config, 100.0),
        player() as viewer,
    ):
        token = read_token(state)
        assert token is not None
        client = await Client().connect(5760, gateway)
        try:
            await client.heartbeat(lambda beat: True, timeout=20.0)
            (stream,) = await described(client)
            assert stream.uri.startswith(f"rtsp://{gateway}:")
            assert token.text not in stream.uri
        finally:
            await client.close()
        path = stream.uri.removeprefix(f"rtsp://{gateway}")
        for transport in ("tcp", "udp"):
            for user in ("", "viewer:wrong@"):
                assert await viewer.watch(transport, f"rtsp://{user}{here}{path}") == []
            shapes = await viewer.watch(transport, f"rtsp://viewer:{token.text}@{here}{path}")
            assert shapes == [[stream.resolution_v, stream.resolution_h, 3]] * PICTURES
        assert len(await viewer.watch("tcp", stream.uri)) == PICTURES  # this computer needs none
