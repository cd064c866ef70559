"""Upload a mission, fly it and follow its progress: MAVSDK (4.x) and its plugin mission.

anafi-mav                             # in one terminal
python examples/mission.py            # in another
"""

from __future__ import annotations

import argparse
import asyncio
import math
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync, MissionItem, MissionPlan
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

METRES_PER_DEGREE = 111_195.0
"""m of latitude on a sphere of 6371 km; good to 0.5 % anywhere."""

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


def plan(latitude: float, longitude: float) -> MissionPlan:
    """Make a triangle: up to 5 m, 15 m north, 10 m east of that, back to the start, land. Heights are above home."""
    north = latitude + 15.0 / METRES_PER_DEGREE
    east = longitude + 10.0 / (METRES_PER_DEGREE * math.cos(math.radians(latitude)))

    def item(latitude: float, longitude: float, action: MissionItem.VehicleAction) -> MissionItem:
        return MissionItem(
            latitude_deg=latitude,
            longitude_deg=longitude,
            relative_altitude_m=5.0,
            speed_m_s=5.0,
            is_fly_through=True,
            acceptance_radius_m=1.0,
            vehicle_action=action,
        )

    action = MissionItem.VehicleAction
    return MissionPlan(
        [
            item(latitude, longitude, action.TAKEOFF),
            item(north, longitude, action.NONE),
            item(north, east, action.NONE),
            item(latitude, longitude, action.NONE),
            item(latitude, longitude, action.LAND),
        ]
    )


async def fly(url: str) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(url)
        drone = await mavsdk.first_autopilot(timeout_s=30.0)
        if drone is None:
            raise SystemExit(f"no drone at {url} within 30 s")
        action, mission, telemetry = ActionAsync(drone), MissionAsync(drone), TelemetryAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, "healthy")
        start = await until(telemetry.subscribe_position(), lambda position: True, "position known")

        await mission.upload_mission(plan(start.latitude_deg, start.longitude_deg))
        print(f"uploaded: {len((await mission.download_mission()).mission_items)} items", flush=True)
        await action.arm()
        await mission.start_mission()
        print("started", flush=True)

        async def report() -> None:
            async for progress in mission.subscribe_mission_progress():
                print(f"item {progress.current} of {progress.total}", flush=True)

        reporting = asyncio.ensure_future(report())
        await until(telemetry.subscribe_in_air(), lambda flying: flying, "in the air")
        await until(telemetry.subscribe_armed(), lambda armed: not armed, "landed and disarmed")
        reporting.cancel()


def main() -> None:
    parser = argparse.ArgumentParser(description="Upload a mission and fly it.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    asyncio.run(fly(parser.parse_args().url))


if __name__ == "__main__":
    main()
