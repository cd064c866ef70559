"""Where two features meet: what one client began, and what another one's command, or the drone, makes of it.

Judged by the commands that the simulated drone received and by where it flew.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    FAILED,
    IN_PROGRESS,
    REJECTED,
    another_controller,
    goto,
    results,
    watched,
)
from support.mav import NAN
from support.missions import put, way
from support.params import write
from support.plans import ACCEPTED as TAKEN
from support.plans import FENCE, circle, upload
from support.setpoints import POSITION_ONLY, VELOCITY_ONLY, attitude, engage, heard, local, said, streaming, texts
from support.world import HOLD, HOME, OFFBOARD, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.services.commands import RESEND_WINDOW
from anafi_mav.sim.world.faults import Impairment

ARM, TAKEOFF, LAND = dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_NAV_TAKEOFF, dialect.MAV_CMD_NAV_LAND
GOTO, SET_MODE, PAUSE = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_DO_PAUSE_CONTINUE
RTL = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
NORTH = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))


async def flies_nowhere(w: World, seconds: float = 3.0) -> None:
    where = w.drone.pose.north
    await watched(seconds)
    assert abs(w.drone.pose.north - where) < 1.0
    assert w.drone.pose.ground_speed < 0.5


async def test_pause_that_replaces_a_pause_blocks_setpoints() -> None:
    """Two stations press Pause at a goto, the answer to the first is on its way: a program that begins is ignored."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        program = await w.connect(sysid=240)
        await w.take_off(10.0)
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 15.0)
        w.drone.faults.down = Impairment(delay=0.4)
        w.drone.faults.up = Impairment(delay=0.4)
        mark = w.clients[1].mark()
        w.client.send_command(PAUSE, 0)
        await asyncio.sleep(0.2)
        w.clients[1].send_command(GOTO, -1, 0, 0, NAN)
        await asyncio.sleep(0.1)
        async with streaming(program, NORTH):
            ack = await w.clients[1].wait(
                "COMMAND_ACK", lambda m: m.command == GOTO and m.result != IN_PROGRESS, since=mark
            )
            assert ack.result == ACCEPTED
            await w.drone.wait_log(lambda e: w.drone.pose.ground_speed < 0.3, 15.0)
            await flies_nowhere(w)


async def test_pause_during_the_takeoff_command_holds_against_setpoints() -> None:
    """TakeOff has left and is not confirmed: the drone may rise to 1 m, and hovers there."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w, streaming(w.clients[1], NORTH):
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.down = Impairment(delay=0.4)
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=5.0)
        await w.drone.wait_log(lambda e: e.name.endswith(".TakeOff"), 5.0)
        assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
        w.drone.faults.down = Impairment()
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0)
        await flies_nowhere(w)


async def test_land_just_before_a_guided_takeoff_ends_it() -> None:
    """The program streams on, armed and in Guided: Land is as good an end of the second as Hold."""
    async with world(flavour="ardupilot", clients=2) as w:
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        async with streaming(w.client, attitude(thrust=0.7)):
            await said(w.client, "Takeoff by setpoints of system 255", mark)
            assert (await w.clients[1].command(LAND)).result == ACCEPTED
            await said(w.client, "Takeoff by setpoints cancelled", mark)
            await watched(2.5)
        assert heard(w, "TakeOff") == []


async def test_takeoff_waiting_for_arming_ends_a_session_on_ground() -> None:
    """QGroundControl sends its take-off before it arms; a program in Offboard on the ground streams a velocity."""
    async with world(clients=2) as w:
        station = w.clients[1]
        async with streaming(w.client, NORTH):
            await engage(w.client, "px4")
            assert (await station.command(TAKEOFF, x=0.0, y=0.0, z=4.0)).result == ACCEPTED
            await station.heartbeat(lambda beat: beat.custom_mode == HOLD)
            assert (await station.command(ARM, 1)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0)
            await w.at_height(4.0)
            await watched(1.5)
        assert [e for e in heard(w, "PCMD") if e.args["pitch"]] == []


async def test_ground_session_does_not_fly_after_the_pilots_takeoff() -> None:
    """The pilot at a Skycontroller takes off while a program, not armed, is in Offboard: the flight is the pilot's."""
    async with world(clients=1) as w:
        async with streaming(w.client, NORTH):
            await engage(w.client, "px4")
            mark = w.client.mark()
            another_controller(w, ardrone3.TakeOff())
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0)
            await said(w.client, "Offboard ended: takeoff by another controller", mark)
            await watched(1.5)
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        assert [e for e in heard(w, "PCMD") if e.args["pitch"]] == []


async def test_offboard_during_the_climb_replaces_a_waiting_goto() -> None:
    """The newer of two commands is flown, and the client of the older one receives CANCELLED."""
    async with world(clients=2) as w:
        program = w.clients[1]
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=6.0)).result == ACCEPTED
        mark = w.client.mark()
        place = geo.destination(*HOME[:2], 30.0, 0.0)
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
        async with streaming(program, local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            assert (await program.command(SET_MODE, 1, 6, 0)).result == ACCEPTED
            await w.client.wait("COMMAND_ACK", lambda m: (m.command, m.result) == (GOTO, CANCELLED), since=mark)
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD, timeout=15.0)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 2.0, 15.0)
        assert heard(w, "moveTo") == []


async def test_refused_goto_keeps_the_goto_waiting_for_takeoff() -> None:
    async with world(clients=2) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=6.0)).result == ACCEPTED
        mark = w.client.mark()
        near, far = (geo.destination(*HOME[:2], metres, 0.0) for metres in (10.0, 50_000.0))
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=near[0], y=near[1], z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
        assert w.drone.flying_state.name == "TAKINGOFF"
        ack = await w.clients[1].command(GOTO, -1, 1, 0, NAN, frame=6, x=far[0], y=far[1], z=8.0, timeout=20.0)
        assert ack.result in (REJECTED, DENIED)
        assert heard(w, "moveTo") == []
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 9.0, 20.0)
        assert (GOTO, ACCEPTED) in results(w.client, mark)


@pytest.mark.parametrize("kind", ["position", "attitude"])
async def test_setpoint_after_guided_velocity_has_its_own_timeout(kind: str) -> None:
    """A program that ends its velocities, sends one kind that lasts half a second, and dies."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off()
        loop = asyncio.get_running_loop()
        last = local(POSITION_ONLY, at=(300.0, 0.0, -10.0)) if kind == "position" else attitude(pitch=-0.15)
        async with streaming(w.client, NORTH):
            await watched(1.6)  # just after the watch over them was wound up
        mark = w.client.mark()
        async with streaming(w.client, last):
            pass
        died = loop.time()
        await said(w.client, "Setpoints stopped: hovering", mark)
        assert loop.time() - died < 0.8


async def test_landing_at_home_ended_elsewhere_ends_in_the_heartbeat() -> None:
    """While Return is shown, station loss and fence leave the drone alone: it has to be true."""
    async with world(speed=1.0) as w:
        w.drone.firmware.receive(
            rth.SetEndingBehavior(rth.RthEndingBehavior.LANDING), asyncio.get_running_loop().time()
        )
        await w.take_off(12.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 40.0)
        await watched(6.0)
        mark = w.client.mark()
        another_controller(w, ardrone3.TakeOff())
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 5.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark)


async def test_silence_before_takeoff_waits_half_a_second() -> None:
    """A home that is being undone takes five seconds: the motors stop before."""
    async with world(speed=1.0, clients=2) as w:
        program: Any = attitude(thrust=0.4)
        async with streaming(w.client, lambda: program):
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            await engage(w.client, "px4")
            program = attitude(thrust=0.7)
            await w.drone.wait_log(lambda e: e.name.endswith(".TakeOff"), 5.0)
            w.drone.faults.unreported = frozenset({rth.CustomLocation.NAME, rth.PreferredHomeType.NAME})
            w.clients[1].send_command(dialect.MAV_CMD_DO_SET_HOME, 0, frame=0, x=48.88, y=2.37, z=0.0)
            await w.drone.wait_log(lambda e: e.kind == "command" and e.name.startswith("rth.set"), 5.0)
        loop = asyncio.get_running_loop()
        died = loop.time()
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(".Landing"), 10.0)
        assert loop.time() - died < 1.3


@pytest.mark.parametrize("action", [3, 5], ids=["return", "land"])
async def test_hold_during_a_fence_action_replaces_the_action(action: int) -> None:
    """The fence's Landing is not confirmed when a person presses Hold: accepted, the drone hovers, nothing follows."""
    async with world(speed=1.0) as w:
        assert (await upload(w.client, [circle((HOME[0], HOME[1]), 20.0)], FENCE)).type == TAKEN
        await write(w.client, "GF_ACTION", action, 6)
        await w.take_off(10.0)
        w.drone.faults.down = w.drone.faults.up = Impairment(delay=0.3)
        mark = w.client.mark()
        another_controller(w, ardrone3.MoveBy(24.0, 0.0, 0.0, 0.0))
        await said(w.client, "too fast for", mark)
        assert (await w.client.command(SET_MODE, 1, 4, 3, timeout=8.0)).result == ACCEPTED
        w.drone.faults.down = w.drone.faults.up = Impairment()
        await watched(1.0)
        assert w.drone.flying_state.name == "HOVERING"
        assert w.drone.pose.up > 8.0


async def test_repeated_land_does_not_restart_landing_another_client_ended() -> None:
    """The acknowledgement of Land was lost, and its client's program repeats it after another client's Hold."""
    async with world(speed=1.0, clients=2) as w:
        await w.take_off(10.0)
        assert (await w.client.command(LAND)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
        assert (await w.clients[1].command(SET_MODE, 1, 4, 3)).result == ACCEPTED
        assert (await w.client.command(LAND)).result == CANCELLED
        await watched(1.0)
        assert len(heard(w, "Landing")) == 1
        await asyncio.sleep(RESEND_WINDOW)  # later it is another one
        assert (await w.client.command(LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)


async def test_repeated_land_after_another_clients_takeoff_is_executed() -> None:
    """It had nothing to do on the ground. Now it has, and a landing may not have to wait."""
    async with world(speed=1.0, clients=2) as w:
        assert (await w.client.command(LAND)).result == ACCEPTED
        assert (await w.clients[1].command(ARM, 1)).result == ACCEPTED
        assert (await w.clients[1].command(TAKEOFF, x=0.0, y=0.0, z=8.0)).result == ACCEPTED
        assert (await w.client.command(LAND)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)


async def test_emergency_while_gaz_ends_a_landing_stops_the_gaz() -> None:
    """No gaz follows the cut, and the client of the Hold receives CANCELLED."""
    async with world(speed=1.0, allow_kill=True, clients=2) as w:
        await w.take_off(10.0)
        assert (await w.client.command(LAND)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)
        w.drone.faults.down = Impairment(delay=0.5)
        mark = w.client.mark()
        w.client.send_command(SET_MODE, 1, 4, 3)
        await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["gaz"] > 0, 5.0)
        assert (await w.clients[1].command(ARM, 0, 21196)).result == ACCEPTED
        assert (SET_MODE, CANCELLED) in results(w.client, mark)
        emergency = next(e for e in w.drone.log if e.name.endswith("Emergency"))
        await watched(1.0)
        assert [e for e in heard(w, "PCMD", since=emergency.t + 0.05) if e.args["gaz"]] == []


async def silence(w: World) -> None:
    """The drone is not heard for longer than its heartbeats last, and speaks again."""
    w.drone.faults.mute = True
    await watched(3.0)
    mark, w.drone.faults.mute = w.client.mark(), False
    await w.client.heartbeat(lambda beat: True, since=mark, timeout=15.0)


async def test_link_silence_above_home_leaves_the_drone_hovering() -> None:
    async with world(speed=8.0) as w:
        await w.take_off(12.0)
        assert await goto(w, 15.0, 12.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 14.0, 20.0)
        mark = w.client.mark()
        assert (await w.client.command(RTL)).result == ACCEPTED
        while not any("Landing in 5 s" in line for line in texts(w.client, mark)):
            await w.client.wait("STATUSTEXT", timeout=30.0)
        await silence(w)
        await watched(5.0)
        assert heard(w, "Landing") == []
        assert w.drone.flying_state.name == "HOVERING"


async def test_link_silence_ends_a_goto_waiting_for_takeoff() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        mark = w.client.mark()
        place = geo.destination(*HOME[:2], 30.0, 0.0)
        w.client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
        await silence(w)
        assert (GOTO, FAILED) in results(w.client, mark)
        await watched(2.0)
        assert heard(w, "moveTo") == []


async def test_unavailable_return_leaves_the_landing_alone() -> None:
    """The drone has no GPS fix: it is not to hover and drift instead of landing."""
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        assert (await w.client.command(LAND)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
        mark, w.drone.faults.gps = w.client.mark(), False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2, since=mark)
        assert (await w.client.command(RTL)).result == REJECTED
        await watched(0.5)
        assert w.drone.flying_state.name == "LANDING"
        assert [e for e in heard(w, "PCMD") if e.args["gaz"]] == []


async def begin_goto(w: World) -> None:
    assert await goto(w, 200.0, 10.0) == ACCEPTED


async def begin_mission(w: World) -> None:
    await put(w, [way(200.0, 0.0, 10.0)])
    assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == ACCEPTED


async def begin_move_of_other_controller(w: World) -> None:
    another_controller(w, ardrone3.MoveTo(*geo.destination(*HOME[:2], 200.0, 0.0), 10.0, 0, 0.0))


@pytest.mark.parametrize("begin", [begin_goto, begin_mission, begin_move_of_other_controller])
async def test_return_begins_although_firmware_lets_it_wait_for_a_move(
    begin: Callable[[World], Awaitable[None]],
) -> None:
    """Parrot promises a return to a drone that hovers: the move to a place far away ends first, not at that place."""
    async with world(quirks=("return-waits-for-moves",), web=True) as w:
        await w.take_off(10.0)
        await begin(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 30.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.drone.wait_log(lambda e: w.drone.firmware.homing.flying, 10.0)
        assert w.drone.pose.north < 60.0
