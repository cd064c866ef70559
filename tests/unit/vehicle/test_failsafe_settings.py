"""Dangerous settings of a drone: each fact has one text, and a value that is not reported has none."""

from __future__ import annotations

import msgspec
import pytest

from anafi_mav.drone.element import Position, Range
from anafi_mav.drone.events import FlyingState, RthHomeType
from anafi_mav.drone.piloting.state import PilotingState
from anafi_mav.drone.status.gps import GpsState
from anafi_mav.drone.status.home import HomeState
from anafi_mav.vehicle.failsafe_settings import FailsafeLimits, failsafe_warnings

HERE = Position(48.0, 2.0, 100.0)
NORTH = Position(48.01, 2.0, 0.0)
"""1112 m north of `HERE`: 0.01 degrees of a meridian at that latitude (WGS 84: 111 200 m each)."""

HOME = HomeState(
    location=HERE,
    min_altitude=Range(20.0, 20.0, 100.0),
    delay_s=60,
    by_itself=True,
    type=RthHomeType.TAKEOFF,
    preferred_type=RthHomeType.TAKEOFF,
    custom_location=NORTH,
)
PILOTING = PilotingState(flying=FlyingState.LANDED, max_distance=Range(100.0, 10.0, 4000.0), geofence=False)
GPS = GpsState(fixed=True, location=HERE)


def reported(
    home: HomeState = HOME,
    piloting: PilotingState = PILOTING,
    gps: GpsState = GPS,
    limits: FailsafeLimits = FailsafeLimits(),  # noqa: B008  # frozen
    *,
    has_controller: bool = False,
) -> list[str]:
    found = failsafe_warnings(home, piloting, gps, limits, has_controller=has_controller)
    return [str(warning.text) for warning in found]


def test_factory_settings_and_unreported_ones_have_no_warning() -> None:
    assert reported() == []
    assert reported(HomeState(), PilotingState(), GpsState()) == []


CUSTOM = msgspec.structs.replace(HOME, preferred_type=RthHomeType.CUSTOM)
WIDE = msgspec.structs.replace(PILOTING, max_distance=Range(500.0, 10.0, 4000.0))


@pytest.mark.parametrize(
    ("home", "piloting", "text"),
    [
        ({"by_itself": False}, {}, "Return at low battery is off (ANF_RTH_AUTO)"),
        ({"min_altitude": Range(15.0, 5.0, 100.0)}, {}, "Return height low: 15 m < 20 m"),
        ({"delay_s": 0}, {}, "Return delay 0 s: each link loss is a return"),
        ({"preferred_type": RthHomeType.CUSTOM}, {}, "Set home 1112 m away > max. 100 m"),
        ({}, {"max_distance": Range(101.0, 10.0, 4000.0)}, "Geofence off: max. 101 m > radio 100 m"),
        ({"location": None}, {"flying": FlyingState.HOVERING}, "No home: drone cannot return"),
    ],
)
def test_dangerous_setting_has_its_text(home: dict[str, object], piloting: dict[str, object], text: str) -> None:
    found = reported(msgspec.structs.replace(HOME, **home), msgspec.structs.replace(PILOTING, **piloting))
    assert found == [text]


def test_absent_home_on_the_ground_is_reported_without_a_fix() -> None:
    nowhere = msgspec.structs.replace(HOME, location=None)
    assert reported(nowhere) == []
    assert reported(nowhere, gps=GpsState(fixed=False)) == ["No home: drone cannot return"]


def test_limits_are_those_of_the_configuration_and_the_radio() -> None:
    assert reported(limits=FailsafeLimits(return_height=30.0)) == ["Return height low: 20 m < 30 m"]
    assert reported(piloting=WIDE, limits=FailsafeLimits(radio_range=500.0)) == []
    assert reported(piloting=WIDE, has_controller=True) == []
    fenced = msgspec.structs.replace(WIDE, geofence=True)
    assert reported(piloting=fenced) == []


def test_custom_home_within_the_distance_has_no_warning() -> None:
    far = msgspec.structs.replace(PILOTING, max_distance=Range(1200.0, 10.0, 4000.0), geofence=True)
    assert reported(CUSTOM, far) == []
