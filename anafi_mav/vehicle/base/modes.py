"""Flight modes: one neutral enum. No I/O.

A flavour holds an autopilot's numbers for them. The mode of a system is the drone's behaviour, not a client's
request;
`Vehicle.mode` decides it.
"""

from __future__ import annotations

import enum


class FlightMode(enum.Enum):
    """Flight mode of a vehicle, in words that belong to no autopilot."""

    POSITION = "Position"
    """Flown by the sticks of a ground station; hovers while all sticks are centred."""
    HOLD = "Hold"
    """Hovers, or flies to the position of a goto command."""
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
