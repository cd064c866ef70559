"""A dronekit program that stays on the ground: what dronekit2's own tests ask of a vehicle, in one go.

It asserts nothing: it prints a line for each answer, which its test judges.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from dronekit import Command, CommandInt, connect
from dronekit_base import say
from pymavlink import mavutil

mav = mavutil.mavlink
HOME = (float(sys.argv[2]), float(sys.argv[3]))


def answers(vehicle: Any, command: int, ask: Callable[[], None], wait: float) -> list[int]:
    """The results of all acknowledgements of a command that come within some seconds."""
    results: list[int] = []

    def heard(_: Any, __: str, message: Any) -> None:
        if message.command == command:
            results.append(message.result)

    vehicle.add_message_listener("COMMAND_ACK", heard)
    ask()
    time.sleep(wait)
    vehicle.remove_message_listener("COMMAND_ACK", heard)
    return results


def item(frame: int, command: int, *numbers: float, autocontinue: int = 1) -> Any:
    """One item; the numbers are param1 to param4, latitude, longitude and height."""
    return CommandInt.from_command(Command(0, 0, 0, frame, command, 0, autocontinue, *numbers))


def read(vehicle: Any) -> list[Any]:
    vehicle.commands.download()
    vehicle.commands.wait_ready()
    return list(vehicle.commands)


def send(vehicle: Any, items: list[Any]) -> None:
    vehicle.commands.clear()
    for one in items:
        vehicle.commands.add(one)
    vehicle.commands.upload(timeout=20)


vehicle = connect(sys.argv[1], wait_ready=True, timeout=40)
say("home", vehicle.home_location)
deadline = time.monotonic() + 15
while vehicle._capabilities is None and time.monotonic() < deadline:  # dronekit has no event for them
    time.sleep(0.1)
say("mission_float", vehicle.capabilities.mission_float, "ftp", vehicle.capabilities.ftp)
say("garbage", vehicle.parameters.get("NO_SUCH_PARAM", wait_ready=True))
say("channels", len(vehicle.channels), type(vehicle.channels["1"]).__name__)

send(vehicle, [])
count, home = len(read(vehicle)), vehicle.home_location
say("empty", count, "at", round(home.lat, 5), round(home.lon, 5))  # single floats

north, east = HOME[0] + 0.0005, HOME[1] + 0.0005
mission = [
    item(0, mav.MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0, north, HOME[1], 60, autocontinue=0),
    item(3, mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, north, HOME[1], 20),
    item(3, mav.MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0, north, east, 20, autocontinue=0),
    item(3, mav.MAV_CMD_CONDITION_YAW, 2, 22, 1, 3, 0, 0, 0),
    item(3, mav.MAV_CMD_NAV_WAYPOINT, 0, 0, 0, 0, 0, 0, 0),
]
send(vehicle, mission)
back = read(vehicle)
say("mission", [one.command for one in back], "autocontinue", {one.autocontinue for one in back})
say("next", vehicle.commands.next)
vehicle.commands.next = 3
deadline = time.monotonic() + 10
while vehicle.commands.next != 3 and time.monotonic() < deadline:
    time.sleep(0.1)
say("next", vehicle.commands.next)

say("compass", answers(vehicle, mav.MAV_CMD_DO_START_MAG_CAL, vehicle.send_calibrate_magnetometer, 3.0))
say("level", answers(vehicle, mav.MAV_CMD_PREFLIGHT_CALIBRATION, vehicle.send_calibrate_vehicle_level, 6.0))
say("reboot", answers(vehicle, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, vehicle.reboot, 0.5))
vehicle.close()
say("end")
