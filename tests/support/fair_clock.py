"""A clock that stands still while a busy machine lets this process wait: seconds of it are seconds that we had.

Gateway, simulator and client of a test live in one process and one event loop, so they can share a clock. On a machine
that is shared with others a process may not get to run for half a second, and then everything in it is late at once:
setpoints, the watch over their silence, and the test that measures both. What is measured by this clock says something
about our code, whoever else is on the machine.

Not counted is the time in which the loop was ready to run and did not: lateness of the selector beyond its timeout, and
of callbacks what they did not spend on a processor, if they did not wait for anything (the kernel counts voluntary
switches). Nor what the machine below a virtual one has stolen from its processors meanwhile, which the kernel counts as
work of whoever it was stolen from. So code of ours that computes for too long, sleeps or blocks is as late as it is.
"""

from __future__ import annotations

import asyncio
import resource
import selectors
import threading
import time
from pathlib import Path
from typing import Any

LATE = 0.0012
"""s that a selector may be late in the course of things: epoll knows milliseconds."""

INTERRUPTED = 0.0001
"""s of callbacks that are interrupted in the course of things."""

LONG = 0.02
"""s of callbacks after which it is looked whether time was stolen; the kernel counts that in hundredths of a second."""

LOOK_EVERY = 0.25
"""s after which it is looked anyway, so that what is found is of now."""

TICK = 0.01

_real = time.monotonic
_lost = 0.0
_newest = 0.0
_began: tuple[float, float, int] | None = None
"""Of the callbacks that are running: the fair time then, the work done until then, and in which thread."""


def fair() -> float:
    """`time.monotonic` without what was lost; never steps back. While callbacks run it is their work that counts."""
    global _newest
    if _began is not None and _began[2] == threading.get_ident() and asyncio._get_running_loop() is not None:
        now = _began[0] + time.thread_time() - _began[1]
    else:
        now = _real() - _lost
    _newest = max(_newest, now)
    return _newest


def stolen() -> list[float]:
    """s that were stolen from each processor; nothing where the system does not tell."""
    try:
        lines = Path("/proc/stat").read_text(encoding="ascii").splitlines()
    except OSError:
        return []
    return [int(line.split()[8]) * TICK for line in lines if line.startswith("cpu") and line[3].isdecimal()]


class FairSelector(selectors.DefaultSelector):
    """Notes what is lost before and after it waits."""

    def __init__(self) -> None:
        super().__init__()
        self._left = self._state()
        self._stolen, self._looked = stolen(), _real()

    @staticmethod
    def _state() -> tuple[float, float, int]:
        return _real(), time.thread_time(), resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw

    def select(self, timeout: float | None = None) -> Any:
        global _lost, _began
        (left, worked, waited), (now, working, waiting) = self._left, self._state()
        took = now - left
        if waited == waiting:
            took = min(took, working - worked + INTERRUPTED)
        if now - left > LONG or now - self._looked > LOOK_EVERY:
            before, self._stolen, self._looked = self._stolen, stolen(), now
            if now - left > LONG:
                most = max((b - a for a, b in zip(before, self._stolen, strict=True)), default=0.0)
                took = max(0.0, min(took, now - left - most))
        _lost += now - left - took
        _began = None
        fair()  # what waits for a time is not to be early
        ready = super().select(timeout)
        self._left = (back, working, _) = self._state()
        if timeout is not None:
            _lost += max(0.0, back - now - max(timeout, 0.0) - LATE)
        _began = max(_newest, back - _lost), working, threading.get_ident()
        return ready


def fair_loop() -> asyncio.AbstractEventLoop:
    """A loop that notes what is lost."""
    return asyncio.SelectorEventLoop(FairSelector())


def install() -> None:
    """From here on `time.monotonic`, which event loops read, is the fair clock."""
    time.monotonic = fair
