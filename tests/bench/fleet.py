"""Processor time and memory of the gateway for a growing fleet.

    .venv/bin/python tests/bench/fleet.py [SECONDS] [DRONES ...] [many]

The fleet is one simulator process whose drones stand on the ground and send attitude, speed and height 30 times a
second. One client listens to everything over UDP. The gateway's figures are its process's own, of SECONDS seconds.
`many`: with several MAVLink frames per datagram (`frames=many`).
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from pathlib import Path

import yaml
from common import frames_option, loopback, machine, product, usage
from pymavlink import mavutil

RATE = 30.0


def main() -> None:
    words, query = frames_option(sys.argv[1:])
    seconds = float(words[0]) if words else 20.0
    print(machine(), query)
    print("| drones | gateway, share of one core | gateway, MiB | simulator, share of one core | MAVLink messages/s |")
    print("|---|---|---|---|---|")
    for drones in [int(text) for text in words[1:]] or [1, 10, 100]:
        print(measure(drones, seconds, query), flush=True)


def measure(drones: int, seconds: float, query: str) -> str:
    """One row of the table."""
    first, client = loopback(), loopback()
    head, _, last = first.rpartition(".")
    fleet = [
        {"name": f"d{number}", "sysid": number + 1, "address": f"{head}.{int(last) + number}"}
        for number in range(drones)
    ]
    listener = _Listener(f"udpin:{client}:14550")
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "fleet.yaml"
        config.write_text(yaml.safe_dump({"endpoints": [f"udpout://{client}:14550{query}"], "drones": fleet}))
        options = ["--address", first, "--count", str(drones), "--telemetry-rate", str(RATE), "--http-port", "8080"]
        with product("sim", *options) as simulator, product("run", "-c", str(config)) as gateway:
            time.sleep(3.0)  # beyond the connections' own work
            heard, before, world = listener.heard, usage(gateway)[0], usage(simulator)[0]
            began = time.monotonic()
            time.sleep(seconds)
            elapsed = time.monotonic() - began
            cpu, memory = usage(gateway)
            rate = (listener.heard - heard) / elapsed
            return (
                f"| {drones} | {(cpu - before) / elapsed:.1%} | {memory:.0f} "
                f"| {(usage(simulator)[0] - world) / elapsed:.1%} | {rate:.0f} |"
            )


class _Listener:
    """A client that only counts what comes."""

    def __init__(self, url: str) -> None:
        self.heard = 0
        self._link = mavutil.mavlink_connection(url)
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            data = self._link.recv()
            if not data:
                self._link.select(1.0)
            # Counted by their lengths, for parsing 100 drones would take the core that is to be measured.
            position = 0
            while position + 1 < len(data):
                self.heard += 1
                position += 12 + data[position + 1]


if __name__ == "__main__":
    main()
