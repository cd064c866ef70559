"""How far a mission is: by hand, line after line, and what it keeps of itself."""

from __future__ import annotations

import pytest

from anafi_mav import mav_enums
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.vehicle.mission.progress import TRANSITIONS, Event, MissionProgress, State
from anafi_mav.vehicle.mission.record import MissionRecord

IMPOSSIBLE = {
    (State.NONE, Event.CHOOSE),
    (State.NONE, Event.BEGIN),
    (State.NONE, Event.STOP),
    (State.NONE, Event.FINISH),
    (State.READY, Event.STOP),
    (State.READY, Event.FINISH),
    (State.ACTIVE, Event.CHOOSE),
    (State.PAUSED, Event.STOP),
    (State.PAUSED, Event.FINISH),
    (State.COMPLETE, Event.STOP),
    (State.COMPLETE, Event.FINISH),
}


def test_every_progress_state_has_its_events() -> None:
    for state in State:
        for event in Event:
            assert ((state, event) in IMPOSSIBLE) is (event not in TRANSITIONS[state]), (state, event)


def item(command: int) -> Item:
    return Item(command, 3, (None, None, None, None, 48.0, 2.0, 10.0))


ITEMS = [item(command) for command in (22, 178, 16, 1001, 16, 20)]
# Take-off and the way up are two lines of item 0; item 3 has no line and is done with the line before it.
LEG = FlightPlanFile(b"QGC WPL 120\n" + b"x\n" * 6, (0, 0, 1, 2, 4, 5), ((), (0,), (1,), (2, 3), (4,), (5,)))


def flying() -> MissionProgress:
    progress = MissionProgress()
    progress.take(ITEMS)
    assert (progress.state, progress.current, progress.first) == (State.READY, 0, 0)
    progress.begin(LEG)
    return progress


def test_line_after_line() -> None:
    progress = flying()
    told = [(progress.executed(line), progress.current) for line in range(6)]
    assert told == [((), 0), ((0,), 1), ((1,), 2), ((2, 3), 4), ((4,), 5), ((5,), 5)]
    assert progress.leg_done
    progress.finish()
    assert (progress.state, progress.first) == (State.COMPLETE, 0)


JUMP = Item(mav_enums.MAV_CMD_DO_JUMP, 2, (1.0, 3.0, None, None, None, None, None))


def test_turns_of_loops_are_counted() -> None:
    """With each line that has the jump, also when the drone's word for it was lost; a chosen item begins them anew."""
    progress = MissionProgress()
    progress.take([*ITEMS[:3], JUMP])
    progress.begin(FlightPlanFile(b"", (1, 2, 1, 2, 1, 2), ((1,), (2, 3), (1,), (2, 3), (1,), (2, 3))))
    progress.executed(0)
    assert progress.jumps == {}
    progress.executed(1)
    assert progress.jumps == {3: 1}
    progress.executed(4)  # 2 and 3 were not heard
    assert progress.jumps == {3: 2}
    progress.executed(3)
    assert progress.jumps == {3: 2}
    progress.stop()
    progress.choose(1, anew=False)
    assert progress.jumps == {3: 2}
    progress.choose(1)
    assert progress.jumps == {}
    progress.fly(1)
    progress.did((1, 3))
    assert progress.jumps == {3: 1}
    progress.finish()
    assert progress.jumps == {}


def test_repeated_or_invalid_line_changes_no_progress() -> None:
    progress = flying()
    assert progress.executed(1) == (0,)
    for line in (1, 0, -1, 6, 4_000_000_000):
        assert progress.executed(line) == ()
    assert (progress.line, progress.current) == (1, 1)


def test_skipped_lines_are_not_reported_as_reached() -> None:
    """The link was away while items 1 to 3 may have been flown."""
    progress = flying()
    progress.executed(1)
    assert progress.executed(4) == (4,)
    assert progress.current == 5


def test_omitted_item_is_skipped_but_lineless_items_count() -> None:
    progress = flying()
    progress.executed(2)
    assert progress.skip(3) == 2
    assert progress.executed(3) == (3,)
    assert progress.skip(9) is None


def test_paused_mission_completes_no_item() -> None:
    progress = flying()
    progress.executed(1)
    progress.stop()
    assert progress.executed(2) == ()
    assert (progress.state, progress.current) == (State.PAUSED, 1)
    progress.begin(LEG, progress.line)
    assert progress.executed(2) == (1,)


def test_last_line_marks_the_plans_own_end() -> None:
    progress = flying()
    seen = []
    for line in range(6):
        seen.append((progress.ending, progress.at_last_line))
        progress.executed(line)
    assert seen == [(False, False)] * 5 + [(True, True)]
    assert not progress.ending, "done"


def test_choosing_an_item() -> None:
    progress = flying()
    progress.executed(3)
    progress.stop()
    progress.choose(1)
    assert (progress.state, progress.current, progress.leg) == (State.PAUSED, 1, None)
    for wrong in (-1, 6):
        with pytest.raises(ValueError, match="no item"):
            progress.choose(wrong)
    progress.begin(LEG, 5)
    progress.finish()
    progress.choose(4)
    assert (progress.state, progress.first) == (State.READY, 4)


def test_another_mission() -> None:
    progress = flying()
    progress.executed(3)
    progress.take(ITEMS[:2])
    assert (progress.state, progress.current, progress.leg) == (State.READY, 0, None)
    progress.take([])
    assert progress.state is State.NONE


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
