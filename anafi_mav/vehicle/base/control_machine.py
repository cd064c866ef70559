"""The active flight task of a vehicle: states, events and transitions. No I/O.

`Control` is the shell: it ends, waits and checks, and reports each step here. Everything that decides which task flies
the drone is in this module:

* At most one task is active. Below it is a hovering mode (Hold, Guided, Position), which is active after the task.
* A request is an `Attempt`, a value with a number. What is reported of an attempt that a newer request has replaced
  changes nothing.
* While a request is pending nothing flies. If it fails, the hovering mode of before is active again, never a task:
  a move that the drone has flown on with is adopted (`Control.acquire`).
* A landing, a return or a motor cut that no task commanded ends the active task, and leaves the hovering mode.
* A pause lasts until another mode or a command: streams cannot leave it.
* One task at most follows the active one (the successor of a take-off): any request withdraws it.

A task is opaque here. `State` is derived from the situation: no joint state exists that the table does not have.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import Generic, TypeVar

from msgspec import Struct
from msgspec.structs import replace

TaskT = TypeVar("TaskT")


class State(enum.Enum):
    """State of the control of one vehicle."""

    IDLE = "no task: the drone stands, or hovers in Hold"
    RELEASING = "a task is requested, and what flew before is ending"
    ACQUIRING = "that has ended; the drone is prepared for the requested task"
    ACTIVE = "a flight task or a chosen hovering mode is active"
    PAUSED = "a client has paused: no stream flies"
    DRONE_ACTS = "the drone lands, returns or has cut its motors, and no task commanded it"


class Event(enum.Enum):
    """Event that changes the state."""

    REQUEST = "a task is requested, and its needs are met"
    RELEASED = "what flew before has ended, or its time to end is over"
    GRANT = "the drone is ready: the requested task is active"
    FAIL = "the request was refused, failed or was cancelled"
    ADOPT = "the drone flies a task already"
    SUCCEED = "a task is to follow the active one"
    FINISH = "a task is over"
    LOSE = "control is lost to the pilot, or its conditions are no longer met"
    RESUME = "a client ends the pause"
    DESCEND = "the drone lands, returns or cuts its motors"
    HOVER = "that is over, and the drone hovers"
    GROUND = "the drone stands"
    LINK_DOWN = "the link is lost"


class DroneAct(enum.Enum):
    """Descent or motor cut that no task has commanded."""

    LANDING = "landing"
    RETURN = "return"
    EMERGENCY = "motor cut"


ADOPTED = 0
"""Number of an adoption: that of no attempt, so that the end of an attempt does not end what was adopted since."""


class Attempt(Struct, Generic[TaskT], frozen=True):
    """One request of a task."""

    task: TaskT | None
    """None: the drone only stops for something that is no flight task (maintenance)."""
    number: int
    below: TaskT | None = None
    """The hovering mode that is active once the task is over."""
    keeps_below: bool = False
    """The hovering mode and the pause of before stay as they are."""
    pauses: bool = False
    is_urgent: bool = False
    """Nothing replaces it before it has ended: the motors are being cut."""
    is_stop: bool = False
    """It stops the drone: its hovering mode, and its pause, count from a newer request on that replaces it."""


class Situation(Struct, Generic[TaskT], frozen=True):
    """The whole state of the control."""

    below: TaskT | None = None
    """The hovering mode; None: Hold."""
    task: TaskT | None = None
    """The active flight task, above the hovering mode."""
    granted: int = 0
    """Number of the attempt by which it is active; `ADOPTED` if it was adopted or has followed another task."""
    is_paused: bool = False
    act: DroneAct | None = None
    pending: Attempt[TaskT] | None = None
    is_released: bool = False
    """What flew before the pending attempt has ended."""
    successor: TaskT | None = None
    epoch: int = 0
    """Counts requests, and what ends all commands: the ground, the loss of the link."""

    @property
    def state(self) -> State:
        """The state that the fields amount to."""
        if self.pending is not None:
            return State.ACQUIRING if self.is_released else State.RELEASING
        if self.act is not None:
            return State.DRONE_ACTS
        if self.is_paused:
            return State.PAUSED
        return State.IDLE if self.task is None and self.below is None else State.ACTIVE

    @property
    def holds_streams(self) -> bool:
        """True while a client's pause is in force, or is about to be."""
        return self.is_paused or (self.pending is not None and self.pending.pauses)

    @property
    def shown(self) -> tuple[TaskT | None, TaskT | None]:
        """Return the task and the hovering mode that make the mode.

        While a request is pending its effect is not shown yet, and the old one no more: the hovering mode alone is
        shown, and Hold where the request leaves it.
        """
        pending = self.pending
        if pending is None:
            return self.task, self.below
        return None, self.below if pending.keeps_below or pending.below == self.below else None


class Input(Struct, Generic[TaskT], frozen=True):
    """Subject of an event."""

    attempt: Attempt[TaskT] | None = None
    """Of REQUEST, RELEASED, GRANT, FAIL; of ADOPT its result."""
    task: TaskT | None = None
    """Of SUCCEED and FINISH; of GROUND and DESCEND the task whose own end that is."""
    number: int | None = None
    """Of FINISH: the attempt by which the task was active; None: whichever it is."""
    act: DroneAct | None = None


class Step(Struct, Generic[TaskT], frozen=True):
    """The next situation, and the effects of the event."""

    situation: Situation[TaskT]
    ended: tuple[TaskT, ...] = ()
    """Tasks that fly no further: each is to be ended at once."""
    begun: TaskT | None = None
    """The successor that is active from now on."""


REST = (State.IDLE, State.ACTIVE, State.PAUSED, State.DRONE_ACTS)
"""States without a request."""
_HOVERS = (State.IDLE, State.ACTIVE, State.PAUSED)
_ANYWHERE: dict[Event, tuple[State, ...]] = {
    Event.REQUEST: (State.RELEASING,),
    Event.ADOPT: (State.ACTIVE, State.PAUSED, State.IDLE),
    Event.DESCEND: (State.DRONE_ACTS,),
    Event.GROUND: (State.IDLE,),
    Event.LINK_DOWN: (State.IDLE,),
}


def _requested(state: State) -> dict[Event, tuple[State, ...]]:
    """Return the events of both states of a request, most of which leave it as it is."""
    untouched = (
        Event.ADOPT,
        Event.SUCCEED,
        Event.FINISH,
        Event.LOSE,
        Event.RESUME,
        Event.DESCEND,
        Event.HOVER,
        Event.GROUND,
    )
    return {
        Event.REQUEST: (State.RELEASING,),
        Event.FAIL: REST,
        **dict.fromkeys(untouched, (state,)),
        Event.LINK_DOWN: (State.IDLE,),
    }


TRANSITIONS: dict[State, dict[Event, tuple[State, ...]]] = {
    State.IDLE: {**_ANYWHERE, Event.SUCCEED: (State.IDLE,), Event.FINISH: (State.IDLE,)},
    State.RELEASING: {**_requested(State.RELEASING), Event.RELEASED: (State.ACQUIRING,)},
    State.ACQUIRING: {**_requested(State.ACQUIRING), Event.GRANT: _HOVERS},
    State.ACTIVE: {
        **_ANYWHERE,
        Event.SUCCEED: (State.ACTIVE,),
        Event.FINISH: (State.ACTIVE, State.IDLE),
        Event.LOSE: (State.IDLE,),
    },
    State.PAUSED: {
        **_ANYWHERE,
        Event.SUCCEED: (State.PAUSED,),
        Event.FINISH: (State.PAUSED,),
        Event.LOSE: (State.IDLE,),
        Event.RESUME: (State.ACTIVE, State.IDLE),
    },
    State.DRONE_ACTS: {
        **_ANYWHERE,
        Event.ADOPT: (State.ACTIVE, State.PAUSED, State.DRONE_ACTS),
        Event.SUCCEED: (State.DRONE_ACTS,),
        Event.FINISH: (State.DRONE_ACTS,),
        Event.LOSE: (State.DRONE_ACTS,),
        Event.RESUME: (State.DRONE_ACTS,),
        Event.HOVER: _HOVERS,
    },
}
"""Possible next states. A pair that is missing changes nothing: it comes too late, or is of another attempt."""


def step(situation: Situation[TaskT], event: Event, about: Input[TaskT] | None = None) -> Step[TaskT]:
    """Return the next situation and the effects of an event."""
    if event not in TRANSITIONS[situation.state]:
        return Step(situation)
    following: Callable[[Situation[TaskT], Input[TaskT]], Step[TaskT]] = _STEPS[event]
    return following(situation, about or Input())


def _request(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    attempt = about.attempt
    if attempt is None or (now.pending is not None and now.pending.is_urgent):
        return Step(now)
    after = replace(
        now, task=None, successor=None, pending=attempt, is_released=False, epoch=max(now.epoch + 1, attempt.number)
    )
    if now.pending is not None and now.pending.is_stop:  # the drone may have obeyed: no older stream flies it on
        after = replace(after, below=now.pending.below, is_paused=now.pending.pauses)
    return Step(after, _those(now.task, now.below, now.successor))


def _released(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    return Step(replace(now, is_released=True)) if _is_pending(now, about) else Step(now)


def _grant(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    attempt = about.attempt
    if attempt is None or not _is_pending(now, about):
        return Step(now)
    after = _with(replace(now, pending=None, is_released=False, act=None), attempt)
    return Step(after, () if now.task is None or now.task is attempt.task else (now.task,))


def _fail(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    return Step(replace(now, pending=None, is_released=False)) if _is_pending(now, about) else Step(now)


def _adopt(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    attempt = about.attempt
    if attempt is None:
        return Step(now)
    successor = now.successor if attempt.task is not None and attempt.task is now.task else None
    others = _those(now.task, now.below, now.successor if successor is None else None)
    act = now.act if attempt.task is None else None
    after = _with(replace(now, successor=successor, act=act), attempt)
    return Step(after, tuple(task for task in others if task is not attempt.task))


def _succeed(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    if about.task is now.task:
        return Step(now)
    replaced = now.successor if now.successor is not about.task else None
    return Step(replace(now, successor=about.task), _those(replaced))


def _finish(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    if about.task is None:
        return Step(now)
    if about.task is now.successor:
        return Step(replace(now, successor=None), (about.task,))
    if about.task is not now.task or about.number not in (None, now.granted):
        return Step(now)
    after = replace(now, task=now.successor, successor=None, granted=ADOPTED)  # no request has begun the successor
    return Step(after, (about.task,), now.successor)


def _lose(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    after = replace(now, task=None, below=None, successor=None, is_paused=False)
    return Step(after, _those(now.task, now.below, now.successor))


def _resume(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    return Step(replace(now, is_paused=False))


def _descend(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    # The hovering mode ends too: a stream that was flown in it would fly the drone away from home, or off again.
    after = replace(now, act=about.act or now.act or DroneAct.LANDING, task=None, below=None, successor=None)
    return Step(after, _those(now.task, now.below, now.successor))


def _hover(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    return Step(replace(now, act=None))


def _ground(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    after: Situation[TaskT] = Situation(pending=now.pending, is_released=now.is_released, epoch=now.epoch + 1)
    ended = _those(now.task, now.below, now.successor)
    return Step(after, tuple(task for task in ended if task is not about.task))


def _link_down(now: Situation[TaskT], about: Input[TaskT]) -> Step[TaskT]:
    return Step(Situation(epoch=now.epoch + 1), _those(now.task, now.below, now.successor))


_STEPS: dict[Event, Callable[..., Step[TaskT]]] = {
    Event.REQUEST: _request,
    Event.RELEASED: _released,
    Event.GRANT: _grant,
    Event.FAIL: _fail,
    Event.ADOPT: _adopt,
    Event.SUCCEED: _succeed,
    Event.FINISH: _finish,
    Event.LOSE: _lose,
    Event.RESUME: _resume,
    Event.DESCEND: _descend,
    Event.HOVER: _hover,
    Event.GROUND: _ground,
    Event.LINK_DOWN: _link_down,
}


def _with(now: Situation[TaskT], attempt: Attempt[TaskT]) -> Situation[TaskT]:
    """Return the situation in which this attempt's task is active."""
    successor = now.successor if now.successor is not attempt.task else None
    now = replace(now, task=attempt.task, granted=attempt.number, successor=successor)
    return now if attempt.keeps_below else replace(now, below=attempt.below, is_paused=attempt.pauses)


def _is_pending(now: Situation[TaskT], about: Input[TaskT]) -> bool:
    """Return True when the event is of the attempt that is pending."""
    return now.pending is not None and about.attempt is not None and about.attempt.number == now.pending.number


def _those(*tasks: TaskT | None) -> tuple[TaskT, ...]:
    return tuple(task for task in tasks if task is not None)
