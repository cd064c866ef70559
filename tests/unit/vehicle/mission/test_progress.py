"""How far a mission is: by hand, line after line, and what it keeps of itself."""

from __future__ import annotations

import pytest
from support.mission_machine import file

from anafi_mav import mav_enums
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import Course, FlightPlanFile
from anafi_mav.vehicle.mission.effects import DroneReport, Prepared, Reached
from anafi_mav.vehicle.mission.machine import MissionMachine, State
from anafi_mav.vehicle.mission.progress import MissionProgress
from anafi_mav.vehicle.mission.record import MissionRecord


def item(command: int) -> Item:
    return Item(command, 3, (None, None, None, None, 48.0, 2.0, 10.0))


ITEMS = [item(command) for command in (22, 178, 16, 1001, 16, 20)]
# Take-off and the way up are two lines of item 0; item 3 has no line and is done with the line before it.
LEG = FlightPlanFile(b"QGC WPL 120\n" + b"x\n" * 6, (0, 0, 1, 2, 4, 5), ((), (0,), (1,), (2, 3), (4,), (5,)))


def flying() -> MissionProgress:
    return MissionProgress().in_file("name", LEG, -1)


def after(progress: MissionProgress, *lines: int) -> tuple[MissionProgress, list[tuple[int, ...]]]:
    """The progress after these lines, and what was done with each."""
    found = []
    for line in lines:
        progress, done = progress.with_executed(ITEMS, line)
        found.append(done)
    return progress, found


def test_line_after_line() -> None:
    progress = flying()
    reported = []
    for line in range(6):
        progress, done = progress.with_executed(ITEMS, line)
        reported.append((done, progress.current))
    assert reported == [((), 0), ((0,), 1), ((1,), 2), ((2, 3), 4), ((4,), 5), ((5,), 5)]
    assert progress.leg_done


JUMP = Item(mav_enums.MAV_CMD_DO_JUMP, 2, (1.0, 3.0, None, None, None, None, None))


def test_turns_of_loops_are_counted() -> None:
    """With each line that has the jump, also when the drone's report of it was lost."""
    items = [*ITEMS[:3], JUMP]
    leg = FlightPlanFile(b"", (1, 2, 1, 2, 1, 2), ((1,), (2, 3), (1,), (2, 3), (1,), (2, 3)))
    progress, counted = MissionProgress().in_file("", leg, -1), []
    for line in (0, 1, 4, 3):  # 2 and 3 were not received, or too late
        progress, _ = progress.with_executed(items, line)
        counted.append(dict(progress.jumps))
    assert counted == [{}, {3: 1}, {3: 2}, {3: 2}]
    assert MissionProgress().at_item(1).with_done(items, (1, 3)).jumps == {3: 1}


def test_chosen_item_restarts_loops_and_end_clears_them() -> None:
    machine = MissionMachine()
    machine.upload([*ITEMS[:3], JUMP], 7)
    leg = FlightPlanFile(file(1, 2).content, (1, 2), ((1,), (2, 3)))
    attempt = machine.attempt(1)
    machine.prepared(attempt, Prepared(Course((leg,)), "name"))
    machine.granted(attempt)
    machine.playing("name", attempt)
    machine.executed(1)
    assert machine.progress.jumps == {3: 1}
    assert machine.attempt().jumps == {3: 1}
    assert machine.attempt(1).jumps == {}
    machine.halted(stopped=True, report=DroneReport(), now=0.0)
    assert (machine.rest, machine.progress.jumps) == (State.COMPLETE, {})


def test_repeated_or_invalid_line_changes_no_progress() -> None:
    progress, done = after(flying(), 1)
    assert done == [(0,)]
    assert after(progress, 1, 0, -1, 6, 4_000_000_000) == (progress, [()] * 5)
    assert (progress.line, progress.current) == (1, 1)


def test_skipped_lines_are_not_reported_as_reached() -> None:
    """The link was away while items 1 to 3 may have been flown."""
    progress, done = after(flying(), 1, 4)
    assert done == [(0,), (4,)]
    assert progress.current == 5


def test_omitted_item_is_skipped_but_lineless_items_count() -> None:
    progress, _ = after(flying(), 2)
    progress, item = progress.with_skipped(3)
    assert item == 2
    progress, done = after(progress, 3)
    assert done == [(3,)]
    assert progress.with_skipped(9) == (progress, None)


def flown(*lines: int) -> MissionMachine:
    """The mission is flown, and these lines are executed."""
    machine = MissionMachine()
    machine.upload(ITEMS, 7)
    assert (machine.rest, machine.progress.current, machine.first) == (State.READY, 0, 0)
    attempt = machine.attempt()
    machine.prepared(attempt, Prepared(Course((LEG,)), "name"))
    machine.granted(attempt)
    machine.playing("name", attempt)
    for line in lines:
        machine.executed(line)
    return machine


def paused(*lines: int) -> MissionMachine:
    machine = flown(*lines)
    machine.control_lost()
    assert machine.state is State.PAUSED
    return machine


def test_line_executed_before_the_drone_has_heard_of_the_pause_counts() -> None:
    machine = paused(1)
    assert Reached(1) in machine.executed(2)
    assert machine.state is State.PAUSED


def test_paused_mission_completes_no_item() -> None:
    machine = paused(1)
    machine.halted(stopped=False, report=DroneReport(), now=0.0)
    assert machine.executed(2) == []
    assert (machine.state, machine.progress.current) == (State.PAUSED, 1)
    machine.playing("name", None)
    assert Reached(1) in machine.executed(2)


def test_last_line_marks_the_plans_own_end() -> None:
    machine, seen = flown(), []
    for line in range(6):
        seen.append((machine.ending, machine.progress.at_last_line))
        machine.executed(line)
    assert seen == [(False, False)] * 5 + [(True, True)]
    assert machine.ending, "the drone lands by the line that it has executed"


def test_choosing_an_item() -> None:
    machine = paused(3)
    machine.choose(1)
    assert (machine.state, machine.progress.current, machine.progress.leg) == (State.PAUSED, 1, None)
    machine = flown(5)
    machine.halted(stopped=True, report=DroneReport(), now=0.0)
    assert (machine.state, machine.first) == (State.COMPLETE, 0)
    machine.choose(4)
    assert (machine.state, machine.first) == (State.READY, 4)


def test_another_mission() -> None:
    machine = paused(3)
    machine.upload(ITEMS[:2], 8)
    assert (machine.state, machine.progress.current, machine.progress.leg) == (State.READY, 0, None)
    machine.upload((), 0)
    assert machine.state is State.NO_MISSION


PLACE = "\t0\t3\t16\t0\t0\t0\t0\t48.0\t2.0\t10.0\t1"
KEPT = [*ITEMS[:3], JUMP, *ITEMS[4:]]


def kept(following: int | None = None) -> MissionRecord:
    content = "QGC WPL 120\n" + "".join(f"{line}{PLACE}\n" for line in range(6))
    return MissionRecord.of(77, "abc", FlightPlanFile(content.encode(), LEG.origins, LEG.done), 2, following, {3: 2})


def test_mission_record_is_read_as_written() -> None:
    record = kept(5)
    again = MissionRecord.read(record.written, KEPT)
    assert again == record
    assert (again.leg.origins, again.leg.done) == (LEG.origins, LEG.done)
    assert dict(again.jumps) == {3: 2}
    assert MissionRecord.read(kept().written, KEPT) == kept()
    earlier = {key: value for key, value in record.written.items() if key != "jumps"}
    without = MissionRecord.read(earlier, KEPT)
    assert without is not None
    assert without.jumps == ()


def test_mission_record_after_some_lines() -> None:
    behind = kept().flown_up_to(4, {3: 1})
    assert (behind.line, behind.next, behind.jumps) == (5, 4, ((3, 1),))
    assert MissionRecord.read(behind.written, KEPT) == behind


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("line", 6),
        ("line", -2),
        ("origins", [0, 0]),
        ("origins", [0, 0, 1, -2, 4, 5]),
        ("origins", [0, 0, 1, 2, 4, 6]),
        ("done", "x"),
        ("done", [[], [0], [1], [2, 3], [4], [6]]),
        ("done", [[], [0], [1], [2, -1], [4], [5]]),
        ("uid", 3),
        ("more", 1),
        ("next", 6),
        ("next", -1),
        ("jumps", [[3, -1]]),
        ("jumps", [[6, 1]]),
        ("jumps", [[-3, 1]]),
        ("jumps", [[2, 1]]),
        ("content", ""),
        ("content", "QGC WPL 120\n" + "x\n" * 6),
        ("content", "QGC WPL 120\n" + f"0{PLACE}\n" * 5 + f"0{PLACE}\n".replace("48.0", "nan")),
    ],
)
def test_mission_record_with_invalid_values_is_not_read(key: str, wrong: object) -> None:
    """People can write files: each number is looked at before anything is looked up with it."""
    assert MissionRecord.read({**kept().written, key: wrong}, KEPT) is None


def test_mission_record_of_another_length_is_not_read() -> None:
    empty = {"content": "QGC WPL 120\n", "origins": [], "done": [], "line": -1}
    assert MissionRecord.read({**kept().written, **empty}, KEPT) is None
    assert MissionRecord.read(kept().written, KEPT[:5]) is None, "a shorter mission"
    assert MissionRecord.read(None, KEPT) is None
