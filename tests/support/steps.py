"""A step in velocity, flown by all four models at once: the product in this process, judged by the true poses."""

from __future__ import annotations

import asyncio
import itertools
import math
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.config import Config, DroneConfig
from anafi_mav.drone.video.video import VideoFrame
from anafi_mav.gateway import Gateway
from anafi_mav.services.system import System
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.wind import WindSpec
from anafi_mav.vehicle.base.velocity_loop import MotionEstimate
from support.mav import Client
from support.roll_records import remember_roll
from support.world import HOLD, HOME, TAKE_OFF_SPEED, TAKEOFF, loopback

VELOCITY_ONLY = 0x9C7
"""SET_POSITION_TARGET type mask: velocity and yaw, nothing else."""

BAND = 0.1
"""Share of the step within which it has settled."""

LENGTH = 8.0
"""s that the step is flown for."""

SMOOTHING = 0.3
"""s that poses are averaged over before it is judged whether it has settled: gusts are no oscillation of ours."""


@dataclass(frozen=True)
class Figures:
    """How one model flew the step."""

    model: str
    settled: float
    """s until it stays within `BAND`."""
    overshoot: float
    """Share of the step."""
    steady: float
    """m/s of the mean error from four seconds after the step on."""
    worst: float
    """m/s of the largest error from then on."""

    def __str__(self) -> str:
        return (
            f"{self.model:8} settled after {self.settled:.2f} s, overshoot {100 * self.overshoot:.0f} %, "
            f"steady error {self.steady:.2f} m/s, largest {self.worst:.2f} m/s"
        )


async def velocity_step(
    wind: WindSpec,
    *,
    speed: float = 5.0,
    course: float = 0.0,
    yaw: float = 0.0,
    tilt: float = 35.0,
    rate: float = 5.0,
    pictures: float | None = None,
) -> list[Figures]:
    """Every model steps from a hover to `speed` m/s towards `course` (rad) with its nose to `yaw` (rad).

    `rate` is how often the drones tell how they move, Hz: five times on the aircraft. With `pictures` the loop knows
    attitude and speed from the live video instead, whose pictures are this old (s) when they arrive.
    """
    specs = [
        DroneSpec(
            model=model,
            address=loopback(),
            home=HOME,
            http_port=None,
            telemetry_rate=rate,
            video_latency=pictures or 0.0,
        )
        for model in MODELS
    ]
    address = loopback()
    folder = tempfile.TemporaryDirectory()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=tuple(DroneConfig(name=s.model, sysid=i + 1, address=s.address) for i, s in enumerate(specs)),
        state=folder.name,
    )
    async with AsyncExitStack() as stack:
        stack.callback(folder.cleanup)
        simulator = await stack.enter_async_context(Simulator(specs, seed=1))
        for drone in simulator.drones:
            remember_roll(Path(folder.name), drone)
        gateway = await stack.enter_async_context(Gateway(config))
        assert await gateway.ready(10.0), gateway.lines()
        client = await Client().connect(5760, address)
        try:
            now = asyncio.get_running_loop().time()
            for drone in simulator.drones:
                drone.firmware.receive(ardrone3.MaxTilt(tilt), now)
                drone.firmware.receive(ardrone3.MaxDistance(1000.0), now)
                drone.wind.spec = wind
            simulator.speed = TAKE_OFF_SPEED
            await asyncio.gather(*(_take_off(client, number + 1) for number in range(len(specs))))
            simulator.speed = 1.0
            if pictures is not None:
                stack.enter_context(motion_by_pictures(gateway))
                for sysid in range(1, len(specs) + 1):
                    asked = dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAVLINK_MSG_ID_ATTITUDE, 1e6 / 30
                    assert (await client.command(*asked, target=(sysid, 1))).result == dialect.MAV_RESULT_ACCEPTED
            wanted = [0.0, 0.0]
            stream = asyncio.ensure_future(_stream(client, len(specs), wanted, yaw))
            try:
                await asyncio.sleep(0.0)  # on this connection the first setpoints go before the commands
                for sysid in range(1, len(specs) + 1):
                    ack = await client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 6, 0, target=(sysid, 1))
                    assert ack.result == dialect.MAV_RESULT_ACCEPTED, ack
                await asyncio.sleep(3.0)  # the nose turns
                wanted[:] = speed * math.cos(course), speed * math.sin(course)
                began = asyncio.get_running_loop().time()
                await asyncio.sleep(LENGTH)
            finally:
                stream.cancel()
            return [_figures(drone, began, speed, course) for drone in simulator.drones]
        finally:
            await client.close()
            await simulator.close()


@contextmanager
def motion_by_pictures(gateway: Gateway) -> Iterator[None]:
    """Give every velocity loop attitude and speed of the pictures, with their own times, and not those of events."""
    on_attitude, on_velocity = MotionEstimate.on_attitude, MotionEstimate.on_velocity

    def follow(system: System) -> Callable[[], None]:
        def show(frame: VideoFrame) -> None:
            motion, attitude, speed = system.vehicle.offboard.motion, frame.attitude, frame.metadata.speed
            assert attitude is not None
            assert speed is not None
            on_attitude(motion, attitude.roll, attitude.pitch, attitude.yaw, frame.shot)
            on_velocity(motion, speed.north, speed.east, speed.down, frame.shot)

        return system.drone.video.subscribe(show)

    with ExitStack() as stack, pytest.MonkeyPatch.context() as patch:
        for system in gateway.systems:
            stack.callback(follow(system))
        patch.setattr(MotionEstimate, "on_attitude", lambda *_: None)
        patch.setattr(MotionEstimate, "on_velocity", lambda *_: None)
        yield


async def _take_off(client: Client, sysid: int) -> None:
    mark = client.mark()
    target = (sysid, 1)
    assert (await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=target)).result == 0
    assert (await client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=8.0, target=target)).result == 0
    for mode in (TAKEOFF, HOLD):
        await client.heartbeat(
            lambda beat, mode=mode: beat.get_srcSystem() == sysid and beat.custom_mode == mode,
            since=mark,
            timeout=30.0,
        )
        mark = client.mark()


async def _stream(client: Client, count: int, wanted: list[float], yaw: float) -> None:
    """A program that sends its velocity twenty times a second to each drone."""
    for _ in itertools.count():
        for sysid in range(1, count + 1):
            client.send(
                dialect.MAVLink_set_position_target_local_ned_message(
                    0, sysid, 1, 1, VELOCITY_ONLY, 0, 0, 0, wanted[0], wanted[1], 0, 0, 0, 0, yaw, 0
                )
            )
        await asyncio.sleep(0.05)  # the program's own rate


def _figures(drone: SimulatedDrone, began: float, speed: float, course: float) -> Figures:
    poses = [(e.t - began, e.args["vn"], e.args["ve"]) for e in drone.log if e.kind == "pose" and e.t >= began]
    north, east = speed * math.cos(course), speed * math.sin(course)
    errors = [(t, vn - north, ve - east) for t, vn, ve in poses]
    settled = 0.0
    for t, _, _ in errors:
        window = [(n, e) for at, n, e in errors if t - SMOOTHING < at <= t]
        if math.hypot(*_mean(window)) > BAND * speed:
            settled = t
    late = [(n, e) for t, n, e in errors if t > 4.0]
    along = [vn * math.cos(course) + ve * math.sin(course) for _, vn, ve in poses]
    return Figures(
        drone.spec.model,
        settled,
        max(along) / speed - 1.0,
        math.hypot(*_mean(late)),
        max(math.hypot(*error) for error in late),
    )


def _mean(vectors: list[tuple[float, float]]) -> tuple[float, float]:
    return sum(n for n, _ in vectors) / len(vectors), sum(e for _, e in vectors) / len(vectors)
