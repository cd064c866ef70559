"""Rule for a client's Hold against a return that the drone begins or announces.

No I/O; time is passed in.

Programs send Hold many times, a person means each of them. So a Hold counts only when its client sent no other in the
5 s before, and an announced return is cancelled only by a second Hold that answers the text about the first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

APART = 5.0
"""s without a Hold of the same client before one that counts."""

ANSWER = 15.0
"""s after the text within which a second Hold cancels the announced return; at least `APART` after it."""

MAX_CLIENTS = 64
"""Clients whose newest Hold is remembered; there are a handful, and an address is easily made up."""


class HoldRule:
    """The Holds of each client, and the announcement that each has answered once."""

    def __init__(self) -> None:
        self._newest: dict[Hashable, float] = {}
        self._offered: dict[Hashable, float] = {}
        """Send time of the text about an announced return, by the client whose Hold it answered."""

    def arrive(self, client: Hashable, now: float) -> bool:
        """Note a Hold, retransmissions included; True when it counts."""
        before = self._newest.pop(client, -math.inf)
        self._newest[client] = now
        if len(self._newest) > MAX_CLIENTS:
            del self._newest[next(iter(self._newest))]
        return now - before >= APART

    def offer(self, client: Hashable, now: float) -> None:
        """Note that this client was notified that another Hold cancels the announced return."""
        self._offered.pop(client, None)
        self._offered[client] = now
        if len(self._offered) > MAX_CLIENTS:
            del self._offered[next(iter(self._offered))]

    def answers(self, client: Hashable, now: float) -> bool:
        """True when a counted Hold of this client, at `now`, cancels the announced return."""
        return APART <= now - self._offered.get(client, -math.inf) <= ANSWER

    def forget_clients(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Forget the Holds of the clients for which `is_gone` returns True."""
        self._newest = {client: at for client, at in self._newest.items() if not is_gone(client)}
        self._offered = {client: at for client, at in self._offered.items() if not is_gone(client)}

    def withdraw(self) -> None:
        """Note that no return is announced: earlier texts do not count for the next announcement."""
        self._offered.clear()
