"""Stations over a zenoh network beside plain UDP: latency of commands, and processor time.

    .venv/bin/python tests/bench/fabric.py [GATEWAYS] [DRONES] [SECONDS]

Default: three gateways with 20 simulated drones each. First each gateway sends to the station by `udpout`. Then the
gateways connect to a router, the Python package in mode `router`, and `anafi-mav ground` leads the station to it. The
station is a socket that counts frames without decoding, and sends MAV_CMD_REQUEST_MESSAGE to each drone in turns: the
latency is the time to its COMMAND_ACK. A simulator of each gateway is a process of its own and is not in the figures.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from common import loopback, machine, product, quantile, usage
from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.fabric.envelope import split_frames

ACK, HEARTBEAT = dialect.MAVLINK_MSG_ID_COMMAND_ACK, dialect.MAVLINK_MSG_ID_HEARTBEAT
ANSWER_LIMIT = 2.0

ROUTER = """
import json, sys, zenoh
config = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
with zenoh.open(config):
    print("ready", flush=True)
    sys.stdin.read()
"""


class Station:
    """A ground station that answers to nothing: it learns where each system is and counts its frames."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.frames: Counter[int] = Counter()
        self.bytes = 0
        self.places: dict[int, tuple[str, int]] = {}
        self._acks: dict[int, threading.Event] = {}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self._socket.bind(address)
        self._out = dialect.MAVLink(None, 255, 190)
        self._lock = threading.Lock()
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=self._beat, daemon=True).start()

    def command(self, sysid: int) -> float | None:
        """Return the time to a command's acknowledgement, s; None: there was none."""
        self._acks[sysid] = answered = threading.Event()
        message = dialect.MAVLink_command_long_message(
            sysid, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0
        )
        began = time.monotonic()
        self._send(message, self.places[sysid])
        return time.monotonic() - began if answered.wait(ANSWER_LIMIT) else None

    def _send(self, message: dialect.MAVLink_message, place: tuple[str, int]) -> None:
        with self._lock:
            self._socket.sendto(message.pack(self._out), place)
            self._out.seq = (self._out.seq + 1) % 256

    def _beat(self) -> None:
        while True:
            for place in set(self.places.values()):
                self._send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), place)
            time.sleep(1.0)

    def _read(self) -> None:
        while True:
            data, place = self._socket.recvfrom(65536)
            self.bytes += len(data)
            for raw in split_frames(data):
                sysid, id = raw[5], raw[7] | raw[8] << 8 | raw[9] << 16
                self.frames[sysid] += 1
                self.places[sysid] = place
                if id == ACK and sysid in self._acks:
                    self._acks[sysid].set()


def configuration(folder: Path, number: int, drones: int, endpoint: str) -> Path:
    """Write the configuration of one gateway with simulated drones."""
    path = folder / f"gateway{number}.yaml"
    ids = range(number * drones + 1, (number + 1) * drones + 1)
    rows = "\n".join(f"  - {{name: drone{sysid}, sysid: {sysid}, sim: {{}}}}" for sysid in ids)
    path.write_text(
        f"state: {folder}/state{number}\nhttp: off\nvideo: off\nendpoints: ['{endpoint}']\ndrones:\n{rows}\n"
    )
    return path


@contextmanager
def router(port: int) -> Iterator[subprocess.Popen[str]]:
    """A zenoh router for the length of a block."""
    settings = {
        "mode": "router",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
    }
    words = [sys.executable, "-c", ROUTER, json.dumps(settings)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "ready"
            yield process
        finally:
            process.kill()


def measure(gateways: int, drones: int, seconds: float, *, over_zenoh: bool) -> None:
    """Print the figures of one way."""
    place, total = (loopback(), 14550), gateways * drones
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, station, others = Path(name), Station(place), {}
        endpoint = f"udpout://{place[0]}:{place[1]}"
        if over_zenoh:
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                port = probe.getsockname()[1]
            others["router"] = stack.enter_context(router(port))
            others["ground"] = stack.enter_context(
                product("ground", "--zenoh", f"zenoh://127.0.0.1:{port}", "--endpoint", endpoint)
            )
            endpoint = f"zenoh://127.0.0.1:{port}"
        processes = [
            stack.enter_context(product("run", "-c", str(configuration(folder, number, drones, endpoint))))
            for number in range(gateways)
        ]
        limit = time.monotonic() + 60.0
        while len(station.places) < total and time.monotonic() < limit:
            time.sleep(0.1)
        if len(station.places) < total:
            raise SystemExit(f"{len(station.places)} of {total} systems arrived: the run is void")
        time.sleep(3.0)
        before = {name: usage(process)[0] for name, process in named(processes, others)}
        frames, octets, began = sum(station.frames.values()), station.bytes, time.monotonic()
        delays, lost = [], 0
        while time.monotonic() < began + seconds:
            for sysid in range(1, total + 1):
                delay = station.command(sysid)
                if delay is None:
                    lost += 1
                else:
                    delays.append(delay)
                time.sleep(0.005)
        elapsed = time.monotonic() - began
        rate, kilobytes = (sum(station.frames.values()) - frames) / elapsed, (station.bytes - octets) / elapsed / 1000
        p50, p99 = (1000 * quantile(delays, share) for share in (0.5, 0.99))
        print(f"{'zenoh' if over_zenoh else 'UDP'}: {total} systems, {rate:.0f} frames/s, {kilobytes:.0f} kB/s")
        print(f"  {len(delays)} commands: p50 {p50:.2f} ms, p99 {p99:.2f} ms, without an answer {lost}")
        for name, process in named(processes, others):
            print(f"  {name}: {100 * (usage(process)[0] - before[name]) / elapsed:.1f} % of a core")


def named(
    gateways: list[subprocess.Popen[str]], others: dict[str, subprocess.Popen[str]]
) -> list[tuple[str, subprocess.Popen[str]]]:
    """Return the measured processes with their names."""
    return [*((f"gateway {number}", process) for number, process in enumerate(gateways)), *others.items()]


def main() -> None:
    words = sys.argv[1:]
    gateways = int(words[0]) if words else 3
    drones = int(words[1]) if len(words) > 1 else 20
    seconds = float(words[2]) if len(words) > 2 else 20.0
    print(machine())
    for over_zenoh in (False, True):
        measure(gateways, drones, seconds, over_zenoh=over_zenoh)


if __name__ == "__main__":
    main()
