"""Two aircraft with one address, each in a network of its own, flown at once by one gateway with two radios.

Three network namespaces stand for the two aircraft and the gateway's machine, two pairs of virtual Ethernet devices
for the air between them. Nothing of it exists on the machine that runs the test: the devices are made inside the
namespaces, and 192.168.42.0/24 is never routed here. Making a namespace takes root.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.product import Process
from support.rtsp_client import Viewer

from anafi_mav.config import from_text
from anafi_mav.relay.server import DEFAULT_PORT

AIRCRAFT = "192.168.42.1"
OURS = "192.168.42.23"
"""What the aircraft's DHCP gave both of our radios: the worst case."""

CLONE_NEWNET = 0x40000000
HOLD, TAKEOFF = 0x03040000, 0x02040000


def ip(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)


def routes() -> str:
    """What this machine knows of networks, namespaces aside."""
    return ip("-o", "addr").stdout + ip("route", "show", "table", "all").stdout


@pytest.fixture
def spaces() -> Iterator[tuple[str, str, str]]:
    """Names of the namespaces of the left aircraft, the right aircraft and the gateway."""
    names = tuple(f"amav{os.getpid()}{letter}" for letter in "lrg")
    before = routes()
    made: list[str] = []
    try:
        for name in names:
            done = ip("netns", "add", name)
            if done.returncode:
                pytest.skip(f"no network namespaces here (they take root): {done.stderr.strip()}")
            made.append(name)
            ip("-n", name, "link", "set", "lo", "up")
        left, right, gateway = names
        for aircraft, radio in ((left, "wlan1"), (right, "wlan2")):
            done = ip("-n", gateway, "link", "add", radio, "type", "veth", "peer", "name", "wlan0", "netns", aircraft)
            if done.returncode:
                pytest.skip(f"no virtual Ethernet here: {done.stderr.strip()}")
            ip("-n", gateway, "addr", "add", f"{OURS}/24", "dev", radio)
            ip("-n", aircraft, "addr", "add", f"{AIRCRAFT}/24", "dev", "wlan0")
            ip("-n", gateway, "link", "set", radio, "up")
            ip("-n", aircraft, "link", "set", "wlan0", "up")
        assert routes() == before
        yield left, right, gateway
        assert routes() == before
    finally:
        for name in made:
            ip("netns", "del", name)


@asynccontextmanager
async def inside(space: str, *words: str) -> AsyncIterator[Process]:
    """`anafi-mav …` in a namespace, from its line that begins with "ready" to the end of the block."""
    held = await Process.start("ip", "netns", "exec", space, sys.executable, "-m", "anafi_mav", *words)
    try:
        await held.line(lambda line: line.startswith("ready"))
        yield held
    finally:
        if held.process.returncode is None:
            held.process.send_signal(signal.SIGTERM)
            await asyncio.wait([asyncio.ensure_future(held.process.wait())], timeout=10.0)
        await held.put_away()


@asynccontextmanager
async def found(space: str, *words: str) -> AsyncIterator[list[str]]:
    """What a command prints in a namespace."""
    held = await Process.start("ip", "netns", "exec", space, sys.executable, "-m", "anafi_mav", *words)
    try:
        assert await held.end() == 0, str(held)
        yield held.lines
    finally:
        await held.put_away()


def connected(space: str, address: tuple[str, int]) -> socket.socket:
    """A TCP connection made inside a namespace: a socket stays where it was made, a thread can go there."""
    result: list[socket.socket | BaseException] = []

    def go() -> None:
        try:
            with Path(f"/run/netns/{space}").open() as place:
                if ctypes.CDLL(None, use_errno=True).setns(place.fileno(), CLONE_NEWNET):
                    raise OSError(ctypes.get_errno(), "setns")
            result.append(socket.create_connection(address, timeout=5.0))
        except BaseException as error:
            result.append(error)

    thread = threading.Thread(target=go)
    thread.start()
    thread.join()
    if isinstance(result[0], BaseException):
        raise result[0]
    return result[0]


class Visitor(Client):
    """A client inside a namespace."""

    async def visit(self, space: str, port: int) -> Visitor:
        sock = await asyncio.to_thread(connected, space, ("127.0.0.1", port))
        sock.setblocking(False)
        reader, self._writer = await asyncio.open_connection(sock=sock)
        self._task = asyncio.get_running_loop().create_task(self._read(reader))
        return self


def entries(log: Path, kind: str) -> list[dict[str, Any]]:
    lines = log.read_bytes().rpartition(b"\n")[0].splitlines()
    return [entry for entry in map(json.loads, lines) if entry["kind"] == kind]


FLEET = f"""\
endpoints: ["tcpin://127.0.0.1:5760"]
drones:
  - {{name: left, sysid: 1, address: {AIRCRAFT}, interface: wlan1}}
  - {{name: right, sysid: 2, address: {AIRCRAFT}, interface: wlan2}}
"""


async def test_two_aircraft_with_one_address_fly_at_once(spaces: tuple[str, str, str], tmp_path: Path) -> None:
    left, right, home = spaces
    config = tmp_path / "fleet.yaml"
    config.write_text(FLEET)
    logs = [tmp_path / "left.jsonl", tmp_path / "right.jsonl"]
    options = ("sim", "--address", AIRCRAFT, "--speed", "3")
    async with (
        inside(left, *options, "--model", "4k", "--log", str(logs[0])),
        inside(right, *options, "--model", "thermal", "--log", str(logs[1])),
        found(home, "discover") as discovery,
        found(home, "info", f"{AIRCRAFT}%wlan2", "--take") as info,
        found(home, "doctor", f"{AIRCRAFT}%wlan1") as examined,
        inside(home, "run", "-c", str(config)) as gateway,
    ):
        assert {drone.interface for drone in from_text("\n".join(discovery), "stdout").drones} == {"wlan1", "wlan2"}
        assert "model: ANAFI Thermal" in info
        assert "adapter: ok: wlan1" in examined
        assert any(line.startswith("model: ok: ANAFI 4K") for line in examined)
        assert not [line for line in examined if "WRONG" in line]
        lines = [line for line in gateway.lines if line.startswith("drone ")]
        assert f"left: system 1 at {AIRCRAFT} on wlan1: ANAFI 4K" in lines[0]
        assert f"right: system 2 at {AIRCRAFT} on wlan2: ANAFI Thermal" in lines[1]
        clients = [await Visitor(256 - system, 190).visit(home, 5760) for system in (1, 2)]
        try:
            await asyncio.gather(*(fly(client, system) for system, client in enumerate(clients, 1)))
            await asyncio.gather(watch(home, "left"), watch(home, "right"))
        finally:
            for client in clients:
                await client.close()

    # Each aircraft did what was asked of it, and nothing that was asked of the other.
    for log, height in zip(logs, (5.0, 9.0), strict=True):
        assert len([e for e in entries(log, "command") if e["name"] == "ardrone3.Piloting.TakeOff"]) == 1
        assert max(entry["args"]["up"] for entry in entries(log, "pose")) == pytest.approx(height, abs=0.7)
        assert len([e for e in entries(log, "session") if e["name"] == "up"]) == (2 if log is logs[1] else 1)
        assert [entry["name"] for entry in entries(log, "video")] == ["setup", "play", "end"]


async def watch(home: str, name: str) -> None:
    """A viewer at the gateway's video server: each aircraft has URIs of its own there."""
    sock = await asyncio.to_thread(connected, home, ("127.0.0.1", DEFAULT_PORT))
    sock.setblocking(False)
    viewer = Viewer(DEFAULT_PORT, *await asyncio.open_connection(sock=sock))
    try:
        path = f"{name}/visible"
        assert (await viewer.describe(path)).name == name
        eye = await viewer.setup_inside(f"{path}/video")
        await viewer.play(path)
        assert (await eye.first(30))[0].is_key
    finally:
        viewer.close()


async def fly(client: Client, system: int) -> None:
    """Up to a height of its own: 5 m for system 1, 9 m for system 2."""

    async def mode(wanted: int, since: int) -> None:
        def reached(beat: Any) -> bool:
            return beat.get_srcSystem() == system and beat.custom_mode == wanted

        await client.heartbeat(reached, since=since, timeout=40.0)

    ack = await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=(system, 1))
    assert ack.result == dialect.MAV_RESULT_ACCEPTED
    mark = client.mark()
    ack = await client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=1.0 + 4.0 * system, target=(system, 1))
    assert ack.result == dialect.MAV_RESULT_ACCEPTED
    await mode(TAKEOFF, mark)
    await mode(HOLD, client.mark())


async def test_media_and_video_of_two_aircraft_with_one_address(spaces: tuple[str, str, str], tmp_path: Path) -> None:
    """Both videos run at the same time, and both web servers are asked, over sockets that one interface each has."""
    left, right, home = spaces
    logs = [tmp_path / "left.jsonl", tmp_path / "right.jsonl"]
    script = Path(__file__).with_name("two_of_one_address.py")
    async with (
        inside(left, "sim", "--address", AIRCRAFT, "--model", "4k", "--log", str(logs[0])),
        inside(right, "sim", "--address", AIRCRAFT, "--model", "thermal", "--log", str(logs[1])),
    ):
        words = ("ip", "netns", "exec", home, sys.executable, str(script), AIRCRAFT, "wlan1", "wlan2", str(tmp_path))
        visit = await Process.start(*words)
        try:
            assert await visit.end(60.0) == 0, str(visit)
        finally:
            await visit.put_away()
    observed = json.loads(visit.lines[-1])
    assert observed["wlan1"]["streams"] == ["DefaultVideo"]
    assert observed["wlan2"]["streams"] == ["DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"]
    assert observed["wlan1"]["serial"] != observed["wlan2"]["serial"]
    for log, one in zip(logs, observed.values(), strict=True):
        assert one["frames"] == 30
        assert one["foreign"] == 0
        assert one["files"]
        assert one["bytes"] > 0
        # Each aircraft has shown its video to the one who asked there, and no one else has asked.
        videos = entries(log, "video")
        assert [entry["name"] for entry in videos] == ["setup", "play", "end"]
        assert videos[0]["args"]["client"][0] == OURS
        assert len([entry for entry in entries(log, "command") if "take_photo" in entry["name"]]) == 1


async def test_missing_interface_is_reported_and_retried(tmp_path: Path) -> None:
    path = tmp_path / "fleet.yaml"
    path.write_text(
        "endpoints: ['tcpin://127.0.0.1:0']\n"
        "drones: [{name: left, sysid: 1, address: 192.168.42.1, interface: nosuch0}]\n".replace(":0'", f":{_free()}'")
    )
    held = await Process.start(sys.executable, "-m", "anafi_mav", "run", "-c", str(path))
    try:
        await held.line(lambda line: line.startswith("ready"))
        (line,) = (line for line in held.lines if line.startswith("drone "))
        assert "on nosuch0: not connected" in line
        assert "interface nosuch0: No such device" in line
        assert "retrying" in line
    finally:
        held.process.send_signal(signal.SIGTERM)
        await held.end()
        await held.put_away()


def _free() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
