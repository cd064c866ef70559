"""A simulated drone behind a gateway, both real: ARSDK over UDP on one side, MAVLink over TCP on the other."""

from __future__ import annotations

import itertools
import os
import random
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as dialect

import anafi_mav.web.webrtc  # noqa: F401 - else a gateway loads it in a thread, and the clock of tests runs meanwhile
from anafi_mav.arsdk.link.handshake import DISCOVERY_PORT, HANDSHAKE_PORT
from anafi_mav.config import Config, DroneConfig, HttpConfig, MediaConfig, RecordingConfig, VideoConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from support import flavours
from support.mav import Client

HOME = (48.8789, 2.3677, 35.0)

WEB_PORT = 8080
"""Of a drone's web server; each drone has an address of its own."""

VIDEO_PORT = 8554
"""Of a drone's video server; no user needs a right for it."""

UDP_PORT = 14550

OPTIONS_PORT = 5770
"""Of the first endpoint with options of its own."""

HOLD, LAND, RETURN, TAKEOFF = 0x03040000, 0x06040000, 0x05040000, 0x02040000
POSITION, OFFBOARD = 0x00030000, 0x00060000
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED

TAKE_OFF_SPEED = 8.0
"""Simulated seconds in one for take-offs that only lead to what is tested."""


@dataclass(frozen=True)
class Modes:
    """custom_mode of what a vehicle can be doing, in one flavour (conformance A3, A4)."""

    hold: int
    """Where a vehicle is that `World.take_off` has lifted, or that was commanded to stop or to go somewhere."""
    idle: int
    """Where a vehicle is that no client has commanded anything."""
    position: int
    land: int
    returning: int
    takeoff: int


MODES = {
    "px4": Modes(hold=HOLD, idle=HOLD, position=POSITION, land=LAND, returning=RETURN, takeoff=TAKEOFF),
    "ardupilot": Modes(hold=4, idle=17, position=5, land=9, returning=6, takeoff=4),
}


_hosts = itertools.count(random.randrange(254))


def loopback() -> str:
    """An address of the loopback network that no one else uses: two runs on one machine do not meet.

    Each process has a network of its own, by its process id, and takes the addresses of that in turn.
    """
    network, host = divmod(os.getpid() % (63 * 254), 254)
    while True:
        address = f"127.{64 + network}.{1 + host}.{1 + next(_hosts) % 254}"
        if all(_is_free(address, port) for port in (DISCOVERY_PORT, HANDSHAKE_PORT)):
            return address


def _is_free(address: str, port: int) -> bool:
    """Whether a server could listen there: not while another one does, or a socket got this port by chance."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as asyncio's servers: ended connections are none
        try:
            probe.bind((address, port))
        except OSError:
            return False
        return True


@dataclass
class World:
    """What a test holds in its hands."""

    simulator: Simulator
    gateway: Gateway
    address: str
    flavour: str = "px4"
    clients: list[Client] = field(default_factory=list)

    @property
    def modes(self) -> Modes:
        """The mode numbers that the clients see."""
        return MODES[self.flavour]

    @property
    def drone(self) -> SimulatedDrone:
        return self.simulator.drones[0]

    @property
    def client(self) -> Client:
        return self.clients[0]

    async def connect(self, sysid: int = 255, compid: int = 190, port: int = 5760) -> Client:
        return self.take(await Client(sysid, compid).connect(port, self.address))

    def take(self, client: Client) -> Client:
        """A client that has come by another way; it is closed at the end."""
        self.clients.append(client)
        return client

    async def take_off(self, height: float = 5.0) -> None:
        """Arm, take off, and wait until the vehicle holds at the height. Time flies as well until then."""
        speed = self.simulator.speed
        self.simulator.speed = max(speed, TAKE_OFF_SPEED)
        try:
            await self._take_off(height)
        finally:
            self.simulator.speed = speed

    async def _take_off(self, height: float) -> None:
        client = self.client
        if self.flavour == "ardupilot":
            ack = await client.command(dialect.MAV_CMD_DO_SET_MODE, 1, self.modes.hold)
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
        ack = await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        ack = await client.command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=height)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        await self.at_height(height)

    async def at_height(self, height: float, timeout: float = 20.0) -> None:
        """Wait until the drone itself, not the gateway's word, has climbed to a height, and the vehicle holds it."""
        await self.drone.wait_log(lambda e: e.name.endswith("moveByEnd"), timeout)
        mark = self.client.mark()
        await self.client.heartbeat(lambda beat: beat.custom_mode == self.modes.hold, since=mark)
        assert abs(self.drone.pose.up - height) < 0.5

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
    drone_address: str | None = None,
    web: bool = False,
    udp: bool = False,
    video: VideoConfig | bool = True,
    video_latency: float = 0.0,
    media: MediaConfig | None = None,
    recording: RecordingConfig | None = None,
    pose: Literal["video", "events"] = "video",
    rtsp_port: int = VIDEO_PORT,
    quirks: tuple[str, ...] = (),
    versions: tuple[int, int] = (1, 3),
    before: Callable[[SimulatedDrone], None] = lambda drone: None,
    options: Sequence[str] = (),
    endpoints: Sequence[str] = (),
) -> AsyncIterator[World]:
    """One simulated drone, one gateway with a TCP endpoint, and its clients, connected and ready.

    With `flavour` the endpoint shows that autopilot. `also` is the flavour of a second endpoint, at port 5761.
    With `udp` there is another one that waits at UDP_PORT. Each of `options` has one at OPTIONS_PORT and above.
    `endpoints` are further ones, as URLs.
    With `web` the drone has its web server, which takes flight plans. A drone at the same `drone_address` as an earlier
    one has the same serial number. With another `rtsp_port` the gateway finds a video server of the test there.
    `before` is called with the drone before the gateway is made.
    """
    drone_address, address = drone_address or loopback(), loopback()
    spec = DroneSpec(
        model=model,
        address=drone_address,
        home=HOME,
        http_port=WEB_PORT if web else None,
        rtsp_port=VIDEO_PORT,
        telemetry_rate=telemetry_rate,
        skycontroller=skycontroller,
        video_latency=video_latency,
        firmware_quirks=quirks,
        versions=versions,
    )
    config = Config(
        endpoints=(
            f"tcpin://{address}:5760?flavour={flavour}",
            *([f"tcpin://{address}:5761?flavour={also}"] if also else []),
            *([f"udpin://{address}:{UDP_PORT}?flavour={flavour}"] if udp else []),
            *(f"tcpin://{address}:{OPTIONS_PORT + index}?{query}" for index, query in enumerate(options)),
            *endpoints,
        ),
        drones=(
            DroneConfig(name="alpha", sysid=sysid, address=drone_address, http_port=WEB_PORT, rtsp_port=rtsp_port),
        ),
        video=video,
        media=media or MediaConfig(),
        recording=recording or RecordingConfig(),
        http=HttpConfig(port=0),
        allow_kill=allow_kill,
        pose=pose,
    )
    flavours.note(*config.endpoints)
    async with AsyncExitStack() as stack:
        simulator = await stack.enter_async_context(Simulator([spec], speed=speed, seed=1))
        before(simulator.drones[0])
        gateway = await stack.enter_async_context(Gateway(config))
        held = World(simulator, gateway, address, flavour)
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
