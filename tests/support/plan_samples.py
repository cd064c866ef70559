"""Plans for tests: made by hand, and drawn at random."""

from __future__ import annotations

import json
from collections.abc import Callable
from random import Random
from typing import Any, TypeVar

from hypothesis import strategies as st

from anafi_mav import mav_enums
from anafi_mav.plans.plan import (
    DO_JUMP,
    GLOBAL,
    MISSION,
    RELATIVE,
    WAYPOINT,
    FenceCircle,
    FencePolygon,
    Item,
    Plan,
    Point,
)

T = TypeVar("T")

LAT, LON = 48.8789, 2.3677

PARROTS_EXAMPLE = b"""QGC WPL 120
0 1 3 22   15.0 0.0 0.0 nan  48.878601 2.366549 15.0 1
1 0 3 16   0.0 0.0 0.0 0.0   48.879000 2.366549 20.0 1
2 0 2 2000 0.0 1.0 1.0 1.0   0.0 0.0 0.0 1
3 0 2 93   10.0 0.0 0.0 0.0  0.0 0.0 0.0 1
4 0 2 2001 0.0 0.0 0.0 0.0   0.0 0.0 0.0 1
5 0 3 16   0.0 0.0 0.0 0.0   48.879139 2.367296 0.0 1
6 0 3 21   0.0 0.0 0.0 nan   48.879139 2.367296 0.0 1
"""
"""The example of Parrot's developer pages, with its blanks."""


def waypoint(north: float, east: float, height: float = 20.0, *params: float | None, frame: int = RELATIVE) -> Item:
    """A waypoint so many 1e-4 degrees from the middle."""
    one, two, three, four = (*params, *([0.0, 0.0, 0.0, None][len(params) :]))
    return Item(WAYPOINT, frame, (one, two, three, four, LAT + north * 1e-4, LON + east * 1e-4, height))


def action(command: int, *params: float | None) -> Item:
    one, two, three, four, five, six, seven = (*params, *([None] * (7 - len(params))))
    return Item(command, MISSION, (one, two, three, four, five, six, seven))


FLIGHT = Plan(
    items=(
        Item(mav_enums.MAV_CMD_NAV_TAKEOFF, RELATIVE, (15.0, 0.0, 0.0, None, LAT, LON, 15.0)),
        action(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 1.0, 4.0, -1.0),
        waypoint(1, 0, 20.0, 0.0, 2.0, 0.0, 90.0),
        action(mav_enums.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, 1.0, 0.0),
        action(mav_enums.MAV_CMD_NAV_DELAY, 10.0),
        waypoint(1, 2, 25.0),
        action(DO_JUMP, 2.0, 3.0),
        Item(mav_enums.MAV_CMD_DO_SET_ROI, RELATIVE, (3.0, 0.0, 0.0, 0.0, LAT, LON, 5.0)),
        waypoint(0, 2, 60.0, frame=GLOBAL),
        action(mav_enums.MAV_CMD_VIDEO_START_CAPTURE, 0.0),
        action(mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE),
        action(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ),
    home=Point(LAT, LON, 35.0),
    zones=(
        FencePolygon(True, ((LAT + 0.01, LON + 0.01), (LAT - 0.01, LON + 0.01), (LAT, LON - 0.01))),
        FenceCircle(False, (LAT + 0.002, LON), 12.5),
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

_EDGES = (None, 0.0, -1.0, 1.0, -0.0, 1e-7, 5e-324, 1e6, -1e6, 0.1)
_COMMANDS = (20, 21, 22, 93, 112, 178, 195, 197, 201, 205, 206, 214, 530, 1000, 2000, 2001, 2500, 2501, 2800, 50000,
             50001, 4501)  # fmt: skip


def _number(random: Random) -> float | None:
    return random.choice(_EDGES) if random.random() < 0.6 else random.uniform(-1e6, 1e6)


def _place(random: Random) -> tuple[float, float]:
    return random.choice(
        [(random.uniform(-90.0, 90.0), random.uniform(-180.0, 180.0)), (90.0, -180.0), (-1e-9, 1e-300), (0.0, 0.0)]
    )


def _height(random: Random) -> float:
    return random.choice([random.uniform(-500.0, 10_000.0), 0.0, -500.0, 1e-9])


def _point(random: Random) -> Point:
    return Point(*_place(random), _height(random))


def _item(random: Random, size: int) -> Item:
    go = random.random() < 0.8
    kind = random.randrange(3)
    if kind == 0:
        return action(DO_JUMP, float(random.randrange(size)), float(random.randrange(10)))
    one, two, three, four, five, six, seven = (_number(random) for _ in range(7))
    if kind == 1:
        where = (*_place(random), _height(random))
        return Item(WAYPOINT, random.choice([0, 3, 5, 6, 10]), (one, two, three, four, *where), go)
    return Item(random.choice(_COMMANDS), random.choice([2, 3, 0]), (one, two, three, four, five, six, seven), go)


def _zone(random: Random) -> FencePolygon | FenceCircle:
    inclusion, group = random.random() < 0.5, random.randrange(4)
    if random.random() < 0.5:
        return FencePolygon(inclusion, tuple(_place(random) for _ in range(random.randint(3, 6))), group)
    centre = None if inclusion and random.random() < 0.3 else _place(random)
    return FenceCircle(inclusion, centre, random.choice([0.5, 1e5, random.uniform(0.5, 1e5)]), group)


def plan_of(seed: int) -> Plan:
    """Any plan: always the same of the same number."""
    random = Random(seed)
    size = random.randint(0, 12)

    def perhaps(make: Callable[[Random], T]) -> T | None:
        return make(random) if random.random() < 0.5 else None

    return Plan(
        tuple(_item(random, size) for _ in range(size)),
        perhaps(_point),
        tuple(_zone(random) for _ in range(random.randrange(4))),
        perhaps(_point),
        tuple(_point(random) for _ in range(random.randrange(4))),
        perhaps(lambda random: random.uniform(0.1, 30.0)),
        perhaps(lambda random: random.uniform(0.1, 30.0)),
    )


def plans() -> st.SearchStrategy[Plan]:
    """Any plan. The numbers are drawn from a seed: drawing each by itself takes a hundred times as long."""
    return st.builds(plan_of, st.integers(0, 2**32))
