"""Each MAV_CMD is one row: what the rows of a system say, and what is refused when a system is made."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Node
from anafi_mav.services import commands, system
from anafi_mav.services.commands import (
    Action,
    ActionGroup,
    Altitude,
    Command,
    Definition,
    Effect,
    ProgressPolicy,
    effect_of_mode,
)
from anafi_mav.services.flavours import ARDUPILOT, PX4, STANDARD, Flavour
from anafi_mav.services.service import Service
from anafi_mav.services.system import System
from anafi_mav.vehicle.base.modes import FlightMode

NAN = math.nan

BY_PARAMETER = "by its parameters"

ROWS: dict[str, tuple[bool, Altitude, object, ProgressPolicy]] = {
    "COMPONENT_ARM_DISARM": (False, Altitude.UNUSED, BY_PARAMETER, ProgressPolicy.PROMPT),
    "VIDEO_START_STREAMING": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.PROMPT),
    "VIDEO_STOP_STREAMING": (False, Altitude.UNUSED, Effect.STOP, ProgressPolicy.PROMPT),
    "CONDITION_YAW": (False, Altitude.UNUSED, BY_PARAMETER, ProgressPolicy.EARLY),
    "DO_ACCEPT_MAG_CAL": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "DO_CANCEL_MAG_CAL": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "DO_CHANGE_ALTITUDE": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "DO_CHANGE_SPEED": (False, Altitude.UNUSED, Effect.EACH, ProgressPolicy.PROMPT),
    "DO_GIMBAL_MANAGER_CONFIGURE": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_GIMBAL_MANAGER_PITCHYAW": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_MOUNT_CONFIGURE": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_MOUNT_CONTROL": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_FENCE_ENABLE": (False, Altitude.UNUSED, Effect.EACH, ProgressPolicy.PROMPT),
    "DO_FLIGHTTERMINATION": (False, Altitude.UNUSED, Effect.KILL, ProgressPolicy.PROMPT),
    "DO_ORBIT": (True, Altitude.AMSL, Effect.CHANGE, ProgressPolicy.EARLY),
    "DO_PAUSE_CONTINUE": (False, Altitude.UNUSED, BY_PARAMETER, ProgressPolicy.PROMPT),
    "DO_REPOSITION": (True, Altitude.BY_FRAME, BY_PARAMETER, ProgressPolicy.EARLY),
    "DO_SET_HOME": (True, Altitude.AMSL, Effect.EACH, ProgressPolicy.LATE),
    "DO_SET_MISSION_CURRENT": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "DO_SET_MODE": (False, Altitude.UNUSED, effect_of_mode, ProgressPolicy.LATE),
    "DO_SET_ROI": (True, Altitude.BY_FRAME, Effect.TARGET, ProgressPolicy.LATE),
    "DO_SET_ROI_LOCATION": (True, Altitude.AMSL, Effect.TARGET, ProgressPolicy.LATE),
    "DO_SET_ROI_NONE": (False, Altitude.UNUSED, Effect.STOP, ProgressPolicy.LATE),
    "DO_SET_ROI_SYSID": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_SET_ROI_WPNEXT_OFFSET": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "DO_SET_STANDARD_MODE": (False, Altitude.UNUSED, effect_of_mode, ProgressPolicy.PROMPT),
    "DO_START_MAG_CAL": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "GIMBAL_REQUEST_AXIS_CALIBRATION": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.PROMPT),
    "MISSION_START": (False, Altitude.UNUSED, effect_of_mode, ProgressPolicy.PROMPT),
    "NAV_LAND": (True, Altitude.UNUSED, Effect.LAND, ProgressPolicy.PROMPT),
    "NAV_LOITER_UNLIM": (True, Altitude.UNUSED, effect_of_mode, ProgressPolicy.LATE),
    "NAV_RETURN_TO_LAUNCH": (False, Altitude.UNUSED, Effect.RETURN, ProgressPolicy.PROMPT),
    "NAV_TAKEOFF": (True, Altitude.BY_FRAME, Effect.IRREVOCABLE, ProgressPolicy.PROMPT),
    "PREFLIGHT_CALIBRATION": (False, Altitude.UNUSED, Effect.CHANGE, ProgressPolicy.FINAL_ONLY),
    "IMAGE_START_CAPTURE": (False, Altitude.UNUSED, BY_PARAMETER, ProgressPolicy.PROMPT),
    "IMAGE_STOP_CAPTURE": (False, Altitude.UNUSED, Effect.STOP, ProgressPolicy.PROMPT),
    "PANORAMA_CREATE": (False, Altitude.UNUSED, Effect.IRREVOCABLE, ProgressPolicy.PROMPT),
    "RESET_CAMERA_SETTINGS": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.LATE),
    "SET_CAMERA_MODE": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.PROMPT),
    "SET_CAMERA_SOURCE": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.PROMPT),
    "SET_CAMERA_ZOOM": (False, Altitude.UNUSED, BY_PARAMETER, ProgressPolicy.PROMPT),
    "STORAGE_FORMAT": (False, Altitude.UNUSED, Effect.ONCE, ProgressPolicy.LATE),
    "VIDEO_START_CAPTURE": (False, Altitude.UNUSED, Effect.TARGET, ProgressPolicy.PROMPT),
    "VIDEO_STOP_CAPTURE": (False, Altitude.UNUSED, Effect.STOP, ProgressPolicy.PROMPT),
    "PREFLIGHT_REBOOT_SHUTDOWN": (False, Altitude.UNUSED, Effect.IRREVOCABLE, ProgressPolicy.FINAL_ONLY),
}
"""What a system carries out: location, height, effect, progress. The other MAV_CMD are queries or UNSUPPORTED."""


async def make_system() -> System:
    """A system of which no drone is connected and no endpoint open."""
    node = Node(clock=SystemClock())
    return System(node, Drone("127.0.0.1"), 1, SystemClock(), 0.0, allow_kill=False)


@pytest.fixture
def rows() -> Mapping[str, Action]:
    made = asyncio.run(make_system())
    found = {id: action for service in made.services for id, action in service.actions().items()}
    return {dialect.enums["MAV_CMD"][id].name.removeprefix("MAV_CMD_"): action for id, action in found.items()}


def test_command_rows_of_a_system_equal_the_list(rows: Mapping[str, Action]) -> None:
    said = {
        name: (
            row.location,
            row.altitude,
            row.effect if isinstance(row.effect, Effect) or row.effect is effect_of_mode else BY_PARAMETER,
            row.progress,
        )
        for name, row in rows.items()
    }
    assert said == ROWS


PAYLOAD = (Effect.STOP, Effect.TARGET, Effect.EACH, Effect.NUMBERED, Effect.ONCE)

PAYLOAD_ROWS: dict[str, tuple[ActionGroup, dict[tuple[float, ...], Effect]]] = {
    "DO_CONTROL_VIDEO": (
        ActionGroup.RECORDING,
        {(-1, 0, 0, 1): Effect.TARGET, (-1, 0, 0, 0): Effect.STOP, (): Effect.STOP},
    ),
    "DO_DIGICAM_CONTROL": (ActionGroup.PHOTO, {(): Effect.EACH}),
    "DO_GIMBAL_MANAGER_CONFIGURE": (ActionGroup.GIMBAL, {(): Effect.TARGET}),
    "DO_GIMBAL_MANAGER_PITCHYAW": (ActionGroup.GIMBAL, {(): Effect.TARGET}),
    "DO_MOUNT_CONFIGURE": (ActionGroup.GIMBAL, {(): Effect.TARGET}),
    "DO_MOUNT_CONTROL": (ActionGroup.GIMBAL, {(): Effect.TARGET}),
    "DO_SET_CAM_TRIGG_DIST": (
        ActionGroup.PHOTO,
        {(5,): Effect.TARGET, (0,): Effect.STOP, (): Effect.STOP},
    ),
    "IMAGE_START_CAPTURE": (
        ActionGroup.PHOTO,
        {(0, 0, 1, 7): Effect.NUMBERED, (0, 0, 1, 0): Effect.EACH, (0, 2, 0): Effect.EACH},
    ),
    "IMAGE_STOP_CAPTURE": (ActionGroup.PHOTO, {(): Effect.STOP}),
    "PANORAMA_CREATE": (ActionGroup.FLIGHT, {(): Effect.IRREVOCABLE}),
    "RESET_CAMERA_SETTINGS": (ActionGroup.CAMERA, {(): Effect.TARGET}),
    "SET_CAMERA_MODE": (ActionGroup.CAMERA, {(): Effect.TARGET}),
    "SET_CAMERA_SOURCE": (ActionGroup.STREAM, {(): Effect.TARGET}),
    "SET_CAMERA_ZOOM": (
        ActionGroup.ZOOM,
        {(0, 1): Effect.EACH, (1, 1): Effect.TARGET, (2, 50): Effect.TARGET, (): Effect.TARGET},
    ),
    "STORAGE_FORMAT": (ActionGroup.STORAGE, {(): Effect.ONCE}),
    "VIDEO_START_CAPTURE": (ActionGroup.RECORDING, {(): Effect.TARGET}),
    "VIDEO_START_STREAMING": (ActionGroup.STREAM, {(): Effect.TARGET}),
    "VIDEO_STOP_CAPTURE": (ActionGroup.RECORDING, {(): Effect.STOP}),
    "VIDEO_STOP_STREAMING": (ActionGroup.STREAM, {(): Effect.STOP}),
}
"""Rows that do not concern the flight, and those of the camera component: group, and effect by parameters."""


async def test_payload_rows_of_both_components_equal_the_list() -> None:
    autopilot, camera = (await make_system()).components
    tables = [service.actions() for component in (autopilot, camera) for service in component.services]
    tables += [service.autopilot_actions() for service in camera.services]
    of_camera = {id for service in camera.services for id in service.actions()}
    found: set[str] = set()
    for id, row in ((id, row) for table in tables for id, row in table.items()):
        name = dialect.enums["MAV_CMD"][id].name.removeprefix("MAV_CMD_")
        if row.group is ActionGroup.FLIGHT and id not in of_camera:
            continue
        found.add(name)
        group, effects = PAYLOAD_ROWS[name]
        for params, effect in effects.items():
            sent: Any = (*params, *[NAN] * (4 - len(params)))
            command = Command(id, row, sent, NAN, NAN, NAN, None)
            assert (command.group, command.effect) == (group, effect), (name, params)
            assert group is ActionGroup.FLIGHT or effect in PAYLOAD
    assert found == {*PAYLOAD_ROWS}


@pytest.mark.parametrize(
    ("name", "params", "place", "flavour", "effect"),
    [
        ("COMPONENT_ARM_DISARM", (0.0, NAN, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.STOP),
        ("COMPONENT_ARM_DISARM", (0.0, 21196.0, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.KILL),
        ("COMPONENT_ARM_DISARM", (1.0, NAN, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.CHANGE),
        ("COMPONENT_ARM_DISARM", (1.0, 21196.0, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.CHANGE),
        ("DO_PAUSE_CONTINUE", (0.0, NAN, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.HOLD),
        ("DO_PAUSE_CONTINUE", (1.0, NAN, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.CHANGE),
        ("DO_REPOSITION", (-1.0, 1.0, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.HOLD),
        ("DO_REPOSITION", (-1.0, 1.0, NAN, 0.0), (NAN, NAN, NAN), PX4, Effect.CHANGE),
        ("DO_REPOSITION", (-1.0, 1.0, NAN, 0.0), (NAN, NAN, NAN), ARDUPILOT, Effect.HOLD),
        ("DO_REPOSITION", (-1.0, 1.0, NAN, NAN), (48.0, 2.0, NAN), PX4, Effect.CHANGE),
        ("DO_SET_MODE", (1.0, 4.0, 3.0, NAN), (NAN, NAN, NAN), PX4, Effect.HOLD),
        ("DO_SET_MODE", (1.0, 4.0, NAN, NAN), (NAN, NAN, NAN), ARDUPILOT, Effect.STOP),
        ("DO_SET_MODE", (1.0, 4.0, 6.0, NAN), (NAN, NAN, NAN), PX4, Effect.LAND),
        ("DO_SET_MODE", (1.0, 4.0, 5.0, NAN), (NAN, NAN, NAN), PX4, Effect.RETURN),
        ("DO_SET_MODE", (1.0, 4.0, 2.0, NAN), (NAN, NAN, NAN), PX4, Effect.IRREVOCABLE),
        ("DO_SET_MODE", (1.0, 6.0, 0.0, NAN), (NAN, NAN, NAN), PX4, Effect.LAPSING),
        ("DO_SET_MODE", (1.0, 99.0, 0.0, NAN), (NAN, NAN, NAN), PX4, Effect.CHANGE),
        ("DO_SET_STANDARD_MODE", (6.0, NAN, NAN, NAN), (NAN, NAN, NAN), STANDARD, Effect.LAPSING),
        ("MISSION_START", (0.0, 0.0, NAN, NAN), (NAN, NAN, NAN), PX4, Effect.LAPSING),
    ],
)
def test_effect_depends_on_the_parameters(
    rows: Mapping[str, Action],
    name: str,
    params: tuple[float, float, float, float],
    place: tuple[float, float, float],
    flavour: Flavour,
    effect: Effect,
) -> None:
    assert Command(0, rows[name], params, *place, None, flavour=flavour).effect is effect


def test_every_mode_has_an_effect() -> None:
    assert set(commands.EFFECT_OF_MODE) == set(FlightMode)


@pytest.mark.parametrize(
    ("effect", "stops", "revocable"),
    [
        (Effect.CHANGE, False, True),
        (Effect.STOP, True, False),
        (Effect.HOLD, True, False),
        (Effect.LAND, True, False),
        (Effect.RETURN, False, False),
        (Effect.LAPSING, False, True),
        (Effect.IRREVOCABLE, False, False),
        (Effect.TARGET, False, False),
        (Effect.NUMBERED, False, False),
        (Effect.ONCE, False, False),
    ],
)
def test_effect_decides_repetition_and_cancellation(effect: Effect, stops: bool, revocable: bool) -> None:
    assert (effect.stops, effect.is_revocable) == (stops, revocable)


@pytest.mark.parametrize(
    ("flavour", "progress"),
    [(PX4, ProgressPolicy.FINAL_ONLY), (STANDARD, ProgressPolicy.FINAL_ONLY), (ARDUPILOT, None)],
)
def test_restart_sends_no_progress_to_ardupilot_clients(
    rows: Mapping[str, Action], flavour: Flavour, progress: ProgressPolicy | None
) -> None:
    row = rows["PREFLIGHT_REBOOT_SHUTDOWN"]
    assert Command(0, row, (1.0, NAN, NAN, NAN), NAN, NAN, NAN, None, flavour=flavour).progress is progress


async def _nothing(command: Command) -> None: ...


PLAIN = Action(_nothing, location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE)


class _Refused(Service):
    """A service whose rows cannot be registered."""

    rows: Mapping[int, Action]
    asked: tuple[int, ...] = ()

    def actions(self) -> Mapping[int, Action]:
        return self.rows

    def queries(self) -> Any:
        return dict.fromkeys(self.asked, lambda inbound, command: 0)


@pytest.mark.parametrize(
    ("id", "row", "reason"),
    [
        (dialect.MAV_CMD_NAV_LOITER_TO_ALT, PLAIN, "MAV_CMD 31: MAVLink says True of its location, the row False"),
        (
            dialect.MAV_CMD_DO_SET_SERVO,
            Action(_nothing, location=True, altitude=Altitude.UNUSED, effect=Effect.CHANGE),
            "MAV_CMD 183: MAVLink says False of its location, the row True",
        ),
        (
            dialect.MAV_CMD_DO_SET_SERVO,
            Action(_nothing, location=False, altitude=Altitude.AMSL, effect=Effect.CHANGE),
            "MAV_CMD 183: its z cannot be a height, it has no location",
        ),
        (
            dialect.MAV_CMD_DO_SET_SERVO,
            Action(_nothing, location=False, altitude=Altitude.UNUSED, effect=effect_of_mode),
            "MAV_CMD 183: it must have both mode and `effect_of_mode`, or none of them",
        ),
        (
            dialect.MAV_CMD_SET_CAMERA_FOCUS,
            Action(_nothing, location=False, altitude=Altitude.UNUSED, effect=Effect.CHANGE, group=ActionGroup.CAMERA),
            "MAV_CMD 532: its group has no CHANGE: say if it counts or sets a target",
        ),
        (dialect.MAV_CMD_DO_ORBIT, PLAIN, r"two services claim \[34\]"),
        (dialect.MAV_CMD_REQUEST_MESSAGE, PLAIN, r"\[512\] are both queries and actions"),
    ],
)
async def test_row_contradicting_another_or_mavlink_is_refused(
    monkeypatch: pytest.MonkeyPatch, id: int, row: Action, reason: str
) -> None:
    wrong = type("Wrong", (_Refused,), {"rows": {id: row}})
    monkeypatch.setattr(system, "AUTOPILOT_SERVICES", (*system.AUTOPILOT_SERVICES, wrong))
    with pytest.raises(ValueError, match=reason):
        await make_system()


async def test_query_with_a_location_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = type("Wrong", (_Refused,), {"rows": {}, "asked": (dialect.MAV_CMD_NAV_LOITER_TO_ALT,)})
    monkeypatch.setattr(system, "AUTOPILOT_SERVICES", (*system.AUTOPILOT_SERVICES, wrong))
    with pytest.raises(ValueError, match="MAV_CMD 31: MAVLink says True of its location"):
        await make_system()


def test_height_of_a_command_without_altitude_raises() -> None:
    definition = Definition(location=True, altitude=Altitude.UNUSED, effect=Effect.CHANGE)
    vehicle: Any = None
    with pytest.raises(ValueError, match="its row says that it has no height"):
        Command(21, definition, (NAN, NAN, NAN, NAN), 48.0, 2.0, 10.0, None).height(vehicle)
