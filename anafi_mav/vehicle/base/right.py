"""The right of a client to end a landing or a return. No I/O.

Handlers of client messages pass it to `Vehicle.hold`, `set_mode` and the like. What the gateway does by itself
(station loss, fence, silence of setpoints, end of a mission, its own end) has none, and so never ends either. A flight
task ends what both its rules (`TaskRules.ends_landing`, `ends_return`) and this right cover.
"""

from __future__ import annotations

import enum
from collections.abc import Hashable

from msgspec import Struct


def system_of(client: Hashable) -> int | None:
    """Return the MAVLink system id of a `Command.client`; None for any other value.

    The gateway itself is such a value, too.
    """
    if isinstance(client, tuple) and len(client) == 3 and isinstance(client[1], int):
        return client[1]
    return None


class Extent(enum.Enum):
    """Landings or returns that a right covers. A forced landing is covered by none."""

    COMMANDED = "those that a client commanded"
    """The right of setpoints, mission messages and the joystick override."""
    ALL = "these, and those that the drone began"
    """The right of a command or a mode message."""


class Right(Struct, frozen=True):
    """One client's right, given by one message of it.

    `Aircraft.right` makes it when the message arrives.
    """

    client: Hashable
    """(channel, system id, component id)."""
    extent: Extent
    takeovers: int
    """Takeovers of the Skycontroller's pilot when its message arrived: a later one is newer than the message."""
    at: float = 0.0
    """When its message arrived, on the monotonic clock."""
    counted: bool = True
    """The client sent no other Hold in the 5 s before: only then does it end a return that the drone began."""

    @property
    def system(self) -> int:
        """MAVLink system id of the client, for texts; 0 when it is unknown."""
        return system_of(self.client) or 0

    def covered(self, extent: Extent | None) -> Extent | None:
        """Return how far this right covers what a task may end; None: not at all."""
        return self.extent if extent is Extent.ALL else extent
