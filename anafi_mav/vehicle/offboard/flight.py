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
from collections.abc import Callable, Coroutine, Hashable
from typing import Any, NamedTuple

from anafi_mav import texts, units
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import Limits, PilotingCommand, events
from anafi_mav.drone.events import FlyingState
from anafi_mav.errors import AnafiMavError, LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import TooLow
from anafi_mav.vehicle.base.clients import system_of
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, reason_of, text_of
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.silence import SILENCE
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
from anafi_mav.vehicle.offboard.stream import GUIDED_TIMEOUT, OffboardStream, State, is_position, lasts
from anafi_mav.vehicle.offboard.takeoff import Launcher, SetpointTakeoff, TakeoffPhase, TakeoffStep, climbs

WARN_AGAIN = 1.0
"""m/s by which a velocity has to be higher than the last one whose tilt was worth a word."""

TILT_HELD = texts.TILT_HELD.fill(tilt=CAUTIOUS_TILT * units.DEG_PER_RAD)

SINGLE_WAIT = 2.0
"""s that a single setpoint may wait until what was under way has let go of the drone; then it is out of date."""

_BEFORE_TAKEOFF = (FlyingState.LANDED, FlyingState.MOTOR_RAMPING)
"""States in which silence disarms a drone that setpoints take off."""


class _Course(NamedTuple):
    """A heading as it was asked for, and what it meant when it first arrived (rad from north)."""

    body: bool
    asked: float | None
    yaw: float | None


class OffboardFlight:
    """The setpoints of programs on one vehicle, and the drone flown by those of its pilot."""

    def __init__(self, vehicle: Aircraft, clock: Clock, takeoff: Launcher) -> None:
        self.guided_timeout = GUIDED_TIMEOUT
        """s that a velocity lasts in ArduPilot's Guided (a parameter)."""
        self.motion = MotionEstimate(vehicle.roll)
        """Motion of the drone; other flight tasks that fly by sticks use it too."""
        self.warn_throttled: Callable[[OperatorText], None] = lambda text: vehicle.text(Severity.WARNING, text)
        """Says what is wrong with something that arrives many times a second."""
        self.run_action: Callable[[Hashable, Coroutine[Any, Any, None]], asyncio.Task[None]] = _at_once
        """Runs what takes the drone over, in its turn among the commands."""
        self.flown: PilotingCommand | None = None
        """The sticks that setpoints hold at present; None while they hold none."""
        self._vehicle = vehicle
        self._clock = clock
        self._takeoff = takeoff
        self._lift = SetpointTakeoff()
        self._stream = OffboardStream()
        self._silence = Alarm(self._expired)
        self._engaging: asyncio.Task[None] | None = None
        self._alone = False
        """True while a single setpoint is being engaged."""
        self._afterwards = FlightMode.HOLD
        """The mode that silence ends in."""
        self._controller = VelocityController(self.motion)
        self._warned_of = STILL
        """m/s of velocity up to which it has been said whether MaxTilt is enough."""
        self._goal: Goal | None = None
        self._course = _Course(False, None, None)
        self._moves = OffboardMoves(vehicle, lambda text: self.warn_throttled(text))

    @property
    def engaged(self) -> bool:
        """Setpoints fly the drone."""
        return self._stream.flying

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
        Returns None, or one sentence on why the setpoint is ignored.
        """
        now = self._clock.monotonic()
        stands = self._stands
        moves = isinstance(setpoint, MotionSetpoint) and (not stands or climbs(setpoint, self._vehicle.height.ato))
        if moves and isinstance(setpoint, MotionSetpoint) and (reason := self._objection(sender, setpoint)):
            return reason
        follows = self._stream.continues_stream(sender, now)
        if not self._stream.receive(sender, setpoint, now, lasts(setpoint, self.guided_timeout if guided else None)):
            return texts.OTHER_PROGRAM
        deadline = self._stream.deadline()
        if self._silence.at is None or (deadline is not None and deadline < self._silence.at):
            self._watch()  # the pilot's newest setpoint may last for less time than the one before
        if stands:
            return self._on_ground(sender, setpoint, now, guided=guided)
        pilot = self.engaged and sender == self._stream.pilot
        if pilot and self._stream.state is State.SINGLE and (follows or not is_position(setpoint)):
            self._stream.engage(sender)
            self._watch()
            self._vehicle.select(FlightMode.OFFBOARD, self)
        if pilot:
            self._fly(now)
        elif guided:
            return self._begin_guided(sender, setpoint, now, follows=follows)
        return None

    # On the ground.

    @property
    def _stands(self) -> bool:
        """The drone is on the ground, and can take off from there."""
        return self._vehicle.flying_state == FlyingState.LANDED

    def _on_ground(self, sender: Hashable, setpoint: Setpoint, now: float, *, guided: bool) -> OperatorText | None:
        """Handle a setpoint on the ground: only a climb of the client that armed and engaged counts.

        Returns why a setpoint that climbs takes nothing off, or None. ArduCopter flies attitudes alone from the
        ground.
        """
        vehicle, lift = self._vehicle, self._lift
        if guided and isinstance(setpoint, MotionSetpoint):
            self._end_count(sender)
            return texts.TAKE_OFF_FIRST
        if not climbs(setpoint, vehicle.height.ato):
            self._end_count(sender)
            return None
        if lift.phase in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED):
            return None
        if guided:
            engaged = vehicle.selected is FlightMode.GUIDED and vehicle.mode_client == sender
        else:
            pilot = self._stream.state is State.ENGAGED and sender == self._stream.pilot
            engaged = pilot and vehicle.mode_client == sender
        if not engaged:
            return texts.TAKE_OFF_OR_GUIDED if guided else None
        if not self._takeoff.is_armed_by(sender):
            return texts.NOT_ARMED_BY_CLIENT
        if (reason := self._grounded) is not None:
            return reason
        step = lift.climb(sender, now, SILENCE)
        if step is TakeoffStep.WARN:
            vehicle.text(Severity.WARNING, texts.SETPOINT_TAKEOFF_SOON.fill(system=system_of(sender)))
        elif step is TakeoffStep.TAKE_OFF:
            lift.begin(sender, TakeoffPhase.LIFTING)
            self.run_action(sender, self._take_off(sender))
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
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_NO_CLIMB)

    async def _take_off(self, sender: Hashable) -> None:
        """Take off after a second of climbing setpoints; the newest is flown from the first hover."""
        vehicle, lift = self._vehicle, self._lift
        afterwards = FlightMode.GUIDED if vehicle.selected is FlightMode.GUIDED else FlightMode.HOLD
        try:
            await vehicle.take_over()
            fresh = self._stream.candidate(sender, self._clock.monotonic()) == sender
            if not (self._stands and fresh and self._takeoff.is_armed_by(sender)):
                raise Refused(texts.SETPOINT_TAKEOFF, texts.SETPOINTS_STOPPED)
            self._join(sender, TakeoffPhase.LIFTING, afterwards)
            await self._takeoff.launch()
        except AnafiMavError as error:
            if lift.phase is TakeoffPhase.LIFTING:
                self.end()
            vehicle.text(Severity.ERROR, texts.SETPOINT_TAKEOFF_FAILED.fill(error=reason_of(error)))

    def _join(self, pilot: Hashable, phase: TakeoffPhase, afterwards: FlightMode) -> None:
        """The session begins, and flies once the drone hovers at the end of the take-off."""
        self._afterwards = afterwards
        self._stream.engage(pilot)
        self._lift.begin(pilot, phase)
        self._vehicle.select(FlightMode.OFFBOARD, self)
        self._watch()

    def after_takeoff(self) -> None:
        """The drone hovers, or a take-off has ended: fly what is fresh at this moment."""
        vehicle = self._vehicle
        if self._lift.phase not in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED) or self._takeoff.under_way:
            return
        if vehicle.in_air:
            self._lift.stop()
            if self.engaged and not vehicle.returning:
                self._begin(FlightMode.OFFBOARD)
        elif self._lift.phase is TakeoffPhase.JOINED:
            self._lift.stop()

    def left_ground(self) -> None:
        """The drone takes off.

        A session that stands by on the ground flies only a take-off that is its own.
        """
        if self.engaged and self._lift.phase not in (TakeoffPhase.LIFTING, TakeoffPhase.JOINED):
            self.end()
            self._vehicle.text(Severity.WARNING, texts.OFFBOARD_ENDED.fill(reason=texts.NOT_ITS_TAKEOFF))

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

    async def engage(self, client: Hashable) -> None:
        """Engage mode Offboard for this client; returns when its setpoints fly the drone.

        Raises `Refused`.
        """
        self._require_freedom(texts.OFFBOARD)
        candidate = self._stream.candidate(client, self._clock.monotonic())
        if candidate is None:
            reason = texts.ROLL_INVERTED if self._vehicle.roll.sign is RollSign.INVERTED else texts.NO_SETPOINTS
            raise Refused(texts.OFFBOARD, reason)
        if self._stream.state is State.ENGAGED and candidate == self._stream.pilot:
            return  # it flies already, and goes on without a jolt
        if self._takeoff.under_way:
            self._takeoff.displace()
            self._join(candidate, TakeoffPhase.JOINED, FlightMode.HOLD)
            return
        await self._vehicle.take_over()
        if not self._stands:
            await self._vehicle.drone.piloting.cancel_return_home()
        pilot = self._stream.candidate(client, self._clock.monotonic())
        if pilot is None or not (self._vehicle.in_air or self._stands) or self._vehicle.returning:
            raise Refused(texts.OFFBOARD, texts.SETPOINTS_STOPPED if pilot is None else self._vehicle.activity)
        self._afterwards = FlightMode.HOLD
        self._stream.engage(pilot)
        self._begin(FlightMode.OFFBOARD)

    def _require_freedom(self, what: OperatorText) -> None:
        vehicle = self._vehicle
        lifting = self._takeoff.under_way or self._lift.phase is TakeoffPhase.LIFTING
        if not (vehicle.in_air or self._stands or lifting):
            raise Refused(what, texts.TAKE_OFF_FIRST)
        if vehicle.drone.piloting.about_to_fly and not lifting:
            raise Refused(what, texts.WILL_TAKE_OFF)
        if vehicle.returning:
            raise Refused(what, texts.RETURNS)
        if vehicle.drone.controller.pilot_acquired_control:
            raise Refused(what, texts.PILOT)
        if vehicle.drone.piloting.limits is None:
            raise Refused(what, texts.TILT_UNKNOWN)
        if vehicle.sticks_follow_camera:
            raise Refused(what, texts.STICKS_FOLLOW_CAMERA)

    # ArduPilot's way.

    def _begin_guided(self, sender: Hashable, setpoint: Setpoint, now: float, *, follows: bool) -> OperatorText | None:
        mode = self._vehicle.mode
        if self._takeoff.under_way and self._vehicle.selected is FlightMode.GUIDED:
            return None  # at its end the next setpoint is flown
        if not self._vehicle.in_air:
            return texts.TAKE_OFF_FIRST
        if self._vehicle.paused:
            return texts.PAUSED_BY_CLIENT
        if mode is not FlightMode.GUIDED:
            return texts.IN_MODE.fill(mode=mode.value)
        self._alone = is_position(setpoint) and not (follows or self._stream.is_late_after_stream(sender, now))
        if self._engaging is None or self._engaging.done():
            self._engaging = self.run_action(sender, self._engage_guided(sender, setpoint, now))
        return None

    async def _engage_guided(self, sender: Hashable, setpoint: Setpoint, said: float) -> None:
        """A setpoint in mode Guided takes the drone over from whatever it does in that mode."""
        try:
            self._require_freedom(texts.SETPOINT)
            if self._vehicle.paused:
                raise Refused(texts.SETPOINT, texts.PAUSED_BY_CLIENT)
            if self._vehicle.mode is not FlightMode.GUIDED:  # ended by what arrived together with the setpoint
                raise Refused(texts.SETPOINT, texts.IN_MODE.fill(mode=self._vehicle.mode.value))
            await self._vehicle.take_over()
            await self._vehicle.drone.piloting.cancel_return_home()
            if not self._vehicle.in_air or self._vehicle.returning:
                raise Refused(texts.SETPOINT, self._vehicle.activity)
        except AnafiMavError as error:
            self.warn_throttled(text_of(error))
            return
        now = self._clock.monotonic()
        self._afterwards = FlightMode.GUIDED
        if self._alone and now - said < SINGLE_WAIT:
            self._stream.engage_single(sender, setpoint, said)
            self._begin(FlightMode.GUIDED)
        elif not self._alone and self._stream.candidate(sender, now) == sender:
            self._stream.engage(sender)
            self._begin(FlightMode.OFFBOARD)
        else:
            self._vehicle.select(FlightMode.GUIDED)

    # Ending.

    def end(self) -> list[asyncio.Task[None]]:
        """End the flight by setpoints; the last one is not flown on.

        Returns tasks that are about to end.
        """
        if self._lift.stop() is TakeoffPhase.COUNTING:
            self._vehicle.mode_client = None  # who counted has to choose the mode once more, and does not count on
            self._vehicle.text(Severity.NOTICE, texts.SETPOINT_TAKEOFF_CANCELLED)
        if not self.engaged:
            return []
        self._stream.disengage()
        self._watch()
        self._vehicle.forget_mode()
        self.flown = None
        ending = self._moves.stop()
        with contextlib.suppress(LinkLost):
            self._vehicle.drone.piloting.pilot(None)
        return ending

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
            self._fly(now)

    def _on_speed(self, message: events.SpeedChanged, now: float) -> None:
        if (velocity := self._vehicle.drone.piloting.state.velocity) is None:
            self.motion.forget_velocity()
        else:
            self.motion.on_velocity(velocity.north, velocity.east, velocity.down, now)
        if isinstance(self._stream.setpoint, MotionSetpoint):
            self._fly(now)

    def _on_altitude(self, message: events.AltitudeChanged, now: float) -> None:
        if (altitude := self._vehicle.drone.piloting.state.altitude) is None:
            self.motion.forget_height()
        else:
            self.motion.on_height(altitude, now)

    def _on_location(self, message: events.GpsLocationChanged, now: float) -> None:
        if (place := self._vehicle.place) is not None:
            self.motion.on_place(place.latitude, place.longitude)

    # Flying.

    def _begin(self, mode: FlightMode) -> None:
        """The session has a pilot from now on."""
        self._watch()  # the pilot's, which may be older than the newest of all
        self._controller = VelocityController(self.motion)
        self._goal, self._course = None, _Course(False, None, None)
        self._warned_of = STILL
        if self._vehicle.in_air:
            self._vehicle.drone.piloting.hover()  # ends a moveTo or moveBy of ours, which would ignore sticks
        self._vehicle.select(mode, self)
        self._fly(self._clock.monotonic())

    def _fly(self, now: float) -> None:
        """Do what the pilot's newest setpoint asks for at this moment."""
        vehicle, setpoint = self._vehicle, self._stream.setpoint
        limits = vehicle.drone.piloting.limits
        if setpoint is None or limits is None or not vehicle.in_air or self._lift.phase is TakeoffPhase.JOINED:
            return
        reason = None
        if vehicle.drone.controller.pilot_acquired_control:
            # He moved a stick. That he let go of it again does not give the drone back to the program.
            reason = texts.PILOT
        elif vehicle.sticks_follow_camera:
            reason = texts.STICKS_FOLLOW_CAMERA
        elif vehicle.roll.sign is RollSign.INVERTED and isinstance(setpoint, MotionSetpoint) and setpoint.needs_loop:
            reason = texts.ROLL_INVERTED
        if reason is not None:
            self.end()
            vehicle.select(FlightMode.HOLD)
            vehicle.text(Severity.WARNING, texts.OFFBOARD_ENDED.fill(reason=reason))
            return
        if isinstance(setpoint, AttitudeSetpoint):
            self._hold(self._attitude(setpoint, limits, now), now)
            return
        try:
            self._goal, self._course = self._resolved(setpoint), self._turned_to(setpoint)
            if setpoint.moves and self._goal is not None:
                self.flown = None
                self._moves.go(self._goal, self._course.yaw, now, asked=self._stream.state is State.ENGAGED)
            else:
                self._hold(self._motion_sticks(setpoint, limits, now), now)
        except Refused as refusal:  # what the drone told when the setpoint arrived is not known any more
            self.warn_throttled(texts.SETPOINT_DROPPED.fill(reason=refusal.reason))
            self._hold(PilotingCommand(), now)

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
            self._vehicle.select(self._afterwards if expired else self._vehicle.selected)
            self._vehicle.text(Severity.WARNING, texts.GROUND_SETPOINTS_STOPPED)
            self.run_action(lifted, self._takeoff.abort())
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
        vehicle.select(self._afterwards)
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


def _at_once(client: Hashable, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
    return asyncio.get_running_loop().create_task(work)
