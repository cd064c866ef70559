"""Conformance items 66 and 74: missions and what befalls them in the moments between: after a start is asked for
and before the drone says that it flies, between two files, and when another client goes on with what was paused.

What is flown is taken from the simulator's own log.
"""

from __future__ import annotations

import asyncio
import itertools
import math
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller
from support.flavours import both
from support.missions import (
    ACTIVE,
    COMPLETE,
    CORNERS,
    MISSION_MODE,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    first,
    mode,
    on_the_way,
    pauses,
    put,
    reached,
    said,
    settled,
    state,
    takeoff,
    way,
    whole,
)
from support.plans import ACCEPTED, MISSION, Item, clear
from support.world import World, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.messages import common

TURN = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, p4=1.0, frame=2)
"""By 90 deg, to the right: no flight plan of Parrot's can say that."""

PLAYS = "common.MavlinkState.MavlinkFilePlayingStateChanged"


async def asked_for(w: World, items: list[Item]) -> int:
    """In the air; the mission is started, the drone flies it and has not said so: it may take 20 s. A mark before."""
    await w.take_off(6.0)
    await put(w, items)
    w.drone.faults.unreported = frozenset({PLAYS})
    mark = w.client.mark()
    w.client.send_command(dialect.MAV_CMD_MISSION_START, 0, 0)
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 20.0)
    return mark


def reports_its_plan(w: World) -> None:
    w.drone.faults.unreported = frozenset()
    w.drone.firmware.flight_plan.report_stopped()  # whatever it is


@both
async def test_conf_011_049_slow_mission_start_sends_no_early_progress(flavour: str) -> None:
    """MAVSDK asks for it four times in 2 s and takes IN_PROGRESS for the end of it: none is said while it waits."""
    async with world(flavour=flavour, web=True) as w:
        await w.take_off(6.0)
        await put(w, CORNERS)
        w.drone.faults.unreported = frozenset({PLAYS})
        mark, began = w.client.mark(), time.monotonic()
        params = (1, MISSION_MODE[flavour]) if first(w) else (1, 4, 4)
        for _ in range(4):
            w.client.send_command(dialect.MAV_CMD_DO_SET_MODE, *params)
            await asyncio.sleep(0.5)  # as MAVSDK's timer
        assert w.client.since(mark, "COMMAND_ACK") == []
        for _ in range(2):
            assert (await w.client.wait("COMMAND_ACK")).result == dialect.MAV_RESULT_IN_PROGRESS
        reports_its_plan(w)
        await w.client.wait("COMMAND_ACK", lambda ack: ack.result == dialect.MAV_RESULT_ACCEPTED, since=mark)
        at, results = zip(*[(at, ack.result) for at, ack in w.client.since(mark, "COMMAND_ACK")], strict=True)
        assert 2.4 < at[0] - began < 3.0
        assert max(b - a for a, b in itertools.pairwise(at)) <= 1.0
        assert set(results[:-1]) == {dialect.MAV_RESULT_IN_PROGRESS}
        assert len(w.commands("common.Mavlink.Start")) == 1


@both
@pytest.mark.parametrize("how", ["another", "one item", "cleared"])
async def test_conf_074_other_mission_uploaded_during_start_ends_the_start(flavour: str, how: str) -> None:
    """The start is answered with a refusal, the drone is commanded to stop and hovers, and the mode is not Mission."""
    async with world(flavour=flavour, web=True) as w:
        mark = await asked_for(w, CORNERS)
        w.drone.faults.unreported = frozenset()
        changed = w.client.mark()
        if how == "cleared":
            assert (await clear(w.client, MISSION)).type == ACCEPTED
        else:
            await put(w, [way(0.0, 9.0, 6.0)] if how == "another" else [*CORNERS[:-1], way(0.0, 9.0, 6.0)])
        stopped = await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", 10.0)
        ack = await w.client.wait(
            "COMMAND_ACK", lambda m: m.command == dialect.MAV_CMD_MISSION_START and m.result != 5, since=mark
        )
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        why = "it was cleared" if how == "cleared" else "another was uploaded"
        await said(w, f"Mission refused: {why} meanwhile", since=mark)
        await state(w, NO_MISSION if how == "cleared" else NOT_STARTED, since=changed)
        await mode(w, w.modes.hold if flavour == "px4" else w.modes.idle, since=changed)
        assert len(w.commands("common.Mavlink.Stop")) == 1
        assert pauses(w)[-2:] == ["playing", "stopped"]
        await w.drone.wait_log(lambda e: e.kind == "state" and e.args["event"] == "at_rest", since=stopped.t)
        there = w.drone.pose
        for _ in range(3):
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, since=w.client.mark())
        here = w.drone.pose
        assert math.dist((there.north, there.east, there.up), (here.north, here.east, here.up)) < 0.3
        assert whole(await state(w, NO_MISSION if how == "cleared" else NOT_STARTED)).mission_mode != 1
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "Mission starts" in m.text] == []
        if how != "cleared":  # and what is the mission now flies
            assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
            await settled(w, (0.0, 9.0, 6.0))
            await state(w, COMPLETE, since=changed)


@pytest.mark.parametrize("how", ["another", "cleared"])
async def test_conf_074_another_mission_before_the_drone_has_begun_at_arming(how: str) -> None:
    """The mode was chosen first and arming began it: both were accepted long ago, so it is a text. The drone, which has
    taken off by then, hovers."""
    async with world(web=True) as w:
        await put(w, CORNERS)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)).result == dialect.MAV_RESULT_ACCEPTED
        w.drone.faults.unreported = frozenset({PLAYS})
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["index"] == 1, 20.0)
        w.drone.faults.unreported = frozenset()
        if how == "cleared":
            assert (await clear(w.client, MISSION)).type == ACCEPTED
        else:
            await put(w, [takeoff(6.0), way(0.0, 9.0, 6.0)])
        why = "mission was cleared" if how == "cleared" else "another was uploaded"
        await said(w, f"Mission not started: {why}", since=mark)
        stopped = await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", 10.0)
        await w.drone.wait_log(lambda e: e.kind == "state" and e.args["event"] == "at_rest", since=stopped.t)
        await mode(w, w.modes.hold, since=w.client.mark())
        await state(w, NO_MISSION if how == "cleared" else NOT_STARTED)
        assert len(w.commands("common.Mavlink.Stop")) == 1
        assert pauses(w)[-2:] == ["playing", "stopped"]


@both
async def test_conf_074_same_mission_uploaded_during_start_changes_nothing(flavour: str) -> None:
    """Two files with a turn between them: the start is accepted, and all of it is flown once."""
    async with world(flavour=flavour, web=True) as w:
        turned = [way(14.0, 0.0, 6.0), TURN, way(14.0, 10.0, 6.0)]
        mark = await asked_for(w, turned)
        await put(w, turned)
        await said(w, "continues at item 1", since=mark)
        reports_its_plan(w)
        ack = await w.client.wait(
            "COMMAND_ACK", lambda m: m.command == dialect.MAV_CMD_MISSION_START and m.result != 5, since=mark
        )
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [0, 1, 2]
        assert len(w.commands("common.Mavlink.Start")) == 2
        await settled(w, (14.0, 10.0, 6.0))


@both
async def test_conf_074_same_mission_uploaded_during_a_failed_start_is_new(flavour: str) -> None:
    """The drone hears the start and cannot: what was uploaded meanwhile begins at its first item."""
    async with world(flavour=flavour, web=True) as w:
        await w.take_off(6.0)
        await put(w, CORNERS)
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=2, since=0)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        w.drone.faults.unreported = frozenset({PLAYS})
        mark = w.client.mark()
        w.client.send_command(dialect.MAV_CMD_MISSION_START, 0, 0)
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "playing", 10.0)
        await put(w, CORNERS)
        await said(w, "continues at item 3", since=mark)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, NOT_STARTED, seq=0, since=mark)
        await mode(w, w.modes.hold, since=mark)


# Between two files, and by another client.


async def test_conf_074_mission_paused_before_a_file_resumes_after_flown_items() -> None:
    """A loop whose turn was just made: the drone turns as often as without the pause, and goes round as often."""
    async with world(web=True) as w:
        await w.take_off(6.0)
        await put(
            w,
            [
                way(6.0, 0.0, 6.0),
                way(6.0, 6.0, 6.0),
                TURN,
                Item(mav_enums.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=0.0, p2=2.0, frame=2),
            ],
        )
        started = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd") and turned(w) == 1, 30.0)
        w.drone.faults.unreported = frozenset({PLAYS})  # the next file is on its way
        await state(w, ACTIVE, seq=0, since=w.client.mark())
        mark = w.client.mark()
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=0, since=mark)
        w.drone.faults.unreported = frozenset()
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert turned(w) == 3
        assert reached(w, started) == [0, 1, 2, 3] * 3


def turned(w: World) -> int:
    """How often the drone was commanded to turn where it is."""
    moves = (e.args for e in w.drone.log if e.kind == "command" and e.name.rpartition(".")[2] == "moveBy")
    return sum(abs(args["dPsi"]) > 1.0 for args in moves)


@both
@pytest.mark.parametrize("after", ["the same again", "another item"])
async def test_conf_074_mission_resumed_by_another_controller_is_followed(flavour: str, after: str) -> None:
    """Paused, and uploaded once more or begun elsewhere next: the drone flies our file, so that is what is reported."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        mark = w.client.mark()
        if after == "the same again":
            await put(w, CORNERS)
            await state(w, NOT_STARTED, seq=0, since=mark)
        else:
            ack = await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 1 + first(w), 0)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
        (begun,) = w.commands("common.Mavlink.Start")
        another_controller(w, common.Start(begun.args["filepath"], common.MavlinkType.FLIGHT_PLAN))
        await said(w, "resumed by another controller", since=mark)
        await state(w, ACTIVE, seq=2, since=mark)
        await mode(w, MISSION_MODE[flavour], since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3]


async def test_conf_074_plan_of_another_mission_is_reported() -> None:
    async with world(web=True) as w:
        await on_the_way(w, 2)
        (begun,) = w.commands("common.Mavlink.Start")
        await put(w, [way(0.0, 9.0, 6.0)])
        mark = w.client.mark()
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "paused", 10.0)
        another_controller(w, common.Start(begun.args["filepath"], common.MavlinkType.FLIGHT_PLAN))
        await said(w, "Drone flies a plan that is not", since=mark)
        await state(w, NOT_STARTED, since=w.client.mark())
