"""The table of phases, and which command an event is about: by hand-made sequences, then by random ones."""

from __future__ import annotations

import random

import pytest

from anafi_mav.arsdk.messages import ardrone3, common
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.common import MavlinkType, PlayingState
from anafi_mav.drone.sent_commands import (
    AUTOMATIC,
    KEPT,
    PLAN_MEMORY,
    STAYS_DOWN,
    TAKE_OFF_MEMORY,
    TAKEN_OFF,
    TRANSITIONS,
    Event,
    Phase,
    SentCommand,
    SentCommands,
    Slot,
)

Q, D, C, E, R, W, A = Phase
"""QUEUED, DELIVERED, CONFIRMED, ENDED, REFUSED, WITHDRAWN, ABANDONED."""

NEXT = {  # after DELIVERED, EXECUTED, OVER, REFUSED, WITHDRAWN, ABANDONED
    Q: (D, C, Q, R, W, A),
    D: (D, C, D, R, W, A),
    C: (C, C, E, C, W, C),
    E: (E, E, E, E, E, E),
    R: (R, R, R, R, R, R),
    W: (W, W, E, R, W, W),
    A: (A, C, E, R, W, A),
}


def playing(state: PlayingState, uid: str = "a") -> common.MavlinkFilePlayingStateChanged:
    return common.MavlinkFilePlayingStateChanged(state, uid, MavlinkType.FLIGHT_PLAN)


PLAYING, PAUSED, STOPPED = PlayingState.PLAYING, PlayingState.PAUSED, PlayingState.STOPPED
ERROR = common.StartingErrorEvent()


def flying(state: FlyingState) -> ardrone3.FlyingStateChanged:
    return ardrone3.FlyingStateChanged(state)


def plan(uid: str = "a", before: str = "") -> SentCommand:
    return SentCommand(Slot.PLAN, uid, common.Stop(), plan_before=before)


def launch() -> SentCommand:
    return SentCommand(Slot.LAUNCH, TAKEN_OFF)


@pytest.fixture
def sent() -> SentCommands:
    return SentCommands()


# -- the table


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("event", Event)
@pytest.mark.parametrize("slot", Slot)
def test_every_event_in_every_phase_has_its_next_phase(phase: Phase, event: Event, slot: Slot) -> None:
    one = SentCommand(slot, phase=phase)
    one.apply(event, 5.0)
    assert one.phase is NEXT[phase][list(Event).index(event)]
    closed = one.phase is not phase and one.phase in (W, A)
    assert one.may_begin(5.0) is (one.awaited or (closed and slot in (Slot.LAUNCH, Slot.LANDING_END, Slot.PLAN)))
    assert one.awaited is (one.phase in (Q, D))


def test_table_lists_every_phase_and_each_is_reached() -> None:
    assert list(TRANSITIONS) == list(Phase)
    assert {Q, *(phase for row in TRANSITIONS.values() for phase in row.values())} == {*Phase}


@pytest.mark.parametrize("slot", [Slot.LAUNCH, Slot.PLAN, Slot.POI])
def test_newest_commands_of_a_slot_are_kept(sent: SentCommands, slot: Slot) -> None:
    placed = [SentCommand(slot) for _ in range(2 * KEPT)]
    for command in placed:
        sent.place(command, 0.0)
    assert sent.awaited(slot) == placed[-KEPT:]


# -- take-off


def test_withdrawn_queued_take_off_may_begin_for_ten_seconds(sent: SentCommands) -> None:
    one = launch()
    sent.place(one, 0.0)
    one.apply(Event.WITHDRAWN, 2.0)
    assert sent.may_start_motors(2.0 + TAKE_OFF_MEMORY - 0.1)
    assert not sent.may_start_motors(2.0 + TAKE_OFF_MEMORY)
    assert sent.attribute(flying(FlyingState.TAKINGOFF), 3.0) is one
    assert not sent.is_unwanted(one, 3.0)  # a drone that has lifted off is landed on command only


def test_withdrawn_take_off_is_ruled_out_by_a_delivered_landing(sent: SentCommands) -> None:
    one, other = launch(), plan()
    for command in (one, other):
        sent.place(command, 0.0)
        command.apply(Event.WITHDRAWN, 2.0)
    sent.rule_out()
    assert not sent.may_start_motors(2.1)
    assert sent.attribute(playing(PLAYING), 2.2) is other
    assert sent.is_unwanted(other, 2.2)  # should it begin all the same, it is stopped


def test_motors_after_a_take_off_that_the_drone_has_ignored_are_another_controllers(sent: SentCommands) -> None:
    one = launch()
    sent.place(one, 0.0)
    one.apply(Event.DELIVERED)
    one.delivered_at = 1.0
    assert sent.has_started_motors(9.0)  # awaited still
    one.apply(Event.WITHDRAWN, 1.5)
    assert sent.has_started_motors(2.0)
    assert not sent.has_started_motors(2.1)  # silent for more than a second: refused
    assert sent.attribute(flying(FlyingState.MOTOR_RAMPING), 2.1) is None
    assert not one.answered
    assert sent.attribute(flying(FlyingState.MOTOR_RAMPING), 2.0) is one
    assert sent.has_started_motors(2.1)  # it has reacted


def test_delivered_take_off_is_refused_when_motors_stop(sent: SentCommands) -> None:
    one = launch()
    sent.place(one, 0.0)
    one.apply(Event.DELIVERED)
    for state, phase in (
        (FlyingState.LANDED, D),  # repeated: the drone stood there before
        (FlyingState.MOTOR_RAMPING, D),
        (FlyingState.LANDED, R),
    ):
        assert sent.attribute(flying(state), 1.0) is one
        assert one.phase is phase
    assert not sent.may_start_motors(1.0)


def test_cut_motors_refuse_a_take_off_at_once(sent: SentCommands) -> None:
    one = launch()
    sent.place(one, 0.0)
    sent.attribute(flying(FlyingState.EMERGENCY), 1.0)
    assert one.phase is R


def test_late_events_of_a_withdrawn_launch_are_no_refusal_of_the_next(sent: SentCommands) -> None:
    """A disarming stopped the motors; the second TakeOff was sent before the events about the first one arrived."""
    first, second = launch(), launch()
    sent.place(first, 0.0)
    first.apply(Event.DELIVERED)
    sent.withdraw(first, 0.1)
    sent.place(second, 0.2)
    second.apply(Event.DELIVERED)
    sent.attribute(flying(FlyingState.MOTOR_RAMPING), 0.3)
    sent.attribute(flying(FlyingState.LANDED), 0.3)
    assert (first.phase, second.phase) == (E, D)
    sent.attribute(flying(FlyingState.MOTOR_RAMPING), 0.4)
    sent.attribute(flying(FlyingState.LANDED), 0.5)
    assert second.phase is R


def test_executed_take_off_cannot_begin_after_the_touchdown(sent: SentCommands) -> None:
    one = launch()
    sent.place(one, 0.0)
    one.apply(Event.WITHDRAWN, 0.5)
    for state in (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF, FlyingState.LANDING):
        sent.attribute(flying(state), 1.0)
    assert sent.may_start_motors(1.0)
    sent.attribute(flying(FlyingState.LANDED), 4.0)
    assert one.phase is E
    assert not sent.may_start_motors(4.0)


def test_two_take_offs_are_confirmed_by_one_event(sent: SentCommands) -> None:
    first, second = launch(), launch()
    assert sent.place(first, 0.0) == sent.place(second, 0.1) == []
    sent.attribute(flying(FlyingState.TAKINGOFF), 1.0)
    assert (first.phase, second.phase) == (C, C)


def test_take_off_replaces_a_hand_launch_without_stopping_it(sent: SentCommands) -> None:
    """UserTakeOff(0) would end the take-off that follows it."""
    hand = SentCommand(Slot.LAUNCH, TAKEN_OFF | {FlyingState.USERTAKEOFF}, ardrone3.UserTakeOff(0), undo_refused=True)
    sent.place(hand, 0.0)
    assert sent.place(launch(), 0.1) == [hand]
    assert hand.phase is A
    assert not sent.is_unwanted(hand, 0.2)


@pytest.mark.parametrize(("after", "undone"), [(1.0, True), (TAKE_OFF_MEMORY, False)])
def test_failed_take_off_undoes_the_hand_launch_that_it_replaced(
    sent: SentCommands, after: float, undone: bool
) -> None:
    undo = ardrone3.UserTakeOff(0)
    hand, newer = SentCommand(Slot.LAUNCH, TAKEN_OFF | {FlyingState.USERTAKEOFF}, undo, undo_refused=True), launch()
    sent.place(hand, 0.0)
    sent.place(newer, 0.1)
    assert sent.withdraw(newer, 0.1 + after) == (undo if undone else None)
    assert newer.phase is W
    assert hand.phase is (W if undone else A)


@pytest.mark.parametrize("withdrawn", [False, True])
def test_take_off_against_landing_is_unwanted_from_touchdown_on(sent: SentCommands, withdrawn: bool) -> None:
    one = SentCommand(Slot.LANDING_END)
    sent.place(one, 0.0)
    if withdrawn:
        one.apply(Event.WITHDRAWN, 1.0)
    assert sent.attribute(flying(FlyingState.FLYING), 1.5) is None  # in the air it has done its work
    sent.attribute(flying(FlyingState.LANDED), 2.0)
    assert sent.attribute(flying(FlyingState.MOTOR_RAMPING), 2.0 + STAYS_DOWN - 0.1) is one
    assert sent.is_unwanted(one, 2.0 + STAYS_DOWN - 0.1)
    assert sent.attribute(flying(FlyingState.MOTOR_RAMPING), 2.0 + STAYS_DOWN) is None


@pytest.mark.parametrize("newer", [launch(), plan(), SentCommand(Slot.LANDING_END)], ids=lambda one: one.slot.value)
def test_newer_start_makes_running_motors_wanted(sent: SentCommands, newer: SentCommand) -> None:
    one = SentCommand(Slot.LANDING_END)
    sent.place(one, 0.0)
    sent.attribute(flying(FlyingState.LANDED), 1.0)
    sent.place(newer, 2.0)
    assert sent.attribute(flying(FlyingState.MOTOR_RAMPING), 2.1) is not one


# -- flight plans


def test_plan_start_goes_through_its_phases(sent: SentCommands) -> None:
    one = plan()
    sent.place(one, 0.0)
    one.apply(Event.DELIVERED)
    for event, phase in ((PLAYING, C), (PLAYING, C), (PAUSED, E), (PAUSED, E), (STOPPED, E)):
        assert sent.attribute(playing(event), 1.0) is one
        assert one.phase is phase
    assert sent.attribute(playing(PLAYING), 1.0) is None  # resumed by another controller


def test_late_playing_of_a_withdrawn_start_is_unwanted(sent: SentCommands) -> None:
    one = plan()
    sent.place(one, 0.0)
    one.apply(Event.WITHDRAWN, 1.0)
    assert sent.attribute(playing(STOPPED, ""), 1.1) is one  # the answer to the command against it
    for now in (1.2, 1.2, 1.0 + PLAN_MEMORY - 0.1):
        assert sent.attribute(playing(PLAYING), now) is one
        assert sent.is_unwanted(one, now)
    assert sent.attribute(playing(PLAYING), 1.0 + PLAN_MEMORY) is None
    assert sent.attribute(playing(PLAYING, "another's"), 1.3) is None


def test_late_playing_before_a_newer_start_is_not_undone(sent: SentCommands) -> None:
    """The Stop against it would end the newer plan; it is behind the older start anyway."""
    older, newer = plan("a"), plan("b")
    sent.place(older, 0.0)
    older.apply(Event.WITHDRAWN, 1.0)
    sent.place(newer, 1.1)
    assert sent.attribute(playing(PLAYING, "a"), 1.2) is older
    assert not sent.is_unwanted(older, 1.2)
    assert newer.phase is Q
    assert sent.attribute(playing(PLAYING, "b"), 1.3) is newer
    assert newer.phase is C


@pytest.mark.parametrize(
    ("reports", "undecided"),
    [
        ((), True),
        ((STOPPED,), True),  # of the command against it, or of the flight before
        ((PLAYING,), True),  # its report may be repeated until its end is reported
        ((PLAYING, STOPPED), False),
        ((PLAYING, PAUSED), False),
        ((ERROR,), False),
    ],
    ids=["nothing", "stopped", "playing", "playing-stopped", "playing-paused", "error"],
)
def test_withdrawn_start_is_undecided_until_its_end_is_reported(
    sent: SentCommands, reports: tuple[object, ...], undecided: bool
) -> None:
    one = withdrawn_plan(sent)
    one.delivered = True
    for report in reports:
        sent.attribute(playing(report) if isinstance(report, PlayingState) else ERROR, 1.1)
    assert sent.is_undecided("a", 1.2) is undecided
    assert not sent.is_undecided("b", 1.2)
    assert not sent.is_undecided("a", 1.0 + PLAN_MEMORY)


@pytest.mark.parametrize(
    ("event", "undecided"),
    [(None, True), (Event.DELIVERED, True), (Event.EXECUTED, False), (Event.REFUSED, False), (Event.ABANDONED, True)],
)
def test_start_is_undecided_until_it_is_answered(sent: SentCommands, event: Event | None, undecided: bool) -> None:
    one = plan()
    sent.place(one, 0.0)
    if event is not None:
        one.apply(event, 1.0)
    assert sent.is_undecided("a", 1.1) is undecided


@pytest.mark.parametrize(("now", "is_its"), [(20.9, True), (21.0, False)])
def test_unknown_plan_name_is_that_of_the_newest_withdrawn_start(sent: SentCommands, now: float, is_its: bool) -> None:
    one = plan()
    sent.place(one, 0.0)
    one.apply(Event.WITHDRAWN, 21.0 - PLAN_MEMORY)
    assert (sent.attribute(playing(PLAYING, "renamed"), now) is one) is is_its
    assert sent.is_unwanted(one, now) is is_its


def test_plan_that_the_drone_names_otherwise_is_known_by_that_name_until_its_end(sent: SentCommands) -> None:
    one = plan()
    sent.place(one, 0.0)
    for state, phase in ((PLAYING, C), (PLAYING, C), (PAUSED, E)):
        assert sent.attribute(playing(state, "renamed"), 0.1) is one
        assert one.phase is phase
    assert sent.attribute(playing(PLAYING, "renamed"), 0.2) is None


@pytest.mark.parametrize("withdrawn", [False, True])
def test_start_is_in_effect_from_its_report_to_its_end(sent: SentCommands, withdrawn: bool) -> None:
    one = withdrawn_plan(sent) if withdrawn else plan()
    if not withdrawn:
        sent.place(one, 0.0)
    assert sent.in_effect(Slot.PLAN) is None
    sent.attribute(playing(PLAYING), 1.1)
    assert sent.in_effect(Slot.PLAN) is one
    sent.attribute(playing(STOPPED), 1.2)
    assert sent.in_effect(Slot.PLAN) is None


def test_withdrawn_start_that_has_ended_begins_no_second_time(sent: SentCommands) -> None:
    """A PLAYING behind its end is another controller's, which is not stopped."""
    one = withdrawn_plan(sent)
    for state in (PLAYING, STOPPED):
        assert sent.attribute(playing(state), 1.1) is one
    assert one.phase is E
    assert sent.attribute(playing(PLAYING), 1.2) is None
    assert not sent.is_unwanted(one, 1.2)


def test_plan_of_another_controller_ends_a_withdrawn_one(sent: SentCommands) -> None:
    one = withdrawn_plan(sent)
    assert sent.attribute(playing(PLAYING), 1.1) is one
    assert sent.attribute(playing(PLAYING, "another's"), 1.2) is None
    assert sent.in_effect(Slot.PLAN) is None


def test_stopped_of_the_older_plan_leaves_the_newer_playing(sent: SentCommands) -> None:
    older, newer = plan("a"), plan("b")
    for one in (older, newer):
        sent.place(one, 0.0)
        sent.attribute(playing(PLAYING, one.target), 0.1)
    assert (older.phase, newer.phase) == (E, C)
    assert sent.attribute(playing(STOPPED, "a"), 0.2) is older
    assert newer.phase is C
    assert sent.is_executed(Slot.PLAN)
    assert sent.attribute(playing(STOPPED, ""), 0.3) is newer
    assert not sent.is_executed(Slot.PLAN)


def test_stopped_before_a_start_is_answered_says_nothing_of_it(sent: SentCommands) -> None:
    one = plan()
    sent.place(one, 0.0)
    assert sent.attribute(playing(STOPPED), 0.1) is None
    assert one.phase is Q


def lines(sent: SentCommands, *reports: tuple[int, float]) -> list[SentCommand | None]:
    """Return the starts that these lines are attributed to, each reported at a time."""
    return [sent.attribute_line(line, now)[0] for line, now in reports]


def two_plans(sent: SentCommands, *reported: int) -> tuple[SentCommand, SentCommand]:
    """Return a start whose lines were reported so far, and the start that followed it at 10 s."""
    old, new = plan("a"), plan("b", before="a")
    sent.place(old, 0.0)
    sent.attribute(playing(PLAYING, "a"), 1.0)
    lines(sent, *((line, 2.0) for line in reported))
    sent.attribute(playing(STOPPED, "a"), 10.0)
    sent.place(new, 10.0)
    sent.attribute(playing(PLAYING, "b"), 10.0)
    return old, new


def test_line_that_continues_the_plan_before_is_that_plans_for_two_seconds(sent: SentCommands) -> None:
    old, new = two_plans(sent, 0, 1)
    assert lines(sent, (1, 10.4), (2, 10.5), (0, 10.6)) == [old, old, new]
    assert sent.attribute_line(1, 10.7) == (new, False)
    assert sent.attribute_line(3, 10.8) == (old, True)
    assert (old.line, new.line) == (3, 1)
    assert lines(sent, (4, 12.1)) == [new]


def test_line_that_continues_both_plans_is_that_of_the_newer(sent: SentCommands) -> None:
    _, new = two_plans(sent)
    assert lines(sent, (0, 10.5)) == [new]


def test_line_that_continues_no_plan_is_that_of_the_newer(sent: SentCommands) -> None:
    """Lines between may not have been reported."""
    _, new = two_plans(sent, 0, 1)
    assert lines(sent, (4, 10.5)) == [new]


def test_line_before_the_report_of_its_plan_is_that_of_the_awaited_start(sent: SentCommands) -> None:
    old, new, third = *two_plans(sent, 0, 1), plan("c", before="b")
    assert lines(sent, (0, 10.5), (1, 10.6), (2, 10.7)) == [new, new, new]
    sent.place(third, 20.0)
    assert lines(sent, (2, 20.1), (3, 20.2), (0, 20.3), (1, 20.4)) == [new, new, third, third]
    assert (old.line, new.line, third.line) == (1, 3, 1)


def test_line_before_the_report_of_its_plan_continues_no_plan_that_ended_long_ago(sent: SentCommands) -> None:
    _, new = two_plans(sent)
    sent.attribute(playing(STOPPED, "b"), 11.0)
    third = plan("c", before="b")
    sent.place(third, 13.0)
    assert lines(sent, (0, 13.1)) == [third]
    assert (new.line, third.line) == (-1, 0)


def test_line_before_the_report_of_its_plan_is_not_of_a_foreign_plan_that_has_ended(sent: SentCommands) -> None:
    """The foreign plan took it, and the next line was late, as it did not follow the newest one of its plan."""
    sent.attribute(playing(PLAYING, "a"), 1.0)
    new = plan("b", before="a")
    sent.attribute(playing(STOPPED, "a"), 10.0)
    sent.place(new, 10.0)
    assert sent.attribute_line(0, 10.4) == (new, False)
    sent.attribute(playing(PLAYING, "b"), 10.5)
    assert [sent.attribute_line(line, 10.6) for line in (1, 2)] == [(new, False), (new, False)]


def test_line_before_the_report_of_its_plan_is_of_a_foreign_plan_that_plays(sent: SentCommands) -> None:
    sent.attribute(playing(PLAYING, "a"), 1.0)
    new = plan("b", before="a")
    sent.place(new, 10.0)
    sent.attribute_line(0, 10.4)
    assert new.line == -1


@pytest.mark.parametrize("is_ended", [False, True])
def test_line_of_a_plan_from_before_the_session_is_late_for_two_seconds(sent: SentCommands, is_ended: bool) -> None:
    """The drone reports at the connection that it plays a plan, and not how far it is."""
    sent.attribute(playing(PLAYING, "a"), 1.0)
    if is_ended:
        sent.attribute(playing(STOPPED, "a"), 10.0)
    new = plan("b", before="a")
    sent.place(new, 10.0)
    assert sent.attribute(playing(PLAYING, "b"), 10.0) is new
    assert [sent.attribute_line(*line)[1] for line in ((2, 10.5), (0, 10.6), (3, 10.7), (1, 10.8))] == [
        True,
        False,
        True,
        False,
    ]
    assert new.line == 1
    assert sent.attribute_line(4, 12.1) == (new, False)


def test_lines_of_a_paused_plan_that_another_controller_resumes_are_not_late(sent: SentCommands) -> None:
    one = plan("a")
    sent.place(one, 0.0)
    sent.attribute(playing(PLAYING, "a"), 0.1)
    lines(sent, (0, 1.0), (1, 2.0))
    sent.attribute(playing(common.PlayingState.PAUSED, "a"), 2.5)
    sent.attribute(playing(PLAYING, "a"), 3.0)
    assert [sent.attribute_line(*line)[1] for line in ((2, 3.5), (3, 4.0))] == [False, False]
    sent.attribute(playing(common.PlayingState.PAUSED, "a"), 4.1)
    again = plan("a")
    again.line = sent.newest_line("a")
    sent.place(again, 4.2)
    sent.attribute(playing(PLAYING, "a"), 4.3)
    assert again.line == 3
    assert sent.attribute_line(4, 4.5) == (again, False)


def test_skipped_line_is_attributed_like_an_executed_one_and_not_noted_as_executed(sent: SentCommands) -> None:
    old, new = two_plans(sent, 0, 1)
    assert [sent.plan_of_line(line, 10.5) for line in (2, 0, 2)] == [(old, True), (new, False), (old, True)]
    assert (old.line, new.line) == (1, -1)


def test_line_without_a_start_of_ours_is_of_no_start(sent: SentCommands) -> None:
    assert sent.attribute_line(0, 1.0) == (None, False)


@pytest.mark.parametrize(("uid", "confirms"), [("renamed", True), ("", True), ("before", False), ("older", False)])
def test_unknown_plan_name_confirms_the_awaited_start(sent: SentCommands, uid: str, confirms: bool) -> None:
    older, one = plan("older"), plan("a", before="before")
    sent.place(older, 0.0)
    sent.attribute(ERROR, 0.1)
    sent.place(one, 0.2)
    assert (sent.attribute(playing(PLAYING, uid), 0.3) is one) is confirms
    assert one.phase is (C if confirms else Q)


def test_plan_of_another_controller_is_of_no_start(sent: SentCommands) -> None:
    assert sent.attribute(playing(PLAYING), 0.0) is None
    one = plan()
    sent.place(one, 0.0)
    assert sent.attribute(ERROR, 0.1) is one
    assert one.phase is R
    assert sent.attribute(playing(PLAYING), 0.2) is None  # of the same name, and refused to this program
    assert sent.attribute(ERROR, 0.3) is None


def test_error_of_a_withdrawn_start_does_not_refuse_the_newer(sent: SentCommands) -> None:
    older, newer = plan(), plan()
    sent.place(older, 0.0)
    older.apply(Event.DELIVERED)
    older.apply(Event.WITHDRAWN, 1.0)
    sent.place(newer, 1.1)
    assert sent.attribute(ERROR, 1.2) is older
    assert (older.phase, newer.phase) == (R, Q)
    assert sent.attribute(ERROR, 1.3) is newer
    assert newer.phase is R


@pytest.mark.parametrize(
    "answer", [None, playing(PLAYING), playing(STOPPED, "")], ids=["undelivered", "begun", "ended"]
)
def test_error_is_the_newers_when_the_older_is_answered(
    sent: SentCommands, answer: common.MavlinkFilePlayingStateChanged | None
) -> None:
    older, newer = plan(), plan()
    sent.place(older, 0.0)
    if answer is not None:
        older.apply(Event.DELIVERED)
    older.apply(Event.WITHDRAWN, 1.0)
    if answer is not None:
        sent.attribute(answer, 1.05)
    sent.place(newer, 1.1)
    assert sent.attribute(ERROR, 1.2) is newer


def test_replaced_start_is_abandoned_and_ends_with_the_newer(sent: SentCommands) -> None:
    older, newer = plan("a"), plan("b")
    assert sent.place(older, 0.0) == []
    assert sent.place(newer, 0.1) == [older]
    assert older.phase is A
    assert sent.attribute(playing(PLAYING, "a"), 0.2) is older
    assert sent.attribute(playing(PLAYING, "b"), 0.3) is newer
    assert (older.phase, newer.phase) == (E, C)


def test_start_unanswered_at_a_lost_link_is_not_undone(sent: SentCommands) -> None:
    """The session goes on when the drone is heard again; a flight plan goes on without a link."""
    one = plan()
    sent.place(one, 0.0)
    sent.abandon(1.0)
    assert sent.may_start_motors(1.1)
    assert sent.attribute(playing(PLAYING), 4.0) is one
    assert not sent.is_unwanted(one, 4.0)
    sent.clear()
    assert sent.attribute(playing(PLAYING), 4.1) is None


# -- effects to undo


def withdrawn_plan(sent: SentCommands) -> SentCommand:
    """A start sent at 0 s and withdrawn at 1 s; PLAYING counts as its effect until 21 s."""
    one = plan("a")
    sent.place(one, 0.0)
    one.apply(Event.WITHDRAWN, 1.0)
    return one


def test_withdrawn_start_is_unwanted_until_its_report_expires(sent: SentCommands) -> None:
    one = withdrawn_plan(sent)
    assert [sent.is_unwanted(one, now) for now in (1.0, 20.9, 21.0)] == [True, True, False]


@pytest.mark.parametrize("event", [None, Event.DELIVERED, Event.EXECUTED, Event.OVER, Event.REFUSED, Event.ABANDONED])
def test_start_that_is_not_withdrawn_is_never_unwanted(sent: SentCommands, event: Event | None) -> None:
    one = plan("a")
    sent.place(one, 0.0)
    if event is Event.OVER:
        one.apply(Event.EXECUTED)
    if event is not None:
        one.apply(event, 1.0)
    assert not sent.is_unwanted(one, 1.1)


@pytest.mark.parametrize(
    ("events", "unwanted"),
    [
        ((), False),
        ((Event.DELIVERED,), False),
        ((Event.EXECUTED,), False),
        ((Event.EXECUTED, Event.OVER), True),
        ((Event.REFUSED,), True),
        ((Event.WITHDRAWN,), True),
        ((Event.ABANDONED, Event.EXECUTED), False),
        ((Event.ABANDONED, Event.REFUSED), True),
    ],
    ids=lambda events: "-".join(event.value for event in events) or "queued" if isinstance(events, tuple) else "",
)
def test_newer_start_in_force_keeps_the_older_from_being_undone(
    sent: SentCommands, events: tuple[Event, ...], unwanted: bool
) -> None:
    older, newer = withdrawn_plan(sent), plan("b")
    sent.place(newer, 1.1)
    for event in events:
        newer.apply(event, 1.2)
    assert sent.is_unwanted(older, 1.3) is unwanted


def test_newer_start_abandoned_at_a_lost_link_may_be_in_force_for_ten_seconds(sent: SentCommands) -> None:
    older, newer = withdrawn_plan(sent), plan("b")
    sent.place(newer, 1.1)
    sent.abandon(2.0)
    assert [sent.is_unwanted(older, now) for now in (2.0, 11.9, 12.0, 20.9, 21.0)] == [False, False, True, True, False]


@pytest.mark.parametrize("in_force", [0, 1])
def test_newer_start_in_force_counts_beside_one_that_is_not(sent: SentCommands, in_force: int) -> None:
    older, newer = withdrawn_plan(sent), (plan("b"), plan("c"))
    for number, one in enumerate(newer):
        assert sent.is_unwanted(older, 1.1) is (number == 0 or in_force == 1)
        sent.place(one, 1.1)
        one.apply(Event.EXECUTED if number == in_force else Event.REFUSED)
    assert not sent.is_unwanted(older, 1.2)


def test_older_start_in_force_does_not_keep_the_newer(sent: SentCommands) -> None:
    """The Stop against the newer one ends the plan before it, too: that one was ended by its being replaced."""
    older, newer = plan("a"), plan("b")
    sent.place(older, 0.0)
    older.apply(Event.EXECUTED)
    sent.place(newer, 0.5)
    newer.apply(Event.WITHDRAWN, 1.0)
    assert older.phase is C
    assert sent.is_unwanted(newer, 1.1)


def test_command_of_another_slot_does_not_keep_a_withdrawn_start(sent: SentCommands) -> None:
    one = withdrawn_plan(sent)
    sent.place(launch(), 1.1)
    sent.place(SentCommand(Slot.FOLLOW, undo=common.Stop()), 1.2)
    assert sent.is_unwanted(one, 1.3)


def test_newest_command_is_the_last_of_its_slot(sent: SentCommands) -> None:
    older, newer = plan("a"), plan("b")
    sent.place(older, 0.0)
    assert sent.is_newest(older)
    sent.place(launch(), 0.1)
    assert sent.is_newest(older)  # another slot
    sent.place(newer, 0.2)
    assert (sent.is_newest(older), sent.is_newest(newer)) == (False, True)
    newer.apply(Event.REFUSED)
    assert (sent.is_newest(older), sent.is_newest(newer)) == (False, True)  # however it ended


def test_equal_command_is_not_the_newest(sent: SentCommands) -> None:
    """Two starts of one plan are equal in every field; which one is the newest is a matter of identity."""
    older, newer = plan("a"), plan("a")
    for one in (older, newer):
        sent.place(one, 0.0)
        one.apply(Event.WITHDRAWN, 0.0)
    assert not sent.is_newest(older)
    assert sent.is_newest(newer)


# -- any order


@pytest.mark.parametrize("seed", range(20))
def test_random_events_leave_at_most_one_plan_active(seed: int) -> None:
    chance, sent, now = random.Random(seed), SentCommands(), 0.0
    placed: list[SentCommand] = []
    for _ in range(500):
        now += chance.choice((0.0, 0.1, 1.0, 6.0))
        match chance.randrange(6):
            case 0:
                target = TAKEN_OFF if (slot := chance.choice([*Slot])) is Slot.LAUNCH else chance.choice("ab")
                one = SentCommand(slot, target, common.Stop() if slot in AUTOMATIC else None)
                assert all(not old.awaited for old in sent.place(one, now))
                placed.append(one)
            case 1 if placed:
                chance.choice(placed[-KEPT:]).apply(chance.choice((Event.DELIVERED, Event.WITHDRAWN)), now)
            case 2:
                sent.abandon(now)
            case 3:
                about = sent.attribute(flying(chance.choice([*FlyingState])), now)
                assert about is None or about.slot in (Slot.LAUNCH, Slot.LANDING_END)
            case 4:
                sent.attribute(ERROR, now)
            case _:
                about = sent.attribute(playing(chance.choice([*PlayingState]), chance.choice(("a", "b", "c", ""))), now)
                assert about is None or about.slot is Slot.PLAN
                assert about is None or about.phase not in (Q, D)
        for slot in AUTOMATIC:
            assert len(sent.awaited(slot)) <= 1
            assert sum(one.phase is C for one in placed if one.slot is Slot.PLAN) <= 1
        unwanted = [one for one in placed[-KEPT:] if one.phase is not W and sent.is_unwanted(one, now)]
        assert unwanted == []
