"""The sample missions, flown from MAVSDK by one gateway, all at once, in real time, on all four models.

What counts is the simulator's own log: where each drone was when it was done with a way point, and what its camera
did when. Conformance 75 and 121.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support.missions import apart
from support.product import product, program
from support.world import loopback

from anafi_mav import geo
from anafi_mav.plans import files
from anafi_mav.plans.plan import GLOBAL, Item, Plan

SCRIPT = Path(__file__).with_name("mavsdk_fleet_missions.py")
MISSIONS = Path(__file__).parents[2] / "missions"
HOME = (48.8789, 2.3677, 35.0)

WITHIN = 2.0
"""m."""

FLOWN = {
    "corridor": "usa", "delivery": "4k", "heights": "thermal", "inspection": "ai", "loop": "usa",
    "orbit": "4k", "panorama": "thermal", "structure": "ai", "survey": "4k", "timelapse": "ai",
}  # fmt: skip
"""Sample -> model; each sample has a drone of its own."""

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

FOREIGN = ("corridor", "structure")
"""MAVSDK does not read these scans of QGroundControl's: they are given to it item by item."""

BY_DISTANCE = 206

LINES = {
    16: ("waypoint",), 17: ("waypoint",), 19: ("waypoint",),
    205: ("mount_control",), 1000: ("mount_control",),
    206: ("trigger_distance", "start_photo", "stop_photo"),
    2000: ("start_photo",), 2001: ("stop_photo",), 2500: ("start_video",), 2501: ("stop_video",), 2800: ("panorama",),
    195: ("set_roi", "set_roi_location"), 196: ("mount_control",),
    20: ("return_to_launch",), 21: ("land",), 22: ("takeoff",),
}  # fmt: skip
"""Item of a mission -> what the drone says of it, in the words of its log."""


def executed(plan: Plan) -> Iterator[Item]:
    """The items in the order in which they are flown: jumps followed.

    To one item further than QGroundControl means: MAVSDK sends its jump ids, which count from 1, as they are.
    """
    left: dict[int, int] = {}
    number = 0
    while number < len(plan.items):
        item = plan.items[number]
        if item.command == 177:
            target, times = int(item.params[0] or 0), int(item.params[1] or 0)
            if left.setdefault(number, times) > 0:
                left[number] -= 1
                number = target + 1
                continue
        else:
            yield item
        number += 1


def place(item: Item) -> tuple[float, float, float]:
    """m north, east and up of the take-off."""
    latitude, longitude, height = item.params[4:]
    north, east = geo.offset(*HOME[:2], latitude or 0.0, longitude or 0.0)
    return (north, east, (height or 0.0) - (HOME[2] if item.frame == GLOBAL else 0.0))


class Log:
    """What the simulator says of one drone, oldest first."""

    def __init__(self, entries: list[dict[str, Any]], address: str) -> None:
        self.entries = [entry for entry in entries if entry["drone"] == address]

    def track(self) -> list[tuple[float, tuple[float, float, float]]]:
        """(s, m north, east and up) ten times a second."""
        poses = [(entry["t"], entry["args"]) for entry in self.entries if entry["kind"] == "pose"]
        return [(t, (args["north"], args["east"], args["up"])) for t, args in poses]

    def lines(self) -> list[tuple[float, str]]:
        """Lines of its plan that do something, when they began. Others set what they need: speed, view, modes."""
        known = {name for names in LINES.values() for name in names}
        items = [(entry["t"], entry["args"]["command"]) for entry in self.entries if entry["name"] == "item"]
        return [(t, name) for t, name in items if name in known]

    def starts(self) -> list[float]:
        """When files were begun."""
        told = [(entry["t"], entry["args"]) for entry in self.entries if entry["kind"] == entry["name"] == "plan"]
        return [t for t, args in told if args["state"] == "playing"]

    def camera(self) -> list[str]:
        """What plan and gateway had the camera do."""
        orders = [entry["args"] for entry in self.entries if entry["name"] == "payload"]
        names = [order["command"].rpartition(".")[2] if "command" in order else "panorama" for order in orders]
        return [name for name in names if not name.startswith("set_")]

    def commands(self, name: str) -> list[dict[str, Any]]:
        return [e["args"] for e in self.entries if e["kind"] == "command" and e["name"].rpartition(".")[2] == name]


SET_ANEW = ("set_view_mode", "set_roi_none", "mount_control")
"""Lines that a file may have besides, for a mode that holds or has to."""


def check(log: Log, plan: Plan) -> None:
    """Each way point was passed within 2 m, and what is between two of them was done between them, in order."""
    track, lines = log.track(), log.lines()
    wanted = [item for item in executed(plan) if item.command in LINES]
    position = 0

    def passed(where: tuple[float, float, float], number: int) -> None:
        nonlocal position
        began, name = lines[position]
        assert name == "waypoint", (number, lines[position:])
        position += 1
        end = lines[position][0]
        flown = [at for t, at in track if began <= t <= end + 0.2]
        closest = min(itertools.starmap(partial(apart, where), itertools.pairwise(flown)))
        assert closest < WITHIN, (number, closest)

    def stays() -> bool:
        """A way point where the drone is: an Ai begins a file over its first one, whatever stands in front of that.

        In the air it climbs first, to its return height if that is higher (Parrot's flight plan page), and comes back.
        """
        began, name = lines[position]
        start = max(t for t in log.starts() if t <= began)
        points = [at for t, at in track if start <= t <= lines[position + 1][0]]
        return (
            name == "waypoint"
            and math.dist(points[0], points[-1]) < WITHIN
            and all(math.dist(points[0][:2], at[:2]) < WITHIN for at in points)
        )

    for number, item in enumerate(wanted):
        names = LINES[item.command]
        while lines[position][1] not in names and (lines[position][1] in SET_ANEW or stays()):
            position += 1
        if names == ("waypoint",):
            passed(place(item), number)
            continue
        if item.command == BY_DISTANCE and item.params[0] == 0.0 and item.params[2] == 1.0:
            assert lines[position][1] == "stop_photo"  # and one more
            position += 1
        assert lines[position][1] in names, (number, item, lines[position:])
        position += 1
        if names == ("takeoff",):
            passed((0.0, 0.0, item.params[6] or 0.0), number)
    assert position == len(lines), lines[position:]


@pytest.mark.timeout(400)
async def test_conf_075_121_every_sample_on_a_drone_of_its_own(tmp_path: Path) -> None:
    first = loopback()
    head, _, last = first.rpartition(".")
    addresses = [f"{head}.{(int(last) + number) % 250 + 1}" for number in range(len(FLOWN))]
    drones = "\n".join(
        f"  - {{name: {name}, sysid: {number}, sim: {{model: {model}, address: {address}, home: {list(HOME)}}}}}"
        for number, ((name, model), address) in enumerate(zip(FLOWN.items(), addresses, strict=True), start=1)
    )
    config = f'endpoints: ["tcpin://{first}:5760"]\ndrones:\n{drones}\n'
    plans, paths = {name: files.load(MISSIONS / f"{name}.plan") for name in FLOWN}, []
    for name in FLOWN:
        path = MISSIONS / f"{name}.plan"
        if name in FOREIGN:
            path = tmp_path / f"{name}.plan"
            files.save(replace(plans[name], blocks=()), path, files.Format.QGC)
        paths.append(str(path))
    async with product(tmp_path, config, ready=False) as p:
        await p.line(lambda line: line.startswith("ready"), timeout=90.0)
        words = (sys.executable, "-u", str(SCRIPT), f"tcpout://{first}:5760", *paths)
        async with program(*words) as mavsdk:
            await mavsdk.line(lambda line: line == "done", timeout=200.0)
        entries = p.entries("pose") + p.entries("plan") + p.entries("command")
        for name, address in zip(FLOWN, addresses, strict=True):
            log = Log(entries, address)
            check(log, plans[name])
            assert log.camera() == CAMERA.get(name, []), name
            zooms = [order["target"] for order in log.commands("SetZoomTarget") if "target" in order]
            assert zooms == ([3.5, 1.0] if name == "inspection" else []), name
