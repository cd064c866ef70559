"""How often the gateway's event loop looks at its sockets, by a clock set by hand."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Iterator

import pytest

from anafi_mav.cli.event_loop import BUSY, PAUSE, WINDOW, PacedSelector


class Moment:
    """A clock that is set by hand, and by sleeping."""

    def __init__(self) -> None:
        self.now = 100.0
        self.slept: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def moment() -> Moment:
    return Moment()


@pytest.fixture
def selector(moment: Moment) -> Iterator[PacedSelector]:
    """A selector with one socket that always has data."""
    ours, theirs = socket.socketpair()
    with PacedSelector(moment.monotonic, moment.sleep) as selector, ours, theirs:
        theirs.send(b"data")
        selector.register(ours, selectors.EVENT_READ)
        yield selector


def make_busy(selector: PacedSelector, moment: Moment) -> None:
    """Let the sockets be busy for a window, and begin the next one."""
    selector.select(0)
    moment.now += WINDOW
    for _ in range(BUSY + 1):
        selector.select(0)
    moment.now += WINDOW
    selector.select(0)


def test_few_sockets_with_data_are_never_waited_for(selector: PacedSelector, moment: Moment) -> None:
    for _ in range(20):
        assert len(selector.select(None)) == 1
        moment.now += WINDOW / 10
    assert moment.slept == []


def test_busy_sockets_are_looked_at_once_in_a_pause(selector: PacedSelector, moment: Moment) -> None:
    make_busy(selector, moment)
    assert selector.select(0) == []
    moment.now += PAUSE / 4
    assert len(selector.select(None)) == 1
    assert moment.slept == [pytest.approx(PAUSE * 3 / 4)]
    moment.now += PAUSE
    assert len(selector.select(None)) == 1
    assert len(moment.slept) == 1


def test_timer_within_a_pause_is_not_late(selector: PacedSelector, moment: Moment) -> None:
    make_busy(selector, moment)
    assert selector.select(PAUSE / 2) == []
    assert moment.slept == [PAUSE / 2]


def test_sockets_that_are_no_longer_busy_are_looked_at_at_once(selector: PacedSelector, moment: Moment) -> None:
    make_busy(selector, moment)
    moment.now += WINDOW
    selector.select(None)
    assert len(selector.select(None)) == 1
    assert moment.slept == []
