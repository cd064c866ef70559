"""A drone of ours connected to a simulated one of a given model, over real sockets, in a world that runs faster."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

from anafi_mav.arsdk.messages.ardrone3 import FlyingState, FlyingStateChanged
from anafi_mav.drone import Drone
from anafi_mav.drone.drone import CONTROLLER_PORTS
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator

HOME = (48.8789, 2.3677, 35.0)
SPEED = 2.0


class Pair(NamedTuple):
    drone: Drone
    real: SimulatedDrone


@asynccontextmanager
async def connected(model: str, speed: float = SPEED, skycontroller: int | None = None) -> AsyncIterator[Pair]:
    """Both, connected; on ports that the system chooses."""
    spec = DroneSpec(
        model=model,
        address="127.0.0.1",
        home=HOME,
        discovery_port=0,
        handshake_port=0,
        c2d_port=0,
        http_port=0,
        skycontroller=skycontroller,
        rtsp_port=0,
    )
    async with Simulator([spec], speed=speed, seed=1) as simulator:
        real = simulator.drones[0]
        shift = CONTROLLER_PORTS if skycontroller == 3 else 0
        drone = Drone(
            "127.0.0.1",
            discovery_port=real.discovery_port,
            http_port=(real.http_port or 80) - shift,
            rtsp_port=real.rtsp_port or 554,
            name=f"simulated {model}",
        )
        await drone.connect()
        try:
            yield Pair(drone, real)
        finally:
            await drone.close()


async def take_off(drone: Drone) -> None:
    """Up, and until it hovers."""
    await drone.piloting.take_off()
    if drone.piloting.state.flying != FlyingState.HOVERING:
        await drone.expect(FlyingStateChanged, lambda m: m.state == FlyingState.HOVERING, 10.0)
