"""Programs that fly by setpoints, in the ways of both families of clients."""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.sim.world.motion import Pose
from anafi_mav.texts import OFFBOARD_STOPPED_HOVER
from support.mav import Client
from support.product import Process
from support.world import HOLD, HOME, OFFBOARD, World

COPTER_BRAKE, COPTER_GUIDED = 17, 4

NO_POSITION, NO_VELOCITY, NO_ACCELERATION = 0x007, 0x038, 0x1C0
NO_YAW, NO_YAW_RATE = 0x400, 0x800

POSITION_ONLY = NO_VELOCITY | NO_ACCELERATION | NO_YAW | NO_YAW_RATE
VELOCITY_ONLY = NO_POSITION | NO_ACCELERATION | NO_YAW | NO_YAW_RATE

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

EVERY = 0.05
"""s between two setpoints of a program."""


def local(
    mask: int,
    frame: int = 1,
    *,
    at: Vector = ZERO,
    v: Vector = ZERO,
    a: Vector = ZERO,
    yaw: float = 0.0,
    yaw_rate: float = 0.0,
) -> Any:
    """SET_POSITION_TARGET_LOCAL_NED."""
    return dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *at, *v, *a, yaw, yaw_rate)


def earth(
    mask: int,
    frame: int,
    north: float = 0.0,
    east: float = 0.0,
    height: float = 0.0,
    *,
    place: tuple[float, float] | None = None,
    v: Vector = ZERO,
    yaw: float = 0.0,
) -> Any:
    """SET_POSITION_TARGET_GLOBAL_INT, m from where the drone took off unless a place is given."""
    latitude, longitude = geo.destination(*HOME[:2], north, east) if place is None else place
    return dialect.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, mask, round(latitude * 1e7), round(longitude * 1e7), height, *v, *ZERO, yaw, 0.0
    )


def attitude(pitch: float = 0.0, thrust: float = 0.5) -> Any:
    """SET_ATTITUDE_TARGET with the nose to the north."""
    q = [math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0]
    return dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, q, 0.0, 0.0, 0.0, thrust)


async def engage(client: Client, flavour: str) -> None:
    """What makes the setpoints fly that are being sent: a mode for PX4, nothing for ArduPilot in Guided."""
    if flavour == "px4":
        mark = client.mark()
        ack = await client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 6, 0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD, since=mark)


def idle_mode(flavour: str) -> int:
    """The mode that the end of a stream leaves."""
    return HOLD if flavour == "px4" else COPTER_GUIDED


@asynccontextmanager
async def streaming(
    client: Client, message: Any | Callable[[], Any], every: float = EVERY
) -> AsyncIterator[list[float]]:
    """A program that sends setpoints until the end of the block, and then dies. When it sent them."""
    sent: list[float] = []
    under_way = asyncio.Event()

    async def stream() -> None:
        for _ in itertools.count():
            client.send(message() if callable(message) else message)
            sent.append(asyncio.get_running_loop().time())
            if len(sent) == 4:
                under_way.set()
            await asyncio.sleep(every)  # the program's own rate

    task = asyncio.ensure_future(stream())
    try:
        await under_way.wait()
        yield sent
    finally:
        task.cancel()
        await asyncio.wait([task])


def allow_speed(w: World, tilt: float = 35.0) -> None:
    """The drone's owner has raised MaxTilt."""
    w.drone.firmware.receive(ardrone3.MaxTilt(tilt), asyncio.get_running_loop().time())


async def turn_to(w: World, degrees: float) -> None:
    """The nose of a hovering drone points elsewhere."""
    w.drone.firmware.receive(
        ardrone3.MoveBy(0.0, 0.0, 0.0, math.radians(degrees) - w.drone.pose.yaw), asyncio.get_running_loop().time()
    )
    await w.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), 20.0, since=asyncio.get_running_loop().time())
    await w.client.wait("ATTITUDE", lambda m: abs(m.yaw - math.radians(degrees)) < 0.05)


async def arrived(w: World, since: float) -> None:
    """The drone says that a move is over."""
    await w.drone.wait_log(
        lambda e: (
            (e.name.endswith("moveToChanged") and e.args["status"] == 1)
            or (e.name.endswith("moveByEnd") and e.args["error"] == 0)
        ),
        30.0,
        since=since,
    )


def heard(w: World, *names: str, since: float = 0.0) -> list[Any]:
    """Commands that the drone received, by the last part of their names."""
    return [e for e in w.drone.log if e.kind == "command" and e.t >= since and e.name.rpartition(".")[2] in names]


def motion(w: World, since: float) -> list[Any]:
    """Commands that move the drone: moves that are not zero, and sticks that are not level."""
    found = heard(w, "moveTo", "extended_move_to", "moveBy", "extended_move_by", "PCMD", since=since)
    axes = ("roll", "pitch", "yaw", "gaz")
    return [e for e in found if any(v for k, v in e.args.items() if e.name.endswith("PCMD") <= (k in axes))]


def texts(client: Client, mark: int = 0) -> list[str]:
    """What was said, chunks joined."""
    joined: dict[int, str] = {}
    whole: list[str] = []
    for _, message in client.since(mark, "STATUSTEXT"):
        if message.id == 0:
            whole.append(message.text)
        else:
            joined[message.id] = joined.get(message.id, "") + message.text
    return [*whole, *joined.values()]


async def said(client: Client, part: str, mark: int = 0) -> None:
    """Wait until a text with this part has come."""
    while not any(part in text for text in texts(client, mark)):
        await client.wait("STATUSTEXT")


async def held(w: World, script: Process, name: str, calm: float = 0.0) -> Pose:
    """Where the drone truly is while a program holds a step; it may go on then.

    `calm`: s that what the program asks for takes to settle. Where the machine holds the program up, just now perhaps,
    the drone hovers and begins again: no one looks before that has settled too.
    """
    await script.line(lambda line: line == f"held {name}", timeout=60.0)
    loop = asyncio.get_running_loop()
    disturbed = (OFFBOARD_STOPPED_HOVER, "Setpoint dropped", "Sticks silent")
    while True:
        texts_at = [at for at, m in w.client.since(0, "STATUSTEXT") if any(words in m.text for words in disturbed)]
        left = max(texts_at, default=-calm) + calm - loop.time()
        if left <= 0.0:
            break
        await asyncio.sleep(left)
    pose = w.drone.pose
    script.say("next")
    return pose
