"""The one timer: it calls once, at the time that was set last."""

from __future__ import annotations

import asyncio

from anafi_mav.clock import Alarm


async def test_alarm_calls_once_at_its_time() -> None:
    loop, called = asyncio.get_running_loop(), []
    alarm = Alarm(lambda: called.append(loop.time()))
    start = loop.time()
    alarm.set(start + 3.0)
    assert alarm.at == start + 3.0
    await asyncio.sleep(20.0)
    assert alarm.at is None
    assert len(called) == 1
    assert start + 3.0 <= called[0] < start + 20.0


async def test_alarm_set_twice_calls_at_the_newer_time_only() -> None:
    loop, called = asyncio.get_running_loop(), []
    alarm = Alarm(lambda: called.append(loop.time()))
    start = loop.time()
    alarm.set_in(1.0)
    alarm.set_in(5.0)
    await asyncio.sleep(20.0)
    assert len(called) == 1
    assert called[0] >= start + 5.0


async def test_alarm_for_a_past_time_calls_soon() -> None:
    called = asyncio.Event()
    alarm = Alarm(called.set)
    alarm.set(asyncio.get_running_loop().time() - 10.0)
    assert not called.is_set()  # never from within `set`
    await asyncio.wait_for(called.wait(), 5.0)


async def test_cancelled_alarm_does_not_call() -> None:
    called: list[int] = []
    alarm = Alarm(lambda: called.append(1))
    alarm.cancel()
    alarm.set_in(1.0)
    alarm.cancel()
    alarm.cancel()
    await asyncio.sleep(5.0)
    assert called == []
    assert alarm.at is None


async def test_alarm_may_be_set_again_by_its_callback() -> None:
    times: list[float] = []

    def call() -> None:
        assert alarm.at is None
        times.append(asyncio.get_running_loop().time())
        if len(times) < 3:
            alarm.set_in(1.0)

    alarm = Alarm(call)
    alarm.set_in(1.0)
    await asyncio.sleep(20.0)
    assert len(times) == 3
    assert alarm.at is None
