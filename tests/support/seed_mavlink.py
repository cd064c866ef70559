"""Each row of the anafi_ros paper's appendix, the MAVLink that reaches it, and the test that shows it.

A row without a test waits for the issue that is named in its place.
"""

from __future__ import annotations

from typing import NamedTuple

PAYLOAD = "camera, gimbal and media over MAVLink"


class Reach(NamedTuple):
    mavlink: str
    """Messages, commands or parameters, as they are written in MAVLink."""
    test: str = ""
    """file::function below tests/; empty: not shown yet."""
    waits: str = ""


_FLIGHT = "conformance/test_conf_flight.py::"
_GIMBAL = "conformance/test_conf_gimbal.py::"
_GUIDED = "conformance/test_conf_guided.py::"
_TELEMETRY = "conformance/test_conf_telemetry.py::"
_ANAFI = "conformance/test_anafi_messages.py::"
_MAINTENANCE = "conformance/test_conf_maintenance.py::"
_TWIN = "conformance/test_conf_params.py::test_alias_and_native_parameter_are_one_value"
_PARAMETER = "conformance/test_conf_params.py::test_native_settings_reach_the_drone"
_MISSIONS = "conformance/test_conf_missions.py::"
_CAMERA = "conformance/test_conf_camera_settings.py::"
_CAPTURE = "conformance/test_conf_camera.py::"
_CAMERA_TASKS = "conformance/test_conf_camera_tasks.py::"
_SAFETY = "conformance/test_safety.py::"

REACHED: dict[str, Reach] = {
    "camera/command": Reach("`MAV_CMD_SET_CAMERA_ZOOM`", _CAPTURE + "test_conf_097_zoom_by_range_step_and_rate"),
    "drone/command": Reach("`SET_ATTITUDE_TARGET`", _SAFETY + "test_setpoint_ends_with_its_own_sender"),
    "drone/moveby": Reach(
        "`MAV_CMD_CONDITION_YAW`, `MAV_CMD_DO_CHANGE_ALTITUDE`; `SET_POSITION_TARGET_LOCAL_NED`",
        _GUIDED + "test_conf_143_condition_yaw",
    ),
    "drone/moveto": Reach(
        "`MAV_CMD_DO_REPOSITION`; orientation mode: `ANF_YAW_MODE`",
        "conformance/test_move_heading.py::test_goto_turns_as_the_parameter_demands",
    ),
    "gimbal/command": Reach(
        "`MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW`, `GIMBAL_MANAGER_SET_ATTITUDE`",
        _GIMBAL + "test_conf_098_gimbal_is_device_1_of_the_autopilot",
    ),
    "battery/health": Reach("`BATTERY_INFO`.state_of_health", _TELEMETRY + "test_conf_037_the_cells_of_an_ai"),
    "battery/percentage": Reach("`BATTERY_STATUS`.battery_remaining", _TELEMETRY + "test_conf_037_battery"),
    "battery/voltage": Reach("`BATTERY_STATUS`.voltages", _TELEMETRY + "test_conf_037_battery"),
    "camera/awb_b_gain": Reach(
        "`ANAFI_CAMERA_EXPOSURE`.awb_b_gain", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"
    ),
    "camera/awb_r_gain": Reach(
        "`ANAFI_CAMERA_EXPOSURE`.awb_r_gain", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"
    ),
    "camera/camera_info": Reach("`ANAFI_CAMERA_INTRINSICS`", _ANAFI + "test_camera_exposure_and_intrinsics"),
    "camera/exposure_time": Reach(
        "`ANAFI_CAMERA_EXPOSURE`.exposure_time", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"
    ),
    "camera/image": Reach(
        "`VIDEO_STREAM_INFORMATION`.uri, [RTSP](video.md)",
        "conformance/test_conf_video.py::test_conf_091_each_uri_opens_once_its_stream_is_shown",
    ),
    "camera/hfov": Reach("`ANAFI_CAMERA_EXPOSURE`.hfov", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"),
    "camera/iso_gain": Reach(
        "`ANAFI_CAMERA_EXPOSURE`.iso", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"
    ),
    "camera/vfov": Reach("`ANAFI_CAMERA_EXPOSURE`.vfov", _ANAFI + "test_video_runs_while_a_stream_needs_its_metadata"),
    "camera/zoom": Reach("`ANAFI_CAMERA_EXPOSURE`.zoom", _ANAFI + "test_camera_exposure_and_intrinsics"),
    "drone/altitude": Reach(
        "`ALTITUDE`.bottom_clearance, `DISTANCE_SENSOR`",
        _TELEMETRY + "test_conf_133_ground_distance_is_reported_and_unmeasured_fields_are_unknown",
    ),
    "drone/altitude_above_to": Reach(
        "`GLOBAL_POSITION_INT`.relative_alt, `ALTITUDE`", _TELEMETRY + "test_conf_035_altitudes_agree"
    ),
    "drone/attitude": Reach("`ATTITUDE_QUATERNION`", _TELEMETRY + "test_conf_040_attitude_signs"),
    "drone/gps/fix": Reach("`GPS_RAW_INT`.fix_type", _TELEMETRY + "test_conf_036_gps"),
    "drone/gps/location": Reach("`GLOBAL_POSITION_INT`, `GPS_RAW_INT`", _TELEMETRY + "test_conf_036_gps"),
    "drone/gps/satellites": Reach("`GPS_RAW_INT`.satellites_visible", _TELEMETRY + "test_conf_036_gps"),
    "drone/rpy": Reach("`ATTITUDE`", _TELEMETRY + "test_conf_040_attitude_signs"),
    "drone/speed": Reach("`LOCAL_POSITION_NED`, `GLOBAL_POSITION_INT`", _TELEMETRY + "test_conf_041_velocity_signs"),
    "drone/state": Reach("`EXTENDED_SYS_STATE`, `HEARTBEAT`, `ANAFI_FLIGHT_STATUS`", _ANAFI + "test_flight_status"),
    "gimbal/attitude/absolute": Reach(
        "`GIMBAL_DEVICE_ATTITUDE_STATUS`", _GIMBAL + "test_conf_103_yaw_has_one_frame_and_agrees_with_the_heading"
    ),
    "home/location": Reach("`HOME_POSITION`, `ANAFI_HOME`", _TELEMETRY + "test_conf_034_home"),
    "link/quality": Reach("`RC_CHANNELS`.rssi, `ANAFI_LINK`.quality", _TELEMETRY + "test_conf_134_rssi"),
    "skycontroller/attitude": Reach("`ANAFI_CONTROLLER_ATTITUDE`", _ANAFI + "test_where_the_skycontroller_points"),
    "skycontroller/command": Reach(
        "`ANAFI_CONTROLLER_INPUT`, `RC_CHANNELS`; wheels and buttons with `ANF_SC_WHEELS`, `ANF_SC_BUTTONS`",
        _ANAFI + "test_wheels_and_buttons_are_the_clients_on_request",
    ),
    "skycontroller/rpy": Reach("`ANAFI_CONTROLLER_ATTITUDE`", _ANAFI + "test_where_the_skycontroller_points"),
    "storage/available": Reach(
        "`STORAGE_INFORMATION`.available_capacity", _CAPTURE + "test_conf_092_each_storage_is_reported"
    ),
    "time": Reach("`SYSTEM_TIME`", "conformance/test_conf_ground_station.py::test_conf_111_system_time"),
    "camera/photo/stop": Reach("`MAV_CMD_IMAGE_STOP_CAPTURE`", _CAPTURE + "test_conf_087_series_counts_and_ends"),
    "camera/photo/take": Reach(
        "`MAV_CMD_IMAGE_START_CAPTURE`, `CAMERA_IMAGE_CAPTURED`", _CAPTURE + "test_conf_086_photo_is_reported_with_file"
    ),
    "camera/recording/start": Reach(
        "`MAV_CMD_VIDEO_START_CAPTURE`", _CAPTURE + "test_conf_089_recording_runs_and_ends"
    ),
    "camera/recording/stop": Reach("`MAV_CMD_VIDEO_STOP_CAPTURE`", _CAPTURE + "test_conf_089_recording_runs_and_ends"),
    "camera/reset": Reach(
        "`MAV_CMD_SET_CAMERA_ZOOM` to 0 %; `MAV_CMD_RESET_CAMERA_SETTINGS` too",
        _CAMERA_TASKS + "test_reset_restores_the_settings_of_the_factory",
    ),
    "drone/arm": Reach("`MAV_CMD_COMPONENT_ARM_DISARM` with `ANF_HAND_LAUNCH`", _MAINTENANCE + "test_a_launch_by_hand"),
    "drone/calibrate": Reach("`MAV_CMD_PREFLIGHT_CALIBRATION`", _MAINTENANCE + "test_conf_130_the_magnetometer"),
    "drone/emergency": Reach(
        "`MAV_CMD_DO_FLIGHTTERMINATION`, `MAV_CMD_COMPONENT_ARM_DISARM`",
        "conformance/test_conf_sequences.py::test_conf_050_the_cut_obeys_the_policy",
    ),
    "drone/halt": Reach("mode Hold, `MAV_CMD_DO_REPOSITION` with nothing set", _FLIGHT + "test_conf_026_pause"),
    "drone/land": Reach("`MAV_CMD_NAV_LAND`, mode Land", _FLIGHT + "test_conf_024_land_by_command"),
    "drone/reboot": Reach("`MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN`", _MAINTENANCE + "test_conf_148_reboot"),
    "drone/rth": Reach("`MAV_CMD_NAV_RETURN_TO_LAUNCH`, mode Return", _FLIGHT + "test_conf_025_return"),
    "drone/takeoff": Reach("`MAV_CMD_NAV_TAKEOFF`, mode Takeoff", _FLIGHT + "test_conf_021_takeoff_relative"),
    "flightplan/pause": Reach(
        "`MAV_CMD_DO_PAUSE_CONTINUE`, mode Hold", _MISSIONS + "test_conf_074_pause_and_resume_at_the_same_item"
    ),
    "flightplan/start": Reach(
        "mode Mission, `MAV_CMD_MISSION_START`",
        _MISSIONS + "test_conf_049_073_mission_from_the_ground_is_flown_completely",
    ),
    "flightplan/stop": Reach(
        "`MISSION_CLEAR_ALL`",
        "conformance/test_conf_missions_changed.py::test_conf_074_other_mission_uploaded_in_flight_stops_the_flown_one",
    ),
    "flightplan/upload": Reach(
        "mission protocol", "conformance/test_conf_plans.py::test_conf_047_upload_and_download_are_equal"
    ),
    "gimbal/calibrate": Reach(
        "`MAV_CMD_PREFLIGHT_CALIBRATION`, `MAV_CMD_GIMBAL_REQUEST_AXIS_CALIBRATION`",
        _MAINTENANCE + "test_conf_130_the_gimbal",
    ),
    "gimbal/reset": Reach(
        "`MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW` with `GIMBAL_MANAGER_FLAGS_NEUTRAL`",
        _GIMBAL + "test_conf_101_command_as_long_and_int_moves_the_pitch",
    ),
    "home/navigate": Reach("`MAV_CMD_NAV_RETURN_TO_LAUNCH`, mode Hold", _FLIGHT + "test_conf_025_return"),
    "home/set": Reach("`MAV_CMD_DO_SET_HOME`", _GUIDED + "test_conf_083_set_home"),
    "skycontroller/offboard": Reach(
        "`ANF_SC_OFFBOARD`, `ANAFI_CONTROLLER_INPUT`.source",
        "conformance/test_pilot_switch.py::test_program_keeps_the_aircraft_until_the_pilots_stick",
    ),
    "storage/download": Reach(
        "MAVLink FTP of component 100, `/media`; `anafi-mav media download`",
        "conformance/test_conf_media.py::test_conf_113_media_is_listed_read_and_removed",
    ),
    "storage/format": Reach("`MAV_CMD_STORAGE_FORMAT`", _CAPTURE + "test_conf_093_format_erases_and_resets_the_index"),
    "camera/autorecord": Reach(
        "extended parameter `CAM_AUTOREC`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"
    ),
    "camera/ev_compensation": Reach(
        "extended parameter `CAM_EV`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"
    ),
    "camera/hdr": Reach("extended parameter `CAM_HDR`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"),
    "camera/max_zoom_speed": Reach(
        "extended parameter `CAM_ZOOMSPEED`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"
    ),
    "camera/mode": Reach("extended parameter `CAM_MODE`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"),
    "camera/relative": Reach("`ANF_CAM_RELATIVE`", _PARAMETER),
    "camera/rendering": Reach(
        "extended parameter `CAM_THM_RENDER`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"
    ),
    "camera/streaming": Reach(
        "extended parameter `CAM_STREAMING`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"
    ),
    "camera/style": Reach("extended parameter `CAM_STYLE`", _CAMERA + "test_conf_094_every_option_reaches_the_drone"),
    "drone/banked_turn": Reach("`ANF_BANKED_TURN`", _PARAMETER),
    "drone/max_altitude": Reach("`ANF_MAX_ALT`", _TWIN),
    "drone/max_distance": Reach("`ANF_MAX_DIST`, `ANF_GEOFENCE`", _TWIN),
    "drone/max_horizontal_speed": Reach(
        "`ANF_HORI_SPEED` where the firmware has it; `MAV_CMD_DO_CHANGE_SPEED`",
        _GUIDED + "test_conf_082_a_speed_counts_for_later_moves_too",
    ),
    "drone/max_pitch_roll": Reach("`ANF_MAX_TILT`", _TWIN),
    "drone/max_pitch_roll_rate": Reach("`ANF_TILT_RATE`", _TWIN),
    "drone/max_vertical_speed": Reach("`ANF_VERT_SPEED`", _TWIN),
    "drone/max_yaw_rate": Reach("`ANF_YAW_RATE`", _TWIN),
    "drone/model": Reach(
        "`ANF_MODEL`, `AUTOPILOT_VERSION`", "conformance/test_conf_ground_station.py::test_conf_149_banner_and_version"
    ),
    "gimbal/max_speed": Reach("`ANF_GMB_SPEED`", _PARAMETER),
    "home/autotrigger": Reach("`ANF_RTH_AUTO`", _TWIN),
    "home/ending_behavior": Reach("`ANF_RTH_END`, `ANF_RTH_END_ALT`", _TWIN),
    "home/min_altitude": Reach("`ANF_RTH_ALT`", _TWIN),
    "home/precise": Reach("`ANF_RTH_PRECISE`", _PARAMETER),
    "home/type": Reach("`ANF_HOME_TYPE`", _PARAMETER),
    "storage/download_folder": Reach(
        "configuration key `media: {download_folder}` of the gateway",
        "conformance/test_media_download.py::test_photo_of_a_flight_is_copied_after_landing",
    ),
}
