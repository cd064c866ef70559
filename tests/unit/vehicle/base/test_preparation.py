"""Steps of the preparation of a request: what each kind sends, and what follows a landing that was ended."""

from __future__ import annotations

import pytest

from anafi_mav.vehicle.base.flight_task import Preparation, PreparationStep, begin_preparation

CANCEL, STOP, END = PreparationStep.CANCEL_RETURN, PreparationStep.STOP, PreparationStep.END_LANDING


def steps(
    start: Preparation, *, ended: tuple[int, ...] = (), stands: bool = False, cancels_return: bool = False
) -> list[PreparationStep]:
    """Return the steps of a preparation; `ended`: places of the steps that find something to end."""
    now, taken = begin_preparation(start, stands=stands, cancels_return=cancels_return), []
    while now.left:
        step = now.left[0]
        now = now.after(has_ended=len(taken) in ended)
        taken.append(step)
    return taken


@pytest.mark.parametrize(
    ("start", "cancels_return", "expected"),
    [
        (Preparation.AS_IT_IS, False, []),
        (Preparation.AS_IT_IS, True, [CANCEL]),
        (Preparation.HOVER, False, [PreparationStep.HOVER]),
        (Preparation.HOVER, True, [CANCEL, PreparationStep.HOVER]),
        (Preparation.STOP, False, [STOP]),
        (Preparation.STOP, True, [STOP, CANCEL]),
        (Preparation.END_LANDING, False, [PreparationStep.SETTLE_LANDING, END]),
        (Preparation.RISE_AGAIN, False, [PreparationStep.SETTLE_LANDING, PreparationStep.RISE_AGAIN]),
    ],
)
def test_preparation_takes_its_steps(start: Preparation, cancels_return: bool, expected: list[PreparationStep]) -> None:
    assert steps(start, cancels_return=cancels_return) == expected


@pytest.mark.parametrize("cancels_return", [False, True])
def test_end_of_descent_stops_and_cancels_every_return(cancels_return: bool) -> None:
    expected = [
        END,
        PreparationStep.CANCEL_OWN_RETURN,
        STOP,
        CANCEL,
        PreparationStep.SETTLE_LANDING,
        END,
        PreparationStep.ANSWER_ANNOUNCED,
    ]
    assert steps(Preparation.END_DESCENT, cancels_return=cancels_return) == expected
    assert steps(Preparation.END_DESCENT, ended=(0,)) == expected  # the stop is still to come


def test_landing_that_began_during_the_end_of_another_is_followed_by_a_stop() -> None:
    taken = steps(Preparation.END_DESCENT, ended=(5,))
    assert taken[5:] == [END, STOP, PreparationStep.ANSWER_ANNOUNCED]


@pytest.mark.parametrize("start", [Preparation.END_LANDING, Preparation.RISE_AGAIN])
def test_landing_that_is_ended_for_a_newer_flight_is_followed_by_no_stop(start: Preparation) -> None:
    assert STOP not in steps(start, ended=(1,))


def test_end_of_descent_sends_nothing_to_a_drone_that_stands() -> None:
    assert steps(Preparation.END_DESCENT, stands=True) == []
