"""Home location and return home: climb, cruise, descend, then hover or land.

Feature rth and its ardrone3 aliases. Home is set at take-off, if there is a GPS fix, or with the first fix in the
air; before that every location is reported as 500. The home that the user prefers is used when it is available,
else the take-off place (rth.xml, home_type). State changes are sent as rth.state and as NavigateHomeStateChanged,
as the aircraft does.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from typing import NamedTuple

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.rth import RthEndingBehavior, RthHomeType, RthState, StateReason
from anafi_mav.sim.features.settings import HOME_TYPES, DroneSettings
from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.faults import Faults
from anafi_mav.sim.world.motion import Pose, Turn
from anafi_mav.sim.world.place import WorldOrigin
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.units import RAD_PER_DEG

UNKNOWN = 500.0
"""Latitude, longitude and altitude of a place that is not known."""

SPEED = 8.0
"""m/s on the way home. Assumed."""
CLIMB_SPEED = 3.0
"""m/s up to the return height and down again. Assumed."""
TURN_SPEED = 60.0 * RAD_PER_DEG
"""rad/s to face home. Assumed."""

_TOO_NEAR_TO_TURN = 1.0
"""m from home below which the nose stays where it is."""


class HomePosition(NamedTuple):
    """deg, deg, m above take-off."""

    latitude: float
    longitude: float
    altitude: float


class ReturnPhase(enum.Enum):
    IDLE = "idle"
    PENDING = "waiting to hover"
    CLIMB = "climbing to the return height"
    CRUISE = "flying home"
    DESCEND = "descending at home"


class Homing:
    """Home and the return. `emit` takes the events, `body` does the flying."""

    def __init__(
        self,
        body: Airframe,
        origin: WorldOrigin,
        settings: DroneSettings,
        emit: Callable[[Message], None],
        faults: Faults,
    ) -> None:
        self._body = body
        self._faults = faults
        self._origin = origin
        self._settings = settings
        self._emit = emit
        self.phase = ReturnPhase.IDLE
        self.takeoff: HomePosition | None = None
        self.fixed_before_takeoff = False
        self.custom: HomePosition | None = None
        self.pilot: HomePosition | None = None
        self._fix = False
        self._height = 0.0
        self._state = (RthState.UNAVAILABLE, StateReason.DISABLED)

    # -- places

    @property
    def type(self) -> RthHomeType:
        """Which place is home now."""
        if not self._fix:
            return RthHomeType.NONE
        preferred: RthHomeType = self._settings["home_type"]
        known = {RthHomeType.CUSTOM: self.custom, RthHomeType.PILOT: self.pilot}.get(preferred)
        return RthHomeType.TAKEOFF if known is None else preferred

    @property
    def home(self) -> HomePosition | None:
        """The place a return would go to; None: not known."""
        places = {RthHomeType.CUSTOM: self.custom, RthHomeType.PILOT: self.pilot}
        return places.get(self.type, self.takeoff)

    @property
    def geofence_centre(self) -> tuple[float, float] | None:
        """deg, deg: the controller's place, if not known the take-off's (ardrone3.xml 1-2-4)."""
        centre = self.takeoff if self.pilot is None else self.pilot
        return None if centre is None else centre[:2]

    @property
    def home_offset(self) -> tuple[float, float] | None:
        """Return home as (north, east) in the simulator's plane, m.

        Returns None without a home and while the drone has no fix.
        """
        home = self.home
        return None if home is None or not self._fix else self._origin.offset(home.latitude, home.longitude)

    def took_off(self, pose: Pose, fix: bool, *, in_flight: bool = False) -> None:
        """Home is here, if the drone knows where here is."""
        self.takeoff = self._here(pose) if fix else None
        self.fixed_before_takeoff = not in_flight
        for message in self._places():
            self._emit(message)

    def set_custom(self, latitude: float, longitude: float, altitude: float, pose: Pose) -> None:
        """Handle rth.set_custom_location.

        The location is accepted when the drone has a fix and the location is within MaxDistance of it.
        """
        if self._fix and _somewhere(latitude, longitude, altitude):
            north, east = self._origin.offset(latitude, longitude)
            reach = self._settings.number("max_distance")
            if (north - pose.north) ** 2 + (east - pose.east) ** 2 <= reach**2:
                self.custom = HomePosition(latitude, longitude, altitude)
        self._emit(rth.HomeType(self.type))
        self._emit(rth.CustomLocation(*(self.custom or (UNKNOWN, UNKNOWN, UNKNOWN))))
        self._emit(self._home_changed())

    def set_pilot(self, latitude: float, longitude: float, altitude: float) -> None:
        """GPSSettings.SendControllerGPS. What is no place is not heard."""
        if not _somewhere(latitude, longitude, altitude):
            return
        before, self.pilot = self.geofence_centre, HomePosition(latitude, longitude, altitude)
        self._emit(ardrone3.GPSFixStateChanged(int(self._fix)))
        if self.geofence_centre != before:
            self._emit(ardrone3.GeofenceCenterChanged(*self.pilot[:2]))
        self._emit(ardrone3.HomeTypeAvailabilityChanged(ardrone3.AvailableHomeType.PILOT, 1))
        if self.type is RthHomeType.PILOT:
            self.preference_changed()

    def preference_changed(self) -> None:
        """The preferred home type was set, or the place that it stands for."""
        self._emit(rth.HomeType(self.type))
        self._emit(ardrone3.HomeTypeChosenChanged(_chosen(self.type)))
        self._emit(self._home_changed())

    def _here(self, pose: Pose) -> HomePosition:
        return HomePosition(*self._origin.place(pose.north, pose.east), pose.up)

    def _home_changed(self) -> Message:
        return ardrone3.HomeChanged(*(self.home or (UNKNOWN, UNKNOWN, UNKNOWN)))

    def _places(self) -> list[Message]:
        messages: list[Message] = [self._home_changed()]
        if self.takeoff is not None:
            messages.append(rth.TakeoffLocation(*self.takeoff, int(self.fixed_before_takeoff)))
        if (centre := self.geofence_centre) is not None:
            messages.append(ardrone3.GeofenceCenterChanged(*centre))
        return messages

    def settings_report(self) -> list[Message]:
        """Return the home messages of the AllSettings answer."""
        return [self._home_changed()]

    def states_report(self) -> list[Message]:
        """Return the messages of home and the return in the AllStates answer."""
        capabilities = sum(1 << type for type in HOME_TYPES)
        available = {
            ardrone3.AvailableHomeType.TAKEOFF: self._fix,
            ardrone3.AvailableHomeType.PILOT: self.pilot is not None,
            ardrone3.AvailableHomeType.FIRST_FIX: False,
            ardrone3.AvailableHomeType.FOLLOWEE: False,
        }
        messages: list[Message] = [
            rth.HomeTypeCapabilities(capabilities),
            rth.HomeType(self.type),
            rth.CustomLocation(*(self.custom or (UNKNOWN, UNKNOWN, UNKNOWN))),
            *(ardrone3.HomeTypeAvailabilityChanged(type, int(there)) for type, there in available.items()),
            ardrone3.HomeTypeChosenChanged(_chosen(self.type)),
        ]
        return messages + self._places()[1:] + self._state_messages()

    # -- the return

    @property
    def active(self) -> bool:
        """A return flies the drone (it may still be waiting to begin: see `flying`)."""
        return self.phase is not ReturnPhase.IDLE

    @property
    def flying(self) -> bool:
        """A return has taken the sticks."""
        return self.phase not in (ReturnPhase.IDLE, ReturnPhase.PENDING)

    @property
    def reason(self) -> StateReason:
        """Why it is in its present state."""
        return self._state[1]

    def _state_messages(self) -> list[Message]:
        state, reason = self._state
        legacy = ardrone3.NavigateHomeReason(min(int(reason), ardrone3.NavigateHomeReason.ICING))
        return [
            rth.State(state, reason),
            ardrone3.NavigateHomeStateChanged(ardrone3.NavigateHomeState(int(state)), legacy),
        ]

    def _set(self, state: RthState, reason: StateReason) -> None:
        self._state = (state, reason)
        for message in self._state_messages():
            self._emit(message)

    def sensors(self, fix: bool, magneto: bool) -> None:
        """A return needs a GPS fix and a calibrated magnetometer; without them one that runs ends."""
        if fix != self._fix:
            self._fix = fix
            self._emit(rth.HomeType(self.type))
        if not (fix and magneto):
            if self._state[0] is not RthState.UNAVAILABLE:
                self._stop_body()
                self._set(RthState.UNAVAILABLE, StateReason.DISABLED)
        elif self._state[0] is RthState.UNAVAILABLE:
            self._set(RthState.AVAILABLE, StateReason.ENABLED)

    def request(self, reason: StateReason, pose: Pose, hovering: bool) -> bool:
        """Go home, at once or as soon as the drone hovers; False when there is no way."""
        if self._state[0] is RthState.UNAVAILABLE or self.home is None:
            return False
        if self.flying:
            self._set(RthState.IN_PROGRESS, reason)
            return True
        self.phase = ReturnPhase.PENDING
        # No input is flown while the battery decides.
        if hovering or reason is StateReason.LOW_BATTERY:
            self._begin(reason, pose)
        else:
            self._set(RthState.PENDING, reason)
        return True

    def abort(self) -> None:
        """Abort the return: rth.abort, NavigateHome(0), or a flight task of higher priority.

        Reports nothing when no return is active.
        """
        if self.active:
            self._stop_body()
            self._set(RthState.AVAILABLE, StateReason.STOPPED)

    def _stop_body(self) -> None:
        if self.flying:
            self._body.hover()
        self.phase = ReturnPhase.IDLE

    def _begin(self, reason: StateReason, pose: Pose) -> None:
        self._set(RthState.IN_PROGRESS, reason)
        ceiling = self._settings.number("max_altitude")
        self._height = max(pose.up, min(self._settings.number("rth_min_altitude"), ceiling))
        self.phase = ReturnPhase.CLIMB
        self._go(pose.north, pose.east, self._height)

    def tick(self, pose: Pose, arrived: bool, hovering: bool) -> RthEndingBehavior | None:
        """Go on with the return; at its end what is to be done there."""
        if self.phase is ReturnPhase.PENDING:
            if hovering:
                self._begin(self._state[1], pose)
        elif self.phase is not ReturnPhase.IDLE and arrived:
            return self._next_phase(pose)
        return None

    def _next_phase(self, pose: Pose) -> RthEndingBehavior | None:
        home = self.home
        if home is None:
            self.abort()
            return None
        north, east = self._origin.offset(home.latitude, home.longitude)
        if self.phase is ReturnPhase.CLIMB:
            self.phase = ReturnPhase.CRUISE
            self._go(north, east, self._height, face=_far(pose, north, east))
        elif self.phase is ReturnPhase.CRUISE:
            self.phase = ReturnPhase.DESCEND
            ground = home.altitude if Quirk.RETURN_ENDS_ABOVE_HOME in self._faults.quirks else 0.0
            self._go(north, east, min(ground + self._settings.number("rth_hovering_altitude"), self._height))
        else:
            self._stop_body()
            if Quirk.RTH_FINISHED_MISSING in self._faults.quirks:
                self._state = (RthState.AVAILABLE, StateReason.ENABLED)
            else:
                self._set(RthState.AVAILABLE, StateReason.FINISHED)
            ending: RthEndingBehavior = self._settings["rth_ending"]
            return ending
        return None

    def _go(self, north: float, east: float, up: float, face: float | None = None) -> None:
        self._body.move(
            north,
            east,
            up,
            yaw=None if face is None else self._body.nearest(face),
            turn=Turn.FIRST,
            speed=SPEED,
            climb=CLIMB_SPEED,
            yaw_rate=TURN_SPEED,
        )


def _far(pose: Pose, north: float, east: float) -> float | None:
    """The bearing of a point, unless it is too near to have one."""
    bearing, distance = pose.bearing(north, east)
    return bearing if distance > _TOO_NEAR_TO_TURN else None


def _somewhere(latitude: float, longitude: float, altitude: float) -> bool:
    """On the earth, at a height that is a number."""
    return abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(altitude)


def _chosen(type: RthHomeType) -> ardrone3.AvailableHomeType:
    if type is RthHomeType.PILOT:
        return ardrone3.AvailableHomeType.PILOT
    return ardrone3.AvailableHomeType.TAKEOFF
