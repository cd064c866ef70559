"""Texts for operators when a mission begins, or does not."""

from __future__ import annotations

from anafi_mav import texts
from anafi_mav.drone.automatic.flight_plan import FlightPlanState
from anafi_mav.drone.events import FlightPlanComponent as Part
from anafi_mav.drone.events import FlightPlanIndicator as Input
from anafi_mav.errors import CommandRejected
from anafi_mav.texts import OperatorText

FIRST_LABEL = 1
"""The number of our item 0 in texts. On a station's map item 0 is home, whether or not it is sent to the vehicle
(QGroundControl FirmwarePlugin::sendHomePositionToVehicle): seq + 1 for PX4's clients, seq for ArduPilot's."""

_REASONS = {
    Part.GPS: texts.NO_FIX,
    Part.CALIBRATION: texts.DRONE_CALIBRATION,
    Part.MAVLINK_FILE: texts.DRONE_FILE,
    Part.TAKE_OFF: texts.DRONE_TAKEOFF,
    Part.WAYPOINTS_BEYOND_GEOFENCE: texts.DRONE_GEOFENCE,
    Part.CAMERA_AVAILABLE: texts.DRONE_CAMERA,
    Part.MAVLINK_STATE: texts.DRONE_NOT_READY,
    Part.MAVLINK_MEDIA: texts.DRONE_MEDIA,
    Part.FIRST_WAYPOINT_TOO_FAR: texts.DRONE_FIRST_FAR,
}
"""Parrot's components of a flight plan that keep it from being begun (arsdk.md §3.1)."""

_INPUTS = {Input.DRONE_GPS: _REASONS[Part.GPS], Input.DRONE_MAGNETO: _REASONS[Part.CALIBRATION]}
"""Faults that an Ai reports twice: as a missing input, and as one of the components."""


def refusal(state: FlightPlanState, error: CommandRejected) -> OperatorText:
    """Return the refusal of a start that the drone does not accept."""
    reasons: list[str] = [_REASONS.get(part, part.name.lower()) for part, ok in state.components.items() if not ok]
    reasons += [_INPUTS.get(one) or one.name.lower().replace("_", " ") for one in sorted(state.missing or ())]
    return texts.MISSION_REFUSED_BY_DRONE.fill(reasons=", ".join(dict.fromkeys(reasons)) or error.reason)


def beginning(item: int, resumes: bool, *, stepped: bool, returns: bool | None) -> OperatorText:
    """Return the text of a mission that begins or resumes, with the drone's link-loss behaviour.

    `stepped`: the drone has a part of the mission only. `returns`: the value of its ReturnHomeOnDisconnect.
    """
    alone = {None: texts.LINK_LOSS_UNKNOWN, True: texts.LINK_LOSS_RETURNS, False: texts.LINK_LOSS_CONTINUES}[returns]
    if stepped and returns is not True:
        alone = texts.LINK_LOSS_FILE
    template = texts.MISSION_RESUMES if resumes else texts.MISSION_STARTS
    return template.fill(item=item + FIRST_LABEL, alone=alone)
