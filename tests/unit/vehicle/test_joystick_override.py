"""When a joystick takes over: hand-computed sequences of its sticks."""

from __future__ import annotations

import pytest

from anafi_mav.vehicle.joystick_override import JoystickOverride

CLIENT = ("channel", 255, 190)


def taken(*positions: tuple[float, float], threshold: float = 0.3) -> list[float]:
    """Times at which (time, largest deflection) takes over."""
    override = JoystickOverride(threshold=threshold)
    return [now for now, largest in positions if override.moved(CLIENT, largest, now)]


def rest(until: float, begin: float = 0.0) -> list[tuple[float, float]]:
    """A joystick at rest, ten times a second."""
    return [(begin + step / 10, 0.05) for step in range(round((until - begin) * 10) + 1)]


def test_stick_after_half_a_second_of_rest_overrides_once() -> None:
    assert taken(*rest(0.5), (0.6, 0.2), (0.7, 0.31), (0.8, 0.9), (0.9, 0.1), (1.0, 0.9)) == [0.7]


@pytest.mark.parametrize("largest", [0.11, 0.3])
def test_stick_up_to_the_threshold_does_not(largest: float) -> None:
    assert taken(*rest(1.0), (1.1, largest)) == []


def test_stick_after_a_shorter_rest_does_not() -> None:
    assert taken(*rest(0.4), (0.5, 0.9)) == []


def test_stick_deflected_from_the_beginning_does_not_override() -> None:
    assert taken(*[(step / 10, 0.9) for step in range(50)]) == []


def test_rest_with_a_gap_in_the_messages_begins_again() -> None:
    assert taken(*rest(0.5), (1.2, 0.9)) == []
    assert taken(*rest(0.3), (1.0, 0.0), (1.3, 0.0), (1.4, 0.9)) == []


def test_second_takeover_needs_a_second_rest() -> None:
    moves = [*rest(0.5), (0.6, 0.9), *rest(1.5, 0.7), (1.6, 0.9)]
    assert taken(*moves) == [0.6, 1.6]


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_throttle_counts_after_passing_the_middle(side: float) -> None:
    override = JoystickOverride()
    override.take_over(CLIENT, side)
    assert [override.climb(CLIENT, side * share) for share in (1.0, 0.4, -0.2, 0.6)] == [
        0.0,
        0.0,
        -0.2 * side,
        0.6 * side,
    ]


def test_throttle_in_the_middle_counts_at_once() -> None:
    override = JoystickOverride()
    override.take_over(CLIENT, 0.0)
    assert override.climb(CLIENT, 0.5) == 0.5


def test_throttle_of_another_client_counts() -> None:
    override = JoystickOverride()
    override.take_over(CLIENT, -1.0)
    assert override.climb(("channel", 254, 190), -1.0) == -1.0
