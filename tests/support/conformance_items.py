"""The conformance list: what a MAVLink client needs of a vehicle, numbered, and which of it is to be shown by now.

A test shows an item when its name begins with `test_conf_NNN`. Both flavours, unless an item concerns one only or has
nothing to do with flavours.
"""

from __future__ import annotations

from typing import NamedTuple

BOTH, PX4, COPTER, NEITHER = ("px4", "ardupilot"), ("px4",), ("ardupilot",), ()


class Item(NamedTuple):
    title: str
    flavours: tuple[str, ...] = BOTH
    """Those in which it is to be shown; none: it does not depend on the flavour."""
    part: str = ""
    """What of it is left to a later issue."""


_LATER_CAMERA = "camera and gimbal components"

ITEMS: dict[int, Item] = {
    1: Item("heartbeat at 1 Hz from component 1, type quadrotor, the flavour's autopilot, custom mode flag"),
    2: Item("one more heartbeat within 100 ms of a change of mode or armed state"),
    5: Item("all frames MAVLink 2, sequence contiguous for each component"),
    6: Item("silent within 3 s of the drone's link loss, back with fresh data"),
    7: Item("COMMAND_ACK from the addressed component, to the requester"),
    8: Item("a command to component 0 gets one acknowledgement"),
    9: Item("an unsupported command is answered within 200 ms", part=_LATER_CAMERA),
    10: Item("NaN in every parameter of every command means the default and breaks nothing"),
    11: Item("a long action says IN_PROGRESS at least once a second, then how it ended"),
    12: Item("a command sent four times in two seconds is executed once"),
    13: Item("commands mean the same as LONG and as INT"),
    14: Item("AUTOPILOT_VERSION on request, unset parameters tolerated"),
    15: Item("capability bits are what is implemented; one parameter encoding"),
    16: Item("version number that no ground station nags about", PX4),
    17: Item("arming: acknowledged, shown within 1 s, idempotent"),
    18: Item("disarming on the ground accepted, in the air refused"),
    19: Item("QGroundControl's order: take-off accepted while disarmed, climb after arming"),
    20: Item("MAVSDK's order: arm, take-off without a height climbs to MIS_TAKEOFF_ALT", PX4),
    21: Item("take-off with latitude and longitude 0: height above ground"),
    22: Item("take-off with unset position: AMSL height", PX4),
    23: Item("SET_MODE to land lands, shown within 1.3 s"),
    24: Item("MAV_CMD_NAV_LAND lands"),
    25: Item("SET_MODE, DO_SET_MODE and NAV_RETURN_TO_LAUNCH return"),
    26: Item("pause: DO_REPOSITION with nothing set stops"),
    27: Item("DO_SET_MODE to each mode: acknowledged and shown", part="mode Mission"),
    28: Item("a mode that is not there: DENIED, a text, the heartbeat unchanged"),
    29: Item("go to a place, in every frame"),
    30: Item("no fix: TEMPORARILY_REJECTED, and nothing moves"),
    31: Item("change of altitude keeps the place"),
    32: Item("landed_state from ground to air and back"),
    33: Item("disarmed after landing"),
    34: Item("HOME_POSITION soon, on request by every way, and streamed"),
    35: Item("all altitudes agree within 0.5 m"),
    36: Item("GPS fix and satellites as the drone says; unknown is unknown"),
    37: Item("battery as the drone says; unused cells unknown"),
    38: Item("SYS_STATUS makes MAVSDK's health_all_ok true when it is"),
    39: Item("the pre-arm bit says whether the drone would take off"),
    40: Item("signs of attitude and yaw"),
    41: Item("signs of NED velocity"),
    42: Item("the list of parameters: complete, constant, from component 1"),
    43: Item("a parameter by name and by index, names of 16 characters"),
    44: Item("a parameter written: echoed; unknown: PARAM_ERROR"),
    45: Item("integers and floats in the flavour's encoding"),
    46: Item("empty lists of missions, fences, rally points: COUNT 0 within 500 ms"),
    50: Item("the motors' cut obeys the policy and says so"),
    51: Item("QGroundControl's connection sequence is through within 10 s"),
    52: Item("every parameter that QGroundControl's pages ask for is there"),
    53: Item("QGroundControl calls the vehicle set up", PX4),
    54: Item("_HASH_CHECK by QGroundControl's algorithm", PX4),
    55: Item("PARAM_SET of _HASH_CHECK stops the list", PX4),
    56: Item("AVAILABLE_MODES one by one and all; out of range DENIED"),
    57: Item("CURRENT_MODE on change and every two seconds, as the heartbeat says"),
    58: Item("AVAILABLE_MODES_MONITOR tells that the list has changed"),
    59: Item("DO_SET_STANDARD_MODE"),
    60: Item("PROTOCOL_VERSION on request"),
    76: Item("fence uploaded and enforced, FENCE_STATUS"),
    77: Item("rally points uploaded and downloaded"),
    78: Item("orbit: AMSL in every frame, both directions"),
    79: Item("ORBIT_EXECUTION_STATUS while it lasts"),
    80: Item("region of interest turns drone and camera"),
    81: Item("DO_REPOSITION's heading in radians; unset keeps it"),
    82: Item("DO_CHANGE_SPEED: types, unchanged, default"),
    83: Item("DO_SET_HOME here and there; HOME_POSITION told"),
    104: Item("MANUAL_CONTROL: signs, neutral after 0.5 s of silence"),
    105: Item("Offboard refused without setpoints, Hold within 1 s of their end"),
    106: Item("position targets in every frame and mask; terrain refused"),
    107: Item("follow: FOLLOW_TARGET leads, or DENIED"),
    108: Item("SET_MESSAGE_INTERVAL: the rate asked for, at most the drone's own"),
    109: Item("MESSAGE_INTERVAL; 0 for what is not there"),
    110: Item("REQUEST_DATA_STREAM does no harm"),
    111: Item("TIMESYNC within 20 ms; PING to its sender only", NEITHER),
    112: Item("long texts in chunks, severities", NEITHER),
    113: Item("FTP: list, open, read, burst, CRC; lost replies, traversal", NEITHER),
    114: Item("@PARAM/param.pck: a valid file or an answer at once"),
    115: Item("FTP sessions of two clients", NEITHER),
    116: Item("MAVSDK: action, telemetry, param, info, ftp", PX4, "mission, camera, gimbal"),
    117: Item("dronekit on ArduPilot's flavour", COPTER, "missions"),
    118: Item("dronekit on PX4's flavour", PX4),
    119: Item("MAVProxy on ArduPilot's flavour", COPTER, "missions"),
    120: Item("Mission Planner's sequences on ArduPilot's flavour", COPTER, "missions, camera"),
    121: Item("two vehicles, two ground stations: no answer goes astray", NEITHER),
    125: Item("COMPONENT_METADATA, general.json, parameter.json", NEITHER),
    126: Item("EVENT, REQUEST_EVENT, arming report", NEITHER),
    127: Item("RUN_PREARM_CHECKS", NEITHER),
    129: Item("COMMAND_CANCEL of a calibration", NEITHER, "format"),
    130: Item("calibration with progress texts, refused in flight"),
    131: Item("log list, empty but correct", NEITHER),
    132: Item("FLIGHT_INFORMATION", NEITHER),
    133: Item("DISTANCE_SENSOR, WIND_COV, VIBRATION only with real data", NEITHER),
    134: Item("RC_CHANNELS rssi in the flavour's scale"),
    135: Item("RADIO_STATUS from the link's quality", NEITHER),
    140: Item("EKF_STATUS_REPORT"),
    143: Item("pause and continue, heading, altitude, fence by command"),
    146: Item("malformed, truncated and oversized frames change nothing", NEITHER),
    147: Item("PING storm, 50 Hz MANUAL_CONTROL, four clients: the heartbeat keeps its time", NEITHER),
    148: Item("reboot: acknowledged, silence, back", NEITHER),
    149: Item("banner and AUTOPILOT_VERSION name gateway and firmware"),
    150: Item("HIGH_LATENCY2 instead of streams", NEITHER),
    153: Item("shell and winch UNSUPPORTED, PLAY_TUNE_V2 beeps", NEITHER),
    155: Item("LINK_NODE_STATUS, ONBOARD_COMPUTER_STATUS on request", NEITHER),
    156: Item("the standard flavour connects and takes off", NEITHER),
}
"""In scope so far, by number. Missing: 3, 4, 84-103, 128, 136-139, 154 (camera, gimbal), 47-49, 61-75, 122, 141, 142
(missions), 123, 124, 144, 145, 151, 152 (fleet)."""
