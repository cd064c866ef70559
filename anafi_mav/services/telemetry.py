"""What a vehicle reports, as a table: message → builder and the drone's events that make it new.

A stream message leaves when one of its fields is new, never to fill a rate: an ANAFI's attitude comes five times a
second, and so do the messages built from it, at most. State messages (battery, system status, home) repeat at their
interval because a client that just connected needs them. A builder returns None while the drone has not reported
what the message is about; single unknown fields carry MAVLink's own "unknown" (NaN, UINT16_MAX, -1, 255).

Frames and units: ARSDK attitude is rad in FRD/NED like MAVLink's, speeds are NED m/s, heights above take-off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from anafi_mav import geo, units
from anafi_mav.drone import events
from anafi_mav.drone.events import AlertLevel, Message, Sensor
from anafi_mav.mavlink import dialect
from anafi_mav.services.service import Service
from anafi_mav.services.stream import Stream, Times
from anafi_mav.services.vehicle import Vehicle

NAN = math.nan
UNKNOWN_U16 = 0xFFFF
UNKNOWN_I16 = 0x7FFF
UNKNOWN_SATELLITES = 255

MOVING = 0.5
"""m/s. Slower than this the course over ground is noise and is reported as unknown."""


def attitude(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ATTITUDE. ARSDK reports no body rates: NaN."""
    state = vehicle.drone.piloting.state.attitude
    if state is None:
        return None
    return dialect.MAVLink_attitude_message(
        times.boot_ms, state.roll, state.pitch, units.wrap_pi(state.yaw), NAN, NAN, NAN
    )


def attitude_quaternion(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ATTITUDE_QUATERNION, (w, x, y, z)."""
    state = vehicle.drone.piloting.state.attitude
    if state is None:
        return None
    w, x, y, z = units.quaternion_from_euler(state.roll, state.pitch, state.yaw)
    return dialect.MAVLink_attitude_quaternion_message(times.boot_ms, w, x, y, z, NAN, NAN, NAN)


def _amsl(vehicle: Vehicle) -> float | None:
    """Height above sea level (m): ATO over the latched take-off point, without a latch the plain GPS altitude."""
    ato = vehicle.drone.piloting.state.altitude
    amsl = None if ato is None else vehicle.height.amsl(ato)
    if amsl is None and (location := vehicle.drone.gps.state.location) is not None:
        return location.altitude
    return amsl


def global_position_int(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """GLOBAL_POSITION_INT; only with a GPS fix, for 0/0 is a place."""
    place, state, amsl = vehicle.place, vehicle.drone.piloting.state, _amsl(vehicle)
    if place is None or amsl is None or state.altitude is None or state.velocity is None:
        return None
    return dialect.MAVLink_global_position_int_message(
        times.boot_ms,
        units.deg_e7(place.latitude),
        units.deg_e7(place.longitude),
        units.millimetres(amsl),
        units.millimetres(state.altitude),
        units.centimetres(state.velocity.north),
        units.centimetres(state.velocity.east),
        units.centimetres(state.velocity.down),
        UNKNOWN_U16 if state.attitude is None else units.centidegrees(state.attitude.yaw),
    )


def local_position_ned(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """LOCAL_POSITION_NED: metres north, east and down of where the drone last took off."""
    place, origin, state = vehicle.place, vehicle.origin, vehicle.drone.piloting.state
    if place is None or origin is None or state.altitude is None or state.velocity is None:
        return None
    north, east = geo.offset(origin.latitude, origin.longitude, place.latitude, place.longitude)
    velocity = state.velocity
    return dialect.MAVLink_local_position_ned_message(
        times.boot_ms, north, east, -state.altitude, velocity.north, velocity.east, velocity.down
    )


def altitude(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ALTITUDE: all relative heights are above the take-off point."""
    ato = vehicle.drone.piloting.state.altitude
    if ato is None:
        return None
    amsl, ground = _amsl(vehicle), vehicle.drone.piloting.state.height
    return dialect.MAVLink_altitude_message(
        times.boot_us, ato, NAN if amsl is None else amsl, ato, ato, NAN, NAN if ground is None else ground
    )


def vfr_hud(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """VFR_HUD. No airspeed is measured: NaN. Nor does an ANAFI report its throttle, but that field knows only 0."""
    state, amsl = vehicle.drone.piloting.state, _amsl(vehicle)
    if state.velocity is None or state.attitude is None:
        return None
    return dialect.MAVLink_vfr_hud_message(
        NAN,
        math.hypot(state.velocity.north, state.velocity.east),
        round(units.wrap_360(state.attitude.yaw * units.DEG_PER_RAD)) % 360,
        0,
        NAN if amsl is None else amsl,
        -state.velocity.down,
    )


def gps_raw_int(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """GPS_RAW_INT. ARSDK reports one standard deviation in metres, no dilution of precision."""
    gps, place, speed = vehicle.drone.gps.state, vehicle.place, vehicle.drone.piloting.state.velocity
    if gps.fixed is None:
        return None
    ground_speed_cms, course = UNKNOWN_U16, UNKNOWN_U16
    if speed is not None:
        ground_speed = math.hypot(speed.north, speed.east)
        ground_speed_cms = units.saturate(ground_speed * 100.0, 16, signed=False)
        if ground_speed > MOVING:
            course = units.centidegrees(math.atan2(speed.east, speed.north))
    accuracies = [a for a in (gps.latitude_accuracy, gps.longitude_accuracy) if a is not None]
    return dialect.MAVLink_gps_raw_int_message(
        times.boot_us,
        dialect.GPS_FIX_TYPE_NO_FIX if place is None else dialect.GPS_FIX_TYPE_3D_FIX,
        0 if place is None else units.deg_e7(place.latitude),
        0 if place is None else units.deg_e7(place.longitude),
        0 if gps.location is None else units.millimetres(gps.location.altitude),
        UNKNOWN_U16,
        UNKNOWN_U16,
        ground_speed_cms,
        course,
        UNKNOWN_SATELLITES if gps.satellites is None else min(gps.satellites, 254),
        h_acc=round(max(accuracies) * 1000) if accuracies and place is not None else 0,
        v_acc=round(gps.altitude_accuracy * 1000) if gps.altitude_accuracy is not None and place is not None else 0,
    )


def _percent(percent: int | None) -> int:
    """Charge left; -1 for what the drone has not said, or cannot mean."""
    return percent if percent is not None and 0 <= percent <= 100 else -1


def battery_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """BATTERY_STATUS: the pack's voltage stands in the first cell, as where cells are not known one by one."""
    state = vehicle.drone.battery.state
    if state.percent is None:
        return None
    first = UNKNOWN_U16 if state.voltage_mv is None else state.voltage_mv
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        UNKNOWN_I16 if state.temperature_k is None else units.saturate(state.temperature_k * 100.0 - 27315.0, 16),
        [first] + [UNKNOWN_U16] * 9,
        -1,
        -1,
        -1,
        _percent(state.percent),
        charge_state={
            AlertLevel.NONE: dialect.MAV_BATTERY_CHARGE_STATE_OK,
            AlertLevel.WARNING: dialect.MAV_BATTERY_CHARGE_STATE_LOW,
            AlertLevel.CRITICAL: dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL,
        }.get(state.worst_alert(), dialect.MAV_BATTERY_CHARGE_STATE_UNDEFINED),
    )


_SENSOR_BITS: dict[Sensor, int] = {
    Sensor.IMU: dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL,
    Sensor.MAGNETOMETER: dialect.MAV_SYS_STATUS_SENSOR_3D_MAG,
    Sensor.BAROMETER: dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE,
    Sensor.GPS: dialect.MAV_SYS_STATUS_SENSOR_GPS,
    Sensor.VERTICAL_CAMERA: dialect.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW,
    Sensor.VERTICAL_TOF: dialect.MAV_SYS_STATUS_SENSOR_LASER_POSITION,
}


def sensor_bits(vehicle: Vehicle) -> tuple[int, int]:
    """(present, healthy) bits of MAV_SYS_STATUS_SENSOR by the drone's own sensor list; what is present is enabled."""
    # We have no fence; MAVProxy calls one that is not healthy a breach, whether it is present or not.
    present, healthy = dialect.MAV_SYS_STATUS_PREARM_CHECK, dialect.MAV_SYS_STATUS_GEOFENCE
    for sensor, works in vehicle.drone.calibration.state.sensors.items():
        bits = _SENSOR_BITS.get(sensor, 0)
        present |= bits
        healthy |= bits if works else 0
    if vehicle.drone.calibration.state.magneto_required:
        healthy &= ~dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    if vehicle.place is None:
        healthy &= ~dialect.MAV_SYS_STATUS_SENSOR_GPS
    if vehicle.drone.battery.state.percent is not None:
        present |= dialect.MAV_SYS_STATUS_SENSOR_BATTERY
        if vehicle.drone.battery.state.worst_alert() != AlertLevel.CRITICAL:
            healthy |= dialect.MAV_SYS_STATUS_SENSOR_BATTERY
    if not vehicle.prearm_problems():
        healthy |= dialect.MAV_SYS_STATUS_PREARM_CHECK
    return present, healthy


def sys_status(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """SYS_STATUS. Load and error counters are not reported by an ANAFI and have no "unknown": 0."""
    present, healthy = sensor_bits(vehicle)
    state = vehicle.drone.battery.state
    return dialect.MAVLink_sys_status_message(
        present,
        present,
        healthy,
        0,
        UNKNOWN_U16 if state.voltage_mv is None else state.voltage_mv,
        -1,
        _percent(state.percent),
        0,
        0,
        0,
        0,
        0,
        0,
    )


def extended_sys_state(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """EXTENDED_SYS_STATE."""
    return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, vehicle.landed.value)


def home_position(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """HOME_POSITION. Its altitude is the take-off point's, whatever the home type; x and y are in the local frame."""
    home, origin = vehicle.home, vehicle.origin
    amsl = vehicle.height.takeoff_amsl
    if home is None or amsl is None:
        return None
    north, east = (NAN, NAN)
    if origin is not None:
        north, east = geo.offset(origin.latitude, origin.longitude, home.latitude, home.longitude)
    return dialect.MAVLink_home_position_message(
        units.deg_e7(home.latitude),
        units.deg_e7(home.longitude),
        units.millimetres(amsl),
        north,
        east,
        0.0,
        [NAN, NAN, NAN, NAN],
        NAN,
        NAN,
        NAN,
        times.boot_us,
    )


_HOME = (events.HomeChanged, events.TakeoffLocation)

STREAMS: dict[int, Stream] = {
    dialect.MAVLINK_MSG_ID_ATTITUDE: Stream(attitude, (events.AttitudeChanged,)),
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Stream(attitude_quaternion, (events.AttitudeChanged,)),
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(
        global_position_int, (events.GpsLocationChanged, events.AltitudeChanged, events.SpeedChanged)
    ),
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(
        local_position_ned, (events.GpsLocationChanged, events.AltitudeChanged, events.SpeedChanged)
    ),
    dialect.MAVLINK_MSG_ID_ALTITUDE: Stream(altitude, (events.AltitudeChanged, events.AltitudeAboveGroundChanged)),
    dialect.MAVLINK_MSG_ID_VFR_HUD: Stream(vfr_hud, (events.SpeedChanged, events.AltitudeChanged)),
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(
        gps_raw_int, (events.GpsLocationChanged, events.NumberOfSatelliteChanged, events.GPSFixStateChanged)
    ),
    dialect.MAVLINK_MSG_ID_SYS_STATUS: Stream(sys_status, on_change=True),
    dialect.MAVLINK_MSG_ID_BATTERY_STATUS: Stream(battery_status),
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Stream(extended_sys_state, on_change=True),
    dialect.MAVLINK_MSG_ID_HOME_POSITION: Stream(home_position, on_change=True),
}

CHANGES: frozenset[type[Message]] = frozenset(
    {
        *_HOME,
        events.ReturnStateChanged,
        events.MavlinkFilePlayingStateChanged,
        events.BatteryAlertChanged,
        events.GPSFixStateChanged,
        events.ForcedLandingAutoTrigger,
        events.SensorsStatesListChanged,
        events.MagnetoCalibrationRequiredState,
    }
)
"""Events after which the state messages marked `on_change` leave at once."""


class TelemetryService(Service):
    """The streams of this table."""

    def streams(self) -> Mapping[int, Stream]:
        return STREAMS
