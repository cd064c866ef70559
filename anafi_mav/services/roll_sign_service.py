"""Keeps what is known of the sign of a drone's roll, by its serial number and firmware, and reports it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from anafi_mav.drone import events
from anafi_mav.drone.events import Message
from anafi_mav.services.roll_sign import INVERTED, Sign
from anafi_mav.services.service import Service
from anafi_mav.services.statustext import Severity

KEY = "roll_sign"
"""Name of the record in the drone's file."""

VERIFIED = "Roll sign verified"


def written(firmware: str, sign: Sign) -> Mapping[str, Any]:
    """Make the record of a verdict, as plain JSON values."""
    return {"firmware": firmware, "inverted": sign is Sign.LEFT}


def read(kept: Any, firmware: str | None) -> Sign:
    """Return the verdict that a record holds for a firmware; UNKNOWN when it is of another, or no record."""
    if not isinstance(kept, dict) or not firmware or kept.get("firmware") != firmware:
        return Sign.UNKNOWN
    inverted = kept.get("inverted")
    if not isinstance(inverted, bool):
        return Sign.UNKNOWN
    return Sign.LEFT if inverted else Sign.RIGHT


class RollSignService(Service):
    """Watches how the drone moves until the sign of its roll is known."""

    def link_up(self) -> None:
        check = self.host.vehicle.roll
        check.recall(read(self.host.memory.settings.get(KEY), self.host.drone.identity.firmware))
        if check.inverted:
            self.host.text(Severity.WARNING, INVERTED)

    def hears(self) -> Collection[type[Message]]:
        return (events.AttitudeChanged, events.SpeedChanged, events.FlyingStateChanged)

    def on_event(self, message: Message, now: float) -> None:
        vehicle, state = self.host.vehicle, self.host.drone.piloting.state
        attitude, velocity = state.attitude, state.velocity
        if not vehicle.in_air or attitude is None or velocity is None:
            vehicle.roll.forget_motion()
        elif isinstance(message, events.AttitudeChanged):
            vehicle.roll.on_attitude(attitude.roll, attitude.yaw)
        elif isinstance(message, events.SpeedChanged) and vehicle.roll.on_velocity(velocity.north, velocity.east, now):
            self._report()

    def _report(self) -> None:
        sign, firmware = self.host.vehicle.roll.sign, self.host.drone.identity.firmware
        if sign is Sign.LEFT:
            self.host.text(Severity.CRITICAL, INVERTED)
        else:
            self.host.text(Severity.INFO, VERIFIED)
        if firmware:
            self.host.memory.settings[KEY] = written(firmware, sign)
            self.host.spawn(self._save())

    async def _save(self) -> None:
        if (problem := await self.host.memory.save()) is not None:
            self.host.complain(problem)
