"""Items of plans as messages and back."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from support.plan_samples import FLIGHT, LAT, LON, action, plans, waypoint

from anafi_mav import mav_enums
from anafi_mav.plans.plan import MISSION, RELATIVE, Item, Plan
from anafi_mav.services.plan.item_messages import as_carried, from_wire, item_int, item_of, to_wire
from anafi_mav.vehicle.fence.plan_items import UNSET, PlanItem, has_place


def test_place_is_in_deg_e7_and_unset_is_nan() -> None:
    wire = to_wire(
        Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 2.5, 0.0, None, 48.87890004, -2.3677, 20.1), False)
    )
    assert (wire.command, wire.frame, wire.x, wire.y, wire.autocontinue) == (16, 3, 488789000, -23677000, 0)
    assert wire.params[:3] == (0.0, 2.5, 0.0)
    assert math.isnan(wire.params[3])
    assert wire.z == 20.100000381469727  # single precision
    assert from_wire(wire) == Item(
        mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 2.5, 0.0, None, 48.8789, -2.3677, 20.1), False
    )


def test_without_a_place_the_same_fields_are_plain_numbers() -> None:
    wire = to_wire(Item(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, MISSION, (-30.0, None, 0.0, 0.0, 7.0, None, 2.0)))
    assert (wire.x, wire.y, wire.z) == (7, UNSET, 2.0)
    assert from_wire(wire).params == (-30.0, None, 0.0, 0.0, 7.0, None, 2.0)


@pytest.mark.parametrize(
    ("single", "shortest"),
    [
        (0.30000001192092896, "0.3"),
        (-0.0, "-0.0"),
        (16777215.0, "16777215.0"),
        (-16777216.0, "-16777216.0"),
        (33554436.0, "33554436.0"),
        (99999997952.0, "100000000000.0"),
        (math.inf, "inf"),
    ],
)
def test_single_precision_parameter_is_read_as_the_shortest_decimal(single: float, shortest: str) -> None:
    assert (
        repr(
            from_wire(PlanItem(mav_enums.MAV_CMD_DO_MOUNT_CONTROL, MISSION, (single, 0.0, 0.0, 0.0), 0, 0, 0.0)).params[
                0
            ]
        )
        == shortest
    )


@pytest.mark.parametrize("params", [(1e39,), (0, 0, 0, 0, 3e9), (0, 0, 0, 0, 0, -3e9)])
def test_number_too_large_for_the_wire_raises(params: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="too large a number"):
        to_wire(action(mav_enums.MAV_CMD_CONDITION_GATE, *params))


def test_a_flight_as_carried() -> None:
    """Its places have seven decimals, its numbers are short: nothing is lost."""
    for item in FLIGHT.items:
        carried = as_carried(item)
        assert (carried.command, carried.frame, carried.autocontinue) == (item.command, item.frame, item.autocontinue)
        assert carried.params == pytest.approx([value if value is None else round(value, 7) for value in item.params])
    assert as_carried(waypoint(0, 0)).params[4:] == (LAT, LON, 20.0)


@settings(max_examples=200, deadline=None)
@given(plans())
def test_item_survives_repeated_conversion(plan: Plan) -> None:
    for item in plan.items:
        try:
            carried = as_carried(item)
        except ValueError:
            placed = has_place(item.command, item.frame)
            limit = 214.748364 if placed else 2147483646.0
            assert any(abs(value or 0.0) > limit for value in item.params[4:6])
            continue
        message = item_int(to_wire(item), 3, 1, 1, 0)
        again = item_of(message)
        assert isinstance(again, PlanItem)
        assert as_carried(carried) == carried
        assert (carried.command, carried.frame, carried.autocontinue) == (item.command, item.frame, item.autocontinue)
        for place, (before, after) in enumerate(zip(item.params, carried.params, strict=True), 1):
            if before is None or after is None:
                assert before is after
            elif place in (5, 6):
                step = 0.5e-7 if to_wire(item).has_place else 0.5
                assert after == pytest.approx(before, abs=step * 1.001)
            else:
                assert after == pytest.approx(before, rel=2.0**-23, abs=1e-38)
