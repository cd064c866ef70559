"""The simulator's gimbal as judge, and what gimbal clients send."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import units
from anafi_mav.arsdk.messages import gimbal
from support.mav import Client
from support.world import World

PITCHYAW, CONFIGURE = dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
LEVEL = dialect.GIMBAL_MANAGER_FLAGS_ROLL_LOCK | dialect.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
"""Flags of QGroundControl and MAVSDK."""
YAW_LOCK = dialect.GIMBAL_MANAGER_FLAGS_YAW_LOCK
VEHICLE_FRAME = dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME
EARTH_FRAME = dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME
NAN = math.nan
NO_ATTITUDE = [NAN] * 4


def truth(w: World) -> gimbal.Attitude:
    """Where the simulated gimbal looks now, deg."""
    firmware = w.drone.firmware
    firmware.gimbal.advance(firmware.time)
    return firmware.gimbal.attitude(firmware.pose)


async def next_truth(w: World, client: Client | None = None) -> gimbal.Attitude:
    """Where it looks when the vehicle reports its attitude next."""
    await (client or w.client).wait("GIMBAL_DEVICE_ATTITUDE_STATUS")
    return truth(w)


async def looks(w: World, **wanted: float) -> None:
    """Wait until the simulated gimbal looks within 0.5 deg of these angles, by the names of Parrot's attitude."""
    for _ in range(60):
        seen = await next_truth(w)
        if all(abs(getattr(seen, name) - angle) < 0.5 for name, angle in wanted.items()):
            return
    raise AssertionError(f"{truth(w)} is not {wanted}")


async def rate(w: World, name: str, steps: int = 5) -> float:
    """Measure how fast the simulated gimbal turns, deg/s by the drone's own clock."""
    first, began = await next_truth(w), w.drone.firmware.time
    for _ in range(steps):
        last = await next_truth(w)
    return float((getattr(last, name) - getattr(first, name)) / (w.drone.firmware.time - began))


def euler(status: Any) -> tuple[float, float, float]:
    """Roll, pitch and yaw (deg) of a GIMBAL_DEVICE_ATTITUDE_STATUS."""
    roll, pitch, yaw = units.euler_from_quaternion(*status.q)
    return roll * units.DEG_PER_RAD, pitch * units.DEG_PER_RAD, yaw * units.DEG_PER_RAD


def send_rates(client: Client, pitch: float, yaw: float = NAN, flags: int = LEVEL) -> None:
    """GIMBAL_MANAGER_SET_ATTITUDE with rates alone (deg/s), as QGroundControl, MAVSDK and MAVProxy send it."""
    rates = (NAN, pitch * units.RAD_PER_DEG, yaw * units.RAD_PER_DEG)
    client.send(dialect.MAVLink_gimbal_manager_set_attitude_message(1, 1, flags, 1, NO_ATTITUDE, *rates))


def beat(client: Client) -> None:
    """One heartbeat of a ground station."""
    client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3))


async def request(client: Client, message: int, name: str) -> Any:
    """Request one message by MAV_CMD_REQUEST_MESSAGE."""
    mark = client.mark()
    ack = await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, message)
    assert ack.result == dialect.MAV_RESULT_ACCEPTED
    return await client.wait(name, since=mark)
