"""Reads the position and velocity of a target from FOLLOW_TARGET. No I/O."""

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
    latitude, longitude = message.lat / 1e7, message.lon / 1e7
    altitude = message.alt
    velocity = None
    if capabilities & 2:
        north, east = message.vel[0], message.vel[1]
        if not math.isfinite(north + east):
            return texts.TARGET_NO_VELOCITY
        if math.hypot(north, east) > FASTEST:
            return texts.TARGET_FAST.fill(speed=math.hypot(north, east))
        velocity = (north, east)
    return Sighting(latitude, longitude, altitude if math.isfinite(altitude) else None, velocity)
