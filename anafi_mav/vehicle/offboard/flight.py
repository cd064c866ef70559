"""Flies the drone by setpoints: the shell around `stream` and `base.velocity_loop`.

An attitude or a velocity reaches the sticks the moment it arrives, and again whenever the drone reports its motion. A
position is a move that the drone makes by itself (`moves`). A timer turns the pilot's silence into a hover,
which ends a move as well. On the ground a setpoint that climbs takes the drone off (`takeoff`); nothing is
flown before it hovers.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import NamedTuple

from anafi_mav import texts, units
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import Limits, PilotingCommand, events
from anafi_mav.drone.events import FlyingState
from anafi_mav.errors import AnafiMavError, LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import TooLow
from anafi_mav.vehicle.base.clients import system_of
from anafi_mav.vehicle.base.control import Request
from anafi_mav.vehicle.base.flight_task import Hover, Needs, PlainTask, TaskRules
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.base.velocity_loop import (
    CAUTIOUS_TILT,
    STILL,
    WIND,
    MotionEstimate,
    VelocityController,
    tilt_for,
    tilt_limit,
    turn_towards,
)
from anafi_mav.vehicle.offboard.goals import Goal, demand, resolve
from anafi_mav.vehicle.offboard.moves import OffboardMoves
from anafi_mav.vehicle.offboard.setpoints import NOTHING, AttitudeSetpoint, MotionSetpoint, Setpoint
from anafi_mav.vehicle.offboard.silence import SILENCE
from anafi_mav.vehicle.offboard.stream import GUIDED_TIMEOUT, OffboardStream, State, is_position, lasts
from anafi_mav.vehicle.offboard.takeoff import Launcher, SetpointTakeoff, TakeoffPhase, TakeoffStep, climbs

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
)

_BEFORE_TAKEOFF = (FlyingState.LANDED, FlyingState.MOTOR_RAMPING)
"""States in which silence disarms a drone that setpoints take off."""


class _Course(NamedTuple):
    """A heading as it was asked for, and what it meant when it first arrived (rad from north)."""

    body: bool
    asked: float | None
    yaw: float | None


_GROUND = Needs.NO_PILOT | Needs.LIMITS | Needs.PLAIN_STICKS
_AIR = _GROUND | Needs.NO_DESCENT | Needs.IN_AIR


@dataclass
class _Engagement:
    """One attempt of a client to fly by setpoints in Guided, while what flew before is ending."""

    client: Hashable
    is_single: bool
    """Its setpoint is a single position so far, to be flown to its end."""
    task: asyncio.Task[None] | None = None

    @property
    def is_pending(self) -> bool:
        return self.task is not None and not self.task.done()


class OffboardFlight(PlainTask):
    """The setpoints of programs on one vehicle, and the drone flown by those of its pilot."""

    def __init__(self, vehicle: Aircraft, clock: Clock, takeoff: Launcher) -> None:
        self.guided_timeout = GUIDED_TIMEOUT
        """s that a velocity lasts in ArduPilot's Guided (a parameter)."""
        self.motion = MotionEstimate(vehicle.roll)
        """Motion of the drone; other flight tasks that fly by sticks use it too."""
        self.warn_throttled: Callable[[OperatorText], None] = lambda text: vehicle.text(Severity.WARNING, text)
        """Says what is wrong with something that arrives many times a second."""
        self.drop: Callable[[Hashable, OperatorText], None] = lambda client, reason: vehicle.text(
            Severity.WARNING, texts.REFUSED.fill(what=texts.SETPOINT, reason=reason)
        )
        """Notifies a client that its setpoint, accepted earlier, is not flown."""
        self.flown: PilotingCommand | None = None
        """The sticks that setpoints hold at present; None while they hold none."""
        self._vehicle = vehicle
        self._clock = clock
        self._takeoff = takeoff
        self._lift = SetpointTakeoff()
        self._stream = OffboardStream()
        self._silence = Alarm(self._expired)
        self._engagement: _Engagement | None = None
        """The newest in Guided."""
        self._chosen_by: Hashable = None
        """Client that chose mode Offboard for the present session."""
        self._controller = VelocityController(self.motion)
        self._warned_of = STILL
        """m/s of velocity up to which it has been said whether MaxTilt is enough."""
        self._goal: Goal | None = None
        self._course = _Course(False, None, None)
        self._moves = OffboardMoves(vehicle, lambda reason: self.drop(self._stream.pilot, reason))

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
        needs = (_GROUND if self._stands else _AIR) | (Needs.ROLL_SIGN if needs_roll else Needs.NONE)
        return TaskRules(texts.OFFBOARD, needs=needs)

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
    def goal(self) -> Goal | None:
        """The position of what is being flown, resolved; None when it has none."""
        return self._goal if self.engaged else None

    @property
    def yaw(self) -> float | None:
        """The heading (rad from north) that is turned to or held; None when none is."""
        return self._course.yaw if self.engaged else None

    # What programs ask for.

    def receive(self, sender: Hashable, setpoint: Setpoint, *, guided: bool = False) -> OperatorText | None:
        """Take a program's newest setpoint; fly it at once when this program is the pilot.

        `guided`: the program is of the family whose setpoints fly the drone in mode Guided, without engagement.
        Returns None, or the reason for which the setpoint is not flown. One that waits for the end of a take-off, or
        for mode Offboard and asks for no motion, has none.
        """
        now = self._clock.monotonic()
        stands = self._stands
        moves = isinstance(setpoint, MotionSetpoint) and (not stands or climbs(setpoint, self._vehicle.height.ato))
        if moves and isinstance(setpoint, MotionSetpoint) and (reason := self._objection(sender, setpoint)):
            return reason
        follows = self._stream.continues_stream(sender, now)
        if not self._stream.receive(sender, setpoint, now, lasts(setpoint, self.guided_timeout if guided else None)):
            return texts.OTHER_PROGRAM if self._stream.state is State.ENGAGED else texts.TOO_MANY_PROGRAMS
        deadline = self._stream.deadline()
        if self._silence.at is None or (deadline is not None and deadline < self._silence.at):
            self._watch()  # the pilot's newest setpoint may last for less time than the one before
        if stands:
            return self._on_ground(sender, setpoint, now, guided=guided)
        pilot = self.engaged and sender == self._stream.pilot
        if pilot and self._stream.state is State.SINGLE and (follows or not is_position(setpoint)):
            self._stream.engage(sender)
            self._watch()
            self._vehicle.changed()
        if pilot:
            return self._fly(now)
        if guided:
            return self._begin_guided(sender, setpoint, now, follows=follows)
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
        vehicle, lift = self._vehicle, self._lift
        pilot = self._stream.state is State.ENGAGED and sender == self._stream.pilot
        if guided and isinstance(setpoint, MotionSetpoint):
            self._end_count(sender)
            return texts.TAKE_OFF_FIRST
        if not climbs(setpoint, vehicle.height.ato):
            self._end_count(sender)
            if guided or setpoint.is_still or isinstance(setpoint, AttitudeSetpoint):
                return None
            return texts.NO_CLIMB if pilot else texts.NOT_OFFBOARD.fill(mode=vehicle.mode.value)
        if lift.phase in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED):
            return None
        if guided:
            below = vehicle.control.below
            engaged = isinstance(below, Hover) and below == _GUIDED and below.client == sender
        else:
            engaged = pilot and self._chosen_by == sender
        if not engaged:
            if guided:
                return texts.TAKE_OFF_OR_GUIDED
            return texts.NOT_CHOSEN if pilot else texts.NOT_OFFBOARD.fill(mode=vehicle.mode.value)
        if not self._takeoff.is_armed_by(sender):
            return texts.NOT_ARMED_BY_CLIENT
        refusal = vehicle.control.policy(Request(self, Right(sender, Extent.COMMANDED), self.rules))
        if (reason := self._grounded if refusal is None else refusal.reason) is not None:
            return reason
        step = lift.climb(sender, now, SILENCE)
        if step is TakeoffStep.WARN:
            if guided:
                vehicle.control.adopt(self, keeps_below=True)
            vehicle.text(Severity.WARNING, texts.SETPOINT_TAKEOFF_SOON.fill(system=system_of(sender)))
        elif step is TakeoffStep.TAKE_OFF:
            lift.begin(sender, TakeoffPhase.LIFTING)
            vehicle.control.run(sender, self._take_off(Right(sender, Extent.COMMANDED)), is_order=False)
        return None

    @property
    def _grounded(self) -> OperatorText | None:
        """Why setpoints do not take the drone off; None when they do."""
        if problems := self._vehicle.prearm_problems():
            return texts.joined(problems)
        try:
            self._require_freedom(texts.TAKEOFF)
        except Refused as refusal:
            return refusal.reason
        return None

    def _end_count(self, sender: Hashable) -> None:
        """One setpoint that does not climb ends the second of the client that sent it."""
        if self._lift.phase is TakeoffPhase.COUNTING and self._lift.client == sender:
            self._lift.stop()
            if not self.engaged:
                self._vehicle.control.release(self)
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_NO_CLIMB)

    async def _take_off(self, by: Right) -> None:
        """Take off after a second of climbing setpoints; the newest is flown from the first hover."""
        vehicle, lift, client = self._vehicle, self._lift, by.client
        below = _GUIDED if vehicle.control.mode is FlightMode.GUIDED else None
        try:
            async with vehicle.control.acquire(self, by=by, below=below) as grant:
                fresh = self._stream.candidate(client, self._clock.monotonic()) == client
                if not (self._stands and fresh and self._takeoff.is_armed_by(client)):
                    raise Refused(texts.SETPOINT_TAKEOFF, texts.SETPOINTS_STOPPED)
                lift.begin(client, TakeoffPhase.LIFTING)
                self._stream.engage(client)
                self._watch()
                grant.begin()
                await self._takeoff.launch()
        except AnafiMavError as error:
            if lift.phase is TakeoffPhase.LIFTING:
                lift.stop()
            vehicle.text(Severity.ERROR, texts.SETPOINT_TAKEOFF_FAILED.fill(error=reason_of(error)))

    def begin(self) -> None:
        """Fly as the successor of a take-off."""
        self.after_takeoff()

    def after_takeoff(self) -> None:
        """The drone hovers, or a take-off has ended: fly what is fresh at this moment."""
        vehicle = self._vehicle
        if self._lift.phase not in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED) or self._takeoff.under_way:
            return
        if vehicle.in_air:
            self._lift.stop()
            if self.engaged and not vehicle.returning:
                self._begin()
        elif self._lift.phase is TakeoffPhase.JOINED:
            self._lift.stop()

    def left_ground(self) -> None:
        """The drone takes off.

        A session that stands by on the ground flies only a take-off that is its own.
        """
        if self.engaged and self._lift.phase not in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED):
            self._vehicle.control.lose(texts.NOT_ITS_TAKEOFF)

    def _objection(self, sender: Hashable, setpoint: MotionSetpoint) -> OperatorText | None:
        """Why a position cannot be flown to; None when it can, or is being flown to."""
        if self._vehicle.roll.sign is RollSign.INVERTED and setpoint.needs_loop:
            return texts.ROLL_INVERTED
        if setpoint.position == NOTHING:
            return None
        if sender == self._stream.pilot and self._goal is not None and self._goal.is_of(setpoint):
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
        self._require_freedom(texts.OFFBOARD)
        candidate = self._stream.candidate(client, self._clock.monotonic())
        if candidate is None:
            reason = texts.ROLL_INVERTED if self._vehicle.roll.sign is RollSign.INVERTED else texts.NO_SETPOINTS
            raise Refused(texts.OFFBOARD, reason)
        if self._stream.state is State.ENGAGED and candidate == self._stream.pilot:
            self._chosen_by = client
            return  # it flies already, and goes on without a jolt
        if self._takeoff.under_way:
            self._stream.engage(candidate)
            self._lift.begin(candidate, TakeoffPhase.JOINED)
            self._chosen_by = client
            control.succeed(self)
            self._watch()
            return
        async with control.acquire(self, by=by) as grant:
            pilot = self._stream.candidate(client, self._clock.monotonic())
            if pilot is None or not (self._vehicle.in_air or self._stands):
                raise Refused(texts.OFFBOARD, texts.SETPOINTS_STOPPED if pilot is None else self._vehicle.activity)
            self._stream.engage(pilot)
            self._chosen_by = client
            grant.begin()
            self._begin()

    def _require_freedom(self, what: OperatorText) -> None:
        vehicle = self._vehicle
        lifting = self._takeoff.under_way or self._lift.phase is TakeoffPhase.LIFTING
        if not (vehicle.in_air or self._stands or lifting):
            raise Refused(what, texts.TAKE_OFF_FIRST)
        if vehicle.drone.piloting.about_to_fly and not lifting:
            raise Refused(what, texts.WILL_TAKE_OFF)
        if vehicle.returning:
            raise Refused(what, texts.RETURNS)
        if (reason := vehicle.lacking(_GROUND)) is not None:
            raise Refused(what, reason)

    # ArduPilot's way.

    def _begin_guided(self, sender: Hashable, setpoint: Setpoint, now: float, *, follows: bool) -> OperatorText | None:
        vehicle = self._vehicle
        if self._takeoff.under_way and vehicle.control.mode is FlightMode.GUIDED:
            return None  # at its end the next setpoint is flown
        if not vehicle.in_air:
            return texts.TAKE_OFF_FIRST
        if vehicle.control.paused:
            return texts.PAUSED_BY_CLIENT
        if vehicle.mode is not FlightMode.GUIDED:
            return texts.IN_MODE.fill(mode=vehicle.mode.value)
        is_single = is_position(setpoint) and not (follows or self._stream.is_late_after_stream(sender, now))
        engagement = self._engagement
        if engagement is not None and engagement.is_pending and engagement.client == sender:
            engagement.is_single = is_single
            return None
        self._engagement = engagement = _Engagement(sender, is_single)
        engagement.task = vehicle.control.run(sender, self._engage_guided(engagement, setpoint, now), is_order=False)
        return None

    async def _engage_guided(self, engagement: _Engagement, setpoint: Setpoint, said: float) -> None:
        """A setpoint in mode Guided acquires the drone from whatever it does in that mode."""
        vehicle, control, client = self._vehicle, self._vehicle.control, engagement.client
        try:
            self._require_freedom(texts.SETPOINT)
            if vehicle.mode is not FlightMode.GUIDED:  # ended by what arrived together with the setpoint
                raise Refused(texts.SETPOINT, texts.IN_MODE.fill(mode=vehicle.mode.value))
            async with control.acquire(
                self, by=Right(client, Extent.COMMANDED), below=_GUIDED, rules=_IN_GUIDED
            ) as grant:
                now = self._clock.monotonic()
                if engagement.is_single and now - said < SINGLE_WAIT:
                    self._stream.engage_single(client, setpoint, said)
                elif not engagement.is_single and self._stream.candidate(client, now) == client:
                    self._stream.engage(client)
                else:
                    raise Refused(texts.SETPOINT, texts.WAITED_TOO_LONG)
                grant.begin()
                self._begin()
        except AnafiMavError as error:
            self.drop(client, reason_of(error))
        except asyncio.CancelledError:
            action = control.actions.current
            if engagement.is_single and action is not None and action.is_replaced_by_another_client:
                self.drop(client, texts.MISSION_DISPLACED if action.replaced_by_order else texts.OTHER_PROGRAM)
            raise

    # Ending.

    def _report_replaced(self) -> None:
        """Notify the sender of a single setpoint whose flight the action of another client ends."""
        action, pilot = self._vehicle.control.actions.current, self._stream.pilot
        if action is not None and action.client not in (None, pilot):
            self.drop(pilot, texts.MISSION_DISPLACED if action.is_order else texts.OTHER_PROGRAM)

    def end(self) -> list[asyncio.Task[None]]:
        """End the flight by setpoints; the last one is not flown on.

        Returns tasks that are about to end.
        """
        if self._lift.stop() is TakeoffPhase.COUNTING:
            self._forget_choice()
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_CANCELLED)
        if not self.engaged:
            return []
        if self._stream.state is State.SINGLE and self._moves.under_way:
            self._report_replaced()
        self._stream.disengage()
        self._watch()
        self.flown = self._chosen_by = None
        ending = self._moves.stop()
        with contextlib.suppress(LinkLost):
            self._vehicle.drone.piloting.pilot(None)
        return ending

    def _forget_choice(self) -> None:
        """The client whose climb was counted has to choose the mode once more."""
        self._chosen_by = None
        if self._vehicle.control.below == _GUIDED:
            self._vehicle.control.adopt(_GUIDED)

    def link_down(self) -> None:
        """Setpoints of before count for nothing."""
        self._silence.cancel()
        self._lift.stop()
        self._moves.forget()
        self._goal = self.flown = None
        self._stream = OffboardStream()
        self.motion = MotionEstimate(self._vehicle.roll)
        self._controller = VelocityController(self.motion)

    # What the drone reports.

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of the events on motion, and on the hover after a take-off."""
        return {
            events.FlyingStateChanged: lambda message, now: self.after_takeoff(),
            events.AttitudeChanged: self._on_attitude,
            events.SpeedChanged: self._on_speed,
            events.AltitudeChanged: self._on_altitude,
            events.GpsLocationChanged: self._on_location,
        }

    def _on_attitude(self, message: events.AttitudeChanged, now: float) -> None:
        if (attitude := self._vehicle.drone.piloting.state.attitude) is None:
            self.motion.forget_attitude()
        else:
            self.motion.on_attitude(attitude.roll, attitude.pitch, attitude.yaw, now)
        if isinstance(self._stream.setpoint, AttitudeSetpoint):
            self._fly_on(now)

    def _on_speed(self, message: events.SpeedChanged, now: float) -> None:
        if (velocity := self._vehicle.drone.piloting.state.velocity) is None:
            self.motion.forget_velocity()
        else:
            self.motion.on_velocity(velocity.north, velocity.east, velocity.down, now)
        if isinstance(self._stream.setpoint, MotionSetpoint):
            self._fly_on(now)

    def _on_altitude(self, message: events.AltitudeChanged, now: float) -> None:
        if (altitude := self._vehicle.drone.piloting.state.altitude) is None:
            self.motion.forget_height()
        else:
            self.motion.on_height(altitude, now)

    def _on_location(self, message: events.GpsLocationChanged, now: float) -> None:
        if (place := self._vehicle.place) is not None:
            self.motion.on_place(place.latitude, place.longitude)

    # Flying.

    def _begin(self) -> None:
        """The session has a pilot from now on."""
        self._watch()  # the pilot's, which may be older than the newest of all
        self._controller = VelocityController(self.motion)
        self._goal, self._course = None, _Course(False, None, None)
        self._warned_of = STILL
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
        vehicle, setpoint = self._vehicle, self._stream.setpoint
        limits = vehicle.drone.piloting.limits
        if setpoint is None or limits is None or not vehicle.in_air or self._lift.phase is TakeoffPhase.JOINED:
            return None
        if not vehicle.control.keeps(self):
            return None
        if isinstance(setpoint, AttitudeSetpoint):
            self._hold(self._attitude(setpoint, limits, now), now)
            return None
        try:
            self._goal, self._course = self._resolved(setpoint), self._turned_to(setpoint)
            if setpoint.moves and self._goal is not None:
                self.flown = None
                return self._moves.go(self._goal, self._course.yaw, now, asked=self._stream.state is State.ENGAGED)
            self._hold(self._motion_sticks(setpoint, limits, now), now)
        except Refused as refusal:  # what the drone told when the setpoint arrived is not known any more
            self._hold(PilotingCommand(), now)
            return refusal.reason
        return None

    def _attitude(self, setpoint: AttitudeSetpoint, limits: Limits, now: float) -> PilotingCommand:
        self._goal, self._course = None, _Course(False, setpoint.yaw, setpoint.yaw)
        turn = setpoint.yaw_rate
        if self.motion.yaw is not None and self.motion.knows_heading(now):
            turn = turn_towards(setpoint.yaw, self.motion.yaw, turn)
        return PilotingCommand(
            roll_deg=setpoint.roll * units.DEG_PER_RAD,
            pitch_deg=setpoint.pitch * units.DEG_PER_RAD,
            yaw_rate_dps=turn * units.DEG_PER_RAD,
            climb_mps=setpoint.climb * limits.climb_mps,
        )

    def _motion_sticks(self, setpoint: MotionSetpoint, limits: Limits, now: float) -> PilotingCommand:
        speed = math.hypot(setpoint.velocity[0] or 0.0, setpoint.velocity[1] or 0.0)
        if speed > self._warned_of:
            self._warned_of = speed + WARN_AGAIN
            needed = tilt_for(speed) * units.DEG_PER_RAD
            allowed = tilt_limit(limits, self.motion) * units.DEG_PER_RAD
            if allowed < min(needed, limits.tilt_deg):
                self.warn_throttled(TILT_HELD)
            elif needed > limits.tilt_deg:
                self.warn_throttled(
                    texts.TILT_WIND.fill(tilt=limits.tilt_deg, speed=speed, wind=WIND, needed=math.ceil(needed))
                )
        located = self._vehicle.place is not None
        wanted = demand(setpoint, self._goal, self._course.yaw, located=located)
        sticks = self._controller.sticks(wanted, limits, now)
        if sticks is None:
            raise Refused(texts.SETPOINT, texts.MOTION_UNKNOWN)
        if self._controller.short_of is not None and self.motion.trusts_tilt:
            self.warn_throttled(texts.TILT_SHORT.fill(tilt=limits.tilt_deg))
        return sticks

    def _resolved(self, setpoint: MotionSetpoint) -> Goal | None:
        """Return the setpoint's position as it was resolved when the setpoint first arrived."""
        if setpoint.position == NOTHING:
            return None
        if self._goal is not None and self._goal.is_of(setpoint):
            return self._goal
        return resolve(setpoint, self._vehicle, self.motion)

    def _turned_to(self, setpoint: MotionSetpoint) -> _Course:
        """Return the setpoint's heading as it was resolved when the setpoint first arrived."""
        if self._course[:2] == (setpoint.body, setpoint.yaw):
            return self._course
        yaw = setpoint.yaw
        if yaw is not None and setpoint.body:
            if self.motion.yaw is None:
                raise Refused(texts.SETPOINT, texts.HEADING_UNKNOWN)
            yaw = units.wrap_pi(self.motion.yaw + yaw)
        return _Course(setpoint.body, setpoint.yaw, yaw)

    def _hold(self, sticks: PilotingCommand, now: float) -> None:
        """These sticks, for as long as the setpoint is young."""
        if self._moves.active:
            self._moves.stop()
        self.flown = sticks
        self._vehicle.drone.piloting.pilot(sticks, age=self._stream.stick_age(now))

    # Silence.

    def _expired(self) -> None:
        lifted, phase = self._lift.client, self._lift.phase
        expired = self._stream.expire(self._clock.monotonic())
        counted = phase is TakeoffPhase.COUNTING and self._stream.newest(lifted) is None
        if (expired and phase is TakeoffPhase.LIFTING and self._vehicle.flying_state in _BEFORE_TAKEOFF) or counted:
            self._lift.stop()
            self._vehicle.control.release(self)
            self._forget_choice()
            self._vehicle.text(Severity.WARNING, texts.GROUND_SETPOINTS_STOPPED)
            by = Right(lifted, Extent.COMMANDED)
            self._vehicle.control.run(lifted, self._takeoff.abort(by), is_order=False)
        elif expired:
            self._stopped(joined=phase is TakeoffPhase.JOINED)
        self._watch()

    def _stopped(self, *, joined: bool) -> None:
        """The pilot's silence has lasted too long.

        `joined`: a take-off that is not the pilot's setpoints' goes on.
        """
        vehicle = self._vehicle
        self._lift.stop()
        self.flown = None
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
        """Come back when those that matter have been silent for too long."""
        deadline = self._stream.deadline()
        if deadline is None:
            self._silence.cancel()
        else:
            self._silence.set(deadline)
