"""The command protocol: what a COMMAND_LONG or COMMAND_INT says, and when it is executed, repeated or answered.

I/O-free. `CommandDesk` decides; `System` runs the handler and sends the acknowledgements.
Rules: conformance R5-R10, MAVLink command.md.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav.mavlink import dialect

RESEND_WINDOW = 2.0
"""s. The same action from the same client within this time is a retransmission: clients resend every 0.5-2 s and
cannot know that only the acknowledgement was lost (conformance R10)."""

PROGRESS_AFTER, PROGRESS_EVERY = 0.3, 0.8
"""s until the first IN_PROGRESS and between them: MAVSDK resends at 0.5 s, every client gives up after 1-3 s (R9)."""

_UNSET_INT = (2**31 - 1, -(2**31))
"""x and y of a COMMAND_INT that stand for "not set": the specified INT32_MAX, and what a cast NaN becomes (R8)."""


@dataclass(frozen=True)
class Command:
    """One command, whichever message brought it. Unset parameters are NaN."""

    id: int
    params: tuple[float, float, float, float]
    """param1..param4."""
    x: float
    """param5: latitude in deg for a command with a location, else as sent."""
    y: float
    """param6: longitude in deg for a command with a location, else as sent."""
    z: float
    """param7: height in m for a command with a location."""
    frame: int | None
    """MAV_FRAME of a COMMAND_INT; None for COMMAND_LONG."""

    def same_as(self, other: Command) -> bool:
        """Equal, with NaN equal to NaN."""
        return (self.id, self.frame) == (other.id, other.frame) and all(
            a == b or (math.isnan(a) and math.isnan(b))
            for a, b in zip(
                (*self.params, self.x, self.y, self.z), (*other.params, other.x, other.y, other.z), strict=True
            )
        )


LOCATION_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_NAV_WAYPOINT,
        dialect.MAV_CMD_NAV_LAND,
        dialect.MAV_CMD_NAV_TAKEOFF,
        dialect.MAV_CMD_DO_ORBIT,
        dialect.MAV_CMD_DO_REPOSITION,
        dialect.MAV_CMD_DO_SET_HOME,
        dialect.MAV_CMD_DO_SET_ROI_LOCATION,
        dialect.MAV_CMD_DO_SET_ROI,
    }
)
"""Commands whose x and y of a COMMAND_INT are degrees times 1e7."""


def from_long(message: dialect.MAVLink_command_long_message) -> Command:
    """The command of a COMMAND_LONG."""
    return Command(
        message.command,
        (message.param1, message.param2, message.param3, message.param4),
        message.param5,
        message.param6,
        message.param7,
        None,
    )


def from_int(message: dialect.MAVLink_command_int_message) -> Command:
    """The command of a COMMAND_INT."""
    scale = 1e7 if message.command in LOCATION_COMMANDS else 1.0
    x, y = (math.nan if value in _UNSET_INT else value / scale for value in (message.x, message.y))
    return Command(
        message.command,
        (message.param1, message.param2, message.param3, message.param4),
        x,
        y,
        message.z,
        message.frame,
    )


@dataclass
class Execution:
    """An action under way or just ended."""

    client: Hashable
    command: Command
    received: float
    result: int = dialect.MAV_RESULT_IN_PROGRESS
    """MAV_RESULT; IN_PROGRESS until it ended."""


class CommandDesk:
    """Tells a new action from the retransmission of one.

    Only the newest action counts: arm, disarm, arm within two seconds are three actions, although the third
    equals the first.
    """

    def __init__(self) -> None:
        self._newest: Execution | None = None

    def retransmission(self, client: Hashable, command: Command, now: float) -> Execution | None:
        """The execution that this command repeats, or None when it is to be executed."""
        newest = self._newest
        if newest is None or newest.client != client or not newest.command.same_as(command):
            return None
        under_way = newest.result == dialect.MAV_RESULT_IN_PROGRESS
        return newest if under_way or now - newest.received < RESEND_WINDOW else None

    def begin(self, client: Hashable, command: Command, now: float) -> Execution:
        """Note that an action begins; every later one is compared with it."""
        self._newest = Execution(client, command, now)
        return self._newest

    def forget(self) -> None:
        """What was done before no longer counts: the link was lost, or something else moved the vehicle."""
        self._newest = None
