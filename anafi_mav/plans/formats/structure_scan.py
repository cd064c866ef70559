"""The items of a structure scan: QGroundControl stores what was drawn, not what is flown.

The flight goes around the structure at a distance, layer by layer, with the camera at a right angle to the way. Facts:
QGroundControl StructureScanComplexItem.cc (version 3 of its JSON), QGCMapPolygon.cc `offset`.
"""

from __future__ import annotations

import math
from typing import Any

from anafi_mav import geo, mav_enums
from anafi_mav.plans.plan import MISSION, RELATIVE, WAYPOINT, Item

VERSION = 3

MAX_LAYERS = 100

TRIGGER, LOOK, LOOK_NO_MORE = (
    mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mav_enums.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
    mav_enums.MAV_CMD_DO_SET_ROI_NONE,
)


def items_of(scan: dict[str, Any]) -> list[Item]:
    """Return the items of a structure scan.

    Raises `KeyError`, `TypeError` or `ValueError` for anything but a structure scan of version 3.
    """
    if scan["version"] != VERSION:
        raise ValueError(f"its version is {scan['version']}, not {VERSION}")
    camera = scan["CameraCalc"]
    layer = _length(camera["AdjustedFootprintFrontal"])
    spacing = _length(camera["AdjustedFootprintSide"])
    distance = _length(camera["DistanceToSurface"])
    layers = int(scan["Layers"])
    if not 0 < layers <= MAX_LAYERS:
        raise ValueError(f"{layers} layers")
    corners = around([(float(corner[0]), float(corner[1])) for corner in scan["polygon"]], distance)
    entrance = float(scan["EntranceAltitude"])
    from_top = bool(scan["StartFromTop"])
    height = float(scan["StructureHeight"]) - layer / 2.0 if from_top else float(scan["ScanBottomAlt"]) + layer / 2.0
    items = [_waypoint(corners[0], entrance), _action(LOOK, 0.0, 0.0, 0.0, 0.0, float(scan["GimbalPitch"]), 0.0, 90.0)]
    for _ in range(layers):
        for number, corner in enumerate([*corners, corners[0]]):
            items.append(_waypoint(corner, height))
            if number == 0:
                items.append(_action(TRIGGER, spacing, 0.0, 1.0))
        items.append(_action(TRIGGER, 0.0, 0.0, 0.0))
        height += -layer if from_top else layer
    return [*items, _action(LOOK_NO_MORE), _waypoint(corners[0], entrance)]


def around(corners: list[tuple[float, float]], distance: float) -> list[tuple[float, float]]:
    """The polygon whose sides run `distance` m outside of this one's.

    Its corners go clockwise, as seen from above.
    """
    if len(corners) < 3:
        raise ValueError(f"a polygon of {len(corners)} corners")
    origin = corners[0]
    plane = [geo.offset(*origin, *corner) for corner in corners]
    twice_area = sum(n * to_e - to_n * e for (n, e), (to_n, to_e) in zip(plane, [*plane[1:], plane[0]], strict=True))
    if twice_area < 0.0:  # north to east is clockwise
        plane.reverse()
    sides = []
    for (n, e), (to_n, to_e) in zip(plane, [*plane[1:], plane[0]], strict=True):
        length = math.hypot(to_n - n, to_e - e)
        if length == 0.0:
            raise ValueError("a corner twice")
        along = (to_n - n) / length, (to_e - e) / length
        # To the left of a clockwise way is outside.
        sides.append((n + distance * along[1], e - distance * along[0], *along))
    met = []
    for (n, e, an, ae), (to_n, to_e, bn, be) in zip([sides[-1], *sides[:-1]], sides, strict=True):
        cross = an * be - ae * bn
        if abs(cross) < 1e-9:
            raise ValueError("a corner that is none")
        t = ((to_n - n) * be - (to_e - e) * bn) / cross
        met.append(geo.destination(*origin, n + t * an, e + t * ae))
    return met


def _length(value: Any) -> float:
    if not isinstance(value, int | float) or not value > 0.0:
        raise ValueError(f"{value!r} is no length")
    return float(value)


def _waypoint(place: tuple[float, float], height: float) -> Item:
    return Item(WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, *place, height))


def _action(command: int, *params: float) -> Item:
    one, two, three, four, five, six, seven = (*params, *([0.0] * (7 - len(params))))
    return Item(command, MISSION, (one, two, three, four, five, six, seven))
