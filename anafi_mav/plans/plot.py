"""Picture of a plan: a map in metres around its start, and a height profile.

Needs matplotlib, the extra `plots`.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from anafi_mav import geo, mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans import path
from anafi_mav.plans.path import Stop
from anafi_mav.plans.plan import FenceCircle, Plan
from anafi_mav.plans.shots import ShotKind, shots
from anafi_mav.units import counted

Point2 = tuple[float, float]
"""East and north in m on the map; way and height in m in the profile."""

SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of pictures, by the ending of the file."""

MANY = 60
"""Places from which on they have no numbers; also the most arrows that there are."""

SHORTEST_LEG = 1.0
"""m: a shorter leg has no arrow."""

RETURN_HEIGHT = 20.0
"""m above take-off: at which a drone returns that nothing else has been set on (rth.xml, the firmware's default)."""


def draw(plan: Plan, title: str, target: Path) -> None:
    """Write the picture.

    Raises `PlanError` where nothing can be drawn or written, `ImportError` without matplotlib.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise PlanError(target.name, f"pictures end in {', '.join(SUFFIXES)}")
    stops = list(path.way(plan))
    if not stops:
        raise PlanError(title, "it has no places: nothing to draw")
    # Its own figures, without the screen that pyplot looks for.
    figure = importlib.import_module("matplotlib.figure").Figure(figsize=(8.0, 9.0), layout="constrained")
    chart, profile = figure.subplots(2, 1, height_ratios=(3, 1))
    origin = (plan.home.latitude, plan.home.longitude) if plan.home else (stops[0].latitude, stops[0].longitude)
    _map(chart, plan, stops, origin)
    chart.set_title(title)
    _profile(profile, plan, stops)
    try:
        figure.savefig(target, dpi=120, metadata={"Date": None} if target.suffix.lower() == ".svg" else None)
    except OSError as error:
        raise PlanError(target.name, error.strerror or str(error)) from error


def _map(axes: Any, plan: Plan, stops: list[Stop], origin: tuple[float, float]) -> None:
    def plane(place: tuple[float, float]) -> tuple[float, float]:
        north, east = geo.offset(*origin, *place)
        return east, north

    points = [plane((stop.latitude, stop.longitude)) for stop in stops]
    _rise(axes, plan, stops, points)
    axes.plot(*zip(*points, strict=True), "-", color="tab:blue", linewidth=1.5, label="way")
    axes.plot(*zip(*points, strict=True), "o", color="tab:blue", markersize=4)
    _direct(axes, points)
    _return(axes, plan, points)
    _camera(axes, plan, plane)
    numbers: dict[tuple[int, int], list[str]] = {}
    for stop, (east, north) in zip(stops, points, strict=True):
        numbers.setdefault((round(east), round(north)), []).append(str(stop.item))
    if len(stops) <= MANY:
        for spot, items in numbers.items():
            axes.annotate(", ".join(items), spot, textcoords="offset points", xytext=(5, 5), fontsize=8)
    if plan.home is not None:
        axes.plot(0.0, 0.0, "s", color="black", markersize=6, label="home")
    if plan.rally:
        rally = [plane((point.latitude, point.longitude)) for point in plan.rally]
        axes.plot(*zip(*rally, strict=True), "^", color="tab:green", markersize=7, label="rally points")
    for zone in plan.zones:
        outline = _outline(zone, origin, plane)
        colour, label = ("tab:green", "stay inside") if zone.inclusion else ("tab:red", "stay outside")
        axes.plot(*zip(*outline, strict=True), "--", color=colour, linewidth=1.0, label=label)
    _named(axes)
    axes.margins(x=0.08, y=0.15)  # room for the scale below the way
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.grid(True, linewidth=0.3)
    _north_and_scale(axes)


def _rise(axes: Any, plan: Plan, stops: list[Stop], points: list[Point2]) -> None:
    """Draw the take-off: its place, and the height to which the drone climbs there."""
    if plan.home is None or not starts_at_home(plan):
        return
    height = next((stop.height for stop in stops if stop.height is not None), None)
    up = "" if height is None else f" to {height:g} m"
    axes.annotate(
        f"take-off{up}", (0.0, 0.0), textcoords="offset points", xytext=(6, -14), fontsize=8, color="tab:blue"
    )
    if points[0] != (0.0, 0.0):
        axes.plot(*zip((0.0, 0.0), points[0], strict=True), "-", color="tab:blue", linewidth=1.5)
        _direct(axes, [(0.0, 0.0), points[0]])


def _direct(axes: Any, points: list[Point2]) -> None:
    """An arrow in the middle of each leg; of many legs, on some."""
    legs = [(one, two) for one, two in pairwise(points) if math.dist(one, two) >= SHORTEST_LEG]
    for one, two in legs[:: max(1, len(legs) // MANY)]:
        middle = ((one[0] + two[0]) / 2.0, (one[1] + two[1]) / 2.0)
        before = (middle[0] - (two[0] - one[0]) * 0.02, middle[1] - (two[1] - one[1]) * 0.02)
        axes.annotate(
            "", xy=middle, xytext=before, arrowprops={"arrowstyle": "-|>", "color": "tab:blue", "mutation_scale": 12}
        )


def _return(axes: Any, plan: Plan, points: list[Point2]) -> None:
    """The way back of a plan that ends with one."""
    if plan.home is None or not returns(plan) or points[-1] == (0.0, 0.0):
        return
    axes.plot(*zip(points[-1], (0.0, 0.0), strict=True), "--", color="tab:purple", linewidth=1.2, label="return")
    _direct(axes, [points[-1], (0.0, 0.0)])


def _camera(axes: Any, plan: Plan, plane: Callable[[tuple[float, float]], Point2]) -> None:
    """Photos, ways with photos or video, and what is looked at from where."""
    found = shots(plan)
    for kind, one, two in found.ways:
        axes.plot(*zip(plane(one), plane(two), strict=True), **_WAYS[kind], label=kind.value)
    if found.photos:
        places = [plane(place) for place in dict.fromkeys(found.photos)]
        axes.plot(*zip(*places, strict=True), "D", color="tab:red", markersize=6, label=ShotKind.PHOTO.value)
    for here, target in found.looks:
        if here is not None:
            axes.plot(*zip(plane(here), plane(target), strict=True), ":", color="tab:orange", linewidth=1.0)
    if found.looks:
        seen = [plane(target) for _, target in found.looks]
        axes.plot(*zip(*seen, strict=True), "*", color="tab:orange", markersize=10, label="looked at")


_WAYS: dict[ShotKind, dict[str, Any]] = {
    ShotKind.PHOTOS: {"color": "tab:red", "linewidth": 5.0, "alpha": 0.3, "solid_capstyle": "butt"},
    ShotKind.VIDEO: {"color": "tab:pink", "linewidth": 9.0, "alpha": 0.25, "solid_capstyle": "butt"},
}


def _north_and_scale(axes: Any) -> None:
    """An arrow to the north, and a bar of a round number of metres: about a fifth of the map."""
    axes.annotate(
        "N",
        xy=(0.96, 0.97),
        xytext=(0.96, 0.87),
        xycoords="axes fraction",
        ha="center",
        arrowprops={"arrowstyle": "-|>", "color": "black"},
        gid="north",
    )
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    metres = round_length(max(right - left, high - low) / 5.0)
    # Its length is one of the map, whatever the map grows to when both axes get one scale; its height one of the paper.
    across = axes.get_xaxis_transform()
    bar = (left, left + metres)
    axes.plot(bar, (0.03, 0.03), "-", color="black", linewidth=3.0, transform=across, gid="scale", scalex=False)
    axes.text(left, 0.045, f"{metres:g} m", fontsize=8, transform=across)


def round_length(metres: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(max(metres, 0.1)))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= max(metres, power))


def starts_at_home(plan: Plan) -> bool:
    """True unless the plan begins without a take-off, in the air."""
    return any(item.command == mav_enums.MAV_CMD_NAV_TAKEOFF for item in plan.items)


def returns(plan: Plan) -> bool:
    """True when the plan ends with a return."""
    return any(item.command == mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH for item in plan.items)


def _outline(zone: Any, origin: tuple[float, float], plane: Any) -> list[tuple[float, float]]:
    if not isinstance(zone, FenceCircle):
        return [plane(corner) for corner in (*zone.corners, zone.corners[0])]
    east, north = plane(zone.centre or origin)
    turns = [math.radians(angle) for angle in range(0, 361, 5)]
    return [(east + zone.radius * math.sin(turn), north + zone.radius * math.cos(turn)) for turn in turns]


def _named(axes: Any) -> None:
    """A legend with each name once."""
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    axes.legend(once.values(), once.keys(), fontsize=8, loc="best")


def profile_of(plan: Plan, stops: list[Stop]) -> tuple[list[Point2], list[Point2]]:
    """Return the height profiles of the flight from the take-off, and of the return.

    Points are m along the ground and m above take-off.
    """
    travelled, flown = 0.0, list[Point2]()
    at = (stops[0].latitude, stops[0].longitude)
    if plan.home is not None and starts_at_home(plan):
        at = (plan.home.latitude, plan.home.longitude)
        flown.append((0.0, 0.0))
        height = stops[0].height
        if height is not None:
            flown.append((0.0, height))  # straight up first
    for stop in stops:
        travelled += geo.distance(*at, stop.latitude, stop.longitude)
        at = (stop.latitude, stop.longitude)
        if stop.height is not None:
            flown.append((travelled, stop.height))
    if plan.home is None or not returns(plan) or not flown:
        return flown, []
    back = travelled + geo.distance(*at, plan.home.latitude, plan.home.longitude)
    height = max(flown[-1][1], RETURN_HEIGHT)
    return flown, [flown[-1], (travelled, height), (back, height)]


def _profile(axes: Any, plan: Plan, stops: list[Stop]) -> None:
    flown, back = profile_of(plan, stops)
    if flown:
        axes.plot(*zip(*flown, strict=True), "o-", color="tab:blue", markersize=4, linewidth=1.5)
    if back:
        label = f"return, at {RETURN_HEIGHT:g} m or higher"
        axes.plot(*zip(*back, strict=True), "--", color="tab:purple", linewidth=1.2, label=label)
        axes.legend(fontsize=8, loc="best")
    axes.set_ylim(bottom=min(0.0, *(height for _, height in flown), 0.0))
    unknown = sum(stop.height is None for stop in stops)
    left = f"; of {counted(unknown, 'place')} it is not known" if unknown else ""
    axes.set_xlabel("way, m")
    axes.set_ylabel("height, m")
    axes.set_title(f"height above take-off{left}", fontsize=9)
    axes.grid(True, linewidth=0.3)
