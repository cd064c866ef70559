"""The flight core: one drone as the vehicle that MAVLink's clients think they fly. No flavour, no message.

It knows what MAVLink has and an ANAFI has not (an armed state, a chosen mode) and keeps it honest: both follow what the
drone does, and a verb returns when the drone confirmed. Whatever is to fly the drone takes it over here. How it gets
into the air is `takeoff`, how to a place `guided_flight`; who keeps telling it how to fly is a `Helm`.
"""

from __future__ import annotations

import asyncio
import enum
import math
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager

from anafi_mav.clock import Clock
from anafi_mav.drone import Drone
from anafi_mav.drone.element import Position
from anafi_mav.drone.events import AlertLevel, FlyingState, ForcedLandingReason, PlayingState, RthHomeType
from anafi_mav.services.aircraft import Aircraft
from anafi_mav.services.clients import system_of
from anafi_mav.services.flying import AIRBORNE, LANDING, ON_GROUND, TAKING_OFF
from anafi_mav.services.follow_flight import FollowFlight
from anafi_mav.services.guided_flight import GuidedFlight
from anafi_mav.services.height import ESTIMATE_ERROR, TakeoffRecord
from anafi_mav.services.helm import Helm
from anafi_mav.services.link_loss import LossPolicy
from anafi_mav.services.manual_flight import ManualFlight
from anafi_mav.services.mission_flight import MissionFlight
from anafi_mav.services.modes import FlightMode
from anafi_mav.services.offboard_flight import OffboardFlight
from anafi_mav.services.place import Place
from anafi_mav.services.rally import RallyPoints
from anafi_mav.services.refusal import Refused
from anafi_mav.services.return_end import ReturnEnd
from anafi_mav.services.statustext import Severity
from anafi_mav.services.takeoff import Takeoff

POSITION_OLD = 3.0
"""s without a GPS location, which an ANAFI reports once a second, after which the last one is no position in flight."""


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


class Vehicle(Aircraft):
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
        super().__init__(drone, text=text, changed=changed)
        self.gcs_loss = LossPolicy()
        """What to do when no ground station is heard any more (a parameter)."""
        self.rally = RallyPoints()
        self.orders = 0
        """Counts who took the vehicle over, and what ended all orders: the ground, the loss of the link."""
        self.intended: FlightMode | None = None
        """The mode that a client last asked for by name or number."""
        self.allow_kill = allow_kill
        self._clock = clock
        self._located_at = -math.inf
        """When the newest GPS location arrived."""
        self._end_others = end_others
        self._terminating = False
        self._last_flying: FlyingState | None = None
        self.return_end = ReturnEnd(self)
        self._takeoff_before: Position | None = None
        """The take-off place that the drone reported when it landed: of the flight that has ended."""
        self.mission = MissionFlight(self)
        self.takeoff = Takeoff(self, self.mission.armed)
        self.guided = GuidedFlight(self)
        self.offboard = OffboardFlight(self, clock)
        self.manual = ManualFlight(self, clock)
        self.follow = FollowFlight(self, lambda: self.offboard.motion, clock)
        self.plan_ids: dict[int, int] = {}
        """Opaque ids of the plans that are in force, by MAV_MISSION_TYPE."""
        self.helms = (self.offboard, self.manual, self.follow, self.mission)

    # What the vehicle is.

    @property
    def armed(self) -> bool:
        return self.takeoff.armed or (self.flying_state is not None and not self.on_ground)

    @property
    def landed(self) -> Landed:
        state = self.flying_state
        if state == FlyingState.LANDED:
            return Landed.ON_GROUND
        if state in TAKING_OFF:
            return Landed.TAKEOFF
        if state in LANDING:
            return Landed.LANDING
        return Landed.IN_AIR if state in AIRBORNE else Landed.UNKNOWN

    @property
    def position_is_old(self) -> bool:
        """True in flight when GPS locations have stopped although the drone reports a fix."""
        return (
            self.place is not None
            and self.flying_state is not None
            and not self.on_ground
            and self._clock.monotonic() - self._located_at > POSITION_OLD
        )

    @property
    def mode(self) -> FlightMode:
        state = self.flying_state
        if state == FlyingState.EMERGENCY:
            return FlightMode.TERMINATED
        if self.return_end.shown:
            return FlightMode.RETURN
        if state in LANDING:
            return FlightMode.LAND
        if self.returning:
            return FlightMode.RETURN
        if state in TAKING_OFF or (self.takeoff.climbing and not self.on_ground):
            return FlightMode.MISSION if self.mission.flying else FlightMode.TAKEOFF
        if state in AIRBORNE and self.drone.piloting.state.plan == PlayingState.PLAYING:
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

    # What it can be told to do. Each returns when the drone confirmed, or raises.

    async def terminate(self) -> None:
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

    async def land(self) -> None:
        """Land here. On the ground there is nothing to do."""
        await self.take_over()
        with self._selected_no_more(None):
            await self.drone.piloting.land()

    async def return_home(self, client: Hashable = None) -> None:
        """Fly home by the drone's own return, and land there as `return_end` says. `client` is None for the gateway."""
        if self.on_ground:
            raise Refused("Return refused: the drone is on the ground")
        if self.flying_state in LANDING:
            raise Refused("Return refused: the drone is landing")
        await self.take_over()
        attempt = self.return_end.command()
        try:
            with self._selected_no_more(None):
                await self.drone.piloting.return_home()
        except BaseException:
            self.return_end.fail(attempt)
            raise
        self.return_end.announce(attempt, system_of(client))

    async def hold(self, mode: FlightMode = FlightMode.HOLD) -> None:
        if self.flying_state in LANDING:
            raise Refused(f"{mode.value} refused: the drone is landing")
        if self.returning_by_itself:
            raise Refused(f"{mode.value} refused: the drone returns home by itself")
        if self.drone.piloting.about_to_fly:
            raise Refused(f"{mode.value} refused: the drone is about to take off")
        await self.take_over()
        if not self.on_ground:
            with self._selected_no_more(mode):
                await self.drone.piloting.stop()
                # One asked for through somebody else, or before the link was lost. Raises when it is the drone's own.
                await self.drone.piloting.cancel_return_home()
                if self.flying_state in LANDING:
                    raise Refused(f"{mode.value} refused: the drone is landing")
        self.select(mode)

    async def set_mode(self, mode: FlightMode, client: Hashable = None) -> None:
        """Whatever doing this mode means. `client` is who asks, for Offboard flies its setpoints."""
        self.intended = mode
        match mode:
            case FlightMode.HOLD | FlightMode.GUIDED | FlightMode.POSITION:
                await self.hold(mode)
            case FlightMode.LAND:
                await self.land()
            case FlightMode.RETURN:
                await self.return_home(client)
            case FlightMode.TAKEOFF:
                await self.takeoff.begin(None, client)
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
        if state in ON_GROUND and before is not None:
            self.orders += 1
            self.return_end.on_ground()
            self.takeoff.came_down()
            self.end_helms(self._ending_mission)
            self.takeoff.end_climb()
            self._selected = FlightMode.HOLD
        elif state in LANDING:
            self.end_helms(self._ending_mission)
            self.takeoff.end_climb()
        elif state in TAKING_OFF and before in ON_GROUND:
            self.height.take_off()
            if (place := self.place) is not None:
                self.origin = place
            if self.drone.home.state.takeoff_location != self._takeoff_before:
                self.on_takeoff_location()  # it was reported before the state
        if state in ON_GROUND:
            self._takeoff_before = self.drone.home.state.takeoff_location
        if not self.on_ground:
            self.takeoff.left_ground()
        self.return_end.on_flying_state()
        self.changed()

    def on_location(self) -> None:
        """A new GPS location."""
        self._located_at = self._clock.monotonic()
        self.on_position()

    def on_position(self) -> None:
        """A new GPS location, altitude or flight id."""
        gps, ato = self.drone.gps.state, self.drone.piloting.state.altitude
        amsl = gps.location.altitude if gps.fixed and gps.location is not None else None
        if self.flying_state == FlyingState.LANDED:
            self.height.on_ground(amsl, ato)
            if self.origin is None:
                self.origin = self.place
        elif self.flying_state is not None and self.height.in_flight(self.drone.product.state.flight_id, amsl, ato):
            self.text(Severity.WARNING, f"Take-off altitude estimated: GPS only (+-{ESTIMATE_ERROR:g} m)")

    def on_takeoff_location(self) -> None:
        """Adopt the take-off place that the drone reports for the present flight as origin of the local frame."""
        location = self.drone.home.state.takeoff_location
        if location is not None and self.flying_state is not None and not self.on_ground:
            self.origin = Place(location.latitude, location.longitude)

    def link_up(self, kept: TakeoffRecord | None) -> None:
        """Begin with a drone that has reported all its states. `kept` is of the last flight that was seen."""
        self.height.recall(kept)
        self.on_flying_state()
        self.on_position()
        if self.flying_state is not None and not self.on_ground:
            self.origin = self._origin_in_flight(kept)

    def _origin_in_flight(self, kept: TakeoffRecord | None) -> Place | None:
        """Return where a drone took off that was found in the air; None when nothing reports it."""
        home, flight = self.drone.home.state, self.drone.product.state.flight_id
        if (location := home.takeoff_location) is not None:
            return Place(location.latitude, location.longitude)
        if kept is not None and kept.flight_id == flight and kept.latitude is not None and kept.longitude is not None:
            return Place(kept.latitude, kept.longitude)
        if home.type == RthHomeType.TAKEOFF and home.location is not None:
            return Place(home.location.latitude, home.location.longitude)
        return None

    @property
    def takeoff_record(self) -> TakeoffRecord | None:
        """The take-off point of the present flight, to be kept; None on the ground or without a flight id."""
        height, origin = self.height, self.origin
        if self.on_ground or not height.flight_id or height.takeoff_amsl is None:
            return None
        place = (None, None) if origin is None else origin.point
        return TakeoffRecord(height.flight_id, height.takeoff_amsl, height.estimated, *place)

    def on_return(self) -> None:
        """The drone's return began, ended or changed: setpoints and the climb after a take-off never fight it."""
        if self.returning:
            if self.mission.returns and not (self.returning_by_itself or self.return_end.active):
                self.return_end.announce(self.return_end.command(), None)  # the mission's last item
            self.end_helms(self._ending_mission)
            self.takeoff.end_climb()
        self.return_end.on_return_state()
        self.changed()

    def link_down(self) -> None:
        """The link is lost: nothing that was asked for outlives it."""
        self.height.link_down()
        self.orders += 1
        self.return_end.link_down()
        self._let_go()
        self.takeoff.link_down()
        self._selected = FlightMode.HOLD
        self.intended = None
        self._last_flying = None
        self._located_at = -math.inf
        for helm in self.helms:
            helm.link_down()
        self._terminating = False

    @property
    def ends_alone(self) -> bool:
        """A return or a landing is commanded or under way, which the drone ends without the gateway."""
        return self.returning or self.return_end.sent or self.flying_state in LANDING

    @property
    def alone(self) -> str | None:
        """The end of a return or landing without the gateway, as a predicate of the drone; None: neither is on."""
        if self.flying_state in LANDING:
            return "is landing, and goes on landing"
        return self.return_end.alone if self.ends_alone else None

    async def let_go(self) -> None:
        """The gateway ends: leave a flying drone hovering. A return or a landing goes on, whoever began it."""
        if self.ends_alone:
            self.return_end.end()
            return
        await self.take_over()
        if self.drone.piloting.about_to_fly:
            await self.drone.piloting.land()
        if not self.on_ground:
            await self.drone.piloting.stop()

    # Machinery.

    @contextmanager
    def _selected_no_more(self, wanted: FlightMode | None) -> Iterator[None]:
        """The mode that was chosen is over but for `wanted`, before the drone shows what it is told in the block: a
        setpoint or stick of that mode that comes meanwhile is not a newer order. On the ground there is none to stop.

        What the drone does not do leaves all as it was.
        """
        before, orders = self._selected, self.orders
        if before is not wanted and not self.on_ground:
            self.forget_mode()
        try:
            yield
        except BaseException:
            if self.orders == orders:
                self._selected = before
            raise

    @property
    def _ending_mission(self) -> Helm | None:
        """The mission, where the landing or return that begins is its own."""
        return self.mission if self.mission.ending else None

    async def take_over(self) -> None:
        if self._terminating:
            raise Refused("Refused: the motors are being cut")
        self.orders += 1
        ended = [*self._end_others(), *self._let_go()]
        if ended:
            await asyncio.wait(ended)

    def _let_go(self) -> list[asyncio.Task[None]]:
        """End what this vehicle does by itself; the tasks that are still about to end."""
        self.takeoff.forget()
        self.guided.forget_arrival()
        return [*self.return_end.end(), *self.end_helms(), *self.takeoff.end()]
