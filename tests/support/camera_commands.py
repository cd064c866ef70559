"""Commands and messages of camera, gimbal, storage and video that this gateway does not have, with the reasons.

docs/generate.py makes docs/camera.md of it and of the tables of the services; a conformance test sends each command.
"""

from __future__ import annotations

from collections.abc import Iterator

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Node
from anafi_mav.services.commands import Action
from anafi_mav.services.component import Component
from anafi_mav.services.flavours import ARDUPILOT, PX4, Flavour
from anafi_mav.services.system import System

WORDS = ("CAMERA", "CAM_", "GIMBAL", "MOUNT", "VIDEO", "IMAGE", "STORAGE", "PANORAMA", "DIGICAM", "SET_ROI", "THERMAL")
NOT_PAYLOAD = {"PREFLIGHT_STORAGE"}
"""A name with one of the words: the storage of parameters."""

THERMAL_MODELS = ("thermal", "usa")
THERMAL_ONLY = {"SET_CAMERA_SOURCE", "CAMERA_THERMAL_RANGE"}
"""UNSUPPORTED on models without a thermal camera."""

REASONS = {
    "DO_DIGICAM_CONFIGURE": "settings are extended parameters",
    "DO_SET_CAM_TRIGG_INTERVAL": "IMAGE_START_CAPTURE has an interval",
    "DO_MOUNT_CONTROL_QUAT": "DO_GIMBAL_MANAGER_PITCHYAW turns the gimbal",
    "SET_CAMERA_FOCUS": "fixed focus",
    "SET_STORAGE_USAGE": "the drone chooses the storage itself",
    "CAMERA_TRACK_POINT": "the drone offers no tracking to programs",
    "CAMERA_TRACK_RECTANGLE": "the drone offers no tracking to programs",
    "CAMERA_STOP_TRACKING": "the drone offers no tracking to programs",
    "CAMERA_START_MTI": "no moving-target indicator",
    "CAMERA_STOP_MTI": "no moving-target indicator",
    "GIMBAL_RESET": "for one maker's gimbals",
    "GIMBAL_AXIS_CALIBRATION_STATUS": "for one maker's gimbals",
    "GIMBAL_REQUEST_AXIS_CALIBRATION": "for one maker's gimbals",
    "GIMBAL_FULL_RESET": "for one maker's gimbals",
    "CAMERA_TRIGGER": "CAMERA_IMAGE_CAPTURED reports photos",
    "DIGICAM_CONFIGURE": "settings are extended parameters",
    "DIGICAM_CONTROL": "sent as MAV_CMD_DO_DIGICAM_CONTROL",
    "CAMERA_STATUS": "between an autopilot and its camera",
    "CAMERA_FEEDBACK": "CAMERA_IMAGE_CAPTURED reports photos",
    "GIMBAL_REPORT": "for one maker's gimbals",
    "GIMBAL_CONTROL": "for one maker's gimbals",
    "GIMBAL_TORQUE_CMD_REPORT": "for one maker's gimbals",
    "CAMERA_TRACKING_IMAGE_STATUS": "the drone offers no tracking to programs",
    "CAMERA_TRACKING_GEO_STATUS": "the drone offers no tracking to programs",
    "GIMBAL_DEVICE_SET_ATTITUDE": "between a gimbal manager and its device",
    "AUTOPILOT_STATE_FOR_GIMBAL_DEVICE": "between an autopilot and its gimbal",
    "HERELINK_VIDEO_STREAM_INFORMATION": "for one maker's radio",
}
"""By name; everything else that has one of the words is in a table of a service."""


def is_payload(name: str) -> bool:
    return any(word in name for word in WORDS) and name not in NOT_PAYLOAD


def commands() -> Iterator[tuple[int, str]]:
    """Number and name of all MAV_CMD about the payload."""
    for id, entry in sorted(dialect.enums["MAV_CMD"].items()):
        name = entry.name.removeprefix("MAV_CMD_")
        if is_payload(name):
            yield id, name


def messages() -> Iterator[tuple[int, str]]:
    """Number and name of all messages about the payload."""
    for id, kind in sorted(dialect.mavlink_map.items()):
        if is_payload(kind.msgname) and not kind.msgname.startswith("ANAFI"):
            yield id, kind.msgname


def make_system() -> System:
    """A system of which no drone is connected and no endpoint open. It needs a running event loop."""
    return System(Node(clock=SystemClock()), Drone("127.0.0.1"), 1, SystemClock(), 0.0, allow_kill=False)


def actions(component: Component, others: Component) -> dict[int, Action]:
    """The commands that a component carries out, also those that it has for the other one."""
    found: dict[int, Action] = {}
    for service in component.services:
        found.update(service.actions())
    if component.compid == dialect.MAV_COMP_ID_AUTOPILOT1:
        for service in others.services:
            found.update(service.autopilot_actions())
    return found


def flavours(component: Component, others: Component, id: int) -> list[Flavour]:
    """The flavours whose clients have a command of a component."""
    row = actions(component, others).get(id)
    if row is not None:
        return [flavour for flavour in (PX4, ARDUPILOT) if row.offered(flavour)]
    return [PX4, ARDUPILOT] if component.commands.owns(id) else []
