"""The examples of the Python API, each as a program of its own against `anafi-mav sim`, judged by its log."""

from __future__ import annotations

import json
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

import pytest
from support.process import SimulatorProcess, simulator_process
from support.product import Process, program
from support.world import loopback

EXAMPLES = Path(__file__).parents[2] / "examples" / "python_api"
HTTP_PORT, RTSP_PORT = 8080, 8554
HOME = (48.8789, 2.3677)
SPEED = 10.0
"""Simulated seconds a second, where the drone only has to fly."""


@asynccontextmanager
async def simulated(log: Path, address: str, *arguments: str, speed: float = SPEED) -> AsyncIterator[SimulatorProcess]:
    ports = ("--http-port", str(HTTP_PORT), "--rtsp-port", str(RTSP_PORT))
    async with simulator_process(address, log, "--speed", str(speed), "--seed", "1", *ports, *arguments) as simulator:
        yield simulator


@asynccontextmanager
async def example(name: str, *arguments: str) -> AsyncIterator[Process]:
    async with program(sys.executable, str(EXAMPLES / name), *arguments) as running:
        yield running


def entries(simulator: SimulatorProcess, kind: str, address: str = "") -> Sequence[dict[str, Any]]:
    """What a drone logged of one kind; the newest line may not be whole yet."""
    whole = simulator.log.read_bytes().rpartition(b"\n")[0].splitlines()
    return [one for one in map(json.loads, whole) if one["kind"] == kind and one["drone"].startswith(address)]


def commands(simulator: SimulatorProcess, *names: str, address: str = "") -> list[str]:
    received = [one["name"].rpartition(".")[2] for one in entries(simulator, "command", address)]
    return [name for name in received if name in names]


def flown_states(simulator: SimulatorProcess, address: str = "") -> list[str]:
    return [one["args"]["to"] for one in entries(simulator, "state", address) if one["name"] == "flying"]


async def test_fly_example_flies_there_and_back_and_lands(tmp_path: Path) -> None:
    address = loopback()
    async with simulated(tmp_path / "log", address) as simulator:
        async with example("fly.py", address, "--distance", "15", "--height", "6") as fly:
            assert await fly.end(60.0) == 0, fly
        assert [line.partition(":")[0] for line in fly.lines] == [
            "connected", "taken off", "climbed", "15 m north", "back", "landed",
        ]  # fmt: skip
        flight = commands(simulator, "TakeOff", "moveBy", "moveTo", "Landing", "CancelMoveTo")
        assert flight == ["TakeOff", "moveBy", "moveTo", "moveBy", "moveTo", "Landing"]
        assert flown_states(simulator)[-1] == "landed"
        poses = [one["args"] for one in entries(simulator, "pose")]
        assert max(pose["lat"] for pose in poses) == pytest.approx(HOME[0] + 15.0 / 111_226.0, abs=1e-5)
        assert poses[-1]["lat"] == pytest.approx(HOME[0], abs=1e-5)


async def test_interrupted_fly_example_leaves_the_drone_hovering(tmp_path: Path) -> None:
    """Ctrl-C in the middle of a moveTo."""
    address = loopback()
    async with simulated(tmp_path / "log", address) as simulator:
        async with example("fly.py", address, "--distance", "3000") as fly:
            await fly.line(lambda line: line.startswith("climbed"))
            while "moveTo" not in commands(simulator, "moveTo"):
                await fly.look(lambda line: False, since=0, timeout=0.1)  # another process writes the log
            fly.process.send_signal(2)
            assert await fly.end(30.0) != 0, fly
        assert commands(simulator, "CancelMoveTo") == ["CancelMoveTo"]
        assert flown_states(simulator)[-1] in ("hovering", "flying")


async def test_photo_example_downloads_the_stored_photos(tmp_path: Path) -> None:
    address, folder = loopback(), tmp_path / "photos"
    async with (
        simulated(tmp_path / "log", address) as simulator,
        example("photo.py", address, "--http-port", str(HTTP_PORT), "--folder", str(folder)) as photo,
    ):
        assert await photo.end(60.0) == 0, photo
        (path,) = folder.iterdir()
        assert path.read_bytes().startswith(b"\xff\xd8")  # a JPEG
        assert f"downloaded {path.name}: {path.stat().st_size} bytes" in photo.lines
        assert commands(simulator, "take_photo", "TakeOff") == ["take_photo"]


async def test_four_drones_example_flies_all_at_once(tmp_path: Path) -> None:
    first = loopback()
    addresses = [str(IPv4Address(first) + index) for index in range(4)]
    async with simulated(tmp_path / "log", first, "--count", "4", speed=4.0) as simulator:
        async with example("four_drones.py", *addresses) as fleet:
            assert await fleet.end(90.0) == 0, fleet
        times = []
        for index, address in enumerate(addresses):
            assert f"drone {index + 1}: landed" in fleet.lines
            assert flown_states(simulator, address)[-1] == "landed"
            top = max(one["args"]["ato"] for one in entries(simulator, "pose", address))
            assert top == pytest.approx(4.0 + 3.0 * index, abs=0.5)
            states = [one for one in entries(simulator, "state", address) if one["name"] == "flying"]
            times.append((states[0]["t"], states[-1]["t"]))
        assert sorted(begin for begin, _ in times)[1] < min(end for _, end in times)


async def test_four_drones_example_without_one_flies_the_others(tmp_path: Path) -> None:
    address, absent = loopback(), loopback()
    async with simulated(tmp_path / "log", address) as simulator:
        async with example("four_drones.py", absent, address) as fleet:
            assert await fleet.end(60.0) == 1, fleet
        assert [line for line in fleet.lines if line.startswith("drone 1: LinkLost")]
        assert flown_states(simulator, address)[-1] == "landed"


async def test_metadata_example_reads_every_picture(tmp_path: Path) -> None:
    address, file = loopback(), tmp_path / "frames.csv"
    words = ("--rtsp-port", str(RTSP_PORT), "--seconds", "3", "--csv", str(file))
    async with simulated(tmp_path / "log", address, speed=1.0), example("metadata.py", address, *words) as metadata:
        assert await metadata.end(60.0) == 0, metadata
    head, *rows = [line.split(",") for line in file.read_text().splitlines()]
    assert head[:4] == ["taken_s", "roll_deg", "pitch_deg", "yaw_deg"]
    taken = [float(row[0]) for row in rows]
    assert taken == sorted(set(taken))
    assert len(rows) > 15  # 90 where the host does not stall; the events of telemetry would be 15


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_flight_plan_example_flies_the_whole_file(tmp_path: Path, model: str) -> None:
    address = loopback()
    async with simulated(tmp_path / "log", address, "--model", model, speed=16.0) as simulator:
        async with example("flight_plan.py", address, "--http-port", str(HTTP_PORT)) as plan:
            assert await plan.end(90.0) == 0, plan
        assert [line for line in plan.lines if line in ("started", "plan ended", "landed")] == [
            "started", "plan ended", "landed",
        ]  # fmt: skip
        done = [int(line.split()[1]) for line in plan.lines if line.startswith("item ")]
        assert done == sorted(done)
        assert len(done) > 10
        assert flown_states(simulator)[-1] == "landed"
        assert max(one["args"]["ato"] for one in entries(simulator, "pose")) == pytest.approx(25.0, abs=1.0)


async def test_first_program_of_the_guide_flies_and_lands(tmp_path: Path) -> None:
    address, script = loopback(), tmp_path / "first.py"
    text = (EXAMPLES.parents[1] / "docs" / "python-api.md").read_text(encoding="utf-8")
    first = text.split("```python\n")[1].split("```")[0]
    assert first.count("127.0.42.1") == 1
    script.write_text(first.replace("127.0.42.1", address), encoding="utf-8")
    async with simulated(tmp_path / "log", address) as simulator:
        async with program(sys.executable, str(script)) as running:
            assert await running.end(60.0) == 0, running
        assert commands(simulator, "TakeOff", "moveBy", "Landing") == ["TakeOff", "moveBy", "Landing"]
        assert flown_states(simulator)[-1] == "landed"


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py") if path.stem != "four_drones"))
async def test_example_without_a_drone_ends_with_one_line(name: str) -> None:
    async with example(name, loopback()) as alone:
        assert await alone.end(60.0) == 1, alone
    assert [line.partition(":")[0] for line in alone.complaints] == ["LinkLost"], alone
