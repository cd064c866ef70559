"""Turns of the nose, as MAV_CMD_CONDITION_YAW means them."""

from __future__ import annotations

from anafi_mav import units

DEG_PER_TURN = 360.0


def heading_of(angle: float, way: float, relative: bool, now: float) -> float:
    """Return the angle to turn for a MAV_CMD_CONDITION_YAW from heading `now`.

    All in deg, clockwise +. `way` is 1 clockwise, -1 counter-clockwise, 0 the shorter one; a relative angle turns by
    `angle` that way.
    """
    if relative:
        return -angle if way < 0 else angle
    turn = units.wrap_pi((angle - now) * units.RAD_PER_DEG) * units.DEG_PER_RAD
    if way > 0 and turn < 0:
        return turn + DEG_PER_TURN
    if way < 0 and turn > 0:
        return turn - DEG_PER_TURN
    return turn
