"""Parameters of mode Follow: the gateway's own settings, and their PX4 aliases.

MAVSDK's follow me writes the aliases.
"""

from __future__ import annotations

from anafi_mav.services.parameter.parameter import Parameter, alias, mapped, own
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.service import Host
from anafi_mav.vehicle.follow import AltitudeMode

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


HEIGHT = _number("ANF_FOLLOW_HT", "height", "Height while following a target", 1.0, 500.0, 8.0, unit="m")
DISTANCE = _number("ANF_FOLLOW_DST", "distance", "Distance while following a target", 1.0, 100.0, 8.0, unit="m")
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
