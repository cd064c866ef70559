"""Processor time of the live picture for browsers: 5 Mbit/s, 30 pictures/s, a key picture a second.

    .venv/bin/python tests/bench/page.py [SECONDS]
    .venv/bin/python tests/bench/page.py chromium

One process has the gateway's part for 0, 1 and 4 browsers; another one plays the browsers with aiortc. Each row is the
share of a core, and the longest iteration of the event loop while the browsers connect and later: the machine has to be
idle for these.

With `chromium`: the time from opening the page of a simulated drone to its first picture, and the age of the pictures
that it shows, read from their strip, against the simulator's clock.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import random
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from common import machine

sys.path.insert(0, str(Path(__file__).parents[1]))

from support import whep
from support.chromium import STRIP, chromium
from support.world import world

from anafi_mav.arsdk.video.rtp_h264 import Picture
from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.relay.feed import Feed
from anafi_mav.web.live_video import LiveVideo
from anafi_mav.web.server import HttpServer

SPS, PPS = bytes.fromhex("6742c01e95a0280f68"), bytes.fromhex("68ce3c80")
RATE, BITS, KEY = 30, 5_000_000, 80_000
"""Pictures/s, bits/s, bytes of a key picture."""
FILLER = 12
"""Type of a NAL unit that a decoder skips."""


class NoiseSource:
    """Stands for `DroneSource`: pictures of noise at the drone's rate."""

    sysid, name, shown = 1, "noise", StreamKind.VISIBLE

    def __init__(self) -> None:
        self.feed = Feed(1, 0, 0)
        self.viewers: list[Any] = []

    async def open(self, kind: StreamKind) -> Feed:
        return self.feed

    def join(self, viewer: Any) -> None:
        self.viewers.append(viewer)

    def leave(self, viewer: Any) -> None:
        if viewer in self.viewers:
            self.viewers.remove(viewer)

    async def run(self) -> None:
        chance, loop = random.Random(1), asyncio.get_running_loop()
        between = (BITS // 8 - KEY) // (RATE - 1)
        begun = loop.time()
        for number in range(1 << 30):
            await asyncio.sleep(max(0.0, begun + number / RATE - loop.time()))
            if number % RATE:
                units = (bytes((FILLER,)) + chance.randbytes(between),)
            else:
                units = (SPS, PPS, b"\x65" + chance.randbytes(KEY))
            packed = self.feed.add(Picture(3000 * number, units, None, True), loop.time())
            for viewer in tuple(self.viewers):
                viewer.show(packed, loop.time())


def browsers(pipe: Connection) -> None:
    """The other process: as many browsers as are asked for."""

    async def run() -> None:
        loop = asyncio.get_running_loop()
        root, count = await loop.run_in_executor(None, pipe.recv)
        held = [whep.browser(root) for _ in range(count)]
        for one in held:
            await one.__aenter__()
        pipe.send("open")
        await loop.run_in_executor(None, pipe.recv)
        for one in held:
            await one.__aexit__(None, None, None)
        pipe.send("closed")

    asyncio.run(run())


class _Watch:
    longest = 0.0

    async def run(self) -> None:
        while True:
            began = time.perf_counter()
            await asyncio.sleep(0.001)
            self.longest = max(self.longest, time.perf_counter() - began)


async def measure(count: int, seconds: float) -> str:
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    process = multiprocessing.get_context("spawn").Process(target=browsers, args=(theirs,))
    process.start()
    server, source, watch = HttpServer(port=0), NoiseSource(), _Watch()
    live = LiveVideo(server, lambda name: source)  # type: ignore[arg-type,return-value]
    await server.start()
    tasks = [asyncio.create_task(one) for one in (source.run(), watch.run())]
    loop = asyncio.get_running_loop()
    await asyncio.sleep(2.0)
    watch.longest = 0.0
    ours.send((f"http://127.0.0.1:{server.port}", count))
    await loop.run_in_executor(None, ours.recv)
    await asyncio.sleep(3.0)
    connecting, watch.longest = watch.longest, 0.0
    assert live.browsers == count
    began = time.process_time()
    await asyncio.sleep(seconds)
    share = 100.0 * (time.process_time() - began) / seconds
    watching = watch.longest
    sent = [session.track.counts for session in source.viewers]
    assert all(counts["pictures"] > RATE * seconds and not counts["dropped pictures"] for counts in sent), sent
    ours.send("close")
    await loop.run_in_executor(None, ours.recv)
    for task in tasks:
        task.cancel()
    await server.close()
    process.join()
    stalls = f"longest iteration {1000.0 * connecting:.0f} ms at the start, {1000.0 * watching:.0f} ms later"
    return f"{count} browsers: {share:.1f} % of a core, {stalls}"


async def look() -> str:
    async with world(speed=1.0) as w, chromium() as browser:
        page = await browser.page()
        assert w.gateway.web is not None
        began = time.perf_counter()
        await page.open(f"http://127.0.0.1:{w.gateway.web.port}/drone/1")
        await page.until("document.getElementById('picture')?.videoWidth ?? 0")
        first = time.perf_counter() - began
        await asyncio.sleep(3.0)
        ages = []
        for _ in range(100):
            ages.append(w.drone.firmware.time * 1000.0 - (int(await page.js(STRIP), 2) & 0xFFFFF))
            await asyncio.sleep(0.05)
        ages.sort()
        return f"Chromium: first picture after {first:.1f} s; age {ages[50]:.0f} ms (median), {ages[-1]:.0f} ms (worst)"


def main() -> None:
    if "chromium" in sys.argv:
        print(machine(), f"load {os.getloadavg()[0]:.1f}")
        print(asyncio.run(look()))
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    print(machine(), f"load {os.getloadavg()[0]:.1f}")
    for count in (0, 1, 4):
        print(asyncio.run(measure(count, seconds)), flush=True)


if __name__ == "__main__":
    main()
