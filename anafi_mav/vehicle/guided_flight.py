"""Flies the drone by single commands: to a place, a height and a heading.

The drone makes each move by itself. The flight task is the target, a `Goto`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

from anafi_mav import texts, units
from anafi_mav.drone import Drone, MoveEnd, Position
from anafi_mav.drone.events import AttitudeChanged
from anafi_mav.drone.expectation import loop_time
from anafi_mav.drone.piloting.moves import Move
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.errors import CommandRejected
from anafi_mav.texts import OperatorText, Subject
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import check_height, check_place
from anafi_mav.vehicle.base.flight_task import Hover, Needs, PlainTask, Preparation, TaskRules
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.move_heading import MoveHeading, oriented
from anafi_mav.vehicle.base.refusal import Refused, Unfinished
from anafi_mav.vehicle.base.requester import By
from anafi_mav.vehicle.base.severity import Severity

SAME_HEIGHT = 0.1
"""m by which the height of a moveTo may differ from the commanded one.

Some millimetres distinguish two of them.
"""

AT_REST = 0.01
"""rad between two reports of the heading, 0.2 s apart, of a drone that does not turn."""

SHORT_CLIMB, SHORT_TURN = 1.0, 0.2
"""m and rad by which a moveBy that something else has ended is short of its end."""

REST_WAIT = 2.0
"""s until a turn counts from the newest heading, whether or not the drone turns. MaxRotationSpeed ends within one."""

_SHORT = (MoveEnd.ERROR, MoveEnd.CANCELED)
"""Ends of a move short of its target."""


def early_end_reason(how: MoveEnd, drone: Drone) -> OperatorText:
    """Return why a move has ended short of its target, without a newer command."""
    if drone.controller.pilot_acquired_control:
        return texts.PILOT
    return texts.MOVE_FAILED if how is MoveEnd.ERROR else texts.MOVE_CANCELLED


GOTO = TaskRules(texts.GOTO, needs=Needs.NO_DESCENT | Needs.IN_AIR, follows=True, needs_link=True)


def _rules_of_offset(what: Subject) -> TaskRules:
    """Return the rules of a moveBy, which ends in a hovering mode by itself."""
    return TaskRules(what, needs=Needs.NO_DESCENT | Needs.IN_AIR, start=Preparation.STOP, is_hover=True, follows=True)


TURN = _rules_of_offset(texts.TURN)


@dataclass(frozen=True)
class Goto(PlainTask):
    """Target of a guided move; the flight task that flies to it."""

    place: GeoPoint
    ato: float
    """m above take-off."""
    yaw: float | None
    """rad, clockwise from north; None: by the vehicle's `move_heading`."""
    speed: float | None
    """m/s over ground, of this move only; None: the vehicle's cruise speed."""
    mode: FlightMode
    """Mode of the vehicle on the way, and at its end: Hold or Guided."""
    cruise_orders: int = field(default=0, compare=False)
    """The vehicle's when the speed was named: a newer command of the cruise speed replaces that."""
    rules: ClassVar[TaskRules] = GOTO

    def is_flown(self, piloting: Piloting) -> bool:
        """Return True when the drone flies there."""
        return piloting.move is not None and piloting.move.target is not None and self.is_to(piloting.move.target)

    def is_to(self, target: Position) -> bool:
        """True when a moveTo with this target (height above take-off) flies there."""
        return (
            self.place.latitude == target.latitude
            and self.place.longitude == target.longitude
            and abs(self.ato - target.altitude) < SAME_HEIGHT
        )

    def at_height(self, ato: float) -> Goto:
        return replace(self, ato=ato)

    def with_heading(self, yaw: float) -> Goto:
        return replace(self, yaw=yaw)


class _Flown(NamedTuple):
    """A goto that was begun, and its move."""

    goto: Goto
    move: Move

    @property
    def has_arrived(self) -> bool:
        return self.move.ended.done() and self.move.ended.result() is MoveEnd.DONE


class _Ended(NamedTuple):
    """A move that has ended, and what was true then."""

    goto: Goto
    is_short: bool
    """The drone, or another controller, has ended it short of its target."""
    location: Position | None
    """The drone's newest GPS location."""
    epoch: int
    """The control's: a change of it is a newer command."""


class GuidedFlight:
    """The moves of one vehicle, one at a time: the present target and the last end."""

    def __init__(self, vehicle: Aircraft) -> None:
        self._vehicle = vehicle
        self._newest: _Flown | _Ended | None = None

    @property
    def _ended(self) -> _Ended | None:
        """The newest move that has ended, while nothing was commanded since."""
        ended = self._newest
        return ended if isinstance(ended, _Ended) and ended.epoch == self._vehicle.control.epoch else None

    @property
    def holds(self) -> bool:
        """True while the newest goto is flown, and at its target while nothing was commanded since.

        False once it has ended short of it, or the drone has begun to land or return.
        """
        if self._vehicle.descent is not None:
            return False
        return isinstance(self._vehicle.control.active, Goto) or (self._ended is not None and not self._ended.is_short)

    @property
    def goto(self) -> Goto | None:
        """Target of the present move, by `go` or by a single setpoint in Guided; None without one."""
        control, move = self._vehicle.control, self._vehicle.drone.piloting.move
        if move is None or move.target is None:
            return None
        goto = control.active
        if isinstance(goto, Goto):
            return goto
        if control.mode is not FlightMode.GUIDED:
            return None
        target = move.target
        return Goto(GeoPoint(target.latitude, target.longitude), target.altitude, None, None, FlightMode.GUIDED)

    def check(self, place: GeoPoint | None, ato: float | None, start: GeoPoint | None = None) -> None:
        """Raise `Refused` for a place or height (m, above take-off) that cannot be flown to now.

        None is not checked. `start`: the drone's place, where the caller knows it.
        """
        if ato is not None:
            check_height(self._vehicle, ato)
        if place is not None:
            check_place(self._vehicle, place, start=start or self._vehicle.place)

    async def reposition(
        self,
        place: GeoPoint | None,
        ato: float | None,
        yaw: float | None,
        speed: float | None = None,
        mode: FlightMode = FlightMode.HOLD,
        *,
        by: By,
    ) -> None:
        """Go to a place, height (m, above take-off) and heading (rad).

        None keeps the value that the drone has when its move begins: where it comes to rest, and its height. For the
        place that is also the target of a move under way (as PX4 does), for the heading see `move_heading`. Returns
        when the drone moves; a change of height without a GPS fix returns at its end.

        `speed` (m/s over ground) counts for this move only. `mode` is Hold or Guided.
        """
        vehicle = self._vehicle
        if place is None and ato is not None and vehicle.place is None:
            await self._climb(ato, yaw, mode, by)
            return
        kept = place or (self._standing if (under_way := self.goto) is None else under_way.place)

        def target() -> Goto:
            here, height = vehicle.place, ato
            where = kept or vehicle.stopping_place
            if where is None or here is None:
                raise Refused(texts.GOTO, texts.NO_FIX)
            if height is None and (height := vehicle.drone.piloting.state.altitude) is None:
                raise Refused(texts.GOTO, texts.HEIGHT_UNKNOWN)
            self.check(place, ato, start=here)
            return Goto(where, height, yaw, speed, mode, vehicle.commanded_speeds.cruise_orders)

        await self._fly(target, by)

    async def go(self, goto: Goto, *, by: By, ato: float | None = None) -> None:
        """Fly to a place, or change the move to it. Returns when the drone is on its way.

        `ato`: the height of it, where the client has set it and it is to be checked, as the place is.
        """

        def target() -> Goto:
            self.check(goto.place, ato)
            return goto

        await self._fly(target, by)

    async def _fly(self, target: Callable[[], Goto], by: By) -> None:
        """Fly to a target that is known when what flew before has ended.

        `target` raises `Refused` for one that is not flown to. It is called on both sides of each wait: a drone at
        speed is elsewhere after it.
        """
        control, piloting = self._vehicle.control, self._vehicle.drone.piloting
        no_setpoint = piloting.move is None or isinstance(control.active, Goto)
        setpoint, epoch = None if no_setpoint else self.goto, control.epoch
        goto = target()
        known: Goto | None = goto

        def condition() -> Goto:
            """Return the target of before where no wait has passed since."""
            nonlocal known
            found, known = known or target(), None
            return found

        try:
            async with control.acquire(goto, by=by, below=Hover(goto.mode), condition=condition) as grant:
                goto = grant.found
                grant.begin(goto)
                await self.move(goto)
        except BaseException:
            # The move of a single setpoint goes on as a goto does, whose task `acquire` makes active again.
            if setpoint is not None and control.epoch != epoch and control.is_free and setpoint.is_flown(piloting):
                control.adopt(setpoint, below=Hover(setpoint.mode))
            raise

    async def move(self, goto: Goto) -> None:
        """Let the drone begin the move of the active task; no await before the moveTo."""
        vehicle, rule = self._vehicle, self._vehicle.settings.move_heading
        named = goto.speed if goto.cruise_orders == vehicle.commanded_speeds.cruise_orders else None
        keeps = goto.yaw is None and rule is MoveHeading.KEEP
        orientation, heading = None, None
        if not keeps:
            orientation, heading = oriented(rule, vehicle.place, goto.place, goto.yaw)
        await vehicle.drone.piloting.move_to(
            goto.place.latitude,
            goto.place.longitude,
            goto.ato,
            heading_deg=heading,
            horizontal_speed=vehicle.cruise_speed if named is None else named,
            vertical_speed=vehicle.climb_speed,
            orientation=orientation,
        )
        if (move := vehicle.drone.piloting.move) is not None:
            self._newest = _Flown(goto, move)
            move.ended.add_done_callback(lambda ended: self._on_end(goto, ended))

    async def _climb(self, ato: float, yaw: float | None, mode: FlightMode, by: By) -> None:
        """Go straight up or down to a height (m above take-off) by a moveBy, which needs no GPS fix.

        Returns at the end of the move: a moveBy reports nothing before. The height is the barometer's, and the drone
        may drift sideways as it does when it hovers without a fix.
        """
        vehicle, hover, rules = self._vehicle, Hover(mode), _rules_of_offset(texts.GOTO)
        async with vehicle.control.acquire(
            hover, by=by, rules=rules, condition=lambda: check_height(vehicle, ato)
        ) as grant:
            grant.begin()
            turn = 0.0 if yaw is None else units.wrap_pi(yaw - await self._resting_heading())
            height = await vehicle.next_height()
            vehicle.control.check(hover, by, rules)
            await self._offset(rules, height - ato, turn)

    async def turn(
        self, angle_from: Callable[[float], float], rate_dps: float | None, mode: FlightMode, by: By
    ) -> None:
        """Turn where the drone hovers; return when it has turned.

        `angle_from` returns the angle to turn (rad, clockwise +) from the heading (rad) at which the drone has come to
        rest; `rate_dps` in deg/s (None: the drone's own).
        """
        vehicle, hover, rules = self._vehicle, Hover(mode), TURN
        async with vehicle.control.acquire(hover, by=by, rules=rules) as grant:
            grant.begin()
            angle = angle_from(await self._resting_heading())
            vehicle.control.check(hover, by, rules)
            await self._offset(rules, 0.0, angle, rate_dps)

    async def _offset(self, rules: TaskRules, down: float, turn: float, rate_dps: float | None = None) -> None:
        """Fly a moveBy (m, rad) to its end. No await before it: its needs have just been checked.

        Raises `Unfinished` when a landing, a return or the pilot has ended it: it was no refusal, since it had begun.
        A drone that begins one may report the end of the move without an error, and how far it has come.
        """
        vehicle, controller = self._vehicle, self._vehicle.drone.controller
        takeovers = controller.takeovers
        try:
            flown = await vehicle.drone.piloting.move_by(0.0, 0.0, down, turn, turn_rate_dps=rate_dps)
        except CommandRejected as error:
            reason = texts.PILOT if controller.takeovers != takeovers else vehicle.lacking(rules.needs)
            if reason is None:
                raise
            raise Unfinished(rules.what, reason) from error
        is_short = abs(flown.down - down) > SHORT_CLIMB or abs(units.wrap_pi(flown.turn - turn)) > SHORT_TURN
        if is_short:
            raise Unfinished(rules.what, vehicle.lacking(rules.needs) or texts.MOVE_FAILED)

    async def _resting_heading(self) -> float:
        """Return the heading (rad) once the drone turns no further, or after `REST_WAIT`.

        A moveBy turns from the heading at its beginning, and what flew before may have turned the drone: its newest
        report is up to 0.2 s old, and it turns on for a moment after a stop.
        """
        drone, until = self._vehicle.drone, loop_time() + REST_WAIT
        attitude = drone.piloting.state.attitude
        before = None if attitude is None else attitude.yaw
        while True:
            yaw = (await drone.expect(AttitudeChanged, timeout=REST_WAIT)).yaw
            if (before is not None and abs(units.wrap_pi(yaw - before)) < AT_REST) or loop_time() > until:
                return yaw
            before = yaw

    @property
    def _standing(self) -> GeoPoint | None:
        """Target of the last move while the drone's GPS location is still from before the arrival.

        A location is reported once a second only, and to use it would fly the drone back by some metres.
        """
        flown, ended = self._newest, self._ended
        if isinstance(flown, _Flown) and flown.goto is self._vehicle.control.active and flown.has_arrived:
            return flown.goto.place  # `_on_end` is called in the next iteration of the event loop
        if ended is None or ended.is_short or self._vehicle.drone.gps.state.location is not ended.location:
            return None
        return ended.goto.place

    def _on_end(self, goto: Goto, ended: asyncio.Future[MoveEnd]) -> None:
        """A move has ended: the drone hovers, at its target or short of it, and the task is over.

        Every client gets a text when it is short of it, and none has commanded that: the mode does not change.
        """
        vehicle, control = self._vehicle, self._vehicle.control
        if control.active is not goto:
            return  # a newer command has ended it
        how = ended.result()
        is_short = how in _SHORT
        if how is MoveEnd.DONE or is_short:
            control.release(goto)
            self._newest = _Ended(goto, is_short, vehicle.drone.gps.state.location, control.epoch)
        if is_short:
            reason = early_end_reason(how, vehicle.drone)
            vehicle.text(Severity.WARNING, texts.TASK_ENDED.fill(what=texts.GOTO, reason=reason))
