"""Capacity: how many drones the gateway serves at three UDP endpoints, and what one of them costs.

    .venv/bin/python tests/bench/capacity.py [DRONES ...] [--seconds S] [--rate HZ] [--web] [--once]

For each number of drones (default 1 10 50 100 250) with datagrams of several frames, then the largest number again
with one frame per datagram. All drones are simulated in one process and send attitude, speed, heights, gimbal and zoom
HZ (30) times a second; the gateway streams to three UDP endpoints at its default rates. Gateway and generator have a
core each.
One process counts the datagrams of all three endpoints without decoding them, on the generator's core.

Delay: drone 1 reports heights of its own at random moments, and a client at a fourth endpoint, which shows that drone
alone, requests RANGEFINDER of each. The delay is from the moment before the generator sends the event until the client
has the datagram: two processes on a busy core are in it. `--web`: with aiortc of the extra `web`, which takes 33 MiB,
where it is installed; otherwise the gateway runs as if it were not.

A row is void when drones are not connected in time, when the generator sent less than 99 % of its rates, which are
those of its first row times the drones, or when a socket lost datagrams. Exit status 1 then.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import json
import os
import random
import selectors
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from common import consecutive, loopback, machine, product, quantile, usage
from pymavlink import mavutil

SCRIPT = str(Path(__file__).resolve())
ENDPOINTS = 3
WEB_PORT = 18088
CLIENT = 14550
FRAMES = {"many": "frames=many&datagram_bytes=1400", "one": "frames=one"}
"""Options of the endpoints."""

LEAST = 0.99
"""Share of the rates that the generator has to reach."""

LEAST_PROBES = 0.9
"""Share of the measured events that the client has to get: of two that arrive together only the newer one leaves."""

PROBES = 20.0
"""Events of drone 1 per second whose delay is measured."""

CONNECT_LIMIT = 60.0
"""s in which all drones have to be connected."""

SETTLE = 6.0
"""s after that: beyond the connections' own work."""

FIRST_HEIGHT = 1000.0
"""m: heights that no drone on the ground reports by itself; each event's is 0.25 m above the one before."""

AS_INSTALLED = "import sys; sys.modules['aiortc'] = None; from anafi_mav.__main__ import main; sys.exit(main())"
"""Runs `anafi-mav` as if the extra `web` were not installed."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drones", nargs="*", type=int, default=[1, 10, 50, 100, 250])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ")
    parser.add_argument("--web", action="store_true", help="with the extra `web`")
    parser.add_argument("--once", action="store_true", help="without the row of one frame per datagram")
    options = parser.parse_args()
    print(machine(), f"load {os.getloadavg()[0]:.1f}", flush=True)
    print(
        "| drones | frames per datagram | gateway, share of one core | per drone | gateway, MiB | simulator "
        "| events/s in | frames/s out | datagrams/s out | dropped | p50 ms | p99 ms | |"
    )
    print("|---|" + "---|" * 12)
    rows = [(drones, "many") for drones in options.drones]
    if not options.once:
        rows.append((max(options.drones), "one"))
    reference: float | None = None
    is_void = False
    for drones, frames in rows:
        row = Row(drones, frames, options)
        reference = reference or row.events / drones
        problem = row.problem(reference)
        is_void = is_void or bool(problem)
        print(f"{row.text()} {problem} |", flush=True)
    return int(is_void)


class Row:
    """One measurement."""

    def __init__(self, drones: int, frames: str, options: argparse.Namespace) -> None:
        self.drones, self.frames = drones, frames
        first, stations = loopback(), loopback()
        addresses = consecutive(first, drones)
        ports = [CLIENT + 1 + number for number in range(ENDPOINTS)]
        config = {
            "endpoints": [f"udpout://{stations}:{port}?{FRAMES[frames]}" for port in ports]
            + [f"udpout://{stations}:{CLIENT}?{FRAMES[frames]}&systems=1"],
            "drones": [
                {"name": f"d{number}", "sysid": number, "address": address}
                for number, address in enumerate(addresses, 1)
            ],
            "http": {"host": stations, "port": WEB_PORT},
            "video": False,
        }
        client = Client(f"udpin:{stations}:{CLIENT}")
        web = f"http://{stations}:{WEB_PORT}/status.json"
        with tempfile.TemporaryDirectory() as folder, _core(-1):
            file = Path(folder) / "capacity.yaml"
            file.write_text(yaml.safe_dump(config))
            os.environ["XDG_STATE_HOME"] = folder
            program = ("-m", "anafi_mav") if options.web else ("-c", AS_INSTALLED)
            with (
                helper("receiver", stations, *map(str, ports)) as receiver,
                helper("generator", first, str(drones), str(options.rate)) as generator,
                _core(0),
                product("run", "-c", str(file), program=program) as gateway,
                _core(-1),
            ):
                self.missing = connected(web)
                time.sleep(SETTLE)
                client.request()
                before, counted, sent = status(web), ask(receiver), ask(generator)
                spent, world = usage(gateway)[0], usage(generator)[0]
                began = time.monotonic()
                probes = ask(generator, f"probe {options.seconds}")
                elapsed = time.monotonic() - began
                cpu, self.memory = usage(gateway)
                self.share = (cpu - spent) / elapsed
                self.world = (usage(generator)[0] - world) / elapsed
                after, counted_after, sent_after = status(web), ask(receiver), ask(generator)
                self.lost = _kernel_drops(gateway.pid) + _kernel_drops(receiver.pid)
        self.probes = len(probes["probes"])
        self.events = (sent_after["sent"] - sent["sent"] - self.probes) / elapsed
        self.datagrams = (counted_after["datagrams"] - counted["datagrams"]) / elapsed
        self.sent_frames = (_frames(after, "sent_frames") - _frames(before, "sent_frames")) / elapsed
        self.dropped = _frames(after, "dropped_frames")
        self.delays = [client.seen[value] - at for value, at in probes["probes"] if value in client.seen]

    def text(self) -> str:
        """The row of the table, without its last cell."""
        p50, p99 = (1000.0 * quantile(self.delays, share) for share in (0.5, 0.99)) if self.delays else (-1.0, -1.0)
        return (
            f"| {self.drones} | {self.frames} | {self.share:.1%} | {self.share / self.drones:.2%} | {self.memory:.0f} "
            f"| {self.world:.0%} | {self.events:.0f} | {self.sent_frames:.0f} | {self.datagrams:.0f} "
            f"| {self.dropped} + {self.lost} | {p50:.1f} | {p99:.1f} |"
        )

    def problem(self, reference: float) -> str:
        """Why the row is void; empty: it is not. `reference`: events of a drone per second."""
        if self.missing:
            return f"void: {self.missing} drones were not connected within {CONNECT_LIMIT:g} s"
        reached = self.events / (reference * self.drones)
        if reached < LEAST:
            return f"void: the generator reached {reached:.1%} of its rates"
        if self.lost:
            return f"void: {self.lost} datagrams were lost in sockets"
        if len(self.delays) < LEAST_PROBES * self.probes:
            return f"void: {len(self.delays)} of {self.probes} probes arrived"
        return ""


class Client:
    """The real client: decodes what it gets, and notes when each height arrived."""

    def __init__(self, url: str) -> None:
        self.seen: dict[float, float] = {}
        self._link: Any = mavutil.mavlink_connection(url, source_system=255)
        threading.Thread(target=self._run, daemon=True).start()

    def request(self) -> None:
        """Have every RANGEFINDER sent."""
        common = mavutil.mavlink
        parameters = (common.MAVLINK_MSG_ID_RANGEFINDER, 1000.0, 0, 0, 0, 0, 0)
        self._link.mav.command_long_send(1, 1, common.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *parameters)
        time.sleep(0.5)

    def _run(self) -> None:
        while True:
            message = self._link.recv_match(type="RANGEFINDER", blocking=True)
            now = time.monotonic()
            if message is not None and message.distance >= FIRST_HEIGHT:
                self.seen.setdefault(message.distance, now)


@contextlib.contextmanager
def _core(number: int) -> Iterator[None]:
    """Start processes on one of the cores that this one may use."""
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {_CORES[number]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


_CORES = sorted(os.sched_getaffinity(0))


@contextlib.contextmanager
def helper(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Another role of this script, from its line "ready" to the end of the block."""
    with subprocess.Popen(
        [sys.executable, SCRIPT, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            if process.stdout.readline().strip() != "ready":
                raise SystemExit(f"{words[0]} did not start")
            yield process
        finally:
            process.kill()


def ask(process: subprocess.Popen[str], question: str = "count") -> dict[str, Any]:
    """The answer of a helper."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(question + "\n")
    process.stdin.flush()
    answer: dict[str, Any] = json.loads(process.stdout.readline())
    return answer


def status(url: str) -> dict[str, Any]:
    """The gateway's status."""
    with urllib.request.urlopen(url, timeout=10.0) as answer:
        record: dict[str, Any] = json.load(answer)
    return record


def connected(url: str) -> int:
    """Wait until all drones are connected; return how many are not in time."""
    end = time.monotonic() + CONNECT_LIMIT
    while True:
        missing = sum(not drone["connected"] for drone in status(url)["drones"])
        if not missing or time.monotonic() > end:
            return missing
        time.sleep(1.0)


def _frames(record: dict[str, Any], counter: str) -> int:
    """A counter of the three endpoints whose datagrams are counted."""
    clients = [client for endpoint in record["endpoints"][:ENDPOINTS] for client in endpoint["clients"]]
    return sum(client["counters"].get(counter, 0) for client in clients)


def _kernel_drops(pid: int) -> int:
    """Datagrams that the sockets of a process had no room for."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            inodes.add(str(link.readlink()).removeprefix("socket:[").removesuffix("]"))
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(row[12]) for row in rows if row[9] in inodes)


# The other roles.


def receive(address: str, ports: list[str]) -> None:
    """Count datagrams."""
    selector, counts = selectors.DefaultSelector(), {"datagrams": 0, "bytes": 0}
    for port in ports:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        sock.bind((address, int(port)))
        sock.setblocking(False)
        selector.register(sock, selectors.EVENT_READ, sock)
    selector.register(sys.stdin, selectors.EVENT_READ)
    buffer = bytearray(65536)
    print("ready", flush=True)
    while True:
        for key, _ in selector.select():
            if key.data is None:
                sys.stdin.readline()
                print(json.dumps(counts), flush=True)
                continue
            with contextlib.suppress(BlockingIOError):
                while True:
                    counts["bytes"] += key.data.recv_into(buffer)
                    counts["datagrams"] += 1
        time.sleep(0.002)  # many at once: the core is the drones'


async def generate(first: str, count: int, rate: float) -> None:
    """Simulate drones, and report what they sent."""
    from anafi_mav.arsdk.messages.ardrone3 import AltitudeAboveGroundChanged
    from anafi_mav.sim import DroneSpec, Simulator

    specs = [
        DroneSpec(address=address, http_port=None, rtsp_port=None, telemetry_rate=rate)
        for address in consecutive(first, count)
    ]
    gc.freeze()  # as the program does
    chance = random.Random(1)
    height = FIRST_HEIGHT
    async with Simulator(specs, seed=1, remember=False) as simulator:
        print("ready", flush=True)
        loop = asyncio.get_running_loop()
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            words = line.split()
            if words[0] == "count":
                sessions = [drone.session for drone in simulator.drones]
                sent = sum(session.counters["sent"] for session in sessions if session is not None)
                print(json.dumps({"sent": sent, "lost": simulator.lost_time}), flush=True)
                continue
            probes, end = [], time.monotonic() + float(words[1])
            while (now := time.monotonic()) < end:
                height += 0.25
                probes.append((height, now))
                simulator.drones[0].inject(AltitudeAboveGroundChanged(height))
                await asyncio.sleep(chance.uniform(0.5, 1.5) / PROBES)
            print(json.dumps({"probes": probes}), flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["receiver"]:
        receive(sys.argv[2], sys.argv[3:])
    elif sys.argv[1:2] == ["generator"]:
        asyncio.run(generate(sys.argv[2], int(sys.argv[3]), float(sys.argv[4])))
    else:
        sys.exit(main())
