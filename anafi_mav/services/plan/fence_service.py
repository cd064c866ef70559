"""Enforces the fence: watches the position, acts at the boundary, sends FENCE_STATUS.

`fence_watch` decides on the action; the zones are a client's upload (`plan_service`). Settings are parameters
(`parameter_table_fence`).
"""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import events
from anafi_mav.drone.events import PlayingState
from anafi_mav.drone.values import Values
from anafi_mav.errors import AnafiMavError
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Action, Altitude, Command, Effect
from anafi_mav.services.plan.fence_mirror import FenceMirror
from anafi_mav.services.service import Host, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.flying import ON_GROUND, TAKING_OFF
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, reason_of
from anafi_mav.vehicle.base.requester import Source
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.fence.fence_watch import (
    CEILING,
    EVERYTHING,
    FLOOR,
    HOME_CIRCLE,
    FenceWatch,
    OutsideFence,
    Reaction,
    Sight,
    State,
)
from anafi_mav.vehicle.vehicle import Vehicle

LOOK_EVERY = 0.5
"""s between looks in flight while the drone reports nothing new."""

LOOK_SOONEST = 0.1
"""s between looks for a new speed alone. An ANAFI reports its speed every 0.2 s."""

JUDGED_AT_ONCE = 8
"""Way points whose place and way are judged by the fence in one look: a few milliseconds for a large fence."""

MIRROR_EVERY = 0.9
"""s, at least, between checks whether the drone's own geofence must change. The services tick once a second."""

DISABLE, ENABLE, DISABLE_FLOOR = 0.0, 1.0, 2.0
"""param1 of MAV_CMD_DO_FENCE_ENABLE."""


@dataclass
class _WayJudgement:
    """Judgement of the whole way of one flight by one fence."""

    flight: int
    """By its `orders`."""
    fence: int | None
    """By a hash; None: there is none."""
    is_first: bool
    """It is the first fence of this flight: the check before the start was by it."""
    points: Iterator[bool | None] = field(default_factory=lambda: iter(()))
    """The judgement of a mission's way, a point at a time."""
    is_inside: bool | None = None
    """None while it is under way."""


class FenceService(Service):
    """Service for the region in which the drone may be."""

    is_watch = True

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._mirror = FenceMirror(host)
        self._located = -math.inf
        """When the drone last reported its position."""
        self._looked = self._mirrored = -math.inf
        self._speeds = ValueInterest((events.SpeedChanged,), is_on=False)
        """On unless the drone stands: its speed says how soon it will be at a boundary."""
        self._breach_ms = 0
        self._judgement: _WayJudgement | None = None
        """Of the newest flight by the newest fence."""
        self._announced: tuple[Any, ...] | None = None
        """Content of the newest FENCE_STATUS."""

    @property
    def _watch(self) -> FenceWatch:
        return self.host.vehicle.fence

    def actions(self) -> Mapping[int, Action]:
        # Not a query: who was refused a place before may ask for it again at once.
        return {
            dialect.MAV_CMD_DO_FENCE_ENABLE: Action(
                self._enable, location=False, altitude=Altitude.UNUSED, effect=Effect.EACH
            )
        }

    def streams(self) -> Mapping[int, MessageStream]:
        return {dialect.MAVLINK_MSG_ID_FENCE_STATUS: MessageStream(self._status, every=1.0, on_change=True)}

    def link_up(self) -> None:
        self._located = -math.inf if self.host.vehicle.place is None else self.host.clock.monotonic()
        self._speeds.switch(not (self.host.vehicle.on_ground or self.host.vehicle.flying_state is None))

    def link_down(self) -> None:
        self._watch.link_down()
        self._mirror.link_down()
        self._located = self._looked = self._mirrored = -math.inf

    def subscriptions(self) -> Subscriptions:
        return {
            events.GpsLocationChanged: self._on_location,
            events.FlyingStateChanged: self._on_flying_state,
        }

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_speed: self._speeds}

    def _on_location(self, message: events.GpsLocationChanged, now: float) -> None:
        self._located = self.host.clock.monotonic()
        self._look(self._located)

    def _on_flying_state(self, message: events.FlyingStateChanged, now: float) -> None:
        self._speeds.switch(message.state not in ON_GROUND)
        self._look(self.host.clock.monotonic())

    def _on_speed(self, values: Values, now: float) -> None:
        if now - self._looked >= LOOK_SOONEST:
            self._look(self.host.clock.monotonic())

    def tick(self, now: float) -> float:
        if now >= self._looked + LOOK_EVERY:
            self._look(now)
        if now >= self._mirrored + MIRROR_EVERY:
            self._mirrored = now
            self._mirror.update(now)
        return NEVER if self.host.vehicle.on_ground else self._looked + LOOK_EVERY

    # Watching.

    def _sight(self, now: float) -> Sight:
        vehicle, drone = self.host.vehicle, self.host.drone
        state, place, home, mode = drone.piloting.state, vehicle.place, vehicle.fence_home, vehicle.mode
        flying_state = vehicle.flying_state
        velocity = (0.0, 0.0) if state.velocity is None else (state.velocity.north, state.velocity.east)
        # A plan and an orbit turn before a fence that was there when they began.
        turns = mode in (FlightMode.MISSION, FlightMode.ORBIT) and self._has_judged_way()
        own_way = turns or self._ends_inside
        return Sight(
            place,
            now - self._located,
            velocity,
            state.altitude,
            None if state.max_altitude is None else state.max_altitude.current,
            home,
            airborne=not vehicle.on_ground and flying_state is not None,
            flying=vehicle.in_air and mode is not FlightMode.RETURN,
            steering=not own_way
            and (state.plan != PlayingState.PLAYING or vehicle.mission.flying or vehicle.mission.ended_unreported),
            orders=vehicle.control.epoch,
            takes_off=flying_state in TAKING_OFF,
            round_trip=vehicle.drone.round_trip.seconds,
        )

    def _has_judged_way(self) -> bool:
        """Return True while the way of the flown plan or orbit is known to be inside the fence.

        That of a plan is judged as it begins and again by a newer fence, some points with each look; until then the
        check before its start counts for the first fence. A fence around a home that has moved is a newer one. That of
        an orbit is not judged again.
        """
        vehicle, watch, mission = self.host.vehicle, self._watch, self.host.vehicle.mission
        if vehicle.control.active is mission and not mission.flying:
            return True  # it has not begun
        flight, judgement = vehicle.control.epoch, self._judgement
        home = vehicle.fence_home if watch.fence.is_around_home else None
        identity = (watch.items.identity, watch.enabled, watch.action is Reaction.NONE, home)
        fence = hash(identity) if watch.fence.zones else None
        if judgement is None or judgement.flight != flight or judgement.fence != fence:
            is_first = judgement is None or judgement.flight != flight
            judgement = self._judgement = _WayJudgement(flight, fence, is_first)
            if fence is None:
                judgement.is_inside = True
            elif mission.flying:
                judgement.points = mission.judge_way()
            else:
                judgement.is_inside = is_first
        if judgement.is_inside is None:
            found = itertools.islice(judgement.points, JUDGED_AT_ONCE)
            judgement.is_inside = next((inside for inside in found if inside is not None), None)
        return judgement.is_first if judgement.is_inside is None else judgement.is_inside

    @property
    def _ends_inside(self) -> bool:
        """True when the drone flies to a place by itself, and place and way are inside the fence.

        They were when the move began, but the fence may be another one since.
        """
        vehicle, move = self.host.vehicle, self.host.drone.piloting.move
        if move is not None and move.target is not None:
            end: GeoPoint | None = GeoPoint(move.target.latitude, move.target.longitude)
        else:
            end = vehicle.offboard.end_place
        if end is None:
            return False
        try:
            self._watch.check_place(end, vehicle.fence_home, vehicle.place)
        except OutsideFence:
            return False
        return True

    def _look(self, now: float) -> None:
        self._looked = now
        vehicle, watch = self.host.vehicle, self._watch
        is_announced = self._announced == (False, watch.breaches)
        if is_announced and watch.rests and (vehicle.on_ground or vehicle.flying_state is None):
            return
        before = watch.state
        blind, breaches = watch.blind, watch.breaches
        sight = self._sight(now)
        action = watch.look(sight, now)
        if watch.blind and not blind:
            self.host.text(Severity.WARNING, texts.FENCE_BLIND)
        if watch.breaches != breaches:
            self._breach_ms = self.host.times().boot_ms
        if action is not None:
            self._begin(action)
        elif (
            before is State.OUTSIDE and watch.state is not State.OUTSIDE and sight.airborne
        ):  # else it has landed there
            self.host.text(Severity.NOTICE, texts.FENCE_INSIDE)
        self._tell()

    def _begin(self, action: Reaction) -> None:
        verdict = self._watch.verdict
        assert verdict is not None
        if action is Reaction.WARN:
            self.host.text(Severity.WARNING, texts.FENCE_WARNING.fill(reason=verdict.text))
        elif self.host.vehicle.control.leaves_to_pilot(Source.FENCE):
            self.host.text(Severity.CRITICAL, texts.FENCE_PILOT.fill(reason=verdict.text))
            self._watch.done(self.host.vehicle.control.epoch)
        else:
            self.host.text(Severity.CRITICAL, texts.FENCE_BREACH.fill(action=action.value, reason=verdict.text))
            # In its turn: what is newer replaces it.
            self.host.run_action(FenceService, self._carry_out(action), is_order=False)

    async def _carry_out(self, action: Reaction) -> None:
        vehicle = self.host.vehicle
        try:
            match action:
                case Reaction.RETURN:
                    await self._return_or_hold()
                case Reaction.LAND:
                    await vehicle.land(Source.FENCE)
                case Reaction.TERMINATE:
                    await vehicle.terminate(Source.FENCE)
                case _:
                    await vehicle.hold(FlightMode.HOLD, Source.FENCE)
        except AnafiMavError as error:
            self.host.text(Severity.ERROR, texts.FENCE_ACTION_FAILED.fill(action=action.value, error=reason_of(error)))
            self._not_done()
        except asyncio.CancelledError:
            self._not_done()
            raise
        else:
            self._watch.done(vehicle.control.epoch)

    def _not_done(self) -> None:
        """The action has failed, or something newer has ended it."""
        self._watch.failed(self.host.clock.monotonic(), replaced=self.host.replaced_by_order)

    async def _return_or_hold(self) -> None:
        try:
            await self.host.vehicle.return_home(Source.FENCE)
        except AnafiMavError as error:
            self.host.text(Severity.ERROR, texts.FENCE_NO_RETURN.fill(error=reason_of(error)))
            await self.host.vehicle.hold(FlightMode.HOLD, Source.FENCE)

    # Telling.

    def _status(self, vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
        """Return FENCE_STATUS, while a fence is in force or a boundary was breached."""
        watch = self._watch
        if not watch.in_force and watch.breaches == 0:
            return None
        return dialect.MAVLink_fence_status_message(
            int(watch.state is State.OUTSIDE),
            min(watch.breaches, 0xFFFF),
            watch.breach.value,
            self._breach_ms,
            dialect.FENCE_MITIGATE_NONE,
        )

    def _tell(self) -> None:
        """Send FENCE_STATUS to all clients when a breach begins or ends."""
        watch = self._watch
        now = (watch.state is State.OUTSIDE, watch.breaches)
        if now != self._announced:
            first, self._announced = self._announced is None, now
            message = self._status(self.host.vehicle, self.host.times())
            if message is not None and not first:
                self.host.send(message)

    # Commands.

    async def _enable(self, command: Command) -> None:
        """Run MAV_CMD_DO_FENCE_ENABLE.

        param1 0 disable, 1 enable, 2 disable the floor; param2 FENCE_TYPE bits, 0 all. The drone's own boundaries are
        settings of the drone: they are in force, and no kind of the fence.
        """
        what, types = command.params[:2]
        watch = self._watch
        wanted = EVERYTHING if math.isnan(types) or types == 0.0 else types
        if what == DISABLE_FLOOR:
            wanted = FLOOR
        if what not in (DISABLE, ENABLE, DISABLE_FLOOR) or wanted not in range(1, EVERYTHING + 1):
            raise Refused(texts.FENCE, texts.FENCE_PARAMS, lasting=True)
        has_circle = bool(watch.types & HOME_CIRCLE) and watch.fence.is_around_home
        own_circle = HOME_CIRCLE if self.host.drone.piloting.state.geofence and not has_circle else 0
        if what != ENABLE and not int(wanted) & ~(CEILING | own_circle):
            reason = texts.OWN_CIRCLE_STAYS if int(wanted) & HOME_CIRCLE else texts.CEILING_STAYS
            raise Refused(texts.FENCE, reason, lasting=True)
        if what == ENABLE:
            if wanted != EVERYTHING and int(wanted) & ~(watch.types | own_circle):
                raise Refused(texts.FENCE, texts.FENCE_KIND_NOT_CHOSEN, lasting=True)
            watch.enable(int(wanted))
            if not watch.in_force and not own_circle:
                self.host.text(Severity.WARNING, texts.FENCE_ON_WITHOUT)
        else:
            with self.host.vehicle.changing_fence():
                watch.disable(int(wanted))
        self._look(self.host.clock.monotonic())
