"""Checks of heights, places and speeds that every command passes before it is flown.

A value out of bounds is refused, never clamped. Bounds are those of the numbers themselves, of the drone's own limits
and of the fence.
"""

from __future__ import annotations

import math

from anafi_mav import geo, mav_enums, texts
from anafi_mav.plans.plan import FASTEST as FASTEST
from anafi_mav.plans.plan import SLOWEST as SLOWEST
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.aircraft import Aircraft
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.base.height import ESTIMATE_FLOOR
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.fence.fence_watch import OutsideFence

NOWHERE = 1e-5
"""deg. A place so near to 0/0 is refused.

Its numbers were not set, or are integers in the place of floats.
"""

LOWEST = 1.0
"""m above take-off: height at which an ANAFI hovers by itself after take-off.

Lower targets are refused, never clamped, unless the drone is as low already (`lowest_height`).
"""

FARTHEST = 4000.0
"""m from the drone's centre. No setting of an ANAFI reaches farther (maximum of its MaxDistance); a place beyond is a
mistake, also while the drone's own geofence is off."""

_AMSL_FRAMES = (None, mav_enums.MAV_FRAME_GLOBAL, mav_enums.MAV_FRAME_GLOBAL_INT)
_RELATIVE_FRAMES = (mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav_enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


class UnsupportedFrame(Refused):
    """A place in a frame we cannot resolve."""

    def __init__(self, frame: int | None) -> None:
        super().__init__(texts.POSITION, texts.FRAME_UNSUPPORTED.fill(frame=frame), lasting=True)


def lowest_height(vehicle: Aircraft) -> float:
    """Return the lowest height (m above take-off) of a target.

    Over a slope that falls away, sticks, velocities and missions lead below the take-off point; there the drone may
    be commanded to any height that is not lower than its own. A lower target is refused: nothing is known of the
    ground there, and the height above ground that the drone reports may be an old one.
    """
    altitude = vehicle.drone.piloting.state.altitude
    return LOWEST if altitude is None or not vehicle.in_air else min(LOWEST, altitude)


class TooLow(Refused):
    """Refusal of a target below `lowest_height`.

    A drone that has not taken off yet is lifted above it anyway.
    """


def check_height(vehicle: Aircraft, ato: float) -> None:
    """Raise `Refused` unless the drone may fly to a target height (m above take-off)."""
    if not math.isfinite(ato):
        raise Refused(texts.HEIGHT, texts.NOT_A_NUMBER, lasting=True)
    if ato < (lowest := lowest_height(vehicle)):
        raise TooLow(texts.HEIGHT, texts.TOO_LOW.fill(height=ato, lowest=lowest), lasting=True)
    check_limits(vehicle, ato)


def check_limits(vehicle: Aircraft, ato: float) -> None:
    """Raise `Refused` for a height (m above take-off) above the ceiling or below the fence."""
    ceiling = vehicle.drone.piloting.state.max_altitude
    if ceiling is not None and ato > ceiling.current:
        raise Refused(
            texts.HEIGHT,
            texts.ABOVE_CEILING.fill(height=ato, ceiling=ceiling.current),
            lasting=True,
        )
    try:
        vehicle.fence.check_height(ato)
    except OutsideFence as error:
        raise Refused(texts.HEIGHT, error.reason, lasting=True) from error


def amsl_to_ato(vehicle: Aircraft, amsl: float) -> float:
    """Return the height above take-off (m) of an AMSL height; raises `Refused` without a bridge."""
    ato = vehicle.height.ato(amsl)
    if ato is None:
        raise Refused(texts.HEIGHT, texts.AMSL_UNKNOWN)
    return ato


def check_estimate(vehicle: Aircraft, ato: float) -> None:
    """Raise `Refused` for an AMSL target that may be the ground.

    The bridge to AMSL may be an estimate.
    """
    if vehicle.height.estimated and ato < ESTIMATE_FLOOR:
        raise Refused(texts.HEIGHT, texts.NEAR_ESTIMATE.fill(height=ato, lowest=ESTIMATE_FLOOR))


def height_in_frame(vehicle: Aircraft, z: float, frame: int | None, *, amsl: bool = False, flown: bool = True) -> float:
    """Return the height above take-off (m) of `z` in a MAV_FRAME (None: AMSL).

    `amsl`: z is AMSL even where the frame is relative. `flown`: the drone is to fly at this height. Raises `Refused`,
    `UnsupportedFrame`.
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


def home_height(vehicle: Aircraft, ato: float) -> float:
    """Return the height (m above take-off) of a custom home: at least that of the take-off.

    The end of a return is a height above the ground at home (rth.xml 146-0-24), and a drone may calculate it from this
    one. Clients that do not know the height send 0 above sea level, which is far below the ground inland. Above a home
    that is raised the return ends too high, and a landing leads down from there. A text reports it.
    """
    if ato >= 0.0:
        return ato
    vehicle.text(Severity.WARNING, texts.HOME_RAISED.fill(height=ato))
    return 0.0


def check_on_earth(place: GeoPoint, what: OperatorText) -> None:
    """Raise `Refused` unless the numbers are a place on earth."""
    if not (abs(place.latitude) <= 90.0 and abs(place.longitude) <= 180.0):
        raise Refused(what, texts.NOT_ON_EARTH, lasting=True)
    if abs(place.latitude) < NOWHERE and abs(place.longitude) < NOWHERE:
        raise Refused(what, texts.AT_NULL, lasting=True)


def check_place(vehicle: Aircraft, place: GeoPoint, *, start: GeoPoint | None = None) -> None:
    """Raise `Refused` unless the drone may fly to `place`.

    With `start` the straight way from there is checked, too.
    """
    check_on_earth(place, texts.GOTO)
    centre = vehicle.geofence_centre
    around = centre or vehicle.place
    if around is not None:
        distance = geo.distance(around.latitude, around.longitude, place.latitude, place.longitude)
        if distance > FARTHEST:
            raise Refused(texts.GOTO, texts.TOO_FAR.fill(distance=distance, limit=FARTHEST), lasting=True)
        if centre is not None:
            _check_geofence(vehicle, distance)
    try:
        vehicle.fence.check_place(place, vehicle.fence_home, start)
    except OutsideFence as error:
        raise Refused(texts.GOTO, error.reason, lasting=error.lasting) from error


def _check_geofence(vehicle: Aircraft, distance: float) -> None:
    """Raise `Refused` for a place beyond the drone's own geofence.

    `distance` is that of the place from the geofence's centre (m).
    """
    state = vehicle.drone.piloting.state
    if state.geofence and state.max_distance is not None and distance > state.max_distance.current:
        raise Refused(
            texts.GOTO,
            texts.BEYOND_GEOFENCE.fill(distance=distance, limit=state.max_distance.current),
            lasting=True,
        )
