"""Parrot's Olympe watches the simulated models: pictures, and metadata that is the flight in the simulator's log."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import math
import re
import socket
import sys
from bisect import bisect
from pathlib import Path
from typing import Any

import pytest
from support.process import simulator_process
from support.world import loopback

from anafi_mav.geo import offset
from anafi_mav.units import quaternion_from_euler

SCRIPT = Path(__file__).with_name("olympe_video.py")

RTSP_PORT, HTTP_PORT = 8554, 8080
"""Of the simulator where Olympe can be told, so that nobody needs the right to listen on 554."""
SPEED = "2"

HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so one of Olympe's timers came late",
    r"ulog - mux - mux_channel_ip_disconnected err=2": "the web server closed what Olympe has just closed itself",
    r"Video output files won't open for stream": "the pictures are looked at and not written to a file",
    r"VideoDecoder#\d+: coded video media format H264/AVCC not supported": (
        "pdraw offers its decoder the stream in both forms, and the decoder takes the other"
    ),
    r"_media_removed - Received removed event from unknown ID": (
        "pdraw tells of the stream in the form that nobody asked for"
    ),
    r"ulog - pomp - event \S+ is still attached to loop": "Olympe destroys the queue of a stream before its event",
    r"mbuf_base_frame_queue_deinit:\d+: pomp_evt_destroy err=16": "the same",
    r"pdraw_dmxstrm - EVT:STREAM;event='\w+';.*status=0;": "pdraw's record of what went well",
}
"""Lines at WARNING and above that Olympe writes without the simulator's fault, also at an aircraft."""

SIZES = {
    "DefaultVideo": [1280, 720],
    "ParrotThermalVideo": [960, 720],
    "ParrotThermalBlendedVideo": [960, 720],
    "Front camera": [1920, 1080],
    "Disparity map": [176, 90],
}

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


async def olympe(*arguments: str) -> tuple[dict[str, Any], str]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(SCRIPT), *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        out, err = await asyncio.wait_for(process.communicate(), 100.0)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert out, err.decode()
    return json.loads(out), err.decode()


async def visit(
    model: str, kind: str, names: list[str], path: Path, *options: str, replay: bool = False
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """What Olympe reports, all steps and its log checked, and the simulator's own log."""
    address = loopback()
    async with simulator_process(address, path, "--model", model, "--speed", SPEED, "--seed", "1", *options):
        report, err = await olympe(address, kind, str(RTSP_PORT), str(HTTP_PORT if replay else 0), *names)
    assert {name: result for name, result in report["steps"].items() if result is not True} == {}, err[-3000:]
    complaints = [line for line in err.splitlines() if re.search(r"\[(WARNING|ERROR|CRITICAL)\]|Traceback", line)]
    assert [line for line in complaints if not any(re.search(known, line) for known in HARMLESS)] == []
    assert "unknown message" not in err.lower()
    return report, read(path)


def may_open(port: int) -> bool:
    with socket.socket() as probe:
        try:
            probe.bind((loopback(), port))
        except PermissionError:
            return False
    return True


def read(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


Pose = dict[str, float]


class Truth:
    """The flight as the simulator logged it, ten times a second."""

    def __init__(self, log: list[dict[str, Any]]) -> None:
        self._poses: list[tuple[float, Pose]] = [
            (entry["args"]["time"], entry["args"]) for entry in log if entry["kind"] == "pose"
        ]
        self._times = [t for t, _ in self._poses]

    def around(self, t: float) -> tuple[Pose, Pose] | None:
        """The last pose before a time and the first after it; None: the simulator did not get to run there."""
        index = bisect(self._times, t)
        if not 0 < index < len(self._poses):
            return None
        (before, one), (after, two) = self._poses[index - 1 : index + 1]
        return (one, two) if after - before < 0.15 * float(SPEED) else None


def check_flight(said: list[dict[str, Any]], log: list[dict[str, Any]], *, modern: bool) -> None:
    """Every picture tells the pose of its moment, which lies between two in the log."""
    truth = Truth(log)
    home = next(entry["args"] for entry in log if entry["kind"] == "pose")
    compared = 0
    for picture in said:
        drone, camera = picture["drone"], picture["camera"]
        poses = truth.around(camera["timestamp"] / 1e6)
        if poses is None:
            continue
        compared += 1
        place, speed = drone["location"], drone["speed"]
        north, east = offset(home["lat"], home["lon"], place["latitude"], place["longitude"])
        told = {
            "north": north,  # steps of version 3 are 3 cm
            "east": east,
            "up": drone["ground_distance"],
            "vn": speed["north"],
            "ve": speed["east"],
            "vd": speed["down"],
        }
        if modern:
            told["ato"] = drone["altitude_ato"]
            assert drone["position"]["north"] == pytest.approx(north, abs=0.02)
            assert drone["position"]["east"] == pytest.approx(east, abs=0.02)
            assert drone["position"]["down"] == pytest.approx(-drone["altitude_ato"], abs=1e-3)
        for key, value in told.items():
            low, high = sorted(pose[key] for pose in poses)
            assert low - 0.1 <= value <= high + 0.1, (key, value, poses)
        assert place["altitude_egm96amsl"] == pytest.approx(35.0 + drone["ground_distance"], abs=0.01)
        attitudes = [quaternion_from_euler(pose["roll"], pose["pitch"], pose["yaw"]) for pose in poses]
        # The gimbal keeps the picture level; it looks where the drone does.
        level = [quaternion_from_euler(0.0, 0.0, pose["yaw"]) for pose in poses]
        for turn, (one, two) in ((drone["quat"], attitudes), (camera["quat"], level)):
            way = same_turn(dict(zip("wxyz", one, strict=True)), two)
            assert same_turn(turn, one) + same_turn(turn, two) <= way + math.radians(4.0)
    assert compared > 0.8 * len(said)
    assert max(picture["drone"]["ground_distance"] for picture in said) > 2.5, "1 m of take-off and 2 by moveBy"


def same_turn(said: dict[str, float], true: tuple[float, float, float, float]) -> float:
    """The angle between two attitudes, rad."""
    product = abs(said["w"] * true[0] + said["x"] * true[1] + said["y"] * true[2] + said["z"] * true[3])
    return 2.0 * math.acos(min(1.0, product))


def check_camera(said: list[dict[str, Any]], *, modern: bool) -> None:
    """The zoom that was asked for is in the pictures, and what the cameras are set to."""
    first, last = said[0], said[-1]
    hfov = math.radians(68.0 if modern else 69.0)
    assert first["camera"]["hfov"] == pytest.approx(hfov, abs=1e-3)
    assert last["camera"]["hfov"] == pytest.approx(2.0 * math.atan(math.tan(hfov / 2.0) / 2.0), abs=1e-3)
    for picture in said:
        camera = picture["camera"]
        assert camera["vfov"] == pytest.approx(2.0 * math.atan(math.tan(camera["hfov"] / 2.0) * 9 / 16), abs=5e-3)
        assert (camera["exposure_time"], camera["iso_gain"]) == (pytest.approx(16.667, abs=0.01), 100)
        assert (camera["awb_r_gain"], camera["awb_b_gain"]) == pytest.approx((1.60, 2.05), abs=1e-3)
    assert [picture["camera"]["timestamp"] for picture in said] == sorted(
        picture["camera"]["timestamp"] for picture in said
    )
    links = [picture["links"] for picture in said]
    wifi = [{"wifi": {"goodput": 20000, "quality": 5, "rssi": -40}}]
    starfish = [
        {
            "starfish": {
                "links": [
                    {"type": "wlan", "status": "running", "quality": 5, "active": True},
                    {"type": "cellular", "status": "down", "quality": 0, "active": False},
                ],
                "quality": 5,
            }
        }
    ]
    assert all(link == (starfish if modern else wifi) for link in links)
    if modern:
        assert (first["camera"]["zoom_level"], last["camera"]["zoom_level"]) == (1.0, 2.0)
    # The states of the flight in their order.
    states = [state for state, before in zip(flown(said), [None, *flown(said)], strict=False) if state != before]
    assert states[0] == states[-1] == "FS_LANDED"
    assert states.index("FS_TAKINGOFF") < states.index("FS_HOVERING") < states.index("FS_LANDING")


def flown(said: list[dict[str, Any]]) -> list[str]:
    return [picture["drone"]["flying_state"] for picture in said]


def check_streams(report: dict[str, Any], names: list[str], log: list[dict[str, Any]]) -> None:
    """All of them came, whole: sky above ground, and as many pictures as were sent."""
    sent = {
        entry["args"]["stream"]: entry["args"] for entry in log if entry["name"] == "end" and entry["kind"] == "video"
    }
    for name in names:
        stream = report["streams"][name]
        assert (stream["size"], stream["shades"]) == (SIZES[name], [168, 88])
        assert stream["kinds"] == ["PROTO"], "Olympe turns version 3 into the protocol buffer"
        assert stream["session"]["title"] == name
        assert sent[name]["reports"] > 0
        # Olympe counts the first packet as missing; a busy machine may drop the last pictures at the end.
        assert sent[name]["lost"] <= 1
        if name != names[0]:
            assert len(stream["said"]) >= 30
        if len(names) > 1:
            beside = report["streams"][f"{name} beside others"]
            assert (beside["size"], beside["shades"]) == (SIZES[name], [168, 88])


@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("4k", ["DefaultVideo"]),
        ("thermal", ["DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"]),
        ("usa", ["DefaultVideo", "ParrotThermalBlendedVideo"]),
        ("ai", ["Front camera", "Disparity map"]),
    ],
)
async def test_olympe_watches_a_flight(model: str, names: list[str], tmp_path: Path) -> None:
    ports = ("--rtsp-port", str(RTSP_PORT), "--http-port", str(HTTP_PORT))
    report, log = await visit(model, "Drone", names, tmp_path / "sim.jsonl", *ports, replay=True)

    check_streams(report, names, log)
    said = report["streams"][names[0]]["said"]
    check_flight(said, log, modern=model == "ai")
    check_camera(said, modern=model == "ai")
    session = report["streams"][names[0]]["session"]
    product = {"4k": "0914", "thermal": "0919", "usa": "091e", "ai": "091a"}[model]
    assert (session["model_id"], session["picture_fov"]["horz"]) == (product, 68.0 if model == "ai" else 69.0)
    # A recording comes back picture by picture, to its end.
    replay = report["streams"]["replay"]
    assert replay["coded"] == pytest.approx(replay["duration"] * 0.03, abs=1.5)
    assert replay["shades"] == [168, 88]
    (finished,) = [entry for entry in log if entry["name"] == "finished"]
    assert finished["args"]["streams"] == [names[0]]


@pytest.mark.parametrize(
    ("generation", "kind", "model", "names"),
    [
        (3, "SkyController3", "4k", ["DefaultVideo"]),
        (4, "SkyController4", "ai", ["Front camera", "Disparity map"]),
        (4, "SkyController4", "usa", ["DefaultVideo"]),
    ],
)
async def test_olympe_watches_through_a_skycontroller(
    generation: int, kind: str, model: str, names: list[str], tmp_path: Path
) -> None:
    # Through a Skycontroller Olympe knows the aircraft's ports only; over the mux of the fourth they are numbers
    # inside a stream.
    options: tuple[str, ...] = ("--skycontroller", str(generation))
    if generation == 4:
        options += ("--rtsp-port", str(RTSP_PORT), "--http-port", str(HTTP_PORT))
    elif not may_open(554):
        pytest.skip("Olympe asks a Skycontroller 3 for its video at port 554, which this user may not open")
    report, log = await visit(model, kind, names, tmp_path / "sim.jsonl", *options)

    check_streams(report, names, log)
    said = report["streams"][names[0]]["said"]
    check_flight(said, log, modern=model == "ai")
    check_camera(said, modern=model == "ai")
