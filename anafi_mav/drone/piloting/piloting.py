"""Element piloting: the verbs that fly the drone.

Each returns when the drone has confirmed it.

A verb raises `CommandRejected` when the drone, or what it reported, refuses; `CommandTimeout` when it does not
answer, and then its command is withdrawn; `LinkLost` when the link is lost meanwhile. Signs and units are the drone's
own: body axes front, right, down; heights above the take-off point.

The promises of the verbs are documented here. Their implementation is in `motors` (up and down),
`guided_moves` (guided moves, home) and `stick_stream` (PCMDs); common to all of them, and
therefore here, is above all `hover`.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveToStatus, OrientationMode, PoiStatus
from anafi_mav.arsdk.messages.common import PlayingState
from anafi_mav.arsdk.messages.follow_me import Mode as FollowMeMode
from anafi_mav.drone.element import Reducer
from anafi_mav.drone.expectation import ANSWER_TIMEOUT, Commander, Expectation, loop_time, require_number
from anafi_mav.drone.piloting.guided_moves import GuidedMoves, ReturnHome
from anafi_mav.drone.piloting.landing import LandingEnd
from anafi_mav.drone.piloting.motors import Motors
from anafi_mav.drone.piloting.moves import Displacement, Move, MoveEnd, Moves
from anafi_mav.drone.piloting.settings import PilotingSettings
from anafi_mav.drone.piloting.state import REDUCERS, PilotingState, require_free
from anafi_mav.drone.piloting.stick_stream import StickStream
from anafi_mav.drone.piloting.sticks import Limits, PilotingCommand, percent
from anafi_mav.drone.sent_commands import QUIET, Slot
from anafi_mav.drone.status.home import Home
from anafi_mav.errors import NotSupported


class Piloting(PilotingSettings):
    """The verbs that fly the drone. `pilot` and `hover` act at once; all others are coroutines.

    A coroutine returns when the drone has confirmed it. It raises `CommandRejected` when the drone, or its reported
    state, refuses; `CommandTimeout` when the drone stays silent; `LinkLost` when the link is lost meanwhile. A command
    that has not been delivered by then is withdrawn.
    """

    NOTHING = PilotingState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = REDUCERS

    def __init__(self, commander: Commander, home: Home, takeoff_blockers: Callable[[], list[str]]) -> None:
        super().__init__(commander)
        self._home = home
        self._moves = Moves(home)
        self.pilot_has_source: Callable[[], bool] = lambda: False
        """True while the pilot at a Skycontroller has the piloting source; set by `Drone`."""
        self.end_unreported: Callable[[type[Message]], None] = lambda kind: None
        """Called when a plan, animation or following has ended, and its event was not sent; set by `Drone`."""
        self._sticks = StickStream(commander, self, home, lambda: self.pilot_has_source())
        self._motors = Motors(commander, self, self._sticks, takeoff_blockers)
        self._guided = GuidedMoves(commander, self, home, self._sticks, self._moves)
        self._returns = ReturnHome(commander, self, home, self._sticks, self._moves, self._end_movement)
        self.is_modern: Callable[[], bool] = lambda: False
        """True for an Ai; set by `Drone`."""
        self._landing_end = LandingEnd(commander, self, self._sticks, self._motors, lambda: self.is_modern())
        self._stopping: dict[type[Message], float] = {}
        """Orders to stop something that the drone has not answered yet: until when once is enough."""

    def reset(self) -> None:
        super().reset()
        self.link_lost()

    def require_free(self) -> None:
        """Raise `CommandRejected` while the drone returns by itself or lands."""
        require_free(self.state, self._home.state)

    def link_lost(self) -> None:
        """Drop everything from before the loss of the link.

        No command is sent again, and started moves are no longer ours.
        """
        self._sticks.silence()
        self._moves.clear(MoveEnd.LINK_LOST)
        self._stopping.clear()
        self._motors.link_lost()
        self._returns.link_lost()

    def reactions(self) -> Mapping[type[Message], Callable[[Any, float], None]]:
        """Events to be shown to this element beyond its reducers."""
        return {
            **self._moves.reactions(),
            rth.State: self._returns.on_state,
            follow_me.State: lambda message, now: self._obeyed(follow_me.Stop),
            animation.State: lambda message, now: self._obeyed(animation.Cancel),
        }

    def on_flying_state(self, message: ardrone3.FlyingStateChanged, now: float) -> None:
        """Follow the flying state, before `reactions`."""
        self._moves.on_flying_state(message, now)
        self._motors.on_flying_state(message, now)
        if message.state is FlyingState.LANDING:
            self._sticks.landing_begun()

    def _obeyed(self, order: type[Message]) -> None:
        self._stopping.pop(order, None)

    def on_plan(self, message: common.MavlinkFilePlayingStateChanged) -> None:
        """A flight plan plays, is paused or stopped."""
        if message.state == PlayingState.PLAYING:
            self._sticks.silence()

    # -- facts about what we do

    @property
    def moves_started(self) -> tuple[Move, ...]:
        """The moves of ours that have not ended; empty after a new connection."""
        return self._moves.started()

    @property
    def move(self) -> Move | None:
        """The moveTo of this program that has not ended."""
        return self._moves.to

    @property
    def moving(self) -> bool:
        """True while a moveTo or moveBy of this program has not ended."""
        return self._moves.to is not None or bool(self._moves.by)

    @property
    def sticks_held(self) -> bool:
        """A setpoint of ours holds the sticks, level or not."""
        return self._sticks.held

    @property
    def sticks_blocked(self) -> str | None:
        """Reason why no stick position is sent at present; None when `pilot` works."""
        return self._sticks.blocked

    @property
    def limits(self) -> Limits | None:
        """See `PilotingState.limits`."""
        return self.state.limits

    @property
    def about_to_fly(self) -> bool:
        """True when the drone is landed and a take-off of this program may still begin.

        It has been sent, or was and cannot be withdrawn; the same holds for a hand launch and a flight plan.
        """
        return self._motors.about_to_fly

    @property
    def has_launched(self) -> bool:
        """True when a command of this program has started the motors that turn, or may have.

        False when another controller has, a Skycontroller for instance.
        """
        return self._motors.has_launched

    @property
    def may_launch_late(self) -> bool:
        """True when a launch of this program that has failed may be what starts the motors now.

        So may another controller be: no event names the command.
        """
        return self._motors.may_launch_late

    @property
    def rises(self) -> bool:
        """True from the start of the motors to the first hover, by a take-off of this program."""
        return self._motors.rises

    # -- up and down

    async def take_off(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Start the motors and rise to about a metre.

        Returns when the drone reports that it is taking off. A drone refuses by not answering; `CommandRejected` then
        names what it has reported against a take-off.
        """
        await self._motors.take_off(timeout)

    async def hand_launch(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Let the motors idle for a throw or release by hand; returns when the drone waits for that.

        Refused as a take-off is. The drone flies as soon as it leaves the hand; `cancel_hand_launch` ends the wait.
        """
        await self._motors.hand_launch(timeout)

    async def cancel_hand_launch(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Stop the idling motors; returns when they stand.

        Returns at once when they stand already and no command may still start them.
        """
        await self._motors.cancel_hand_launch(timeout)

    async def land(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Land here; returns when the drone is landing, at once when it is or has landed.

        A drone that is `about_to_fly` is watched until it certainly stays on the ground, or has been made to land.
        """
        await self._motors.land(timeout)

    async def end_landing(self, timeout: float = ANSWER_TIMEOUT, *, take_off: bool = False) -> None:
        """End a landing; returns when the drone reports another state.

        Returns at once when it does not land. It sends gaz for a second at most, and with `take_off` a TakeOff too
        (SmartTakeOffLand on the Ai), which starts the motors of a drone that has landed: only for a user who wants
        just that. The sticks are centred then. Raises `CommandRejected` when LANDED is reported first, or the drone
        goes on landing: nothing of this is sent after it.
        """
        await self._landing_end.end(timeout, take_off=take_off)

    async def settle_landing(self, timeout: float = ANSWER_TIMEOUT) -> bool:
        """Return True when the drone lands, also by a withdrawn Landing that arrived all the same."""
        return await self._motors.settle_landing(timeout)

    async def stop_motors(self, *, force: bool = False) -> None:
        """Stop propellers that turn on the ground or just above it.

        Returns when the drone reports that they stand. `force` cuts them when they still ramp up after
        `motors.FORCED_AFTER`, never once the drone has left the ground.
        """
        await self._motors.stop_motors(force=force)

    async def emergency(self) -> None:
        """Cut the motors at once: in the air the drone falls.

        Returns when it reports that they are cut.

        Cancelling this does not withdraw it: it is repeated while there is a link, as Parrot does (arsdk-ng: timeout
        policy RETRY), for at most `motors.EMERGENCY_TIMEOUT` while a caller waits. Commands that wait to be
        sent are withdrawn.
        """
        await self._motors.emergency()

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
        Returns at the end of the move the distance flown. Without a `timeout` the time allowed grows with the move.
        A timeout or the cancellation of this coroutine stops the drone.
        """
        return await self._guided.move_by(front, right, down, turn, timeout, turn_rate_dps)

    async def move_to(
        self,
        latitude: float,
        longitude: float,
        altitude: float,
        heading_deg: float | None = None,
        horizontal_speed: float | None = None,
        vertical_speed: float | None = None,
        timeout: float = ANSWER_TIMEOUT,
        orientation: OrientationMode | None = None,
    ) -> Move:
        """Fly to a place (deg, deg, m above take-off); returns when the drone is on its way.

        `heading_deg` (clockwise from north) is turned to on the way; None keeps the heading. `orientation` is another
        way to turn: TO_TARGET turns to the place before the drone moves, HEADING_START to `heading_deg`.
        `horizontal_speed` and `vertical_speed` (m/s) limit the speed; None leaves it to the drone. `Move.result` waits
        for the end. A newer moveTo replaces an older one.
        Raises `LocalProtocolError` for a heading that the orientation does not use, or lacks.
        """
        return await self._guided.move_to(
            latitude, longitude, altitude, heading_deg, horizontal_speed, vertical_speed, timeout, orientation
        )

    # -- home

    async def return_home(self, timeout: float = ANSWER_TIMEOUT) -> Move | None:
        """Fly home; returns when the return is running or pending.

        What the drone flies by itself is cancelled first, as by `hover`: a return waits until the drone hovers (rth.xml
        146-0-11), and a moveTo would be flown to its end before. None: the drone was returning already.
        """
        return await self._returns.return_home(timeout)

    async def settle_return(self, timeout: float = ANSWER_TIMEOUT) -> bool:
        """Return True when the drone returns.

        One that hovers is asked for its states: it may have ended its return without a report.
        """
        return await self._returns.settle_return(timeout)

    async def cancel_return_home(self, timeout: float = ANSWER_TIMEOUT, *, even_its_own: bool = False) -> bool:
        """Stop a return that a user commanded, also one not begun yet; return False without one.

        It may have been commanded through this program or not. One that the drone began by itself is stopped only
        with `even_its_own`, else `CommandRejected` is raised.
        """
        return await self._returns.cancel_return_home(timeout, even_its_own=even_its_own)

    async def set_min_altitude(self, metres: float) -> float:
        """See `Home.set_min_altitude`."""
        return await self._home.set_min_altitude(metres)

    # -- sticks, and the end of everything

    def pilot(self, command: PilotingCommand | None, age: float = 0.0) -> None:
        """Hold a stick position for 0.5 s (`sticks.HOLD_LIMIT`) unless repeated.

        A PCMD is sent now and every 50 ms. None centres the sticks for two seconds, and so does the end of the
        repetition. `age` (s) is the time since the position was set: one that is corrected on the way is not a new
        one. A position ends a moveTo or moveBy of this program, during which the drone would ignore it. Nothing is
        sent and nothing kept while `sticks_blocked`. Raises `NotSupported` before the drone has reported its limits,
        `LinkLost` without a link.
        """
        self._commander.require_link()
        if command is None:
            self._sticks.let_go()
            return
        state = self.state
        limits = state.limits
        if limits is None:
            raise NotSupported("reported tilt and speed limits")
        position = percent(command, limits)
        if self._sticks.blocked is None:
            self._guided.stop("taken over by the sticks")
            if state.following != FollowMeMode.LOOK_AT:  # which leaves the flying to the sticks
                self._stop_following(state)
            self._stop_animation(state)
            self._sticks.hold(position, age)
        else:
            self._sticks.pump()

    def hover(self) -> None:
        """Stop everything that this program began, and hover: takes effect before it returns.

        Cancels moveTo and moveBys (those of an earlier connection or another controller too, as far as the drone
        reports them), a running point of interest, an animation, the following of a target, a playing flight plan (it
        is paused) and a return that this program commanded, also those that have not begun; then centres the sticks
        for two seconds, since a PCMD alone neither stops a moveTo nor is it acknowledged. A landing and a return that
        the drone began by itself continue. Raises `LinkLost` without a link.
        """
        self._commander.require_link()
        self._commander.abort_pending("stopped by hover")
        self._end_movement("stopped by hover")
        if self._returns.drop("stopped by hover"):
            self._returns.abort()
        self._sticks.centre()

    def stopping(self) -> list[Message]:
        """Return the commands that end what the drone flies by itself, as far as known.

        A landing, a return and a flight plan go on. Nothing that this program started ends by this call.
        """
        state, commands = self.state, self._guided.ends(of_others=True)
        if state.poi in (PoiStatus.RUNNING, PoiStatus.PENDING):
            commands.append(ardrone3.StopPilotedPOI())
        if state.following not in (None, FollowMeMode.NONE):
            commands.append(follow_me.Stop())
        if state.animation not in (None, animation.Type.NONE):
            commands.append(animation.Cancel())
        return commands

    def _end_movement(self, why: str) -> None:
        """Cancel what the drone flies by itself, as far as known; a landing or return goes on."""
        commands = self.stopping()
        self._guided.drop(why)
        for command in commands:
            if isinstance(command, ardrone3.MoveBy):
                self._moves.expect_stray(loop_time())
            if isinstance(command, follow_me.Stop | animation.Cancel):
                self._stop_once(command)
            else:
                self._commander.send_stop(command)
        if self.state.plan == PlayingState.PLAYING or self._commander.sent.is_executed(Slot.PLAN):
            self._commander.send_stop(common.Pause())

    async def stop(self, timeout: float = ANSWER_TIMEOUT) -> None:
        """Hover, and return when the drone has confirmed the end of everything that was running.

        The report of an end may be missing. A hover that lasts confirms that of a moveTo, too. That of a flight plan,
        an animation or a following is confirmed by a hover after the drone was asked for its states and has not named
        it as under way.
        """
        require_number(timeout)
        answers, move_to, kinds = [], None, list[type[Message]]()
        if (self._moves.to is not None and self._moves.to.running) or self.state.move_to == MoveToStatus.RUNNING:
            move_to = self._commander.expect((ardrone3.MoveToChanged,), _ends_move_to)
            answers.append(move_to)
        if self._moves.by:
            answers.append(self._commander.expect((ardrone3.MoveByEnd,), lambda message: True))
        if self.state.plan == PlayingState.PLAYING:
            kinds.append(common.MavlinkFilePlayingStateChanged)
        if self._moves.returning is not None and self._moves.returning.running:
            answers.append(self._commander.expect((rth.State,), self._returns.ends_ours))
        if self.state.following not in (None, FollowMeMode.NONE):
            kinds.append(follow_me.State)
        if self.state.animation not in (None, animation.Type.NONE):
            kinds.append(animation.State)
        ends = {kind: self._commander.expect((kind,), _ENDS[kind]) for kind in kinds}
        answers += ends.values()
        began = loop_time()
        try:
            self.hover()
            for answer in answers:
                answer.expire_after(timeout, "hover")
            if move_to is not None:
                await self._commander.stops_delivered("hover", timeout)
                await self._wait_for_hover(move_to)
            if ends:
                await self._commander.stops_delivered("hover", timeout)
                await self._wait_for_ends(ends)
            for answer in answers:
                await answer.wait()
            # Of what was given up before it was confirmed no event may speak; but the order to stop has to arrive.
            await self._commander.stops_delivered("hover", timeout - (loop_time() - began))
        finally:
            for answer in answers:
                answer.close()

    async def _wait_for_hover(self, move_to: Expectation[bool]) -> None:
        """Wait for the end of a moveTo that the drone has received the cancellation of.

        It is over when the drone has hovered for `QUIET` without a report.
        """
        if await self._hovers_without(move_to):
            self.set_state(replace(self.state, move_to=None))
            self._moves.end_cancelled()
            move_to.succeed(True)

    async def _hovers_without(self, end: Expectation[bool]) -> bool:
        """Return True when the drone has hovered for `QUIET` and has not reported this end."""
        hover = self._commander.expect(
            (ardrone3.FlyingStateChanged,), lambda message: True if message.state == FlyingState.HOVERING else None
        )
        try:
            if self.state.flying != FlyingState.HOVERING:
                await asyncio.wait({end.future, hover.future}, return_when=asyncio.FIRST_COMPLETED)
            await asyncio.wait({end.future}, timeout=QUIET)
        finally:
            hover.close()
        return not end.future.done() and self.state.flying == FlyingState.HOVERING

    async def _wait_for_ends(self, ends: Mapping[type[Message], Expectation[bool]]) -> None:
        """Wait for reports of ends that the drone has received the commands for.

        A drone that owes one is asked for its states. What these do not name as under way has ended when the drone then
        hovers: a hover alone may be one at a way point, or of a target that stands still.
        """
        named = {kind: self._commander.expect((kind,), lambda message: True) for kind in ends}
        states = self._commander.expect((common.AllStatesChanged,), lambda message: True)
        try:
            await asyncio.wait({end.future for end in ends.values()}, timeout=QUIET)
            owed = {kind: end for kind, end in ends.items() if not end.future.done()}
            if owed:
                self._home.request_states()
            while not states.future.done() and (left := {end.future for end in owed.values() if not end.future.done()}):
                await asyncio.wait({states.future, *left}, return_when=asyncio.FIRST_COMPLETED)
            for kind, end in owed.items():
                if not end.future.done() and await self._hovers_without(end) and not named[kind].future.done():
                    self.end_unreported(kind)
        finally:
            for answer in (*named.values(), states):
                answer.close()

    def _stop_following(self, state: PilotingState) -> None:
        if state.following not in (None, FollowMeMode.NONE):
            self._stop_once(follow_me.Stop())

    def _stop_animation(self, state: PilotingState) -> None:
        if state.animation not in (None, animation.Type.NONE):
            self._stop_once(animation.Cancel())

    def _stop_once(self, order: Message) -> None:
        """Halt what setpoints take over from many times a second.

        Once it was heard and not obeyed, say it again.
        """
        kind = type(order)
        if loop_time() < self._stopping.get(kind, -math.inf):
            return
        self._stopping[kind] = math.inf

        def heard(delivery: asyncio.Future[None]) -> None:
            if kind in self._stopping:
                self._stopping[kind] = loop_time() + QUIET

        self._commander.send_stop(order).add_done_callback(heard)


def _ends_move_to(message: ardrone3.MoveToChanged) -> bool | None:
    return True if message.status != ardrone3.MoveToStatus.RUNNING else None


def _ends_following(message: follow_me.State) -> bool | None:
    return True if message.mode == FollowMeMode.NONE else None


def _ends_animation(message: animation.State) -> bool | None:
    return True if message.type == animation.Type.NONE else None


def _ends_playing(message: common.MavlinkFilePlayingStateChanged) -> bool | None:
    return True if message.state != PlayingState.PLAYING else None


_ENDS: Mapping[type[Message], Callable[[Any], bool | None]] = {
    common.MavlinkFilePlayingStateChanged: _ends_playing,
    follow_me.State: _ends_following,
    animation.State: _ends_animation,
}
"""Whether an event is the end of what the drone flies by itself, by its kind."""
