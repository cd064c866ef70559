"""Olympe's own media examples run on the simulated ANAFI Ai, directly and behind its Skycontroller 4."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from support import olympe
from support.process import simulator_process
from support.world import loopback

pytestmark = [pytest.mark.third_party, olympe.needed]


@pytest.mark.parametrize("on", olympe.combinations("media"))
async def test_olympes_media_examples(on: olympe.Combination, tmp_path: Path) -> None:
    via = "drone" if on.controller == "Drone" else "skycontroller"
    address, log, downloads = loopback(), tmp_path / "sim.jsonl", tmp_path / "downloads"
    downloads.mkdir()
    port = str(olympe.HTTP_PORT)
    controller = ("--skycontroller", "4") if via == "skycontroller" else ()
    # The examples give a burst and its media three seconds; it takes one and a half of simulated ones.
    options = ("--model", on.model, "--http-port", port, "--seed", "1", "--speed", "3", *controller)
    async with simulator_process(address, log, *options):
        report, err = await olympe.run("olympe_media.py", address, port, via, str(downloads), timeout=200.0)
    assert report == {"failed": None}, err
    observed = olympe.complaints(err)
    assert not observed, err

    files = sorted(downloads.glob("*/*.JPG"))
    assert [file.name for file in files] == [f"1000000100{number:02}.JPG" for number in range(1, 15)]
    for file in files:
        reported_md5 = file.with_name(f"{file.name}.md5").read_text().split()[0]
        assert hashlib.md5(file.read_bytes()).hexdigest() == reported_md5
    assert sorted(file.name for file in downloads.glob("*/thumbnails/*.JPG")) == [file.name for file in files]
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    olympe.clock_set(entries, on.controller)
    counted = [entry["args"]["photo_resource_count"] for entry in entries if entry["name"] == "mediastore.counters"]
    # Files are counted as they reach the card, and when the example has all of them it deletes them.
    assert max(counted) == 14
    assert counted[-1] == 0
