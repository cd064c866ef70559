"""Calls that give way to sockets, by a clock set by hand and iterations as the event loop makes them."""

from __future__ import annotations

from functools import partial

import pytest

from anafi_mav.cli.paced_calls import LONGEST, SHARE, SLICE, PacedCall, PacedCalls


class Iterations:
    """The event loop: sockets are looked at when an iteration begins, and requested runs follow."""

    def __init__(self) -> None:
        self.now = self.looked = 100.0
        self.requested = 0
        """Runs that were requested and not made yet."""
        self.made: list[str] = []
        self.calls = PacedCalls(lambda: self.looked, self._request_run, lambda: self.now)

    def _request_run(self) -> None:
        self.requested += 1

    def call(self, name: str, seconds: float) -> PacedCall:
        """Return a call that takes so long."""
        return partial(self._make, name, seconds)

    def _make(self, name: str, seconds: float) -> None:
        self.made.append(name)
        self.now += seconds

    def fill(self, count: int, seconds: float) -> None:
        """Request calls late in an iteration, so that they wait."""
        self.now = self.looked + SLICE
        for number in range(count):
            self.calls.request(self.call(str(number), seconds))

    def iterate(self, others: float = 0.0) -> list[str]:
        """Look at sockets, spend `others` s on what they brought, and run; return the calls that were made."""
        self.looked = self.now
        self.now += others
        assert self.requested == 1
        self.requested = 0
        self.made.clear()
        self.calls.run()
        return list(self.made)


@pytest.fixture
def loop() -> Iterations:
    return Iterations()


def test_call_early_in_an_iteration_is_made_at_once(loop: Iterations) -> None:
    loop.calls.request(loop.call("a", 0.6 * SLICE))
    loop.calls.request(loop.call("b", 0.6 * SLICE))
    assert (loop.made, loop.requested) == (["a", "b"], 0)


def test_call_late_in_an_iteration_waits_for_a_look_at_the_sockets(loop: Iterations) -> None:
    loop.now += SLICE
    loop.calls.request(loop.call("a", 0.0))
    assert (loop.made, loop.requested) == ([], 1)
    assert loop.iterate() == ["a"]
    assert loop.requested == 0


def test_waiting_calls_share_the_time_of_an_iteration_in_their_sequence(loop: Iterations) -> None:
    """Of calls of 0.3 slices each four begin within a slice; no run ends in the middle of a call."""
    loop.fill(10, 0.3 * SLICE)
    assert loop.iterate() == ["0", "1", "2", "3"]
    assert loop.iterate() == ["4", "5", "6", "7"]
    assert loop.iterate() == ["8", "9"]
    assert loop.requested == 0


def test_call_does_not_overtake_those_that_wait(loop: Iterations) -> None:
    loop.fill(2, SLICE)
    assert loop.iterate() == ["0"]
    loop.looked = loop.now
    loop.calls.request(loop.call("last", 0.0))
    assert loop.made == ["0"]
    assert loop.iterate() == ["1"]
    assert loop.iterate() == ["last"]


def test_busy_iteration_makes_one_call_at_least(loop: Iterations) -> None:
    loop.fill(2, 5 * SLICE)
    assert loop.iterate(others=2 * SLICE) == ["0"]
    assert loop.iterate(others=2 * SLICE) == ["1"]


def test_calls_have_a_third_of_a_fully_used_processor(loop: Iterations) -> None:
    """Sockets and timers take 4 slices of each iteration, waiting calls 2 after it: 20 calls of 0.1 slices."""
    assert SHARE == 0.5
    loop.fill(100, 0.1 * SLICE)
    assert [len(loop.iterate(others=4 * SLICE)) for _ in range(5)] == [20] * 5


def test_iteration_after_a_stall_makes_calls_for_a_bounded_time(loop: Iterations) -> None:
    loop.fill(2000, 0.1 * SLICE)
    assert len(loop.iterate(others=60.0)) == pytest.approx(LONGEST / (0.1 * SLICE), abs=1)


def test_call_requested_twice_is_made_once(loop: Iterations) -> None:
    loop.now += SLICE
    first, second = loop.call("first", 0.0), loop.call("second", 0.0)
    for call in (first, second, first):
        loop.calls.request(call)
    assert loop.iterate() == ["first", "second"]


def test_cancelled_call_is_not_made(loop: Iterations) -> None:
    loop.now += SLICE
    call = loop.call("cancelled", 0.0)
    loop.calls.request(call)
    loop.calls.request(loop.call("other", 0.0))
    loop.calls.cancel(call)
    loop.calls.cancel(call)
    assert loop.iterate() == ["other"]


def test_call_that_cancels_the_next_and_requests_itself_runs_again(loop: Iterations) -> None:
    loop.now += SLICE
    following = loop.call("following", 0.0)

    def call() -> None:
        loop.made.append("call")
        loop.calls.cancel(following)
        if loop.made == ["call"]:
            loop.now += SLICE
            loop.calls.request(call)

    loop.calls.request(call)
    loop.calls.request(following)
    loop.looked, loop.requested = loop.now, 0
    loop.calls.run()
    assert (loop.made, loop.requested) == (["call"], 1)
    loop.looked = loop.now
    loop.calls.run()
    assert loop.made == ["call", "call"]


def test_call_that_raises_costs_no_other_call(loop: Iterations) -> None:
    loop.now += SLICE
    loop.calls.request(lambda: loop.made.append(str(1 // 0)))
    loop.calls.request(loop.call("other", 0.0))
    with pytest.raises(ZeroDivisionError):
        loop.iterate()
    assert loop.iterate() == ["other"]
