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


@pytest.mark.parametrize(
    ("command", "params", "number"),
    [
        (TURN, (90.0, 1e-6, 1.0, 0.0), 2),
        (mav_enums.MAV_CMD_PANORAMA_CREATE, (360.0, 0.0, 1e-6, 0.0), 3),
        (mav_enums.MAV_CMD_PANORAMA_CREATE, (360.0, 0.0, -30.0, 0.0), 3),
        (mav_enums.MAV_CMD_PANORAMA_CREATE, (360.0, 20.0, 30.0, 1e9), 4),
        (mav_enums.MAV_CMD_IMAGE_START_CAPTURE, (0.0, 1e9, 0.0, 0.0), 2),
        (mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL, (1e9, None, None, None), 1),
    ],
)
def test_rate_or_interval_that_no_flight_has_is_refused(
    command: int, params: tuple[float | None, ...], number: int
) -> None:
    place = Item(mav_enums.MAV_CMD_NAV_WAYPOINT, 3, (None, None, None, None, 48.0, 2.0, 10.0))
    (fault,) = examine((place, Item(command, 2, (*params, None, None, None))), 2).faults
    assert "invalid" in fault.reason
    assert fault.param == number


@pytest.mark.parametrize("speed", [None, 0.0, 0.1, 30.0, 720.0])
def test_speed_of_a_panorama_that_a_flight_has_is_accepted(speed: float | None) -> None:
    panorama = Item(mav_enums.MAV_CMD_PANORAMA_CREATE, 2, (360.0, 20.0, speed, speed, None, None, None))
    assert examine((panorama,), 2).faults == ()
