"""The sample missions, flown from MAVSDK by one gateway in real time: each on each of the four models, none of which
has to refuse one. Two batches of twenty drones at once, for one of forty would keep two cores busy all the time.

What counts is the simulator's own log: where each drone was when it was done with a way point, what its camera did
when, where it looked and how many photos it took. Conformance 75 and 121.
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.flown import Log, check, looked, photos, tilts
from support.product import product, program
from support.world import HOME, loopback

from anafi_mav.plans import files

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_fleet_missions.py")
MISSIONS = Path(__file__).parents[2] / "missions"

ZOOMS = {"4k": 3.0, "thermal": 3.0, "usa": 32.0, "ai": 6.0}
"""Model -> how far it zooms. Each flies every sample."""

BATCHES = (
    ("inspection", "orbit", "heights", "loop", "corridor"),
    ("panorama", "timelapse", "delivery", "survey", "structure"),
)
"""Samples that are flown at once, the shorter ones and the longer ones."""

CAMERA = {
    "corridor": ["take_photo", "stop_photo", "take_photo"],
    "inspection": ["take_photo"] * 6,
    "loop": ["take_photo"] * 3,
    "orbit": ["start_recording", "stop_recording"],
    "panorama": ["panorama"] * 2,
    "structure": ["take_photo", "stop_photo"] * 2,
    "survey": ["take_photo", "stop_photo", "take_photo"],
    "timelapse": ["take_photo", "stop_photo"],
}
"""What the cameras do, in order. An order to take photos by time or distance is one until it is ended."""

TILTS = {
    "corridor": [-60.0],
    "inspection": [0.0, -30.0, -15.0, 0.0],
    "structure": [-10.0],
    "survey": [-90.0],
}
"""Where the gimbal items point the camera, deg: down is negative."""

AIMED = 0.5
"""deg that it may be beside that."""

FOREIGN = ("corridor", "structure")
"""MAVSDK does not read these scans of QGroundControl's: they are given to it item by item."""

LAPSES = {"corridor": 1, "structure": 2, "survey": 1, "timelapse": 1}
"""Items that begin one. Of each the number of photos is known but for one; single photos are one each."""


async def flown(folder: Path, samples: Sequence[str]) -> dict[tuple[str, str], Log]:
    """Fly samples, each on every model, all at once; what the simulator says of each drone."""
    first = loopback()
    head, _, last = first.rpartition(".")
    drones = list(itertools.product(samples, ZOOMS))
    addresses = [f"{head}.{(int(last) + number) % 250 + 1}" for number in range(len(drones))]
    listed = [
        {"name": f"{name}-{model}", "sysid": number, "sim": {"model": model, "address": address, "home": HOME}}
        for number, ((name, model), address) in enumerate(zip(drones, addresses, strict=True), start=1)
    ]
    config = json.dumps({"endpoints": [f"tcpin://{first}:5760"], "drones": listed})
    paths = {name: MISSIONS / f"{name}.plan" for name in samples}
    for name in set(FOREIGN) & set(samples):
        plain = replace(files.load(paths[name]), blocks=())
        paths[name] = folder / f"{name}.plan"
        files.save(plain, paths[name], files.Format.QGC)
    async with product(folder, config, ready=False) as p:
        await p.line(lambda line: line.startswith("ready"), timeout=90.0)
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{first}:5760", *(str(paths[name]) for name, _ in drones))
        async with program(*words) as mavsdk:
            await mavsdk.line(lambda line: line == "done", timeout=250.0)
    said: dict[str, list[dict[str, Any]]] = {address: [] for address in addresses}
    for line in p.log.read_bytes().splitlines():
        entry = json.loads(line)
        said[entry["drone"]].append(entry)
    return {drone: Log(said[address]) for drone, address in zip(drones, addresses, strict=True)}


def judge(name: str, model: str, log: Log) -> None:
    """Everything of one flight."""
    begun = check(log, files.load(MISSIONS / f"{name}.plan"))
    assert log.camera() == CAMERA.get(name, [])
    half = (1.0 + ZOOMS[model]) / 2.0
    assert log.zooms() == ([half, 1.0] if name == "inspection" else [])
    assert tilts(log, begun) == pytest.approx(TILTS.get(name, []), abs=AIMED)
    assert looked(log, begun) == (name == "orbit")
    counts = photos(log, begun)
    assert all(abs(taken - expected) <= (expected > 1) for taken, expected in counts), counts
    assert sum(expected > 1 for _, expected in counts) == LAPSES.get(name, 0), counts


@pytest.mark.timeout(800)
async def test_conf_075_121_every_sample_on_every_model(tmp_path: Path) -> None:
    """One test, so that never more than one batch is in the air, however many workers the suite has."""
    for samples in BATCHES:
        folder = tmp_path / samples[0]
        folder.mkdir()
        for (name, model), log in (await flown(folder, samples)).items():
            try:
                judge(name, model, log)
            except AssertionError as error:
                raise AssertionError(f"{name} on {model}: {error}") from error
