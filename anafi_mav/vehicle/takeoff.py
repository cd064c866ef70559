"""Arming, which an ANAFI does not know, and the take-off to a height.

The drone takes off to a height of its own; the climb to the requested one is a move that follows in the background.
An armed state that nothing follows lapses, and so does a take-off that waits for its client to arm.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Hashable
from dataclasses import replace
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import Alarm
from anafi_mav.drone.events import FlyingState, FlyingStateChanged
from anafi_mav.errors import AnafiMavError
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import check_height
from anafi_mav.vehicle.base.control import Control
from anafi_mav.vehicle.base.control_machine import State as ControlState
from anafi_mav.vehicle.base.flight_task import DISARM, HAND_LAUNCH, FlightTask, PlainTask, TaskRules
from anafi_mav.vehicle.base.flying import AIRBORNE
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, Rejected, Unfinished, reason_of
from anafi_mav.vehicle.base.requester import By
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.takeoff_machine import Event, RunningTakeoff, State, TakeoffSituation, WaitingTakeoff, step

AUTO_DISARM = 10.0
"""s that an armed vehicle waits for a take-off (as PX4's COM_DISARM_PRFLT)."""

ARM_WAIT = 10.0
"""s that a take-off waits for arming.

QGroundControl sends take-off first and arms on its acceptance.
"""

CLIMB_WAIT = 15.0
"""s after the take-off without a hover until the climb to the requested height is aborted."""

TAKEOFF_WAIT = 30.0
"""s that a command waits for the end of a take-off."""

LOW = 0.5
"""m above take-off below which a drone that takes off is disarmed by a landing."""

CLOSE_ENOUGH = 0.1
"""m from the height of a take-off that are no reason for a move."""

_RISING = (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF)

_RISES = TaskRules(texts.TAKEOFF)
"""Of a take-off that waits for nothing: the hovering mode after it is Guided or Hold."""


class _Waiting(PlainTask):
    """A command that follows the take-off: the newest is the one successor."""

    mode = None

    def __init__(self, rules: TaskRules, control: Control) -> None:
        self.rules = replace(rules, keeps_below=True)
        self._control = control
        self._task = asyncio.current_task()

    def end(self) -> list[asyncio.Task[None]]:
        """Cancel the command when another one follows the take-off.

        With the take-off it fails by itself.
        """
        if self._task is not None and self._control.successor not in (None, self):
            self._task.cancel()
        return []


class Takeoff(PlainTask):
    """The way of one vehicle from standing disarmed to hovering at a height."""

    rules = TaskRules(texts.TAKEOFF, keeps_below=True, ends_landing=Extent.ALL)
    mode = None
    """The drone reports that it takes off."""

    def __init__(self, vehicle: Aircraft, armed: Callable[[Hashable], None]) -> None:
        self._vehicle = vehicle
        self._tell_armed = armed
        """Called with a client that has armed: a mission that waits for its arming begins."""
        self._situation: TakeoffSituation[asyncio.Task[Any]] = TakeoffSituation()
        """Arming, and the take-off that waits for it or is under way; its task returns True at the asked height."""
        self._alarm = Alarm(self._on_alarm)
        """Set to the situation's deadline."""

    @property
    def armed(self) -> bool:
        """Arming was accepted and has not lapsed.

        What flies is armed in any case (`Aircraft.armed`).
        """
        return self._situation.arming is not None

    @property
    def climbing(self) -> bool:
        """The climb that follows the drone's own take-off is under way."""
        attempt = self._situation.attempt
        return isinstance(attempt, RunningTakeoff) and attempt.climbs

    @property
    def under_way(self) -> bool:
        """An accepted take-off has not reached its height yet."""
        return isinstance(self._situation.attempt, RunningTakeoff)

    @property
    def rises(self) -> bool:
        """A take-off is under way, or the drone rises to its first hover after a Hold has ended one."""
        is_running = isinstance(self._situation.attempt, RunningTakeoff)
        return is_running or self._vehicle.flying_state in _RISING

    def is_armed_by(self, client: Hashable) -> bool:
        """Has this client armed the vehicle for the flight that begins now?"""
        return self._situation.arming is not None and client in self._situation.arming.clients

    # What clients ask for. Each returns when the drone confirmed, or raises.

    async def arm(self, by: Right) -> None:
        """Accept arming.

        An ANAFI has no such state: nothing turns until a take-off; it lapses after `AUTO_DISARM`.

        With `hand_launch` the motors do turn, and the drone flies as soon as it leaves the hand.

        A take-off that this client commanded begins now. Another client's does not: a client that arms only to look
        at something must not find propellers turning.
        """
        vehicle, client = self._vehicle, by.client
        if vehicle.armed and not vehicle.on_ground:
            return
        if vehicle.settings.hand_launch:
            async with vehicle.control.acquire(HAND_LAUNCH, by=by, condition=vehicle.require_ready):
                await vehicle.drone.piloting.hand_launch()
            return
        vehicle.require_ready()
        self._enter(step(self._situation, Event.ARM, client=client, until=_after(AUTO_DISARM)))
        vehicle.changed()
        if not self._start_when_armed(by):
            self._tell_armed(client)

    def _start_when_armed(self, by: Right) -> bool:
        """Begin the take-off that waits for this client to arm, if it has; return True if it begins."""
        waiting = self._situation.attempt
        if not (isinstance(waiting, WaitingTakeoff) and waiting.client == by.client and self.is_armed_by(by.client)):
            return False
        self._start(self._rise(waiting.height, by, lifts_off=True), waiting.height)
        return True

    async def disarm(self, by: Right, *, force: bool) -> None:
        """Disarm on the ground; propellers that turn there are stopped first.

        With `force` the motors are cut for that if need be. In the air only `force` with `allow_kill` disarms: the
        motors stop, the drone falls.
        """
        vehicle = self._vehicle
        if vehicle.on_ground:
            await self._land(by)  # a take-off that is on its way to the drone must not follow
            if not vehicle.on_ground:
                raise Refused(texts.DISARM, texts.JUST_TAKEN_OFF)
        elif self._turns_near_ground:
            async with vehicle.control.acquire(DISARM, by=by):
                vehicle.note_landing_command()
                await vehicle.drone.piloting.stop_motors(force=force)
        elif force:
            await vehicle.terminate(by)
            return
        else:
            raise Refused(texts.DISARM, self._airborne)
        self._set_disarmed()

    @property
    def _airborne(self) -> OperatorText:
        """Return the reason of a refusal while the drone does not report that it stands."""
        state = self._vehicle.flying_state
        if state in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF):
            return texts.STARTS_MOTORS
        return texts.FLYING_STATE_UNKNOWN if state is None else texts.IN_AIR

    async def _land(self, by: By) -> None:
        async with self._vehicle.control.acquire(DISARM, by=by):
            self._vehicle.note_landing_command()
            await self._vehicle.drone.piloting.land()

    def _set_disarmed(self) -> None:
        self._enter(step(self._situation, Event.DISARM))
        self._vehicle.changed()

    @property
    def _turns_near_ground(self) -> bool:
        """The propellers turn, and the drone stands or has hardly left the ground."""
        vehicle = self._vehicle
        if vehicle.flying_state is FlyingState.TAKINGOFF:
            height = vehicle.drone.piloting.state.altitude
            return height is not None and height < LOW
        return vehicle.flying_state in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF)

    async def take_off(self, ato: float | None, by: Right) -> None:
        """Take off to `ato` m (None: as set). Returns when the drone confirmed that it takes off.

        Disarmed, it returns at once and the take-off waits `ARM_WAIT` for this client to arm.
        """
        vehicle = self._vehicle
        height = vehicle.settings.takeoff_height if ato is None else ato
        is_armed = self.armed

        def condition() -> None:
            check_height(vehicle, height)
            if not vehicle.on_ground:
                raise Refused(texts.TAKEOFF, self._airborne)
            vehicle.require_ready()
            if is_armed and not self.armed:
                raise Refused(texts.TAKEOFF, texts.ARMING_EXPIRED)

        if not is_armed:
            # What lifts off while it waits is replaced now.
            async with vehicle.control.acquire(self, by=by, condition=condition):
                waiting = WaitingTakeoff(height, by.client, _after(ARM_WAIT))
                self._enter(step(self._situation, Event.REQUEST, attempt=waiting))
            self._start_when_armed(by)
            return
        async with vehicle.control.acquire(self, by=by, below=self._below, rules=_RISES, condition=condition):
            await self.launch()
        self._start(self._rise(height, by), height)

    async def abort(self, by: By) -> None:
        """Disarm a drone that stands, land one that is about to leave the ground.

        Its setpoints have stopped.
        """
        await self._land(by)
        self._set_disarmed()

    async def over(self, rules: TaskRules) -> None:
        """Wait until an accepted take-off has reached its height.

        Returns at once when the drone does not rise. When a Hold has ended the climb, the drone still rises to its
        own height: the wait is then for its first hover. (MAVSDK's goto_location sends Hold first.) Of several
        commands that wait the newest stays, the others are cancelled. `rules` are those of the flight task that waits.
        Raises `Unfinished` when the take-off fails, or lasts for longer than `TAKEOFF_WAIT`.
        """
        if not self.rises:
            return
        control, what = self._vehicle.control, rules.what
        waiting = _Waiting(rules, control)
        control.succeed(waiting)
        end = asyncio.get_running_loop().create_task(self._until_risen())
        try:
            await asyncio.wait({end}, timeout=TAKEOFF_WAIT)
            if not end.done():
                raise Unfinished(what, texts.TAKEOFF_UNFINISHED.fill(seconds=TAKEOFF_WAIT))
            if not end.result():
                raise Unfinished(what, texts.TAKEOFF_TOO_LOW)
        finally:
            end.cancel()
            control.release(waiting)

    async def _until_risen(self) -> bool:
        """Wait for the end of a take-off, or of a rise; True: it has reached its height.

        The climb of a take-off that starts its motors begins while its rise is waited for.
        """
        while self.rises:
            if (task := self._situation.task) is not None:
                await asyncio.wait({task})
                return not task.cancelled() and task.result() is True
            with contextlib.suppress(AnafiMavError):
                await self._vehicle.drone.expect(FlyingStateChanged, lambda m: m.state not in _RISING, TAKEOFF_WAIT)
        return self._vehicle.in_air

    # What ends it.

    def end(self) -> list[asyncio.Task[None]]:
        """End the take-off: another flight task is active now. Also one that waits for arming.

        A request that ends the climb leaves the drone at another height than its client wanted: a text reports it.
        Returns tasks that are about to end.
        """
        vehicle, attempt = self._vehicle, self._situation.attempt
        reached, is_replaced = vehicle.drone.piloting.state.altitude, vehicle.control.state is ControlState.RELEASING
        if isinstance(attempt, RunningTakeoff) and attempt.climbs and is_replaced and reached is not None:
            vehicle.text(Severity.NOTICE, texts.CLIMB_ENDED.fill(height=attempt.height, reached=reached))
        return self._enter(step(self._situation, Event.END))

    @property
    def _below(self) -> FlightTask | None:
        """The hovering mode after the take-off: Guided where it was chosen, else Hold."""
        control = self._vehicle.control
        return control.below if control.mode is FlightMode.GUIDED else None

    @property
    def owns_descent(self) -> bool:
        """True before the climb.

        A take-off that has yet to begin is not disturbed, and reports its own failure.
        """
        return self._situation.state is State.LIFTING

    def came_down(self) -> None:
        """The drone has come down: it is disarmed, and nothing of before lifts it off again."""
        self._enter(step(self._situation, Event.GROUND))

    def left_ground(self) -> None:
        """The drone has left the ground: arming does not lapse any more."""
        self._enter(step(self._situation, Event.LIFT))

    def link_down(self) -> None:
        """Disarm and cancel everything that was commanded before."""
        self._enter(step(self._situation, Event.LINK_DOWN))

    # Taking off.

    async def launch(self) -> None:
        """Take off to the drone's own height; returns when the drone confirmed it.

        Until it has succeeded or failed, the armed state does not lapse.
        """
        self._enter(step(self._situation, Event.LIFT))
        try:
            await self._vehicle.drone.piloting.take_off()
        finally:
            if self._vehicle.on_ground:
                self._enter(step(self._situation, Event.STAND, until=_after(AUTO_DISARM)))

    async def _rise(self, height: float, by: By, *, lifts_off: bool = False) -> bool:
        """Take off where that is still to be done, then climb; True when the height is reached.

        Failures are sent as texts: the command was answered long ago, and its permission may have ended since.
        """
        vehicle, control, climbs = self._vehicle, self._vehicle.control, False
        try:
            if lifts_off:
                control.check(self, by)
                await self.launch()
                control.adopt(self, below=self._below)
            climbs = True
            self._enter(step(self._situation, Event.CLIMB))
            vehicle.changed()
            await self._climb(height, by)
            return True
        except AnafiMavError as error:
            reason = reason_of(error)
            if climbs:
                vehicle.text(Severity.ERROR, texts.CLIMB_ABORTED.fill(height=height, error=reason))
            else:
                vehicle.text(Severity.ERROR, texts.TAKEOFF_FAILED.fill(error=reason))
            return False
        finally:  # its successor flies, or the drone hovers
            if self._situation.task is asyncio.current_task():
                self._enter(step(self._situation, Event.END))
                control.release(self)
                vehicle.changed()

    async def _climb(self, height: float, by: By) -> None:
        """From the drone's own hover height to the asked one."""
        vehicle = self._vehicle
        if not vehicle.in_air:
            await vehicle.drone.expect(FlyingStateChanged, lambda m: m.state in AIRBORNE, CLIMB_WAIT)
        present = await vehicle.next_height()
        if not vehicle.in_air or vehicle.returning:
            raise Rejected(vehicle.activity)
        vehicle.control.check(self, by)
        if abs(height - present) > CLOSE_ENOUGH:
            await vehicle.drone.piloting.move_by(0.0, 0.0, present - height, 0.0)

    # Machinery.

    def _start(self, work: Coroutine[Any, Any, bool], height: float) -> None:
        """Begin the part of a take-off to a height (m, above take-off) that no command waits for."""
        task = asyncio.get_running_loop().create_task(work)
        self._enter(step(self._situation, Event.START, attempt=RunningTakeoff(task, height)))

    def _enter(self, now: TakeoffSituation[asyncio.Task[Any]]) -> list[asyncio.Task[None]]:
        """Enter a situation; return the task of the take-off that ends thereby, if there is one."""
        task, self._situation = self._situation.task, now
        if now.deadline is None:
            self._alarm.cancel()
        elif now.deadline != self._alarm.at:
            self._alarm.set(now.deadline)
        if task is None or task is now.task or task is asyncio.current_task():
            return []
        task.cancel()
        return [task]

    def _on_alarm(self) -> None:
        """A take-off has waited too long for its client to arm, or the armed state for a take-off."""
        vehicle, now = self._vehicle, self._situation
        if isinstance(now.attempt, WaitingTakeoff) and now.attempt.until == now.deadline:
            self._enter(step(now, Event.END))
            vehicle.control.release(self)
            vehicle.text(Severity.WARNING, texts.TAKEOFF_CANCELLED.fill(seconds=ARM_WAIT))
        elif vehicle.drone.piloting.about_to_fly:
            # a mission's start is with the drone: who says disarmed now may see it rise
            self._enter(step(now, Event.STAND, until=_after(AUTO_DISARM)))
        elif vehicle.on_ground:
            vehicle.text(Severity.INFO, texts.DISARMED)
            self._set_disarmed()
        else:
            self._enter(step(now, Event.LIFT))


def _after(seconds: float) -> float:
    return asyncio.get_running_loop().time() + seconds
