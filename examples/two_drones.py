"""Fly two drones at once, or as many as the gateway has: MAVSDK (4.x), one connection for all of them.

    anafi-mav run -c two.yaml                       # in one terminal
    python examples/two_drones.py                   # in another

`two.yaml`, here with simulated drones:

    drones:
      - {name: alpha, sysid: 1, sim: {home: [48.8789, 2.3677, 35.0]}}
      - {name: bravo, sysid: 2, sim: {home: [48.8789, 2.3680, 35.0]}}
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

LISTEN = 3.0
"""s to listen for drones: each sends a heartbeat once a second."""
LOWEST, STEP = 4.0, 3.0
"""m above take-off of the first drone, and from one drone to the next."""

T = TypeVar("T")


async def until(updates: AsyncIterator[T], accept: Callable[[T], bool], what: str, timeout: float = 60.0) -> T:
    """Return the first update that `accept` takes and print `what`; raises TimeoutError when none arrives in time."""

    async def find() -> T:
        async for update in updates:
            if accept(update):
                return update
        raise RuntimeError(f"the updates ended before: {what}")

    try:
        found = await asyncio.wait_for(find(), timeout)
    except asyncio.TimeoutError:
        raise TimeoutError(f"not within {timeout:g} s: {what}") from None
    print(what, flush=True)
    return found


async def fly(number: int, drone: System, height: float) -> None:
    """One drone's flight; the others do the same meanwhile."""
    name = f"system {number}"
    action, telemetry = ActionAsync(drone), TelemetryAsync(drone)
    await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, f"{name}: healthy")
    await action.set_takeoff_altitude(height)
    await action.arm()
    await action.takeoff()
    await until(
        telemetry.subscribe_position(), lambda p: p.relative_altitude_m > height - 0.5, f"{name}: at {height:g} m"
    )
    await action.land()
    await until(telemetry.subscribe_armed(), lambda armed: not armed, f"{name}: landed and disarmed")


async def fly_all(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        if await mavsdk.first_autopilot(timeout_s=30.0) is None:
            raise SystemExit(f"no drone at {url} within 30 s")
        await asyncio.sleep(LISTEN)
        drones = {await system.get_system_id(): system for system in await mavsdk.get_systems()}
        print(f"drones: {len(drones)}", flush=True)
        await asyncio.gather(
            *(fly(number, drones[number], LOWEST + STEP * index) for index, number in enumerate(sorted(drones)))
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Fly every drone of a gateway at once.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    asyncio.run(fly_all(parser.parse_args().url))


if __name__ == "__main__":
    main()
