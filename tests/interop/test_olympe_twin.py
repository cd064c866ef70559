"""The same plan file: by the gateway, and by `plan convert` and Olympe. The two drones fly the same path within 1 m."""

from __future__ import annotations

import asyncio
import json
import math
import sys
from collections.abc import Coroutine
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from support import olympe
from support.mav import Client
from support.process import simulator_process
from support.product import START_LIMIT, Process, product, program
from support.world import ARMED, loopback

SAMPLE = Path(__file__).parents[2] / "missions" / "delivery.plan"

PORT = 8080
"""Of the simulator's web server: Olympe is given it, so no one needs the right to listen on 80."""

WITHIN = 1.0
"""m."""

pytestmark = [pytest.mark.third_party, olympe.needed]

Point = tuple[float, float, float]


async def run(*words: str, timeout: float = START_LIMIT) -> Process:
    """A program to its good end."""
    async with program(sys.executable, *words) as held:
        assert await held.end(timeout) == 0, str(held)
        return held


async def together(*flights: Coroutine[Any, Any, None]) -> None:
    """All of them at once; the first that fails ends the others."""
    tasks = [asyncio.ensure_future(flight) for flight in flights]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


def path(log: Path) -> list[Point]:
    """Where the drone of a log has been: m north, east, up, ten times a second."""
    entries = map(json.loads, log.read_text().splitlines())
    return [tuple(e["args"][axis] for axis in ("north", "east", "up")) for e in entries if e["kind"] == "pose"]  # type: ignore[misc]


def off(point: Point, one: Point, two: Point) -> float:
    """How far (m) a point is from the straight way between two."""
    way = [b - a for a, b in zip(one, two, strict=True)]
    length = sum(part * part for part in way)
    share = sum((p - a) * part for p, a, part in zip(point, one, way, strict=True)) / length if length else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, [a + share * part for a, part in zip(one, way, strict=True)])


def apart(these: list[Point], those: list[Point]) -> float:
    """How far (m) the farthest point of one path is from the other path."""
    thinned = [those[0]]
    for point in those:
        if math.dist(point, thinned[-1]) > 0.3:
            thinned.append(point)
    thinned.append(those[-1])
    return max(min(off(point, one, two) for one, two in pairwise(thinned)) for point in these[::3])


@pytest.mark.parametrize("on", olympe.combinations("twin"))
async def test_the_same_file_flies_the_same_path(on: olympe.Combination, tmp_path: Path) -> None:
    """Both at once, each at a drone of its own."""
    model = on.model
    olympes, ours, gateway = loopback(), loopback(), loopback()
    logs = {name: tmp_path / f"{name}.jsonl" for name in ("olympe", "gateway")}
    options = ("--model", model, "--http-port", str(PORT), "--seed", "1", "--speed", "3")
    config = f"""
        endpoints: ["tcpin://{gateway}:5760"]
        drones: [{{name: alpha, sysid: 1, address: {ours}, http_port: {PORT}}}]
    """
    twin = tmp_path / "twin.mavlink"
    plan = ("-m", "anafi_mav", "plan")
    await run(*plan, "convert", str(SAMPLE), str(twin), "--model", model)

    async def by_olympe() -> None:
        async with simulator_process(olympes, logs["olympe"], *options):
            steps, err = await olympe.run("olympe_twin.py", olympes, str(PORT), model, str(twin), timeout=180.0)
            assert steps == dict.fromkeys(("connect", "flown", "landed", "disconnect"), True), err

    async def by_gateway() -> None:
        async with simulator_process(ours, logs["gateway"], *options), product(tmp_path, config):
            watcher = await Client(sysid=254).connect(5760, gateway)
            await run(*plan, "fly", str(SAMPLE), "--endpoint", f"tcpout://{gateway}:5760", timeout=120.0)
            await watcher.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=60.0)
            await watcher.close()

    await together(by_olympe(), by_gateway())
    one, two = path(logs["olympe"]), path(logs["gateway"])
    assert max(north for north, _, _ in one) > 50.0
    assert apart(one, two) < WITHIN
    assert apart(two, one) < WITHIN
