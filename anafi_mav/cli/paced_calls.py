"""Calls that wait until sockets have been looked at. No I/O.

A hundred drones have a hundred timers, of a third of a second and less. asyncio calls all that are due before it looks
at a socket: after a busy moment a client's setpoint waited for sixty of them, thirty milliseconds. Calls that may wait
share a short time of each event-loop iteration instead. Those that do not fit are first in the next iteration.
"""

from __future__ import annotations

from collections.abc import Callable

SLICE = 0.001
"""s after a look at the sockets for which such calls are made. The last of them may take longer."""

SHARE = 0.5
"""Time for waiting calls, as a share of the time since the last of them: a third of a processor that is fully used."""

LONGEST = 0.01
"""s of such calls in an iteration at most, also after a stall of the host."""

PacedCall = Callable[[], None]


class PacedCalls:
    """Makes calls in the sequence in which they were requested."""

    def __init__(
        self, looked: Callable[[], float], request_run: Callable[[], None], monotonic: Callable[[], float]
    ) -> None:
        """`looked` returns when sockets were looked at last (s, monotonic).

        `request_run` requests one call of `run`, after the next look and after the timers that are due then.
        """
        self._looked = looked
        self._request_run = request_run
        self._monotonic = monotonic
        self._waiting: dict[PacedCall, None] = {}
        """In the sequence of their requests."""
        self._will_run = False
        """True while a call of `run` is requested or made."""
        self._since = 0.0
        """When calls began to wait, or when the last one was made (s, monotonic)."""

    def __len__(self) -> int:
        """Return how many calls wait."""
        return len(self._waiting)

    def request(self, call: PacedCall) -> None:
        """Make this call, at once or in a later iteration.

        It is made at once if no other waits and the time of this iteration is not over. A call that waits already
        keeps its place.
        """
        if self._will_run:
            self._waiting.setdefault(call)
            return
        now = self._monotonic()
        if now < self._looked() + SLICE:
            call()
            return
        self._since = now
        self._waiting[call] = None
        self._will_run = True
        self._request_run()

    def cancel(self, call: PacedCall) -> None:
        """Do not make this call."""
        self._waiting.pop(call, None)

    def run(self) -> None:
        """Make waiting calls, at least one, until their time is over."""
        now = self._monotonic()
        end = max(self._looked() + SLICE, now + min(SHARE * (now - self._since), LONGEST))
        try:
            while self._waiting:
                call = next(iter(self._waiting))
                del self._waiting[call]
                call()
                now = self._monotonic()
                if now >= end:
                    break
        finally:  # an exception is reported by the event loop, and costs no other call
            self._since = now
            self._will_run = bool(self._waiting)
            if self._waiting:
                self._request_run()
