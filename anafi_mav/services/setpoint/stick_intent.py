"""Deflections of sticks that a person means, as far as the messages show it. No I/O.

A stick off its middle is meant. The throttle of many joysticks does not return to the middle: where it was in the first
message of a client, it counts as resting.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav.vehicle.manual_flight import Sticks

MEANT = 0.2
"""Share of the way from which a deflection is meant."""

GAP = 5.0
"""s without messages after which the next one shows the throttle at rest: the joystick may be another one."""

MAX_CLIENTS = 8
"""Clients whose throttle is remembered."""


@dataclass
class _Throttle:
    """The throttle of one client."""

    rest: float
    newest: float


class StickIntent:
    """The throttles at rest of all clients."""

    def __init__(self) -> None:
        self._throttles: dict[Hashable, _Throttle] = {}

    def is_meant(self, client: Hashable, sticks: Sticks, now: float) -> bool:
        """Note a client's sticks; return True when a person asks for motion with them."""
        throttle = self._throttles.pop(client, None)
        if throttle is None or now - throttle.newest >= GAP:
            throttle = _Throttle(sticks.climb, now)
        throttle.newest = now
        self._throttles[client] = throttle
        if len(self._throttles) > MAX_CLIENTS:
            del self._throttles[next(iter(self._throttles))]
        is_raised = abs(sticks.climb) >= MEANT and abs(sticks.climb - throttle.rest) >= MEANT
        return is_raised or max(abs(sticks.forward), abs(sticks.right), abs(sticks.turn)) >= MEANT

    def forget(self) -> None:
        """Forget every client's throttle."""
        self._throttles.clear()
