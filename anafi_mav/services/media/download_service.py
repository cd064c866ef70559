"""Copies the drone's photos and videos to a folder of this computer after each landing.

Configuration key `media.download_folder`. A take-off ends it: the radio then belongs to the flight. The next landing
continues where it ended, in the middle of a file if need be.
"""

from __future__ import annotations

import asyncio
import logging
import re
from pathlib import Path

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.events import FlyingStateChanged
from anafi_mav.drone.payload.media import Resource
from anafi_mav.drone.payload.media_copy import copy
from anafi_mav.drone.rest import MediaNotIndexed
from anafi_mav.errors import AnafiMavError, CommandRejected, RemoteProtocolError
from anafi_mav.services.media.media_folder import busy
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.flying import ON_GROUND
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions

logger = logging.getLogger(__name__)

SETTLE = 3.0
"""s after a landing before the list is requested: autorecord ends its video then. Also between looks at a drone that
records, saves or indexes."""


class DownloadService(Service):
    """Downloads the media where a folder is configured."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._task: asyncio.Task[None] | None = None

    def link_up(self) -> None:
        self._begin_on_ground()

    def link_down(self) -> None:
        self._end()

    def subscriptions(self) -> Subscriptions:
        return {FlyingStateChanged: self._on_flying_state}

    def _on_flying_state(self, message: FlyingStateChanged, now: float) -> None:
        self._begin_on_ground()

    def _begin_on_ground(self) -> None:
        folder = self.host.download_folder
        if folder is None:
            return
        if self.host.drone.piloting.state.flying not in ON_GROUND:
            self._end()
        elif self._task is None:
            self._task = self.host.spawn(self._copy(folder / folder_name(self.host.drone)))

    def _end(self) -> None:
        task, self._task = self._task, None
        if task is not None:
            task.cancel()

    async def _copy(self, folder: Path) -> None:
        """Copy the files that are not copied yet.

        A damaged file does not end it, a lost drone and a full disk do.
        """
        drone, copied = self.host.drone, 0
        problem: Exception | None = None
        try:
            for resource in await self._finished():
                try:
                    copied += await copy(drone.media, resource, folder, interrupted=self._log_interruption) is not None
                except (CommandRejected, RemoteProtocolError) as error:
                    logger.warning("%s: %s not copied: %s", drone.name, resource.resource_id, error)
                    problem = error
        except (AnafiMavError, OSError) as error:
            logger.warning("%s: media not copied: %s", drone.name, error)
            problem = error
        if copied:
            self.host.text(Severity.INFO, texts.MEDIA_COPIED.fill(count=copied))
        if problem is not None:
            self.host.text(Severity.WARNING, texts.MEDIA_NOT_COPIED.fill(error=texts.from_below(problem)))

    async def _finished(self) -> list[Resource]:
        """Return all files, once the drone has indexed them and no camera writes one."""
        drone = self.host.drone
        while True:
            await asyncio.sleep(SETTLE)
            if busy(drone) is not None:
                continue
            try:
                listing = await drone.media.listing()
            except MediaNotIndexed:
                continue
            else:
                return [resource for day in listing.files.values() for resource in day.values()]

    def _log_interruption(self, error: AnafiMavError, pause: float) -> None:
        logger.info("%s: copying media again in %g s: %s", self.host.drone.name, pause, error)


def folder_name(drone: Drone) -> str:
    """Return the name of a drone's folder."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", drone.name)[:64] or "drone"
