"""`anafi-mav sim` as a process: what it says, what it refuses, how it ends; and the drones it is made of."""

from __future__ import annotations

import asyncio
import io
import json
import signal
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from support.world import loopback

from anafi_mav.arsdk.link import handshake
from anafi_mav.cli import main
from anafi_mav.errors import ConfigError
from anafi_mav.sim import DroneSpec, Simulator

LIMIT = 20.0
"""s for anything a process does."""


async def sim(*words: str, stdin: int = asyncio.subprocess.DEVNULL) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "anafi_mav", "sim", *words),
        stdin=stdin,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )


@asynccontextmanager
async def running(
    *words: str, stdin: int = asyncio.subprocess.DEVNULL, first: bytes = b""
) -> AsyncIterator[tuple[asyncio.subprocess.Process, list[str]]]:
    """A simulator that is ready, with the lines it said; `first` goes to its stdin."""
    process = await sim(*words, stdin=stdin)
    try:
        if first:
            assert process.stdin is not None
            process.stdin.write(first)
        assert process.stdout is not None
        lines: list[str] = []
        while not lines or not lines[-1].startswith("ready"):
            line = await asyncio.wait_for(process.stdout.readline(), LIMIT)
            assert line, (await process.communicate())[1].decode()
            lines.append(line.decode().rstrip())
        yield process, lines
    finally:
        if process.returncode is None:
            process.kill()
        await process.communicate()


def refused_here(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one line with which it refuses its arguments, in this process: nothing has been started by then."""
    status = main(["sim", *words])
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    (line,) = err.splitlines()
    return line


async def refused(*words: str) -> str:
    """The one line with which it ends at once, as a process."""
    process = await sim(*words)
    try:
        out, err = await asyncio.wait_for(process.communicate(), LIMIT)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert (process.returncode, out) == (2, b"")
    (line,) = err.decode().splitlines()
    return line


async def discover(address: str) -> dict[str, Any]:
    """What a drone sends each client that connects to its discovery port."""
    reader, writer = await asyncio.open_connection(address, handshake.DISCOVERY_PORT)
    text = await asyncio.wait_for(reader.readuntil(b"\0"), LIMIT)
    writer.close()
    found = json.loads(text[:-1])
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_sim_prints_ready_and_ends_on_a_signal(number: signal.Signals) -> None:
    address = loopback()
    ports = ("--http-port", "0", "--rtsp-port", "0")
    async with running("--address", address, *ports, "--protocol", "2") as (process, lines):
        assert lines[-1] == "ready, Ctrl-C ends"
        (line,) = lines[:-1]
        assert f"at {address}: discovery 44445, protocol 2, HTTP " in line
        assert ", RTSP " in line
        device = await discover(address)
        assert device["model.id"] == "0x0914"
        assert device["serial"] in line
        assert device["port"] == 44444
        process.send_signal(number)
        out, err = await asyncio.wait_for(process.communicate(), LIMIT)
        assert (process.returncode, out, err) == (0, b"", b"")


async def test_three_drones_in_one_process() -> None:
    first = loopback().rpartition(".")[0] + ".250"
    async with running("--address", first, "--count", "3", "--http-port", "0") as (_, lines):
        assert len(lines) == 4
        network = first.rpartition(".")[0]
        devices = [await discover(f"{network}.{host}") for host in (250, 251, 252)]
        assert len({device["serial"] for device in devices}) == 3
        assert len({device["name"] for device in devices}) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="sets a limit by ulimit of sh, which Windows does not have")
async def test_fleet_that_needs_more_open_files_than_a_shell_allows_is_ready() -> None:
    """Each drone has four sockets, and a shell usually allows 1024 files."""
    words = (sys.executable, "-m", "anafi_mav", "sim", "--address", loopback(), "--count", "20")
    process = await asyncio.create_subprocess_exec(
        *("sh", "-c", 'ulimit -Sn 64 && exec "$@"', "sh", *words),
        *("--http-port", "8080", "--rtsp-port", "8554"),
        stdout=asyncio.subprocess.PIPE,
    )
    assert process.stdout is not None
    try:
        lines = [await asyncio.wait_for(process.stdout.readline(), LIMIT) for _ in range(21)]
        assert lines[-1].startswith(b"ready")
        assert sum(b"HTTP 8080, RTSP 8554" in line for line in lines) == 20
    finally:
        process.terminate()
        await asyncio.wait_for(process.wait(), LIMIT)


async def test_fleet_from_stdin_ends_with_stdin() -> None:
    network = loopback().rpartition(".")[0]
    drones = [
        {
            "address": f"{network}.240",
            "http_port": None,
            "rtsp_port": None,
            "name": "Alpha",
            "serial": "PI040416DA9H777777",
        },
        {"address": f"{network}.241", "http_port": None, "home": [10.0, 20.0, 30.0], "versions": [1, 2]},
    ]
    fleet = json.dumps({"drones": drones, "speed": 2.0, "seed": 7}).encode() + b"\n"
    words = ("--fleet", "-", "--stdin-watch")
    async with running(*words, stdin=asyncio.subprocess.PIPE, first=fleet) as (process, lines):
        assert "no HTTP, no video" in lines[0]
        assert "protocol 1 to 2" in lines[1]
        device = await discover(f"{network}.240")
        assert (device["name"], device["serial"]) == ("Alpha", "PI040416DA9H777777")
        assert process.stdin is not None
        process.stdin.close()
        assert await asyncio.wait_for(process.wait(), LIMIT) == 0


async def test_a_fleet_from_a_file(tmp_path: Path) -> None:
    address = loopback()
    fleet = tmp_path / "fleet.json"
    fleet.write_text(json.dumps({"drones": [{"address": address, "http_port": None}]}))
    async with running("--fleet", str(fleet)):
        assert (await discover(address))["model.id"] == "0x0914"


async def test_simulator_log_is_lines_of_json(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    address = loopback()
    async with running("--address", address, "--http-port", "0", "--log", str(log)) as (process, _):
        process.terminate()
        await asyncio.wait_for(process.wait(), LIMIT)
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    assert {entry["drone"] for entry in entries} == {address}
    pose = next(entry for entry in entries if entry["kind"] == "pose")
    assert (pose["args"]["north"], pose["args"]["ato"]) == (0.0, 0.0)
    assert (pose["args"]["lat"], pose["args"]["lon"]) == (48.8789, 2.3677)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--storage", "16 gigs"], "--storage: expected a number of bytes like 500k or 16G, got '16 gigs'"),
        (["--storage", "-1"], "--storage: expected a number of bytes, got -1"),
        (["--model", "bebop"], "--model: expected one of 4k, thermal, usa, ai, got 'bebop'"),
        (["--address", "localhost"], "--address: expected an IPv4 address, got 'localhost'"),
        (["--count", "0"], "--count: expected a number from 1 to 254, got 0"),
        (["--count", "many"], "--count: expected a number from 1 to 254, got 'many'"),
        (["--count", "255"], "--count: expected a number from 1 to 254, got 255"),
        (
            ["--address", "255.255.255.254", "--count", "3"],
            "--count: expected room for 3 addresses from 255.255.255.254 on",
        ),
        (["--home", "Paris"], "--home: expected LAT,LON,ALT like 48.8789,2.3677,35, got 'Paris'"),
        (["--home", "1,2"], "--home: expected LAT,LON,ALT like 48.8789,2.3677,35, got '1,2'"),
        (
            ["--home", "91,0,0"],
            "--home: expected latitude, longitude (deg) and altitude (up to 10000 m), got (91.0, 0.0, 0.0)",
        ),
        (
            ["--home", "nan,0,0"],
            "--home: expected latitude, longitude (deg) and altitude (up to 10000 m), got (nan, 0.0, 0.0)",
        ),
        (["--speed", "0"], "--speed: expected a number from 0.1 to 20, got 0"),
        (["--speed", "nan"], "--speed: expected a number from 0.1 to 20, got 'nan'"),
        (["--seed", "x"], "--seed: expected a whole number from 0 to 4294967295, got 'x'"),
        (["--seed", "-1"], "--seed: expected a whole number from 0 to 4294967295, got -1"),
        (["--protocol", "4"], "--protocol: expected 1, 2 or 3, got 4"),
        (["--http-port", "65536"], "--http-port: expected a port from 0 to 65535, got 65536"),
        (["--telemetry-rate", "0"], "--telemetry-rate: expected up to 200 Hz, got 0"),
        (["--fleet", "/nowhere/fleet.json"], "--fleet: expected a JSON object with drones in /nowhere/fleet.json: "),
    ],
)
def test_a_mistake_is_one_line(words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused_here(capsys, *words).startswith(f"anafi-mav: {complaint}")


@pytest.mark.parametrize(
    ("fleet", "complaint"),
    [
        (b"{}\n", "--fleet: expected a JSON object with drones in -: Object missing required field `drones`"),
        (b"\xff\xfe\n", "--fleet: expected a JSON object with drones in -: "),
        (b"", "--fleet: expected a JSON object with drones in -: "),
        (b'{"drones": []}\n', "drones: expected at least one"),
        (b'{"drones": [{"modell": "4k"}]}\n', "--fleet: expected keys of DroneSpec, got modell"),
        (
            b'{"drones": [{"discovery_port": 99999}]}\n',
            "--fleet: expected a JSON object with drones in -: "
            "discovery_port: expected a port from 0 to 65535, got 99999 - at `$.drones[0]`",
        ),
        (
            b'{"drones": [{"versions": [2, 1]}]}\n',
            "--fleet: expected a JSON object with drones in -: versions: expected the lowest and the highest of 1 to 3",
        ),
    ],
)
def test_a_wrong_fleet_is_one_line(
    fleet: bytes, complaint: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(fleet)))
    assert refused_here(capsys, "--fleet", "-").startswith(f"anafi-mav: {complaint}")


async def test_a_port_in_use_is_one_line() -> None:
    address = loopback()
    with socket.create_server((address, 44445)):
        line = await refused("--address", address, "--http-port", "0")
    assert line.startswith(f"anafi-mav: --address: expected free ports on {address}: ")
    assert "44445" in line


async def test_a_taken_web_port_costs_the_web_server_only() -> None:
    address = loopback()
    with socket.create_server((address, 0)) as taken:
        port = taken.getsockname()[1]
        async with running("--address", address, "--http-port", str(port)) as (_, lines):
            assert f"no HTTP on port {port}: Address already in use" in lines[0]
            await discover(address)


async def test_unwritable_simulator_log_is_one_line(tmp_path: Path) -> None:
    complaint = f"--log: expected a file that can be written, got {tmp_path}: Is a directory"
    assert await refused("--log", str(tmp_path)) == f"anafi-mav: {complaint}"


# -- the parts


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"model": "5k"}, "model"),
        ({"address": "::1"}, "address"),
        ({"home": (0.0, 181.0, 0.0)}, "home"),
        ({"serial": "1234"}, "serial"),
        ({"http_port": -1}, "http_port"),
        ({"rtsp_port": 65536}, "rtsp_port"),
        ({"c2d_port": 65536}, "c2d_port"),
        ({"handshake_port": -1}, "handshake_port"),
        ({"versions": (0, 3)}, "versions"),
        ({"telemetry_rate": 201.0}, "telemetry_rate"),
        ({"telemetry_rate": float("nan")}, "telemetry_rate"),
    ],
)
def test_invalid_simulated_drone_is_refused(values: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        DroneSpec(**values)
    assert caught.value.key_path == key
    assert "expected" in caught.value.problem


@pytest.mark.parametrize("speed", [0.0, -1.0, 101.0, float("nan")])
def test_invalid_speed_is_refused(speed: float) -> None:
    with pytest.raises(ConfigError, match="speed"):
        Simulator([DroneSpec()], speed=speed)


async def test_same_seed_same_ids() -> None:
    def ids(seed: int) -> tuple[str, str]:
        identity = Simulator([DroneSpec()], seed=seed).drones[0].identity
        return identity.boot_id, identity.run_id

    assert ids(1) == ids(1)
    assert ids(1) != ids(2)
