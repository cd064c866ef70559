"""Flies the drone by setpoints: the shell around `stream` and `steering`.

An attitude or a velocity reaches the sticks the moment it arrives, and again whenever the drone reports its motion. A
position is a move that the drone makes by itself (`moves`). A timer turns the pilot's silence into a hover,
which ends a move as well. On the ground a setpoint that climbs takes the drone off (`takeoff`); nothing is
flown before it hovers.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Hashable
from typing import NamedTuple

from msgspec.structs import replace

from anafi_mav import texts, units
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import Limits, PilotingCommand, events
from anafi_mav.drone.events import FlyingState, Message
from anafi_mav.drone.piloting.state import MOTORS_OFF
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import TooLow
from anafi_mav.vehicle.base.flight_task import Hover, Needs, PlainTask, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.right import Extent, Right, system_of
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.base.velocity_loop import (
    CAUTIOUS_TILT,
    WIND,
    MotionEstimate,
    VelocityController,
    tilt_for,
    tilt_limit,
)
from anafi_mav.vehicle.offboard.goals import Goal, resolve
from anafi_mav.vehicle.offboard.moves import OffboardMoves
from anafi_mav.vehicle.offboard.setpoints import NOTHING, AttitudeSetpoint, MotionSetpoint, Setpoint
from anafi_mav.vehicle.offboard.stream import COUNTS, FLYING, STREAMS, Event, OffboardStream, State, Steering, lasts
from anafi_mav.vehicle.offboard.takeoff import Launcher, climbs

WARN_AGAIN = 1.0
"""m/s by which a velocity has to be higher than the last one whose tilt was worth a word."""

TILT_HELD = texts.TILT_HELD.fill(tilt=CAUTIOUS_TILT * units.DEG_PER_RAD)

SINGLE_WAIT = 2.0
"""s that a single setpoint may wait until what was under way has let go of the drone; then it is out of date."""

_GUIDED = Hover(FlightMode.GUIDED)
_IN_GUIDED = TaskRules(
    texts.SETPOINT,
    needs=Needs.NO_DESCENT | Needs.IN_AIR | Needs.NO_PILOT | Needs.LIMITS | Needs.PLAIN_STICKS,
    is_stream=True,
    needs_operator=True,
)

_BEFORE_TAKEOFF = (FlyingState.LANDED, FlyingState.MOTOR_RAMPING)
"""States in which silence disarms a drone that setpoints take off."""


_GROUND = Needs.NO_PILOT | Needs.LIMITS | Needs.PLAIN_STICKS
_AIR = _GROUND | Needs.NO_DESCENT | Needs.IN_AIR

_RULES = {
    (stands, needs_roll): TaskRules(
        texts.OFFBOARD,
        needs=(_GROUND if stands else _AIR) | (Needs.ROLL_SIGN if needs_roll else Needs.NONE),
        ends_landing=Extent.COMMANDED,
        ends_return=Extent.COMMANDED,
        follows=True,
        needs_operator=True,
        needs_link=True,
    )
    for stands in (False, True)
    for needs_roll in (False, True)
}
"""For a drone that stands on the ground or not, and a setpoint that a velocity loop flies or not."""


MOTION: frozenset[type[Message]] = frozenset({events.AttitudeChanged, events.SpeedChanged, events.AltitudeChanged})
"""Values of which the drone's motion is estimated."""


class _Attempt(NamedTuple):
    """One attempt of a client to acquire control by setpoints, while what flew before is ending."""

    client: Hashable
    task: asyncio.Task[None]


class OffboardFlight(PlainTask):
    """The setpoints of programs on one vehicle, and the drone flown by those of its pilot."""

    def __init__(self, vehicle: Aircraft, clock: Clock, takeoff: Launcher) -> None:
        self._motion = MotionEstimate(vehicle.roll)
        self._unread: dict[type[Message], float] = {}
        """Values of motion that were reported since the last look at them, and when (s)."""
        self.warn_throttled: Callable[[OperatorText], None] = lambda text: vehicle.text(Severity.WARNING, text)
        """Says what is wrong with something that arrives many times a second."""
        self.drop: Callable[[Hashable, OperatorText], None] = lambda client, reason: vehicle.text(
            Severity.WARNING, texts.REFUSED.fill(what=texts.SETPOINT, reason=reason)
        )
        """Notifies a client that its setpoint, accepted earlier, is not flown."""
        self._vehicle = vehicle
        self._clock = clock
        self._takeoff = takeoff
        self._stream = OffboardStream()
        self._silence = Alarm(self._expired)
        self._attempt: _Attempt | None = None
        """The newest."""
        self._moves = OffboardMoves(vehicle, lambda reason: self.drop(self._stream.pilot, reason))

    @property
    def motion(self) -> MotionEstimate:
        """Motion of the drone; other flight tasks that fly by sticks use it too."""
        self._read_motion()
        return self._motion

    @property
    def engaged(self) -> bool:
        """Setpoints fly the drone."""
        return self._stream.flying

    @property
    def streaming_pilot(self) -> Hashable:
        """The client whose stream of setpoints flies the drone; None for a single position."""
        return self._stream.pilot if self._stream.state is State.ENGAGED else None

    # Flight task.

    @property
    def rules(self) -> TaskRules:
        setpoint = self._stream.setpoint
        needs_roll = isinstance(setpoint, MotionSetpoint) and setpoint.needs_loop
        return _RULES[self._stands, needs_roll]

    @property
    def mode(self) -> FlightMode | None:
        """Offboard; Guided for a single position there; None while a take-off is counted down."""
        if not self.engaged:
            return None
        return FlightMode.GUIDED if self._stream.state is State.SINGLE else FlightMode.OFFBOARD

    @property
    def setpoint(self) -> Setpoint | None:
        """Return the setpoint that is flown; None without one."""
        return self._stream.setpoint

    @property
    def flown(self) -> PilotingCommand | None:
        """The sticks that setpoints hold at present; None while they hold none."""
        return None if self._stream.steering is None else self._stream.steering.sticks

    @property
    def goal(self) -> Goal | None:
        """The position of what is being flown, resolved; None when it has none."""
        return None if self._stream.steering is None else self._stream.steering.goal

    @property
    def end_place(self) -> GeoPoint | None:
        """Return the place on the map at which the flown setpoint ends; None when it leads on.

        A velocity or acceleration beside a position leads beyond it.
        """
        goal, setpoint = self.goal, self._stream.setpoint
        if goal is None or not isinstance(setpoint, MotionSetpoint):
            return None
        leads_on = setpoint.velocity != NOTHING or setpoint.acceleration != NOTHING
        return None if leads_on else goal.place

    @property
    def yaw(self) -> float | None:
        """The heading (rad from north) that is turned to or held; None when none is."""
        return None if self._stream.steering is None else self._stream.steering.heading.yaw

    # What programs ask for.

    def receive(self, sender: Hashable, setpoint: Setpoint, *, guided: bool = False) -> OperatorText | None:
        """Take a program's newest setpoint; fly it at once when this program is the pilot.

        `guided`: the program is of the family whose setpoints fly the drone in mode Guided, without engagement.
        Returns None, or the reason for which the setpoint is not flown. One that waits for the end of a take-off, or
        for mode Offboard and asks for no motion, has none.
        """
        now = self._clock.monotonic()
        timeout = lasts(setpoint, self._vehicle.settings.guided_timeout if guided else None)
        if (reason := self._objection(sender, setpoint)) is not None:
            return reason
        self._stream = stream = self._stream.receive(sender, setpoint, now, timeout)
        if (reason := stream.objection(sender)) is not None:
            return reason
        self._watch()  # the pilot's newest setpoint may last for less time than the one before
        if self._stands:
            return self._on_ground(sender, setpoint, now, guided=guided)
        engagement = stream.engagement
        if engagement is not None and engagement.state in FLYING and sender == engagement.pilot:
            if engagement.state is State.SINGLE and not stream.received[sender].is_single:
                self._stream = stream.after(Event.ENGAGE)
                self._watch()
                self._vehicle.changed()
            return self._fly(now)
        if guided:
            return self._begin_guided(sender)
        return None if setpoint.is_still else texts.NOT_OFFBOARD.fill(mode=self._vehicle.mode.value)

    # On the ground.

    @property
    def _stands(self) -> bool:
        """The drone is on the ground, and can take off from there."""
        return self._vehicle.flying_state == FlyingState.LANDED

    def _on_ground(self, sender: Hashable, setpoint: Setpoint, now: float, *, guided: bool) -> OperatorText | None:
        """Handle a setpoint on the ground: only a climb of the client that armed and engaged counts.

        Returns why a setpoint takes nothing off, or None. ArduCopter flies attitudes alone from the ground.
        """
        vehicle, control, stream = self._vehicle, self._vehicle.control, self._stream
        pilot = stream.state in STREAMS and sender == stream.pilot
        if guided and isinstance(setpoint, MotionSetpoint):
            self._end_count(sender)
            return texts.TAKE_OFF_FIRST
        if not climbs(setpoint, vehicle.height.ato):
            self._end_count(sender)
            if guided or setpoint.is_still or isinstance(setpoint, AttitudeSetpoint):
                return None
            return texts.NO_CLIMB if pilot else texts.NOT_OFFBOARD.fill(mode=vehicle.mode.value)
        if stream.state in (State.LIFTING, State.JOINED) or self._is_acquiring:
            return None
        if guided:
            below = control.below
            if not (isinstance(below, Hover) and below == _GUIDED and below.client == sender):
                return texts.TAKE_OFF_OR_GUIDED
        elif stream.engagement is None or not pilot:
            return texts.NOT_OFFBOARD.fill(mode=vehicle.mode.value)
        elif stream.engagement.chosen_by != sender:
            return texts.NOT_CHOSEN
        if not self._takeoff.is_armed_by(sender):
            return texts.NOT_ARMED_BY_CLIENT
        by = vehicle.right(sender, Extent.COMMANDED)
        try:
            control.require_allowed(self, by)
            vehicle.require_ready()
            self._require_freedom(texts.TAKEOFF)
        except Refused as refusal:
            return refusal.reason
        self._stream = stream.climb(sender, now)
        self._watch()
        if self._stream.state is State.LIFTING:
            self._attempt = _Attempt(sender, control.run(sender, self._take_off(by, guided=guided), is_order=False))
        elif stream.climbs_since != self._stream.climbs_since:
            if guided:
                control.adopt(self, keeps_below=True)
            vehicle.text(Severity.WARNING, texts.SETPOINT_TAKEOFF_SOON.fill(system=system_of(sender)))
        return None

    @property
    def _is_acquiring(self) -> bool:
        """True while the newest attempt of a client has not ended."""
        return self._attempt is not None and not self._attempt.task.done()

    def _end_count(self, sender: Hashable) -> None:
        """One setpoint that does not climb ends the second of the client that sent it."""
        if self._stream.state in COUNTS and self._stream.pilot == sender:
            self._stream = self._stream.after(Event.STAY)
            if not self.engaged:
                self._vehicle.control.release(self)
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_NO_CLIMB)

    async def _take_off(self, by: Right, *, guided: bool) -> None:
        """Take off after a second of climbing setpoints; the newest is flown from the first hover."""
        vehicle, client = self._vehicle, by.client

        def condition() -> None:
            fresh = self._stream.candidate(client, self._clock.monotonic()) == client
            if not (self._stands and fresh and self._takeoff.is_armed_by(client)):
                raise Refused(texts.SETPOINT_TAKEOFF, texts.SETPOINTS_STOPPED)
            vehicle.require_ready()

        try:
            below = _GUIDED if guided else None
            async with vehicle.control.acquire(self, by=by, below=below, condition=condition) as grant:
                self._engage(Event.LIFT, client)
                grant.begin()
                await self._takeoff.launch()
        except AnafiMavError as error:
            if self._stream.state is State.LIFTING and self._stream.pilot == client:
                vehicle.control.release(self)  # refused before it has replaced anything
            vehicle.text(Severity.ERROR, texts.SETPOINT_TAKEOFF_FAILED.fill(error=reason_of(error)))

    def begin(self) -> None:
        """Fly as the successor of a take-off."""
        self.after_takeoff()

    def after_takeoff(self) -> None:
        """The drone hovers, or a take-off has ended: fly what is fresh at this moment."""
        vehicle, state = self._vehicle, self._stream.state
        if state not in (State.LIFTING, State.JOINED) or self._takeoff.under_way:
            return
        if vehicle.in_air or (state is State.JOINED and vehicle.on_ground):
            self._stream = self._stream.after(Event.RISEN)
            if vehicle.in_air and not vehicle.returning:
                self._begin()

    def left_ground(self) -> None:
        """The drone takes off.

        A session that stands by on the ground, or counts, flies only a take-off that is its own.
        """
        if self._stream.engagement is not None and self._stream.state not in (State.LIFTING, State.JOINED):
            self._vehicle.control.lose(texts.NOT_ITS_TAKEOFF)

    def _objection(self, sender: Hashable, setpoint: Setpoint) -> OperatorText | None:
        """Return why a setpoint cannot be flown; None when it can, is, or leaves the drone standing."""
        if isinstance(setpoint, AttitudeSetpoint) or (self._stands and not climbs(setpoint, self._vehicle.height.ato)):
            return None
        if self._vehicle.roll.sign is RollSign.INVERTED and setpoint.needs_loop:
            return texts.ROLL_INVERTED
        if setpoint.position == NOTHING:
            return None
        if sender == self._stream.pilot and self.goal is not None and self.goal.is_of(setpoint):
            return None
        try:
            resolve(setpoint, self._vehicle, self.motion)
        except TooLow as refusal:
            return refusal.reason if self._vehicle.in_air else None
        except Refused as refusal:
            return refusal.reason
        return None

    def streamed_for(self, client: Hashable) -> bool:
        """True when there are setpoints that mode Offboard would fly for this client."""
        return self._stream.candidate(client, self._clock.monotonic()) is not None

    async def engage(self, by: Right) -> None:
        """Engage mode Offboard for this client; returns when its setpoints fly the drone.

        Raises `Refused`.
        """
        control, client = self._vehicle.control, by.client
        candidate = self._pilot_for(client)
        if self._stream.state in STREAMS and candidate == self._stream.pilot:
            self._stream = self._stream.note(chosen_by=client)
            return  # it flies already, and goes on without a jolt
        if self._takeoff.under_way:
            self._engage(Event.JOIN, candidate, client)
            control.succeed(self)
            return
        async with control.acquire(self, by=by, condition=lambda: self._pilot_for(client)) as grant:
            self._engage(Event.ENGAGE, grant.found, client)
            grant.begin()
            self._begin()

    def _pilot_for(self, client: Hashable) -> Hashable:
        """Return the client whose setpoints mode Offboard flies for this one, or raise `Refused`."""
        self._require_freedom(texts.OFFBOARD)
        pilot = self._stream.candidate(client, self._clock.monotonic())
        if pilot is None:
            reason = texts.ROLL_INVERTED if self._vehicle.roll.sign is RollSign.INVERTED else texts.NO_SETPOINTS
            raise Refused(texts.OFFBOARD, reason)
        return pilot

    def _engage(self, event: Event, pilot: Hashable, chosen_by: Hashable = None) -> None:
        """The session has this pilot from now on, and ends with its silence."""
        self._stream = self._stream.engage(event, pilot, chosen_by)
        self._watch()

    def _require_freedom(self, what: OperatorText) -> None:
        vehicle = self._vehicle
        lifting = self._takeoff.under_way or self._stream.state is State.LIFTING
        if vehicle.drone.piloting.about_to_fly and not lifting:
            raise Refused(what, texts.WILL_TAKE_OFF)
        if (reason := vehicle.lacking(_GROUND)) is not None:
            raise Refused(what, reason)

    # ArduPilot's way.

    def _begin_guided(self, sender: Hashable) -> OperatorText | None:
        vehicle, attempt = self._vehicle, self._attempt
        if self._takeoff.under_way and vehicle.control.mode is FlightMode.GUIDED:
            return None  # at its end the next setpoint is flown
        if not vehicle.in_air:
            return vehicle.activity
        if vehicle.control.paused:
            return texts.PAUSED_BY_CLIENT
        if vehicle.mode is not FlightMode.GUIDED:
            return texts.IN_MODE.fill(mode=vehicle.mode.value)
        if attempt is None or not self._is_acquiring or attempt.client != sender:
            work = self._engage_guided(vehicle.right(sender, Extent.COMMANDED))
            self._attempt = _Attempt(sender, vehicle.control.run(sender, work, is_order=False))
        return None

    async def _engage_guided(self, by: Right) -> None:
        """The newest setpoint in mode Guided acquires the drone from whatever it does in that mode."""
        vehicle, control, client = self._vehicle, self._vehicle.control, by.client
        try:
            if vehicle.mode is not FlightMode.GUIDED:  # ended by what arrived together with the setpoint
                raise Refused(texts.SETPOINT, texts.IN_MODE.fill(mode=vehicle.mode.value))
            async with control.acquire(
                self, by=by, below=_GUIDED, rules=_IN_GUIDED, condition=lambda: self._require_recent(client)
            ) as grant:
                is_single = self._stream.received[client].is_single
                self._engage(Event.ENGAGE_SINGLE if is_single else Event.ENGAGE, client)
                grant.begin()
                self._begin()
        except AnafiMavError as error:
            self.drop(client, reason_of(error))
        except asyncio.CancelledError:
            action, newest = control.actions.current, self._stream.received.get(client)
            is_single = newest is not None and newest.is_single
            if is_single and action is not None and action.is_replaced_by_another_client:
                self.drop(client, texts.MISSION_DISPLACED if action.replaced_by_order else texts.OTHER_PROGRAM)
            raise

    def _require_recent(self, client: Hashable) -> None:
        """Raise `Refused` when a client's newest setpoint in Guided is out of date."""
        now, newest = self._clock.monotonic(), self._stream.received.get(client)
        if newest is None or now >= (newest.at + SINGLE_WAIT if newest.is_single else newest.over):
            raise Refused(texts.SETPOINT, texts.WAITED_TOO_LONG)

    # Ending.

    def _report_replaced(self, pilot: Hashable) -> None:
        """Notify the sender of a single setpoint whose flight the action of another client ends."""
        action = self._vehicle.control.actions.current
        if action is not None and action.client not in (None, pilot):
            self.drop(pilot, texts.MISSION_DISPLACED if action.is_order else texts.OTHER_PROGRAM)

    def end(self) -> list[asyncio.Task[None]]:
        """End the flight by setpoints; the last one is not flown on.

        Returns tasks that are about to end.
        """
        ended, self._stream = self._stream, self._stream.after(Event.DISENGAGE)
        self._watch()
        if ended.state in COUNTS:
            self._forget_choice()
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_CANCELLED)
        if not ended.flying:
            return []
        if ended.state is State.SINGLE and self._moves.under_way:
            self._report_replaced(ended.pilot)
        ending = self._moves.stop()
        self._vehicle.centre_sticks()
        return ending

    def _forget_choice(self) -> None:
        """The client whose climb was counted has to choose the mode once more."""
        if self._vehicle.control.below == _GUIDED:
            self._vehicle.control.adopt(_GUIDED)

    def link_up(self) -> None:
        """The link's delay is measured from now on."""
        self._motion.round_trip = self._vehicle.drone.round_trip

    def link_down(self) -> None:
        """Setpoints of before count for nothing."""
        self._moves.forget()
        self._stream = OffboardStream()
        self._watch()
        self._motion, self._unread = MotionEstimate(self._vehicle.roll), {}

    # What the drone reports.

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of the events on motion, and on the hover after a take-off."""
        return {
            events.FlyingStateChanged: lambda message, now: self.after_takeoff(),
            events.GpsLocationChanged: self._on_location,
        }

    def value_subscriptions(self) -> ValueSubscriptions:
        """Return the handler of the values that report the drone's motion."""
        return {self._on_motion: ValueInterest(MOTION)}

    def _on_motion(self, values: Values, now: float) -> None:
        places = values.layout.places
        for kind in MOTION:
            if kind in places:
                self._unread[kind] = now
        if self._vehicle.flying_state in MOTORS_OFF and self._stream.engagement is None:
            return  # the motion of a drone that stands is read when it is needed
        self._read_motion()
        setpoint = self._stream.setpoint
        if (isinstance(setpoint, AttitudeSetpoint) and events.AttitudeChanged in values) or (
            isinstance(setpoint, MotionSetpoint) and events.SpeedChanged in values
        ):
            self._fly_on(now)

    def _read_motion(self) -> None:
        """Add the newest values to the estimate."""
        if not self._unread:
            return
        unread, self._unread = self._unread, {}
        motion, state = self._motion, self._vehicle.drone.piloting.state
        if (at := unread.get(events.AttitudeChanged)) is not None:
            if (attitude := state.attitude) is None:
                motion.forget_attitude()
            else:
                motion.on_attitude(attitude.roll, attitude.pitch, attitude.yaw, at)
        if (at := unread.get(events.SpeedChanged)) is not None:
            if (velocity := state.velocity) is None:
                motion.forget_velocity()
            else:
                motion.on_velocity(velocity.north, velocity.east, velocity.down, at)
        if (at := unread.get(events.AltitudeChanged)) is not None:
            if (altitude := state.altitude) is None:
                motion.forget_height()
            else:
                motion.on_height(altitude, at)

    def _on_location(self, message: events.GpsLocationChanged, now: float) -> None:
        if (place := self._vehicle.place) is not None:
            self.motion.on_place(place.latitude, place.longitude)

    # Flying.

    def _begin(self) -> None:
        """Setpoints fly the drone from now on."""
        self._stream = self._stream.note(steering=Steering(VelocityController(self.motion)))
        if self._vehicle.in_air:
            self._vehicle.drone.piloting.hover()  # ends a moveTo or moveBy of ours, which would ignore sticks
        self._fly_on(self._clock.monotonic())

    def _fly_on(self, now: float) -> None:
        """Fly the pilot's newest setpoint after it has arrived."""
        pilot = self._stream.pilot
        if (reason := self._fly(now)) is not None:
            self.drop(pilot, reason)

    def _fly(self, now: float) -> OperatorText | None:
        """Fly the pilot's newest setpoint at this moment; return why it is not flown, or None."""
        vehicle, stream = self._vehicle, self._stream
        setpoint, steering, limits = stream.setpoint, stream.steering, vehicle.drone.piloting.state.limits
        if setpoint is None or steering is None or limits is None or not vehicle.in_air:
            return None
        if not vehicle.control.keeps(self):
            return None
        if isinstance(setpoint, AttitudeSetpoint):
            self._hold(steering.lean(setpoint, limits, now), now)
            return None
        try:
            steering = steering.resolve(setpoint, vehicle)
            if setpoint.moves and steering.goal is not None:
                self._stream = stream.note(steering=steering)
                return self._moves.go(steering.goal, steering.heading.yaw, now, asked=stream.state is not State.SINGLE)
            steering = self._judge_speed(setpoint, limits, steering)
            steering = steering.close_loop(setpoint, limits, now, located=vehicle.place is not None)
        except Refused as refusal:  # what the drone had reported when the setpoint arrived is not known any more
            self._hold(replace(steering, sticks=PilotingCommand()), now)
            return refusal.reason
        if steering.is_short_of_tilt:
            self.warn_throttled(texts.TILT_SHORT.fill(tilt=limits.tilt_deg))
        self._hold(steering, now)
        return None

    def _judge_speed(self, setpoint: MotionSetpoint, limits: Limits, steering: Steering) -> Steering:
        """Warn once for each higher speed that MaxTilt does not hold."""
        speed = math.hypot(setpoint.velocity[0] or 0.0, setpoint.velocity[1] or 0.0)
        if speed <= steering.warned_of:
            return steering
        needed = tilt_for(speed) * units.DEG_PER_RAD
        allowed = tilt_limit(limits, self.motion) * units.DEG_PER_RAD
        if allowed < min(needed, limits.tilt_deg):
            self.warn_throttled(TILT_HELD)
        elif needed > limits.tilt_deg:
            self.warn_throttled(
                texts.TILT_WIND.fill(tilt=limits.tilt_deg, speed=speed, wind=WIND, needed=math.ceil(needed))
            )
        return replace(steering, warned_of=speed + WARN_AGAIN)

    def _hold(self, steering: Steering, now: float) -> None:
        """These sticks, for as long as the setpoint is young."""
        if self._moves.active:
            self._moves.stop()
        self._stream = self._stream.note(steering=steering)
        self._vehicle.drone.piloting.pilot(steering.sticks, age=self._stream.stick_age(now))

    # Silence.

    def _expired(self) -> None:
        """End an engagement whose pilot is silent: the drone hovers, or is disarmed."""
        vehicle, ended = self._vehicle, self._stream
        self._stream = ended.expire(self._clock.monotonic())
        self._watch()
        if self._stream is ended:
            return
        lifting = ended.state is State.LIFTING and vehicle.flying_state in _BEFORE_TAKEOFF
        joined = ended.state is State.JOINED  # a take-off goes on that is not the pilot's
        if ended.state in COUNTS or lifting:
            vehicle.control.release(self)
            self._forget_choice()
            vehicle.text(Severity.WARNING, texts.GROUND_SETPOINTS_STOPPED)
            abort = self._takeoff.abort(vehicle.right(ended.pilot, Extent.COMMANDED))
            vehicle.control.run(ended.pilot, abort, is_order=False)
            return
        self._moves.forget()
        if not (self._stands or joined):
            vehicle.drone.piloting.hover()
        vehicle.control.release(self)
        if self._stands:
            vehicle.text(Severity.WARNING, texts.OFFBOARD_STOPPED_ON_GROUND)
        elif joined:
            vehicle.text(Severity.WARNING, texts.OFFBOARD_STOPPED_TAKEOFF)
        else:
            vehicle.text(Severity.WARNING, texts.OFFBOARD_STOPPED_HOVER)

    def _watch(self) -> None:
        """Wake up when the pilot has been silent for too long, or before."""
        deadline = self._stream.deadline
        if deadline is None:
            self._silence.cancel()
        elif self._silence.at is None or deadline < self._silence.at:
            self._silence.set(deadline)
