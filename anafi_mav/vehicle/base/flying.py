"""Parrot's flying states in the groups that matter to MAVLink."""

from __future__ import annotations

from anafi_mav.drone.events import FlyingState

ON_GROUND = (FlyingState.LANDED, FlyingState.EMERGENCY)

TAKING_OFF = (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF, FlyingState.USERTAKEOFF)

LANDING = (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING)

AIRBORNE = (FlyingState.HOVERING, FlyingState.FLYING)
"""Flying, and neither taking off nor landing by itself."""
