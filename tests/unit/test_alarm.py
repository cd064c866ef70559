"""The one timer calls once, at the time that was set last; a schedule knows what is due next."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from anafi_mav.clock import NEVER, Alarm, Schedule, YieldingCall


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


class HeldLoop:
    """An event loop that lets calls wait for ever, or until `held` is called."""

    def __init__(self) -> None:
        self.held: dict[Callable[[], None], None] = {}

    def call_after_clients(self, call: Callable[[], None]) -> None:
        self.held[call] = None

    def cancel_after_clients(self, call: Callable[[], None]) -> None:
        self.held.pop(call, None)


async def test_turn_is_at_once_where_the_event_loop_has_no_turns() -> None:
    called: list[int] = []
    turn = YieldingCall(lambda: called.append(1))
    turn.cancel()
    turn.request()
    assert called == [1]
    turn.cancel()


async def test_turn_is_left_to_an_event_loop_that_has_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, held, called = asyncio.get_running_loop(), HeldLoop(), []
    monkeypatch.setattr(loop, "call_after_clients", held.call_after_clients, raising=False)
    monkeypatch.setattr(loop, "cancel_after_clients", held.cancel_after_clients, raising=False)
    turn = YieldingCall(lambda: called.append(1))
    turn.request()
    turn.request()
    assert called == []
    (call,) = held.held
    call()
    assert called == [1]
    turn.cancel()
    assert held.held == {}


def called(schedule: Schedule[str], now: float, again: dict[str, float]) -> list[str]:
    """Run a schedule; return the keys that were due. `again`: when each is due next."""
    keys: list[str] = []

    def call(key: str) -> float:
        keys.append(key)
        return again.get(key, NEVER)

    schedule.run(now, call)
    return keys


def test_schedule_calls_each_key_when_it_is_due_again() -> None:
    schedule = Schedule(["fast", "slow", "idle"])
    assert schedule.next == NEVER
    assert schedule.bring_forward(10.0)
    assert called(schedule, 10.0, {"fast": 11.0, "slow": 15.0}) == ["fast", "slow", "idle"]
    assert schedule.next == 11.0
    assert called(schedule, 10.9, {}) == []
    assert called(schedule, 11.0, {"fast": 12.0}) == ["fast"]
    assert called(schedule, 15.0, {"fast": 16.0}) == ["fast", "slow"]
    assert schedule.next == 16.0


def test_schedule_brought_forward_calls_all_keys_once() -> None:
    schedule = Schedule(["one", "other"])
    schedule.bring_forward(1.0)
    called(schedule, 1.0, {"one": 5.0})
    assert schedule.bring_forward(3.0)
    assert not schedule.bring_forward(4.0)
    assert schedule.next == 3.0
    assert called(schedule, 2.9, {}) == []
    assert called(schedule, 3.0, {"one": 5.0}) == ["one", "other"]
    assert called(schedule, 4.0, {}) == []
    assert schedule.next == 5.0


def test_schedule_brought_forward_by_a_call_calls_again() -> None:
    """A look of one key may be the cause of another one's."""
    schedule = Schedule(["one"])
    schedule.bring_forward(0.0)

    def call(key: str) -> float:
        schedule.bring_forward(0.1)
        return NEVER

    schedule.run(0.0, call)
    assert schedule.next == 0.1
