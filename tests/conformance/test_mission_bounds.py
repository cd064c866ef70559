"""Numbers of mission items that no ANAFI flies, and heights that may be the ground."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.missions import ACTIVE, put, start, state, takeoff, way
from support.plans import INVALID_PARAM1, MISSION, Item, upload
from support.setpoints import said, texts
from support.world import HOME, world

HUGE = 1e30

OUT_OF_BOUNDS: dict[str, tuple[Item, int]] = {
    "hold": (way(10.0, 0.0, 10.0, p1=HUGE), 1),
    "hold of two hours": (way(10.0, 0.0, 10.0, p1=7200.0), 1),
    "radius": (way(10.0, 0.0, 10.0, p2=HUGE), 2),
    "heading": (Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME[:2], z=10.0, p4=HUGE, frame=3), 4),
    "height": (way(10.0, 0.0, HUGE), 7),
    "depth": (way(10.0, 0.0, -HUGE), 7),
    "height above sea level": (Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME[:2], z=-HUGE, frame=0), 7),
    "delay": (Item(dialect.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=HUGE, frame=2), 1),
    "condition delay": (Item(dialect.MAV_CMD_CONDITION_DELAY, 0.0, 0.0, p1=HUGE, frame=2), 1),
    "loiter time": (Item(dialect.MAV_CMD_NAV_LOITER_TIME, *HOME[:2], z=10.0, p1=HUGE, frame=3), 1),
    "speed": (Item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=HUGE, frame=2), 2),
    "speed at which no move would end": (Item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=0.01, frame=2), 2),
    "turn": (Item(dialect.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=HUGE, frame=2), 1),
}
"""An item, and the number of the parameter that MISSION_ACK names."""


async def test_mission_item_out_of_bounds_is_refused_with_its_parameter() -> None:
    async with world() as w:
        await put(w, [way(10.0, 0.0, 10.0)])
        for name, (item, number) in OUT_OF_BOUNDS.items():
            ack = await upload(w.client, [way(0.0, 10.0, 10.0), item], MISSION)
            assert ack.type == INVALID_PARAM1 + number - 1, (name, ack)
        await said(w.client, "Mission refused: item 2: NAV_WAYPOINT: invalid wait", 0)
        for hold in (0.0, 3600.0):
            await put(w, [way(0.0, 10.0, 10.0, p1=hold)])


@pytest.mark.parametrize("frame", [3, 0], ids=["relative", "above sea level"])
async def test_mission_below_the_takeoff_point_warns_at_its_start(frame: int) -> None:
    """10 m meant above the take-off and sent above the sea lead into the ground: PX4 warns of items below home."""
    async with world(web=True) as w:
        low = replace(way(12.0, 0.0, -5.0 if frame == 3 else HOME[2] - 5.0), frame=frame)
        await put(w, [takeoff(6.0), way(12.0, 12.0, 6.0), low])
        mark = w.client.mark()
        await start(w)
        await said(w.client, "Mission item 3 low: -5.0 m above takeoff", mark)
        await state(w, ACTIVE, since=mark)


async def test_mission_at_usual_heights_warns_of_nothing() -> None:
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(12.0, 0.0, 1.0)])
        mark = w.client.mark()
        await start(w)
        await state(w, ACTIVE, since=mark)
        assert not [text for text in texts(w.client, mark) if " low: " in text]


async def test_mission_with_a_takeoff_elsewhere_warns_at_its_start() -> None:
    """The drone flies to the item's place, as PX4 does; ArduCopter rises straight up."""
    async with world(web=True) as w:
        await put(w, [replace(way(30.0, 40.0, 6.0), command=dialect.MAV_CMD_NAV_TAKEOFF), way(12.0, 12.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await said(w.client, "Mission item 1: takeoff place is 50 m away", mark)
        await state(w, ACTIVE, since=mark)


async def test_mission_with_a_takeoff_at_the_drone_warns_of_nothing() -> None:
    async with world(web=True) as w:
        await put(w, [replace(way(3.0, 4.0, 6.0), command=dialect.MAV_CMD_NAV_TAKEOFF), way(30.0, 40.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await state(w, ACTIVE, since=mark)
        assert not [text for text in texts(w.client, mark) if "takeoff place" in text]


@pytest.mark.parametrize(("model", "highest"), [("4k", 15), ("ai", 16)])
async def test_mission_speed_above_the_drones_is_reported_at_upload(model: str, highest: int) -> None:
    async with world(model=model) as w:
        speed = Item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=float(highest), frame=2)
        mark = w.client.mark()
        await put(w, [takeoff(6.0), speed, way(12.0, 0.0, 6.0)])
        await said(w.client, "Mission: 3 items", mark)
        mark = w.client.mark()
        await put(w, [takeoff(6.0), replace(speed, p2=99.0), way(12.0, 0.0, 6.0)])
        text = f"Mission: 3 items; approximated: item 2: speed 99 m/s: the drone flies {highest} m/s at most"
        await said(w.client, text[:50], mark)
        await said(w.client, text[50:], mark)
