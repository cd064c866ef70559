"""QGroundControl's `.plan`: JSON with a mission, a fence and rally points.

Surveys and corridor scans store the items that are flown; they become those, and stay editable as long as nothing
changes them. A structure scan stores its drawing only (`structure_scan`). Facts: docs.qgroundcontrol.com plan.html,
QGroundControl MissionItem.cc, SimpleMissionItem.cc, GeoFenceController.cc, TransectStyleComplexItem.cc.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

import msgspec

from anafi_mav.errors import PlanError
from anafi_mav.plans.formats import structure_scan
from anafi_mav.plans.plan import (
    DO_JUMP,
    GLOBAL,
    GLOBAL_INT,
    MAX_ITEMS,
    MISSION,
    RELATIVE,
    RELATIVE_INT,
    TERRAIN,
    TERRAIN_INT,
    Block,
    FenceCircle,
    FencePolygon,
    Item,
    Loss,
    Params,
    Plan,
    Point,
)

FILE_TYPE = "Plan"
VERSION, MISSION_VERSION, LIST_VERSION = 1, 2, 2

_SIMPLE_KEYS = frozenset({"type", "frame", "command", "autoContinue", "doJumpId", "params", "coordinate"})
_MISSION_KEYS = frozenset({"items", "plannedHomePosition", "cruiseSpeed", "hoverSpeed", "version"})
_FILE_KEYS = frozenset({"fileType", "version", "mission", "geoFence", "rallyPoints"})

LARGEST = sys.float_info.max
"""Largest number that a float holds. JSON has larger whole ones."""

_TRANSECTS = ("survey", "CorridorScan")
"""Kinds of items that store what is flown."""

_ALTITUDE_MODES = {RELATIVE: 1, RELATIVE_INT: 1, GLOBAL: 2, GLOBAL_INT: 2, TERRAIN: 4, TERRAIN_INT: 4}
"""QGroundControl's altitude mode by frame: relative, absolute, above terrain by the vehicle."""

_DEFAULTS = {"firmwareType": 12, "vehicleType": 2, "globalPlanAltitudeMode": 0}
"""Of a plan that QGroundControl has not made: PX4, quadrotor, each item as its frame says."""


class _Trouble(Exception):
    """Something in the file is not as it has to be; the text is a clause."""


def read(text: str | bytes, source: str) -> Plan:
    """The plan in a file. Raises `PlanError`."""
    try:
        document = msgspec.json.decode(text)
        json.loads(text, object_pairs_hook=_once)  # which of two values counts, no reader could say
    except (ValueError, RecursionError) as error:
        raise PlanError(source, f"no JSON: {error}") from error
    reader = _Reader(source)
    try:
        return reader.plan(document)
    except _Trouble as error:
        raise PlanError(source, str(error), reader.item) from error


def _once(pairs: list[tuple[str, Any]]) -> None:
    """Raise `ValueError` for an object that has a key twice."""
    if len(dict(pairs)) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:40]!r} stands twice in one object")


class _Reader:
    def __init__(self, source: str) -> None:
        self.source = source
        self.item: int | None = None
        """Number of the item that is being read, for messages."""
        self._items: list[Item] = []
        self._numbers: dict[int, int] = {}
        """Places of items by QGroundControl's doJumpId."""
        self._blocks: list[Block] = []

    def plan(self, document: Any) -> Plan:
        whole = _mapping(document, "the file")
        if whole.get("fileType") != FILE_TYPE:
            raise _Trouble("it is no QGroundControl plan")
        _version(whole, VERSION, "the plan")
        mission = _mapping(whole.get("mission"), "mission")
        _version(mission, MISSION_VERSION, "the mission")
        for stored in _sequence(mission.get("items"), "mission.items"):
            self.item = len(self._items)
            self._take(_mapping(stored, "an item"))
            if len(self._items) > MAX_ITEMS:
                raise _Trouble(f"more than {MAX_ITEMS} items")
        self.item = None
        items = tuple(self._resolved(number, item) for number, item in enumerate(self._items))
        home = mission.get("plannedHomePosition")
        zones, back = self._fence(whole.get("geoFence"))
        rally = _mapping(whole.get("rallyPoints") or {"version": LIST_VERSION}, "rallyPoints")
        _version(rally, LIST_VERSION, "the rally points")
        editor = {
            "file": {key: value for key, value in whole.items() if key not in _FILE_KEYS},
            "mission": {key: value for key, value in mission.items() if key not in _MISSION_KEYS},
        }
        return Plan(
            items,
            None if home is None else _point(home, "plannedHomePosition"),
            zones,
            back,
            tuple(_point(point, "a rally point") for point in _sequence(rally.get("points", []), "rallyPoints.points")),
            _optional(mission.get("cruiseSpeed"), "cruiseSpeed"),
            _optional(mission.get("hoverSpeed"), "hoverSpeed"),
            tuple(self._blocks),
            _json(editor),
        )

    def _take(self, stored: dict[str, Any]) -> None:
        kind = stored.get("type")
        if kind == "SimpleItem":
            self._simple(stored)
            return
        if kind != "ComplexItem":
            raise _Trouble(f"an item of type {kind!r}")
        name = stored.get("complexItemType")
        first = len(self._items)
        if name in _TRANSECTS:
            drawn = _mapping(stored.get("TransectStyleComplexItem"), f"the {name}")
            if "Items" not in drawn:
                raise _Trouble(f"the {name} stores no items: save the plan with a newer QGroundControl")
            for inner in _sequence(drawn["Items"], "Items"):
                self._simple(_mapping(inner, "an item"))
        elif name == "StructureScan":
            try:
                self._items += structure_scan.items_of(stored)
            except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
                raise _Trouble(f"the structure scan cannot be understood: {error}") from error
        else:
            raise _Trouble(f"items of type {name!r} are not for a multicopter, or not known")
        self._blocks.append(Block(name, first, len(self._items) - first, _json(stored)))

    def _simple(self, stored: dict[str, Any]) -> None:
        place = len(self._items)
        self.item = place
        params = [_optional(value, "params") for value in _sequence(stored.get("params"), "params")]
        if len(params) == 4 and "coordinate" in stored:  # before 2018
            point = _point(stored["coordinate"], "coordinate")
            params += [point.latitude, point.longitude, point.height]
        if len(params) != 7:
            raise _Trouble(f"{len(params)} params, expected 7")
        jump = stored.get("doJumpId")
        if isinstance(jump, int):
            self._numbers[jump] = place
        one, two, three, four, five, six, seven = params
        extra = {key: value for key, value in stored.items() if key not in _SIMPLE_KEYS}
        self._items.append(
            Item(
                _whole(stored.get("command"), "command", 0xFFFF),
                _whole(stored.get("frame"), "frame", 0xFF),
                (one, two, three, four, five, six, seven),
                stored.get("autoContinue") is not False,
                _json(extra) if extra else "",
            )
        )

    def _resolved(self, number: int, item: Item) -> Item:
        if item.command != DO_JUMP:
            return item
        target, *rest = item.params
        place = None if target is None else self._numbers.get(int(target))
        if place is None:
            self.item = number
            where = "nowhere" if target is None else f"to doJumpId {target:g}, which is not there"
            raise _Trouble(f"it jumps {where}")
        two, three, four, five, six, seven = rest
        params: Params = (float(place), two, three, four, five, six, seven)
        return Item(item.command, item.frame, params, item.autocontinue, item.extra)

    def _fence(self, stored: Any) -> tuple[tuple[FencePolygon | FenceCircle, ...], Point | None]:
        if stored is None:
            return (), None
        fence = _mapping(stored, "geoFence")
        _version(fence, LIST_VERSION, "the fence")
        zones: list[FencePolygon | FenceCircle] = []
        for one in _sequence(fence.get("polygons", []), "geoFence.polygons"):
            polygon = _mapping(one, "a polygon")
            corners = tuple(_place(corner, "a corner") for corner in _sequence(polygon.get("polygon"), "polygon"))
            if len(corners) < 3:
                raise _Trouble(f"a polygon of the fence has {len(corners)} corners")
            zones.append(FencePolygon(polygon.get("inclusion") is not False, corners))
        for one in _sequence(fence.get("circles", []), "geoFence.circles"):
            circle = _mapping(one, "a circle")
            drawn = _mapping(circle.get("circle"), "circle")
            radius = _number(drawn.get("radius"), "radius")
            if radius <= 0.0:
                raise _Trouble(f"a circle of the fence has a radius of {radius:g} m")
            zones.append(
                FenceCircle(circle.get("inclusion") is not False, _place(drawn.get("center"), "center"), radius)
            )
        back = fence.get("breachReturn")
        return tuple(zones), None if back is None else _point(back, "breachReturn")


def _mapping(value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _Trouble(f"{what} is no object")
    return value


def _sequence(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise _Trouble(f"{what} is no list")
    return value


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise _Trouble(f"{what}: {str(value)[:20]} is no number")
    return float(value)


def _optional(value: Any, what: str) -> float | None:
    return None if value is None else _number(value, what)


def _whole(value: Any, what: str, top: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= top:
        raise _Trouble(f"{str(value)[:20]} is no {what}")
    return value


def _version(value: dict[str, Any], expected: int, what: str) -> None:
    if value.get("version") != expected:
        raise _Trouble(f"{what} is of version {str(value.get('version'))[:20]}, not {expected}")


def _place(value: Any, what: str) -> tuple[float, float]:
    numbers = [_number(number, what) for number in _sequence(value, what)]
    if len(numbers) < 2 or abs(numbers[0]) > 90.0 or abs(numbers[1]) > 180.0:
        raise _Trouble(f"{what} is no place")
    return numbers[0], numbers[1]


def _point(value: Any, what: str) -> Point:
    latitude, longitude = _place(value, what)
    return Point(latitude, longitude, _optional(value[2], what) or 0.0 if len(value) > 2 else 0.0)


def _json(value: Any) -> str:
    return msgspec.json.encode(value).decode()


# Writing.


def write(plan: Plan) -> tuple[bytes, list[Loss]]:
    """A file of the plan."""
    losses: list[Loss] = []
    editor = msgspec.json.decode(plan.editor) if plan.editor else {"file": {}, "mission": {}}
    mission: dict[str, Any] = {**_DEFAULTS, **editor["mission"], "version": MISSION_VERSION}
    mission["items"] = _stored_items(plan, losses)
    mission["plannedHomePosition"] = None if plan.home is None else _stored_point(plan.home)
    if plan.home is None:
        # QGroundControl wants one; a plan begins where its first place is.
        mission["plannedHomePosition"] = [*_first_place(plan.items), 0.0]
        losses.append(Loss("that there is no planned home: written as where the first place is, at sea level"))
    mission["cruiseSpeed"] = 15.0 if plan.cruise_speed is None else plan.cruise_speed
    mission["hoverSpeed"] = 5.0 if plan.hover_speed is None else plan.hover_speed
    if plan.hover_speed is None or plan.cruise_speed is None:
        losses.append(Loss("that no speeds are assumed: written as QGroundControl's 15 and 5 m/s"))
    document = {
        "groundStation": "anafi-mav",
        **editor["file"],
        "fileType": FILE_TYPE,
        "version": VERSION,
        "mission": mission,
        "geoFence": _stored_fence(plan, losses),
        "rallyPoints": {"points": [_stored_point(point) for point in plan.rally], "version": LIST_VERSION},
    }
    return msgspec.json.format(msgspec.json.encode(document, order="sorted"), indent=4) + b"\n", losses


def _stored_items(plan: Plan, losses: list[Loss]) -> list[Any]:
    stored: list[Any] = []
    blocks = {block.first: block for block in plan.blocks}
    number = 0
    while number < len(plan.items):
        block = blocks.get(number)
        if block is not None and (drawn := _stored_block(block, plan.items)) is not None:
            stored.append(drawn)
            number += block.count
            continue
        if block is not None:
            losses.append(Loss(f"its items are not those of the {block.kind} any more: written one by one", number))
        stored.append(_stored_item(number, plan.items[number]))
        number += 1
    return stored


def _stored_block(block: Block, items: Sequence[Item]) -> Any:
    """The editor's own form of items that are still what it made; None when they are not."""
    stored = msgspec.json.decode(block.data)
    reader = _Reader("")
    try:
        reader._take(stored)
    except _Trouble:
        return None
    made = tuple(reader._items)
    now = tuple(items[block.first : block.first + block.count])
    if made != now or any(item.command == DO_JUMP for item in now):
        return None
    for number, inner in enumerate(stored.get("TransectStyleComplexItem", {}).get("Items", [])):
        inner["doJumpId"] = block.first + number + 1
    return stored


def _stored_item(number: int, item: Item) -> dict[str, Any]:
    params = list(item.params)
    if item.command == DO_JUMP and params[0] is not None:
        params[0] += 1  # doJumpId counts from 1
    extra: dict[str, Any] = msgspec.json.decode(item.extra) if item.extra else {}
    if not extra and item.frame in _ALTITUDE_MODES and params[6] is not None:
        extra = {"Altitude": params[6], "AltitudeMode": _ALTITUDE_MODES[item.frame], "AMSLAltAboveTerrain": None}
    return {
        **extra,
        "type": "SimpleItem",
        "frame": item.frame,
        "command": item.command,
        "autoContinue": item.autocontinue,
        "doJumpId": number + 1,
        "params": params,
    }


def _first_place(items: Sequence[Item]) -> tuple[float, float]:
    """Return the position of the first item with a place; 0, 0 without one.

    Values that are no place on the globe are other parameters.
    """
    for item in items:
        latitude, longitude = item.params[4:6]
        if item.frame == MISSION or latitude is None or longitude is None:
            continue
        if abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and (latitude, longitude) != (0.0, 0.0):
            return latitude, longitude
    return 0.0, 0.0


def _stored_point(point: Point) -> list[float]:
    return [point.latitude, point.longitude, point.height]


def _stored_fence(plan: Plan, losses: list[Loss]) -> dict[str, Any]:
    polygons, circles = [], []
    for zone in plan.zones:
        if zone.inclusion and zone.group != 0:
            losses.append(Loss(f"an inclusion zone of the fence is of group {zone.group}: there are no groups"))
        if isinstance(zone, FencePolygon):
            corners = [list(corner) for corner in zone.corners]
            polygons.append({"inclusion": zone.inclusion, "polygon": corners, "version": 1})
        elif zone.centre is None:
            losses.append(Loss(f"the fence's circle of {zone.radius:g} m around home: circles have a place"))
        else:
            drawn = {"center": list(zone.centre), "radius": zone.radius}
            circles.append({"circle": drawn, "inclusion": zone.inclusion, "version": 1})
    fence: dict[str, Any] = {"circles": circles, "polygons": polygons, "version": LIST_VERSION}
    if plan.breach_return is not None:
        fence["breachReturn"] = _stored_point(plan.breach_return)
    return fence
