"""One flight task flies the drone, whatever arrives in the same event-loop iteration."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from support.fault_scenarios import ACCEPTED, ARM, PX4_OFFBOARD, SET_MODE, TAKEOFF_CMD, goto, watched
from support.setpoints import COPTER_GUIDED, POSITION_ONLY, VELOCITY_ONLY, earth, heard, local, streaming
from support.world import HOLD, HOME, world

from anafi_mav.arsdk.messages import rth
from anafi_mav.errors import CommandRejected

UP = 8.0
NORTH = earth(POSITION_ONLY, 6, 20.0, 0.0, UP)
"""A single position: 20 m north of the drone."""
EAST = local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))


@pytest.mark.parametrize("together", [False, True], ids=["later", "same iteration"])
async def test_newer_velocity_of_another_client_replaces_single_goto(together: bool) -> None:
    """The goto is flown to its end or not at all: never as a stream that is cut off by silence."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(UP)
        assert await goto(w, 0.0, UP) == ACCEPTED
        first, second = w.clients
        began = asyncio.get_running_loop().time()
        first.send(NORTH)
        if not together:
            await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("moveTo"), 5.0, since=began)
        second.send(EAST)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["ve"] > 1.0, 10.0, since=began)
        stops = asyncio.get_running_loop().time()
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["ve"]) < 0.05, 10.0, since=stops)
        assert w.drone.pose.east > 1.0
        assert abs(w.drone.pose.north) < 2.0
        mark = first.mark()
        assert (await first.heartbeat(lambda beat: True, since=mark)).custom_mode == COPTER_GUIDED


async def test_offboard_during_the_motor_ramp_follows_the_takeoff() -> None:
    """QGroundControl's sequence: the take-off waits for arming; the mode is chosen before the drone has lifted off."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 6.0, 30.0)


@pytest.mark.parametrize("late", [0.0, 1.0], ids=["in time", "late"])
async def test_action_that_ignores_its_end_sends_nothing_that_collides_with_a_hold(late: float) -> None:
    """In the wait of a Hold it may stop what it has begun; after that wait it sends nothing at all."""
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        vehicle, refused, begun = w.gateway.systems[0].vehicle, [], asyncio.Event()

        async def stubborn() -> None:
            begun.set()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(60.0)
            await asyncio.sleep(late)
            move, stop = vehicle.drone.piloting.move_to, vehicle.drone.calibration.abort_magnetometer
            for verb in (move(HOME[0] + 0.001, HOME[1], UP), *([stop()] if late else [])):
                with pytest.raises(CommandRejected):
                    await verb
                refused.append(verb)

        action = vehicle.control.run(None, stubborn())
        await begun.wait()
        began = asyncio.get_running_loop().time()
        assert (await w.client.command(SET_MODE, 1, 4, 3)).result == ACCEPTED
        await asyncio.wait({action})
        assert len(refused) == (2 if late else 1)
        assert heard(w, "moveTo", since=began) == heard(w, "MagnetoCalibration", since=began) == []


async def test_action_of_the_flight_core_ends_with_the_link() -> None:
    """It waits for no answer of the drone, whose loss would end it."""
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        action = w.gateway.systems[0].vehicle.control.run(None, asyncio.sleep(60.0))
        w.drone.faults.mute = True
        await asyncio.wait({action}, timeout=10.0)
        assert action.cancelled()


async def test_takeoff_that_waited_for_arming_ends_in_hold_whatever_mode_was_chosen_before() -> None:
    """As one that follows the arming: no joystick on the table has the drone then."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(SET_MODE, 1, 3, 0)).result == ACCEPTED  # Position
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 4.8, 30.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=w.client.mark())


async def test_return_that_begins_during_the_lift_is_not_disturbed_by_the_climb() -> None:
    """Another controller's: the drone reports it before it reports that it takes off."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=10.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        w.drone.inject(rth.State(rth.RthState.IN_PROGRESS, rth.StateReason.USER_REQUEST))
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Climb"), since=mark, timeout=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0)
        await asyncio.sleep(1.0)  # in which the climb would begin
        assert heard(w, "moveBy") == []


async def test_return_that_begins_during_the_lift_is_not_disturbed_by_setpoints() -> None:
    """Offboard was chosen in the lift and follows the take-off: its setpoints would end the return."""
    async with world(speed=1.0) as w, streaming(w.client, EAST):
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=10.0)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        w.drone.inject(rth.State(rth.RthState.IN_PROGRESS, rth.StateReason.USER_REQUEST))
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Climb"), since=mark, timeout=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0)
        await watched(2.0)
        assert heard(w, "PCMD", "moveBy", "CancelMoveTo", "abort") == []
