"""MAVSDK's plugins geofence and mission_raw as their users write them: fences and rally points up, down and away.

    mavsdk_plans.py URL LATITUDE LONGITUDE

It prints a line a step; the test that runs it holds them against what was sent and what another client reads.
"""

from __future__ import annotations

import asyncio
import sys
import time

from mavsdk.asyncio.plugins.geofence import (
    Circle,
    FenceType,
    GeofenceAsync,
    GeofenceData,
    GeofenceError,
    Point,
    Polygon,
)
from mavsdk.asyncio.plugins.mission_raw import MissionItem, MissionRawAsync, MissionRawError
from mavsdk_base import connected, fields, say

FENCE, RALLY = 1, 2


def shape(data: GeofenceData) -> str:
    polygons = [
        [polygon.fence_type.name, *[(round(p.latitude_deg, 7), round(p.longitude_deg, 7)) for p in polygon.points]]
        for polygon in data.polygons
    ]
    circles = [
        (c.fence_type.name, round(c.point.latitude_deg, 7), round(c.point.longitude_deg, 7), round(c.radius, 3))
        for c in data.circles
    ]
    return f"{polygons} {circles}"


async def fences(geofence: GeofenceAsync, latitude: float, longitude: float) -> None:
    corners = [(0.001, 0.001), (-0.001, 0.001), (-0.001, -0.001), (0.001, -0.001)]
    polygon = Polygon([Point(latitude + n, longitude + e) for n, e in corners], FenceType.INCLUSION)
    hole = Circle(Point(latitude + 0.0005, longitude), 12.5, FenceType.EXCLUSION)
    sent = GeofenceData([polygon], [hole])
    await geofence.upload_geofence(sent)
    say("fence sent", shape(sent))
    say("fence read", shape(await geofence.download_geofence()))
    try:
        await geofence.upload_geofence(
            GeofenceData([Polygon([Point(latitude, longitude)] * 3, FenceType.INCLUSION)], [])
        )
    except GeofenceError as error:
        say("fence refused", error.result.name)
    say("fence kept", shape(await geofence.download_geofence()))
    await geofence.clear_geofence()
    say("fence cleared", shape(await geofence.download_geofence()))


def rally_points(count: int, latitude: float, longitude: float) -> list[MissionItem]:
    return [
        MissionItem(
            seq, 6, 5100, int(seq == 0), 1, 0.0, 0.0, 0.0, 0.0,
            round((latitude + 1e-5 * seq) * 1e7), round(longitude * 1e7), 20.0, RALLY,
        )
        for seq in range(count)
    ]  # fmt: skip


async def raw(mission: MissionRawAsync, latitude: float, longitude: float) -> None:
    circles = [
        MissionItem(
            seq, 5, 5003, int(seq == 0), 1, 80.0 + seq, float(seq), 0.0, 0.0,
            round(latitude * 1e7), round(longitude * 1e7), 0.0, FENCE,
        )
        for seq in range(3)
    ]  # fmt: skip
    await mission.upload_geofence(circles)
    say("raw fence", [fields(one) for one in await mission.download_geofence()] == [fields(one) for one in circles])
    for count in (5, 1000):
        points = rally_points(count, latitude, longitude)
        began = time.monotonic()
        await mission.upload_rally_points(points)
        up = time.monotonic()
        read = await mission.download_rallypoints()
        down = time.monotonic()
        say("raw rally", count, [fields(one) for one in read] == [fields(one) for one in points])
        say("seconds", count, f"{up - began:.3f} {down - up:.3f}")
    try:
        await mission.upload_geofence([MissionItem(0, 5, 16, 1, 1, 0, 0, 0, 0, 1, 1, 0, FENCE)])
    except MissionRawError as error:
        say("raw refused", error.result.name)
    say("raw kept", len(await mission.download_geofence()))


async def main(url: str, latitude: float, longitude: float) -> None:
    async with connected(url) as drone:
        await fences(GeofenceAsync(drone), latitude, longitude)
        await raw(MissionRawAsync(drone), latitude, longitude)
        say("done")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
