"""Flights of MAVSDK's example programs, the same calls in the same order: python mavsdk_examples.py URL PACE NAME ...

Each begins on the ground and arms by itself; five of them engage Offboard there. The examples' waits are `PACE` times
shorter. Where an example leaves the drone in the air, it is landed afterwards. A line before and after each.
"""

from __future__ import annotations

import asyncio
import math
import sys
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from mavsdk.asyncio.plugins.action import ActionAsync, OrbitYawBehavior
from mavsdk.asyncio.plugins.mission import MissionAsync, MissionItem, MissionPlan
from mavsdk.asyncio.plugins.offboard import (
    Attitude,
    OffboardAsync,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk_base import connected, say, until

M = 1.0 / 111_226.0
"""Degrees of latitude a metre, here."""


@dataclass
class Drone:
    """The plugins that the examples use."""

    action: ActionAsync
    offboard: OffboardAsync
    mission: MissionAsync
    telemetry: TelemetryAsync
    pace: float
    home: tuple[float, float, float]

    async def pause(self, seconds: float) -> None:
        await asyncio.sleep(seconds / self.pace)

    async def in_air(self, wanted: bool) -> None:
        await until(self.telemetry.subscribe_in_air(), lambda in_air: in_air is wanted)

    async def down(self) -> None:
        """On the ground, and disarmed."""
        await until(self.telemetry.subscribe_armed(), lambda armed: not armed)


async def goto(drone: Drone) -> None:
    """The target comes one second after the take-off was accepted."""
    await drone.action.arm()
    await drone.action.takeoff()
    await asyncio.sleep(1.0)
    latitude, longitude, amsl = drone.home
    await drone.action.goto_location(latitude, longitude + 20.0 * M, amsl + 20.0, 0.0)
    await until(drone.telemetry.subscribe_position(), lambda p: p.relative_altitude_m > 18.5)
    await drone.action.land()


Setting = Callable[[], Awaitable[None]]


async def from_the_ground(drone: Drone, idle: Setting, steps: Sequence[tuple[Setting, float]]) -> None:
    """Arm, set something that stands still, start, and then climb with the first step."""
    await drone.action.arm()
    await idle()
    await drone.offboard.start()
    for number, (step, seconds) in enumerate(steps):
        await step()
        if number == 0:  # its time in the example, in which the second before the take-off does not go faster
            await asyncio.sleep(max(seconds / drone.pace, 2.0))
            await drone.in_air(True)
        else:
            await drone.pause(seconds)
    await drone.offboard.stop()


async def offboard_attitude(drone: Drone) -> None:
    def lean(roll: float, thrust: float) -> Setting:
        return lambda: drone.offboard.set_attitude(Attitude(roll, 0.0, 0.0, thrust))

    steps = [(lean(0.0, 0.7), 2.0), (lean(30.0, 0.6), 2.0), (lean(-30.0, 0.6), 2.0), (lean(0.0, 0.6), 2.0)]
    await from_the_ground(drone, lean(0.0, 0.0), steps)
    await drone.action.land()


async def offboard_position_ned(drone: Drone) -> None:
    def place(north: float, east: float, down: float, yaw: float) -> Setting:
        return lambda: drone.offboard.set_position_ned(PositionNedYaw(north, east, down, yaw))

    ways = [(0.0, 0.0, -5.0, 0.0), (5.0, 0.0, -5.0, 90.0), (5.0, 10.0, -5.0, 90.0), (0.0, 10.0, 0.0, 180.0)]
    await from_the_ground(drone, place(0.0, 0.0, 0.0, 0.0), [(place(*way), 10.0) for way in ways])


async def offboard_velocity_body(drone: Drone) -> None:
    def go(forward: float, right: float, down: float, turn: float) -> Setting:
        return lambda: drone.offboard.set_velocity_body(VelocityBodyYawspeed(forward, right, down, turn))

    still = (0.0, 0.0, 0.0, 0.0)
    ways = [((0.0, 0.0, -1.0, 60.0), 5.0), ((0.0, 0.0, 0.0, -60.0), 5.0), (still, 2.0)]
    ways += [((5.0, 0.0, 0.0, 30.0), 15.0), (still, 5.0), ((0.0, -5.0, 0.0, 30.0), 15.0), (still, 8.0)]
    await from_the_ground(drone, go(*still), [(go(*way), seconds) for way, seconds in ways])


async def offboard_velocity_ned(drone: Drone) -> None:
    def go(north: float, east: float, down: float, yaw: float) -> Setting:
        return lambda: drone.offboard.set_velocity_ned(VelocityNedYaw(north, east, down, yaw))

    ways = [((0.0, 0.0, -2.0, 0.0), 4.0), ((2.0, 0.0, 0.0, 90.0), 4.0), ((-2.0, 0.0, 0.0, 270.0), 4.0)]
    ways += [((0.0, -2.0, 0.0, 90.0), 4.0), ((0.0, 2.0, 0.0, 90.0), 4.0), ((0.0, 0.0, 1.0, 0.0), 4.0)]
    await from_the_ground(drone, go(0.0, 0.0, 0.0, 0.0), [(go(*way), seconds) for way, seconds in ways])


async def offboard_position_velocity_ned(drone: Drone) -> None:
    """So flies the trajectory of offboard_from_csv, ten points a second, which then lands and waits for the ground."""

    def go(place: tuple[float, float, float], speed: tuple[float, float, float]) -> Setting:
        return lambda: drone.offboard.set_position_velocity_ned(
            PositionNedYaw(*place, 0.0), VelocityNedYaw(*speed, 0.0)
        )

    await from_the_ground(
        drone,
        lambda: drone.offboard.set_position_ned(PositionNedYaw(0.0, 0.0, 0.0, 0.0)),
        [(go((0.0, 0.0, -10.0), (0.0, 0.0, -1.0)), 10.0), (go((15.0, 0.0, -10.0), (1.0, 0.0, 0.0)), 20.0)],
    )
    await drone.action.land()
    await drone.in_air(False)


async def do_orbit(drone: Drone) -> None:
    """It returns at its end, which is a landing."""
    await drone.action.arm()
    await drone.action.takeoff()
    await drone.pause(10.0)
    latitude, longitude, amsl = drone.home
    facing = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    await drone.action.do_orbit(10.0, 2.0, facing, latitude, longitude, amsl + 10.0)
    await drone.pause(20.0)
    await drone.action.return_to_launch()
    await drone.in_air(False)


async def mission(drone: Drone) -> None:
    """It ends when the drone is no longer in the air: behind the return that ends its mission."""
    nan = math.nan
    ways = [(10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    items = [
        MissionItem(
            drone.home[0] + north * M,
            drone.home[1] + east * M,
            10.0,
            5.0,
            True,
            nan,
            nan,
            MissionItem.CameraAction.NONE,
            nan,
            nan,
            nan,
            nan,
            nan,
            MissionItem.VehicleAction.NONE,
        )
        for north, east in ways
    ]
    await drone.mission.set_return_to_launch_after_mission(True)
    await drone.mission.upload_mission(MissionPlan(items))
    await drone.action.arm()
    await drone.mission.start_mission()
    await drone.in_air(True)
    await drone.in_air(False)


EXAMPLES = (
    goto,
    offboard_attitude,
    offboard_position_ned,
    offboard_velocity_body,
    offboard_velocity_ned,
    offboard_position_velocity_ned,
    do_orbit,
    mission,
)


async def main(url: str, pace: float, names: Sequence[str]) -> None:
    async with connected(url) as system:
        telemetry = TelemetryAsync(system)
        await until(telemetry.subscribe_health(), lambda h: h.is_global_position_ok and h.is_home_position_ok)
        home = await until(telemetry.subscribe_home())
        drone = Drone(
            ActionAsync(system),
            OffboardAsync(system),
            MissionAsync(system),
            telemetry,
            pace,
            (home.latitude_deg, home.longitude_deg, home.absolute_altitude_m),
        )
        for example in (example for example in EXAMPLES if example.__name__ in names):
            say("begin", example.__name__)
            await example(drone)
            say("end", example.__name__)
            if await until(telemetry.subscribe_in_air()):
                await drone.action.land()
            await drone.down()
            say("down", example.__name__)


asyncio.run(main(sys.argv[1], float(sys.argv[2]), sys.argv[3:]))
