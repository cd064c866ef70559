"""Take-off by setpoints: the climbing setpoints, and how long they must last. No I/O.

Programs of both families begin on the ground: they arm, engage, and send a setpoint that climbs. PX4 then takes off in
Offboard for any setpoint, ArduCopter in Guided for an attitude with thrust (mode_guided.cpp, `set_angle`). `stream`
counts the time.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Protocol

from anafi_mav.vehicle.base.requester import By
from anafi_mav.vehicle.offboard.setpoints import AttitudeSetpoint, PositionReference, Setpoint

CLIMB_FOR = 1.0
"""s for which a client asks to climb before the drone takes off."""

LEAST_CLIMB = 0.05
"""m, m/s or m/s2 upward that count as a climb: less is the noise of a controller that holds the ground."""


def climbs(setpoint: Setpoint, ato: Callable[[float], float | None]) -> bool:
    """Does a setpoint ask a drone that stands to climb?

    `ato` converts AMSL heights to heights above it (m).

    A position, velocity or acceleration that leads upward, none of them downward; of an attitude a thrust above 0.5.
    """
    if isinstance(setpoint, AttitudeSetpoint):
        return setpoint.climb > 0.0
    ups = [None if down is None else -down for down in (setpoint.velocity[2], setpoint.acceleration[2])]
    if (z := setpoint.position[2]) is not None:
        height = {PositionReference.TAKEOFF: z, PositionReference.SEA: ato(z)}.get(setpoint.origin, -z)
        ups.append(height)
    known = [up for up in ups if up is not None]
    return any(up > LEAST_CLIMB for up in known) and not any(up < -LEAST_CLIMB for up in known)


class Launcher(Protocol):
    """The take-off of a vehicle, as far as setpoints use it."""

    @property
    def under_way(self) -> bool:
        """An accepted take-off has not reached its height yet."""

    def is_armed_by(self, client: Hashable) -> bool:
        """Has this client armed the vehicle for the flight that begins now?"""

    async def launch(self) -> None:
        """Take off to the drone's own height; returns when the drone confirmed it."""

    async def abort(self, by: By) -> None:
        """Disarm a drone that stands, land one that is about to leave the ground."""
