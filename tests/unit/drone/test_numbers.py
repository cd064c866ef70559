"""Numbers that a program hands to the Python API and that no float holds."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Iterator
from typing import Any

import pytest
from support.python_api import members
from support.simulated import connected

from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.errors import AnafiMavError, LocalProtocolError

HUGE = 10**400
NUMBERS = ("float", "int", "float | None", "int | None")


def calls(owner: Any) -> Iterator[tuple[str, dict[str, int]]]:
    """Each coroutine of an object that takes numbers alone, with arguments of which one is too large."""
    for name, function in members(type(owner)):
        if not inspect.iscoroutinefunction(function):
            continue
        parameters = [one for one in inspect.signature(function).parameters.values() if one.name != "self"]
        numbers = {one.name for one in parameters if str(one.annotation) in NUMBERS}
        needed = {one.name: 1 for one in parameters if one.default is one.empty and one.kind is not one.VAR_POSITIONAL}
        if needed.keys() <= numbers:
            yield from ((name, {**needed, number: HUGE}) for number in sorted(numbers))


def owners(drone: Drone) -> Iterator[Any]:
    """The drone and its elements."""
    yield drone
    yield from (value for value in vars(drone).values() if type(value).__module__.startswith("anafi_mav.drone."))


async def test_number_that_no_float_holds_raises_only_errors_of_the_package() -> None:
    found, count = [], 0
    async with connected("4k", speed=20.0) as (drone, _):
        for owner in owners(drone):
            for name, arguments in calls(owner):
                count += 1
                try:
                    await asyncio.wait_for(getattr(owner, name)(**arguments), 1.0)
                except (AnafiMavError, asyncio.TimeoutError):
                    pass
                except Exception as error:
                    found.append(f"{type(owner).__name__}.{name}({', '.join(arguments)}): {error!r}")
    assert count > 50
    assert found == []


async def test_stick_position_that_no_float_holds_is_clipped() -> None:
    async with connected("4k") as (drone, _):
        drone.piloting.pilot(PilotingCommand(climb_mps=-HUGE))
        with pytest.raises(LocalProtocolError):
            drone.piloting.pilot(PilotingCommand(climb_mps=float("nan")))


async def test_pause_that_is_not_a_number_is_refused() -> None:
    """In the event loop's heap of timers it would hold back those of others."""
    with pytest.raises(LocalProtocolError):
        await Drone("127.0.0.1").pause(float("nan"))
