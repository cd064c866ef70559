"""Place and height of a command, by its frame and by the flavour of its sender.

Conformance E2 (take-off), B1 "INT frame" (AMSL whatever the frame says), C2 (frames), architecture "One height".
"""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.commands import Altitude, Command
from anafi_mav.vehicle.base.bounds import amsl_to_ato, check_estimate
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.vehicle import Vehicle

_AMSL_FRAMES = (None, dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT)
_RELATIVE_FRAMES = (dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


class UnsupportedFrame(Refused):
    """A place in a frame we cannot resolve."""

    def __init__(self, frame: int | None) -> None:
        super().__init__(texts.POSITION, texts.FRAME_UNSUPPORTED.fill(frame=frame), lasting=True)


def height(vehicle: Vehicle, command: Command, *, flown: bool = True) -> float | None:
    """Height above take-off (m) of a command's z; None when z is unset. COMMAND_LONG has AMSL.

    `flown`: the drone is to fly at this height. Raises `Refused`, `UnsupportedFrame`.
    """
    if math.isnan(command.z):
        return None
    altitude = command.definition.altitude
    if altitude is Altitude.UNUSED:
        raise ValueError(f"MAV_CMD {command.id}: its row says that it has no height")
    amsl = altitude is Altitude.AMSL and command.flavour.relative_frames_are_amsl
    return height_in_frame(vehicle, command.z, command.frame, amsl=amsl, flown=flown)


def height_in_frame(vehicle: Vehicle, z: float, frame: int | None, *, amsl: bool = False, flown: bool = True) -> float:
    """Return the height above take-off (m) of `z` in a MAV_FRAME (None: AMSL).

    `amsl`: z is AMSL even where the frame is relative. Raises `Refused`, `UnsupportedFrame`.
    """
    if not math.isfinite(z):
        raise Refused(texts.HEIGHT, texts.NOT_A_NUMBER, lasting=True)
    if frame in _AMSL_FRAMES or (amsl and frame in _RELATIVE_FRAMES):
        ato = amsl_to_ato(vehicle, z)
        if flown:
            check_estimate(vehicle, ato)
        return ato
    if frame in _RELATIVE_FRAMES:
        return z
    raise UnsupportedFrame(frame)


def place(command: Command) -> GeoPoint | None:
    """The command's position; None when it is unset. Half a position is refused."""
    if math.isnan(command.x) and math.isnan(command.y):
        return None
    if not (math.isfinite(command.x) and math.isfinite(command.y)):
        raise Refused(texts.POSITION, texts.LATITUDE_LONGITUDE_NUMBERS, lasting=True)
    return GeoPoint(command.x, command.y)
