"""A plan as a picture: a map in metres around where it begins, and how high it goes along its way.

Needs matplotlib, the extra `plots`.
"""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from typing import Any

from anafi_mav import geo
from anafi_mav.errors import PlanError
from anafi_mav.plans import path
from anafi_mav.plans.path import Stop
from anafi_mav.plans.plan import Circle, Plan, counted

SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of pictures, by the ending of the file."""

MANY = 60
"""Places from which on they have no numbers any more."""


def draw(plan: Plan, title: str, target: Path) -> None:
    """Write the picture. Raises `PlanError` where nothing can be drawn or written, `ImportError` without matplotlib."""
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
    _profile(profile, stops)
    try:
        figure.savefig(target, dpi=120, metadata={"Date": None} if target.suffix.lower() == ".svg" else None)
    except OSError as error:
        raise PlanError(target.name, error.strerror or str(error)) from error


def _map(axes: Any, plan: Plan, stops: list[Stop], origin: tuple[float, float]) -> None:
    def plane(place: tuple[float, float]) -> tuple[float, float]:
        north, east = geo.offset(*origin, *place)
        return east, north

    points = [plane((stop.latitude, stop.longitude)) for stop in stops]
    axes.plot(*zip(*points, strict=True), "-", color="tab:blue", linewidth=1.5, label="way")
    axes.plot(*zip(*points, strict=True), "o", color="tab:blue", markersize=4)
    numbers: dict[tuple[int, int], list[str]] = {}
    for stop, (east, north) in zip(stops, points, strict=True):
        numbers.setdefault((round(east), round(north)), []).append(str(stop.item))
    if len(stops) <= MANY:
        for spot, items in numbers.items():
            axes.annotate(", ".join(items), spot, textcoords="offset points", xytext=(5, 5), fontsize=8)
    looks = [(item, path.place_of(item)) for item in plan.items if item.command in path.LOOKS]
    seen = [plane(place) for _, place in looks if place is not None]
    if seen:
        axes.plot(*zip(*seen, strict=True), "*", color="tab:orange", markersize=10, label="looked at")
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
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.grid(True, linewidth=0.3)


def _outline(zone: Any, origin: tuple[float, float], plane: Any) -> list[tuple[float, float]]:
    if not isinstance(zone, Circle):
        return [plane(corner) for corner in (*zone.corners, zone.corners[0])]
    east, north = plane(zone.centre or origin)
    turns = [math.radians(angle) for angle in range(0, 361, 5)]
    return [(east + zone.radius * math.sin(turn), north + zone.radius * math.cos(turn)) for turn in turns]


def _named(axes: Any) -> None:
    """A legend with each name once."""
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    axes.legend(once.values(), once.keys(), fontsize=8, loc="best")


def _profile(axes: Any, stops: list[Stop]) -> None:
    travelled, last, known = 0.0, stops[0], []
    for stop in stops:
        travelled += geo.distance(last.latitude, last.longitude, stop.latitude, stop.longitude)
        last = stop
        if stop.height is not None:
            known.append((travelled, stop.height))
    if known:
        axes.plot(*zip(*known, strict=True), "o-", color="tab:blue", markersize=4, linewidth=1.5)
    axes.set_ylim(bottom=min(0.0, *(height for _, height in known), 0.0))
    unknown = len(stops) - len(known)
    left = f"; of {counted(unknown, 'place')} it is not known" if unknown else ""
    axes.set_xlabel("way, m")
    axes.set_ylabel("height, m")
    axes.set_title(f"height above take-off{left}", fontsize=9)
    axes.grid(True, linewidth=0.3)
