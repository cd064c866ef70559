"""A pymavlink program that flies with the helpers of `mavutil`: python pymavlink_helpers.py URL.

It prints a line a step; the test that runs it judges them by the simulated drone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil

mav = mavutil.mavlink
LIMIT = 30.0
"""s for anything that is waited for."""


def say(*words: object) -> None:
    print(*words, flush=True)


def main(url: str) -> None:
    link = mavutil.mavlink_connection(url, source_system=254)
    assert link.wait_heartbeat(timeout=LIMIT), "no heartbeat"
    say("vehicle", link.target_system, link.target_component, link.flightmode, link.motors_armed())

    def until(kind: str, accept: Callable[[Any], bool]) -> Any:
        """Return the first message of a kind that `accept` likes."""
        while (message := link.recv_match(type=kind, blocking=True, timeout=LIMIT)) is not None:
            if accept(message):
                return message
        raise SystemExit(f"no such {kind}")

    def result(command: int) -> str:
        """Return the final MAV_RESULT of a command."""
        ack = until("COMMAND_ACK", lambda m: m.command == command and m.result != mav.MAV_RESULT_IN_PROGRESS)
        return str(mav.enums["MAV_RESULT"][ack.result].name.removeprefix("MAV_RESULT_"))

    def mode(name: str) -> str:
        while link.flightmode != name:
            until("HEARTBEAT", lambda m: m.get_srcComponent() == 1)
        return str(link.flightmode)

    link.set_mode("GUIDED")
    say("mode", result(mav.MAV_CMD_DO_SET_MODE), mode("GUIDED"))
    link.arducopter_arm()
    link.motors_armed_wait()
    say("armed", link.motors_armed())
    link.mav.command_long_send(1, 1, mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 6)
    say("takeoff", result(mav.MAV_CMD_NAV_TAKEOFF))
    until("GLOBAL_POSITION_INT", lambda m: m.relative_alt > 5700)
    here = link.location()
    link.mav.set_position_target_global_int_send(
        0, 1, 1, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0x0FF8, round((here.lat + 0.002) * 1e7), round(here.lng * 1e7),
        6.0, 0, 0, 0, 0, 0, 0, 0, 0,
    )  # fmt: skip
    until("VFR_HUD", lambda m: m.groundspeed > 1.0)
    link.set_mode_loiter()
    say("loiter", result(mav.MAV_CMD_NAV_LOITER_UNLIM), mode("LOITER"))
    until("VFR_HUD", lambda m: m.groundspeed < 0.2)
    say("stopped")
    link.set_mode_auto()
    say("auto", result(mav.MAV_CMD_MISSION_START))
    link.set_mode_rtl()
    say("rtl", result(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH), mode("RTL"))
    link.set_mode(link.mode_mapping()["LAND"])
    say("land", result(mav.MAV_CMD_DO_SET_MODE), mode("LAND"))
    link.motors_disarmed_wait()
    say("disarmed", link.motors_armed())
    link.close()


if __name__ == "__main__":
    main(sys.argv[1])
