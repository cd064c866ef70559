"""Guided flight by single commands: speed, height, heading, pause, home.

What goes to a place is `flight_service`; what circles is `orbit_service`. A handler returns when the drone
confirmed. Regions of interest are in `services.gimbal`. Conformance A4, B1, B2, D1 and items 78-83, 143.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import replace

from anafi_mav import texts, units
from anafi_mav.drone import Position
from anafi_mav.drone.events import RthHomeType
from anafi_mav.errors import AnafiMavError, NotSupported
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Action, Altitude, Command, Effect, ProgressPolicy
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.service import Host, MessageHandler, Service
from anafi_mav.vehicle.base.bounds import (
    FASTEST,
    SLOWEST,
    UnsupportedFrame,
    check_on_earth,
    height_in_frame,
    home_height,
)
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.base.yaw import DEG_PER_TURN, heading_of
from anafi_mav.vehicle.guided_flight import TURN, Goto
from anafi_mav.vehicle.vehicle import Vehicle

KEEP, DEFAULT = -1.0, -2.0
"""Values for "no change" and "back to the default" in speed and throttle.

Source: MAVLink common.xml DO_CHANGE_SPEED.
"""

_AIRSPEED, _GROUNDSPEED = 0.0, 1.0
_UPWARDS, _DOWNWARDS = 2.0, 3.0
"""SPEED_TYPE."""

_OWN_SPEED = (FlightMode.MISSION, FlightMode.RETURN, FlightMode.LAND)
"""Modes in which the drone flies at a speed that no command changes."""

SLOWEST_TURN = 1.0
"""deg/s. A slower turn is a number in the wrong field, and would take forever."""

_ITEM_GOTO, _ITEM_ALTITUDE = 2, 3
"""`current` of a mission item that is a command (ArduPilot, MAVLink mission.md)."""


async def _fly_item(host: Host, inbound: Inbound, by: Right) -> None:
    item, flavour = inbound.message, flavour_of(inbound.channel)
    scale = 1e7 if item.get_msgId() == dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT else 1.0
    vehicle, result = host.vehicle, dialect.MAV_MISSION_ERROR
    try:
        ato = height_in_frame(vehicle, item.z, item.frame)
        if flavour.guided_setpoints and flavour.custom_mode(vehicle.mode) != flavour.custom_mode(FlightMode.GUIDED):
            raise Refused(texts.GOTO, texts.NOT_GUIDED)  # as in ArduCopter, in whose other modes it moves nothing
        if item.current == _ITEM_GOTO:
            if item.command != dialect.MAV_CMD_NAV_WAYPOINT:
                raise Refused(texts.GOTO, texts.NOT_A_WAY_POINT, lasting=True)
            where = GeoPoint(item.x / scale, item.y / scale)
            check_on_earth(where, texts.GOTO)
            await vehicle.reposition(where, ato, None, mode=flavour.guided_mode, by=by)
        else:
            await change_altitude(vehicle, ato, flavour, by)
        result = dialect.MAV_MISSION_ACCEPTED
    except UnsupportedFrame:
        result = dialect.MAV_MISSION_UNSUPPORTED_FRAME
        raise
    except Refused as error:
        result = dialect.MAV_MISSION_INVALID if error.lasting else dialect.MAV_MISSION_DENIED
        raise
    except asyncio.CancelledError:
        result = dialect.MAV_MISSION_OPERATION_CANCELLED
        raise
    finally:
        host.send(dialect.MAVLink_mission_ack_message(inbound.sysid, inbound.compid, result), inbound.channel)


async def change_altitude(vehicle: Vehicle, ato: float, flavour: Flavour, by: Right) -> None:
    """Go to a height (m above take-off): at the target of a move under way, else here."""
    goto = vehicle.guided.goto
    if goto is None:
        await vehicle.guided.reposition(None, ato, None, mode=flavour.guided_mode, by=by)
    else:
        move = vehicle.drone.piloting.move
        # MAVProxy says it as a command and as an item at once, and means one move. If nothing comes of that, the newer
        # order stands for itself.
        if goto.at_height(ato) != goto or move is None or not await move.under_way():
            await vehicle.guided.go(goto.at_height(ato), by=by, ato=ato)


def _effect_of_pause(command: Command) -> Effect:
    return Effect.HOLD if command.params[0] == 0.0 else Effect.CHANGE


def _effect_of_turn(command: Command) -> Effect:
    """A turn by an angle counts each time; a turn to a heading may be answered twice."""
    return Effect.EACH if command.params[3] == 1.0 else Effect.CHANGE


class GuidedService(Service):
    """Changes the flight under way."""

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_DO_CHANGE_SPEED: Action(
                self._change_speed, location=False, altitude=Altitude.UNUSED, effect=Effect.EACH
            ),
            dialect.MAV_CMD_DO_CHANGE_ALTITUDE: Action(
                self._change_altitude,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.CHANGE,
                still_holds=lambda command: self.host.vehicle.guided.holds,
            ),
            dialect.MAV_CMD_CONDITION_YAW: Action(
                self._turn,
                location=False,
                altitude=Altitude.UNUSED,
                effect=_effect_of_turn,
                progress=ProgressPolicy.EARLY,
                still_holds=lambda command: not self.host.vehicle.descends,
            ),
            dialect.MAV_CMD_DO_PAUSE_CONTINUE: Action(
                self._pause_or_continue,
                location=False,
                altitude=Altitude.UNUSED,
                effect=_effect_of_pause,
                still_holds=lambda command: not self.host.vehicle.descends,
            ),
            dialect.MAV_CMD_DO_SET_HOME: Action(
                self._set_home,
                location=True,
                altitude=Altitude.AMSL,
                effect=Effect.EACH,
                progress=ProgressPolicy.LATE,
            ),
        }

    def item_commands(self) -> Mapping[int, MessageHandler]:
        return {_ITEM_GOTO: self._item, _ITEM_ALTITUDE: self._item}

    def _item(self, inbound: Inbound) -> None:
        """Carry out a mission item that belongs to no mission, and acknowledge it with MISSION_ACK.

        ArduPilot's older way to send a goto or a height: dronekit's simple_goto, MAVProxy's and Mission Planner's
        change of altitude (conformance D1-D3, item 141).
        """
        by = self.host.vehicle.right(inbound.client, Extent.COMMANDED)
        self.host.run_action(inbound.client, _fly_item(self.host, inbound, by))

    async def _change_speed(self, command: Command) -> None:
        """MAV_CMD_DO_CHANGE_SPEED: param1 SPEED_TYPE, param2 m/s.

        A move that is under way changes its speed at once. A mission, a return and a landing are flown at a speed of
        the drone's own, so it is refused there (ArduCopter: FAILED in modes without a speed).

        Unset and -1 change nothing, -2 restores the speed of the parameter (ANF_CRUISE_SPEED, ANF_CLIMB_SPEED), and so
        does the landing. The drone itself limits a value above its maximum. An ANAFI measures no airspeed: both
        horizontal types are over ground.
        """
        kind, speed, throttle = command.params[:3]
        if not (math.isnan(throttle) or throttle in (0.0, KEEP, DEFAULT)):
            raise Refused(texts.SPEED, texts.NO_THROTTLE, lasting=True)
        if math.isnan(kind):
            kind = _GROUNDSPEED
        if kind not in (_AIRSPEED, _GROUNDSPEED, _UPWARDS, _DOWNWARDS):
            raise Refused(texts.SPEED, texts.PARAM1_TO_3, lasting=True)
        if math.isnan(speed) or speed == KEEP:
            return
        if speed != DEFAULT and not SLOWEST <= speed <= FASTEST:
            raise Refused(texts.SPEED, texts.PARAM2_SPEED.fill(slowest=SLOWEST, fastest=FASTEST), lasting=True)
        wanted = None if speed == DEFAULT else speed
        vehicle = self.host.vehicle
        if vehicle.mode in _OWN_SPEED:
            raise Refused(texts.SPEED, texts.FIXED_IN_MODE.fill(mode=vehicle.mode.value))
        speeds = vehicle.commanded_speeds
        if kind in (_AIRSPEED, _GROUNDSPEED):
            vehicle.commanded_speeds = replace(speeds, cruise=wanted, cruise_orders=speeds.cruise_orders + 1)
        else:
            vehicle.commanded_speeds = replace(speeds, climb=wanted)
        if (goto := vehicle.guided.goto) is not None:
            await vehicle.guided.go(goto, by=command.right)

    async def _change_altitude(self, command: Command) -> None:
        """MAV_CMD_DO_CHANGE_ALTITUDE: param1 height in m, param2 MAV_FRAME.

        During a move it changes the height of the move's target.
        """
        vehicle = self.host.vehicle
        frame = command.params[1]
        if not math.isfinite(frame):
            raise Refused(texts.ALTITUDE_CHANGE, texts.PARAM2_FRAME, lasting=True)
        ato = height_in_frame(vehicle, command.params[0], int(frame))
        await change_altitude(vehicle, ato, command.flavour, command.right)

    async def _turn(self, command: Command) -> None:
        """Run MAV_CMD_CONDITION_YAW: turn to a heading or by an angle.

        param1 deg, param2 deg/s (unset or 0: the drone's own), param3 direction, param4 relative. On the way to a
        place the drone turns while it flies on, the shorter way; else it turns where it hovers. A take-off under way
        is flown to its end before.
        """
        angle, rate, way, relative = command.params
        if not math.isfinite(angle) or abs(angle) > DEG_PER_TURN:
            raise Refused(texts.TURN, texts.PARAM1_ANGLE, lasting=True)
        if math.isinf(rate) or rate < 0.0 or 0.0 < rate < SLOWEST_TURN or math.isinf(way):
            raise Refused(texts.TURN, texts.PARAM2_RATE.fill(slowest=SLOWEST_TURN), lasting=True)
        if not (math.isnan(relative) or relative in (0.0, 1.0)):  # ArduCopter refuses it too
            raise Refused(texts.TURN, texts.PARAM4_BINARY, lasting=True)
        vehicle = self.host.vehicle
        await vehicle.takeoff.over(TURN)
        attitude = vehicle.drone.piloting.state.attitude
        if not vehicle.in_air or attitude is None:
            raise Refused(texts.TURN, texts.HEADING_UNKNOWN if vehicle.in_air else vehicle.activity)

        def angle_from(yaw: float) -> float:
            turn = heading_of(angle, 0.0 if math.isnan(way) else way, relative == 1.0, yaw * units.DEG_PER_RAD)
            return turn * units.RAD_PER_DEG

        if (goto := vehicle.guided.goto) is not None:
            heading = attitude.yaw + angle_from(attitude.yaw)
            await vehicle.guided.go(goto.with_heading(heading), by=command.right)
        else:
            await vehicle.guided.turn(
                angle_from, rate if rate > 0.0 else None, command.flavour.guided_mode, command.right
            )

    async def _pause_or_continue(self, command: Command) -> None:
        """Run MAV_CMD_DO_PAUSE_CONTINUE: param1 0 hovers, 1 continues.

        Continue means to fly on to the target of the move that the pause stopped, or to resume its mission. After a
        pause that stopped neither, setpoints may fly the drone again. Refused when the vehicle was commanded
        otherwise since, the mission was replaced, or the drone has landed.
        """
        vehicle = self.host.vehicle
        if command.params[0] == 0.0:
            await vehicle.hold(command.flavour.guided_mode, command.right, pause=True)
        elif command.params[0] == 1.0:
            task = vehicle.interrupted
            if isinstance(task, Goto):
                await vehicle.guided.go(task, by=command.right)
            elif task is vehicle.mission and vehicle.mission.paused:
                await vehicle.set_mode(FlightMode.MISSION, command.right)
            elif task is None and vehicle.control.has_pause:
                vehicle.control.resume()  # setpoints may fly it again
            else:
                raise Refused(texts.CONTINUE, texts.NOTHING_PAUSED)
        else:
            raise Refused(texts.PAUSE, texts.PARAM1_BINARY, lasting=True)

    # Home.

    async def _prefer(self, kind: RthHomeType) -> None:
        try:
            await self.host.drone.home.set_preferred_type(kind)
        except AnafiMavError as error:
            self.host.text(Severity.CRITICAL, texts.HOME_TYPE_KEPT.fill(error=error))

    async def _restore_place(self, place: Position) -> None:
        try:
            await self.host.drone.home.set_custom_location(place.latitude, place.longitude, place.altitude)
        except AnafiMavError as error:
            self.host.text(Severity.CRITICAL, texts.HOME_PLACE_KEPT.fill(error=error))

    async def _set_home(self, command: Command) -> None:
        """MAV_CMD_DO_SET_HOME: param1 1 takes the drone's position, else the command's place.

        The drone's home becomes one of Parrot's type custom, and stays that until a client changes it: a text reports
        this. During a return that the drone has begun by itself its position is refused: the drone would be at home at
        once, and hover there. A place elsewhere leads it there.
        """
        vehicle, home = self.host.vehicle, self.host.drone.home
        is_here = command.params[0] == 1.0

        def require_no_own_return() -> None:
            if is_here and vehicle.returning_by_itself:
                raise Refused(texts.HOME, texts.RETURNS_BY_ITSELF)

        require_no_own_return()
        if is_here:
            where, ato = vehicle.place, 0.0  # below the drone, not where it flies
            if where is None:
                raise Refused(texts.HOME, texts.POSITION_UNKNOWN)
        else:
            where = command.place()
            if where is None:
                raise Refused(texts.HOME, texts.NO_PLACE, lasting=True)
            ato = command.height(vehicle, flown=False) or 0.0
        check_on_earth(where, texts.HOME)
        async with vehicle.home_choice:
            # First the place: preferred before it, the custom home of some other day would be home until it is sent.
            require_no_own_return()
            before, old = home.state.preferred_type, home.state.custom_location
            is_custom = before == RthHomeType.CUSTOM  # then the place is home as soon as the drone has it
            given: Position | None = None
            try:
                given = await home.set_custom_location(where.latitude, where.longitude, home_height(vehicle, ato))
                if not is_custom:
                    require_no_own_return()
                await home.set_preferred_type(RthHomeType.CUSTOM)
            except BaseException as error:
                # What is not reported to be home must not stay it: a return that replaces this waits until it is not.
                if is_custom and old is not None:
                    await asyncio.wait([self.host.spawn(self._restore_place(old))])
                elif is_custom and not isinstance(error, NotSupported):
                    self.host.text(Severity.CRITICAL, texts.HOME_PLACE_KEPT.fill(error=texts.HOME_PLACE_UNKNOWN))
                elif given is not None and before is not None and not is_custom:
                    await asyncio.wait([self.host.spawn(self._prefer(before))])
                raise
        vehicle.return_end.set_home(given, texts.SET_HOME)
        self.host.text(Severity.NOTICE, texts.HOME_SET)
