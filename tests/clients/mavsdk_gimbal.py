"""MAVSDK's plugin gimbal as its users write it.

    mavsdk_gimbal.py URL

It prints a line a step; the test that runs it judges them by the simulated gimbal.
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.gimbal import ControlMode, GimbalAsync, GimbalMode, SendMode
from mavsdk.asyncio.plugins.telemetry import LandedState, TelemetryAsync
from mavsdk_base import connected, held, say, until

FOLLOW, LOCK = GimbalMode.YAW_FOLLOW, GimbalMode.YAW_LOCK
ONCE, STREAM = SendMode.ONCE, SendMode.STREAM
PLACE = (48.8789, 2.3677 + 20.0 / 73200.0, 35.0)
"""20 m east of the place of take-off, at its height above sea level."""


async def main(url: str) -> None:
    async with connected(url) as drone:
        gimbal, action, telemetry = GimbalAsync(drone), ActionAsync(drone), TelemetryAsync(drone)
        (found,) = (await until(gimbal.subscribe_gimbal_list(), lambda seen: bool(seen.gimbals))).gimbals
        id = found.gimbal_id
        say("gimbal", id, found.vendor_name, found.model_name)
        await gimbal.take_control(id, ControlMode.PRIMARY)
        await until(gimbal.subscribe_control_status(), lambda status: status.control_mode == ControlMode.PRIMARY)
        say("primary")

        async def looks(pitch: float, yaw: float, *, north: bool = False) -> None:
            def arrived(attitude: Any) -> bool:
                angles = attitude.euler_angle_north if north else attitude.euler_angle_forward
                return abs(angles.pitch_deg - pitch) < 1.0 and abs(angles.yaw_deg - yaw) < 1.0

            await until(gimbal.subscribe_attitude(), arrived)

        await gimbal.set_angles(id, 0.0, -30.0, 20.0, FOLLOW, ONCE)
        await looks(-30.0, 20.0)
        await held("angles")
        await gimbal.set_angles(id, 5.0, 40.0, -15.0, FOLLOW, STREAM)
        await looks(40.0, -15.0)
        await held("streamed")
        await gimbal.set_angles(id, 0.0, -90.0, 30.0, FOLLOW, STREAM)
        await until(gimbal.subscribe_attitude(), lambda seen: seen.euler_angle_forward.pitch_deg < -89.0)
        await held("down")
        await gimbal.set_angles(id, 0.0, 0.0, 40.0, LOCK, ONCE)
        await looks(0.0, 40.0, north=True)
        await held("locked")

        await gimbal.set_angular_rates(id, 0.0, -10.0, -5.0, FOLLOW, ONCE)
        await held("rates")
        await gimbal.set_angular_rates(id, 0.0, 0.0, 0.0, FOLLOW, ONCE)
        say("stopped")

        async def stream() -> None:
            while True:
                await gimbal.set_angular_rates(id, 0.0, 8.0, 0.0, FOLLOW, STREAM)
                await asyncio.sleep(0.2)

        streaming = asyncio.create_task(stream())
        await held("streaming")
        streaming.cancel()

        await action.arm()
        await action.takeoff()
        await until(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)
        await until(telemetry.subscribe_position(), lambda position: position.relative_altitude_m > 2.2)
        await gimbal.set_roi_location(id, *PLACE)
        await held("region")
        await gimbal.set_angles(id, 0.0, 10.0, 0.0, FOLLOW, ONCE)
        await gimbal.release_control(id)
        await until(gimbal.subscribe_control_status(), lambda status: status.control_mode == ControlMode.NONE)
        say("released")


asyncio.run(main(sys.argv[1]))
