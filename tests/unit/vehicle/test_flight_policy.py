"""The switch between pilot and programs: its states, and the flight tasks that it refuses."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from anafi_mav import texts
from anafi_mav.services.command.orbit_service import OrbitService
from anafi_mav.vehicle.base.control import Control, Request
from anafi_mav.vehicle.base.flight_task import DISARM, HAND_LAUNCH, LAND, MOTOR_CUT, FlightTask, Hover, maintenance
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import By, Source
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.flight_policy import BY_NUMBER, NUMBERS, TRANSITIONS, Event, State, refusal_of
from anafi_mav.vehicle.follow_flight import FollowFlight
from anafi_mav.vehicle.manual_flight import ManualFlight
from anafi_mav.vehicle.mission.flight import MissionFlight
from anafi_mav.vehicle.return_end import ReturnEnd
from anafi_mav.vehicle.takeoff import Takeoff

CLIENT = Right(("channel", 255, 190), Extent.ALL, 0)


def request(task: FlightTask, by: By = CLIENT) -> Request:
    return Request(task, by, task.rules)


def of(kind: type) -> Request:
    """A request of a task that exists only in an aircraft: its rules decide."""
    return Request(LAND, CLIENT, kind.rules)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("state", "event"), [*itertools.product(State, Event)])
def test_switch_has_a_next_state_for_every_event(state: State, event: Event) -> None:
    expected = {
        Event.GIVE: State.PILOT,
        Event.TAKE: State.PROGRAM,
        Event.FREE: State.AUTOMATIC,
        Event.STICK: State.AUTOMATIC if state is State.AUTOMATIC else State.PILOT,
        Event.LINK_DOWN: State.AUTOMATIC if state is State.AUTOMATIC else State.PILOT,
    }
    assert TRANSITIONS[state][event] is expected[event]


def test_switch_numbers_are_those_of_the_paper() -> None:
    assert [NUMBERS[state] for state in (State.PILOT, State.PROGRAM)] == [False, True]
    assert {number: state for state, number in NUMBERS.items()} == BY_NUMBER


@pytest.mark.parametrize("kind", [MissionFlight, FollowFlight, Takeoff, OrbitService], ids=lambda kind: kind.__name__)
def test_flight_of_a_client_is_refused_in_pilot_alone(kind: type) -> None:
    refusal = refusal_of(State.PILOT, of(kind))
    assert isinstance(refusal, Refused)
    assert refusal.reason == texts.PILOT_SWITCH
    assert not refusal.lasting
    assert refusal_of(State.PROGRAM, of(kind)) is None
    assert refusal_of(State.AUTOMATIC, of(kind)) is None


def test_hand_launch_is_refused_in_pilot() -> None:
    refusal = refusal_of(State.PILOT, request(HAND_LAUNCH))
    assert refusal is not None
    assert refusal.text == "Arming refused: pilot flies, ANF_SC_OFFBOARD 0"


@pytest.mark.parametrize(
    "task", [LAND, DISARM, MOTOR_CUT, maintenance(texts.CALIBRATION), Hover(), Hover(FlightMode.GUIDED)]
)
def test_stop_is_never_refused(task: FlightTask) -> None:
    assert [refusal_of(state, request(task)) for state in State] == [None] * 3


@pytest.mark.parametrize("kind", [ReturnEnd, ManualFlight], ids=lambda kind: kind.__name__)
def test_return_and_mode_position_are_never_refused(kind: type) -> None:
    assert [refusal_of(state, of(kind)) for state in State] == [None] * 3


@pytest.mark.parametrize("source", Source)
def test_gateway_is_refused_for_changed_settings(source: Source) -> None:
    refusal = refusal_of(State.PILOT, request(HAND_LAUNCH, source))
    assert (refusal is not None) is (source is Source.GATEWAY)


def test_first_policy_that_refuses_decides() -> None:
    first, second = (Refused(texts.GOTO, reason) for reason in (texts.PILOT_SWITCH, texts.PILOT))
    asked = request(HAND_LAUNCH)
    nothing: Any = None
    control = Control(nothing)
    assert control.refusal(asked) is None
    control.policies = (lambda request: None, lambda request: first, lambda request: second)
    assert control.refusal(asked) is first
    control.policies = (lambda request: None, lambda request: second)
    assert control.refusal(asked) is second
