"""What the programs written against dronekit share: a wait for what the vehicle reports, and a line for each step."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any


def say(*words: object) -> None:
    print(*words, flush=True)


def until(vehicle: Any, name: str, true: Callable[[Any], bool], timeout: float = 30.0) -> None:
    """Wait for an attribute of the vehicle, by dronekit's own events."""
    met = threading.Event()

    def changed(_: Any, __: str, value: Any) -> None:
        if true(value):
            met.set()

    where = vehicle.location if name.startswith("location.") else vehicle
    name = name.removeprefix("location.")
    where.add_attribute_listener(name, changed)
    try:
        if not true(getattr(where, name)) and not met.wait(timeout):
            raise SystemExit(f"{name} did not become what was waited for: {getattr(where, name)}")
    finally:
        where.remove_attribute_listener(name, changed)
