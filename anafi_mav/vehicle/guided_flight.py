"""Flies the drone by single commands: to a place, a height and a heading.

The drone makes each move by itself. A move needs no continuous setpoints, so this class does not implement the
flight-task interface.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace

from anafi_mav import texts, units
from anafi_mav.drone import MoveEnd, Position
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.bounds import check_height, check_place
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.move_heading import oriented
from anafi_mav.vehicle.base.refusal import Refused

SAME_HEIGHT = 0.1
"""m by which the height of a moveTo may differ from the commanded one.

Some millimetres distinguish two of them.
"""


@dataclass(frozen=True)
class Goto:
    """Target of a guided move."""

    place: GeoPoint
    ato: float
    """m above take-off."""
    yaw: float | None
    """rad, clockwise from north; None: by the vehicle's `move_heading`."""
    speed: float | None
    """m/s over ground, of this move only; None: the vehicle's cruise speed."""
    mode: FlightMode
    """Mode of the vehicle on the way."""

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


class GuidedFlight:
    """The moves of one vehicle, one at a time: the present target and the last arrival."""

    def __init__(self, vehicle: Aircraft) -> None:
        self._vehicle = vehicle
        self._goto: Goto | None = None
        self._arrived: tuple[GeoPoint, Position | None] | None = None
        """Target of the last completed move, and the drone's newest GPS location then."""

    @property
    def goto(self) -> Goto | None:
        """Target of the present move, by `go` or by a single setpoint in Guided; None without one."""
        goto, vehicle, move = self._goto, self._vehicle, self._vehicle.drone.piloting.move
        if move is None or move.target is None:
            return None
        if goto is not None and goto.mode is vehicle.selected and goto.is_to(move.target):
            return goto
        if vehicle.selected is not FlightMode.GUIDED:
            return None
        target = move.target
        return Goto(GeoPoint(target.latitude, target.longitude), target.altitude, None, None, FlightMode.GUIDED)

    def check(self, place: GeoPoint | None, ato: float | None) -> None:
        """Raise `Refused` for a place or height (m, above take-off) that cannot be flown to now.

        None is not checked.
        """
        if ato is not None:
            check_height(self._vehicle, ato)
        if place is not None:
            check_place(self._vehicle, place, start=self._vehicle.place)

    async def reposition(
        self,
        place: GeoPoint | None,
        ato: float | None,
        yaw: float | None,
        speed: float | None = None,
        mode: FlightMode = FlightMode.HOLD,
    ) -> None:
        """Go to a place, height (m, above take-off) and heading (rad).

        None keeps the present value; for the place also the target of a move under way (as PX4 does), for the heading
        see `move_heading`. Returns when the drone moves; a change of height without a GPS fix returns at its end.

        `speed` (m/s over ground) counts for this move only. `mode` is Hold or Guided.
        """
        vehicle = self._vehicle
        here, present = vehicle.place, vehicle.drone.piloting.state.altitude
        if here is None and place is None and ato is not None:
            await self._climb(ato, yaw, mode)
            return
        if here is None:
            raise Refused(texts.GOTO, texts.NO_FIX)
        if ato is None:
            if present is None:
                raise Refused(texts.GOTO, texts.HEIGHT_UNKNOWN)
            ato = present
        else:
            check_height(vehicle, ato)
        kept = self._standing or here if self.goto is None else self.goto.place
        await self.go(Goto(place or kept, ato, yaw, speed, mode), checked=place is None)

    async def go(self, goto: Goto, *, checked: bool = False) -> None:
        """Fly to a place, or change the move to it. Returns when the drone is on its way.

        `checked`: the place is the drone's own position, which needs no check.
        """
        vehicle = self._vehicle
        if (descent := vehicle.descent) is not None:
            raise Refused(texts.GOTO, descent)
        if not vehicle.in_air:
            raise Refused(texts.GOTO, texts.NOT_IN_AIR)
        if not checked:
            check_place(vehicle, goto.place, start=vehicle.place)
        await vehicle.take_over()
        await vehicle.drone.piloting.cancel_return_home()
        if not vehicle.in_air or vehicle.returning:  # no await from here to the moveTo
            raise Refused(texts.GOTO, vehicle.activity)
        vehicle.select(goto.mode)
        before, self._goto = self._goto, goto
        orientation, heading = oriented(vehicle.move_heading, vehicle.place, goto.place, goto.yaw)
        try:
            await vehicle.drone.piloting.move_to(
                goto.place.latitude,
                goto.place.longitude,
                goto.ato,
                heading_deg=heading,
                horizontal_speed=vehicle.cruise_speed if goto.speed is None else goto.speed,
                vertical_speed=vehicle.climb_speed,
                orientation=orientation,
            )
        except BaseException:
            self._goto = before  # a refused one must not be flown by the next change of height or speed
            raise
        if (move := vehicle.drone.piloting.move) is not None:
            move.ended.add_done_callback(lambda ended: self._on_arrival(goto.place, ended))

    async def _climb(self, ato: float, yaw: float | None, mode: FlightMode) -> None:
        """Go straight up or down to a height (m above take-off) by a moveBy, which needs no GPS fix.

        Returns at the end of the move: a moveBy reports nothing before. The height is the barometer's, and the drone
        may drift sideways as it does when it hovers without a fix.
        """
        vehicle = self._vehicle
        check_height(vehicle, ato)
        await self._begin(texts.GOTO, mode)
        state = vehicle.drone.piloting.state
        if state.altitude is None:
            raise Refused(texts.GOTO, texts.HEIGHT_UNKNOWN)
        turn = 0.0 if yaw is None or state.attitude is None else units.wrap_pi(yaw - state.attitude.yaw)
        await vehicle.drone.piloting.move_by(0.0, 0.0, state.altitude - ato, turn)

    async def _begin(self, what: OperatorText, mode: FlightMode) -> None:
        """Stop the drone for a moveBy. Raises `Refused`, with `what` for the text."""
        vehicle = self._vehicle
        if (descent := vehicle.descent) is not None:
            raise Refused(what, descent)
        if not vehicle.in_air:
            raise Refused(what, texts.NOT_IN_AIR)
        await vehicle.take_over()
        await vehicle.drone.piloting.stop()
        await vehicle.drone.piloting.cancel_return_home()
        if not vehicle.in_air or vehicle.returning:
            raise Refused(what, vehicle.activity)
        vehicle.select(mode)

    async def turn(self, angle: float, rate_dps: float | None, mode: FlightMode) -> None:
        """Turn by `angle` where the drone hovers; return when it has turned.

        `angle` is in rad, clockwise +; `rate_dps` in deg/s (None: the drone's own).
        """
        await self._begin(texts.TURN, mode)
        await self._vehicle.drone.piloting.move_by(0.0, 0.0, 0.0, angle, turn_rate_dps=rate_dps)

    def forget_arrival(self) -> None:
        """Forget the last arrival, because another command is run: the GPS location counts again."""
        self._arrived = None

    @property
    def _standing(self) -> GeoPoint | None:
        """Target of the last move while the drone's GPS location is still from before the arrival.

        A location is reported once a second only, and to use it would fly the drone back by some metres.
        """
        if self._arrived is None or self._vehicle.drone.gps.state.location is not self._arrived[1]:
            return None
        return self._arrived[0]

    def _on_arrival(self, place: GeoPoint, ended: asyncio.Future[MoveEnd]) -> None:
        if not ended.cancelled() and ended.result() is MoveEnd.DONE:
            self._arrived = place, self._vehicle.drone.gps.state.location
