"""The flight core: one drone as the vehicle that MAVLink's clients see.

No flavour, no message.

It holds the states that MAVLink has and an ANAFI has not (armed, mode) and keeps them true: both follow the drone's
behaviour, and a verb returns when the drone confirmed. Which flight task is active is stored in `base.control` alone.
The mode is derived from that task and from what the drone does by itself.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Awaitable, Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from anafi_mav import geo, texts
from anafi_mav.clock import NEVER, Clock
from anafi_mav.drone import Drone
from anafi_mav.drone.element import Position
from anafi_mav.drone.events import (
    AlertLevel,
    AutoTriggerReason,
    FlightId,
    FlyingState,
    FlyingStateChanged,
    ForcedLandingReason,
    GpsLocationChanged,
    PlayingState,
    ReturnReason,
    ReturnStateChanged,
    RthEndingBehavior,
    RthHomeType,
    RthState,
    TakeoffLocation,
)
from anafi_mav.errors import CommandRejected
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.aborted_return import AbortedReturn
from anafi_mav.vehicle.base.aircraft import Aircraft, CommandedSpeeds
from anafi_mav.vehicle.base.bounds import check_height
from anafi_mav.vehicle.base.control_machine import REST, DroneAct, State
from anafi_mav.vehicle.base.flight_task import (
    LAND,
    MOTOR_CUT,
    DescentEnd,
    FlightTask,
    Hover,
    Needs,
    Preparation,
    PreparationStep,
    TaskRules,
    end_of_descent,
)
from anafi_mav.vehicle.base.flying import AIRBORNE, LANDING, ON_GROUND, TAKING_OFF
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.height import ESTIMATE_ERROR, TakeoffRecord
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import By, Source, client_of, right_of
from anafi_mav.vehicle.base.right import Extent, Right, system_of
from anafi_mav.vehicle.base.roll_sign import RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions
from anafi_mav.vehicle.base.velocity_loop import TILT_LAG
from anafi_mav.vehicle.controller_inputs import ControllerInputs
from anafi_mav.vehicle.follow_flight import FollowFlight
from anafi_mav.vehicle.guided_flight import GOTO, GuidedFlight
from anafi_mav.vehicle.hold_rule import APART, HoldRule
from anafi_mav.vehicle.initiator import Initiator, Initiators
from anafi_mav.vehicle.joystick_override import Override
from anafi_mav.vehicle.link_loss import GcsWatch, LossAction, LossPolicy
from anafi_mav.vehicle.manual_flight import ManualFlight
from anafi_mav.vehicle.mission.flight import MissionFlight
from anafi_mav.vehicle.offboard.flight import OffboardFlight
from anafi_mav.vehicle.operator_control import Need, OperatorControl, operator_refusal_of
from anafi_mav.vehicle.pilot_switch import PilotSwitch
from anafi_mav.vehicle.return_end import ReturnEnd
from anafi_mav.vehicle.takeoff import Takeoff

NOT_COUNTED = texts.AGAIN_WITHIN.fill(seconds=APART)
UNENDABLE = (
    texts.FORCED,
    texts.LANDS,
    texts.PILOT_LANDS,
    texts.RETURNS,
    texts.PILOT_RETURNS,
    texts.RETURNS_BY_ITSELF,
    texts.MOTOR_DOWN,
    NOT_COUNTED,
)
"""Why a landing or a return is not ended."""

POSITION_OLD = 3.0
"""s without a GPS location, which an ANAFI reports once a second, after which the last one is no position in flight.

Nor after the landing, until the drone reports the next one.
"""

LOCATIONS_MISSED = 3
"""A drone that reports its location more rarely (a slowed simulator) may miss as many."""

BRAKING = 3.0
"""m/s2 that an ANAFI brakes with: 2 to 4 (anafi_ros paper IV)."""

LANDS_AFTER_RETURN = 2.0
"""s after a return that the drone ends by landing within which the landing begins."""


ESTIMATED = texts.TAKEOFF_AMSL_ESTIMATED.fill(error=ESTIMATE_ERROR)

GOOD_ACCURACY = 5
"""m of one standard deviation of GPS altitude that AMSL heights can be used with, without a text."""

_AUTO = (FlightMode.MISSION, FlightMode.FOLLOW, FlightMode.ORBIT, FlightMode.RETURN, FlightMode.LAND)
"""Modes in which the drone flies without setpoints of a client."""

_ALWAYS_ENTERABLE = frozenset(
    {
        FlightMode.HOLD,
        FlightMode.GUIDED,
        FlightMode.POSITION,
        FlightMode.TAKEOFF,
        FlightMode.LAND,
        FlightMode.RETURN,
        FlightMode.OFFBOARD,
    }
)


class Landed(enum.Enum):
    """State of the vehicle between ground and air."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


_LANDED_BY_STATE: Mapping[FlyingState | None, Landed] = {
    FlyingState.LANDED: Landed.ON_GROUND,
    **dict.fromkeys(TAKING_OFF, Landed.TAKEOFF),
    **dict.fromkeys(LANDING, Landed.LANDING),
    **dict.fromkeys(AIRBORNE, Landed.IN_AIR),
}


class Health(enum.Enum):
    """How the vehicle as a whole is."""

    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6


class VehicleStatus(NamedTuple):
    """State of a vehicle at one moment, as HEARTBEAT and EXTENDED_SYS_STATE report it."""

    mode: FlightMode
    is_armed: bool
    health: Health
    landed: Landed


@dataclass(frozen=True)
class LinkFacts:
    """Facts that end with the link to the drone."""

    flying: FlyingState | None = None
    """Newest flying state that was handled."""
    located_at: float = -math.inf
    """When the newest GPS location arrived (s)."""
    location_gaps: tuple[float, ...] = ()
    """s between the newest three locations, or fewer."""
    landed_at: float = -math.inf
    """When the last flight ended (s)."""
    lands_next: tuple[int, float] | None = None
    """A return has finished that the drone ends by landing: the epoch then, and until when it is due."""
    own_return: ReturnReason | None = None
    """Reason of the drone's own return under way."""


@dataclass(frozen=True)
class FlightFacts:
    """Facts of the present flight; on the ground those of the last one."""

    origin: GeoPoint | None = None
    earlier_takeoff: Position | None = None
    """The take-off place that the drone reported when it landed: of the flight before."""
    landing_ended_at: float = -math.inf
    """When a client last ended a landing (s)."""
    aborted_return: AbortedReturn | None = None
    """The return of the drone's own that was ended, while that has to be repeated to all clients."""


class Vehicle(Aircraft):
    """One drone, flown. All methods run on the event loop's thread."""

    def __init__(
        self,
        drone: Drone,
        clock: Clock,
        *,
        allow_kill: bool,
        text: Callable[[Severity, OperatorText], None],
        changed: Callable[[], None],
    ) -> None:
        super().__init__(drone, clock, text=text, changed=changed)
        self.gcs_loss = LossPolicy()
        """Reaction to the loss of all ground stations (a parameter)."""
        self.stations = GcsWatch()
        self.link_facts = LinkFacts()
        self.flight_facts = FlightFacts()
        self.allow_kill = allow_kill
        self._initiators = Initiators()
        self.holds = HoldRule()
        """Which Holds of clients count against a return of the drone's own."""
        self.return_end = ReturnEnd(self, self._command_landing)
        self.mission = MissionFlight(self, clock)
        self.takeoff = Takeoff(self, self.mission.armed)
        self.guided = GuidedFlight(self)
        self.offboard = OffboardFlight(self, clock, self.takeoff)
        self.manual = ManualFlight(self, clock, lambda: self.overridable, lambda: self.pilot_switch.objection)
        self.pilot_switch = PilotSwitch(self, drone.controller, lambda: self.control.perform(self.stop_for_pilot()))
        self.operators = OperatorControl()
        """The operator among the stations, if one has requested control."""
        self.control.policies = (
            lambda request: self.pilot_switch.refusal(request) if drone.controller.present else None,
            lambda request: operator_refusal_of(self.operators, request) if self.operators.operator else None,
        )
        self.controller_inputs = ControllerInputs(drone.controller)
        self.follow = FollowFlight(self, lambda: self.offboard.motion, clock)

    # What the vehicle is.

    @property
    def armed(self) -> bool:
        return self._is_armed_in(self.flying_state)

    def prearm_problems(self) -> list[OperatorText]:
        problems = super().prearm_problems()
        if self.stations.lost and self.gcs_loss.action is not LossAction.NOTHING and self.on_ground:
            problems.append(texts.NO_STATION)
        return problems

    def _is_armed_in(self, state: FlyingState | None) -> bool:
        return (state is not None and state not in ON_GROUND) or self.takeoff.armed

    def is_armed_by(self, client: Hashable) -> bool:
        return self.takeoff.is_armed_by(client)

    @property
    def origin(self) -> GeoPoint | None:
        return self.flight_facts.origin

    @property
    def position_is_old(self) -> bool:
        return self._clock.monotonic() > self._position_expiry

    @property
    def stopping_place(self) -> GeoPoint | None:
        here, velocity = self.place, self.drone.piloting.state.velocity
        if here is None or velocity is None:
            return here
        # The location is up to a second old, and the drone flies on while it brakes.
        age = self._clock.monotonic() - self.link_facts.located_at
        seconds = age + TILT_LAG + math.hypot(velocity.north, velocity.east) / (2.0 * BRAKING)
        return GeoPoint(*geo.destination(*here, velocity.north * seconds, velocity.east * seconds))

    @property
    def _position_expiry(self) -> float:
        """When the newest location becomes old, if no other follows (s).

        `NEVER` without a location. On the ground, where nothing moves, the newest one stays what it was at the landing.
        """
        gps, facts, flying = self.drone.gps.state, self.link_facts, self.flying_state
        if not gps.fixed or gps.location is None or flying is None:
            return NEVER
        # The shorter one: a gap in which locations were missing is not how often they are reported.
        every = min(facts.location_gaps, default=0.0)
        expiry = facts.located_at + max(POSITION_OLD, LOCATIONS_MISSED * every)
        return NEVER if flying in ON_GROUND and expiry >= facts.landed_at else expiry

    def position_expires_at(self, now: float) -> float:
        """Return when `position_is_old` becomes true by itself (s); `NEVER` when it is."""
        expiry = self._position_expiry
        return expiry if now <= expiry else NEVER

    def mode_expires_at(self, now: float) -> float:
        """Return when `mode` changes by itself (s), or `NEVER`."""
        if self.link_facts.lands_next is None:
            return NEVER
        until = self.link_facts.lands_next[1]
        return until if now < until else NEVER

    @property
    def landed(self) -> Landed:
        return _LANDED_BY_STATE.get(self.flying_state, Landed.UNKNOWN)

    @property
    def mode(self) -> FlightMode:
        state = self.flying_state
        if state == FlyingState.EMERGENCY:
            return FlightMode.TERMINATED
        if self.return_end.shown:
            return FlightMode.RETURN
        if state in LANDING:
            return FlightMode.LAND
        if self.returning or (self.link_facts.lands_next is not None and self._is_about_to_land):
            return FlightMode.RETURN
        if state in TAKING_OFF or (self.takeoff.climbing and not self.on_ground):
            return FlightMode.MISSION if self.mission.flying else FlightMode.TAKEOFF
        mode, plays = self.control.mode, self.drone.piloting.state.plan == PlayingState.PLAYING
        if plays and mode is not FlightMode.MISSION and state in AIRBORNE:
            is_over = self.drone.flight_plan.plays_withdrawn or self.mission.ended_unreported
            return mode if is_over else FlightMode.MISSION
        return mode

    @property
    def _is_about_to_land(self) -> bool:
        """Between a return and its landing the drone reports neither; no mode is shown in between."""
        if self.link_facts.lands_next is None or not self.in_air:
            return False
        epoch, until = self.link_facts.lands_next
        return epoch == self.control.epoch and self._clock.monotonic() < until

    @property
    def acts_by_itself(self) -> bool:
        """True during a landing or return that no client has commanded."""
        initiators = self._initiators
        if self.flying_state in LANDING:
            initiator = initiators.landing
        else:
            initiator = initiators.returning if self.returning else None
            if initiator is None and self._is_about_to_land:
                initiator = initiators.last_return
        return initiator not in (None, Initiator.CLIENT)

    @property
    def lands_uncommanded(self) -> bool:
        return self._initiators.landing in (Initiator.DRONE, Initiator.UNSEEN)

    @property
    def overridable(self) -> Override:
        """Return the active kind of flight, as far as a joystick may override it.

        Whether a landing or return may be ended is decided by `hold`.
        """
        mode = self.mode
        if self.offboard.engaged and mode in (FlightMode.OFFBOARD, FlightMode.GUIDED):
            return Override.OFFBOARD
        if mode in _AUTO or (mode in (FlightMode.HOLD, FlightMode.GUIDED) and self.drone.piloting.moving):
            return Override.AUTO
        return Override(0)

    @property
    def status(self) -> VehicleStatus:
        """Mode, armed state, health and landed state of this moment."""
        state = self.flying_state
        is_armed = self._is_armed_in(state)
        health, landed = self._health(state, is_armed=is_armed), _LANDED_BY_STATE.get(state, Landed.UNKNOWN)
        return VehicleStatus(self.mode, is_armed, health, landed)

    def _health(self, state: FlyingState | None, *, is_armed: bool) -> Health:
        if state == FlyingState.EMERGENCY:
            return Health.EMERGENCY
        forced = self.drone.alerts.state.forced_landing
        if (
            state == FlyingState.EMERGENCY_LANDING
            or forced not in (None, ForcedLandingReason.NONE)
            or self.drone.battery.state.worst_alert() == AlertLevel.CRITICAL
        ):
            return Health.CRITICAL
        return Health.ACTIVE if is_armed else Health.STANDBY

    @property
    def mission_needs_gimbal(self) -> bool:
        """True while the gimbal belongs to the mission that is flown; a paused mission frees it."""
        return self.control.active is self.mission and self.mission.machine.needs_gimbal

    @property
    def mission_needs_camera(self) -> bool:
        """True while the camera belongs to the mission that is flown; a paused mission frees it."""
        return self.control.active is self.mission and self.mission.machine.needs_camera

    @property
    def enterable_modes(self) -> frozenset[FlightMode]:
        """Modes that a client may ask for as things stand.

        Hold, Land and Return are always among them: whether the drone can, it says itself.
        """
        follow = {FlightMode.FOLLOW} if self.place is not None else frozenset()
        mission = {FlightMode.MISSION} if self.mission.there else frozenset()
        return _ALWAYS_ENTERABLE | follow | mission

    # Its commands. Each returns when the drone confirmed, or raises.

    async def terminate(self, by: By) -> None:
        """Cut the motors, at once: what this replaces is not waited for, and sends nothing any more."""
        if not self.allow_kill:
            raise Refused(
                texts.MOTOR_CUT,
                texts.MOTOR_CUT_FORBIDDEN,
                lasting=True,
                critical=True,
            )
        async with self.control.acquire(MOTOR_CUT, by=by):
            await self.drone.piloting.emergency()

    async def land(self, by: By) -> None:
        """Land here. On the ground there is nothing to do."""
        rules = replace(LAND.rules, keeps_below=self.on_ground)  # on the ground there is no mode to leave
        async with self.control.acquire(LAND, by=by, rules=rules):
            await self._command_landing()
        if self.flying_state not in LANDING:
            self.control.release(LAND)

    async def _command_landing(self) -> None:
        """Land for a client, also at the end of its return: it is that client's landing."""
        self.note_landing_command()
        await self.drone.piloting.land()

    def note_landing_command(self) -> None:
        if not self.on_ground or self.drone.piloting.about_to_fly:  # else it ends no flight, and none that follows
            self._initiators.land_commanded(self._clock.monotonic())

    def note_plan_landing(self) -> None:
        self._initiators.plan_ended(self._clock.monotonic())

    async def return_home(self, by: By) -> None:
        """Fly home by the drone's own return. A landing goes on unless `by` may end it."""
        if self.return_end.shown:
            return  # it waits above home or lands there, and would climb and fly home once more
        await self.drone.piloting.settle_return()  # one that has ended would be accepted as under way
        async with self.control.acquire(self.return_end, by=by, condition=self._require_return):
            self._initiators.return_commanded(self._clock.monotonic())
            attempt = self.return_end.command()
            try:
                await self.drone.piloting.return_home()
            except BaseException:
                self.return_end.fail(attempt)
                raise
        self.return_end.announce(attempt, system_of(client_of(by)))

    def _require_return(self) -> None:
        """Raise `Refused` when the drone stands, or lands and cannot return.

        A drone that is held for a launch stands too: no return may wait there.
        """
        if self.on_ground or self.flying_state is FlyingState.USERTAKEOFF:
            raise Refused(texts.RETURN, self.activity)
        if self.landing and self.drone.home.state.rth == RthState.UNAVAILABLE:  # it would be ended for nothing
            raise Refused(texts.RETURN, texts.RETURN_UNAVAILABLE)

    async def hold(self, mode: FlightMode, by: By, *, chosen: bool = False, pause: bool = False) -> None:
        """Stop and hover. A landing or return goes on, and this is refused, unless `by` may end it.

        `chosen`: a client has chosen the mode by name or number. `pause`: setpoints of every client are ignored from
        now on; what flew is what DO_PAUSE_CONTINUE goes on with. During a pause the shown mode keeps both.
        """
        pauses = pause or (self.control.paused and mode is self.mode)
        hover = Hover(mode, client_of(by) if chosen else None, self._paused_task if pauses else None)
        task = self.manual if mode is FlightMode.POSITION else hover
        rising, may_rise = self.drone.piloting.about_to_fly, self.may_rise
        async with self.control.acquire(task, by=by, pauses=pauses) as grant:
            grant.begin(pauses=pauses and (rising or not self.on_ground))
        if may_rise:
            self.text(Severity.WARNING, texts.MODE_MAY_RISE.fill(mode=mode.value))

    @property
    def may_rise(self) -> bool:
        """True while a drone that has not left the ground may take off, whatever is cancelled now."""
        starts = self.flying_state in (FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF)
        return starts or self.drone.piloting.about_to_fly

    def end_inputs_of_others(self) -> None:
        """End flight by setpoints or sticks of a station that is not the operator.

        The drone hovers. A goto, a mission and what else flies by itself continue: the new operator decides about them.
        """
        pilot = self.offboard.streaming_pilot
        if pilot is not None and (reason := self.operators.objection(system_of(pilot) or 0, Need.FLY)) is not None:
            self.control.lose(reason)
        if (holder := self.manual.holder) is not None and self.operators.objection(system_of(holder) or 0, Need.FLY):
            self.manual.silent(holder)

    async def stop_for_pilot(self) -> None:
        """End what flies or is about to fly, for the pilot; return when the drone hovers or stands.

        A drone that has not left the ground stays there, and a landing or return goes on. A drone that nothing of ours
        flies receives nothing: its take-off may be the pilot's own.
        """
        control, active, by = self.control, self.control.active, Source.SWITCH
        is_pending = control.state in (State.RELEASING, State.ACQUIRING)
        is_flown = active is not None and active.rules.is_flight
        rising = self.drone.piloting.about_to_fly
        moves = self.drone.controller.taken and not self.on_ground
        if is_flown:
            control.lose(texts.PILOT_SWITCH)
        if self.descends and (not is_pending or control.next in (None, LAND, self.return_end)):
            return
        if not (is_pending or is_flown or rising or moves):
            return
        if self.may_rise:
            await self.takeoff.abort(by)
            return
        start = Preparation.AS_IT_IS if self.descends else Preparation.END_DESCENT
        async with control.acquire(hold := Hover(), by=by, rules=replace(hold.rules, start=start)):
            pass

    @property
    def _paused_task(self) -> FlightTask | None:
        """Return the task that a pause stops now, or that an earlier pause has stopped."""
        if (goto := self.guided.goto) is not None:
            return goto
        if self.mission.flying:
            return self.mission
        return self.interrupted

    @property
    def interrupted(self) -> FlightTask | None:
        """The goto or mission that a pause has stopped, while nothing else was commanded since."""
        control = self.control
        is_pending = control.state in (State.RELEASING, State.ACQUIRING)
        below = control.next_below if is_pending else control.below
        return below.resumes if isinstance(below, Hover) and (is_pending or control.active is below) else None

    async def reposition(
        self,
        place: GeoPoint | None,
        ato: float | None,
        yaw: float | None,
        speed: float | None = None,
        *,
        mode: FlightMode,
        by: By,
    ) -> None:
        """See `GuidedFlight.reposition`; a take-off under way is flown to its end before."""
        if self.takeoff.rises:
            self.guided.check(place, ato)  # one that is refused replaces none that waits
            await self.takeoff.over(GOTO)
        await self.guided.reposition(place, ato, yaw, speed, mode, by=by)

    async def take_off(self, ato: float | None, by: Right) -> None:
        """Take off to a height, or end a landing: then the drone hovers where it is."""
        if not self.landing or self.on_ground:
            await self.takeoff.take_off(ato, by)
            return

        def condition() -> None:
            if ato is not None:
                check_height(self, ato)
            if self.on_ground:
                raise Refused(texts.LANDING, texts.ALREADY_LANDED, form=texts.NOT_ABORTED)

        rules = end_of_descent(self.takeoff.rules, Preparation.RISE_AGAIN)
        async with self.control.acquire(Hover(), by=by, rules=rules, condition=condition):
            pass

    async def set_mode(self, mode: FlightMode, by: Right) -> None:
        """Do what this mode means, for the client that chose it: Offboard flies its setpoints."""
        match mode:
            case FlightMode.HOLD | FlightMode.POSITION:
                await self.hold(mode, by)
            case FlightMode.GUIDED:
                if not self._keeps_takeoff(by):
                    await self.hold(mode, by, chosen=True)
            case FlightMode.LAND:
                await self.land(by)
            case FlightMode.RETURN:
                await self.return_home(by)
            case FlightMode.TAKEOFF:
                await self.take_off(None, by)
            case FlightMode.OFFBOARD:
                if self.descends and not self.offboard.streamed_for(by.client):
                    raise Refused(texts.OFFBOARD, texts.NO_SETPOINTS)
                await self._free(self.offboard, by)
                await self.offboard.engage(by)
            case FlightMode.MISSION:
                if self.mission.there and not self.mission.flying:
                    await self._free(self.mission, by, self.mission.require_flyable)
                await self.mission.engage(by)
            case FlightMode.TERMINATED:
                await self.terminate(by)
            case FlightMode.FOLLOW:
                await self.follow.engage(by)
            case FlightMode.ORBIT:
                raise Refused(texts.ORBIT, texts.BY_COMMAND_ONLY, lasting=True)

    def _keeps_takeoff(self, by: Right) -> bool:
        """Return True when a take-off leads to Guided, which a client chooses again: it goes on.

        Guided is then that client's. ArduCopter changes nothing when its present mode is chosen (mode.cpp, `set_mode`).
        """
        control = self.control
        rises = control.active is self.takeoff
        below = control.below if rises else control.next_below if control.next is self.takeoff else None
        if below is None or below.mode is not FlightMode.GUIDED:
            return False
        control.require_allowed(self.takeoff, by)
        if rises:
            control.adopt(self.takeoff, below=Hover(FlightMode.GUIDED, by.client))
        return True

    # Ending a landing or a return.

    @property
    def landing(self) -> bool:
        """The drone lands, or has been commanded to and has not answered."""
        return self.descent is texts.LANDS

    @property
    def _landing_is_sent(self) -> bool:
        """A landing was commanded and has not been answered."""
        return self.control.next is LAND or self.return_end.commands_landing

    @property
    def descends(self) -> bool:
        """The drone lands or returns, or has been commanded to and has not answered."""
        return self.descent is not None

    @property
    def descent(self) -> OperatorText | None:
        state = self.flying_state
        if state in LANDING or (self._landing_is_sent and state not in ON_GROUND):
            return texts.LANDS
        return texts.RETURNS if self.returning or self.control.next is self.return_end else None

    @property
    def _forced_landing(self) -> bool:
        """No command ends this landing."""
        alerts = self.drone.alerts.state
        forced = alerts.forced_landing not in (None, ForcedLandingReason.NONE) and not alerts.forced_landing_delay_s
        return self.flying_state == FlyingState.EMERGENCY_LANDING or (forced and self.flying_state in LANDING)

    def require_endable(self, rules: TaskRules, by: By) -> None:
        """Raise `Refused` when the drone lands or returns, and the rules or `by` may not end that."""
        what, right = rules.what, right_of(by)
        lands = self.landing
        if not lands and rules.start is not Preparation.END_DESCENT:
            return
        ends = rules.ends_landing if lands else rules.ends_return
        extent = None if right is None else right.covered(ends)
        if lands:
            initiator = self._initiators.landing or Initiator.CLIENT
            if self._forced_landing:
                raise Refused(what, texts.FORCED)
            if initiator in (Initiator.PILOT, Initiator.UNSEEN):
                raise Refused(what, texts.PILOT_LANDS)
            if extent is None or (initiator is Initiator.DRONE and extent is not Extent.ALL):
                raise Refused(what, texts.LANDS)
        elif self.returning:
            initiator = self._initiators.returning or Initiator.CLIENT
            if self.returning_by_itself:
                self._require_own_endable(what, right if extent is Extent.ALL else None)
            elif initiator is Initiator.PILOT:
                raise Refused(what, texts.PILOT_RETURNS)
            elif extent is None:
                raise Refused(what, texts.RETURNS)
        elif extent is None and self.control.next is self.return_end:
            raise Refused(what, texts.RETURNS)

    def _require_own_endable(self, what: OperatorText, by: Right | None) -> None:
        if by is None:
            raise Refused(what, texts.RETURNS_BY_ITSELF)
        if self.drone.home.state.reason == ReturnReason.MOTOR_DOWN:
            raise Refused(what, texts.MOTOR_DOWN)
        if not by.counted:
            raise Refused(what, NOT_COUNTED)

    async def _free(self, task: FlightTask, by: Right, require: Callable[[], Awaitable[None]] | None = None) -> None:
        """End a landing or return that the task and `by` may end; returns when the drone hovers.

        Returns at once when the drone neither lands nor returns. A task that is refused ends nothing: `require` raises
        `Refused` for what it needs beyond its rules.
        """
        self.control.require_allowed(task, by)
        if self.descends:
            needs = task.rules.needs & ~(Needs.NO_DESCENT | Needs.IN_AIR)  # these are what the stop is for
            if (reason := self.lacking(needs)) is not None:
                raise Refused(task.rules.what, reason)
            rules = end_of_descent(task.rules)
            if require is not None:
                self.control.check(task, by, rules)
                await require()
            async with self.control.acquire(Hover(), by=by, rules=rules):
                pass

    def descent_end(self, rules: TaskRules, by: By) -> DescentEnd:
        right = right_of(by)
        if right is None or rules.start is not Preparation.END_DESCENT:
            return DescentEnd(right)
        return DescentEnd(right, self.returning_by_itself, self._cancels_announced(rules, right))

    async def end_descent(self, what: PreparationStep, end: DescentEnd) -> bool:
        piloting, right = self.drone.piloting, end.right
        match what:
            case PreparationStep.END_LANDING:
                return await self._end_landing(right)
            case PreparationStep.SETTLE_LANDING:
                await piloting.settle_landing()
                return True  # it has waited, maybe for none
            case PreparationStep.RISE_AGAIN:
                return await self._end_landing(right, take_off=True)
            case PreparationStep.CANCEL_OWN_RETURN if (
                right is not None and end.is_of_own_return and self.returning_by_itself
            ):
                reason = self.drone.home.state.reason
                await piloting.cancel_return_home(even_its_own=True)
                self._return_aborted(right, reason)
                return True
            case PreparationStep.ANSWER_ANNOUNCED if right is not None and end.cancels_announced is not None:
                await self._answer_announced(end.cancels_announced, right)
                return True
        return False

    def _cancels_announced(self, rules: TaskRules, by: Right) -> bool | None:
        """A return is announced and this Hold counts.

        True: it cancels it, False: it is the first; None otherwise.
        """
        trigger = self.drone.home.state.auto_trigger
        cancellable = trigger not in (None, AutoTriggerReason.NONE, AutoTriggerReason.MOTOR_DOWN)
        if not cancellable:
            self.holds.withdraw()
            return None
        if self.returning or by.covered(rules.ends_return) is not Extent.ALL or not by.counted:
            return None
        return self.holds.answers(by.client, by.at)

    async def _answer_announced(self, cancels: bool, by: Right) -> None:
        """Cancel the announced return, or notify all clients how a second Hold does."""
        home = self.drone.home
        trigger = home.state.auto_trigger
        if trigger in (None, AutoTriggerReason.NONE) or self.returning:
            return
        if not cancels:
            self.holds.offer(by.client, self._clock.monotonic())
            self.text(Severity.CRITICAL, texts.RETURN_ANNOUNCED.fill(seconds=home.state.auto_trigger_delay_s or 0))
            return
        await home.cancel_auto_trigger()
        if self.returning_by_itself:
            raise Refused(texts.RETURN, texts.RETURN_BEGUN, form=texts.NOT_CANCELLED)
        self.holds.withdraw()
        self._return_aborted(by, ReturnReason.LOW_BATTERY)  # the one reason that is announced and can be cancelled

    def _return_aborted(self, by: Right, reason: ReturnReason | None) -> None:
        """Notify all clients that a client has ended or cancelled a return of the drone's own.

        They are notified at once, and repeatedly.
        """
        aborted = AbortedReturn(by.system, reason)
        self.flight_facts = replace(self.flight_facts, aborted_return=aborted)
        aborted.report(self, self._clock.monotonic())

    def _note_stopped_return(self, reason: ReturnReason) -> None:
        """Remind all clients of an own return of the drone that no pending request has ended.

        The start of a mission that crosses its beginning ends it, and another controller may.
        """
        aborted = AbortedReturn(None, reason)
        if self.in_air and self.control.state in REST and aborted.lasts(self):
            self.flight_facts = replace(self.flight_facts, aborted_return=aborted)

    def remind_of_aborted_return(self, now: float) -> None:
        """Remind every client of a return that one of them has ended, while its reason lasts."""
        aborted = self.flight_facts.aborted_return
        if aborted is not None and not aborted.lasts(self):
            self.flight_facts = replace(self.flight_facts, aborted_return=None)
        elif aborted is not None and aborted.due(self, now):
            aborted.report(self, now)

    async def _end_landing(self, right: Right | None, *, take_off: bool = False) -> bool:
        """End the landing that the drone flies; return False at once when it flies none."""
        if self.flying_state not in LANDING:
            return False
        try:
            await self.drone.piloting.end_landing(take_off=take_off)
        except CommandRejected as error:
            raise Refused(texts.LANDING, texts.from_below(error.reason), form=texts.NOT_ABORTED) from None
        self.flight_facts = replace(self.flight_facts, landing_ended_at=self._clock.monotonic())
        if right is not None:
            self.text(Severity.NOTICE, texts.LANDING_ABORTED.fill(system=right.system))
        return True

    # What the drone reports.

    def subscriptions(self) -> Subscriptions:
        """Return the handlers of events that change the vehicle's own state.

        Services are called after them.
        """
        return {
            FlyingStateChanged: lambda message, now: self.on_flying_state(),
            GpsLocationChanged: lambda message, now: self.on_location(),
            FlightId: lambda message, now: self.on_position(),
            TakeoffLocation: lambda message, now: self.on_takeoff_location(),
            ReturnStateChanged: lambda message, now: self.on_return(),
        }

    def on_flying_state(self) -> None:
        """The drone's flying state changed."""
        state, before = self.flying_state, self.link_facts.flying
        self.link_facts = replace(self.link_facts, flying=state)
        if state == before:
            return
        takeoff = self.drone.home.state.takeoff_location
        self._note_landing(before)
        if state in ON_GROUND and before is not None:
            if before not in ON_GROUND:
                self.link_facts = replace(self.link_facts, landed_at=self._clock.monotonic())
            self.commanded_speeds = CommandedSpeeds()
            self.return_end.on_ground()
            self.takeoff.came_down()
            self.control.on_ground()
            if state == FlyingState.EMERGENCY:
                self.control.on_descent(DroneAct.EMERGENCY)
        elif state in LANDING:
            self.control.on_descent(DroneAct.LANDING)
        elif state in TAKING_OFF and before in ON_GROUND:
            self.height.take_off()
            self._report_accuracy()
            self._set_origin(self.place)
            if takeoff != self.flight_facts.earlier_takeoff:
                self.on_takeoff_location()  # it was reported before the state
        if state in ON_GROUND:
            self.flight_facts = replace(self.flight_facts, earlier_takeoff=takeoff, aborted_return=None)
        if not self.on_ground:
            self.takeoff.left_ground()
            if before in ON_GROUND:
                if self.drone.piloting.may_launch_late:  # its command was answered with FAILED
                    self.text(Severity.CRITICAL, texts.TAKEOFF_LATE)
                if not self.drone.piloting.has_launched:
                    self.control.lose(texts.FOREIGN_TAKEOFF)  # a mode chosen before was not meant for this flight
                self.offboard.left_ground()
        self.return_end.on_flying_state()
        self._note_hover()
        self.changed()

    def _note_hover(self) -> None:
        """The drone may have ended what it did by itself."""
        if self.in_air and not self.returning:
            self.control.release(LAND)  # ended elsewhere
            self.control.on_hover()

    def on_location(self) -> None:
        """A new GPS location."""
        now, facts = self._clock.monotonic(), self.link_facts
        gaps = (*facts.location_gaps[-1:], now - facts.located_at) if facts.located_at > -math.inf else ()
        self.link_facts = replace(facts, located_at=now, location_gaps=gaps)
        self.on_position()

    def on_position(self) -> None:
        """A new GPS location, altitude or flight id."""
        gps, ato = self.drone.gps.state, self.drone.piloting.state.altitude
        amsl = gps.location.altitude if gps.fixed and gps.location is not None else None
        if self.flying_state == FlyingState.LANDED:
            if not self.drone.piloting.about_to_fly:  # else it may have left the ground, and report that late
                self.height.on_ground(amsl, ato)
            if self.origin is None:
                self._set_origin(self.place)
        elif self.flying_state is not None and self.height.in_flight(self.drone.product.state.flight_id, amsl, ato):
            self.text(Severity.WARNING, ESTIMATED)

    def _report_accuracy(self) -> None:
        """Warn that AMSL heights of this flight have the error of GPS at its beginning."""
        gps = self.drone.gps.state
        if gps.fixed and gps.altitude_accuracy is not None and gps.altitude_accuracy > GOOD_ACCURACY:
            self.text(Severity.WARNING, texts.TAKEOFF_AMSL_INACCURATE.fill(error=gps.altitude_accuracy))

    def on_takeoff_location(self) -> None:
        """Adopt the take-off place of the present flight as origin of the local frame.

        The drone reports it.
        """
        location = self.drone.home.state.takeoff_location
        if location is not None and self.flying_state is not None and not self.on_ground:
            self._set_origin(GeoPoint(location.latitude, location.longitude))

    def _set_origin(self, origin: GeoPoint | None) -> None:
        """Adopt the origin of the local frame; None keeps the one of before."""
        if origin is not None:
            self.flight_facts = replace(self.flight_facts, origin=origin)

    def link_up(self, kept: TakeoffRecord | None) -> None:
        """Begin with a drone that has reported all its states.

        `kept` is of the last flight that was seen.
        """
        self.height.recall(kept)
        self.offboard.link_up()
        if self.on_ground:  # maybe another aircraft, or carried elsewhere
            self.flight_facts, self.commanded_speeds = FlightFacts(), CommandedSpeeds()
        self.return_end.watch_end()
        self._recall_initiator(kept)
        self.on_flying_state()
        self.on_location()  # the one that it has reported counts for as long as a new one
        if self.flying_state is not None and not self.on_ground:
            self.flight_facts = replace(self.flight_facts, origin=self._origin_in_flight(kept))

    def _recall_initiator(self, kept: TakeoffRecord | None) -> None:
        """Adopt the stored initiators of a landing or return of this flight that is still under way.

        A landing that has begun since is that of the return only if the drone has ended it so.
        """
        if kept is None or kept.flight_id != self.drone.product.state.flight_id:
            return
        landing, returning = (Initiator.__members__.get(name or "") for name in (kept.landing, kept.returning))
        if self.flying_state not in LANDING:
            landing = None
        elif landing is None and self._return_lands:
            landing = returning
        self._initiators.recall(landing, returning if self.returning else None)

    def _origin_in_flight(self, kept: TakeoffRecord | None) -> GeoPoint | None:
        """Return where a drone took off that was found in the air; None when nothing reports it."""
        home, flight = self.drone.home.state, self.drone.product.state.flight_id
        if (location := home.takeoff_location) is not None:
            return GeoPoint(location.latitude, location.longitude)
        if kept is not None and kept.flight_id == flight and kept.latitude is not None and kept.longitude is not None:
            return GeoPoint(kept.latitude, kept.longitude)
        if home.type == RthHomeType.TAKEOFF and home.location is not None:
            return GeoPoint(home.location.latitude, home.location.longitude)
        return None

    @property
    def standing_warnings(self) -> list[OperatorText]:
        """Texts that stay true for a while: a client that connects later gets them with its banner."""
        warnings = [ESTIMATED] if self.height.estimated and not self.on_ground else []
        if self.pilot_switch.objection is not None:
            warnings.append(texts.SWITCH_PILOT)
        return [*warnings, texts.ROLL_SIGN_INVERTED] if self.roll.sign is RollSign.INVERTED else warnings

    @property
    def takeoff_record(self) -> TakeoffRecord | None:
        """Return the record of the present flight's take-off point, to be stored.

        Returns None on the ground or without a flight id.
        """
        height, origin = self.height, self.origin
        if self.on_ground or not height.flight_id or height.takeoff_amsl is None:
            return None
        latitude, longitude = (None, None) if origin is None else origin
        landing, returning = self._initiators.landing, self._initiators.returning
        return TakeoffRecord(
            height.flight_id,
            height.takeoff_amsl,
            height.estimated,
            latitude,
            longitude,
            None if landing is None else landing.name,
            None if returning is None else returning.name,
        )

    def on_return(self) -> None:
        """React to a drone's return that began, ended or changed.

        Setpoints and the climb after a take-off end then, so that they never fight the return.
        """
        has_returned = self._initiators.returning is not None  # else the drone repeats the end of an earlier return
        self._note_return()
        home, lands_next = self.drone.home.state, self.link_facts.lands_next
        if not self._return_lands:
            lands_next = None
        elif has_returned:
            lands_next = self.control.epoch, self._clock.monotonic() + LANDS_AFTER_RETURN
        own, before = home.reason if home.returning_by_itself else None, self.link_facts.own_return
        self.link_facts = replace(self.link_facts, lands_next=lands_next, own_return=own)
        if before is not None and home.rth == RthState.AVAILABLE and home.reason == ReturnReason.STOPPED:
            self._note_stopped_return(before)
        if self.returning:
            self.return_end.watch_end()
            if self.mission.returns and not (self.returning_by_itself or self.return_end.active):
                self.return_end.announce(self.return_end.command(), None)  # the mission's last item
                if self.control.active is self.mission:
                    self.control.succeed(self.return_end)
                else:
                    self.control.adopt(self.return_end)
            self.control.on_descent(DroneAct.RETURN)
        self.return_end.on_return_state()
        self._note_hover()
        self.changed()

    @property
    def _return_lands(self) -> bool:
        """True when the drone reports the end of a return, and lands after that."""
        home = self.drone.home.state
        finished = home.rth == RthState.AVAILABLE and home.reason == ReturnReason.FINISHED
        return finished and home.ending == RthEndingBehavior.LANDING

    def link_down(self) -> None:
        """The link is lost: nothing that was asked for outlives it."""
        self.height.link_down()
        self.return_end.link_down()
        self.mission.link_down()  # before it could be ended: the drone may fly on
        self.control.link_down()
        self.pilot_switch.link_down()
        self.takeoff.link_down()
        self.link_facts = LinkFacts()
        for task in (self.offboard, self.manual):
            task.link_down()

    @property
    def alone(self) -> str | None:
        """Return how a return or landing ends without the gateway, as a predicate of the drone.

        Returns None if neither is active.
        """
        if self.landing:
            return "is landing, and goes on landing"
        return self.return_end.alone if self.descends else None

    async def let_go(self) -> None:
        """Prepare for the end of the gateway: a landing or return goes on, else the drone hovers.

        Everything else is ended. When the Skycontroller's pilot has the sticks, the drone is left to that pilot:
        nothing of ours flies it.
        """
        if self.descends:
            if not self.landing:
                self.control.release(self.return_end)
            return
        if self.control.leaves_to_pilot(Source.GATEWAY):
            if self._starts_by_command:  # a hand launch, for one, does not take the sticks
                await self._command_landing()
            return
        await self.control.perform(self._stay())

    @property
    def _starts_by_command(self) -> bool:
        """True while a drone that has not left the ground starts, or may, by our command."""
        piloting = self.drone.piloting
        return piloting.about_to_fly or (self.may_rise and piloting.has_launched)

    async def _stay(self) -> None:
        """Hover, or stay on the ground.

        A drone whose motors start by a command of this program is landed: it would rise and hover without a program.
        """
        hover, rising = Hover(), self._starts_by_command
        rules = replace(hover.rules, start=Preparation.AS_IT_IS) if rising else None
        async with self.control.acquire(hover, by=Source.GATEWAY, rules=rules):
            if rising:
                await self._command_landing()

    def _note_landing(self, before: FlyingState | None) -> None:
        """Record the initiator of the landing that begins or ends."""
        initiators, now = self._initiators, self._clock.monotonic()
        if before is None:
            self._note_return()
        if self.flying_state not in LANDING:
            initiators.on_landing_over(unsent=not self._landing_is_sent)
        elif initiators.landing is None:
            initiators.on_landing(
                now,
                plan_lands=self.mission.ending,
                pilot_may_land=self.drone.controller.present and not self.mission.lands_here,
                unseen=before is None,
            )

    def _note_return(self) -> None:
        """Record the initiator of the return that begins or ends."""
        now, home = self._clock.monotonic(), self.drone.home.state
        if not self.returning:
            stopped = home.rth == RthState.AVAILABLE and home.reason == ReturnReason.STOPPED
            self._initiators.on_return_over(now, stopped=stopped)
            return
        self._initiators.on_return(
            now,
            by_itself=home.returning_by_itself,
            by_plan=home.reason == ReturnReason.FLIGHTPLAN,
            skycontroller=self.drone.controller.present,
        )
