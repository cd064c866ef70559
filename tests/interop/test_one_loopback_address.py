"""Simulated drones where the loopback network is 127.0.0.1 alone, as on macOS.

A network namespace whose loopback device has that one address stands for such a system. Making one takes root.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.product import Process, program

CONFIG = """
    endpoints: ["tcpin://127.0.0.1:5760"]
    drones:
      - {name: alpha, sysid: 1, sim: {}}
      - {name: bravo, sysid: 2, sim: {model: thermal}}
      - {name: charlie, sysid: 3, sim: {}}
"""


def ip(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)


@pytest.fixture
def space() -> Iterator[tuple[str, ...]]:
    """The words that run a program in a namespace with one loopback address."""
    name = f"amav{os.getpid()}one"
    done = ip("netns", "add", name)
    if done.returncode:
        pytest.skip(f"no network namespaces here (they take root): {done.stderr.strip()}")
    try:
        ip("-n", name, "addr", "add", "127.0.0.1/32", "dev", "lo")
        ip("-n", name, "link", "set", "lo", "up")
        ip("-n", name, "addr", "del", "127.0.0.1/8", "dev", "lo")  # the kernel's own
        yield "ip", "netns", "exec", name, sys.executable, "-m", "anafi_mav"
    finally:
        ip("netns", "del", name)


async def status(space: tuple[str, ...], home: dict[str, str]) -> dict[str, Any]:
    async with program(*space, "status", "--json", env=home) as held:
        assert await held.end() == 0, str(held)
        found: dict[str, Any] = json.loads("\n".join(held.lines))
        return found


async def test_three_simulated_drones_share_one_loopback_address(space: tuple[str, ...], tmp_path: Path) -> None:
    config, home = tmp_path / "fleet.yaml", {"XDG_STATE_HOME": str(tmp_path)}
    config.write_text(CONFIG)
    held = await Process.start(*space, "run", "-c", str(config), env=home)
    try:
        await held.line(lambda line: line.startswith("ready"), timeout=60.0)
        drones = [line for line in held.lines if line.startswith("drone ")]
        assert [" at 127.0.0.1: ANAFI " in line for line in drones] == [True] * 3
        found = (await status(space, home))["drones"]
        assert [(drone["name"], drone["connected"], drone["address"]) for drone in found] == [
            ("alpha", True, "127.0.0.1"), ("bravo", True, "127.0.0.1"), ("charlie", True, "127.0.0.1"),
        ]  # fmt: skip
        serials = [drone["serial"] for drone in found]
        assert len(set(serials)) == 3
        # The state of a drone is kept by its serial number: that of a further drone belongs to its system id.
        assert serials[1][-6:] == "000002"
        assert serials[2][-6:] == "000003"
    finally:
        held.process.send_signal(signal.SIGTERM)
        await asyncio.wait_for(held.process.wait(), 30.0)
        await held.put_away()


async def test_scenario_on_shared_address_is_refused(space: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("steps: [{at: 1, battery: 9}]")
    config = tmp_path / "fleet.yaml"
    config.write_text(CONFIG.replace("sysid: 3, sim: {}", "sysid: 3, sim: {scenario: bad.yaml}"))
    async with program(*space, "run", "-c", str(config), "--check", env={"XDG_STATE_HOME": str(tmp_path)}) as held:
        assert await held.end() == 1
        assert any("drones[2].sim.scenario: WRONG: expected none: the drone shares 127.0.0.1" in x for x in held.lines)
