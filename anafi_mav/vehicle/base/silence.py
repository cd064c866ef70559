"""Silence of a client after which the drone hovers. No I/O."""

from __future__ import annotations

SILENCE = 0.45
"""s without a setpoint until the drone is told to hover, so that it has been told within half a second."""
