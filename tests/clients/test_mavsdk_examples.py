"""The shipped MAVSDK examples beside the whole flight, against the product in its own processes, judged by its log."""

from __future__ import annotations

import re
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from support.product import Process, Product, free_udp_port, product, program
from support.world import loopback

from anafi_mav import geo

EXAMPLES = Path(__file__).parents[2] / "examples"
HOME = (48.8789, 2.3677, 35.0)

pytestmark = pytest.mark.third_party


@asynccontextmanager
async def played(
    name: str, folder: Path, *, drones: int = 1, speed: float = 3.0
) -> AsyncIterator[tuple[Product, Process]]:
    """An example that has ended with exit status 0, and the product whose simulated drones it flew."""
    address = loopback()
    port = free_udp_port(address)
    fleet = [
        f"{{name: d{number}, sysid: {number}, sim: {{address: {loopback()}, home: {list(HOME)}, speed: {speed:g}}}}}"
        for number in range(1, drones + 1)
    ]
    async with product(folder, f'endpoints: ["udpout://{address}:{port}"]\ndrones: [{", ".join(fleet)}]') as p:
        async with program(sys.executable, str(EXAMPLES / f"{name}.py"), f"udpin://{address}:{port}") as example:
            assert await example.end(90.0) == 0, example
        yield p, example


def steps(example: Process, *words: str) -> list[str]:
    return [line for line in example.lines if line in words]


def received(p: Product, *names: str) -> list[str]:
    """Which of these commands the drones received, in their order."""
    found = [entry["name"].rpartition(".")[2] for entry in p.entries("command")]
    return [name for name in found if name in names]


def tracks(p: Product) -> Sequence[list[tuple[float, float, float]]]:
    """For each drone: (m north of home, m east, m above take-off) of its poses."""
    flown: dict[str, list[Any]] = {}
    for entry in p.entries("pose"):
        pose = entry["args"]
        flown.setdefault(entry["drone"], []).append((*geo.offset(*HOME[:2], pose["lat"], pose["lon"]), pose["ato"]))
    return list(flown.values())


async def test_mission_example_flies_its_triangle(tmp_path: Path) -> None:
    async with played("mission", tmp_path) as (p, example):
        words = ["uploaded: 5 items", "started", "in the air", "landed and disarmed"]
        assert steps(example, *words) == words
        items = [int(line.split()[1]) for line in example.lines if line.startswith("item ")]
        assert items == sorted(items)
        assert items[-1] == 5
        (track,) = tracks(p)
        for corner in ((15.0, 0.0), (15.0, 10.0)):
            assert min(abs(north - corner[0]) + abs(east - corner[1]) for north, east, _ in track) < 2.5
        assert track[-1] == pytest.approx((0.0, 0.0, 0.0), abs=1.5)


async def test_offboard_example_flies_its_velocity_and_its_place(tmp_path: Path) -> None:
    async with played("offboard", tmp_path, speed=1.0) as (p, example):
        words = ["offboard", "flown north at 2 m/s", "turned", "flown to a place 5 m east", "hovering"]
        assert steps(example, *words) == words
        (track,) = tracks(p)
        assert max(north for north, _, _ in track) > 3.0
        assert track[-1][1] == pytest.approx(5.0, abs=1.0)
        assert received(p, "TakeOff", "Landing") == ["TakeOff", "Landing"]


async def test_follow_example_stays_behind_its_target(tmp_path: Path) -> None:
    async with played("follow", tmp_path, speed=1.0) as (p, example):
        assert "following" in example.lines
        (track,) = tracks(p)
        assert 12.0 < max(north for north, _, _ in track) < 24.0  # the target goes from 8 m to 24.5 m
        assert abs(track[-1][1]) < 1.0
        assert max(height for _, _, height in track) == pytest.approx(8.0, abs=1.0)


async def test_geofence_example_is_refused_outside_and_flies_inside(tmp_path: Path) -> None:
    async with played("geofence", tmp_path) as (p, example):
        words = ["target outside the fence: COMMAND_DENIED", "flown to a target inside", "fence cleared"]
        assert steps(example, *words) == words
        assert received(p, "moveTo") == ["moveTo"]
        (track,) = tracks(p)
        assert max(north for north, _, _ in track) == pytest.approx(15.0, abs=1.5)


async def test_two_drones_example_flies_both_at_once(tmp_path: Path) -> None:
    async with played("two_drones", tmp_path, drones=2) as (p, example):
        assert "drones: 2" in example.lines
        assert sorted(max(height for _, _, height in track) for track in tracks(p)) == pytest.approx(
            [4.0, 7.0], abs=0.7
        )
        flights: dict[str, list[float]] = {}
        for entry in p.entries("state", "flying"):
            flights.setdefault(entry["drone"], []).append(entry["t"])
        (begin_1, *_, end_1), (begin_2, *_, end_2) = flights.values()
        assert max(begin_1, begin_2) < min(end_1, end_2)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_example_of_a_mavlink_client_needs_no_gateway_on_its_machine(path: Path) -> None:
    """A newcomer copies it to a machine that has no gateway."""
    assert re.findall(r"^(?:from|import) (anafi\w*)", path.read_text(), re.MULTILINE) == []
