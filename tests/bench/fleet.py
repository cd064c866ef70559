"""Processor time and memory of the gateway for a growing fleet.

    .venv/bin/python tests/bench/fleet.py [SECONDS] [DRONES ...] [many]

The fleet is one simulator process whose drones send attitude, speed and height 30 times a second. They stand on the
ground; in the last row the largest fleet hovers. One client listens to everything over UDP. The figures are the
processes' own, of SECONDS seconds. `many`: with several MAVLink frames per datagram (`frames=many`).
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

TAKE_OFF_LIMIT = 60.0
"""s for the whole fleet."""


def main() -> None:
    words, query = frames_option(sys.argv[1:])
    seconds = float(words[0]) if words else 20.0
    print(machine(), query)
    head = "gateway, share of one core | gateway, MiB | simulator, share of one core | MAVLink messages/s"
    print(f"| drones | {head} |")
    print("|---|---|---|---|---|")
    fleets = [int(text) for text in words[1:]] or [1, 10, 100]
    for drones in fleets:
        print(measure(drones, seconds, query), flush=True)
    print(measure(max(fleets), seconds, query, hovering=True), flush=True)


def measure(drones: int, seconds: float, query: str, *, hovering: bool = False) -> str:
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
            if hovering:
                listener.take_off(drones)
            heard, before, world = listener.heard, usage(gateway)[0], usage(simulator)[0]
            began = time.monotonic()
            time.sleep(seconds)
            elapsed = time.monotonic() - began
            cpu, memory = usage(gateway)
            rate = (listener.heard - heard) / elapsed
            return (
                f"| {drones}{' hovering' if hovering else ''} | {(cpu - before) / elapsed:.1%} | {memory:.0f} "
                f"| {(usage(simulator)[0] - world) / elapsed:.1%} | {rate:.0f} |"
            )


class _Listener:
    """A client that counts the messages it receives, and notes which drones are in the air."""

    def __init__(self, url: str) -> None:
        self.heard = 0
        self.airborne: set[int] = set()
        """System ids whose last EXTENDED_SYS_STATE says so."""
        self._link = mavutil.mavlink_connection(url)
        threading.Thread(target=self._run, daemon=True).start()

    def take_off(self, drones: int) -> None:
        """Lift the whole fleet to its default height, and let it come to rest."""
        common, unchanged = mavutil.mavlink, float("nan")
        end = time.monotonic() + TAKE_OFF_LIMIT
        for sysid in range(1, drones + 1):
            self._link.mav.command_long_send(sysid, 1, common.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, *[0] * 6)
            self._link.mav.command_long_send(sysid, 1, common.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, *[unchanged] * 4)
        while len(self.airborne) < drones:
            if time.monotonic() > end:
                raise SystemExit(f"{len(self.airborne)} of {drones} drones are in the air after {TAKE_OFF_LIMIT:g} s")
            time.sleep(0.1)
        time.sleep(5.0)

    def _run(self) -> None:
        while True:
            data = self._link.recv()
            if not data:
                self._link.select(1.0)
            # Read by their headers, for parsing 100 drones would take the core that is to be measured.
            position = 0
            while position + 1 < len(data):
                self.heard += 1
                begin, position = position, position + 12 + data[position + 1]
                if data[begin + 7 : begin + 10] == _EXTENDED_SYS_STATE:
                    landed = data[begin + 11] if data[begin + 1] > 1 else 0
                    note = self.airborne.add if landed == _IN_AIR else self.airborne.discard
                    note(data[begin + 5])


_EXTENDED_SYS_STATE = mavutil.mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE.to_bytes(3, "little")
_IN_AIR = mavutil.mavlink.MAV_LANDED_STATE_IN_AIR


if __name__ == "__main__":
    main()
