"""A dronekit script as its users write them: python dronekit_flight.py tcp:HOST:PORT north-latitude longitude.

It prints a line a step; the test that runs it holds them against the simulator's own log.
"""

from __future__ import annotations

import sys

import dronekit
from dronekit_base import say, until


def main(url: str, latitude: float, longitude: float) -> None:
    vehicle = dronekit.connect(url, wait_ready=True, timeout=30, heartbeat_timeout=30)
    say("ready", vehicle.version)
    say("parameters", len(vehicle.parameters))
    until(vehicle, "ekf_ok", bool)
    say("armable", vehicle.is_armable)
    vehicle.mode = dronekit.VehicleMode("GUIDED")
    until(vehicle, "mode", lambda mode: mode.name == "GUIDED")
    vehicle.armed = True
    until(vehicle, "armed", bool)
    say("armed")
    vehicle.simple_takeoff(6)
    until(vehicle, "location.global_relative_frame", lambda at: at is not None and at.alt is not None and at.alt > 5.7)
    say("up")
    vehicle.groundspeed = 6
    vehicle.simple_goto(dronekit.LocationGlobalRelative(latitude, longitude, 9))
    until(
        vehicle,
        "location.global_relative_frame",
        lambda at: at is not None and abs(at.lat - latitude) < 1e-5 and abs(at.alt - 9.0) < 0.5,
    )
    say("there")
    for name in ("BRAKE", "LOITER", "RTL"):
        vehicle.mode = dronekit.VehicleMode(name)
        until(vehicle, "mode", lambda mode, name=name: mode.name == name)
        say("mode", name)
    vehicle.mode = dronekit.VehicleMode("LAND")
    until(vehicle, "mode", lambda mode: mode.name == "LAND")
    until(vehicle, "armed", lambda armed: not armed, 60.0)
    say("landed")
    vehicle.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
