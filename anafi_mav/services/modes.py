"""Flight modes: one neutral enum, and how PX4 writes it into ``custom_mode``.

The mode of a system is what the drone does, not what somebody asked for; `Vehicle.mode` decides it. This module
only names modes and translates numbers.
"""

from __future__ import annotations

import enum
import math


class FlightMode(enum.Enum):
    """What a vehicle can be doing, in words that belong to no autopilot."""

    POSITION = "Position"
    HOLD = "Hold"
    TAKEOFF = "Takeoff"
    MISSION = "Mission"
    RETURN = "Return"
    LAND = "Land"
    OFFBOARD = "Offboard"
    TERMINATED = "Terminated"


# PX4 packs main mode into bits 16..23 and sub mode into bits 24..31 of custom_mode
# (PX4-Autopilot src/modules/commander/px4_custom_mode.h).
_MAIN_POSCTL, _MAIN_AUTO, _MAIN_OFFBOARD, _MAIN_TERMINATION = 3, 4, 6, 10

PX4_MODES: dict[FlightMode, tuple[int, int]] = {
    FlightMode.POSITION: (_MAIN_POSCTL, 0),
    FlightMode.TAKEOFF: (_MAIN_AUTO, 2),
    FlightMode.HOLD: (_MAIN_AUTO, 3),
    FlightMode.MISSION: (_MAIN_AUTO, 4),
    FlightMode.RETURN: (_MAIN_AUTO, 5),
    FlightMode.LAND: (_MAIN_AUTO, 6),
    FlightMode.OFFBOARD: (_MAIN_OFFBOARD, 0),
    FlightMode.TERMINATED: (_MAIN_TERMINATION, 0),
}
_BY_NUMBERS = {numbers: mode for mode, numbers in PX4_MODES.items()}


def px4_custom_mode(mode: FlightMode) -> int:
    """``custom_mode`` of a heartbeat in this mode."""
    main, sub = PX4_MODES[mode]
    return main << 16 | sub << 24


def from_px4_custom_mode(custom_mode: int) -> FlightMode | None:
    """The mode that a packed number names (message SET_MODE); None when we do not have it."""
    return _BY_NUMBERS.get((custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF))


def from_px4_parameters(main: float, sub: float) -> FlightMode | None:
    """The mode that MAV_CMD_DO_SET_MODE names with param2 and param3; None when we do not have it.

    Below 256 param2 is the main mode and param3 the sub mode (NaN = 0); Mission Planner puts the packed number
    into param2 (conformance E5).
    """
    if not math.isfinite(main) or main < 0 or main >= 1 << 32 or main != int(main):
        return None
    if main >= 1 << 16:
        return from_px4_custom_mode(int(main))
    if math.isnan(sub):
        sub = 0.0
    if not math.isfinite(sub) or sub != int(sub):
        return None
    return _BY_NUMBERS.get((int(main), int(sub)))
