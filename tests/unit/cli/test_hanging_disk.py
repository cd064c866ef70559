"""A gateway beside a disk or a terminal that hangs: its drones go on, and so does its end."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fabric import FabricStation, free_port, router
from support.hanging_disk import hanging, hanging_file
from support.mav import Client
from support.product import product
from support.world import loopback, world

from anafi_mav.config import Config, DroneConfig
from anafi_mav.disk_writer import HANGS
from anafi_mav.gateway import Gateway
from anafi_mav.state_lock import STATE_WRITER, read_holder, state_folder

MISSIONS = Path(__file__).parents[3] / "missions"


async def test_hanging_log_file_stops_neither_a_command_nor_the_end(tmp_path: Path) -> None:
    address = loopback()
    path, reading = hanging_file(tmp_path / "gateway.log")
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}}}}}]
    """
    try:
        async with product(tmp_path, config, "-vv", "--log-file", str(path)) as p:
            client = await Client().connect(5760, address)
            await client.heartbeat(lambda beat: True)
            ack = await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
            await client.close()
            p.process.send_signal(signal.SIGTERM)
            assert await p.end() == 0
    finally:
        os.close(reading)


def fill(pipe: int) -> None:
    """Leave no room in a pipe, as in a terminal that was stopped by Ctrl-S."""
    os.set_blocking(pipe, False)
    with suppress(BlockingIOError):
        while True:
            os.write(pipe, b"x" * 4096)
    os.set_blocking(pipe, True)


@asynccontextmanager
async def started(*words: str, **streams: int) -> AsyncIterator[asyncio.subprocess.Process]:
    """`anafi-mav` for the length of a block."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "anafi_mav", *words, stdin=asyncio.subprocess.DEVNULL, **streams
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


@contextmanager
def open_pipe() -> Iterator[tuple[int, int]]:
    """The two ends of a pipe, the reading one first, for the length of a block."""
    ends = os.pipe()
    try:
        yield ends
    finally:
        for end in ends:
            os.close(end)


async def ready(pipe: int) -> None:
    """Read a pipe until the program at its other end is ready."""
    await read_until(pipe, b"ready")


async def read_until(pipe: int, word: bytes) -> None:
    """Read a pipe until a program has written a word."""
    shown = b""
    while word not in shown:
        shown += await asyncio.wait_for(asyncio.to_thread(os.read, pipe, 4096), 30.0)


async def end(process: asyncio.subprocess.Process) -> int:
    """The status with which a program ends at SIGTERM."""
    process.send_signal(signal.SIGTERM)
    return await asyncio.wait_for(process.wait(), 15.0)


def fleet(folder: Path, address: str) -> str:
    """The path of a configuration with one simulated drone."""
    path = folder / "fleet.yaml"
    path.write_text(f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}}}}}]
    """)
    return str(path)


async def test_stopped_terminal_stops_neither_a_command_nor_the_end(tmp_path: Path) -> None:
    address = loopback()
    with open_pipe() as (reading, shown), open_pipe() as (_, stopped):
        fill(stopped)
        async with started("run", "-c", fleet(tmp_path, address), "-vv", stdout=shown, stderr=stopped) as process:
            await ready(reading)
            client = await Client().connect(5760, address)
            await client.heartbeat(lambda beat: True)
            ack = await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
            await client.close()
            assert await end(process) == 0


async def test_stopped_terminal_of_a_ground_process_keeps_no_station_from_its_drone() -> None:
    """The line about the systems on the fabric has no room on stdout."""
    port = free_port()
    async with router() as node:
        words = ("ground", "--zenoh", node.url, "--endpoint", f"tcpin://127.0.0.1:{port}")
        with open_pipe() as (reading, shown):
            async with started(*words, stdout=shown) as process:
                await ready(reading)
                fill(shown)
                async with world(endpoints=(node.url,), speed=1.0):
                    station = await FabricStation().join(port, tcp=True)
                    version = dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
                    ack = await station.command(dialect.MAV_CMD_REQUEST_MESSAGE, version)
                    assert ack.result == dialect.MAV_RESULT_ACCEPTED
                    await station.close()
                assert await end(process) == 0


async def test_sigterm_beside_a_stopped_terminal_hovers_a_drone_in_the_air(tmp_path: Path) -> None:
    """The sentence about the drone has no room on stdout."""
    address, log = loopback(), tmp_path / "sim.jsonl"
    words = ("run", "-c", fleet(tmp_path, address), "--sim-log", str(log))
    with open_pipe() as (reading, shown):
        async with started(*words, stdout=shown) as process:
            await ready(reading)
            client = await Client().connect(5760, address)
            assert (await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == 0
            assert (await client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result == 0
            fill(shown)
            assert await end(process) == 0
            await client.close()
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    assert [entry["name"] for entry in entries if entry["kind"] == "session"] == ["up", "lost"]


async def test_stopped_terminal_stops_no_ground_process() -> None:
    """It carries sticks and setpoints of stations, too."""
    pytest.importorskip("zenoh", reason="the extra `fabric` is not installed")
    url = f"zenoh://{loopback()}:7447"
    with open_pipe() as (_, stopped):
        fill(stopped)
        words = ("ground", "--zenoh", url, "--endpoint", f"udpin://{loopback()}:0")
        async with started(*words, stdout=stopped, stderr=asyncio.subprocess.PIPE) as process:
            assert process.stderr is not None
            assert url.encode() in await asyncio.wait_for(process.stderr.readline(), 30.0)  # no router: its loop runs
            assert await end(process) == 0


@pytest.mark.parametrize("shown_last", [b"", b"begun"], ids=["upload", "flight"])
async def test_stopped_terminal_of_plan_fly_delays_neither_its_heartbeats_nor_ctrl_c(shown_last: bytes) -> None:
    """The lines about the upload, or about the mission, have no room on stdout."""
    async with world(speed=4.0, web=True) as w:
        words = ("plan", "fly", str(MISSIONS / "orbit.plan"), "--endpoint", f"tcpout://{w.address}:5760")
        with open_pipe() as (reading, shown):
            if not shown_last:
                fill(shown)
            async with started(*words, stdout=shown) as process:
                if shown_last:
                    await read_until(reading, shown_last)
                    fill(shown)
                await w.client.wait("MISSION_ITEM_REACHED", lambda m: m.seq >= 1, since=0, timeout=60.0)
                process.send_signal(signal.SIGINT)
                assert await asyncio.wait_for(process.wait(), 15.0) == 130


async def test_drones_connect_beside_a_hanging_state_folder() -> None:
    """What is stored about a drone, and the lock file's line about it, are the business of a thread."""
    with hanging(STATE_WRITER):
        async with world() as w:
            said = "".join(m.text for _, m in w.client.since(0, "STATUSTEXT"))
            assert "the disk does not answer; no plans, new ones not kept" in said
        holder = read_holder(state_folder(None))
        assert holder is not None
        assert holder.drones == ()  # they would be written by now


async def test_state_folder_on_a_hanging_disk_stays_locked_behind_the_end(tmp_path: Path) -> None:
    """What is still to be written there would replace files of the next gateway."""
    host = loopback()
    drones = (DroneConfig(name="alpha", sysid=1, address=host),)
    config = Config(endpoints=(f"tcpin://{host}:5760",), drones=drones, video=False, http=False, state=str(tmp_path))
    gateway = Gateway(config)
    await gateway.open()
    with hanging(STATE_WRITER):
        await gateway.close()
        assert read_holder(tmp_path) is not None
        assert gateway.state_problems() == [f"{tmp_path}: {HANGS}"]
