"""Flies a mission: performs the effects of `MissionMachine`, which decides.

What the drone can fly by itself it flies from a file (`FlightPlanFile`); what it cannot, the gateway flies between
two files (`FlyItem`). The drone reports which line it has executed, and nothing else counts. Another flight task, a
landing or a return pauses the mission, and only a client's command resumes it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Coroutine, Hashable, Iterator, Sequence
from typing import Any, Protocol

from anafi_mav import texts
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import events
from anafi_mav.drone.automatic.flight_plan import FlightPlanState
from anafi_mav.drone.events import AlertState, FlyingState, ForcedLandingReason, PlayError, PlayingState
from anafi_mav.drone.events import FlightPlanComponent as Part
from anafi_mav.drone.events import FlightPlanIndicator as Input
from anafi_mav.drone.sent_commands import SentCommand
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError, CommandRejected, LinkLost
from anafi_mav.plans.plan import Item
from anafi_mav.plans.translation.translate import Course, FlightPlanFile
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.control import Condition
from anafi_mav.vehicle.base.control_machine import State as ControlState
from anafi_mav.vehicle.base.flight_task import Needs, PlainTask, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import DroneRefused, Refused, reason_of, text_of
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.fence.fence_watch import OutsideFence
from anafi_mav.vehicle.mission.effects import (
    Acquire,
    Announce,
    DroneReport,
    Effect,
    Failure,
    FlyItem,
    MissionAttempt,
    Persist,
    Prepare,
    Prepared,
    Reached,
    Release,
    Select,
    SendText,
    StartFile,
    Suspend,
    Work,
)
from anafi_mav.vehicle.mission.machine import PROOF, MissionMachine, State
from anafi_mav.vehicle.mission.path import FilesOnDrone, check_path, lay_out, next_place, way_points
from anafi_mav.vehicle.mission.payload_state import payload_after
from anafi_mav.vehicle.mission.progress import Mission
from anafi_mav.vehicle.mission.record import MissionRecord
from anafi_mav.vehicle.mission.steps import fly_step

_LANDING = (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING)
_BEGINS = (State.PREPARING, State.TAKING_OVER, State.STARTING)
"""A start is under way, and the drone has not confirmed it."""

STORE_WAIT = 5.0
"""s that a command waits for a mission to be stored, which takes a thread some milliseconds and a disk its time."""

_START_BLOCKERS = {
    Part.GPS: texts.NO_FIX,
    Part.CALIBRATION: texts.DRONE_CALIBRATION,
    Part.MAVLINK_FILE: texts.DRONE_FILE,
    Part.TAKE_OFF: texts.DRONE_TAKEOFF,
    Part.WAYPOINTS_BEYOND_GEOFENCE: texts.DRONE_GEOFENCE,
    Part.CAMERA_AVAILABLE: texts.DRONE_CAMERA,
    Part.MAVLINK_STATE: texts.DRONE_NOT_READY,
    Part.MAVLINK_MEDIA: texts.DRONE_MEDIA,
    Part.FIRST_WAYPOINT_TOO_FAR: texts.DRONE_FIRST_FAR,
}
"""Parrot's components of a flight plan that keep it from being begun (arsdk.md §3.1)."""

_INPUTS = {Input.DRONE_GPS: _START_BLOCKERS[Part.GPS], Input.DRONE_MAGNETO: _START_BLOCKERS[Part.CALIBRATION]}
"""Faults that an Ai reports twice: as a missing input, and as one of the components."""


class MissionOutlet(Protocol):
    """Clients and memory, as a mission that is flown needs them."""

    def mission_changed(self) -> None:
        """Send MISSION_CURRENT, if it has changed."""

    def item_reached(self, item: int) -> None:
        """Report an item as reached."""

    def store_record(self, record: MissionRecord | None) -> None:
        """Store the record for a restarted gateway; None: delete it."""

    def run_mission(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Run in the background, until the link goes down."""


class StoreWait:
    """Delays the commands of a client while its new mission is being stored.

    They are meant for that mission, not for the old one: clients like dronekit do not wait for the acknowledgement of
    their last item.
    """

    def __init__(self) -> None:
        self._stored: asyncio.Future[None] | None = None

    @contextlib.contextmanager
    def going_on(self) -> Iterator[None]:
        """For as long as a mission is being stored, and until it is the one of the vehicle."""
        stored = self._stored = asyncio.get_running_loop().create_future()
        try:
            yield
        finally:
            stored.set_result(None)
            if self._stored is stored:
                self._stored = None

    @property
    def is_active(self) -> bool:
        """A mission is being stored."""
        return self._stored is not None

    async def over(self) -> None:
        """Return when no mission is being stored: at once if that is so.

        Raises `Refused` when it takes too long.
        """
        while self._stored is not None:
            done, _ = await asyncio.wait({self._stored}, timeout=STORE_WAIT)
            if not done:
                raise Refused(texts.MISSION, texts.MISSION_STORING)


class MissionFlight(PlainTask):
    """Flies the mission of one vehicle; its flight task in mode Mission."""

    rules = TaskRules(texts.MISSION, needs=Needs.NO_PILOT, ends_landing=Extent.COMMANDED, ends_return=Extent.COMMANDED)
    mode = FlightMode.MISSION

    def __init__(self, vehicle: Aircraft, clock: Clock) -> None:
        self.machine = MissionMachine()
        self.storing = StoreWait()
        self._vehicle = vehicle
        self._clock = clock
        self._files = FilesOnDrone(vehicle.drone.flight_plan)
        self._alarm = Alarm(self._on_alarm)
        self._proof = ValueInterest(PROOF, is_on=False)
        """Of the values that show whether the drone has reached the last way point: while that is in question."""
        self._outlet: MissionOutlet | None = None
        self._background: asyncio.Task[None] | None = None
        """Runs the machine's work when no command of a client does."""
        self._begun: asyncio.Event | None = None
        """Set when the start under way has ended; None while no command waits for that."""
        self._commanded: list[MissionAttempt] = []
        """Those that commands are starting, in the order of their arrival; the machine knows one from Acquire on."""

    def attach(self, outlet: MissionOutlet) -> None:
        """Report to clients and memory from now on."""
        self._outlet = outlet

    @property
    def outlet(self) -> MissionOutlet:
        assert self._outlet is not None, "attached by the service, without which no client requests a mission"
        return self._outlet

    # Requests of clients.

    def take(self, items: Sequence[Item], identity: int) -> None:
        """Fly another mission from now on, or (no items) none. One that is flown is stopped."""
        if identity != self.machine.mission.identity:
            self._handle(self.machine.upload(items, identity))

    def taken_again(self) -> None:
        """The same mission was uploaded once more: a flight continues, else it is a new mission."""
        self._handle(self.machine.upload_again())

    async def engage(self, by: Right, item: int | None = None) -> None:
        """Begin mode Mission, resume it or fly it from an item on; returns when the drone flies it.

        On the ground and disarmed it waits until this client arms. Raises `Refused`, or the error by which the drone
        refused.
        """
        await self.storing.over()
        machine, vehicle = self.machine, self._vehicle
        if not self.there:
            raise Refused(texts.MISSION, texts.NO_MISSION)
        if item is None:
            await self._start_over()
        if machine.flying and item is None:
            return  # it is flown, and is not interrupted
        attempt = machine.attempt(item)
        if vehicle.armed:
            self._require_freedom(attempt, ends_return=self.returns)
            self._commanded.append(attempt)
            try:
                await self._work(Prepare(attempt), by)
            finally:
                self._commanded.remove(attempt)
                if self._begun is not None and self._beginning is None:
                    self._release_waiting()
            self._require_same(attempt)
            return

        def condition() -> None:
            self._require_freedom(attempt)
            if not vehicle.on_ground:  # it has taken off, and waits for no arming
                raise Refused(texts.MISSION, vehicle.activity)

        async with vehicle.control.acquire(self, by=by, condition=condition):
            effects = machine.await_arm(by.client, self._now)
        self._handle(effects)
        if vehicle.is_armed_by(by.client):  # since it requested this
            self.armed(by.client)

    async def require_flyable(self) -> None:
        """Raise `Refused` for a mission that cannot be flown from here.

        Asked before a landing or return is ended for it.
        """
        await self.storing.over()
        attempt = self.machine.attempt()
        course = await self._laid_out(attempt.mission.items, attempt.item, attempt)
        await check_path(self._vehicle, attempt.mission.items, course.parts, warns=False)

    async def _start_over(self) -> None:
        """Return when no start is under way; raise `Refused` if the mission was replaced.

        A second one would stop a drone that is about to take off.
        ArduCopter's operators choose Auto, arm, and then send MISSION_START.
        """
        mission = self.machine.mission
        while self._beginning is not None:
            await self._start_ended()
        self._require_mission(mission)

    async def _start_ended(self) -> None:
        """Wait until the start under way has ended.

        A command that waits, too, may have begun another one then.
        """
        self._begun = self._begun or asyncio.Event()
        await self._begun.wait()

    @property
    def _beginning(self) -> MissionAttempt | None:
        """The newest start under way."""
        if self._commanded:
            return self._commanded[-1]
        return self.machine.phase.attempt if self.machine.state in _BEGINS else None

    def _release_waiting(self) -> None:
        """Let the commands go on that wait for the end of a start."""
        if self._begun is not None:
            self._begun.set()
            self._begun = None

    async def choose(self, by: Right, item: int) -> None:
        """Make an item the current one; a mission that is flown, or about to be, continues there.

        Without effect on the item that is flown: clients repeat the request, and each start stops the drone first.
        """
        await self.storing.over()
        mission = self.machine.mission
        while (begun := self._beginning) is not None and begun.item == item and not begun.jumps:
            self.outlet.mission_changed()  # the answer to a message
            await self._start_ended()
            self._require_mission(mission)
            if self.machine.flying:
                return  # from this item on: another choice would have cancelled this one
        if not self.there:
            raise Refused(texts.CURRENT_ITEM, texts.NO_MISSION)
        if not 0 <= item < len(self.machine.mission.items):
            raise Refused(texts.CURRENT_ITEM, texts.NO_SUCH_ITEM.fill(number=item + texts.FIRST_LABEL), lasting=True)
        begun = self._beginning
        if begun is None and self.machine.is_at(item):
            self.outlet.mission_changed()
            return
        if self.machine.flying or begun is not None:
            await self.engage(by, item)
        else:
            self._handle(self.machine.choose(item))

    async def reset(self, by: Right) -> None:
        """Reset every jump counter; the current item stays. After the end the mission begins again."""
        progress = self.machine.progress
        if self.machine.rest is State.COMPLETE:
            await self.choose(by, 0)
        elif progress.jumps and not self.ending:
            await self.choose(by, progress.current)

    def armed(self, client: Hashable) -> None:
        """A client has armed: the mission that waits for that begins."""
        self._handle(self.machine.armed(client, storing=self.storing.is_active))

    # The state, for others.

    @property
    def there(self) -> bool:
        """True when a mission is stored."""
        return bool(self.machine.mission.items)

    @property
    def flying(self) -> bool:
        """True while the mission is flown."""
        return self.machine.flying

    @property
    def target(self) -> tuple[GeoPoint, float] | None:
        """Way point that the drone flies to by its file: place, m above take-off.

        None without one.
        """
        progress = self.machine.progress
        if self.machine.state is not State.FLYING_FILE or progress.leg is None:
            return None
        return next_place(progress.leg.content, progress.line)

    @property
    def ended_unreported(self) -> bool:
        """True when the plan that the drone reports as playing is over, as far as its lines go."""
        plan = self._vehicle.drone.flight_plan.state
        return plan.playing == PlayingState.PLAYING and self.machine.has_flown(plan.uid)

    @property
    def paused(self) -> bool:
        """True when the mission was begun and stopped."""
        return self.machine.rest is State.PAUSED

    @property
    def ending(self) -> bool:
        """True when a landing or a return that begins now is the plan's own."""
        return self.machine.ending

    @property
    def lands_here(self) -> bool:
        """True while the drone lands where its plan does, whose lines may be reported later."""
        return self._lands and self.machine.lands_at(self._vehicle.place)

    @property
    def owns_descent(self) -> bool:
        vehicle = self._vehicle
        if self.ending:
            return True
        return self.returns if vehicle.returning else self._lands and self.machine.may_land(vehicle.place)

    @property
    def returns(self) -> bool:
        """True when a return that begins now is that of the mission's last item.

        One for which the drone names its plan as the reason is, also before it has reported that it flies the plan: at
        the place of the last way point it may begin with the return.
        """
        machine, drone = self.machine, self._vehicle.drone
        if machine.returning:
            return True
        if drone.home.state.reason != events.ReturnReason.FLIGHTPLAN:
            return False
        same = drone.flight_plan.state.uid == machine.progress.uid
        return machine.leads_home or (same and machine.returned)

    def judge_way(self) -> Iterator[bool | None]:
        """Judge if the rest of the way that is laid out is inside the fence, a way point at a time.

        Yields None after each of them, and the judgement at last: a long way takes seconds.
        """
        vehicle, progress = self._vehicle, self.machine.progress
        where, line = vehicle.place, progress.line
        try:
            for part in progress.course.parts:
                for point in way_points(part, line) if isinstance(part, FlightPlanFile) else ():
                    vehicle.fence.check_place(point.place, vehicle.fence_home, where)
                    where = point.place
                    yield None
                line = -1
        except OutsideFence:
            yield False
        else:
            yield True

    # Effects.

    @property
    def _now(self) -> float:
        return self._clock.monotonic()

    def _handle(self, effects: Sequence[Effect]) -> None:
        """Perform effects; work among them is done in the background."""
        if (work := self._perform(effects)) is not None:
            self._background = self.outlet.run_mission(self._report_failure(work))

    def _perform(self, effects: Sequence[Effect]) -> Work | None:
        """Perform effects at once; return the one that takes time, the last one of any event."""
        vehicle, work = self._vehicle, None
        for effect in effects:
            match effect:
                case Select():
                    if vehicle.control.active is not self:
                        vehicle.control.adopt(self)
                case Release():
                    if effect.lands:
                        vehicle.note_plan_landing()
                    self._release()
                case Suspend():
                    self._suspend(starting=effect.starting)
                case SendText():
                    vehicle.text(effect.severity, effect.text)
                case Announce():
                    returns = vehicle.drone.flight_plan.state.returns_on_disconnect
                    text = _beginning_text(effect.item, effect.resumes, stepped=effect.stepped, returns=returns)
                    vehicle.text(Severity.INFO, text)
                case Reached():
                    self.outlet.item_reached(effect.item)
                case Persist():
                    self.outlet.store_record(effect.record)
                case _:
                    work = effect
        if (deadline := self.machine.deadline()) is None:
            self._alarm.cancel()
        elif deadline != self._alarm.at:
            self._alarm.set(deadline)
        if (ends := self.machine.phase.state is State.ENDING) != self._proof.is_on:
            self._proof.switch(ends)
        if self._begun is not None and self._beginning is None:
            self._release_waiting()
        if self._outlet is not None:
            self._outlet.mission_changed()
        return work

    def _release(self) -> None:
        """Leave mode Mission, if it is the mode: another flight task may be active by now."""
        self._cancel_background()
        self._vehicle.control.release(self)

    def _cancel_background(self) -> list[asyncio.Task[None]]:
        task = self._background
        if task is None or task.done() or task is asyncio.current_task():
            return []
        if self.machine.state is State.COMPLETE:
            return []  # it is about to handle the confirmed start of the last file: its withdrawal would stop the drone
        task.cancel()
        return [task]

    def _suspend(self, *, starting: bool) -> None:
        """Command the drone to pause its file. A landing or a return of its own is not disturbed."""
        vehicle = self._vehicle
        if starting or (vehicle.flying_state not in _LANDING and not vehicle.returning):
            with contextlib.suppress(LinkLost):
                vehicle.drone.flight_plan.suspend()

    # Work.

    async def _report_failure(self, work: Work) -> None:
        """Do work whose failure the machine has reported as a text: no command waits for it."""
        with contextlib.suppress(AnafiMavError):
            await self._work(work)

    async def _work(self, work: Work | None, by: Right | None = None) -> None:
        """Do the machine's work until the drone flies. The gateway's items are flown in background.

        `by`: the client that requests it; None: the mission goes on by itself, or its client has armed.
        """
        while work is not None:
            attempt = work.attempt
            try:
                effects = await self._result_of(work, by)
            except AnafiMavError as error:
                self._handle(self.machine.failed(attempt, Failure(text_of(error), reason_of(error))))
                self._require_same(attempt)
                raise
            except BaseException:
                self._handle(self.machine.failed(attempt, None))
                raise
            work = self._perform(effects)
            if isinstance(work, FlyItem):
                self._handle([work])
                return

    async def _result_of(self, work: Work, by: Right | None) -> list[Effect]:
        """Do one piece of work; return the effects of its result."""
        machine, attempt = self.machine, work.attempt
        match work:
            case Prepare():
                if attempt.unattended:
                    await self.storing.over()
                held = machine.holds(attempt)  # not if a new mission was stored meanwhile, which has its own attempt
                if held:
                    prepared = await self._prepare(attempt)
                    if by is not None:  # the drone may have begun to take off meanwhile: a refusal disturbs nothing
                        self._require_freedom(attempt, ends_return=self.returns)
                    effects = machine.prepared(attempt, prepared)
                else:
                    effects = []
            case Acquire():
                effects = await self._acquire(work, by)
            case StartFile():
                await self._start(work)
                return machine.confirmed(attempt)
            case FlyItem():
                await fly_step(self._vehicle, attempt.mission.items[work.item])
                return machine.item_flown(attempt)
        if not effects:
            self._require_same(attempt)
            raise Refused(texts.MISSION, texts.MISSION_DISPLACED)
        return effects

    async def _prepare(self, attempt: MissionAttempt) -> Prepared:
        """Lay out the parts, check them, and load the first file, without disturbing the flight."""
        vehicle, plan, items = self._vehicle, self._vehicle.drone.flight_plan, attempt.mission.items
        progress, course, line = self.machine.progress, attempt.course, -1
        resumes = course is None and self._resumes(attempt)
        if resumes:
            course, line = progress.course, progress.line
        elif course is None:
            course = await self._laid_out(items, attempt.item, attempt)
        elif not course.parts and course.rest is not None:
            course = await self._laid_out(items, course.rest, attempt)
        if attempt.course is None or course is not attempt.course:
            await check_path(vehicle, items, course.parts, line)
        head = course.parts[0]
        if resumes or not isinstance(head, FlightPlanFile):
            return Prepared(course, progress.uid if resumes else "", line, resumes)
        if attempt.course is None and plan.state.playing == PlayingState.PAUSED:
            await plan.stop()  # some firmware may take no file while another one is paused (GroundSDK stops first)
        leg, uid, line = await self._files.beginning_with(head, items)
        return Prepared(Course((leg, *course.parts[1:]), course.rest, course.later), uid, line)

    async def _laid_out(self, items: Sequence[Item], first: Any, attempt: MissionAttempt) -> Course:
        parts, rest = await lay_out(self._vehicle, items, first, attempt.jumps)
        return Course(tuple(parts), rest)

    def _resumes(self, attempt: MissionAttempt) -> bool:
        """The drone hovers, with the rest of what is to be flown in its memory.

        Its payload is as the executed lines have set it. An Ai resumes in any case: it would climb for a new file.
        """
        machine, progress, plan = self.machine, self.machine.progress, self._vehicle.drone.flight_plan.state
        paused = plan.playing == PlayingState.PAUSED and plan.uid == progress.uid
        whole = progress.leg is not None and progress.course.later is None
        same = machine.rest is State.PAUSED and attempt.item == progress.current and attempt.jumps == progress.jumps
        decided = not self._vehicle.drone.flight_plan.is_undecided(progress.uid)
        goes_on = self._vehicle.drone.flight_plan.version == 2 or self._payload_holds
        return same and whole and paused and decided and self._vehicle.in_air and goes_on

    @property
    def _payload_holds(self) -> bool:
        drone, progress = self._vehicle.drone, self.machine.progress
        if progress.leg is None:
            return True
        return payload_after(progress.leg, progress.line, drone.flight_plan.version).holds(drone)

    async def _acquire(self, work: Acquire, by: Right | None) -> list[Effect]:
        """Acquire control, and hover; return the effects of the grant.

        Without a client the mission has control since its mode was chosen, and its end cancels this work. A mission
        that was replaced meanwhile does not become active.
        """
        control, ends_return = self._vehicle.control, self.returns

        def condition() -> None:
            self._require_freedom(work.attempt, ends_return=ends_return)
            if not self._vehicle.armed:
                raise Refused(texts.MISSION, texts.ARMING_EXPIRED)

        async with contextlib.nullcontext() if by is None else control.acquire(self, by=by, condition=condition):
            if by is None:  # `acquire` has checked it for a client
                condition()
            await self._stop(work.prepared, condition)
            if not (effects := self.machine.granted(work.attempt)):
                raise Refused(texts.MISSION, texts.MISSION_DISPLACED)
        return effects

    async def _stop(self, prepared: Prepared, condition: Condition) -> None:
        """End the moves, the mission's own return and another plan; check the drone after each wait."""
        vehicle, plan = self._vehicle, self._vehicle.drone.flight_plan
        if vehicle.in_air:
            await vehicle.drone.piloting.stop()
            condition()
            await vehicle.drone.piloting.cancel_return_home()
            condition()
        if not prepared.resumes and plan.state.playing not in (None, PlayingState.STOPPED):
            await plan.stop()
            condition()
        if prepared.resumes and plan.state.playing != PlayingState.PAUSED:  # it would begin the file again
            raise Refused(texts.MISSION, texts.MISSION_STOPPED)

    async def _start(self, work: StartFile) -> None:
        """Command the drone to fly a file, or to resume it; returns when it does."""
        plan = self._vehicle.drone.flight_plan
        goes_on = plan.state.returns_on_disconnect is False if plan.starts_anywhere else None
        uid, line = work.prepared.uid, work.prepared.line + 1 if plan.starts_anywhere else 0
        # Before the start: with its confirmation the drone may report lines whose effect takes a while.
        is_changed = work.prepared.resumes and not self._payload_holds
        try:
            await plan.start(uid, line, continue_on_disconnect=goes_on, cause=work.attempt)
        except CommandRejected as error:
            raise DroneRefused(_refusal_text(plan.state, error)) from error
        if is_changed:
            self._vehicle.text(Severity.WARNING, texts.MISSION_PAYLOAD_CHANGED)

    def _require_freedom(self, attempt: MissionAttempt, *, ends_return: bool = False) -> None:
        """Raise `Refused` while the drone may not fly an attempt, or not take off for it.

        `ends_return`: a return under way is the mission's own.
        """
        vehicle = self._vehicle
        returns, stands = vehicle.returning, vehicle.on_ground
        self._require_same(attempt)
        if returns and vehicle.returning_by_itself:
            raise Refused(texts.MISSION, texts.RETURNS_BY_ITSELF)
        if (returns and not ends_return) or not (stands or vehicle.in_air):
            raise Refused(texts.MISSION, vehicle.activity)
        if (reason := vehicle.lacking(self.rules.needs)) is not None:
            raise Refused(texts.MISSION, reason)
        if stands:
            vehicle.require_ready()

    def _require_same(self, attempt: MissionAttempt) -> None:
        self._require_mission(attempt.mission)

    def _require_mission(self, mission: Mission) -> None:
        """Raise `Refused` when another mission is stored."""
        if self.machine.mission is not mission:
            why = texts.MISSION_REPLACED_MEANWHILE if self.there else texts.MISSION_CLEARED_MEANWHILE
            raise Refused(texts.MISSION, why)

    # What the drone reports, and time.

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of what reports how far the drone's plan is."""
        return {
            events.MavlinkFilePlayingStateChanged: self._on_playing,
            events.MissionItemExecuted: self._on_executed,
            events.WaypointSkipped: self._on_skipped,
        }

    def value_subscriptions(self) -> ValueSubscriptions:
        """Return the handler of the values that prove that the drone is at its last way point."""
        return {self._on_position: self._proof}

    def _on_playing(self, message: events.MavlinkFilePlayingStateChanged, now: float) -> None:
        plan = self._vehicle.drone.flight_plan
        flown = plan.flown
        match message.state:
            case PlayingState.PLAYING if not plan.plays_withdrawn:
                attempt, line = (flown.cause, flown.line) if isinstance(flown, SentCommand) else (None, -1)
                self._handle(self.machine.playing(message.filepath, attempt, now, line=line))
            case PlayingState.PAUSED | PlayingState.STOPPED if flown is None:
                stopped = message.state == PlayingState.STOPPED
                self._handle(self.machine.halted(stopped=stopped, report=self._report(), now=self._now))

    def _on_executed(self, message: events.MissionItemExecuted, now: float) -> None:
        if not self._vehicle.drone.flight_plan.attribute_line(message.idx, now):
            self._handle(self.machine.executed(message.idx, now))

    def _on_skipped(self, message: events.WaypointSkipped, now: float) -> None:
        if not self._vehicle.drone.flight_plan.is_skipped_late(message.item, now):
            self._handle(self.machine.skipped(message.item))

    def _on_position(self, values: Values, now: float) -> None:
        for kind in values.layout.kinds:
            if kind in PROOF and self.machine.state is State.ENDING:
                self._handle(self.machine.reported(self._report(), self._now, kind))

    def on_vehicle(self) -> None:
        """Landing, return or flying state have changed."""
        machine, drone = self.machine, self._vehicle.drone
        match machine.phase.state:
            case State.ENDING:
                may_end = True
            case State.FLYING_FILE:
                descends = (
                    drone.piloting.settled.flying is FlyingState.LANDING
                    or drone.home.settled.reason is events.ReturnReason.FLIGHTPLAN
                )
                may_end = machine.progress.leg_done or descends
            case _:
                may_end = False
        if may_end:
            self._handle(machine.reported(self._report(), self._now))

    def _on_alarm(self) -> None:
        self._handle(self.machine.timeout(self._report()))

    @property
    def _forced(self) -> bool:
        """The drone lands, or is about to, and no plan is the cause."""
        return self._vehicle.drone.alerts.state.forced_landing not in (None, ForcedLandingReason.NONE)

    @property
    def _lands(self) -> bool:
        return self._vehicle.flying_state is FlyingState.LANDING and not self._forced

    def _report(self) -> DroneReport:
        vehicle, drone = self._vehicle, self._vehicle.drone
        alerts, returning = drone.alerts.state, drone.home.state.returning
        pilot, forced = drone.controller.pilot_acquired_control, self._forced
        alert = alerts.alert not in (None, AlertState.NONE)
        plan_error = drone.flight_plan.state.error not in (None, PlayError.NONE)
        down = vehicle.flying_state in (FlyingState.LANDING, FlyingState.LANDED)
        return DroneReport(
            pilot=pilot,
            is_in_trouble=not vehicle.in_air or returning or pilot or alert or forced or plan_error,
            lands=self._lands,
            lands_or_returns=not forced and (down or (vehicle.returning and not vehicle.returning_by_itself)),
            returns_by_plan=returning and drone.home.state.reason == events.ReturnReason.FLIGHTPLAN,
            place=vehicle.place,
            ato=drone.piloting.state.altitude,
        )

    # Flight task.

    def end(self) -> list[asyncio.Task[None]]:
        """Another flight task is active now: the mission is paused."""
        ended, vehicle = self._cancel_background(), self._vehicle
        lands = vehicle.flying_state is FlyingState.LANDING and vehicle.control.state is not ControlState.RELEASING
        if effects := self.machine.control_lost(lands=lands):
            self._perform(effects)
        return ended

    # The link.

    def link_down(self) -> None:
        """The drone may fly on with the file that it has. What the gateway flies itself ends here."""
        self.machine.link_down()
        self._alarm.cancel()
        self._release_waiting()

    def link_up(self, record: MissionRecord | None) -> None:
        """The drone is connected again, or to a new gateway: look if it flies our mission."""
        vehicle, plan = self._vehicle, self._vehicle.drone.flight_plan.state
        plays, in_air = plan.playing == PlayingState.PLAYING, vehicle.in_air or self._lands
        landing = vehicle.place if self._lands and vehicle.lands_uncommanded else None
        effects = self.machine.link_up(record, plan.uid, self._now, plays=plays, in_air=in_air, landing=landing)
        self._handle(effects)
        self.on_vehicle()  # it may have landed meanwhile


def _refusal_text(state: FlightPlanState, error: CommandRejected) -> OperatorText:
    """Return the refusal of a start that the drone does not accept."""
    reasons: list[str] = [
        _START_BLOCKERS.get(part, part.name.lower()) for part, ok in state.components.items() if not ok
    ]
    reasons += [_INPUTS.get(one) or one.name.lower().replace("_", " ") for one in sorted(state.missing or ())]
    return texts.MISSION_REFUSED_BY_DRONE.fill(reasons=", ".join(dict.fromkeys(reasons)) or error.reason)


def _beginning_text(item: int, resumes: bool, *, stepped: bool, returns: bool | None) -> OperatorText:
    """Return the text of a mission that begins or resumes, with the drone's link-loss behaviour.

    `stepped`: the drone has a part of the mission only. `returns`: the value of its ReturnHomeOnDisconnect.
    """
    alone = {None: texts.LINK_LOSS_UNKNOWN, True: texts.LINK_LOSS_RETURNS, False: texts.LINK_LOSS_CONTINUES}[returns]
    if stepped and returns is not True:
        alone = texts.LINK_LOSS_FILE
    template = texts.MISSION_RESUMES if resumes else texts.MISSION_STARTS
    return template.fill(item=item + texts.FIRST_LABEL, alone=alone)
