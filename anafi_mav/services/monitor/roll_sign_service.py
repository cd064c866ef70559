"""Stores and reports what is known of the sign of a drone's roll.

The record holds for one serial number and firmware.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.drone.piloting.state import Attitude, Velocity
from anafi_mav.drone.values import Values
from anafi_mav.services.service import Host, Service
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions

KEY = "roll_sign"
"""Name of the record in the drone's file."""


def written(firmware: str, sign: RollSign) -> Mapping[str, Any]:
    """Make the record of a verdict, as plain JSON values."""
    return {"firmware": firmware, "inverted": sign is RollSign.INVERTED}


def read(kept: Any, firmware: str | None) -> RollSign:
    """Return the verdict that a record holds for a firmware.

    Returns UNKNOWN for a record of another firmware, or an invalid one.
    """
    if not isinstance(kept, dict) or not firmware or kept.get("firmware") != firmware:
        return RollSign.UNKNOWN
    inverted = kept.get("inverted")
    if not isinstance(inverted, bool):
        return RollSign.UNKNOWN
    return RollSign.INVERTED if inverted else RollSign.NORMAL


class RollSignService(Service):
    """Watches how the drone moves until the sign of its roll is known."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._interest = ValueInterest((events.AttitudeChanged, events.SpeedChanged), is_on=False)
        """On in the air."""

    def link_up(self) -> None:
        self._interest.switch(self.host.vehicle.in_air)
        check = self.host.vehicle.roll
        check.recall(read(self.host.memory.settings.get(KEY), self.host.drone.identity.firmware))
        if check.sign is RollSign.INVERTED:
            self.host.text(Severity.WARNING, texts.ROLL_SIGN_INVERTED)

    def subscriptions(self) -> Subscriptions:
        return {events.FlyingStateChanged: self._on_flying_state}

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_motion: self._interest}

    def _motion(self) -> tuple[Attitude, Velocity] | None:
        """Return attitude and velocity of the drone; None if one is unknown or it does not fly.

        Earlier motion is discarded then.
        """
        vehicle, state = self.host.vehicle, self.host.drone.piloting.state
        if not vehicle.in_air or state.attitude is None or state.velocity is None:
            vehicle.roll.forget_motion()
            return None
        return state.attitude, state.velocity

    def _on_flying_state(self, message: events.FlyingStateChanged, now: float) -> None:
        self._interest.switch(self.host.vehicle.in_air)
        self._motion()

    def _on_motion(self, values: Values, now: float) -> None:
        if (motion := self._motion()) is None:
            return
        check, (attitude, velocity) = self.host.vehicle.roll, motion
        if events.AttitudeChanged in values:
            check.on_attitude(attitude.roll, attitude.yaw)
        if events.SpeedChanged in values and check.on_velocity(velocity.north, velocity.east, now):
            self._report()

    def _report(self) -> None:
        sign, firmware = self.host.vehicle.roll.sign, self.host.drone.identity.firmware
        if sign is RollSign.INVERTED:
            self.host.text(Severity.CRITICAL, texts.ROLL_SIGN_INVERTED)
        else:
            self.host.text(Severity.INFO, texts.ROLL_SIGN_VERIFIED)
        if firmware:
            self.host.memory.settings[KEY] = written(firmware, sign)
            self.host.spawn(self._save())

    async def _save(self) -> None:
        if (problem := await self.host.memory.save()) is not None:
            self.host.warn_throttled(problem)
