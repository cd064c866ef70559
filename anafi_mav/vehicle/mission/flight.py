"""Flies a mission: the shell around the cores `progress` and `plans.translation.translate`.

What the drone can fly by itself it flies from a file (`FlightPlanFile`); what it cannot, the gateway flies between
two files (`Step`). The drone says which line it has executed, and nothing else counts. Whatever takes the drone over
stops the mission, and nothing but a client's word lets it go on.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Hashable, Sequence
from typing import Any

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.drone.events import FlyingState, Message, PlayingState
from anafi_mav.errors import AnafiMavError, CommandRejected, LinkLost
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import FlightPlanFile
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import DroneRefused, Refused, not_ready, reason_of, text_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.mission.course import Course
from anafi_mav.vehicle.mission.files import FilesOnDrone
from anafi_mav.vehicle.mission.path import WayPoint, check_path, lay_out, way_points
from anafi_mav.vehicle.mission.progress import ENDINGS, MissionProgress, State
from anafi_mav.vehicle.mission.record import Keeper, MissionRecord
from anafi_mav.vehicle.mission.steps import fly_step
from anafi_mav.vehicle.mission.texts import beginning, refusal
from anafi_mav.vehicle.mission.waits import ARM_WAIT, PROOF, ArmWait, EndWatch, StoreWait

_LANDING = (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING)


class MissionFlight:
    """Flies the mission of one vehicle; its flight task in mode Mission."""

    def __init__(self, vehicle: Aircraft) -> None:
        self.progress = MissionProgress()
        self.identity = 0
        """The opaque id of the mission."""
        self.news: Callable[[], None] = lambda: None
        """Says that MISSION_CURRENT has changed."""
        self.reached: Callable[[int], None] = lambda item: None
        """Says that an item is done."""
        self.say: Callable[[Severity, Callable[[int], OperatorText]], None] = lambda severity, text: None
        """A text to everybody; it is made from what they call item 0."""
        self.first_number: Callable[[Hashable], int] = lambda client: 0
        """Returns the number that a client gives item 0."""
        self.spawn: Callable[[Coroutine[Any, Any, None]], asyncio.Task[None]] | None = None
        """Runs something until the link goes down."""
        self.keeper = Keeper()
        """Remembers what is needed to know the drone's plan again."""
        self._vehicle = vehicle
        self._course = Course()
        self._uid = ""
        """Of the file that the drone flies, or flew last."""
        self._left: tuple[FlightPlanFile, int, dict[int, int]] | None = None
        """The drone has it paused, and the mission is to begin elsewhere next: file, last line, jumps."""
        self._starting: tuple[FlightPlanFile, int] | None = None
        """File that the drone is commanded to begin, and the line before; None also once withdrawn."""
        self._taken_meanwhile = False
        """While it was asked, the same mission was uploaded again."""
        self._files = FilesOnDrone(vehicle.drone.flight_plan)
        self.storing = StoreWait()
        self._arming = ArmWait(self._lapsed)
        self._beginning = False
        """Taken over by ourselves."""
        self._running: asyncio.Task[None] | None = None
        """Task of the gateway between two files."""
        self._end_watch = EndWatch(vehicle, self.progress, self._ended)
        self._may_end_late = False
        """True while a report of the last line completes a mission that was paused because the drone stopped its plan.

        Nothing has been played since, so that such a report is of that flight.
        """

    # What clients ask for.

    def take(self, items: Sequence[Item], identity: int) -> None:
        """Another mission was uploaded, or none any more.

        One that is flown is stopped: it is not the mission now.
        """
        if identity == self.identity:
            return
        known, self.identity = self.identity != 0, identity
        why = texts.MISSION_REPLACED if items else texts.MISSION_CLEARED
        flown, starting, self._starting = self.flying, self._starting is not None, None
        if flown:
            self._stop(why)
        elif starting and self._running is not None:  # what it began for was answered long ago
            self._vehicle.text(Severity.WARNING, texts.MISSION_NOT_STARTED.fill(reason=why))
        if flown or starting:
            self._suspend(starting=starting)
            self._vehicle.select(FlightMode.HOLD)
        self.progress.take(items)
        self._left, self._course = None, Course()
        self._drop_pending()
        if known:  # else it has just been read, and what was kept of it has not been looked at
            self.keeper.forget()

    def taken_again(self) -> None:
        """The same mission was uploaded once more.

        One that is flown goes on undisturbed; else it is a new one.
        """
        starting, current = self._starting, self.progress.current
        if starting is not None:
            leg, line = starting
            current, self._taken_meanwhile = leg.origins[line + 1], True
        if starting is not None or self.progress.state is State.ACTIVE:
            self.say(Severity.INFO, lambda first: texts.MISSION_SAME.fill(item=current + first))
            return
        self._anew()

    def _anew(self) -> None:
        """Nothing of it has been flown, but for a file that the drone has paused."""
        self._leave()
        self.progress.take(self.progress.items)
        self.keeper.forget()

    def _leave(self) -> None:
        """Remember the paused file before the mission begins elsewhere.

        Another controller may still let the drone resume it.
        """
        progress = self.progress
        if progress.state is State.PAUSED and progress.leg is not None:
            self._left = progress.leg, progress.line, dict(progress.jumps)

    async def engage(self, client: Hashable, item: int | None = None) -> None:
        """Begin mode Mission, resume it or fly it from an item on; returns when the drone flies it.

        On the ground and disarmed it waits until this client arms. Raises `Refused`, or the error by which the drone
        refused.
        """
        await self.storing.over()
        progress, vehicle = self.progress, self._vehicle
        if progress.state is State.NONE:
            raise Refused(texts.MISSION, texts.NO_MISSION)
        if progress.state is State.ACTIVE and item is None:
            return  # it is flown, and goes on without a jolt
        self._require_freedom()
        if vehicle.armed:
            chosen = item is not None
            await self._begin(progress.first if item is None else item, self.first_number(client), anew=chosen)
            return
        if problems := vehicle.prearm_problems():
            raise not_ready(problems)
        await vehicle.take_over()
        vehicle.select(FlightMode.MISSION, self)
        self._arming.begin(client)

    async def choose(self, client: Hashable, item: int) -> None:
        """Make an item the current one; a mission that is flown goes on there."""
        await self.storing.over()
        if self.progress.state is State.NONE:
            raise Refused(texts.CURRENT_ITEM, texts.NO_MISSION)
        if not 0 <= item < len(self.progress.items):
            number = item + self.first_number(client)
            raise Refused(texts.CURRENT_ITEM, texts.NO_SUCH_ITEM.fill(number=number), lasting=True)
        if self.progress.state is State.ACTIVE:
            await self.engage(client, item)
        else:
            self._leave()
            self.progress.choose(item)
            self._keep()
            self.news()

    async def reset(self, client: Hashable) -> None:
        """Reset every jump counter; the current item stays.

        After the end the mission begins again.
        """
        progress = self.progress
        if progress.state is State.COMPLETE:
            await self.choose(client, 0)
        elif progress.jumps and not progress.ending:
            await self.choose(client, progress.current)

    def armed(self, client: Hashable) -> None:
        """A client has armed: what waited for that begins."""
        if self._arming.ends_with(client):
            self._run(self._begin_and_report(self.first_number(client)))

    @property
    def there(self) -> bool:
        """There is a mission."""
        return self.progress.state is not State.NONE

    @property
    def flying(self) -> bool:
        """It is flown."""
        return self.progress.state is State.ACTIVE

    @property
    def paused(self) -> bool:
        """It was begun and stopped."""
        return self.progress.state is State.PAUSED

    @property
    def ending(self) -> bool:
        """A landing or a return that begins now is the plan's own."""
        return self.progress.ending

    @property
    def returns(self) -> bool:
        """A return that begins now is that of the mission's last item, done already or about to be."""
        drone = self._vehicle.drone
        by_plan = drone.home.state.reason == events.ReturnReason.FLIGHTPLAN and drone.flight_plan.state.uid == self._uid
        return self.progress.ending or (by_plan and self.progress.returned)

    # The beginning.

    def _require_freedom(self) -> None:
        vehicle = self._vehicle
        if vehicle.flying_state in _LANDING:
            raise Refused(texts.MISSION, texts.LANDS)
        if vehicle.returning_by_itself:
            raise Refused(texts.MISSION, texts.RETURNS_BY_ITSELF)
        if vehicle.drone.controller.pilot_acquired_control:
            raise Refused(texts.MISSION, texts.PILOT)
        if not vehicle.in_air and not vehicle.on_ground:
            raise Refused(texts.MISSION, vehicle.activity)

    def _resumes(self, item: int) -> bool:
        """The drone hovers, with the rest of what is to be flown in its memory."""
        progress, plan = self.progress, self._vehicle.drone.flight_plan.state
        paused = plan.playing == PlayingState.PAUSED and plan.uid == self._uid
        whole = progress.leg is not None and self._course.later is None
        same = progress.state is State.PAUSED and item == progress.current
        return same and whole and paused and self._vehicle.in_air

    async def _begin(self, item: int, number: int, *, anew: bool = False, waited: bool = False) -> None:
        """Fly from an item on.

        Nothing is disturbed before all is known to be good. `number` is that of the first item.

        With the loop reset (keyword) every loop has all its repetitions before it, else those that were left when the
        mission was stopped. `waited`: the flight task was acquired when the mode was chosen, and the drone has stood
        since.
        """
        vehicle, progress, plan = self._vehicle, self.progress, self._vehicle.drone.flight_plan
        items, resumes, uid = progress.items, self._resumes(item), self._uid
        jumps = {} if anew else progress.jumps
        if resumes:
            course, line = self._course, progress.line
        else:
            course, line = Course(*await lay_out(vehicle, items, item, number, jumps)), -1
        await check_path(vehicle, course.parts, line, number)
        head = course.parts[0]
        if not resumes and isinstance(head, FlightPlanFile):
            if plan.state.playing == PlayingState.PAUSED:
                await plan.stop()  # some firmware may take no file while another one is paused (GroundSDK stops first)
            head, uid, line = await self._files.beginning_with(head, items)
            course.parts[0] = head
        self._beginning = True
        try:
            if not waited:
                await vehicle.take_over()
            if vehicle.in_air:
                await vehicle.drone.piloting.stop()
                await vehicle.drone.piloting.cancel_return_home()
            if not resumes and plan.state.playing not in (None, PlayingState.STOPPED):
                await plan.stop()
        finally:
            self._beginning = False
        self._require_freedom()
        if progress.items is not items or not vehicle.armed:
            raise Refused(texts.MISSION, texts.MISSION_DISPLACED)
        vehicle.select(FlightMode.MISSION, self)
        self._left, self._course = None, course
        if not resumes:
            progress.jumps = {**jumps}
        try:
            if isinstance(head, FlightPlanFile):
                await self._play(head, uid, line)
                self._require_same(items)
            else:
                progress.fly(head.item)
                self._run(self._go_on())
        except BaseException as error:
            if progress.state is not State.ACTIVE:
                vehicle.select(FlightMode.HOLD)
                if self._taken_meanwhile and progress.items is items:
                    self._anew()
                    self.news()
            if isinstance(error, CommandRejected):
                self._require_same(items)
            raise
        self._announce(resumes)

    def _require_same(self, items: Sequence[Item]) -> None:
        if self.progress.items is not items:
            why = texts.MISSION_REPLACED_MEANWHILE if self.there else texts.MISSION_CLEARED_MEANWHILE
            raise Refused(texts.MISSION, why)

    async def _play(self, leg: FlightPlanFile, uid: str, line: int) -> None:
        """Begin a file, or go on with it; returns when the drone flies it."""
        plan = self._vehicle.drone.flight_plan
        goes_on = plan.state.returns_on_disconnect is False if plan.starts_anywhere else None
        self._uid, self._starting, self._taken_meanwhile = uid, (leg, line), False
        try:
            await plan.start(uid, line + 1 if plan.starts_anywhere else 0, continue_on_disconnect=goes_on)
            if self._starting is not None:
                self.progress.begin(leg, line)
        except CommandRejected as error:
            raise DroneRefused(refusal(plan.state, error)) from error
        finally:
            self._starting = None
        self._keep()
        self.news()

    async def _begin_and_report(self, number: int) -> None:
        """Begin the mission after the wait for arming; failures are sent as texts.

        The command that chose it was answered long ago.
        """
        try:
            await self.storing.over()
            await self._begin(self.progress.first, number, waited=True)
        except AnafiMavError as error:
            self._vehicle.text(Severity.ERROR, text_of(error))
            if self._is_chosen_only:
                self._vehicle.select(FlightMode.HOLD)

    @property
    def _is_chosen_only(self) -> bool:
        """The mode is Mission, and nothing of the mission is flown."""
        return self._vehicle.selected is FlightMode.MISSION and not self.flying

    def _announce(self, resumes: bool) -> None:
        """Announce the item that is flown, and the drone's behaviour without the gateway."""
        current, stepped = self.progress.current, self._course.stepped
        returns = self._vehicle.drone.flight_plan.state.returns_on_disconnect
        self.say(Severity.INFO, lambda first: beginning(current + first, resumes, stepped=stepped, returns=returns))

    # From part to part.

    async def _go_on(self) -> None:
        """Fly what follows: the steps that come next, and then the file behind them."""
        progress = self.progress
        try:
            while not self._course.over:
                rest = self._course.rest
                if not self._course.parts and rest is not None:
                    self._course = Course(*await lay_out(self._vehicle, progress.items, rest, 0))
                    await check_path(self._vehicle, self._course.parts, -1, 0)
                head = self._course.parts[0]
                if isinstance(head, FlightPlanFile):
                    leg, uid, line = await self._files.beginning_with(head, progress.items)
                    self._course.parts[0] = leg
                    await self._play(leg, uid, line)
                    return  # it says itself when it ends
                progress.fly(head.item)
                self._keep()
                self.news()
                await fly_step(self._vehicle, progress.items[head.item])
                progress.did(head.done)
                for item in head.done:
                    self.reached(item)
                self._part_over()
        except AnafiMavError as error:
            self._break_off(reason_of(error))
        else:
            self._finish()

    def _leg_over(self) -> None:
        """The drone has flown a whole file."""
        self._part_over()
        if (following := self._course.later) is not None:
            self._course.later = None
            self.progress.current = following
            self._break_off(texts.MISSION_LINK_LOST)
            self.progress.choose(following, anew=False)
            self._keep()
            self.news()
        elif not self._course.over:
            self._run(self._go_on())
        else:
            self._finish()

    def _part_over(self) -> None:
        """Make the following part the current item.

        When the mission is paused before that part begins, the part before is not flown again.
        """
        following = self._course.part_over()
        if following is not None:
            self.progress.fly(following)
            self._keep()
            self.news()

    def _finish(self) -> None:
        self._complete()
        self._vehicle.select(FlightMode.HOLD)
        self.news()

    def _complete(self) -> None:
        self._left = None
        self.progress.finish()
        self.keeper.forget()
        self.say(Severity.INFO, lambda first: texts.MISSION_COMPLETE)

    def _stopped_by_drone(self) -> None:
        """Pause the mission: the drone has stopped its plan, as far as its reports go."""
        self._break_off(texts.MISSION_STOPPED)
        stopped = self._vehicle.drone.flight_plan.state.playing == PlayingState.STOPPED
        self._may_end_late = stopped and self._course.following is None

    def _break_off(self, why: OperatorText) -> None:
        """Stop the mission for a reason that no client has commanded."""
        if self.progress.state is State.ACTIVE:
            self._stop(why)
            self._vehicle.select(FlightMode.HOLD)

    def _stop(self, why: OperatorText | None) -> None:
        progress = self.progress
        progress.stop()
        self._may_end_late = False
        current, severity = progress.current, Severity.INFO if why is None else Severity.WARNING
        if not self._beginning:

            def paused(first: int) -> OperatorText:
                if why is None:
                    return texts.MISSION_PAUSED.fill(item=current + first)
                return texts.MISSION_PAUSED_REASON.fill(item=current + first, reason=why)

            self.say(severity, paused)
        self._end_watch.end()
        self._keep()
        self.news()

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        assert self.spawn is not None, "set by the service, without which nobody asks for a mission"
        task = self._running = self.spawn(work)

        def done(ended: asyncio.Task[None]) -> None:
            if self._running is ended:
                self._running = None

        task.add_done_callback(done)

    # What the drone reports.

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of what reports how far the drone's plan is."""
        return {
            events.MavlinkFilePlayingStateChanged: self._on_playing,
            events.MissionItemExecuted: lambda message, now: self._executed(message.idx),
            events.WaypointSkipped: self._on_skipped,
            **dict.fromkeys(PROOF, self._on_position),
        }

    def _on_position(self, message: Message, now: float) -> None:
        self._end_watch.on_position(type(message))

    def _on_skipped(self, message: events.WaypointSkipped, now: float) -> None:
        item = self.progress.skip(message.item)
        if item is not None:
            self.say(Severity.WARNING, lambda first: texts.MISSION_OUT_OF_REACH.fill(item=item + first))

    def _on_playing(self, message: events.MavlinkFilePlayingStateChanged, now: float) -> None:
        progress = self.progress
        if message.state == PlayingState.PLAYING:
            self._end_watch.end()
            self._may_end_late = False
            if self._starting is not None:
                (leg, line), self._starting = self._starting, None
                progress.begin(leg, line)
                self.news()
            elif message.filepath != self._uid:
                if progress.state is State.ACTIVE:
                    self._break_off(texts.MISSION_OTHER_PLAN)
                else:
                    self._vehicle.text(Severity.NOTICE, texts.OTHER_PLAN)
            elif progress.state is not State.ACTIVE:
                # Not by us, but it flies, and who looks at the mission has to see that.
                self._leave()
                if self._left is None:
                    self._vehicle.text(Severity.NOTICE, texts.OTHER_PLAN)
                    return
                self._vehicle.select(FlightMode.MISSION, self)
                (leg, line, jumps), self._left = self._left, None
                progress.begin(leg, line)
                progress.jumps = jumps
                self.say(Severity.NOTICE, lambda first: texts.MISSION_RESUMED_ELSEWHERE)
                self.news()
        elif self._starting is None and progress.state is State.ACTIVE and progress.leg is not None:
            if progress.leg_done:
                self._leg_over()
            elif progress.ending and progress.at_last_line and message.state == PlayingState.STOPPED:
                self._end_watch.begin()
            elif self._vehicle.drone.controller.pilot_acquired_control:
                self._break_off(texts.MISSION_PILOT)
            elif message.state == PlayingState.STOPPED and (last := self._last_way_point(progress.leg)) is not None:
                self._end_watch.begin(last)
            else:
                self._stopped_by_drone()

    def _last_way_point(self, leg: FlightPlanFile) -> WayPoint | None:
        """Return the way point that a file ends at.

        Returns None while other way points are left, or when the file ends with a landing or a return.
        """
        progress = self.progress
        points, left = [*way_points(leg)], [*way_points(leg, progress.line)]
        if progress.items[leg.origins[-1]].command in ENDINGS or len(left) > 1 or not points:
            return None
        return points[-1]

    def _executed(self, line: int) -> None:
        progress, leg = self.progress, self.progress.leg
        paused = self._may_end_late and self._starting is None and progress.state is State.PAUSED
        late = paused and leg is not None and line == len(leg.origins) - 1
        if late:
            progress.begin(leg, progress.line)
        done = progress.executed(line)
        for item in done:
            self.reached(item)
        if done:
            self._keep()
        if late:
            self._may_end_late = False
            self._complete()  # and no other mode: another flight task may be active by now
        self.news()
        if self._end_watch.running and progress.leg_done:  # it has said so late
            self._end_watch.end()
            self._leg_over()

    def on_vehicle(self) -> None:
        """Landing, return or flying state have changed."""
        self._end_watch.look()

    def _ended(self, begun: bool) -> None:
        """Handle a plan that the drone has stopped without reporting its last line.

        `begun`: the plan has been flown all the same.
        """
        if begun:
            if (leg := self.progress.leg) is not None:
                self._executed(len(leg.origins) - 1)
            self._leg_over()
        else:
            self._stopped_by_drone()

    # Helm.

    def end(self) -> list[asyncio.Task[None]]:
        """Something else flies now: the mission is paused."""
        self._drop_pending()
        ended = []
        if self._running is not None and self._running is not asyncio.current_task():
            self._running.cancel()
            ended.append(self._running)
            self._running = None
            if self._is_chosen_only:
                self._vehicle.forget_mode()
        if self.progress.state is State.ACTIVE:
            self._stop(None)
            self._suspend()
        return ended

    def _suspend(self, *, starting: bool = False) -> None:
        """The drone is not to fly its file any more.

        A landing or a return of its own is not disturbed.

        `starting`: it has been asked to begin it and has not said that it does, so no landing or return is that
        file's.
        """
        vehicle = self._vehicle
        if starting or (vehicle.flying_state not in _LANDING and not vehicle.returning):
            with contextlib.suppress(LinkLost):
                vehicle.drone.flight_plan.suspend()

    def _lapsed(self) -> None:
        self._vehicle.select(FlightMode.HOLD)
        self._vehicle.text(
            Severity.WARNING, texts.MISSION_NOT_STARTED.fill(reason=texts.NOT_ARMED_WITHIN.fill(seconds=ARM_WAIT))
        )

    def _drop_pending(self) -> None:
        """Withdraw a mission that waits for arming, so that the mode no longer shows it."""
        if self._arming.end():
            self._vehicle.forget_mode()

    # The link.

    def link_down(self) -> None:
        """The drone may fly on with the file that it has. What the gateway flies itself ends here."""
        self._arming.end()
        self._end_watch.end()
        self._starting, self._running, self._may_end_late = None, None, False
        self._course.end_with_this_part()
        if self.progress.state is State.ACTIVE:
            self.progress.stop()

    def link_up(self, record: MissionRecord | None) -> None:
        """The drone is back, or it is another gateway's: is it our mission that it flies?"""
        progress, plan = self.progress, self._vehicle.drone.flight_plan.state
        if progress.leg is None and record is not None and record.mission == self.identity:
            leg, plays = record.leg, plan.uid == record.uid
            if not (plays or self._vehicle.in_air):
                return
            self._uid, self._course = record.uid, Course([leg], later=record.next)
            self.keeper.found(record)
            progress.begin(leg, record.line)
            progress.jumps = dict(record.jumps)
            progress.stop()
        if progress.state is not State.PAUSED or progress.leg is None:
            return
        plays = plan.uid == self._uid and plan.playing == PlayingState.PLAYING
        later = self._course.later
        if progress.leg_done and later is not None:
            progress.current = later
        current = progress.current
        if plays:
            progress.begin(progress.leg, progress.line)
            self._vehicle.select(FlightMode.MISSION, self)
            self.say(Severity.NOTICE, lambda first: texts.MISSION_FOUND_FLYING.fill(item=current + first))
        elif progress.leg_done and later is None:
            progress.begin(progress.leg, progress.line)
            progress.finish()
            self.keeper.forget()
            self.say(Severity.INFO, lambda first: texts.MISSION_COMPLETE)
        else:
            self.say(Severity.NOTICE, lambda first: texts.MISSION_FOUND_PAUSED.fill(item=current + first))
        self.news()

    def _keep(self) -> None:
        self.keeper.keep(self.identity, self._uid, self.progress, self._course.following)
