"""Fly velocities and a position from a program: MAVSDK (4.x) and its plugin offboard.

anafi-mav                              # in one terminal
python examples/offboard.py            # in another
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

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
        action, offboard, telemetry = ActionAsync(drone), OffboardAsync(drone), TelemetryAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), lambda ok: ok, "healthy")

        await action.set_takeoff_altitude(HEIGHT)
        await action.arm()
        await action.takeoff()
        await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > HEIGHT - 0.5, "taken off")

        # Mode Offboard begins with a setpoint. MAVSDK repeats the newest one 20 times a second; when this program
        # ends or stalls, the drone hovers within half a second.
        await offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
        await offboard.start()
        print("offboard", flush=True)

        await offboard.set_velocity_ned(VelocityNedYaw(2.0, 0.0, 0.0, 0.0))  # north, east, down (m/s), heading (deg)
        await asyncio.sleep(3.0)
        now = await until(telemetry.subscribe_position_velocity_ned(), lambda p: True, "flown north at 2 m/s")
        print(f"north {now.position.north_m:.1f} m, {now.velocity.north_m_s:.1f} m/s", flush=True)

        await offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 45.0))  # turn on the spot, deg/s
        await asyncio.sleep(2.0)
        print("turned", flush=True)

        # A place in the frame of that telemetry (m north, east, down) and a heading (deg).
        await offboard.set_position_ned(PositionNedYaw(now.position.north_m, now.position.east_m + 5.0, -HEIGHT, 90.0))
        await until(
            telemetry.subscribe_position_velocity_ned(),
            lambda p: abs(p.position.east_m - now.position.east_m - 5.0) < 0.5,
            "flown to a place 5 m east",
        )

        await offboard.stop()
        print("hovering", flush=True)
        await action.land()
        await until(telemetry.subscribe_armed(), lambda armed: not armed, "landed and disarmed")


def main() -> None:
    parser = argparse.ArgumentParser(description="Fly by setpoints in mode Offboard.")
    parser.add_argument("url", nargs="?", default="udpin://0.0.0.0:14540", help="in MAVSDK's grammar (%(default)s)")
    asyncio.run(fly(parser.parse_args().url))


if __name__ == "__main__":
    main()
