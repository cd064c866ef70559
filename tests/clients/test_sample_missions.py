"""The sample missions, flown from MAVSDK by one gateway in real time, many drones at once.

By default each sample is flown once, the models in turn. The tests marked `full` fly each on every model, none of which
has to refuse one: two batches of twenty drones, for one of forty would keep two cores busy all the time. A client of
our own flies all combinations in virtual time (`conformance/test_conf_missions_samples.py`).

What counts is the simulator's own log, judged by `support/samples.py`: where each drone was when it was done with a way
point, what its camera did when, where it looked and how many photos it took. Conformance 75 and 121.
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
from support.flight_checks import MAVSDKS_JUMPS, Log
from support.product import product, program
from support.samples import SAMPLES, ZOOMS, judge, path_of
from support.world import HOME, loopback

from anafi_mav.plans.formats import files

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_fleet_missions.py")

FOREIGN = ("corridor", "structure")
"""MAVSDK does not read these scans of QGroundControl's: they are given to it item by item."""

Flight = tuple[str, str]
"""A sample and a model."""


async def flown(folder: Path, drones: Sequence[Flight], speed: float) -> dict[Flight, Log]:
    """Fly all of them at once; the simulator's log of each drone."""
    first = loopback()
    head, _, last = first.rpartition(".")
    addresses = [f"{head}.{(int(last) + number) % 250 + 1}" for number in range(len(drones))]
    listed = [
        {
            "name": f"{name}-{model}",
            "sysid": number,
            "sim": {"model": model, "address": address, "home": HOME, "speed": speed},
        }
        for number, ((name, model), address) in enumerate(zip(drones, addresses, strict=True), start=1)
    ]
    config = json.dumps({"endpoints": [f"tcpin://{first}:5760"], "drones": listed})
    paths = {name: path_of(name) for name, _ in drones}
    for name in set(FOREIGN) & set(paths):
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


def judge_all(logs: dict[Flight, Log]) -> None:
    for (name, model), log in logs.items():
        try:
            judge(name, model, log, jump_beyond=MAVSDKS_JUMPS)
        except AssertionError as error:
            raise AssertionError(f"{name} on {model}: {error}") from error


async def test_conf_075_121_every_sample_once_by_mavsdk(tmp_path: Path) -> None:
    """At twice the clock's speed: the poses in the log are then 0.2 simulated seconds apart, 1.6 m at most."""
    judge_all(await flown(tmp_path, list(zip(SAMPLES, itertools.cycle(ZOOMS), strict=False)), speed=2.0))


@pytest.mark.full
@pytest.mark.parametrize("samples", [SAMPLES[:5], SAMPLES[5:]], ids=["short", "long"])
async def test_conf_075_121_every_sample_on_every_model_by_mavsdk(samples: tuple[str, ...], tmp_path: Path) -> None:
    judge_all(await flown(tmp_path, list(itertools.product(samples, ZOOMS)), speed=1.0))
