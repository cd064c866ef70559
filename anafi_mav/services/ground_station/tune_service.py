"""PLAY_TUNE and PLAY_TUNE_V2: the drone beeps with its motors.

An ANAFI cannot play notes; the beep is for finding it in the grass. A tune with notes starts a beep of a few seconds,
one without notes ends it. It beeps on the ground only: in the air the motors have other things to do.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping

from anafi_mav import texts
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.service import Host, MessageHandler, Service

BEEP = 3.0
"""s. Long enough to hear where it comes from; a new tune makes it last."""


class TuneService(Service):
    """The drone's alert sound."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._beep: asyncio.Task[None] | None = None

    def messages(self) -> Mapping[int, MessageHandler]:
        return {
            dialect.MAVLINK_MSG_ID_PLAY_TUNE: self._play,
            dialect.MAVLINK_MSG_ID_PLAY_TUNE_V2: self._play,
        }

    def _play(self, inbound: Inbound) -> None:
        if self._beep is not None:
            self._beep.cancel()
        self._beep = self.host.spawn(self._sound(bool(inbound.message.tune.strip("\0 "))))

    async def _sound(self, on: bool) -> None:
        sound = self.host.drone.sound
        try:
            if on and not self.host.vehicle.on_ground:
                self.host.warn_throttled(texts.TUNE_REFUSED)
                return
            if not on:
                await sound.stop()
                return
            await sound.start()
            await asyncio.sleep(BEEP)
            await sound.stop()
        except AnafiMavError as error:
            with contextlib.suppress(AnafiMavError):
                self.host.warn_throttled(texts.TUNE_FAILED.fill(error=error))
