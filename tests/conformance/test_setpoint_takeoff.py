"""Take-off by setpoints, and what waits for a take-off: judged by the commands that the simulated drone received."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller, being_tried, deaf, home_being_undone, watched
from support.flavours import both
from support.mav import NAN, Client
from support.setpoints import (
    COPTER_GUIDED,
    NO_ACCELERATION,
    NO_POSITION,
    NO_VELOCITY,
    NO_YAW,
    NO_YAW_RATE,
    POSITION_ONLY,
    VELOCITY_ONLY,
    attitude,
    heard,
    local,
    motion,
    said,
    streaming,
    texts,
)
from support.world import ARMED, HOLD, HOME, OFFBOARD, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone import events
from anafi_mav.sim.skycontroller import TAKEOFF_LAND
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk

ACCEPTED, FAILED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_FAILED
CANCELLED = 6
"""MAV_RESULT_CANCELLED, which pymavlink's stock dialect does not have."""
ARM, TAKEOFF, LAND = (
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
    dialect.MAV_CMD_NAV_TAKEOFF,
    dialect.MAV_CMD_NAV_LAND,
)
GOTO, SET_MODE = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_SET_MODE
ACCELERATION_ONLY = NO_POSITION | NO_VELOCITY | NO_YAW | NO_YAW_RATE
IDLE = local(VELOCITY_ONLY)
"""A velocity of nothing: what MAVSDK's examples stream before they engage."""


async def ready(client: Client, flavour: str, *, arm: bool = True) -> None:
    """Arm and engage, while setpoints stream."""
    if arm:
        assert (await client.command(ARM, 1)).result == ACCEPTED
    numbers = (1, 6, 0) if flavour == "px4" else (1, 4)
    assert (await client.command(SET_MODE, *numbers)).result == ACCEPTED


async def lifted(w: World) -> Any:
    return await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(".TakeOff"), 5.0)


class Program:
    """What a program sends at present."""

    def __init__(self, setpoint: Any) -> None:
        self.setpoint = setpoint

    def __call__(self) -> Any:
        return self.setpoint


@pytest.mark.parametrize(
    ("setpoint", "seen"),
    [
        (local(POSITION_ONLY, at=(8.0, 0.0, -5.0)), lambda pose: pose["north"] > 7.0 and pose["up"] > 4.5),
        (local(VELOCITY_ONLY, v=(1.0, 0.0, -1.0)), lambda pose: pose["north"] > 2.0 and pose["up"] > 3.0),
        (local(ACCELERATION_ONLY, a=(0.0, 0.0, -1.0)), lambda pose: pose["up"] > 3.0),
        (local(NO_ACCELERATION | NO_YAW | NO_YAW_RATE, at=(4.0, 0.0, -4.0)), lambda pose: pose["north"] > 3.0),
        (attitude(pitch=-0.1, thrust=0.7), lambda pose: pose["up"] > 3.0 and pose["north"] > 1.0),
    ],
    ids=["position", "velocity", "acceleration", "position and velocity", "attitude"],
)
async def test_climbing_offboard_setpoint_takes_off_and_is_flown(
    setpoint: Any, seen: Callable[[dict[str, float]], bool]
) -> None:
    """MAVSDK's examples: arm, stream something that stands still, engage on the ground, then climb."""
    async with world(clients=2) as w:
        program, mark = Program(IDLE), w.clients[1].mark()
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD)
            program.setpoint = setpoint
            await said(w.clients[1], "Takeoff by setpoints of system 255 in 1 s", mark)
            begun = asyncio.get_running_loop().time()
            assert heard(w, "TakeOff") == []
            takeoff = await lifted(w)
            assert takeoff.t - begun > 0.8
            await w.drone.wait_log(lambda e: e.kind == "pose" and seen(e.args), 15.0)
            hovering = next(e for e in w.drone.log if e.name.endswith("FlyingStateChanged") and e.args["state"] == 2)
            early = [e for e in heard(w, "PCMD", "moveTo", "moveBy") if e.t < hovering.t and any(e.args.values())]
            assert [e for e in early if not e.name.endswith("PCMD") or e.args["gaz"] or e.args["pitch"]] == []
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD and beat.base_mode & ARMED)
        await said(w.client, "Setpoints stopped: hovering")


async def test_trajectory_from_the_ground_takes_off_and_is_flown() -> None:
    """MAVSDK's offboard_from_csv: ten points a second, the first 10 cm above the ground."""
    async with world(speed=1.0) as w:
        mark, begun = w.client.mark(), asyncio.get_running_loop().time()

        def point() -> Any:
            height = min(max(asyncio.get_running_loop().time() - begun - 1.0, 0.0), 5.0)
            mask = NO_ACCELERATION | NO_YAW | NO_YAW_RATE
            return local(mask, at=(0.0, 0.0, -height), v=(0.0, 0.0, -1.0 if height else 0.0))

        async with streaming(w.client, point, every=0.1):
            await ready(w.client, "px4")
            await lifted(w)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 4.5, 15.0)
        assert " < 1.0 m" not in " ".join(texts(w.client, mark))


async def test_guided_attitude_with_thrust_takes_off() -> None:
    """dronekit's set_attitude_target example: GUIDED_NOGPS, arm, thrust."""
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(SET_MODE, 1, 20)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        async with streaming(w.client, attitude(thrust=0.7), every=0.2):
            await lifted(w)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 3.0, 15.0)
        mark = w.client.mark()
        await said(w.client, "Setpoints stopped: hovering")
        await w.client.heartbeat(lambda beat: beat.custom_mode == COPTER_GUIDED, since=mark)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(1.0, 0.0, 0.0))):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 15.0)


@both
async def test_count_before_a_setpoint_takeoff_ends_with_the_takeoff_of_another(flavour: str) -> None:
    """The pilot takes off while a program's second is counted: its silence lands nothing."""
    async with world(flavour=flavour, skycontroller=3) as w:
        mark = w.client.mark()
        async with streaming(w.client, attitude(thrust=0.7)):
            await ready(w.client, flavour)
            await said(w.client, "Takeoff by setpoints of system 255", mark)
            w.drone.skycontroller.press(TAKEOFF_LAND)
            await w.drone.wait_log(lambda e: e.kind == "state" and e.args.get("to") == "motor_ramping", 5.0)
        await said(w.client, "Takeoff by setpoints cancelled", mark)
        await w.drone.wait_log(lambda e: e.kind == "state" and e.args.get("to") == "hovering", 15.0)
        await asyncio.sleep(1.5)
        assert heard(w, "Landing") == []


@pytest.mark.parametrize(
    "setpoint",
    [local(POSITION_ONLY, at=(0.0, 0.0, -5.0)), local(VELOCITY_ONLY, v=(0.0, 0.0, -1.0)), attitude(thrust=0.5)],
    ids=["position", "velocity", "attitude that holds"],
)
async def test_guided_setpoint_on_ground_is_reported_not_flown(setpoint: Any) -> None:
    async with world(flavour="ardupilot") as w:
        await ready(w.client, "ardupilot")
        mark = w.client.mark()
        async with streaming(w.client, setpoint):
            if setpoint.get_msgId() != dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET:
                await said(w.client, "Setpoint refused: take off first", mark)
            await asyncio.sleep(1.5)
        assert heard(w, "TakeOff") == []


@both
async def test_setpoint_takeoff_needs_the_arming_of_the_same_client(flavour: str) -> None:
    """Another client arms, to look at something: no motor turns."""
    async with world(flavour=flavour, clients=2) as w, streaming(w.client, attitude(thrust=0.7)):
        await ready(w.client, flavour, arm=False)
        assert (await w.clients[1].command(ARM, 1)).result == ACCEPTED
        await said(w.client, "Setpoint refused: this client has not armed", 0)
        await asyncio.sleep(1.5)
        assert heard(w, "TakeOff") == []


@both
async def test_setpoint_takeoff_needs_the_mode_of_the_same_client(flavour: str) -> None:
    """A ground station chooses the mode while an armed program streams a climb: nothing takes off."""
    async with world(flavour=flavour, clients=2) as w, streaming(w.client, attitude(thrust=0.7)):
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await ready(w.clients[1], flavour, arm=False)
        await asyncio.sleep(1.5)
        assert heard(w, "TakeOff") == []


@both
@pytest.mark.parametrize("how", ["disarm", "hold", "no climb", "gap"])
async def test_second_before_a_setpoint_takeoff_can_be_ended(flavour: str, how: str) -> None:
    """By any client's disarm or Hold, by one setpoint that does not climb, by a gap: no motor turns."""
    async with world(flavour=flavour, clients=2) as w:
        program, mark = Program(attitude(thrust=0.4)), w.client.mark()
        stop = (1, 4, 3) if flavour == "px4" else (1, 17)
        async with streaming(w.client, program):
            await ready(w.client, flavour)
            program.setpoint = attitude(thrust=0.7)
            await said(w.client, "Takeoff by setpoints of system 255", mark)
            if how == "disarm":
                assert (await w.clients[1].command(ARM, 0)).result == ACCEPTED
            elif how == "hold":
                assert (await w.clients[1].command(SET_MODE, *stop)).result == ACCEPTED
            elif how == "no climb":
                program.setpoint = attitude(thrust=0.5)
            if how != "gap":
                await said(w.client, "Takeoff by setpoints cancelled", mark)
                await asyncio.sleep(1.3)
        if how == "gap":
            await said(w.client, "Setpoints stopped on the ground: disarming", mark)
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark)
            await asyncio.sleep(1.3)
        assert heard(w, "TakeOff") == []


@both
async def test_silence_before_a_setpoint_takeoff_counts_per_client(flavour: str) -> None:
    """Another program streams on: the drone is disarmed all the same."""
    async with world(flavour=flavour, clients=2) as w, streaming(w.clients[1], IDLE):
        mark = w.client.mark()
        async with streaming(w.client, attitude(thrust=0.7)):
            await ready(w.client, flavour)
            await said(w.client, "Takeoff by setpoints of system 255", mark)
        await said(w.client, "Setpoints stopped on the ground: disarming", mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark)
        assert heard(w, "TakeOff") == []


@pytest.mark.parametrize("moment", ["motor ramping", "motor ramping, landing ignored", "taking off"])
async def test_silence_in_setpoint_takeoff_disarms_on_ground_hovers_airborne(moment: str) -> None:
    async with world(speed=1.0) as w:
        if "ignored" in moment:
            w.drone.faults.quirks = frozenset({Quirk.RAMPING_IGNORES_LANDING})
        program, mark = Program(IDLE), w.client.mark()
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            program.setpoint = attitude(thrust=0.7)
            await lifted(w)
            if moment == "taking off":
                await w.drone.wait_log(lambda e: e.name.endswith("FlyingStateChanged") and e.args["state"] == 1, 5.0)
        if moment != "taking off":
            await said(w.client, "Setpoints stopped on the ground: disarming", mark)
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=15.0)
            assert w.drone.flying_state.name == "LANDED"
            return
        await said(w.client, "Setpoints stopped: hovering", mark)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD and beat.base_mode & ARMED, timeout=10.0)
        assert heard(w, "Landing") == []
        assert w.drone.pose.up == pytest.approx(1.0, abs=0.5)


async def test_after_a_landing_setpoints_need_another_arming() -> None:
    async with world() as w:
        program = Program(IDLE)
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            program.setpoint = attitude(thrust=0.7)
            await lifted(w)
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD and beat.base_mode & ARMED)
            await w.drone.wait_log(lambda e: e.name.endswith("FlyingStateChanged") and e.args["state"] == 3, 10.0)
            assert (await w.client.command(LAND)).result == ACCEPTED
            await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=15.0)
            await ready(w.client, "px4", arm=False)
            await said(w.client, "Setpoint refused: this client has not armed", 0)
            await asyncio.sleep(1.5)
            assert len(heard(w, "TakeOff")) == 1


async def test_prearm_problem_keeps_setpoints_on_the_ground() -> None:
    async with world() as w:
        program, mark = Program(IDLE), w.client.mark()
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            w.drone.faults.magneto_required = True
            await said(w.client, "Magnetometer calibration required", mark)
            program.setpoint = attitude(thrust=0.7)
            await said(w.client, "Setpoint refused: magneto calibration", mark)
            await asyncio.sleep(1.3)
        assert [text for text in texts(w.client, mark) if text.startswith("Takeoff by setpoints")] == []
        assert heard(w, "TakeOff") == []


async def test_setpoints_do_not_take_off_a_vehicle_that_is_disarmed_meanwhile() -> None:
    """Their second is over, but a home is still being undone when the armed state expires."""
    async with world(speed=1.0) as w:
        program = Program(IDLE)
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            await asyncio.sleep(7.0)  # 3 s before the armed state expires
            await home_being_undone(w)
            program.setpoint = attitude(thrust=0.7)
            await said(w.client, "Disarmed: no takeoff", 0)
            await asyncio.sleep(6.0)  # the home is undone within this time
        assert heard(w, "TakeOff") == []


async def test_climbing_setpoints_do_not_replace_a_takeoff_that_the_drone_has_not_received() -> None:
    async with world(speed=1.0, flavour="ardupilot") as w:
        await ready(w.client, "ardupilot")
        mark = w.client.mark()
        deaf(w, 2.5)
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=5.0)
        await being_tried(w.client, mark, TAKEOFF)
        async with streaming(w.client, attitude(thrust=0.7)):
            await said(w.client, "Setpoint refused: drone is about to take off", mark)
            await watched(1.5)
        await w.at_height(5.0)
        assert [text for text in texts(w.client, mark) if text.startswith("Takeoff by setpoints")] == []
        assert len(heard(w, "TakeOff")) == 1


async def test_setpoints_do_not_fly_the_takeoff_of_another_controller_that_precedes_theirs() -> None:
    """Their second is over, but a home is still being undone when the drone leaves the ground."""
    async with world(speed=4.0) as w:
        program, mark = Program(IDLE), w.client.mark()
        async with streaming(w.client, program):
            await ready(w.client, "px4")
            await home_being_undone(w)
            program.setpoint = attitude(pitch=-0.1, thrust=0.7)
            await said(w.client, "Takeoff by setpoints of system 255", mark)
            await watched(1.3)
            another_controller(w, ardrone3.TakeOff())
            await said(w.client, "Takeoff by setpoints failed", mark)
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 10.0)
            began = asyncio.get_running_loop().time()
            await watched(3.0)
        assert motion(w, began) == []
        assert w.drone.pose.up == pytest.approx(1.0, abs=0.2)


# What waits for an accepted take-off.


def place(north: float) -> dict[str, float]:
    latitude, longitude = geo.destination(*HOME[:2], north, 0.0)
    return {"x": latitude, "y": longitude}


async def rising(w: World, height: float = 6.0) -> None:
    """A take-off is accepted, and the drone has hardly left the ground."""
    if w.flavour == "ardupilot":
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
    assert (await w.client.command(ARM, 1)).result == ACCEPTED
    assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=height)).result == ACCEPTED


@both
async def test_goto_during_takeoff_waits_for_the_climb(flavour: str) -> None:
    """MAVSDK's goto example: IN_PROGRESS at once, the climb to its height first, then the goto."""
    async with world(flavour=flavour) as w:
        await rising(w)
        mark = w.client.mark()
        ack = await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, **place(12.0), z=8.0, timeout=20.0)
        assert ack.result == ACCEPTED
        results = [m.result for _, m in w.client.since(mark, "COMMAND_ACK") if m.command == GOTO]
        assert results[0] == dialect.MAV_RESULT_IN_PROGRESS
        (climb,) = heard(w, "moveBy")
        end = next(e for e in w.drone.log if e.name.endswith("moveByEnd"))
        (goto,) = heard(w, "moveTo")
        assert climb.t < end.t < goto.t
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 11.0, 20.0)


async def starting(w: World, height: float) -> None:
    """The motors start: the drone has not confirmed that it takes off."""
    if w.flavour == "ardupilot":
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
    assert (await w.client.command(ARM, 1)).result == ACCEPTED
    w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=height)
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)


async def climbing(w: World, height: float) -> None:
    """The climb that follows the drone's own take-off has begun."""
    await rising(w, height)
    await w.drone.wait_log(lambda e: e.name.endswith("moveBy"), 20.0)


TURN, ROI, ORBIT = dialect.MAV_CMD_CONDITION_YAW, dialect.MAV_CMD_DO_SET_ROI_LOCATION, dialect.MAV_CMD_DO_ORBIT


async def turned(w: World) -> None:
    ack = await w.client.command(TURN, 90.0, 0.0, 0.0, 0.0, timeout=20.0)
    assert ack.result == ACCEPTED
    assert math.degrees(w.drone.pose.yaw) == pytest.approx(90.0, abs=3.0)


async def looked(w: World) -> None:
    assert (await w.client.command(ROI, frame=6, **place(20.0), z=0.0, timeout=20.0)).result == ACCEPTED


async def looked_by_mount(w: World) -> None:
    """The mount protocol's way to a place (MAVProxy, Mission Planner)."""
    gps = dialect.MAV_MOUNT_MODE_GPS_POINT
    ack = await w.client.command(dialect.MAV_CMD_DO_MOUNT_CONTROL, frame=6, **place(20.0), z=gps, timeout=20.0)
    assert ack.result == ACCEPTED


async def gone(w: World) -> None:
    assert (await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, **place(12.0), z=9.0, timeout=20.0)).result == ACCEPTED


async def orbited(w: World) -> None:
    ack = await w.client.command(ORBIT, 8.0, 2.0, x=NAN, y=NAN, z=NAN, timeout=20.0)
    assert ack.result == ACCEPTED


@both
@pytest.mark.parametrize("follow", [turned, looked, looked_by_mount, orbited, gone])
@pytest.mark.parametrize("begin", [starting, rising, climbing])
async def test_command_during_a_takeoff_waits_for_the_climb(
    flavour: str, begin: Callable[[World, float], Any], follow: Callable[[World], Any]
) -> None:
    """The climb goes on to its height; what was commanded meanwhile is done then, and accepted only then."""
    async with world(flavour=flavour) as w:
        await begin(w, 9.0)
        await follow(w)
        assert w.drone.pose.up == pytest.approx(9.0, abs=0.5)
        end = next(e for e in w.drone.log if e.name.endswith("moveByEnd"))
        assert end.args["error"] == 0
        later = [e for e in heard(w, "moveBy", "moveTo", "extended_move_to", "StartPilotedPOIV2") if e.t > end.t]
        assert later or follow is orbited


@pytest.mark.parametrize("begin", [starting, rising, climbing])
async def test_guided_chosen_again_during_a_takeoff_keeps_the_climb(begin: Callable[[World, float], Any]) -> None:
    """As in ArduCopter, where the present mode chosen again changes nothing; setpoints of its client fly after it."""
    async with world(flavour="ardupilot", clients=2) as w:
        await begin(w, 9.0)
        mark = w.client.mark()
        assert (await w.clients[1].command(SET_MODE, 1, COPTER_GUIDED)).result == ACCEPTED
        await w.at_height(9.0)
        assert not [text for text in texts(w.client, mark) if "Climb" in text]
        async with streaming(w.clients[1], local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 20.0)


@pytest.mark.parametrize("stop", [(SET_MODE, 1, 4, 3), (dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)])
async def test_climb_that_a_command_ends_is_reported_with_its_height(stop: tuple[int, ...]) -> None:
    """The take-off was accepted long before: its client reads that the drone is lower than it was commanded to."""
    async with world() as w:
        await climbing(w, 30.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 3.0, 20.0)
        mark = w.client.mark()
        assert (await w.client.command(*stop)).result == ACCEPTED
        await said(w.client, "Climb to 30 m ended at ", mark)


async def test_goto_after_hold_during_takeoff_awaits_first_hover() -> None:
    """MAVSDK's goto_location changes to Hold before it sends the target, in this example 1 s after the take-off."""
    async with world(speed=1.0) as w:
        await rising(w)
        assert w.drone.flying_state.name == "TAKINGOFF"
        assert (await w.client.command(SET_MODE, 1, 4, 3)).result == ACCEPTED
        mark = w.client.mark()
        ack = await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, **place(12.0), z=8.0, timeout=20.0)
        assert ack.result == ACCEPTED
        assert w.client.since(mark, "COMMAND_ACK")[0][1].result == dialect.MAV_RESULT_IN_PROGRESS
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 8.0, 20.0)


async def test_of_two_gotos_during_takeoff_the_newest_is_flown() -> None:
    async with world(clients=2) as w:
        await rising(w)
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, **place(30.0), z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO)
        mark = w.client.mark()
        ack = await w.clients[1].command(GOTO, -1, 1, 0, NAN, frame=6, **place(6.0), z=8.0, timeout=20.0)
        assert ack.result == ACCEPTED
        await w.client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (GOTO, CANCELLED), since=mark)
        assert len(heard(w, "moveTo")) == 1


@pytest.mark.parametrize("how", ["hold", "land"])
async def test_goto_waiting_for_takeoff_is_cancelled(how: str) -> None:
    async with world(clients=2) as w:
        await rising(w, 9.0)
        await w.drone.wait_log(lambda e: e.name.endswith("FlyingStateChanged") and e.args["state"] in (2, 3), 10.0)
        mark = w.client.mark()
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, **place(30.0), z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
        other = w.clients[1]
        ack = await (other.command(SET_MODE, 1, 4, 3) if how == "hold" else other.command(LAND))
        assert ack.result == ACCEPTED
        await w.client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (GOTO, CANCELLED), since=mark)
        assert heard(w, "moveTo") == []


async def test_goto_waiting_for_takeoff_fails_with_it() -> None:
    """The drone lands by itself in the climb: the goto is answered, and not flown later."""
    async with world() as w:
        await rising(w, 20.0)
        mark = w.client.mark()
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, **place(30.0), z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
        w.drone.faults.battery = 1
        ack = await w.client.wait(
            "COMMAND_ACK",
            lambda m: m.command == GOTO and m.result != dialect.MAV_RESULT_IN_PROGRESS,
            since=mark,
            timeout=30.0,
        )
        assert ack.result == FAILED
        assert heard(w, "moveTo") == []


async def test_offboard_during_takeoff_is_accepted_and_flown_after_climb() -> None:
    async with world() as w:
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await rising(w)
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == ACCEPTED
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD, timeout=15.0)
            end = next(e for e in w.drone.log if e.name.endswith("moveByEnd"))
            moved = [e for e in heard(w, "PCMD") if e.args["pitch"] > 0]
            assert all(e.t > end.t for e in moved)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 10.0)
        assert w.drone.pose.up == pytest.approx(6.0, abs=0.5)


async def test_offboard_silent_during_takeoff_leaves_the_climb_alone() -> None:
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await rising(w, 4.0)
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == ACCEPTED
        await said(w.client, "Setpoints stopped: takeoff continues", mark)
        await w.at_height(4.0)
        assert [e for e in heard(w, "PCMD") if e.args["pitch"]] == []


async def test_offboard_silent_during_the_climb_leaves_it_alone() -> None:
    """The move to the height is the take-off's: no hover of the setpoints ends it."""
    async with world(speed=1.0) as w:
        await climbing(w, 9.0)
        mark = w.client.mark()
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == ACCEPTED
        await said(w.client, "Setpoints stopped: takeoff continues", mark)
        await w.at_height(9.0)
        assert len(heard(w, "moveBy")) == 1


async def test_guided_stream_during_takeoff_flies_after_climb_without_warning() -> None:
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        await rising(w)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 20.0)
        end = next(e for e in w.drone.log if e.name.endswith("moveByEnd"))
        assert all(e.t > end.t for e in heard(w, "PCMD") if e.args["pitch"] > 0)
        assert "Setpoint refused" not in " ".join(texts(w.client, mark))


@both
async def test_setpoint_takeoff_on_bad_link_with_other_client_arming(flavour: str) -> None:
    """200 ms and 25 % loss to the drone: nothing takes off for the client that did not arm, and then once."""
    async with world(speed=1.0, flavour=flavour, clients=2) as w:
        w.drone.faults.up = w.drone.faults.down = Impairment(loss=0.25, delay=0.2)
        async with streaming(w.client, attitude(thrust=0.7)):
            await ready(w.client, flavour, arm=False)
            assert (await w.clients[1].command(ARM, 1)).result == ACCEPTED
            await said(w.client, "Setpoint refused: this client has not armed", 0)
            await asyncio.sleep(1.5)
            assert heard(w, "TakeOff") == []
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 3.0, 30.0)
        w.drone.faults.up = w.drone.faults.down = Impairment()
        assert len(heard(w, "TakeOff")) == 1


async def test_motion_of_a_drone_with_its_motors_off_is_read_when_it_is_needed() -> None:
    async with world() as w:
        (system,) = w.gateway.systems
        for heading in (1.0, -2.0):
            w.drone.place(0.0, 0.0, heading)
            await system.drone.expect(
                events.AttitudeChanged, lambda message, yaw=heading: math.isclose(message.yaw, yaw, abs_tol=1e-3)
            )
            assert system.vehicle.offboard.motion.yaw == pytest.approx(heading, abs=1e-3)
