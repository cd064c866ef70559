"""What is said to people when a mission begins, or does not."""

from __future__ import annotations

from anafi_mav.drone.automatic.flight_plan import FlightPlanState
from anafi_mav.drone.events import FlightPlanComponent as Part
from anafi_mav.drone.events import FlightPlanIndicator as Input
from anafi_mav.errors import CommandRejected

_REASONS = {
    Part.GPS: "no GPS fix",
    Part.CALIBRATION: "the magnetometer wants to be calibrated",
    Part.MAVLINK_FILE: "it does not take the file",
    Part.TAKE_OFF: "it cannot take off",
    Part.WAYPOINTS_BEYOND_GEOFENCE: "a way point is beyond its own geofence or ceiling",
    Part.CAMERA_AVAILABLE: "its camera is not available",
    Part.MAVLINK_STATE: "it is not ready for a plan",
    Part.MAVLINK_MEDIA: "it cannot store the pictures",
    Part.FIRST_WAYPOINT_TOO_FAR: "the first way point is too far away",
}
"""Parrot's components of a flight plan that keep it from being begun (arsdk.md §3.1)."""

_INPUTS = {Input.DRONE_GPS: _REASONS[Part.GPS], Input.DRONE_MAGNETO: _REASONS[Part.CALIBRATION]}
"""What an Ai lacks and tells twice: as a missing input, and as one of the components."""


def refusal(state: FlightPlanState, error: CommandRejected) -> str:
    """One sentence on a start that the drone has refused."""
    reasons = [_REASONS.get(part, part.name.lower()) for part, ok in state.components.items() if not ok]
    reasons += [_INPUTS.get(one) or one.name.lower().replace("_", " ") for one in sorted(state.missing or ())]
    return f"Mission refused by the drone: {', '.join(dict.fromkeys(reasons)) or error.reason}"


def beginning(item: int, resumes: bool, *, stepped: bool, returns: bool | None) -> str:
    """Where a mission begins or goes on, and what becomes of it without the gateway.

    `stepped`: the drone has a part of it only. `returns`: what its ReturnHomeOnDisconnect is set to.
    """
    alone = {None: "does as it is set", True: "returns home", False: "flies on"}[returns]
    if stepped and returns is not True:
        alone = "flies to the end of its file and hovers"
    verb = "goes on" if resumes else "begins"
    return f"Mission {verb} at item {item}; without link or gateway the drone {alone}"
