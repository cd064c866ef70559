"""Orbits: MAV_CMD_DO_ORBIT flown by the gateway's loops, with ORBIT_EXECUTION_STATUS.

An ANAFI has no orbit of its own: its point of interest turns the nose, the pilot flies the circle. So the sticks are
held from here, and whatever ends the gateway ends them. Conformance A4, B1 and items 78, 79.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from anafi_mav import geo, texts, units
from anafi_mav.drone import events
from anafi_mav.drone.piloting.moves import Move, MoveEnd
from anafi_mav.drone.values import Values
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Action, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.service import Host, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.bounds import SLOWEST, check_height, check_on_earth, check_place
from anafi_mav.vehicle.base.flight_task import STEERING, Needs, PlainTask, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.base.velocity_loop import VelocityController, tilt_limit
from anafi_mav.vehicle.circle import (
    DEFAULT_RADIUS,
    DEFAULT_SPEED,
    LARGEST,
    ON_IT,
    SMALLEST,
    Circle,
    Facing,
    Lap,
    entry,
    fastest,
    heading_at,
    outline,
)
from anafi_mav.vehicle.guided_flight import Goto, early_end_reason
from anafi_mav.vehicle.vehicle import Vehicle

AS_IT_IS = 5.0
"""ORBIT_YAW_BEHAVIOUR_UNCHANGED; QGroundControl always sends it."""

BY_STICKS = 4.0
"""ORBIT_YAW_BEHAVIOUR_RC_CONTROLLED.

Sticks are ignored during an orbit, so the nose stays free.
"""


@dataclass
class _Orbit:
    """One orbit, from the way to the circle on; the newest one is kept after its end."""

    lap: Lap
    cruise: tuple[float | None, int]
    """The vehicle's cruise speed, and how often it was commanded, when the orbit's was last decided.

    A change of either changes the orbit's.
    """
    approach: asyncio.Task[None] | None = None
    controller: VelocityController | None = None
    """None on the way to the circle."""
    is_over: bool = False


class OrbitService(Service, PlainTask):
    """Flies circles; the vehicle's flight task while it does."""

    rules = TaskRules(
        texts.ORBIT,
        needs=Needs.NO_DESCENT | Needs.IN_AIR | Needs.FIX | Needs.LIMITS | STEERING,
        follows=True,
        needs_link=True,
    )
    mode = FlightMode.ORBIT

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._newest: _Orbit | None = None
        self._interest = ValueInterest((events.SpeedChanged, events.AttitudeChanged), is_on=False)
        """On while the drone circles."""

    @property
    def _orbit(self) -> _Orbit | None:
        """The orbit that is flown, or flown to; None without one."""
        return None if self._newest is None or self._newest.is_over else self._newest

    @property
    def circle(self) -> Circle | None:
        """Return the circle that is flown, or flown to; None without one."""
        return None if self._orbit is None else self._orbit.lap.circle

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_DO_ORBIT: Action(
                self._fly_orbit,
                location=True,
                altitude=Altitude.AMSL,
                effect=Effect.CHANGE,
                progress=ProgressPolicy.EARLY,
                still_holds=lambda command: (
                    self._newest is not None and (not self._newest.is_over or self._newest.lap.done)
                ),
            )
        }

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: MessageStream(self._status, every=0.8)}

    # Flight task.

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task: something else flies the drone now."""
        orbit = self._orbit
        if orbit is None:
            return []
        orbit.is_over = True
        self._interest.switch(False)
        self.host.vehicle.centre_sticks()
        if orbit.approach is None or orbit.approach is asyncio.current_task():
            return []
        orbit.approach.cancel()
        return [orbit.approach]

    def link_down(self) -> None:
        orbit, self._newest = self._newest, None
        self._interest.switch(False)
        if orbit is not None and orbit.approach is not None:
            orbit.approach.cancel()

    # The command.

    async def _fly_orbit(self, command: Command) -> None:
        """Fly MAV_CMD_DO_ORBIT: param1 radius in m, + clockwise; param2 m/s; param3 yaw; param4 rad.

        param3 is the yaw behaviour, param4 the angle to fly. The centre is the drone's position unless it is set, z
        is AMSL in every frame but ArduPilot's clients'. ACCEPTED when the drone is on its way to the circle, or on
        it. A take-off under way is flown to its end before.
        """
        vehicle = self.host.vehicle
        await vehicle.takeoff.over(self.rules)
        circle = self._described(command)
        async with vehicle.control.acquire(self, by=command.right, condition=lambda: self._way(circle)) as grant:
            start, is_away = grant.found
            orbit = _Orbit(Lap(self._held_back(circle)), _cruise(vehicle))
            if is_away:
                heading = heading_at(orbit.lap.circle, _bearing(circle.centre, start))
                await vehicle.guided.move(Goto(start, circle.height, heading, None, FlightMode.HOLD))
            else:
                vehicle.drone.piloting.hover()  # ends a move of ours, which would ignore sticks
            self._newest = orbit
            grant.begin()
            if is_away and (move := vehicle.drone.piloting.move) is not None:
                orbit.approach = self.host.spawn(self._approach(move, orbit))
            else:
                self._begin(orbit)

    def _way(self, circle: Circle) -> tuple[GeoPoint, bool]:
        """Return the first point of the circle, and True when the drone is away from it.

        Raises `Refused` for a way or a circle that may not be flown.
        """
        vehicle, here = self.host.vehicle, self.host.vehicle.place
        if here is None:
            raise Refused(texts.ORBIT, texts.NO_FIX)
        check_height(vehicle, circle.height)
        start = entry(circle, here)
        off = abs(geo.distance(*circle.centre, *here) - circle.radius)
        is_away = off > ON_IT or abs((vehicle.drone.piloting.state.altitude or 0.0) - circle.height) > ON_IT
        check_place(vehicle, start, start=here if is_away else None)
        for before, point in pairwise(outline(circle)):
            check_place(vehicle, point, start=before)
        return start, is_away

    def _described(self, command: Command) -> Circle:
        vehicle, piloting = self.host.vehicle, self.host.drone.piloting.state
        radius, speed, facing, angle = command.params
        running = self.circle
        where = command.place() or (None if running is None else running.centre) or vehicle.place
        if where is None:
            raise Refused(texts.ORBIT, texts.ORBIT_NO_CENTRE)
        check_on_earth(where, texts.ORBIT)
        if math.isnan(radius):
            radius = DEFAULT_RADIUS if running is None else running.signed_radius
        if not SMALLEST <= abs(radius) <= LARGEST:
            raise Refused(texts.ORBIT, texts.RADIUS_RANGE.fill(smallest=SMALLEST, largest=LARGEST), lasting=True)
        if math.isnan(speed):
            speed = DEFAULT_SPEED if running is None else running.speed
        if not SLOWEST <= speed <= 100.0:
            raise Refused(texts.ORBIT, texts.PARAM2_ORBIT, lasting=True)
        if math.isnan(angle) or angle == 0.0:
            angle = math.inf
        if angle < 0.0:
            raise Refused(texts.ORBIT, texts.PARAM4_ORBIT, lasting=True)
        ato = command.height(vehicle)
        if ato is None:
            ato = piloting.altitude if running is None else running.height
        if ato is None:
            raise Refused(texts.ORBIT, texts.HEIGHT_UNKNOWN)
        heading = 0.0 if piloting.attitude is None else piloting.attitude.yaw
        return Circle(
            where,
            abs(radius),
            1 if radius > 0.0 else -1,
            speed,
            ato,
            _facing(facing),
            heading,
            None if math.isinf(angle) else angle,
        )

    def _held_back(self, circle: Circle) -> Circle:
        """Return the circle at a speed that the tilt limit allows; send a text if it is slower."""
        limits = self.host.drone.piloting.limits
        if limits is None:
            raise Refused(texts.ORBIT, texts.TILT_UNKNOWN)
        tilt = tilt_limit(limits, self.host.vehicle.offboard.motion) * units.DEG_PER_RAD
        most = fastest(circle.radius, tilt)
        if circle.speed <= most:
            return circle
        name = texts.MAX_TILT if tilt >= limits.tilt_deg else texts.UNVERIFIED_ROLL
        text = texts.ORBIT_SLOWED.fill(speed=most, asked=circle.speed, limit=name, tilt=tilt)
        self.host.text(Severity.NOTICE, text)
        return replace(circle, speed=most)

    async def _approach(self, move: Move, orbit: _Orbit) -> None:
        """Circle when the move there has ended well."""
        end = await move.result()
        if self._orbit is not orbit or end is MoveEnd.LINK_LOST:
            return
        orbit.approach = None
        if end is MoveEnd.DONE:
            self._begin(orbit)
        else:
            reason = early_end_reason(end, self.host.drone)
            self.host.text(Severity.WARNING, texts.TASK_ENDED.fill(what=texts.ORBIT, reason=reason))
            self.host.vehicle.control.release(self)

    def _begin(self, orbit: _Orbit) -> None:
        orbit.controller = VelocityController(self.host.vehicle.offboard.motion)
        self._interest.switch(True)
        self._fly(self.host.clock.monotonic())

    # Flying.

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_motion: self._interest}

    def _on_motion(self, values: Values, now: float) -> None:
        self._fly(now)

    def _fly(self, now: float) -> None:
        vehicle, orbit = self.host.vehicle, self._orbit
        if orbit is None or orbit.controller is None or not vehicle.control.keeps(self):
            return
        lap = orbit.lap
        if (cruise := _cruise(vehicle)) != orbit.cruise:
            orbit.cruise = cruise
            lap.circle = self._held_back(replace(lap.circle, speed=cruise[0] or DEFAULT_SPEED))
        limits = vehicle.drone.piloting.limits
        demand = None if vehicle.place is None else lap.demand(vehicle.offboard.motion)
        sticks = None if demand is None or limits is None else orbit.controller.sticks(demand, limits, now)
        if sticks is None:
            self._stop(texts.POSITION_UNKNOWN, Severity.WARNING)
        elif lap.done:
            self._stop(texts.ORBIT_DONE, Severity.INFO)
        else:
            vehicle.drone.piloting.pilot(sticks)

    def _stop(self, why: OperatorText, severity: Severity) -> None:
        self.host.vehicle.control.release(self)
        self.host.vehicle.hover()
        self.host.text(severity, texts.TASK_ENDED.fill(what=texts.ORBIT, reason=why))

    def _status(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
        """ORBIT_EXECUTION_STATUS: while it lasts, the way to the circle included."""
        circle = self.circle
        amsl = None if circle is None else vehicle.height.amsl(circle.height)
        if circle is None or amsl is None:
            return None
        return dialect.MAVLink_orbit_execution_status_message(
            times.boot_us,
            circle.signed_radius,
            dialect.MAV_FRAME_GLOBAL,
            units.deg_e7(circle.centre.latitude),
            units.deg_e7(circle.centre.longitude),
            amsl,
        )


def _cruise(vehicle: Vehicle) -> tuple[float | None, int]:
    return vehicle.cruise_speed, vehicle.commanded_speeds.cruise_orders


def _facing(behaviour: float) -> Facing:
    if math.isnan(behaviour) or behaviour == AS_IT_IS:
        return Facing.CENTRE
    if behaviour == BY_STICKS:
        return Facing.FREE
    try:
        return Facing(behaviour)
    except ValueError:
        raise Refused(texts.ORBIT, texts.PARAM3_ORBIT, lasting=True) from None


def _bearing(centre: GeoPoint, place: GeoPoint) -> float:
    """rad, clockwise from north, of a place seen from a centre."""
    north, east = geo.offset(*centre, *place)
    return math.atan2(east, north)
