"""Silence of a client after which the drone hovers. No I/O."""

from __future__ import annotations

SILENCE = 0.45
"""s without a setpoint until a hover is commanded: the drone receives it within 0.5 s."""
