"""A dronekit script as its users write them: python dronekit_flight.py tcp:HOST:PORT north-latitude longitude.

It prints a line a step; the test that runs it holds them against the simulator's own log.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from typing import Any

import dronekit


def until(vehicle: Any, name: str, true: Callable[[Any], bool], timeout: float = 30.0) -> None:
    """Wait for an attribute of the vehicle, by dronekit's own events."""
    met = threading.Event()

    def changed(_: Any, __: str, value: Any) -> None:
        if true(value):
            met.set()

    where = vehicle.location if name.startswith("location.") else vehicle
    name = name.removeprefix("location.")
    where.add_attribute_listener(name, changed)
    try:
        if not true(getattr(where, name)) and not met.wait(timeout):
            raise SystemExit(f"{name} did not become what was waited for: {getattr(where, name)}")
    finally:
        where.remove_attribute_listener(name, changed)


def main(url: str, latitude: float, longitude: float) -> None:
    vehicle = dronekit.connect(url, wait_ready=True, timeout=30, heartbeat_timeout=30)
    print("ready", vehicle.version, flush=True)
    print("parameters", len(vehicle.parameters), flush=True)
    until(vehicle, "ekf_ok", bool)
    print("armable", vehicle.is_armable, flush=True)
    vehicle.mode = dronekit.VehicleMode("GUIDED")
    until(vehicle, "mode", lambda mode: mode.name == "GUIDED")
    vehicle.armed = True
    until(vehicle, "armed", bool)
    print("armed", flush=True)
    vehicle.simple_takeoff(6)
    until(vehicle, "location.global_relative_frame", lambda at: at is not None and at.alt is not None and at.alt > 5.7)
    print("up", flush=True)
    vehicle.groundspeed = 6
    vehicle.simple_goto(dronekit.LocationGlobalRelative(latitude, longitude, 9))
    until(
        vehicle,
        "location.global_relative_frame",
        lambda at: at is not None and abs(at.lat - latitude) < 1e-5 and abs(at.alt - 9.0) < 0.5,
    )
    print("there", flush=True)
    for name in ("BRAKE", "LOITER", "RTL"):
        vehicle.mode = dronekit.VehicleMode(name)
        until(vehicle, "mode", lambda mode, name=name: mode.name == name)
        print("mode", name, flush=True)
    vehicle.mode = dronekit.VehicleMode("LAND")
    until(vehicle, "mode", lambda mode: mode.name == "LAND")
    until(vehicle, "armed", lambda armed: not armed, 60.0)
    print("landed", flush=True)
    vehicle.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
