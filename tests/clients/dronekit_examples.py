"""Flights of dronekit's example programs, the same calls in the same order: python dronekit_examples.py URL PACE.

The examples' waits are `PACE` times shorter, but for what is sent at a rate of its own. Where an example leaves the
drone in the air, this waits for its landing. A line before and after each.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Any

import dronekit
from dronekit_base import say, until
from pymavlink import mavutil

VELOCITY_ONLY = 0b0000_1101_1100_0111
YAW_BY_RATE = 0b0000_0000
M = 1.0 / 111_226.0
"""Degrees of latitude a metre, here."""


def armed(vehicle: Any, mode: str) -> None:
    """As all of them begin."""
    while not vehicle.is_armable:
        time.sleep(0.2)
    vehicle.mode = dronekit.VehicleMode(mode)
    vehicle.armed = True
    while not vehicle.armed:
        vehicle.armed = True
        time.sleep(1.0)


def taken_off(vehicle: Any, height: float) -> None:
    armed(vehicle, "GUIDED")
    vehicle.simple_takeoff(height)
    while vehicle.location.global_relative_frame.alt < height * 0.95:
        time.sleep(0.2)


def set_attitude_target(vehicle: Any, pace: float) -> None:
    """It takes off by thrust, from the ground."""

    def send(roll: float, pitch: float, thrust: float) -> None:
        q = quaternion(roll, pitch)
        message = vehicle.message_factory.set_attitude_target_encode(0, 1, 1, YAW_BY_RATE, q, 0.0, 0.0, 0.0, thrust)
        vehicle.send_mavlink(message)

    armed(vehicle, "GUIDED_NOGPS")
    while vehicle.location.global_relative_frame.alt < 2.5 * 0.95:
        send(0.0, 0.0, 0.7 if vehicle.location.global_relative_frame.alt < 2.5 * 0.6 else 0.6)
        time.sleep(0.2)
    for roll, pitch in ((0.0, 0.0), (0.0, -0.02), (0.0, 0.02)):
        begun = time.monotonic()
        while time.monotonic() - begun < 3.0 / pace:
            send(roll, pitch, 0.5)
            time.sleep(0.1)
    vehicle.mode = dronekit.VehicleMode("LAND")


def quaternion(roll: float, pitch: float) -> list[float]:
    cos, sin = math.cos, math.sin
    r, p = roll / 2.0, pitch / 2.0
    return [cos(r) * cos(p), sin(r) * cos(p), cos(r) * sin(p), -sin(r) * sin(p)]


def guided_set_speed_yaw(vehicle: Any, pace: float) -> None:
    """Velocities once a second, by two messages; headings; a region of interest."""

    def local(north: float, east: float, down: float, seconds: int) -> None:
        message = vehicle.message_factory.set_position_target_local_ned_encode(
            0, 0, 0, mavutil.mavlink.MAV_FRAME_LOCAL_NED, VELOCITY_ONLY,
            0, 0, 0, north, east, down, 0, 0, 0, 0, 0,
        )  # fmt: skip
        for _ in range(seconds):
            vehicle.send_mavlink(message)
            time.sleep(1.0)

    def earth(north: float, east: float, down: float, seconds: int) -> None:
        message = vehicle.message_factory.set_position_target_global_int_encode(
            0, 0, 0, mavutil.mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, VELOCITY_ONLY,
            0, 0, 0, north, east, down, 0, 0, 0, 0, 0,
        )  # fmt: skip
        for _ in range(seconds):
            vehicle.send_mavlink(message)
            time.sleep(1.0)

    def heading(degrees: float, *, relative: bool) -> None:
        message = vehicle.message_factory.command_long_encode(
            0, 0, mavutil.mavlink.MAV_CMD_CONDITION_YAW, 0, degrees, 0, 1, int(relative), 0, 0, 0
        )
        vehicle.send_mavlink(message)

    taken_off(vehicle, 5.0)
    heading(180.0, relative=False)
    local(2.0, 0.0, 0.0, 3)
    heading(90.0, relative=True)
    earth(-2.0, 0.0, -0.5, 3)
    earth(0.0, 0.0, 0.0, 1)
    vehicle.mode = dronekit.VehicleMode("LAND")


def simple_goto(vehicle: Any, pace: float) -> None:
    """It returns at its end, which is a landing."""
    taken_off(vehicle, 8.0)
    vehicle.airspeed = 3
    home = vehicle.location.global_relative_frame
    for north, groundspeed in ((15.0, None), (25.0, 10)):
        place = dronekit.LocationGlobalRelative(home.lat + north * M, home.lon, 10)
        if groundspeed is None:
            vehicle.simple_goto(place)
        else:
            vehicle.simple_goto(place, groundspeed=groundspeed)
        time.sleep(30.0 / pace)
    vehicle.mode = dronekit.VehicleMode("RTL")


EXAMPLES: tuple[Callable[[Any, float], None], ...] = (set_attitude_target, guided_set_speed_yaw, simple_goto)


def main(url: str, pace: float) -> None:
    vehicle = dronekit.connect(url, wait_ready=True, timeout=30, heartbeat_timeout=30)
    for example in EXAMPLES:
        say("begin", example.__name__)
        example(vehicle, pace)
        say("end", example.__name__)
        until(vehicle, "armed", lambda armed: not armed, 60.0)
        say("down", example.__name__)
    vehicle.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
