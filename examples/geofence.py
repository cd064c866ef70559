"""Upload a fence and see a target outside it refused: MAVSDK (4.x) and its plugin geofence.

anafi-mav                              # in one terminal
python examples/geofence.py            # in another
"""

from __future__ import annotations

import argparse
import asyncio
import math
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.geofence import Circle, FenceType, GeofenceAsync, GeofenceData, Point
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

METRES_PER_DEGREE = 111_195.0
"""m of latitude on a sphere of 6371 km; good to 0.5 % anywhere."""

RADIUS = 30.0
"""m of the fence, around where the drone stands."""
HEIGHT = 5.0
"""m above the take-off point."""

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


async def fly(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        drone = await mavsdk.first_autopilot(timeout_s=30.0)
        if drone is None:
            raise SystemExit(f"no drone at {url} within 30 s")
        action, geofence, telemetry = ActionAsync(drone), GeofenceAsync(drone), TelemetryAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, "healthy")
        start = await until(telemetry.subscribe_position(), lambda position: True, "position known")

        circle = Circle(Point(start.latitude_deg, start.longitude_deg), RADIUS, FenceType.INCLUSION)
        await geofence.upload_geofence(GeofenceData([], [circle]))
        print(f"fence of {RADIUS:g} m uploaded", flush=True)
        try:
            await action.set_takeoff_altitude(HEIGHT)
            await action.arm()
            await action.takeoff()
            await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > HEIGHT - 0.5, "taken off")

            height = start.absolute_altitude_m + HEIGHT
            outside = start.latitude_deg + 2.0 * RADIUS / METRES_PER_DEGREE
            try:
                await action.goto_location(outside, start.longitude_deg, height, math.nan)
            except ActionError as error:
                print(f"target outside the fence: {error.result.name}", flush=True)
            else:
                raise SystemExit("the drone accepted a target outside the fence")

            inside = start.latitude_deg + 0.5 * RADIUS / METRES_PER_DEGREE
            await action.goto_location(inside, start.longitude_deg, height, math.nan)
            await until(
                telemetry.subscribe_position(),
                lambda p: abs(p.latitude_deg - inside) * METRES_PER_DEGREE < 1.0,
                "flown to a target inside",
            )
            await action.land()
            await until(telemetry.subscribe_armed(), lambda armed: not armed, "landed and disarmed")
        finally:
            await geofence.clear_geofence()
            print("fence cleared", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Upload a fence and try to leave it.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    asyncio.run(fly(parser.parse_args().url))


if __name__ == "__main__":
    main()
