"""MAVSDK's telemetry, info, shell and log_files plugins, unmodified: writes what each reports, a JSON line at a time.

python mavsdk_listen.py URL
"""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import statistics
import sys
import tempfile
from collections.abc import Awaitable, Callable
from enum import Enum
from pathlib import Path
from typing import Any

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.shell import ShellAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.shell import Device
from mavsdk_base import connected

SUBSCRIPTIONS = [
    "position",
    "home",
    "in_air",
    "landed_state",
    "armed",
    "attitude_quaternion",
    "attitude_euler",
    "velocity_ned",
    "gps_info",
    "raw_gps",
    "battery",
    "flight_mode",
    "health",
    "rc_status",
    "position_velocity_ned",
    "fixedwing_metrics",
    "health_all_ok",
    "unix_epoch_time",
    "distance_sensor",
    "heading",
    "altitude",
    "odometry",
]
RATES = [
    "position",
    "home",
    "in_air",
    "landed_state",
    "attitude_quaternion",
    "attitude_euler",
    "velocity_ned",
    "gps_info",
    "raw_gps",
    "battery",
    "rc_status",
    "position_velocity_ned",
    "fixedwing_metrics",
    "unix_epoch_time",
    "distance_sensor",
    "altitude",
    "health",
    "odometry",
    "actuator_output_status",
    "ground_truth",
    "imu",
    "scaled_imu",
    "raw_imu",
]


def plain(value: Any) -> Any:
    """A value of MAVSDK's as JSON has it; NaN is None."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, float):
        return None if math.isnan(value) else value
    if isinstance(value, str | int | bool) or value is None:
        return value
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return {name: plain(item) for name, item in vars(value).items()}


def say(kind: str, value: Any) -> None:
    sys.stdout.write(json.dumps({"kind": kind, "value": plain(value)}) + "\n")
    sys.stdout.flush()


async def result(work: Callable[[], Awaitable[Any]]) -> Any:
    try:
        return await work()
    except Exception as error:  # MAVSDK has an error class for each plugin
        return error.result.name if hasattr(error, "result") else repr(error)


async def first(telemetry: TelemetryAsync, name: str, accept: Callable[[Any], bool] = lambda value: True) -> Any:
    async for value in getattr(telemetry, f"subscribe_{name}")():
        if accept(value):
            return value
    return None


async def rate(telemetry: TelemetryAsync, name: str, count: int = 60) -> float:
    """Hz by the median of the gaps between so many samples' own times: the first ones are still events."""
    times: list[float] = []
    async for value in getattr(telemetry, f"subscribe_{name}")():
        times.append((value.time_usec if name == "odometry" else value.timestamp_us) / 1e6)
        if len(times) == count:
            break
    return 1.0 / statistics.median(b - a for a, b in itertools.pairwise(times))


async def download(logs: LogFilesAsync, entry: Any, path: str) -> None:
    async for _ in logs.download_log_file(entry, path):
        pass


async def flight_logs(logs: LogFilesAsync) -> Any:
    """Download the only log, then erase all: its date and size, the copy's bytes, and the list after it."""
    (entry,) = await logs.get_entries()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        await asyncio.wait_for(download(logs, entry, str(path)), 30.0)
        copy = path.read_bytes().decode()
    await logs.erase_all_log_files()
    return [entry.date, entry.size_bytes, copy, await result(logs.get_entries)]


async def main(url: str) -> None:
    async with connected(url) as drone:
        telemetry, info, action = TelemetryAsync(drone), InfoAsync(drone), ActionAsync(drone)
        await asyncio.wait_for(first(telemetry, "health_all_ok", lambda ok: ok), 30.0)
        for name in RATES:
            change = getattr(telemetry, f"set_rate_{name}")
            say(f"rate {name}", await result(lambda change=change: change(4.0)))
        for name in SUBSCRIPTIONS:
            say(name, await asyncio.wait_for(first(telemetry, name), 10.0))
        say("gps_global_origin", await result(telemetry.get_gps_global_origin))
        for name in ("identification", "product", "version"):
            say(name, await result(getattr(info, f"get_{name}")))
        say("log_files", await result(LogFilesAsync(drone).get_entries))
        shell = ShellAsync(drone)
        answers = shell.subscribe_receive()
        answer = asyncio.ensure_future(answers.__anext__())
        await asyncio.sleep(0.2)  # MAVSDK asks for an answer only once it has a receiver for it
        await shell.send("version", Device.SHELL)
        say("shell", (await asyncio.wait_for(answer, 5.0)).data)

        await action.set_takeoff_altitude(3.0)
        await action.arm()
        await action.takeoff()
        await asyncio.wait_for(first(telemetry, "in_air", lambda flies: flies), 20.0)
        await asyncio.wait_for(first(telemetry, "position", lambda p: p.relative_altitude_m > 2.5), 20.0)
        for name in ("landed_state", "armed", "distance_sensor", "position"):
            say(f"flying {name}", await asyncio.wait_for(first(telemetry, name), 10.0))
        for name in ("attitude_quaternion", "odometry"):
            await getattr(telemetry, f"set_rate_{name}")(30.0)
            say(f"hz {name}", await asyncio.wait_for(rate(telemetry, name), 30.0))
        flights = info.subscribe_flight_information()
        say("flight_information", await asyncio.wait_for(flights.__anext__(), 10.0))
        say("speed_factor", await result(info.get_speed_factor))
        await action.land()
        await asyncio.wait_for(first(telemetry, "armed", lambda armed: not armed), 30.0)
        say("flight logs", await flight_logs(LogFilesAsync(drone)))
        say("end", True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
