"""Parrot's Olympe flies the simulated drone through the simulated Skycontroller."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from support.process import simulator_process
from support.world import loopback

SCRIPT = Path(__file__).with_name("olympe_skycontroller.py")

CONTROLLERS_OWN = ("skyctrl.", "mapper.", "drone_manager.", "devicemanager.", "controllerNetwork.")

HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so Olympe's stick timer came late",
    r"ulog - mux - mux_channel_ip_disconnected err=2": "the web server closed what Olympe has just closed itself",
}
"""Lines at WARNING and above that Olympe writes without the simulator's fault."""

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


async def olympe(address: str, kind: str) -> tuple[dict[str, Any], str]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(SCRIPT), address, kind, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        out, err = await asyncio.wait_for(process.communicate(), 90.0)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert out, err.decode()
    return json.loads(out), err.decode()


@pytest.mark.parametrize(
    ("generation", "kind", "model", "product"),
    [(3, "SkyController3", "4k", 0x0914), (4, "SkyController4", "ai", 0x091A), (4, "SkyController4", "usa", 0x091E)],
)
async def test_olympe_flies_through_the_skycontroller(
    generation: int, kind: str, model: str, product: int, tmp_path: Path
) -> None:
    address, path = loopback(), tmp_path / "sim.jsonl"
    arguments = ("--model", model, "--skycontroller", str(generation), "--speed", "3", "--seed", "1")
    async with simulator_process(address, path, *arguments):
        report, err = await olympe(address, kind)
    log = [json.loads(line) for line in path.read_text().splitlines()]
    assert {name: result for name, result in report["steps"].items() if result is not True} == {}, err[-3000:]
    complaints = [line for line in err.splitlines() if re.search(r"\[(WARNING|ERROR|CRITICAL)\]|Traceback", line)]
    assert [line for line in complaints if not any(re.search(known, line) for known in HARMLESS)] == []
    assert "unknown message" not in err.lower()

    known = report["known"]
    assert known["product"] == {"product": str(product)}
    assert known["source"] == {"source": "SkyController"}
    assert known["battery"] == {"percent": "87"}
    assert known["version"]["software"] == "1.8.2"
    assert known["drone name"]["name"].startswith("ANAFI")

    if generation == 4:
        assert known["devices"]["connected"]["device"]["uid"] == known["web"]["serial"]
        assert known["devices"]["connected"]["device"]["model"] == product
        (paired,) = known["devices"]["known_devices"]["devices"]
        assert paired["info"]["uid"] == known["web"]["serial"]
    assert known["web"]["serial"] == known["serial of the drone"]["high"] + known["serial of the drone low"]["low"]

    # The drone was not told what was the controller's business, and flew what it was told.
    commands = [entry for entry in log if entry["kind"] == "command"]
    assert not [entry for entry in commands if entry["name"].startswith(CONTROLLERS_OWN)]
    sticks = [entry["args"]["pitch"] for entry in commands if entry["name"] == "ardrone3.Piloting.PCMD"]
    assert 40 in sticks
    poses = [entry["args"] for entry in log if entry["kind"] == "pose"]
    assert max(pose["north"] for pose in poses) > 5.5, "5 m by moveBy and some more with the sticks"
    assert [entry["args"]["to"] for entry in log if entry["kind"] == "state"][-1] == "landed"
