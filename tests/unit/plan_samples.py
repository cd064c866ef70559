"""Plans for tests: made by hand, and drawn at random."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import strategies as st

from anafi_mav.plans.plan import (
    DO_JUMP,
    GLOBAL,
    MISSION,
    RELATIVE,
    WAYPOINT,
    Circle,
    Item,
    Plan,
    Point,
    Polygon,
)

LAT, LON = 48.8789, 2.3677


def waypoint(north: float, east: float, height: float = 20.0, *params: float | None, frame: int = RELATIVE) -> Item:
    """A waypoint so many 1e-4 degrees from the middle."""
    one, two, three, four = (*params, *([0.0, 0.0, 0.0, None][len(params) :]))
    return Item(WAYPOINT, frame, (one, two, three, four, LAT + north * 1e-4, LON + east * 1e-4, height))


def action(command: int, *params: float | None) -> Item:
    one, two, three, four, five, six, seven = (*params, *([None] * (7 - len(params))))
    return Item(command, MISSION, (one, two, three, four, five, six, seven))


FLIGHT = Plan(
    items=(
        Item(22, RELATIVE, (15.0, 0.0, 0.0, None, LAT, LON, 15.0)),
        action(178, 1.0, 4.0, -1.0),
        waypoint(1, 0, 20.0, 0.0, 2.0, 0.0, 90.0),
        action(2000, 0.0, 0.0, 1.0, 0.0),
        action(93, 10.0),
        waypoint(1, 2, 25.0),
        action(DO_JUMP, 2.0, 3.0),
        Item(201, RELATIVE, (3.0, 0.0, 0.0, 0.0, LAT, LON, 5.0)),
        waypoint(0, 2, 60.0, frame=GLOBAL),
        action(2500, 0.0),
        action(2501),
        action(20),
    ),
    home=Point(LAT, LON, 35.0),
    zones=(
        Polygon(True, ((LAT + 0.01, LON + 0.01), (LAT - 0.01, LON + 0.01), (LAT, LON - 0.01))),
        Circle(False, (LAT + 0.002, LON), 12.5),
    ),
    breach_return=Point(LAT, LON, 30.0),
    rally=(Point(LAT + 0.001, LON, 20.0), Point(LAT, LON + 0.001, 25.5)),
    cruise_speed=15.0,
    hover_speed=4.5,
)
"""A bit of everything."""


def simple(number: int, command: int, *params: float | None, frame: int = 3, **more: Any) -> dict[str, Any]:
    """A SimpleItem as QGroundControl stores it."""
    return {
        "autoContinue": True, "command": command, "doJumpId": number, "frame": frame,
        "params": [*params, *([0] * (7 - len(params)))], "type": "SimpleItem", **more,
    }  # fmt: skip


def altitude(height: float) -> dict[str, Any]:
    return {"AMSLAltAboveTerrain": None, "Altitude": height, "AltitudeMode": 1}


def survey(first: int) -> dict[str, Any]:
    """A survey of four items, in the shape of QGroundControl's version 5."""
    return {
        "TransectStyleComplexItem": {
            "CameraCalc": {"AdjustedFootprintFrontal": 25, "AdjustedFootprintSide": 25, "CameraName": "Manual",
                           "DistanceToSurface": 50, "DistanceToSurfaceRelative": True, "version": 1},
            "CameraShots": 6, "CameraTriggerInTurnAround": True, "FollowTerrain": False, "HoverAndCapture": False,
            "Items": [
                simple(first, 16, 0, 0, 0, None, LAT, LON, 50),
                simple(first + 1, 206, 25, 0, 1, frame=2),
                simple(first + 2, 16, 0, 0, 0, None, LAT + 0.001, LON, 50),
                simple(first + 3, 206, 0, 0, 1, frame=2),
            ],
            "Refly90Degrees": False, "TurnAroundDistance": 10,
            "VisualTransectPoints": [[LAT, LON], [LAT + 0.001, LON]], "version": 1,
        },
        "angle": 90, "complexItemType": "survey", "entryLocation": 0, "flyAlternateTransects": False,
        "polygon": [[LAT, LON - 0.001], [LAT + 0.001, LON - 0.001], [LAT + 0.001, LON + 0.001], [LAT, LON + 0.001]],
        "splitConcavePolygons": False, "type": "ComplexItem", "version": 5,
    }  # fmt: skip


def structure_scan() -> dict[str, Any]:
    """Two layers around 0.0002 degrees of latitude by 0.0003 of longitude, its corners counter-clockwise."""
    return {
        "CameraCalc": {"AdjustedFootprintFrontal": 10, "AdjustedFootprintSide": 5, "CameraName": "Manual",
                       "DistanceToSurface": 20, "DistanceToSurfaceRelative": True, "version": 1},
        "EntranceAltitude": 40, "GimbalPitch": -5, "Layers": 2, "ScanBottomAlt": 10, "StartFromTop": True,
        "StructureHeight": 30, "complexItemType": "StructureScan",
        "polygon": [[LAT, LON], [LAT, LON + 0.0003], [LAT + 0.0002, LON + 0.0003], [LAT + 0.0002, LON]],
        "type": "ComplexItem", "version": 3,
    }  # fmt: skip


def document(*items: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A plan file as QGroundControl writes it."""
    return {
        "fileType": "Plan",
        "geoFence": {
            "breachReturn": [LAT, LON, 30],
            "circles": [{"circle": {"center": [LAT, LON], "radius": 80.5}, "inclusion": True, "version": 1}],
            "polygons": [{"inclusion": False, "polygon": [[LAT, LON], [LAT + 0.001, LON], [LAT, LON + 0.001]],
                          "version": 1}],
            "version": 2,
        },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": 15, "firmwareType": 12, "globalPlanAltitudeMode": 1, "hoverSpeed": 5, "items": list(items),
            "plannedHomePosition": [LAT, LON, 35.25], "vehicleType": 2, "version": 2,
        },
        "rallyPoints": {"points": [[LAT, LON, 50]], "version": 2},
        "version": 1,
        **more,
    }  # fmt: skip


def encoded(plan: dict[str, Any]) -> bytes:
    return json.dumps(plan).encode()


# At random.

_number = st.none() | st.floats(-1e6, 1e6) | st.sampled_from([0.0, -1.0, 1.0])
_latitude, _longitude = st.floats(-90.0, 90.0), st.floats(-180.0, 180.0)
_height = st.floats(-500.0, 10_000.0)
_point = st.builds(Point, _latitude, _longitude, _height)
_place = st.tuples(_latitude, _longitude)


def _item(size: int) -> st.SearchStrategy[Item]:
    jump = st.builds(
        lambda target, repeat: action(DO_JUMP, float(target), float(repeat)),
        st.integers(0, size - 1),
        st.integers(0, 9),
    )
    placed = st.builds(
        lambda frame, params, place, height, go: Item(WAYPOINT, frame, (*params, *place, height), go),
        st.sampled_from([0, 3, 5, 6, 10]), st.tuples(*[_number] * 4), _place, _height, st.booleans(),
    )  # fmt: skip
    other = st.builds(
        lambda command, frame, params, go: Item(command, frame, params, go),
        st.sampled_from([20, 21, 22, 93, 112, 178, 195, 197, 201, 205, 206, 214, 530, 1000, 2000, 2001, 2500, 2501,
                         2800, 50000, 50001, 4501]),
        st.sampled_from([2, 3, 0]), st.tuples(*[_number] * 7), st.booleans(),
    )  # fmt: skip
    return placed | other | jump


_zone = st.builds(
    Polygon, st.booleans(), st.lists(_place, min_size=3, max_size=6).map(tuple), st.integers(0, 3)
) | st.builds(Circle, st.booleans(), _place | st.none(), st.floats(0.5, 1e5), st.integers(0, 3)).filter(
    lambda circle: circle.inclusion or circle.centre is not None
)


@st.composite
def plans(draw: st.DrawFn) -> Plan:
    """Any plan."""
    size = draw(st.integers(0, 12))
    return Plan(
        tuple(draw(_item(size)) for _ in range(size)),
        draw(st.none() | _point),
        tuple(draw(st.lists(_zone, max_size=3))),
        draw(st.none() | _point),
        tuple(draw(st.lists(_point, max_size=3))),
        draw(st.none() | st.floats(0.1, 30.0)),
        draw(st.none() | st.floats(0.1, 30.0)),
    )
