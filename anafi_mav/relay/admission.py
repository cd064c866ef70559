"""Admission of pictures to one viewer. No I/O.

A viewer gets pictures from an entry on, and none while it is too slow.
"""

from __future__ import annotations

import enum

MAX_ENTRY_WAIT = 2.0
"""s that a viewer waits for an entry; then it gets every picture, and its decoder has to make do with that."""

MAX_WAITING = 1 << 20
"""Bytes that may wait for a slow viewer: 1.7 s of 5 Mbit/s. Later than that a picture is of no use to a pilot."""
RESUME_BELOW = MAX_WAITING // 4
"""Bytes that wait when a slow viewer gets pictures again, so that it does not lose the next one at once."""


class Admission(enum.Enum):
    """Decision about one picture."""

    DROP = enum.auto()
    PASS = enum.auto()
    PASS_WITHOUT_ENTRY = enum.auto()
    """Decoding begins here, and the picture is no entry: the parameter sets have to precede it."""


class PictureGate:
    """The decisions for one viewer."""

    def __init__(self) -> None:
        self._awaits_entry = True
        self._since: float | None = None
        """When it began to wait for an entry, or was too slow."""
        self._is_slow = False

    def begin(self, now: float, *, has_entry: bool) -> None:
        """Note that the viewer starts `now`; `has_entry`: with an entry and the pictures since."""
        self._since, self._is_slow = now, False
        self._awaits_entry = not has_entry

    def admit(self, is_entry: bool, waiting: int, now: float) -> Admission:
        """Decide about the next picture; `waiting` bytes of earlier ones have not left yet."""
        if waiting > MAX_WAITING and not self._is_slow:
            self._is_slow = self._awaits_entry = True
            self._since = now
        if self._is_slow and waiting <= RESUME_BELOW:
            self._is_slow = False
        if self._is_slow or (self._awaits_entry and not is_entry and not self._has_waited(now)):
            return Admission.DROP
        is_late_start, self._awaits_entry = self._awaits_entry and not is_entry, False
        return Admission.PASS_WITHOUT_ENTRY if is_late_start else Admission.PASS

    def _has_waited(self, now: float) -> bool:
        return self._since is not None and now - self._since >= MAX_ENTRY_WAIT
