"""A dronekit script as its users write them: python dronekit_mission.py tcp:HOST:PORT LATITUDE LONGITUDE.

A mission is uploaded, read back and flown. It prints a line a step; the test that runs it holds them against the
simulator's own log.
"""

from __future__ import annotations

import sys
from typing import Any

import dronekit
from dronekit_base import say, until

RELATIVE, WAYPOINT, RETURN, TAKEOFF, DELAY, SPEED, PHOTO = 3, 16, 20, 22, 93, 178, 2000


def shape(command: Any) -> tuple[object, ...]:
    """Places go to and fro as single floats, which are half a metre apart here."""
    c = command
    numbers = (c.param1, c.param2, c.param3, c.param4, c.z)
    return (c.command, c.frame, *map(float, numbers), round(float(c.x), 5), round(float(c.y), 5))


def main(url: str, latitude: float, longitude: float) -> None:
    vehicle = dronekit.connect(url, wait_ready=True, timeout=30, heartbeat_timeout=30)
    until(vehicle, "ekf_ok", bool)
    commands = vehicle.commands
    commands.download()
    commands.wait_ready()
    say("there were", commands.count)
    commands.clear()
    north = latitude + 0.00018
    rows = [
        (TAKEOFF, 0, 0, 0, 0, 0, 0, 6),
        (WAYPOINT, 0, 0, 0, 0, north, longitude, 6),
        (DELAY, 1, -1, -1, -1, 0, 0, 0),
        (PHOTO, 0, 0, 1, 0, 0, 0, 0),
        (SPEED, 1, 3, -1, 0, 0, 0, 0),
        (WAYPOINT, 0, 0, 0, 0, latitude, longitude + 0.0001, 9),
        (RETURN, 0, 0, 0, 0, 0, 0, 0),
    ]
    wanted = [dronekit.Command(0, 0, 0, RELATIVE, command, 0, 1, *numbers) for command, *numbers in rows]
    for command in wanted:
        commands.add(command)
    commands.upload()
    commands.download()
    commands.wait_ready()
    say("sent", [shape(command) for command in wanted])
    say("read", [shape(commands[number]) for number in range(commands.count)])
    home = vehicle.home_location
    say("home", round(home.lat, 5), round(home.lon, 5), round(home.alt))
    vehicle.mode = dronekit.VehicleMode("GUIDED")
    until(vehicle, "mode", lambda mode: mode.name == "GUIDED")
    vehicle.armed = True
    until(vehicle, "armed", bool)
    vehicle.simple_takeoff(5)
    until(vehicle, "location.global_relative_frame", lambda at: at is not None and at.alt is not None and at.alt > 4.7)
    commands.next = 1
    vehicle.mode = dronekit.VehicleMode("AUTO")
    until(vehicle, "mode", lambda mode: mode.name == "AUTO")
    say("auto")
    until(vehicle, "mode", lambda mode: mode.name == "RTL", 60.0)
    say("end", commands.next)
    vehicle.mode = dronekit.VehicleMode("LAND")
    until(vehicle, "armed", lambda armed: not armed, 60.0)
    say("landed")
    vehicle.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
