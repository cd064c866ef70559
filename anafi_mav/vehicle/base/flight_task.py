"""Flight tasks: needs as data, preparation of the drone, and the actions that run them.

At most one flight task is active (`Control`). Offboard setpoints, a target to follow, a mission, a goto, a take-off
and a return are flight tasks. Hold, Guided and Position are hovering modes: what is active below a task and after it.

Every wait between a request and the first command of its task is a step of its `Preparing`, so that `Control` checks
all conditions of the request again after each of them. What is true of one request only is in its `DescentEnd`.

An action of a client that acquires control ends all older ones. A newer one continues: it will replace this one.
"""

from __future__ import annotations

import asyncio
import enum
import itertools
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from operator import attrgetter
from typing import Protocol

from msgspec import Struct

from anafi_mav import texts
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.texts import Subject
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import Extent, Right


class Needs(enum.Flag):
    """Conditions that a task needs.

    They are checked before what flies is ended, and again when it has ended.
    """

    NONE = 0
    NO_DESCENT = enum.auto()
    """The drone neither lands nor returns, and was not commanded to."""
    STANDS = enum.auto()
    """The drone is on the ground with its motors off, and no take-off of ours is about to begin.

    After a motor cut it may still be falling.
    """
    IN_AIR = enum.auto()
    FIX = enum.auto()
    NO_PILOT = enum.auto()
    """The pilot at a Skycontroller has not just acquired control."""
    LIMITS = enum.auto()
    """The drone has reported its tilt and speed limits."""
    PLAIN_STICKS = enum.auto()
    """Stick input is relative to the drone's nose, not to its camera."""
    ROLL_SIGN = enum.auto()
    """The reported roll has not been found inverted."""


STEERING = Needs.NO_PILOT | Needs.PLAIN_STICKS | Needs.ROLL_SIGN
"""Conditions that a task that flies by sticks needs until its end: without one of them control is lost."""


@cache
def lasting_needs(needs: Needs) -> Needs:
    """Return those of a task's needs that last until its end."""
    return needs & STEERING


class Preparation(enum.Enum):
    """How the drone is prepared for a task."""

    AS_IT_IS = "nothing is sent: the task itself replaces the motion, or stops it"
    HOVER = "hover, without waiting: what moves is cancelled, the sticks are centred"
    STOP = "stop, and wait until the drone has confirmed the end of its moves"
    END_LANDING = "a landing that the request may end is ended"
    RISE_AGAIN = "a landing that the request may end is ended, by a TakeOff too"
    END_DESCENT = "a landing or return that the request may end is ended, then the drone stops"


ENDS_LANDING = (Preparation.END_LANDING, Preparation.RISE_AGAIN, Preparation.END_DESCENT)
"""A landing is ended, or the request is refused."""


class PreparationStep(enum.Enum):
    """A step of a preparation; its value is the explanation."""

    HOVER = "cancel what moves, without waiting"
    STOP = "stop, and wait until the drone has confirmed it"
    CANCEL_RETURN = "cancel a return that a user has commanded, also one that is not reported yet"
    CANCEL_OWN_RETURN = "cancel the return that the drone flew by itself when the request arrived"
    END_LANDING = "end the landing that is reported"
    SETTLE_LANDING = "wait until it is known whether a withdrawn Landing has begun all the same"
    RISE_AGAIN = "end the landing by gaz and a TakeOff"
    ANSWER_ANNOUNCED = "cancel the return that the drone has announced, or notify the clients how that is done"


_STEPS: Mapping[Preparation, tuple[PreparationStep, ...]] = {
    Preparation.AS_IT_IS: (PreparationStep.CANCEL_RETURN,),
    Preparation.HOVER: (PreparationStep.CANCEL_RETURN, PreparationStep.HOVER),
    Preparation.STOP: (PreparationStep.STOP, PreparationStep.CANCEL_RETURN),
    Preparation.END_LANDING: (PreparationStep.SETTLE_LANDING, PreparationStep.END_LANDING),
    Preparation.RISE_AGAIN: (PreparationStep.SETTLE_LANDING, PreparationStep.RISE_AGAIN),
    Preparation.END_DESCENT: (
        PreparationStep.END_LANDING,
        PreparationStep.CANCEL_OWN_RETURN,
        PreparationStep.STOP,
        PreparationStep.CANCEL_RETURN,
        PreparationStep.SETTLE_LANDING,
        PreparationStep.END_LANDING,
        PreparationStep.ANSWER_ANNOUNCED,
    ),
}


@dataclass(frozen=True)
class TaskRules:
    """Differences of a flight task from the others, as data."""

    what: Subject
    """For texts: `{what} refused: {reason}` and `{what} ended: {reason}`."""
    needs: Needs = Needs.NONE
    start: Preparation = Preparation.AS_IT_IS
    wait: float | None = None
    """s that the tasks before it may take to end; None: however long it takes. After that they can send nothing."""
    is_urgent: bool = False
    """It is sent first, and does not wait for the end of anything; nothing replaces it."""
    lasts: bool = True
    """It is active until it ends; else it is over as soon as its command to the drone is."""
    is_hover: bool = False
    """A hovering mode: active below a task and after it."""
    is_stream: bool = False
    """Setpoints of a client: they never leave a pause."""
    needs_operator: bool = False
    """It flies by sticks or setpoints: while there is an operator, no other station may begin it."""
    keeps_below: bool = False
    """The hovering mode of before stays chosen, and so does a pause."""
    ends_landing: Extent | None = None
    """Landings that it ends, as far as its client's right covers them; None: it ends none."""
    ends_return: Extent | None = None
    """Returns that it ends, likewise."""
    follows: bool = False
    """During a take-off, or at the end of a mission, it follows the active task instead of ending it."""
    needs_link: bool = False
    """The gateway keeps it going, or stops it when the link is back. The drone goes on with others by itself."""
    is_flight: bool = True
    """A policy may refuse it; False: it stops the drone, lands it, leads it home, or nothing flies meanwhile."""


STOP_WAIT = 0.5
"""s that a stopping command waits for the action that it replaces.

An action that has not ended by then can send nothing.
"""


def stop_rules(
    what: Subject, landing: Extent | None, to_home: Extent | None, start: Preparation = Preparation.END_DESCENT
) -> TaskRules:
    """Return the rules of a stop that ends these landings and returns; then the drone hovers."""
    return TaskRules(
        what, start=start, wait=STOP_WAIT, is_hover=True, ends_landing=landing, ends_return=to_home, is_flight=False
    )


def end_of_descent(rules: TaskRules, start: Preparation = Preparation.END_DESCENT) -> TaskRules:
    """Return the rules of the stop that ends, before a task, what the task may end."""
    return stop_rules(rules.what, rules.ends_landing, rules.ends_return, start)


class FlightTask(Protocol):
    """A flight task, or a hovering mode."""

    @property
    def rules(self) -> TaskRules:
        """Differences from other tasks."""

    @property
    def mode(self) -> FlightMode | None:
        """The mode that is shown while it is active; None: the hovering mode below it."""

    @property
    def owns_descent(self) -> bool:
        """True when a landing or return that begins now is the task's own."""

    def begin(self) -> None:
        """Begin as the successor of a task that is over; only `Control` calls it."""

    def end(self) -> list[asyncio.Task[None]]:
        """End this task, because something else flies now; earlier setpoints no longer count.

        Returns tasks that are about to end.

        Never waits, never raises, and does nothing when the task is not active. Only `Control` calls it.
        """

    def is_flown(self, piloting: Piloting) -> bool:
        """Return True when the drone flies this task on although it has ended.

        A move goes on until another command.
        """


class PlainTask:
    """Base of flight tasks: what most of them have in common."""

    @property
    def owns_descent(self) -> bool:
        return False

    def begin(self) -> None:
        """Begin as the successor of a task that is over."""

    def end(self) -> list[asyncio.Task[None]]:
        """End this task: another one flies now."""
        return []

    def is_flown(self, piloting: Piloting) -> bool:
        """Return True when the drone flies this task on although it has ended."""
        return False


@dataclass(frozen=True)
class Hover(PlainTask):
    """A hovering mode: Hold or Guided."""

    mode: FlightMode = FlightMode.HOLD
    client: Hashable = field(default=None, compare=False)
    """Client that chose it by name or number; None: it is the end of something else."""
    resumes: FlightTask | None = field(default=None, compare=False)
    """The task that a pause has stopped and DO_PAUSE_CONTINUE goes on with."""

    @property
    def rules(self) -> TaskRules:
        """Rules of a stop; a chosen Guided ends only what clients commanded.

        Programs choose it routinely.
        """
        ends, what = Extent.ALL if self.client is None else Extent.COMMANDED, texts.Subject(self.mode.value)
        return stop_rules(what, ends, ends)


@dataclass(frozen=True)
class CommandTask(PlainTask):
    """One command to the drone, without a mode of its own: landing, motor cut, maintenance."""

    rules: TaskRules
    mode: FlightMode | None = None

    @property
    def owns_descent(self) -> bool:
        return self.rules.what == texts.LANDING


LAND = CommandTask(TaskRules(texts.LANDING, wait=STOP_WAIT, is_flight=False))
MOTOR_CUT = CommandTask(TaskRules(texts.MOTOR_CUT, is_urgent=True, lasts=False, is_flight=False))
DISARM = CommandTask(TaskRules(texts.DISARM, wait=STOP_WAIT, keeps_below=True, lasts=False, is_flight=False))
HAND_LAUNCH = CommandTask(TaskRules(texts.ARMING, keeps_below=True, lasts=False))


def maintenance(what: Subject, needs: Needs = Needs.STANDS) -> CommandTask:
    """Return the task of a calibration or the like, during which nothing flies."""
    return CommandTask(TaskRules(what, needs=needs, keeps_below=True, lasts=False, is_flight=False))


class FlightAction(Struct, eq=False):
    """A running action: a command, a stream's engagement, a reaction of the gateway."""

    client: Hashable
    is_order: bool = True
    """A client has commanded it; neither the gateway began it, nor a stream of setpoints."""
    flies: bool = True
    """It may fly the drone; False: of camera or gimbal, whose place in the sequence counts."""
    is_of_core: bool = False
    """The flight core runs it, no service: it ends with the link."""
    replaced_by_order: bool = False
    """A newer command of a client has ended it."""
    replaced_by: Hashable = None
    """Client whose action has ended it; None: the gateway's, or none."""

    @property
    def is_replaced_by_another_client(self) -> bool:
        """True when the action of another client has ended it."""
        return self.replaced_by not in (None, self.client)


class FlightActions:
    """The running actions of one vehicle."""

    def __init__(self) -> None:
        self._tasks: dict[asyncio.Task[None], FlightAction] = {}
        """In the sequence of their arrival, which is not that of their first steps."""
        self._begun: list[Callable[[Hashable], None]] = []
        self._replaced: list[Callable[[Hashable], None]] = []

    @property
    def current(self) -> FlightAction | None:
        """The action that calls; None outside of them."""
        task = asyncio.current_task()
        return None if task is None else self._tasks.get(task)

    @property
    def is_idle(self) -> bool:
        """True when no action runs, or has arrived, that may fly the drone."""
        return not any(action.flies for action in self._tasks.values())

    def add(self, task: asyncio.Task[None], action: FlightAction) -> None:
        """Note an action that has arrived, until it ends."""
        self._tasks[task] = action
        task.add_done_callback(self._tasks.pop)

    def announce(self, client: Hashable) -> None:
        """Notify the subscribers that an action without acknowledgement of this client begins."""
        for call in self._begun:
            call(client)

    def on_begun(self, call: Callable[[Hashable], None]) -> None:
        """Call this each time an action without acknowledgement begins, with its client."""
        self._begun.append(call)

    def on_replaced(self, call: Callable[[Hashable], None]) -> None:
        """Call this each time an action replaces the others, with its client; None: the gateway's."""
        self._replaced.append(call)

    def count(self, belongs: Callable[[FlightAction], bool]) -> int:
        """Return the number of actions for which `belongs` returns True."""
        return sum(map(belongs, self._tasks.values()))

    def end_older(self) -> list[asyncio.Task[None]]:
        """Cancel the actions that may fly and are older than the calling one.

        Outside of an action these are all.
        """
        older, current = self.cancel_older(attrgetter("flies")), self.current
        for call in self._replaced:
            call(None if current is None else current.client)
        return older

    def cancel_older(self, belongs: Callable[[FlightAction], bool]) -> list[asyncio.Task[None]]:
        """Cancel the actions that belong to a group and are older than the calling one.

        A newer action than the calling one continues: it will replace this one.
        """
        task, current = asyncio.current_task(), self.current
        before = itertools.takewhile(lambda other: other is not task, self._tasks)
        older = [other for other in before if belongs(self._tasks[other])]
        for other in older:
            if current is not None:
                self._tasks[other].replaced_by = current.client
            if current is not None and current.is_order:
                self._tasks[other].replaced_by_order = True
            other.cancel()
        return older

    def link_down(self) -> None:
        """Cancel the actions of the flight core; a service cancels its own."""
        for task, action in tuple(self._tasks.items()):
            if action.is_of_core:
                task.cancel()


@dataclass(frozen=True)
class DescentEnd:
    """Facts of one request that may end a landing or a return, from its arrival on."""

    right: Right | None
    """Of its client; None: a part of the gateway, which ends none that the drone or a client began."""
    is_of_own_return: bool = False
    """The drone flew home by itself then. A return that it begins afterwards goes on."""
    cancels_announced: bool | None = None
    """A return was announced then: True: it is cancelled, False: this is its client's first Hold; None otherwise."""


@dataclass(frozen=True)
class Preparing:
    """State of the preparation of one request: the steps that are left."""

    start: Preparation
    left: tuple[PreparationStep, ...]
    """The next one first; empty: the drone is ready."""

    def after(self, *, has_ended: bool) -> Preparing:
        """Return the state after the next step; `has_ended`: there was something to end."""
        done, *left = self.left
        if (
            done is PreparationStep.END_LANDING
            and has_ended
            and PreparationStep.STOP in _STEPS[self.start]
            and PreparationStep.STOP not in left
        ):
            left.insert(0, PreparationStep.STOP)  # it has begun since the first one, and left the drone in motion
        return replace(self, left=tuple(left))


def begin_preparation(start: Preparation, *, stands: bool, cancels_return: bool, plays: bool = False) -> Preparing:
    """Return the first state of a preparation.

    `stands`: the drone is on the ground, and nothing of ours is about to lift it. `cancels_return`: the task may not
    fly during a return. `plays`: the drone reports that it flies a plan, during which it takes no sticks.
    """
    if stands and start is Preparation.END_DESCENT:
        return Preparing(start, ())
    keeps_return = not cancels_return and start is not Preparation.END_DESCENT
    steps = tuple(one for one in _STEPS[start] if one is not PreparationStep.CANCEL_RETURN or not keeps_return)
    if plays and cancels_return and PreparationStep.STOP not in steps:
        steps = (PreparationStep.STOP, *steps)
    return Preparing(start, steps)
