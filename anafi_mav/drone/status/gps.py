"""Element gps: the fix, the satellites and where the drone is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone.element import Element, Position, Reducer, position


class GpsState(msgspec.Struct, frozen=True):
    """Fix, satellites and place."""

    fixed: bool | None = None
    satellites: int | None = None
    """Satellites in use."""
    location: Position | None = None
    """Place of the drone, altitude above mean sea level; None also when the drone reports it as unknown."""
    latitude_accuracy: int | None = None
    """m, one standard deviation."""
    longitude_accuracy: int | None = None
    """m, one standard deviation."""
    altitude_accuracy: int | None = None
    """m, one standard deviation."""


def _accuracy(metres: int) -> int | None:
    """Parrot's -1 is "not available" (ardrone3.xml 1-4-9)."""
    return metres if metres >= 0 else None


def _location(state: GpsState, message: ardrone3.GpsLocationChanged) -> GpsState:
    location = position(message.latitude, message.longitude, message.altitude)
    if location is None:
        return GpsState(state.fixed, state.satellites)
    return GpsState(
        state.fixed,
        state.satellites,
        location,
        _accuracy(message.latitude_accuracy),
        _accuracy(message.longitude_accuracy),
        _accuracy(message.altitude_accuracy),
    )


class Gps(Element[GpsState]):
    """The satellite receiver. No verbs."""

    NOTHING = GpsState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.GPSFixStateChanged: lambda state, message: replace(state, fixed=message.fixed != 0),
        ardrone3.NumberOfSatelliteChanged: lambda state, message: replace(state, satellites=message.numberOfSatellite),
        ardrone3.GpsLocationChanged: _location,
    }
