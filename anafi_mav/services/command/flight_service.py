"""Arming, take-off, landing, return, goto and changes of the mode: of the autopilot alone.

A handler returns when the drone confirmed, or raises.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import geo, texts
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import (
    EFFECT_OF_MODE,
    Action,
    Altitude,
    Command,
    Effect,
    ProgressPolicy,
    effect_of_mode,
)
from anafi_mav.services.flavours import flavour_of
from anafi_mav.services.service import MessageHandler, Service
from anafi_mav.texts import Template
from anafi_mav.vehicle.base.bounds import FASTEST, SLOWEST
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, Unsupported
from anafi_mav.vehicle.base.right import Extent, Right
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.mission.path import AWAY
from anafi_mav.vehicle.vehicle import Vehicle

FORCE = 21196
"""param2 of an arm or disarm that overrides checks (MAVLink common.xml MAV_CMD_COMPONENT_ARM_DISARM)."""

CHANGE_MODE = dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
RELATIVE_YAW = dialect.MAV_DO_REPOSITION_FLAGS_RELATIVE_YAW


class FlightService(Service):
    """The commands that begin and end flights, and SET_MODE. The newest one wins."""

    def capabilities(self) -> int:
        return dialect.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION if self.host.vehicle.allow_kill else 0

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: Action(
                self._arm_or_disarm, location=False, altitude=Altitude.UNUSED, effect=_effect_of_arm
            ),
            dialect.MAV_CMD_NAV_TAKEOFF: Action(
                self._take_off, location=True, altitude=Altitude.BY_FRAME, effect=Effect.IRREVOCABLE
            ),
            dialect.MAV_CMD_NAV_LAND: Action(
                self._land,
                location=True,
                altitude=Altitude.UNUSED,
                effect=Effect.LAND,
            ),
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: Action(
                lambda command: self.host.vehicle.return_home(command.right),
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.RETURN,
            ),
            dialect.MAV_CMD_DO_REPOSITION: Action(
                self._reposition,
                location=True,
                altitude=Altitude.BY_FRAME,
                effect=_effect_of_reposition,
                progress=ProgressPolicy.EARLY,
                still_holds=lambda command: self.host.vehicle.guided.holds,
            ),
            dialect.MAV_CMD_DO_SET_MODE: Action(
                lambda command: change_mode(self.host.vehicle, command.mode, command.right),
                location=False,
                altitude=Altitude.UNUSED,
                effect=effect_of_mode,
                mode=lambda command: command.flavour.mode_of_parameters(command.params[1], command.params[2]),
                progress=ProgressPolicy.LATE,
            ),
            dialect.MAV_CMD_NAV_LOITER_UNLIM: Action(
                self._loiter,
                location=True,
                altitude=Altitude.UNUSED,
                effect=effect_of_mode,
                mode=lambda command: FlightMode.POSITION,
                progress=ProgressPolicy.LATE,
                offered=lambda flavour: flavour.loiter_command,
            ),
            dialect.MAV_CMD_DO_FLIGHTTERMINATION: Action(
                self._terminate, location=False, altitude=Altitude.UNUSED, effect=Effect.KILL
            ),
        }

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_SET_MODE: self._set_mode}

    async def _arm_or_disarm(self, command: Command) -> None:
        """MAV_CMD_COMPONENT_ARM_DISARM: param1 1 arm, 0 disarm; param2 21196 disarms by force."""
        if command.params[0] == 1.0:
            await self.host.vehicle.takeoff.arm(command.right)
        elif command.params[0] == 0.0:
            await self.host.vehicle.takeoff.disarm(command.right, force=command.params[1] == FORCE)
        else:
            raise Refused(texts.ARMING, texts.PARAM1_BINARY, lasting=True)

    async def _take_off(self, command: Command) -> None:
        """Run MAV_CMD_NAV_TAKEOFF; the reference of z depends on the client (conformance E2).

        Unset: the height of MIS_TAKEOFF_ALT. COMMAND_LONG with latitude and longitude exactly 0, or from a client whose
        family means it so: above the take-off point (MAVProxy, dronekit, Mission Planner). Any other COMMAND_LONG: AMSL
        (QGroundControl). COMMAND_INT: as its frame says. The position is not used: an ANAFI takes off where it stands,
        and a text reports a position elsewhere.
        """
        vehicle = self.host.vehicle
        relative = command.flavour.relative_takeoff or (command.x == 0.0 and command.y == 0.0)
        if command.frame is None and relative and not math.isnan(command.z):
            await vehicle.take_off(command.z, command.right)
        else:
            await vehicle.take_off(command.height(vehicle), command.right)
        self._report_place(command, texts.TAKEOFF_PLACE)

    async def _land(self, command: Command) -> None:
        """Run MAV_CMD_NAV_LAND; the position is not used, and a text reports one elsewhere."""
        await self.host.vehicle.land(command.right)
        if not self.host.vehicle.on_ground:
            self._report_place(command, texts.LANDING_ELSEWHERE)

    async def _loiter(self, command: Command) -> None:
        """Run MAV_CMD_NAV_LOITER_UNLIM; the position is not used, and a text reports one elsewhere."""
        await change_mode(self.host.vehicle, command.mode, command.right)
        self._report_place(command, texts.LOITER_ELSEWHERE)

    def _report_place(self, command: Command, text: Template) -> None:
        """Report that the position of a command is not used, when it is elsewhere."""
        here = self.host.vehicle.place
        if here is None or not (abs(command.x) <= 90.0 and abs(command.y) <= 180.0) or command.x == command.y == 0.0:
            return  # unset; QGroundControl and MAVSDK send NaN, the others 0
        metres = geo.distance(here.latitude, here.longitude, command.x, command.y)
        if metres > AWAY:
            self.host.text(Severity.WARNING, text.fill(metres=metres))

    async def _reposition(self, command: Command) -> None:
        """Run MAV_CMD_DO_REPOSITION: go to a place, height and heading.

        param1 speed in m/s (unset or <= 0: the drone's own), param4 heading in rad, x, y, z.

        param2 bit 0 (CHANGE_MODE): see `_require_change_of_mode`; bit 1 (RELATIVE_YAW): the heading is relative to the
        present one. z obeys the frame: 0 and 5 AMSL, 3 and 6 above take-off. All unset is pause, with or without
        CHANGE_MODE: it stops something. A speed alone is refused.
        """
        vehicle, speed = self.host.vehicle, command.params[0]
        if math.isinf(speed) or abs(command.params[3]) > 2.0 * math.pi:
            raise Refused(texts.GOTO, texts.PARAM1_SPEED_HEADING, lasting=True)
        if speed > 0.0 and not SLOWEST <= speed <= FASTEST:
            raise Refused(texts.SPEED, texts.SPEED_RANGE.fill(slowest=SLOWEST, fastest=FASTEST), lasting=True)
        where, ato, heading = command.place(), command.height(vehicle), _heading(command)
        mode = command.flavour.guided_mode
        if where is None and ato is None and heading is None:
            if speed > 0.0:
                raise Refused(texts.GOTO, texts.SPEED_ALONE, lasting=True)
            await vehicle.hold(mode, command.right, pause=True)
            return
        if not _flags(command) & CHANGE_MODE:
            _require_change_of_mode(vehicle, command)
        if heading is not None and _flags(command) & RELATIVE_YAW:
            attitude = vehicle.drone.piloting.state.attitude
            if attitude is None:
                raise Refused(texts.GOTO, texts.HEADING_UNKNOWN)
            heading += attitude.yaw
        speed_limit = speed if speed > 0.0 else None
        await vehicle.reposition(where, ato, heading, speed_limit, mode=mode, by=command.right)

    async def _terminate(self, command: Command) -> None:
        """MAV_CMD_DO_FLIGHTTERMINATION: param1 1 cuts the motors."""
        if command.params[0] != 1.0:
            raise Refused(texts.TERMINATION, texts.NOT_REVOCABLE, lasting=True)
        await self.host.vehicle.terminate(command.right)

    def _set_mode(self, inbound: Inbound) -> None:
        """SET_MODE has no acknowledgement: the heartbeat shows the mode, a text the refusal."""
        mode: FlightMode | None = flavour_of(inbound.channel).mode_of_number(inbound.message.custom_mode)
        client, vehicle, now = inbound.client, self.host.vehicle, self.host.clock.monotonic()
        is_hold = mode is not None and EFFECT_OF_MODE[mode] is Effect.HOLD
        counted = not is_hold or vehicle.holds.arrive(client, now)
        self.host.run_action(client, change_mode(vehicle, mode, vehicle.right(client, Extent.ALL, counted=counted)))


async def change_mode(vehicle: Vehicle, mode: FlightMode | None, by: Right) -> None:
    """Enter a mode that a message selected; None is a mode that we do not have."""
    if mode is None:
        raise Refused(texts.MODE, texts.NO_SUCH_MODE, lasting=True)
    await vehicle.set_mode(mode, by)


def _require_change_of_mode(vehicle: Vehicle, command: Command) -> None:
    """Refuse a reposition without CHANGE_MODE where it would change the mode.

    PX4 supports none without it (Commander.cpp), ArduCopter takes it in Guided (GCS_MAVLink_Copter.cpp).
    """
    flavour = command.flavour
    if not flavour.guided_setpoints:
        raise Unsupported(texts.GOTO, texts.NO_CHANGE_MODE)
    if flavour.custom_mode(vehicle.mode) != flavour.custom_mode(FlightMode.GUIDED):
        raise Refused(texts.GOTO, texts.NOT_GUIDED_NO_CHANGE_MODE, lasting=True)


def _effect_of_arm(command: Command) -> Effect:
    if command.params[0] != 0.0:
        return Effect.CHANGE
    return Effect.KILL if command.params[1] == FORCE else Effect.STOP


def _heading(command: Command) -> float | None:
    """Return the heading (rad) of a reposition; None: unset.

    ArduPilot's clients send 0 for that (conformance D1).
    """
    heading = command.params[3]
    return None if math.isnan(heading) or (heading == 0.0 and command.flavour.zero_is_unset) else heading


def _flags(command: Command) -> int:
    """Return the MAV_DO_REPOSITION_FLAGS of a reposition."""
    flags = command.params[1]
    return int(flags) if math.isfinite(flags) else 0


def _effect_of_reposition(command: Command) -> Effect:
    """A reposition with nothing set is a pause.

    A turn by an angle counts each time, as that of CONDITION_YAW: a COMMAND_INT has no confirmation by which a second
    turn differs from a retransmission, and PX4 and ArduCopter carry out each one.
    """
    heading = _heading(command)
    if heading is None and all(math.isnan(value) for value in (command.x, command.y, command.z)):
        return Effect.HOLD
    return Effect.EACH if heading is not None and _flags(command) & RELATIVE_YAW else Effect.CHANGE
