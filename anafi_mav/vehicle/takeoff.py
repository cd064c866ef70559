"""Arming, which an ANAFI does not know, and the take-off to a height.

The drone takes off to a height of its own; the climb to the requested one is a move that follows in the background.
An armed state that nothing follows lapses, and so does a take-off that waits for its client to arm.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Hashable
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import Alarm
from anafi_mav.drone.events import AltitudeChanged, FlyingState, FlyingStateChanged
from anafi_mav.errors import AnafiMavError
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import STOP_WAIT, Aircraft
from anafi_mav.vehicle.base.bounds import check_height
from anafi_mav.vehicle.base.flying import AIRBORNE
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, Rejected, Unfinished, not_ready
from anafi_mav.vehicle.base.severity import Severity

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

ALTITUDE_WAIT = 3.0
"""s for the drone to tell its height, which it does five times a second."""

LOW = 0.5
"""m above take-off below which a drone that takes off is disarmed by a landing."""

CLOSE_ENOUGH = 0.1
"""m from the height of a take-off that are no reason for a move."""

_RISING = (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF)


class Takeoff:
    """The way of one vehicle from standing disarmed to hovering at a height."""

    def __init__(self, vehicle: Aircraft, armed: Callable[[Hashable], None]) -> None:
        self.height = 2.5
        """m above take-off for a take-off that names no height (PX4's default of MIS_TAKEOFF_ALT)."""
        self.hand_launch = False
        """Arming starts the motors and waits for the drone to be thrown (a parameter; Parrot's UserTakeOff)."""
        self._vehicle = vehicle
        self._tell_armed = armed
        """Called with a client that has armed: a mission that waits for its arming begins."""
        self._armed = False
        self._armed_by: set[Hashable] = set()
        """Clients that have armed since the vehicle was disarmed last."""
        self.ended: Callable[[], None] = lambda: None
        """Called when an accepted take-off has ended, at its height or not."""
        self._waiting: asyncio.Task[Any] | None = None
        """The command that waits for the end of a take-off."""
        self._reached = False
        """The last take-off has reached its height."""
        self._climbing = False
        self._pending: tuple[float, Hashable] | None = None
        """Height of a take-off that waits for its client to arm, and the client."""
        self._disarming = Alarm(self._auto_disarm)
        """Runs while an armed vehicle waits for a take-off."""
        self._lapsing = Alarm(self._lapsed)
        """Runs while a take-off waits for its client to arm."""
        self._background: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def armed(self) -> bool:
        """Arming was accepted and has not lapsed.

        What flies is armed in any case (`Aircraft.armed`).
        """
        return self._armed

    @property
    def climbing(self) -> bool:
        """The climb that follows the drone's own take-off is under way."""
        return self._climbing

    @property
    def under_way(self) -> bool:
        """An accepted take-off has not reached its height yet."""
        return self._background is not None and not self._background.done()

    @property
    def rises(self) -> bool:
        """A take-off is under way, or the drone rises to its first hover after a Hold has ended one."""
        return self.under_way or self._vehicle.flying_state in _RISING

    def is_armed_by(self, client: Hashable) -> bool:
        """Has this client armed the vehicle for the flight that begins now?"""
        return self._armed and client in self._armed_by

    # What clients ask for. Each returns when the drone confirmed, or raises.

    async def arm(self, client: Hashable = None) -> None:
        """Accept arming.

        An ANAFI has no such state: nothing turns until a take-off; it lapses after `AUTO_DISARM`.

        With `hand_launch` the motors do turn, and the drone flies as soon as it leaves the hand.

        A take-off that this client commanded begins now. Another client's does not: a client that arms only to look
        at something must not find propellers turning.
        """
        vehicle = self._vehicle
        if vehicle.armed and not vehicle.on_ground:
            return
        if problems := vehicle.prearm_problems():
            raise not_ready(problems)
        if self.hand_launch:
            await vehicle.take_over()
            await vehicle.drone.piloting.hand_launch()
            return
        if not self._armed:
            self._armed_by.clear()
        self._armed = True
        self._armed_by.add(client)
        self._disarming.set_in(AUTO_DISARM)
        vehicle.changed()
        if self._pending is not None and self._pending[1] == client:
            height, _ = self._pending
            self.forget()
            self._start_background(self._take_off_and_report(height))
        else:
            self._tell_armed(client)

    async def disarm(self, *, force: bool) -> None:
        """Disarm on the ground; propellers that turn there are stopped first.

        With `force` the motors are cut for that if need be. In the air only `force` with `allow_kill` disarms: the
        motors stop, the drone falls.
        """
        vehicle = self._vehicle
        if vehicle.on_ground:
            await vehicle.take_over(STOP_WAIT)
            await vehicle.drone.piloting.land()  # a take-off that is on its way to the drone must not follow
            if not vehicle.on_ground:
                raise Refused(texts.DISARM, texts.JUST_TAKEN_OFF)
            self._armed = False
            vehicle.changed()
            return
        if self._turns_near_ground:
            await vehicle.take_over(STOP_WAIT)
            await vehicle.drone.piloting.stop_motors(force=force)
            self._armed = False
            vehicle.changed()
            return
        if not force:
            raise Refused(texts.DISARM, texts.IN_AIR)
        await vehicle.terminate()

    @property
    def _turns_near_ground(self) -> bool:
        """The propellers turn, and the drone stands or has hardly left the ground."""
        vehicle = self._vehicle
        if vehicle.flying_state is FlyingState.TAKINGOFF:
            height = vehicle.drone.piloting.state.altitude
            return height is not None and height < LOW
        return vehicle.flying_state in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF)

    async def begin(self, ato: float | None, client: Hashable = None) -> None:
        """Take off to `ato` m (None: `height`). Returns when the drone confirmed that it takes off.

        Disarmed, it returns at once and the take-off waits `ARM_WAIT` for this client to arm.
        """
        vehicle = self._vehicle
        height = self.height if ato is None else ato
        check_height(vehicle, height)
        if not vehicle.on_ground:
            raise Refused(texts.TAKEOFF, texts.IN_AIR)
        if problems := vehicle.prearm_problems():
            raise not_ready(problems)
        await vehicle.take_over()  # also where it waits for arming: what lifts off then is replaced now
        if not self._armed:
            self._pending = (height, client)
            self._lapsing.set_in(ARM_WAIT)
            return
        await self._lift_off()
        if vehicle.selected is not FlightMode.GUIDED:
            vehicle.forget_mode()
        self._start_background(self._climb(height))

    async def launch(self) -> None:
        """Take off to the drone's own height, for setpoints; returns when the drone confirmed it."""
        if problems := self._vehicle.prearm_problems():
            raise not_ready(problems)
        await self._lift_off()

    async def abort(self) -> None:
        """Disarm a drone that stands, land one that is about to leave the ground.

        Its setpoints have stopped.
        """
        await self._vehicle.take_over(STOP_WAIT)
        await self._vehicle.drone.piloting.land()
        self._armed = False
        self._vehicle.changed()

    async def over(self, what: OperatorText) -> None:
        """Wait until an accepted take-off has reached its height.

        Returns at once when the drone does not rise. When a Hold has ended the climb, the drone still rises to its
        own height: the wait is then for its first hover. (MAVSDK's goto_location sends Hold first.) Of several
        commands that wait the newest stays, the others are cancelled. Raises `Unfinished` when the take-off fails, or
        lasts for longer than `TAKEOFF_WAIT`.
        """
        if not self.rises:
            return
        self.displace()
        current = self._waiting = asyncio.current_task()
        end = asyncio.get_running_loop().create_task(self._until_risen())
        try:
            await asyncio.wait({end}, timeout=TAKEOFF_WAIT)
            if not end.done():
                raise Unfinished(what, texts.TAKEOFF_UNFINISHED.fill(seconds=TAKEOFF_WAIT))
            if not end.result():
                raise Unfinished(what, texts.TAKEOFF_TOO_LOW)
        finally:
            end.cancel()
            if self._waiting is current:
                self._waiting = None

    def displace(self) -> None:
        """Cancel the command that waits for the end of a take-off: a newer one is flown at that end."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            waiting.cancel()

    async def _until_risen(self) -> bool:
        """Wait for the end of a take-off, or of a rise.

        True: it has reached its height. Never raises.
        """
        if self.under_way:
            assert self._background is not None
            await asyncio.wait({self._background})
            return self._reached
        with contextlib.suppress(AnafiMavError):
            await self._vehicle.drone.expect(FlyingStateChanged, lambda m: m.state not in _RISING, TAKEOFF_WAIT)
        return self._vehicle.in_air

    # What ends it.

    def forget(self) -> None:
        """Cancel the take-off that waits for arming, if there is one."""
        if self._pending is not None:
            self._pending = None
            self._lapsing.cancel()

    def end(self) -> list[asyncio.Task[None]]:
        """Abort the background part of the take-off: another flight task is active now.

        Returns tasks that are about to end.
        """
        task, self._background, self._climbing = self._background, None, False
        if task is None:
            return []
        task.cancel()
        return [task]

    def end_climb(self) -> None:
        """The drone lands or returns: it does not climb.

        A take-off that has yet to begin is not disturbed.
        """
        if self._climbing:
            self.end()

    def came_down(self) -> None:
        """The drone has come down: it is disarmed, and nothing of before lifts it off again."""
        self._armed = False
        self.forget()

    def left_ground(self) -> None:
        """The drone has left the ground: arming does not lapse any more."""
        self._disarming.cancel()

    def link_down(self) -> None:
        """Disarm and cancel everything that was commanded before."""
        self._armed = False
        for task in tuple(self._tasks):
            task.cancel()

    # Taking off.

    async def _lift_off(self) -> None:
        """The drone's own take-off.

        Until it has succeeded or failed, the armed state does not lapse.
        """
        self._disarming.cancel()
        self._vehicle.paused = False  # a pause that comes from here on ends this take-off
        try:
            await self._vehicle.drone.piloting.take_off()
        finally:
            if self._armed and self._vehicle.on_ground:
                self._disarming.set_in(AUTO_DISARM)

    async def _take_off_and_report(self, height: float) -> None:
        """Take off after the wait for arming; failures are sent as texts.

        The command was answered long ago.
        """
        try:
            await self._lift_off()
        except AnafiMavError as error:
            self._vehicle.text(Severity.ERROR, texts.TAKEOFF_FAILED.fill(error=error))
            return
        await self._climb(height)

    async def _climb(self, height: float) -> None:
        """From the drone's own hover height to the asked one."""
        vehicle = self._vehicle
        self._climbing = True
        vehicle.changed()
        try:
            if not vehicle.in_air:
                await vehicle.drone.expect(FlyingStateChanged, lambda m: m.state in AIRBORNE, CLIMB_WAIT)
            # What it told last is from while it rose.
            present = (await vehicle.drone.expect(AltitudeChanged, timeout=ALTITUDE_WAIT)).altitude
            if not vehicle.in_air or vehicle.returning:
                raise Rejected(vehicle.activity)
            if abs(height - present) > CLOSE_ENOUGH:
                await vehicle.drone.piloting.move_by(0.0, 0.0, present - height, 0.0)
            self._reached = True
        except AnafiMavError as error:
            vehicle.text(Severity.ERROR, texts.CLIMB_ABORTED.fill(height=height, error=error))
        finally:
            if self._background is asyncio.current_task():
                self._climbing, self._background = False, None
                vehicle.changed()

    def _start_background(self, work: Coroutine[Any, Any, None]) -> None:
        self.end()
        self._reached = False
        task = asyncio.get_running_loop().create_task(work)
        self._background = task
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not self.under_way:
            self.ended()

    # What lapses.

    def _lapsed(self) -> None:
        self.forget()
        self._vehicle.text(Severity.WARNING, texts.TAKEOFF_CANCELLED.fill(seconds=ARM_WAIT))

    def _auto_disarm(self) -> None:
        if self._vehicle.drone.piloting.about_to_fly:
            self._disarming.set_in(
                AUTO_DISARM
            )  # a mission's start is with the drone: who says disarmed now may see it rise
        elif self._armed and self._vehicle.on_ground:
            self._armed = False
            self._vehicle.text(Severity.INFO, texts.DISARMED)
            self._vehicle.changed()
