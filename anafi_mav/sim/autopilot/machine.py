"""The flying state of the aircraft as a table: {state: {event: next state}}.

States are Parrot's (ardrone3 FlyingStateChanged). An event without an entry does not count in that state: the drone
stays as it is and, as ARSDK knows no refusal, says nothing. The order of states is the one Olympe's and anafi_ros's
users see; that a Landing is taken while the motors ramp up, and an Emergency on the ground, is assumed.
"""

from __future__ import annotations

import enum

from anafi_mav.arsdk.messages.ardrone3 import FlyingState


class Event(enum.Enum):
    """Events of the flying-state machine; the value names the cause."""

    TAKE_OFF = "command TakeOff, accepted"
    USER_TAKE_OFF = "command UserTakeOff(1), accepted"
    USER_TAKE_OFF_CANCEL = "command UserTakeOff(0)"
    LAND = "command Landing, or the end of a return home that is to land"
    EMERGENCY = "command Emergency"
    CLIMB = "positive gaz in a PCMD"
    ABORT_LANDING = "command TakeOff, or SmartTakeOffLand on the Ai, in a landing"
    FORCED_LANDING = "battery empty"
    RAMPED_UP = "motors at speed, take-off wanted"
    IDLING = "motors at speed, hand launch wanted"
    THROWN = "the drone is thrown"
    AIRBORNE = "take-off height reached"
    BUSY = "sticks, a move, a return, or still moving"
    AT_REST = "no task and no motion"
    TOUCHDOWN = "on the ground"
    SETTLED = "motors off and at rest for a moment"


LANDED = FlyingState.LANDED
TAKINGOFF = FlyingState.TAKINGOFF
HOVERING = FlyingState.HOVERING
FLYING = FlyingState.FLYING
LANDING = FlyingState.LANDING
EMERGENCY = FlyingState.EMERGENCY
USERTAKEOFF = FlyingState.USERTAKEOFF
MOTOR_RAMPING = FlyingState.MOTOR_RAMPING
EMERGENCY_LANDING = FlyingState.EMERGENCY_LANDING

TRANSITIONS: dict[FlyingState, dict[Event, FlyingState]] = {
    LANDED: {
        Event.TAKE_OFF: MOTOR_RAMPING,
        Event.USER_TAKE_OFF: MOTOR_RAMPING,
        Event.EMERGENCY: EMERGENCY,
    },
    MOTOR_RAMPING: {
        Event.RAMPED_UP: TAKINGOFF,
        Event.IDLING: USERTAKEOFF,
        Event.USER_TAKE_OFF_CANCEL: LANDED,
        Event.LAND: LANDING,
        Event.EMERGENCY: EMERGENCY,
    },
    USERTAKEOFF: {
        Event.THROWN: TAKINGOFF,
        Event.USER_TAKE_OFF_CANCEL: LANDED,
        Event.EMERGENCY: EMERGENCY,
    },
    TAKINGOFF: {
        Event.AIRBORNE: HOVERING,
        Event.LAND: LANDING,
        Event.FORCED_LANDING: EMERGENCY_LANDING,
        Event.EMERGENCY: EMERGENCY,
    },
    HOVERING: {
        Event.BUSY: FLYING,
        Event.LAND: LANDING,
        Event.FORCED_LANDING: EMERGENCY_LANDING,
        Event.EMERGENCY: EMERGENCY,
    },
    FLYING: {
        Event.AT_REST: HOVERING,
        Event.LAND: LANDING,
        Event.FORCED_LANDING: EMERGENCY_LANDING,
        Event.EMERGENCY: EMERGENCY,
    },
    LANDING: {
        Event.CLIMB: FLYING,
        Event.ABORT_LANDING: FLYING,
        Event.TOUCHDOWN: LANDED,
        Event.FORCED_LANDING: EMERGENCY_LANDING,
        Event.EMERGENCY: EMERGENCY,
    },
    EMERGENCY_LANDING: {
        Event.TOUCHDOWN: LANDED,
        Event.EMERGENCY: EMERGENCY,
    },
    EMERGENCY: {
        Event.SETTLED: LANDED,
    },
}

AIRBORNE = frozenset({TAKINGOFF, HOVERING, FLYING, LANDING, EMERGENCY_LANDING})
"""States in which the motors carry the drone."""

GUIDED = frozenset({HOVERING, FLYING})
"""States that take sticks, moves and returns."""


def next_state(state: FlyingState, event: Event) -> FlyingState | None:
    """Return the state to which `event` leads from `state`, or None when it is ignored there."""
    return TRANSITIONS[state].get(event)
