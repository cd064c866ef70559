"""Why a drone does not begin a plan, in words for people (arsdk.md §3.1: components of the flight plan)."""

from __future__ import annotations

from anafi_mav.drone.events import FlightPlanComponent as Part
from anafi_mav.drone.flight_plan import FlightPlanState
from anafi_mav.errors import CommandRejected

_WORDS = {
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


def refusal(state: FlightPlanState, error: CommandRejected) -> str:
    """One sentence on a start that the drone has refused."""
    reasons = [_WORDS.get(part, part.name.lower()) for part, ok in state.components.items() if not ok]
    reasons += [indicator.name.lower().replace("_", " ") for indicator in sorted(state.missing or ())]
    return f"Mission refused by the drone: {', '.join(reasons) or error.reason}"
