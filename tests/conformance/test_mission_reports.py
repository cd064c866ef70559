"""Missions whose drone reports late or in part, and commands that cross them.

A mission ends as it has been flown, a second start disturbs no first one, and a refused start ends no landing.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    LAND_CMD,
    PX4_HOLD,
    PX4_OFFBOARD,
    SET_MODE,
    another_controller,
    being_tried,
    on_command,
    results,
    until,
    watched,
)
from support.fault_scenarios import RTL as RTL_CMD
from support.missions import (
    ACTIVE,
    COMPLETE,
    CORNERS,
    LAND,
    MISSION_MODE,
    NOT_STARTED,
    PAUSED,
    PLACE,
    RTL,
    put,
    reached,
    said,
    start,
    state,
    takeoff,
    way,
    whole,
)
from support.params import write
from support.plans import FENCE, Item, around, polygon, square, upload
from support.setpoints import VELOCITY_ONLY, local, streaming
from support.world import ARMED, HOLD, HOME, World, world

from anafi_mav.arsdk.messages import ardrone3, common, flight_plan, piloting_style, rth
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim.world.faults import Impairment

ACCEPTED, IN_PROGRESS = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS
ARM, START = dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_MISSION_START
PLAYING = common.MavlinkFilePlayingStateChanged.NAME
EXECUTED = common.MissionItemExecuted.NAME
PX4_MISSION = (1, 4, 4)
CHOOSE = dialect.MAV_CMD_DO_SET_MISSION_CURRENT
WAIT = Item(dialect.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=5.0, frame=2)


async def disarmed(w: World) -> None:
    await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=60.0)


@pytest.mark.parametrize("last", [LAND, RTL], ids=["land", "return"])
@pytest.mark.parametrize("late", [0.5, None])
async def test_mission_whose_end_is_reported_late_or_never_is_complete(last: Item, late: float | None) -> None:
    """Its last line is reported, and the drone lands or returns, before it reports its plan as stopped."""
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0), last])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        if late is None:
            w.drone.faults.unreported = frozenset({PLAYING})
        else:
            w.drone.faults.late = {PLAYING: late}
        await disarmed(w)
        assert whole(await w.client.wait("MISSION_CURRENT")).mission_state == COMPLETE


@pytest.mark.parametrize("last", [way(12.0, 12.0, 6.0), WAIT], ids=["way point", "wait"])
async def test_mission_that_ends_in_the_air_without_a_report_of_its_plans_end_is_complete(last: Item) -> None:
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0), last])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.unreported = frozenset({PLAYING})
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 2]
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)


@pytest.mark.parametrize("uid", ["", "other"])
async def test_plan_of_another_controller_is_shown_as_a_mission(uid: str) -> None:
    """Also one that the drone reports without a name."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        kind = common.MavlinkType.FLIGHT_PLAN
        w.drone.inject(common.MavlinkFilePlayingStateChanged(common.PlayingState.PLAYING, uid, kind))
        await w.client.heartbeat(lambda beat: beat.custom_mode == MISSION_MODE["px4"])


@pytest.mark.parametrize("change", ["current item", "mission"])
async def test_change_of_a_mission_whose_plans_end_was_not_reported_keeps_the_mode(change: str) -> None:
    """QGroundControl chooses the first item at the end."""
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.unreported = frozenset({PLAYING})
        await state(w, COMPLETE, since=0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        mark = w.client.mark()
        if change == "mission":
            await put(w, [takeoff(6.0), way(6.0, 0.0, 6.0)])
        else:
            w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, 0))
        await state(w, NOT_STARTED, since=mark)
        assert (await w.client.heartbeat(lambda beat: True)).custom_mode == HOLD


@pytest.mark.parametrize("command", [(SET_MODE, *PX4_HOLD), (LAND_CMD,), (RTL_CMD,)], ids=["hold", "land", "return"])
async def test_command_at_the_last_item_leaves_a_complete_mission(command: tuple[float, ...]) -> None:
    """A program commands it when that item is reached, and the drone reports the end of its plan later."""
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.late = {PLAYING: 1.5}
        await w.client.wait("MISSION_ITEM_REACHED", lambda m: m.seq == 1, since=0, timeout=30.0)
        mark = w.client.mark()
        assert (await w.client.command(*command)).result == ACCEPTED
        await state(w, COMPLETE, since=mark, timeout=2.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Mission complete", since=mark)


async def test_turn_after_a_file_whose_plans_end_is_not_reported_is_flown() -> None:
    async with world(web=True) as w:
        turn = Item(dialect.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, frame=2)
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0), turn])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        w.drone.faults.unreported = frozenset({PLAYING})
        await state(w, COMPLETE, since=0)
        assert abs(w.drone.pose.yaw - 1.57) < 0.1
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)


async def test_landing_of_another_controller_on_the_way_to_a_landing_place_pauses_the_mission() -> None:
    async with world(speed=1.0, web=True) as w:
        land = Item(dialect.MAV_CMD_NAV_LAND, *around(PLACE, (100.0, 0.0))[0], p4=float("nan"), frame=3)
        await put(w, [takeoff(15.0), way(5.0, 0.0, 15.0), land])
        await start(w)
        await state(w, ACTIVE, seq=2, since=0)
        w.drone.faults.unreported = frozenset({PLAYING})
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 12.0, 20.0)
        mark = w.client.mark()
        another_controller(w, ardrone3.Landing())
        await state(w, PAUSED, since=mark)
        await disarmed(w)
        assert whole(await w.client.wait("MISSION_CURRENT")).mission_state == PAUSED
        assert w.drone.pose.north < 60.0


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_item_whose_report_crosses_a_hold_is_reached(model: str) -> None:
    async with world(speed=1.0, model=model, web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 6.0), WAIT, way(12.0, 12.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0, timeout=60.0)
        w.drone.faults.down = Impairment(delay=0.4)
        lines = w.drone.firmware.flight_plan.items
        wait = next(number for number, line in enumerate(lines) if "DELAY" in line.command.name)
        await w.drone.wait_log(lambda entry: entry.name == EXECUTED and entry.args["idx"] == wait, 90.0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await state(w, COMPLETE, since=mark, timeout=90.0)
        assert reached(w) == [0, 1, 2, 3]


def take_time(monkeypatch: pytest.MonkeyPatch, seconds: float = 1.0) -> asyncio.Event:
    """Let the drone take its time for each file; return what is set once it has begun to."""
    upload_file, has_begun = FlightPlan.upload, asyncio.Event()

    async def slowly(self: FlightPlan, plan: bytes) -> str:
        has_begun.set()
        await asyncio.sleep(seconds)
        return await upload_file(self, plan)

    monkeypatch.setattr(FlightPlan, "upload", slowly)
    return has_begun


@pytest.mark.parametrize("flies", [False, True])
@pytest.mark.parametrize("after", [0.3, 1.2, 1.6, 2.3])
@pytest.mark.parametrize("first", ["mode", "start"])
async def test_second_start_of_an_armed_vehicle_joins_the_first(
    monkeypatch: pytest.MonkeyPatch, first: str, after: float, flies: bool
) -> None:
    take_time(monkeypatch)
    async with world(speed=1.0, web=True) as w:
        if flies:
            await w.take_off(6.0)
        else:
            assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await put(w, CORNERS[flies:])
        w.drone.faults.down = Impairment(delay=0.4)
        commands = [(SET_MODE, *PX4_MISSION), (START, 0, 0)]
        mark = w.client.mark()
        for command in commands if first == "mode" else reversed(commands):
            w.client.send_command(*command)
            await asyncio.sleep(after)  # of the client, between its commands
        found = await until(w.client, mark, 2, 30.0)
        assert [result for _, result in found] == [ACCEPTED, ACCEPTED]
        assert len(w.commands("common.Mavlink.Start")) == 1


@pytest.mark.parametrize("after", [0.3, 1.2])
async def test_item_that_is_chosen_while_a_start_prepares_is_flown(
    monkeypatch: pytest.MonkeyPatch, after: float
) -> None:
    take_time(monkeypatch)
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, CORNERS)
        mark = w.client.mark()
        w.client.send_command(SET_MODE, *PX4_MISSION)
        await asyncio.sleep(after)  # of the client, between its commands
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 2, 0, timeout=20.0)
        assert ack.result == ACCEPTED
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert 1 not in reached(w, mark)


async def test_present_item_that_is_chosen_again_replaces_another_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first choice is still being uploaded while the drone flies on to the present item."""
    async with world(speed=1.0, web=True) as w:
        await put(w, [takeoff(6.0), *(way(60.0, 20.0 * number, 6.0) for number in range(3))])
        await start(w)
        await state(w, ACTIVE, seq=1, since=0)
        has_begun = take_time(monkeypatch)
        mark = w.client.mark()
        w.client.send_command(CHOOSE, 3)
        await has_begun.wait()
        w.client.send_command(CHOOSE, 1)
        assert (await until(w.client, mark, 2))[1] == (CHOOSE, ACCEPTED)
        assert (await w.client.wait("MISSION_CURRENT")).seq == 1


@pytest.mark.parametrize("command", [(START, 0, 0), (CHOOSE, 0)])
async def test_start_that_waits_for_another_does_not_fly_a_mission_uploaded_meanwhile(
    monkeypatch: pytest.MonkeyPatch, command: tuple[int, ...]
) -> None:
    has_begun = take_time(monkeypatch)
    async with world(speed=1.0, web=True) as w:
        other = await w.connect(sysid=240)
        await w.take_off(6.0)
        await put(w, CORNERS)
        mark = other.mark()
        w.client.send_command(START, 0, 0)
        await has_begun.wait()
        other.send_command(*command)
        await put(w, [takeoff(6.0), way(-10.0, 0.0, 6.0)])
        assert await until(other, mark, 1) == [(command[0], dialect.MAV_RESULT_TEMPORARILY_REJECTED)]
        await said(w, "another was uploaded meanwhile", mark)
        await watched(3.0)
        assert w.commands(common.Start.NAME) == []


async def test_choice_of_the_item_of_a_start_that_fails_is_kept() -> None:
    async with world(speed=1.0, web=True) as w:
        other = await w.connect(sysid=240)
        await w.take_off(6.0)
        await put(w, CORNERS)
        w.drone.faults.unreported = frozenset({PLAYING})
        w.client.send_command(CHOOSE, 0)
        w.client.send_command(SET_MODE, *PX4_MISSION)
        mark, begun = w.client.mark(), on_command(w, common.Start.NAME, lambda: None)
        w.client.send_command(CHOOSE, 2)
        await begun
        assert (await other.command(CHOOSE, 2, timeout=60.0)).result == ACCEPTED
        assert (CHOOSE, dialect.MAV_RESULT_FAILED) in results(w.client, mark)
        assert (await w.client.wait("MISSION_CURRENT")).seq == 2


async def test_choice_of_the_item_of_a_start_that_fails_is_newer_than_a_start_that_waits_too() -> None:
    async with world(speed=1.0, web=True) as w:
        second, third = await w.connect(sysid=240), await w.connect(sysid=241)
        await w.take_off(6.0)
        await put(w, [takeoff(6.0), *(way(60.0, 20.0 * number, 6.0) for number in range(3))])
        w.drone.faults.unreported = frozenset({PLAYING})
        w.client.send_command(CHOOSE, 1)
        w.client.send_command(SET_MODE, *PX4_MISSION)
        begun = on_command(w, common.Start.NAME, lambda: None)
        w.client.send_command(CHOOSE, 3)
        await begun
        seconds, mark = second.mark(), third.mark()
        second.send_command(START)
        await being_tried(second, seconds, START)
        third.send_command(CHOOSE, 3)
        await being_tried(third, mark, CHOOSE)
        w.drone.faults.unreported = frozenset()
        assert await until(third, mark, 1, 60.0) == [(CHOOSE, ACCEPTED)]
        assert (await third.wait("MISSION_CURRENT")).seq == 3


@pytest.mark.parametrize("by", ["start", "current"])
@pytest.mark.parametrize("after", [0.3, 1.2, 1.6])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_second_start_joins_the_one_under_way(
    monkeypatch: pytest.MonkeyPatch, flavour: str, by: str, after: float
) -> None:
    """ArduPilot's operators choose Auto, arm, and send MISSION_START; a drone takes its time for a file."""
    take_time(monkeypatch)
    async with world(speed=1.0, flavour=flavour, web=True) as w:
        await put(w, CORNERS)
        w.drone.faults.down = Impairment(delay=0.4)
        mode = (1, MISSION_MODE[flavour]) if flavour == "ardupilot" else PX4_MISSION
        assert (await w.client.command(SET_MODE, *mode)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        await asyncio.sleep(after)  # of the client, between its commands
        if by == "start":
            assert (await w.client.command(START, 0, 0, timeout=20.0)).result == ACCEPTED
        else:
            w.client.send(newer.MAVLink_mission_set_current_message(1, 1, int(flavour == "ardupilot")))
        await state(w, ACTIVE, seq=1, since=mark)
        assert len(w.commands("common.Mavlink.Start")) == 1


@pytest.mark.parametrize("descent", [LAND_CMD, RTL_CMD])
@pytest.mark.parametrize("items", [[takeoff(6.0), way(12.0, 0.0, 400.0)], [takeoff(2.0)]], ids=["high", "nothing"])
async def test_refused_mission_ends_no_descent(descent: int, items: list[Item]) -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(20.0)
        await put(w, items)
        await refused_in(w, descent, PX4_MISSION)


@pytest.mark.parametrize("descent", [LAND_CMD, RTL_CMD])
async def test_mission_outside_the_fence_ends_no_descent(descent: int) -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(20.0)
        await put(w, [takeoff(6.0), way(200.0, 0.0, 20.0)])
        assert (await upload(w.client, square(PLACE, 100.0), FENCE)).type == 0
        await refused_in(w, descent, PX4_MISSION)


@pytest.mark.parametrize("descent", [LAND_CMD, RTL_CMD])
async def test_refused_offboard_ends_no_descent(descent: int) -> None:
    """Sticks that follow the camera fly no setpoints."""
    async with world(speed=1.0) as w:
        await w.take_off(20.0)
        style = piloting_style.PilotingStyleStyle.CAMERA_OPERATED
        another_controller(w, piloting_style.SetStyle(style))
        pilot = await w.connect(254)
        async with streaming(pilot, local(VELOCITY_ONLY, v=(1.0, 0.0, 0.0))):
            await refused_in(w, descent, PX4_OFFBOARD)


async def refused_in(w: World, descent: int, mode: tuple[int, int, int]) -> None:
    """A mode that is requested in a landing or return is refused, and that goes on."""
    assert (await w.client.command(descent)).result == ACCEPTED
    shown = w.modes.land if descent == LAND_CMD else w.modes.returning
    await w.client.heartbeat(lambda beat: beat.custom_mode == shown)
    await watched(0.5)
    commands = len(sent(w))
    assert (await w.client.command(SET_MODE, *mode)).result not in (ACCEPTED, IN_PROGRESS)
    await watched(1.5)
    assert sent(w)[commands:] == []
    assert (await w.client.heartbeat(lambda beat: True)).custom_mode == shown


def sent(w: World) -> list[str]:
    """The commands that move the drone, without its sticks at rest."""
    entries = [entry for entry in w.drone.log if entry.kind == "command"]
    return [entry.name for entry in entries if entry.name.startswith(("ardrone3.Piloting.", "rth.")) and moves(entry)]


def moves(entry: Any) -> bool:
    return not entry.name.endswith("PCMD") or any(entry.args[axis] for axis in ("roll", "pitch", "yaw", "gaz"))


async def test_own_return_of_the_drone_that_the_start_of_a_mission_ends_is_reported() -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(8.0)
        await put(w, CORNERS)
        mark = w.client.mark()

        def begin() -> None:  # just before the drone receives the start
            assert w.drone.firmware.homing.request(StateReason.LOW_BATTERY, w.drone.firmware.pose, False)

        begun = on_command(w, common.Start.NAME, begin)
        assert (await w.client.command(SET_MODE, *PX4_MISSION, timeout=30.0)).result != ACCEPTED
        await begun
        await said(w, "Return stopped by a command: low battery", mark)
        await said(w, "No automatic return: battery ", mark)


async def test_mission_that_replaces_one_that_waits_for_arming_says_so() -> None:
    async with world(web=True) as w:
        await put(w, CORNERS)
        assert (await w.client.command(SET_MODE, *PX4_MISSION)).result == ACCEPTED
        mark = w.client.mark()
        await put(w, [takeoff(6.0), way(9.0, 0.0, 6.0)])
        await said(w, "Mission not started", mark)


@pytest.mark.parametrize("is_faulty", [True, False])
async def test_mission_that_waited_for_arming_is_not_started_unready_or_disarmed(
    monkeypatch: pytest.MonkeyPatch, is_faulty: bool
) -> None:
    """The drone takes its time for the file: it becomes unfit to take off meanwhile, or the armed state expires."""
    has_begun = take_time(monkeypatch, 5.0 if is_faulty else 14.0)
    async with world(speed=1.0, web=True) as w:
        await put(w, CORNERS)
        assert (await w.client.command(SET_MODE, *PX4_MISSION)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await has_begun.wait()
        if is_faulty:
            w.drone.faults.refuse_take_off = frozenset({TakeoffChecklistType.VCAM})
        reason = "PreArm: vcam" if is_faulty else "Mission refused: armed state has expired"
        await w.client.wait("STATUSTEXT", lambda m: m.text == reason, since=mark, timeout=20.0)
        assert w.commands("common.Mavlink.Start") == []


@pytest.mark.parametrize("late", [{PLAYING: 0.5}, {PLAYING: 0.5, EXECUTED: 0.5}, {PLAYING: 0.5, EXECUTED: 0.8}])
@pytest.mark.parametrize("stands_there", [False, True])
async def test_return_by_the_plan_is_the_missions_before_its_start_is_reported(
    late: dict[str, float], stands_there: bool
) -> None:
    """At the place of its last way point the drone returns at once, maybe before it has reported the plan."""
    async with world(speed=1.0, web=True) as w:
        await write(w.client, "ANF_RTL_END", 1, dialect.MAV_PARAM_TYPE_INT32)
        await w.take_off(6.0)
        await put(w, [way(0.0 if stands_there else 6.0, 0.0, 6.0), RTL])
        w.drone.faults.late = late
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0, timeout=10.0)).result == 0
        await state(w, COMPLETE, since=mark, timeout=20.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Return ended"), since=mark, timeout=30.0)
        sent = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert sent.count("Return: hovers at home") == 1
        assert not [text for text in sent if "paused" in text or "refused" in text]
        assert [e.args["state"] for e in w.drone.log if e.name == "plan"] == ["playing", "stopped"]
        assert not [e for e in w.drone.log if e.name == rth.Abort.NAME]


@pytest.mark.parametrize("task", ["orbit", "mission"])
async def test_newer_fence_across_the_way_is_not_entered(task: str) -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(10.0)
        if task == "orbit":
            centre = around(PLACE, (20.0, 0.0))[0]
            place = {"x": centre[0], "y": centre[1], "z": HOME[2] + 10.0}
            ack = await w.client.command(dialect.MAV_CMD_DO_ORBIT, 20.0, 5.0, 0, float("nan"), frame=0, **place)
            assert ack.result == ACCEPTED
        else:
            await put(w, [way(0.0, 0.0, 10.0), way(60.0, 0.0, 10.0)])
            assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 5.0, 20.0)
        mark = w.client.mark()
        zone = square(around(PLACE, (40.0, 0.0))[0], 12.0, inclusion=False)
        assert (await upload(w.client, zone, FENCE)).type == 0
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Fence hold"), since=mark, timeout=30.0)
        await watched(5.0)
        poses = [entry.args for entry in w.drone.log if entry.kind == "pose"]
        assert not [pose for pose in poses if pose["north"] > 28.0 and abs(pose["east"]) < 12.0]


ZONE = square(around(PLACE, (40.0, 0.0))[0], 12.0, inclusion=False)


async def stays_out(w: World) -> None:
    """The drone holds before `ZONE`."""
    await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Fence hold"), timeout=30.0)
    await watched(5.0)
    assert max(entry.args["north"] for entry in w.drone.log if entry.kind == "pose") < 28.0


async def test_circle_around_a_home_that_is_set_on_the_way_is_not_left() -> None:
    """It moves with home: the way that was inside of it leads out of it now."""
    async with world(speed=1.0, web=True) as w:
        circle = Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION + 2, 0.0, 0.0, p1=60.0, frame=3)
        assert (await upload(w.client, [circle], FENCE)).type == 0
        await w.take_off(10.0)
        await put(w, [way(0.0, 0.0, 10.0), way(55.0, 0.0, 10.0)])
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 5.0, 20.0)
        mark = w.client.mark()
        south = around(PLACE, (-20.0, 0.0))[0]
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_HOME, 0, x=south[0], y=south[1], z=HOME[2])
        assert ack.result == ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Fence hold"), since=mark, timeout=30.0)
        await watched(5.0)
        assert max(entry.args["north"] for entry in w.drone.log if entry.kind == "pose") < 40.0


async def test_fence_that_is_uploaded_while_a_start_prepares_is_not_entered(monkeypatch: pytest.MonkeyPatch) -> None:
    has_begun = take_time(monkeypatch)
    async with world(speed=1.0, web=True) as w:
        await w.take_off(10.0)
        await put(w, [way(0.0, 0.0, 10.0), way(60.0, 0.0, 10.0)])
        w.client.send_command(START, 0, 0)
        await has_begun.wait()
        assert (await upload(w.client, ZONE, FENCE)).type == 0
        await stays_out(w)


async def test_fence_whose_action_is_set_on_the_way_is_not_entered() -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(10.0)
        assert (await upload(w.client, ZONE, FENCE)).type == 0
        await write(w.client, "GF_ACTION", 0, 6)
        await put(w, [way(0.0, 0.0, 10.0), way(60.0, 0.0, 10.0)])
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 5.0, 20.0)
        await write(w.client, "GF_ACTION", 2, 6)
        await stays_out(w)


async def test_newer_fence_behind_many_way_points_is_not_entered() -> None:
    """A long way is judged some points at a time."""
    async with world(speed=1.0, web=True) as w:
        await w.take_off(10.0)
        await put(w, [way(float(north), 0.0, 10.0) for north in range(61)])
        assert (await w.client.command(START, 0, 0, timeout=20.0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 5.0, 40.0)
        assert (await upload(w.client, ZONE, FENCE)).type == 0
        await stays_out(w)


async def test_newer_fence_around_the_way_disturbs_no_mission() -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(10.0)
        await put(w, [way(0.0, 0.0, 10.0), way(40.0, 0.0, 10.0), way(40.0, 20.0, 10.0)])
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 5.0, 20.0)
        corners = around(PLACE, (43.0, -10.0), (43.0, 23.0), (-10.0, 23.0), (-10.0, -10.0))
        assert (await upload(w.client, polygon(corners), FENCE)).type == 0
        await state(w, COMPLETE, since=0, timeout=60.0)
        assert (w.drone.pose.north, w.drone.pose.east) == pytest.approx((40.0, 20.0), abs=2.0)


async def test_distance_and_number_of_the_next_way_point_are_reported() -> None:
    async with world(flavour="ardupilot", web=True, speed=1.0) as w:
        w.client.send(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
        await put(w, [takeoff(8.0), way(60.0, 0.0, 8.0), way(160.0, 0.0, 8.0)])
        await start(w)
        await w.drone.wait_log(lambda entry: w.drone.pose.north > 20.0, 60.0)
        output = await w.client.wait("NAV_CONTROLLER_OUTPUT")
        assert output.wp_dist == pytest.approx(60.0 - w.drone.pose.north, abs=8.0)
        assert output.target_bearing == pytest.approx(0, abs=2)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 235)).result == ACCEPTED
        message = await w.client.wait("HIGH_LATENCY2", since=mark)
        assert message.wp_num == 2  # behind home and the take-off
        assert message.target_distance * 10 == pytest.approx(60.0 - w.drone.pose.north, abs=10.0)


SQUARE = [way(9.0, 0.0, 6.0), way(9.0, 9.0, 6.0), way(0.0, 9.0, 6.0), way(0.0, 0.0, 6.0)]


@pytest.mark.parametrize("is_uploaded", [False, True], ids=["restarted", "replaced"])
async def test_line_of_the_file_before_that_is_reported_late_is_none_of_the_new_file(is_uploaded: bool) -> None:
    """The report has the number of a line alone, here that of the last line of the new file."""
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE)
        w.drone.faults.late = {EXECUTED: 0.8}
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda entry: entry.name == "item" and entry.args["index"] == 3, 40.0)
        mark = w.client.mark()
        if is_uploaded:
            await put(w, [way(-6.0, 0.0, 6.0), way(-6.0, -6.0, 6.0), way(0.0, -6.0, 6.0)])
            assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        else:
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 1)).result == ACCEPTED
        begun = w.drone.log[-1].t
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", 60.0, since=begun)
        seen = [whole(m).mission_state for _, m in w.client.since(mark, "MISSION_CURRENT")]
        assert COMPLETE not in seen
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == ([0, 1, 2] if is_uploaded else [1, 2, 3])


async def test_line_of_the_file_before_that_is_reported_twice_is_none_of_the_new_file() -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE)
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await state(w, ACTIVE, seq=3, since=0)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 1)).result == ACCEPTED
        w.drone.inject(common.MissionItemExecuted(2))
        begun = w.drone.log[-1].t
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", 60.0, since=begun)
        await state(w, COMPLETE, since=w.client.mark())
        assert reached(w, mark) == [1, 2, 3]


async def found_flying(w: World) -> None:
    """`SQUARE` is flown while the link is lost for some seconds, in which the drone passes an item."""
    await write(w.client, "ANF_MIS_RTH", 0, dialect.MAV_PARAM_TYPE_INT32)
    await w.take_off(6.0)
    await put(w, SQUARE)
    assert (await w.client.command(START, 0, 0)).result == ACCEPTED
    await state(w, ACTIVE, seq=1, since=0)
    mark = w.client.mark()
    w.drone.faults.mute = True
    await w.drone.wait_log(lambda entry: entry.name == "item" and entry.args["index"] == 2, 40.0)
    w.drone.faults.mute = False
    await said(w, "Mission flying: at item 2 or later", mark)


async def test_item_that_the_drone_has_passed_without_a_link_is_flown_to_again_when_it_is_chosen() -> None:
    """After the loss of the link it is the last known item: the drone does not report how far it is."""
    async with world(speed=1.0, web=True) as w:
        await found_flying(w)
        begun = w.drone.log[-1].t
        assert (await w.client.command(CHOOSE, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "playing", 10.0, since=begun)
        mark = w.client.mark()
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert reached(w, mark) == [1, 2, 3]


async def test_line_of_a_file_that_another_controller_has_resumed_is_none_of_the_new_file() -> None:
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE)
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await state(w, ACTIVE, seq=1, since=0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        (command,) = w.commands(common.Start.NAME)
        another_controller(w, common.Start(**command.args))
        await said(w, "Mission resumed by another controller")
        w.drone.faults.late = {EXECUTED: 0.8}
        await w.drone.wait_log(lambda entry: entry.name == "item" and entry.args["index"] == 3, 40.0)
        mark, begun = w.client.mark(), w.drone.log[-1].t
        assert (await w.client.command(CHOOSE, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "plan" and e.args["state"] == "stopped", 60.0, since=begun + 2.0)
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert reached(w, mark) == [0, 1, 2, 3]


async def test_way_point_of_the_file_before_that_is_reported_late_as_skipped_is_none_of_the_new_file() -> None:
    async with world(speed=1.0, model="ai", web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE)
        assert (await w.client.command(START, 0, 0, timeout=20.0)).result == ACCEPTED
        await state(w, ACTIVE, seq=1, since=0)
        mark = w.client.mark()
        await put(w, [way(0.0, 9.0, 6.0), way(6.0, 9.0, 6.0)])
        assert (await w.client.command(START, 0, 0, timeout=20.0)).result == ACCEPTED
        w.drone.inject(flight_plan.WaypointSkipped(1))
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert reached(w, mark) == [0, 1]
        assert not [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "skipped" in m.text]


@pytest.mark.parametrize("is_replaced", [False, True], ids=["again", "replaced"])
async def test_mission_starts_after_one_whose_end_is_never_reported(is_replaced: bool) -> None:
    """A drone that flies no plan has no state to report when one is to be stopped."""
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE[:2])
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        w.drone.faults.unreported = frozenset({PLAYING})
        await state(w, COMPLETE, since=mark)
        if is_replaced:
            await put(w, SQUARE[2:])
        begun = w.drone.log[-1].t

        def starts(entry: Any) -> bool:
            if (entry.kind, entry.name) != ("command", common.Start.NAME):
                return False
            w.drone.faults.unreported = frozenset()
            return True

        started = asyncio.ensure_future(w.drone.wait_log(starts, 30.0, since=begun))
        assert (await w.client.command(START, 0, 0, timeout=30.0)).result == ACCEPTED
        await started
        mark = w.client.mark()
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [0, 1]


@pytest.mark.parametrize("unreported", [{PLAYING, EXECUTED}, {PLAYING}], ids=["no lines", "all lines"])
async def test_return_of_a_plan_whose_end_is_not_reported_completes_the_mission(unreported: set[str]) -> None:
    """The drone names its plan as the reason of the return; after it the mode is that of a drone that hovers."""
    async with world(speed=2.0, web=True) as w:
        await write(w.client, "ANF_RTL_END", 1, dialect.MAV_PARAM_TYPE_INT32)
        await w.take_off(6.0)
        await put(w, [*SQUARE[:2], RTL])
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        w.drone.faults.unreported = frozenset(unreported)
        await state(w, COMPLETE, since=mark)
        assert w.drone.firmware.homing.active
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Return ended"), since=mark, timeout=30.0)
        mark = w.client.mark()
        await watched(3.0)
        assert {m.custom_mode for _, m in w.client.since(mark, "HEARTBEAT") if m.get_srcComponent() == 1} == {HOLD}
        assert not [m.text for _, m in w.client.since(0, "STATUSTEXT") if "paused" in m.text]


@pytest.mark.parametrize("late", [0.3, 1.5])
async def test_line_that_is_reported_before_its_plan_is_reached(late: float) -> None:
    """The drone stands at the first way point, and reports that before it reports that it flies the plan."""
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, [way(0.0, 0.0, 6.0), *SQUARE[:2]])
        w.drone.faults.late = {PLAYING: late}
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [0, 1, 2]


async def test_line_before_the_report_of_its_plan_is_none_of_a_plan_that_ended_long_ago() -> None:
    """The earlier plan was stopped before its first line."""
    async with world(speed=1.0, web=True) as w:
        await w.take_off(6.0)
        await put(w, SQUARE)
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await put(w, [way(0.0, 0.0, 6.0), way(1.5, 0.0, 6.0)])
        await watched(3.0)
        w.drone.faults.late = {PLAYING: 1.5}
        mark = w.client.mark()
        assert (await w.client.command(START, 0, 0)).result == ACCEPTED
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [0, 1]
