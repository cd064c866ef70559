"""Flies to positions by the drone's own moves: moveTo for places, moveBy for offsets.

One move at a time; the newest goal wins. A repeated one is not begun again, for a moveTo that is restarted all the
time never arrives; one that changes faster than `MOVE_EVERY` is followed in steps.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from anafi_mav import texts, units
from anafi_mav.drone import MoveEnd
from anafi_mav.errors import AnafiMavError, LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.move_heading import MoveHeading, oriented
from anafi_mav.vehicle.base.refusal import Rejected, reason_of
from anafi_mav.vehicle.offboard.goals import Goal

MOVE_EVERY = 0.2
"""s between two moves: a program may change its target with every setpoint.

But each move has to be acknowledged by the drone, and a move that begins just after the last one was received is of
no use.
"""

RETRY = 2.0
"""s until a moveTo that the drone refused or gave up is tried again, if it is still asked for. A moveBy never is: it
may have flown a part of its way."""


@dataclass(frozen=True, eq=False)
class _Wanted:
    """A requested move: the identity of one attempt, of which a retry is another."""

    goal: Goal
    yaw: float | None
    """rad from north; None keeps the present heading."""
    speeds: tuple[float | None, float | None]
    """m/s over ground and up or down; None: the drone's own."""

    def is_same(self, other: _Wanted) -> bool:
        """True when the other asks for nothing new. A moveBy has no speed."""
        has_speed = self.goal.place is not None and self.goal.offset is None
        return (self.goal, self.yaw) == (other.goal, other.yaw) and (not has_speed or self.speeds == other.speeds)


@dataclass(frozen=True)
class _Attempt:
    """All facts of the newest attempt to fly to a goal."""

    wanted: _Wanted
    starter: asyncio.Task[None]
    """Begins this one, and the next one `MOVE_EVERY` later."""
    waits: tuple[asyncio.Task[None], ...] = ()
    """Wait for the end of a moveBy each; all but the newest are about to hear of it."""
    is_begun: bool = False
    failure: OperatorText | None = None
    """Reason for which the drone does not make the move, or did not at the last try; None while it does."""
    retry_at: float = math.inf


class OffboardMoves:
    """The moves of one session of setpoints."""

    def __init__(self, vehicle: Aircraft, drop: Callable[[OperatorText], None]) -> None:
        """`drop` receives the reason for which a goal is not flown to."""
        self._vehicle = vehicle
        self._drop = drop
        self._attempt: _Attempt | None = None

    @property
    def active(self) -> bool:
        """Something has been begun and not been stopped; it may have arrived."""
        return self._attempt is not None

    @property
    def under_way(self) -> bool:
        """True until the goal is reached, as far as the drone has reported it."""
        attempt = self._attempt
        is_waiting = attempt is not None and (not attempt.is_begun or not all(wait.done() for wait in attempt.waits))
        return is_waiting or self._vehicle.drone.piloting.moving

    def go(self, goal: Goal, yaw: float | None, now: float, *, asked: bool) -> OperatorText | None:
        """Fly to a goal and turn to a heading (rad from north) on the way; None keeps the heading.

        `asked`: the client still repeats the goal. A goal that was sent once is tried once.

        Returns the reason for which the drone has not flown to this goal, which may be tried again; None without one.
        """
        before, failure, vehicle = self._attempt, None, self._vehicle
        wanted = _Wanted(goal, yaw, (vehicle.cruise_speed, vehicle.climb_speed))
        if before is not None and before.wanted.is_same(wanted):
            failure = before.failure
            if not asked or now < before.retry_at:
                return failure
        if before is None or before.starter.done():
            starter = asyncio.get_running_loop().create_task(self._start())
        else:
            starter = before.starter
        waits = () if before is None else tuple(wait for wait in before.waits if not wait.done())
        self._attempt = _Attempt(wanted, starter, waits, failure=failure)
        return failure

    def stop(self) -> list[asyncio.Task[None]]:
        """End what has been begun: the drone hovers, unless it lands or returns.

        Tasks that are about to end.
        """
        if self._attempt is not None and self._vehicle.drone.piloting.sticks_blocked is None:
            # Before the waiting ends: a relative move whose waiting is given up would be ended a second time.
            self._vehicle.hover()
        return self.forget()

    def forget(self) -> list[asyncio.Task[None]]:
        """Begin nothing more, and wait for nothing. Returns tasks that are about to end."""
        attempt, self._attempt = self._attempt, None
        tasks = [] if attempt is None else [t for t in (attempt.starter, *attempt.waits) if not t.done()]
        for task in tasks:
            task.cancel()
        return tasks

    def _note(self, wanted: _Wanted, **facts: Any) -> bool:
        """Note facts of an attempt; return False for one that was replaced or stopped."""
        if self._attempt is None or self._attempt.wanted is not wanted:
            return False
        self._attempt = replace(self._attempt, **facts)
        return True

    async def _start(self) -> None:
        while self._attempt is not None and not self._attempt.is_begun:
            wanted = self._attempt.wanted
            self._note(wanted, is_begun=True)
            try:
                await self._move(wanted)
            except AnafiMavError as error:
                self._failed(wanted, reason_of(error), again=True)
            await asyncio.sleep(MOVE_EVERY)

    async def _move(self, wanted: _Wanted) -> None:
        goal, yaw = wanted.goal, wanted.yaw
        piloting, vehicle = self._vehicle.drone.piloting, self._vehicle
        present = piloting.state.altitude
        if goal.offset is not None:
            self._by(wanted, *goal.offset)
            return
        if goal.place is None:
            if present is None or goal.height is None:
                raise Rejected(texts.HEIGHT_UNKNOWN)
            self._by(wanted, 0.0, 0.0, present - goal.height)
            return
        height = present if goal.height is None else goal.height
        if height is None:
            raise Rejected(texts.HEIGHT_UNKNOWN)
        orientation, heading = oriented(self._move_heading, vehicle.place, goal.place, yaw)
        move = await piloting.move_to(
            goal.place.latitude,
            goal.place.longitude,
            height,
            heading_deg=heading,
            horizontal_speed=wanted.speeds[0],
            vertical_speed=wanted.speeds[1],
            orientation=orientation,
        )
        self._note(wanted, failure=None)
        move.ended.add_done_callback(lambda ended: self._ended(wanted, ended.result()))

    @property
    def _move_heading(self) -> MoveHeading:
        """Return the rule for a place without a heading.

        PX4's Offboard keeps the heading, ArduPilot's Guided follows WP_YAW_BEHAVIOR. A stream of places never turns
        first: the drone would stop at each of them.
        """
        rule = self._vehicle.settings.move_heading
        if self._vehicle.control.mode is not FlightMode.GUIDED or rule is MoveHeading.KEEP:
            return MoveHeading.KEEP
        return MoveHeading.TO_TARGET

    def _by(self, wanted: _Wanted, front: float, right: float, down: float) -> None:
        piloting = self._vehicle.drone.piloting
        turn = 0.0
        if wanted.yaw is not None and (attitude := piloting.state.attitude) is not None:
            turn = units.wrap_pi(wanted.yaw - attitude.yaw)
        if piloting.move is not None:
            piloting.hover()  # a moveBy replaces a moveBy; whether it replaces a moveTo is not documented
        task = asyncio.get_running_loop().create_task(self._relative_move(wanted, front, right, down, turn))
        if self._attempt is not None:
            self._attempt = replace(self._attempt, waits=(*self._attempt.waits, task))

    async def _relative_move(self, wanted: _Wanted, front: float, right: float, down: float, turn: float) -> None:
        try:
            await self._vehicle.drone.piloting.move_by(front, right, down, turn)
        except LinkLost:
            return
        except AnafiMavError as error:
            self._failed(wanted, reason_of(error), again=False)

    def _ended(self, wanted: _Wanted, how: MoveEnd) -> None:
        if how is MoveEnd.ERROR:
            self._failed(wanted, texts.MOVE_FAILED, again=True)
        elif how is MoveEnd.CANCELED and self._note(wanted, failure=texts.MOVE_CANCELLED):
            self._drop(texts.MOVE_CANCELLED)

    def _failed(self, wanted: _Wanted, why: OperatorText, *, again: bool) -> None:
        """The drone did not make a move."""
        retry_at = asyncio.get_running_loop().time() + RETRY if again else math.inf
        if not self._note(wanted, failure=why, retry_at=retry_at):
            return
        self._drop(why)
        # One that was refused leaves an older one alone, which is no longer wanted.
        if self._vehicle.drone.piloting.sticks_blocked is None:
            self._vehicle.hover()
