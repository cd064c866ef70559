"""Element piloting: the verbs that fly the drone. Each returns when the drone has confirmed it.

A verb raises `CommandRejected` when the drone, or what it reported, refuses; `CommandTimeout` when it stays silent,
and then its command is taken back; `LinkLost` when the link dies meanwhile. Signs and units are the drone's own:
body axes front, right, down; heights above the take-off point.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, rth
from anafi_mav.arsdk.messages import move as guided
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveToStatus, OrientationMode, PoiStatus
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.arsdk.messages.follow_me import Mode as FollowMeMode
from anafi_mav.arsdk.messages.rth import RthState
from anafi_mav.arsdk.wire import Message
from anafi_mav.drone.alerts import spoken
from anafi_mav.drone.element import Position, Reducer
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation
from anafi_mav.drone.home import Home
from anafi_mav.drone.moves import Displacement, Move, MoveEnd, Moves
from anafi_mav.drone.piloting_settings import PilotingSettings
from anafi_mav.drone.piloting_state import MOTORS_OFF, REDUCERS, PilotingState
from anafi_mav.drone.sticks import Limits, PilotingCommand, Sticks, percent
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported
from anafi_mav.units import RAD_PER_DEG, wrap_360

log = logging.getLogger("anafi_mav")

RAMPING_TIMEOUT = 10.0
"""s that the motors may take from their first turn to the take-off."""

MOVE_BY_MARGIN = 20.0
"""s that a relative move may take beyond the flight itself."""
MOVE_BY_SLOWEST = 0.5
"""m/s and rad/s below which a relative move is given up: the speed is the drone's choice, this is far below it."""

FASTEST = 16.0
"""m/s over ground, the Ai's top speed (anafi_ros paper, table I): stands for "no limit" where Parrot has no word for it
and another limit is given."""

TAKE_OFF_MEMORY = 10.0
"""s after a take-off was given up in which the drone may still carry it out, or already does and could not say so."""

QUIET = 1.0
"""s after the drone received a command in which it would have said what it did; silence means that there was nothing to
do. Its acknowledgement came through, so its events do too, a few retransmissions of 150 ms later at most."""

EMERGENCY_TIMEOUT = 30.0
"""s that cutting the motors is tried for while the link seems to live but delivers nothing."""

RELEASES = 3
"""PCMDs that say that nobody holds the sticks; they are not acknowledged."""

_STICKS_DEAD = frozenset(
    {FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY, FlyingState.EMERGENCY_LANDING}
)
"""States in which no PCMD is sent: positive gaz cancels a landing (ardrone3.xml 1-0-3)."""
_TAKEN_OFF = frozenset({FlyingState.TAKINGOFF, FlyingState.HOVERING, FlyingState.FLYING})
_LANDING = frozenset({FlyingState.LANDING, FlyingState.LANDED, FlyingState.EMERGENCY_LANDING, FlyingState.EMERGENCY})
_IN_FLIGHT = frozenset({FlyingState.HOVERING, FlyingState.FLYING})
_MOTORS_CUT = frozenset({FlyingState.EMERGENCY, FlyingState.LANDED})


class Piloting(PilotingSettings):
    """Takes off, lands, moves, returns, hovers. `pilot` and `hover` act at once; all others are coroutines."""

    NOTHING = PilotingState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = REDUCERS

    def __init__(self, commander: Commander, home: Home, takeoff_blockers: Callable[[], list[str]]) -> None:
        super().__init__(commander)
        self._home = home
        self._takeoff_blockers = takeoff_blockers
        self._moves = Moves(home)
        self._sticks = Sticks()
        self._timer: asyncio.TimerHandle | None = None
        self._landings_asked = 0
        self._stopping: dict[type[Message], float] = {}
        """Orders to stop something that the drone has not answered yet: until when once is enough."""
        self._launches: set[Expectation[bool]] = set()
        """Waits of take-offs and hand launches whose command may not have left."""
        self._abortion: asyncio.Future[None] | None = None
        """The order to end a return that was given last."""
        self._abortion_insists = False
        """It is meant for a return of the drone's own, too."""
        self._may_take_off_until = -math.inf

    def reset(self) -> None:
        super().reset()
        self.link_lost()

    def link_lost(self) -> None:
        """Nothing of before is sent again, and what was started is nobody's any more."""
        self._silence_sticks()
        self._moves.clear(MoveEnd.LINK_LOST)
        self._stopping.clear()
        self._may_take_off_until = -math.inf
        self._abortion = None

    def reactions(self) -> Mapping[type[Message], Callable[[Any, float], None]]:
        """Events to be shown to this element beyond its reducers."""
        return {
            **self._moves.reactions(),
            rth.State: self._on_return,
            follow_me.State: lambda message, now: self._obeyed(follow_me.Stop),
            animation.State: lambda message, now: self._obeyed(animation.Cancel),
        }

    def _obeyed(self, order: type[Message]) -> None:
        self._stopping.pop(order, None)

    def _on_return(self, message: rth.State, now: float) -> None:
        self._moves.on_return(message, now)
        if self._home.state.returning_by_itself and self._abortion is not None and not self._abortion_insists:
            # It was given against a return that a user had asked for.
            self._commander.take_back(self._abortion, CommandRejected("the drone returns home by itself"))

    def on_plan(self, message: common.MavlinkFilePlayingStateChanged) -> None:
        """A flight plan plays, is paused or stopped."""
        if message.state == PlayingState.PLAYING:
            self._silence_sticks()

    # -- facts about what we do

    @property
    def moves_started(self) -> tuple[Move, ...]:
        """The moves of ours that have not ended; empty after a new connection."""
        return self._moves.started()

    @property
    def move(self) -> Move | None:
        """Our moveTo that has not ended."""
        return self._moves.to

    @property
    def moving(self) -> bool:
        """A moveTo or moveBy of ours has not ended."""
        return self._moves.to is not None or bool(self._moves.by)

    @property
    def sticks_blocked(self) -> str | None:
        """Why no setpoint is sent at present; None when the sticks work."""
        if self.state.plan == PlayingState.PLAYING:
            return "a flight plan plays"
        return self._sticks_dead

    @property
    def _sticks_dead(self) -> str | None:
        """Why no PCMD at all is sent at present, not even one that centres the sticks."""
        flying = self.state.flying
        if not self._commander.connected:
            return "not connected"
        if flying is None:
            return "the drone has not reported its flying state"
        if flying in _STICKS_DEAD:
            return f"the drone is in the state {spoken(flying)}"
        if self._landings_asked:
            return "the drone is about to land"
        if self._home.state.returning_by_itself and self._home.state.reason is not None:
            return f"the drone returns home by itself: {spoken(self._home.state.reason)}"
        return None

    @property
    def limits(self) -> Limits | None:
        """What 100 % stick is; None before the drone has reported all of it."""
        tilt, yaw, climb = self.state.max_tilt, self.state.max_rotation_speed, self.state.max_vertical_speed
        if tilt is None or yaw is None or climb is None:
            return None
        return Limits(tilt.current, yaw.current, climb.current)

    @property
    def about_to_fly(self) -> bool:
        """The drone stands, but a take-off of ours is on its way to it, or was and cannot be taken back.

        The same goes for a hand launch and a flight plan.
        """
        return self.state.flying == FlyingState.LANDED and (
            bool(self._launches)
            or self._now() < self._may_take_off_until
            or self._commander.may_begin(common.Stop, TAKE_OFF_MEMORY)
        )

    # -- up and down

    async def take_off(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Motors on and up to about a metre; returns when the drone says that it is taking off.

        A drone refuses by silence; `CommandRejected` then tells what it has reported against a take-off.
        """
        self._require_link()
        flying = self.state.flying
        if flying in _TAKEN_OFF:
            return
        if flying not in (FlyingState.LANDED, FlyingState.MOTOR_RAMPING):
            raise CommandRejected(_in_state(flying))
        await self._launch(ardrone3.TakeOff(), _TAKEN_OFF, timeout)

    async def hand_launch(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Motors idle, for a drone that is thrown or let go by a hand; returns when it waits for that.

        Refused as a take-off is. It flies as soon as it leaves the hand; `cancel_hand_launch` ends the wait.
        """
        self._require_link()
        flying = self.state.flying
        if flying == FlyingState.USERTAKEOFF:
            return
        if flying != FlyingState.LANDED:
            raise CommandRejected(_in_state(flying))
        if self._launches:
            raise CommandRejected("the drone is about to take off")
        try:
            await self._launch(ardrone3.UserTakeOff(1), _TAKEN_OFF | {FlyingState.USERTAKEOFF}, timeout)
        except LinkLost:
            raise
        except BaseException:
            # Given up: the motors of a drone that somebody holds must not start a moment later.
            self._commander.halt_if_connected(ardrone3.UserTakeOff(0))
            raise

    async def _launch(self, command: Message, up: frozenset[FlyingState], timeout: float) -> None:
        """Send a command that starts the motors; returns when the drone is in one of these states."""
        self._silence_sticks()

        def judge(message: ardrone3.FlyingStateChanged) -> bool | AnafiMavError | None:
            if message.state in up:
                return True
            if message.state == FlyingState.MOTOR_RAMPING:
                answer.expire_after(RAMPING_TIMEOUT, CommandTimeout(command.NAME, RAMPING_TIMEOUT))
            elif message.state in _MOTORS_CUT:
                return CommandRejected(self._why_on_the_ground("the motors stopped again"))
            return None

        answer = self._commander.expect((ardrone3.FlyingStateChanged,), judge)
        self._commander.dispatch(answer, command, timeout)
        self._launches.add(answer)
        try:
            await answer.wait()
        except CommandRejected:
            raise
        except BaseException as error:
            self._may_take_off_until = self._now() + TAKE_OFF_MEMORY
            if isinstance(error, CommandTimeout) and (reasons := self._why_on_the_ground("")):
                raise CommandRejected(reasons) from None
            raise
        finally:
            self._launches.discard(answer)

    async def cancel_hand_launch(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Stop the idling motors; returns when they stand, at once when they do and nothing is to start them."""
        self._require_link()
        if self.about_to_fly:
            await self.land(timeout)
            return
        if self.state.flying in MOTORS_OFF:
            return
        if self.state.in_air:
            raise CommandRejected("the drone flies")
        await self._commander.confirm(
            ardrone3.UserTakeOff(0),
            (ardrone3.FlyingStateChanged,),
            lambda message: True if message.state in MOTORS_OFF else None,
            timeout,
        )

    def _why_on_the_ground(self, otherwise: str) -> str:
        return ", ".join(self._takeoff_blockers()) or otherwise

    async def land(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Land here; returns when the drone is landing, at once when it is or has landed.

        A drone that stands but is `about_to_fly` is watched until it certainly stays there, or is made to land.
        """
        self._require_link()
        self._commander.call_off("the drone is to land")
        if self.state.flying in _LANDING and not self.about_to_fly:
            return
        # Level at once, then nothing, from here on and not from the drone's answer on: a positive gaz would cancel
        # the landing.
        self._centre_sticks()
        self._silence_sticks()
        self._landings_asked += 1
        try:
            if self.about_to_fly:
                await self._catch_take_off(timeout)
            if self.state.flying in _LANDING:
                return
            self._end_hand_launch()
            await self._commander.confirm(
                ardrone3.Landing(),
                (ardrone3.FlyingStateChanged,),
                lambda message: True if message.state in _LANDING else None,
                timeout,
            )
        finally:
            self._landings_asked -= 1

    def _end_hand_launch(self) -> None:
        """A drone that idles in a hand has no use for a Landing: it waits to be thrown, or for this."""
        if self.about_to_fly or self.state.flying in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF):
            self._commander.halt(ardrone3.UserTakeOff(0))

    async def _catch_take_off(self, timeout: float) -> None:
        """Return when the drone is off the ground, or when it certainly stays there.

        That is known once it has received a Landing, behind any take-off of ours, and then says nothing. Raises
        `CommandTimeout` while it is not known; the Landing is not taken back.
        """
        self._end_hand_launch()
        answer = self._commander.expect(
            (ardrone3.FlyingStateChanged,),
            lambda message: None if message.state in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF) else True,
        )
        try:
            delivery = self._commander.deliver(ardrone3.Landing())
            if not await self._ended(answer, delivery, ardrone3.Landing.NAME, timeout):
                self._may_take_off_until = -math.inf
                self._commander.certainly_not(common.Stop)
        finally:
            answer.close()

    async def _ended(self, answer: Expectation[Any], delivery: asyncio.Future[None], what: str, timeout: float) -> bool:
        """Wait for an answer that need not come: True when it came, False when the drone has the command and is quiet.

        Raises `CommandTimeout` when neither is known in time, `LinkLost`.
        """
        answer.expire_after(timeout, CommandTimeout(what, timeout))
        await asyncio.wait({answer.future, delivery}, return_when=asyncio.FIRST_COMPLETED)
        if not answer.future.done():
            delivery.result()  # raises LinkLost
            await asyncio.wait({answer.future}, timeout=QUIET)
            if not answer.future.done():
                return False
        answer.future.result()
        return True

    async def emergency(self) -> None:
        """Cut the motors, wherever the drone is: in the air it falls. Returns when the drone says that they are.

        Cancelling this does not take it back: it is repeated while there is a link, as Parrot does (arsdk-ng: timeout
        policy RETRY), for at most `EMERGENCY_TIMEOUT` while somebody waits for it. What waits to be sent is taken back.
        """
        self._require_link()
        self._silence_sticks()
        cut = self.state.flying in _MOTORS_CUT and not self.about_to_fly
        # Emergency overtakes what waits in the queue: nothing of that may follow it.
        self._commander.call_off("the motors are cut")
        for launch in self._launches:
            launch.fail(CommandRejected("the motors are cut"))
            if launch.token is not None:
                self._commander.cancel(launch.token)
        answer = self._commander.expect(
            (ardrone3.FlyingStateChanged,), lambda message: True if message.state in _MOTORS_CUT else None
        )
        try:
            delivery = self._commander.deliver(ardrone3.Emergency())
            said = await self._ended(answer, delivery, ardrone3.Emergency.NAME, EMERGENCY_TIMEOUT)
        except CommandTimeout as error:
            self._commander.take_back(delivery, error)  # said to have failed, it must not be carried out later
            raise
        finally:
            answer.close()
        if not said and not cut:
            raise CommandTimeout(ardrone3.Emergency.NAME, QUIET)

    # -- guided moves

    async def move_by(
        self,
        front: float,
        right: float,
        down: float,
        turn: float,
        timeout: float | None = None,
        turn_rate_dps: float | None = None,
    ) -> Displacement:
        """Fly a straight line relative to the body (m) while turning clockwise by `turn` (rad).

        `turn_rate_dps` (deg/s) limits the turn; None leaves it to the drone.
        Returns at the end of the move what was flown. Without a `timeout` the time given grows with the move.
        Giving up, by time or by cancellation of this coroutine, stops the drone.
        """
        if not math.isfinite(front + right + down + turn):
            raise LocalProtocolError("a relative move is not a number")
        self.require_free()
        command = self._move_by_command(front, right, down, turn, turn_rate_dps)
        if timeout is None:
            timeout = MOVE_BY_MARGIN + (math.hypot(front, right, down) + abs(turn)) / MOVE_BY_SLOWEST
            if turn_rate_dps is not None:
                timeout += abs(turn) / (turn_rate_dps * RAD_PER_DEG)
        move = Move(self._commander.expect((), _decided_elsewhere))
        self._centre_sticks()
        self._commander.call_off("a move was asked for")
        self._moves.by.append(move)
        try:
            self._commander.dispatch(move.answer, command, timeout)
            flown: Displacement = await move.answer.wait()
        finally:
            if move in self._moves.by:  # given up: neither the drone nor hover has ended it
                self._moves.drop_by(move, self._now())
                # Otherwise the drone is busy with what is not ours to disturb.
                if self.sticks_blocked is None and not self._home.state.returning:
                    self._commander.halt_if_connected(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
        return flown

    def _move_by_command(
        self, front: float, right: float, down: float, turn: float, turn_rate_dps: float | None
    ) -> Message:
        if turn_rate_dps is None:
            return ardrone3.MoveBy(front, right, down, turn)
        if not (math.isfinite(turn_rate_dps) and turn_rate_dps > 0.0):
            raise LocalProtocolError("a turn needs a rate above zero")
        limits = self.limits
        if limits is None:
            raise NotSupported("reported speed limits")
        return guided.ExtendedMoveBy(front, right, down, turn, FASTEST, limits.climb_mps, turn_rate_dps)

    async def move_to(
        self,
        latitude: float,
        longitude: float,
        altitude: float,
        heading_deg: float | None = None,
        horizontal_speed: float | None = None,
        vertical_speed: float | None = None,
        timeout: float = ANSWER_TIMEOUT,
    ) -> Move:
        """Fly to a place (deg, deg, m above take-off); returns when the drone is on its way.

        `heading_deg` (clockwise from north) is turned to on the way; None keeps the heading. `horizontal_speed`
        and `vertical_speed` (m/s) limit the speed; None leaves it to the drone. `Move.result` tells how it ends. A
        newer moveTo replaces an older one.
        """
        if not math.isfinite(
            latitude + longitude + altitude + (heading_deg or 0.0) + (horizontal_speed or 0.0) + (vertical_speed or 0.0)
        ):
            raise LocalProtocolError("a target is not a number")
        self.require_free()
        command = self._move_to_command(
            Position(latitude, longitude, altitude), heading_deg, horizontal_speed, vertical_speed
        )
        move = Move(self._commander.expect((), _decided_elsewhere), Position(latitude, longitude, altitude))
        self._centre_sticks()
        self._commander.call_off("a move was asked for")
        obsolete = self._moves.begin_to(move)
        if obsolete is not None and obsolete.answer.token is not None:
            self._commander.cancel(obsolete.answer.token)
        try:
            self._commander.dispatch(move.answer, command, timeout)
            await move.answer.wait()
            if self._moves.to is move:
                self._silence_sticks()
        finally:
            if not move.running and self._moves.to is move:  # given up: it must not start later
                self._moves.cancel_to("given up")
                self._commander.halt_if_connected(ardrone3.CancelMoveTo())
        return move

    def _move_to_command(
        self,
        to: Position,
        heading_deg: float | None,
        horizontal_speed: float | None,
        vertical_speed: float | None,
    ) -> Message:
        mode = OrientationMode.NONE if heading_deg is None else OrientationMode.HEADING_DURING
        heading = 0.0 if heading_deg is None else wrap_360(heading_deg)
        if horizontal_speed is None and vertical_speed is None:
            return ardrone3.MoveTo(to.latitude, to.longitude, to.altitude, mode, heading)
        if any(speed is not None and speed <= 0.0 for speed in (horizontal_speed, vertical_speed)):
            raise LocalProtocolError("a moveTo needs a speed above zero")
        limits = self.limits
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

    # -- home

    async def return_home(self, timeout: float = ANSWER_TIMEOUT) -> Move | None:
        """Fly home; returns when the drone is on its way or about to be. None: it was returning already."""
        self._require_link()
        if self._home.state.returning and not self._moves.aborting:
            return None
        if self._home.state.rth == RthState.UNAVAILABLE:
            raise CommandRejected("return home is unavailable")
        if self.state.flying == FlyingState.EMERGENCY_LANDING:
            raise CommandRejected(_in_state(self.state.flying))

        def judge(message: rth.State) -> bool | AnafiMavError | None:
            if message.state in (RthState.IN_PROGRESS, RthState.PENDING):
                return True
            if message.state == RthState.UNAVAILABLE:
                return CommandRejected(f"return home is unavailable: {spoken(message.reason)}")
            return None

        move = Move(self._commander.expect((rth.State,), judge))
        self._commander.call_off("the drone is to return home")
        self._release_sticks()
        self._moves.returning = move
        try:
            self._commander.dispatch(move.answer, rth.ReturnToHome(), timeout)
            await move.answer.wait()
        except (CommandRejected, LinkLost):
            if self._moves.returning is move:
                self._moves.returning = None
            move.end(MoveEnd.ERROR)
            raise
        # After a timeout it stays ours: should the drone begin to return all the same, hover has to stop it.
        return move

    async def cancel_return_home(self, timeout: float = ANSWER_TIMEOUT, *, even_its_own: bool = False) -> None:
        """Stop a return that a user asked for, through us or not, also one that has not begun yet.

        One that the drone began by itself is stopped only with `even_its_own`, else `CommandRejected` is raised.
        """
        self._require_link()
        home = self._home.state
        if home.returning_by_itself and not even_its_own:
            raise CommandRejected("the drone returns home by itself")
        asked = self._drop_return("the return was cancelled")
        if not home.returning and not asked and not self._moves.aborting:
            return
        answer = self._commander.expect((rth.State,), _ends_return)
        began = self._now()
        try:
            await self._ended(answer, self._abort(even_its_own), rth.Abort.NAME, timeout)
        finally:
            answer.close()
        # The event may have been about an earlier return: what ends this one is that the drone has the order.
        await self._commander.halted(rth.Abort.NAME, timeout - (self._now() - began))
        if self._home.state.returning:
            raise CommandTimeout(rth.Abort.NAME, timeout)

    def _abort(self, even_its_own: bool = False) -> asyncio.Future[None]:
        """End a return. Until the drone has answered, what it last said of a return is no longer true."""
        self._moves.aborting = True
        self._abortion_insists = even_its_own

        def quiet(delivery: asyncio.Future[None]) -> None:
            if delivery is self._abortion:  # a newer one has its own time
                self._moves.aborted()

        def heard(delivery: asyncio.Future[None]) -> None:
            asyncio.get_running_loop().call_later(QUIET, quiet, delivery)

        delivery = self._abortion = self._commander.halt(rth.Abort())
        delivery.add_done_callback(heard)
        return delivery

    def _drop_return(self, why: str) -> bool:
        """The return that we asked for, running or on its way, is not ours any more. False: there was none."""
        returning, self._moves.returning = self._moves.returning, None
        if returning is None:
            return False
        returning.end(MoveEnd.CANCELED)
        returning.answer.fail(CommandRejected(why))
        if returning.answer.token is not None:
            self._commander.cancel(returning.answer.token)
        return True

    # -- sticks

    def pilot(self, command: PilotingCommand | None, age: float = 0.0) -> None:
        """Hold these sticks: a PCMD leaves now and every 50 ms, for `sticks.HOLD_LIMIT` unless it is said again.

        `age` (s) is how long ago it was said: a setpoint that is corrected on the way is not a new one. None lets the
        sticks go (centred for two seconds), and so does silence. A setpoint takes over from a moveTo or
        moveBy of ours, during which the drone would ignore it. Nothing is sent and nothing kept while
        `sticks_blocked`.
        Raises `NotSupported` before the drone has reported its limits, `LinkLost` without a link.
        """
        self._require_link()
        if command is None:
            self._centre_sticks()
            return
        limits = self.limits
        if limits is None:
            raise NotSupported("reported tilt and speed limits")
        position = percent(command, limits)
        if self.sticks_blocked is None:
            self._stop_moves("taken over by the sticks")
            if self.state.following != FollowMeMode.LOOK_AT:  # which leaves the flying to the sticks
                self._stop_following()
            self._stop_animation()
            now = self._now()
            self._sticks.command(position, now, now - age)
        self._pump()

    def hover(self) -> None:
        """Stop now, whatever we had started, and stay: takes effect before it returns.

        Cancels moveTo and moveBys (those of an earlier connection or another controller too, as far as the drone
        tells), a running point of interest, an animation, the following of a target, a playing flight plan (it is
        paused) and a return that was asked for through us, and whatever of these has been asked for and has not begun;
        then centres the sticks for two seconds, since a PCMD alone neither stops a moveTo nor is it acknowledged. A
        landing or a return that the drone began by itself goes on. Raises `LinkLost` without a link.
        """
        self._require_link()
        state = self.state
        self._commander.call_off("stopped by hover")
        cancelled = self._stop_moves("stopped by hover")
        if not self._home.state.returning_by_itself:
            if state.move_to == MoveToStatus.RUNNING and not cancelled:
                self._commander.halt(ardrone3.CancelMoveTo())
            if self._moves.inherited and state.flying in _IN_FLIGHT and not self._home.state.returning:
                self._moves.expect_stray(self._now())
                self._commander.halt(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
        if state.poi in (PoiStatus.RUNNING, PoiStatus.PENDING):
            self._commander.halt(ardrone3.StopPilotedPOI())
        self._stop_following()
        self._stop_animation()
        if state.plan == PlayingState.PLAYING:
            self._commander.halt(common.Pause())
        if self._drop_return("stopped by hover"):
            self._abort()
        self._sticks.centre(self._now())
        self._pump()

    async def stop(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """`hover`, then wait until the drone has confirmed the end of what was running."""
        answers = []
        if (self._moves.to is not None and self._moves.to.running) or self.state.move_to == MoveToStatus.RUNNING:
            answers.append(self._commander.expect((ardrone3.MoveToChanged,), _ends_move_to))
        if self._moves.by:
            answers.append(self._commander.expect((ardrone3.MoveByEnd,), lambda message: True))
        if self.state.plan == PlayingState.PLAYING:
            answers.append(self._commander.expect((common.MavlinkFilePlayingStateChanged,), _ends_playing))
        if self._moves.returning is not None and self._moves.returning.running:
            answers.append(self._commander.expect((rth.State,), self._ends_our_return))
        if self.state.following not in (None, FollowMeMode.NONE):
            answers.append(self._commander.expect((follow_me.State,), _ends_following))
        if self.state.animation not in (None, animation.Type.NONE):
            answers.append(self._commander.expect((animation.State,), _ends_animation))
        began = self._now()
        try:
            self.hover()
            for answer in answers:
                answer.expire_after(timeout, CommandTimeout("hover", timeout))
            for answer in answers:
                await answer.wait()
            # Of what was given up before it was confirmed no event may speak; but the order to stop has to arrive.
            await self._commander.halted("hover", timeout - (self._now() - began))
        finally:
            for answer in answers:
                answer.close()

    def _ends_our_return(self, message: rth.State) -> bool | AnafiMavError | None:
        if self._home.state.returning_by_itself:
            return CommandRejected("the drone returns home by itself")
        return _ends_return(message)

    def _stop_moves(self, why: str) -> bool:
        """Cancel our moveTo and moveBys; in the order of the queue, so a later move is not hit.

        True when a moveTo was cancelled.
        """
        move = self._moves.cancel_to(why)
        if move is not None:
            if move.answer.token is not None:
                self._commander.cancel(move.answer.token)
            self._commander.halt(ardrone3.CancelMoveTo())
        moves = self._moves.cancel_by(why, self._now())
        for move in moves:
            if move.answer.token is not None:
                self._commander.cancel(move.answer.token)
        if moves:
            self._commander.halt(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
        return move is not None

    def _stop_following(self) -> None:
        if self.state.following not in (None, FollowMeMode.NONE):
            self._stop_once(follow_me.Stop())

    def _stop_animation(self) -> None:
        if self.state.animation not in (None, animation.Type.NONE):
            self._stop_once(animation.Cancel())

    def _stop_once(self, order: Message) -> None:
        """Halt what setpoints take over from many times a second. Once it was heard and not obeyed, say it again."""
        kind = type(order)
        if self._now() < self._stopping.get(kind, -math.inf):
            return
        self._stopping[kind] = math.inf

        def heard(delivery: asyncio.Future[None]) -> None:
            if kind in self._stopping:
                self._stopping[kind] = self._now() + QUIET

        self._commander.halt(order).add_done_callback(heard)

    def _pump(self) -> None:
        """Send the PCMD that is due and come back for the next."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._sticks_dead is not None:
            self._sticks.stop()
        now = self._now()
        pcmd = self._sticks.due(now)
        if pcmd is not None:
            self._send_if_connected(pcmd)
        deadline = self._sticks.deadline
        if deadline is not None:
            self._timer = asyncio.get_running_loop().call_at(deadline, self._pump)

    def _centre_sticks(self) -> None:
        """Let go of what deflection there is. What begins now may be refused; the sticks must not stay as they are."""
        if self._sticks.active:
            self._sticks.centre(self._now())
            self._pump()

    def _silence_sticks(self) -> None:
        """No more PCMDs: something else flies the drone now."""
        self._sticks.stop()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _release_sticks(self) -> None:
        """Take the hands off: a return waits for a PCMD with flag 0 (rth.xml 146-0-11)."""
        if self._sticks.active and self._sticks_dead is None:
            for _ in range(RELEASES):
                self._commander.send(self._sticks.released(self._now()))
        self._silence_sticks()

    # -- settings

    async def set_min_altitude(self, metres: float) -> float:
        """See `Home.set_min_altitude`."""
        return await self._home.set_min_altitude(metres)

    # -- small change

    @staticmethod
    def _now() -> float:
        return asyncio.get_running_loop().time()

    def require_free(self) -> None:
        """Raise `CommandRejected` while the drone returns for reasons of its own, or lands: no move of ours gets in its
        way."""
        if self._home.state.returning_by_itself:
            raise CommandRejected("the drone returns home by itself")
        if self.state.flying in (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING):
            raise CommandRejected(_in_state(self.state.flying))

    def _require_link(self) -> None:
        if not self._commander.connected:
            raise LinkLost("not connected")

    def _send_if_connected(self, message: Message) -> None:
        """For what is worth sending only while there is a link; its loss is reported elsewhere."""
        try:
            self._commander.send(message)
        except LinkLost as error:
            log.debug("%s not sent: %s", message.NAME, error)
            self._sticks.stop()


def _in_state(flying: FlyingState | None) -> str:
    return (
        "the drone has not reported its flying state"
        if flying is None
        else f"the drone is in the state {spoken(flying)}"
    )


def _decided_elsewhere(message: Message) -> None:
    """The judge of moves: `Moves` knows which of them an event speaks of."""


def _ends_move_to(message: ardrone3.MoveToChanged) -> bool | None:
    return True if message.status != ardrone3.MoveToStatus.RUNNING else None


def _ends_return(message: rth.State) -> bool | None:
    return True if message.state in (RthState.AVAILABLE, RthState.UNAVAILABLE) else None


def _ends_following(message: follow_me.State) -> bool | None:
    return True if message.mode == FollowMeMode.NONE else None


def _ends_animation(message: animation.State) -> bool | None:
    return True if message.type == animation.Type.NONE else None


def _ends_playing(message: common.MavlinkFilePlayingStateChanged) -> bool | None:
    return True if message.state != PlayingState.PLAYING else None
