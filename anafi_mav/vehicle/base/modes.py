"""Flight modes: one neutral enum. How an autopilot numbers them is its flavour's business. No I/O.

The mode of a system is what the drone does, not what somebody asked for; `Vehicle.mode` decides it.
"""

from __future__ import annotations

import enum


class FlightMode(enum.Enum):
    """What a vehicle can be doing, in words that belong to no autopilot."""

    POSITION = "Position"
    """Flown by the sticks of a ground station; hovers while nobody touches them."""
    HOLD = "Hold"
    """Hovers, or goes where it was told to go."""
    GUIDED = "Guided"
    """As Hold, and setpoints of the program that chose it fly the drone without another word (ArduPilot's way)."""
    TAKEOFF = "Takeoff"
    MISSION = "Mission"
    RETURN = "Return"
    LAND = "Land"
    OFFBOARD = "Offboard"
    """Setpoints of a program fly the drone."""
    FOLLOW = "Follow"
    ORBIT = "Orbit"
    TERMINATED = "Terminated"


HOVERING = (FlightMode.HOLD, FlightMode.GUIDED, FlightMode.POSITION)
"""Modes that begin with a stop: what they differ in is who may move the drone next."""
