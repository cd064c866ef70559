"""Interface of a flight task: flies the drone by continuous setpoints or stick input.

Their source is a program, a joystick, or a target to follow.
"""

from __future__ import annotations

import asyncio
from typing import Protocol


class Helm(Protocol):
    """A flight task."""

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task, because something else flies now; earlier setpoints no longer count.

        Returns tasks that are about to end.

        Never waits, never raises, and does nothing when the task is not active.
        """

    def link_down(self) -> None:
        """Forget all earlier setpoints: the drone's link is lost."""
