"""The return home as a verb, and how one that was asked for is ended.

A return may have begun by itself, or become one of the drone's own while it was ours: those are not ours to stop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from anafi_mav.arsdk.messages import rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, FlyingStateChanged
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.drone.element import Element
from anafi_mav.drone.expectation import Commander, loop_time
from anafi_mav.drone.piloting.moves import Move, MoveEnd, Moves
from anafi_mav.drone.piloting.state import PilotingState, in_state
from anafi_mav.drone.piloting.stick_stream import StickStream
from anafi_mav.drone.sent_commands import QUIET
from anafi_mav.drone.status.alerts import spoken
from anafi_mav.drone.status.home import BY_ITSELF, Home
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LinkLost

_TAKES_OFF = frozenset({FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF, FlyingState.TAKINGOFF})
_FLIES = frozenset({FlyingState.HOVERING, FlyingState.FLYING})


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
        finally:
            answer.close()
        # The event may have been about an earlier return: what ends this one is that the drone has the order.
        await self._commander.stops_delivered(rth.Abort.NAME, timeout - (loop_time() - began))
        if self._home.state.returning:
            raise CommandTimeout(rth.Abort.NAME, timeout)
        return True

    def abort(self, even_its_own: bool = False) -> asyncio.Future[None]:
        """End a return.

        Until the drone has answered, what it last said of a return is no longer true.
        """
        self._moves.aborting = True
        self._abortion_insists = even_its_own

        def quiet(delivery: asyncio.Future[None]) -> None:
            if delivery is self._abortion:  # a newer one has its own time
                self._moves.aborted()

        def heard(delivery: asyncio.Future[None]) -> None:
            asyncio.get_running_loop().call_later(QUIET, quiet, delivery)

        delivery = self._abortion = self._commander.send_stop(rth.Abort())
        delivery.add_done_callback(heard)
        return delivery

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
