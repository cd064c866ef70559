"""Ctrl-C in a command that does not make its own arrangements.

Until a command has begun, Ctrl-C ends the process at once (`anafi_mav.__main__`). A command that has begun may have
something to put away: it gets a KeyboardInterrupt, or its coroutine is cancelled.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import signal
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")


def raise_on_interrupt() -> None:
    """Let SIGINT raise KeyboardInterrupt from now on, unless it is ignored."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def raise_on_termination() -> None:
    """Let SIGTERM raise SystemExit from now on, unless it is ignored or has a handler."""

    def end(number: int, frame: object) -> None:
        raise SystemExit(128 + number)

    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, end)


def listen(callback: Callable[[signal.Signals], object], *names: str) -> None:
    """Call `callback` in the event loop with each signal of these names."""
    loop = asyncio.get_running_loop()
    for name in names:
        number = signal.Signals[name]
        try:
            loop.add_signal_handler(number, callback, number)
        except NotImplementedError:  # Windows
            signal.signal(number, functools.partial(_forward, loop, callback))


def _forward(
    loop: asyncio.AbstractEventLoop, callback: Callable[[signal.Signals], object], number: int, frame: object
) -> None:
    """Pass a signal from Python's handler to the event loop, unless that has ended."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(callback, signal.Signals(number))


def run(work: Coroutine[Any, Any, ResultT]) -> ResultT:
    """Run a coroutine as asyncio.run does; SIGINT and SIGTERM cancel it.

    Once it has ended, raises KeyboardInterrupt then, or SystemExit with the status that shells have for SIGTERM.
    """
    interrupted: signal.Signals | None = None

    async def guarded() -> ResultT:
        task = asyncio.current_task()
        assert task is not None

        def interrupt(number: signal.Signals) -> None:
            nonlocal interrupted
            interrupted = number
            task.cancel()

        loop = asyncio.get_running_loop()
        if terminated is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, functools.partial(_forward, loop, interrupt))
        if before is not signal.SIG_IGN:
            # Not the loop's own way: as it closes it sets Python's handler, which raises wherever the program then is.
            signal.signal(signal.SIGINT, functools.partial(_forward, loop, interrupt))
        return await work

    before, terminated = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError:
        if interrupted == signal.SIGTERM:
            raise SystemExit(128 + signal.SIGTERM) from None
        if interrupted:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGINT, before)
        signal.signal(signal.SIGTERM, terminated)
