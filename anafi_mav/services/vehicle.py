"""The flight core: one drone as the vehicle that MAVLink's clients think they fly. No flavour, no message.

It knows what MAVLink has and an ANAFI has not (an armed state on the ground, a chosen mode, a take-off to a height)
and keeps it honest: mode and armed state follow the drone, a verb returns when the drone confirmed.
"""

from __future__ import annotations

import asyncio
import enum
import logging
import math
from collections.abc import Callable, Coroutine, Hashable
from dataclasses import dataclass, replace
from typing import Any

from anafi_mav import geo, units
from anafi_mav.clock import Clock
from anafi_mav.drone import Drone, Position
from anafi_mav.drone.events import (
    AlertLevel,
    AltitudeChanged,
    FlyingState,
    FlyingStateChanged,
    ForcedLandingReason,
    PilotingStyleStyle,
    PlayingState,
)
from anafi_mav.drone.moves import MoveEnd
from anafi_mav.errors import AnafiMavError, CommandRejected
from anafi_mav.services.fence_watch import FenceWatch, OutsideFence
from anafi_mav.services.follow_flight import FollowFlight
from anafi_mav.services.height import HeightReference
from anafi_mav.services.helm import Helm
from anafi_mav.services.link_loss import LossPolicy
from anafi_mav.services.manual_flight import ManualFlight
from anafi_mav.services.mission_flight import MissionFlight
from anafi_mav.services.modes import FlightMode
from anafi_mav.services.offboard_flight import OffboardFlight
from anafi_mav.services.place import Place as Place
from anafi_mav.services.rally import RallyPoints
from anafi_mav.services.refusal import Refused as Refused
from anafi_mav.services.statustext import Severity

logger = logging.getLogger(__name__)

AUTO_DISARM = 10.0
"""s that an armed vehicle waits for a take-off (as PX4's COM_DISARM_PRFLT)."""

ARM_WAIT = 10.0
"""s that a take-off waits for somebody to arm: QGroundControl sends take-off first and arms on its acceptance."""

CLIMB_WAIT = 15.0
"""s for the drone to hover after it took off, before the climb to the asked height is given up."""

ALTITUDE_WAIT = 3.0
"""s for the drone to tell its height, which it does five times a second."""

CLOSE_ENOUGH = 0.1
"""m from the height of a take-off that are no reason for a move."""

SLOWEST, FASTEST = 0.1, 100.0
"""m/s. A speed beyond these is a number in the wrong place, or in another unit. Within them the drone limits itself."""

NOWHERE = 1e-5
"""deg. A place that is so near to 0/0 is no place but numbers that were not set, or integers in the place of floats."""

LOWEST = 1.0
"""m above take-off: where an ANAFI hovers by itself after take-off. Lower targets are refused, never clamped."""

_ON_GROUND = (FlyingState.LANDED, FlyingState.EMERGENCY)
_TAKING_OFF = (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF, FlyingState.USERTAKEOFF)
_LANDING = (FlyingState.LANDING, FlyingState.EMERGENCY_LANDING)
_AIRBORNE = (FlyingState.HOVERING, FlyingState.FLYING)


class Landed(enum.Enum):
    """Where the vehicle is between ground and air."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Health(enum.Enum):
    """How the vehicle as a whole is."""

    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6


def _point(place: Place | None) -> tuple[float, float] | None:
    return None if place is None else place.point


@dataclass(frozen=True)
class Goto:
    """Where a guided move leads."""

    place: Place
    ato: float
    """m above take-off."""
    yaw: float | None
    """rad, clockwise from north; None keeps the heading."""
    speed: float | None
    """m/s over ground, of this move only; None: the vehicle's cruise speed."""
    mode: FlightMode
    """The mode that the vehicle is in on the way."""

    def at_height(self, ato: float) -> Goto:
        return replace(self, ato=ato)

    def with_heading(self, yaw: float) -> Goto:
        return replace(self, yaw=yaw)


class Vehicle:
    """One drone, flown. All methods run on the event loop's thread."""

    def __init__(
        self,
        drone: Drone,
        clock: Clock,
        *,
        allow_kill: bool,
        text: Callable[[Severity, str], None],
        changed: Callable[[], None],
        end_others: Callable[[], list[asyncio.Task[None]]],
    ) -> None:
        self.drone = drone
        self.height = HeightReference()
        self.takeoff_height = 2.5
        """m above take-off for a take-off that names no height (PX4's default of MIS_TAKEOFF_ALT)."""
        self.hand_launch = False
        """Arming starts the motors and waits for the drone to be thrown (a parameter; Parrot's UserTakeOff)."""
        self.cruise_speed: float | None = None
        """m/s over ground that moves keep to; None: the drone's own (MAV_CMD_DO_CHANGE_SPEED)."""
        self.climb_speed: float | None = None
        """m/s up and down that moves keep to; None: the drone's own."""
        self.gcs_loss = LossPolicy()
        """What to do when no ground station is heard any more (a parameter)."""
        self.origin: Place | None = None
        """Origin of the local frame: where the drone last took off, or first stood with a fix."""
        self.fence = FenceWatch()
        self.rally = RallyPoints()
        self.orders = 0
        """Counts who took the vehicle over."""
        self._goto: Goto | None = None
        self._arrived: tuple[Place, Position | None] | None = None
        """Where the last move ended well, and the drone's newest GPS location then."""
        self.intended: FlightMode | None = None
        """The mode that a client last asked for by name or number."""
        self._clock = clock
        self.allow_kill = allow_kill
        self.text = text
        self._changed = changed
        self._end_others = end_others
        self._selected = FlightMode.HOLD
        self._armed = False
        self._climbing = False
        self._pending_takeoff: tuple[float, Hashable] | None = None
        """Height of a take-off that waits for its client to arm, and the client."""
        self._terminating = False
        self._last_flying: FlyingState | None = None
        self._disarm_timer: asyncio.TimerHandle | None = None
        self._pending_timer: asyncio.TimerHandle | None = None
        self._background: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self.offboard = OffboardFlight(self, clock)
        self.manual = ManualFlight(self, clock)
        self.follow = FollowFlight(self, clock)
        self.mission = MissionFlight(self)
        self.plan_ids: dict[int, int] = {}
        """Opaque ids of the plans that are in force, by MAV_MISSION_TYPE."""
        self.helms: tuple[Helm, ...] = (self.offboard, self.manual, self.follow, self.mission)
        """Who can fly the drone for as long as somebody keeps telling them how; one of them at a time."""

    # What the vehicle is.

    @property
    def flying_state(self) -> FlyingState | None:
        """Parrot's word for it; None until reported."""
        return self.drone.piloting.state.flying

    @property
    def on_ground(self) -> bool:
        return self.flying_state in _ON_GROUND

    @property
    def in_air(self) -> bool:
        """Flying, and not on its way down or up by itself."""
        return self.flying_state in _AIRBORNE

    @property
    def armed(self) -> bool:
        """Motors may turn: the drone is off the ground, or arming was accepted and has not lapsed."""
        return self._armed or (self.flying_state is not None and not self.on_ground)

    @property
    def landed(self) -> Landed:
        state = self.flying_state
        if state == FlyingState.LANDED:
            return Landed.ON_GROUND
        if state in _TAKING_OFF:
            return Landed.TAKEOFF
        if state in _LANDING:
            return Landed.LANDING
        return Landed.IN_AIR if state in _AIRBORNE else Landed.UNKNOWN

    @property
    def returning(self) -> bool:
        """The drone flies home, whoever began it."""
        return self.drone.home.state.returning and not self.on_ground

    @property
    def returning_by_itself(self) -> bool:
        """Nobody asked for this return: battery, lost link, ... It is not ours to stop."""
        return self.drone.home.state.returning_by_itself and not self.on_ground

    @property
    def mode(self) -> FlightMode:
        """What the drone does now."""
        state = self.flying_state
        if state == FlyingState.EMERGENCY:
            return FlightMode.TERMINATED
        if state in _LANDING:
            return FlightMode.LAND
        if self.returning:
            return FlightMode.RETURN
        if state in _TAKING_OFF or (self._climbing and not self.on_ground):
            return FlightMode.MISSION if self.mission.flying else FlightMode.TAKEOFF
        if state in _AIRBORNE and self.drone.piloting.state.plan == PlayingState.PLAYING:
            return FlightMode.MISSION
        return self._selected

    @property
    def health(self) -> Health:
        state = self.flying_state
        if state == FlyingState.EMERGENCY:
            return Health.EMERGENCY
        forced = self.drone.alerts.state.forced_landing
        if (
            state == FlyingState.EMERGENCY_LANDING
            or forced not in (None, ForcedLandingReason.NONE)
            or self.drone.battery.state.worst_alert() == AlertLevel.CRITICAL
        ):
            return Health.CRITICAL
        return Health.ACTIVE if self.armed else Health.STANDBY

    @property
    def place(self) -> Place | None:
        """Where the drone is by its newest GPS location; None without a fix."""
        gps = self.drone.gps.state
        if not gps.fixed or gps.location is None:
            return None
        return Place(gps.location.latitude, gps.location.longitude)

    @property
    def home(self) -> Place | None:
        """Where a return ends: what the drone reports, before its first take-off where it stands."""
        home = self.drone.home.state.location
        if home is not None:
            return Place(home.latitude, home.longitude)
        return self.place if self.on_ground else None

    @property
    def sticks_follow_camera(self) -> bool:
        """What sticks mean depends on where the camera looks (piloting_style.xml): no loop closes over that."""
        return self.drone.piloting.state.style == PilotingStyleStyle.CAMERA_OPERATED

    @property
    def enterable_modes(self) -> frozenset[FlightMode]:
        """Modes that a client may ask for as things stand. Hold, Land and Return are always among them: whether the
        drone can, it says itself."""
        modes = {FlightMode.HOLD, FlightMode.GUIDED, FlightMode.POSITION, FlightMode.TAKEOFF}
        modes |= {FlightMode.LAND, FlightMode.RETURN, FlightMode.OFFBOARD}
        if self.place is not None:
            modes.add(FlightMode.FOLLOW)
        if self.mission.there:
            modes.add(FlightMode.MISSION)
        return frozenset(modes)

    def prearm_problems(self) -> list[str]:
        """Why the drone would not take off, in sentences; empty when it would."""
        problems: list[str] = []
        if self.flying_state is None:
            problems.append("the drone has not said whether it flies")
        if self.flying_state == FlyingState.EMERGENCY:
            problems.append("emergency stop")
        problems += self.drone.takeoff_blockers()
        if (problem := self.fence_problem) is not None:
            problems.append(problem)
        return problems

    @property
    def fence_problem(self) -> str | None:
        """Why the fence keeps the drone on the ground, in a sentence; None when it does not."""
        if self.on_ground:
            try:
                self.fence.check_place(_point(self.place), _point(self.home))
            except OutsideFence as error:
                return str(error)
        return None

    # What it can be told to do. Each returns when the drone confirmed, or raises.

    async def arm(self, client: Hashable = None) -> None:
        """Accept arming. An ANAFI has no such state: nothing turns until a take-off; it lapses after `AUTO_DISARM`.

        With `hand_launch` the motors do turn, and the drone flies as soon as it leaves the hand.

        A take-off that this client asked for begins now. Another client's does not: whoever arms to look at something
        must not find propellers turning.
        """
        if self.armed and not self.on_ground:
            return
        if problems := self.prearm_problems():
            raise Refused("PreArm: " + "; ".join(problems))
        if self.hand_launch:
            await self.take_over()
            await self.drone.piloting.hand_launch()
            return
        self._armed = True
        self._rearm_disarm_timer()
        self._changed()
        if self._pending_takeoff is not None and self._pending_takeoff[1] == client:
            height, _ = self._pending_takeoff
            self._forget_takeoff()
            self._start_background(self._take_off_and_report(height))
        else:
            self.mission.armed(client)

    async def disarm(self, *, force: bool) -> None:
        """Disarm on the ground. In the air only `force` with `allow_kill` does it: the motors stop, the drone falls."""
        if self.on_ground:
            await self.take_over()
            await self.drone.piloting.land()  # a take-off that is on its way to the drone must not follow
            if not self.on_ground:
                raise Refused("Disarm refused: the drone had just taken off, it lands")
            self._armed = False
            self._changed()
            return
        if self.flying_state == FlyingState.USERTAKEOFF:
            await self.take_over()
            await self.drone.piloting.cancel_hand_launch()
            return
        if not force:
            raise Refused("Disarm refused: the drone is in the air")
        await self.terminate()

    async def terminate(self) -> None:
        """Cut the motors, if the configuration allows it at all."""
        if not self.allow_kill:
            raise Refused(
                "Motor cut refused: the drone would fall. Set allow_kill: true to permit it",
                lasting=True,
                critical=True,
            )
        await self.take_over()
        self._terminating = True
        try:
            await self.drone.piloting.emergency()
        finally:
            self._terminating = False

    def check_height(self, ato: float) -> None:
        """Raise `Refused` unless a target height (m above take-off) is one the drone may go to."""
        ceiling = self.drone.piloting.state.max_altitude
        if not math.isfinite(ato):
            raise Refused("Refused: the height is not a number", lasting=True)
        if ato < LOWEST:
            raise Refused(f"Refused: {ato:.1f} m above take-off is below {LOWEST:g} m", lasting=True)
        if ceiling is not None and ato > ceiling.current:
            raise Refused(
                f"Refused: {ato:.1f} m above take-off is above the drone's ceiling of {ceiling.current:g} m",
                lasting=True,
            )
        try:
            self.fence.check_height(ato)
        except OutsideFence as error:
            raise Refused(f"Refused: {error}", lasting=True) from error

    def amsl_to_ato(self, amsl: float) -> float:
        """Height above take-off (m) of an AMSL height; raises `Refused` when no bridge is known."""
        ato = self.height.ato(amsl)
        if ato is None:
            raise Refused(
                "Refused: no GPS fix on the ground, so the take-off point's height above sea level is unknown"
            )
        return ato

    async def take_off(self, ato: float | None, client: Hashable = None) -> None:
        """Take off to `ato` m (None: `takeoff_height`). Returns when the drone confirmed that it takes off.

        Disarmed, it returns at once and the take-off waits `ARM_WAIT` for this client to arm.
        """
        height = self.takeoff_height if ato is None else ato
        self.check_height(height)
        if not self.on_ground:
            raise Refused("Takeoff refused: the drone is in the air")
        if problems := self.prearm_problems():
            raise Refused("PreArm: " + "; ".join(problems))
        if not self._armed:
            self._pending_takeoff = (height, client)
            self._set_timer("_pending_timer", ARM_WAIT, self._takeoff_lapsed)
            return
        await self.take_over()
        await self._begin_takeoff(height)

    async def land(self) -> None:
        """Land here. On the ground there is nothing to do."""
        await self.take_over()
        await self.drone.piloting.land()

    async def return_home(self) -> None:
        """Fly home by the drone's own return."""
        if self.on_ground:
            raise Refused("Return refused: the drone is on the ground")
        if self.flying_state in _LANDING:
            raise Refused("Return refused: the drone is landing")
        await self.take_over()
        await self.drone.piloting.return_home()

    async def hold(self, mode: FlightMode = FlightMode.HOLD) -> None:
        """Stop and hover, in mode Hold or Position."""
        if self.flying_state in _LANDING:
            raise Refused(f"{mode.value} refused: the drone is landing")
        if self.returning_by_itself:
            raise Refused(f"{mode.value} refused: the drone returns home by itself")
        if self.drone.piloting.about_to_fly:
            raise Refused(f"{mode.value} refused: the drone is about to take off")
        await self.take_over()
        if not self.on_ground:
            await self.drone.piloting.stop()
            # One asked for through somebody else, or before the link was lost. Raises when it is the drone's own.
            await self.drone.piloting.cancel_return_home()
            if self.flying_state in _LANDING:
                raise Refused(f"{mode.value} refused: the drone is landing")
        self.select(mode)

    async def reposition(
        self,
        place: Place | None,
        ato: float | None,
        yaw: float | None,
        speed: float | None = None,
        mode: FlightMode = FlightMode.HOLD,
    ) -> None:
        """Go to a place, height (m above take-off) and heading (rad); None keeps what is, a place that is being flown
        to too (as PX4 does). Returns when it moves.

        `speed` (m/s over ground) counts for this move only. `mode` is Hold or Guided.
        """
        if place is None and ato is None and yaw is None and speed is None:
            await self.hold(mode)
            return
        here, present = self.place, self.drone.piloting.state.altitude
        if here is None:
            raise Refused("Goto refused: no GPS fix")
        if ato is None:
            if present is None:
                raise Refused("Goto refused: the drone's height is not known")
            ato = present
        else:
            self.check_height(ato)
        kept = self._standing or here if self.goto is None else self.goto.place
        await self.go(Goto(place or kept, ato, yaw, speed, mode), checked=place is None)

    @property
    def _standing(self) -> Place | None:
        """Where the drone is by having arrived there, as long as its GPS location is from before: that comes once a
        second only, and to keep it would lead the drone back by some metres."""
        if self._arrived is None or self.drone.gps.state.location is not self._arrived[1]:
            return None
        return self._arrived[0]

    @property
    def goto(self) -> Goto | None:
        """Where the drone is on its way to by `go`; None when it is on no such way."""
        goto = self._goto
        on_the_way = goto is not None and self._selected is goto.mode and self.drone.piloting.move is not None
        return goto if on_the_way else None

    async def go(self, goto: Goto, *, checked: bool = False) -> None:
        """Fly to a place, or change how it is being flown to. Returns when the drone is on its way.

        `checked`: the place is where the drone is, which needs no leave.
        """
        if not self.in_air:
            raise Refused("Goto refused: the drone is not in the air")
        if not checked:
            self.check_place(goto.place, start=self.place)
        if self.returning_by_itself:
            raise Refused("Goto refused: the drone returns home by itself")
        await self.take_over()
        await self.drone.piloting.cancel_return_home()
        if not self.in_air or self.returning:  # no await from here to the moveTo
            raise Refused("Goto refused: the drone does something else now")
        self.select(goto.mode)
        before, self._goto = self._goto, goto
        try:
            await self.drone.piloting.move_to(
                goto.place.latitude,
                goto.place.longitude,
                goto.ato,
                heading_deg=None if goto.yaw is None else units.wrap_360(goto.yaw * units.DEG_PER_RAD),
                horizontal_speed=self.cruise_speed if goto.speed is None else goto.speed,
                vertical_speed=self.climb_speed,
            )
        except BaseException:
            self._goto = before  # a refused one must not be flown by the next change of height or speed
            raise
        if (move := self.drone.piloting.move) is not None:
            move.ended.add_done_callback(lambda ended: self._on_arrival(goto.place, ended))

    def _on_arrival(self, place: Place, ended: asyncio.Future[MoveEnd]) -> None:
        if not ended.cancelled() and ended.result() is MoveEnd.DONE:
            self._arrived = place, self.drone.gps.state.location

    async def turn(self, angle: float, rate_dps: float | None, mode: FlightMode) -> None:
        """Turn by `angle` (rad, clockwise +) where the drone hovers, at `rate_dps` (None: the drone's own).

        Returns when it has turned.
        """
        if not self.in_air:
            raise Refused("Turn refused: the drone is not in the air")
        if self.returning_by_itself:
            raise Refused("Turn refused: the drone returns home by itself")
        await self.take_over()
        await self.drone.piloting.stop()
        await self.drone.piloting.cancel_return_home()
        if not self.in_air or self.returning:
            raise Refused("Turn refused: the drone does something else now")
        self.select(mode)
        await self.drone.piloting.move_by(0.0, 0.0, 0.0, angle, turn_rate_dps=rate_dps)

    @staticmethod
    def check_on_earth(place: Place, what: str) -> None:
        """Raise `Refused` unless this is a place."""
        if not (abs(place.latitude) <= 90.0 and abs(place.longitude) <= 180.0):
            raise Refused(f"{what} refused: that is no place on earth", lasting=True)
        if abs(place.latitude) < NOWHERE and abs(place.longitude) < NOWHERE:
            raise Refused(f"{what} refused: latitude and longitude are both 0", lasting=True)

    def check_place(self, place: Place, *, start: Place | None = None) -> None:
        """Raise `Refused` unless the drone may fly there, and the straight way from `start` if that is given."""
        self.check_on_earth(place, "Goto")
        state, centre = self.drone.piloting.state, self.home
        if state.geofence and state.max_distance is not None and centre is not None:
            distance = geo.distance(centre.latitude, centre.longitude, place.latitude, place.longitude)
            if distance > state.max_distance.current:
                raise Refused(
                    f"Goto refused: {distance:.0f} m from home is beyond the drone's limit of "
                    f"{state.max_distance.current:g} m",
                    lasting=True,
                )

        try:
            self.fence.check_place(_point(place), _point(centre), _point(start))
        except OutsideFence as error:
            raise Refused(f"Goto refused: {error}", lasting=error.lasting) from error

    async def set_mode(self, mode: FlightMode, client: Hashable = None) -> None:
        """Whatever doing this mode means. `client` is who asks, for Offboard flies its setpoints."""
        self.intended = mode
        match mode:
            case FlightMode.HOLD | FlightMode.GUIDED | FlightMode.POSITION:
                await self.hold(mode)
            case FlightMode.LAND:
                await self.land()
            case FlightMode.RETURN:
                await self.return_home()
            case FlightMode.TAKEOFF:
                await self.take_off(None, client)
            case FlightMode.OFFBOARD:
                await self.offboard.engage(client)
            case FlightMode.MISSION:
                await self.mission.engage(client)
            case FlightMode.TERMINATED:
                await self.terminate()
            case FlightMode.FOLLOW:
                await self.follow.engage()
            case FlightMode.ORBIT:
                raise Refused("Orbit refused: it is begun by a command", lasting=True)

    # What the drone reports.

    def on_flying_state(self) -> None:
        """The drone's flying state changed."""
        state, before = self.flying_state, self._last_flying
        self._last_flying = state
        if state == before:
            return
        if state in _ON_GROUND and before is not None:
            self._armed = False
            self._forget_takeoff()
            self._end_helms(self._ending_mission)
            self._end_climb()
            self._selected = FlightMode.HOLD
        elif state in _LANDING:
            self._end_helms(self._ending_mission)
            self._end_climb()
        elif state in _TAKING_OFF and before in _ON_GROUND:
            self.height.take_off()
            if (place := self.place) is not None:
                self.origin = place
        if not self.on_ground:
            self._cancel_timer("_disarm_timer")
        self._changed()

    def on_position(self) -> None:
        """A new GPS location, altitude or flight id."""
        gps = self.drone.gps.state
        if self.flying_state == FlyingState.LANDED:
            self.height.on_ground(
                gps.location.altitude if gps.fixed and gps.location is not None else None,
                self.drone.piloting.state.altitude,
            )
            if self.origin is None:
                self.origin = self.place
        elif self.flying_state is not None:
            self.height.in_flight(self.drone.product.state.flight_id)

    def on_return(self) -> None:
        """The drone's return began, ended or changed: setpoints and the climb after a take-off never fight it."""
        if self.returning:
            self._end_helms(self._ending_mission)
            self._end_climb()
        self._changed()

    def link_down(self) -> None:
        """The link is lost: nothing that was asked for outlives it."""
        self.height.link_down(flying=not self.on_ground)
        self._let_go()
        self._armed = False
        self._selected = FlightMode.HOLD
        self.intended = None
        self._last_flying = None
        for helm in self.helms:
            helm.link_down()
        self._terminating = False
        for task in tuple(self._tasks):
            task.cancel()

    async def let_go(self) -> None:
        """The gateway ends: give up whatever is under way and leave a flying drone hovering on its own."""
        await self.take_over()
        if self.drone.piloting.about_to_fly:
            await self.drone.piloting.land()
        if not self.on_ground:
            await self.drone.piloting.stop()

    # Machinery.

    def select(self, mode: FlightMode, helm: Helm | None = None) -> None:
        """This is what the vehicle does from now on. Whoever flew it by setpoints or sticks ends, but for `helm`."""
        self._end_helms(helm)
        self._selected = mode
        self._changed()

    def _end_helms(self, helm: Helm | None = None) -> list[asyncio.Task[None]]:
        """Nobody flies by setpoints or sticks any more, but for `helm`; tasks that are about to end."""
        return [task for one in self.helms if one is not helm for task in one.end()]

    @property
    def _ending_mission(self) -> Helm | None:
        """The mission, where the landing or return that begins is its own."""
        return self.mission if self.mission.ending else None

    def forget_mode(self) -> None:
        """What was chosen is over: until something else is, the vehicle holds."""
        self._selected = FlightMode.HOLD

    def _end_climb(self) -> None:
        if self._climbing:
            self._cancel_background()

    async def take_over(self) -> None:
        """A new intention replaces whatever was going on, and waits until that has let go of the drone.

        Without the wait a move that is given up could cancel the one that follows it. Raises `Refused` while the
        motors are being cut.
        """
        if self._terminating:
            raise Refused("Refused: the motors are being cut")
        self.orders += 1
        ended = [*self._end_others(), *self._let_go()]
        if ended:
            await asyncio.wait(ended)

    def _let_go(self) -> list[asyncio.Task[None]]:
        """End what this vehicle does by itself; the tasks that are still about to end."""
        self._forget_takeoff()
        self._arrived = None
        return [*self._end_helms(), *self._cancel_background()]

    def _forget_takeoff(self) -> None:
        self._pending_takeoff = None
        self._cancel_timer("_pending_timer")

    def _takeoff_lapsed(self) -> None:
        self._forget_takeoff()
        self.text(Severity.WARNING, "Takeoff forgotten: nobody armed")

    def _cancel_background(self) -> list[asyncio.Task[None]]:
        task, self._background, self._climbing = self._background, None, False
        if task is None:
            return []
        task.cancel()
        return [task]

    def _start_background(self, work: Coroutine[Any, Any, None]) -> None:
        self._cancel_background()
        task = asyncio.get_running_loop().create_task(work)
        self._background = task
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _begin_takeoff(self, height: float) -> None:
        await self._lift_off()
        if self._selected is not FlightMode.GUIDED:
            self._selected = FlightMode.HOLD
        self._start_background(self._climb(height))

    async def _lift_off(self) -> None:
        """The drone's own take-off. Until it has succeeded or failed, the armed state does not lapse."""
        self._cancel_timer("_disarm_timer")
        try:
            await self.drone.piloting.take_off()
        finally:
            if self._armed and self.on_ground:
                self._rearm_disarm_timer()

    async def _take_off_and_report(self, height: float) -> None:
        """The take-off that waited for arming: its command was answered long ago, so failures are texts."""
        try:
            await self._lift_off()
        except AnafiMavError as error:
            self.text(Severity.ERROR, f"Takeoff failed: {error}")
            return
        await self._climb(height)

    async def _climb(self, height: float) -> None:
        """From the drone's own hover height to the asked one."""
        self._climbing = True
        self._changed()
        try:
            if not self.in_air:
                await self.drone.expect(FlyingStateChanged, lambda m: m.state in _AIRBORNE, CLIMB_WAIT)
            # What it told last is from while it rose.
            present = (await self.drone.expect(AltitudeChanged, timeout=ALTITUDE_WAIT)).altitude
            if not self.in_air or self.returning:
                raise CommandRejected("the drone does something else now")
            if abs(height - present) > CLOSE_ENOUGH:
                await self.drone.piloting.move_by(0.0, 0.0, present - height, 0.0)
        except AnafiMavError as error:
            self.text(Severity.ERROR, f"Climb to {height:g} m given up: {error}")
        finally:
            if self._background is asyncio.current_task():
                self._climbing, self._background = False, None
                self._changed()

    def _rearm_disarm_timer(self) -> None:
        self._set_timer("_disarm_timer", AUTO_DISARM, self._auto_disarm)

    def _auto_disarm(self) -> None:
        if self._armed and self.on_ground:
            self._armed = False
            self.text(Severity.INFO, "Disarmed: no take-off followed")
            self._changed()

    def _set_timer(self, name: str, delay: float, callback: Callable[[], None]) -> None:
        self._cancel_timer(name)
        setattr(self, name, asyncio.get_running_loop().call_later(delay, callback))

    def _cancel_timer(self, name: str) -> None:
        timer: asyncio.TimerHandle | None = getattr(self, name)
        if timer is not None:
            timer.cancel()
            setattr(self, name, None)
