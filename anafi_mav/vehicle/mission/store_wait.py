"""Wait for a mission that is being stored."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

from anafi_mav import texts
from anafi_mav.vehicle.base.refusal import Refused

STORE_WAIT = 5.0
"""s that a command waits for a mission to be stored, which takes a thread some milliseconds and a disk its time."""


class StoreWait:
    """Delays the commands of a client while its new mission is being stored.

    They are meant for that mission, not for the old one: clients like dronekit do not wait for the acknowledgement of
    their last item.
    """

    def __init__(self) -> None:
        self._stored: asyncio.Future[None] | None = None

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """For as long as a mission is being stored, and until it is the one of the vehicle."""
        stored = self._stored = asyncio.get_running_loop().create_future()
        try:
            yield
        finally:
            stored.set_result(None)
            if self._stored is stored:
                self._stored = None

    @property
    def is_active(self) -> bool:
        """A mission is being stored."""
        return self._stored is not None

    async def over(self) -> None:
        """Return when no mission is being stored: at once if that is so.

        Raises `Refused` when it takes too long.
        """
        while self._stored is not None:
            done, _ = await asyncio.wait({self._stored}, timeout=STORE_WAIT)
            if not done:
                raise Refused(texts.MISSION, texts.MISSION_STORING)
