"""The control of flight as a table: each pair of state and event, and random sequences of events."""

from __future__ import annotations

import itertools
import random
from collections import defaultdict
from collections.abc import Iterator

import pytest

from anafi_mav.vehicle.base.control_machine import (
    ADOPTED,
    TRANSITIONS,
    Attempt,
    DroneAct,
    Event,
    Input,
    Situation,
    State,
    Step,
    step,
)

HOVERS, TASKS = ("guided", "position"), ("goto", "offboard", "mission")
SEQUENCES, LENGTH = 100_000, 7


def situations() -> Iterator[Situation[str]]:
    """Return situations of every state, with every field that a state leaves free."""
    attempts = [None, Attempt("goto", 7, "guided"), Attempt[str](None, 7, "guided", pauses=True)]
    attempts += [Attempt("roi", 7, keeps_below=True), Attempt[str](None, 7, is_urgent=True)]
    acts = (None, DroneAct.LANDING)
    for below, task, is_paused, act, attempt, is_released, successor in itertools.product(
        (None, "guided"), (None, "mission"), (False, True), acts, attempts, (False, True), (None, "offboard")
    ):
        if (act is not None and task is not None) or (attempt is None and is_released):
            continue  # a task ends when the drone acts
        yield Situation(below, task, 3, is_paused, act, attempt, is_released, successor, epoch=7)


def inputs(event: Event, now: Situation[str]) -> Iterator[Input[str]]:
    """Return what an event may be about: of this attempt and of an older one, of each task, of none."""
    match event:
        case Event.REQUEST:
            yield Input(Attempt("goto", 8, "guided"))
            yield Input(Attempt(None, 8))
        case Event.RELEASED | Event.GRANT | Event.FAIL:
            yield Input(Attempt("goto", 2))
            if now.pending is not None:
                yield Input(now.pending)
        case Event.ADOPT:
            yield Input(Attempt("mission", 7))
            yield Input(Attempt(None, 7, "guided"))
            yield Input(Attempt("offboard", 7, keeps_below=True))
            yield Input(Attempt[str](None, 7, "guided", pauses=True))
            yield Input(Attempt(None, 7))
        case Event.SUCCEED | Event.FINISH:
            for task in TASKS:
                yield Input(task=task)
                yield Input(task=task, number=2)
        case Event.DESCEND:
            yield Input(act=DroneAct.RETURN)
            yield Input()
        case Event.GROUND:
            yield Input(task=now.task)
            yield Input()
        case _:
            yield Input()


def require_consistent(before: Situation[str], event: Event, about: Input[str], after: Step[str]) -> None:
    """Assert what holds for each step: no task flies without being shown, none that has ended is active."""
    now, ended = after.situation, set(after.ended)
    gone = {before.task, before.successor} - {now.task, now.successor, None}
    assert gone <= ended | {about.task if event is Event.GROUND else None}, (before, event, about)
    assert not ended & {now.task, now.successor}, (before, event, about)
    assert now.epoch >= before.epoch
    assert now.task is None or now.act is None, (before, event, about)
    if after != Step(before):  # else it is of another attempt, or of a task that is not active
        assert now.state in TRANSITIONS[before.state].get(event, ()), (before, event, about, now)
    assert (after.begun is None) or after.begun == now.task
    if event is Event.FAIL and before.task is None:
        assert now.task is None  # a failed request makes no task active
    if event in (Event.GROUND, Event.LINK_DOWN):
        assert (now.task, now.below, now.is_paused) == (None, None, False)
    if event is Event.DESCEND:
        assert (now.task, now.below) == (None, None)  # nothing flies on when the drone hovers again
    if now.pending is None and now.task is None and now.below is None:
        assert now.shown == (None, None)  # Hold


def test_every_control_pair_leads_where_the_table_leads() -> None:
    reached: dict[tuple[State, Event], set[State]] = defaultdict(set)
    for now, event in itertools.product(situations(), Event):
        for about in inputs(event, now):
            after = step(now, event, about)
            require_consistent(now, event, about, after)
            if event in TRANSITIONS[now.state]:
                reached[now.state, event].add(after.situation.state)
            else:
                assert after == Step(now)
    assert {pair[0] for pair in reached} == set(State)
    for state, row in TRANSITIONS.items():
        for event, targets in row.items():
            assert set(targets) <= reached[state, event] | {state}, (state, event)


def test_late_report_of_older_attempt_changes_nothing() -> None:
    for now in situations():
        for event in (Event.RELEASED, Event.GRANT, Event.FAIL):
            assert step(now, event, Input(Attempt("goto", 2, "guided"))).situation == now


def test_urgent_request_is_replaced_by_none() -> None:
    now: Situation[str] = step(Situation(), Event.REQUEST, Input(Attempt(None, 1, is_urgent=True))).situation
    assert step(now, Event.REQUEST, Input(Attempt("goto", 2))).situation == now


def requested(now: Situation[str], attempt: Attempt[str]) -> Situation[str]:
    for event in (Event.REQUEST, Event.RELEASED):
        now = step(now, event, Input(attempt)).situation
    return now


def granted(now: Situation[str], attempt: Attempt[str]) -> Situation[str]:
    return step(requested(now, attempt), Event.GRANT, Input(attempt)).situation


def test_failed_request_restores_hovering_mode_not_task() -> None:
    now = granted(Situation(), Attempt("mission", 1, "guided"))
    restart = Attempt("mission", 2, "guided")
    pending = requested(now, restart)
    assert (pending.state, pending.task) == (State.ACQUIRING, None)
    assert pending.pending is not None
    assert pending.pending.task == "mission"
    after = step(pending, Event.FAIL, Input(restart)).situation
    assert (after.state, after.task, after.below) == (State.ACTIVE, None, "guided")


def test_take_off_end_makes_newest_successor_active() -> None:
    now = granted(Situation(), Attempt("takeoff", 1, "guided"))
    now = step(now, Event.SUCCEED, Input(task="goto")).situation
    replaced = step(now, Event.SUCCEED, Input(task="offboard"))
    assert replaced.ended == ("goto",)
    after = step(replaced.situation, Event.FINISH, Input(task="takeoff"))
    assert (after.situation.task, after.begun, after.ended) == ("offboard", "offboard", ("takeoff",))
    assert after.situation.below == "guided"


def test_end_of_older_request_leaves_its_task_active_as_successor() -> None:
    now = granted(Situation(), Attempt("mission", 1))
    for successor, over in (("return", "mission"), ("mission", "return")):
        now = step(now, Event.SUCCEED, Input(task=successor)).situation
        now = step(now, Event.FINISH, Input(task=over)).situation
    assert (now.task, now.granted) == ("mission", ADOPTED)
    assert step(now, Event.FINISH, Input(task="mission", number=1)) == Step(now)


def test_request_withdraws_successor_of_take_off() -> None:
    now = step(granted(Situation(), Attempt("takeoff", 1)), Event.SUCCEED, Input(task="goto")).situation
    after = step(now, Event.REQUEST, Input(Attempt(None, 2)))
    assert set(after.ended) == {"takeoff", "goto"}
    assert after.situation.successor is None


@pytest.mark.parametrize("event", [Event.FAIL, Event.HOVER, Event.RESUME])
def test_pause_ends_by_resume_alone(event: Event) -> None:
    now = granted(Situation(), Attempt(None, 1, "guided", pauses=True))
    assert now.state is State.PAUSED
    if event is Event.FAIL:
        attempt = Attempt("goto", 2, "guided")
        now = requested(now, attempt)
        assert now.holds_streams
        now = step(now, event, Input(attempt)).situation
    elif event is Event.HOVER:
        now = step(now, Event.DESCEND, Input(act=DroneAct.RETURN)).situation
        assert now.state is State.DRONE_ACTS
        now = step(now, event).situation
    else:
        now = step(now, event).situation
    assert now.state is (State.ACTIVE if event is Event.RESUME else State.PAUSED)


def test_lost_control_leaves_hold() -> None:
    now = granted(Situation(), Attempt("offboard", 1, "guided"))
    after = step(now, Event.LOSE)
    assert (after.situation.state, set(after.ended)) == (State.IDLE, {"offboard", "guided"})


def test_random_control_sequences_keep_one_owner() -> None:
    draw = random.Random(20261122)
    events, below = list(Event), (None, *HOVERS)
    for _ in range(SEQUENCES):
        now: Situation[str] = Situation()
        attempts: list[Attempt[str]] = []
        live: set[str] = set()
        for _ in range(LENGTH):
            event = draw.choice(events)
            if event in (Event.REQUEST, Event.ADOPT):
                number = now.epoch + 1 if event is Event.REQUEST else now.epoch
                task = draw.choice((None, *TASKS))
                attempts.append(Attempt(task, number, draw.choice(below), draw.random() < 0.2, draw.random() < 0.2))
                about = Input(attempts[-1])
            elif attempts and event in (Event.RELEASED, Event.GRANT, Event.FAIL):
                about = Input(attempts[-1] if draw.random() < 0.8 else draw.choice(attempts))
            else:
                about = Input(task=draw.choice(TASKS), act=DroneAct.LANDING)
                if event is Event.GROUND:
                    about = Input()
            after = step(now, event, about)
            require_consistent(now, event, about, after)
            now = after.situation
            live = (live - set(after.ended)) | ({now.task, now.successor} - {None})  # type: ignore[arg-type]
            assert live <= {now.task, now.successor}  # what has begun and not ended is active


def test_adoption_of_the_active_task_keeps_its_successor() -> None:
    """A take-off that has waited for arming is adopted once it has lifted off; Offboard was to follow it."""
    now = Situation(task="takeoff", granted=3, successor="offboard", epoch=3)
    after = step(now, Event.ADOPT, Input(Attempt("takeoff", ADOPTED, "guided")))
    assert (after.situation.task, after.situation.successor, after.situation.below) == ("takeoff", "offboard", "guided")
    assert after.ended == ()


def test_end_of_an_attempt_keeps_what_was_adopted_since() -> None:
    """A change of speed that the drone refuses: its goto is active again."""
    now = Situation(task="goto", granted=5, epoch=5)
    adopted = step(now, Event.ADOPT, Input(Attempt("goto", ADOPTED, "guided"))).situation
    assert step(adopted, Event.FINISH, Input(task="goto", number=5)).situation.task == "goto"
    assert step(adopted, Event.FINISH, Input(task="goto")).situation.task is None
