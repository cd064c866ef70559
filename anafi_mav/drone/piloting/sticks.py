"""The sticks: a setpoint as PCMD percentages, and when which PCMD is due.

No I/O; time is handed in.

PCMD is not acknowledged and the drone forgets it soon, so what holds is repeated every 50 ms (ardrone3.xml 1-0-2).
Letting go is explicit: centred sticks are repeated for two seconds, because a single datagram can be lost.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec

from anafi_mav.arsdk.messages.ardrone3 import PCMD
from anafi_mav.errors import LocalProtocolError

PERIOD = 0.05
"""s between two PCMDs: "sends each 50 ms" (ardrone3.xml 1-0-2)."""

CENTRED_REPEATS = 40
"""PCMDs that centre the sticks: two seconds of them."""

HOLD_LIMIT = 0.5
"""s that a deflection holds without being sent again.

The pilot or program in control renews it. A deflection that outlives its sender is the worst that can happen, so the
layer nearest to the drone ends it, whatever the layers above missed.
"""

MIN_SPACING = 0.02
"""s between two PCMDs on average, however often the sticks move: a drone that takes them every 50 ms gains nothing from
more, and the radio loses. Two may follow each other closely, so that a setpoint need not wait because a correction of
the heading has just left; then the newest position waits, older ones are never sent."""


class PilotingCommand(msgspec.Struct, frozen=True):
    """Position of the sticks in aerospace signs; clipped to the limits.

    FRD body, + up for the climb.
    """

    roll_deg: float = 0.0
    """Tilt, + right."""
    pitch_deg: float = 0.0
    """Tilt, + nose UP (that is backwards)."""
    yaw_rate_dps: float = 0.0
    """Turn, deg/s, + clockwise seen from above."""
    climb_mps: float = 0.0
    """m/s, + up."""


class Limits(msgspec.Struct, frozen=True):
    """Values at full stick: the drone's own settings."""

    tilt_deg: float
    yaw_rate_dps: float
    climb_mps: float


class Percent(NamedTuple):
    """Stick positions in PCMD's signs, -100..100.

    roll + right, pitch + nose DOWN, yaw + clockwise, gaz + up.
    """

    roll: int
    pitch: int
    yaw: int
    gaz: int


CENTRED = Percent(0, 0, 0, 0)


def percent(command: PilotingCommand, limits: Limits) -> Percent:
    """Return the stick positions of a setpoint, in percent, clipped to -100..100.

    They are rounded to the nearest percent. Raises `LocalProtocolError` for a setpoint that is not a number.
    """
    return Percent(
        _share(command.roll_deg, limits.tilt_deg),
        _share(-command.pitch_deg, limits.tilt_deg),
        _share(command.yaw_rate_dps, limits.yaw_rate_dps),
        _share(command.climb_mps, limits.climb_mps),
    )


def _share(value: float, limit: float) -> int:
    held = -limit if value < -limit else limit if value > limit else value  # an int of any size, too
    if math.isnan(held):
        raise LocalProtocolError("a piloting setpoint is not a number")
    # A limit of zero is a drone that may not move that way at all.
    return round(100.0 * held / limit) if limit > 0.0 else 0


def is_deflected(pcmd: PCMD) -> bool:
    """True when any stick of this PCMD is off its middle."""
    return bool(pcmd.roll or pcmd.pitch or pcmd.yaw or pcmd.gaz)


class StickSchedule:
    """When to send which stick position.

    `deadline` says when `due` has something, `due` hands it out once.
    """

    __slots__ = ("_expires", "_last", "_next", "_paid_until", "_position", "_remaining", "_seq")

    def __init__(self) -> None:
        self._position = CENTRED
        self._remaining: int | None = 0
        """PCMDs still to come; None: until further notice."""
        self._last = CENTRED
        """Position that was sent last."""
        self._next = 0.0
        self._expires = 0.0
        self._paid_until = -math.inf
        """When the PCMDs sent so far would all have had their `MIN_SPACING`."""
        self._seq = 0

    @property
    def active(self) -> bool:
        """Is there anything left to send?"""
        return self._remaining != 0

    @property
    def held(self) -> bool:
        """A setpoint holds the sticks, level or not."""
        return self._remaining is None

    @property
    def deflected(self) -> bool:
        """The position that was sent last is off the middle."""
        return self._last != CENTRED

    @property
    def deadline(self) -> float | None:
        """When the next PCMD is due; None when none is."""
        return self._next if self._remaining != 0 else None

    def command(self, position: Percent, now: float, said: float | None = None) -> None:
        """Hold this position until `HOLD_LIMIT` after it was set; then the sticks centre.

        `said` is the time at which it was set, None: now.
        """
        if self._remaining == 0 or position != self._position:  # the same said again leaves with the next repetition
            self._next = max(now, self._paid_until - MIN_SPACING)
        self._position, self._remaining = position, None
        self._expires = (now if said is None else said) + HOLD_LIMIT

    def centre(self, now: float) -> None:
        """Let go: centred from now on, for two seconds. The end of a deflection waits for nothing."""
        self._position, self._remaining = CENTRED, CENTRED_REPEATS
        self._next = now if self.deflected else max(now, self._paid_until - MIN_SPACING)

    def stop(self) -> None:
        """Send nothing any more."""
        self._remaining = 0

    def due(self, now: float) -> PCMD | None:
        """The PCMD to send at this moment, if its time has come.

        Repetitions keep their 20 Hz grid when a call is a little late; after a longer pause the missed ones are
        not made up for.
        """
        if self._remaining == 0 or now < self._next:
            return None
        if self._remaining is None and now >= self._expires:
            self.centre(now)
        if self._remaining is not None:
            self._remaining -= 1
        self._next = self._next + PERIOD if now - self._next < PERIOD else now + PERIOD
        self._paid_until = max(self._paid_until, now) + MIN_SPACING
        self._last = self._position
        return self._pcmd(self._position, now)

    def single(self, position: Percent, now: float) -> PCMD:
        """Return one PCMD outside of the 20 Hz grid."""
        self._last = position
        return self._pcmd(position, now)

    def _pcmd(self, position: Percent, now: float) -> PCMD:
        """Build a PCMD whose flag is 1 only when roll or pitch is deflected.

        Parrot's own programs do so. With flag 0 the drone holds its place, and begins a return or a point of interest
        that waits for it to hover (GroundSDK PilotingCommand, Olympe; ardrone3.xml 1-0-2, 1-0-5; rth.xml 146-0-11).
        With flag 1 and no deflection it is commanded to 0 degrees of tilt, which wind carries away.
        """
        return PCMD(int(position.roll != 0 or position.pitch != 0), *position, self._stamp(now))

    def _stamp(self, now: float) -> int:
        """Return timestampAndSeqNum: a counter in the top byte, milliseconds below.

        The drone keeps statistics of it.
        """
        self._seq = (self._seq + 1) & 0xFF
        return self._seq << 24 | int(now * 1000.0) & 0xFFFFFF
