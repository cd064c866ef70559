"""A moveBy, a moveTo and the return home as verbs, and how what they started is stopped.

Which of them has not ended is kept in `moves`, which reads the drone's events; the commands are sent from here. A
return may have begun by itself, or become one of the drone's own while it was ours: those are not ours to stop.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.arsdk.messages import move as guided
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, FlyingStateChanged, MoveToStatus, OrientationMode
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.drone.element import Element, Position
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation, loop_time, require_number
from anafi_mav.drone.piloting.moves import FASTEST, Displacement, Move, MoveEnd, Moves
from anafi_mav.drone.piloting.state import PilotingState, in_state, require_free
from anafi_mav.drone.piloting.stick_stream import StickStream
from anafi_mav.drone.sent_commands import QUIET
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.drone.status.home import BY_ITSELF, Home
from anafi_mav.errors import (
    AnafiMavError,
    CommandRejected,
    CommandTimeout,
    LinkLost,
    LocalProtocolError,
    NotSupported,
)
from anafi_mav.units import RAD_PER_DEG, is_finite, wrap_360

MOVE_BY_MARGIN = 20.0
"""s that a relative move may take beyond the flight itself."""
MOVE_BY_SLOWEST = 0.5
"""m/s and rad/s below which a relative move is aborted.

The drone chooses the speed; this is far below it.
"""

_TAKES_OFF = frozenset({FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF, FlyingState.TAKINGOFF})
_FLIES = frozenset({FlyingState.HOVERING, FlyingState.FLYING})

_WITH_HEADING = (OrientationMode.HEADING_START, OrientationMode.HEADING_DURING)


class GuidedMoves:
    """The moves that are verbs. `Piloting` says what its verbs of the same names promise."""

    def __init__(
        self, commander: Commander, flight: Element[PilotingState], home: Home, sticks: StickStream, moves: Moves
    ) -> None:
        self._commander = commander
        self._flight = flight
        self._home = home
        self._sticks = sticks
        self._moves = moves

    async def move_by(
        self,
        front: float,
        right: float,
        down: float,
        turn: float,
        timeout: float | None,
        turn_rate_dps: float | None,
    ) -> Displacement:
        if not is_finite(front, right, down, turn):
            raise LocalProtocolError("a relative move is not a number")
        require_number(timeout)
        require_free(self._flight.state, self._home.state)
        command = self._move_by_command(front, right, down, turn, turn_rate_dps)
        turn_rate = None if turn_rate_dps is None else turn_rate_dps * RAD_PER_DEG
        if timeout is None:
            timeout = MOVE_BY_MARGIN + (math.hypot(front, right, down) + abs(turn)) / MOVE_BY_SLOWEST
            if turn_rate is not None:
                timeout += abs(turn) / turn_rate
        offset = Displacement(front, right, down, turn)
        move = Move(self._commander.expect((), _decided_elsewhere), offset=offset, turn_rate=turn_rate)
        self._sticks.let_go()
        self._commander.abort_pending("a move was asked for")
        self._moves.by.append(move)
        try:
            self._commander.dispatch(move.answer, command, timeout)
            flown: Displacement = await move.answer.wait()
        finally:
            if move in self._moves.by:  # given up: neither the drone nor hover has ended it
                self._moves.drop_by(move, loop_time())
                # Otherwise the drone is busy with what is not ours to disturb.
                if self._sticks.blocked is None and not self._home.state.returning:
                    self._commander.send_stop_if_connected(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
        return flown

    def _move_by_command(
        self, front: float, right: float, down: float, turn: float, turn_rate_dps: float | None
    ) -> Message:
        if turn_rate_dps is None:
            return ardrone3.MoveBy(front, right, down, turn)
        if not (is_finite(turn_rate_dps) and turn_rate_dps > 0.0):
            raise LocalProtocolError("a turn needs a rate above zero")
        limits = self._flight.state.limits
        if limits is None:
            raise NotSupported("reported speed limits")
        return guided.ExtendedMoveBy(front, right, down, turn, FASTEST, limits.climb_mps, turn_rate_dps)

    async def move_to(
        self,
        latitude: float,
        longitude: float,
        altitude: float,
        heading_deg: float | None,
        horizontal_speed: float | None,
        vertical_speed: float | None,
        timeout: float,
        orientation: OrientationMode | None,
    ) -> Move:
        try:
            speeds = (horizontal_speed or 0.0) + (vertical_speed or 0.0)
            is_target = math.isfinite(latitude + longitude + altitude + (heading_deg or 0.0) + speeds)
        except OverflowError:  # an int that no float holds
            is_target = False
        if not is_target:
            raise LocalProtocolError("a target is not a number")
        require_number(timeout)
        if orientation is None:
            orientation = OrientationMode.NONE if heading_deg is None else OrientationMode.HEADING_DURING
        if (heading_deg is not None) != (orientation in _WITH_HEADING):
            raise LocalProtocolError(f"a moveTo with orientation {orientation.name} and heading {heading_deg}")
        require_free(self._flight.state, self._home.state)
        target = self._moves.distinct(Position(latitude, longitude, altitude), loop_time())
        command = self._move_to_command(target, orientation, heading_deg, horizontal_speed, vertical_speed)
        move = Move(self._commander.expect((), _decided_elsewhere), target)
        self._sticks.let_go()
        self._commander.abort_pending("a move was asked for")
        obsolete = self._moves.begin_to(move)
        if obsolete is not None:
            self._commander.cancel(obsolete.answer.token)
        try:
            self._commander.dispatch(move.answer, command, timeout)
            await move.answer.wait()
            if self._moves.to is move:
                self._sticks.silence()
        finally:
            if not move.running and self._moves.to is move:  # given up: it must not start later
                self._moves.cancel_to("given up")
                move.answer.close()  # not awaited when it was refused before it was sent
                self._commander.send_stop_if_connected(ardrone3.CancelMoveTo())
        return move

    def _move_to_command(
        self,
        to: Position,
        mode: OrientationMode,
        heading_deg: float | None,
        horizontal_speed: float | None,
        vertical_speed: float | None,
    ) -> Message:
        heading = 0.0 if heading_deg is None else wrap_360(heading_deg)
        if horizontal_speed is None and vertical_speed is None:
            return ardrone3.MoveTo(to.latitude, to.longitude, to.altitude, mode, heading)
        if any(speed is not None and speed <= 0.0 for speed in (horizontal_speed, vertical_speed)):
            raise LocalProtocolError("a moveTo needs a speed above zero")
        limits = self._flight.state.limits
        if limits is None:
            raise NotSupported("reported speed limits")
        return guided.ExtendedMoveTo(
            to.latitude,
            to.longitude,
            to.altitude,
            guided.OrientationMode(mode.value),
            heading,
            FASTEST if horizontal_speed is None else horizontal_speed,
            limits.climb_mps if vertical_speed is None else vertical_speed,
            limits.yaw_rate_dps,
        )

    def stop(self, why: str) -> None:
        """Cancel our moveTo and moveBys.

        The cancellations go through the command queue in sequence, so a later move is not hit.
        """
        if self._moves.to is None and not self._moves.by:
            return
        commands = self.ends(of_others=False)
        self.drop(why)
        for command in commands:
            self._commander.send_stop(command)

    def ends(self, *, of_others: bool) -> list[Message]:
        """Return the commands that end our moveTo and moveBys.

        `of_others`: also those of another controller or an earlier connection, as far as the drone reports them. A
        return goes on.
        """
        state, home, moves, commands = self._flight.state, self._home.state, self._moves, list[Message]()
        is_other = state.move_to == MoveToStatus.RUNNING and not home.returning_by_itself
        if moves.to is not None or (of_others and is_other):
            commands.append(ardrone3.CancelMoveTo())
        may_be_other = moves.inherited and state.flying in _FLIES and not home.returning
        if moves.by or (of_others and may_be_other):
            commands.append(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
        return commands

    def drop(self, why: str) -> None:
        """Let our moveTo and moveBys end here, which `ends` ends in the drone."""
        for move in (self._moves.cancel_to(why), *self._moves.cancel_by(why, loop_time())):
            if move is not None:
                self._commander.cancel(move.answer.token)


def _decided_elsewhere(message: Message) -> None:
    """The judge of moves: `Moves` knows which of them an event speaks of."""


class ReturnHome:
    """Returns home that were asked for.

    `Piloting` says what its verbs of the same names promise.
    """

    def __init__(
        self,
        commander: Commander,
        flight: Element[PilotingState],
        home: Home,
        sticks: StickStream,
        moves: Moves,
        end_movement: Callable[[str], None],
    ) -> None:
        """Store `end_movement`, which cancels what the drone flies; its argument is the reason."""
        self._end_movement = end_movement
        self._commander = commander
        self._flight = flight
        self._home = home
        self._sticks = sticks
        self._moves = moves
        self._abortion: asyncio.Future[None] | None = None
        """The order to end a return that was given last."""
        self._abortion_insists = False
        """It is meant for a return of the drone's own, too."""

    def link_lost(self) -> None:
        """Drop the command that ends a return; it is no longer ours."""
        self._abortion = None

    async def return_home(self, timeout: float) -> Move | None:
        require_number(timeout)
        self._commander.require_link()
        if self._home.state.returning and not self._moves.aborting:
            return None
        if self._home.state.rth == RthState.UNAVAILABLE:
            raise CommandRejected("return home is unavailable")
        if self._flight.state.flying == FlyingState.EMERGENCY_LANDING:
            raise CommandRejected(in_state(self._flight.state.flying))

        def judge(message: rth.State) -> bool | AnafiMavError | None:
            if message.state in (RthState.IN_PROGRESS, RthState.PENDING):
                return True
            if message.state == RthState.UNAVAILABLE:
                return CommandRejected(f"return home is unavailable: {spoken(message.reason)}")
            return None

        self._commander.abort_pending("the drone is to return home")
        self._sticks.release()  # raises while the pilot at a Skycontroller flies: nothing waits for an answer then
        self._end_movement("the drone is to return home")
        move = Move(self._commander.expect((rth.State,), judge))
        self._moves.returning = move
        try:
            takes_off = self._flight.state.flying in _TAKES_OFF
            self._commander.dispatch(move.answer, rth.ReturnToHome(), timeout)
            if takes_off and await self._has_taken_off(move):  # it has ignored what it received before
                self._commander.cancel(move.answer.token)
                self._commander.dispatch(move.answer, rth.ReturnToHome(), timeout)
            await move.answer.wait()
        except (CommandRejected, LinkLost):
            if self._moves.returning is move:
                self._moves.returning = None
            move.end(MoveEnd.ERROR)
            raise
        # After a timeout it stays ours: should the drone begin to return all the same, hover has to stop it.
        return move

    async def settle_return(self, timeout: float) -> bool:
        if not self._home.state.returning or self._flight.state.flying != FlyingState.HOVERING:
            return self._home.state.returning
        states = self._commander.expect((common.AllStatesChanged,), lambda message: True)
        try:
            states.expire_after(timeout, common.AllStates.NAME)
            self._home.request_states()
            await states.wait()
        finally:
            states.close()
        return self._home.state.returning

    async def _has_taken_off(self, move: Move) -> bool:
        """Wait until the drone hovers or flies; return False when the return is answered before."""
        hover = self._commander.expect((FlyingStateChanged,), lambda message: True if message.state in _FLIES else None)
        try:
            await asyncio.wait({move.answer.future, hover.future}, return_when=asyncio.FIRST_COMPLETED)
        except BaseException:
            self._commander.cancel(move.answer.token)
            move.answer.close()
            raise
        finally:
            hover.close()
        return not move.answer.future.done()

    async def cancel_return_home(self, timeout: float, *, even_its_own: bool = False) -> bool:
        require_number(timeout)
        self._commander.require_link()
        home = self._home.state
        if home.returning_by_itself and not even_its_own:
            raise CommandRejected(BY_ITSELF)
        asked = self.drop("the return was cancelled")
        if not home.returning and not asked and not self._moves.aborting:
            return False
        answer = self._commander.expect((rth.State,), _ends_return)
        began = loop_time()
        try:
            await answer.wait_or_quiet(self.abort(even_its_own), rth.Abort.NAME, timeout)
            # The event may have been about an earlier return: what ends this one is that the drone has the order.
            await self._commander.stops_delivered(rth.Abort.NAME, timeout - (loop_time() - began))
            if self._home.state.returning:
                await answer.wait()  # for the states that `abort` has requested
        finally:
            answer.close()
        if self._home.state.returning:
            raise CommandTimeout(rth.Abort.NAME, timeout)
        return True

    def abort(self, even_its_own: bool = False) -> asyncio.Future[None]:
        """End a return.

        Until the drone has answered, what it last said of a return is no longer true. One that reports nothing is asked
        for its states: it may have ended the return before without a report, and an abort that finds none is silent.
        """
        self._moves.aborting = True
        self._abortion_insists = even_its_own

        def quiet(delivery: asyncio.Future[None]) -> None:
            if delivery is not self._abortion:  # a newer one has its own time
                return
            if not self._home.state.returning:
                self._moves.aborted()
                return
            states = self._commander.expect((common.AllStatesChanged,), lambda message: True)
            states.expire_after(ANSWER_TIMEOUT, common.AllStates.NAME)
            states.future.add_done_callback(lambda known: self._states_known(delivery, states))
            with contextlib.suppress(LinkLost):
                self._home.request_states()

        def heard(delivery: asyncio.Future[None]) -> None:
            asyncio.get_running_loop().call_later(QUIET, quiet, delivery)

        delivery = self._abortion = self._commander.send_stop(rth.Abort())
        delivery.add_done_callback(heard)
        return delivery

    def _states_known(self, delivery: asyncio.Future[None], states: Expectation[bool]) -> None:
        """The drone has reported its states after an abort, or answers too late."""
        states.close()
        if delivery is self._abortion:
            self._moves.aborted()

    def drop(self, why: str) -> bool:
        """The return that we asked for, running or on its way, is not ours any more.

        False: there was none.
        """
        returning, self._moves.returning = self._moves.returning, None
        if returning is None:
            return False
        returning.end(MoveEnd.CANCELED)
        returning.answer.fail(CommandRejected(why))
        self._commander.cancel(returning.answer.token)
        return True

    def on_state(self, message: rth.State, now: float) -> None:
        """Follow the state of a return.

        A command against a return is withdrawn when that is now the drone's own.
        """
        self._moves.on_return(message, now)
        if self._home.state.returning_by_itself and self._abortion is not None and not self._abortion_insists:
            # It was given against a return that a user had asked for.
            self._commander.withdraw(self._abortion, CommandRejected(BY_ITSELF))

    def ends_ours(self, message: rth.State) -> bool | AnafiMavError | None:
        """A judge: has the return that we asked for ended?"""
        if self._home.state.returning_by_itself:
            return CommandRejected(BY_ITSELF)
        return _ends_return(message)


def _ends_return(message: rth.State) -> bool | None:
    return True if message.state in (RthState.AVAILABLE, RthState.UNAVAILABLE) else None
