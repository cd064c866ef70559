"""Where a vehicle may be sent, and by what: CHANGE_MODE, distance, height without GPS, home, an old position."""

from __future__ import annotations

import asyncio
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller
from support.flavours import both
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.vehicle import POSITION_OLD

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
REJECTED, UNSUPPORTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED, dialect.MAV_RESULT_UNSUPPORTED
REPOSITION, SET_HOME = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_SET_HOME
ALTITUDE, SET_MODE = dialect.MAV_CMD_DO_CHANGE_ALTITUDE, dialect.MAV_CMD_DO_SET_MODE
CHANGE_MODE = dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
RELATIVE = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
NAN = math.nan

NORTH = geo.destination(HOME[0], HOME[1], 30.0, 0.0)


def moves(w: World) -> int:
    return len(w.commands("ardrone3.Piloting.moveTo"))


async def said(w: World, mark: int, text: str) -> None:
    await w.client.wait("STATUSTEXT", lambda m: text in m.text, since=mark)


async def goto(w: World, flags: float, place: tuple[float, float] = NORTH) -> int:
    ack = await w.client.command(REPOSITION, -1, flags, 0, NAN, frame=RELATIVE, x=place[0], y=place[1], z=8.0)
    return int(ack.result)


# CHANGE_MODE (S22).


@pytest.mark.parametrize("flags", [0.0, NAN, 2.0])
async def test_reposition_without_change_mode_is_unsupported_by_px4(flags: float) -> None:
    async with world() as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        assert await goto(w, flags) == UNSUPPORTED
        await said(w, mark, "Goto refused: flag CHANGE_MODE is missing")
        assert moves(w) == 0
        assert await goto(w, CHANGE_MODE) == ACCEPTED
        assert moves(w) == 1


async def test_reposition_without_change_mode_needs_guided_in_ardupilot() -> None:
    async with world(flavour="ardupilot") as w:
        await w.take_off(5.0)
        assert await goto(w, 0.0) == ACCEPTED  # it took off in Guided
        assert (await w.client.command(SET_MODE, 1, 17)).result == ACCEPTED
        mark = w.client.mark()
        assert await goto(w, 0.0) == DENIED
        await said(w, mark, "Goto refused: not in Guided, no CHANGE_MODE")
        assert moves(w) == 1
        assert await goto(w, CHANGE_MODE) == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == 4)


@both
async def test_reposition_with_nothing_set_stops_without_change_mode_too(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        assert await goto(w, CHANGE_MODE) == ACCEPTED
        assert (await w.client.command(REPOSITION, -1, 0, 0, NAN)).result == ACCEPTED
        assert len(w.commands("ardrone3.Piloting.CancelMoveTo")) == 1


# Distance (S16).


@both
async def test_target_beyond_4_km_is_refused_without_geofence(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        far, farther = (geo.destination(HOME[0], HOME[1], metres, 0.0) for metres in (3990.0, 4010.0))
        mark = w.client.mark()
        assert await goto(w, CHANGE_MODE, farther) == DENIED
        await said(w, mark, "Goto refused: 4010 m away > 4000 m")
        assert moves(w) == 0
        assert await goto(w, CHANGE_MODE, far) == ACCEPTED


# A height without GPS (S17).


async def without_fix(w: World) -> None:
    w.drone.faults.gps = False
    await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)


@pytest.mark.parametrize("command", ["DO_REPOSITION", "DO_CHANGE_ALTITUDE"])
@both
async def test_height_change_without_gps_is_flown_by_move_by(flavour: str, command: str) -> None:
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        # The climb counts from the reported height: the report of the take-off's end may still be on its way.
        await w.client.wait("GLOBAL_POSITION_INT", lambda m: abs(m.relative_alt / 1000.0 - w.drone.pose.up) < 0.2)
        await without_fix(w)
        assert await goto(w, CHANGE_MODE) == REJECTED  # a place needs a fix
        if command == "DO_REPOSITION":
            ack = await w.client.command(REPOSITION, -1, CHANGE_MODE, 0, NAN, frame=RELATIVE, z=9.0, timeout=20.0)
        else:
            ack = await w.client.command(ALTITUDE, 9.0, RELATIVE, timeout=20.0)
        assert ack.result == ACCEPTED
        assert w.drone.pose.up == pytest.approx(9.0, abs=0.5)
        assert moves(w) == 0
        for bad in (0.5, 1000.0):
            assert (await w.client.command(ALTITUDE, bad, RELATIVE)).result == DENIED


async def test_height_change_without_gps_is_not_flown_from_an_old_height() -> None:
    """A moveBy is relative: counted from a height of before, it would end as much too high as the drone has risen."""
    async with world() as w:
        await w.take_off(5.0)
        await without_fix(w)
        w.drone.faults.unreported = frozenset({ardrone3.AltitudeChanged.NAME})
        another_controller(w, ardrone3.MoveBy(0.0, 0.0, -6.0, 0.0))
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 10.9, 30.0)
        before = len(w.commands("ardrone3.Piloting.moveBy"))
        ack = await w.client.command(REPOSITION, -1, CHANGE_MODE, 0, NAN, frame=RELATIVE, z=9.0, timeout=20.0)
        assert ack.result == dialect.MAV_RESULT_FAILED
        assert [e for e in w.commands("ardrone3.Piloting.moveBy")[before:] if e.args["dZ"]] == []
        w.drone.faults.unreported = frozenset()
        ack = await w.client.command(REPOSITION, -1, CHANGE_MODE, 0, NAN, frame=RELATIVE, z=8.0, timeout=20.0)
        assert ack.result == ACCEPTED
        assert w.drone.pose.up == pytest.approx(8.0, abs=0.5)


# A home that the drone refuses.


@both
async def test_custom_home_that_the_drone_ignores_fails_immediately(flavour: str) -> None:
    """It is silent when the place is too far away. One that is silent may have obeyed, so that this is no refusal."""
    async with world(flavour=flavour) as w:
        await w.take_off(5.0)
        before = asyncio.get_running_loop().time()
        beyond = geo.destination(HOME[0], HOME[1], 43_000.0, 0.0)
        mark = w.client.mark()
        ack = await w.client.command(SET_HOME, 0, 0, 0, 0, frame=0, x=beyond[0], y=beyond[1], z=HOME[2])
        assert ack.result == dialect.MAV_RESULT_FAILED
        assert asyncio.get_running_loop().time() - before < 4.0  # the time of a drone without an answer is 5 s
        silent = "Command failed: no answer in 1.5 s"
        await w.client.wait("STATUSTEXT", lambda m: m.text == silent, since=mark)
        assert len(w.commands("rth.set_custom_location")) == 1


# An old position (S21).


async def test_position_in_flight_without_gps_locations_is_not_sent() -> None:
    """On the ground the last one stays: nothing has moved."""
    async with world() as w:
        stopped = frozenset({Quirk.GPS_LOCATION_STOPS})
        w.drone.faults.quirks = stopped
        mark = w.client.mark()
        await asyncio.sleep(POSITION_OLD + 0.5)
        assert w.client.since(mark, "GLOBAL_POSITION_INT")[-1][0] > w.client.received[-1][0] - 1.0
        w.drone.faults.quirks = frozenset()
        for _ in range(3):  # each of a GPS location: they come as often again as before
            await w.client.wait("GPS_RAW_INT")
        await w.take_off(5.0)
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if m.text.startswith("Position unknown")]
        mark = w.client.mark()
        w.drone.faults.quirks = stopped
        await said(w, mark, "Position unknown: no GPS location for 3 s")
        mark = w.client.mark()
        await w.client.wait("ATTITUDE", since=mark)
        await w.client.wait("SYS_STATUS")
        kinds = ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ODOMETRY")
        assert [m for kind in kinds for m in w.client.since(mark, kind)] == []
        # A change of height does not lead back to the old place.
        ack = await w.client.command(ALTITUDE, 8.0, RELATIVE, timeout=20.0)
        assert (ack.result, moves(w)) == (ACCEPTED, 0)
        assert await goto(w, CHANGE_MODE) == REJECTED
        w.drone.faults.quirks = frozenset()
        await w.client.wait("GLOBAL_POSITION_INT")
        await said(w, mark, "Position known again")


async def test_position_is_not_called_unknown_right_after_a_connection() -> None:
    """The first GPS location after a connection comes within a second; here none comes before the drone flies."""
    async with world() as w:
        w.drone.faults.quirks = frozenset({Quirk.GPS_LOCATION_STOPS})
        await w.take_off(5.0)
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if m.text.startswith("Position unknown")]
