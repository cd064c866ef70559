"""What the commands of component 1 do, for users; those about the payload are in `camera_commands`.

docs/generate.py makes docs/commands.md of it and of the tables of the services; a missing or unknown name stops it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Action
from anafi_mav.services.component import Component
from support.camera_commands import actions, is_payload

FLIGHT: Mapping[str, str] = {
    "COMPONENT_ARM_DISARM": (
        "param1 1 arms, 0 disarms and stops propellers that turn on the ground. In the air a disarm is refused, unless "
        "param2 is 21196 and the configuration allows it (`allow_kill`)"
    ),
    "NAV_TAKEOFF": "armed, the drone climbs to z, unset to `MIS_TAKEOFF_ALT`; the place is not used",
    "NAV_LAND": "lands where it is; the place is not used",
    "NAV_RETURN_TO_LAUNCH": "returns home as the drone is set to",
    "NAV_LOITER_UNLIM": "hovers, as mode Loiter; the place is not used",
    "DO_REPOSITION": "goes to place, height and heading (param4); param1 is the speed",
    "DO_CHANGE_SPEED": "param2 m/s of the goto under way and of later ones; refused in missions, returns and landings",
    "DO_CHANGE_ALTITUDE": "param1 m in frame param2: climbs or descends, on the way to a place too",
    "CONDITION_YAW": "param1 deg, absolute or (param4 1) relative, param3 the direction, param2 deg/s",
    "DO_ORBIT": "flies around a place: param1 radius, + clockwise, param2 m/s, param3 yaw, param4 angle",
    "DO_PAUSE_CONTINUE": "param1 0 hovers, and no stream flies then; 1 continues the goto or mission that it stopped",
    "DO_SET_MODE": "sets the mode, in the numbers of the endpoint's flavour",
    "DO_SET_STANDARD_MODE": "sets one of MAVLink's standard modes",
    "DO_SET_HOME": "param1 1: home is here, else at the place: a custom home, until a client changes it",
    "DO_FLIGHTTERMINATION": "param1 1 cuts the motors, where the configuration allows it (`allow_kill`)",
    "MISSION_START": "begins the mission or resumes it; only the whole of it",
    "DO_SET_MISSION_CURRENT": "param1 the item that is flown next, -1 the present one; param2 1 resets the mission",
    "DO_FENCE_ENABLE": "param1 0 disables, 1 enables, 2 disables the floor; param2 FENCE_TYPE bits, 0 for all",
    "PREFLIGHT_CALIBRATION": "param2 1 magnetometer, param5 2 horizon of the gimbal, all 0 ends the one under way",
    "DO_START_MAG_CAL": "calibrates the magnetometer: accepted when the drone waits to be turned",
    "DO_ACCEPT_MAG_CAL": "nothing to do: the drone has stored the result",
    "DO_CANCEL_MAG_CAL": "ends the calibration of the magnetometer",
    "PREFLIGHT_REBOOT_SHUTDOWN": "param1 1 reboots the drone, on the ground",
    "RUN_PREARM_CHECKS": "sends the health report again, and a text for each reason not to arm",
    "REQUEST_OPERATOR_CONTROL": "asks for the control of the vehicle, or gives it back",
    "CONTROL_HIGH_LATENCY": "param1 1: this endpoint gets HIGH_LATENCY2 in place of the streams",
    "REQUEST_MESSAGE": "sends message param1 once",
    "SET_MESSAGE_INTERVAL": "message param1 every param2 µs to this client's channel; -1 never, 0 as at first",
    "GET_MESSAGE_INTERVAL": "sends MESSAGE_INTERVAL of message param1",
    "GET_HOME_POSITION": "sends HOME_POSITION",
    "REQUEST_PROTOCOL_VERSION": "sends PROTOCOL_VERSION",
    "REQUEST_AUTOPILOT_CAPABILITIES": "sends AUTOPILOT_VERSION",
    "DO_SEND_BANNER": "sends the versions of gateway and drone as texts",
}
"""By name; a clause about what the drone or the gateway does."""


def rows(autopilot: Component, camera: Component) -> Iterator[tuple[int, str, Action | None]]:
    """Number, name and row (None: a query) of each command of component 1 that is not about the payload."""
    carried_out = actions(autopilot, camera)
    queries = {id for service in autopilot.services for id in service.queries()}
    for id in sorted({*carried_out, *queries}):
        name = dialect.enums["MAV_CMD"][id].name.removeprefix("MAV_CMD_")
        if not is_payload(name):
            yield id, name, carried_out.get(id)
