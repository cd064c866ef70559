"""Parrot's Olympe watches the simulated models: pictures, and metadata that is the flight in the simulator's log.

The default run takes a pairwise selection of model, controller and version (`olympe.SELECTED`), `full` every one.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect
from pathlib import Path
from typing import Any

import pytest
from support import olympe
from support.check_look import PRODUCTS, check_pictures

from anafi_mav.geo import offset
from anafi_mav.units import quaternion_from_euler

SPEED = "2"

pytestmark = [pytest.mark.third_party, olympe.needed]


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
    """Every picture reports the pose of its moment, which lies between two in the log."""
    truth = Truth(log)
    home = next(entry["args"] for entry in log if entry["kind"] == "pose")
    compared: list[float] = []
    for picture in said:
        drone, camera = picture["drone"], picture["camera"]
        poses = truth.around(camera["timestamp"] / 1e6)
        if poses is None:
            continue
        compared.append(drone["ground_distance"])
        # What happens between two poses grows with the square of the time: 0.2 s, or more if one is late.
        off = 0.1 * max(1.0, ((poses[1]["time"] - poses[0]["time"]) / 0.2) ** 2)
        place, speed = drone["location"], drone["speed"]
        north, east = offset(home["lat"], home["lon"], place["latitude"], place["longitude"])
        observed = {
            "north": north,  # steps of version 3 are 3 cm
            "east": east,
            "up": drone["ground_distance"],
            "vn": speed["north"],
            "ve": speed["east"],
            "vd": speed["down"],
        }
        if modern:
            observed["ato"] = drone["altitude_ato"]
            assert drone["position"]["north"] == pytest.approx(north, abs=0.02)
            assert drone["position"]["east"] == pytest.approx(east, abs=0.02)
            assert drone["position"]["down"] == pytest.approx(-drone["altitude_ato"], abs=1e-3)
        for key, value in observed.items():
            low, high = sorted(pose[key] for pose in poses)
            assert low - off <= value <= high + off, (key, value, poses)
        assert place["altitude_egm96amsl"] == pytest.approx(35.0 + drone["ground_distance"], abs=0.01)
        attitudes = [quaternion_from_euler(pose["roll"], pose["pitch"], pose["yaw"]) for pose in poses]
        # The gimbal keeps the picture level; it looks where the drone does.
        level = [quaternion_from_euler(0.0, 0.0, pose["yaw"]) for pose in poses]
        for turn, (one, two) in ((drone["quat"], attitudes), (camera["quat"], level)):
            way = same_turn(dict(zip("wxyz", one, strict=True)), two)
            assert same_turn(turn, one) + same_turn(turn, two) <= way + math.radians(4.0)
    # Those of moments when the machine let no one run have no pose on both sides; the rest is enough.
    assert len([height for height in compared if height > 0.2]) >= 30
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


def check_states(said: list[dict[str, Any]], log: list[dict[str, Any]]) -> None:
    """The states of the flight in their order; one that was short may have had no picture."""
    observed = [state for state, _ in itertools.groupby(picture["drone"]["flying_state"] for picture in said)]
    true = iter(["FS_LANDED", *(f"FS_{e['args']['to'].upper()}" for e in log if e["kind"] == "state")])
    assert all(state in true for state in observed), observed
    assert {"FS_LANDED", "FS_HOVERING", "FS_LANDING"} <= set(observed)


def check_streams(streams: dict[str, Any], log: list[dict[str, Any]]) -> None:
    """All of them came, whole."""
    sent = [entry["args"] for entry in log if entry["name"] == "end" and entry["kind"] == "video"]
    for name, stream in streams.items():
        if name != "replay":
            check_pictures(stream, name.removesuffix(" beside others"))
            assert stream["session"].get("title", name) == name
    # Olympe counts the first packet as missing; a busy machine may drop the last pictures at the end.
    assert all(end["lost"] <= 1 for end in sent), sent
    assert sent[0]["reports"] > 0, sent


# Directly, and through the mux of a Skycontroller 4; through the third `test_olympe.py` looks.
@pytest.mark.parametrize("on", olympe.combinations("video"))
async def test_olympe_watches_a_flight(on: olympe.Combination, tmp_path: Path) -> None:
    _, model, kind, _ = on
    report, err, log = await olympe.visit("olympe_video.py", on, tmp_path, timeout=200.0, options=("--speed", SPEED))
    for part in report.values():
        assert olympe.failed(part["steps"]) == {}
    streams = report["video"]["streams"]
    first = next(iter(streams))
    check_streams(streams, log)
    said = streams[first]["said"]
    check_flight(said, log, modern=model == "ai")
    check_camera(said, modern=model == "ai")
    check_states(said, log)
    session = streams[first]["session"]
    assert (session["model_id"], session["picture_fov"]["horz"]) == (PRODUCTS[model], 68.0 if model == "ai" else 69.0)
    observed = olympe.complaints(err, olympe.HARMLESS_WITH_VIDEO)
    assert not observed, "\n".join(observed)
    if kind != "Drone":
        return
    # A recording is played picture by picture to its end. Olympe gets its decoder ready while the first ones come.
    replay = streams["replay"]
    (finished,) = [entry for entry in log if entry["name"] == "finished"]
    assert finished["args"]["streams"] == [first]
    (sent,) = [
        e["args"]["pictures"] for e in log if e["name"] == "end" and e["args"]["session"] == finished["args"]["session"]
    ]
    assert sent == pytest.approx(replay["duration"] * 0.03, abs=1.5)
    assert 0.5 * sent < replay["coded"] <= sent
    assert replay["shades"] == [168, 88]
