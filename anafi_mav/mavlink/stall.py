"""Notices that the host stalled, so that messages of that time are dropped.

A stopped or overloaded process finds in its sockets what arrived while it could not read: setpoints of a program that
has ended since, commands whose client waits no longer. They carry no time of their own, and must not be carried out
as if they were new. A command is still handed to its host: a stop is carried out, and others are refused.

A suspended computer stalls, too. The clock of the event loop stands still meanwhile, so that no silence is longer by
it; but what TCP or an access point kept for the computer is as old.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable

from anafi_mav.clock import Clock

BEAT = 0.1
"""s between two signs that the event loop runs."""

KEPT = 600
"""Delays of beats that are kept: one minute."""

STALL = 1.0
"""s without one after which the host counts as stalled."""

DRAIN = 0.3
"""s after a stall within which the sockets are emptied of what arrived meanwhile. It begins again after a late beat."""

LATE = 0.2
"""s without a beat, soon after a stall, in which a busy host has not let the loop empty its sockets."""


APART = 0.05
"""s by which readings of two clocks one after the other may differ: the process may wait in between."""


class StallWatch:
    """Watches one event loop between `start` and `stop`."""

    def __init__(self, on_stall: Callable[[float], None], clock: Clock) -> None:
        """`on_stall` is called with the length of a stall, s, when it is over."""
        self._loop = asyncio.get_running_loop()
        self._on_stall = on_stall
        self._clock = clock
        self._beaten = self._loop.time()
        self._booted = clock.boottime()
        """`Clock.boottime` at the last beat."""
        self._drained = self._beaten
        self.punctual_until = math.inf
        """Time (`Clock.boottime`) before which nothing that is read can have waited for a stall to end."""
        self._stalled_since = self._beaten
        """Time of the last beat before the newest stall; earlier by a suspension since."""
        self._stalled = 0.0
        """s of all stalls that are over, without suspensions."""
        self.delays: deque[float] = deque(maxlen=KEPT)
        """How late the last beats were, s."""
        self._timer: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Begin to watch."""
        self._beaten, self._booted = self._loop.time(), self._clock.boottime()
        self.punctual_until = self._booted + STALL
        self._timer = self._loop.call_later(BEAT, self._beat)

    def stop(self) -> None:
        """Watch no longer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.punctual_until = math.inf

    @property
    def waited(self) -> float:
        """How long what is read from a socket now may have waited there for a stall to end, s.

        0 without a stall.

        An event loop reads its sockets before it runs its timers: the first look after a stall finds no beat.
        """
        now = self._loop.time()
        if self._timer is None:
            return 0.0
        gap = self._clock.boottime() - self._booted
        if gap >= STALL:
            return gap
        is_draining = now < self._drained or (self._beaten < self._drained and now - self._beaten >= LATE)
        return now - self._stalled_since if is_draining else 0.0

    @property
    def stalled(self) -> float:
        """How long the host stalled since the start, s, with a stall that no beat has ended yet.

        By the loop's clock, to which suspensions add nothing.
        """
        gap = self._loop.time() - self._beaten
        return self._stalled + gap if self._timer is not None and gap >= STALL else self._stalled

    def _beat(self) -> None:
        now = self._loop.time()
        before, late = self._beaten, now - self._beaten
        booted, self._booted = self._booted, self._clock.boottime()
        asleep = self._booted - booted - late
        lost = late + asleep if asleep > APART else late
        self.delays.append(max(0.0, late - BEAT))
        self._beaten = now
        self._timer = self._loop.call_later(BEAT, self._beat)
        if lost >= STALL:
            self._stalled_since, self._drained = now - lost, now + DRAIN
            self._stalled += late if late >= STALL else 0.0
            self._on_stall(lost)
        elif before < self._drained and late >= LATE:
            self._drained = now + DRAIN
        self.punctual_until = self._booted + STALL if now >= self._drained else -math.inf
