"""Missions over a radio link that loses some of all frames, each way (conformance 61).

A client of our own sends and reads five hundred items in virtual time. MAVSDK, whose timers run by the clock, does so
under the marker `full`, and by default with MAVSDKS_COUNT.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support.lossy import LossyLink, lossy_link
from support.mav import Client
from support.plans import ACCEPTED, MISSION, Item, content, download, mission, upload
from support.product import program
from support.world import HOME, UDP_PORT, World, world

pytestmark = pytest.mark.third_party

SCRIPT = Path(__file__).with_name("mavsdk_lossy.py")

COUNT = 500
MAVSDKS_COUNT = 150

counts = pytest.mark.parametrize("count", [MAVSDKS_COUNT, pytest.param(COUNT, marks=pytest.mark.full)])

BAD = 0.25

MAVSDKS_TRIES = 3
"""By the way MAVSDK counts, 97.7 % of such uploads succeed, and 99.9 % cannot, whatever the vehicle does: it says its
first message five times, and once in a thousand uploads all five are lost. Nor is it patient: the half seconds without
a request that it counts go on while the gateway waits for a processor. An upload that it has abandoned, and said so, is
begun again, as its user would. tests/bench/lossy_uploads.py has the figures."""

MAVSDKS_OWN = 0.05
"""What MAVSDK's own test of lossy transfers loses. It asks for an item five times, so 99.6 % of such downloads succeed,
and with a quarter lost one in 3 000 would, whatever the vehicle does."""


async def by_mavsdk(w: World, link: LossyLink, count: int, what: str) -> list[str]:
    """What it printed, line by line, once it has done its work."""
    words = (sys.executable, "-u", str(SCRIPT), "udpout://{}:{}".format(*link.address), str(count), what)
    async with program(*words) as script:
        await script.line(lambda line: line == "done", timeout=350.0)
        return script.lines


async def holds_what_mavsdk_sent(w: World, count: int) -> None:
    """Read by another client whose link is good. The figures are those of mavsdk_lossy.py."""
    items = await download(w.client, MISSION)
    assert [(m.command, m.frame, m.param2, m.param4, m.x, m.y, m.z) for m in items] == [
        (16, 3, 1.0, 1.0 + n % 300, 488789000 + 30 * n, 23677000 - 20 * n, 10.0 + n % 40) for n in range(count)
    ]


@counts
async def test_conf_061_items_by_mavsdk_on_a_bad_link(count: int) -> None:
    async with world(udp=True) as w, lossy_link((w.address, UDP_PORT), BAD) as link:
        lines = await by_mavsdk(w, link, count, "up")
        observed = [line for line in lines if line.startswith("tried")]
        assert observed[-1] == "tried upload done"
        assert len(observed) <= MAVSDKS_TRIES
        link.check(count)
        await holds_what_mavsdk_sent(w, count)


@counts
async def test_conf_061_items_by_mavsdk_there_and_back(count: int) -> None:
    async with world(udp=True) as w, lossy_link((w.address, UDP_PORT), MAVSDKS_OWN) as link:
        lines = await by_mavsdk(w, link, count, "both")
        assert "tried upload done" in lines
        assert "equal True" in lines
        link.check(2 * count)
        await holds_what_mavsdk_sent(w, count)


def contents(items: list[Item]) -> list[tuple[float, ...]]:
    return [item.content for item in items]


async def test_conf_061_500_items_by_pymavlink_up() -> None:
    async with world(udp=True, speed=1.0, telemetry_rate=1.0) as w, lossy_link((w.address, UDP_PORT), BAD) as link:
        client, plan = w.take(Client(254).connect_udp(*link.address)), mission(HOME, COUNT)
        assert (await upload(client, plan, MISSION, timeout=10.0, repeat=0.5)).type == ACCEPTED
        link.check(COUNT)
        assert [content(item) for item in await download(w.client, MISSION)] == contents(plan)


async def test_conf_061_500_items_by_pymavlink_down() -> None:
    """It asks for an item up to 20 times."""
    async with world(udp=True, speed=1.0, telemetry_rate=1.0) as w, lossy_link((w.address, UDP_PORT), BAD) as link:
        client, plan = w.take(Client(254).connect_udp(*link.address)), mission(HOME, COUNT)
        assert (await upload(w.client, plan, MISSION)).type == ACCEPTED
        items = await download(client, MISSION, tries=20, patience=0.25)
        link.check(COUNT)
        assert [content(item) for item in items] == contents(plan)
