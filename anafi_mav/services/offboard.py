"""Offboard: setpoints of a program fly the drone for as long as they keep coming, and not a moment longer.

I/O-free: `OffboardStream` keeps the state, `Vehicle` sends what it says. SET_ATTITUDE_TARGET becomes the stick
vector u = [vz, roll, pitch, yaw rate] of the anafi_ros paper, the only thing ARSDK has:

- roll and pitch of the quaternion: tilt, limited by the drone's own MaxTilt;
- yaw of the quaternion: held by a proportional loop on the yaw rate; a body yaw rate that is not ignored is added
  as feed-forward;
- thrust: 0.5 holds height, 0 and 1 are full descent and climb, in between linear; ignored or NaN is 0.5.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from anafi_mav import units
from anafi_mav.mavlink import dialect

SILENCE = 0.45
"""s without a setpoint until the drone is told to hover, so that it has been told within half a second."""

YAW_GAIN = 1.5
"""1/s: turn rate per heading error. Attitude comes at 5 Hz and answers after 0.1-0.2 s, which stays well damped."""


class State(enum.Enum):
    """Where an offboard session stands."""

    IDLE = "no setpoints"
    STREAMING = "setpoints come, another mode flies"
    ENGAGED = "setpoints fly the drone"


class Event(enum.Enum):
    """What can happen to it."""

    SETPOINT = "a usable setpoint arrived"
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
    if abs(roll) > math.pi / 2:
        return "the attitude quaternion is upside down"
    yaw_rate = 0.0
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE and math.isfinite(message.body_yaw_rate):
        yaw_rate = message.body_yaw_rate
    thrust = 0.5
    if not mask & dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE and math.isfinite(message.thrust):
        thrust = units.clip(message.thrust, 0.0, 1.0)
    return AttitudeSetpoint(roll, pitch, yaw, yaw_rate, 2.0 * thrust - 1.0)


def yaw_rate_towards(setpoint: AttitudeSetpoint, yaw: float) -> float:
    """Turn rate (rad/s, clockwise +) that brings a drone heading `yaw` (rad) to the setpoint the short way."""
    return setpoint.yaw_rate + YAW_GAIN * units.wrap_pi(setpoint.yaw - yaw)


class OffboardStream:
    """The newest setpoint, its age, and whether it flies the drone."""

    def __init__(self) -> None:
        self.state = State.IDLE
        self.setpoint: AttitudeSetpoint | None = None
        self._received = -math.inf

    def receive(self, setpoint: AttitudeSetpoint, now: float) -> None:
        """A usable setpoint arrived."""
        self.setpoint, self._received = setpoint, now
        self.state = TRANSITIONS[self.state][Event.SETPOINT]

    def fresh(self, now: float) -> bool:
        """Setpoints arrive: mode Offboard may be engaged."""
        deadline = self.deadline()
        return deadline is not None and now < deadline

    def engage(self) -> None:
        """Mode Offboard begins; only while setpoints are `fresh`."""
        self.state = TRANSITIONS[self.state][Event.ENGAGE]

    def disengage(self) -> None:
        """Another mode takes over; setpoints may go on coming."""
        self.state = TRANSITIONS[self.state][Event.DISENGAGE]

    def deadline(self) -> float | None:
        """When silence will have lasted too long; None while there is nothing to wait for."""
        return None if self.state is State.IDLE else self._received + SILENCE

    def expire(self, now: float) -> bool:
        """True when silence just ended an engaged session: the drone must hover now."""
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return False
        engaged = self.state is State.ENGAGED
        self.state, self.setpoint = TRANSITIONS[self.state][Event.SILENCE], None
        return engaged
