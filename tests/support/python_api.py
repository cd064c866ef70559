"""The public Python API: what `anafi_mav.drone` exports, and which of its methods are machinery."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from anafi_mav import drone
from anafi_mav.drone.element import Element

INTERNAL = frozenset(
    {
        "allows", "details", "link_lost", "link_up", "on_plan", "on_playing", "questions", "reactions", "release",
        "require_free", "reset",
    }
)  # fmt: skip
"""Methods of elements that `Drone` calls: public between modules, no part of the API."""

INTERNAL_OF = {
    "Drone": {"moves_started", "counters"},
    "Move": {"answer", "end", "ended", "is_to", "running", "under_way"},
    "Piloting": {"moves_started", "set_min_altitude", "settle_landing", "sticks_held"},
    "Home": {"request_states"},
    "Video": {"close"},
}
"""The same, of one class."""


def is_public(owner: type, name: str) -> bool:
    """True for a method or property that the reference documents."""
    if name.startswith("_") or name in INTERNAL_OF.get(owner.__name__, ()):
        return False
    return not (issubclass(owner, Element | drone.Drone) and name in INTERNAL)


def members(owner: type) -> Iterator[tuple[str, Any]]:
    """(name, function) of the public methods and properties of a class, in the order of their definition."""
    seen = set()
    for base in owner.__mro__:
        if not base.__module__.startswith("anafi_mav"):
            continue
        for name, member in vars(base).items():
            function = member.fget if isinstance(member, property) else member
            if inspect.isfunction(function) and name not in seen and is_public(owner, name):
                seen.add(name)
                yield name, member


def classes() -> list[type]:
    """Every exported class."""
    return [value for name in drone.__all__ if inspect.isclass(value := getattr(drone, name))]
