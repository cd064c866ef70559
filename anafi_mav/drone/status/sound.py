"""Element sound: the motors beep, so that a drone is found in the grass. On the ground only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import AlertSoundState
from anafi_mav.drone.element import Reducer
from anafi_mav.drone.settings import Commanding


class SoundState(msgspec.Struct, frozen=True):
    """The alert sound."""

    playing: bool | None = None


class Sound(Commanding[SoundState]):
    """The alert sound, to find a drone."""

    NOTHING = SoundState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.AlertSound: lambda state, message: SoundState(message.state == AlertSoundState.PLAYING)
    }

    async def start(self) -> None:
        """Start the alert sound; returns when the drone beeps."""
        self._commander.require_feature(self.state.playing, "alert sound")
        await self._change(
            ardrone3.StartAlertSound(),
            ardrone3.AlertSound,
            lambda message: True if message.state == AlertSoundState.PLAYING else None,
        )

    async def stop(self) -> None:
        """Stop the alert sound; returns when the drone is silent."""
        self._commander.require_feature(self.state.playing, "alert sound")
        await self._change(
            ardrone3.StopAlertSound(),
            ardrone3.AlertSound,
            lambda message: True if message.state == AlertSoundState.STOPPED else None,
        )
