"""Parrot's Olympe photographs, records, looks around, downloads, deletes and formats on the simulated models."""

from __future__ import annotations

import asyncio
import hashlib
import importlib.util
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from support.process import simulator_process
from support.world import loopback

SCRIPT = Path(__file__).with_name("olympe_payload.py")

PORT = 8080
"""Of the simulator's web server: Olympe is told, so nobody needs the right to listen on 80."""

HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so one of Olympe's timers came late",
    r"olympe\.flightplan - step - ": "what BROKEN is about",
}
"""Lines at WARNING and above that Olympe writes without the drone's fault."""

BROKEN = "NameError: name '_get_namedtuple_from_mapping' is not defined"
"""What Olympe 8.5.0 comes to with every plan that it reads back: it has an answer in its hands and calls a function
that `olympe.features.flightplan` does not import. One that does is to be compared with what was uploaded."""

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


async def visit(model: str, folder: Path) -> tuple[dict[str, Any], str, list[dict[str, Any]]]:
    """What the script reports, Olympe's own log, and the simulator's."""
    address, log, downloads = loopback(), folder / "sim.jsonl", folder / "downloads"
    downloads.mkdir()
    async with simulator_process(address, log, "--model", model, "--http-port", str(PORT), "--seed", "1"):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, str(SCRIPT), address, str(PORT), str(downloads), model),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            out, err = await asyncio.wait_for(process.communicate(), 100.0)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    assert out, err.decode()
    return json.loads(out), err.decode(), [json.loads(line) for line in log.read_text().splitlines()]


@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
async def test_olympe_uses_the_payload(model: str, tmp_path: Path) -> None:
    report, err, log = await visit(model, tmp_path)

    failed = {name: step.get("explained") for name, step in report["steps"].items() if not step["ok"]}
    assert failed == {}
    complaints = [line for line in err.splitlines() if re.search(r"\[(WARNING|ERROR|CRITICAL)\]", line)]
    assert [line for line in complaints if not any(re.search(known, line) for known in HARMLESS)] == []
    assert err.count("Traceback") == err.count(BROKEN)
    assert "unknown message" not in err.lower()
    # Nor did Olympe say anything that the simulator has no word for: such a command is logged by its numbers.
    assert [entry["name"] for entry in log if entry["kind"] == "command" and entry["name"][0].isdigit()] == []

    assert re.fullmatch(r"[0-9a-f]{32}", report["plan"])
    assert (report["plans"], report["plan again"]) == (BROKEN, BROKEN)
    assert report["axes"] == ("yaw|pitch|roll" if model == "ai" else "pitch|roll")
    offsets = report["offsets"]
    assert (offsets["current_pitch"], offsets["current_roll"], offsets["update_state"]) == (1.5, -1.5, "inactive")
    check_media(report, tmp_path / "downloads", thermal=model in ("thermal", "usa"))
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


def check_media(report: dict[str, Any], folder: Path, *, thermal: bool) -> None:
    """A photo, a burst, a lapse, a film and perhaps a thermal one: listed, fetched, the same bytes."""
    media = report["media"]
    assert [one["photo_mode"] for one in media.values()][:3] == ["single", "burst", "timelapse"]
    videos = [one for one in media.values() if one["type"] == "video"]
    assert [one["thermal"] for one in videos] == [False, True][: 1 + thermal]
    assert 2000 <= videos[0]["duration"] < 4000
    assert len(media["10000002"]["resources"]) == 14
    names = [name for one in media.values() for name in one["resources"]]
    assert sorted(report["files"]) == sorted(names)
    for name, md5 in report["files"].items():
        # Olympe compared it with the drone's word and wrote that beside the file.
        assert (folder / f"{name}.md5").read_text().split()[0] == md5
        data = (folder / name).read_bytes()
        assert hashlib.md5(data).hexdigest() == md5
        assert data.startswith(b"\xff\xd8") if name.endswith(".JPG") else data[4:8] == b"ftyp"
    assert len(report["thumbnails"]) == len(names)
    counters = report["counters"]
    assert (counters["video_media_count"], counters["photo_media_count"]) == (len(videos), 3)
    assert counters["photo_resource_count"] + counters["video_resource_count"] == len(names)
