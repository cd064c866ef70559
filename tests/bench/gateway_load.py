"""Processor time of the gateway alone, in virtual time: the load of the machine changes the figure least.

    .venv/bin/python tests/bench/gateway_load.py [DRONES] [ENDPOINTS] [ROUNDS] [many] [profile]

The gateway connects to simulated drones, whose datagrams of three seconds are recorded on the ground. Then the
simulated world rests, and the recording is repeated with new sequence numbers, straight into the sessions: without
the reading of sockets, which costs the same in every commit. What leaves goes to UDP sockets that nothing reads.
Each piece of half a second is repeated ROUNDS times, and the figure is the sum of the least: a busy machine disturbs
some of the repetitions, seldom all.
"""

from __future__ import annotations

import asyncio
import cProfile
import gc
import os
import pstats
import socket
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass
from typing import Any

from common import consecutive, frames_option, loopback, machine

from anafi_mav.arsdk.link import watchdog
from anafi_mav.arsdk.link.frame import FrameType, decode_frames, encode_frame
from anafi_mav.arsdk.link.session import Session
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

RATE = 30.0
RECORDED = 3.0
"""s of the recording: some multiple of every period of a drone on the ground."""

STEP = 0.005
"""s between two moments of the virtual clock."""

PIECE = 0.5
"""s that are measured at once."""

CONNECTING = 30.0
"""s in which the fleet has to be connected."""


class _Loop(asyncio.SelectorEventLoop):
    """An event loop whose clock is set by hand."""

    now = 1000.0

    def time(self) -> float:
        return self.now

    def monotonic(self) -> float:
        """As a `Clock`."""
        return self.now


class _Clock:
    """The loop's time for the gateway."""

    def __init__(self, loop: _Loop) -> None:
        self.monotonic = loop.time
        self.time = lambda: 1.7e9 + loop.time()
        self.boottime = loop.time


@dataclass
class _Recorded:
    """A datagram of a drone."""

    step: int
    session: Session
    data: bytes


class Replay:
    """The gateway, and the datagrams of its drones."""

    def __init__(self, gateway: Gateway, loop: _Loop, recorded: list[_Recorded]) -> None:
        self._loop = loop
        self._steps: list[list[tuple[Session, int, list[Any]]]] = [[] for _ in range(round(RECORDED / STEP))]
        for entry in recorded:
            version = entry.session.version
            frames = [frame for frame in decode_frames(version, entry.data)[0] if frame.type != FrameType.ACK]
            if frames and entry.step < len(self._steps):
                self._steps[entry.step].append((entry.session, version, frames))
        self._numbers: dict[tuple[Session, int], int] = {}
        self._mask = 0xFFFF
        for entry in recorded:
            for id, last in entry.session._transport._last_seq.items():
                self._numbers[entry.session, id] = last

    async def run(self) -> list[float]:
        """Return the processor time (s) of each piece of the recording."""
        steps = round(PIECE / STEP)
        return [await self._piece(self._steps[at : at + steps]) for at in range(0, len(self._steps), steps)]

    async def _piece(self, steps: list[list[tuple[Session, int, list[Any]]]]) -> float:
        spent = 0.0
        for step in steps:
            datagrams = [(session, self._renumbered(session, *rest)) for session, *rest in step]
            self._loop.now += STEP
            began = time.process_time()
            for session, data in datagrams:
                session.datagram_received(data, session._peer or ("", 0))
            for _ in range(3):
                await asyncio.sleep(0)
            spent += time.process_time() - began
        return spent

    def _renumbered(self, session: Session, version: int, frames: list[Any]) -> bytes:
        pieces = []
        for frame in frames:
            number = (self._numbers.get((session, frame.id), frame.seq) + 1) & self._mask
            self._numbers[session, frame.id] = number
            pieces.append(encode_frame(version, frame.type, frame.id, number, frame.payload))
        return b"".join(pieces)


async def measure(loop: _Loop, drones: int, endpoints: int, rounds: int, query: str, profiled: bool) -> None:
    """Print the figure."""
    first = loopback()
    addresses = consecutive(first, drones)
    specs = [DroneSpec(address=address, http_port=None, rtsp_port=None, telemetry_rate=RATE) for address in addresses]
    simulator = Simulator(specs, seed=1, remember=False)
    sinks = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(endpoints)]
    for sink in sinks:
        sink.bind((first, 0))
    config = Config(
        endpoints=[f"udpout://{first}:{sink.getsockname()[1]}{query}" for sink in sinks],
        drones=[
            DroneConfig(name=f"d{number}", sysid=number + 1, address=address)
            for number, address in enumerate(addresses)
        ],
        video=False,
        http=False,
    )
    gc.freeze()  # as the program does
    await simulator.start()
    gateway = Gateway(config, clock=_Clock(loop))
    await gateway.start()
    while not all(system.active for system in gateway.systems):
        await _pass(loop, 1)
        if loop.now > 1000.0 + CONNECTING:
            raise SystemExit("not all drones are connected")
    await _pass(loop, round(8.0 / STEP))
    replay = Replay(gateway, loop, await _record(loop, gateway))
    simulator._next_turn.cancel()  # type: ignore[union-attr]
    await replay.run()
    if profiled:
        profile = cProfile.Profile()
        profile.enable()
        await replay.run()
        await replay.run()
        profile.disable()
        profile.dump_stats(os.environ.get("PROF_OUT", "gateway_load.prof"))
        pstats.Stats(profile).sort_stats("tottime").print_stats(60)
    before, garbage = _sent(gateway), _Garbage()
    found = [await replay.run() for _ in range(rounds)]
    frames = (_sent(gateway) - before) / (RECORDED * rounds)
    least, mean = (sum(map(choose, zip(*found, strict=True))) / RECORDED for choose in (min, statistics.mean))
    shares = f"{least:.2%} | {mean:.2%} | {garbage.seconds / rounds / RECORDED:.2%}"
    print(f"| {drones} | {endpoints} | {shares} | {frames:.0f} |", flush=True)
    os._exit(0)


class _Garbage:
    """Processor time of the garbage collector."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._began = 0.0
        gc.callbacks.append(self._note)

    def _note(self, phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            self._began = time.process_time()
        else:
            self.seconds += time.process_time() - self._began


async def _record(loop: _Loop, gateway: Gateway) -> list[_Recorded]:
    recorded: list[_Recorded] = []
    step = 0

    def listen(session: Session) -> None:
        def take(data: bytes) -> None:
            recorded.append(_Recorded(step, session, data))
            session._take.__func__(session, data)  # type: ignore[attr-defined]

        session.air = lambda data, came_in, hand_on: take(data) if came_in else hand_on(data)

    sessions = [system.drone._session for system in gateway.systems]
    for session in sessions:
        assert isinstance(session, Session)
        listen(session)
    for number in range(round(RECORDED / STEP)):
        step = number
        await _pass(loop, 1)
    for session in sessions:
        assert isinstance(session, Session)
        session.air = None
    return recorded


async def _pass(loop: _Loop, steps: int) -> None:
    """Let virtual time pass."""
    for _ in range(steps):
        loop.now += STEP
        for _ in range(4):
            await asyncio.sleep(0)


def _sent(gateway: Gateway) -> int:
    return gateway._node.counters()["sent_frames"]


def main() -> None:
    watchdog.LIMIT = None
    words, query = frames_option([word for word in sys.argv[1:] if word != "profile"])
    drones, endpoints, rounds = (*map(int, words), *(20, 3, 12)[len(words) :])
    print(machine(), query)
    print("| drones | endpoints | gateway, share of one core | mean | garbage collection | frames/s |")
    print("|---|---|---|---|---|---|")
    loop = _Loop()
    with tempfile.TemporaryDirectory() as state:
        os.environ["XDG_STATE_HOME"] = state
        work = measure(loop, drones, endpoints, rounds, query, "profile" in sys.argv)
        loop.run_until_complete(work)


if __name__ == "__main__":
    main()
