"""The drone as seen by the modules that fly it: state, position and selected mode.

No flavour, no message.

These modules build on this layer. `Vehicle` stands above them: it is an `Aircraft` and knows all of them, while none
of them needs to know the others.
"""

from __future__ import annotations

import asyncio
import contextlib
from abc import abstractmethod
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from anafi_mav import texts
from anafi_mav.clock import Clock
from anafi_mav.drone import Drone
from anafi_mav.drone.events import AltitudeChanged, FlyingState, PilotingStyleStyle
from anafi_mav.errors import LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.control import Conditions, Control
from anafi_mav.vehicle.base.flight_task import Needs
from anafi_mav.vehicle.base.flying import AIRBORNE, ON_GROUND
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.height import HeightReference
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.move_heading import MoveHeading
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import By
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.roll_sign import RollCheck, RollSign
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.fence_watch import FenceWatch, OutsideFence
from anafi_mav.vehicle.fence.rally import RallyPoints

ALTITUDE_WAIT = 3.0
"""s for the drone to report its height, which it does five times a second."""

_ACTIVITIES: Mapping[FlyingState | None, OperatorText] = {
    FlyingState.LANDED: texts.ON_GROUND,
    FlyingState.MOTOR_RAMPING: texts.STARTS_MOTORS,
    FlyingState.USERTAKEOFF: texts.STARTS_MOTORS,
    FlyingState.TAKINGOFF: texts.TAKES_OFF,
    FlyingState.HOVERING: texts.HOVERS,
    FlyingState.FLYING: texts.FLIES,
    FlyingState.LANDING: texts.LANDS,
    FlyingState.EMERGENCY: texts.EMERGENCY_STOP,
    FlyingState.EMERGENCY_LANDING: texts.FORCED,
}


@dataclass(frozen=True)
class FlightSettings:
    """Values that clients set for all flights, by parameters and commands."""

    takeoff_height: float = 2.5
    """m above take-off for a take-off that names no height (PX4's default of MIS_TAKEOFF_ALT)."""
    hand_launch: bool = False
    """Arming starts the motors and waits for the drone to be thrown (Parrot's UserTakeOff)."""
    cruise_speed: float | None = None
    """m/s over ground that moves keep to; None: the drone's own."""
    climb_speed: float | None = None
    """m/s up and down that moves keep to; None: the drone's own."""
    move_heading: MoveHeading = MoveHeading.KEEP
    """Heading of moves whose command names none."""
    guided_timeout: float = 1.5
    """s that a velocity of ArduPilot's Guided lasts.

    dronekit's documents send one a second; ArduCopter's GUID_TIMEOUT is 3 s.
    """


@dataclass(frozen=True)
class CommandedSpeeds:
    """Speeds that a client has commanded for a flight; None: those of `FlightSettings`.

    By MAV_CMD_DO_CHANGE_SPEED.
    """

    cruise: float | None = None
    """m/s over ground."""
    climb: float | None = None
    """m/s up and down."""
    cruise_orders: int = 0
    """How often the speed over ground was commanded: an orbit or goto with a speed of its own obeys each of them."""


class Aircraft(Conditions):
    """One drone that can be flown. All methods run on the event loop's thread."""

    def __init__(
        self,
        drone: Drone,
        clock: Clock,
        *,
        text: Callable[[Severity, OperatorText], None],
        changed: Callable[[], None],
    ) -> None:
        self.drone = drone
        self.height = HeightReference()
        self.roll = RollCheck()
        """Verifies the sign of the roll that the drone reports, for the loops over velocity."""
        self.settings = FlightSettings()
        self.commanded_speeds = CommandedSpeeds()
        """For the present flight, on the ground for the next one."""
        self.fence = FenceWatch()
        self.rally = RallyPoints()
        self.home_choice = asyncio.Lock()
        """Lock held while the drone's home is chosen.

        A home is a type and a place: two choices at once would mix.
        """
        self.text = text
        self.changed = changed
        """Notifies that mode, armed state or health may have changed."""
        self.control = Control(self)
        self._clock = clock

    # What it is.

    @property
    def flying_state(self) -> FlyingState | None:
        """Parrot's flying state; None until reported."""
        return self.drone.piloting.settled.flying

    @property
    def cruise_speed(self) -> float | None:
        """Ground speed (m/s) that moves keep to; None: the drone's own."""
        commanded = self.commanded_speeds.cruise
        return self.settings.cruise_speed if commanded is None else commanded

    @property
    def climb_speed(self) -> float | None:
        """Vertical speed (m/s) that moves keep to; None: the drone's own."""
        commanded = self.commanded_speeds.climb
        return self.settings.climb_speed if commanded is None else commanded

    @property
    def on_ground(self) -> bool:
        return self.drone.piloting.settled.flying in ON_GROUND

    @property
    def in_air(self) -> bool:
        """True when flying, and neither taking off nor landing by itself."""
        return self.drone.piloting.settled.flying in AIRBORNE

    @property
    @abstractmethod
    def armed(self) -> bool:
        """True when motors may turn.

        The drone is off the ground, or arming was accepted and has not expired.
        """

    @abstractmethod
    def is_armed_by(self, client: Hashable) -> bool:
        """Return True when this client has armed the vehicle for the flight that begins now."""

    @abstractmethod
    def note_plan_landing(self) -> None:
        """Note that a plan has ended that lands the drone, which may report the landing later."""

    @property
    def returning(self) -> bool:
        """True while the drone flies home, whether a client, the pilot or the drone began it."""
        return self.drone.home.state.returning and self.drone.piloting.settled.flying not in ON_GROUND

    @property
    def returning_by_itself(self) -> bool:
        """True when the drone began this return by itself: battery, lost link, ...

        It is not the gateway's to stop.
        """
        return self.drone.home.state.returning_by_itself and not self.on_ground

    @property
    @abstractmethod
    def descent(self) -> OperatorText | None:
        """The reason to refuse a command that may not end a landing or return; None without either.

        The drone lands or returns, or was commanded to.
        """

    @property
    @abstractmethod
    def lands_uncommanded(self) -> bool:
        """True during a landing that, as far as known, neither a client nor the pilot has commanded."""

    @property
    @abstractmethod
    def mode(self) -> FlightMode:
        """The present flight mode of the drone."""

    @property
    @abstractmethod
    def origin(self) -> GeoPoint | None:
        """Origin of the local frame: where the drone last took off, or first stood with a fix."""

    @property
    @abstractmethod
    def position_is_old(self) -> bool:
        """True when GPS locations have stopped in flight although the drone reports a fix.

        It stays true after the landing, until the drone reports where it stands.
        """

    @property
    def place(self) -> GeoPoint | None:
        """Position of the drone; None without a fix, and while the newest location is old."""
        gps = self.drone.gps.state
        if not gps.fixed or gps.location is None or self.position_is_old:
            return None
        return GeoPoint(gps.location.latitude, gps.location.longitude)

    @property
    @abstractmethod
    def stopping_place(self) -> GeoPoint | None:
        """Place at which the drone comes to rest when it brakes now; None without a position."""

    @property
    def home(self) -> GeoPoint | None:
        """Place at which a return ends, as the drone reports it.

        Without a report and on the ground it is the drone's position; None without either.
        """
        home = self.drone.home.state.location
        if home is not None:
            return GeoPoint(home.latitude, home.longitude)
        return self.place if self.on_ground else None

    @contextlib.contextmanager
    def changing_fence(self) -> Iterator[None]:
        """Change settings of the fence; a text reports when no boundary of it is in force any more."""
        was_in_force = self.fence.in_force
        yield
        if was_in_force and not self.fence.in_force:
            self.text(Severity.WARNING, texts.FENCE_OFF)

    @property
    def fence_home(self) -> GeoPoint | None:
        """Centre of fence circles around home: a rally point in use does not move them."""
        state, is_rally = self.drone.home.state, self.rally.is_home
        home = state.takeoff_location if is_rally else state.location
        if home is None:
            return self.origin if is_rally else self.home
        return GeoPoint(home.latitude, home.longitude)

    @property
    def geofence_centre(self) -> GeoPoint | None:
        """Centre of the drone's own geofence: a controller's GPS, else the take-off point.

        Source: ardrone3.xml 1-2-4. On the ground without such a controller it is the drone's position: the drone
        still reports that of its last flight.
        """
        reported, takeoff = self.drone.piloting.state.geofence_centre, self.drone.home.state.takeoff_location
        if self.on_ground and self.drone.controller.state.position is None:
            return self.place
        if reported is not None:
            return GeoPoint(*reported)
        return self.origin if takeoff is None else GeoPoint(takeoff.latitude, takeoff.longitude)

    @property
    def activity(self) -> OperatorText:
        """Activity of the drone, as the reason of a refusal."""
        if self.returning:
            return texts.RETURNS
        return _ACTIVITIES.get(self.flying_state, texts.FLYING_STATE_UNKNOWN)

    @property
    def sticks_follow_camera(self) -> bool:
        """True when stick input is relative to the camera's direction (piloting_style.xml).

        No control loop works with that.
        """
        return self.drone.piloting.state.style == PilotingStyleStyle.CAMERA_OPERATED

    def lacking(self, needs: Needs) -> OperatorText | None:
        has_descent, rows = _rows_of(needs)
        if has_descent and (descent := self.descent) is not None:
            return descent
        for is_unmet, reason in rows:
            if is_unmet(self):
                return reason
        return None

    def prearm_problems(self) -> list[OperatorText]:
        """Return the reasons why the drone would not take off, in sentences; empty without any."""
        problems: list[OperatorText] = []
        state = self.flying_state
        if state is None:
            problems.append(texts.FLYING_STATE_UNKNOWN)
        if state == FlyingState.EMERGENCY:
            problems.append(texts.EMERGENCY_STOP)
        problems += map(texts.from_below, self.drone.takeoff_blockers())
        if (problem := self.fence_problem) is not None:
            problems.append(problem)
        return problems

    def require_ready(self) -> None:
        """Raise `Refused` with the reasons why the drone would not take off."""
        if problems := self.prearm_problems():
            raise Refused(texts.ARMING, texts.joined(problems), form=texts.PREARM)

    @property
    def fence_problem(self) -> OperatorText | None:
        """The reason why the fence keeps the drone on the ground, in a sentence; None without one."""
        if self.fence.fence.zones and self.on_ground:
            try:
                self.fence.check_place(self.place, self.fence_home)
            except OutsideFence as error:
                return error.reason
        return None

    # What all flight tasks need.

    def right(self, client: Hashable, extent: Extent, *, counted: bool = True) -> Right:
        """Return the right that a message of this client gives, which arrives now."""
        return Right(client, extent, self.drone.controller.takeovers, self._clock.monotonic(), counted)

    def centre_sticks(self) -> None:
        """Centre the sticks; without a link none are held."""
        with contextlib.suppress(LinkLost):
            self.drone.piloting.pilot(None)

    async def next_height(self) -> float:
        """Return the height (m above take-off) that the drone reports next.

        The last report may be from while it rose or sank. Raises `CommandTimeout`.
        """
        return (await self.drone.expect(AltitudeChanged, timeout=ALTITUDE_WAIT)).altitude

    def hover(self) -> None:
        """End every motion of ours; without a link the drone does that by itself."""
        with contextlib.suppress(LinkLost):
            self.drone.piloting.hover()

    # Each verb returns when the drone confirmed, or raises.

    @abstractmethod
    async def hold(self, mode: FlightMode, by: By) -> None:
        """Stop and hover, in mode Hold, Guided or Position.

        A landing or return continues unless `by` may end it.
        """

    @abstractmethod
    def note_landing_command(self) -> None:
        """Note that a landing is about to be sent: it is a client's, not the drone's own."""

    @abstractmethod
    async def terminate(self, by: By) -> None:
        """Cut the motors, if the configuration allows it at all."""


_UNMET: tuple[tuple[Needs, Callable[[Aircraft], bool], OperatorText], ...] = (
    (Needs.STANDS, lambda aircraft: aircraft.flying_state is FlyingState.EMERGENCY, texts.EMERGENCY_STOP),
    (
        Needs.STANDS,
        lambda aircraft: not aircraft.on_ground or aircraft.drone.piloting.about_to_fly,
        texts.NOT_ON_GROUND,
    ),
    (Needs.IN_AIR, lambda aircraft: not aircraft.in_air, texts.NOT_IN_AIR),
    (Needs.FIX, lambda aircraft: aircraft.place is None, texts.NO_FIX),
    (Needs.NO_PILOT, lambda aircraft: aircraft.drone.controller.pilot_acquired_control, texts.PILOT),
    (Needs.LIMITS, lambda aircraft: aircraft.drone.piloting.limits is None, texts.TILT_UNKNOWN),
    (Needs.PLAIN_STICKS, lambda aircraft: aircraft.sticks_follow_camera, texts.STICKS_FOLLOW_CAMERA),
    (Needs.ROLL_SIGN, lambda aircraft: aircraft.roll.sign is RollSign.INVERTED, texts.ROLL_INVERTED),
)
"""When a need is not met, and the reason of a refusal then, in the order in which they are checked."""


@cache
def _rows_of(needs: Needs) -> tuple[bool, Sequence[tuple[Callable[[Aircraft], bool], OperatorText]]]:
    """Return True when a descent counts, and the rows of the other needs.

    Stored, because each setpoint of a stream is checked.
    """
    return Needs.NO_DESCENT in needs, [(is_unmet, reason) for need, is_unmet, reason in _UNMET if need in needs]
