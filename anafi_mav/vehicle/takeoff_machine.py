"""Arming and the take-off of one vehicle: states, events and transitions. No I/O.

Two facts that go together: which clients have armed, and the take-off that one of them has commanded. The armed state
expires while the drone stands, and so does a take-off that waits for its client to arm. A take-off is a value of its
own: the end of one never ends another.

The task that flies a take-off is opaque here. `State` is derived from the two facts; `Takeoff` is the shell.
"""

from __future__ import annotations

import enum
from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

TaskT = TypeVar("TaskT")


class State(enum.Enum):
    """State of arming and take-off."""

    DISARMED = "no client has armed, and no take-off is commanded"
    WAITING = "a take-off is accepted and waits until its client arms; others may have armed"
    ARMED = "a client has armed, and no take-off is under way"
    LIFTING = "the drone takes off to its own height"
    CLIMBING = "the drone climbs from there to the requested height"


class Event(enum.Enum):
    """Event that changes the state."""

    ARM = "a client has armed"
    DISARM = "a client has disarmed, or the armed state has expired"
    REQUEST = "a take-off is accepted whose client has not armed"
    START = "a take-off begins, in a task of its own"
    LIFT = "TakeOff is about to be sent, or the drone has left the ground: the armed state does not expire"
    STAND = "the drone has not taken off: the armed state expires again"
    CLIMB = "the drone has taken off to its own height"
    END = "the take-off is over, has expired, or another flight task is active"
    GROUND = "the drone has come down"
    LINK_DOWN = "the link is lost"


@dataclass(frozen=True)
class Arming:
    """An armed state that clients have caused."""

    clients: frozenset[Hashable]
    until: float | None
    """When it expires (s, loop clock); None: not while the drone takes off or flies."""


@dataclass(frozen=True)
class WaitingTakeoff:
    """A take-off that waits until its client arms."""

    height: float
    """m above take-off."""
    client: Hashable
    until: float
    """When it expires (s, loop clock)."""


@dataclass(frozen=True)
class RunningTakeoff(Generic[TaskT]):
    """A take-off that is under way."""

    task: TaskT
    height: float
    """m above take-off."""
    climbs: bool = False
    """The drone has taken off to its own height."""


@dataclass(frozen=True)
class TakeoffSituation(Generic[TaskT]):
    """The whole state of arming and take-off."""

    arming: Arming | None = None
    attempt: WaitingTakeoff | RunningTakeoff[TaskT] | None = None

    @property
    def state(self) -> State:
        """The state that the fields amount to."""
        match self.attempt:
            case WaitingTakeoff():
                return State.WAITING
            case RunningTakeoff(climbs=climbs):
                return State.CLIMBING if climbs else State.LIFTING
        return State.DISARMED if self.arming is None else State.ARMED

    @property
    def task(self) -> TaskT | None:
        """The task of the take-off that is under way."""
        return self.attempt.task if isinstance(self.attempt, RunningTakeoff) else None

    @property
    def deadline(self) -> float | None:
        """When the next fact expires (s, loop clock); None: nothing expires."""
        expiring = (one for one in (self.arming, self.attempt) if isinstance(one, Arming | WaitingTakeoff))
        return min((one.until for one in expiring if one.until is not None), default=None)


_RESTS = (State.DISARMED, State.ARMED)
_ANYWHERE: dict[Event, tuple[State, ...]] = {
    Event.REQUEST: (State.WAITING,),
    Event.START: (State.LIFTING,),
    Event.LINK_DOWN: (State.DISARMED,),
}


def _within(state: State) -> dict[Event, tuple[State, ...]]:
    """Return the events of the armed state, which leave a take-off as it is."""
    return dict.fromkeys((Event.ARM, Event.DISARM, Event.LIFT, Event.STAND), (state,))


TRANSITIONS: dict[State, dict[Event, tuple[State, ...]]] = {
    State.DISARMED: {**_ANYWHERE, Event.ARM: (State.ARMED,)},
    State.WAITING: {**_ANYWHERE, **_within(State.WAITING), Event.END: _RESTS, Event.GROUND: (State.DISARMED,)},
    State.ARMED: {
        **_ANYWHERE,
        **_within(State.ARMED),
        Event.DISARM: (State.DISARMED,),
        Event.GROUND: (State.DISARMED,),
    },
    State.LIFTING: {
        **_ANYWHERE,
        **_within(State.LIFTING),
        Event.CLIMB: (State.CLIMBING,),
        Event.END: _RESTS,
        Event.GROUND: (State.LIFTING,),
    },
    State.CLIMBING: {
        **_ANYWHERE,
        **_within(State.CLIMBING),
        Event.END: _RESTS,
        Event.GROUND: (State.CLIMBING,),
    },
}
"""Possible next states. A pair that is missing changes nothing. A take-off under way reports by itself that the drone
has come down."""


def step(
    now: TakeoffSituation[TaskT],
    event: Event,
    *,
    client: Hashable = None,
    until: float | None = None,
    attempt: WaitingTakeoff | RunningTakeoff[TaskT] | None = None,
) -> TakeoffSituation[TaskT]:
    """Return the next situation.

    `client` is the one that arms; `until` is when the armed state expires, after ARM and STAND; `attempt` is what
    REQUEST and START begin.
    """
    if event not in TRANSITIONS[now.state]:
        return now
    arming = now.arming
    match event:
        case Event.ARM:
            others = frozenset() if arming is None else arming.clients
            return replace(now, arming=Arming(others | {client}, until))
        case Event.LIFT | Event.STAND if arming is not None:
            return replace(now, arming=replace(arming, until=until))
        case Event.DISARM:
            return replace(now, arming=None)
        case Event.REQUEST | Event.START:
            return replace(now, attempt=attempt)
        case Event.CLIMB if isinstance(now.attempt, RunningTakeoff):
            return replace(now, attempt=replace(now.attempt, climbs=True))
        case Event.END:
            return replace(now, attempt=None)
        case Event.GROUND:
            return TakeoffSituation(attempt=now.attempt if isinstance(now.attempt, RunningTakeoff) else None)
        case Event.LINK_DOWN:
            return TakeoffSituation()
    return now
