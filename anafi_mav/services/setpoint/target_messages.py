"""Reads position and velocity of a target: FOLLOW_TARGET, GLOBAL_POSITION_INT. No I/O."""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.follow import FASTEST, Sighting


def sighting(message: dialect.MAVLink_follow_target_message) -> Sighting | OperatorText:
    """Return the content of a FOLLOW_TARGET, or one sentence on why it cannot be followed.

    Bits of est_capabilities: 0 position, 1 velocity (MAVLink common.xml FOLLOW_TARGET).
    """
    capabilities = message.est_capabilities
    if not capabilities & 1:
        return texts.TARGET_NO_POSITION
    altitude = message.alt if math.isfinite(message.alt) else None
    velocity = (message.vel[0], message.vel[1]) if capabilities & 2 else None
    return _checked(Sighting(message.lat / 1e7, message.lon / 1e7, altitude, velocity))


def station_sighting(message: dialect.MAVLink_global_position_int_message) -> Sighting | OperatorText:
    """Return the content of a station's GLOBAL_POSITION_INT.

    Or one sentence on why it cannot be followed. QGroundControl sends a velocity of 0 when its receiver reports none:
    it is measured from the positions then.
    """
    velocity = (message.vx / 1e2, message.vy / 1e2) if message.vx or message.vy else None
    return _checked(Sighting(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3, velocity))


def _checked(seen: Sighting) -> Sighting | OperatorText:
    """Return a sighting whose velocity can be flown, or one sentence on why it cannot."""
    if seen.velocity is not None:
        speed = math.hypot(*seen.velocity)
        if not math.isfinite(speed):
            return texts.TARGET_NO_VELOCITY
        if speed > FASTEST:
            return texts.TARGET_FAST.fill(speed=speed)
    return seen
