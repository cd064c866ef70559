"""Delay that a MAVLink router, or a zenoh network, adds between a gateway and a station, beside none, in one run.

    .venv/bin/python tests/bench/routers.py [COMMANDS] [DRONES]

One gateway has an endpoint for each path: a station over TCP, one over UDP, a router that is connected over TCP and
has a station at its UDP port, and a zenoh router (the Python package) with `anafi-mav ground` and a station at its UDP
port. MAVProxy is in the test extra; MAVLINK_ROUTERD and MAVP2P name the programs of mavlink-router and mavp2p. The
paths take turns: each sends a command that the gateway refuses at once, and waits for its answer. All paths stream the
telemetry of all drones meanwhile. The figures are of the way there and back.
"""

from __future__ import annotations

import selectors
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import yaml
from common import loopback, machine, product, quantile
from fabric import router
from pymavlink.dialects.v20 import ardupilotmega as mavlink

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.routers import ROUTERS, program_of, words

ANSWER_LIMIT = 5.0
START_LIMIT = 60.0
SETTLE = 5.0
"""s of telemetry before the first command."""

FABRIC = "zenoh"
"""Path over a zenoh router and the ground process."""

ACK = mavlink.MAVLINK_MSG_ID_COMMAND_ACK.to_bytes(3, "little")


class Station:
    """One path: sends commands, finds their answers, and drops everything else undecoded."""

    def __init__(self, number: int, host: str, port: int, kind: socket.SocketKind) -> None:
        self._out = mavlink.MAVLink(None, 245 - number, 190)
        self.socket = socket.socket(socket.AF_INET, kind)
        if kind is socket.SOCK_DGRAM:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.socket.connect((host, port))
        if kind is socket.SOCK_STREAM:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.setblocking(False)
        self._data = b""
        self.heard = 0

    def beat(self) -> None:
        self.socket.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(self._out))

    def command(self, drone: int) -> None:
        message = mavlink.MAVLink_command_long_message(drone, 1, mavlink.MAV_CMD_USER_1, 0, 0, 0, 0, 0, 0, 0, 0)
        self.socket.send(message.pack(self._out))

    def read(self) -> bool:
        """Read what has arrived; True when an answer to this station's command is in it."""
        try:
            data = self._data + self.socket.recv(1 << 18)
        except (BlockingIOError, ConnectionRefusedError):
            return False
        at, found = 0, False
        while len(data) - at >= 12 and len(data) - at >= (end := 12 + data[at + 1]):
            self.heard += 1
            if data[at + 7 : at + 10] == ACK and data[at + 1] >= 9 and data[at + 10 + 8] == self._out.srcSystem:
                found = True
            at += end
        self._data = data[at:]
        return found


def main() -> None:
    commands = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    drones = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    first, host = loopback(), loopback()
    head, _, last = first.rpartition(".")
    fleet = [
        {"name": f"d{n}", "sysid": n, "address": f"{head}.{int(last) + n - 1}", "http_port": 8080}
        for n in range(1, drones + 1)
    ]
    present = [(name, found) for name in ROUTERS if (found := program_of(name)) is not None]
    for name in ROUTERS:
        if name not in dict(present):
            print(f"{name}: skipped, {ROUTERS[name]} names no program")
    ports = {name: 5770 + index for index, (name, _) in enumerate(present)}
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        fabric = probe.getsockname()[1]
    endpoints = [
        f"tcpin://{host}:5760",
        f"udpin://{host}:14550",
        *(f"tcpin://{host}:{port}" for port in ports.values()),
        f"zenoh://127.0.0.1:{fabric}",
    ]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        config = Path(folder) / "fleet.yaml"
        config.write_text(
            yaml.safe_dump({"endpoints": endpoints, "drones": fleet, "state": folder, "video": False, "http": False})
        )
        stack.enter_context(router(fabric))
        stack.enter_context(product("sim", "--address", first, "--count", str(drones), "--http-port", "8080"))
        stack.enter_context(product("run", "-c", str(config)))
        paths = {
            "none, TCP": Station(0, host, 5760, socket.SOCK_STREAM),
            "none, UDP": Station(1, host, 14550, socket.SOCK_DGRAM),
        }
        for index, (name, found) in enumerate(present):
            stations = f"{host}:{14560 + index}"
            process = subprocess.Popen(
                words(name, found, [f"{host}:{ports[name]}"], stations),
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder,
            )  # fmt: skip
            stack.callback(process.terminate)
            paths[name] = Station(2 + index, host, 14560 + index, socket.SOCK_DGRAM)
        ground = ("--zenoh", f"zenoh://127.0.0.1:{fabric}", "--endpoint", f"udpin://{host}:14570")
        stack.enter_context(product("ground", *ground))
        paths[FABRIC] = Station(2 + len(present), host, 14570, socket.SOCK_DGRAM)
        delays = measure(paths, commands, drones)
    print(machine(), f"{drones} drones, {commands} commands on each path")
    print("| path | p50 | 99 % | largest | added to UDP, p50 | without answer |\n|---|---|---|---|---|---|")
    base = quantile(delays["none, UDP"], 0.5)
    for path, found in delays.items():
        p50, p99 = quantile(found, 0.5), quantile(found, 0.99)
        added = "–" if path.startswith("none") else f"{1000 * (p50 - base):.2f} ms"
        print(
            f"| {path} | {1000 * p50:.2f} ms | {1000 * p99:.2f} ms | {1000 * max(found):.1f} ms | {added} "
            f"| {commands - len(found)} |"
        )


def measure(paths: dict[str, Station], commands: int, drones: int) -> dict[str, list[float]]:
    """Return the delays of each path, s, from commands in turn."""
    delays: dict[str, list[float]] = {path: [] for path in paths}
    with selectors.DefaultSelector() as ready:
        for station in paths.values():
            ready.register(station.socket, selectors.EVENT_READ, station)
        beat = 0.0

        def until(end: float, wanted: Station | None = None) -> bool:
            nonlocal beat
            while (left := end - time.monotonic()) > 0:
                if time.monotonic() > beat:
                    beat = time.monotonic() + 1.0
                    for station in paths.values():
                        try:
                            station.beat()
                        except ConnectionRefusedError:
                            continue  # the router has not started yet
                for key, _ in ready.select(min(left, 0.1)):
                    if key.data.read() and key.data is wanted:
                        return True
            return False

        began = time.monotonic()
        while not all(station.heard for station in paths.values()):
            if time.monotonic() > began + START_LIMIT:
                raise SystemExit(f"silent: {[path for path, station in paths.items() if not station.heard]}")
            until(time.monotonic() + 0.5)
        until(time.monotonic() + SETTLE)
        for number in range(commands):
            for path, station in paths.items():
                sent = time.monotonic()
                station.command(1 + number % drones)
                if until(sent + ANSWER_LIMIT, station):
                    delays[path].append(time.monotonic() - sent)
                until(time.monotonic() + 0.002)  # what streams meanwhile is read outside the next delay
    return delays


if __name__ == "__main__":
    main()
