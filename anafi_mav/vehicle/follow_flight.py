"""Flies the drone after a target: the part with I/O around the core `follow`.

Its loop closes on the drone's own speed, as for velocity setpoints. When the target is silent the drone hovers, in
mode Hold.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from anafi_mav import geo, texts
from anafi_mav.clock import Alarm, Clock
from anafi_mav.drone import PilotingCommand, events
from anafi_mav.drone.values import Values
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import LOWEST, amsl_to_ato, check_estimate, check_height, check_on_earth, check_place
from anafi_mav.vehicle.base.flight_task import STEERING, Needs, PlainTask, Preparation, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.requester import By, client_of
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.subscriptions import ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.base.velocity_loop import MotionEstimate, VelocityController
from anafi_mav.vehicle.follow import PATIENCE, REACH, SILENCE, AltitudeMode, FollowSettings, Sighting, TargetFollower


@dataclass(frozen=True)
class Following:
    """One use of mode Follow, from its request to its end."""

    follower: TargetFollower
    controller: VelocityController
    requester: Hashable
    """Client that chose the mode; None: a part of the gateway."""
    leader: Hashable = None
    """Sender of the target that is followed; None: the drone hovers until a target appears."""
    kept_height: float | None = None
    """m above take-off, kept while the target asks for a height that is too low."""


class FollowFlight(PlainTask):
    """Mode Follow of one vehicle."""

    rules = TaskRules(
        texts.FOLLOW,
        needs=Needs.NO_DESCENT | Needs.IN_AIR | Needs.FIX | Needs.LIMITS | STEERING,
        start=Preparation.HOVER,
        needs_link=True,
    )
    mode = FlightMode.FOLLOW

    def __init__(self, vehicle: Aircraft, motion: Callable[[], MotionEstimate], clock: Clock) -> None:
        self.settings = FollowSettings()
        self.warn_throttled: Callable[[OperatorText], None] = lambda text: vehicle.text(Severity.WARNING, text)
        self.drop: Callable[[Hashable, OperatorText], None] = lambda client, reason: vehicle.text(
            Severity.WARNING, texts.TARGET_IGNORED.fill(reason=reason)
        )
        """Notifies a client that the drone does not follow its target any longer."""
        self._vehicle = vehicle
        self._motion = motion
        self._clock = clock
        self._silence = Alarm(self._expired)
        self._following: Following | None = None
        self._interest = ValueInterest((events.SpeedChanged,), is_on=False)
        """On while a target is followed or waited for."""

    @property
    def engaged(self) -> bool:
        """True when the drone follows, or waits for its target."""
        return self._following is not None

    @property
    def requester(self) -> Hashable:
        """Client that chose the mode; None in another mode."""
        return None if self._following is None else self._following.requester

    async def engage(self, by: By) -> None:
        """Begin mode Follow; return when the drone hovers and waits for its target.

        Raises `Refused`.
        """
        if not self._vehicle.in_air:
            raise Refused(texts.FOLLOW, texts.TAKE_OFF_FIRST if self._vehicle.on_ground else self._vehicle.activity)
        async with self._vehicle.control.acquire(self, by=by):
            self._following = Following(
                TargetFollower(self.settings), VelocityController(self._motion()), client_of(by)
            )
            self._interest.switch(True)
            self._silence.set(self._clock.monotonic() + PATIENCE)

    def receive(self, sender: Hashable, seen: Sighting) -> OperatorText | None:
        """Take a target's position; return the reason for which it is not followed, or None.

        The first sender in mode Follow is followed until the mode ends. In another mode a target asks for nothing: its
        message names no drone.
        """
        following = self._following
        if following is None:
            return None
        if following.leader not in (None, sender):
            return texts.OTHER_TARGET
        if reason := self._objection(seen):
            return reason
        reference = self._motion().reference
        if reference is None:
            return texts.POSITION_UNKNOWN
        now = self._clock.monotonic()
        north, east = geo.offset(*reference, seen.latitude, seen.longitude)
        following.follower.see(north, east, seen.altitude, seen.velocity, now)
        self._following = replace(following, leader=sender)
        self._silence.set(now + SILENCE)
        return self._fly(self._following, now)

    def _objection(self, seen: Sighting) -> OperatorText | None:
        here = self._vehicle.place
        if here is None:
            return texts.NO_FIX
        try:
            check_on_earth(GeoPoint(seen.latitude, seen.longitude), texts.TARGET)
        except Refused as refusal:
            return refusal.reason
        distance = geo.distance(here.latitude, here.longitude, seen.latitude, seen.longitude)
        return texts.TARGET_FAR.fill(distance=distance) if distance > REACH else None

    def end(self) -> list[asyncio.Task[None]]:
        """End this flight task: something else flies the drone now."""
        if self._following is not None:
            self._following = None
            self._interest.switch(False)
            self._silence.cancel()
            self._vehicle.centre_sticks()
        return []

    def value_subscriptions(self) -> ValueSubscriptions:
        """Return the handler of values that report the drone's motion: the loop closes on it."""
        return {self._on_speed: self._interest}

    def _on_speed(self, values: Values, now: float) -> None:
        following = self._following
        if following is None or following.leader is None:
            return
        if self._silence.at is not None and now >= self._silence.at:
            self._expired()  # after a stall of the host the drone's events are read before timers are called
            return
        if (reason := self._fly(following, now)) is not None:
            self.drop(following.leader, reason)

    def _fly(self, following: Following, now: float) -> OperatorText | None:
        """Fly to where the target wants the drone; return why it hovers instead, or None."""
        vehicle = self._vehicle
        limits = vehicle.drone.piloting.limits
        if limits is None or not vehicle.control.keeps(self):
            return None
        reason: OperatorText | None = None
        sticks = PilotingCommand()
        try:
            motion = self._motion()
            wanted = following.follower.aim(motion.north, motion.east, self._height(following), now)
            if wanted is not None and vehicle.place is not None and motion.reference is not None:
                place = GeoPoint(
                    *geo.destination(*motion.reference, wanted.x.position or 0.0, wanted.y.position or 0.0)
                )
                check_place(vehicle, place)
                sticks = following.controller.sticks(wanted, limits, now) or sticks
        except Refused as refusal:
            reason = refusal.reason
        vehicle.drone.piloting.pilot(sticks)
        return reason

    def _height(self, following: Following) -> float:
        """Return the height to fly at (m, above take-off).

        Raises `Refused` when it is unknown or not allowed.

        A target that asks for less than `LOWEST` is followed at the height that the drone had then: programs send an
        altitude of 0 for one that they do not know.
        """
        settings, state = self.settings, self._vehicle.drone.piloting.state
        height = settings.height
        if settings.altitude_mode is AltitudeMode.TERRAIN:
            if state.altitude is None or state.height is None:
                raise Refused(texts.FOLLOW, texts.GROUND_HEIGHT_UNKNOWN)
            height += state.altitude - state.height
        elif settings.altitude_mode is AltitudeMode.TARGET:
            altitude = following.follower.altitude
            if altitude is None:
                raise Refused(texts.FOLLOW, texts.TARGET_NO_ALTITUDE)
            height += amsl_to_ato(self._vehicle, altitude)
        is_low, kept = height < LOWEST, following.kept_height
        kept = state.altitude if kept is None else kept
        self._following = replace(following, kept_height=kept if is_low else None)
        if is_low:
            if kept is None:
                raise Refused(texts.FOLLOW, texts.HEIGHT_UNKNOWN)
            self.warn_throttled(texts.FOLLOW_HEIGHT_KEPT.fill(height=height))
            return kept
        if settings.altitude_mode is AltitudeMode.TARGET:
            check_estimate(self._vehicle, height)
        check_height(self._vehicle, height)
        return height

    def _expired(self) -> None:
        if (ended := self._following) is None:
            return
        self._following = None
        self._interest.switch(False)
        self._vehicle.drone.piloting.hover()
        self._vehicle.control.release(self)
        why = texts.NO_TARGET if ended.leader is None else texts.TARGET_LOST
        self._vehicle.text(Severity.WARNING, texts.TASK_ENDED.fill(what=texts.FOLLOW, reason=why))
