"""Items of a plan as MISSION_ITEM_INT and MISSION_ITEM, both ways. No I/O.

MISSION_ITEM_INT is the form that is kept. What comes as MISSION_ITEM, with places in single precision, becomes the
integers that give the same floats back (MAVLink mission.md; conformance C5, D2).
"""

from __future__ import annotations

import math
from typing import Any

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.vehicle.fence.plan_items import DEGREES, UNSET, PlanFault, PlanItem, has_place


def _integer(value: float, scale: float) -> int | None:
    """x or y of a MISSION_ITEM as MISSION_ITEM_INT has it; None when that cannot hold it."""
    if math.isnan(value):
        return UNSET
    if not abs(value * scale) < UNSET:
        return None
    return round(value * scale)


def item_of(message: Any) -> PlanItem | PlanFault:
    """Return the item of a MISSION_ITEM or MISSION_ITEM_INT, or its fault."""
    x: int | None = message.x
    y: int | None = message.y
    if message.get_msgId() == dialect.MAVLINK_MSG_ID_MISSION_ITEM:
        scale = DEGREES if has_place(message.command, message.frame) else 1.0
        x, y = _integer(message.x, scale), _integer(message.y, scale)
    if x is None:
        return PlanFault(dialect.MAV_MISSION_INVALID_PARAM5_X, texts.BAD_LATITUDE)
    if y is None:
        return PlanFault(dialect.MAV_MISSION_INVALID_PARAM6_Y, texts.BAD_LONGITUDE)
    params = (message.param1, message.param2, message.param3, message.param4)
    return PlanItem(message.command, message.frame, params, x, y, message.z, message.autocontinue, message.current)


def item_int(
    item: PlanItem, seq: int, sysid: int, compid: int, mission_type: int
) -> dialect.MAVLink_mission_item_int_message:
    """MISSION_ITEM_INT to one client."""
    return dialect.MAVLink_mission_item_int_message(
        sysid, compid, seq, item.frame, item.command, item.current, item.autocontinue,
        *item.params, item.x, item.y, item.z, mission_type,
    )  # fmt: skip


def item_float(
    item: PlanItem, seq: int, sysid: int, compid: int, mission_type: int
) -> dialect.MAVLink_mission_item_message:
    """MISSION_ITEM to one client: places are as exact as single precision is, about 0.4 m."""
    scale = DEGREES if item.has_place else 1.0
    x, y = (math.nan if value == UNSET else value / scale for value in (item.x, item.y))
    return dialect.MAVLink_mission_item_message(
        sysid, compid, seq, item.frame, item.command, item.current, item.autocontinue,
        *item.params, x, y, item.z, mission_type,
    )  # fmt: skip
