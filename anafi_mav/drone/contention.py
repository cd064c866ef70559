"""Backing off from a second controller that takes the drone: the policy. No I/O.

A drone accepts one controller, and a new handshake ends the session before it. Two controllers that both reconnect
would throw each other out for ever, in the air. A connection that is lost within `SHORT` of its handshake is taken for
that. One that found the drone in the air at its first connection yields after the first such loss, one that has been
connected since before take-off after `PATIENCE`.
"""

from __future__ import annotations

import random
from collections.abc import Callable

SHORT = 5.0
"""s after a handshake within which a loss counts as another controller's handshake."""

PATIENCE = 5
"""Short connections in a row after which the controller that was there before take-off yields."""

YIELD_FIRST, YIELD_LAST = 30.0, 300.0
"""s that a controller which yields stays away: doubled from the first to the last."""

JITTER = 0.2
"""Share by which that time varies either way, so that two gateways do not come back together."""


class Contention:
    """Losses of one drone's connections, and how long to stay away."""

    def __init__(self, chance: Callable[[], float] = random.random) -> None:
        """`chance` returns a number from 0 to 1."""
        self._chance = chance
        self._guest = True
        """The drone flew before it was connected to for the first time, or may have."""
        self._connected = False
        self._short = 0
        self._yields = 0

    def connected(self, airborne: bool) -> None:
        """Note a complete connection to a drone that is in the air, or not."""
        if not self._connected:
            self._connected, self._guest = True, airborne

    def on_ground(self) -> None:
        """Note that the connected drone stands: its next flight begins with this controller."""
        if self._connected:
            self._guest = False

    def lost(self, age: float, *, displaced: bool = True, dismissed: bool = False) -> bool:
        """Note a lost connection; return True when another controller acquired the drone.

        The connection was last heard `age` s after its handshake. `displaced`: it was lost as another handshake would
        end it, and the drone is in reach. One short connection alone may have been bad radio, unless the drone
        `dismissed` us, or was flown by another controller already. A long one ends a row of short ones, however it was
        lost.
        """
        if age > SHORT:
            self._short = self._yields = 0
            return False
        if not displaced:
            return False
        self._short += 1
        return dismissed or self._guest or self._short > 1

    def stay_away(self) -> float | None:
        """Return for how long (s) to leave the drone to the other controller; None: try on."""
        if self._short == 0 or (self._short < PATIENCE and not self._guest and self._yields == 0):
            return None
        pause = min(YIELD_FIRST * 2.0**self._yields, YIELD_LAST)
        self._yields += 1
        return pause * (1.0 + JITTER * (2.0 * self._chance() - 1.0))
