"""The clock of tests: no one waits for a wait, and how busy the machine is makes no difference.

Gateway, simulator and client of most tests live in one process and one event loop. When none of them has anything to do
before a timer is due, and nothing is on its way between their sockets (the loopback interface delivers what is sent
before `send` returns), then nothing can happen until that timer: the clock is set to it, and the loop goes on at once.
A minute of flight takes as long as its computations do, on any machine, with the timers in the order they are due.

While callbacks run the clock goes on by a microsecond with each look at it: no two moments are the same, computing
takes no time, and a busy machine that lets callbacks wait changes nothing.
How long one turn of callbacks computed at most, which every timer has to wait for in earnest, can be asked for
(`turns`): it is processor time of this thread. What latencies that makes is for tests/bench/ to say, and that nothing
of ours blocks a loop in other ways for ruff.

As soon as another client is there, a child process, work in a thread or a timer of the kernel's, the clock runs like
theirs; with threads, or beside child processes that only react (`only_reacts`), like a router, only while the loop
waits, and never past the timer that it waits for: they have no timers, and a busy machine must not look like a host
that stalled.
"""

from __future__ import annotations

import asyncio
import gc
import math
import os
import selectors
import socket
import subprocess
import sys
import time
from asyncio import _get_running_loop
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from threading import get_ident
from typing import Any

STEP = 1e-6
"""s between two looks at the clock while callbacks run."""

_real = time.monotonic
_ahead = 0.0
"""s that the clock is ahead of `time.monotonic` when nothing of this process runs; negative when it is behind."""
_newest = 0.0
_computing: int | None = None
"""Identity of the thread whose loop runs callbacks, while no other process or thread can change anything."""
_may_have_children = True
"""False from when no child process was left until the next one is started."""
_groups: set[int] = set()
"""Process groups beside our own that children are in."""


def now() -> float:
    """What `time.monotonic` is in tests; never steps back."""
    global _newest
    if _computing is not None and _computing == get_ident() and _get_running_loop() is not None:
        _newest += STEP
    else:
        _newest = max(_newest, _real() + _ahead)
    return _newest


def _reading(real: Callable[[int], float], clock: int) -> float:
    """What `time.clock_gettime` is in tests: the computer is not suspended."""
    return now() if clock == time.CLOCK_BOOTTIME else real(clock)


def childless() -> bool:
    """Whether no process that this one has started is left, in its own process group and in those of `_groups`."""
    global _may_have_children
    if not _may_have_children:
        return True
    for group in (os.getpgrp(), *_groups):
        try:
            os.waitid(os.P_PGID, group, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        except ChildProcessError:
            _groups.discard(group)
        else:
            return False
    _may_have_children = False
    return True


def note_child(group: int | None = None) -> None:
    """A process is started: from now on the kernel is asked whether it is left; in a process group of its own here."""
    global _may_have_children
    _may_have_children = True
    if group is not None:
        _groups.add(group)


class Turns:
    """How long a loop computes between two looks at its sockets and timers: so long everything else has to wait."""

    def __init__(self) -> None:
        self.longest = 0.0
        """s of processor time of this thread: what the machine takes away, as far as it says so, is not in it."""
        self._began = time.thread_time()

    def begin(self) -> None:
        self._began = time.thread_time()

    def end(self) -> None:
        self.longest = max(self.longest, time.thread_time() - self._began)


class Stalls:
    """How long the machine kept this loop from running at once: what it computed itself is not in it."""

    LOOK = 0.02
    """s between two looks."""

    def __init__(self) -> None:
        self.longest = 0.0
        """s."""

    async def look(self) -> None:
        """Measure until cancelled."""
        while True:
            began, worked = now(), time.thread_time()
            await asyncio.sleep(self.LOOK)
            late = now() - began - self.LOOK
            self.longest = max(self.longest, late - (time.thread_time() - worked))


@asynccontextmanager
async def stalls() -> AsyncIterator[Stalls]:
    """Measure within the block what another process on the machine costs where the clock runs like its own."""
    found = Stalls()
    task = asyncio.get_running_loop().create_task(found.look())
    try:
        yield found
    finally:
        task.cancel()


class Barrier:
    """Waits until the kernel has delivered what this process sent before.

    It delivers from a thread of its own when it has much to deliver, in the order in which it was sent: a datagram to
    ourselves arrives last. (`sched_yield` promises nothing, and on a busy machine costs this process its turn.)
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.connect(self._socket.getsockname())  # blocking, without a limit of Python's: that polls each time

    def wait(self) -> None:
        self._socket.send(b"\0")
        self._socket.recv(1)

    def close(self) -> None:
        self._socket.close()


class Selector(selectors.DefaultSelector):
    """Does not wait when there is nothing to wait for."""

    def __init__(self) -> None:
        super().__init__()
        self.in_threads = 0
        """Works in threads that the loop waits for."""
        self.others = 0
        """Who else can bring something about, as the test has said."""
        self.processes: list[asyncio.SubprocessTransport] = []
        """Those of whose end the loop has no report: a thread may have collected it already."""
        self.reactive: list[asyncio.SubprocessTransport] = []
        """Those among them that only react to what they receive, as the test has said."""
        self.turns: Turns | None = None
        """Measured within a block of `turns` only: the kernel takes 1 us to report the processor time of a thread."""
        self._barrier = Barrier()

    def select(self, timeout: float | None = None) -> Any:
        if self.turns is None:
            return self._select(timeout)
        self.turns.end()
        ready = self._select(timeout)
        self.turns.begin()
        return ready

    def _select(self, timeout: float | None) -> Any:
        global _ahead, _newest, _computing
        is_alone = timeout is not None and self._alone()
        if not (is_alone or self._only_threads() or self._only_reactive()):
            self._stop_computing()
            return super().select(timeout)
        here = self._stop_computing()
        ready = super().select(0.0)
        if not ready and (timeout is None or timeout > 0.0):
            # What waits behind callbacks that are ready need not be seen before them.
            self._barrier.wait()
            ready = super().select(0.0)
            if not ready:
                if not is_alone:
                    ready = super().select(timeout)
                waited = math.inf if is_alone else now() - here
                here += waited if timeout is None else min(waited, timeout)
        _ahead, _newest = here - _real(), max(_newest, here)
        _computing = get_ident()
        return ready

    def _stop_computing(self) -> float:
        """From now on the clock runs again; returns the time."""
        global _ahead, _computing
        if _computing is not None:
            _ahead = now() - _real()
            _computing = None
        return now()

    def _alone(self) -> bool:
        """Whether no one but the loop itself can bring anything about."""
        if self.processes:
            self.processes = [process for process in self.processes if process.get_returncode() is None]
        return not (self.in_threads or self.others or self.processes) and childless()

    def _only_threads(self) -> bool:
        """Whether the loop waits for threads of this process alone, which have no clock of their own."""
        return bool(self.in_threads) and not (self.others or self.processes) and childless()

    def _only_reactive(self) -> bool:
        """Whether the loop's processes all only react: how long the machine lets this one wait is then of no matter."""
        return bool(self.processes) and not self.others and all(one in self.reactive for one in self.processes)

    def close(self) -> None:
        self._barrier.close()
        super().close()


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


def _selector() -> Selector:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, Loop)
    return loop.waits


@contextmanager
def everybodys() -> Iterator[None]:
    """Within the block the clock runs like everybody's: for what the kernel does by timers of its own."""
    selector = _selector()
    selector.others += 1
    try:
        yield
    finally:
        selector.others -= 1


def only_reacts(process: asyncio.subprocess.Process) -> None:
    """A process of the test's has no clock that matters: beside such ones alone the loop's clock waits for the loop.

    On a busy machine the loop then neither oversleeps nor computes for long, so that no message ages by that.
    """
    loop = asyncio.get_running_loop()
    if not isinstance(loop, Loop):
        return  # everybody's clock
    selector = loop.waits
    selector.reactive += [one for one in selector.processes if one.get_pid() == process.pid]


@contextmanager
def turns() -> Iterator[Turns]:
    """The turns that end within the block.

    The garbage collector rests meanwhile: it would look through every message that a client of the tests has kept, and
    through what all tests before have left. The product's own heap is in the figures of tests/bench/heartbeat.py.
    """
    selector = _selector()
    selector.turns = asked = Turns()
    gc.disable()
    try:
        yield asked
        asked.end()
    finally:
        selector.turns = None
        gc.enable()


def install() -> None:
    """From here on `time.monotonic`, which event loops read, is this clock."""
    time.monotonic = now
    if sys.platform == "linux":  # elsewhere `SystemClock` has no such clock
        time.clock_gettime = partial(_reading, time.clock_gettime)
    os.register_at_fork(after_in_parent=note_child)
    start = subprocess.Popen.__init__

    def noted_start(self: Any, *args: Any, **options: Any) -> None:
        try:
            start(self, *args, **options)
        finally:
            note_child()

    subprocess.Popen.__init__ = noted_start
