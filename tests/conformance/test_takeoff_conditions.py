"""Conditions of arming and take-off, judged by what the simulated drone received and by the heartbeat."""

from __future__ import annotations

import asyncio
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, ARM, REJECTED, TAKEOFF_CMD, goto, heard, watched
from support.mav import NAN
from support.params import write
from support.world import ARMED, HOME, MODES, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.alarms import TakeoffChecklist, TakeoffChecklistType
from anafi_mav.sim import SimulatedDrone
from anafi_mav.vehicle.takeoff import AUTO_DISARM

INT32 = dialect.MAV_PARAM_TYPE_INT32
TAKEOFF_MODE = MODES["px4"].takeoff


def now() -> float:
    return asyncio.get_running_loop().time()


async def test_arming_in_the_air_is_accepted_and_leaves_the_flight_alone() -> None:
    """Also where arming starts the motors: a client that arms once more disturbs no goto."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        assert await goto(w, 30.0, 5.0) == ACCEPTED
        await write(w.client, "ANF_HAND_LAUNCH", 1, INT32)
        began = now()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 29.0, 30.0)
        assert [e.name for e in w.drone.log if e.kind == "command" and e.t >= began and "PCMD" not in e.name] == []


async def test_arming_without_a_flying_state_is_refused() -> None:
    def silent(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({ardrone3.FlyingStateChanged.NAME})

    async with world(before=silent) as w:
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == REJECTED
        text = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("PreArm"), since=mark)
        assert "flying state unknown" in text.text.lower()
        assert not (await w.client.heartbeat(lambda beat: True)).base_mode & ARMED


async def test_armed_state_expires_after_a_takeoff_that_the_drone_has_not_begun() -> None:
    """The drone refuses by silence, for a reason that it has not reported."""

    def refusing(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({TakeoffChecklist.NAME})
        drone.faults.refuse_take_off = frozenset({TakeoffChecklistType.MAGNETO_CALIBRATION})

    async with world(before=refusing) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, -1, NAN, NAN, NAN, timeout=20.0)).result != ACCEPTED
        assert heard(w, "TakeOff") == ["TakeOff"]
        began = now()
        await w.client.heartbeat(lambda beat: beat.base_mode & ARMED)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=2.0 * AUTO_DISARM)
        assert math.isclose(now() - began, AUTO_DISARM, abs_tol=1.5)


async def test_takeoff_with_a_place_elsewhere_reports_that_it_is_ignored() -> None:
    async with world() as w:
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        latitude, longitude = geo.destination(*HOME[:2], 30.0, 40.0)
        ack = await w.client.command(TAKEOFF_CMD, 0, 0, 0, NAN, x=latitude, y=longitude, z=HOME[2] + 6.0)
        assert ack.result == ACCEPTED
        text = "Takeoff straight up: place 50 m away ignored"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)
        await w.at_height(6.0)
        assert math.hypot(w.drone.pose.north, w.drone.pose.east) < 0.5


async def test_takeoff_with_the_place_of_the_drone_reports_nothing() -> None:
    async with world() as w:
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        ack = await w.client.command(TAKEOFF_CMD, 0, 0, 0, NAN, x=HOME[0], y=HOME[1], z=HOME[2] + 6.0)
        assert ack.result == ACCEPTED
        await w.at_height(6.0)
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "straight up" in m.text] == []


@pytest.mark.parametrize(
    ("flavour", "command", "words"),
    [
        ("px4", dialect.MAV_CMD_NAV_LAND, "Landing"),
        ("ardupilot", dialect.MAV_CMD_NAV_LAND, "Landing"),
        ("ardupilot", dialect.MAV_CMD_NAV_LOITER_UNLIM, "Loiter"),
    ],
)
async def test_landing_or_loiter_with_a_place_elsewhere_reports_that_it_is_ignored(
    flavour: str, command: int, words: str
) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(6.0)
        near, far = geo.destination(*HOME[:2], 3.0, 4.0), geo.destination(*HOME[:2], 30.0, 40.0)
        mark = w.client.mark()
        for place in (near, far):
            assert (await w.client.command(command, frame=6, x=place[0], y=place[1], z=0.0)).result == ACCEPTED
        ignored = f"{words} here: place 50 m away ignored"
        await w.client.wait("STATUSTEXT", lambda m: m.text == ignored, since=mark)
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "ignored" in m.text] == [ignored]


async def test_mode_during_the_climb_is_takeoff() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=8.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("moveBy"), 20.0)
        await watched(1.0)
        assert (await w.client.heartbeat(lambda beat: True)).custom_mode == TAKEOFF_MODE
        await w.at_height(8.0)


async def test_mode_after_a_takeoff_that_waited_for_arming_is_hold() -> None:
    """As after one of an armed vehicle: Position, chosen on the ground, is shown until the drone takes off."""
    async with world(speed=1.0) as w:
        position = dialect.MAV_CMD_DO_SET_MODE, 1, 3, 0
        assert (await w.client.command(*position)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        assert (await w.client.heartbeat(lambda beat: True, since=w.client.mark())).custom_mode == MODES["px4"].position
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.at_height(5.0)
