"""Access of an endpoint's clients: what they may send, and what they are shown. No I/O.

An endpoint has one of three levels, and each holds the ones before it:

- observe: read telemetry, parameters, plans, files and logs, and set the rates of one's own streams;
- control: fly, steer gimbal and cameras, change plans;
- all: also maintenance: parameters, restart, calibration, formatting, deletion of files, the shell.

What is not in the tables needs `control`, so that a message that is added later moves nothing by mistake.
"""

from __future__ import annotations

import enum
from typing import Any

from anafi_mav.endpoint_options import EndpointOptions
from anafi_mav.mavlink import dialect


class Access(enum.IntEnum):
    """Level of an endpoint, and of what a message needs."""

    OBSERVE = 0
    CONTROL = 1
    ALL = 2

    @classmethod
    def of(cls, name: str) -> Access:
        """Return the level with this name in the options of an endpoint."""
        return cls[name.upper()]


HASH_NAME = "_HASH_CHECK"
"""A PARAM_SET of this name writes nothing: it ends the list for a client that has its values (PX4, QGroundControl)."""

OBSERVED_MESSAGES = frozenset(
    {
        dialect.MAVLINK_MSG_ID_HEARTBEAT,
        dialect.MAVLINK_MSG_ID_PING,
        dialect.MAVLINK_MSG_ID_TIMESYNC,
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        dialect.MAVLINK_MSG_ID_STATUSTEXT,
        dialect.MAVLINK_MSG_ID_RADIO_STATUS,
        dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION_REQUEST,
        dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
        dialect.MAVLINK_MSG_ID_REQUEST_EVENT,
        dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        dialect.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_LIST,
        dialect.MAVLINK_MSG_ID_PARAM_EXT_REQUEST_READ,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        dialect.MAVLINK_MSG_ID_MISSION_ACK,
        dialect.MAVLINK_MSG_ID_LOG_REQUEST_LIST,
        dialect.MAVLINK_MSG_ID_LOG_REQUEST_DATA,
        dialect.MAVLINK_MSG_ID_LOG_REQUEST_END,
    }
)
"""Messages that read, or concern their sender's own link alone."""

MAINTENANCE_MESSAGES = frozenset(
    {
        dialect.MAVLINK_MSG_ID_PARAM_SET,
        dialect.MAVLINK_MSG_ID_SERIAL_CONTROL,
        dialect.MAVLINK_MSG_ID_LOG_ERASE,
        dialect.MAVLINK_MSG_ID_SETUP_SIGNING,
        dialect.MAVLINK_MSG_ID_PARAM_MAP_RC,
        dialect.MAVLINK_MSG_ID_OSD_PARAM_CONFIG,
        dialect.MAVLINK_MSG_ID_SET_MAG_OFFSETS,
        dialect.MAVLINK_MSG_ID_DEVICE_OP_WRITE,
        dialect.MAVLINK_MSG_ID_SECURE_COMMAND,
        dialect.MAVLINK_MSG_ID_AUTH_KEY,
        dialect.MAVLINK_MSG_ID_AIRLINK_AUTH,
        dialect.MAVLINK_MSG_ID_WIFI_CONFIG_AP,
        dialect.MAVLINK_MSG_ID_CAN_FRAME,
        dialect.MAVLINK_MSG_ID_CANFD_FRAME,
        dialect.MAVLINK_MSG_ID_CAN_FILTER_MODIFY,
        dialect.MAVLINK_MSG_ID_CUBEPILOT_FIRMWARE_UPDATE_START,
    }
)
"""Those after SETUP_SIGNING are for systems behind other endpoints: PX4 and ArduPilot change settings by them."""

OBSERVED_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_REQUEST_MESSAGE,
        dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
        dialect.MAV_CMD_GET_MESSAGE_INTERVAL,
        dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        dialect.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        dialect.MAV_CMD_GET_HOME_POSITION,
        dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION,
        dialect.MAV_CMD_REQUEST_CAMERA_SETTINGS,
        dialect.MAV_CMD_REQUEST_STORAGE_INFORMATION,
        dialect.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS,
        dialect.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE,
        dialect.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION,
        dialect.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS,
        dialect.MAV_CMD_DO_SEND_BANNER,
        dialect.MAV_CMD_RUN_PREARM_CHECKS,
        dialect.MAV_CMD_CONTROL_HIGH_LATENCY,
    }
)
"""Commands that read, or concern their sender's own link alone."""

MAINTENANCE_COMMANDS = frozenset(
    {
        dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        dialect.MAV_CMD_PREFLIGHT_CALIBRATION,
        dialect.MAV_CMD_PREFLIGHT_STORAGE,
        dialect.MAV_CMD_DO_START_MAG_CAL,
        dialect.MAV_CMD_DO_ACCEPT_MAG_CAL,
        dialect.MAV_CMD_DO_CANCEL_MAG_CAL,
        dialect.MAV_CMD_GIMBAL_REQUEST_AXIS_CALIBRATION,
        dialect.MAV_CMD_RESET_CAMERA_SETTINGS,
        dialect.MAV_CMD_STORAGE_FORMAT,
        dialect.MAV_CMD_DO_SET_PARAMETER,
        dialect.MAV_CMD_PREFLIGHT_SET_SENSOR_OFFSETS,
        dialect.MAV_CMD_PREFLIGHT_UAVCAN,
        dialect.MAV_CMD_CONFIGURE_ACTUATOR,
        dialect.MAV_CMD_AIRFRAME_CONFIGURATION,
        dialect.MAV_CMD_START_RX_PAIR,
        dialect.MAV_CMD_CAN_FORWARD,
        dialect.MAV_CMD_POWER_OFF_INITIATED,
        dialect.MAV_CMD_FIXED_MAG_CAL,
        dialect.MAV_CMD_FIXED_MAG_CAL_FIELD,
        dialect.MAV_CMD_FIXED_MAG_CAL_YAW,
        dialect.MAV_CMD_ACCELCAL_VEHICLE_POS,
        dialect.MAV_CMD_SET_FACTORY_TEST_MODE,
        dialect.MAV_CMD_GIMBAL_FULL_RESET,
        dialect.MAV_CMD_FLASH_BOOTLOADER,
        dialect.MAV_CMD_DEBUG_TRAP,
        dialect.MAV_CMD_SCRIPTING,
    }
)
"""Those after STORAGE_FORMAT are for systems behind other endpoints."""

WITH_SECRETS = frozenset(
    {
        dialect.MAVLINK_MSG_ID_SETUP_SIGNING,
        dialect.MAVLINK_MSG_ID_AUTH_KEY,
        dialect.MAVLINK_MSG_ID_WIFI_CONFIG_AP,
        dialect.MAVLINK_MSG_ID_AIRLINK_AUTH,
        dialect.MAVLINK_MSG_ID_CHANGE_OPERATOR_CONTROL,
    }
)
"""Messages with a key or password, which no log and no recording may hold."""

COMMANDS = (dialect.MAVLINK_MSG_ID_COMMAND_LONG, dialect.MAVLINK_MSG_ID_COMMAND_INT)

STOPPING = (*COMMANDS, dialect.MAVLINK_MSG_ID_SET_MODE)
"""Messages that can stop a flight."""

_FTP_OPCODE = 3
"""Byte of the payload of FILE_TRANSFER_PROTOCOL that holds the opcode (MAVLink ftp.md)."""

_FTP_READS = frozenset(
    {
        dialect.MAV_FTP_OPCODE_NONE,
        dialect.MAV_FTP_OPCODE_TERMINATESESSION,
        dialect.MAV_FTP_OPCODE_RESETSESSION,
        dialect.MAV_FTP_OPCODE_LISTDIRECTORY,
        dialect.MAV_FTP_OPCODE_OPENFILERO,
        dialect.MAV_FTP_OPCODE_READFILE,
        dialect.MAV_FTP_OPCODE_CALCFILECRC,
        dialect.MAV_FTP_OPCODE_BURSTREADFILE,
        16,  # ListDirectoryWithTime, which the enum does not have
    }
)

_FTP_WRITES = frozenset(
    {dialect.MAV_FTP_OPCODE_CREATEFILE, dialect.MAV_FTP_OPCODE_WRITEFILE, dialect.MAV_FTP_OPCODE_OPENFILEWO}
)
"""Uploads: the only files of our drones that clients can write are plans."""


def needed_access(message: Any) -> Access:
    """Return the level that a message of a client needs.

    None stands for a message that our dialect does not have.
    """
    if message is None:
        return Access.CONTROL
    id = message.get_msgId()
    if id in COMMANDS:
        if message.command in OBSERVED_COMMANDS:
            return Access.OBSERVE
        return Access.ALL if message.command in MAINTENANCE_COMMANDS else Access.CONTROL
    if id in OBSERVED_MESSAGES:
        return Access.OBSERVE
    if id == dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
        opcode = bytes(message.payload)[_FTP_OPCODE]
        if opcode in _FTP_READS or opcode >= dialect.MAV_FTP_OPCODE_ACK:
            return Access.OBSERVE
        return Access.CONTROL if opcode in _FTP_WRITES else Access.ALL
    if id == dialect.MAVLINK_MSG_ID_PARAM_SET and message.param_id == HASH_NAME:
        return Access.OBSERVE
    return Access.ALL if id in MAINTENANCE_MESSAGES else Access.CONTROL


def needed_by_others(message: Any) -> Access:
    """Return the level that a message to a system behind another endpoint needs.

    Files that can be written there are parameters, scripts and firmware too (ArduPilot's @PARAM/param.pck).
    """
    if message is not None and message.get_msgId() == dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
        return Access.ALL if bytes(message.payload)[_FTP_OPCODE] in _FTP_WRITES else needed_access(message)
    return needed_access(message)


MESSAGE_IDS: dict[str, int] = {kind.msgname: id for id, kind in dialect.mavlink_map.items()}
"""Message ids by name."""


_OF_LINK = frozenset({dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM, dialect.MAVLINK_MSG_ID_LOG_REQUEST_END})
_COMMANDS_OF_LINK = frozenset({dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_CONTROL_HIGH_LATENCY})
_FTP_OF_LINK = frozenset({dialect.MAV_FTP_OPCODE_TERMINATESESSION, dialect.MAV_FTP_OPCODE_RESETSESSION})


def concerns_link(message: Any) -> bool:
    """Return True for a permitted message of an observer that changes the state of its link.

    Here each client has its own rates and sessions. A system behind another endpoint has one link to the gateway: its
    rates and sessions are those of all clients.
    """
    id = message.get_msgId()
    if id in COMMANDS:
        return message.command in _COMMANDS_OF_LINK
    if id == dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL:
        return bytes(message.payload)[_FTP_OPCODE] in _FTP_OF_LINK
    return id in _OF_LINK or id == dialect.MAVLINK_MSG_ID_PARAM_SET


class MessageFilter:
    """The message ids that pass."""

    def __init__(self, options: EndpointOptions) -> None:
        """Create the filter of the options, whose names are messages of the dialect."""
        self._allowed = frozenset(MESSAGE_IDS[name] for name in options.allow_messages)
        self._blocked = frozenset(MESSAGE_IDS[name] for name in options.block_messages)

    def passes(self, id: int) -> bool:
        """Return True for a message that may be streamed. Without HEARTBEAT no client sees a system."""
        if id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            return True
        return id not in self._blocked and (not self._allowed or id in self._allowed)
