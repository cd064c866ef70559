"""Processor time of the simulated camera's picture, in virtual time: a busy machine has the same figure.

    .venv/bin/python tests/bench/video.py [SECONDS] [profile]

A drone hovers in the wind, its camera turning with the compass, and one client watches: an RTSP session whose datagrams
are not read. Each row is the share of a core at 30 pictures a second: the time with the video less that without it.
"""

from __future__ import annotations

import asyncio
import cProfile
import pstats
import socket
import sys
import time

from common import loopback, machine

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.wind import WindSpec

WINDY = WindSpec(8.0, 90.0)
TURN = ardrone3.PCMD(flag=0, roll=0, pitch=0, yaw=40, gaz=0, timestampAndSeqNum=0)
STICKS_EVERY = 5
"""Steps of the simulator."""
STREAMS = {"4k": "video", "thermal": "thermal", "ai": "front"}


class _Loop(asyncio.SelectorEventLoop):
    """An event loop whose clock is set by hand."""

    now = 1000.0

    def time(self) -> float:
        return self.now


async def run(simulator: Simulator, loop: _Loop, seconds: float) -> float:
    """Let time pass; the processor time of it in s."""
    period, began = simulator._period, time.process_time()
    for step in range(round(seconds / period)):
        if step % STICKS_EVERY == 0:
            simulator.drones[0].firmware.receive(TURN, loop.now)
        simulator.advance(period)
        loop.now += period
        await asyncio.sleep(0.0)
    return time.process_time() - began


async def ask(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, request: str) -> str:
    writer.write(request.encode())
    answer = await reader.readuntil(b"\r\n\r\n")
    assert answer.startswith(b"RTSP/1.0 200 "), answer
    return answer.decode()


async def measure(model: str, seconds: float, loop: _Loop) -> str:
    address = loopback()
    spec = DroneSpec(model=model, address=address, http_port=None, rtsp_port=0, wind=WINDY)
    simulator = Simulator([spec], seed=1, remember=False)
    (drone,) = simulator.drones
    await drone.start()
    drone.firmware.receive(ardrone3.TakeOff(), loop.now)
    await run(simulator, loop, 10.0)
    without = min([await run(simulator, loop, seconds) for _ in range(3)])
    reader, writer = await asyncio.open_connection(address, drone.rtsp_port)
    sinks = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for sink in sinks:
        sink.bind((address, 0))
    ports = "-".join(str(sink.getsockname()[1]) for sink in sinks)
    url = f"rtsp://{address}:{drone.rtsp_port}/live"
    answer = await ask(
        reader,
        writer,
        f"SETUP {url}/{STREAMS[model]} RTSP/1.0\r\nCSeq: 1\r\nTransport: RTP/AVP;unicast;client_port={ports}\r\n\r\n",
    )
    session = answer.partition("Session: ")[2].partition(";")[0].split()[0]
    await ask(reader, writer, f"PLAY {url} RTSP/1.0\r\nCSeq: 2\r\nSession: {session}\r\n\r\n")
    first = await run(simulator, loop, seconds)
    watched = min([await run(simulator, loop, seconds) for _ in range(3)])
    writer.close()
    for sink in sinks:
        sink.close()
    await drone.close()
    share, cold = 100.0 * (watched - without) / seconds, 100.0 * (first - without) / seconds
    return f"{model} {STREAMS[model]}: {share:.1f} % of a core, in the first {seconds:g} s {cold:.1f} %"


def main() -> None:
    seconds = next((float(text) for text in sys.argv[1:] if text != "profile"), 10.0)
    print(machine())
    profile = cProfile.Profile() if "profile" in sys.argv else None
    for model in STREAMS:
        loop = _Loop()
        if profile is not None:
            profile.enable()
        print(loop.run_until_complete(measure(model, seconds, loop)))
        if profile is not None:
            profile.disable()
        loop.close()
    if profile is not None:
        pstats.Stats(profile).sort_stats("tottime").print_stats(25)


if __name__ == "__main__":
    main()
