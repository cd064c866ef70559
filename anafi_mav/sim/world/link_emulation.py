"""Radio link between a controller and a simulated drone: faults of datagrams on their way.

Configured by `faults.Impairment`.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from anafi_mav.sim.world.faults import CLEAR, Faults, Impairment

HELD = 0.1
"""s at most that a datagram waits for the next one to overtake it."""

MAX_UNDER_WAY = 2000
"""Datagrams on their way at a time; a delay of 10 s at 200 of them a second. More are lost."""

Deliver = Callable[[bytes], None]


class LinkEmulation:
    """Both directions of one drone's link.

    `later(seconds, function)` calls a function after a while.
    """

    def __init__(
        self, faults: Faults, chance: random.Random, later: Callable[[float, Callable[[], None]], Any]
    ) -> None:
        self._faults = faults
        self._chance = chance
        self._later = later
        self._held: dict[bool, Callable[[], None]] = {}
        self._under_way = 0

    def __call__(self, data: bytes, inbound: bool, deliver: Deliver) -> None:
        """Hand a datagram on: at once, later, twice or never. `inbound`: towards the drone."""
        faults = self._faults
        impairment = faults.up if inbound else faults.down
        held = self._held.pop(inbound, None)
        if impairment is CLEAR or impairment.clear:
            deliver(data)
        elif self._chance.random() >= impairment.loss:
            copies = 2 if self._chance.random() < impairment.duplicate else 1
            for _ in range(copies):
                self._send(data, inbound, deliver, impairment, may_wait=held is None)
        if held is not None:
            held()

    def _send(self, data: bytes, inbound: bool, deliver: Deliver, impairment: Impairment, *, may_wait: bool) -> None:
        delay = impairment.delay + self._chance.random() * impairment.jitter
        # What overtakes another does not wait itself.
        if self._chance.random() < impairment.reorder and may_wait and inbound not in self._held:
            self._hold(data, inbound, deliver, delay)
        else:
            self._after(delay, lambda: deliver(data))

    def _hold(self, data: bytes, inbound: bool, deliver: Deliver, delay: float) -> None:
        def release() -> None:
            if self._held.get(inbound) is release:
                del self._held[inbound]
            if not released:
                released.append(True)
                self._after(delay, lambda: deliver(data))

        released: list[bool] = []
        self._held[inbound] = release
        self._after(HELD, release)

    def _after(self, delay: float, function: Callable[[], None]) -> None:
        if delay <= 0.0:
            function()
        elif self._under_way < MAX_UNDER_WAY:
            self._under_way += 1
            self._later(delay, lambda: self._arrive(function))

    def _arrive(self, function: Callable[[], None]) -> None:
        self._under_way -= 1
        function()
