"""Parrot's libvideo-metadata reads what we write of a picture, and we read what it writes."""

from __future__ import annotations

import importlib.util
import json
import math
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from anafi_mav.arsdk.video.video_metadata import (
    V3_PROFILE,
    FlyingState,
    FrameMetadata,
    LinkInfo,
    LinkStatus,
    LinkType,
    Location,
    Ned,
    PilotingMode,
    Quaternion,
    StarfishLink,
    Vector3,
    WifiLink,
    decode_v3,
    encode_v3,
)
from anafi_mav.arsdk.video.video_metadata_proto import decode_proto, encode_proto

SCRIPT = Path(__file__).with_name("parrot_metadata.py")

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)

FLOWN = FrameMetadata(
    drone_quat=Quaternion(0.488, -0.029, 0.026, 0.872),
    location=Location(latitude=48.878922, longitude=2.367782, altitude_amsl=61.5, satellites=14),
    ground_distance=0.43,
    altitude_ato=0.25,
    speed=Ned(1.5, -2.25, 0.75),
    battery_percentage=54,
    flying_state=FlyingState.FLYING,
    piloting_mode=PilotingMode.MOVE_TO,
    position=Ned(1.0, -2.0, -3.5),
    local_position=Vector3(-1.5, 2.5, -3.5),
    timestamp=123_456_789_012,
    base_quat=Quaternion(0.6, 0.0, 0.0, 0.8),
    quat=Quaternion(0.7071, 0.0, -0.7071, 0.0),
    exposure_time=16.66,
    iso_gain=318,
    awb_r_gain=1.60,
    awb_b_gain=2.05,
    hfov=1.2043,
    vfov=0.7377,
    zoom_level=1.5,
    wifi=WifiLink(goodput=19330, quality=5, rssi=-15),
    starfish=StarfishLink(
        links=(
            LinkInfo(type=LinkType.WLAN, status=LinkStatus.RUNNING, quality=5, active=True),
            LinkInfo(type=LinkType.CELLULAR, status=LinkStatus.DOWN),
        ),
        quality=5,
    ),
)


def whole_v3(body: bytes) -> str:
    """With the id and length that the header extension of a packet has for it."""
    return (struct.pack(">HH", V3_PROFILE, len(body) // 4) + body).hex()


def ask(*orders: dict[str, str]) -> list[dict[str, Any]]:
    """What Parrot's library says of each."""
    lines = "".join(json.dumps(order) + "\n" for order in orders)
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], input=lines, capture_output=True, text=True, timeout=60, check=True
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def near(value: float | tuple[float, ...], step: float) -> Any:
    """Within the rounding of a fixed-point number; Parrot's conversion truncates, ours rounds."""
    if isinstance(value, tuple):
        return {name: near(one, step) for name, one in value._asdict().items()}  # type: ignore[attr-defined]
    return pytest.approx(value, abs=step)


def test_parrot_reads_our_version_3() -> None:
    (read,) = ask({"format": "v3", "hex": whole_v3(encode_v3(FLOWN))})
    drone, camera = read["drone"], read["camera"]
    assert drone["quat"] == near(FLOWN.drone_quat, 2**-14)
    assert drone["location"]["latitude"] == near(48.878922, 2**-22)
    assert drone["location"]["longitude"] == near(2.367782, 2**-22)
    assert drone["location"]["altitude_egm96amsl"] == 61.5
    assert drone["location"]["sv_count"] == 14
    assert drone["ground_distance"] == near(0.43, 2**-16)
    assert drone["speed"] == {"north": 1.5, "east": -2.25, "down": 0.75}
    assert (drone["battery_percentage"], drone["animation_in_progress"]) == (54, False)
    assert (drone["flying_state"], drone["piloting_mode"]) == ("FS_FLYING", "PM_MOVETO")
    assert camera["timestamp"] == 123_456_789_012
    assert camera["base_quat"] == near(FLOWN.base_quat, 2**-14)
    assert camera["quat"] == near(FLOWN.quat, 2**-14)
    assert camera["exposure_time"] == near(16.66, 2**-8)
    assert camera["iso_gain"] == 318
    assert (camera["awb_r_gain"], camera["awb_b_gain"]) == (near(1.60, 2**-14), near(2.05, 2**-14))
    assert (camera["hfov"], camera["vfov"]) == (near(1.2043, 1e-4), near(0.7377, 1e-4))
    assert read["links"] == [{"wifi": {"goodput": 19330, "quality": 5, "rssi": -15}}]


def test_parrot_reads_our_protocol_buffer() -> None:
    (read,) = ask({"format": "proto", "hex": encode_proto(FLOWN).hex()})
    drone, camera = read["drone"], read["camera"]
    assert drone["quat"] == near(FLOWN.drone_quat, 1e-6)
    assert drone["location"] == {
        "latitude": 48.878922, "longitude": 2.367782, "altitude_egm96amsl": 61.5, "sv_count": 14,
    }  # fmt: skip
    assert (drone["ground_distance"], drone["altitude_ato"]) == (0.43, 0.25)
    assert drone["position"] == {"north": 1.0, "east": -2.0, "down": -3.5}
    assert drone["local_position"] == {"x": -1.5, "y": 2.5, "z": -3.5}
    assert drone["speed"] == {"north": 1.5, "east": -2.25, "down": 0.75}
    assert (drone["battery_percentage"], drone["flying_state"]) == (54, "FS_FLYING")
    assert (camera["timestamp"], camera["iso_gain"]) == (123_456_789_012, 318)
    assert camera["quat"] == near(FLOWN.quat, 1e-6)
    assert camera["exposure_time"] == near(16.66, 1e-5)
    assert (camera["awb_r_gain"], camera["awb_b_gain"]) == (near(1.60, 1e-6), near(2.05, 1e-6))
    assert (camera["hfov"], camera["vfov"], camera["zoom_level"]) == (near(1.2043, 1e-6), near(0.7377, 1e-6), 1.5)
    assert read["links"] == [
        {"wifi": {"goodput": 19330, "quality": 5, "rssi": -15}},
        {
            "starfish": {
                "links": [
                    {"type": "wlan", "status": "running", "quality": 5, "active": True},
                    {"type": "cellular", "status": "down", "quality": 0, "active": False},
                ],
                "quality": 5,
            }
        },
    ]


def test_we_read_what_parrot_writes() -> None:
    """It turns version 3 into the protocol buffer by itself; both must be the same to us."""
    modes = list(PilotingMode)
    flown = [msgspec.structs.replace(FLOWN, piloting_mode=mode, timestamp=None) for mode in modes]
    bodies = [encode_v3(metadata) for metadata in flown]
    answers = ask(*({"format": "v3", "hex": whole_v3(body)} for body in bodies))
    for body, answer in zip(bodies, answers, strict=True):
        ours, theirs = decode_v3(body), decode_proto(bytes.fromhex(answer["hex"]))
        assert ours is not None
        assert theirs is not None
        for name in ("exposure_time", "awb_r_gain", "awb_b_gain", "hfov", "vfov"):
            assert getattr(theirs, name) == pytest.approx(getattr(ours, name), rel=1e-6)
        rounded = {name: getattr(ours, name) for name in ("exposure_time", "awb_r_gain", "awb_b_gain", "hfov", "vfov")}
        assert msgspec.structs.replace(theirs, **rounded) == ours


def test_parrot_finds_unknown_what_we_say_is() -> None:
    unknown = FrameMetadata(
        ground_distance=0.0, speed=Ned(0.0, 0.0, 0.0), battery_percentage=10, flying_state=FlyingState.LANDED
    )
    v3, proto = ask(
        {"format": "v3", "hex": whole_v3(encode_v3(unknown))}, {"format": "proto", "hex": encode_proto(unknown).hex()}
    )
    assert "location" not in v3["drone"]
    assert "location" not in proto["drone"]
    assert v3["drone"]["piloting_mode"] == proto["drone"]["piloting_mode"] == "PM_UNKNOWN"
    assert math.isnan(v3["drone"]["altitude_ato"])
    assert decode_proto(bytes.fromhex(v3["hex"])) == msgspec.structs.replace(
        unknown, ground_distance=None, wifi=WifiLink(goodput=0, quality=0, rssi=0)
    )


def test_metadata_that_parrot_refuses_is_not_read() -> None:
    short = encode_v3(FLOWN)[:64]
    refused = ask({"format": "v3", "hex": whole_v3(short)}, {"format": "proto", "hex": "ff"})
    assert ["refused" in answer for answer in refused] == [True, True]
    assert decode_v3(short) is None
    assert decode_proto(b"\xff") is None
