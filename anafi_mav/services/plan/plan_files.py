"""Plans as ArduPilot's files "@MISSION/mission.dat", "fence.dat" and "rally.dat". No I/O.

MAVProxy's `wp ftp` and `wp ftpload` transfer them. A header of five numbers (magic, MAV_MISSION_TYPE, options, first
item, number of items), then the items as the payloads of MISSION_ITEM_INT in the order of the wire (ArduPilot
AP_Filesystem_Mission, MAVProxy mission_item_protocol.py).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.services.plan.item_messages import item_int, item_of
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem

PATHS: Mapping[int, str] = {
    dialect.MAV_MISSION_TYPE_MISSION: "/@MISSION/mission.dat",
    dialect.MAV_MISSION_TYPE_FENCE: "/@MISSION/fence.dat",
    dialect.MAV_MISSION_TYPE_RALLY: "/@MISSION/rally.dat",
}
"""By MAV_MISSION_TYPE."""

MAGIC = 0x763D

_HEADER = struct.Struct("<HHHHH")
_ITEM = struct.Struct("<ffffiifHHBBBBBB")
"""param1..4, x, y, z, seq, command, target system and component, frame, current, autocontinue, mission type."""


def size_of(items: int) -> int:
    """Bytes of a file with so many items."""
    return _HEADER.size + items * _ITEM.size


def pack_plan(items: Sequence[PlanItem], mission_type: int) -> bytes:
    """Return the file of a list."""
    parts = [_HEADER.pack(MAGIC, mission_type, 0, 0, len(items))]
    for seq, item in enumerate(items):
        message = item_int(item, seq, 0, 0, mission_type)
        parts.append(_ITEM.pack(*(getattr(message, name) for name in message.ordered_fieldnames)))
    return b"".join(parts)


def unpack_plan(content: bytes, mission_type: int) -> list[PlanItem] | PlanFault:
    """Return the list in a file, or why it holds none."""
    if len(content) < _HEADER.size:
        return _invalid(texts.FILE_NO_HEADER)
    magic, kind, options, first, count = _HEADER.unpack_from(content)
    if magic != MAGIC or kind != mission_type:
        return _invalid(texts.FILE_OTHER_KIND)
    if options != 0 or first != 0:
        return _invalid(texts.FILE_PART)
    if len(content) != size_of(count):
        return _invalid(texts.FILE_ITEMS.fill(count=count))
    items: list[PlanItem] = []
    names = dialect.MAVLink_mission_item_int_message.ordered_fieldnames
    for seq, values in enumerate(_ITEM.iter_unpack(content[_HEADER.size :])):
        message = dialect.MAVLink_mission_item_int_message(**dict(zip(names, values, strict=True)))
        item = item_of(message)
        if isinstance(item, PlanFault):
            return PlanFault(item.result, texts.ITEM_REASON.fill(number=seq, reason=item.reason))
        if message.seq != seq:
            return _invalid(texts.FILE_NUMBER.fill(number=seq, seq=message.seq))
        items.append(item)
    return items


def _invalid(reason: OperatorText) -> PlanFault:
    return PlanFault(dialect.MAV_MISSION_INVALID, reason)
