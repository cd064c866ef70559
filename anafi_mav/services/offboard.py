"""Offboard: setpoints of a program fly the drone for as long as they keep coming, and not a moment longer.

I/O-free: `OffboardStream` keeps the state, `Vehicle` sends what it says. SET_ATTITUDE_TARGET becomes the stick
vector u = [vz, roll, pitch, yaw rate] of the anafi_ros paper, the only thing ARSDK has:

- roll and pitch of the quaternion: tilt, limited by the drone's own MaxTilt;
- yaw of the quaternion: held by a proportional loop on the yaw rate; a body yaw rate that is not ignored is added
  as feed-forward;
- thrust: 0.5 holds height, 0 and 1 are full descent and climb, in between linear; ignored or NaN is 0.5.

A session has one pilot: whoever engages it. Setpoints of others change nothing while it lasts.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Hashable
from dataclasses import dataclass

from anafi_mav import units
from anafi_mav.mavlink import dialect

SILENCE = 0.45
"""s without a setpoint until the drone is told to hover, so that it has been told within half a second."""

YAW_GAIN = 1.5
"""1/s: turn rate per heading error. Attitude comes at 5 Hz and answers after 0.1-0.2 s, which stays well damped."""


UNIT_TOLERANCE = 0.1
"""How far a quaternion's length may be from 1: single precision and sloppy sums, not garbage."""

THRUST_TOLERANCE = 1e-3
"""How far thrust may be outside of 0..1: rounding, not another unit."""

MAX_PILOTS = 8
"""Programs whose setpoints are listened to at once."""


class State(enum.Enum):
    """Where an offboard session stands."""

    IDLE = "no setpoints"
    STREAMING = "setpoints come, another mode flies"
    ENGAGED = "setpoints fly the drone"


class Event(enum.Enum):
    """What can happen to it."""

    SETPOINT = "a usable setpoint of the pilot arrived"
    ENGAGE = "mode Offboard asked for"
    DISENGAGE = "another mode took over"
    SILENCE = "no setpoint for too long"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {Event.SETPOINT: State.STREAMING, Event.DISENGAGE: State.IDLE},
    State.STREAMING: {
        Event.SETPOINT: State.STREAMING,
        Event.ENGAGE: State.ENGAGED,
        Event.DISENGAGE: State.STREAMING,
        Event.SILENCE: State.IDLE,
    },
    State.ENGAGED: {
        Event.SETPOINT: State.ENGAGED,
        Event.ENGAGE: State.ENGAGED,
        Event.DISENGAGE: State.STREAMING,
        Event.SILENCE: State.IDLE,
    },
}
"""A pair that is missing cannot happen: without setpoints Offboard is refused, and there is no silence to notice."""


@dataclass(frozen=True)
class AttitudeSetpoint:
    """What one SET_ATTITUDE_TARGET asks for."""

    roll: float
    """rad, right wing down +."""
    pitch: float
    """rad, nose up +."""
    yaw: float
    """rad, clockwise from north."""
    yaw_rate: float
    """rad/s, clockwise +; feed-forward."""
    climb: float
    """-1 full descent .. 1 full climb."""


def attitude_setpoint(message: dialect.MAVLink_set_attitude_target_message) -> AttitudeSetpoint | str:
    """The setpoint in a message, or one sentence on why it cannot be flown."""
    mask = message.type_mask
    if mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE:
        return "body rates alone cannot be flown: an ANAFI takes angles"
    try:
        roll, pitch, yaw = units.euler_from_quaternion(*message.q)
    except ValueError:
        return "the attitude quaternion is no rotation"
    if not abs(math.hypot(*message.q) - 1.0) <= UNIT_TOLERANCE:
        return "the attitude quaternion is not of length 1"
    if abs(roll) > math.pi / 2:
        return "the attitude quaternion is upside down"
    yaw_rate = 0.0
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE and math.isfinite(message.body_yaw_rate):
        yaw_rate = message.body_yaw_rate
    thrust = 0.5
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE and math.isfinite(message.thrust):
        if not -THRUST_TOLERANCE <= message.thrust <= 1.0 + THRUST_TOLERANCE:
            return "thrust is not between 0 and 1"
        thrust = units.clip(message.thrust, 0.0, 1.0)
    return AttitudeSetpoint(roll, pitch, yaw, yaw_rate, 2.0 * thrust - 1.0)


def yaw_rate_towards(setpoint: AttitudeSetpoint, yaw: float) -> float:
    """Turn rate (rad/s, clockwise +) that brings a drone heading `yaw` (rad) to the setpoint the short way."""
    return setpoint.yaw_rate + YAW_GAIN * units.wrap_pi(setpoint.yaw - yaw)


class OffboardStream:
    """The newest setpoints, their age, and whose of them fly the drone."""

    def __init__(self) -> None:
        self.state = State.IDLE
        self.pilot: Hashable = None
        """Whose setpoints fly the drone while the session is engaged."""
        self._heard: dict[Hashable, tuple[AttitudeSetpoint, float]] = {}

    @property
    def setpoint(self) -> AttitudeSetpoint | None:
        """The pilot's newest setpoint; None while no session is engaged."""
        heard = self._heard.get(self.pilot) if self.state is State.ENGAGED else None
        return None if heard is None else heard[0]

    def age(self, now: float) -> float:
        """Seconds since the pilot's newest setpoint; 0 while no session is engaged."""
        return now - self._heard[self.pilot][1] if self.state is State.ENGAGED else 0.0

    def receive(self, sender: Hashable, setpoint: AttitudeSetpoint, now: float) -> bool:
        """A usable setpoint arrived. False: somebody else flies, or too many want to."""
        if sender not in self._heard and len(self._heard) >= MAX_PILOTS:
            self._heard = {other: heard for other, heard in self._heard.items() if self._is_fresh(heard, now)}
            if len(self._heard) >= MAX_PILOTS:
                return False
        self._heard[sender] = (setpoint, now)
        if self.state is State.ENGAGED and sender != self.pilot:
            return False
        self.state = TRANSITIONS[self.state][Event.SETPOINT]
        return True

    def candidate(self, client: Hashable, now: float) -> Hashable | None:
        """Whose setpoints mode Offboard would fly if this client asked for it: its own, else the newest of all.

        None: nobody's are fresh, mode Offboard is to be refused.
        """
        fresh = {sender: heard for sender, heard in self._heard.items() if self._is_fresh(heard, now)}
        if client in fresh:
            return client
        return max(fresh, key=lambda sender: fresh[sender][1], default=None)

    def engage(self, pilot: Hashable) -> None:
        """Mode Offboard begins, flown by a `candidate`."""
        self.state, self.pilot = TRANSITIONS[self.state][Event.ENGAGE], pilot

    def disengage(self) -> None:
        """Another mode takes over; setpoints may go on coming."""
        self.state, self.pilot = TRANSITIONS[self.state][Event.DISENGAGE], None

    def deadline(self) -> float | None:
        """When silence will have lasted too long; None while there is nothing to wait for."""
        if self.state is State.IDLE:
            return None
        if self.state is State.ENGAGED:
            return self._heard[self.pilot][1] + SILENCE
        return max(at for _, at in self._heard.values()) + SILENCE

    def expire(self, now: float) -> bool:
        """True when silence just ended an engaged session: the drone must hover now."""
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return False
        engaged = self.state is State.ENGAGED
        self._heard = {sender: heard for sender, heard in self._heard.items() if self._is_fresh(heard, now)}
        self.pilot = None
        self.state = TRANSITIONS[self.state][Event.SILENCE]
        if self._heard:  # others stream on; none of them flies
            self.state = TRANSITIONS[self.state][Event.SETPOINT]
        return engaged

    @staticmethod
    def _is_fresh(heard: tuple[AttitudeSetpoint, float], now: float) -> bool:
        return now < heard[1] + SILENCE
