"""ANF_SC_OFFBOARD: the explicit switch between the Skycontroller's pilot and programs, seen by every client."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, REJECTED, Impairment, goto, watched
from support.flavours import both
from support.mav import Client
from support.missions import put, takeoff, way
from support.params import fetch, read, send_set, value_of, write
from support.setpoints import VELOCITY_ONLY, attitude, heard, local, motion, said, streaming, texts
from support.world import HOLD, World, world

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.drone.controller.controller import LOOK_EVERY, PILOT_KEEPS, QUIET_LOOKS

SWITCH = "ANF_SC_OFFBOARD"
PILOT, PROGRAM, AUTOMATIC = range(3)
PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

TAKEOFF_LAND = 1
"""Its button."""

REFUSED = "pilot flies, ANF_SC_OFFBOARD 0"
SET_MODE, ARM, TAKEOFF = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_NAV_TAKEOFF
PAUSE, LAND, RETURN = dialect.MAV_CMD_DO_PAUSE_CONTINUE, dialect.MAV_CMD_NAV_LAND, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
INT32 = dialect.MAV_PARAM_TYPE_INT32


def now() -> float:
    return asyncio.get_running_loop().time()


def skycontroller(w: World) -> Any:
    assert w.drone.skycontroller is not None
    return w.drone.skycontroller


async def switch(w: World, value: int, client: Client | None = None) -> None:
    """Set the switch; it is confirmed."""
    answer = await write(client or w.client, SWITCH, value, INT32, w.flavour)
    assert value_of(answer, w.flavour) == value


async def shown(client: Client, value: int, mark: int) -> None:
    """Wait until a client has received this value of the switch."""
    await client.wait("PARAM_VALUE", lambda m: m.param_id == SWITCH and value_of(m) == value, since=mark)


async def source_is(w: World, source: Source) -> None:
    pilot = skycontroller(w)
    if pilot.source is not source:
        await w.drone.wait_log(lambda entry: pilot.source is source, 20.0)


async def refused(w: World, command: int, *params: float, **place: float) -> None:
    """A command is refused with the reason of the switch."""
    mark = w.client.mark()
    ack = await w.client.command(command, *params, **place)
    assert ack.result == REJECTED
    await said(w.client, REFUSED, mark)


async def test_flight_commands_are_refused_while_pilot_has_aircraft() -> None:
    """Stops, a landing and a return are not."""
    async with world(skycontroller=3) as w:
        await switch(w, PILOT)
        await refused(w, TAKEOFF, x=0.0, y=0.0, z=5.0)
        await switch(w, AUTOMATIC)
        await w.take_off(8.0)
        await switch(w, PILOT)
        mark, began = w.client.mark(), now()
        assert await goto(w, 30.0, 8.0) == REJECTED
        await said(w.client, f"Goto refused: {REFUSED}", mark)
        await refused(w, dialect.MAV_CMD_DO_ORBIT, 10.0, 2.0, 0.0, 0.0)
        await refused(w, dialect.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0)
        await refused(w, dialect.MAV_CMD_DO_SET_ROI_LOCATION, x=48.8790, y=2.3680, z=35.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            await refused(w, SET_MODE, 1, 6, 0)
        assert motion(w, began) == []
        assert skycontroller(w).source is Source.SKY_CONTROLLER
        for stop in ((SET_MODE, 1, 4, 3), (PAUSE, 0), (RETURN,), (SET_MODE, 1, 4, 3), (LAND,)):
            assert (await w.client.command(*stop)).result == ACCEPTED


@both
async def test_streams_are_not_flown_while_pilot_has_aircraft(flavour: str) -> None:
    async with world(skycontroller=4, flavour=flavour) as w:
        await w.take_off(8.0)
        number = (1, 3, 0) if flavour == "px4" else (1, 5)
        assert (await w.client.command(SET_MODE, *number)).result == ACCEPTED
        await switch(w, PILOT)
        began = now()
        stick = dialect.MAVLink_manual_control_message(1, 600, 0, 500, 0, 0)
        async with streaming(w.client, stick, 0.1):
            await said(w.client, f"Sticks ignored: {REFUSED}")
        if flavour == "ardupilot":
            assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
            async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0)), 0.2):
                await said(w.client, f"Setpoint refused: {REFUSED}")
        assert motion(w, began) == []


async def test_goto_ends_when_aircraft_is_given_to_the_pilot() -> None:
    """Every client sees it, and the pilot's sticks fly at once."""
    async with world(speed=1.0, skycontroller=3) as w:
        other = await w.connect(sysid=250)
        await w.take_off(8.0)
        assert await goto(w, 80.0, 8.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        mark, north = w.client.mark(), w.drone.pose.north
        await switch(w, PILOT, other)  # confirmed once the Skycontroller has both
        assert skycontroller(w).source is Source.SKY_CONTROLLER
        await shown(w.client, PILOT, mark)
        await said(w.client, f"Goto ended: {REFUSED}", mark)
        for client in (w.client, other):
            await said(client, "Aircraft: pilot only")
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        await asyncio.sleep(2.0)
        assert w.drone.pose.vn == pytest.approx(0.0, abs=0.2)
        assert w.drone.pose.north < north + 20.0
        skycontroller(w).stick(PITCH_STICK, 60)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 10.0)


async def test_landing_goes_on_when_aircraft_is_given_to_the_pilot() -> None:
    async with world(skycontroller=3) as w:
        await w.take_off(8.0)
        assert (await w.client.command(LAND)).result == ACCEPTED
        await switch(w, PILOT)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)


@pytest.mark.parametrize("kind", ["command", "hand launch", "mission"])
async def test_start_of_motors_ends_when_pilot_gets_aircraft(kind: str) -> None:
    """It is only pending then: the motors stop, and nothing lifts the drone off later."""
    async with world(speed=1.0, skycontroller=3, web=True) as w:
        client = w.client
        if kind == "hand launch":
            await write(client, "ANF_HAND_LAUNCH", 1, INT32, w.flavour)
        else:
            assert (await client.command(ARM, 1)).result == ACCEPTED
        if kind == "mission":
            await put(w, [takeoff(6.0), way(40.0, 0.0, 6.0)])
            assert (await client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        began = now()
        if kind == "command":
            client.send_command(TAKEOFF, x=0.0, y=0.0, z=15.0)
        else:
            client.send_command(
                ARM if kind == "hand launch" else dialect.MAV_CMD_MISSION_START, float(kind != "mission")
            )
        await w.drone.wait_log(lambda e: e.t >= began and e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        await switch(w, PILOT)
        await asyncio.sleep(5.0)
        assert w.drone.pose.up == pytest.approx(0.0, abs=0.01)
        assert [e.args["to"] for e in w.drone.log if e.t >= began and e.name == "flying"][-1] == "landed"
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_takeoff_by_setpoints_ends_when_pilot_gets_aircraft() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        async with streaming(w.client, local(VELOCITY_ONLY, v=(0.0, 0.0, -1.0))):
            await asyncio.sleep(0.3)
            assert (await w.client.command(SET_MODE, 1, 6, 0)).result == ACCEPTED
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("TakeOff"), 10.0)
            await switch(w, PILOT)
            await asyncio.sleep(5.0)
        assert w.drone.pose.up == pytest.approx(0.0, abs=0.01)


async def test_climbing_setpoint_on_the_ground_is_refused_while_pilot_has_aircraft() -> None:
    """At once: no client is warned of a take-off that is not going to be."""
    async with world(speed=1.0, skycontroller=3, flavour="ardupilot") as w:
        await switch(w, PILOT)
        assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        async with streaming(w.client, attitude(thrust=0.7)):
            await said(w.client, f"Setpoint refused: {REFUSED}", mark)
            await watched(1.5)
        assert [text for text in texts(w.client, mark) if text.startswith("Takeoff by setpoints")] == []
        assert heard(w, "TakeOff") == []


async def test_drone_that_rises_does_not_climb_for_program() -> None:
    """The pilot gets it at the drone's own first hover."""
    async with world(speed=1.0, skycontroller=3) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=15.0)).result == ACCEPTED
        began = now()
        await switch(w, PILOT)
        await asyncio.sleep(6.0)
        assert motion(w, began) == []
        assert w.drone.pose.up == pytest.approx(1.0, abs=0.2)
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_pilots_stick_during_a_takeoff_leaves_the_drone_at_its_first_hover() -> None:
    """The stick sets the switch to Pilot without ending the take-off: the climb is refused when it is due."""
    async with world(speed=1.0, skycontroller=3) as w:
        await switch(w, PROGRAM)
        w.simulator.speed = 0.5  # the climb is due when the pilot's two seconds are over
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        mark, began = w.client.mark(), now()
        skycontroller(w).stick(PITCH_STICK, 40)
        await shown(w.client, PILOT, mark)
        skycontroller(w).stick(PITCH_STICK, 0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
        await asyncio.sleep(8.0)
        assert now() - began > PILOT_KEEPS + 1.0
        assert heard(w, "moveBy") == []
        assert w.drone.pose.up == pytest.approx(1.0, abs=0.2)
        assert skycontroller(w).source is Source.SKY_CONTROLLER


@pytest.mark.parametrize("state", ["motor_ramping", "takingoff"])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_pilots_stick_during_a_takeoff_ends_its_climb(flavour: str, state: str) -> None:
    """The axes are grabbed with the take-off: no motion of ours has preceded the stick, which rests again at once."""
    async with world(speed=1.0, skycontroller=3, flavour=flavour) as w:
        if flavour == "ardupilot":
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == state, 10.0)
        skycontroller(w).stick(PITCH_STICK, 40)
        await said(w.client, "Skycontroller pilot has control: stick moved", mark)
        skycontroller(w).stick(PITCH_STICK, 0)
        await said(w.client, "Climb to 15 m aborted: Skycontroller pilot", mark)
        await asyncio.sleep(5.0)
        assert heard(w, "moveBy") == []
        assert w.drone.pose.up == pytest.approx(1.0, abs=0.2)
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_pilots_stick_is_seen_in_a_takeoff_that_is_reported_late() -> None:
    """The axes stay grabbed until the drone answers, or the pilot's stick would be seen by the drone alone."""
    async with world(speed=1.0, skycontroller=3) as w:
        w.drone.faults.late = {ardrone3.FlyingStateChanged.NAME: 0.8}
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "motor_ramping", 10.0)
        await watched(0.6)
        skycontroller(w).stick(PITCH_STICK, 40)
        await said(w.client, "Skycontroller pilot has control: stick moved", mark)
        skycontroller(w).stick(PITCH_STICK, 0)
        await watched(8.0)
        assert heard(w, "moveBy") == []


async def test_takeoff_that_waits_for_arming_ends_with_the_pilots_stick() -> None:
    """The client arms afterwards: the policy is asked again before the drone lifts off."""
    async with world(speed=1.0, skycontroller=3) as w:
        await switch(w, PROGRAM)
        assert (await w.client.command(TAKEOFF, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        mark = w.client.mark()
        skycontroller(w).stick(PITCH_STICK, 40)
        await shown(w.client, PILOT, mark)
        skycontroller(w).stick(PITCH_STICK, 0)
        await asyncio.sleep(PILOT_KEEPS + 0.5)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await said(w.client, REFUSED, mark)
        await asyncio.sleep(3.0)
        assert heard(w, "TakeOff") == []


async def test_pilot_gets_sticks_of_a_drone_that_does_not_confirm_its_stop() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        assert await goto(w, 80.0, 8.0) == ACCEPTED
        w.drone.faults.unreported = frozenset({ardrone3.MoveToChanged.NAME})
        mark = w.client.mark()
        send_set(w.client, SWITCH, PILOT, INT32)
        await w.client.wait(
            "PARAM_VALUE", lambda m: m.param_id == SWITCH and value_of(m) == PILOT, since=mark, timeout=20.0
        )
        assert skycontroller(w).source is Source.SKY_CONTROLLER
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "not set" in m.text] == []


async def test_drone_that_the_pilot_flies_receives_nothing_of_the_switch() -> None:
    """Its take-off is the pilot's own, and goes on."""
    async with world(speed=1.0, skycontroller=3) as w:
        began = now()
        skycontroller(w).press(TAKEOFF_LAND)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "takingoff", 10.0)
        await switch(w, PILOT)
        await asyncio.sleep(4.0)
        assert [e.name for e in heard(w, "Landing", "moveBy", "CancelMoveTo", "PCMD", since=began)] == []
        assert w.drone.flying_state.name in ("HOVERING", "FLYING")
        await switch(w, AUTOMATIC)
        await switch(w, PILOT)
        assert [e.name for e in heard(w, "Landing", "moveBy", "CancelMoveTo", "PCMD", since=began)] == []


async def test_drone_found_flying_receives_nothing_of_the_switch() -> None:
    """A move of before the connection may be under way, but the pilot flies: no zero move takes the source."""
    async with world(speed=1.0, skycontroller=3) as w:
        skycontroller(w).press(TAKEOFF_LAND)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
        w.drone.faults.mute = True
        await asyncio.sleep(6.0)
        mark, w.drone.faults.mute = w.client.mark(), False
        await w.client.wait("ATTITUDE", since=mark, timeout=20.0)
        began = now()
        await switch(w, PILOT)
        assert [e.name for e in heard(w, "moveBy", "CancelMoveTo", "PCMD", since=began)] == []
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_turn_ends_when_aircraft_is_given_to_the_pilot() -> None:
    """It has no flight task of its own: the drone hovers in Hold while it turns."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        w.client.send_command(dialect.MAV_CMD_CONDITION_YAW, 170.0, 10.0, 1.0, 1.0)
        await w.drone.wait_log(lambda e: w.drone.pose.yaw > 0.5, 20.0)
        await switch(w, PILOT)
        yaw = w.drone.pose.yaw
        await asyncio.sleep(3.0)
        assert w.drone.pose.yaw == pytest.approx(yaw, abs=0.2)
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_goto_during_hand_over_to_pilot_is_refused() -> None:
    """The switch is at Pilot from the request on, and shows it once it is confirmed."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        assert await goto(w, 80.0, 8.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        w.drone.faults.unreported = frozenset({ardrone3.MoveToChanged.NAME})
        began, mark = now(), w.client.mark()
        send_set(w.client, SWITCH, PILOT, INT32)
        await asyncio.sleep(0.5)
        assert await goto(w, 60.0, 8.0) == REJECTED
        await said(w.client, f"Goto refused: {REFUSED}", mark)
        assert w.client.since(mark, "PARAM_VALUE") == [], "refused at once, without replacing the stop"
        await asyncio.sleep(8.0)
        assert heard(w, "moveTo", since=began) == []
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_end_of_the_connection_gives_the_aircraft_to_the_pilot() -> None:
    """The Skycontroller takes everything back by itself; a program has to take the aircraft again."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        await switch(w, PROGRAM)
        w.drone.faults.mute = True
        await asyncio.sleep(6.0)
        mark = w.client.mark()
        w.drone.faults.mute = False
        await w.client.wait("ATTITUDE", since=mark, timeout=20.0)
        assert value_of(await read(w.client, SWITCH)) == PILOT
        await refused(w, dialect.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0)


async def test_switch_at_automatic_gives_kept_sticks_back() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        await switch(w, PROGRAM)
        assert skycontroller(w).source is Source.CONTROLLER
        await switch(w, AUTOMATIC)
        await source_is(w, Source.SKY_CONTROLLER)
        assert await goto(w, 5.0, 8.0) == ACCEPTED


async def test_goto_that_has_arrived_is_not_ended_again() -> None:
    async with world(skycontroller=3) as w:
        await w.take_off(8.0)
        assert await goto(w, 5.0, 8.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"].name == "DONE", 20.0)
        mark = w.client.mark()
        await switch(w, PILOT)
        await said(w.client, "Aircraft: pilot only", mark)
        assert not [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "ended" in m.text]


async def test_newest_request_of_the_switch_counts() -> None:
    """Programs take the aircraft while it is still being given to the pilot."""
    async with world(speed=1.0, skycontroller=3) as w:
        other = await w.connect(sysid=250)
        await w.take_off(8.0)
        await switch(w, PROGRAM)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        send_set(w.client, SWITCH, PILOT, INT32)
        await asyncio.sleep(0.1)
        send_set(other, SWITCH, PROGRAM, INT32)
        await asyncio.sleep(5.0)
        assert value_of(await read(w.client, SWITCH)) == PROGRAM
        assert skycontroller(w).source is Source.CONTROLLER


async def test_return_during_hand_over_to_pilot_goes_on() -> None:
    """The switch's own Hold waits for the drone when the return arrives, and does not cancel it."""
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(12.0)
        assert await goto(w, 80.0, 12.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        began = now()
        w.drone.faults.mute = True
        asyncio.get_running_loop().call_later(1.5, setattr, w.drone.faults, "mute", False)
        send_set(w.client, SWITCH, PILOT, INT32)
        await asyncio.sleep(0.2)
        w.client.send_command(RETURN)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("return_to_home"), 10.0, since=began)
        await asyncio.sleep(3.0)
        assert [e.name for e in w.drone.log if e.t >= began and e.name.endswith("rth.abort")] == []
        assert skycontroller(w).source is Source.SKY_CONTROLLER


@pytest.mark.parametrize("generation", [3, 4])
async def test_program_keeps_the_aircraft_until_the_pilots_stick(generation: int) -> None:
    """Taken on request, also while nothing moves; the stick gives it to the pilot, until it is taken again."""
    async with world(skycontroller=generation) as w:
        other, pilot = await w.connect(sysid=250), skycontroller(w)
        await w.take_off(8.0)
        await source_is(w, Source.SKY_CONTROLLER)
        await switch(w, PROGRAM)
        assert pilot.source is Source.CONTROLLER
        await said(other, "Aircraft: programs")
        await asyncio.sleep(5 * QUIET_LOOKS * LOOK_EVERY)
        assert pilot.source is Source.CONTROLLER
        assert await goto(w, 5.0, 8.0) == ACCEPTED
        marks = w.client.mark(), other.mark()
        pilot.stick(PITCH_STICK, 40)
        await source_is(w, Source.SKY_CONTROLLER)
        for client, mark in zip((w.client, other), marks, strict=True):
            await shown(client, PILOT, mark)
            await said(client, "Aircraft: pilot only", mark)
        pilot.stick(PITCH_STICK, 0)
        await asyncio.sleep(PILOT_KEEPS + 0.5)
        assert await goto(w, 6.0, 8.0) == REJECTED
        await switch(w, PROGRAM)
        assert await goto(w, 7.0, 8.0) == ACCEPTED


async def test_aircraft_is_not_taken_while_the_pilot_moves_a_stick() -> None:
    async with world(skycontroller=3) as w:
        await w.take_off(8.0)
        await switch(w, PROGRAM)
        skycontroller(w).stick(PITCH_STICK, 40)
        await source_is(w, Source.SKY_CONTROLLER)
        mark = w.client.mark()
        send_set(w.client, SWITCH, PROGRAM, INT32)
        await said(w.client, "ANF_SC_OFFBOARD not set", mark)
        assert value_of(await read(w.client, SWITCH)) == PILOT
        assert skycontroller(w).source is Source.SKY_CONTROLLER


async def test_switch_by_default_refuses_nothing() -> None:
    """The stick ends a goto, and after two seconds a program flies again."""
    async with world(skycontroller=3) as w:
        await w.take_off(8.0)
        assert await goto(w, 60.0, 8.0) == ACCEPTED
        await source_is(w, Source.CONTROLLER)
        skycontroller(w).stick(PITCH_STICK, 40)
        await source_is(w, Source.SKY_CONTROLLER)
        skycontroller(w).stick(PITCH_STICK, 0)
        assert value_of(await read(w.client, SWITCH)) == AUTOMATIC
        await asyncio.sleep(PILOT_KEEPS + 0.5)
        assert await goto(w, 50.0, 8.0) == ACCEPTED


async def test_switch_does_not_exist_without_a_skycontroller() -> None:
    async with world() as w:
        assert SWITCH not in await fetch(w.client)
        assert heard(w, "SetPilotingSource") == []
