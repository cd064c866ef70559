"""Parameters of mode Follow: the gateway's own settings, PX4's and ArduPilot's aliases.

MAVSDK's follow me writes PX4's. ArduPilot's offsets are in m from the target: X along its course, Y to its right. Its
FOLL_OFS_Z counts from the target whatever FOLL_ALT_TYPE is (AP_Follow::get_target_dist_and_vel_ned), which only selects
a source of the target's height. Heights here count from the take-off point by default, so that neither exists: the same
number could mean below the target.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from anafi_mav import texts
from anafi_mav.services.parameter.parameter import Parameter, alias, fact, mapped, own
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.service import Host
from anafi_mav.units import DEG_PER_RAD
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.follow import REACH, AltitudeMode

GROUP = "Follow"


def _number(
    name: str, field: str, short: str, low: float, high: float, default: float, *, unit: str = "", decimals: int = 1
) -> Parameter:
    def put(host: Host, value: float) -> None:
        setattr(host.vehicle.follow.settings, field, value)

    def read(host: Host) -> float:
        return float(getattr(host.vehicle.follow.settings, field))

    return Parameter(
        name,
        ParamType.REAL32,
        short,
        read=read,
        write=own(put),
        put=put,
        limits=lambda host: (low, high),
        polled=True,
        unit=unit,
        decimals=decimals,
        group=GROUP,
        default=default,
        source="gateway",
    )


NEAREST, FARTHEST = 1.0, 100.0
"""m from the target over ground."""

HEIGHT = _number("ANF_FOLLOW_HT", "height", "Height while following a target", 1.0, 500.0, 8.0, unit="m")
DISTANCE = _number("ANF_FOLLOW_DST", "distance", "Distance while following a target", NEAREST, FARTHEST, 8.0, unit="m")
ANGLE = _number(
    "ANF_FOLLOW_ANG", "angle", "Side of the target, clockwise from its course", -180.0, 180.0, 180.0, unit="deg"
)
RESPONSIVENESS = _number(
    "ANF_FOLLOW_RS",
    "responsiveness",
    "Smoothing of the target's moves, 0: none",
    0.0,
    1.0,
    0.1,
    decimals=2,
)
TANGENTIAL = _number(
    "ANF_FOLLOW_VEL", "tangential_speed", "Maximum speed around a turning target", 0.0, 20.0, 5.0, unit="m/s"
)


def _put_altitude(host: Host, value: float) -> None:
    host.vehicle.follow.settings.altitude_mode = AltitudeMode(int(value))


ALTITUDE = Parameter(
    "ANF_FOLLOW_ALT",
    ParamType.INT32,
    "Reference of the height",
    read=lambda host: float(host.vehicle.follow.settings.altitude_mode),
    write=own(_put_altitude),
    put=_put_altitude,
    values={0: "Take-off point", 1: "Ground below", 2: "Target"},
    polled=True,
    group=GROUP,
    long="The altitude reported by a target is often metres off, and phones may use the ellipsoid.",
    default=0.0,
    source="gateway",
)

FOLLOW_NATIVE: tuple[Parameter, ...] = (HEIGHT, DISTANCE, ANGLE, RESPONSIVENESS, ALTITUDE, TANGENTIAL)

FOLLOW_PX4: tuple[Parameter, ...] = (
    alias(HEIGHT, "FLW_TGT_HT"),
    alias(DISTANCE, "FLW_TGT_DST"),
    alias(ANGLE, "FLW_TGT_FA"),
    alias(RESPONSIVENESS, "FLW_TGT_RS"),
    mapped(ALTITUDE, "FLW_TGT_ALT_M", ParamType.INT32, ALTITUDE.values, {0: 0, 1: 1, 2: 2}),
    alias(TANGENTIAL, "FLW_TGT_MAX_VEL"),
)


Offsets = tuple[float, float]
"""m ahead of the target and to its right."""

MILLIMETRES = 3
"""Decimals of an offset: the angle behind it is in degrees."""


def _offsets(host: Host) -> Offsets:
    settings = host.vehicle.follow.settings
    angle = settings.angle / DEG_PER_RAD
    ahead, right = settings.distance * math.cos(angle), settings.distance * math.sin(angle)
    return round(ahead, MILLIMETRES), round(right, MILLIMETRES)


def _put_offsets(host: Host, offsets: Offsets) -> None:
    distance = math.hypot(*offsets)
    if not NEAREST <= distance <= FARTHEST:
        raise Refused(texts.FOLLOW, texts.FOLLOW_DISTANCE.fill(low=NEAREST, high=FARTHEST), lasting=True)
    settings = host.vehicle.follow.settings
    settings.distance, settings.angle = distance, math.atan2(offsets[1], offsets[0]) * DEG_PER_RAD


def _offset(name: str, index: int, short: str, put: Callable[[Offsets, float], Offsets], default: float) -> Parameter:
    """Return one of the two offsets over ground that are distance and angle for other clients."""
    return replace(
        DISTANCE,
        name=name,
        short=short,
        read=lambda host: _offsets(host)[index],
        write=own(lambda host, value: _put_offsets(host, put(_offsets(host), value))),
        put=None,
        limits=lambda host: (-FARTHEST, FARTHEST),
        decimals=MILLIMETRES,
        derived=True,
        native=DISTANCE.name,
        default=default,
    )


FOLLOW_ARDUPILOT: tuple[Parameter, ...] = (
    fact("FOLL_ENABLE", 1, "Mode Follow is available", ParamType.INT8, group=GROUP),
    fact("FOLL_SYSID", 0, "The first sender of a target leads", ParamType.INT16, group=GROUP),
    fact("FOLL_OFS_TYPE", 1, "Offsets are relative to the target's course", ParamType.INT8, group=GROUP),
    fact("FOLL_YAW_BEHAVE", 1, "The nose is towards the target", ParamType.INT8, group=GROUP),
    fact("FOLL_DIST_MAX", REACH, "A target farther away is not followed", ParamType.REAL32, unit="m", group=GROUP),
    _offset("FOLL_OFS_X", 0, "Offset ahead of the target", lambda old, value: (value, old[1]), -8.0),
    _offset("FOLL_OFS_Y", 1, "Offset to the right of the target", lambda old, value: (old[0], value), 0.0),
)
