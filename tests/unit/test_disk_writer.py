"""Threads for files: order, bounds, and an end that waits for no disk."""

from __future__ import annotations

import asyncio
import sys
import threading

import pytest
from support.hanging_disk import PATIENCE, hanging
from support.product import program

from anafi_mav.disk_writer import DiskWriter

HANG = """
import sys, threading
from anafi_mav.disk_writer import DiskWriter
begun = threading.Event()
writer = DiskWriter("hangs")
writer.submit(lambda: (begun.set(), threading.Event().wait()))
begun.wait()
print(writer.wait(0.01))
"""


async def test_jobs_run_in_their_order_and_return_their_results() -> None:
    writer, seen = DiskWriter("test"), list[int]()
    loop = asyncio.get_running_loop()
    works = [loop.run_in_executor(writer, lambda number=number: seen.append(number) or number) for number in range(50)]
    assert await asyncio.gather(*works) == [*range(50)] == seen
    with pytest.raises(ZeroDivisionError):
        await loop.run_in_executor(writer, lambda: 1 // 0)
    assert await writer.drain(PATIENCE)
    writer.shutdown()


async def test_drain_of_a_writer_that_hangs_returns_false_in_time() -> None:
    writer, seen = DiskWriter("test"), list[int]()
    with hanging(writer):
        behind = writer.submit(seen.append, 1)
        assert not await writer.drain(0.01)
        assert behind.cancel()
    assert await writer.drain(PATIENCE)
    assert seen == []
    writer.shutdown()


def test_post_refuses_a_job_beyond_its_bound() -> None:
    writer = DiskWriter("test", max_waiting=2)
    with hanging(writer):
        assert [writer.post(lambda: None) for _ in range(3)] == [True, True, False]
    assert writer.wait(PATIENCE)
    writer.shutdown()


def test_threads_end_behind_the_last_job() -> None:
    writer, both = DiskWriter("ends", threads=2), threading.Barrier(2)
    works = [writer.submit(both.wait, PATIENCE) for _ in range(2)]
    assert {work.result(PATIENCE) for work in works} == {0, 1}
    threads = [thread for thread in threading.enumerate() if thread.name == "ends"]
    writer.shutdown()
    for thread in threads:
        thread.join(PATIENCE)
    assert [thread.is_alive() for thread in threads] == [False, False]


async def test_program_ends_while_its_disk_hangs() -> None:
    async with program(sys.executable, "-c", HANG) as held:
        assert await held.end() == 0
        assert held.lines == ["False"]
