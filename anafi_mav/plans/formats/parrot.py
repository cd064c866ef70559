"""Parrot's `.mavlink`: `QGC WPL 120`, no home, only the commands that the drone flies.

Version 1 is for ANAFI 4K, Thermal and USA, version 2 for the Ai. The first line does not distinguish them: the reader
of a file names the version. Facts: Parrot's developer pages on flight plans; GroundSDK's reader and writer. Only the
file is handled here; the translation of a mission that the drone cannot fly as it is, is not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans.formats.waypoints import editor_losses, rows, text_of
from anafi_mav.plans.plan import GLOBAL, GLOBAL_INT, MISSION, RELATIVE, RELATIVE_INT, Item, Loss, Params, Plan
from anafi_mav.units import counted

Version = Literal[1, 2]

HEADER = "QGC WPL 120"

UNSET = "nan"
"""As in Parrot's own files."""

_HEADER = re.compile(r"QGC WPL \d+")

SET_VIEW_MODE, SET_STILL_MODE = 50000, 50001
"""Parrot's own commands."""

_START_PHOTO = mav_enums.MAV_CMD_IMAGE_START_CAPTURE

_PLACE = frozenset({5, 6, 7})

_BOTH: dict[int, frozenset[int]] = {
    mav_enums.MAV_CMD_NAV_WAYPOINT: frozenset({1, 2, 4}) | _PLACE,
    mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH: frozenset(),
    mav_enums.MAV_CMD_NAV_DELAY: frozenset({1}),
    mav_enums.MAV_CMD_CONDITION_DELAY: frozenset({1}),
    mav_enums.MAV_CMD_IMAGE_STOP_CAPTURE: frozenset(),
    mav_enums.MAV_CMD_VIDEO_START_CAPTURE: frozenset(),
    mav_enums.MAV_CMD_VIDEO_STOP_CAPTURE: frozenset(),
    mav_enums.MAV_CMD_PANORAMA_CREATE: frozenset({1, 2, 3, 4}),
}
COMMANDS: dict[Version, dict[int, frozenset[int]]] = {
    1: {
        **_BOTH,
        mav_enums.MAV_CMD_NAV_LAND: frozenset(),
        mav_enums.MAV_CMD_NAV_TAKEOFF: frozenset(),
        mav_enums.MAV_CMD_DO_CHANGE_SPEED: frozenset({1, 2}),
        mav_enums.MAV_CMD_DO_SET_ROI: frozenset({1}) | _PLACE,
        mav_enums.MAV_CMD_DO_MOUNT_CONTROL: frozenset({1}),
        _START_PHOTO: frozenset({2, 3}),
        SET_VIEW_MODE: frozenset({1, 2}),
        SET_STILL_MODE: frozenset({1, 2, 3}),
    },
    2: {
        **_BOTH,
        mav_enums.MAV_CMD_NAV_LAND: frozenset({4}) | _PLACE,
        mav_enums.MAV_CMD_NAV_TAKEOFF: frozenset({4}) | _PLACE,
        mav_enums.MAV_CMD_DO_CHANGE_SPEED: frozenset({1, 2, 3, 4}),
        mav_enums.MAV_CMD_DO_SET_ROI: frozenset({1, 2, 3}) | _PLACE,
        mav_enums.MAV_CMD_DO_SET_ROI_LOCATION: _PLACE,
        mav_enums.MAV_CMD_DO_SET_ROI_NONE: frozenset(),
        mav_enums.MAV_CMD_DO_MOUNT_CONTROL: frozenset({1, 2, 3, 7}),
        mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST: frozenset({1, 2, 3}),
        mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL: frozenset({1, 2}),
        _START_PHOTO: frozenset({2, 3, 4}),
        SET_VIEW_MODE: frozenset({1, 2, 3}),
        SET_STILL_MODE: frozenset({1, 2, 3}),
    },
}
"""Commands of each version, and which of their parameters mean something, in MAVLink's numbers.

Two are written otherwise in version 1: IMAGE_START_CAPTURE has interval, count and format in param1 to param3, and the
format stands there instead of in param3 of SET_STILL_MODE.
"""

_NOTHING_WITHOUT_A_PLACE = (mav_enums.MAV_CMD_NAV_WAYPOINT, mav_enums.MAV_CMD_DO_SET_ROI_LOCATION)

_FLOAT_FRAMES = {RELATIVE_INT: RELATIVE, GLOBAL_INT: GLOBAL}

_UNSET = frozenset({None, 0.0, -1.0})
"""Of a parameter that means nothing, what is no loss: zero, and the -1 of "unchanged"."""


def read(text: str, source: str, version: Version) -> Plan:
    """The plan in a file. Raises `PlanError`."""
    first = text.split("\n", 1)[0].strip()
    if _HEADER.fullmatch(first) is None:
        raise PlanError(source, f"{first[:20]!r} is not the first line of a plan")
    items: list[Item] = []
    for number, item in enumerate(rows(text, source)):
        known = COMMANDS[version].get(item.command)
        if known is None:
            raise PlanError(source, f"command {item.command} is none of version {version}", number)
        if version == 1 and item.command == _START_PHOTO:
            items += _photo_of_version_1(item, items)
            continue
        params = _kept(item.params, known)
        # Version 1 has one frame for everything.
        frame = item.frame if known >= _PLACE and (version == 2 or item.frame in (GLOBAL, RELATIVE)) else MISSION
        items.append(Item(item.command, frame, params, item.autocontinue))
    return Plan(tuple(items))


def _kept(params: Params, known: frozenset[int]) -> Params:
    one, two, three, four, five, six, seven = params
    return (
        one if 1 in known else None,
        two if 2 in known else None,
        three if 3 in known else None,
        four if 4 in known else None,
        five if 5 in known else None,
        six if 6 in known else None,
        seven if 7 in known else None,
    )


def _photo_of_version_1(item: Item, before: list[Item]) -> list[Item]:
    """Convert a version 1 photo line to MAVLink's IMAGE_START_CAPTURE.

    A SET_STILL_MODE with its format is put before it if the last one in `before` has another format.
    """
    interval, count, kind = item.params[:3]
    start = Item(_START_PHOTO, MISSION, (None, interval, count, None, None, None, None), item.autocontinue)
    last = next((one for one in reversed(before) if one.command == SET_STILL_MODE), None)
    present = None if last is None else last.params[2]
    if kind in (None, 0.0) and present in (None, 0.0):
        return [start]
    if before and before[-1].command == SET_STILL_MODE:
        one, two, _, *_rest = before[-1].params
        before[-1] = replace(before[-1], params=(one, two, kind, None, None, None, None))
        return [start]
    if kind == present:
        return [start]
    return [Item(SET_STILL_MODE, MISSION, (0.0, interval, kind, None, None, None, None)), start]


def write(plan: Plan, version: Version) -> tuple[bytes, list[Loss]]:
    """A file of what the version can hold of the plan."""
    content, losses = write_items(plan.items, version)
    if plan.home is not None:
        losses.append(Loss("the planned home: the drone returns to where it took off"))
    if plan.zones or plan.breach_return:
        losses.append(Loss(f"the fence of {counted(len(plan.zones), 'zone')}"))
    if plan.rally:
        losses.append(Loss(counted(len(plan.rally), "rally point")))
    return content, losses + editor_losses(plan)


def write_items(items: Iterable[Item], version: Version) -> tuple[bytes, list[Loss]]:
    """A file of what the version can hold of these items."""
    losses: list[Loss] = []
    written: list[Item] = []
    still: float | None = None
    """The format of photos that holds, for version 1."""
    for number, item in enumerate(items):
        held = _held(number, item, version, losses)
        if held is None:
            continue
        if version == 1 and held.command == SET_STILL_MODE:
            still = held.params[2]
            held = replace(held, params=(*held.params[:2], 0.0, *held.params[3:]))
        elif version == 1 and held.command == _START_PHOTO:
            _, interval, count, *_rest = held.params
            held = replace(held, params=(interval, count, still or 0.0, 0.0, 0.0, 0.0, 0.0))
        written.append(held)
    return text_of(HEADER, written, current=None, unset=UNSET), losses


def _held(number: int, item: Item, version: Version, losses: list[Loss]) -> Item | None:
    """Return an item as the version can hold it, or None when it cannot hold it at all."""
    known = COMMANDS[version].get(item.command)
    if known is None:
        losses.append(Loss(f"command {item.command}: version {version} has none such", number))
        return None
    placed = known >= _PLACE
    frame = _FLOAT_FRAMES.get(item.frame, item.frame)
    if placed and not (frame == RELATIVE or (frame == GLOBAL and version == 2)):
        if item.params[4] is not None and item.params[5] is not None:
            losses.append(Loss(f"its height is in frame {item.frame}: version {version} has none such", number))
            return None
        frame = RELATIVE
    if item.command in _NOTHING_WITHOUT_A_PLACE and None in item.params[4:]:
        losses.append(Loss("it has no place", number))
        return None
    for place, value in enumerate(item.params, 1):
        if place not in known and value not in _UNSET:
            losses.append(Loss(f"param{place} of {value:g} means nothing to the drone", number))
    if not item.autocontinue:
        losses.append(Loss("that it waits to be continued", number))
    params = _kept(item.params, known)
    if version == 1:
        if item.command == mav_enums.MAV_CMD_NAV_WAYPOINT and params[3] is None:
            losses.append(Loss("its heading is not set: written as 0, which is north", number))
        one, two, three, four, five, six, seven = (0.0 if value is None else value for value in params)
        params = one, two, three, four, five, six, seven
    return Item(item.command, RELATIVE if version == 1 else (frame if placed else MISSION), params, item.autocontinue)
