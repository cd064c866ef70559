"""Offboard: a program's setpoints fly the drone while they keep arriving. No I/O.

`OffboardStream` stores the sender of the setpoints and whether they fly the drone; their content is in `setpoints`, and
`OffboardFlight` flies it.

A session has one pilot: the client that engages it. Setpoints of others change nothing while it lasts. PX4's way to
engage is mode Offboard, refused without setpoints. ArduPilot's way is to send setpoints in mode Guided, and there a
single position is a move of its own, which nothing but its end or another order ends; a second setpoint of the same
program within `TOGETHER` makes a stream of it, whose end is silence. After that end a position of the same program is
a part of the stream for `LATE_AFTER_STREAM` longer: what a bad link delivers late must not send the drone off for good.
"""

from __future__ import annotations

import enum
from collections.abc import Hashable
from typing import NamedTuple

from anafi_mav.vehicle.offboard.setpoints import NOTHING, MotionSetpoint, Setpoint
from anafi_mav.vehicle.offboard.silence import SILENCE

GUIDED_TIMEOUT = 1.5
"""s that a velocity of ArduPilot's Guided lasts, unless a client sets another (dronekit's documents send one a
second; ArduCopter's GUID_TIMEOUT is 3 s)."""

SHORTEST_TIMEOUT, LONGEST_TIMEOUT = 0.5, 3.0
"""s that it can be set to."""

TOLD_EARLY = 0.5 - SILENCE
"""s before the end of a timeout at which the drone is commanded to hover."""

TOGETHER = 0.5
"""s within which a second setpoint makes a stream of the first."""

LATE_AFTER_STREAM = 3.0
"""s after the silence for which a position may still be one of the stream's; the time after which ArduCopter takes a
stream of velocities for ended."""

MAX_PILOTS = 8
"""Programs whose setpoints are listened to at once."""


class State(enum.Enum):
    """State of an offboard session."""

    IDLE = "no setpoints"
    STREAMING = "setpoints arrive while another mode is active"
    ENGAGED = "setpoints fly the drone"
    SINGLE = "a single setpoint is flown to its end"


class Event(enum.Enum):
    """Event that changes the state."""

    SETPOINT = "a usable setpoint of the pilot arrived"
    ENGAGE = "mode Offboard is requested, or a stream arrives in mode Guided"
    ENGAGE_SINGLE = "a single position in mode Guided"
    DISENGAGE = "another mode is active"
    SILENCE = "no setpoint for too long"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {Event.SETPOINT: State.STREAMING, Event.DISENGAGE: State.IDLE},
    State.STREAMING: {
        Event.SETPOINT: State.STREAMING,
        Event.ENGAGE: State.ENGAGED,
        Event.ENGAGE_SINGLE: State.SINGLE,
        Event.DISENGAGE: State.STREAMING,
        Event.SILENCE: State.IDLE,
    },
    State.ENGAGED: {
        Event.SETPOINT: State.ENGAGED,
        Event.ENGAGE: State.ENGAGED,
        Event.DISENGAGE: State.STREAMING,
        Event.SILENCE: State.IDLE,
    },
    State.SINGLE: {
        Event.SETPOINT: State.SINGLE,
        Event.ENGAGE: State.ENGAGED,
        Event.ENGAGE_SINGLE: State.SINGLE,
        Event.DISENGAGE: State.STREAMING,
    },
}
"""A pair that is missing cannot happen: without setpoints Offboard is refused, and there is no silence to notice; a
stream does not become a single setpoint again, and a single one is followed by silence."""


def is_position(setpoint: Setpoint) -> bool:
    """It can be flown to its end: a position can, a velocity has none."""
    return isinstance(setpoint, MotionSetpoint) and setpoint.moves


def lasts(setpoint: Setpoint, guided_timeout: float | None) -> float:
    """Return the s of silence after which a setpoint is over.

    `guided_timeout`: of ArduPilot's Guided; None elsewhere.

    It counts for velocities and yaw rates alone: a tilt or an acceleration that outlives its sender gains speed.
    """
    if guided_timeout is None or not isinstance(setpoint, MotionSetpoint):
        return SILENCE
    steers = setpoint.velocity != NOTHING or setpoint.yaw_rate is not None
    alone = setpoint.position == NOTHING and setpoint.acceleration == NOTHING
    return guided_timeout - TOLD_EARLY if steers and alone else SILENCE


class _Heard(NamedTuple):
    """A program's newest setpoint."""

    setpoint: Setpoint
    at: float
    lasts: float = SILENCE
    """s of silence after which it is over."""

    @property
    def over(self) -> float:
        """When it is over."""
        return self.at + self.lasts


class OffboardStream:
    """The newest setpoints, their age, and whose of them fly the drone."""

    def __init__(self) -> None:
        self.state = State.IDLE
        self.pilot: Hashable = None
        """Whose setpoints fly the drone while the session is engaged."""
        self._heard: dict[Hashable, _Heard] = {}
        self._fell_silent: tuple[Hashable, float] | None = None
        """Whose stream of positions silence ended last, and when it had lasted too long."""

    @property
    def flying(self) -> bool:
        """Setpoints fly the drone, a stream of them or a single one."""
        return self.state in (State.ENGAGED, State.SINGLE)

    @property
    def setpoint(self) -> Setpoint | None:
        """The pilot's newest setpoint; None while none is flown."""
        heard = self._heard.get(self.pilot) if self.flying else None
        return None if heard is None else heard.setpoint

    def age(self, now: float) -> float:
        """Seconds since the pilot's newest setpoint; 0 while none is flown."""
        return now - self._heard[self.pilot].at if self.flying else 0.0

    def stick_age(self, now: float) -> float:
        """Return `age` for the sticks: 0 for longer when the setpoint lasts longer than `SILENCE`.

        Sticks expire `SILENCE` after an age of 0.
        """
        return max(0.0, self.age(now) - (self._heard[self.pilot].lasts - SILENCE)) if self.flying else 0.0

    def continues_stream(self, sender: Hashable, now: float) -> bool:
        """This program's last setpoint is so young that one that arrives now is of the same stream."""
        heard = self._heard.get(sender)
        return heard is not None and now - heard.at < TOGETHER

    def is_late_after_stream(self, sender: Hashable, now: float) -> bool:
        """Return True if a position of this program may be a late one of a stream that has ended.

        It is then flown as a part of that stream.
        """
        return (
            self._fell_silent is not None
            and self._fell_silent[0] == sender
            and now < self._fell_silent[1] + LATE_AFTER_STREAM
        )

    def newest(self, sender: Hashable) -> Setpoint | None:
        """Return the last setpoint of this program."""
        heard = self._heard.get(sender)
        return None if heard is None else heard.setpoint

    def receive(self, sender: Hashable, setpoint: Setpoint, now: float, lasts: float = SILENCE) -> bool:
        """A usable setpoint arrived; it is over after `lasts` s of silence.

        False: another client flies, or too many want to.
        """
        if sender not in self._heard and len(self._heard) >= MAX_PILOTS:
            self._prune(now)
            if len(self._heard) >= MAX_PILOTS:
                return False
        self._heard[sender] = _Heard(setpoint, now, lasts)
        if self.state is State.ENGAGED and sender != self.pilot:
            return False
        self.state = TRANSITIONS[self.state][Event.SETPOINT]
        return True

    def candidate(self, client: Hashable, now: float) -> Hashable | None:
        """Return the client whose setpoints mode Offboard would fly if this client chose it.

        Its own have priority, then the newest of all. Returns None if no client has fresh setpoints: mode Offboard is
        to be refused.
        """
        fresh = {sender: heard for sender, heard in self._heard.items() if self._is_fresh(heard, now)}
        if client in fresh:
            return client
        return max(fresh, key=lambda sender: fresh[sender].at, default=None)

    def engage(self, pilot: Hashable) -> None:
        """Setpoints begin to fly the drone, those of a `candidate`."""
        self.state, self.pilot = TRANSITIONS[self.state][Event.ENGAGE], pilot

    def engage_single(self, pilot: Hashable, setpoint: Setpoint, said: float) -> None:
        """Start to fly this one setpoint of a program to its end, whatever its age is by now."""
        self._heard[pilot] = _Heard(setpoint, said)
        if self.state is State.IDLE:
            self.state = TRANSITIONS[self.state][Event.SETPOINT]
        self.state, self.pilot = TRANSITIONS[self.state][Event.ENGAGE_SINGLE], pilot

    def disengage(self) -> None:
        """Another mode takes over; setpoints may go on coming."""
        self.state, self.pilot = TRANSITIONS[self.state][Event.DISENGAGE], None

    def deadline(self) -> float | None:
        """When silence will have lasted too long; None while there is nothing to wait for."""
        if self.state in (State.IDLE, State.SINGLE):
            return None
        if self.state is State.ENGAGED:
            return self._heard[self.pilot].over
        return max(heard.over for heard in self._heard.values())

    def expire(self, now: float) -> bool:
        """True when silence just ended an engaged session: the drone must hover now."""
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return False
        engaged = self.state is State.ENGAGED
        if engaged and is_position(self._heard[self.pilot].setpoint):
            self._fell_silent = self.pilot, now
        self._prune(now)
        self.pilot = None
        self.state = TRANSITIONS[self.state][Event.SILENCE]
        if self._heard:  # others stream on; none of them flies
            self.state = TRANSITIONS[self.state][Event.SETPOINT]
        return engaged

    def _prune(self, now: float) -> None:
        """Forget clients that have fallen silent, but not the one whose single setpoint is flown."""
        self._heard = {
            sender: heard
            for sender, heard in self._heard.items()
            if self._is_fresh(heard, now) or (self.state is State.SINGLE and sender == self.pilot)
        }

    @staticmethod
    def _is_fresh(heard: _Heard, now: float) -> bool:
        return now < heard.over
