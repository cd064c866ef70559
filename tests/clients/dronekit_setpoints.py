"""A dronekit script that flies by setpoints and by channels: python dronekit_setpoints.py URL px4|ardupilot.

It prints a line a step, and goes on with the step until the test has looked where the drone truly is.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import dronekit
from dronekit_base import say, until
from pymavlink import mavutil

EVERY, STANDSTILL = 0.1, 0.3
"""s from one to the next, and between two of which the machine stood still."""
VELOCITY_ONLY = 0b0000_1101_1100_0111
POSITION_ONLY = 0b0000_1101_1111_1000


def repeated(do: Callable[[], None], seconds: float, name: str, engage: Callable[[], None] = lambda: None) -> None:
    """A program's own loop, as the examples of dronekit have it; after some time, until the test has looked.

    `engage` is what makes the drone listen. Where the machine held this program up, the drone hovers and listens no
    more: so it is said again, and what is flown by then has to settle again. It is said at the beginning in any case:
    the machine may have stood still since the last setpoint of what came before.
    """
    do()
    engage()
    due: float | None = time.monotonic() + seconds
    last = time.monotonic()
    looked = threading.Event()

    def look() -> None:
        sys.stdin.readline()
        looked.set()

    while not looked.wait(EVERY):
        do()
        if time.monotonic() - last > STANDSTILL:
            engage()
            due = due and time.monotonic() + seconds
        last = time.monotonic()
        if due is not None and time.monotonic() > due:
            due = None
            say("held", name)
            threading.Thread(target=look, daemon=True).start()


def set_mode(vehicle: Any, name: str) -> None:
    vehicle.mode = dronekit.VehicleMode(name)
    until(vehicle, "mode", lambda mode: mode.name == name)
    say("mode", name)


def main(url: str, flavour: str) -> None:
    vehicle = dronekit.connect(url, wait_ready=True, timeout=30, heartbeat_timeout=30)
    until(vehicle, "ekf_ok", bool)
    if flavour == "ardupilot":
        set_mode(vehicle, "GUIDED")
    vehicle.armed = True
    until(vehicle, "armed", bool)
    vehicle.simple_takeoff(8)
    until(vehicle, "location.global_relative_frame", lambda at: at is not None and at.alt is not None and at.alt > 7.7)
    idle = "GUIDED" if flavour == "ardupilot" else "LOITER"
    until(vehicle, "mode", lambda mode: mode.name == idle)
    say("up")

    def setpoint(frame: int, mask: int, at: tuple[float, ...], v: tuple[float, ...]) -> Callable[[], None]:
        message = vehicle.message_factory.set_position_target_local_ned_encode(
            0, 0, 0, frame, mask, *at, *v, 0, 0, 0, 0, 0
        )
        return lambda: vehicle.send_mavlink(message)

    nowhere = (0.0, 0.0, 0.0)
    north = setpoint(mavutil.mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_ONLY, nowhere, (2.0, 0.0, 0.0))

    def engage() -> None:
        if flavour == "px4":
            vehicle.mode = dronekit.VehicleMode("OFFBOARD")

    if flavour == "px4":
        repeated(north, 1.0, "setpoints before Offboard")
    repeated(north, 5.0, "velocity", engage)
    place = setpoint(mavutil.mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY, (4.0, -5.0, -10.0), nowhere)
    repeated(place, 9.0, "position", engage)
    until(vehicle, "mode", lambda mode: mode.name == idle)
    say("idle", idle)

    set_mode(vehicle, "LOITER" if flavour == "ardupilot" else "POSCTL")

    def channels() -> None:
        vehicle.channels.overrides = {"1": 1800, "2": 1500, "3": 1500, "4": 1500}

    repeated(channels, 3.0, "channels")
    vehicle.channels.overrides = {}
    set_mode(vehicle, "RTL")
    vehicle.close()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
