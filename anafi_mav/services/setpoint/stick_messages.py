"""Reads sticks from MANUAL_CONTROL and RC_CHANNELS_OVERRIDE. No I/O.

- MANUAL_CONTROL: x forward, y right, r clockwise, each -1000..1000; z 0..1000 with 500 in the middle, which holds the
  height, as for every multicopter. 32767 is an axis that is not there. Buttons do nothing;
- RC_CHANNELS_OVERRIDE: channels 1 roll, 2 pitch, 3 throttle, 4 yaw (ArduPilot's RCMAP_*), 1500 us in the middle,
  pitch below it is forward. 0 releases a channel, 65535 leaves it as this client set it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.manual_flight import Sticks

DEAD_ZONE = 0.03
"""Share of the way that a stick may be off its middle and count as centred: none of them returns exactly."""

NO_AXIS = 0x7FFF
"""MANUAL_CONTROL: this axis does not exist."""

RELEASED, KEPT = 0, 0xFFFF
"""RC_CHANNELS_OVERRIDE: give the channel back; leave it as it is."""

SHORTEST, LONGEST = 800, 2200
"""us that a channel may be: what transmitters send, with their trims."""


def manual_sticks(message: dialect.MAVLink_manual_control_message) -> Sticks | OperatorText | None:
    """Return the sticks of a MANUAL_CONTROL, or one sentence on why they are invalid.

    Returns None if the message has no axis at all.
    """
    axes = (message.x, message.y, message.r, message.z)
    if all(axis == NO_AXIS for axis in axes):
        return None
    if any(abs(axis) > 1000 and axis != NO_AXIS for axis in axes):
        return texts.AXIS_RANGE
    if message.z < 0:
        return texts.THROTTLE_RANGE
    forward, right, turn = (0.0 if axis == NO_AXIS else axis / 1000.0 for axis in axes[:3])
    climb = 0.0 if message.z == NO_AXIS else (message.z - 500) / 500.0
    return Sticks(*map(_beyond_dead_zone, (forward, right, turn, climb)))


@dataclass(frozen=True)
class RcChannels:
    """Values that a client has set on the four channels, us; None: released."""

    roll: int | None = None
    pitch: int | None = None
    throttle: int | None = None
    yaw: int | None = None

    def after(self, message: dialect.MAVLink_rc_channels_override_message) -> RcChannels | OperatorText:
        """Return the channels after one more RC_CHANNELS_OVERRIDE.

        Returns one sentence on the reason if the message is invalid.
        """
        said = {
            "roll": message.chan1_raw,
            "pitch": message.chan2_raw,
            "throttle": message.chan3_raw,
            "yaw": message.chan4_raw,
        }
        said = {name: value for name, value in said.items() if value != KEPT}
        if any(value != RELEASED and not SHORTEST <= value <= LONGEST for value in said.values()):
            return texts.CHANNEL_RANGE.fill(shortest=SHORTEST, longest=LONGEST)
        return replace(self, **{name: value or None for name, value in said.items()})

    @property
    def released(self) -> bool:
        return self.roll is self.pitch is self.throttle is self.yaw is None

    @property
    def sticks(self) -> Sticks:
        roll, pitch, throttle, yaw = (
            0.0 if value is None else max(-1.0, min((value - 1500) / 500.0, 1.0))
            for value in (self.roll, self.pitch, self.throttle, self.yaw)
        )
        return Sticks(*map(_beyond_dead_zone, (-pitch, roll, yaw, throttle)))


def _beyond_dead_zone(share: float) -> float:
    return share if abs(share) > DEAD_ZONE else 0.0
