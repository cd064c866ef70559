"""Limit of what an address gets before it has proved to be there. No I/O.

The sender's address of a UDP datagram is easily forged: a gateway that answered one heartbeat with the telemetry of a
fleet would flood the address that is named as its sender. Until the proof an address gets heartbeats and answers, and
at most ten times the bytes that it has sent, those around the frames included.
"""

from __future__ import annotations

import random
from collections import OrderedDict, deque
from collections.abc import Hashable, Iterator

from anafi_mav.mavlink.frames import FRAME_BYTES, Packed

FACTOR = 10
"""Bytes that leave for each byte of valid datagrams: ten heartbeats for a station's one."""

DATAGRAM = 28
"""Bytes around a datagram's payload: 20 of IPv4 and 8 of UDP. Without them ten times a long frame would be many short
datagrams, and more than ten times on the wire."""

PROOF_DATAGRAMS, PROOF_WINDOW = 3, 10.0
"""The third datagram with a valid frame within so many seconds is the proof: a station sends one a second, and a forger
has to send as many to each address that it wants to flood."""

INTRODUCE_EVERY = 1.0
"""s, on average, after which an address that a signed endpoint refuses may get a heartbeat again."""

MAX_INTRODUCED = 100
"""Addresses that get one in that time: a heartbeat has 34 bytes, so forged addresses draw 3.4 kB/s in all."""


class AddressProof:
    """One address without proof.

    Heartbeats leave in turn over the systems, and are renewed by each datagram.
    """

    def __init__(self) -> None:
        self._arrivals: deque[float] = deque(maxlen=PROOF_DATAGRAMS)
        self._left = 0
        """Bytes that may leave."""
        self._shows_systems = False
        """It has sent a frame to no particular system."""
        self._may_answer = False
        """It has sent a frame to a particular system."""
        self._waiting: OrderedDict[tuple[int, int], Packed] = OrderedDict()
        """The newest heartbeat of each component that waits for its turn."""

    def received(self, size: int, *, addressed: bool, broadcast: bool, now: float) -> bool:
        """Count a datagram with valid frames; return True when it is the proof.

        `size`: bytes of its frames; `addressed`, `broadcast`: they are for one system, or for all.
        """
        self._arrivals.append(now)
        self._left += FACTOR * (size + DATAGRAM)
        self._may_answer |= addressed
        self._shows_systems |= broadcast
        return len(self._arrivals) == PROOF_DATAGRAMS and now - self._arrivals[0] <= PROOF_WINDOW

    def answer(self, size: int) -> bool:
        """Return True if an answer of this size may leave in a datagram; it then counts as sent."""
        return self._may_answer and self._spend(size)

    def heartbeat(self, source: tuple[int, int], packed: Packed) -> None:
        """Let a heartbeat wait for its turn, in place of an older one of the same component."""
        self._waiting[source] = packed

    def heartbeats(self) -> Iterator[tuple[tuple[int, int], Packed]]:
        """Yield the heartbeats that may leave now; they count as sent."""
        while self._shows_systems and self._waiting:
            source, packed = next(iter(self._waiting.items()))
            if not self._spend(len(packed.payload) + FRAME_BYTES):
                return
            del self._waiting[source]
            yield source, packed

    def _spend(self, size: int) -> bool:
        if size + DATAGRAM > self._left:
            return False
        self._left -= size + DATAGRAM
        return True


class Introductions:
    """Which addresses that a signed endpoint refuses get its heartbeat."""

    def __init__(self) -> None:
        self._introduced: set[Hashable] = set()
        self._until = 0.0

    def allow(self, address: Hashable, now: float) -> bool:
        """Return True if this address may get a heartbeat now.

        It then counts as introduced for a moment.
        """
        if now >= self._until:
            # Not in step with a station's heartbeats: a flood at the beginning then takes no turn of it for ever.
            self._until = now + INTRODUCE_EVERY * random.uniform(0.5, 1.5)
            self._introduced.clear()
        if address in self._introduced or len(self._introduced) >= MAX_INTRODUCED:
            return False
        self._introduced.add(address)
        return True
