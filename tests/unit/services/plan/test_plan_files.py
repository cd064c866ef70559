"""The files of plans: bytes made by hand, round trips, and what is refused."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock

from anafi_mav.mavlink import dialect
from anafi_mav.services.plan.plan_files import MAGIC, PATHS, pack_plan, size_of, unpack_plan
from anafi_mav.vehicle.fence.plan_items import PlanFault, PlanItem

MISSION, FENCE = dialect.MAV_MISSION_TYPE_MISSION, dialect.MAV_MISSION_TYPE_FENCE
ITEMS = [
    PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 0, (0.0, 0.0, 0.0, 0.0), 488789000, 23677000, 35.0),
    PlanItem(dialect.MAV_CMD_NAV_TAKEOFF, 3, (0.0, 0.0, 0.0, 0.0), 0, 0, 12.5),
    PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, 3, (2.0, 0.0, 0.0, 90.0), 488799000, 23687000, 20.0, autocontinue=0),
]


def test_plan_file_has_mavproxys_layout() -> None:
    """Its own reader: header of five numbers, then payloads of MISSION_ITEM_INT by pymavlink's unpacker."""
    content = pack_plan(ITEMS, MISSION)
    assert struct.unpack_from("<HHHHH", content) == (0x763D, 0, 0, 0, 3)
    kind = stock.MAVLink_mission_item_int_message
    assert len(content) == 10 + 3 * kind.unpacker.size == size_of(3)
    values = kind.unpacker.unpack_from(content, 10 + 2 * kind.unpacker.size)
    found = dict(zip(kind.ordered_fieldnames, values, strict=True))
    assert (found["seq"], found["command"], found["frame"], found["autocontinue"]) == (2, 16, 3, 0)
    assert (found["param1"], found["param4"], found["x"], found["y"], found["z"]) == (
        2.0, 90.0, 488799000, 23687000, 20.0,
    )  # fmt: skip


@pytest.mark.parametrize("kind", PATHS)
def test_written_plan_file_reads_back_equal(kind: int) -> None:
    assert unpack_plan(pack_plan(ITEMS, kind), kind) == ITEMS
    assert unpack_plan(pack_plan([], kind), kind) == []


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "file without header"),
        (bytes(9), "file without header"),
        (bytes(10), "of another kind"),
        (pack_plan(ITEMS, FENCE), "of another kind"),
        (pack_plan(ITEMS, MISSION)[:-1], "lacks its 3 items"),
        (pack_plan(ITEMS, MISSION) + b"\0", "lacks its 3 items"),
        (struct.pack("<HHHHH", MAGIC, 0, 1, 0, 0), "holds part of a list"),
        (struct.pack("<HHHHH", MAGIC, 0, 0, 1, 0), "holds part of a list"),
        (struct.pack("<HHHHH", MAGIC, 0, 0, 0, 1) + pack_plan(ITEMS, MISSION)[-38:], "item 0 has number 2"),
    ],
)
def test_incomplete_plan_file_is_refused(content: bytes, reason: str) -> None:
    found = unpack_plan(content, MISSION)
    assert isinstance(found, PlanFault)
    assert reason in found.reason
