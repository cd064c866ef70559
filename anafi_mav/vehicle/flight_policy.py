"""Policy in front of flight tasks: pilot or programs. No I/O.

The anafi_ros paper has an explicit switch, `skycontroller/offboard`, between manual and offboard control. `PilotSwitch`
is its state; it decides in front of `Control.acquire`. Tasks that stop the drone, land it or lead it home are never
refused (`TaskRules.is_flight`). Automatic is the state that nothing requests: the pilot's stick and a program's command
take the aircraft from each other, as `drone.controller` arbitrates.
"""

from __future__ import annotations

import enum

from anafi_mav import texts
from anafi_mav.vehicle.base.control import Request
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import Source


class State(enum.Enum):
    """State of the switch."""

    PILOT = "programs do not fly the aircraft"
    PROGRAM = "programs fly; sticks and source of the Skycontroller are kept for them"
    AUTOMATIC = "the newer one of the pilot's stick and a program's command flies"


class Event(enum.Enum):
    """Event that changes the state of the switch."""

    GIVE = "a client gives the aircraft to the pilot"
    TAKE = "a client takes it for programs, and the Skycontroller has confirmed that"
    FREE = "a client ends the explicit choice"
    STICK = "the pilot moves a stick, or takes the source"
    LINK_DOWN = "the connection ends, with which the Skycontroller takes everything back"


TRANSITIONS: dict[State, dict[Event, State]] = {
    State.PILOT: {
        Event.GIVE: State.PILOT,
        Event.TAKE: State.PROGRAM,
        Event.FREE: State.AUTOMATIC,
        Event.STICK: State.PILOT,
        Event.LINK_DOWN: State.PILOT,
    },
    State.PROGRAM: {
        Event.GIVE: State.PILOT,
        Event.TAKE: State.PROGRAM,
        Event.FREE: State.AUTOMATIC,
        Event.STICK: State.PILOT,
        Event.LINK_DOWN: State.PILOT,
    },
    State.AUTOMATIC: {
        Event.GIVE: State.PILOT,
        Event.TAKE: State.PROGRAM,
        Event.FREE: State.AUTOMATIC,
        Event.STICK: State.AUTOMATIC,
        Event.LINK_DOWN: State.AUTOMATIC,
    },
}

NUMBERS: dict[State, int] = {State.PILOT: 0, State.PROGRAM: 1, State.AUTOMATIC: 2}
"""Values of ANF_SC_OFFBOARD; 0 and 1 are those of the paper's service."""
BY_NUMBER: dict[int, State] = {number: state for state, number in NUMBERS.items()}


def refusal_of(state: State, request: Request) -> Refused | None:
    """Return the refusal of a request behind a Skycontroller; None: it is permitted.

    A changed setting never moves an aircraft that the pilot has.
    """
    is_of_program = not isinstance(request.by, Source) or request.by.is_program
    if state is State.PILOT and is_of_program and request.rules.is_flight:
        return Refused(request.rules.what, texts.PILOT_SWITCH)
    return None
