"""Settings of the drone that leave one of its failsafes without effect, as texts. No I/O.

A client reads them with its banner, once per session, and `anafi-mav doctor` prints them. They are read from what the
drone reported; a value that it has not reported is no reason for a text. Nothing is written to the drone: what a
pilot has set may be meant so. docs/failsafes.md has the table of all failsafes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from anafi_mav import geo, texts
from anafi_mav.drone import Drone
from anafi_mav.drone.events import RthHomeType
from anafi_mav.drone.piloting.state import PilotingState
from anafi_mav.drone.status.gps import GpsState
from anafi_mav.drone.status.home import HomeState
from anafi_mav.texts import OperatorText

RETURN_HEIGHT = 20.0
"""m above take-off. Lower than that a return meets trees and houses; it is also the least that an ANAFI takes."""

DIRECT_RANGE = 100.0
"""m of the drone's own Wi-Fi, without a Skycontroller: the radius to which the factory sets MaxDistance."""

CONTROLLER_RANGE = 4000.0
"""m of a Skycontroller's radio (Parrot's data sheet of the Skycontroller 3), and the largest MaxDistance."""


class FailsafeLimits(msgspec.Struct, frozen=True):
    """Values below or above which a setting is reported."""

    return_height: float = RETURN_HEIGHT
    """m above take-off: the least height of a return that is not reported."""
    radio_range: float | None = None
    """m; None: `DIRECT_RANGE`, or `CONTROLLER_RANGE` behind a Skycontroller."""


class FailsafeWarning(NamedTuple):
    """A fact, and the parameter that changes it."""

    text: OperatorText
    mend: str
    """Repair, as an instruction to a person."""


def failsafe_warnings(
    home: HomeState, piloting: PilotingState, gps: GpsState, limits: FailsafeLimits, *, has_controller: bool
) -> Iterator[FailsafeWarning]:
    """Yield a warning for each dangerous fact that holds."""
    # On the ground with a fix there is no home yet: the take-off makes one.
    if home.location is None and (piloting.in_air or gps.fixed is False):
        yield FailsafeWarning(texts.NO_HOME, "wait for a GPS fix before the take-off")
    if home.by_itself is False:
        yield FailsafeWarning(texts.RETURN_OFF, "set the parameter ANF_RTH_AUTO to 1")
    height = home.min_altitude
    if height is not None and height.current < limits.return_height:
        text = texts.RETURN_LOW.fill(height=height.current, limit=limits.return_height)
        yield FailsafeWarning(text, "raise the parameter ANF_RTH_ALT")
    if home.delay_s == 0:
        yield FailsafeWarning(texts.RETURN_AT_ONCE, "raise the parameter ANF_RTH_DELAY")
    distance, reach = _custom_home_distance(home, gps), piloting.max_distance
    if distance is not None and reach is not None and distance > reach.current:
        text = texts.HOME_FAR.fill(distance=distance, limit=reach.current)
        yield FailsafeWarning(text, "set home again, or raise the parameter ANF_MAX_DIST")
    radio = limits.radio_range
    if radio is None:
        radio = CONTROLLER_RANGE if has_controller else DIRECT_RANGE
    if piloting.geofence is False and reach is not None and reach.current > radio:
        text = texts.GEOFENCE_OFF.fill(distance=reach.current, limit=radio)
        yield FailsafeWarning(text, "set the parameter ANF_GEOFENCE to 1, or lower ANF_MAX_DIST")


def warnings_of(drone: Drone, limits: FailsafeLimits) -> list[FailsafeWarning]:
    """Return the warnings of a connected drone."""
    return list(
        failsafe_warnings(
            drone.home.state,
            drone.piloting.state,
            drone.gps.state,
            limits,
            has_controller=drone.controller.present,
        )
    )


def _custom_home_distance(home: HomeState, gps: GpsState) -> float | None:
    """Return m from the drone to the home that a user chose, if returns go there."""
    place, here = home.custom_location, gps.location
    if RthHomeType.CUSTOM not in (home.type, home.preferred_type) or place is None or here is None:
        return None
    return geo.distance(here.latitude, here.longitude, place.latitude, place.longitude)
