"""MAVSDK's plugins mission and mission_raw as their users write them: a mission up, down, flown, held and gone on with.

    mavsdk_mission.py URL LATITUDE LONGITUDE FILE ...

The files are QGroundControl's, to be imported and uploaded as they are. It prints a line a step; the test that runs it
holds them against the simulator's own log and against what another client reads.
"""

from __future__ import annotations

import asyncio
import math
import sys
from pathlib import Path
from typing import Any

from mavsdk.asyncio import Autopilot
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync, MissionError, MissionItem, MissionPlan
from mavsdk.asyncio.plugins.mission_raw import MissionItem as RawItem
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync, MissionRawError
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync
from mavsdk_base import connected, say, until

Camera, Vehicle = MissionItem.CameraAction, MissionItem.VehicleAction


def plan(latitude: float, longitude: float) -> MissionPlan:
    """Up to 6 m; 20 m north, where it looks down, waits and takes a photo; 15 m east of that, filming on the way."""
    north, east = 20.0 / 111195.0, 15.0 / (111195.0 * math.cos(math.radians(latitude)))
    return MissionPlan(
        [
            MissionItem(latitude, longitude, 6.0, vehicle_action=Vehicle.TAKEOFF, acceptance_radius_m=1.0),
            MissionItem(
                latitude + north, longitude, 6.0, speed_m_s=3.0, gimbal_pitch_deg=-45.0, loiter_time_s=2.0,
                camera_action=Camera.TAKE_PHOTO, acceptance_radius_m=1.0,
            ),
            MissionItem(
                latitude + north, longitude, 8.0, speed_m_s=4.0, gimbal_pitch_deg=-10.0, yaw_deg=90.0,
                is_fly_through=True, camera_action=Camera.START_VIDEO, acceptance_radius_m=1.0,
            ),
            MissionItem(
                latitude + north, longitude + east, 8.0, is_fly_through=True, camera_action=Camera.STOP_VIDEO,
                acceptance_radius_m=1.0,
            ),
        ]
    )  # fmt: skip


def shape(item: MissionItem) -> list[object]:
    numbers = (
        item.relative_altitude_m, item.speed_m_s, item.gimbal_pitch_deg, item.loiter_time_s, item.acceptance_radius_m,
        item.yaw_deg,
    )  # fmt: skip
    return [
        round(item.latitude_deg, 6), round(item.longitude_deg, 6), *[str(round(number, 3)) for number in numbers],
        item.is_fly_through, item.camera_action.name, item.vehicle_action.name,
    ]  # fmt: skip


async def follow(mission: MissionAsync) -> None:
    async for progress in mission.subscribe_mission_progress():
        say("progress", progress.current, progress.total)


async def item(mission: MissionAsync, number: int) -> None:
    await until(mission.subscribe_mission_progress(), lambda progress: progress.current >= number)


async def mode(telemetry: TelemetryAsync, wanted: FlightMode) -> None:
    say("mode", (await until(telemetry.subscribe_flight_mode(), lambda mode: mode == wanted)).name)


async def fly(drone: Any, latitude: float, longitude: float) -> None:
    mission, telemetry, action = MissionAsync(drone), TelemetryAsync(drone), ActionAsync(drone)
    wanted = plan(latitude, longitude)
    await mission.set_return_to_launch_after_mission(True)
    await mission.upload_mission(wanted)
    read = await mission.download_mission()
    say("sent", [shape(item) for item in wanted.mission_items])
    say("read", [shape(item) for item in read.mission_items])
    following = asyncio.ensure_future(follow(mission))
    await action.arm()
    await mission.start_mission()
    await mode(telemetry, FlightMode.MISSION)
    await item(mission, 1)
    await mission.pause_mission()
    await mode(telemetry, FlightMode.HOLD)
    say("finished", await mission.is_mission_finished())
    await mission.start_mission()
    await mode(telemetry, FlightMode.MISSION)
    await item(mission, 4)
    say("finished", await mission.is_mission_finished())
    following.cancel()
    await mode(telemetry, FlightMode.RETURN_TO_LAUNCH)
    await action.land()
    await until(telemetry.subscribe_in_air(), lambda in_air: not in_air)
    say("landed")
    await mission.set_current_mission_item(2)
    say("current", (await mission.mission_progress()).current)
    try:
        await mission.set_current_mission_item(77)
    except MissionError as error:
        say("no item", error.result.name)
    await mission.clear_mission()
    try:
        say("left", len((await mission.download_mission()).mission_items))
    except MissionError as error:
        say("left", error.result.name)


def fields(item: RawItem, autopilot: Autopilot) -> list[str]:
    """All but `current`, which says where a vehicle is; a number that is not set is equal to itself.

    A heading that is not set comes back from an ArduPilot as 0.
    """
    heading = 0.0 if autopilot == Autopilot.ARDUPILOT and math.isnan(item.param4) else item.param4
    values = (
        item.seq, item.frame, item.command, item.autocontinue, item.param1, item.param2, item.param3, heading,
        item.x, item.y, item.z, item.mission_type,
    )  # fmt: skip
    return [str(value) for value in values]


async def raw(drone: Any, paths: list[str]) -> None:
    mission, autopilot = MissionRawAsync(drone), await drone.autopilot_type()
    for path in paths:
        name = Path(path).name
        try:
            items = (await mission.import_qgroundcontrol_mission(path)).mission_items
        except MissionRawError as error:
            say("import", name, error.result.name)
            continue
        await mission.upload_mission(items)
        read = await mission.download_mission()
        pairs = zip(items, read, strict=True)
        other = [str(one.seq) for one, two in pairs if fields(one, autopilot) != fields(two, autopilot)]
        say("import", name, len(items), f"differs:{','.join(other)}" if other else "equal")
    changed = asyncio.ensure_future(changes(mission))
    await asyncio.sleep(0)  # it has subscribed now, and is waiting
    say("yours")
    await changed
    say("changed to", len(await mission.download_mission()))
    try:
        home = RawItem(0, 0, 16, 1, 1, 0, 0, 0, 0, 0, 0, 35.0, 0)  # to an ArduPilot; to others a way point
        await mission.upload_mission([home, RawItem(1, 2, 183, 0, 1, 1, 1500, 0, 0, 0, 0, 0, 0)])
    except MissionRawError as error:
        say("refused", error.result.name)
    say("kept", len(await mission.download_mission()))


async def changes(mission: MissionRawAsync) -> None:
    async for _ in mission.subscribe_mission_changed():
        return


async def main(url: str, latitude: float, longitude: float, paths: list[str]) -> None:
    async with connected(url) as drone:
        if paths:
            await raw(drone, paths)
        else:
            await fly(drone, latitude, longitude)
        say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4:]))
