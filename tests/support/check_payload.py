"""What `olympe_payload.py` did with camera, gimbal, card and media."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import pytest

from support.olympe import failed
from support.poses import pose_at

BROKEN = "NameError: name '_get_namedtuple_from_mapping' is not defined"
"""What Olympe 8.5.0 comes to with every plan that it reads back: it has an answer in its hands and calls a function
that `olympe.features.flightplan` does not import. One that does is to be compared with what was uploaded."""


def check_payload(report: dict[str, Any], model: str, folder: Path, log: list[dict[str, Any]]) -> None:
    """It photographed, filmed, looked around, calibrated, downloaded, deleted and formatted."""
    assert failed(report["steps"]) == {}
    assert re.fullmatch(r"[0-9a-f]{32}", report["plan"])
    assert (report["plans"], report["plan again"]) == (BROKEN, BROKEN)
    assert report["axes"] == ("yaw|pitch|roll" if model == "ai" else "pitch|roll")
    offsets = report["offsets"]
    assert (offsets["current_pitch"], offsets["current_roll"], offsets["update_state"]) == (1.5, -1.5, "inactive")
    check_media(report, folder, filmed(log), thermal=model in ("thermal", "usa"))
    if model == "ai":
        assert report["config"] == {"camera_mode": "recording", "ev_compensation": "1_00"}
        return
    assert (report["photo"], report["photos of a burst"]) == ("10000001", "10000002")
    assert report["recording"]["state"] == "active"
    assert report["card"] == {"name": "films", "capacity": 64_000_000_000}
    assert report["free"] == {"available_bytes": 64_000_000_000}
    exposure = report["exposure"]
    manual = ("manual", "shutter_1_over_500", "iso_400")
    wanted = ("automatic", "shutter_1_over_60", "iso_100") if model == "4k" else manual
    assert (exposure["mode"], exposure["manual_shutter_speed"], exposure["manual_iso_sensitivity"]) == wanted


def filmed(log: list[dict[str, Any]]) -> float:
    """The simulated time in s from the first order to record to the first to stop."""
    start, stop = (
        next(entry["t"] for entry in log if entry["kind"] == "command" and entry["name"].endswith(names))
        for names in ((".start_recording", ".StartRecording"), (".stop_recording", ".StopRecording"))
    )
    return pose_at(log, stop)["time"] - pose_at(log, start)["time"]


def check_media(report: dict[str, Any], folder: Path, seconds: float, *, thermal: bool) -> None:
    """A photo, a burst, a lapse, a film and perhaps a thermal one: listed, fetched, the same bytes."""
    media = report["media"]
    assert [one["photo_mode"] for one in media.values()][:3] == ["single", "burst", "timelapse"]
    videos = [one for one in media.values() if one["type"] == "video"]
    assert [one["thermal"] for one in videos] == [False, True][: 1 + thermal]
    assert seconds > 1.9, "a gimbal went down 60 degrees at 30 degrees per second"
    assert videos[0]["duration"] / 1000.0 == pytest.approx(seconds, abs=1.0)
    assert len(media["10000002"]["resources"]) == 14
    names = [name for one in media.values() for name in one["resources"]]
    assert sorted(report["files"]) == sorted(names)
    for name, md5 in report["files"].items():
        # Olympe compared it with the drone's word and wrote that beside the file.
        assert (folder / f"{name}.md5").read_text().split()[0] == md5
        data = (folder / name).read_bytes()
        assert hashlib.md5(data).hexdigest() == md5
        assert data.startswith(b"\xff\xd8") if name.endswith(".JPG") else data[4:8] == b"ftyp"
    assert report["thumbnails"] == sorted(media["10000002"]["resources"])
    counters = report["counters"]
    assert (counters["video_media_count"], counters["photo_media_count"]) == (len(videos), 3)
    assert counters["photo_resource_count"] + counters["video_resource_count"] == len(names)
