"""Read-only constants for parameters that QGroundControl's pages need and an ANAFI lacks.

QGroundControl opens an error dialog for each name that a page of Vehicle Setup, or an indicator of its toolbar, does
not find (FactPanelController::getParameterFact). The names are those of its releases 4.3 and 5.0 and of its sources
of July 2026, for a multicopter; `tests/support/qgroundcontrol.json` has them page by page. Values are true where the
drone has such a thing, otherwise neutral: nothing is mapped, nothing is offset, nothing is tuned.
"""

from __future__ import annotations

from anafi_mav.drone import events
from anafi_mav.services.parameter.parameter import Parameter, fact, number
from anafi_mav.services.parameter.parameter_codec import ParamType
from anafi_mav.services.parameter.parameter_table import AVOIDANCE
from anafi_mav.services.service import Host

PX4_SETUP, ARDUPILOT_SETUP = "PX4 setup", "ArduPilot setup"

NOT_AVAILABLE = "Not available on ANAFI."

COMPASS_SIDES = 38
"""Bits of CAL_MAG_SIDES: 2 nose down, 4 left side down, 32 upright. QGroundControl shows one picture for each.

An ANAFI is turned about each of its three axes (arsdk common.xml 0-14-2), and each picture stands for one of them
(`calibration_service`).
"""


def _px4(name: str, value: float, short: str, kind: ParamType = ParamType.INT32, **more: object) -> Parameter:
    return fact(name, value, short, kind, **{"group": PX4_SETUP, "long": NOT_AVAILABLE, **more})


def _ardupilot(name: str, value: float, short: str, kind: ParamType = ParamType.INT8, **more: object) -> Parameter:
    return fact(name, value, short, kind, **{"group": ARDUPILOT_SETUP, "long": NOT_AVAILABLE, **more})


def _cells(host: Host) -> float:
    reported = host.drone.battery.state.cell_count
    return number(reported if reported is not None else host.drone.identity.model.battery_cells)


def _volts(millivolts: int | None) -> float:
    return number(None if millivolts is None else millivolts / 1000.0)


_BATTERY: tuple[Parameter, ...] = (
    _px4("BAT1_SOURCE", 1, "Battery: reports its charge", values={1: "External"}, long=""),
    Parameter(
        "BAT1_N_CELLS",
        ParamType.INT32,
        "Battery: cells in series",
        _cells,
        updates=(events.BatteryDescription,),
        group=PX4_SETUP,
        source=events.BatteryDescription.NAME,
    ),
    Parameter(
        "BAT1_V_CHARGED",
        ParamType.REAL32,
        "Battery: voltage of a full cell",
        lambda host: _volts(host.drone.battery.state.cell_max_mv),
        updates=(events.BatteryDescription,),
        unit="V",
        decimals=2,
        group=PX4_SETUP,
        long="Reported by the Ai only; -1: not available.",
        source=events.BatteryDescription.NAME,
    ),
    Parameter(
        "BAT1_V_EMPTY",
        ParamType.REAL32,
        "Battery: voltage of an empty cell",
        lambda host: _volts(host.drone.battery.state.cell_min_mv),
        updates=(events.BatteryDescription,),
        unit="V",
        decimals=2,
        group=PX4_SETUP,
        long="Reported by the Ai only; -1: not available.",
        source=events.BatteryDescription.NAME,
    ),
    _px4("BAT1_V_LOAD_DROP", 0.0, "Battery: voltage drop under load", ParamType.REAL32, unit="V"),
)

_SWITCHES = {"ARM": "ARMSWITCH", "GEAR": "GEAR", "KILL": "KILLSWITCH", "LOITER": "LOITER", "OFFB": "OFFB"} | {
    "RETURN": "RETURN"
}
"""Switches of a radio: as RC_MAP_…_SW has them, and as RC_…_TH."""

_GAINS = (
    *(f"MC_{axis}RATE_{gain}" for axis in ("ROLL", "PITCH") for gain in "KID"),
    "MC_YAWRATE_K",
    "MC_YAWRATE_I",
    *(f"MC_{axis}_P" for axis in ("ROLL", "PITCH", "YAW")),
    "MPC_XY_P",
    "MPC_Z_P",
    *(f"MPC_{axis}_VEL_{gain}_ACC" for axis in ("XY", "Z") for gain in "PID"),
)

SETUP_PX4: tuple[Parameter, ...] = (
    _px4("SYS_AUTOCONFIG", 0, "Airframe: reset to its defaults"),
    *_BATTERY,
    _px4("SENS_BOARD_ROT", 0, "Autopilot: orientation on the frame"),
    *(
        _px4(f"SENS_BOARD_{axis}_OFF", 0.0, "Autopilot: offset of its level", ParamType.REAL32, unit="deg")
        for axis in "XYZ"
    ),
    _px4("SENS_DPRES_OFF", 0.0, "Airspeed sensor: offset", ParamType.REAL32),
    *(_px4(f"CAL_MAG{index}_ROT", -1, "Magnetometer: orientation", values={-1: "Internal"}) for index in range(3)),
    _px4("CAL_MAG_SIDES", COMPASS_SIDES, "Magnetometer: positions of its calibration", long=""),
    *(_px4(f"RC_MAP_PARAM{index}", 0, "Radio channel: none") for index in range(1, 4)),
    *(_px4(f"RC_MAP_{name}_SW", 0, "Radio channel: none") for name in _SWITCHES),
    *(_px4(f"RC_{name}_TH", 0.0, "Radio channel: threshold", ParamType.REAL32) for name in _SWITCHES.values()),
    _px4("SDLOG_MODE", -1, "Log: none", values={-1: "Disabled"}),
    _px4(
        "COM_OBS_AVOID",
        0,
        "Obstacle avoidance: none",
        values={0: "Off"},
        present=lambda drone: not AVOIDANCE.present(drone),
    ),
    *(_px4(name, 0.0, "Gain of the drone's own controller", ParamType.REAL32) for name in _GAINS),
)

SETUP_ARDUPILOT: tuple[Parameter, ...] = (
    _ardupilot("AHRS_ORIENTATION", 0, "Autopilot: orientation on the frame"),
    _ardupilot("COMPASS_DEC", 0.0, "Compass: declination", ParamType.REAL32, unit="rad"),
    _ardupilot("COMPASS_AUTODEC", 1, "Compass: declination by place"),
    _ardupilot("COMPASS_CAL_FIT", 0.0, "Compass: strictness of its calibration", ParamType.REAL32),
    _ardupilot("COMPASS_PRIO1_ID", 1, "First compass: COMPASS_DEV_ID", ParamType.INT32, long=""),
    _ardupilot("COMPASS_PRIO2_ID", 0, "Second compass: none", ParamType.INT32, long=""),
    _ardupilot("COMPASS_PRIO3_ID", 0, "Third compass: none", ParamType.INT32, long=""),
    *(_ardupilot(f"RC{channel}_OPTION", 0, "Radio channel: no function", ParamType.INT16) for channel in range(6, 17)),
    _ardupilot("TUNE", 0, "Tuning by a knob: none"),
    _ardupilot("TUNE_MIN", 0.0, "Tuning by a knob: lowest", ParamType.REAL32),
    _ardupilot("TUNE_MAX", 0.0, "Tuning by a knob: highest", ParamType.REAL32),
    _ardupilot("AUTOTUNE_AXES", 0, "Autotune: no axis"),
    _ardupilot("MOT_SPIN_ARM", 0.0, "Motors: throttle when armed", ParamType.REAL32),
    _ardupilot("MOT_SPIN_MIN", 0.0, "Motors: lowest throttle in flight", ParamType.REAL32),
    *(
        _ardupilot(name, 0.0, "Gain of the drone's own controller", ParamType.REAL32)
        for name in (
            *(f"ATC_ANG_{axis}_P" for axis in ("RLL", "PIT", "YAW")),
            *(f"ATC_RAT_{axis}_{gain}" for axis in ("RLL", "PIT", "YAW") for gain in "PID"),
            "PSC_ACCZ_P",
            "PSC_ACCZ_I",
        )
    ),
    _ardupilot("FS_OPTIONS", 0, "Failsafe: exceptions", ParamType.INT32),
    _ardupilot("FS_CRASH_CHECK", 0, "Failsafe: crash check"),
    _ardupilot("FS_EKF_ACTION", 0, "Failsafe: position estimate"),
    _ardupilot("FS_EKF_THRESH", 0.0, "Failsafe: threshold of the position estimate", ParamType.REAL32),
)
