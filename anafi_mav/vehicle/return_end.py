"""The end of a return that was commanded here: a landing at home, or a hover and a text.

The text has the reason. The command is a client's or the gateway's own. The drone ends its returns by its own setting
(ANF_RTH_END; hovering, from the factory) and the gateway does not write that setting: it is also the end of returns
that the drone begins by itself. PX4 and ArduCopter land by default. So the gateway commands the landing, once the
drone has reported that the return is finished, and only where it is certain enough of the place: see `objection`.

A commanded return is one `ReturnAttempt`. Any newer command, the ground and the loss of the link end it, and with it
everything that would still have been sent for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import enum
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from anafi_mav import geo, texts
from anafi_mav.clock import Alarm
from anafi_mav.drone import Position
from anafi_mav.drone.events import (
    FlyingState,
    PoiStatus,
    PreciseHomeState,
    ReturnReason,
    RthEndingBehavior,
    RthHomeType,
    RthState,
)
from anafi_mav.errors import AnafiMavError, CommandTimeout, LinkLost
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.flight_task import PlainTask, Preparation, TaskRules
from anafi_mav.vehicle.base.flying import LANDING
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.right import Extent
from anafi_mav.vehicle.base.severity import Severity

logger = logging.getLogger(__name__)

NEAR_HOME = 5.0
"""m over ground from home within which the gateway lands."""

SHORTEST_WAIT = 5.0
"""s above home before a landing, at least: a person reads the text and can still send Hold."""

LONGEST_WAIT = 60.0
"""s above home that a client can ask for (ArduCopter's largest RTL_LOIT_TIME)."""

LOCATION_WAIT = 1.5
"""s after the end of a return in which a location from after that end arrives.

An ANAFI reports its location once a second: the last one may be from before it stopped, some metres away.
"""

LAND_AGAIN = 5.0
"""s after a landing that the drone did not confirm until it is announced once more: no station may be left that could
command it."""

LANDS_WITHIN = 1.0
"""s after a return was stopped, without a command of ours, in which the landing that has stopped it is reported."""

UNREPORTED = 10.0
"""s of hovering at home after which a drone that reports no end of its return is asked for its states."""

ANSWER = 3.0
"""s for its answer; then the return counts as ended without a report."""

SAME_PLACE = 1e-6
"""deg, 0.1 m: a place that the drone repeats is closer to the one that it was given."""


class EndOfReturn(enum.IntEnum):
    """The end of a commanded return; the numbers of ANF_RTL_END."""

    LAND = 0
    HOVER = 1


class _Phase(enum.Enum):
    COMMANDED = "the drone has not reported a return yet"
    RETURNING = "the drone returns"
    WAITING = "the drone hovers at home, the gateway is about to land it"
    LANDING = "the landing is commanded, or the drone begins it by its own setting"
    STOPPED = "the drone has stopped the return, to hover or to land"


@dataclass
class ReturnAttempt:
    """One commanded return, until it has landed, hovers for good, or is replaced."""

    phase: _Phase
    task: asyncio.Task[None] | None = None
    """The wait above home and the landing."""

    def stop(self) -> list[asyncio.Task[None]]:
        """Nothing more is sent for it. Returns the task that is about to end."""
        task, self.task = self.task, None
        if task is None or task is asyncio.current_task():
            return []
        task.cancel()
        return [task]


@dataclass
class _UnreportedEnd:
    """Doubt about the return that the drone reports, whatever commanded it.

    It hovers at home, and has reported no end.
    """

    alarm: Alarm | None = None
    """Runs while it hovers, and then while its answer is due; None without a return."""
    is_asked: bool = False
    """It has been asked for its states in this return."""

    def replace(self, act: Callable[[], None]) -> Alarm:
        """Return a new alarm in place of the one of before, not set yet."""
        if self.alarm is not None:
            self.alarm.cancel()
        self.alarm = Alarm(act)
        return self.alarm

    def settle(self) -> None:
        """The return is over, or another one begins."""
        if self.alarm is not None:
            self.alarm.cancel()
        self.alarm, self.is_asked = None, False


@dataclass(frozen=True)
class _GivenHome:
    """A home that a client chose through this gateway, or a rally point."""

    place: Position
    label: OperatorText
    flight_id: str | None
    """Of the flight in which it was chosen; None where the drone reports none."""


class ReturnEnd(PlainTask):
    """The flight task Return: a commanded return, until the drone has landed or hovers."""

    rules = TaskRules(
        texts.RETURN,
        start=Preparation.END_LANDING,
        ends_landing=Extent.COMMANDED,
        ends_return=Extent.COMMANDED,
        follows=True,
        is_flight=False,
    )
    mode = None
    """The drone reports that it returns; see `shown`."""

    def __init__(self, vehicle: Aircraft, land: Callable[[], Awaitable[None]]) -> None:
        """`land` commands a landing and returns when the drone has reported it."""
        self.ending = EndOfReturn.LAND
        """A parameter."""
        self.wait = SHORTEST_WAIT
        """s above home before the landing (a parameter); `SHORTEST_WAIT` holds where this is less."""
        self._vehicle = vehicle
        self._command_landing = land
        self._attempt: ReturnAttempt | None = None
        self._unreported_end = _UnreportedEnd()
        self._given: _GivenHome | None = None

    @property
    def active(self) -> bool:
        """A commanded return is on its way, waits above home, or lands."""
        return self._attempt is not None

    @property
    def shown(self) -> bool:
        """The mode is Return though the drone reports none: it waits above home, or lands."""
        return self._attempt is not None and self._attempt.phase in (_Phase.WAITING, _Phase.LANDING)

    @property
    def owns_descent(self) -> bool:
        return self._attempt is not None and self._attempt.phase is not _Phase.STOPPED

    @property
    def commands_landing(self) -> bool:
        """True while the gateway has commanded the landing at home, and the drone has not answered."""
        attempt = self._attempt
        if attempt is None or attempt.phase is not _Phase.LANDING or self._drone_lands:
            return False
        return attempt.task is not None

    def set_home(self, place: Position, label: OperatorText) -> None:
        """A client has set the drone's custom home, or a rally point has become it."""
        if not self._vehicle.on_ground:
            self._given = _GivenHome(place, label, self._vehicle.drone.product.state.flight_id)

    # A return begins and ends.

    def command(self) -> ReturnAttempt:
        """The drone is about to be commanded to return."""
        self.end()
        self._unreported_end.settle()
        self.watch_end()
        self._attempt = ReturnAttempt(_Phase.RETURNING if self._vehicle.returning else _Phase.COMMANDED)
        return self._attempt

    def fail(self, attempt: ReturnAttempt) -> None:
        """The drone does not return, or a newer command has replaced this one."""
        if self._attempt is attempt:
            self._attempt = None
            attempt.stop()

    def announce(self, attempt: ReturnAttempt, system: int | None) -> None:
        """The commanded return has begun: send every client its end.

        `system` commanded it; None: the gateway.
        """
        if self._attempt is not attempt:
            return
        if system is None:
            begun = texts.RETURN_STARTED.fill(end=self._prospect)
        else:
            begun = texts.RETURN_BY.fill(system=system, end=self._prospect)
        self._vehicle.text(Severity.NOTICE, begun)
        if self._lands and not self._drone_lands:
            self._vehicle.text(Severity.INFO, texts.RETURN_LINK_LOSS)

    def end(self) -> list[asyncio.Task[None]]:
        """Another command, the ground or the loss of the link ends the attempt.

        Returns tasks that are about to end.
        """
        attempt, self._attempt = self._attempt, None
        if attempt is None:
            return []
        if attempt.phase is _Phase.WAITING:
            self._vehicle.text(Severity.NOTICE, texts.HOME_LANDING_CANCELLED)
        return attempt.stop()

    def _close(self) -> None:
        """The attempt is over: nothing is left to be sent for it."""
        self._attempt = None
        self._vehicle.control.release(self)

    def link_down(self) -> None:
        """The drone ends a return by its own setting from now on."""
        attempt, self._attempt = self._attempt, None
        if attempt is not None:
            attempt.stop()
        self._unreported_end.settle()
        if self._given is not None and not self._given.flight_id:
            self._given = None  # the next connection may find another flight

    def on_ground(self) -> None:
        """The drone has landed; the next flight has other homes."""
        self._given = None
        self.end()

    # What the drone reports.

    def on_return_state(self) -> None:
        """rth.state was reported, once more perhaps."""
        attempt, home = self._attempt, self._vehicle.drone.home.state
        if self._unreported_end.alarm is not None:
            self.watch_end()
        if attempt is None:
            return
        if home.returning and attempt.phase is not _Phase.LANDING:
            attempt.stop()  # it waited above home, and the drone has a reason of its own to return once more
            attempt.phase = _Phase.RETURNING
        elif not home.returning and attempt.phase is _Phase.RETURNING:
            attempt.stop()
            if home.rth == RthState.AVAILABLE and home.reason == ReturnReason.FINISHED:
                self._arrived(attempt)
            elif self._vehicle.in_air:
                reason = texts.HOVER_STOPPED if home.reason == ReturnReason.STOPPED else texts.HOVER_UNFINISHED
                attempt.phase = _Phase.STOPPED
                attempt.task = asyncio.get_running_loop().create_task(self._see_hover(attempt, reason))
            else:
                self._close()

    def on_flying_state(self) -> None:
        """The drone's flying state has changed."""
        attempt = self._attempt
        if self._unreported_end.alarm is not None:
            self.watch_end()
        if attempt is None:
            return
        if self._vehicle.flying_state == FlyingState.EMERGENCY_LANDING:
            self._vehicle.control.release(self)  # by the drone itself, and shown as a landing
        elif attempt.phase is _Phase.WAITING and self._vehicle.flying_state in LANDING:
            attempt.stop()
            attempt.phase = _Phase.LANDING
        elif attempt.phase is _Phase.LANDING and attempt.task is None and self._vehicle.in_air:
            self._close()  # the landing was ended elsewhere

    # The end.

    def _arrived(self, attempt: ReturnAttempt) -> None:
        """The drone has reported the return as finished."""
        if self._drone_lands:
            attempt.phase = _Phase.LANDING
            attempt.task = asyncio.get_running_loop().create_task(self._see_landing(attempt))
        elif self.ending is EndOfReturn.HOVER:
            self._hover(None)
        elif (reason := self.objection()) is not None:
            self._hover(reason)
        else:
            attempt.phase = _Phase.WAITING
            attempt.task = asyncio.get_running_loop().create_task(self._land(attempt))

    async def _land(self, attempt: ReturnAttempt) -> None:
        """Wait above home, then land. Every condition is judged again before each step."""
        vehicle = self._vehicle
        vehicle.changed()
        if self.objection(arrived=True) is not None:
            await asyncio.sleep(LOCATION_WAIT)
            if (reason := self.objection(arrived=True)) is not None:
                self._hover(reason)
                return
        if self.wait > SHORTEST_WAIT:
            vehicle.text(Severity.NOTICE, texts.RETURN_LANDING_IN.fill(seconds=self.wait))
            await asyncio.sleep(self.wait - SHORTEST_WAIT)
        try:
            while (reason := await self._countdown()) is None:
                attempt.phase = _Phase.LANDING
                try:
                    await self._command_landing()
                    return
                except CommandTimeout as error:
                    logger.warning("landing at home: %s", error)
                    vehicle.text(Severity.ERROR, texts.HOME_LANDING_FAILED)
                attempt.phase = _Phase.WAITING
                await asyncio.sleep(LAND_AGAIN)
            self._hover(reason)
        except AnafiMavError as error:
            logger.warning("landing at home: %s", error)
            vehicle.text(Severity.ERROR, texts.HOME_LANDING_FAILED)
            if self._attempt is attempt:
                self._close()
        finally:
            attempt.task = None

    async def _countdown(self) -> OperatorText | None:
        """Announce the landing and wait; return why the drone does not land, or None."""
        if (reason := self._late_objection()) is not None:
            return reason
        self._announce_landing()
        before = self._vehicle.drone.gps.state.location
        await asyncio.sleep(SHORTEST_WAIT)
        if (reason := self._late_objection()) is not None:
            return reason
        return texts.HOVER_OLD_POSITION if self._vehicle.drone.gps.state.location is before else None

    async def _see_landing(self, attempt: ReturnAttempt) -> None:
        """Report a hover when the landing by the drone's own setting does not begin in time.

        So a landing is not shown for longer than it is true.
        """
        await asyncio.sleep(SHORTEST_WAIT)
        attempt.task = None
        if self._vehicle.flying_state not in LANDING:
            self._hover(texts.HOVER_NO_LANDING)

    async def _see_hover(self, attempt: ReturnAttempt, reason: OperatorText) -> None:
        """Report a hover once the return was not stopped by a landing, which ends the attempt."""
        await asyncio.sleep(LANDS_WITHIN)
        attempt.task = None
        self._hover(reason)

    def _announce_landing(self) -> None:
        vehicle, home = self._vehicle, self._vehicle.drone.home.state
        if (metres := _metres(vehicle.place, home.takeoff_location)) is None:
            soon = texts.LANDING_SOON.fill(seconds=SHORTEST_WAIT)
        else:
            soon = texts.LANDING_SOON_AT.fill(seconds=SHORTEST_WAIT, distance=metres)
        vehicle.text(Severity.WARNING, soon)
        precise = home.precise in (PreciseHomeState.AVAILABLE, PreciseHomeState.ACTIVE)
        accuracy = texts.PRECISE if precise else texts.GPS_ONLY
        vehicle.text(Severity.NOTICE, texts.LANDING_PLACE.fill(place=self._label, accuracy=accuracy))

    def _hover(self, reason: OperatorText | None) -> None:
        """The return is over, and the drone stays in the air.

        `reason`: why it does not land, where it was to.
        """
        vehicle, attempt = self._vehicle, self._attempt
        if attempt is not None:
            self._close()
            attempt.stop()
        altitude = vehicle.drone.piloting.state.altitude
        at = texts.AT_HOME if altitude is None else texts.AT_HEIGHT.fill(height=altitude)
        if reason is None:
            vehicle.text(Severity.NOTICE, texts.RETURN_HOVERS.fill(at=at))
        else:
            vehicle.text(Severity.WARNING, texts.RETURN_HOVERS_REASON.fill(at=at, reason=reason))
        vehicle.changed()

    def watch_end(self) -> None:
        """Notice a drone that hovers at home and reports no end of its return."""
        doubt = self._unreported_end
        if not self._vehicle.returning:
            doubt.settle()
        elif not doubt.is_asked:  # else this is its answer
            alarm = doubt.replace(self._ask)
            under_way = self._vehicle.drone.home.state.rth == RthState.IN_PROGRESS
            if under_way and self._vehicle.flying_state == FlyingState.HOVERING:
                alarm.set_in(UNREPORTED)

    def _ask(self) -> None:
        metres = _metres(self._vehicle.place, self._vehicle.drone.home.state.location)
        if metres is None or metres > NEAR_HOME:
            return
        self._unreported_end.is_asked = True
        self._unreported_end.replace(self._unanswered).set_in(ANSWER)
        with contextlib.suppress(LinkLost):
            self._vehicle.drone.home.request_states()

    def _unanswered(self) -> None:
        """The drone still reports that it returns: a commanded return is over nevertheless."""
        if self._attempt is not None and self._attempt.phase is _Phase.RETURNING:
            self._hover(texts.HOVER_UNREPORTED)

    # Where and how.

    def objection(self, *, arrived: bool = False) -> OperatorText | None:
        """Return why the gateway leaves the drone hovering at home, in a few words; None: it lands.

        `arrived`: also compare the drone's place with home.
        """
        vehicle, home = self._vehicle, self._vehicle.drone.home.state
        if vehicle.drone.controller.present:
            return texts.HOVER_SKYCONTROLLER
        if home.type == RthHomeType.TAKEOFF:
            target = home.takeoff_location
            if target is not None and not home.fixed_before_takeoff:
                return texts.HOVER_FIRST_FIX
        elif home.type == RthHomeType.CUSTOM:
            target = home.custom_location
            if self._chosen is None:
                return texts.HOVER_OLD_HOME
        else:
            return _UNCERTAIN_HOMES.get(home.type or RthHomeType.NONE, texts.HOVER_HOME_UNKNOWN)
        if target is None or home.location is None:
            return texts.HOVER_HOME_UNKNOWN
        if not arrived:
            return None
        if vehicle.place is None:
            return texts.NO_FIX
        metres = max(_metres(vehicle.place, target) or 0.0, _metres(vehicle.place, home.location) or 0.0)
        return texts.HOVER_FROM_HOME.fill(distance=metres) if metres > NEAR_HOME else None

    def _late_objection(self) -> OperatorText | None:
        """`objection`, and what may have happened while the drone waited above home."""
        vehicle = self._vehicle
        if not vehicle.in_air or vehicle.returning:
            return texts.HOVER_NOT_HOVERING
        if vehicle.drone.piloting.state.poi in (PoiStatus.RUNNING, PoiStatus.PENDING):
            return texts.HOVER_ROI
        if self.ending is EndOfReturn.HOVER:
            return texts.HOVER_BY_SETTING
        return self.objection(arrived=True)

    @property
    def _chosen(self) -> _GivenHome | None:
        """The home that was set in this flight, as long as it is the drone's custom home."""
        given, custom = self._given, self._vehicle.drone.home.state.custom_location
        if given is None or custom is None or given.flight_id != self._vehicle.drone.product.state.flight_id:
            return None
        apart = max(abs(given.place.latitude - custom.latitude), abs(given.place.longitude - custom.longitude))
        return given if apart < SAME_PLACE else None

    @property
    def _label(self) -> OperatorText:
        chosen = self._chosen
        if self._vehicle.drone.home.state.type == RthHomeType.CUSTOM and chosen is not None:
            return chosen.label
        return texts.TAKEOFF_POINT

    @property
    def alone(self) -> str:
        """The end of a return without the gateway, as a predicate of the drone."""
        home = self._vehicle.drone.home.state.location
        where = "home" if home is None else f"{home.latitude:.5f}, {home.longitude:.5f}"
        return f"returns to {where} and {'lands' if self._drone_lands else 'hovers'} there (ANF_RTH_END)"

    @property
    def _drone_lands(self) -> bool:
        """The drone's own setting says that its returns end in a landing."""
        return self._vehicle.drone.home.state.ending == RthEndingBehavior.LANDING

    @property
    def _lands(self) -> bool:
        return self._drone_lands or (self.ending is EndOfReturn.LAND and self.objection() is None)

    @property
    def _prospect(self) -> OperatorText:
        """The end of a return that begins now, as the end of a text."""
        if self._drone_lands:
            return texts.LANDS_BY_SETTING
        if self.ending is EndOfReturn.HOVER:
            return texts.HOVERS_AT_HOME
        reason = self.objection()
        return texts.LANDS_AT.fill(place=self._label) if reason is None else texts.HOVERS_BECAUSE.fill(reason=reason)


_UNCERTAIN_HOMES = {
    RthHomeType.PILOT: texts.HOVER_HOME_PILOT,
    RthHomeType.FOLLOWEE: texts.HOVER_HOME_FOLLOWED,
    RthHomeType.VEHICLE: texts.HOVER_HOME_VEHICLE,
}
"""Homes that move, or that no client chose in this flight: the drone is left hovering there."""


def _metres(place: GeoPoint | None, other: Position | None) -> float | None:
    """The distance over ground, m; None when one of the places is unknown."""
    if place is None or other is None:
        return None
    return geo.distance(*place, other.latitude, other.longitude)
