"""Take-off by setpoints: the climbing setpoints, and how long they must last. No I/O.

Programs of both families begin on the ground: they arm, engage, and send a setpoint that climbs. PX4 then takes off
in
Offboard for any setpoint, ArduCopter in Guided for an attitude with thrust (mode_guided.cpp, `set_angle`). Only a
climb
that one and the same client requests without a gap for `CLIMB_FOR` takes the drone off, and every client is warned in
that time: one packet, or the setpoint of a client that did not arm, starts no motor. `OffboardFlight` is the shell.
"""

from __future__ import annotations

import enum
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


class TakeoffPhase(enum.Enum):
    """State of a take-off by setpoints."""

    IDLE = "none"
    COUNTING = "a client asks to climb, every client is warned"
    LIFTING = "TakeOff is commanded, the setpoints are flown from the first hover on"
    JOINED = "another take-off is under way, the setpoints are flown at its end"


class TakeoffStep(enum.Enum):
    """Consequence of a setpoint that climbs."""

    WARN = "the second has begun"
    WAIT = "it lasts"
    TAKE_OFF = "it is over"


class SetpointTakeoff:
    """The take-off that setpoints of one client ask for."""

    def __init__(self) -> None:
        self.phase = TakeoffPhase.IDLE
        self.client: Hashable = None
        self._since = 0.0
        self._last = 0.0

    def climb(self, client: Hashable, now: float, gap: float) -> TakeoffStep:
        """A setpoint that climbs has arrived.

        `gap`: s between two of them that begin the second again.
        """
        if self.phase is not TakeoffPhase.COUNTING or now - self._last >= gap:
            self.phase, self.client, self._since, self._last = TakeoffPhase.COUNTING, client, now, now
            return TakeoffStep.WARN
        if client != self.client:
            return TakeoffStep.WAIT
        self._last = now
        return TakeoffStep.TAKE_OFF if now - self._since >= CLIMB_FOR else TakeoffStep.WAIT

    def begin(self, client: Hashable, phase: TakeoffPhase) -> None:
        """The drone is about to leave the ground, by this client's setpoints or another take-off."""
        self.phase, self.client = phase, client

    def stop(self) -> TakeoffPhase:
        """It is over, or ended. Returns the phase that has ended."""
        before, self.phase, self.client = self.phase, TakeoffPhase.IDLE, None
        return before
