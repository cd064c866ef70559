"""Downloads of a drone's files beside a fleet: their speed, and what they do to heartbeats and answers of others.

    .venv/bin/python tests/bench/media.py [ftp] [loss] [http]

A fleet of 20 simulated drones sends attitude, speed and height 30 times a second. Each part has processes of its own
for simulator, gateway, client and this script, all on loopback. This script is one more client: it measures the gaps
between the heartbeats of each drone, and the delay of commands that it sends to the drones whose files are not read.

- ftp: MAVSDK downloads by bursts. The same client and MAVSDK's own server, without a fleet, for comparison.
- loss: of the frames 5 % are lost each way. Bursts, and MAVSDK's other way with one request at a time.
- http: `anafi-mav media download` of 200 MB; memory of the gateway and of the command.
"""

from __future__ import annotations

import asyncio
import hashlib
import math
import os
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import yaml
from common import loopback, machine, product, quantile, usage
from pymavlink.dialects.v20 import common as dialect

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.lossy import lossy_link
from support.media import DAY, add_video

from anafi_mav.sim import DroneSpec, Simulator

DRONES, RATE = 20, 30.0

FTP_SIZE, SERVED_SIZE, LOSSY_SIZE, STEPS_SIZE, HTTP_SIZE = 20_000_000, 2_000_000, 3_000_000, 60_000, 200_000_000
"""Bytes of the files; one request at a time takes long."""

LOSS = 0.05

WEB_PORT, DRONES_WEB_PORT = 8088, 8080

COMMAND = 50_000
"""A number that MAVLink does not use; it is answered with UNSUPPORTED."""

EVERY = 0.02
"""s between commands."""

LATE = 0.02
"""s from which this script has gone on too late."""

TRIES = 3
"""Downloads whose median is printed."""


Span = tuple[float, float]
"""From when to when, s of the monotonic clock."""


# -- processes


async def simulate(first: str, size: int) -> None:
    """Be the fleet: each drone has one video."""
    head, _, last = first.rpartition(".")
    specs = [
        DroneSpec(
            address=f"{head}.{int(last) + number}", http_port=DRONES_WEB_PORT, rtsp_port=None, telemetry_rate=RATE
        )
        for number in range(DRONES)
    ]
    async with Simulator(specs) as simulator:
        for drone in simulator.drones:
            video = add_video(drone, size)
        print(video.id, video.size, video.md5(), flush=True)
        await asyncio.Event().wait()


async def download(url: str, path: str, folder: str, way: str, component: int) -> None:
    """Be MAVSDK's client; print the seconds of one download."""
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.ftp import FtpAsync

    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(url)
        end = time.monotonic() + 30.0
        system = None
        while system is None and time.monotonic() < end:
            await asyncio.sleep(0.1)
            for one in await mavsdk.get_systems():
                if await one.get_system_id() == 1 and await one.is_connected():
                    system = one
        if system is None:
            raise SystemExit("MAVSDK found no system")
        ftp = FtpAsync(system)
        await ftp.set_target_compid(component)
        await asyncio.sleep(2.0)  # beyond what it requests from 20 new systems
        began = time.monotonic()
        async for _ in ftp.download(path, folder, way == "burst"):
            pass
        print(f"{time.monotonic() - began:.6f}", flush=True)


async def serve(url: str, folder: str) -> None:
    """Be MAVSDK's server."""
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.ftp_server import FtpServerAsync

    async with Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT)) as mavsdk:
        await mavsdk.add_any_connection(url)
        server = FtpServerAsync(await mavsdk.server_component())
        await server.set_root_dir(folder)
        print("ready", flush=True)
        await asyncio.Event().wait()


@contextmanager
def own(*words: object) -> Iterator[subprocess.Popen[str]]:
    """Run this script in another process."""
    command = [sys.executable, str(Path(__file__)), *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


@dataclass
class Fleet:
    """A running fleet and its gateway."""

    gateway: subprocess.Popen[str]
    web: str
    path: str
    size: int
    md5: str
    client: str
    """Address of MAVSDK's end."""
    observer: str


@contextmanager
def fleet(size: int, folder: Path, endpoint: str = "udpout://{client}:14540") -> Iterator[Fleet]:
    """Start both."""
    first, client, observer, web = loopback(), loopback(), loopback(), loopback()
    head, _, last = first.rpartition(".")
    drones = [
        {
            "name": f"d{number}",
            "sysid": number + 1,
            "address": f"{head}.{int(last) + number}",
            "http_port": DRONES_WEB_PORT,
        }
        for number in range(DRONES)
    ]
    config = folder / "fleet.yaml"
    endpoints = [endpoint.format(client=client), f"udpout://{observer}:14550"]
    plan = {
        "endpoints": endpoints,
        "drones": drones,
        "state": str(folder / "state"),
        "http": {"host": web, "port": WEB_PORT},
        "video": False,
    }
    config.write_text(yaml.safe_dump(plan))
    with own("--simulate", first, size) as simulator:
        assert simulator.stdout is not None
        name, length, md5 = simulator.stdout.readline().split()
        with product("run", "-c", str(config)) as gateway:
            time.sleep(3.0)  # beyond the connections' own work
            yield Fleet(gateway, f"{web}:{WEB_PORT}", f"/media/{DAY}/{name}", int(length), md5, client, observer)


# -- the other client


@dataclass
class Observer:
    """Reads all heartbeats, and sends commands to all drones but the first."""

    address: str
    gaps: list[Span] = field(default_factory=list)
    delays: list[Span] = field(default_factory=list)
    late: list[Span] = field(default_factory=list)
    """When this script itself had to wait for a processor."""
    sent: int = 0

    def watch(self, done: threading.Event) -> None:
        """Go on until it is done."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind((self.address, 14550))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        pack = dialect.MAVLink(None, 255, 190)
        _, peer = sock.recvfrom(2048)
        beats: dict[int, float] = {}
        waiting: dict[tuple[int, int], float] = {}
        due, number = time.monotonic(), 0
        while not done.is_set():
            number += 1
            target, command = 2 + number % (DRONES - 1), COMMAND + number % 10_000
            message = dialect.MAVLink_command_long_message(target, 1, command, 0, *[math.nan] * 7)
            waiting[target, command] = time.monotonic()
            self.sent += 1
            sock.sendto(message.pack(pack), peer)
            due += EVERY
            while (left := due - time.monotonic()) > 0:
                if not select.select([sock], [], [], left)[0]:
                    break
                frame = sock.recv(2048)
                now, kind, system = time.monotonic(), int.from_bytes(frame[7:10], "little"), frame[5]
                if kind == dialect.MAVLINK_MSG_ID_HEARTBEAT and frame[6] == 1:
                    if system in beats:
                        self.gaps.append((beats[system], now))
                    beats[system] = now
                elif kind == dialect.MAVLINK_MSG_ID_COMMAND_ACK:
                    key = (system, int.from_bytes(frame[10:12], "little"))
                    if key in waiting:
                        self.delays.append((waiting.pop(key), now))
            if (now := time.monotonic()) > due + LATE:
                self.late.append((due, now))
                due = now
        sock.close()

    def describe(self) -> str:
        """Figures, and again without those into which a wait of this script fell."""
        figures = f"  {_figures(self.gaps, self.delays)}; {len(self.delays)} of {self.sent} acknowledged"
        if self.late:
            gaps, delays = ([span for span in spans if self._is_fair(span)] for spans in (self.gaps, self.delays))
            figures += f"\n  without {len(self.late)} waits of this script: {_figures(gaps, delays)}"
        return figures

    def _is_fair(self, span: Span) -> bool:
        return not any(begin < span[1] and end > span[0] for begin, end in self.late)


def _figures(gaps: Sequence[Span], delays: Sequence[Span]) -> str:
    if not gaps or not delays:
        return "none"
    largest = max(end - begin for begin, end in gaps)
    times = [1000.0 * (end - begin) for begin, end in delays]
    return (
        f"heartbeat gaps up to {largest:.3f} s ({len(gaps)}); acknowledgements p50 {quantile(times, 0.5):.1f} ms, "
        f"p99 {quantile(times, 0.99):.1f} ms"
    )


@contextmanager
def observed(address: str) -> Iterator[Observer]:
    """Observe during the block."""
    done, observer = threading.Event(), Observer(address)
    thread = threading.Thread(target=observer.watch, args=(done,))
    thread.start()
    try:
        yield observer
    finally:
        done.set()
        thread.join()


# -- parts


def mavsdk(url: str, path: str, folder: Path, way: str, component: int = 100) -> float:
    """Return the seconds of a download by MAVSDK's client."""
    copy = folder / Path(path).name
    copy.unlink(missing_ok=True)
    with own("--download", url, path, folder, way, component) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
    if not line:
        raise SystemExit(f"MAVSDK could not download {path}")
    return float(line)


def rate(size: int, times: Sequence[float]) -> str:
    """Return the median in words."""
    rates = sorted(size / seconds / 1e6 for seconds in times)
    return f"{quantile(rates, 0.5):.3f} MB/s ({', '.join(f'{one:.3f}' for one in rates)})"


def measure_ftp(folder: Path) -> None:
    """Bursts beside a fleet."""
    with fleet(FTP_SIZE, folder) as running:
        with observed(running.observer) as idle:
            time.sleep(10.0)
        print(f"without a download\n{idle.describe()}", flush=True)
        url = f"udpin://{running.client}:14540"
        with observed(running.observer) as observer:
            times = [mavsdk(url, running.path, folder, "burst") for _ in range(TRIES)]
        check(folder / Path(running.path).name, running.md5)
        print(f"FTP, MAVSDK's client by bursts, {DRONES} drones: {rate(running.size, times)}")
        print(observer.describe(), flush=True)
    address = loopback()
    (folder / "served").mkdir()
    (folder / "served" / "a.bin").write_bytes(os.urandom(SERVED_SIZE))
    with own("--serve", f"udpout://{address}:14540", folder / "served") as server:
        assert server.stdout is not None
        server.stdout.readline()
        times = [mavsdk(f"udpin://{address}:14540", "a.bin", folder, "burst", 1) for _ in range(TRIES)]
    print(f"MAVSDK's own server, the same client, no fleet: {rate(SERVED_SIZE, times)}", flush=True)


def measure_loss(folder: Path) -> None:
    """Bursts and single requests over a bad link."""
    for way, size in (("burst", LOSSY_SIZE), ("steps", STEPS_SIZE)):
        with fleet(size, folder, "udpin://{client}:14540") as running:
            seconds = asyncio.run(lossy(running, folder, way))
            check(folder / Path(running.path).name, running.md5)
            print(
                f"FTP at {100 * LOSS:.0f} % loss each way, {way}: {running.size / seconds / 1e3:.1f} kB/s", flush=True
            )


async def lossy(running: Fleet, folder: Path, way: str) -> float:
    """Return the seconds of a download over a bad link."""
    async with lossy_link((running.client, 14540), LOSS) as link:
        url = f"udpout://{link.address[0]}:{link.address[1]}"
        return await asyncio.to_thread(mavsdk, url, running.path, folder, way)


def measure_http(folder: Path) -> None:
    """A large file by the command."""
    with fleet(HTTP_SIZE, folder) as running, observed(running.observer) as observer:
        before = most = usage(running.gateway)[1]
        words = ["media", "download", str(folder / "copies"), "--gateway", running.web, "--sysid", "1"]
        began, first, own_most = time.monotonic(), 0.0, 0.0
        with subprocess.Popen(
            [sys.executable, "-m", "anafi_mav", *words], stdout=subprocess.PIPE, text=True
        ) as command:
            while command.poll() is None:
                most = max(most, usage(running.gateway)[1])
                with suppress(OSError, IndexError):
                    memory = usage(command)[1]
                    if not first and list((folder / "copies").rglob("*.part")):
                        first = memory
                    own_most = max(own_most, memory)
                time.sleep(0.05)
        seconds = time.monotonic() - began
        assert command.returncode == 0
        (copy,) = (folder / "copies").rglob("*.MP4")
        check(copy, running.md5)
        print(
            f"media download of {running.size / 1e6:.0f} MB: {running.size / seconds / 1e6:.1f} MB/s in all; "
            f"gateway {before:.0f} MiB, at most {most - before:.1f} more; "
            f"command {first:.0f} MiB at its first bytes, at most {own_most - first:.1f} more"
        )
    print(observer.describe(), flush=True)


def check(path: Path, md5: str) -> None:
    """Compare a copy with the simulated card."""
    found = hashlib.md5(path.read_bytes()).hexdigest()
    if found != md5:
        raise SystemExit(f"{path.name}: expected MD5 {md5}, got {found}")


PARTS = {"ftp": measure_ftp, "loss": measure_loss, "http": measure_http}


def main() -> None:
    match sys.argv[1:]:
        case ["--simulate", first, size]:
            asyncio.run(simulate(first, int(size)))
        case ["--download", url, path, folder, way, component]:
            asyncio.run(download(url, path, folder, way, int(component)))
        case ["--serve", url, folder]:
            asyncio.run(serve(url, folder))
        case parts:
            print(machine(), flush=True)
            for part in parts or PARTS:
                with tempfile.TemporaryDirectory() as folder:
                    PARTS[part](Path(folder))


if __name__ == "__main__":
    main()
