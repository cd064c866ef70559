"""What we do not do, and why: the error of a request that was understood."""

from __future__ import annotations

from anafi_mav.errors import AnafiMavError


class Refused(AnafiMavError):
    """We do not do this. `lasting` tells a request that is wrong in itself from one that comes at a bad moment."""

    def __init__(self, reason: str, *, lasting: bool = False, critical: bool = False) -> None:
        super().__init__(reason)
        self.reason = reason
        self.lasting = lasting
        self.critical = critical


class Unfinished(AnafiMavError):
    """A command was accepted for later, and what it waited for has failed: MAV_RESULT_FAILED."""


class Unsupported(Refused):
    """The vehicle has no such command, or not with these parameters: MAV_RESULT_UNSUPPORTED."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason, lasting=True)
