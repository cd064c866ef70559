"""The flying state's table, pair by pair."""

from __future__ import annotations

import itertools

import pytest

from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.sim.autopilot.machine import AIRBORNE, GUIDED, TRANSITIONS, Event, next_state

S = FlyingState

# arsdk.md 2.3 in words: what each event counts in, and where it leads. Nothing else counts.
EXPECTED = {
    Event.TAKE_OFF: {S.LANDED: S.MOTOR_RAMPING},
    Event.USER_TAKE_OFF: {S.LANDED: S.MOTOR_RAMPING},
    Event.USER_TAKE_OFF_CANCEL: {S.MOTOR_RAMPING: S.LANDED, S.USERTAKEOFF: S.LANDED},
    Event.LAND: dict.fromkeys((S.MOTOR_RAMPING, S.TAKINGOFF, S.HOVERING, S.FLYING), S.LANDING),
    Event.EMERGENCY: {state: S.EMERGENCY for state in S if state is not S.EMERGENCY},
    Event.CLIMB: {S.LANDING: S.FLYING},
    Event.ABORT_LANDING: {S.LANDING: S.FLYING},
    Event.FORCED_LANDING: dict.fromkeys((S.TAKINGOFF, S.HOVERING, S.FLYING, S.LANDING), S.EMERGENCY_LANDING),
    Event.RAMPED_UP: {S.MOTOR_RAMPING: S.TAKINGOFF},
    Event.IDLING: {S.MOTOR_RAMPING: S.USERTAKEOFF},
    Event.THROWN: {S.USERTAKEOFF: S.TAKINGOFF},
    Event.AIRBORNE: {S.TAKINGOFF: S.HOVERING},
    Event.BUSY: {S.HOVERING: S.FLYING},
    Event.AT_REST: {S.FLYING: S.HOVERING},
    Event.TOUCHDOWN: {S.LANDING: S.LANDED, S.EMERGENCY_LANDING: S.LANDED},
    Event.SETTLED: {S.EMERGENCY: S.LANDED},
}


@pytest.mark.parametrize(("state", "event"), list(itertools.product(S, Event)))
def test_every_pair(state: FlyingState, event: Event) -> None:
    assert next_state(state, event) == EXPECTED[event].get(state)


def test_every_state_is_reached_and_left_to_the_ground() -> None:
    def reachable(start: FlyingState) -> set[FlyingState]:
        found, new = {start}, [start]
        while new:
            following = set(TRANSITIONS[new.pop()].values()) - found
            found |= following
            new += following
        return found

    assert reachable(S.LANDED) == set(S)
    assert all(S.LANDED in reachable(state) for state in S)


def test_guided_states_are_airborne_states() -> None:
    assert GUIDED < AIRBORNE
    assert AIRBORNE.isdisjoint({S.LANDED, S.MOTOR_RAMPING, S.USERTAKEOFF, S.EMERGENCY})
