"""The end of a commanded return (ANF_RTL_END): landed and disarmed where home is certain, else hovering with a text.

Judged by the commands that the simulated drone received and by where it came down.
"""

from __future__ import annotations

import asyncio
import math
import re
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller, deaf, on_command, return_by_itself
from support.flavours import both
from support.mav import NAN, Client
from support.missions import RTL as RTL_ITEM
from support.missions import put, start, takeoff, way
from support.params import read, value_of, write
from support.plans import RALLY, Item, upload
from support.setpoints import texts
from support.world import ARMED, HOLD, HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk

ACCEPTED, REJECTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
RTL, LAND = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_NAV_LAND
GOTO, SET_HOME, SET_MODE = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_SET_HOME, dialect.MAV_CMD_DO_SET_MODE
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE
PX4_HOLD = (1, 4, 3)
INT32, REAL32, INT16 = 6, 9, 4
FAST = 8.0
"""Simulated seconds in one: the wait above home is the gateway's own and stays as long as it is."""


def landings(w: World) -> list[Any]:
    return w.commands("ardrone3.Piloting.Landing")


async def away(w: World, north: float = 15.0) -> None:
    """Take off and fly a few metres."""
    await w.take_off()
    place = geo.destination(*HOME[:2], north, 0.0)
    assert (await w.client.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=5.0)).result == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > north - 1.0, 20.0)


async def go_home(w: World) -> int:
    """Command a return; a mark from before it."""
    mark = w.client.mark()
    assert (await w.client.command(RTL)).result == ACCEPTED
    return mark


async def said(client: Client, pattern: str, mark: int) -> None:
    """Wait for a text that matches; the way home takes its time."""
    while not any(re.search(pattern, line) for line in texts(client, mark)):
        await client.wait("STATUSTEXT", timeout=30.0)


async def landed(w: World, mark: int) -> None:
    """The vehicle is disarmed, and the drone truly stands where it took off."""
    await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=30.0)
    assert w.drone.flying_state.name == "LANDED"
    assert math.hypot(w.drone.pose.north, w.drone.pose.east) < 1.0


async def hovers(w: World, text: str, mark: int) -> None:
    """The return ends with this text, in Hold, and no landing was commanded. The height is the last reported one."""
    await said(w.client, rf"^Return ended, hovering at 1\d m{text}$", mark)
    beat = await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, since=mark)
    assert beat.base_mode & ARMED
    assert landings(w) == []
    assert w.drone.flying_state.name == "HOVERING"
    assert w.drone.pose.up == pytest.approx(10.0, abs=0.3)


@both
async def test_commanded_return_ends_landed_and_disarmed(flavour: str) -> None:
    """Return is shown until it has landed, the texts say where, and no setting of the drone is written."""
    async with world(speed=FAST, flavour=flavour) as w:
        await away(w)
        mark = await go_home(w)
        await said(w.client, "Return by system 255: lands at take-off point", mark)
        await said(w.client, "Link loss during return: drone hovers at home", mark)
        over = await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["reason"] == 3, 30.0)
        await said(w.client, r"^Landing in 5 s, Hold cancels: \d m from take-off$", mark)
        await said(w.client, "Landing place: take-off point, ", mark)
        await landed(w, mark)
        (landing,) = landings(w)
        assert landing.t - over.t > 4.9
        armed = [m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT") if m.base_mode & ARMED]
        assert set(armed[armed.index(w.modes.returning) :]) == {w.modes.returning}
        names = {e.name for e in w.drone.log if e.kind == "command"}
        assert not [name for name in names if name.startswith("rth.set_")]


async def test_hold_above_home_cancels_the_landing() -> None:
    async with world(speed=FAST) as w:
        await away(w)
        mark = await go_home(w)
        await said(w.client, "Landing in 5 s", mark)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await said(w.client, "Landing at home cancelled", mark)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        await asyncio.sleep(5.5)  # longer than what was left
        assert landings(w) == []
        assert w.drone.flying_state.name == "HOVERING"


async def landing_unheard(w: World) -> int:
    """Return home, and land there by a command that the drone does not hear; the client's mark of before."""
    await away(w)
    mark = await go_home(w)
    await said(w.client, "Landing in 5 s", mark)
    await asyncio.sleep(4.5)  # nearly all of it
    deaf(w, 6.0)
    await said(w.client, "Landing at home failed, hovering", mark)
    return mark


async def test_landing_that_the_drone_does_not_hear_is_tried_again() -> None:
    async with world(speed=1.0) as w:
        mark = await landing_unheard(w)
        assert landings(w) == []
        await landed(w, mark)


async def test_end_of_a_return_that_is_reported_again_in_a_later_hover_announces_no_landing() -> None:
    """A drone that is asked for its states repeats the last one, FINISHED, until the next return or flight."""
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_RTH_END", 0, INT32)
        await away(w)
        await go_home(w)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 30.0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        finished = rth.State(rth.RthState.AVAILABLE, rth.StateReason.FINISHED)
        assert w.gateway.systems[0].drone.home.state.reason == finished.reason
        mark = w.client.mark()
        w.drone.inject(finished)
        for _ in range(2):
            await w.client.heartbeat(lambda beat: True)
        assert {
            beat.custom_mode
            for _, beat in w.client.since(mark, "HEARTBEAT")
            if beat.autopilot != dialect.MAV_AUTOPILOT_INVALID
        } == {HOLD}


async def test_hold_between_two_landings_cancels_the_second() -> None:
    async with world(speed=1.0) as w:
        await landing_unheard(w)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        await asyncio.sleep(12.0)  # longer than until the second
        assert landings(w) == []


async def test_return_commanded_again_above_home_does_not_restart() -> None:
    """PX4 and ArduCopter stay in their mode then: a program that sends it every second must come down."""
    async with world(speed=FAST) as w:
        await away(w)
        mark = await go_home(w)
        await said(w.client, "Landing in 5 s", mark)
        assert (await w.client.command(SET_MODE, 1, 4, 5)).result == ACCEPTED
        await landed(w, mark)
        assert len(w.commands("rth.return_to_home")) == 1
        assert "cancelled" not in " ".join(texts(w.client, mark))


async def test_return_ended_by_another_clients_hold_does_not_land() -> None:
    """The newest command wins, and a finished report of the drone that is late means nothing then."""
    async with world(speed=FAST) as w:
        await away(w)
        mark = await go_home(w)
        other = await w.connect(sysid=254)
        place = geo.destination(*HOME[:2], 3.0, 0.0)
        goto = (GOTO, -1, 1, 0, NAN)
        ack = await other.command(*goto, frame=6, x=place[0], y=place[1], z=5.0)
        assert ack.result == REJECTED  # a goto does not end a return
        assert (await other.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        ack = await other.command(*goto, frame=6, x=place[0], y=place[1], z=6.0)
        assert ack.result == ACCEPTED
        w.drone.inject(rth.State(rth.RthState.AVAILABLE, rth.StateReason.FINISHED))
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 20.0)
        await asyncio.sleep(5.5)
        assert landings(w) == []
        assert "Landing" not in " ".join(texts(w.client, mark))


async def test_late_report_of_an_earlier_return_ends_nothing() -> None:
    """Reports come late, or twice: before the drone has reported this return, none is about it."""
    async with world(speed=FAST) as w:
        await away(w)
        w.drone.faults.up = Impairment(delay=1.0)
        w.client.send_command(RTL)
        await w.client.wait("COMMAND_ACK", lambda m: m.result == dialect.MAV_RESULT_IN_PROGRESS)
        w.drone.inject(rth.State(rth.RthState.AVAILABLE, rth.StateReason.FINISHED))
        await w.client.wait("COMMAND_ACK", lambda m: m.result == ACCEPTED)
        w.drone.faults.up = Impairment()
        assert "Return ended" not in " ".join(texts(w.client))
        await said(w.client, "Landing in 5 s", 0)


async def test_return_with_hover_parameter_ends_hovering() -> None:
    async with world(speed=FAST) as w:
        assert value_of(await write(w.client, "ANF_RTL_END", 1, INT32)) == 1
        await away(w)
        mark = await go_home(w)
        await said(w.client, "Return by system 255: hovers at home", mark)
        await hovers(w, "", mark)


async def test_return_with_landing_by_drone_needs_no_gateway_landing() -> None:
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_RTH_END", 0, INT32)
        await write(w.client, "ANF_RTL_END", 1, INT32)
        await away(w)
        mark = await go_home(w)
        await said(w.client, r"Return by system 255: lands at home \(ANF_RTH_END\)", mark)
        await landed(w, mark)
        assert landings(w) == []


async def test_return_begun_by_the_drone_keeps_its_end() -> None:
    """Low battery sends the drone home: it hovers there, as its own setting says, and the gateway lands nothing."""
    async with world(speed=FAST) as w:
        await away(w)
        mark = w.client.mark()
        return_by_itself(w)
        await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["reason"] == 3, 30.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark)
        await asyncio.sleep(5.5)
        assert landings(w) == []


async def test_return_behind_a_skycontroller_hovers() -> None:
    async with world(speed=FAST, skycontroller=3) as w:
        await away(w)
        mark = await go_home(w)
        await said(w.client, "Return by system 255: hovers, Skycontroller", mark)
        await hovers(w, ": Skycontroller", mark)


async def test_return_to_a_first_fix_hovers() -> None:
    """The drone took off without a fix: its home is where it got the first one."""
    async with world(speed=FAST) as w:
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        await w.take_off()
        w.drone.faults.gps = True
        await w.drone.wait_log(lambda e: e.name == "rth.takeoff_location")
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type >= 3)
        mark = await go_home(w)
        await hovers(w, ": home is first fix", mark)


async def test_return_to_the_pilot_hovers() -> None:
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_HOME_TYPE", 4, INT32)
        another_controller(w, ardrone3.SendControllerGPS(*geo.destination(*HOME[:2], 5.0, 0.0), 35.0, 2.0, 3.0))
        await away(w)
        mark = await go_home(w)
        await hovers(w, ": home is the pilot", mark)


@pytest.mark.parametrize("when", ["in this flight", "before the take-off"])
async def test_return_to_set_home_lands_only_in_same_flight(when: str) -> None:
    async with world(speed=FAST) as w:
        place = geo.destination(*HOME[:2], 8.0, 0.0)

        async def choose() -> None:
            assert (await w.client.command(SET_HOME, 0, frame=6, x=place[0], y=place[1], z=0.0)).result == ACCEPTED

        if when == "before the take-off":
            await choose()
        await away(w)
        if when == "in this flight":
            await choose()
        mark = await go_home(w)
        if when == "before the take-off":
            await hovers(w, ": home set earlier", mark)
            return
        await said(w.client, r"^Landing in 5 s, Hold cancels: [6-9] m from take-off$", mark)
        await said(w.client, "Landing place: set home, ", mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=30.0)
        assert math.hypot(w.drone.pose.north - 8.0, w.drone.pose.east) < 1.0


@pytest.mark.parametrize("z", [0.0, HOME[2] - 30.0, HOME[2] + 4.0])
async def test_return_to_set_home_ends_in_the_air_whatever_height_a_client_sends(z: float) -> None:
    """A client without the height of a place sends 0; the drone may count the end of a return from it."""
    async with world(speed=FAST, quirks=("return-ends-above-home",)) as w:
        await write(w.client, "ANF_RTL_END", 1, INT32)
        place = geo.destination(*HOME[:2], 8.0, 0.0)
        await away(w)
        mark = w.client.mark()
        assert (await w.client.command(SET_HOME, 0, frame=0, x=place[0], y=place[1], z=z)).result == ACCEPTED
        if z < HOME[2]:
            await said(w.client, f"^Home height raised to take-off: was {z - HOME[2]:.0f} m$", mark)
        mark = await go_home(w)
        await said(w.client, r"^Return ended, hovering at 1\d m", mark)
        assert w.drone.pose.up == pytest.approx(10.0 + max(0.0, z - HOME[2]), abs=0.5)
        assert w.drone.pose.north == pytest.approx(8.0, abs=1.0)


async def test_return_not_reported_as_finished_hovers_with_a_text() -> None:
    """Quirk rth-finished-missing: nothing is landed, everybody reads it, and Hold still ends it."""
    async with world(speed=FAST) as w:
        w.drone.faults.quirks = frozenset({Quirk.RTH_FINISHED_MISSING})
        await away(w)
        mark = await go_home(w)
        await said(w.client, r"^Return ended, hovering at 1\d m: not finished$", mark)
        assert landings(w) == []
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("command", [(SET_MODE, *PX4_HOLD), (PAUSE, 0)])
async def test_hold_after_the_unreported_end_of_a_return_is_accepted(command: tuple[int, ...], own: bool) -> None:
    """Quirk rth-finished-missing: the drone hovers at home already, so it has nothing to report of the Hold."""
    async with world(speed=FAST, quirks=("rth-finished-missing",)) as w:
        await away(w)
        mark = w.client.mark()
        if own:
            return_by_itself(w)
        else:
            await go_home(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        hovers_at = await w.drone.wait_log(
            lambda e: e.name == "flying" and e.args["to"] == "hovering" and not w.drone.firmware.homing.active,
            30.0,
            since=w.drone.log[-1].t,
        )
        mark = w.client.mark()
        assert (await w.client.command(*command, timeout=12.0)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark)
        assert not [e for e in w.drone.log if e.t > hovers_at.t and e.name == "flying"]


@pytest.mark.parametrize("own", [False, True])
async def test_unreported_end_of_a_return_without_an_attempt_ends_mode_return(own: bool) -> None:
    """Quirk rth-finished-missing, in a return of the drone's own, and in a commanded one after a link loss."""
    async with world(speed=FAST, quirks=("rth-finished-missing",)) as w:
        await away(w, 60.0)
        mark = w.client.mark()
        if own:
            return_by_itself(w)
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        else:
            await go_home(w)
            w.simulator.speed = 1.0
            w.drone.faults.mute = True
            await w.client.silence("HEARTBEAT", 2.0)
            w.drone.faults.mute = False
            mark = w.client.mark()
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark, timeout=10.0)
            w.simulator.speed = FAST
        assert w.drone.firmware.homing.active
        await w.drone.wait_log(lambda e: not w.drone.firmware.homing.active, 30.0, since=w.drone.log[-1].t)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=w.client.mark(), timeout=20.0)
        assert w.drone.flying_state.name == "HOVERING"
        assert landings(w) == []


async def test_return_not_reported_as_finished_ends_with_the_landing() -> None:
    """Quirk rth-finished-missing: a return of the flight before neither ends the next climb nor shows mode Return."""
    async with world(speed=FAST, quirks=("rth-finished-missing",)) as w:
        await away(w)
        mark = w.client.mark()
        return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark)
        await w.drone.wait_log(lambda e: not w.drone.firmware.homing.active, 30.0, since=w.drone.log[-1].t)
        assert (await w.client.command(LAND, timeout=20.0)).result == ACCEPTED
        await landed(w, mark)
        await w.take_off(6.0)


async def test_return_ending_far_from_home_hovers() -> None:
    """The drone reports finished where its home is not: a wind, or another home than the reported one."""
    async with world(speed=FAST) as w:
        await away(w, 20.0)
        mark = await go_home(w)
        w.drone.faults.unreported = frozenset({rth.State.NAME, ardrone3.NavigateHomeStateChanged.NAME})
        w.drone.firmware.homing.abort()
        w.drone.faults.unreported = frozenset()
        w.drone.inject(rth.State(rth.RthState.AVAILABLE, rth.StateReason.FINISHED))
        await said(w.client, "m from home", mark)
        await asyncio.sleep(5.5)
        assert landings(w) == []


@both
async def test_mission_ending_with_a_return_lands(flavour: str) -> None:
    async with world(speed=FAST, flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), RTL_ITEM])
        mark = w.client.mark()
        await start(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, since=mark, timeout=30.0)
        await said(w.client, "Return: lands at take-off point", mark)
        await said(w.client, "Landing in 5 s", mark)
        await landed(w, mark)


async def test_return_of_a_lost_ground_station_lands() -> None:
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_GCS_LOSS", 2, INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await away(w)
        mark = w.client.mark()
        w.client.send(
            dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
        )
        await said(w.client, "Return: lands at take-off point", mark)
        await landed(w, mark)


@both
async def test_gateway_shutdown_does_not_abort_a_return(flavour: str) -> None:
    """SIGTERM: the drone goes on home and ends there as its own setting says; the terminal names both."""
    async with world(speed=FAST, flavour=flavour) as w:
        await away(w)
        await go_home(w)
        (sentence,) = w.gateway.drones_in_air()
        assert sentence.startswith("alpha returns to 48.87890, 2.36770")
        assert sentence.endswith("hovers there (ANF_RTH_END)")
        await w.gateway.close()
        over = await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["reason"] == 3, 30.0)
        heard = [e.name for e in w.drone.log if e.kind == "command"]
        assert "rth.abort" not in heard
        assert heard[-1] == "rth.return_to_home"
        assert over.t


async def test_gateway_shutdown_does_not_abort_a_landing() -> None:
    async with world(speed=FAST) as w:
        await w.take_off()
        assert (await w.client.command(LAND)).result == ACCEPTED
        assert w.gateway.drones_in_air() == ["alpha is landing, and goes on landing"]
        await w.gateway.close()
        await w.drone.wait_log(lambda e: e.name.endswith("FlyingStateChanged") and e.args["state"] == 0, 20.0)
        assert [e.name for e in w.drone.log if e.kind == "command"][-1] == "ardrone3.Piloting.Landing"


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_names_of_both_families_are_one_setting(flavour: str) -> None:
    """A client that writes one sees the others change; the drone's own setting is not written."""
    async with world(flavour=flavour) as w:
        client = w.client
        if flavour == "px4":
            assert value_of(await read(client, "RTL_LAND_DELAY")) == 5.0
            assert value_of(await write(client, "RTL_LAND_DELAY", -1.0)) == -1.0
            assert value_of(await read(client, "ANF_RTL_END")) == 1
            assert value_of(await write(client, "RTL_LAND_DELAY", 9.0)) == 9.0
            assert value_of(await read(client, "ANF_RTL_END")) == 0
            assert value_of(await read(client, "ANF_RTL_WAIT")) == 9.0
        else:
            assert value_of(await write(client, "RTL_ALT_FINAL", 500, INT16, flavour), flavour) == 1000.0
            await said(client, "RTL_ALT_FINAL: hovers at 10 m", 0)
            assert value_of(await read(client, "ANF_RTL_END"), flavour) == 1
            assert value_of(await write(client, "RTL_ALT_FINAL", 0, INT16, flavour), flavour) == 0.0
            assert value_of(await read(client, "ANF_RTL_END"), flavour) == 0
            assert value_of(await write(client, "RTL_LOIT_TIME", 9000, INT32, flavour), flavour) == 9000.0
            assert value_of(await read(client, "ANF_RTL_WAIT"), flavour) == 9.0
        assert not [e for e in w.drone.log if e.kind == "command" and e.name.startswith("rth.set_")]


async def test_rally_point_below_the_take_off_is_raised_to_it() -> None:
    """The height at the end of a return may count from that of the home."""
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_RTL_TYPE", 1, INT32)
        place = geo.destination(*HOME[:2], 10.0, 0.0)
        point = Item(dialect.MAV_CMD_NAV_RALLY_POINT, *place, z=-20.0, frame=dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        mark = w.client.mark()
        assert (await upload(w.client, [point], RALLY)).type == ACCEPTED
        await away(w)
        await said(w.client, "^Home height raised to take-off: was -20 m$", mark)
        await said(w.client, "Returns end at rally point 0", mark)
        assert [entry.args["altitude"] for entry in w.commands("rth.set_custom_location")] == [pytest.approx(0.0)]


async def test_return_to_a_rally_point_lands_there() -> None:
    async with world(speed=FAST) as w:
        await write(w.client, "ANF_RTL_TYPE", 1, INT32)
        place = geo.destination(*HOME[:2], 10.0, 0.0)
        point = Item(dialect.MAV_CMD_NAV_RALLY_POINT, *place, z=5.0, frame=dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        assert (await upload(w.client, [point], RALLY)).type == ACCEPTED
        mark = w.client.mark()
        await away(w)
        await said(w.client, "Returns end at rally point 0", mark)
        mark = await go_home(w)
        await said(w.client, "Return by system 255: lands at rally point 0", mark)
        await said(w.client, "Landing place: rally point 0, ", mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=30.0)
        assert math.hypot(w.drone.pose.north - 10.0, w.drone.pose.east) < 1.0


@both
async def test_return_over_a_bad_link_ends_landed_once(flavour: str) -> None:
    """200 ms and 25 % loss both ways: one return, one landing, and the mode is never another one."""
    async with world(speed=2.0, flavour=flavour) as w:
        await away(w)
        w.drone.faults.up = w.drone.faults.down = Impairment(loss=0.25, delay=0.2)
        mark = w.client.mark()
        assert (await w.client.command(RTL, timeout=15.0)).result == ACCEPTED
        await said(w.client, "Landing in 5 s", mark)
        await landed(w, mark)
        w.drone.faults.up = w.drone.faults.down = Impairment()
        assert len(landings(w)) == 1
        assert len(w.commands("rth.return_to_home")) == 1


@both
async def test_home_here_during_the_drones_own_return_is_refused(flavour: str) -> None:
    """It would end the return of an empty battery in a hover that no client commanded."""
    async with world(flavour=flavour) as w:
        await away(w, 40.0)
        return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning)
        mark = w.client.mark()
        assert (await w.client.command(SET_HOME, 1)).result == REJECTED
        assert "Home refused: drone is returning by itself" in texts(w.client, mark)
        assert w.commands("rth.set_preferred_home_type") == w.commands("rth.set_custom_location") == []
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] < 5.0, 60.0)


async def test_new_place_of_a_custom_home_is_accepted_although_the_drones_own_return_begins_then() -> None:
    """The drone has it already, and will return there: a refusal would be untrue."""
    async with world(speed=1.0) as w:
        await away(w, 40.0)
        w.drone.faults.late = {rth.CustomLocation.NAME: 0.5}
        assert (await w.client.command(SET_HOME, 0, frame=6, x=HOME[0], y=HOME[1], z=0.0)).result == ACCEPTED
        begun = on_command(w, rth.SetCustomLocation.NAME, lambda: return_by_itself(w))
        mark = w.client.mark()
        assert (await w.client.command(SET_HOME, 1)).result == ACCEPTED, texts(w.client, mark)
        await begun
        custom = w.drone.firmware.homing.custom
        assert custom is not None
        assert custom.latitude > HOME[0] + 1e-4


async def test_failed_home_of_a_drone_whose_custom_place_is_not_known_is_reported_as_maybe_moved() -> None:
    """The drone prefers a custom home, obeys and does not answer: no place can be restored."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        custom = int(rth.RthHomeType.CUSTOM)
        assert value_of(await write(w.client, "ANF_HOME_TYPE", custom, INT32)) == custom
        w.drone.faults.unreported = frozenset({rth.CustomLocation.NAME})
        mark = w.client.mark()
        ack = await w.client.command(SET_HOME, 0, frame=6, x=HOME[0] + 2e-4, y=HOME[1], z=HOME[2], timeout=15.0)
        assert ack.result == dialect.MAV_RESULT_FAILED
        assert w.drone.firmware.homing.custom is not None
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Home may be moved: old place unknown", since=mark)
        assert not [text for text in texts(w.client, mark) if "does not accept" in text]  # it has
