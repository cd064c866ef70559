"""What the programs written against MAVSDK share: the drone they fly, and a line for each step."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk

LIMIT = 60.0
"""s for anything that is waited for."""


def say(*words: object) -> None:
    print(*words, flush=True)


def ground_station() -> Mavsdk:
    return Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))


@asynccontextmanager
async def connected(url: str) -> AsyncIterator[Any]:
    """The first drone there."""
    async with ground_station() as mavsdk:
        await mavsdk.add_any_connection(url)
        drone = await mavsdk.first_autopilot(timeout_s=30.0)
        if drone is None:
            raise SystemExit("no drone")
        yield drone


async def until(updates: AsyncIterator[Any], accept: Callable[[Any], bool] = lambda update: True) -> Any:
    """The first update that is liked."""

    async def find() -> Any:
        async for update in updates:
            if accept(update):
                return update
        raise SystemExit("no more updates")

    return await asyncio.wait_for(find(), LIMIT)


def fields(item: Any) -> tuple[object, ...]:
    """All that an item of mission_raw says."""
    return (
        item.seq, item.frame, item.command, item.current, item.autocontinue, item.param1, item.param2, item.param3,
        item.param4, item.x, item.y, item.z, item.mission_type,
    )  # fmt: skip


async def held(name: str, seconds: float = 0.0) -> None:
    """Go on with a step for so long that something comes of it, and until the test has looked and said so."""
    await asyncio.sleep(seconds)
    say("held", name)
    await asyncio.to_thread(sys.stdin.readline)


async def tried(name: str, work: Awaitable[Any]) -> bool:
    """Whether something that may be refused was done; it says what became of it."""
    try:
        await work
        say("tried", name, "done")
        return True
    except Exception as error:  # MAVSDK has a class for each plugin
        if not hasattr(error, "result"):
            raise
        say("tried", name, error.result.name)
        return False
