"""A stall of the host is noticed before anything that arrived meanwhile is read."""

from __future__ import annotations

import asyncio
import threading
import time

from support.clock import everybodys, only_reacts
from support.laptop import LaptopClock

from anafi_mav.mavlink.stall import DRAIN, STALL, StallWatch


async def test_stall_marks_data_old_until_sockets_are_drained() -> None:
    stalls: list[float] = []
    watch = StallWatch(stalls.append, LaptopClock())
    watch.start()
    with everybodys():
        await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
        time.sleep(1.2 * STALL)  # noqa: ASYNC251
        assert watch.waited  # before any timer has run
        assert watch.waited >= 1.2 * STALL
        assert watch.stalled >= 1.2 * STALL
        assert stalls == []
        await asyncio.sleep(0.1)  # a beat
        assert watch.waited >= 1.2 * STALL  # what arrived during the stall may still be in a socket
        while watch.waited:  # noqa: ASYNC110
            await asyncio.sleep(0.05)
        assert watch.waited == 0.0
        assert stalls[0] >= STALL
        assert watch.stalled == stalls[0]
    watch.stop()


async def test_host_that_is_late_again_drains_for_longer() -> None:
    """After a stall a busy host may not let the loop run for all of the time in which it empties its sockets."""
    watch = StallWatch(lambda seconds: None, LaptopClock())
    watch.start()
    with everybodys():
        await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
        time.sleep(1.2 * STALL)  # noqa: ASYNC251
        await asyncio.sleep(0.05)  # a beat
        assert watch.waited
        time.sleep(DRAIN + 0.1)  # noqa: ASYNC251
        assert watch.waited >= 1.2 * STALL  # before any timer has run
        await asyncio.sleep(0.05)  # a beat
        assert watch.waited >= 1.2 * STALL
        while watch.waited:  # noqa: ASYNC110
            await asyncio.sleep(0.05)
    watch.stop()


async def test_stopped_watch_finds_nothing_old() -> None:
    watch = StallWatch(lambda seconds: None, LaptopClock())
    watch.start()
    watch.stop()
    with everybodys():
        await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
        time.sleep(1.2 * STALL)  # noqa: ASYNC251
        assert not watch.waited


async def test_slow_callback_beside_a_thread_is_no_stall_of_the_host() -> None:
    """The clock of tests: a busy machine with work in a thread must not look like a host that stalled."""
    stalls: list[float] = []
    watch, written = StallWatch(stalls.append, LaptopClock()), threading.Event()
    watch.start()
    work = asyncio.get_running_loop().run_in_executor(None, written.wait)
    await asyncio.sleep(0)
    time.sleep(1.2 * STALL)  # noqa: ASYNC251
    assert not watch.waited
    await asyncio.sleep(0.2)  # two beats
    written.set()
    await work
    watch.stop()
    assert stalls == []


async def test_slow_callback_beside_a_process_that_only_reacts_is_no_stall_of_the_host() -> None:
    """The clock of tests: a busy machine with a router in a process of its own must not look like one either."""
    stalls: list[float] = []
    watch = StallWatch(stalls.append, LaptopClock())
    watch.start()
    process = await asyncio.create_subprocess_exec("cat", stdin=asyncio.subprocess.PIPE)
    only_reacts(process)
    await asyncio.sleep(0)
    time.sleep(1.2 * STALL)  # noqa: ASYNC251
    assert not watch.waited
    await asyncio.sleep(0.2)  # two beats
    process.kill()
    await process.wait()
    watch.stop()
    assert stalls == []


async def test_suspended_computer_marks_data_old_until_sockets_are_drained() -> None:
    """The clock of the loop stands still meanwhile: no silence is longer by it."""
    over: asyncio.Future[float] = asyncio.get_running_loop().create_future()
    clock = LaptopClock()
    watch = StallWatch(over.set_result, clock)
    watch.start()
    await asyncio.sleep(1.0)  # ten beats
    assert not watch.waited
    clock.slept = 3600.0
    assert 3600.0 <= watch.waited < 3600.2
    assert 3600.0 <= await over < 3600.3
    assert watch.waited >= 3600.0  # what arrived meanwhile may still be in a socket
    await asyncio.sleep(DRAIN)
    assert watch.waited == 0.0
    assert watch.stalled == 0.0
    watch.stop()
