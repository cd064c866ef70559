"""Event loop for recordings: virtual time that depends on the program alone, never on the machine.

The clock of `support.clock` still runs at a hundredth of its pace while callbacks compute. Here it stands still: it
moves only when nothing is ready and nothing is on its way between sockets, and then to the next timer. Two runs of the
same program therefore have the same times, to the last bit. What else could differ from run to run is fixed as well:

- Work for threads runs at once in the loop's own thread.
- Before the loop looks at its sockets, a datagram travels through the loopback device. The process runs on one core,
  whose queue keeps the order: when the datagram has arrived, everything sent before it has arrived too.
- A timer of the simulator's world is due exactly; every other timer is due `LATE` s later. Both kinds fall on the same
  instants otherwise (0.1 s is a whole number of steps), and what happens first would depend on rounding.
"""

from __future__ import annotations

import asyncio
import os
import random
import selectors
import socket
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from anafi_mav.sim import Simulator

START = 1000.0
"""s: the monotonic clock at the start."""

EPOCH = 1_767_268_800.25
"""s since 1970 at the start of the monotonic clock: noon of the first of January 2026, UTC, and a bit."""

LATE = 5e-7
"""s that a timer is later than asked for, unless it is the world's."""

PROBES = 3
"""Datagrams that travel before time moves: SYN, SYN-ACK and ACK each need the one before."""

_now = START


def is_worlds(callback: Callable[..., object]) -> bool:
    """Whether a timer is the one that moves the drones of a simulator."""
    return isinstance(getattr(callback, "__self__", None), Simulator)


def now() -> float:
    """The time, in place of `time.monotonic`."""
    return _now


def _reading(real: Callable[[int], float], clock: int) -> float:
    """What `time.clock_gettime` is in tests: the computer is not suspended."""
    return _now if clock == time.CLOCK_BOOTTIME else real(clock)


def now_of_day() -> float:
    """The time, in place of `time.time`."""
    return EPOCH + (_now - START)


class Selector(selectors.DefaultSelector):
    """Moves the clock instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self._receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._receiver.bind(("127.0.0.1", 0))
        self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sender.connect(self._receiver.getsockname())

    def select(self, timeout: float | None = None) -> Any:
        global _now
        self._settle()
        ready = super().select(0.0)
        if ready or (timeout is not None and timeout <= 0.0):
            return ready
        for _ in range(PROBES - 1):
            self._settle()
        ready = super().select(0.0)
        if ready:
            return ready
        if timeout is None:
            raise RuntimeError("the program waits for something that nothing can bring about")
        _now += timeout
        return ready

    def _settle(self) -> None:
        """Let everything arrive that was sent before."""
        self._sender.send(b".")
        self._receiver.recv(1)

    def close(self) -> None:
        self._sender.close()
        self._receiver.close()
        super().close()


class Loop(asyncio.SelectorEventLoop):
    """Event loop with the clock of this module."""

    def __init__(self) -> None:
        super().__init__(Selector())
        self.world_timers = 0
        """Timers that were recognised as the world's."""

    def time(self) -> float:
        return _now

    def call_at(self, when: float, callback: Callable[..., object], *args: Any, context: Any = None) -> Any:
        if is_worlds(callback):
            self.world_timers += 1
        else:
            when += LATE
        return super().call_at(when, callback, *args, context=context)

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:
        work = self.create_future()
        try:
            work.set_result(func(*args))
        except Exception as error:
            work.set_exception(error)
        return work


def install(seed: int) -> None:
    """Use this clock in the whole process from here on, and fix what else differs from run to run."""
    global _now
    _now = START
    time.monotonic = now
    if sys.platform == "linux":  # elsewhere `SystemClock` has no such clock
        time.clock_gettime = partial(_reading, time.clock_gettime)
    time.time = now_of_day
    os.environ["TZ"] = "UTC"
    time.tzset()
    random.seed(seed)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
