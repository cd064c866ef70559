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
    OffboardError,
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
"""s of a wait, and of one in which the host stalled: what is flown by then has to settle again."""


async def unbroken(seconds: float, flight: Callable[[], int | None]) -> None:
    """Wait until one flight has gone on for so long, with a machine that did not stand still meanwhile.

    `flight` numbers the flights; None while there is none.
    """
    clock = asyncio.get_running_loop().time
    begun, number = clock(), flight()
    while (step := clock()) - begun < seconds or number is None:
        await asyncio.sleep(STEP)
        if clock() - step > STANDSTILL or flight() is None or flight() != number:
            begun, number = clock(), flight()


SETTLED = 3
"""Targets on time, a second each, after which a drone that follows is in its place again."""


class Pilot:
    """Flies by setpoints, and begins again where the machine has held this program up for half a second.

    The drone hovers then, in mode Hold, and MAVSDK forgets the setpoint: at the first heartbeat with another mode
    than Offboard three seconds after the last start. One may come between a setpoint and the start that follows.
    """

    def __init__(self, plugin: OffboardAsync, telemetry: TelemetryAsync) -> None:
        self._plugin, self._telemetry = plugin, telemetry
        self._wanted: Callable[[], Awaitable[None]] | None = None
        self._turn = asyncio.Lock()
        """Of the program that sets or starts: what is started is what was set last."""
        self._there = False
        self._resumed = 0
        self._staying: asyncio.Future[None] | None = None

    async def fly(self, wanted: Callable[[], Awaitable[None]]) -> None:
        async with self._turn:
            self._wanted = wanted
            await wanted()

    async def begin(self) -> None:
        """Start, and stay in mode Offboard from then on."""
        await self._engage()
        self._there = True
        self._staying = asyncio.ensure_future(self._stay())

    async def held(self, name: str, seconds: float = 0.0) -> None:
        """As `held`, for so long without a break, of the flight or of the machine."""
        await unbroken(seconds, self._flight)
        await held(name)

    async def end(self) -> None:
        """Do not begin again any more; the drone flies on."""
        self._flight()
        async with self._turn:
            if self._staying is not None:
                self._staying.cancel()

    def _flight(self) -> int | None:
        if self._staying is not None and self._staying.done():
            self._staying.result()
        return self._resumed if self._there else None

    async def _engage(self) -> None:
        """Set what is wanted and start; both again where a heartbeat or a standstill came in between."""
        clock = asyncio.get_running_loop().time
        async with self._turn:
            while True:
                begun = clock()
                assert self._wanted is not None
                await self._wanted()
                try:
                    return await self._plugin.start()
                except OffboardError as error:
                    if error.result.name != "NO_SETPOINT_SET" and clock() - begun < STANDSTILL:
                        raise

    async def _stay(self) -> None:
        async for mode in self._telemetry.subscribe_flight_mode():
            gone, self._there = self._there and mode.name != "OFFBOARD", mode.name == "OFFBOARD"
            if gone:
                self._resumed += 1
                say("resumed", self._resumed)
            if not self._there:
                await self._engage()


async def offboard(system: Any) -> None:
    plugin, telemetry = OffboardAsync(system), TelemetryAsync(system)
    await tried("start without setpoints", plugin.start())
    pilot = Pilot(plugin, telemetry)
    await pilot.fly(partial(plugin.set_attitude_rate, AttitudeRate(0.0, 0.0, 20.0, 0.5)))
    await tried("start with rates", pilot.begin())
    await plugin.stop()
    await pilot.fly(partial(plugin.set_attitude, Attitude(0.0, -6.0, 0.0, 0.6)))
    await tried("start", pilot.begin())
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
    await pilot.end()
    await plugin.stop()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")
    say("stopped", await plugin.is_active())


async def manual(system: Any) -> None:
    plugin, telemetry = ManualControlAsync(system), TelemetryAsync(system)
    sticks = [0.0, 0.0, 0.5, 0.0]
    there, enough = asyncio.Event(), asyncio.Event()

    async def joystick() -> None:
        while not enough.is_set():
            await plugin.set_manual_control_input(*sticks)
            there.set()
            await asyncio.sleep(0.05)

    stream = asyncio.ensure_future(joystick())

    def flight() -> int:
        if stream.done():
            stream.result()
        return 0

    await there.wait()  # the sticks have to be there before they may fly
    await plugin.start_position_control()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "POSCTL")
    for name, position in (
        ("forward", (0.6, 0.0, 0.5, 0.0)),
        ("right", (0.0, 0.6, 0.5, 0.0)),
        ("up", (0.0, 0.0, 0.9, 0.0)),
        ("clockwise", (0.0, 0.0, 0.5, 0.5)),
    ):
        sticks[:] = position
        await unbroken(2.0, flight)
        await held(name)
    enough.set()
    await stream
    await held("still")


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
    clock = asyncio.get_running_loop().time
    north, on_time, observed = 10.0, 0, 0
    while observed < 9 or on_time < SETTLED:
        begun = clock()
        await plugin.set_target_location(TargetLocation(HOME[0] + north * M, HOME[1], HOME[2], 1.5, 0.0, 0.0))
        await asyncio.sleep(1.0)
        north += 1.5
        # Where the machine stood still the drone went on, and the target of this program did not.
        on_time = on_time + 1 if clock() - begun < 1.0 + STANDSTILL else 0
        if observed or (north > 20.0 and on_time >= SETTLED):
            observed += 1
            say("target" if on_time >= SETTLED else "late target", north)
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
