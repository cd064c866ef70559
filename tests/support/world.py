"""A simulated drone behind a gateway, both real: ARSDK over UDP on one side, MAVLink over TCP on the other."""

from __future__ import annotations

import random
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from support.mav import Client

HOME = (48.8789, 2.3677, 35.0)

HOLD, LAND, RETURN, TAKEOFF = 0x03040000, 0x06040000, 0x05040000, 0x02040000
POSITION, OFFBOARD = 0x00030000, 0x00060000
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED


def loopback() -> str:
    """An address of the loopback network that nobody else uses: two runs on one machine do not meet."""
    while True:
        address = f"127.{random.randint(64, 126)}.{random.randint(1, 254)}.{random.randint(1, 254)}"
        with socket.socket() as probe:
            try:
                probe.bind((address, 44445))
            except OSError:
                continue
            return address


@dataclass
class World:
    """What a test holds in its hands."""

    simulator: Simulator
    gateway: Gateway
    address: str
    clients: list[Client] = field(default_factory=list)

    @property
    def drone(self) -> SimulatedDrone:
        return self.simulator.drones[0]

    @property
    def client(self) -> Client:
        return self.clients[0]

    async def connect(self, sysid: int = 255, compid: int = 190, port: int = 5760) -> Client:
        client = await Client(sysid, compid).connect(port, self.address)
        self.clients.append(client)
        return client

    async def take_off(self, height: float = 5.0) -> None:
        """Arm, take off, and wait until the vehicle holds at the height."""
        client = self.client
        ack = await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        mark = client.mark()
        ack = await client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=height)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await client.heartbeat(lambda beat: beat.custom_mode == TAKEOFF, since=mark)
        await client.heartbeat(lambda beat: beat.custom_mode == HOLD, timeout=20.0)

    def commands(self, name: str) -> list[Any]:
        """What the drone received under Parrot's name."""
        return [entry for entry in self.drone.log if entry.kind == "command" and entry.name == name]


@asynccontextmanager
async def world(
    *,
    speed: float = 3.0,
    telemetry_rate: float = 5.0,
    allow_kill: bool = False,
    sysid: int = 1,
    clients: int = 1,
    skycontroller: int | None = None,
    flavour: str = "px4",
    also: str | None = None,
    model: str = "4k",
) -> AsyncIterator[World]:
    """One simulated drone, one gateway with a TCP endpoint, and its clients, connected and ready.

    With `flavour` the endpoint shows that autopilot; `World.take_off` and the mode numbers above are PX4's. `also` is
    the flavour of a second endpoint, at port 5761.
    """
    drone_address, address = loopback(), loopback()
    spec = DroneSpec(
        model=model,
        address=drone_address,
        home=HOME,
        http_port=None,
        telemetry_rate=telemetry_rate,
        skycontroller=skycontroller,
    )
    config = Config(
        endpoints=(
            f"tcpin://{address}:5760?flavour={flavour}",
            *([f"tcpin://{address}:5761?flavour={also}"] if also else []),
        ),
        drones=(DroneConfig(name="alpha", sysid=sysid, address=drone_address),),
        allow_kill=allow_kill,
    )
    async with Simulator([spec], speed=speed, seed=1) as simulator, Gateway(config) as gateway:
        held = World(simulator, gateway, address)
        try:
            for _ in range(clients):
                await held.connect()
            assert await gateway.ready(10.0), gateway.lines()
            await held.client.heartbeat(lambda beat: True, since=0)
            await held.client.wait("GLOBAL_POSITION_INT", since=0)
            yield held
        finally:
            for client in held.clients:
                await client.close()
            await simulator.close()  # before the gateway, which would stay for two seconds to hover what still flies
