"""Let the drone follow a target that walks north: MAVSDK (4.x) and its plugin follow_me.

anafi-mav                            # in one terminal
python examples/follow.py            # in another
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.follow_me import Config, FollowMeAsync, TargetLocation
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync

METRES_PER_DEGREE = 111_195.0
"""m of latitude on a sphere of 6371 km; good to 0.5 % anywhere."""

HEIGHT = 8.0
"""m above the take-off point, of the drone that follows."""
SPEED, SECONDS = 1.5, 12
"""m/s at which the target walks, and for how long."""

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
        action, follow, telemetry = ActionAsync(drone), FollowMeAsync(drone), TelemetryAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, "healthy")
        start = await until(telemetry.subscribe_position(), lambda position: True, "position known")

        await action.set_takeoff_altitude(HEIGHT)
        await action.arm()
        await action.takeoff()
        await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > HEIGHT - 1.0, "taken off")

        await follow.set_config(
            Config(
                follow_height_m=HEIGHT,
                follow_distance_m=5.0,
                responsiveness=0.1,
                altitude_mode=Config.FollowAltitudeMode.CONSTANT,
                max_tangential_vel_m_s=5.0,
                follow_angle_deg=180.0,  # behind the target
            )
        )
        await follow.start()
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.FOLLOW_ME, "following")

        # The target begins 8 m north of the start and walks on; a program would take these from a GPS receiver.
        north = 8.0
        for _ in range(SECONDS):
            latitude = start.latitude_deg + north / METRES_PER_DEGREE
            target = TargetLocation(latitude, start.longitude_deg, start.absolute_altitude_m, SPEED, 0.0, 0.0)
            await follow.set_target_location(target)
            await asyncio.sleep(1.0)
            north += SPEED
        place = await until(telemetry.subscribe_position(), lambda position: True, f"target at {north:g} m north")
        behind = north - (place.latitude_deg - start.latitude_deg) * METRES_PER_DEGREE
        print(f"drone {behind:.1f} m behind it", flush=True)

        await follow.stop()
        await action.land()
        await until(telemetry.subscribe_armed(), lambda armed: not armed, "landed and disarmed")


def main() -> None:
    parser = argparse.ArgumentParser(description="Follow a target.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    asyncio.run(fly(parser.parse_args().url))


if __name__ == "__main__":
    main()
