"""Conformance item 49: missions that the drone itself refuses, each for one of its own reasons.

The gateway sees nothing wrong: what it would see by itself the simulated drone does not tell it. Only the components of
a flight plan (ComponentStateListChanged, arsdk.md §3.1) say why, in models of both kinds of files.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.missions import (
    ACTIVE,
    COMPLETE,
    MISSION_MODE,
    NOT_STARTED,
    flown,
    put,
    reached,
    start,
    state,
    takeoff,
    way,
)
from support.setpoints import said, texts
from support.world import World, world

from anafi_mav.arsdk.messages import alarms, ardrone3, common
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.common import FlightPlanComponent as Part
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.world.faults import Faults

COMPONENT = common.ComponentStateListChanged.NAME

GPS_REPORTS = frozenset({ardrone3.GPSFixStateChanged.NAME, ardrone3.GpsLocationChanged.NAME})
"""What the gateway takes its own word about the fix from."""


def _no_fix(w: World) -> None:
    w.drone.faults.unreported, w.drone.faults.gps = GPS_REPORTS, False


def _needs_calibration(w: World) -> None:
    reports = {common.MagnetoCalibrationRequiredState.NAME, alarms.TakeoffChecklist.NAME}
    w.drone.faults.unreported = frozenset(reports)
    w.drone.faults.magneto_required = True


def _unreadable_file(w: World) -> None:
    w.drone.faults.refuse_plan = frozenset({Part.MAVLINK_FILE})


def _no_take_off(w: World) -> None:
    w.drone.faults.unreported = frozenset({alarms.TakeoffChecklist.NAME})
    w.drone.faults.refuse_take_off = frozenset({TakeoffChecklistType.VCAM})


def _low_ceiling(w: World) -> None:
    w.drone.faults.unreported = frozenset({ardrone3.MaxAltitudeChanged.NAME})
    w.drone.firmware.receive(ardrone3.MaxAltitude(10.0), asyncio.get_running_loop().time())


def _no_camera(w: World) -> None:
    w.drone.faults.refuse_plan = frozenset({Part.CAMERA_AVAILABLE})


def mend(w: World) -> None:
    """All is well again."""
    w.drone.firmware.receive(ardrone3.MaxAltitude(150.0), asyncio.get_running_loop().time())
    well = Faults()
    for name in ("gps", "magneto_required", "refuse_take_off", "refuse_plan", "unreported"):
        setattr(w.drone.faults, name, getattr(well, name))


REASONS: dict[Part, tuple[Callable[[World], None], str]] = {
    Part.GPS: (_no_fix, "no GPS fix"),
    # One that has to be calibrated does not take off either, and says so.
    Part.CALIBRATION: (_needs_calibration, "calibrate magnetometer, cannot take off"),
    Part.MAVLINK_FILE: (_unreadable_file, "file not accepted"),
    Part.TAKE_OFF: (_no_take_off, "cannot take off"),
    Part.WAYPOINTS_BEYOND_GEOFENCE: (_low_ceiling, "waypoint out of bounds"),
    Part.CAMERA_AVAILABLE: (_no_camera, "camera unavailable"),
}
"""What goes wrong in the drone, and what is said of it."""

LOOKED_AT = (Part.MAVLINK_FILE, Part.WAYPOINTS_BEYOND_GEOFENCE)
"""The drone says so only when it is commanded to start."""


async def observed(w: World, part: Part, ok: bool, since: float) -> None:
    """Wait until the drone has reported a component."""
    await w.drone.wait_log(
        lambda e: e.name == COMPONENT and e.args == {"component": part, "State": int(ok)}, since=since
    )


@both
@pytest.mark.parametrize("by_mode", [False, True])
async def test_conf_049_mission_of_an_armed_drone_that_is_no_longer_ready_is_not_started(
    flavour: str, by_mode: bool
) -> None:
    """It was ready when it was armed; a fault within the 10 s after that is found before the drone is commanded."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0)])
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        w.drone.faults.refuse_take_off = frozenset({TakeoffChecklistType.VCAM})
        await w.client.wait(
            "SYS_STATUS", lambda m: not m.onboard_control_sensors_health & dialect.MAV_SYS_STATUS_PREARM_CHECK
        )
        mark = w.client.mark()
        numbers = (MISSION_MODE[flavour],) if flavour == "ardupilot" else (4, 4)
        mode, start = (dialect.MAV_CMD_DO_SET_MODE, 1, *numbers), (dialect.MAV_CMD_MISSION_START, 0, 0)
        assert (await w.client.command(*(mode if by_mode else start))).result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w.client, "PreArm:", mark)
        assert w.drone.log.find("command", common.Start.NAME) == []


@both
@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize("part", REASONS, ids=lambda part: part.name.lower())
async def test_conf_049_mission_refused_by_the_drone_names_its_reason(part: Part, model: str, flavour: str) -> None:
    """MISSION_START and mode Mission are both refused in its words, and nothing flies until that is over."""
    fail, reason = REASONS[part]
    async with world(flavour=flavour, web=True, model=model) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 12.0)])
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        now = asyncio.get_running_loop().time
        since = now()
        fail(w)
        if part not in LOOKED_AT:
            await observed(w, part, False, since)
        number = MISSION_MODE[flavour]
        mode = (dialect.MAV_CMD_DO_SET_MODE, 1, *((number,) if flavour == "ardupilot" else (4, 4)))
        for asked, command in enumerate([(dialect.MAV_CMD_MISSION_START, 0, 0), mode], 1):
            mark = w.client.mark()
            ack = await w.client.command(*command)
            assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
            await said(w.client, reason, mark)
            assert f"Mission refused by drone: {reason}" in texts(w.client, mark)
            await observed(w, part, False, since)
            refused = w.drone.log.find("event", common.StartingErrorEvent.NAME)
            assert len(refused) == asked, "the drone was asked, and has refused"
            await w.client.heartbeat(lambda beat: beat.custom_mode != number, since=w.client.mark())
            await state(w, NOT_STARTED, seq=0)
        assert flown(w) == [] == reached(w)
        assert not w.drone.log.find("state", "flying")
        since = now()
        mend(w)
        if part not in LOOKED_AT:
            await observed(w, part, True, since)
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, since=0)


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_drone_that_reports_no_playing_state_before_a_plan_flies_one(model: str) -> None:
    """Parrot's common.xml has the state reported by start, pause and stop alone."""

    def silent(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({common.MavlinkFilePlayingStateChanged.NAME})

    async with world(model=model, web=True, before=silent) as w:
        w.drone.faults.unreported = frozenset()
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0)])
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1]
