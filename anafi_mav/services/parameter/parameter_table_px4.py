"""Parameters by PX4's names: aliases of the native ones, and facts for its clients.

QGroundControl calls a vehicle without some of these not set up, and warns of others when it opens a page (conformance
A5). Each has an effect or is a fact: a value that nothing would follow cannot be written, one that an ANAFI does not
report reads -1. What only fills a page of QGroundControl is in `parameter_table_setup`.
"""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.drone import events
from anafi_mav.services.parameter.parameter import Limits, Parameter, alias, current, fact, mapped, number
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.parameter.parameter_table import (
    AVOIDANCE,
    CLIMB_SPEED,
    CRUISE_SPEED,
    GCS_LOSS,
    GCS_LOSS_TIME,
    GEOFENCE,
    HORIZONTAL_SPEED,
    MAX_ALTITUDE,
    MAX_CRUISE_SPEED,
    MAX_DISTANCE,
    MAX_TILT,
    RC_OVERRIDE,
    RC_OVERRIDE_STICK,
    RETURN_ALTITUDE,
    RETURN_BY_ITSELF,
    RETURN_END_ALTITUDE,
    RETURN_LANDING,
    TAKEOFF_HEIGHT,
    TILT_RATE,
    VERTICAL_SPEED,
    YAW_MODE,
    YAW_RATE,
    put_end_of_return,
    put_return_wait,
)
from anafi_mav.services.parameter.parameter_table_fence import FENCE_PX4
from anafi_mav.services.parameter.parameter_table_follow import FOLLOW_PX4
from anafi_mav.services.parameter.parameter_table_setup import SETUP_PX4
from anafi_mav.services.service import Host
from anafi_mav.vehicle.base.move_heading import MoveHeading
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.offboard.silence import SILENCE
from anafi_mav.vehicle.return_end import LONGEST_WAIT, EndOfReturn
from anafi_mav.vehicle.takeoff import AUTO_DISARM

FACTS = "PX4 facts"

NOT_REPORTED = "An ANAFI does not report it."


def _calibrated(host: Host) -> float:
    return 0.0 if host.drone.calibration.state.magneto_required else 1.0


def _fence_radius(host: Host) -> float:
    state = host.drone.piloting.state
    return current(state.max_distance) if state.geofence else 0.0


def _fence_limits(host: Host) -> Limits | None:
    setting = host.drone.piloting.state.max_distance
    return None if setting is None else (0.0, setting.max)


async def _set_fence_radius(host: Host, value: float) -> None:
    piloting = host.drone.piloting
    setting = piloting.state.max_distance
    if value == 0.0:
        await piloting.set_geofence(False)
        return
    if setting is not None and value < setting.min:
        raise Refused(texts.FENCE, texts.FENCE_RADIUS.fill(radius=setting.min), lasting=True)
    await piloting.set_max_distance(value)
    await piloting.set_geofence(True)


FENCE_RADIUS = Parameter(
    "GF_MAX_HOR_DIST",
    ParamType.REAL32,
    "Radius of the drone's own geofence, 0: off",
    read=_fence_radius,
    write=_set_fence_radius,
    limits=_fence_limits,
    updates=(events.MaxDistanceChanged, events.NoFlyOverMaxDistanceChanged),
    present=lambda drone: MAX_DISTANCE.present(drone) and GEOFENCE.present(drone),
    unit="m",
    step=10.0,
    decimals=0,
    group=MAX_DISTANCE.group,
    native=MAX_DISTANCE.name,
    source=MAX_DISTANCE.source,
)


HOVERS = -1.0
"""RTL_LAND_DELAY of a return that ends hovering."""


def _land_delay(host: Host) -> float:
    end = host.vehicle.return_end
    return HOVERS if end.ending is EndOfReturn.HOVER else end.wait


async def _set_land_delay(host: Host, value: float) -> None:
    if HOVERS < value < 0.0:
        raise Refused(texts.RTL_LAND_DELAY, texts.LAND_DELAY, lasting=True)
    if value == HOVERS:
        put_end_of_return(host, EndOfReturn.HOVER)
    else:
        put_end_of_return(host, EndOfReturn.LAND)
        put_return_wait(host, value)


LAND_DELAY = Parameter(
    "RTL_LAND_DELAY",
    ParamType.REAL32,
    "Wait above home before landing; -1: a commanded return ends hovering",
    read=_land_delay,
    write=_set_land_delay,
    limits=lambda host: (HOVERS, LONGEST_WAIT),
    polled=True,
    derived=True,
    unit="s",
    step=1.0,
    decimals=1,
    group=RETURN_LANDING.group,
    native=RETURN_LANDING.name,
    source=RETURN_LANDING.source,
)


def _flight_time_us(host: Host) -> int | None:
    seconds = host.drone.product.state.total_flight_s
    return None if seconds is None else seconds * 1_000_000


def _high_word(host: Host) -> float:
    time = _flight_time_us(host)
    return number(None if time is None else time >> 32)


def _low_word(host: Host) -> float:
    """Return the low 32 bits, which PX4 stores in an INT32 as they are."""
    time = _flight_time_us(host)
    if time is None:
        return math.nan
    low = time & 0xFFFFFFFF
    return float(low - (1 << 32) if low >= 1 << 31 else low)


ALIASES: tuple[Parameter, ...] = (
    alias(TAKEOFF_HEIGHT, "MIS_TAKEOFF_ALT"),
    alias(RETURN_ALTITUDE, "RTL_RETURN_ALT"),
    alias(RETURN_END_ALTITUDE, "RTL_DESCEND_ALT"),
    LAND_DELAY,
    alias(MAX_TILT, "MPC_TILTMAX_AIR"),
    alias(MAX_TILT, "MPC_MAN_TILT_MAX"),
    alias(TILT_RATE, "MC_ROLLRATE_MAX"),
    alias(TILT_RATE, "MC_PITCHRATE_MAX"),
    alias(YAW_RATE, "MPC_MAN_Y_MAX"),
    alias(VERTICAL_SPEED, "MPC_Z_VEL_MAX_UP"),
    alias(VERTICAL_SPEED, "MPC_Z_VEL_MAX_DN"),
    alias(HORIZONTAL_SPEED, "MPC_VEL_MANUAL"),
    alias(CRUISE_SPEED, "MPC_XY_CRUISE"),
    alias(CLIMB_SPEED, "MPC_Z_V_AUTO_UP"),
    alias(CLIMB_SPEED, "MPC_Z_V_AUTO_DN"),
    mapped(
        YAW_MODE,
        "MPC_YAW_MODE",
        ParamType.INT32,
        {0: "Towards the target", 4: "Towards the target, heading first", 5: "Fixed"},
        {0: MoveHeading.TO_TARGET, 4: MoveHeading.TO_TARGET_FIRST, 5: MoveHeading.KEEP},
    ),
    alias(MAX_ALTITUDE, "GF_MAX_VER_DIST"),
    FENCE_RADIUS,
    mapped(
        RETURN_BY_ITSELF,
        "COM_LOW_BAT_ACT",
        ParamType.INT32,
        {2: "Land at the emergency level", 3: "Return at the critical, land at the emergency level"},
        {2: 0, 3: 1},
    ),
    mapped(AVOIDANCE, "COM_OBS_AVOID", ParamType.INT32, {0: "Off", 1: "On"}, {0: 0, 1: 1}),
    mapped(GCS_LOSS, "NAV_DLL_ACT", ParamType.INT32, GCS_LOSS.values, {number: number for number in GCS_LOSS.values}),
    alias(GCS_LOSS_TIME, "COM_DL_LOSS_T", ParamType.INT32, decimals=0),
    mapped(
        RC_OVERRIDE,
        "COM_RC_OVERRIDE",
        ParamType.INT32,
        RC_OVERRIDE.values,
        {number: number for number in RC_OVERRIDE.values},
    ),
    alias(RC_OVERRIDE_STICK, "COM_RC_STICK_OV"),
)


def _fact(name: str, value: float, short: str, kind: ParamType = ParamType.INT32, **more: object) -> Parameter:
    return fact(name, value, short, kind, group=FACTS, **more)


FACTS_PX4: tuple[Parameter, ...] = (
    Parameter("MAV_SYS_ID", ParamType.INT32, "System id", lambda host: float(host.sysid), group=FACTS, source="fleet"),
    _fact("SYS_AUTOSTART", 4001, "Airframe: a quadrotor"),
    _fact("SYS_HITL", 0, "Simulation inside the autopilot: none"),
    _fact("SYS_HAS_MAG", 1, "The drone has a magnetometer"),
    _fact("SYS_HAS_BARO", 1, "The drone has a barometer"),
    _fact("CAL_GYRO0_ID", 1, "Gyroscope: calibrated by the manufacturer"),
    _fact("CAL_ACC0_ID", 1, "Accelerometer: calibrated by the manufacturer"),
    Parameter(
        "CAL_MAG0_ID",
        ParamType.INT32,
        "Magnetometer: 0 while a calibration is required",
        _calibrated,
        updates=(events.MagnetoCalibrationRequiredState,),
        group=FACTS,
        source=events.MagnetoCalibrationRequiredState.NAME,
    ),
    _fact("CAL_MAG1_ID", 0, "Second magnetometer: none"),
    _fact("CAL_MAG2_ID", 0, "Third magnetometer: none"),
    _fact("COM_RC_IN_MODE", 1, "Stick input: MAVLink"),
    _fact("COM_RC_LOSS_T", SILENCE, "Timeout of stick input; a hover follows", ParamType.REAL32, unit="s", decimals=2),
    _fact(
        "COM_OF_LOSS_T",
        0.5,
        "Timeout of setpoints; a hover follows",
        ParamType.REAL32,
        unit="s",
        decimals=1,
        long="Stricter than PX4's 1.0 s.",
    ),
    _fact("NAV_RCL_ACT", 1, "Sticks lost: hold", values={1: "Hold"}),
    _fact(
        "COM_DISARM_PRFLT",
        AUTO_DISARM,
        "Time from arming to disarming without a take-off",
        ParamType.REAL32,
        unit="s",
        decimals=0,
    ),
    _fact("COM_DISARM_LAND", 0, "Time from landing to disarming", ParamType.REAL32, unit="s"),
    *(
        _fact(name, 0, "Radio channel: none")
        for name in (
            "RC_MAP_ROLL",
            "RC_MAP_PITCH",
            "RC_MAP_YAW",
            "RC_MAP_THROTTLE",
            "RC_MAP_FLTMODE",
            "RC_MAP_FLAPS",
            "RC_MAP_AUX1",
            "RC_MAP_AUX2",
        )
    ),
    *(_fact(f"COM_FLTMODE{slot}", -1, "Mode switch: none") for slot in range(1, 7)),
    *(
        _fact(name, math.nan, f"Battery: {what} level", ParamType.REAL32, long=NOT_REPORTED)
        for name, what in (("BAT_LOW_THR", "low"), ("BAT_CRIT_THR", "critical"), ("BAT_EMERGEN_THR", "emergency"))
    ),
    _fact("CP_DIST", -1, "Collision prevention by distance: none", ParamType.REAL32),
    _fact("MPC_LAND_SPEED", math.nan, "Speed of a landing", ParamType.REAL32, unit="m/s", long=NOT_REPORTED),
    _fact(
        "MPC_XY_VEL_MAX",
        MAX_CRUISE_SPEED,
        "Maximum requested ground speed",
        ParamType.REAL32,
        unit="m/s",
        decimals=1,
    ),
    Parameter(
        "LND_FLIGHT_T_HI",
        ParamType.INT32,
        "Total flight time, high word of microseconds",
        _high_word,
        updates=(events.MotorFlightsStatusChanged,),
        volatile=True,
        group=FACTS,
        source=events.MotorFlightsStatusChanged.NAME,
    ),
    Parameter(
        "LND_FLIGHT_T_LO",
        ParamType.INT32,
        "Total flight time, low word of microseconds",
        _low_word,
        updates=(events.MotorFlightsStatusChanged,),
        volatile=True,
        group=FACTS,
        source=events.MotorFlightsStatusChanged.NAME,
    ),
)

PX4_NAMES: tuple[Parameter, ...] = (*ALIASES, *FENCE_PX4, *FOLLOW_PX4, *FACTS_PX4, *SETUP_PX4)
