"""The command table: MAV_CMD → the vehicle's action.

A handler returns when the drone confirmed, or raises.
"""

from __future__ import annotations

import math
from functools import partial

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.command_targets import height, place
from anafi_mav.services.commands import Action, Altitude, Command, Effect, ProgressPolicy, effect_of_mode
from anafi_mav.vehicle.base.bounds import FASTEST, SLOWEST
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.refusal import Refused, Unsupported
from anafi_mav.vehicle.base.right import Right
from anafi_mav.vehicle.guided_flight import GOTO
from anafi_mav.vehicle.vehicle import Vehicle

FORCE = 21196
"""param2 of an arm or disarm that overrides checks (MAVLink common.xml MAV_CMD_COMPONENT_ARM_DISARM)."""

CHANGE_MODE = dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
RELATIVE_YAW = dialect.MAV_DO_REPOSITION_FLAGS_RELATIVE_YAW


async def arm_disarm(vehicle: Vehicle, command: Command) -> None:
    """MAV_CMD_COMPONENT_ARM_DISARM: param1 1 arm, 0 disarm; param2 21196 disarms by force."""
    if command.params[0] == 1.0:
        await vehicle.takeoff.arm(command.right)
    elif command.params[0] == 0.0:
        await vehicle.takeoff.disarm(command.right, force=command.params[1] == FORCE)
    else:
        raise Refused(texts.ARMING, texts.PARAM1_BINARY, lasting=True)


async def takeoff(vehicle: Vehicle, command: Command) -> None:
    """Run MAV_CMD_NAV_TAKEOFF; the reference of z depends on the client (conformance E2).

    Unset: the height of MIS_TAKEOFF_ALT. COMMAND_LONG with latitude and longitude exactly 0, or from a client whose
    family means it so: above the take-off point (MAVProxy, dronekit, Mission Planner). Any other COMMAND_LONG: AMSL
    (QGroundControl). COMMAND_INT: as its frame says. The position is not used: an ANAFI takes off where it stands.
    """
    relative = command.flavour.relative_takeoff or (command.x == 0.0 and command.y == 0.0)
    if command.frame is None and relative and not math.isnan(command.z):
        await vehicle.take_off(command.z, command.right)
        return
    await vehicle.take_off(height(vehicle, command), command.right)


async def land(vehicle: Vehicle, command: Command) -> None:
    """MAV_CMD_NAV_LAND: land here; its position is ignored."""
    await vehicle.land(command.right)


async def return_to_launch(vehicle: Vehicle, command: Command) -> None:
    """MAV_CMD_NAV_RETURN_TO_LAUNCH."""
    await vehicle.return_home(command.right)


async def reposition(vehicle: Vehicle, command: Command) -> None:
    """Run MAV_CMD_DO_REPOSITION: go to a place, height and heading.

    param1 speed in m/s (unset or <= 0: the drone's own), param4 heading in rad, x, y, z.

    param2 bit 0 (CHANGE_MODE): see `_require_change_of_mode`; bit 1 (RELATIVE_YAW): the heading is relative to the
    present one. z obeys the frame: 0 and 5 AMSL, 3 and 6 above take-off. All unset is pause, with or without
    CHANGE_MODE: it stops something. A speed alone is refused.
    """
    speed = command.params[0]
    if math.isinf(speed) or abs(command.params[3]) > 2.0 * math.pi:
        raise Refused(texts.GOTO, texts.PARAM1_SPEED_HEADING, lasting=True)
    if speed > 0.0 and not SLOWEST <= speed <= FASTEST:
        raise Refused(texts.SPEED, texts.SPEED_RANGE.fill(slowest=SLOWEST, fastest=FASTEST), lasting=True)
    where, ato, heading = place(command), height(vehicle, command), _heading(command)
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
    if vehicle.takeoff.rises:
        vehicle.guided.check(where, ato)  # one that is refused replaces none that waits
        await vehicle.takeoff.over(GOTO)
    await vehicle.guided.reposition(where, ato, heading, speed if speed > 0.0 else None, mode, by=command.right)


def _require_change_of_mode(vehicle: Vehicle, command: Command) -> None:
    """Refuse a reposition without CHANGE_MODE where it would change the mode.

    PX4 supports none without it (Commander.cpp), ArduCopter takes it in Guided (GCS_MAVLink_Copter.cpp).
    """
    flavour = command.flavour
    if not flavour.guided_setpoints:
        raise Unsupported(texts.GOTO, texts.NO_CHANGE_MODE)
    if flavour.custom_mode(vehicle.mode) != flavour.custom_mode(FlightMode.GUIDED):
        raise Refused(texts.GOTO, texts.NOT_GUIDED_NO_CHANGE_MODE, lasting=True)


async def set_mode(vehicle: Vehicle, command: Command) -> None:
    """MAV_CMD_DO_SET_MODE, in the numbers of the sender's flavour."""
    await change_mode(vehicle, command.mode, command.right)


async def change_mode(vehicle: Vehicle, mode: FlightMode | None, by: Right) -> None:
    """Enter a mode that a message selected; None is a mode that we do not have."""
    if mode is None:
        raise Refused(texts.MODE, texts.NO_SUCH_MODE, lasting=True)
    await vehicle.set_mode(mode, by)


async def terminate(vehicle: Vehicle, command: Command) -> None:
    """MAV_CMD_DO_FLIGHTTERMINATION: param1 1 cuts the motors."""
    if command.params[0] != 1.0:
        raise Refused(texts.TERMINATION, texts.NOT_REVOCABLE, lasting=True)
    await vehicle.terminate(command.right)


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


def flight_actions(vehicle: Vehicle) -> dict[int, Action]:
    """The commands that begin and end flights. The newest one wins."""
    return {
        dialect.MAV_CMD_COMPONENT_ARM_DISARM: Action(
            partial(arm_disarm, vehicle), location=False, altitude=Altitude.UNUSED, effect=_effect_of_arm
        ),
        dialect.MAV_CMD_NAV_TAKEOFF: Action(
            partial(takeoff, vehicle), location=True, altitude=Altitude.BY_FRAME, effect=Effect.IRREVOCABLE
        ),
        dialect.MAV_CMD_NAV_LAND: Action(
            partial(land, vehicle), location=True, altitude=Altitude.UNUSED, effect=Effect.LAND
        ),
        dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: Action(
            partial(return_to_launch, vehicle), location=False, altitude=Altitude.UNUSED, effect=Effect.RETURN
        ),
        dialect.MAV_CMD_DO_REPOSITION: Action(
            partial(reposition, vehicle),
            location=True,
            altitude=Altitude.BY_FRAME,
            effect=_effect_of_reposition,
            progress=ProgressPolicy.EARLY,
            still_holds=lambda: not vehicle.guided.has_failed,
        ),
        dialect.MAV_CMD_DO_SET_MODE: Action(
            partial(set_mode, vehicle),
            location=False,
            altitude=Altitude.UNUSED,
            effect=effect_of_mode,
            mode=lambda command: command.flavour.mode_of_parameters(command.params[1], command.params[2]),
            progress=ProgressPolicy.LATE,
        ),
        dialect.MAV_CMD_DO_FLIGHTTERMINATION: Action(
            partial(terminate, vehicle), location=False, altitude=Altitude.UNUSED, effect=Effect.KILL
        ),
    }
