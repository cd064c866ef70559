"""CONDITION_YAW's param4: MAVLink has 0 and 1; an ArduPilot mission may carry any byte, and all but 0 are relative."""

from __future__ import annotations

import pytest

from anafi_mav import mav_enums
from anafi_mav.plans.plan import Item
from anafi_mav.plans.rules.rules_flight import is_relative
from anafi_mav.plans.translation.translate import examine

TURN = mav_enums.MAV_CMD_CONDITION_YAW


@pytest.mark.parametrize(
    ("reference", "relative"), [(None, False), (0.0, False), (1.0, True), (3.0, True), (255.0, True)]
)
def test_reference_of_a_turn_is_relative_unless_0(reference: float | None, relative: bool) -> None:
    assert is_relative(reference) is relative
    item = Item(TURN, 2, (2.0, 22.0, 1.0, reference, None, None, None))
    assert examine((item,), 2).faults == ()


@pytest.mark.parametrize("reference", [-1.0, 0.5, 256.0])
def test_invalid_reference_byte_is_refused(reference: float) -> None:
    item = Item(TURN, 2, (2.0, 22.0, 1.0, reference, None, None, None))
    (fault,) = examine((item,), 2).faults
    assert "invalid reference" in fault.reason
    assert fault.param == 4


def test_negative_rate_of_a_turn_is_refused() -> None:
    """In flight the turn would fail, and the mission would be paused before it."""
    item = Item(TURN, 2, (90.0, -20.0, 1.0, 0.0, None, None, None))
    (fault,) = examine((item,), 2).faults
    assert fault.reason == "CONDITION_YAW: invalid rate of -20 deg/s"
    assert fault.param == 2
