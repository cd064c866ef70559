"""Olympe's own media examples run on the simulated ANAFI Ai, directly and behind its Skycontroller 4."""

from __future__ import annotations

import asyncio
import hashlib
import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest
from support.process import simulator_process
from support.world import loopback

SCRIPT = Path(__file__).with_name("olympe_media.py")

PORT = 8080
"""Of the simulator's web server: Olympe is told, so nobody needs the right to listen on 80."""

HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so one of Olympe's timers came late",
    r"backend - __call__ - Unhandled exception|Traceback \(most recent call last\)": "Olympe's own way out of a mux:"
    " its `_tx_cb` asks a client that is gone (seen with skyctrl_media alone; the line below it is asked for)",
}
"""Lines at WARNING and above that Olympe writes without the drone's fault."""

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


@pytest.mark.parametrize("via", ["drone", "skycontroller"])
async def test_olympes_media_examples(via: str, tmp_path: Path) -> None:
    address, log, downloads = loopback(), tmp_path / "sim.jsonl", tmp_path / "downloads"
    downloads.mkdir()
    controller = ("--skycontroller", "4") if via == "skycontroller" else ()
    async with simulator_process(address, log, "--model", "ai", "--http-port", str(PORT), "--seed", "1", *controller):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, str(SCRIPT), address, str(PORT), via, str(downloads)),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            out, told = await asyncio.wait_for(process.communicate(), 100.0)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    err = told.decode()
    assert out, err
    assert json.loads(out) == {"failed": None}, err

    complaints = [line for line in err.splitlines() if re.search(r"\[(WARNING|ERROR|CRITICAL)\]|Traceback", line)]
    assert [line for line in complaints if not any(re.search(known, line) for known in HARMLESS)] == []
    assert err.count("Traceback") == err.count("AttributeError: 'NoneType' object has no attribute 'connected'")
    assert "unknown message" not in err.lower()

    files = sorted(downloads.glob("*/*.JPG"))
    assert [file.name for file in files] == [f"1000000100{number:02}.JPG" for number in range(1, 15)]
    for file in files:
        told_md5 = file.with_name(f"{file.name}.md5").read_text().split()[0]
        assert hashlib.md5(file.read_bytes()).hexdigest() == told_md5
    assert sorted(file.name for file in downloads.glob("*/thumbnails/*.JPG")) == [file.name for file in files]
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    counted = [entry["args"]["photo_resource_count"] for entry in entries if entry["name"] == "mediastore.counters"]
    # Files are counted as they reach the card, and when the example has all of them it deletes them.
    assert max(counted) == 14
    assert counted[-1] == 0
