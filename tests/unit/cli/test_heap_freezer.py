"""When the heap is frozen, by the clock of tests, and what the collector of a started gateway still scans."""

from __future__ import annotations

import asyncio
import gc
import signal
import sys
from pathlib import Path

import pytest
from support.product import Process
from support.world import HOME, loopback

from anafi_mav.cli.heap_freezer import DELAY, HeapFreezer, frozen_afterwards

PROGRAM = """
import gc, signal, sys
def show(number, frame):
    from anafi_mav.services.system import System
    print("scanned systems:", sum(type(one) is System for one in gc.get_objects()), flush=True)
signal.signal(signal.SIGUSR1, show)
from anafi_mav.__main__ import main
sys.exit(main())
"""
"""The program, which prints at SIGUSR1 how many systems its garbage collector knows."""


class Freezes:
    """Counts calls."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> None:
        self.count += 1


async def test_requests_within_the_delay_share_one_freeze() -> None:
    freezes = Freezes()
    freezer = HeapFreezer(freezes)
    freezer.request()
    await asyncio.sleep(0.8 * DELAY)
    freezer.request()
    assert freezes.count == 0
    await asyncio.sleep(0.3 * DELAY)  # counted from the first request: a fleet that connects slowly is not put off
    assert freezes.count == 1
    await asyncio.sleep(2.0 * DELAY)
    assert freezes.count == 1


async def test_later_request_freezes_again() -> None:
    freezes = Freezes()
    freezer = HeapFreezer(freezes)
    for expected in (1, 2, 3):
        freezer.request()
        await asyncio.sleep(1.1 * DELAY)
        assert freezes.count == expected


async def test_closed_freezer_does_not_freeze() -> None:
    freezes = Freezes()
    freezer = HeapFreezer(freezes)
    freezer.request()
    freezer.close()
    await asyncio.sleep(2.0 * DELAY)
    assert freezes.count == 0


def test_collector_is_enabled_again_after_a_failed_start() -> None:
    enabled_within: list[bool] = []

    def start() -> None:
        with frozen_afterwards():
            enabled_within.append(gc.isenabled())
            raise OSError("port in use")

    with pytest.raises(OSError, match="port"):
        start()
    assert enabled_within == [False]
    assert gc.isenabled()


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="Windows has no such signal")
async def test_collector_of_a_ready_gateway_scans_no_system(tmp_path: Path) -> None:
    config, address = tmp_path / "fleet.yaml", loopback()
    config.write_text(
        f"endpoints: ['tcpin://{address}:5760']\n"
        f"drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}}}}}]\n"
        "http: false\nvideo: false\n"
    )
    process = await Process.start(
        sys.executable, "-c", PROGRAM, "run", "-c", str(config), env={"XDG_STATE_HOME": str(tmp_path)}
    )
    try:
        await process.line(lambda line: line.startswith("ready"))
        process.process.send_signal(signal.SIGUSR1)
        assert await process.line(lambda line: line.startswith("scanned")) == "scanned systems: 0"
        process.process.terminate()
        assert await process.end() == 0
    finally:
        await process.put_away()
