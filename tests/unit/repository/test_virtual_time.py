"""Event loop of recordings: its clock moves to the next timer, and only there."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator

import pytest
from support.virtual_time import LATE, Loop
from support.world import loopback

from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.fleet import TURN


@pytest.fixture
def loop() -> Iterator[Loop]:
    loop = Loop()
    yield loop
    loop.close()


def test_clock_moves_to_the_next_timer_without_waiting(loop: Loop) -> None:
    begun = loop.time()
    loop.run_until_complete(asyncio.sleep(36_000.0))
    assert loop.time() == pytest.approx(begun + 36_000.0 + LATE, abs=1e-7)


def test_clock_stands_still_while_callbacks_compute(loop: Loop) -> None:
    async def compute() -> float:
        begun = loop.time()
        for _ in range(100):
            await asyncio.sleep(0)
        return loop.time() - begun

    assert loop.run_until_complete(compute()) == 0.0


def test_world_timer_precedes_others_of_the_same_instant(loop: Loop) -> None:
    async def time_of_the_world() -> float:
        async with Simulator([DroneSpec(address=loopback())]) as simulator:
            seen = loop.create_future()
            loop.call_at(loop.time() + TURN + TURN, lambda: seen.set_result(simulator.drones[0].time))
            return await seen

    assert loop.run_until_complete(time_of_the_world()) == pytest.approx(2.0 * TURN)
    assert loop.world_timers == 3


def test_datagram_arrives_before_time_moves(loop: Loop) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)

        async def exchange() -> float:
            begun = loop.time()
            reading = loop.create_task(asyncio.wait_for(loop.sock_recv(receiver, 10), 5.0))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.sendto(b"x", receiver.getsockname())
            assert await reading == b"x"
            return loop.time() - begun

        assert loop.run_until_complete(exchange()) == 0.0


def test_work_for_threads_runs_immediately_in_the_own_thread(loop: Loop) -> None:
    async def work() -> int:
        return await loop.run_in_executor(None, threading.get_ident)

    assert loop.run_until_complete(work()) == threading.get_ident()


def test_program_waiting_for_nothing_fails(loop: Loop) -> None:
    async def forever() -> None:
        await loop.create_future()

    with pytest.raises(RuntimeError, match="nothing can bring about"):
        loop.run_until_complete(forever())
