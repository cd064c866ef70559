"""Who flies the drone for as long as somebody keeps telling them how: a program, a joystick, a target to follow."""

from __future__ import annotations

import asyncio
from typing import Protocol


class Helm(Protocol):
    """One way to be flown."""

    def end(self) -> list[asyncio.Task[None]]:
        """Something else flies now: nothing of what was said before goes on. Returns tasks that are about to end.

        Never waits, never raises, and does nothing when it does not fly.
        """

    def link_down(self) -> None:
        """The drone's link is gone: what was said before counts for nothing."""
