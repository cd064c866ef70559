"""MAVSDK's plugins offboard, manual_control and follow_me as their users write them.

    mavsdk_offboard.py offboard|manual|follow URL

It prints a line a step, and goes on with the step until the test has looked where the drone truly is.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.follow_me import Config, FollowMeAsync, TargetLocation
from mavsdk.asyncio.plugins.manual_control import ManualControlAsync
from mavsdk.asyncio.plugins.offboard import (
    AccelerationNed,
    Attitude,
    AttitudeRate,
    OffboardAsync,
    PositionGlobalYaw,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync
from mavsdk_base import connected, held, say, tried, until

HOME = (48.8789, 2.3677, 35.0)
M = 1.0 / 111_226.0
"""Degrees of latitude a metre, here."""


STEP, STANDSTILL = 0.1, 0.3
"""s of a wait, and of one in which the machine stood still: what is flown by then has to settle anew."""


class Pilot:
    """Flies by setpoints, and begins again where the machine has held this program up for half a second.

    The drone hovers then, in mode Hold, and MAVSDK forgets the setpoint.
    """

    def __init__(self, plugin: OffboardAsync, telemetry: TelemetryAsync) -> None:
        self._plugin, self._telemetry = plugin, telemetry
        self._wanted: Callable[[], Awaitable[None]] | None = None
        self._resumed = 0

    async def fly(self, wanted: Callable[[], Awaitable[None]]) -> None:
        self._wanted = wanted
        await wanted()

    async def held(self, name: str, seconds: float = 0.0) -> None:
        """As `held`, for so long without a break, of the flight or of the machine."""
        clock = asyncio.get_running_loop().time
        begun, resumed = clock(), self._resumed
        while (step := clock()) - begun < seconds:
            await asyncio.sleep(STEP)
            if clock() - step > STANDSTILL or self._resumed != resumed:
                begun, resumed = clock(), self._resumed
        await held(name)

    async def stay(self) -> None:
        there = False
        async for mode in self._telemetry.subscribe_flight_mode():
            gone, there = there and mode.name != "OFFBOARD", mode.name == "OFFBOARD"
            if gone and self._wanted is not None:
                self._resumed += 1
                say("resumed", self._resumed)
                await self._wanted()
                await self._plugin.start()


async def offboard(system: Any) -> None:
    plugin, telemetry = OffboardAsync(system), TelemetryAsync(system)
    await tried("start without setpoints", plugin.start())
    await plugin.set_attitude_rate(AttitudeRate(0.0, 0.0, 20.0, 0.5))
    await tried("start with rates", plugin.start())
    await plugin.stop()
    pilot = Pilot(plugin, telemetry)
    await pilot.fly(partial(plugin.set_attitude, Attitude(0.0, -6.0, 0.0, 0.6)))
    await tried("start", plugin.start())
    staying = asyncio.ensure_future(pilot.stay())
    await pilot.held("attitude", 2.5)
    await pilot.fly(partial(plugin.set_velocity_ned, VelocityNedYaw(0.0, 2.0, 0.5, 90.0)))
    await pilot.held("velocity ned", 5.0)
    await pilot.fly(partial(plugin.set_velocity_body, VelocityBodyYawspeed(2.0, 0.0, -0.5, 0.0)))
    await pilot.held("velocity body", 4.0)
    await pilot.fly(partial(plugin.set_position_ned, PositionNedYaw(8.0, -6.0, -12.0, 0.0)))
    await until(
        telemetry.subscribe_position_velocity_ned(),
        lambda p: abs(p.position.north_m - 8.0) < 0.5 and abs(p.position.east_m + 6.0) < 0.5,
    )
    await pilot.held("position ned", 1.5)
    for name, altitude, kind in (("relative", 9.0, 0), ("amsl", HOME[2] + 11.0, 1)):
        place = PositionGlobalYaw(HOME[0] + 20.0 * M, HOME[1], altitude, 0.0, PositionGlobalYaw.AltitudeType(kind))
        await pilot.fly(partial(plugin.set_position_global, place))
        await until(telemetry.subscribe_position(), lambda p: abs(p.latitude_deg - HOME[0] - 20.0 * M) < 5e-6)
        await pilot.held(f"position global {name}", 2.5)
    await pilot.fly(
        partial(
            plugin.set_position_velocity_ned, PositionNedYaw(30.0, 0.0, -11.0, 0.0), VelocityNedYaw(0.0, 0.0, 0.0, 0.0)
        )
    )
    # At rest: an acceleration is flown on from the speed that there is.
    await until(
        telemetry.subscribe_position_velocity_ned(),
        lambda p: abs(p.position.north_m - 30.0) < 0.5 and abs(p.velocity.north_m_s) < 0.15,
    )
    await pilot.held("position and velocity")
    await pilot.fly(partial(plugin.set_acceleration_ned, AccelerationNed(0.0, 1.0, 0.0)))
    await pilot.held("acceleration", 2.0)
    staying.cancel()
    await plugin.stop()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")
    say("stopped", await plugin.is_active())


async def manual(system: Any) -> None:
    plugin, telemetry = ManualControlAsync(system), TelemetryAsync(system)
    sticks = [0.0, 0.0, 0.5, 0.0]

    async def joystick() -> None:
        while True:
            await plugin.set_manual_control_input(*sticks)
            await asyncio.sleep(0.05)

    stream = asyncio.ensure_future(joystick())
    await asyncio.sleep(0.3)  # the sticks have to be there before they may fly
    await plugin.start_position_control()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "POSCTL")
    for name, position in (
        ("forward", (0.6, 0.0, 0.5, 0.0)),
        ("right", (0.0, 0.6, 0.5, 0.0)),
        ("up", (0.0, 0.0, 0.9, 0.0)),
        ("clockwise", (0.0, 0.0, 0.5, 0.5)),
    ):
        sticks[:] = position
        await held(name, 2.0)
    stream.cancel()
    await held("still", 1.0)


async def follow(system: Any) -> None:
    plugin, telemetry = FollowMeAsync(system), TelemetryAsync(system)
    config = await plugin.get_config()
    say("config", config.follow_height_m, config.follow_distance_m, config.follow_angle_deg)
    await plugin.set_config(
        Config(
            follow_height_m=10.0,
            follow_distance_m=6.0,
            responsiveness=0.1,
            altitude_mode=Config.FollowAltitudeMode.CONSTANT,
            max_tangential_vel_m_s=6.0,
            follow_angle_deg=180.0,
        )
    )
    await tried("start", plugin.start())
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "FOLLOW_ME")
    say("following", await plugin.is_active())
    for second in range(15):
        north = 10.0 + 1.5 * second
        await plugin.set_target_location(TargetLocation(HOME[0] + north * M, HOME[1], HOME[2], 1.5, 0.0, 0.0))
        say("target", north)
        await asyncio.sleep(1.0)
    say("target", 10.0 + 1.5 * 15)
    await held("following")
    await plugin.stop()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")
    say("stopped")


async def main(what: str, url: str) -> None:
    async with connected(url) as drone:
        action, telemetry = ActionAsync(drone), TelemetryAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), bool)
        await action.set_takeoff_altitude(8.0)
        await action.arm()
        await action.takeoff()
        await until(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")
        say("up")
        await {"offboard": offboard, "manual": manual, "follow": follow}[what](drone)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2]))
