"""A mission whose restart is withdrawn by COMMAND_CANCEL: the client's state and the drone's are the same."""

from __future__ import annotations

import asyncio
import math

import pytest
from support.fault_scenarios import another_controller, home_being_undone, until
from support.flavours import both
from support.missions import ACTIVE, MISSION_MODE, PAUSED, first, on_the_way, put, state, takeoff, way, whole
from support.world import World, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages.common import MavlinkType, PlayingState
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.world.faults import Impairment

SET_CURRENT = mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT
NOT_IN_MISSION_MODE = 2

LATE = Impairment(delay=0.5)
"""Of the drone's answers."""


def commanded(w: World, name: str) -> list[float]:
    """When the simulated drone received a command."""
    return [e.t for e in w.drone.log if e.kind == "command" and e.name.endswith(name)]


async def cancelled_restart(w: World, moment: str) -> int:
    """Fly to a corner, restart at the first way point and cancel that when the drone has received a command.

    Returns a mark behind the acknowledgement.
    """
    await on_the_way(w, 2)
    w.drone.faults.down = LATE
    mark, seen = w.client.mark(), len(commanded(w, moment))
    w.client.send_command(SET_CURRENT, 1.0 + first(w), 0.0)
    await w.drone.wait_log(lambda e: len(commanded(w, moment)) > seen, 20.0)
    w.client.send(newer.MAVLink_command_cancel_message(1, 1, SET_CURRENT))
    ack = await w.client.wait(
        "COMMAND_ACK", lambda m: m.command == SET_CURRENT and m.result != mav_enums.MAV_RESULT_IN_PROGRESS, since=mark
    )
    assert ack.result == mav_enums.MAV_RESULT_CANCELLED
    return w.client.mark()


@both
@pytest.mark.parametrize("moment", ["Mavlink.Pause", "Mavlink.Stop", "Mavlink.Start"])
async def test_cancelled_mission_restart_leaves_a_paused_mission(flavour: str, moment: str) -> None:
    """Cancelled while control is acquired, or while the start is on its way and the drone begins it late."""
    async with world(flavour=flavour, web=True) as w:
        mark = await cancelled_restart(w, moment)
        for _ in range(6):  # one a second: longer than reports are late, and than Mission is shown after a mission
            await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        states = [whole(m).mission_state for _, m in w.client.since(mark, "MISSION_CURRENT")]
        assert {*states} <= {PAUSED}
        assert whole(await state(w, PAUSED)).mission_mode == NOT_IN_MISSION_MODE
        modes = [m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT") if m.get_srcComponent() == 1]
        shown = [mode == MISSION_MODE[flavour] for mode in modes]
        assert not shown[-1]
        assert shown == sorted(shown, reverse=True), "once another mode is shown, Mission is not shown again"
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"][-1] != "playing"
        last = w.drone.pose
        await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        here = w.drone.pose
        assert math.dist((here.north, here.east, here.up), (last.north, last.east, last.up)) < 0.3


@both
async def test_mission_replaced_during_its_restart_is_not_shown_as_flown(flavour: str) -> None:
    """A client uploads another mission while control is acquired for the old one."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        w.drone.faults.down = LATE
        mark, seen = w.client.mark(), len(commanded(w, "Mavlink.Pause"))
        w.client.send_command(SET_CURRENT, 1.0 + first(w), 0.0)
        await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Pause")) > seen, 20.0)
        await put(w, [takeoff(6.0), way(5.0, 5.0, 6.0)])
        ack = await w.client.wait(
            "COMMAND_ACK",
            lambda m: m.command == SET_CURRENT and m.result != mav_enums.MAV_RESULT_IN_PROGRESS,
            since=mark,
            timeout=20.0,
        )
        assert ack.result != mav_enums.MAV_RESULT_ACCEPTED
        for _ in range(4):  # one a second: longer than reports are late, and than Mission is shown after a mission
            beat = await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert beat.custom_mode != MISSION_MODE[flavour]
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"][-1] != "playing"


@both
async def test_paused_mission_sends_mission_current_once(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        ack = await w.client.command(mav_enums.MAV_CMD_SET_MESSAGE_INTERVAL, newer.MAVLINK_MSG_ID_MISSION_CURRENT, -1)
        assert ack.result == mav_enums.MAV_RESULT_ACCEPTED
        mark = w.client.mark()
        ack = await w.client.command(mav_enums.MAV_CMD_DO_PAUSE_CONTINUE, 0)
        assert ack.result == mav_enums.MAV_RESULT_ACCEPTED
        for _ in range(3):
            await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        sent = {bytes(m.get_payload()) for _, m in w.client.since(mark, "MISSION_CURRENT")}
        assert len(sent) == 1


@both
async def test_withdrawn_start_reported_late_under_another_name_is_suspended(flavour: str) -> None:
    """A name that the drone has not reported before is that of the start that it may still execute."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        mark, seen = w.client.mark(), len(commanded(w, "Mavlink.Start"))
        w.client.send_command(SET_CURRENT, 1.0 + first(w), 0.0)
        await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Stop")) > 0, 20.0)
        w.drone.faults.unreported = frozenset({common.MavlinkFilePlayingStateChanged.NAME})
        await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Start")) > seen, 20.0)
        w.client.send(newer.MAVLink_command_cancel_message(1, 1, SET_CURRENT))
        await w.client.wait(
            "COMMAND_ACK",
            lambda m: m.command == SET_CURRENT and m.result == mav_enums.MAV_RESULT_CANCELLED,
            since=mark,
        )
        w.drone.faults.unreported = frozenset()
        stops = len(commanded(w, "Mavlink.Stop"))
        w.drone.inject(common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "renamed", MavlinkType.FLIGHT_PLAN))
        await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Stop")) > stops, 5.0)


class SilentPlan:
    """A mission whose restart was cancelled and that was started again, while the drone reports nothing of its plan."""

    def __init__(self, w: World, mark: int, older: str, newer: str) -> None:
        self.w = w
        self.mark = mark
        """Before the second start."""
        self.older = older
        """The drone's name of the file of the cancelled start."""
        self.newer = newer

    def report(self, uid: str, *states: PlayingState) -> None:
        for one in states:
            self.w.drone.inject(common.MavlinkFilePlayingStateChanged(one, uid, MavlinkType.FLIGHT_PLAN))

    def states(self) -> list[int]:
        return [whole(m).mission_state for _, m in self.w.client.since(self.mark, "MISSION_CURRENT")]

    def results(self) -> list[int]:
        start = mav_enums.MAV_CMD_MISSION_START
        acks = [m for _, m in self.w.client.since(self.mark, "COMMAND_ACK") if m.command == start]
        return [m.result for m in acks if m.result != mav_enums.MAV_RESULT_IN_PROGRESS]

    def resumed(self) -> list[str]:
        texts = [m.text for _, m in self.w.client.since(self.mark, "STATUSTEXT")]
        return [text for text in texts if "resumed by another controller" in text]


async def started_twice(w: World) -> SilentPlan:
    """Fly to a corner, restart, cancel that when the drone has begun, and start it again, without a report of it."""
    await on_the_way(w, 2)
    mark, stops, starts = w.client.mark(), len(commanded(w, "Mavlink.Stop")), len(commanded(w, "Mavlink.Start"))
    w.client.send_command(SET_CURRENT, float(first(w)), 0.0)
    await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Stop")) > stops, 20.0)
    w.drone.faults.unreported = frozenset({common.MavlinkFilePlayingStateChanged.NAME})
    await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Start")) > starts, 20.0)
    w.client.send(newer.MAVLink_command_cancel_message(1, 1, SET_CURRENT))
    await w.client.wait(
        "COMMAND_ACK", lambda m: m.command == SET_CURRENT and m.result == mav_enums.MAV_RESULT_CANCELLED, since=mark
    )
    await state(w, PAUSED, since=mark)
    w.client.send(newer.MAVLink_mission_set_current_message(1, 1, first(w)))
    await state(w, PAUSED, seq=0, since=mark)
    mark = w.client.mark()
    w.client.send_command(mav_enums.MAV_CMD_MISSION_START, 0.0, 0.0)
    await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Start")) > starts + 1, 20.0)
    w.drone.faults.unreported = frozenset()
    files = [e.args["filepath"] for e in w.drone.log if e.kind == "command" and e.name.endswith("Mavlink.Start")]
    assert files[-1] != files[-2], "reports of the two starts differ by the name alone"
    return SilentPlan(w, mark, files[-2], files[-1])


@both
async def test_reports_of_a_cancelled_start_are_not_those_of_the_next(flavour: str) -> None:
    """The drone reports the cancelled start and its end, however late, and then the second start."""
    async with world(speed=1.0, flavour=flavour, web=True) as w:
        plan = await started_twice(w)
        for report in (PlayingState.PLAYING, PlayingState.STOPPED):
            plan.report(plan.older, report)
            for _ in range(2):  # one a second
                await w.client.heartbeat(lambda beat: True, since=w.client.mark())
            assert plan.results() == []
            assert ACTIVE not in plan.states()
        plan.report(plan.newer, PlayingState.PLAYING)
        await state(w, ACTIVE, since=plan.mark)
        for _ in range(2):
            await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert plan.results() == [mav_enums.MAV_RESULT_ACCEPTED]
        shown = [one == ACTIVE for one in plan.states()]
        assert shown == sorted(shown), "once it is flown, it is not shown as paused"
        assert plan.resumed() == []


@both
@pytest.mark.parametrize("end", [PlayingState.STOPPED, None], ids=["repeated-stop", "silence"])
async def test_start_behind_a_cancelled_one_that_never_began_is_shown_as_flown(
    flavour: str, end: PlayingState | None
) -> None:
    """The only PLAYING is the second start's; the drone may have repeated before that it flies no plan."""
    async with world(flavour=flavour, web=True) as w:
        plan = await started_twice(w)
        if end is not None:
            plan.report(plan.older, end)
        plan.report(plan.newer, PlayingState.PLAYING)
        await state(w, ACTIVE, since=plan.mark)
        for _ in range(4):  # one a second: longer than any wait for a report
            beat = await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert plan.results() == [mav_enums.MAV_RESULT_ACCEPTED]
        assert plan.states()[-1] == ACTIVE
        assert beat.custom_mode == MISSION_MODE[flavour]
        assert plan.resumed() == []
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"][-1] == "playing"


@both
async def test_hold_while_a_start_is_in_doubt_stops_the_drone(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        plan = await started_twice(w)
        plan.report(plan.older, PlayingState.PLAYING)
        hold = (1.0, 4.0, 3.0) if flavour == "px4" else (1.0, 17.0)
        ack = await w.client.command(mav_enums.MAV_CMD_DO_SET_MODE, *hold)
        assert ack.result == mav_enums.MAV_RESULT_ACCEPTED
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"][-1] != "playing"
        for _ in range(4):  # one a second: longer than any wait for a report
            beat = await w.client.heartbeat(lambda beat: True, since=w.client.mark())
        assert beat.custom_mode != MISSION_MODE[flavour]
        assert plan.states()[-1] == PAUSED
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"][-1] != "playing"
        assert mav_enums.MAV_RESULT_ACCEPTED not in plan.results()


async def test_paused_mission_that_another_controller_stops_in_the_wait_is_not_begun_again() -> None:
    """The start of a plan that is no longer paused would fly it from its first line."""
    async with world(speed=1.0, web=True) as w:
        await on_the_way(w, 2)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_SET_MODE, 1, 4, 3)).result == mav_enums.MAV_RESULT_ACCEPTED
        await home_being_undone(w)
        mark, starts = w.client.mark(), len(commanded(w, "Mavlink.Start"))
        w.client.send_command(mav_enums.MAV_CMD_MISSION_START)
        await asyncio.sleep(0.5)
        another_controller(w, common.Stop())
        assert (mav_enums.MAV_CMD_MISSION_START, mav_enums.MAV_RESULT_TEMPORARILY_REJECTED) in await until(
            w.client, mark, 2
        )
        assert len(commanded(w, "Mavlink.Start")) == starts
        assert (await w.client.command(mav_enums.MAV_CMD_MISSION_START)).result == mav_enums.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=2, since=mark)


async def test_mission_whose_resumption_was_withdrawn_is_continued_from_another_file() -> None:
    """A late report of the withdrawn start has the same name as one of a second start would have."""
    async with world(speed=1.0, web=True) as w:
        await on_the_way(w, 2)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_SET_MODE, 1, 4, 3)).result == mav_enums.MAV_RESULT_ACCEPTED
        w.drone.faults.unreported = frozenset({common.MavlinkFilePlayingStateChanged.NAME})
        mark, starts = w.client.mark(), len(commanded(w, "Mavlink.Start"))
        w.client.send_command(mav_enums.MAV_CMD_MISSION_START)
        await w.drone.wait_log(lambda e: len(commanded(w, "Mavlink.Start")) > starts, 10.0)
        w.client.send(newer.MAVLink_command_cancel_message(1, 1, mav_enums.MAV_CMD_MISSION_START))
        assert (mav_enums.MAV_CMD_MISSION_START, mav_enums.MAV_RESULT_CANCELLED) in await until(w.client, mark, 1)
        w.drone.faults.unreported = frozenset()
        assert (await w.client.command(mav_enums.MAV_CMD_MISSION_START)).result == mav_enums.MAV_RESULT_ACCEPTED
        files = [e.args["filepath"] for e in w.drone.log if e.kind == "command" and e.name.endswith("Mavlink.Start")]
        assert len({*files}) == 2
        assert files[-1] not in files[:-1]
        await state(w, ACTIVE, seq=2, since=mark)
