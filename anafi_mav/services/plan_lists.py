"""Mission, fence and rally lists: all three are empty and say so.

Until the mission service lands, a list of items is refused as a whole and an empty one is true by itself. Silence
would hang every client: QGroundControl asks for the three lists each time it connects.
"""

from __future__ import annotations

from typing import Any

from anafi_mav.mavlink import dialect

TYPES = (
    dialect.MAV_MISSION_TYPE_MISSION,
    dialect.MAV_MISSION_TYPE_FENCE,
    dialect.MAV_MISSION_TYPE_RALLY,
)


def answer(message: Any, sysid: int, compid: int) -> list[dialect.MAVLink_message]:
    """What to send back to (sysid, compid) for a message of the mission protocol; empty when nothing is due."""
    kind = getattr(message, "mission_type", dialect.MAV_MISSION_TYPE_MISSION)

    def acknowledge(result: int) -> list[dialect.MAVLink_message]:
        return [dialect.MAVLink_mission_ack_message(sysid, compid, result, kind)]

    match message.get_msgId():
        case dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
            if kind not in TYPES:
                return acknowledge(dialect.MAV_MISSION_UNSUPPORTED)
            return [dialect.MAVLink_mission_count_message(sysid, compid, 0, kind)]
        case dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
            known = kind in TYPES or kind == dialect.MAV_MISSION_TYPE_ALL
            return acknowledge(dialect.MAV_MISSION_ACCEPTED if known else dialect.MAV_MISSION_UNSUPPORTED)
        case dialect.MAVLINK_MSG_ID_MISSION_COUNT:
            empty = message.count == 0 and kind in TYPES
            return acknowledge(dialect.MAV_MISSION_ACCEPTED if empty else dialect.MAV_MISSION_UNSUPPORTED)
        case dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT | dialect.MAVLINK_MSG_ID_MISSION_REQUEST:
            return acknowledge(dialect.MAV_MISSION_INVALID_SEQUENCE)
        case dialect.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST:
            return acknowledge(dialect.MAV_MISSION_UNSUPPORTED)
        case dialect.MAVLINK_MSG_ID_MISSION_ITEM | dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT:
            return acknowledge(
                dialect.MAV_MISSION_UNSUPPORTED if message.current in (2, 3) else dialect.MAV_MISSION_ERROR
            )
    return []
