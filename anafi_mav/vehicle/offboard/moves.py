"""Flies to positions by the drone's own moves: moveTo for places, moveBy for offsets.

One move at a time; the newest goal wins. A repeated one is not begun again, for a moveTo that is restarted all the
time never arrives; one that changes faster than `MOVE_EVERY` is followed in steps.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from typing import TypeAlias

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


_Wanted: TypeAlias = "tuple[Goal, float | None]"
"""Goal, and the heading there (rad from north); None keeps the present heading."""


class OffboardMoves:
    """The moves of one session of setpoints."""

    def __init__(self, vehicle: Aircraft, drop: Callable[[OperatorText], None]) -> None:
        """`drop` receives the reason for which a goal is not flown to."""
        self._vehicle = vehicle
        self._drop = drop
        self._wanted: _Wanted | None = None
        """Requested move that has not begun."""
        self._begun: _Wanted | None = None
        self._failure: OperatorText | None = None
        """Reason for which the drone does not make the move that has begun; None while it does."""
        self._retry_at = math.inf
        self._starter: asyncio.Task[None] | None = None
        self._relative: set[asyncio.Task[None]] = set()
        """Wait for the end of a moveBy each; all but the newest are about to hear of it."""

    @property
    def active(self) -> bool:
        """Something has been begun and not been stopped; it may have arrived."""
        return self._begun is not None

    @property
    def under_way(self) -> bool:
        """True until the goal is reached, as far as the drone has reported it."""
        return self._wanted is not None or bool(self._relative) or self._vehicle.drone.piloting.moving

    def go(self, goal: Goal, yaw: float | None, now: float, *, asked: bool) -> OperatorText | None:
        """Fly to a goal and turn to a heading (rad from north) on the way; None keeps the heading.

        `asked`: the client still repeats the goal. A goal that was sent once is tried once.

        Returns the reason for which the drone has not flown to this goal, which may be tried again; None without one.
        """
        wanted = (goal, yaw)
        if wanted != self._begun:
            self._failure = None
        elif not asked or now < self._retry_at:
            return self._failure
        self._begun = self._wanted = wanted
        self._retry_at = math.inf
        if self._starter is None or self._starter.done():
            self._starter = asyncio.get_running_loop().create_task(self._start())
        return self._failure

    def stop(self) -> list[asyncio.Task[None]]:
        """End what has been begun: the drone hovers, unless it lands or returns.

        Tasks that are about to end.
        """
        if self._begun is not None and self._vehicle.drone.piloting.sticks_blocked is None:
            # Before the waiting ends: a relative move whose waiting is given up would be ended a second time.
            with contextlib.suppress(LinkLost):
                self._vehicle.drone.piloting.hover()
        return self.forget()

    def forget(self) -> list[asyncio.Task[None]]:
        """Begin nothing more, and wait for nothing. Returns tasks that are about to end."""
        self._wanted = self._begun = self._failure = None
        self._retry_at = math.inf
        tasks = [task for task in (self._starter, *self._relative) if task is not None and not task.done()]
        for task in tasks:
            task.cancel()
        self._starter = None
        return tasks

    async def _start(self) -> None:
        while (wanted := self._wanted) is not None:
            self._wanted = None
            try:
                await self._move(wanted)
            except AnafiMavError as error:
                self._failed(wanted, reason_of(error), again=True)
            await asyncio.sleep(MOVE_EVERY)

    async def _move(self, wanted: _Wanted) -> None:
        goal, yaw = wanted
        piloting, vehicle = self._vehicle.drone.piloting, self._vehicle
        present = piloting.state.altitude
        if goal.offset is not None:
            front, right, down = goal.offset
            self._by(wanted, front, right, down, yaw)
            return
        if goal.place is None:
            if present is None or goal.height is None:
                raise Rejected(texts.HEIGHT_UNKNOWN)
            self._by(wanted, 0.0, 0.0, present - goal.height, yaw)
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
            horizontal_speed=vehicle.cruise_speed,
            vertical_speed=vehicle.climb_speed,
            orientation=orientation,
        )
        if self._is_news_of(wanted):
            self._failure = None
        move.ended.add_done_callback(lambda ended: self._ended(wanted, ended.result()))

    @property
    def _move_heading(self) -> MoveHeading:
        """Return the rule for a place without a heading.

        PX4's Offboard keeps the heading, ArduPilot's Guided follows WP_YAW_BEHAVIOR. A stream of places never turns
        first: the drone would stop at each of them.
        """
        rule = self._vehicle.move_heading
        if self._vehicle.control.mode is not FlightMode.GUIDED or rule is MoveHeading.KEEP:
            return MoveHeading.KEEP
        return MoveHeading.TO_TARGET

    def _by(self, wanted: _Wanted, front: float, right: float, down: float, yaw: float | None) -> None:
        piloting = self._vehicle.drone.piloting
        turn = 0.0
        if yaw is not None and (attitude := piloting.state.attitude) is not None:
            turn = units.wrap_pi(yaw - attitude.yaw)
        if piloting.move is not None:
            piloting.hover()  # a moveBy replaces a moveBy, of a moveTo nobody says so
        task = asyncio.get_running_loop().create_task(self._relative_move(wanted, front, right, down, turn))
        self._relative.add(task)
        task.add_done_callback(self._relative.discard)

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
        elif how is MoveEnd.CANCELED and self._is_news_of(wanted):
            self._failure = texts.MOVE_CANCELLED
            self._drop(texts.MOVE_CANCELLED)

    def _is_news_of(self, wanted: _Wanted) -> bool:
        """Of a move that was replaced or stopped there is nothing to say."""
        return self._begun == wanted and self._wanted is None

    def _failed(self, wanted: _Wanted, why: OperatorText, *, again: bool) -> None:
        """The drone did not make a move."""
        if not self._is_news_of(wanted):
            return
        if again:
            self._retry_at = asyncio.get_running_loop().time() + RETRY
        self._failure = why
        self._drop(why)
        # One that was refused leaves an older one alone, which nobody asks for any more.
        if self._vehicle.drone.piloting.sticks_blocked is None:
            with contextlib.suppress(LinkLost):
                self._vehicle.drone.piloting.hover()
