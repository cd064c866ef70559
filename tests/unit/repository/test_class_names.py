"""A public class name exists once, so that a reader knows the class without the imports of its module."""

from __future__ import annotations

import ast
import functools
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[3] / "anafi_mav"

ELSEWHERE = ("arsdk/messages/", "mav_enums.py", "mavlink/dialect.py")
"""Parrot's and MAVLink's own names, or generated."""

QUALIFIED = {"State", "Event"}
"""Of the machine in their module; used with the module's name, or in it alone."""

BOTH_SIDES = {
    "Animations",
    "Battery",
    "Camera",
    "FlightPlan",
    "FollowMe",
    "Gimbal",
    "Identity",
    "Media",
    "Poi",
    "Resource",
    "Storage",
    "Thermal",
}
"""The same real thing, once simulated in `sim` and once seen by its user in `drone`."""


@functools.cache
def public_classes() -> dict[str, list[str]]:
    """Return the modules (room/…/module.py) of each class that is public and stands at the top of a module."""
    places = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        if place.startswith(ELSEWHERE):
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(place)
    return places


def test_public_class_name_exists_once() -> None:
    repeated = {name: places for name, places in public_classes().items() if len(places) > 1}
    assert {name: places for name, places in repeated.items() if name not in QUALIFIED | BOTH_SIDES} == {}


def test_repeated_class_name_is_one_in_sim_and_drone() -> None:
    classes = public_classes()
    rooms = {name: tuple(sorted(place.split("/")[0] for place in classes[name])) for name in BOTH_SIDES}
    assert rooms == dict.fromkeys(BOTH_SIDES, ("drone", "sim"))
