"""Processor time of the simulator alone, in virtual time: the load of the machine does not change the figure.

    .venv/bin/python tests/bench/simulator.py [DRONES] [SECONDS] [profile]

Every drone has an ARSDK session to a UDP socket that nothing reads, and sends attitude, speed and height 30 times a
second. Each row is the processor time of one simulated second, first on the ground, then hovering, then in the wind.
"""

from __future__ import annotations

import asyncio
import cProfile
import pstats
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from common import loopback, machine

from anafi_mav.arsdk.link.device import DeviceSession
from anafi_mav.arsdk.link.handshake import ConnectRequest
from anafi_mav.arsdk.link.transport import Role, Transport
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.wind import WindSpec

RATE = 30.0
WINDY = WindSpec(8.0, 90.0)


class _Loop(asyncio.SelectorEventLoop):
    """An event loop whose clock is set by hand."""

    now = 1000.0

    def time(self) -> float:
        return self.now


class _Fleet:
    """A simulated world that is advanced turn by turn, with the loop's work between."""

    def __init__(self, drones: int, loop: _Loop) -> None:
        first = loopback()
        head, _, last = first.rpartition(".")
        addresses = [f"{head}.{int(last) + number}" for number in range(drones)]
        specs = [DroneSpec(address=address, http_port=None, telemetry_rate=RATE) for address in addresses]
        self.simulator = Simulator(specs, seed=1, remember=False)
        self.turns = 0
        self._loop = loop
        self._sink = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sink.bind((first, 0))

    async def connect(self) -> None:
        peer = self._sink.getsockname()
        for drone in self.simulator.drones:
            sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            sock.bind((drone.address, 0))
            transport = Transport(Role.DEVICE, 3, self._loop.time(), ping_after=1e6)
            session = DeviceSession(transport, ConnectRequest("bench", "bench", peer[1]), peer[0])
            session.on_message = drone._on_session(session)
            await session.open(sock)

    async def run(self, seconds: float) -> None:
        period = self.simulator._period
        for _ in range(round(seconds / period)):
            self.simulator.advance(period)
            self._loop.now += period
            self.turns += 1
            await asyncio.sleep(0.0)
            await asyncio.sleep(0.0)

    async def take_off(self) -> None:
        for drone in self.simulator.drones:
            drone.firmware.receive(ardrone3.TakeOff(), self._loop.now)
        await self.run(8.0)
        assert all(drone.flying_state is FlyingState.HOVERING for drone in self.simulator.drones)


async def measure(drones: int, seconds: float, profiled: bool, loop: _Loop) -> None:
    """Print the table."""
    fleet = _Fleet(drones, loop)
    await fleet.connect()
    await fleet.run(2.0)
    for state in ("standing", "hovering", "hovering in wind"):
        if state == "hovering":
            await fleet.take_off()
        elif state == "hovering in wind":
            for drone in fleet.simulator.drones:
                drone.wind.spec = WINDY
            await fleet.run(2.0)
        sent = _sent(fleet)
        turns = fleet.turns
        with _profile(profiled):
            began = time.process_time()
            await fleet.run(seconds)
            spent = time.process_time() - began
        rates = f"{(fleet.turns - turns) / seconds:.0f} | {(_sent(fleet) - sent) / seconds:.0f}"
        print(f"| {drones} {state} | {spent / seconds:.1%} | {rates} |", flush=True)


def _sent(fleet: _Fleet) -> int:
    """Messages of all drones so far."""
    sessions = [drone.session for drone in fleet.simulator.drones]
    return sum(session.counters["sent"] for session in sessions if session is not None)


@contextmanager
def _profile(wanted: bool) -> Iterator[None]:
    if not wanted:
        yield
        return
    profile = cProfile.Profile()
    profile.enable()
    yield
    profile.disable()
    pstats.Stats(profile).sort_stats("tottime").print_stats(40)


def main() -> None:
    words = [word for word in sys.argv[1:] if word != "profile"]
    drones = int(words[0]) if words else 100
    seconds = float(words[1]) if len(words) > 1 else 10.0
    print(machine())
    print("| drones | simulator, share of one core | turns/s | messages/s |")
    print("|---|---|---|---|")
    loop = _Loop()
    loop.run_until_complete(measure(drones, seconds, "profile" in sys.argv, loop))


if __name__ == "__main__":
    main()
