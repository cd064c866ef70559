"""Orientation of a move to a place, with bearings on the equator by hand."""

from __future__ import annotations

import math

import pytest

from anafi_mav.drone.events import OrientationMode
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.move_heading import MoveHeading, oriented

HERE = GeoPoint(0.0, 0.0)
SOUTH_EAST = GeoPoint(-0.001, 0.001)  # the ellipsoid: a degree is 110574 m north and 111320 m east
NEAR = GeoPoint(0.0, 0.00001)  # 1.1 m
NONE, TO_TARGET = OrientationMode.NONE, OrientationMode.TO_TARGET
START, DURING = OrientationMode.HEADING_START, OrientationMode.HEADING_DURING


@pytest.mark.parametrize(
    ("rule", "here", "target", "yaw", "orientation", "heading"),
    [
        (MoveHeading.KEEP, HERE, SOUTH_EAST, None, NONE, None),
        (MoveHeading.KEEP, HERE, SOUTH_EAST, -math.pi / 2, DURING, 270.0),
        (MoveHeading.TO_TARGET, HERE, SOUTH_EAST, None, DURING, 134.8),
        (MoveHeading.TO_TARGET, HERE, NEAR, None, NONE, None),
        (MoveHeading.TO_TARGET, None, SOUTH_EAST, None, NONE, None),
        (MoveHeading.TO_TARGET, HERE, SOUTH_EAST, 0.0, DURING, 0.0),
        (MoveHeading.TO_TARGET_FIRST, HERE, SOUTH_EAST, None, TO_TARGET, None),
        (MoveHeading.TO_TARGET_FIRST, HERE, NEAR, None, NONE, None),
        (MoveHeading.TO_TARGET_FIRST, HERE, NEAR, math.pi, START, 180.0),
    ],
)
def test_orientation_follows_rule_and_heading(
    rule: MoveHeading,
    here: GeoPoint | None,
    target: GeoPoint,
    yaw: float | None,
    orientation: OrientationMode,
    heading: float | None,
) -> None:
    found = oriented(rule, here, target, yaw)
    assert found[0] is orientation
    assert found[1] == (heading if heading is None else pytest.approx(heading, abs=0.1))
