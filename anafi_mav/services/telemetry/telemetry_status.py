"""How the vehicle is: battery, sensors, estimator, flights, as messages.

Unknown values carry MAVLink's own "unknown". A field without an "unknown", which an ANAFI does not report, is 0,
with a comment here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import units
from anafi_mav.drone import events
from anafi_mav.drone.events import AlertLevel, BatteryAlert, MotorError, Sensor
from anafi_mav.drone.status.battery import BatteryState
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import char_field
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan
UNKNOWN_U16 = 0xFFFF
UNKNOWN_I16 = 0x7FFF

CELLS, MORE_CELLS = 10, 4
"""Cells that BATTERY_STATUS has room for, in its two fields."""

SHARED_FLAGS = 0x3FF
"""Bits that EKF_STATUS_FLAGS and ESTIMATOR_STATUS_FLAGS have in common."""

BAD_LINK = 1
"""The drone's "a disconnection is highly probable" (common.xml 0-5-16)."""


def percent(charge: int | None) -> int:
    """Return the remaining charge, %; -1 if it is unknown or out of range."""
    return charge if charge is not None and 0 <= charge <= 100 else -1


def _voltages(state: BatteryState) -> tuple[list[int], list[int]]:
    """Return the two voltage fields of BATTERY_STATUS, mV.

    They hold the cells where the drone reports each, else the pack in the first.
    """
    known = [voltage for _, voltage in sorted(state.cell_voltages_mv.items())]
    if not known or len(known) != (state.cell_count or len(known)):
        known = [] if state.voltage_mv is None else [state.voltage_mv]
    first = known[:CELLS] + [UNKNOWN_U16] * (CELLS - len(known[:CELLS]))
    more = known[CELLS : CELLS + MORE_CELLS]
    return first, more + [0] * (MORE_CELLS - len(more))


_CHARGE_STATES: Mapping[AlertLevel | None, int] = {
    AlertLevel.NONE: dialect.MAV_BATTERY_CHARGE_STATE_OK,
    AlertLevel.WARNING: dialect.MAV_BATTERY_CHARGE_STATE_LOW,
    AlertLevel.CRITICAL: dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL,
}

_FAULTS = {
    BatteryAlert.TOO_HOT: dialect.MAV_BATTERY_FAULT_OVER_TEMPERATURE,
    BatteryAlert.TOO_COLD: dialect.MAV_BATTERY_FAULT_UNDER_TEMPERATURE,
    BatteryAlert.GAUGE_TOO_OLD: dialect.MAV_BATTERY_FAULT_INCOMPATIBLE_FIRMWARE,
}


def _charge_state(state: BatteryState) -> int:
    """Return MAV_BATTERY_CHARGE_STATE: a full battery that is cold or hot is not low.

    Stations announce LOW and CRITICAL as a low charge. An alert of another kind at its critical level is UNHEALTHY.
    """
    charge = state.charge_alert()
    if charge != AlertLevel.CRITICAL and state.worst_alert() == AlertLevel.CRITICAL:
        return dialect.MAV_BATTERY_CHARGE_STATE_UNHEALTHY
    return _CHARGE_STATES.get(charge, dialect.MAV_BATTERY_CHARGE_STATE_UNDEFINED)


def battery_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return BATTERY_STATUS.

    An ANAFI reports no current; the Ai reports its cells, its temperature and its charge in mAh.
    """
    state = vehicle.drone.battery.state
    if state.percent is None:
        return None
    voltages, more = _voltages(state)
    used = -1
    if state.full_charge_mah is not None and state.remaining_mah is not None:
        used = units.saturate(max(state.full_charge_mah - state.remaining_mah, 0), 32)
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        UNKNOWN_I16 if state.temperature_k is None else units.saturate(state.temperature_k * 100.0 - 27315.0, 16),
        voltages,
        -1,
        used,
        -1,
        percent(state.percent),
        charge_state=_charge_state(state),
        voltages_ext=more,
        fault_bitmask=sum(bit for alert, bit in _FAULTS.items() if state.alerts.get(alert, 0) > AlertLevel.NONE),
    )


def battery_info(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return BATTERY_INFO: the values that do not change in flight.

    Only the Ai reports more than health, cycles and serial number.
    """
    state = vehicle.drone.battery.state
    if state.health_percent is None and state.serial is None:
        return None

    def thousandth(value: int | None, unknown: float = 0.0) -> float:
        return unknown if value is None else value / 1000.0

    return dialect.MAVLink_battery_info_message(
        id=0,
        battery_function=dialect.MAV_BATTERY_FUNCTION_ALL,
        type=dialect.MAV_BATTERY_TYPE_LIPO,
        state_of_health=0xFF if state.health_percent is None else min(state.health_percent, 100),
        cells_in_series=min(state.cell_count or 0, 0xFF),
        cycle_count=UNKNOWN_U16 if state.cycles is None else min(state.cycles, UNKNOWN_U16 - 1),
        weight=0,
        discharge_minimum_voltage=thousandth(state.cell_min_mv),
        charging_minimum_voltage=0.0,
        resting_minimum_voltage=0.0,
        charging_maximum_voltage=thousandth(state.cell_max_mv),
        charging_maximum_current=0.0,
        nominal_voltage=0.0,
        discharge_maximum_current=0.0,
        discharge_maximum_burst_current=0.0,
        design_capacity=thousandth(state.design_mah),
        full_charge_capacity=thousandth(state.full_charge_mah, NAN),
        manufacture_date=b"",
        serial_number=char_field(state.serial, 32),
        name=b"",
    )


_SENSOR_BITS: dict[Sensor, int] = {
    Sensor.IMU: dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL,
    Sensor.MAGNETOMETER: dialect.MAV_SYS_STATUS_SENSOR_3D_MAG,
    Sensor.BAROMETER: dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE,
    Sensor.GPS: dialect.MAV_SYS_STATUS_SENSOR_GPS,
    Sensor.VERTICAL_CAMERA: dialect.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW,
    Sensor.VERTICAL_TOF: dialect.MAV_SYS_STATUS_SENSOR_LASER_POSITION,
}


def sensor_bits(vehicle: Vehicle) -> tuple[int, int, int]:
    """(present, enabled, healthy) bits of MAV_SYS_STATUS_SENSOR by the drone's own sensor list.

    What is present is enabled, but for a fence that is not.
    """
    drone, fence = vehicle.drone, vehicle.fence
    present = dialect.MAV_SYS_STATUS_PREARM_CHECK | (dialect.MAV_SYS_STATUS_GEOFENCE if fence.present else 0)
    # MAVProxy calls a fence that is not healthy a breach, whether it is present or not.
    healthy = dialect.MAV_SYS_STATUS_GEOFENCE if fence.healthy else 0
    for sensor, works in drone.calibration.state.sensors.items():
        bits = _SENSOR_BITS.get(sensor, 0)
        present |= bits
        healthy |= bits if works else 0
    if drone.calibration.state.magneto_required:
        healthy &= ~dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    if vehicle.place is None:
        healthy &= ~dialect.MAV_SYS_STATUS_SENSOR_GPS
    if drone.battery.state.percent is not None:
        present |= dialect.MAV_SYS_STATUS_SENSOR_BATTERY
        if drone.battery.state.worst_alert() != AlertLevel.CRITICAL:
            healthy |= dialect.MAV_SYS_STATUS_SENSOR_BATTERY
    if (error := drone.alerts.state.motor_error) is not None:
        present |= dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        if error == MotorError.NO_ERROR:
            healthy |= dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    if (quality := drone.link.state.quality) is not None:
        present |= dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        if quality > BAD_LINK:
            healthy |= dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    if not vehicle.prearm_problems():
        healthy |= dialect.MAV_SYS_STATUS_PREARM_CHECK
    enabled = present if fence.in_force else present & ~dialect.MAV_SYS_STATUS_GEOFENCE
    return present, enabled, healthy


def sys_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """SYS_STATUS. Load and error counters are not reported by an ANAFI and have no "unknown": 0."""
    present, enabled, healthy = sensor_bits(vehicle)
    state = vehicle.drone.battery.state
    return dialect.MAVLink_sys_status_message(
        present,
        enabled,
        healthy,
        0,
        UNKNOWN_U16 if state.voltage_mv is None else state.voltage_mv,
        -1,
        percent(state.percent),
        0,
        0,
        0,
        0,
        0,
        0,
    )


def ekf_flags(vehicle: Vehicle) -> int:
    """Return EKF_STATUS_FLAGS by the drone's reports.

    dronekit arms on them, MAVProxy shows them. Without GPS an ANAFI holds its place by its vertical camera, relative
    to where it was; it does not when it reports that it is too dark or too high for that.
    """
    drone = vehicle.drone
    state, alerts = drone.piloting.state, drone.alerts.state
    if state.attitude is None:
        return dialect.EKF_UNINITIALIZED
    flags = dialect.EKF_ATTITUDE
    blind = vehicle.place is None and bool(alerts.too_dark_to_hover or alerts.too_high_to_hover)
    if state.velocity is not None:
        flags |= dialect.EKF_VELOCITY_VERT
        if blind:
            flags |= dialect.EKF_CONST_POS_MODE
        else:
            flags |= dialect.EKF_VELOCITY_HORIZ | dialect.EKF_POS_HORIZ_REL | dialect.EKF_PRED_POS_HORIZ_REL
    if vehicle.place is not None:
        flags |= dialect.EKF_POS_HORIZ_ABS | dialect.EKF_PRED_POS_HORIZ_ABS
    if state.altitude is not None:
        flags |= dialect.EKF_POS_VERT_ABS
    if state.height is not None:
        flags |= dialect.EKF_POS_VERT_AGL
    return flags


def ekf_status_report(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return EKF_STATUS_REPORT (ArduPilot's). The drone reports no variances: NaN."""
    return dialect.MAVLink_ekf_status_report_message(ekf_flags(vehicle), NAN, NAN, NAN, NAN, NAN, NAN)


def estimator_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ESTIMATOR_STATUS (PX4's): the same flags as far as it has them, and accuracies.

    GPS accuracies are m, one standard deviation. Test ratios are not reported: NaN.
    """
    gps = vehicle.drone.gps.state
    accuracies = [a for a in (gps.latitude_accuracy, gps.longitude_accuracy) if a is not None]
    horizontal = float(max(accuracies)) if accuracies and vehicle.place is not None else NAN
    vertical = NAN if gps.altitude_accuracy is None or vehicle.place is None else float(gps.altitude_accuracy)
    return dialect.MAVLink_estimator_status_message(
        times.boot_us, ekf_flags(vehicle) & SHARED_FLAGS, NAN, NAN, NAN, NAN, NAN, NAN, horizontal, vertical
    )


STREAMS: Mapping[int, MessageStream] = {
    dialect.MAVLINK_MSG_ID_SYS_STATUS: MessageStream(sys_status, every=1.0, on_change=True),
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: MessageStream(battery_status, every=1.0),
    dialect.MAVLINK_MSG_ID_BATTERY_INFO: MessageStream(battery_info),
    dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT: MessageStream(ekf_status_report, every=1.0),
    dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: MessageStream(
        estimator_status, (events.GpsLocationChanged, events.HoveringWarning), repeated=True
    ),
}
