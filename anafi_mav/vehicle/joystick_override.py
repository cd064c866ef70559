"""Detects a joystick that overrides the active flight task, as PX4's COM_RC_OVERRIDE.

No I/O; time is passed in.

The edge counts: a stick that leaves the middle after it has rested there. So a joystick that lies on the table, or is
switched on with a stick at its end, does nothing. The throttle never overrides, since that of many joysticks rests at
its lower end, and after an override it counts only once it has passed the middle.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Hashable
from dataclasses import dataclass

CENTRE = 0.1
"""Share of the way within which a stick counts as centred."""

REST = 0.5
"""s that all three sticks must have rested there."""

GAP = 0.5
"""s between two messages after which the rest begins again.

The sticks' motion between the two is unknown.
"""

MAX_CLIENTS = 8
"""Clients whose sticks are remembered."""


class Override(enum.IntFlag):
    """Bits of COM_RC_OVERRIDE: flight that a joystick may override."""

    AUTO = 1
    """Goto, mission, follow, orbit, and a return or landing that a client commanded."""
    OFFBOARD = 2
    """Setpoints."""


class StickEdge:
    """The sticks of one client."""

    def __init__(self) -> None:
        self._since = math.inf
        """Time at which they came to rest; infinite while they are deflected."""
        self._armed = False
        self._newest = -math.inf

    def moved(self, largest: float, threshold: float, now: float) -> bool:
        """Note the largest deflection of the three sticks; True when it starts a stick override.

        It does so once for each rest of the sticks.
        """
        if now - self._newest > GAP:
            self._since, self._armed = math.inf, False
        self._newest = now
        if largest <= CENTRE:
            self._since = min(self._since, now)
            self._armed = self._armed or now - self._since >= REST
            return False
        self._since = math.inf
        if not self._armed or largest <= threshold:
            return False
        self._armed = False
        return True


@dataclass
class JoystickOverride:
    """The override of one vehicle: its two parameters, and the sticks of each client."""

    sources: Override = Override.AUTO
    threshold: float = 0.3
    """Share of the way beyond which a stick overrides."""

    def __post_init__(self) -> None:
        self._edges: dict[Hashable, StickEdge] = {}
        self._throttle: dict[Hashable, float] = {}
        """Side of a client's throttle when it overrode; absent once it has passed the middle."""

    def moved(self, client: Hashable, largest: float, now: float) -> bool:
        """Note the largest deflection of a client's three sticks; True when it overrides."""
        edge = self._edges.pop(client, None) or StickEdge()
        self._edges[client] = edge
        if len(self._edges) > MAX_CLIENTS:
            del self._edges[next(iter(self._edges))]
        return edge.moved(largest, self.threshold, now)

    def take_over(self, client: Hashable, climb: float) -> None:
        """Note that a client has overridden with its throttle at `climb`."""
        self._throttle.clear()
        if climb:
            self._throttle[client] = math.copysign(1.0, climb)

    def climb(self, client: Hashable, climb: float) -> float:
        """Return a client's throttle; 0 until it has passed the middle after an override."""
        side = self._throttle.get(client)
        if side is None:
            return climb
        if climb * side > 0.0:
            return 0.0
        del self._throttle[client]
        return climb

    def forget(self) -> None:
        """Forget every client's sticks."""
        self._edges.clear()
        self._throttle.clear()
