"""MAVSDK's plugins action and calibration as their users write them.

    mavsdk_action.py URL

It prints a line a step; the test that runs it holds them against the simulator's own log.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync, OrbitYawBehavior
from mavsdk.asyncio.plugins.calibration import CalibrationAsync, CalibrationError
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync
from mavsdk_base import connected, say, tried, until

HOME = (48.8789, 2.3677, 35.0)


async def calibrated(name: str, steps: AsyncIterator[Any]) -> None:
    """A calibration with its progress."""
    progress, texts = [], []
    try:
        async for result, step in steps:
            if step.has_progress and step.progress == step.progress:  # unknown is not a number
                progress.append(round(100 * step.progress))
            if step.has_status_text:
                texts.append(step.status_text)
            last = result
        say("calibrated", name, last.name, progress[-1:] or "-", len(texts))
    except CalibrationError as error:
        say("calibrated", name, error.result.name)


async def main(url: str) -> None:
    async with connected(url) as drone:
        action, telemetry, calibration = ActionAsync(drone), TelemetryAsync(drone), CalibrationAsync(drone)
        await until(telemetry.subscribe_health_all_ok(), bool)
        await calibrated("magnetometer", calibration.calibrate_magnetometer())
        await calibrated("horizon", calibration.calibrate_level_horizon())
        await calibrated("gyro", calibration.calibrate_gyro())

        await action.set_takeoff_altitude(6.0)
        await action.set_return_to_launch_altitude(25.0)
        say("altitudes", await action.get_takeoff_altitude(), await action.get_return_to_launch_altitude())
        await action.arm()
        await action.disarm()
        await action.arm()
        await action.takeoff()
        await until(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)
        await until(telemetry.subscribe_position(), lambda position: position.relative_altitude_m > 5.7)
        say("up")
        await tried("disarm", action.disarm())
        await tried("kill", action.kill())
        await tried("terminate", action.terminate())
        await tried("reboot", action.reboot())
        await tried("set_actuator", action.set_actuator(1, 0.5))
        await action.set_current_speed(5.0)
        await action.goto_location(HOME[0] + 0.0003, HOME[1], HOME[2] + 9.0, float("nan"))
        await until(
            telemetry.subscribe_position(),
            lambda position: (
                abs(position.latitude_deg - HOME[0] - 0.0003) < 1e-5 and abs(position.relative_altitude_m - 9.0) < 0.5
            ),
        )
        say("there")
        facing = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
        await action.do_orbit(10.0, 2.0, facing, HOME[0] + 0.0003, HOME[1], HOME[2] + 9.0)
        say("orbiting")
        await action.hold()
        await action.set_home(False, HOME[0] + 0.0001, HOME[1], HOME[2])
        say("home set")
        await action.return_to_launch()
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "RETURN_TO_LAUNCH")
        say("returning")
        await action.land()
        await until(telemetry.subscribe_armed(), lambda armed: not armed)
        say("landed")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
