"""Parrot's Olympe uploads a flight plan to the simulated models, plays, pauses and ends it, and looks at a point."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest
from support.process import simulator_process
from support.world import loopback

SCRIPT = Path(__file__).with_name("olympe_plan.py")

PORT = 8080
"""Of the simulator's web server: Olympe is told, so nobody needs the right to listen on 80."""

HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so one of Olympe's timers came late",
    r"olympe\.flightplan - step - ": "its HTTP client gives a connection half a second; the script uploads again",
}
"""Lines at WARNING and above that Olympe writes without the drone's fault."""

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
@pytest.mark.timeout(200)
async def test_olympe_plays_a_flight_plan(model: str, tmp_path: Path) -> None:
    address, log_file = loopback(), tmp_path / "sim.jsonl"
    options = ("--model", model, "--http-port", str(PORT), "--seed", "1", "--speed", "3")
    async with simulator_process(address, log_file, *options):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, str(SCRIPT), address, str(PORT), model),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            out, err = await asyncio.wait_for(process.communicate(), 180.0)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    assert out, err.decode()
    report, text = json.loads(out), err.decode()
    assert {name: step.get("explained") for name, step in report["steps"].items() if not step["ok"]} == {}
    complaints = [line for line in text.splitlines() if re.search(r"\[(WARNING|ERROR|CRITICAL)\]", line)]
    assert [line for line in complaints if not any(re.search(known, line) for known in HARMLESS)] == []
    assert "unknown message" not in text.lower()

    log = [json.loads(line) for line in log_file.read_text().splitlines()]
    assert [entry["name"] for entry in log if entry["kind"] == "command" and entry["name"][0].isdigit()] == []
    executed = [e["args"]["idx"] for e in log if e["kind"] == "event" and e["name"].endswith("MissionItemExecuted")]
    assert executed[:8] == list(range(8))
    north = max(entry["args"]["north"] for entry in log if entry["kind"] == "pose")
    assert north == pytest.approx(20.0, abs=1.5)  # 0.00018 deg of latitude
    done = [entry["args"]["command"] for entry in log if entry["kind"] == "plan" and entry["name"] == "payload"]
    assert [name.rpartition(".")[2] for name in done[:3]] == ["set_camera_mode", "start_recording", "stop_recording"]
