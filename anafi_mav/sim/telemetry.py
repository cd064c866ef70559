"""Telemetry that a drone sends without a request, at the aircraft's rates.

Attitude, speed and height 5 times a second (or at `--telemetry-rate`), the gimbal, the zoom and the height above
ground as often but not below 5 times, position and voltage once (anafi_ros). Messages that are late are not sent
later.
"""

from __future__ import annotations

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.sim.autopilot.firmware import Firmware
from anafi_mav.sim.world.quirks import Quirk

RATE = 5.0
"""Hz of the aircraft."""


class Telemetry:
    """One drone's schedule. `phase` (0..1) spreads the drones of a fleet over the period."""

    def __init__(self, firmware: Firmware, rate: float, phase: float) -> None:
        self._firmware = firmware
        self._motion = _Period(1.0 / rate, phase)
        self._gimbal = _Period(1.0 / max(rate, RATE), phase)
        self._position = _Period(1.0, phase)
        self.next = 0.0
        """When `due` has something to do: before that it returns nothing."""

    def due(self, now: float) -> list[Message]:
        """The messages to send now."""
        if now < self.next:
            return []
        firmware = self._firmware
        messages: list[Message] = []
        if self._motion.due(now):
            messages += firmware.motion_report()
        if self._gimbal.due(now):
            firmware.gimbal.advance(firmware.time)
            messages += firmware.gimbal.attitudes(firmware.pose)
            messages += firmware.payload.telemetry()
            messages += firmware.follow.telemetry()
            messages.append(ardrone3.AltitudeAboveGroundChanged(firmware.pose.up))
        if self._position.due(now):
            if Quirk.GPS_LOCATION_STOPS not in firmware.faults.quirks:
                messages += firmware.position_report()
            messages.append(firmware.battery.voltage())
        self.next = min(self._motion.next, self._gimbal.next, self._position.next)
        return messages


class _Period:
    def __init__(self, period: float, phase: float) -> None:
        self._period = period
        self.next = 0.0
        self._phase = phase

    def due(self, now: float) -> bool:
        if now < self.next:
            return False
        if self.next == 0.0:
            self.next = now + self._phase * self._period
            return False
        # One period on; after a pause the rhythm starts again instead of catching up.
        self.next += self._period
        if self.next < now:
            self.next = now + self._period
        return True
