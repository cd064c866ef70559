"""Arming and take-off as a table: each pair of state and event, and random sequences of events."""

from __future__ import annotations

import itertools
import random
from collections import defaultdict
from typing import Any

import pytest

from anafi_mav.vehicle.takeoff_machine import (
    TRANSITIONS,
    Arming,
    Event,
    RunningTakeoff,
    State,
    TakeoffSituation,
    WaitingTakeoff,
    step,
)

Situation = TakeoffSituation[str]

ARMINGS = (None, Arming(frozenset({"a"}), 20.0), Arming(frozenset({"a", "b"}), None))
ATTEMPTS = (
    None,
    WaitingTakeoff(3.0, "b", 12.0),
    RunningTakeoff("lift", 3.0),
    RunningTakeoff("climb", 3.0, climbs=True),
)
SITUATIONS = [Situation(arming, attempt) for arming, attempt in itertools.product(ARMINGS, ATTEMPTS)]
SEQUENCES, LENGTH = 20_000, 8


def inputs(event: Event) -> dict[str, Any]:
    """Return what an event is about."""
    match event:
        case Event.ARM:
            return {"client": "c", "until": 30.0}
        case Event.STAND:
            return {"until": 30.0}
        case Event.REQUEST:
            return {"attempt": WaitingTakeoff(5.0, "c", 30.0)}
        case Event.START:
            return {"attempt": RunningTakeoff("new", 3.0)}
    return {}


def after(now: Situation, *events: Event) -> Situation:
    for event in events:
        now = step(now, event, **inputs(event))
    return now


def test_every_takeoff_pair_leads_where_the_table_leads() -> None:
    reached: dict[tuple[State, Event], set[State]] = defaultdict(set)
    for now, event in itertools.product(SITUATIONS, Event):
        then = after(now, event)
        if event in TRANSITIONS[now.state]:
            reached[now.state, event].add(then.state)
        else:
            assert then == now
    assert reached == {(state, event): set(to) for state, row in TRANSITIONS.items() for event, to in row.items()}


@pytest.mark.parametrize("now", SITUATIONS)
@pytest.mark.parametrize(
    ("event", "arming"),
    [
        (Event.DISARM, None),
        (Event.GROUND, None),
        (Event.LINK_DOWN, None),
        (Event.ARM, {"c"}),
    ],
)
def test_armed_clients_after_an_event(now: Situation, event: Event, arming: set[str] | None) -> None:
    before = frozenset() if now.arming is None else now.arming.clients
    then = after(now, event).arming
    assert (None if then is None else then.clients) == (None if arming is None else before | arming)


@pytest.mark.parametrize(
    ("events", "deadline"),
    [
        ((), None),
        ((Event.REQUEST,), 30.0),
        ((Event.REQUEST, Event.END), None),
        ((Event.ARM,), 30.0),
        ((Event.ARM, Event.LIFT), None),
        ((Event.ARM, Event.LIFT, Event.STAND), 30.0),
        ((Event.ARM, Event.START, Event.CLIMB), 30.0),
        ((Event.LIFT, Event.STAND), None),
        ((Event.ARM, Event.DISARM, Event.STAND), None),
        ((Event.ARM, Event.GROUND), None),
    ],
)
def test_deadline_after_events(events: tuple[Event, ...], deadline: float | None) -> None:
    assert after(Situation(), *events).deadline == deadline


def test_earlier_deadline_of_arming_and_takeoff_counts() -> None:
    arming, waiting = Arming(frozenset({"a"}), 20.0), WaitingTakeoff(3.0, "b", 12.0)
    assert Situation(arming, waiting).deadline == 12.0
    assert Situation(Arming(arming.clients, 11.0), waiting).deadline == 11.0


def test_takeoff_under_way_stays_when_the_drone_comes_down() -> None:
    now = after(Situation(), Event.ARM, Event.START, Event.GROUND)
    assert (now.state, now.task, now.arming) == (State.LIFTING, "new", None)


def test_waiting_takeoff_ends_when_the_drone_comes_down() -> None:
    assert after(Situation(), Event.REQUEST, Event.GROUND) == Situation()


def test_newer_takeoff_replaces_the_one_under_way() -> None:
    now = after(Situation(attempt=RunningTakeoff("old", 3.0, climbs=True)), Event.START)
    assert (now.state, now.task) == (State.LIFTING, "new")


def test_random_takeoff_events_keep_the_situation_consistent(fuzz_seed: int) -> None:
    chosen = random.Random(fuzz_seed)
    for _ in range(SEQUENCES):
        now = Situation()
        for event in chosen.choices(tuple(Event), k=LENGTH):
            before, now = now, after(now, event)
            assert now.state in TRANSITIONS[before.state].get(event, (before.state,)), (before, event)
            assert (now.task is None) is (now.state not in (State.LIFTING, State.CLIMBING))
            assert now.state is not State.CLIMBING or before.state in (State.LIFTING, State.CLIMBING)
            if event is Event.END:
                assert now.state in (State.DISARMED, State.ARMED)
        assert after(now, Event.LINK_DOWN) == Situation()
