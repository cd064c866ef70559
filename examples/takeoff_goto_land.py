"""Take off, fly 30 m away, land: a whole flight with nothing but MAVSDK (4.x).

    anafi-mav                                       # in one terminal
    python examples/takeoff_goto_land.py            # in another

`python examples/takeoff_goto_land.py --help` lists what can be changed.
"""

from __future__ import annotations

import argparse
import asyncio
import math
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

METRES_PER_DEGREE = 111_195.0
"""m of latitude on a sphere of 6371 km; good to 0.5 % anywhere."""

CLOSE = 1.0
"""m from the target at which we have arrived."""

T = TypeVar("T")


async def until(updates: AsyncIterator[T], accept: Callable[[T], bool], what: str, timeout: float = 60.0) -> T:
    """The first update that `accept` likes; says `what` when it came, raises TimeoutError when it did not."""

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


async def fly(url: str, distance: float, bearing: float, height: float) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        drone = await mavsdk.first_autopilot(timeout_s=30.0)
        if drone is None:
            raise SystemExit(f"no drone at {url} within 30 s")
        action, telemetry = ActionAsync(drone), TelemetryAsync(drone)

        # MAVSDK's sum of: calibrated, position known, home known, may be armed.
        await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, "healthy")
        start = await until(telemetry.subscribe_position(), lambda position: True, "position known")

        await action.set_takeoff_altitude(height)
        await action.arm()
        print("armed", flush=True)
        await action.takeoff()
        await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > height - CLOSE, "taken off")

        # The target: degrees for the map, metres above sea level for the height. NaN keeps the heading as it is.
        metres_per_degree_east = METRES_PER_DEGREE * math.cos(math.radians(start.latitude_deg))
        latitude = start.latitude_deg + distance * math.cos(math.radians(bearing)) / METRES_PER_DEGREE
        longitude = start.longitude_deg + distance * math.sin(math.radians(bearing)) / metres_per_degree_east
        await action.goto_location(latitude, longitude, start.absolute_altitude_m + height, math.nan)

        def metres_left(latitude_deg: float, longitude_deg: float, relative_altitude_m: float) -> float:
            north = (latitude - latitude_deg) * METRES_PER_DEGREE
            east = (longitude - longitude_deg) * metres_per_degree_east
            return math.hypot(north, east, height - relative_altitude_m)

        there = await until(
            telemetry.subscribe_position(),
            lambda p: metres_left(p.latitude_deg, p.longitude_deg, p.relative_altitude_m) < CLOSE,
            f"flown {distance:g} m",
        )
        left = metres_left(there.latitude_deg, there.longitude_deg, there.relative_altitude_m)
        print(f"{left:.2f} m from the target", flush=True)

        await action.land()
        await until(telemetry.subscribe_armed(), lambda armed: not armed, "landed and disarmed")


def main() -> None:
    parser = argparse.ArgumentParser(description="Take off, fly to a place, land.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    parser.add_argument("--distance", type=float, default=30.0, metavar="M", help="metres to fly (%(default)s)")
    parser.add_argument("--bearing", type=float, default=0.0, metavar="DEG", help="0 north, 90 east (%(default)s)")
    parser.add_argument(
        "--height", type=float, default=10.0, metavar="M", help="above the take-off point (%(default)s)"
    )
    arguments = parser.parse_args()
    asyncio.run(fly(arguments.url, arguments.distance, arguments.bearing, arguments.height))


if __name__ == "__main__":
    main()
