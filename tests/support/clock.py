"""The clock of tests: nobody waits for a wait, and seconds of a busy machine are seconds that we had.

Gateway, simulator and client of most tests live in one process and one event loop. When none of them has anything to do
before a timer is due, and nothing is on its way between their sockets (the loopback interface delivers what is sent
before `send` returns), then nothing can happen until that timer: the clock is set to it, and the loop goes on at once.
A minute of flight takes as long as its computations do, on any machine, with the timers in the order they are due.

Not counted either is the time in which callbacks were ready to run and did not, because the machine is shared: what
they waited for a processor, and what the machine below a virtual one has stolen from its processors meanwhile, which
the kernel counts as work of whoever it was stolen from. Code of ours that computes for long, sleeps or blocks is as
late as it is; how much many short works come to is for tests/bench/ to say.

As soon as somebody else is there, a child process, work in a thread or a timer of the kernel's, the clock runs like
theirs.
"""

from __future__ import annotations

import asyncio
import os
import selectors
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

INTERRUPTED = 0.0001
"""s of callbacks that are interrupted in the course of things."""

LONG = 0.02
"""s of callbacks that work for long: all that is beyond counts, and it is looked whether time was stolen. The kernel
counts that in hundredths of a second, so of less it cannot be known."""

SHARE = 0.1
"""What counts of shorter work: from one moment to the next a shared machine can be so much slower. Some does count,
so that no two moments are the same."""

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
        told = _began[0] + counted(time.thread_time() - _began[1])
    else:
        told = _real() - _lost
    _newest = max(_newest, told)
    return _newest


def queued() -> float:
    """s that this thread was ready to run and did not, because others ran; 0 where the system does not tell."""
    try:
        return int(Path("/proc/thread-self/schedstat").read_bytes().split()[1]) * 1e-9
    except OSError:
        return 0.0


def counted(work: float) -> float:
    """How many s so much work is on the clock."""
    return SHARE * min(max(work, 0.0), LONG) + max(work - LONG, 0.0)


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
        self._queued, self._stolen, self._looked = queued(), stolen(), _real()
        self.in_threads = 0
        """Works in threads that the loop waits for."""
        self.others = 0
        """Who else can bring something about, as the test has said."""
        self.processes: list[asyncio.SubprocessTransport] = []
        """Those whose end the loop has not been told of: a thread may have collected it already."""

    @staticmethod
    def _state() -> tuple[float, float]:
        return _real(), time.thread_time()

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
        self._left = (back, working) = self._state()
        if alone and timeout is not None:
            _lost += back - here - (timeout if quick and not ready else 0.0)
        if alone:
            _began = max(_newest, back - _lost), working, threading.get_ident()
        return ready

    def _waited(self) -> float:
        """s of the callbacks' time that do not count."""
        (left, worked), (here, working) = self._left, self._state()
        work = working - worked
        idle = max(0.0, here - left - work)
        if idle > INTERRUPTED:
            before, self._queued = self._queued, queued()
            idle = max(0.0, idle - (self._queued - before))
        if here - left > LONG or here - self._looked > LOOK_EVERY:
            earlier, self._stolen, self._looked = self._stolen, stolen(), here
            if here - left > LONG:
                work -= max((b - a for a, b in zip(earlier, self._stolen, strict=True)), default=0.0)
        return here - left - idle - counted(work)

    def _alone(self) -> bool:
        """Whether nobody but the loop itself can bring anything about."""
        self.processes = [process for process in self.processes if process.get_returncode() is None]
        return not (self.in_threads or self.others or self.processes) and childless()

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
        self.waits = Selector()
        super().__init__(self.waits)

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:
        work = super().run_in_executor(executor, func, *args)
        self.waits.in_threads += 1
        work.add_done_callback(self._ended)
        return work

    async def subprocess_exec(self, *args: Any, **options: Any) -> Any:
        transport, protocol = await super().subprocess_exec(*args, **options)
        self.waits.processes.append(transport)
        return transport, protocol

    def _ended(self, work: object) -> None:
        self.waits.in_threads -= 1


@contextmanager
def everybodys() -> Iterator[None]:
    """Within the block the clock runs like everybody's: for what the kernel does by timers of its own."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, Loop)
    loop.waits.others += 1
    try:
        yield
    finally:
        loop.waits.others -= 1


def install() -> None:
    """From here on `time.monotonic`, which event loops read, is this clock."""
    time.monotonic = now
