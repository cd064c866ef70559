"""Severity of a text to the clients. No I/O."""

from __future__ import annotations

import enum


class Severity(enum.IntEnum):
    """MAV_SEVERITY, the ones in use."""

    EMERGENCY = 0
    """The motors were cut in the air."""
    ALERT = 1
    """The drone does something by itself that cannot be stopped."""
    CRITICAL = 2
    """Something fails that flight depends on."""
    ERROR = 3
    """Something that a user asked for did not work."""
    WARNING = 4
    """A request was refused, or the drone warns."""
    NOTICE = 5
    """Out of the ordinary, and no reason to worry."""
    INFO = 6
