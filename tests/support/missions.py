"""Missions from a client's side, in both families' ways; where the drone went is the simulator's word."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav.mavlink import dialect as newer
from support.plans import ACCEPTED, MISSION, Item, around, upload
from support.world import HOME, World

PLACE = (HOME[0], HOME[1])

MISSION_MODE = {"px4": 0x04040000, "ardupilot": 3}
NO_MISSION, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5
NAN = float("nan")


def way(north: float, east: float, up: float, **more: float) -> Item:
    """A way point so many m north and east of home, `up` above it."""
    return Item(dialect.MAV_CMD_NAV_WAYPOINT, *around(PLACE, (north, east))[0], z=up, p4=NAN, frame=3, **more)  # type: ignore[arg-type]


def takeoff(up: float) -> Item:
    return Item(dialect.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, z=up, p4=NAN, frame=3)


RTL, LAND = (
    Item(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, frame=2),
    Item(dialect.MAV_CMD_NAV_LAND, 0.0, 0.0, p4=NAN, frame=3),
)

ROUND = [
    takeoff(6.0),
    way(12.0, 0.0, 6.0),
    way(12.0, 15.0, 7.0),
    Item(dialect.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=2.0, frame=2),
    RTL,
]
"""Up, two way points, a wait, home."""


def first(w: World) -> int:
    """What the clients call the first item."""
    return 1 if w.flavour == "ardupilot" else 0


async def put(w: World, items: list[Item]) -> None:
    """Upload a mission as clients of the flavour do, with home in front for ArduPilot's."""
    listed = [Item(dialect.MAV_CMD_NAV_WAYPOINT, *HOME), *items] if first(w) else items
    assert (await upload(w.client, listed, MISSION)).type == ACCEPTED


async def start(w: World) -> None:
    """From the ground, as the flavour's clients do it: PX4's by the mode, ArduPilot's by arming and MISSION_START."""
    assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == dialect.MAV_RESULT_ACCEPTED
    if first(w):
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
    else:
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)
    assert ack.result == dialect.MAV_RESULT_ACCEPTED, ack


def whole(message: Any) -> Any:
    """The same message with the fields that pymavlink's own dialect does not have yet."""
    (again,) = newer.MAVLink(None).parse_buffer(message.get_msgbuf())
    return again


def reached(w: World, since: int = 0) -> list[int]:
    """The items that were reported as reached, counted from 0."""
    return [m.seq - first(w) for _, m in w.client.since(since, "MISSION_ITEM_REACHED")]


async def state(
    w: World, wanted: int, *, seq: int | None = None, since: int | None = None, timeout: float = 30.0
) -> Any:
    """Wait for a MISSION_CURRENT with a mission_state, and the current item counted from 0.

    Before a start ArduPilot's is 0, which is home.
    """
    return await w.client.wait(
        "MISSION_CURRENT",
        lambda m: whole(m).mission_state == wanted and seq in (None, max(m.seq - first(w), 0)),
        since=since,
        timeout=timeout,
    )


def flown(w: World) -> list[str]:
    """What the drone itself has begun, line by line of its files."""
    return [entry.args["command"] for entry in w.drone.log if entry.name == "item"]


async def mode(w: World, number: int, since: int | None = None) -> None:
    await w.client.heartbeat(lambda beat: beat.custom_mode == number, since=since)


async def said(w: World, words: str, since: int = 0) -> Any:
    """Wait for a text with these words."""
    return await w.client.wait("STATUSTEXT", lambda m: words in m.text, since=since)


async def settled(w: World, wanted: tuple[float, float, float]) -> None:
    """Wait until the drone itself is at a place, m north, east and up of where it took off."""
    await w.drone.wait_log(
        lambda entry: math.dist((w.drone.pose.north, w.drone.pose.east, w.drone.pose.up), wanted) < 0.7, timeout=30.0
    )


CORNERS = [takeoff(6.0), way(14.0, 0.0, 6.0), way(14.0, 14.0, 6.0), way(0.0, 14.0, 6.0)]


async def on_the_way(w: World, item: int) -> None:
    """CORNERS are flown, and the drone is on the way to a corner."""
    await put(w, CORNERS)
    await start(w)
    await state(w, ACTIVE, seq=item, since=0)


def pauses(w: World) -> list[str]:
    """What the drone was commanded against its plan, and how it plays."""
    names = ("Pause", "Stop", "moveBy", "moveTo", "PCMD")
    observed = [e.name for e in w.drone.log if e.kind == "command" and e.name.rpartition(".")[2] in names]
    return [*observed, *(e.args["state"] for e in w.drone.log if e.name == "plan")]


def apart(where: Sequence[float], begin: Sequence[float], end: Sequence[float]) -> float:
    """m from the straight way between two places."""
    along = [b - a for a, b in zip(begin, end, strict=True)]
    towards = sum(w * (p - a) for w, p, a in zip(along, where, begin, strict=True))
    part = min(max(towards / (sum(w * w for w in along) or 1.0), 0.0), 1.0)
    return math.dist(where, [a + part * w for a, w in zip(begin, along, strict=True)])
