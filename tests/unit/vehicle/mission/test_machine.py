"""The flight of a mission as a machine: every pair of state and event, and random sequences of events."""

from __future__ import annotations

import random

import pytest
from support.mission_machine import (
    FAILURE,
    GONE,
    ITEMS,
    LAST,
    NOW,
    RandomFlight,
    calls,
    flying,
    in_state,
    loaded,
    starting,
    taking_over,
)

from anafi_mav.vehicle.mission.effects import Effect, Release, Select, Work
from anafi_mav.vehicle.mission.machine import FLYING, TRANSITIONS, Event, State

S, E = State, Event
WAITING = (S.NO_MISSION, S.READY, S.PAUSED, S.COMPLETE)


def names(effects: list[Effect]) -> str:
    return " ".join(type(effect).__name__ for effect in effects)


EXPECTED: dict[State, dict[Event, tuple[State, str]]] = {
    S.NO_MISSION: {
        E.UPLOADED: (S.READY, ""),
        E.CLEARED: (S.NO_MISSION, ""),
        E.OTHER_PLAYING: (S.NO_MISSION, "SendText"),
        E.LINK_DOWN: (S.NO_MISSION, ""),
    },
    S.READY: {
        E.UPLOADED: (S.READY, "Persist"),
        E.CLEARED: (S.NO_MISSION, "Persist"),
        E.UPLOADED_AGAIN: (S.READY, "Persist"),
        E.CHOSEN: (S.READY, ""),
        E.ENGAGED: (S.AWAIT_ARM, "Select"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.RESUMED: (S.FLYING_FILE, "Select SendText Persist"),
        E.OTHER_PLAYING: (S.READY, "SendText"),
        E.LINK_DOWN: (S.READY, ""),
        E.LINK_UP: (S.READY, ""),
    },
    S.AWAIT_ARM: {
        E.UPLOADED: (S.READY, "Persist SendText Release"),
        E.CLEARED: (S.NO_MISSION, "Persist SendText Release"),
        E.UPLOADED_AGAIN: (S.AWAIT_ARM, "Persist"),
        E.CHOSEN: (S.AWAIT_ARM, ""),
        E.ENGAGED: (S.AWAIT_ARM, "Select"),
        E.ARMED: (S.PREPARING, "Prepare"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.RESUMED: (S.FLYING_FILE, "Select SendText Persist"),
        E.OTHER_PLAYING: (S.AWAIT_ARM, "SendText"),
        E.CONTROL_LOST: (S.READY, ""),
        E.TIMEOUT: (S.READY, "Release SendText"),
        E.LINK_DOWN: (S.READY, ""),
    },
    S.PREPARING: {
        E.UPLOADED: (S.READY, "Persist SendText Release"),
        E.CLEARED: (S.NO_MISSION, "Persist SendText Release"),
        E.UPLOADED_AGAIN: (S.PREPARING, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.FAILED: (S.READY, "SendText Release"),
        E.OTHER_PLAYING: (S.PREPARING, "SendText"),
        E.CONTROL_LOST: (S.READY, ""),
        E.LINK_DOWN: (S.READY, ""),
    },
    S.TAKING_OVER: {
        E.UPLOADED: (S.READY, "Persist Release"),
        E.CLEARED: (S.NO_MISSION, "Persist Release"),
        E.UPLOADED_AGAIN: (S.TAKING_OVER, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.GRANTED: (S.STARTING, "Select StartFile"),
        E.FAILED: (S.READY, "Release"),
        E.LINK_DOWN: (S.READY, ""),
    },
    S.STARTING: {
        E.UPLOADED: (S.READY, "Persist Suspend Release"),
        E.CLEARED: (S.NO_MISSION, "Persist Suspend Release"),
        E.UPLOADED_AGAIN: (S.STARTING, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Suspend Acquire"),
        E.FAILED: (S.READY, "Release"),
        E.PLAYING: (S.FLYING_FILE, "Persist"),
        E.CONTROL_LOST: (S.READY, "Suspend"),
        E.LINK_DOWN: (S.READY, ""),
    },
    S.FLYING_FILE: {
        E.UPLOADED: (S.READY, "Persist SendText Suspend Release"),
        E.CLEARED: (S.NO_MISSION, "Persist SendText Suspend Release"),
        E.UPLOADED_AGAIN: (S.FLYING_FILE, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Suspend Acquire Persist"),
        E.CONFIRMED: (S.FLYING_FILE, "Announce"),
        E.FAILED: (S.PAUSED, "SendText Release Persist"),
        E.OTHER_PLAYING: (S.PAUSED, "SendText Release Persist"),
        E.HALTED: (S.ENDING, ""),
        E.EXECUTED: (S.FLYING_FILE, "Reached Persist"),
        E.SKIPPED: (S.FLYING_FILE, "SendText"),
        E.REPORTED: (S.FLYING_FILE, ""),
        E.CONTROL_LOST: (S.PAUSED, "SendText Suspend Persist"),
        E.TIMEOUT: (S.FLYING_FILE, ""),
        E.LINK_DOWN: (S.PAUSED, ""),
    },
    S.FLYING_ITEM: {
        E.UPLOADED: (S.READY, "Persist SendText Suspend Release"),
        E.CLEARED: (S.NO_MISSION, "Persist SendText Suspend Release"),
        E.UPLOADED_AGAIN: (S.FLYING_ITEM, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Suspend Acquire"),
        E.FAILED: (S.PAUSED, "SendText Release"),
        E.OTHER_PLAYING: (S.PAUSED, "SendText Release"),
        E.ITEM_FLOWN: (S.FLYING_ITEM, "Reached Prepare"),
        E.CONTROL_LOST: (S.PAUSED, "SendText Suspend"),
        E.LINK_DOWN: (S.PAUSED, ""),
    },
    S.ENDING: {
        E.UPLOADED: (S.READY, "Persist SendText Suspend Release"),
        E.CLEARED: (S.NO_MISSION, "Persist SendText Suspend Release"),
        E.UPLOADED_AGAIN: (S.ENDING, "SendText"),
        E.PREPARED: (S.TAKING_OVER, "Suspend Acquire Persist"),
        E.RESUMED: (S.FLYING_FILE, "Select SendText"),
        E.OTHER_PLAYING: (S.PAUSED, "SendText Release Persist"),
        E.EXECUTED: (S.COMPLETE, "Reached Persist SendText Release"),
        E.SKIPPED: (S.ENDING, "SendText"),
        E.REPORTED: (S.PAUSED, "SendText Release Persist"),
        E.CONTROL_LOST: (S.PAUSED, "SendText Suspend Persist"),
        E.TIMEOUT: (S.ENDING, ""),
        E.LINK_DOWN: (S.PAUSED, ""),
    },
    S.PAUSED: {
        E.UPLOADED: (S.READY, "Persist"),
        E.CLEARED: (S.NO_MISSION, "Persist"),
        E.UPLOADED_AGAIN: (S.READY, "Persist"),
        E.CHOSEN: (S.PAUSED, "Persist"),
        E.ENGAGED: (S.AWAIT_ARM, "Select"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.RESUMED: (S.FLYING_FILE, "Select SendText"),
        E.OTHER_PLAYING: (S.PAUSED, "SendText"),
        E.HALTED: (S.PAUSED, ""),
        E.EXECUTED: (S.PAUSED, "Reached Persist"),
        E.LINK_DOWN: (S.PAUSED, ""),
        E.LINK_UP: (S.FLYING_FILE, "Select SendText"),
    },
    S.COMPLETE: {
        E.UPLOADED: (S.READY, "Persist"),
        E.CLEARED: (S.NO_MISSION, "Persist"),
        E.UPLOADED_AGAIN: (S.READY, "Persist"),
        E.CHOSEN: (S.READY, ""),
        E.ENGAGED: (S.AWAIT_ARM, "Select"),
        E.PREPARED: (S.TAKING_OVER, "Acquire"),
        E.OTHER_PLAYING: (S.COMPLETE, "SendText"),
        E.LINK_DOWN: (S.COMPLETE, ""),
    },
}
"""Next state and effects by hand, of the machines of `in_state`. A missing pair changes nothing."""


@pytest.mark.parametrize("state", State)
def test_machine_pair_of_state_and_event_has_defined_result(state: State) -> None:
    assert EXPECTED[state].keys() == TRANSITIONS[state].keys()
    for event in Event:
        machine = in_state(state)
        before = (machine.phase, machine.progress, machine.mission)
        effects = calls(machine)[event]()
        if event in EXPECTED[state]:
            assert (machine.state, names(effects)) == EXPECTED[state][event], event
            assert machine.state in TRANSITIONS[state][event], event
        elif event in (E.PLAYING, E.RESUMED) and effects:  # no such start, or no such file
            other = (EXPECTED[state].get(E.RESUMED), EXPECTED[state].get(E.OTHER_PLAYING))
            assert (machine.state, names(effects)) in other, event
        else:
            assert (effects, (machine.phase, machine.progress, machine.mission)) == ([], before), event


HELD = {S.AWAIT_ARM, S.PREPARING, S.STARTING, *FLYING}
"""States in which mode Mission is shown."""

DEADLINES = {S.AWAIT_ARM, S.ENDING}
ATTEMPTED = {S.PREPARING, S.TAKING_OVER, S.STARTING, S.FLYING_ITEM}

SEQUENCES, EVENTS = 100_000, 4


def test_machine_keeps_every_promise_in_random_sequences() -> None:
    """Each sequence begins in a drawn state."""
    chance, begins = random.Random(13), [in_state(state) for state in State]
    reached: set[tuple[State, Event]] = set()
    for number in range(SEQUENCES):
        flight = RandomFlight(chance, chance.choice(begins))
        machine = flight.machine
        selected = machine.state in HELD
        for _ in range(EVENTS):
            phase, before = machine.phase, machine.state
            event, effects = flight.step()
            if effects or machine.phase is not phase:
                reached.add((before, event))
            where = (number, before, event, machine.state)
            for effect in effects:
                selected = (selected or isinstance(effect, Select)) and not isinstance(effect, Release)
            if event in (E.CONTROL_LOST, E.LINK_DOWN) and machine.state is not S.TAKING_OVER:
                selected = False  # by the shell, which ends its flight task
            assert selected >= (machine.state in HELD), where
            assert selected <= (machine.state in HELD or machine.state is S.TAKING_OVER), where
            awaits_end = machine.state is S.FLYING_FILE and machine.progress.leg_done and not machine.ending
            assert (machine.deadline() is not None) is (machine.state in DEADLINES or awaits_end), where
            assert machine.phase.attempt is not None or machine.state not in ATTEMPTED, where
            assert machine.rest is machine.state or machine.state not in {*WAITING, *FLYING}, where
            assert machine.rest in WAITING or machine.flying, where
            assert bool(machine.mission.items) is (machine.rest is not S.NO_MISSION), where
            assert 0 <= machine.progress.current < max(len(machine.mission.items), 1), where
            assert sum(isinstance(effect, Work) for effect in effects) <= 1, where
    quiet = {(S.NO_MISSION, E.CLEARED), (S.READY, E.LINK_UP), (S.FLYING_FILE, E.REPORTED)}
    assert {(state, event) for state, row in TRANSITIONS.items() for event in row} - reached <= quiet


def test_withdrawn_start_leaves_the_mission_as_it_was() -> None:
    machine, attempt = starting()
    assert names(machine.failed(attempt, None)) == "Release"
    assert machine.state is S.READY
    assert names(machine.playing("a", None)) == "SendText"  # another controller's: this mission has no such file


def test_playing_during_a_start_is_known_by_its_attempt_not_by_its_name() -> None:
    machine, attempt = starting()
    for other in (None, machine.attempt()):
        assert machine.playing("a", other) == []
        assert machine.state is S.STARTING
    assert names(machine.playing("renamed", attempt)) == "Persist"
    assert (machine.state, machine.progress.uid) == (S.FLYING_FILE, "a")


def test_restart_withdrawn_during_acquisition_pauses_and_releases() -> None:
    machine, attempt = taking_over(machine=flying())
    machine.halted(stopped=False, report=GONE, now=NOW)
    effects = machine.failed(attempt, None)
    assert names(effects) == "SendText Release"
    assert machine.state is S.PAUSED


def test_older_attempt_reporting_late_changes_nothing() -> None:
    machine, older = starting()
    _, newer = taking_over(machine=machine)
    phase = machine.phase
    assert phase.attempt is newer
    for effects in (
        machine.confirmed(older),
        machine.failed(older, FAILURE),
        machine.failed(older, None),
        machine.granted(older),
    ):
        assert effects == []
    assert machine.phase is phase


def test_paused_mission_that_another_controller_resumes_is_shown_as_flown() -> None:
    machine = flying()
    machine.control_lost()
    assert machine.state is S.PAUSED
    assert names(machine.playing("a", None)) == "Select SendText"
    assert machine.state is S.FLYING_FILE


def test_late_report_of_the_last_line_completes_a_mission_that_a_landing_of_the_drone_has_paused() -> None:
    """One that a client has paused, or that goes on with another part, stays paused."""
    machine = flying(LAST)
    machine.control_lost(lands=True)
    machine.executed(1)
    assert machine.state is S.COMPLETE
    machine = flying(LAST)
    machine.control_lost()
    machine.executed(1)
    assert machine.state is S.PAUSED
    machine = flying()
    machine.control_lost(lands=True)
    machine.executed(2)
    assert machine.state is S.PAUSED


def test_playing_that_the_drone_repeats_counts_once() -> None:
    """Of its own start, of a mission that another controller has resumed, and of another plan; a stop ends each."""
    machine, attempt = starting()
    assert names(machine.playing("a", attempt)) == "Persist"
    assert machine.playing("a", attempt) == []
    machine.control_lost()
    assert machine.playing("a", attempt) == []
    assert names(machine.playing("a", None)) == "Select SendText"
    assert machine.playing("a", None) == []
    assert names(machine.playing("b", None)) == "SendText Release Persist"
    assert machine.playing("b", None) == []
    machine.halted(stopped=True, report=GONE, now=NOW)
    assert names(machine.playing("b", None)) == "SendText"


def test_mission_uploaded_while_armed_start_waits_for_it_is_flown() -> None:
    machine = loaded()
    machine.await_arm("client", NOW)
    machine.armed("client", storing=True)
    older = machine.phase.attempt
    assert names(machine.upload(ITEMS[:3], 8)) == "Persist Prepare"
    attempt = machine.phase.attempt
    assert machine.state is S.PREPARING
    assert attempt is not None
    assert attempt.mission is machine.mission
    assert older is not None
    assert machine.failed(older, FAILURE) == []
    assert names(machine.failed(attempt, FAILURE)) == "SendText Release"
    assert machine.state is S.READY


def test_choosing_an_item_that_does_not_exist_raises() -> None:
    machine = loaded()
    for wrong in (-1, 6):
        with pytest.raises(ValueError, match="no item"):
            machine.choose(wrong)


def test_mission_of_parts_is_flown_to_its_end() -> None:
    machine = flying()
    for line in range(3):
        machine.executed(line)
    effects = machine.halted(stopped=True, report=GONE, now=NOW)
    assert names(effects) == "FlyItem"
    assert (machine.state, machine.progress.current) == (S.FLYING_ITEM, 3)
    attempt = machine.phase.attempt
    assert attempt is not None
    assert names(machine.item_flown(attempt)) == "Reached Prepare Persist"
    following = machine.phase.attempt
    assert following is not None
    machine.prepared(following, LAST)
    machine.playing("b", following)
    assert names(machine.confirmed(following)) == ""
    for line in range(2):
        machine.executed(line)
    assert names(machine.halted(stopped=True, report=GONE, now=NOW)) == "Persist SendText Release"
    assert (machine.state, machine.first) == (S.COMPLETE, 0)
