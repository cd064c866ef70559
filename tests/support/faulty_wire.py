"""A bad link in virtual time: loses, doubles, delays and so reorders datagrams, the same way for the same seed."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass

from anafi_mav.arsdk.link.transport import Event, Transport


@dataclass(frozen=True)
class Faults:
    """Shares are 0..1 per datagram; a delay is drawn from `delay` (s) for each copy, so that copies overtake."""

    loss: float = 0.0
    duplicate: float = 0.0
    delay: tuple[float, float] = (0.001, 0.001)


class FaultyWire:
    """Two transports and the air between them. `heard` collects the events of each."""

    def __init__(self, seed: int, faults: Faults, left: Transport, right: Transport, now: float = 0.0) -> None:
        self.now = now
        self.ends = (left, right)
        self.heard: tuple[list[Event], list[Event]] = ([], [])
        self._random = random.Random(seed)
        self._faults = faults
        self._air: list[tuple[float, int, int, bytes]] = []
        self._count = 0

    def run(self, until: float) -> None:
        """Let time pass."""
        while True:
            for end in (0, 1):
                for datagram in self.ends[end].outgoing(self.now):
                    self._throw(1 - end, datagram)
            times = [deadline for end in self.ends if (deadline := end.deadline()) is not None]
            if self._air:
                times.append(self._air[0][0])
            if not times or min(times) > until:
                self.now = until
                return
            self.now = max(self.now, *[min(times)])
            for end in (0, 1):
                self.heard[end].extend(self.ends[end].expire(self.now))
            while self._air and self._air[0][0] <= self.now:
                _, _, end, datagram = heapq.heappop(self._air)
                self.heard[end].extend(self.ends[end].receive(datagram, self.now))

    def _throw(self, end: int, datagram: bytes) -> None:
        for _ in range(2 if self._random.random() < self._faults.duplicate else 1):
            if self._random.random() >= self._faults.loss:
                self._count += 1
                arrival = self.now + self._random.uniform(*self._faults.delay)
                heapq.heappush(self._air, (arrival, self._count, end, datagram))
