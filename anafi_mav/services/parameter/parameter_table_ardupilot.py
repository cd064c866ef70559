"""Parameters by ArduCopter's names: aliases of the native ones, and facts for its clients.

Names, types and units are ArduCopter 4.5's (centimetres and centidegrees where it has them). QGroundControl's setup
pages, Mission Planner and MAVProxy look for these (conformance E3). As with PX4's names, each has an effect or is a
fact: a value that cannot be followed cannot be written, one that an ANAFI does not report reads -1.
"""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.services.parameter.parameter import Limits, Parameter, alias, current, fact, mapped, number
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.parameter.parameter_table import (
    CLIMB_SPEED,
    CRUISE_SPEED,
    GCS_LOSS,
    GCS_LOSS_TIME,
    GUIDED_TIME,
    MAX_ALTITUDE,
    MAX_DISTANCE,
    MAX_TILT,
    RETURN_ALTITUDE,
    RETURN_BY_ITSELF,
    RETURN_END_ALTITUDE,
    RETURN_LANDING,
    RETURN_WAIT,
    TILT_RATE,
    VERTICAL_SPEED,
    YAW_MODE,
    YAW_RATE,
    put_end_of_return,
)
from anafi_mav.services.parameter.parameter_table_fence import FENCE_ARDUPILOT
from anafi_mav.services.parameter.parameter_table_follow import FOLLOW_ARDUPILOT
from anafi_mav.services.parameter.parameter_table_setup import SETUP_ARDUPILOT
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.move_heading import MoveHeading
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.link_loss import LossAction
from anafi_mav.vehicle.return_end import EndOfReturn
from anafi_mav.vehicle.takeoff import AUTO_DISARM

FACTS = "ArduPilot facts"

NOT_REPORTED = "An ANAFI does not report it."

DRONE_WARNS = "0: no threshold (ArduPilot). The drone has its own levels of battery warnings."

CM = 100.0
"""cm in a m, centidegrees in a degree."""


def _final_altitude(host: Host) -> float:
    if host.vehicle.return_end.ending is EndOfReturn.LAND:
        return 0.0
    return current(host.drone.home.state.ending_altitude) * CM


def _final_limits(host: Host) -> Limits | None:
    setting = host.drone.home.state.ending_altitude
    return None if setting is None else (0.0, setting.max * CM)


async def _set_final_altitude(host: Host, value: float) -> None:
    """Set the end of returns: 0 lands, a value above 0 hovers.

    The hover is at ANF_RTH_END_ALT, which is the drone's, whatever the number. A text is sent when that height
    differs from the number.
    """
    put_end_of_return(host, EndOfReturn.LAND if value == 0.0 else EndOfReturn.HOVER)
    height = _final_altitude(host)
    if math.isfinite(height) and abs(value - height) >= 1.0:
        host.text(Severity.NOTICE, texts.RTL_ALT_FINAL.fill(height=height / CM))


FINAL_ALTITUDE = Parameter(
    "RTL_ALT_FINAL",
    ParamType.INT16,
    "Height at the end of a commanded return; 0: it lands",
    read=_final_altitude,
    write=_set_final_altitude,
    limits=_final_limits,
    updates=(events.ReturnEndingAltitude,),
    polled=True,
    derived=True,
    present=RETURN_END_ALTITUDE.present,
    unit="cm",
    step=CM,
    decimals=0,
    group=RETURN_LANDING.group,
    native=RETURN_LANDING.name,
    source=RETURN_LANDING.source,
)

ALIASES: tuple[Parameter, ...] = (
    alias(MAX_TILT, "ANGLE_MAX", ParamType.INT16, scale=CM, unit="centi-degrees"),
    alias(TILT_RATE, "ATC_RATE_R_MAX"),
    alias(TILT_RATE, "ATC_RATE_P_MAX"),
    alias(YAW_RATE, "PILOT_Y_RATE"),
    alias(VERTICAL_SPEED, "PILOT_SPEED_UP", ParamType.INT16, scale=CM, unit="cm/s", decimals=0),
    alias(VERTICAL_SPEED, "PILOT_SPEED_DN", ParamType.INT16, scale=CM, unit="cm/s", decimals=0),
    alias(CRUISE_SPEED, "WPNAV_SPEED", scale=CM, unit="cm/s", decimals=0),
    alias(CLIMB_SPEED, "WPNAV_SPEED_UP", scale=CM, unit="cm/s", decimals=0),
    alias(CLIMB_SPEED, "WPNAV_SPEED_DN", scale=CM, unit="cm/s", decimals=0),
    mapped(
        YAW_MODE,
        "WP_YAW_BEHAVIOR",
        ParamType.INT8,
        {0: "Never change the heading", 2: "Face the target, except in a return"},
        {0: MoveHeading.KEEP, 2: MoveHeading.TO_TARGET},
    ),
    alias(MAX_ALTITUDE, "FENCE_ALT_MAX"),
    alias(MAX_DISTANCE, "FENCE_RADIUS"),
    alias(RETURN_ALTITUDE, "RTL_ALT", ParamType.INT32, scale=CM, unit="cm", decimals=0),
    FINAL_ALTITUDE,
    alias(RETURN_WAIT, "RTL_LOIT_TIME", ParamType.INT32, scale=1000.0, unit="ms", decimals=0),
    mapped(
        RETURN_BY_ITSELF,
        "BATT_FS_LOW_ACT",
        ParamType.INT8,
        {0: "None", 2: "RTL"},
        {0: 0, 2: 1},
    ),
    mapped(
        GCS_LOSS,
        "FS_GCS_ENABLE",
        ParamType.INT8,
        {0: "Disabled", 1: "RTL", 5: "Land", 7: "Brake"},
        {0: LossAction.NOTHING, 1: LossAction.RETURN, 5: LossAction.LAND, 7: LossAction.HOLD},
    ),
    alias(GCS_LOSS_TIME, "FS_GCS_TIMEOUT"),
    alias(GUIDED_TIME, "GUID_TIMEOUT"),
)


def _fact(name: str, value: float, short: str, kind: ParamType = ParamType.INT8, **more: object) -> Parameter:
    return fact(name, value, short, kind, group=FACTS, **more)


def _not_reported(name: str, short: str, kind: ParamType = ParamType.REAL32, **more: object) -> Parameter:
    return _fact(name, math.nan, short, kind, long=NOT_REPORTED, **more)


def _compass_offset(host: Host) -> float:
    return 0.0 if host.drone.calibration.state.magneto_required else math.nan


_CHANNELS = {"ROLL": 1, "PITCH": 2, "THROTTLE": 3, "YAW": 4}
"""Channel of each axis in RC_CHANNELS_OVERRIDE."""

FACTS_ARDUPILOT: tuple[Parameter, ...] = (
    Parameter(
        "SYSID_THISMAV", ParamType.INT16, "System id", lambda host: float(host.sysid), group=FACTS, source="fleet"
    ),
    _fact("FRAME_CLASS", 1, "Frame: a quadrotor"),
    _fact("FRAME_TYPE", 1, "Frame: X"),
    _fact("ARMING_CHECK", 1, "Checks before arming: all", ParamType.INT32),
    _fact("DISARM_DELAY", AUTO_DISARM, "Time from arming to disarming without a take-off", unit="s"),
    _not_reported("FENCE_MARGIN", "Distance kept to the fence", unit="m"),
    _fact("FS_THR_ENABLE", 7, "Sticks lost: brake", values={7: "Brake"}),
    _fact("FS_THR_VALUE", -1, "Throttle value of a lost radio: none", ParamType.INT16),
    _fact("BATT_MONITOR", 7, "Battery monitor: the battery reports its charge"),
    Parameter(
        "BATT_CAPACITY",
        ParamType.INT32,
        "Charge of the full battery",
        lambda host: number(host.drone.battery.state.full_charge_mah),
        updates=(events.BatteryCapacity,),
        unit="mAh",
        group=FACTS,
        source=events.BatteryCapacity.NAME,
    ),
    _fact("BATT_FS_CRT_ACT", 1, "Battery almost empty: the drone lands", values={1: "Land"}),
    *(
        _fact(f"BATT_{level}_{unit}", 0.0, "Threshold: none", ParamType.REAL32, unit=name, long=DRONE_WARNS)
        for level in ("LOW", "CRT")
        for unit, name in (("VOLT", "V"), ("MAH", "mAh"))
    ),
    _not_reported("LAND_SPEED", "Speed of a landing", ParamType.INT16, unit="cm/s"),
    _fact("COMPASS_DEV_ID", 1, "Compass: the drone has one", ParamType.INT32),
    _fact("COMPASS_DEV_ID2", 0, "Second compass: none", ParamType.INT32),
    _fact("COMPASS_DEV_ID3", 0, "Third compass: none", ParamType.INT32),
    _fact("COMPASS_USE", 1, "The compass is used"),
    _fact("COMPASS_USE2", 0, "Second compass: none"),
    _fact("COMPASS_USE3", 0, "Third compass: none"),
    *(
        Parameter(
            f"COMPASS_OFS_{axis}",
            ParamType.REAL32,
            "Compass offset: 0 while a calibration is required",
            _compass_offset,
            updates=(events.MagnetoCalibrationRequiredState,),
            group=FACTS,
            long=NOT_REPORTED,
            source=events.MagnetoCalibrationRequiredState.NAME,
        )
        for axis in "XYZ"
    ),
    *(
        _fact(f"COMPASS_OFS{number}_{axis}", 0.0, "Compass offset: no such compass", ParamType.REAL32)
        for number in (2, 3)
        for axis in "XYZ"
    ),
    *(_not_reported(f"INS_ACCOFFS_{axis}", "Accelerometer offset") for axis in "XYZ"),
    *(_fact(f"RCMAP_{axis}", channel, "Channel of RC_CHANNELS_OVERRIDE") for axis, channel in _CHANNELS.items()),
    *(
        _fact(f"RC{channel}_{what}", value, "PWM value of RC_CHANNELS_OVERRIDE", ParamType.INT16, unit="PWM")
        for channel in _CHANNELS.values()
        for what, value in (("MIN", 1000), ("TRIM", 1500), ("MAX", 2000))
    ),
    *(_fact(f"RC{channel}_REVERSED", 0, "Channel reversed: no") for channel in _CHANNELS.values()),
    _fact("FLTMODE_CH", 0, "Mode switch: none"),
    *(_fact(f"FLTMODE{slot}", 5, "Mode switch: none; sticks fly Loiter") for slot in range(1, 7)),
    _fact("SIMPLE", 0, "Simple mode: none"),
    _fact("SUPER_SIMPLE", 0, "Super simple mode: none"),
    Parameter(
        "STAT_FLTTIME",
        ParamType.INT32,
        "Total flight time",
        lambda host: number(host.drone.product.state.total_flight_s),
        updates=(events.MotorFlightsStatusChanged,),
        volatile=True,
        unit="s",
        group=FACTS,
        source=events.MotorFlightsStatusChanged.NAME,
    ),
)

ARDUPILOT_NAMES: tuple[Parameter, ...] = (
    *ALIASES,
    *FENCE_ARDUPILOT,
    *FOLLOW_ARDUPILOT,
    *FACTS_ARDUPILOT,
    *SETUP_ARDUPILOT,
)
