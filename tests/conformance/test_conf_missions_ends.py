"""Conformance items 73 and 74: how plans end whose drone does not say that it has executed their last line.

Parrot does not write down whether a plan that lands or returns reports its last line before it. The simulator does;
here it does not, and what is its own end and what is not has to be seen from what the drone does then.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from support.fault_scenarios import return_by_itself
from support.flavours import both
from support.missions import (
    ACTIVE,
    COMPLETE,
    LAND,
    PAUSED,
    PLACE,
    RTL,
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
from support.world import ARMED, World, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk

WAIT = Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=2.0, frame=2)


def while_it_waits(w: World, do: Callable[[], Any]) -> asyncio.Future[Any]:
    """Do something in the moment in which the drone begins to wait, in the line before the last."""

    def heard(entry: Any) -> bool:
        if entry.name != "item" or not entry.args["command"].endswith("delay"):
            return False
        do()
        return True

    return asyncio.ensure_future(w.drone.wait_log(heard, 40.0))


def waited(w: World) -> None:
    """The drone says that it has executed the line before the last, and no more of its lines."""
    w.drone.inject(common.MissionItemExecuted(len(w.drone.firmware.flight_plan.items) - 2))
    w.drone.faults.unreported = frozenset({common.MissionItemExecuted.NAME})


def observed_after(w: World, entry: Any) -> list[str]:
    """What the drone was commanded to do after that."""
    return [e.name for e in w.drone.log if e.kind == "command" and e.t > entry.t]


async def to_the_last_line(w: World, last: Item, do: Callable[[], Any] = lambda: None) -> tuple[int, Any]:
    """Fly a mission to its last line, where something else may happen; a mark before it, and the drone's last word."""
    await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), WAIT, last])

    def there() -> None:
        waited(w)
        do()

    ending = while_it_waits(w, there)
    await start(w)
    await state(w, ACTIVE, seq=1, since=0)
    mark = w.client.mark()
    return mark, await ending


@both
@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize("last", [LAND, RTL], ids=["land", "return"])
async def test_conf_073_mission_completes_when_its_end_is_not_reported(flavour: str, model: str, last: Item) -> None:
    """It lands, or returns: that was the plan's last item. Nothing is sent against it."""
    async with world(flavour=flavour, model=model, web=True) as w:
        mark, entry = await to_the_last_line(w, last)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3]
        await mode(w, w.modes.land if last is LAND else w.modes.returning, since=mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)
        assert observed_after(w, entry) == (
            [] if last is LAND else ["ardrone3.Piloting.Landing"]
        )  # above home: ANF_RTL_END
        lines = [e.args["idx"] for e in w.drone.log if e.name == common.MissionItemExecuted.NAME]
        assert lines == [*range(len(w.drone.firmware.flight_plan.items) - 1)]
        assert reached(w) == [0, 1, 2, 3]


@both
@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize("is_late", [True, False], ids=["late", "unreported"])
async def test_conf_073_return_of_a_plan_whose_lines_are_not_reported_lands(
    flavour: str, model: str, is_late: bool
) -> None:
    """The line before the return is not reported by then either; the drone names its plan as the return's reason."""
    async with world(flavour=flavour, model=model, web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), WAIT, RTL])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        mark, name = w.client.mark(), common.MissionItemExecuted.NAME
        if is_late:
            w.drone.faults.late = {name: 0.8}
        else:
            w.drone.faults.unreported = frozenset({name})
        await state(w, COMPLETE, since=mark)
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=60.0)
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "paused" in m.text] == []


@both
async def test_conf_073_landing_that_precedes_the_report_of_its_file_completes_the_mission(flavour: str) -> None:
    """The gateway turns the drone, and the file behind that has the landing alone: the drone lands at once."""
    turn = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, p3=1.0, frame=2)
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), turn, LAND])
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        mark = w.client.mark()
        w.drone.faults.late = {common.MavlinkFilePlayingStateChanged.NAME: 0.3}
        await state(w, COMPLETE, since=mark)
        assert [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "paused" in m.text] == []
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)
        assert not w.commands("common.Mavlink.Pause")


@both
async def test_conf_073_landing_whose_lines_are_reported_late_completes_the_mission(flavour: str) -> None:
    """It is taken for another one until the drone reports the last line of its plan."""
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), LAND])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        mark = w.client.mark()
        w.drone.faults.late = {common.MissionItemExecuted.NAME: 0.8, common.MavlinkFilePlayingStateChanged.NAME: 0.3}
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2]
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=40.0)


async def test_conf_073_last_line_reported_after_the_end_completes_the_mission() -> None:
    """The drone says that its plan has ended, and only then that the last line was executed."""
    async with world(web=True) as w:

        def ends() -> None:
            plan = w.drone.firmware.flight_plan
            last = len(plan.items) - 1
            plan.stop(hover=True)
            w.drone.faults.unreported = frozenset()
            w.drone.inject(common.MissionItemExecuted(last))

        mark, _ = await to_the_last_line(w, LAND, ends)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3]
        assert [m for _, m in w.client.since(mark, "STATUSTEXT") if "paused" in m.text] == []


@both
@pytest.mark.parametrize("last", [LAND, RTL], ids=["land", "return"])
async def test_conf_074_plan_stopped_before_its_landing_is_paused(flavour: str, last: Item) -> None:
    """Another client stops it there and the drone hovers: nothing has landed or returned, so nothing is complete."""
    async with world(flavour=flavour, web=True) as w:
        stop = w.drone.firmware.flight_plan.stop
        mark, entry = await to_the_last_line(w, last, lambda: stop(hover=True))
        await state(w, PAUSED, seq=3, since=mark)
        await said(w, "Mission paused at item 4: stopped by the drone", since=mark)
        await mode(w, w.modes.idle, since=mark)
        assert reached(w) == [0, 1, 2]
        assert observed_after(w, entry) == []
        assert w.drone.pose.up > 5.0


@both
async def test_conf_074_battery_return_at_last_line_is_not_the_plans(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        mark, entry = await to_the_last_line(w, RTL, lambda: return_by_itself(w))
        await state(w, PAUSED, seq=3, since=mark)
        await mode(w, w.modes.returning, since=mark)
        assert reached(w) == [0, 1, 2]
        assert observed_after(w, entry) == []


# A last line that is a way point or a wait (S8).

PLAIN = {
    "way-point": [takeoff(6.0), way(9.0, 0.0, 6.0), way(9.0, 9.0, 6.0)],
    "wait": [takeoff(6.0), way(9.0, 9.0, 6.0), Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=1.0, frame=2)],
}
plain = pytest.mark.parametrize("items", PLAIN.values(), ids=PLAIN)
EXECUTED = common.MissionItemExecuted.NAME


def lines_reported(w: World) -> list[int]:
    return [entry.args["idx"] for entry in w.drone.log if entry.name == EXECUTED]


@both
@pytest.mark.parametrize("model", ["4k", "ai"])
@plain
async def test_mission_with_last_line_unreported_completes_at_last_waypoint(
    flavour: str, model: str, items: list[Item]
) -> None:
    async with world(flavour=flavour, model=model, web=True) as w:
        w.drone.faults.quirks = frozenset({Quirk.LAST_ITEM_NOT_REPORTED})
        await put(w, items)
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 2]
        await mode(w, w.modes.idle)
        last = len(w.drone.firmware.flight_plan.items) - 1
        assert lines_reported(w) == [*range(last)]
        await settled(w, (9.0, 9.0, 6.0))
        assert [m.text for _, m in w.client.since(0, "STATUSTEXT") if "paused" in m.text] == []


@plain
async def test_mission_with_last_line_reported_after_stop_completes(items: list[Item]) -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({Quirk.STOPPED_BEFORE_EXECUTED})
        await put(w, items)
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 2]
        assert [m.text for _, m in w.client.since(0, "STATUSTEXT") if "paused" in m.text] == []


@pytest.mark.parametrize("last", [LAND, RTL], ids=["land", "return"])
@pytest.mark.parametrize("quirk", [Quirk.LAST_ITEM_NOT_REPORTED, Quirk.STOPPED_BEFORE_EXECUTED])
async def test_mission_with_quirk_ending_by_return_or_landing_completes(quirk: Quirk, last: Item) -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({quirk})
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), last])
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 2]


async def test_mission_stopped_before_its_last_waypoint_is_paused() -> None:
    """Another controller stops it 60 m before its end: nothing is there to be claimed."""
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), way(80.0, 0.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        w.drone.firmware.flight_plan.stop(hover=True)
        await state(w, PAUSED, seq=2)
        await said(w, "Mission paused at item 3: stopped by the drone")
        assert reached(w) == [0, 1]


async def test_mission_stopped_by_alert_at_last_waypoint_is_paused() -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({Quirk.LAST_ITEM_NOT_REPORTED})
        await put(w, PLAIN["wait"])
        while_it_waits(w, lambda: w.drone.inject(ardrone3.AlertStateChanged(ardrone3.AlertState.CRITICAL_BATTERY)))
        await start(w)
        await state(w, PAUSED, seq=2, since=0)
        assert reached(w) == [0, 1]


async def report_last_line(w: World) -> None:
    """The drone reports its plan's last line; return when the gateway has processed that report."""
    w.drone.faults.unreported = frozenset()
    mark = w.client.mark()
    w.drone.inject(common.MissionItemExecuted(len(w.drone.firmware.flight_plan.items) - 1))
    w.drone.inject(ardrone3.IcingLevelChanged(ardrone3.WarningLevel.CRITICAL))  # reports keep their order
    await said(w, "Icing: critical", since=mark)


@both
async def test_mission_with_last_line_reported_after_pause_completes(flavour: str) -> None:
    """The drone's own report is the answer, however late. What flies by then is not disturbed."""
    async with world(flavour=flavour, web=True) as w:
        stop = w.drone.firmware.flight_plan.stop
        mark, _ = await to_the_last_line(w, LAND, lambda: stop(hover=True))
        await state(w, PAUSED, seq=3, since=mark)
        ack = await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=PLACE[0], y=PLACE[1], z=9.0)
        assert ack.result == mav_enums.MAV_RESULT_ACCEPTED, ack
        mark = w.client.mark()
        await report_last_line(w)
        await state(w, COMPLETE, since=mark)
        assert reached(w) == [0, 1, 2, 3]
        await settled(w, (0.0, 0.0, 9.0))


async def test_mission_paused_by_client_stays_paused_after_last_line() -> None:
    """Resume must not begin the whole mission again for a pilot who has paused it."""
    async with world(web=True) as w:
        mark, _ = await to_the_last_line(w, PLAIN["way-point"][-1])
        ack = await w.client.command(mav_enums.MAV_CMD_DO_SET_MODE, 1, 4, 3)
        assert ack.result == mav_enums.MAV_RESULT_ACCEPTED, ack
        await state(w, PAUSED, seq=3, since=mark)
        await report_last_line(w)
        await state(w, PAUSED, seq=3)
        assert reached(w) == [0, 1, 2]


async def test_stopped_mission_ignores_the_lines_of_another_plan() -> None:
    async with world(web=True) as w:
        stop = w.drone.firmware.flight_plan.stop
        mark, _ = await to_the_last_line(w, LAND, lambda: stop(hover=True))
        await state(w, PAUSED, seq=3, since=mark)
        playing = common.MavlinkFilePlayingStateChanged(
            common.PlayingState.PLAYING, "other", common.MavlinkType.FLIGHT_PLAN
        )
        w.drone.inject(playing)
        await report_last_line(w)
        await state(w, PAUSED, seq=3)
        assert reached(w) == [0, 1, 2]


LOCATION, ALTITUDE = ardrone3.GpsLocationChanged.NAME, ardrone3.AltitudeChanged.NAME
MOVED = {
    LOCATION: [takeoff(6.0), way(9.0, 0.0, 6.0), way(9.0, 12.0, 6.0)],
    ALTITUDE: [takeoff(6.0), way(9.0, 0.0, 6.0), way(9.0, 0.0, 15.0)],
}
"""By the name of a report: a mission whose last line changes what it says and little else."""


async def stopped_without(w: World, report: str) -> int:
    """Fly MOVED[report] to its end, which is not reported, and nor is the position there. Return a mark before it."""
    w.drone.faults.quirks = frozenset({Quirk.LAST_ITEM_NOT_REPORTED})
    await put(w, MOVED[report])
    await start(w)
    await w.drone.wait_log(lambda entry: entry.name == "item" and entry.args["index"] == 3, 40.0)
    w.drone.faults.unreported = frozenset({report})
    await w.drone.wait_log(lambda entry: entry.name == "plan" and entry.args["state"] == "stopped", 40.0)
    mark = since = w.client.mark()
    last = MOVED[report][-1]
    await settled(w, (9.0, 12.0, 6.0) if report == LOCATION else (9.0, 0.0, last.z))
    for _ in range(4):  # one a second: longer than a drone's last report and its landing are waited for
        await w.client.heartbeat(lambda beat: True, since=since)
        since = w.client.mark()
    return mark


@pytest.mark.parametrize("report", MOVED)
async def test_mission_end_without_position_completes_when_position_is_known(report: str) -> None:
    """The last position that was received is of the way to the last way point: it proves nothing."""
    async with world(web=True) as w:
        await stopped_without(w, report)
        assert reached(w) == [0, 1]
        w.drone.faults.unreported = frozenset()
        await state(w, COMPLETE)
        assert reached(w) == [0, 1, 2]
        assert [m.text for _, m in w.client.since(0, "STATUSTEXT") if "paused" in m.text] == []
        assert lines_reported(w) == [0, 1, 2]


async def test_mission_end_without_any_position_is_paused() -> None:
    async with world(web=True) as w:
        mark = await stopped_without(w, LOCATION)
        await state(w, PAUSED, seq=2, since=mark)
        assert reached(w) == [0, 1]


@pytest.mark.parametrize("quirk", [Quirk.LAST_ITEM_NOT_REPORTED, Quirk.STOPPED_BEFORE_EXECUTED])
async def test_mission_with_quirk_completes_over_a_bad_link(quirk: Quirk) -> None:
    """200 ms and a quarter of the datagrams lost, both ways."""
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({quirk})
        await put(w, PLAIN["way-point"])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.up = w.drone.faults.down = Impairment(loss=0.25, delay=0.2)
        await state(w, COMPLETE, since=0, timeout=60.0)
        assert reached(w) == [0, 1, 2]


# Lines, states and the start of a file that are reported later than what they are about.

PLAYING, FLYING_STATE = common.MavlinkFilePlayingStateChanged.NAME, ardrone3.FlyingStateChanged.NAME
DESCENTS = {"land": LAND, "return": RTL}
LATE = {
    "lines": {EXECUTED: 0.9},
    "lines and landing": {EXECUTED: 0.9, FLYING_STATE: 0.6},
    "lines and stop": {EXECUTED: 0.9, PLAYING: 0.6},
}
"""s by which events are late."""


def paused_texts(w: World) -> list[str]:
    return [m.text for _, m in w.client.since(0, "STATUSTEXT") if "paused" in m.text]


async def lands(w: World) -> None:
    await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=0, timeout=60.0)


@pytest.mark.parametrize("late", LATE.values(), ids=LATE)
@pytest.mark.parametrize("quirks", [set(), {Quirk.LAST_ITEM_NOT_REPORTED}], ids=["", "last unreported"])
@pytest.mark.parametrize("last", DESCENTS.values(), ids=DESCENTS)
async def test_mission_whose_descent_precedes_its_lines_completes_without_a_pause(
    last: Item, quirks: set[Quirk], late: dict[str, float]
) -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), last])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.quirks = frozenset(quirks)
        w.drone.faults.late = late
        await state(w, COMPLETE, since=0, timeout=60.0)
        assert reached(w) == [0, 1, 2]
        await lands(w)
        assert paused_texts(w) == []
        assert w.commands(common.Pause.NAME) == []
        assert w.commands(common.Stop.NAME) == []


async def test_last_file_that_lands_before_its_start_is_reported_is_not_stopped() -> None:
    """The mission is complete as soon as the start is reported; the gateway withdrew that start by Stop."""
    async with world(speed=1.0, web=True) as w:
        turn = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, frame=2)
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), turn, LAND])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.late = {PLAYING: 0.2, EXECUTED: 1.0}
        await state(w, COMPLETE, since=0, timeout=60.0)
        await lands(w)
        assert reached(w) == [0, 1, 2, 3]
        assert w.commands(common.Stop.NAME) == []


async def is_landing(w: World) -> None:
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 60.0)
    await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)


async def holds(w: World) -> int:
    return int((await w.client.command(mav_enums.MAV_CMD_DO_SET_MODE, 1, 4, 3)).result)


@pytest.mark.parametrize("late", [{}, {EXECUTED: 4.0}], ids=["", "lines late"])
async def test_landing_of_a_mission_behind_a_skycontroller_is_ended_by_hold(late: dict[str, float]) -> None:
    """It was taken for one by the Skycontroller's button, and no client could end it."""
    async with world(speed=1.0, web=True, skycontroller=3) as w:
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), LAND])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.late = late
        await is_landing(w)
        assert await holds(w) == mav_enums.MAV_RESULT_ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 8.0)


async def test_landing_by_button_on_the_way_of_a_mission_that_lands_is_not_ended_by_hold() -> None:
    async with world(speed=1.0, web=True, skycontroller=3) as w:
        await put(w, [takeoff(6.0), way(40.0, 0.0, 6.0), LAND])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(1)
        await is_landing(w)
        assert await holds(w) == mav_enums.MAV_RESULT_TEMPORARILY_REJECTED
        await said(w, "Hold refused: Skycontroller pilot is landing", since=0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


@pytest.mark.parametrize("late", [1.4, 2.5])
async def test_mission_that_lands_before_its_start_is_reported_completes(late: float) -> None:
    async with world(web=True) as w:
        await w.take_off(6.0)
        w.simulator.speed = 1.0
        await put(w, [way(1.0, 0.0, 6.0), LAND])
        w.drone.faults.late = {PLAYING: late}
        assert (await w.client.command(mav_enums.MAV_CMD_MISSION_START)).result == mav_enums.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=0)
        assert reached(w)[-1] == 1  # a line that is reported before the start of its file may be another file's
        await lands(w)
        assert paused_texts(w) == []
        assert w.commands(common.Pause.NAME) == []
        assert w.commands(common.Stop.NAME) == []


async def test_mission_whose_lines_follow_its_end_in_the_air_completes_without_a_pause() -> None:
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(6.0), way(0.5, 0.0, 6.0)])
        w.drone.faults.late = {EXECUTED: 1.5}
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1]
        assert paused_texts(w) == []


async def test_last_wait_that_is_reported_as_it_begins_is_flown_to_its_end() -> None:
    """The turn behind it begins when the drone has waited."""
    async with world(speed=1.0, web=True) as w:
        wait = Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=5.0, frame=2)
        turn = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, frame=2)
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0), wait, turn])
        waits = while_it_waits(w, lambda: report_wait(w))
        await start(w)
        begun = await waits
        await state(w, COMPLETE, since=0, timeout=60.0)
        stopped = next(e for e in w.drone.log if e.name == "plan" and e.args["state"] == "stopped" and e.t > begun.t)
        assert stopped.t - begun.t >= 4.9
        assert w.commands(common.Stop.NAME) == []


def report_wait(w: World) -> None:
    """The drone reports the wait as executed when it begins."""
    w.drone.inject(common.MissionItemExecuted(len(w.drone.firmware.flight_plan.items) - 1))
