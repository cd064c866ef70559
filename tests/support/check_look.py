"""What `olympe_look.py` saw, judged by the simulator's own log."""

from __future__ import annotations

import math
from typing import Any

import pytest

from anafi_mav.geo import offset
from support.olympe import during, failed

SIZES = {
    "DefaultVideo": [1280, 720],
    "ParrotThermalVideo": [960, 720],
    "ParrotThermalBlendedVideo": [960, 720],
    "Front camera": [1920, 1080],
    "Disparity map": [176, 90],
}

SHADES = {"ParrotThermalVideo": [48, 168], "ParrotThermalBlendedVideo": [168, 168]}
"""Luma of sky and ground where it is not that of a visible picture."""

PRODUCTS = {"4k": "0914", "thermal": "0919", "usa": "091e", "ai": "091a"}


def check_look(report: dict[str, Any], model: str, log: list[dict[str, Any]]) -> None:
    """Pictures of the first camera came, and they say where the drone is."""
    assert failed(report["steps"]) == {}
    name = "Front camera" if model == "ai" else "DefaultVideo"
    stream = report["streams"][name]
    check_pictures(stream, name)
    assert (stream["session"]["title"], stream["session"]["model_id"]) == (name, PRODUCTS[model])
    poses = [entry["args"] for entry in during(log, report) if entry["kind"] == "pose"]
    for picture in stream["said"]:
        place = picture["drone"]["location"]
        away = offset(poses[0]["lat"], poses[0]["lon"], place["latitude"], place["longitude"])
        assert math.hypot(*away) < 0.1
        assert picture["drone"]["ground_distance"] == pytest.approx(poses[0]["up"], abs=0.1)
        assert picture["drone"]["flying_state"] == "FS_LANDED"


def check_pictures(stream: dict[str, Any], name: str) -> None:
    """Sky above ground, of the right size, and what they say can be read."""
    assert (stream["size"], stream["shades"]) == (SIZES[name], SHADES.get(name, [168, 88]))
    assert stream["kinds"] == ["PROTO"], "Olympe turns version 3 into the protocol buffer"
