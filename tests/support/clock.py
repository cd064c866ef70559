"""The clock of tests: nobody waits for a wait, and seconds of a busy machine are seconds that we had.

Gateway, simulator and client of most tests live in one process and one event loop. When none of them has anything to do
before a timer is due, and nothing is on its way between their sockets (the loopback interface delivers what is sent
before `send` returns), then nothing can happen until that timer: the clock is set to it, and the loop goes on at once.
A minute of flight takes as long as its computations do, on any machine, with the timers in the order they are due.

Not counted either is the time in which callbacks were ready to run and did not, because the machine is shared: what
they did not spend on a processor, if they did not wait for anything (the kernel counts voluntary switches), and what
the machine below a virtual one has stolen from its processors meanwhile, which the kernel counts as work of whoever it
was stolen from. So code of ours that computes for too long, sleeps or blocks is as late as it is.

As soon as somebody else is there, a child process or work in a thread, the clock runs like theirs.
"""

from __future__ import annotations

import asyncio
import os
import resource
import selectors
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

INTERRUPTED = 0.0001
"""s of callbacks that are interrupted in the course of things."""

LONG = 0.02
"""s of callbacks after which it is looked whether time was stolen; the kernel counts that in hundredths of a second."""

LOOK_EVERY = 0.25
"""s after which it is looked anyway, so that what is found is of now."""

TICK = 0.01

_real = time.monotonic
_lost = 0.0
"""s that `time.monotonic` is ahead of the clock: negative when more was skipped than lost."""
_newest = 0.0
_began: tuple[float, float, int] | None = None
"""Of the callbacks that are running: the clock's time then, the work done until then, and in which thread."""


def now() -> float:
    """What `time.monotonic` is in tests; never steps back. While callbacks run it is their work that counts."""
    global _newest
    if _began is not None and _began[2] == threading.get_ident() and asyncio._get_running_loop() is not None:
        told = _began[0] + time.thread_time() - _began[1]
    else:
        told = _real() - _lost
    _newest = max(_newest, told)
    return _newest


def stolen() -> list[float]:
    """s that were stolen from each processor; nothing where the system does not tell."""
    try:
        lines = Path("/proc/stat").read_text(encoding="ascii").splitlines()
    except OSError:
        return []
    return [int(line.split()[8]) * TICK for line in lines if line.startswith("cpu") and line[3].isdecimal()]


def childless() -> bool:
    """Whether no process that this one has started is left."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return True
    return False


class Selector(selectors.DefaultSelector):
    """Notes what is lost before it waits, and does not wait when there is nothing to wait for."""

    def __init__(self) -> None:
        super().__init__()
        self._left = self._state()
        self._stolen, self._looked = stolen(), _real()
        self.in_threads = 0
        """Works in threads that the loop waits for."""
        self.processes: list[asyncio.SubprocessTransport] = []
        """Those whose end the loop has not been told of: a thread may have collected it already."""

    @staticmethod
    def _state() -> tuple[float, float, int]:
        return _real(), time.thread_time(), resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw

    def select(self, timeout: float | None = None) -> Any:
        global _lost, _began
        alone = self._alone()
        if alone:
            _lost += self._waited()
        _began = None
        now()  # what waits for a time is not to be early
        here = _real()
        quick = alone and timeout is not None and timeout > 0.0
        ready = self._look() if quick else super().select(timeout)
        self._left = (back, working, _) = self._state()
        if quick and not ready:
            _lost += back - here - timeout
        if alone:
            _began = max(_newest, back - _lost), working, threading.get_ident()
        return ready

    def _waited(self) -> float:
        """s of the callbacks' time that were none of theirs."""
        (left, worked, waited), (here, working, waiting) = self._left, self._state()
        took = here - left
        if waited == waiting:
            took = min(took, working - worked + INTERRUPTED)
        if here - left > LONG or here - self._looked > LOOK_EVERY:
            before, self._stolen, self._looked = self._stolen, stolen(), here
            if here - left > LONG:
                most = max((b - a for a, b in zip(before, self._stolen, strict=True)), default=0.0)
                took = max(0.0, min(took, here - left - most))
        return here - left - took

    def _alone(self) -> bool:
        """Whether nobody but the loop itself can bring anything about."""
        self.processes = [process for process in self.processes if process.get_returncode() is None]
        return not self.in_threads and not self.processes and childless()

    def _look(self) -> Any:
        """What is ready by itself."""
        ready = super().select(0.0)
        if not ready:
            os.sched_yield()  # the kernel delivers from a thread of its own when it has much to deliver
            ready = super().select(0.0)
        return ready


class Loop(asyncio.SelectorEventLoop):
    """Knows its processes and works in threads, whose ends it has to wait for in earnest."""

    def __init__(self) -> None:
        self._waits = Selector()
        super().__init__(self._waits)

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:
        work = super().run_in_executor(executor, func, *args)
        self._waits.in_threads += 1
        work.add_done_callback(self._ended)
        return work

    async def subprocess_exec(self, *args: Any, **options: Any) -> Any:
        transport, protocol = await super().subprocess_exec(*args, **options)
        self._waits.processes.append(transport)
        return transport, protocol

    def _ended(self, work: object) -> None:
        self._waits.in_threads -= 1


def install() -> None:
    """From here on `time.monotonic`, which event loops read, is this clock."""
    time.monotonic = now
