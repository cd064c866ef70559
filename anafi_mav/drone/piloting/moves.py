"""Moves that we started and that have not ended.

They are the moveTo, the moveBys and the return home of this connection. Hover must cancel exactly these, and only
these. The drone's events report how a move continues and ends; this module reads them, `piloting` sends the commands.

Two facts make the bookkeeping more than a flag. A new moveTo replaces the running one without an event about it, and
a new moveBy makes the previous one end as "interrupted" (ardrone3.xml 1-0-10, 1-0-7). And an event does not name the
command that it answers: it may belong to a move that was cancelled a moment ago. An event about a moveTo contains the
target, so two that could be confused do not get the same one.
"""

from __future__ import annotations

import asyncio
import enum
import math
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from anafi_mav import geo
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import MoveByError, MoveToStatus
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.drone.element import Position, finite, position
from anafi_mav.drone.expectation import Expectation
from anafi_mav.drone.piloting.state import MOTORS_OFF
from anafi_mav.drone.status.home import Home
from anafi_mav.errors import CommandRejected

MAX_UNANSWERED = 8
"""Aborted moveTos that are remembered.

The drone answers one within a few tenths of a second.
"""

STRAY_FOR = 2.0
"""s after the end of a move in which an event may still be about it: a moveByEnd after a cancelled moveBy, or that of
the zero move that cancelled it; the end of a moveTo once more."""

_SAME_PLACE_DEG = 1e-7
"""About a centimetre. The drone echoes a target as it got it; this tolerates a detour through single precision."""
_SAME_HEIGHT = 1e-3
_ROUNDED = 1.0
"""m by which the echo of the only moveTo that is waited for may differ from its target."""
_APART, _APART_SHARE = 2e-3, 2e-6
"""m, and share of the height, by which two moveTos differ at least.

Twice the tolerance of `_same`.
"""
_NO_MOVE = 1e-3
"""m or rad below which a moveBy went nowhere."""
_TINY = 0.1, 0.05
"""m and rad within which a drone counts as there: a moveBy that asks for no more may go nowhere."""
_SHORT = 1.0, 0.2
"""m and rad by which the end of a moveBy may differ from what was commanded."""
FASTEST = 16.0
"""m/s over ground, the Ai's top speed (anafi_ros paper, table I): stands for "no limit" where Parrot has no word for it
and another limit is given."""
_FASTEST_CLIMB, _FASTEST_TURN = 6.0, 3.5
"""m/s and rad/s that no ANAFI exceeds: a moveBy takes longer than its offset at these."""
_ON_ITS_WAY = 1.0
"""s after a moveBy was cancelled here in which the drone may still complete it: what ends it there is on its way."""


class MoveEnd(enum.Enum):
    """How a move ended."""

    DONE = "done"
    CANCELED = "canceled"
    """By this program, by a landing or by another controller."""
    ERROR = "error"
    """The drone could not do it."""
    REPLACED = "replaced"
    """A newer move took its place."""
    LINK_LOST = "link lost"
    """Unknown: the link was lost on the way."""


class Displacement(msgspec.Struct, frozen=True):
    """Distance flown by a moveBy, in the axes of the body at its start."""

    front: float
    """m."""
    right: float
    """m."""
    down: float
    """m."""
    turn: float
    """rad, + clockwise."""


class Move:
    """A move under way.

    `target` is set for a moveTo only; its altitude is above the take-off point. `offset` is set for a moveBy only, and
    `turn_rate` (rad/s) if its turn has a limit.
    """

    __slots__ = ("answer", "begun", "echo", "ended", "offset", "running", "target", "turn_rate")

    def __init__(
        self,
        answer: Expectation[Any],
        target: Position | None = None,
        offset: Displacement | None = None,
        turn_rate: float | None = None,
    ) -> None:
        self.answer = answer
        """The wait of the verb that started it."""
        self.target = target
        self.offset = offset
        self.turn_rate = turn_rate
        self.begun = asyncio.get_running_loop().time()
        """When it was about to be sent, s."""
        self.echo: Position | None = None
        """The target as the drone reports it, where that differs from `target`."""
        self.running = False
        """The drone said that it is under way."""
        self.ended: asyncio.Future[MoveEnd] = asyncio.get_running_loop().create_future()
        """Do not await this one, a cancelled wait would cancel it: use `result`."""

    async def under_way(self) -> bool:
        """Wait until the drone flies this moveTo, or will not; return True when it does.

        For callers other than the verb that started it.
        """
        answer = self.answer.future
        await asyncio.wait({answer})
        return not answer.cancelled() and answer.exception() is None

    async def result(self) -> MoveEnd:
        """Wait until the move has ended; return how. Never raises."""
        return await asyncio.shield(self.ended)

    def end(self, how: MoveEnd) -> None:
        if not self.ended.done():
            self.ended.set_result(how)

    def earliest_end(self, *, by_rate: bool) -> float:
        """Return when a moveBy can be over at the earliest (s).

        At the speed of the fastest drone, and as near to its end as counts as there. `by_rate`: a drone that keeps to
        the limit of the turn; some turn faster, and so does a simulated one whose time is accelerated.
        """
        if (offset := self.offset) is None:
            return self.begun
        rate = min(self.turn_rate, _FASTEST_TURN) if by_rate and self.turn_rate is not None else _FASTEST_TURN
        length, angle = _TINY
        over_ground = (math.hypot(offset.front, offset.right) - length) / FASTEST
        climb, turn = (abs(offset.down) - length) / _FASTEST_CLIMB, (abs(offset.turn) - angle) / rate
        return self.begun + max(over_ground, climb, turn, 0.0)

    def is_to(self, message: ardrone3.MoveToChanged) -> bool:
        """Does this event speak of this move's target?"""
        return any(place is not None and _same(message, place) for place in (self.target, self.echo))

    def may_be_to(self, message: ardrone3.MoveToChanged) -> bool:
        """Return True when this event's target is this move's but for rounding.

        Such rounding occurs in a conversion through another frame.
        """
        target = self.target
        if target is None or position(message.latitude, message.longitude, message.altitude) is None:
            return False
        away = geo.distance(target.latitude, target.longitude, message.latitude, message.longitude)
        return math.hypot(away, target.altitude - message.altitude) <= _ROUNDED


def _same(one: ardrone3.MoveToChanged | Position, other: Position) -> bool:
    return (
        math.isclose(one.latitude, other.latitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG)
        and math.isclose(one.longitude, other.longitude, rel_tol=0.0, abs_tol=_SAME_PLACE_DEG)
        and math.isclose(one.altitude, other.altitude, rel_tol=1e-6, abs_tol=_SAME_HEIGHT)
    )


_MOVE_TO_ENDS = {
    MoveToStatus.DONE: MoveEnd.DONE,
    MoveToStatus.CANCELED: MoveEnd.CANCELED,
    MoveToStatus.ERROR: MoveEnd.ERROR,
}

_MOVE_BY_REFUSALS = {
    MoveByError.BUSY: "the drone is busy",
    MoveByError.NOT_AVAILABLE: "a relative move is not available now",
    MoveByError.INTERRUPTED: "the move was interrupted",
}


def _axes(message: ardrone3.MoveByEnd, offset: Displacement) -> list[tuple[float, float, float]]:
    """Return flown, commanded and tolerated value of each axis that is reported as a number."""
    length, angle = _SHORT
    axes = [
        (message.dX, offset.front, length),
        (message.dY, offset.right, length),
        (message.dZ, offset.down, length),
    ]
    if (turn := finite(message.dPsi)) is not None:
        axes.append((math.remainder(turn - offset.turn, 2.0 * math.pi) + offset.turn, offset.turn, angle))
    return [axis for axis in axes if finite(axis[0]) is not None]


def _is_short(message: ardrone3.MoveByEnd, offset: Displacement | None) -> bool:
    """Return True when this end of a moveBy is not where it was to lead."""
    return offset is not None and any(abs(flown - asked) > about for flown, asked, about in _axes(message, offset))


def _is_tiny(offset: Displacement | None) -> bool:
    """Return True when the end of this moveBy may be where it began."""
    length, angle = _TINY
    return offset is not None and (
        max(abs(offset.front), abs(offset.right), abs(offset.down)) <= length
        and abs(math.remainder(offset.turn, 2.0 * math.pi)) <= angle
    )


def _leads_elsewhere(message: ardrone3.MoveByEnd, offset: Displacement | None) -> bool:
    """Return True when this end of a moveBy is not on the way to where it was to lead."""
    return offset is not None and any(
        not min(0.0, asked) - about <= flown <= max(0.0, asked) + about
        for flown, asked, about in _axes(message, offset)
    )


_RETURN_ENDS = {StateReason.FINISHED: MoveEnd.DONE, StateReason.STOPPED: MoveEnd.CANCELED}


class Moves:
    """The moves of ours that have not ended."""

    def __init__(self, home: Home) -> None:
        self._home = home
        self.to: Move | None = None
        self.by: list[Move] = []
        """Oldest first: the drone ends them in this order."""
        self.returning: Move | None = None
        self._older: Move | None = None
        """The moveTo that still runs while `to` waits for its answer: a refused newer one leaves it alone."""
        self._cancelling: Move | None = None
        """The moveTo that we cancelled and whose CANCELED has not come yet."""
        self._unanswered: tuple[Position, ...] = ()
        """Targets of moveTos that were aborted or replaced before the drone had reported on them.

        It may still do so until it flies a newer one.
        """
        self._ended: tuple[tuple[Position, float], ...] = ()
        """Targets of moveTos that the drone has ended, and when: it may report that twice."""
        self._stray_until = 0.0
        self._given_up: tuple[tuple[Displacement | None, float], ...] = ()
        """Offsets of moveBys that the drone may have completed, and until when it may report that.

        None: of one that is not ours.
        """
        self.inherited = True
        """True when a moveBy of an earlier connection may be under way.

        The drone was found flying; no event reports such a moveBy.
        """
        self.aborting = False
        """A return is being aborted: until the drone has answered, what it last said of a return is not true."""

    def started(self) -> tuple[Move, ...]:
        """All of them."""
        return tuple(move for move in (self.to, *self.by, self.returning) if move is not None)

    # -- what we do

    def distinct(self, target: Position, now: float) -> Position:
        """Return a target for a new moveTo that cannot be confused with an aborted or ended move.

        It is this target, or one a little below it when the drone's events about such a move would be taken for its
        own. Not above it, which the ceiling may forbid.
        """
        cancelling = () if self._cancelling is None or self._cancelling.target is None else (self._cancelling.target,)
        while any(_same(target, other) for other in (*self._before(now), *cancelling)):
            step = max(_APART, _APART_SHARE * abs(target.altitude))
            target = msgspec.structs.replace(target, altitude=target.altitude - step)
        return target

    def _before(self, now: float) -> list[Position]:
        """Return the targets of earlier moveTos that an event may still be about."""
        return [*self._unanswered, *(target for target, at in self._ended if now - at < STRAY_FOR)]

    def begin_to(self, move: Move) -> Move | None:
        """Note that a moveTo is about to be sent; return the pending one that it replaces.

        None when no moveTo of ours was pending. The one returned was not under way yet, and its verb no longer waits.
        """
        before, self.to = self.to, move
        if before is None:
            return None
        if before.running:
            self._older = before
            return None
        self._note_unanswered(before)
        before.end(MoveEnd.REPLACED)
        before.answer.fail(CommandRejected("replaced by a newer moveTo"))
        return before

    def cancel_to(self, why: str) -> Move | None:
        """Whatever moveTo there is, is about to be cancelled. Returns the newest.

        One that was under way ends when the drone says so.
        """
        newest, older = self.to, self._older
        self.to = self._older = None
        for move in (newest, older):
            if move is None:
                continue
            move.answer.fail(CommandRejected(why))
            if move.running:
                self._cancelling = move
            else:
                self._note_unanswered(move)
                move.end(MoveEnd.CANCELED)
        return newest

    def _note_unanswered(self, move: Move) -> None:
        if move.target is not None:
            self._unanswered = (*self._unanswered, move.target)[-MAX_UNANSWERED:]

    def cancel_by(self, why: str, now: float) -> list[Move]:
        """The moveBys are about to be cancelled; returns them.

        They end here: the drone's event names none of them.
        """
        moves, self.by = self.by, []
        for move in moves:
            move.answer.fail(CommandRejected(why))
            move.end(MoveEnd.CANCELED)
            self._note_given_up(move, now)
        return moves

    def drop_by(self, move: Move, now: float) -> None:
        """The verb of this moveBy has given it up."""
        if move in self.by:
            self.by.remove(move)
            self._note_given_up(move, now)
        move.end(MoveEnd.CANCELED)

    def _note_given_up(self, move: Move, now: float) -> None:
        """Expect the end of a moveBy that is not awaited any longer."""
        self._stray_until = now + STRAY_FOR
        if move.earliest_end(by_rate=True) <= now + _ON_ITS_WAY:
            self._note_stray(move.offset)

    def _note_stray(self, offset: Displacement | None) -> None:
        self._given_up = (*self._given_up, (offset, self._stray_until))[-MAX_UNANSWERED:]

    def end_cancelled(self) -> None:
        """The moveTo that was cancelled is over; the drone may still report its end."""
        move, self._cancelling = self._cancelling, None
        if move is not None:
            self._note_unanswered(move)
            move.end(MoveEnd.CANCELED)

    def aborted(self) -> None:
        """The drone has had an abort, and had time to answer."""
        self.aborting = False

    def expect_stray(self, now: float) -> None:
        """Note that any moveBy is about to be ended.

        The event of one that is not ours is not about ours.
        """
        self._stray_until = now + STRAY_FOR
        if self.inherited:
            self._note_stray(None)
        self.inherited = False

    def clear(self, how: MoveEnd) -> None:
        """All have ended, as far as we are concerned."""
        for move in (*self.started(), self._older, self._cancelling):
            if move is not None:
                move.end(how)
                move.answer.fail(CommandRejected(how.value))
        self.to = self.returning = self._older = self._cancelling = None
        self.by = []
        self._unanswered = self._ended = self._given_up = ()
        self._stray_until = 0.0
        self.aborting = False
        self.inherited = True

    # -- what the drone says

    def reactions(self) -> Mapping[type[Message], Callable[[Any, float], None]]:
        """Return the handlers of events, called after the reducers."""
        return {
            ardrone3.MoveToChanged: self._on_move_to,
            ardrone3.MoveByEnd: self._on_move_by_end,
        }

    def _on_move_to(self, message: ardrone3.MoveToChanged, now: float) -> None:
        move = self.to
        if message.status == MoveToStatus.RUNNING:
            if move is None:
                return
            is_own = move.is_to(message)
            if not is_own and any(_same(message, one) for one in self._before(now)):
                return
            if not is_own and not move.running and self._is_alone and move.may_be_to(message):
                move.echo = position(message.latitude, message.longitude, message.altitude)
                is_own = True
            if is_own:
                self._under_way(move)
            return
        how = _MOVE_TO_ENDS.get(message.status)
        if how is None:
            return
        if move is None or not move.running:
            # Commands are carried out in their order, so this may still speak of what was before.
            if self._cancelling is not None and self._cancelling.is_to(message):
                self._end(self._cancelling, how, now)
                self._cancelling = None
                return
            if self._older is not None and self._older.is_to(message):
                self._end(self._older, how, now)
                self._older = None
                return
        if any(_same(message, target) for target in self._before(now)):
            return
        if move is None or (not move.is_to(message) and (move.running or how is MoveEnd.DONE)):
            return
        self.to, self._older = self._older, None
        self._end(move, how, now)
        move.answer.fail(CommandRejected(f"the drone answered the moveTo with {how.value}"))

    def _end(self, move: Move, how: MoveEnd, now: float) -> None:
        """The drone has reported the end of a moveTo."""
        if move.target is not None:
            self._ended = (*self._ended, (move.target, now))[-MAX_UNANSWERED:]
        move.end(how)

    @property
    def _is_alone(self) -> bool:
        """True when no other moveTo of ours is left that the drone's next event could be about."""
        return not self._unanswered and self._older is None and self._cancelling is None

    def _under_way(self, move: Move) -> None:
        """The newest moveTo is being flown, so that all before it are over."""
        if self._older is not None:
            self._older.end(MoveEnd.REPLACED)
            self._older = None
        if self._cancelling is not None:
            self._cancelling.end(MoveEnd.CANCELED)
            self._cancelling = None
        self._unanswered = ()
        move.running = True
        move.answer.succeed(move)

    def _on_move_by_end(self, message: ardrone3.MoveByEnd, now: float) -> None:
        if not self.by or self._is_stray(message, now):
            return
        move = self.by.pop(0)
        is_doubtful = message.error == MoveByError.INTERRUPTED or _is_short(message, move.offset)
        if not self.by and (is_doubtful or now < self._stray_until):
            # Nothing of ours has interrupted it: it may be the late end of an earlier one, and this one is flown on.
            self.inherited = True
        if message.error == MoveByError.OK:
            move.end(MoveEnd.DONE)
            move.answer.succeed(Displacement(message.dX, message.dY, message.dZ, message.dPsi))
            return
        move.end(MoveEnd.CANCELED if message.error == MoveByError.INTERRUPTED else MoveEnd.ERROR)
        move.answer.fail(CommandRejected(_MOVE_BY_REFUSALS.get(message.error, "the drone could not make the move")))

    def _is_stray(self, message: ardrone3.MoveByEnd, now: float) -> bool:
        """Return True when this event belongs to a moveBy that was cancelled before the present one.

        Nothing but a newer moveBy interrupts one, a move that asks for more than a drone tells from nothing does not
        succeed by staying, and none is flown faster than a drone flies. One that turns faster than it was to turn is
        that of a like one, if there was any.
        """
        if now >= self._stray_until:
            return False
        if message.error == MoveByError.INTERRUPTED:
            return len(self.by) == 1  # of two, the newer has interrupted the older
        if message.error != MoveByError.OK:
            return False
        went_nowhere = max(abs(message.dX), abs(message.dY), abs(message.dZ), abs(message.dPsi)) < _NO_MOVE
        move = self.by[0]
        offset = move.offset
        may_be_late = any(now < until and (one is None or not _is_short(message, one)) for one, until in self._given_up)
        is_early = now < move.earliest_end(by_rate=may_be_late) and not _is_short(message, offset)
        return is_early or (went_nowhere and not _is_tiny(offset)) or _leads_elsewhere(message, offset)

    def on_flying_state(self, message: ardrone3.FlyingStateChanged, now: float) -> None:
        """Motors that stand end every move."""
        if message.state in MOTORS_OFF:
            self.inherited = False
            self.cancel_to("the motors are off")
            if self._cancelling is not None:
                self._cancelling.end(MoveEnd.CANCELED)
                self._cancelling = None
            self.cancel_by("the motors are off", now)
            if self.returning is not None and self.returning.running:
                self.returning.end(MoveEnd.CANCELED)
                self.returning = None

    def on_return(self, message: rth.State, now: float) -> None:
        """A return of ours goes on or ends, or has become one of the drone's own."""
        if not self._home.state.returning:
            self.aborting = False
        move = self.returning
        if move is None:
            return
        if self._home.state.returning_by_itself:
            # The drone has reasons of its own now: it is no longer ours to stop.
            self.returning = None
            move.end(MoveEnd.REPLACED)
        elif self._home.state.returning:
            move.running = True
        elif move.running:
            self.returning = None
            move.end(_RETURN_ENDS.get(message.reason, MoveEnd.ERROR))
