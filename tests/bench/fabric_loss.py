"""The fabric over a poor link between gateway and router: what gets through, and how late.

    .venv/bin/python tests/bench/fabric_loss.py [LINK] [STARTS] [SECONDS]

LINK is tcp, udp, quic or all. `tcp`: 50 ms each way, and a stall of 1 s every 20 s. `udp` and `quic`: 5 % of the
datagrams of each direction are lost, and the others are 50 ms late. Gateway, simulated drone, ground and station share
this process and its clock; the router is the Python package in a process of its own, and the station's side of it is
not impaired. For each start it waits 15 s at most for the drone's heartbeat and the answer to a command. Then it sends
commands for SECONDS, repeated after 1 s without an answer, uploads a mission of 12 items and downloads a file of
about 100 kB.

    .venv/bin/python tests/bench/fabric_loss.py declaration [SECONDS]

Two liveliness tokens are declared over `udp`. The datagram with the first declaration is lost, and no other. It prints
which tokens another session sees within SECONDS, and after the first one was declared again.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import zenoh
from common import machine, quantile
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import missions, repeating
from support.certificates import Authority
from support.fabric import FabricStation, ground, router
from support.media import DAY, add_video
from support.plans import ACCEPTED, MISSION
from support.poor_link import LossyRelay, StallingRelay
from support.world import World, world

JOIN_LIMIT = 15.0
FILE = 100_000
PLAN = [missions.takeoff(6.0), *(missions.way(10.0 + n, 0.0, 6.0) for n in range(10)), missions.RTL]


class Tally:
    """Figures of all starts of one link."""

    def __init__(self) -> None:
        self.starts = self.connected = self.sent = self.rejected = self.unanswered = 0
        self.delays: list[float] = []
        self.uploads: list[float] = []
        self.downloads: list[float] = []
        self.size = 0
        self.failed: list[str] = []

    def show(self, link: str) -> None:
        """Print them."""
        print(f"{link}: {self.connected} of {self.starts} starts connected within {JOIN_LIMIT:.0f} s")
        if self.delays:
            p50, p99 = (1000 * quantile(self.delays, share) for share in (0.5, 0.99))
            print(
                f"  {len(self.delays)} commands accepted in {self.sent} attempts: p50 {p50:.0f} ms, p99 {p99:.0f} ms, "
                f"longest {1000 * max(self.delays):.0f} ms; rejected {self.rejected}, unanswered {self.unanswered}"
            )
        for name, times in ((f"upload of {len(PLAN)} items", self.uploads), (f"{self.size} bytes", self.downloads)):
            if times:
                print(f"  {name}: {len(times)}, mean {sum(times) / len(times):.1f} s, longest {max(times):.1f} s")
        for failure in self.failed:
            print(f"  failed: {failure}")


async def measure(link: str, number: int, seconds: float, tally: Tally, authority: Authority) -> None:
    """Start once and measure."""
    settings = {}
    if link == "quic":
        certificate, key = authority.issue("router")
        files = {"listen_certificate": certificate, "listen_private_key": key}
        settings = {f"transport/link/tls/{name}": str(path) for name, path in files.items()}
    async with router(settings, also="" if link == "tcp" else link) as node:
        relay: Any
        if link == "tcp":
            relay = StallingRelay(node.port, delay=0.05, stall_time=1.0, stall_every=20.0)
        else:
            relay = LossyRelay(node.other, seed=number)
        url = f"zenoh://127.0.0.1:{await relay.start()}?link={link}"
        if link == "quic":
            url += f"&ca={authority.path}"
        try:
            async with world(endpoints=(url,), web=True) as w, ground(node.url) as port:
                video = add_video(w.drone, FILE)
                station = FabricStation()
                tally.starts += 1
                try:
                    await station.join(port, timeout=JOIN_LIMIT)
                    await _first_answer(station)
                except AssertionError as error:
                    print(f"{link}, start {number}: not connected ({str(error)[:60]}); {_line(w)}", flush=True)
                    await station.close()
                    return
                tally.connected += 1
                try:
                    await _use(station, seconds, tally)
                    began = time.monotonic()
                    assert (await repeating.upload(station, PLAN, MISSION)).type == ACCEPTED
                    tally.uploads.append(time.monotonic() - began)
                    began = time.monotonic()
                    assert await repeating.download(station, f"/media/{DAY}/{video.id}") == video.content()
                    tally.downloads.append(time.monotonic() - began)
                    tally.size = len(video.content())
                except AssertionError as error:
                    tally.failed.append(f"start {number}: {str(error)[:100]}")
                finally:
                    await station.close()
                what = (len(tally.delays), len(tally.uploads), len(tally.downloads), len(tally.failed))
                print(f"{link}, start {number}: so far commands, uploads, downloads, failed: {what}", flush=True)
        finally:
            await relay.close()


def _line(w: World) -> str:
    return next(line for line in w.gateway.lines() if "zenoh" in line)


async def _first_answer(station: FabricStation) -> None:
    limit = time.monotonic() + JOIN_LIMIT
    while time.monotonic() < limit:
        try:
            ack, _ = await repeating.command(station, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        except repeating.Unanswered:
            continue
        if ack.result == dialect.MAV_RESULT_ACCEPTED:
            return
        await asyncio.sleep(0.2)
    raise AssertionError("no command is accepted")


async def _use(station: FabricStation, seconds: float, tally: Tally) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        began = time.monotonic()
        try:
            ack, attempts = await repeating.command(station, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        except repeating.Unanswered:
            tally.unanswered += 1
            continue
        tally.sent += attempts
        if ack.result == dialect.MAV_RESULT_ACCEPTED:
            tally.delays.append(time.monotonic() - began)
        else:
            tally.rejected += 1
        await asyncio.sleep(0.1)


def opened(locator: str) -> zenoh.Session:
    config = zenoh.Config()
    for key, value in {"mode": "client", "connect/endpoints": [locator]}.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


async def declaration(seconds: float) -> None:
    """Lose one declaration, and print what becomes of it."""
    lost, kept = "bench/lost", "bench/kept"
    seen: set[str] = set()
    async with router(also="udp") as node:
        relay = LossyRelay(node.other, loss=0.0)
        locator = f"udp/127.0.0.1:{await relay.start()}"
        session = await asyncio.to_thread(opened, locator)
        observer = await asyncio.to_thread(opened, f"tcp/127.0.0.1:{node.port}")
        watch = observer.liveliness().declare_subscriber(
            "bench/**", lambda sample: seen.add(str(sample.key_expr)), history=True
        )
        relay.lose_next = lost.encode()
        first = await asyncio.to_thread(session.liveliness().declare_token, lost)
        await asyncio.sleep(1.0)
        second = await asyncio.to_thread(session.liveliness().declare_token, kept)
        await asyncio.sleep(seconds)
        print(f"{relay.lost} of {relay.lost + relay.passed} datagrams lost; seen after {seconds:.0f} s: {sorted(seen)}")
        await asyncio.to_thread(first.undeclare)
        third = await asyncio.to_thread(session.liveliness().declare_token, lost)
        await asyncio.sleep(5.0)
        print(f"seen 5 s after the first was declared again: {sorted(seen)}")
        for held in (watch, second, third):
            await asyncio.to_thread(held.undeclare)
        await asyncio.to_thread(session.close)
        await asyncio.to_thread(observer.close)
        await relay.close()


def main() -> None:
    words = sys.argv[1:]
    if words[:1] == ["declaration"]:
        asyncio.run(declaration(float(words[1]) if len(words) > 1 else 60.0))
        return
    links = ("tcp", "udp", "quic") if not words or words[0] == "all" else (words[0],)
    starts = int(words[1]) if len(words) > 1 else 10
    seconds = float(words[2]) if len(words) > 2 else 10.0
    logging.disable(logging.CRITICAL)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        authority = Authority(Path(folder))
        for link in links:
            tally = Tally()
            for number in range(starts):
                asyncio.run(measure(link, number, seconds, tally, authority))
            tally.show(link)


if __name__ == "__main__":
    main()
