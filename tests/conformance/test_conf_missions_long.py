"""Missions that are longer than one file, and those that begin in the middle of one: loops, jumps, skipped way points.

What was flown, in which order and how often, is read from the simulator's own log.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller
from support.missions import (
    ACTIVE,
    COMPLETE,
    PAUSED,
    apart,
    mode,
    put,
    reached,
    said,
    settled,
    start,
    state,
    takeoff,
    way,
)
from support.plans import Item
from support.world import World, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.plans.translation.translate import MAX_LINES

A, B, C = (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)

SETS = 498
"""Items in each turn that only say the speed again: with them four turns fill a file."""


def loop(often: float) -> list[Item]:
    """Up, then round by A and B, and in the end to C: way points are items 1 and 2."""
    sets = [Item(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=8.0, p3=-1.0, frame=2)] * SETS
    jump = Item(mav_enums.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=1.0, p2=often, frame=2)
    return [takeoff(6.0), way(*A, 6.0), way(*B, 6.0), *sets, jump, way(*C, 6.0)]


JUMP, LAST = SETS + 3, SETS + 4
TURN = list(range(1, JUMP + 1))
"""Items of a turn, in their order."""


def visits(w: World, *places: tuple[float, float]) -> str:
    """Which places the drone has come by, in its order; one that it stays at is one."""
    names, seen = "ABC", ""
    poses = [entry.args for entry in w.drone.log if entry.kind == "pose" and entry.args["up"] > 4.0]
    for stretch in itertools.pairwise((pose["north"], pose["east"]) for pose in poses):
        here = [names[number] for number, there in enumerate(places) if apart(there, *stretch) < 2.0]
        if here and not seen.endswith(here[0]):
            seen += here[0]
    return seen


def files(w: World) -> list[str]:
    """The files that the drone was commanded to fly, in their order."""
    starts = [*w.commands("common.Mavlink.Start"), *w.commands("flight_plan.start_at_v2")]
    return [e.args.get("filepath") or e.args["flightplan_id"] for e in sorted(starts, key=lambda e: e.t)]


def rounds(items: Sequence[int]) -> None:
    """What was reported as reached is up, and then turn for turn."""
    assert items[0] == 0
    for place, item in enumerate(items[1:]):
        assert item == TURN[place % len(TURN)], (place, items[max(place - 3, 0) : place + 5])


async def begun(w: World, number: int) -> None:
    """The drone flies so many files by now."""
    await w.drone.wait_log(lambda e: e.name == "plan" and len(files(w)) == number, timeout=300.0)


@pytest.mark.parametrize(("model", "cuts"), [("4k", 2), ("ai", 1)])
async def test_a_loop_without_end_is_flown_file_after_file(model: str, cuts: int) -> None:
    """Paused and gone on with in a later file, and left by the current item. The drone comes by at each turn."""
    assert 4 * (SETS + 2) == MAX_LINES
    async with world(web=True, model=model, speed=4.0) as w:
        w.drone.faults.battery = 80
        await put(w, loop(-1.0))
        await said(w, "flown by gateway")
        await start(w)
        await begun(w, cuts + 1)
        await state(w, ACTIVE, seq=1, timeout=60.0)
        mark = w.client.mark()
        await state(w, ACTIVE, seq=2, since=mark, timeout=60.0)
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2, since=mark)
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 1)).result == dialect.MAV_RESULT_ACCEPTED
        mark = w.client.mark()
        await state(w, ACTIVE, seq=1, since=mark, timeout=60.0)
        assert files(w)[cuts + 1 :] == [files(w)[cuts]], "the same file goes on"
        observed = reached(w)
        rounds(observed)
        await w.drone.wait_log(lambda e: e.kind == "pose", since=w.drone.log[-1].t)  # the log's last pose is older
        assert observed.count(JUMP) >= 4 * cuts
        assert visits(w, A, B) == "AB" * observed.count(2)
        assert (
            await w.client.command(mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT, LAST, 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=LAST, since=mark)
        await state(w, COMPLETE, since=mark, timeout=60.0)
        await mode(w, w.modes.idle, since=mark)
        await settled(w, (*C, 6.0))
        assert reached(w)[-1] == LAST
        assert "C" in visits(w, A, B, C)[-2:]


async def test_long_loop_is_flown_the_requested_number_of_rounds() -> None:
    """Over a cut, and over a pause in which the drone was flown elsewhere and forgot its file."""
    async with world(web=True, speed=4.0) as w:
        w.drone.faults.battery = 80
        await put(w, loop(5.0))
        await start(w)
        await begun(w, 2)
        await state(w, ACTIVE, seq=2, timeout=60.0)
        mark = w.client.mark()
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2, since=mark)
        another_controller(w, common.Stop())
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", since=paused(w))
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=mark, timeout=200.0)
        assert len(files(w)) == 3
        assert reached(w) == [0, *TURN * 6, LAST]
        assert visits(w, A, B, C) == "AB" * 6 + "C"


def paused(w: World) -> float:
    """When the drone was commanded to pause last."""
    return float(w.commands("common.Mavlink.Pause")[-1].t)


async def test_ai_resumes_inside_file_after_jumps_and_item_changes() -> None:
    """Where what is left to fly is the end of the file that it has; the counts of a loop that is chosen begin again."""
    async with world(web=True, model="ai") as w:
        jump = Item(mav_enums.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=1.0, p2=2.0, frame=2)
        await put(w, [takeoff(6.0), way(*A, 6.0), way(*B, 6.0), jump, way(*C, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        mark = w.client.mark()
        assert (
            await w.client.command(mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT, 2, 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=2, since=mark)
        await state(w, ACTIVE, seq=1, since=w.client.mark())  # again, and not still
        mark = w.client.mark()
        assert (
            await w.client.command(mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT, 4, 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=4, since=mark)
        await state(w, COMPLETE, since=mark)
        starts = w.commands("flight_plan.start_at_v2")
        assert [e.args["item"] for e in starts] == [0, 3, 8], "lines: up in two, A, B, A, B, A, B, C"
        assert len({e.args["flightplan_id"] for e in starts}) == 1
        lines = [e.args["index"] for e in w.drone.log if e.name == "item"]
        assert lines == [0, 1, 2, 3, 4, 8]
        assert reached(w) == [0, 2, 3, 4]
        assert visits(w, A, B, C)[-2:] == "BC"
        await settled(w, (*C, 6.0))


async def test_ai_skips_an_unreachable_way_point() -> None:
    """It says so; what was not flown over is not reported, and the rest is flown."""
    async with world(web=True, model="ai") as w:
        await put(w, [takeoff(6.0), way(8.0, 0.0, 6.0), way(60.0, 0.0, 6.0), way(*C, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        another_controller(w, ardrone3.MaxDistance(20.0))
        another_controller(w, ardrone3.NoFlyOverMaxDistance(1))
        skipped = await w.drone.wait_log(lambda e: e.name == "flight_plan.waypoint_skipped", timeout=30.0)
        await said(w, "item 3 skipped: out of reach")
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 3]
        assert skipped.args["item"] == 3, "a line of its file"
        assert max(e.args["north"] for e in w.drone.log if e.kind == "pose") < 22.0
        await settled(w, (*C, 6.0))
