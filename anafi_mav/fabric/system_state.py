"""The state of one system on the fabric, as JSON. No I/O.

An interface: a field that a reader may rely on is only removed or changed together with `STATE_VERSION`; readers ignore
fields that they do not know.
"""

from __future__ import annotations

import msgspec

from anafi_mav.status_record import DroneStatus

STATE_VERSION = 1


class StatePosition(msgspec.Struct, frozen=True, kw_only=True):
    """Position of a drone, as its GLOBAL_POSITION_INT reports it."""

    latitude: float
    """deg."""
    longitude: float
    """deg."""
    amsl_m: float
    age_s: float


class SystemState(msgspec.Struct, frozen=True, kw_only=True):
    """The value of a system's key `state`."""

    version: int = STATE_VERSION
    gateway: str
    """Session id of the gateway."""
    drone: DroneStatus
    """As in the status record (status.json)."""
    position: StatePosition | None
    """None: unknown."""

    def encode(self) -> bytes:
        """Return the JSON text."""
        return msgspec.json.encode(self)
