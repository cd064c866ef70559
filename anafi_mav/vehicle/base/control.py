"""The one owner of flight: decides which flight task is active, and hands control over.

`control_machine` decides; this shell performs its effects. `acquire` is the only way to the drone's sticks and moves:

1. The policy, the task's needs and the request's own condition are checked. A request that is refused disturbs nothing.
2. What flies is ended at once, and all older actions are cancelled. From now on they can send only what stops them.
3. Their end is awaited: without that an aborted move could cancel the one that follows it.
4. The drone is prepared by the steps of `preparation`: it stops, say, and a landing is ended that the request may end.
5. After each wait all conditions are checked again, and that the pilot has moved no stick since the client's message
   arrived. From the last check to the first command of the task there is no wait.

A newer request replaces a pending one. No module but this one stores who flies, and the mode is derived from it.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Coroutine, Hashable
from contextlib import asynccontextmanager
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from anafi_mav import texts
from anafi_mav.drone import Drone
from anafi_mav.drone.events import PlayingState
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.control_machine import (
    ADOPTED,
    Attempt,
    DroneAct,
    Event,
    Input,
    Situation,
    State,
    Step,
    step,
)
from anafi_mav.vehicle.base.flight_task import (
    ENDS_LANDING,
    DescentEnd,
    FlightAction,
    FlightActions,
    FlightTask,
    Hover,
    Needs,
    PreparationStep,
    TaskRules,
    begin_preparation,
    lasting_needs,
)
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, text_of
from anafi_mav.vehicle.base.requester import By, Source, client_of
from anafi_mav.vehicle.base.right import Right
from anafi_mav.vehicle.base.severity import Severity


class Request(Struct, frozen=True):
    """A request of a flight task."""

    task: FlightTask
    by: By
    rules: TaskRules
    """Those of the task, or what this request has instead."""

    @property
    def client(self) -> Hashable:
        """The client that requests it; None: a part of the gateway."""
        return client_of(self.by)


Policy: TypeAlias = Callable[[Request], "Refused | None"]
"""Decides who may request a flight task: returns the refusal, or None."""

Condition: TypeAlias = Callable[[], object]
"""Raises `Refused` while a request may not be carried out, for a reason that its task does not declare as a need."""


class Conditions(ABC):
    """The part of an aircraft on which requests of flight tasks depend."""

    drone: Drone
    text: Callable[[Severity, OperatorText], None]
    changed: Callable[[], None]

    @abstractmethod
    def lacking(self, needs: Needs) -> OperatorText | None:
        """Return the first condition that is not met, as the reason of a refusal; None: all are."""

    @property
    @abstractmethod
    def on_ground(self) -> bool:
        """True while the drone stands."""

    @abstractmethod
    def require_endable(self, rules: TaskRules, by: By) -> None:
        """Raise `Refused` when the drone lands or returns, and a request may not end that."""

    @abstractmethod
    def descent_end(self, rules: TaskRules, by: By) -> DescentEnd:
        """Return the facts of a request that arrives now and may end a landing or a return."""

    @abstractmethod
    async def end_descent(self, what: PreparationStep, end: DescentEnd) -> bool:
        """Perform a step that ends a landing or a return; return True when there was one to end."""


_SHOWN = (Event.GRANT, Event.FAIL, Event.ADOPT, Event.FINISH, Event.LOSE)
"""Events after which clients are notified of a new mode. While a request is pending, what it leads to is not known yet;
what the drone does by itself is notified by `Vehicle`, once it has noted all of it."""


class Grant:
    """A request whose predecessors have ended."""

    def __init__(self, control: Control, attempt: Attempt[FlightTask], found: Any) -> None:
        self._control = control
        self.attempt = attempt
        self.found = found
        """Result of the request's condition at the last check: what it flies is decided by that."""

    def begin(self, task: FlightTask | None = None, *, pauses: bool | None = None) -> None:
        """Make the task active: its mode is shown from now on. Later calls do nothing.

        `task`: instead of the requested one, whose values the drone's motion has changed meanwhile.
        """
        if task is not None:
            self.attempt = replace(self.attempt, task=task)
        if pauses is not None:
            self.attempt = replace(self.attempt, pauses=pauses)
        self._control.handle(Event.GRANT, Input(self.attempt))


class Control:
    """Owner of flight of one vehicle. All methods run on the event loop's thread."""

    def __init__(self, aircraft: Conditions) -> None:
        self.policies: tuple[Policy, ...] = ()
        """The first one that refuses a request decides."""
        self.actions = FlightActions()
        self._aircraft = aircraft
        self._situation: Situation[FlightTask] = Situation()

    # What flies.

    @property
    def active(self) -> FlightTask | None:
        """The active flight task, or the chosen hovering mode.

        None: the drone stands, or hovers in Hold.
        """
        return self._situation.task or self._situation.below

    @property
    def below(self) -> FlightTask | None:
        """The hovering mode below the active task, and after it; None: Hold."""
        return self._situation.below

    @property
    def next(self) -> FlightTask | None:
        """The task that is being acquired; None without one."""
        pending = self._situation.pending
        return None if pending is None else pending.task

    @property
    def is_free(self) -> bool:
        """True while no task is active or being acquired, and the drone neither lands nor returns."""
        return self._situation.task is None and self._situation.pending is None and self._situation.act is None

    @property
    def next_below(self) -> FlightTask | None:
        """The hovering mode that a pending request leads to; None without one, and for Hold."""
        now = self._situation
        if now.pending is None:
            return None
        return now.below if now.pending.keeps_below else now.pending.below

    @property
    def successor(self) -> FlightTask | None:
        """The task that follows the active one."""
        return self._situation.successor

    @property
    def state(self) -> State:
        """The state of the machine."""
        return self._situation.state

    @property
    def mode(self) -> FlightMode:
        """The mode of the active task.

        `Vehicle.mode` puts first what the drone does by itself.
        """
        task, below = self._situation.shown
        if task is not None and (mode := task.mode) is not None:
            return mode
        if below is not None and (mode := below.mode) is not None:
            return mode
        return FlightMode.HOLD

    @property
    def paused(self) -> bool:
        """True while a pause of a client is in force, or about to be: no setpoint is flown.

        A command or another mode ends it.
        """
        return self._situation.holds_streams

    @property
    def has_pause(self) -> bool:
        """True while a pause is in force that `resume` ends.

        Not while a request is pending, which may begin another one.
        """
        return self._situation.is_paused and self._situation.pending is None

    @property
    def is_settled(self) -> bool:
        """True when no command or request has arrived whose effect is not there yet.

        Only then may what is no action, and so has no place in their sequence, change what flies.
        """
        return self._situation.pending is None and self.actions.is_idle

    @property
    def epoch(self) -> int:
        """Count of requests, and of what ended all commands: the ground, the loss of the link."""
        return self._situation.epoch

    def keeps(self, task: FlightTask) -> bool:
        """Return True while this task is active and its conditions last; else control is lost.

        A task that flies by sticks asks before it sends any.
        """
        if self._situation.task is not task:
            return False
        reason = self._aircraft.lacking(lasting_needs(task.rules.needs))
        if reason is None:
            return True
        self.lose(reason)
        return False

    # Requests.

    @asynccontextmanager
    async def acquire(
        self,
        task: FlightTask,
        *,
        by: By,
        below: FlightTask | None = None,
        pauses: bool = False,
        rules: TaskRules | None = None,
        condition: Condition = lambda: None,
    ) -> AsyncIterator[Grant]:
        """Acquire control for a task, in an action; the block prepares and starts it.

        The task becomes active by `Grant.begin`, at the end of the block at the latest. When the request fails, the
        hovering mode of before is active again; after `begin` it is the one below the task. So is the task of before if
        the drone flies it on. After a stop that the drone has not confirmed it is Hold. A newer request cancels the
        action, and is not disturbed by either.

        `below`: the hovering mode after the task; None: Hold. `pauses`: streams do not leave it. `rules`: for this
        request, instead of the task's own. `condition`: what the request needs beyond them; what it returns is
        `Grant.found`. A caller checks nothing before or after: it would be true on one side of the wait only.

        Raises `Refused` by the policy, for a need or a condition that is not met, while the motors are being cut, and
        when the drone rejects what is sent to it.
        """
        own_rules, rules = rules, rules or task.rules
        piloting = self._aircraft.drone.piloting

        def check() -> Any:
            self.check(task, by, own_rules)  # those of some tasks depend on the drone's state
            return condition()

        found = check()
        end = self._aircraft.descent_end(rules, by) if rules.start in ENDS_LANDING else None
        before, number = self.active, self._situation.epoch + 1
        own = task if rules.lasts and not rules.is_hover else None
        hover = task if rules.is_hover else below
        is_stop = not rules.is_flight and not rules.keeps_below
        attempt = Attempt(own, number, hover, rules.keeps_below, pauses, rules.is_urgent, is_stop)
        grant: Grant | None = None
        try:
            has_waited = await self._release(attempt, rules.wait)
            self.handle(Event.RELEASED, Input(attempt))
            if has_waited:  # else no event was received since the first check
                found = check()
            stands = end is not None and self._aircraft.on_ground and not piloting.about_to_fly
            plays = piloting.state.plan == PlayingState.PLAYING
            preparing = begin_preparation(
                rules.start, stands=stands, cancels_return=Needs.NO_DESCENT in rules.needs, plays=plays
            )
            while preparing.left:
                has_ended = await self._prepare(preparing.left[0], end)
                if has_ended:
                    found = check()
                preparing = preparing.after(has_ended=has_ended)
            grant = Grant(self, attempt, found)
            yield grant
            if (pending := self._situation.pending) is not None and pending.number == number:
                grant.begin()
        except BaseException as error:
            self.handle(Event.FAIL, Input(attempt))
            if grant is not None:
                self.handle(Event.FINISH, Input(task=grant.attempt.task, number=number))
            if before is not None and self.is_free and before.is_flown(piloting):
                self.adopt(before, keeps_below=True)
            elif isinstance(error, CommandTimeout) and not rules.is_flight and not rules.keeps_below and self.is_free:
                self.adopt(Hover())  # the drone may have obeyed: no older stream flies it on
            if isinstance(error, CommandRejected):
                # A stick that the pilot holds is known once the axes are grabbed: it ends what has just begun.
                is_pilots = rules.is_flight and self._aircraft.drone.controller.pilot_acquired_control
                reason = texts.PILOT if is_pilots else self._aircraft.lacking(rules.needs)
                raise Refused(rules.what, reason or texts.from_below(error.reason)) from error
            raise

    def check(self, task: FlightTask, by: By, rules: TaskRules | None = None) -> None:
        """Raise `Refused` when a task may not be requested now; disturbs nothing."""
        rules = rules or task.rules
        self.require_allowed(task, by, rules)
        if rules.is_stream and self.paused:
            raise Refused(rules.what, texts.PAUSED_BY_CLIENT)
        if (reason := self._aircraft.lacking(rules.needs)) is not None:
            raise Refused(rules.what, reason)
        if (pending := self._situation.pending) is not None and pending.is_urgent:
            raise Refused(texts.FLIGHT_COMMAND, texts.MOTORS_STOPPING)
        if rules.start in ENDS_LANDING:
            self._aircraft.require_endable(rules, by)

    def require_allowed(self, task: FlightTask, by: By, rules: TaskRules | None = None) -> None:
        """Raise `Refused` for the policy, and for the pilot.

        A part of the gateway leaves the pilot alone, and a stick that has moved since a client's message is newer.
        """
        rules = rules or task.rules
        if (refusal := self.refusal(Request(task, by, rules))) is not None:
            raise refusal
        takeovers = self._aircraft.drone.controller.takeovers
        is_older = rules.is_flight and isinstance(by, Right) and by.takeovers != takeovers
        if is_older or (isinstance(by, Source) and self.leaves_to_pilot(by)):
            raise Refused(rules.what, texts.PILOT)

    def refusal(self, request: Request) -> Refused | None:
        """Return the refusal of the first policy that refuses a request; None: it is permitted."""
        return next((refusal for policy in self.policies if (refusal := policy(request)) is not None), None)

    def leaves_to_pilot(self, by: Source) -> bool:
        """True when a part of the gateway does not act: the Skycontroller's pilot flies, or can."""
        controller = self._aircraft.drone.controller
        return by.yields_to_pilot and (controller.pilot_has_source or controller.pilot_acquired_control)

    async def _prepare(self, what: PreparationStep, end: DescentEnd | None) -> bool:
        """Perform a step of a preparation; return True when there was something to end."""
        piloting = self._aircraft.drone.piloting
        match what:
            case PreparationStep.HOVER:
                piloting.hover()
                return False
            case PreparationStep.STOP:
                await piloting.stop()
                return True
            case PreparationStep.CANCEL_RETURN:
                return await piloting.cancel_return_home()  # raises when the return is the drone's own
        return end is not None and await self._aircraft.end_descent(what, end)

    async def _release(self, attempt: Attempt[FlightTask], limit: float | None) -> bool:
        """End what flies, which can fly the drone no further; return True after a wait for it."""
        ending = [*self.actions.end_older(), *self.handle(Event.REQUEST, Input(attempt))]
        if not ending:
            return False
        drone = self._aircraft.drone
        drone.retire(ending)
        if attempt.is_urgent:
            drone.silence(ending)
        else:
            _, late = await asyncio.wait(ending, timeout=limit)
            drone.silence(late)
            return True
        return False

    def succeed(self, task: FlightTask) -> None:
        """Let a task follow the active one, instead of another successor.

        Any request withdraws it. Raises `ValueError` for a task that ends what flies, by its rules.
        """
        if not task.rules.follows:
            raise ValueError(f"{task.rules.what} follows no task")
        self.handle(Event.SUCCEED, Input(task=task))

    def adopt(self, task: FlightTask, *, below: FlightTask | None = None, keeps_below: bool = False) -> None:
        """Make a task active that the drone flies already; what else flew is ended.

        `below`: the hovering mode after the task; `keeps_below`: that of before.
        """
        own, hover = (None, task) if task.rules.is_hover else (task, below)
        self.handle(Event.ADOPT, Input(Attempt(own, ADOPTED, hover, keeps_below)))

    def release(self, task: FlightTask) -> None:
        """End a task that is over: its successor is active, or the hovering mode below it."""
        self.handle(Event.FINISH, Input(task=task))

    def lose(self, reason: OperatorText) -> None:
        """End the active task, whose conditions are no longer met, with a text.

        The drone hovers in Hold.
        """
        task = self.active
        self.handle(Event.LOSE)
        if task is not None:
            text = texts.TASK_ENDED.fill(what=task.rules.what, reason=reason)
            self._aircraft.text(Severity.WARNING, text)

    def resume(self) -> None:
        """End the pause: setpoints may fly the drone again."""
        self.handle(Event.RESUME)

    def run(self, client: Hashable, work: Coroutine[Any, Any, None], *, is_order: bool = True) -> asyncio.Task[None]:
        """Run an action in its turn among the commands; its refusal is sent as a text.

        `is_order`: a client has commanded it; neither the gateway began it, nor a stream of setpoints.
        """
        task = asyncio.get_running_loop().create_task(self._explained(work))
        # Cancelled before it began, `work` would complain that nothing awaited it.
        task.add_done_callback(lambda _: work.close())
        self.actions.add(task, FlightAction(client, is_order, is_of_core=True))
        self.actions.announce(client)
        return task

    async def perform(self, work: Coroutine[Any, Any, None]) -> None:
        """Run the gateway's own action in its turn; return when it has ended or is replaced.

        For a caller that is no action: what replaces the action leaves the caller undisturbed.
        """
        await asyncio.wait({self.run(None, work, is_order=False)})

    async def _explained(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except AnafiMavError as error:
            critical = isinstance(error, Refused) and error.critical
            self._aircraft.text(Severity.CRITICAL if critical else Severity.WARNING, text_of(error))

    # What the drone reports.

    def on_descent(self, act: DroneAct) -> None:
        """End the active task, because the drone lands, returns or has cut its motors.

        A task continues whose own end that is.
        """
        if not self._owns_descent:
            self.handle(Event.DESCEND, Input(act=act))

    def on_hover(self) -> None:
        """The drone neither lands nor returns."""
        self.handle(Event.HOVER)

    def on_ground(self) -> None:
        """The drone stands: nothing of before flies it again."""
        self.handle(Event.GROUND, Input(task=self._situation.task if self._owns_descent else None))

    def link_down(self) -> list[asyncio.Task[None]]:
        """The link is lost: nothing that was requested outlives it."""
        self.actions.link_down()
        task = self._situation.task
        ending = self.handle(Event.LINK_DOWN)
        if task is not None and task.rules.needs_link:
            self._aircraft.text(Severity.WARNING, texts.TASK_ENDED.fill(what=task.rules.what, reason=texts.LINK_LOST))
        return ending

    @property
    def _owns_descent(self) -> bool:
        task = self._situation.task
        return task is not None and task.owns_descent

    # Machinery.

    def handle(self, event: Event, about: Input[FlightTask] | None = None) -> list[asyncio.Task[None]]:
        """Take a step of the machine and perform its effects; return what is about to end.

        For `Grant`: others request, release or report.
        """
        before = self._situation
        after: Step[FlightTask] = step(before, event, about)
        self._situation = after.situation
        ending = [task for one in after.ended for task in one.end()]
        if after.begun is not None:
            after.begun.begin()
        if event in _SHOWN and after.situation is not before:
            self._aircraft.changed()
        return ending
