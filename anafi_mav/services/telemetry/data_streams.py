"""ArduPilot's groups of streams, which REQUEST_DATA_STREAM selects by number. No I/O.

ArduPilot's own clients request whole groups at a rate. A group here has those of our messages that ArduCopter has in
it (ArduPilot GCS_MAVLINK_Copter.cpp STREAM_*_msgs), and the ones that PX4's clients use for the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from anafi_mav.mavlink import dialect

_GROUPS: Mapping[int, Sequence[int]] = {
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: (
        dialect.MAVLINK_MSG_ID_SYS_STATUS,
        dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
        dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        dialect.MAVLINK_MSG_ID_FENCE_STATUS,
        dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    ),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: (dialect.MAVLINK_MSG_ID_RC_CHANNELS, dialect.MAVLINK_MSG_ID_RADIO_STATUS),
    dialect.MAV_DATA_STREAM_POSITION: (
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    dialect.MAV_DATA_STREAM_EXTRA1: (dialect.MAVLINK_MSG_ID_ATTITUDE, dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION),
    dialect.MAV_DATA_STREAM_EXTRA2: (dialect.MAVLINK_MSG_ID_VFR_HUD, dialect.MAVLINK_MSG_ID_ALTITUDE),
    dialect.MAV_DATA_STREAM_EXTRA3: (
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        dialect.MAVLINK_MSG_ID_RANGEFINDER,
        dialect.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS,
        dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,
        dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
        dialect.MAVLINK_MSG_ID_MOUNT_ORIENTATION,
    ),
}


def members(group: int) -> Sequence[int]:
    """Return the message ids of a group.

    MAV_DATA_STREAM_ALL: those of all groups. Empty for a group that an ANAFI has no data for.
    """
    if group == dialect.MAV_DATA_STREAM_ALL:
        return [id for ids in _GROUPS.values() for id in ids]
    return _GROUPS.get(group, ())
