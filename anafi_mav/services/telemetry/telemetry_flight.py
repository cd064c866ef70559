"""Position and motion of the drone, as messages.

A builder returns None while the drone has not reported the subject of its message; single unknown fields carry
MAVLink's own "unknown" (NaN, UINT16_MAX, -1, 255).

Frames and units: ARSDK attitude is rad in FRD/NED like MAVLink's, speeds are NED m/s, heights above take-off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from anafi_mav import geo, units
from anafi_mav.drone import events
from anafi_mav.drone.events import MoveToStatus
from anafi_mav.drone.piloting.state import Attitude, Velocity
from anafi_mav.mavlink import dialect
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.geo_point import GeoPoint
from anafi_mav.vehicle.vehicle import Vehicle

NAN = math.nan
UNKNOWN_U16 = 0xFFFF
UNKNOWN_SATELLITES = 255
UNKNOWN_U8 = 255

MOVING = 0.5
"""m/s. Slower than this the course over ground is noise and is reported as unknown."""


def attitude(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ATTITUDE. ARSDK reports no body rates: NaN."""
    state = times.pose.attitude
    if state is None:
        return None
    return dialect.MAVLink_attitude_message(
        times.boot_ms, state.roll, state.pitch, units.wrap_pi(state.yaw), NAN, NAN, NAN
    )


def attitude_quaternion(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ATTITUDE_QUATERNION, (w, x, y, z)."""
    state = times.pose.attitude
    if state is None:
        return None
    w, x, y, z = units.quaternion_from_euler(state.roll, state.pitch, state.yaw)
    return dialect.MAVLink_attitude_quaternion_message(times.boot_ms, w, x, y, z, NAN, NAN, NAN)


def global_position_int(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return GLOBAL_POSITION_INT; None without position, height or speed.

    The position is unknown without a GPS fix, and while the newest location is old.

    0/0 is no substitute for an unknown position: it is a place.
    """
    pose = times.pose
    place, height = pose.place, pose.amsl(vehicle)
    if place is None or height is None or pose.altitude is None or pose.velocity is None:
        return None
    return dialect.MAVLink_global_position_int_message(
        times.boot_ms,
        units.deg_e7(place.latitude),
        units.deg_e7(place.longitude),
        units.millimetres(height),
        units.millimetres(pose.altitude),
        units.centimetres(pose.velocity.north),
        units.centimetres(pose.velocity.east),
        units.centimetres(pose.velocity.down),
        UNKNOWN_U16 if pose.attitude is None else units.centidegrees(pose.attitude.yaw),
    )


def local_position_ned(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """LOCAL_POSITION_NED: metres north, east and down of where the drone last took off."""
    pose, origin = times.pose, vehicle.origin
    place, velocity = pose.place, pose.velocity
    if place is None or origin is None or pose.altitude is None or velocity is None:
        return None
    north, east = geo.offset(origin.latitude, origin.longitude, place.latitude, place.longitude)
    return dialect.MAVLink_local_position_ned_message(
        times.boot_ms, north, east, -pose.altitude, velocity.north, velocity.east, velocity.down
    )


def _to_body(velocity: Velocity, attitude: Attitude) -> tuple[float, float, float]:
    """A velocity over ground (north, east, down) along the drone's axes (forward, right, down)."""
    cr, sr = math.cos(attitude.roll), math.sin(attitude.roll)
    cp, sp = math.cos(attitude.pitch), math.sin(attitude.pitch)
    cy, sy = math.cos(attitude.yaw), math.sin(attitude.yaw)
    north, east, down = velocity.north, velocity.east, velocity.down
    level_forward, level_right = cy * north + sy * east, cy * east - sy * north
    forward = cp * level_forward - sp * down
    below = sp * level_forward + cp * down
    return forward, cr * level_right + sr * below, cr * below - sr * level_right


def odometry(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return ODOMETRY: LOCAL_POSITION_NED and the attitude in one.

    The velocity is along the drone's axes. Rates and covariances are not reported: NaN.
    """
    pose, origin = times.pose, vehicle.origin
    place, leaning = pose.place, pose.attitude
    if place is None or origin is None:
        return None
    if pose.altitude is None or pose.velocity is None or leaning is None:
        return None
    north, east = geo.offset(origin.latitude, origin.longitude, place.latitude, place.longitude)
    return dialect.MAVLink_odometry_message(
        times.boot_us,
        dialect.MAV_FRAME_LOCAL_NED,
        dialect.MAV_FRAME_BODY_FRD,
        north,
        east,
        -pose.altitude,
        list(units.quaternion_from_euler(leaning.roll, leaning.pitch, leaning.yaw)),
        *_to_body(pose.velocity, leaning),
        NAN,
        NAN,
        NAN,
        [NAN] * 21,
        [NAN] * 21,
    )


def altitude(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """ALTITUDE: all relative heights are above the take-off point."""
    pose = times.pose
    ato, ground = pose.altitude, pose.height
    if ato is None:
        return None
    height = pose.amsl(vehicle)
    return dialect.MAVLink_altitude_message(
        times.boot_us, ato, NAN if height is None else height, ato, ato, NAN, NAN if ground is None else ground
    )


def vfr_hud(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """VFR_HUD.

    No airspeed is measured: NaN. Nor does an ANAFI report its throttle, but that field knows only 0.
    """
    pose = times.pose
    height = pose.amsl(vehicle)
    if pose.velocity is None or pose.attitude is None:
        return None
    return dialect.MAVLink_vfr_hud_message(
        NAN,
        math.hypot(pose.velocity.north, pose.velocity.east),
        round(units.wrap_360(pose.attitude.yaw * units.DEG_PER_RAD)) % 360,
        0,
        NAN if height is None else height,
        -pose.velocity.down,
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


def distance_sensor(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return DISTANCE_SENSOR of the ground below.

    The drone derives it from several sensors and reports no limits of it.
    """
    height = vehicle.drone.piloting.state.height
    if height is None:
        return None
    return dialect.MAVLink_distance_sensor_message(
        times.boot_ms,
        0,
        UNKNOWN_U16,
        units.saturate(height * 100.0, 16, signed=False),
        dialect.MAV_DISTANCE_SENSOR_UNKNOWN,
        0,
        dialect.MAV_SENSOR_ROTATION_PITCH_270,
        UNKNOWN_U8,
    )


def rangefinder(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """RANGEFINDER: the same for dronekit, which knows no other."""
    height = vehicle.drone.piloting.state.height
    return None if height is None else dialect.MAVLink_rangefinder_message(height, 0.0)


class MoveTarget(NamedTuple):
    """Target of a running moveTo, or the mission's next way point, seen from the drone."""

    bearing: float
    """deg, clockwise from north, -180..180."""
    distance: float
    """m, horizontally."""
    altitude: float
    """m above the take-off point."""


def target(vehicle: Vehicle) -> MoveTarget | None:
    """Return the present target; None without one, or while the drone's position is unknown."""
    place, state = vehicle.place, vehicle.drone.piloting.state
    if place is None:
        return None
    if state.move_target is not None and state.move_to == MoveToStatus.RUNNING:
        goal = GeoPoint(state.move_target.latitude, state.move_target.longitude), state.move_target.altitude
    elif (of_mission := vehicle.mission.target) is not None:
        goal = of_mission
    else:
        return None
    (latitude, longitude), altitude = goal
    north, east = geo.offset(place.latitude, place.longitude, latitude, longitude)
    return MoveTarget(math.degrees(math.atan2(east, north)), math.hypot(north, east), altitude)


def nav_controller_output(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """Return NAV_CONTROLLER_OUTPUT: distance and direction of the present target.

    Without a target: distance 0, ahead.
    """
    state, goal = vehicle.drone.piloting.state, target(vehicle)
    if vehicle.place is None or state.attitude is None:
        return None
    heading = units.wrap_pi(state.attitude.yaw) * units.DEG_PER_RAD
    bearing, distance, above = heading, 0.0, 0.0
    if goal is not None:
        bearing, distance = goal.bearing, goal.distance
        above = NAN if state.altitude is None else goal.altitude - state.altitude
    return dialect.MAVLink_nav_controller_output_message(
        NAN, NAN, round(heading), round(bearing), units.saturate(distance, 16, signed=False), above, NAN, NAN
    )


def extended_sys_state(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """EXTENDED_SYS_STATE."""
    return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, vehicle.landed.value)


def home_position(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """HOME_POSITION.

    Its altitude is the take-off point's, whatever the home type; x and y are in the local frame.
    """
    home, origin = vehicle.home or vehicle.origin, vehicle.origin
    ground = vehicle.height.takeoff_amsl
    if home is None or ground is None:
        return None
    north, east = (NAN, NAN)
    if origin is not None:
        north, east = geo.offset(origin.latitude, origin.longitude, home.latitude, home.longitude)
    return dialect.MAVLink_home_position_message(
        units.deg_e7(home.latitude),
        units.deg_e7(home.longitude),
        units.millimetres(ground),
        north,
        east,
        0.0,
        [NAN, NAN, NAN, NAN],
        NAN,
        NAN,
        NAN,
        times.boot_us,
    )


def gps_global_origin(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    """GPS_GLOBAL_ORIGIN: where the local frame is 0, on the ground of the take-off."""
    origin, ground = vehicle.origin, vehicle.height.takeoff_amsl
    if origin is None or ground is None:
        return None
    return dialect.MAVLink_gps_global_origin_message(
        units.deg_e7(origin.latitude), units.deg_e7(origin.longitude), units.millimetres(ground), times.boot_us
    )


_POSITION = (events.GpsLocationChanged, events.AltitudeChanged, events.SpeedChanged)

STREAMS: Mapping[int, MessageStream] = {
    dialect.MAVLINK_MSG_ID_ATTITUDE: MessageStream(attitude, (events.AttitudeChanged,), every=0.1, from_pictures=True),
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: MessageStream(
        attitude_quaternion, (events.AttitudeChanged,), every=0.1, from_pictures=True, spared=True
    ),
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: MessageStream(
        global_position_int, _POSITION, every=0.2, from_pictures=True
    ),
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: MessageStream(
        local_position_ned, _POSITION, every=0.2, from_pictures=True, spared=True
    ),
    dialect.MAVLINK_MSG_ID_ODOMETRY: MessageStream(odometry, (events.AttitudeChanged, *_POSITION), from_pictures=True),
    dialect.MAVLINK_MSG_ID_ALTITUDE: MessageStream(
        altitude,
        (events.AltitudeChanged, events.AltitudeAboveGroundChanged),
        every=0.2,
        from_pictures=True,
        spared=True,
    ),
    dialect.MAVLINK_MSG_ID_VFR_HUD: MessageStream(
        vfr_hud, (events.SpeedChanged, events.AltitudeChanged), every=0.2, from_pictures=True
    ),
    dialect.MAVLINK_MSG_ID_GPS_RAW_INT: MessageStream(
        gps_raw_int, (events.GpsLocationChanged, events.NumberOfSatelliteChanged, events.GPSFixStateChanged), every=0.5
    ),
    dialect.MAVLINK_MSG_ID_DISTANCE_SENSOR: MessageStream(
        distance_sensor, (events.AltitudeAboveGroundChanged,), every=0.2
    ),
    dialect.MAVLINK_MSG_ID_RANGEFINDER: MessageStream(rangefinder, (events.AltitudeAboveGroundChanged,)),
    dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: MessageStream(nav_controller_output),
    dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: MessageStream(extended_sys_state, every=0.5, on_change=True),
    dialect.MAVLINK_MSG_ID_HOME_POSITION: MessageStream(home_position, every=2.0, on_change=True),
    dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: MessageStream(gps_global_origin),
}
