"""The mission protocol from a client's side: raw messages, nothing of ours between them and the wire."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from anafi_mav import geo, mav_enums
from support.mav import Client

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
NAMES = {MISSION: "mission", FENCE: "fence", RALLY: "rally"}

ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE = 0, 1, 2, 3, 4
INVALID_PARAM1, INVALID_SEQUENCE, DENIED, CANCELLED = 6, 13, 14, 15

REQUESTS = ("MISSION_REQUEST", "MISSION_REQUEST_INT")
ITEMS = ("MISSION_ITEM", "MISSION_ITEM_INT")


@dataclass(frozen=True)
class Item:
    """What a client wants to have stored."""

    command: int
    latitude: float
    longitude: float
    z: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0
    frame: int = 0

    @property
    def content(self) -> tuple[float, ...]:
        """As MISSION_ITEM_INT has it."""
        x, y = round(self.latitude * 1e7), round(self.longitude * 1e7)
        return (self.command, self.frame, self.p1, self.p2, self.p3, self.p4, x, y, self.z)


def content(message: Any) -> tuple[float, ...]:
    """The same of a MISSION_ITEM_INT."""
    m = message
    return (m.command, m.frame, m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z)


def polygon(corners: Sequence[tuple[float, float]], *, inclusion: bool = True) -> list[Item]:
    return [Item(5001 if inclusion else 5002, *corner, p1=len(corners)) for corner in corners]


def around(place: tuple[float, float], *offsets: tuple[float, float]) -> list[tuple[float, float]]:
    """Points so many metres north and east of a place."""
    return [geo.destination(*place, *offset) for offset in offsets]


def square(place: tuple[float, float], half: float, *, inclusion: bool = True) -> list[Item]:
    """A square fence of twice `half` m with its middle at a place."""
    corners = around(place, (half, half), (-half, half), (-half, -half), (half, -half))
    return polygon(corners, inclusion=inclusion)


def circle(place: tuple[float, float], radius: float, *, inclusion: bool = True) -> Item:
    return Item(5003 if inclusion else 5004, *place, p1=radius)


def mission(home: tuple[float, float, float], size: int, shift: float = 0.0) -> list[Item]:
    """A mission that differs from one of another size or shift, as an ArduPilot client lists it: item 0 is home,
    to others a first way point."""
    turns = [2.0 * math.pi * n / max(size - 1, 1) for n in range(size - 1)]
    circle = around(home[:2], *[(30.0 * math.cos(turn), 30.0 * math.sin(turn)) for turn in turns])
    points = [
        Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *place, z=15.0 + n % 7 + shift, p4=10.0 * (n % 30 + 1), frame=3)
        for n, place in enumerate(circle)
    ]
    return [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *home), *points]


def rally(place: tuple[float, float], height: float) -> Item:
    return Item(mav_enums.MAV_CMD_NAV_RALLY_POINT, *place, z=height, frame=3)


def send_count(client: Client, count: int, kind: int) -> int:
    """Announce an upload; the mark before it."""
    mark = client.mark()
    client.send(dialect.MAVLink_mission_count_message(1, 1, count, kind))
    return mark


def send_item(client: Client, item: Item, seq: int, kind: int, *, as_float: bool = False) -> None:
    fields = (1, 1, seq, item.frame, item.command, 0, 1, item.p1, item.p2, item.p3, item.p4)
    if as_float:
        client.send(dialect.MAVLink_mission_item_message(*fields, item.latitude, item.longitude, item.z, kind))
    else:
        client.send(dialect.MAVLink_mission_item_int_message(*fields, *item.content[6:8], item.z, kind))


async def upload(
    client: Client,
    items: Sequence[Item],
    kind: int,
    *,
    as_float: bool = False,
    timeout: float = 5.0,
    repeat: float | None = None,
) -> Any:
    """Upload in the manner of a ground station: answer every request; the MISSION_ACK that ends it.

    `repeat`: announce it again every so many s until the first request comes.
    """
    position = send_count(client, len(items), kind)
    deadline = time.monotonic() + timeout
    begun = False
    while True:
        waiting = timeout if begun or repeat is None else repeat
        try:
            message = await client.wait(
                (*REQUESTS, "MISSION_ACK"), lambda m: m.mission_type == kind, since=position, timeout=waiting
            )
        except AssertionError:
            if begun or repeat is None or time.monotonic() > deadline:
                raise
            send_count(client, len(items), kind)
            continue
        begun = True
        position = next(i for i in range(position, client.mark()) if client.received[i][1] is message) + 1
        if message.get_type() == "MISSION_ACK":
            return message
        send_item(client, items[message.seq], message.seq, kind, as_float=as_float)


async def count(client: Client, kind: int, timeout: float = 5.0) -> Any:
    """Ask for a list; the MISSION_COUNT."""
    mark = client.mark()
    client.send(dialect.MAVLink_mission_request_list_message(1, 1, kind))
    return await client.wait("MISSION_COUNT", lambda m: m.mission_type == kind, since=mark, timeout=timeout)


async def begin_download(client: Client, kind: int) -> None:
    """Request a list and its first item, and no other."""
    assert (await count(client, kind)).count > 1
    mark = client.mark()
    client.send(dialect.MAVLink_mission_request_int_message(1, 1, 0, kind))
    await client.wait("MISSION_ITEM_INT", lambda m: m.mission_type == kind, since=mark)


async def download(
    client: Client, kind: int, *, tries: int = 1, patience: float = 5.0, as_float: bool = False
) -> list[Any]:
    """The items, one after the other, each asked for so many times, and the closing acknowledgement."""
    ask = dialect.MAVLink_mission_request_message if as_float else dialect.MAVLink_mission_request_int_message
    total = None
    for attempt in range(tries):
        try:
            total = await count(client, kind, patience)
            break
        except AssertionError:
            if attempt == tries - 1:
                raise
    assert total is not None
    items = []
    for seq in range(total.count):
        for attempt in range(tries):
            mark = client.mark()
            client.send(ask(1, 1, seq, kind))
            try:
                items.append(
                    await client.wait(ITEMS, lambda m, seq=seq: m.seq == seq, since=mark, timeout=patience)  # type: ignore[misc]
                )
                break
            except AssertionError:
                if attempt == tries - 1:
                    raise
    client.send(dialect.MAVLink_mission_ack_message(1, 1, ACCEPTED, kind))
    return items


async def clear(client: Client, kind: int) -> Any:
    mark = client.mark()
    client.send(dialect.MAVLink_mission_clear_all_message(1, 1, kind))
    return await client.wait("MISSION_ACK", lambda m: m.mission_type == kind, since=mark)
