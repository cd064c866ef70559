"""A plan in words: its summary, then a row for each item with its parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from anafi_mav import geo, mav_enums
from anafi_mav.plans import path
from anafi_mav.plans.formats.parrot import SET_STILL_MODE, SET_VIEW_MODE
from anafi_mav.plans.plan import (
    DO_JUMP,
    GLOBAL,
    GLOBAL_INT,
    RELATIVE,
    RELATIVE_INT,
    TERRAIN,
    TERRAIN_INT,
    Item,
    Plan,
)
from anafi_mav.units import counted

_FRAMES = {RELATIVE: "", RELATIVE_INT: "", GLOBAL: " AMSL", GLOBAL_INT: " AMSL"} | dict.fromkeys(
    (TERRAIN, TERRAIN_INT), " above ground"
)

_WORDS: dict[int, dict[int, str]] = {
    mav_enums.MAV_CMD_NAV_WAYPOINT: {1: "hold {:g} s", 2: "within {:g} m", 4: "heading {:g}°"},
    mav_enums.MAV_CMD_NAV_LOITER_TIME: {1: "for {:g} s"},
    mav_enums.MAV_CMD_NAV_LAND: {4: "heading {:g}°"},
    mav_enums.MAV_CMD_NAV_TAKEOFF: {4: "heading {:g}°"},
    mav_enums.MAV_CMD_NAV_DELAY: {1: "{:g} s"},
    mav_enums.MAV_CMD_CONDITION_DELAY: {1: "{:g} s"},
    mav_enums.MAV_CMD_CONDITION_YAW: {1: "{:g}°"},
    DO_JUMP: {1: "to item {:g}", 2: "{:g} times"},
    mav_enums.MAV_CMD_DO_CHANGE_SPEED: {2: "{:g} m/s"},
    mav_enums.MAV_CMD_DO_MOUNT_CONTROL: {1: "pitch {:g}°", 2: "roll {:g}°", 3: "yaw {:g}°"},
    mav_enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: {1: "pitch {:g}°", 2: "yaw {:g}°"},
    mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST: {1: "every {:g} m"},
    mav_enums.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL: {1: "every {:g} ms"},
    mav_enums.MAV_CMD_SET_CAMERA_ZOOM: {1: "type {:g}", 2: "to {:g}"},
    mav_enums.MAV_CMD_IMAGE_START_CAPTURE: {2: "every {:g} s", 3: "{:g} photos"},
    mav_enums.MAV_CMD_PANORAMA_CREATE: {1: "{:g}° wide", 2: "{:g}° high", 3: "{:g}°/s", 4: "{:g}°/s up and down"},
    SET_VIEW_MODE: {1: "mode {:g}", 2: "ROI {:g}"},
    SET_STILL_MODE: {1: "type {:g}", 2: "every {:g}", 3: "format {:g}"},
}
"""Parameters by number, where their numbers say something."""

_EVEN_ZERO = frozenset({"heading {:g}°", "pitch {:g}°", "every {:g} m"})
"""Words that are said of 0, too."""

_OWN_NAMES = {SET_VIEW_MODE: "SET_VIEW_MODE", SET_STILL_MODE: "SET_STILL_CAPTURE_MODE"}


@dataclass(frozen=True)
class ItemRow:
    """An item in words."""

    number: str
    command: str
    place: str
    height: str
    leg: str
    """How far it is from the place before."""
    words: str

    def columns(self) -> tuple[str, ...]:
        return self.number, self.command, self.place, self.height, self.leg, self.words


HEAD = ItemRow("item", "command", "latitude, longitude", "height", "leg", "")

NUMBERS = (0, 3, 4)
"""Columns of numbers, aligned to the right."""


def name_of(command: int) -> str:
    """A command's name without its prefix; its number when it has none."""
    entry = mav_enums.enums["MAV_CMD"].get(command)
    return _OWN_NAMES.get(command) or (str(command) if entry is None else entry.name.removeprefix("MAV_CMD_"))


def summary(plan: Plan) -> str:
    """Return a summary of a plan in one line."""
    parts = [counted(len(plan.items), "item")]
    if plan.home is not None:
        parts.append(f"home {_place((plan.home.latitude, plan.home.longitude))} at {plan.home.height:g} m AMSL")
    stops = list(path.way(plan))
    if len(stops) > 1:
        parts.append(f"{path.length(stops):.0f} m from the first place to the last")
    heights = [stop.height for stop in stops if stop.height is not None]
    if heights:
        parts.append(f"up to {max(heights):g} m high")
    if plan.zones:
        parts.append(f"a fence of {counted(len(plan.zones), 'zone')}")
    if plan.rally:
        parts.append(counted(len(plan.rally), "rally point"))
    parts += [f"items {block.first} to {block.first + block.count - 1} are a {block.kind}" for block in plan.blocks]
    return ", ".join(parts)


def rows_of(plan: Plan) -> Iterator[ItemRow]:
    """Each item in words."""
    stops = {stop.item: stop for stop in path.way(plan)}
    before: path.Stop | None = None
    for number, item in enumerate(plan.items):
        leg, stop = "", stops.get(number)
        if stop is not None:
            if before is not None:
                leg = f"{geo.distance(before.latitude, before.longitude, stop.latitude, stop.longitude):.0f} m"
            before = stop
        place = path.place_of(item)
        height = item.params[6]
        placed = place is not None and height is not None
        yield ItemRow(
            str(number),
            name_of(item.command),
            "" if place is None else _place(place),
            f"{height:g} m{_FRAMES.get(item.frame, f' frame {item.frame}')}" if placed else "",
            leg,
            ", ".join(_words(item, place is not None)),
        )


def _words(item: Item, placed: bool) -> Iterator[str]:
    known = _WORDS.get(item.command, {})
    for number, value in enumerate(item.params, 1):
        if value is None or (placed and number > 4):
            continue
        word = known.get(number)
        if word is None and value != 0.0:
            yield f"param{number} {value:g}"
        elif word is not None and (value != 0.0 or word in _EVEN_ZERO):
            yield word.format(value)
    if not item.autocontinue:
        yield "waits to be continued"


def _place(place: tuple[float, float]) -> str:
    return f"{place[0]:.7f}, {place[1]:.7f}"
