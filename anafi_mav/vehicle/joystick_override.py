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


@dataclass(frozen=True)
class StickEdge:
    """The sticks of one client."""

    newest: float
    since: float = math.inf
    """Time at which they came to rest; infinite while they are deflected."""
    armed: bool = False
    """They have rested for long enough, and have not overridden since."""


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
        """Note the largest deflection of a client's three sticks; True when it overrides.

        It does so once for each rest of the sticks.
        """
        edge = self._edges.pop(client, None)
        if edge is None or now - edge.newest > GAP:
            edge = StickEdge(now)
        is_at_rest = largest <= CENTRE
        since = min(edge.since, now) if is_at_rest else math.inf
        armed = edge.armed or now - since >= REST
        overrides = armed and not is_at_rest and largest > self.threshold
        self._edges[client] = StickEdge(now, since, armed and not overrides)
        if len(self._edges) > MAX_CLIENTS:
            del self._edges[next(iter(self._edges))]
        return overrides

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
