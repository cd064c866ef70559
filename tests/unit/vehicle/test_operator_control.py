"""Operator control without I/O: who becomes the operator, who may do what meanwhile, and when the role ends."""

from __future__ import annotations

import itertools

import pytest

from anafi_mav import texts
from anafi_mav.vehicle.base.control import Request
from anafi_mav.vehicle.base.flight_task import DISARM, HAND_LAUNCH, LAND, MOTOR_CUT, FlightTask, Hover
from anafi_mav.vehicle.base.refusal import NotInControl
from anafi_mav.vehicle.base.requester import By, Source
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.manual_flight import ManualFlight
from anafi_mav.vehicle.operator_control import (
    MAX_SHOWN,
    MAX_WAITING,
    REPEATS,
    SILENT,
    TRANSITIONS,
    ControlRequest,
    Event,
    Need,
    OperatorControl,
    RequestOutcome,
    State,
    operator_refusal_of,
)
from anafi_mav.vehicle.return_end import ReturnEnd

TEACHER, STUDENT, GUEST, OWN = 255, 254, 250, 1


def asked(system: int, *, allows: bool = False, timeout: float = 10.0, secondaries: range = range(0)) -> ControlRequest:
    return ControlRequest(system, allows, timeout, secondaries)


def held(*, allows: bool = False, secondaries: range = range(0)) -> OperatorControl:
    """The teacher is the operator since 0 s."""
    control = OperatorControl()
    control.own = OWN
    assert control.request(asked(TEACHER, allows=allows, secondaries=secondaries), 0.0) is RequestOutcome.GRANTED
    return control


def permitted(control: OperatorControl, system: int) -> set[Need]:
    return {need for need in Need if control.objection(system, need) is None}


ALL = set(Need)


# Requests.


@pytest.mark.parametrize("allows", [False, True])
def test_request_without_an_operator_is_granted(allows: bool) -> None:
    control = OperatorControl()
    assert control.grants_requests
    assert control.request(asked(STUDENT, allows=allows), 0.0) is RequestOutcome.GRANTED
    assert (control.operator, control.state) == (STUDENT, State.OFFERED if allows else State.HELD)
    assert control.grants_requests is allows


def test_request_of_another_station_fails_while_control_is_held() -> None:
    control = held()
    assert control.request(asked(STUDENT), 1.0) is RequestOutcome.ASKED
    assert (control.operator, control.state) == (TEACHER, State.HELD)


def test_request_is_granted_once_the_operator_allows_takeovers() -> None:
    control = held()
    assert control.request(asked(STUDENT), 1.0) is RequestOutcome.ASKED
    assert control.request(asked(TEACHER, allows=True), 2.0) is RequestOutcome.KEPT
    assert control.take_offered() == [STUDENT]
    assert control.take_offered() == []
    assert control.request(asked(STUDENT), 3.0) is RequestOutcome.GRANTED
    assert (control.operator, control.state) == (STUDENT, State.HELD)


def test_operator_that_forbids_takeovers_again_is_asked() -> None:
    control = held(allows=True)
    assert control.request(asked(TEACHER), 1.0) is RequestOutcome.KEPT
    assert control.request(asked(STUDENT), 2.0) is RequestOutcome.ASKED


def test_release_frees_the_aircraft_and_grants_nothing() -> None:
    control = held()
    control.request(asked(STUDENT), 1.0)
    assert control.release(STUDENT) is RequestOutcome.NOT_OPERATOR
    assert control.release(TEACHER) is RequestOutcome.RELEASED
    assert (control.operator, control.state) == (0, State.FREE)
    assert control.tick(1.0).notify == ()
    assert control.release(TEACHER) is RequestOutcome.RELEASED


def test_secondary_is_asked_about_like_any_station() -> None:
    """It may command, but the role is not its own: ArduPilot granted it by mistake at first (ardupilot#33332)."""
    assert held(secondaries=range(STUDENT, TEACHER + 1)).request(asked(STUDENT), 1.0) is RequestOutcome.ASKED


# Rights.


def test_without_an_operator_everything_is_permitted() -> None:
    assert permitted(OperatorControl(), 0) == ALL
    assert permitted(OperatorControl(), GUEST) == ALL


@pytest.mark.parametrize("allows", [False, True])
def test_operator_and_own_components_may_do_all_and_others_nothing(allows: bool) -> None:
    control = held(allows=allows)
    assert permitted(control, TEACHER) == permitted(control, OWN) == ALL
    assert permitted(control, STUDENT) == permitted(control, 0) == {Need.NOTHING}
    assert control.objection(STUDENT, Need.FLY) == "operator is system 255"


def test_secondary_commands_and_does_not_fly() -> None:
    control = held(secondaries=range(STUDENT, TEACHER + 1))
    control.hear(GUEST, 0.0, is_secondary=True)
    assert permitted(control, STUDENT) == permitted(control, GUEST) == {Need.NOTHING, Need.COMMAND}
    control.hear(GUEST, 1.0)  # the same id, on an endpoint that does not name it
    assert permitted(control, GUEST) == {Need.NOTHING}


def test_range_of_the_operator_before_means_nothing() -> None:
    control = held(allows=True, secondaries=range(STUDENT, TEACHER + 1))
    control.request(asked(GUEST, secondaries=range(GUEST, GUEST + 1)), 1.0)
    assert permitted(control, STUDENT) == permitted(control, TEACHER) == {Need.NOTHING}


def test_shown_secondaries_are_heard_ones_in_order() -> None:
    control = held(secondaries=range(1, 256))
    for system in range(20, 0, -1):
        control.hear(system, 0.0)
    assert control.shown_secondaries(SILENT - 0.1) == [*range(1, MAX_SHOWN + 1)]
    control.hear(7, 1.0)
    assert control.shown_secondaries(SILENT) == [7]
    assert TEACHER not in control.shown_secondaries(0.0)


# Flight tasks.


def client(system: int) -> Right:
    return Right(("channel", system, 190), Extent.ALL, 0)


def refusal(task: FlightTask, by: By) -> str | None:
    found = operator_refusal_of(held(), Request(task, by, task.rules))
    assert found is None or isinstance(found, NotInControl)
    return None if found is None else found.text


def test_flight_task_of_another_station_is_refused() -> None:
    assert refusal(HAND_LAUNCH, client(STUDENT)) == "Arming refused: operator is system 255"
    assert refusal(HAND_LAUNCH, client(TEACHER)) is None
    assert refusal(HAND_LAUNCH, Right(None, Extent.ALL, 0)) is not None


@pytest.mark.parametrize("task", [LAND, DISARM, MOTOR_CUT, Hover()])
def test_stop_of_another_station_is_permitted(task: FlightTask) -> None:
    assert refusal(task, client(STUDENT)) is None


@pytest.mark.parametrize("kind", [ReturnEnd, ManualFlight], ids=lambda kind: kind.__name__)
def test_return_and_mode_position_of_another_station_are_permitted(kind: type) -> None:
    request = Request(LAND, client(STUDENT), kind.rules)  # type: ignore[attr-defined]
    assert operator_refusal_of(held(), request) is None


@pytest.mark.parametrize("source", Source)
def test_gateway_is_never_refused_for_an_operator(source: Source) -> None:
    assert refusal(HAND_LAUNCH, source) is None


# Notifications.


def sent(control: OperatorControl, *times: float) -> list[list[tuple[int, int]]]:
    """(system, count) of the notifications at each time."""
    return [[(one.request.system, one.sent) for one in control.tick(now).notify] for now in times]


def test_operator_is_notified_at_once_and_until_it_acknowledges() -> None:
    control = held()
    control.request(asked(STUDENT), 1.0)
    assert sent(control, 1.0, 1.5, 2.0) == [[(STUDENT, 1)], [], [(STUDENT, 2)]]
    control.acknowledge(GUEST)
    assert sent(control, 3.0) == [[(STUDENT, REPEATS)]]
    control.request(asked(GUEST), 3.5)
    assert sent(control, 3.5) == [[(GUEST, 1)]]
    control.acknowledge(TEACHER)
    assert sent(control, 4.5, 4.9) == [[], []]


def test_repeated_request_is_no_further_notification() -> None:
    control = held()
    for now in (1.0, 1.1, 1.2):
        assert control.request(asked(STUDENT), now) is RequestOutcome.ASKED
    assert sent(control, 1.2) == [[(STUDENT, 1)]]


def test_request_expires_and_can_be_repeated() -> None:
    control = held()
    control.request(asked(STUDENT, timeout=3.0), 1.0)
    control.hear(TEACHER, 3.9)
    assert control.tick(3.9).expired == ()
    assert control.tick(4.0).expired == (STUDENT,)
    control.request(asked(STUDENT), 4.5)
    assert sent(control, 4.5) == [[(STUDENT, 1)]]


def test_requests_beyond_the_bound_do_not_reach_the_operator() -> None:
    control = held()
    for system in range(1, 200):
        assert control.request(asked(system), 1.0) is RequestOutcome.ASKED
    assert len(sent(control, 1.0)[0]) == MAX_WAITING


# The end of the role.


def test_silent_operator_is_none_any_longer() -> None:
    control = held(secondaries=range(STUDENT, TEACHER + 1))
    control.hear(STUDENT, SILENT)
    assert control.tick(SILENT - 0.01).lost == 0
    assert control.tick(SILENT).lost == TEACHER
    assert (control.operator, control.state) == (0, State.FREE)
    assert permitted(control, GUEST) == ALL
    assert control.tick(SILENT + 1.0).lost == 0


def test_every_message_of_the_operator_keeps_its_role() -> None:
    control = held()
    control.hear(TEACHER, 4.0)
    assert control.tick(SILENT + 3.9).lost == 0
    assert control.tick(SILENT + 4.0).lost == TEACHER


def test_time_without_reception_is_no_silence_of_the_operator() -> None:
    control = held()
    control.skip(60.0)
    assert control.tick(60.0 + SILENT - 0.1).lost == 0
    control.restart(200.0)
    assert control.tick(200.0 + SILENT - 0.1).lost == 0
    assert control.tick(200.0 + SILENT).lost == TEACHER
    control.restart(300.0)
    assert control.is_free


# The table.

HAPPENS = {
    State.FREE: {Event.CLAIM, Event.OFFER},
    State.HELD: set(Event),
    State.OFFERED: {Event.CLAIM, Event.OFFER, Event.RELEASE, Event.SILENCE},
}


@pytest.mark.parametrize(("state", "event"), [*itertools.product(State, Event)])
def test_table_has_the_pairs_that_can_happen(state: State, event: Event) -> None:
    after = {
        Event.CLAIM: State.HELD,
        Event.OFFER: State.OFFERED,
        Event.ASK: State.HELD,
        Event.RELEASE: State.FREE,
        Event.SILENCE: State.FREE,
    }
    assert TRANSITIONS[state].get(event) is (after[event] if event in HAPPENS[state] else None)


def test_reason_names_the_operator() -> None:
    assert texts.OTHER_OPERATOR.fill(system=7) == "operator is system 7"
