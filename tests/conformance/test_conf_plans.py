"""Conformance items 46, 47, 48, 61 to 72 and 142: what all three lists have in common, in both flavours.

Item 69 wants a position that is the same within 1e-6 degrees; a MISSION_ITEM carries single precision, which is coarser
than that (1.9e-6 at 48.9°). Asked for is the nearest number that the message can carry.
"""

from __future__ import annotations

import asyncio
import math
import struct
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.lossy import lossy_link
from support.mav import Client
from support.plans import (
    ACCEPTED,
    ALL,
    CANCELLED,
    DENIED,
    ERROR,
    FENCE,
    INVALID_PARAM1,
    INVALID_SEQUENCE,
    ITEMS,
    MISSION,
    NO_SPACE,
    RALLY,
    REQUESTS,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    Item,
    around,
    circle,
    clear,
    content,
    count,
    download,
    mission,
    polygon,
    rally,
    send_count,
    send_item,
    square,
    upload,
)
from support.world import HOME, UDP_PORT, loopback, world

from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim import DroneSpec, Simulator

lists = pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])

PLACE = (HOME[0], HOME[1])


def a_plan(kind: int, size: int = 10, shift: float = 0.0) -> list[Item]:
    """Good items that can be distinguished from those of another size or shift; far away, so that the drone may fly."""
    if kind == MISSION:
        return mission(HOME, size, shift)
    if kind == RALLY:
        return [
            rally(place, 20.0 + n + shift)
            for n, place in enumerate(around(PLACE, *[(40.0 * n, -30.0) for n in range(size)]))
        ]
    turns = [2.0 * math.pi * n / (size - 1) for n in range(size - 1)]
    middle = around(PLACE, (3000.0 + shift, 0.0))[0]
    corners = around(middle, *[(40.0 * math.cos(turn), 60.0 * math.sin(turn)) for turn in turns])
    return [*polygon(corners, inclusion=False), circle(around(PLACE, (5000.0 + shift, 0.0))[0], 35.5, inclusion=False)]


@both
@lists
async def test_conf_046_empty_lists(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        total = await count(w.client, kind, timeout=0.5)
        assert (total.count, total.mission_type) == (0, kind)
        assert (total.target_system, total.target_component) == (255, 190)


@both
@lists
async def test_conf_047_upload_and_download_are_equal(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(kind)
        ack = await upload(w.client, plan, kind)
        assert (ack.type, ack.mission_type) == (ACCEPTED, kind)
        assert [content(item) for item in await download(w.client, kind)] == [item.content for item in plan]


@both
async def test_conf_048_answers_go_to_the_requester(flavour: str) -> None:
    """Five clients with the addresses of real ones, two of them on one channel; each uploads, and all read at once."""
    async with world(flavour=flavour) as w:
        others = [await w.connect(*address) for address in ((255, 230), (245, 190), (255, 0), (7, 42))]
        for index, client in enumerate((w.client, *others)):
            plan = a_plan(FENCE, 4 + index)
            assert (await upload(client, plan, FENCE, as_float=client.compid == 0)).type == ACCEPTED
            items = await asyncio.gather(*(download(other, FENCE) for other in (w.client, *others)))
            assert {len(seen) for seen in items} == {4 + index}
        for client in (w.client, *others):
            targets = {
                (m.target_system, m.target_component)
                for kind in ("MISSION_ACK", "MISSION_COUNT", *REQUESTS, *ITEMS)
                for _, m in client.since(0, kind)
            }
            assert targets == {(client.sysid, client.compid)}


@both
async def test_conf_061_a_quarter_of_everything_lost(flavour: str) -> None:
    """tests/clients/test_lossy_missions.py has 500 items."""
    async with world(flavour=flavour, udp=True) as w, lossy_link((w.address, UDP_PORT), 0.25) as link:
        client, plan = w.take(Client(254).connect_udp(*link.address)), a_plan(RALLY, 40)
        ack = await upload(client, plan, RALLY, timeout=10.0, repeat=0.5)
        assert ack.type == ACCEPTED
        items = await download(client, RALLY, tries=20, patience=0.1)
        assert [content(item) for item in items] == [item.content for item in plan]
        link.check(80)


def requests(client: Client) -> list[tuple[float, Any]]:
    return sorted((entry for kind in REQUESTS for entry in client.since(0, kind)), key=lambda entry: entry[0])


@both
async def test_conf_061_requested_again_within_250_ms(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        mark = send_count(w.client, 5, FENCE)
        for _ in range(4):
            await w.client.wait(REQUESTS, since=mark)
            mark = w.client.mark()
        times = [at for at, _ in requests(w.client)]
        assert {m.seq for _, m in requests(w.client)} == {0}
        assert [round(b - a, 1) for a, b in pairwise(times)] == pytest.approx([0.25] * 3, abs=0.1)


@both
async def test_conf_062_copies_and_items_out_of_order(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(RALLY, 4)
        mark = send_count(w.client, 4, RALLY)
        await w.client.wait(REQUESTS, lambda m: m.seq == 0, since=mark)
        send_item(w.client, plan[0], 0, RALLY)
        await w.client.wait(REQUESTS, lambda m: m.seq == 1, since=mark)
        for stray in (0, 3, 2, 0):
            send_item(w.client, plan[stray], stray, RALLY)
        mark = w.client.mark()
        again = await w.client.wait(REQUESTS, since=mark, timeout=1.0)
        assert again.seq == 1
        for seq in (1, 2):
            send_item(w.client, plan[seq], seq, RALLY)
            await w.client.wait(REQUESTS, lambda m, seq=seq: m.seq == seq + 1, since=mark)  # type: ignore[misc]
        send_item(w.client, plan[3], 3, RALLY)
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == ACCEPTED
        assert [content(item) for item in await download(w.client, RALLY)] == [item.content for item in plan]


@both
@lists
async def test_conf_063_an_aborted_upload_keeps_the_old_plan(flavour: str, kind: int) -> None:
    """The client falls silent; the vehicle asks for five seconds, says that it gives up, and takes the next upload."""
    async with world(flavour=flavour) as w:
        plan = a_plan(kind)
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        mark = send_count(w.client, 7, kind)
        await w.client.wait(REQUESTS, since=mark)
        send_item(w.client, a_plan(kind, 7, 1.0)[0], 0, kind)
        ack = await w.client.wait("MISSION_ACK", since=mark, timeout=8.0)
        assert (ack.type, ack.mission_type) == (CANCELLED, kind)
        await w.client.wait("STATUSTEXT", lambda m: "upload aborted" in m.text, since=mark)
        assert [content(item) for item in await download(w.client, kind)] == [item.content for item in plan]
        assert (await upload(w.client, a_plan(kind, 5), kind)).type == ACCEPTED


@both
async def test_conf_063_closed_channel_frees_its_plan_transfer(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        other = await w.connect(254)
        mark = send_count(other, 5, FENCE)
        await other.wait(REQUESTS, since=mark)
        await other.close()
        deadline = time.monotonic() + 1.0  # well before its silence would end the transfer
        while (ack := await upload(w.client, a_plan(FENCE), FENCE)).type != ACCEPTED:
            assert ack.type == DENIED
            assert time.monotonic() < deadline


@both
@lists
async def test_conf_064_the_client_cancels(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(kind)
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        mark = send_count(w.client, 7, kind)
        await w.client.wait(REQUESTS, since=mark)
        w.client.send(dialect.MAVLink_mission_ack_message(1, 1, CANCELLED, kind))
        assert [content(item) for item in await download(w.client, kind)] == [item.content for item in plan]
        mark = w.client.mark()
        await w.client.wait("HEARTBEAT", since=mark)
        assert [m for name in REQUESTS for _, m in w.client.since(mark, name)] == []
        # And a download.
        w.client.send(dialect.MAVLink_mission_request_list_message(1, 1, kind))
        w.client.send(dialect.MAVLink_mission_ack_message(1, 1, CANCELLED, kind))
        other = await w.connect(254)
        assert (await upload(other, a_plan(kind, 5), kind)).type == ACCEPTED


@both
@lists
async def test_conf_065_a_second_client_is_refused(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        other = await w.connect(254, 191)
        plan, wrong = a_plan(kind), a_plan(kind, 5, 3.0)
        mark = send_count(w.client, len(plan), kind)
        await w.client.wait(REQUESTS, since=mark)
        assert (await upload(other, wrong, kind)).type == DENIED
        assert (await clear(other, kind)).type == DENIED
        mark = other.mark()
        send_item(other, wrong[0], 0, kind)
        ack = await other.wait("MISSION_ACK", since=mark)
        assert ack.type in (DENIED, ERROR)
        send_item(w.client, plan[0], 0, kind)
        for seq in range(1, len(plan)):
            await w.client.wait(REQUESTS, lambda m, seq=seq: m.seq == seq, since=0)  # type: ignore[misc]
            send_item(w.client, plan[seq], seq, kind)
        assert (await w.client.wait("MISSION_ACK", since=0)).type == ACCEPTED
        assert [content(item) for item in await download(other, kind)] == [item.content for item in plan]
        assert (await upload(other, wrong, kind)).type == ACCEPTED


async def test_fence_is_not_deleted_by_a_late_copy_of_its_clients_clearing() -> None:
    """MAVProxy clears a fence before it uploads another; a router's second link to the gateway may be slow."""
    async with world(also="px4") as w:
        second, plan = await w.connect(port=5761), square(PLACE, 50.0)
        frame, mark = w.client.pack(dialect.MAVLink_mission_clear_all_message(1, 1, FENCE)), w.client.mark()
        w.client.send_raw(frame)
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == ACCEPTED
        assert (await upload(w.client, plan, FENCE)).type == ACCEPTED
        second.send_raw(frame)
        assert [content(item) for item in await download(second, FENCE)] == [item.content for item in plan]


BAD_ITEMS = [
    (FENCE, [Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE)], UNSUPPORTED, "item 0"),
    (FENCE, [circle(PLACE, 50.0), Item(dialect.MAV_CMD_NAV_RALLY_POINT, *PLACE)], UNSUPPORTED, "item 1"),
    (RALLY, [Item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, *PLACE, p1=3)], UNSUPPORTED, "item 0"),
    (FENCE, [circle(PLACE, -5.0)], INVALID_PARAM1, "item 0"),
    (FENCE, [circle(PLACE, float("nan"))], INVALID_PARAM1, "item 0"),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, *PLACE, p1=2)], INVALID_PARAM1, "item 0"),
    (FENCE, square(PLACE, 50.0)[:3], INVALID_PARAM1, "item 0: not 4 corners"),
    (
        FENCE,
        [circle(PLACE, 50.0), *square(PLACE, 50.0)[:3], circle(PLACE, 50.0)],
        INVALID_PARAM1,
        "item 1: not 4 corners",
    ),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, *PLACE, p1=50, p2=0.5)], INVALID_PARAM1 + 1, "item 0"),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 95.0, 2.0, p1=50)], INVALID_PARAM1 + 4, "item 0"),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 48.0, 190.0, p1=50)], INVALID_PARAM1 + 5, "item 0"),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0.0, 0.0, p1=50)], INVALID_PARAM1 + 4, "item 0"),
    (FENCE, [Item(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, *PLACE, p1=50, frame=10)], UNSUPPORTED_FRAME, "item 0"),
    (RALLY, [Item(dialect.MAV_CMD_NAV_RALLY_POINT, *PLACE, z=20, frame=11)], UNSUPPORTED_FRAME, "item 0"),
    (RALLY, [Item(dialect.MAV_CMD_NAV_RALLY_POINT, *PLACE, z=float("inf"), frame=3)], INVALID_PARAM1 + 6, "item 0"),
    (FENCE, polygon([PLACE, PLACE, PLACE]), 5, "has no area"),
    (
        FENCE,
        [Item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT, *PLACE), Item(dialect.MAV_CMD_NAV_FENCE_RETURN_POINT, *PLACE)],
        5,
        "return point",
    ),
    (
        MISSION,
        [
            Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20, frame=3),
            Item(dialect.MAV_CMD_DO_GRIPPER, 0.0, 0.0, p2=1, frame=2),
        ],
        UNSUPPORTED,
        "item {}",
    ),
    (
        MISSION,
        [
            Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20, frame=3),
            Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20, frame=10),
        ],
        UNSUPPORTED_FRAME,
        "item {}",
    ),
    (
        MISSION,
        [
            Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20, frame=3),
            Item(dialect.MAV_CMD_NAV_WAYPOINT, 95.0, 2.0, z=20, frame=3),
        ],
        INVALID_PARAM1 + 4,
        "item {}",
    ),
    (
        MISSION,
        [
            Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20, frame=3),
            Item(dialect.MAV_CMD_NAV_WAYPOINT, 48.0, 190.0, z=20, frame=3),
        ],
        INVALID_PARAM1 + 5,
        "item {}",
    ),
]


@both
async def test_conf_066_unstorable_items_are_refused(flavour: str) -> None:
    """Refused with the reason and the item, and what was there before stays."""
    async with world(flavour=flavour) as w:
        for kind in (MISSION, FENCE, RALLY):
            assert (await upload(w.client, a_plan(kind), kind)).type == ACCEPTED
        for kind, items, result, words in BAD_ITEMS:
            mark = w.client.mark()
            ack = await upload(w.client, items, kind)
            assert (ack.type, ack.mission_type) == (result, kind), items
            text = await w.client.wait("STATUSTEXT", lambda m: "refused" in m.text, since=mark)
            number = 2 if flavour == "px4" else 1  # the map's: home is item 0 there
            assert words.format(number) in text.text or text.id > 0, text.text  # a longer one goes on in the next
            assert (await count(w.client, kind)).count == 10


@both
@lists
async def test_conf_067_more_than_there_is_room_for(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(kind)
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        mark = send_count(w.client, 5001, kind)
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == NO_SPACE
        mark = send_count(w.client, 5000, kind)
        assert (await w.client.wait(REQUESTS, since=mark)).seq == 0
        w.client.send(dialect.MAVLink_mission_ack_message(1, 1, CANCELLED, kind))
        assert (await count(w.client, kind)).count == len(plan)


@both
async def test_conf_068_clearing(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for cleared in (FENCE, RALLY, MISSION, ALL):
            for kind in (MISSION, FENCE, RALLY):
                assert (await upload(w.client, a_plan(kind), kind)).type == ACCEPTED
            for _ in range(2):  # the second time there is nothing to clear
                ack = await clear(w.client, cleared)
                assert (ack.type, ack.mission_type, whole(ack).opaque_id) == (ACCEPTED, cleared, 0)
            for kind in (MISSION, FENCE, RALLY):
                assert (await count(w.client, kind)).count == (0 if cleared in (kind, ALL) else 10)
        assert (await upload(w.client, a_plan(FENCE), FENCE)).type == ACCEPTED
        mark = send_count(w.client, 0, FENCE)
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == ACCEPTED
        assert (await count(w.client, FENCE)).count == 0


def single(value: float) -> float:
    """The nearest number in single precision."""
    (result,) = struct.unpack("<f", struct.pack("<f", value))
    return float(result)


@both
@lists
async def test_conf_069_float_requests(flavour: str, kind: int) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(kind)
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        items = await download(w.client, kind, as_float=True)
        assert {item.get_type() for item in items} == {"MISSION_ITEM"}
        for seen, wanted in zip(items, plan, strict=True):
            x, y = wanted.content[6:8]
            assert (seen.x, seen.y) == (single(x / 1e7), single(y / 1e7))
            assert (seen.x, seen.y) == pytest.approx((wanted.latitude, wanted.longitude), abs=2e-6)
            assert (seen.command, seen.frame, seen.param1, seen.z) == (
                wanted.command,
                wanted.frame,
                wanted.p1,
                wanted.z,
            )


@both
@lists
async def test_conf_069_items_uploaded_as_floats(flavour: str, kind: int) -> None:
    """dronekit's way, from component 0: it answers MISSION_REQUEST only, with MISSION_ITEM."""
    async with world(flavour=flavour) as w:
        client = await w.connect(255, 0)
        plan = a_plan(kind, 6)
        position = send_count(client, len(plan), kind)
        while True:
            message = await client.wait(("MISSION_REQUEST", "MISSION_ACK"), since=position)
            position = next(i for i in range(position, client.mark()) if client.received[i][1] is message) + 1
            if message.get_type() == "MISSION_ACK":
                break
            send_item(client, plan[message.seq], message.seq, kind, as_float=True)
        assert message.type == ACCEPTED
        for seen, wanted in zip(await download(client, kind, as_float=True), plan, strict=True):
            assert (seen.x, seen.y) == (single(wanted.latitude), single(wanted.longitude))


@both
async def test_conf_070_five_requests_at_once(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        plan = a_plan(FENCE, 12)
        assert (await upload(w.client, plan, FENCE)).type == ACCEPTED
        mark = w.client.mark()
        total = await count(w.client, FENCE)
        wanted = [*range(5), 11, 10, 9, 8, 7, 6, 5, 0, 0]
        for seq in wanted:
            w.client.send(dialect.MAVLink_mission_request_int_message(1, 1, seq, FENCE))
        w.client.send(dialect.MAVLink_mission_request_int_message(1, 1, total.count, FENCE))
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == INVALID_SEQUENCE
        seen = [m for _, m in w.client.since(mark, "MISSION_ITEM_INT")]
        assert [m.seq for m in seen] == wanted
        assert [content(m) for m in seen] == [plan[seq].content for seq in wanted]


def whole(message: Any) -> Any:
    """The same message with the fields that pymavlink's own dialect does not have yet."""
    (again,) = newer.MAVLink(None).parse_buffer(message.get_msgbuf())
    return again


def whole_ids(message: Any) -> dict[int, int]:
    """Which plans a MISSION_CURRENT names."""
    current = whole(message)
    return {MISSION: current.mission_id, FENCE: current.fence_id, RALLY: current.rally_points_id}


@both
async def test_conf_071_opaque_ids(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        client = w.client
        other = await w.connect(254)
        seen: dict[int, set[int]] = {MISSION: set(), FENCE: set(), RALLY: set()}
        ids = {MISSION: 0, FENCE: 0, RALLY: 0}
        for kind, size in ((FENCE, 5), (RALLY, 5), (FENCE, 6), (MISSION, 5), (RALLY, 7), (FENCE, 5), (MISSION, 6)):
            mark = other.mark()
            ack = await upload(client, a_plan(kind, size), kind)
            total = await count(client, kind)
            ids[kind] = whole(ack).opaque_id
            assert ids[kind] == whole(total).opaque_id != 0
            seen[kind].add(ids[kind])
            # Everybody hears that something changed, at once.
            await other.wait("MISSION_CURRENT", lambda m: whole_ids(m) == ids, since=mark, timeout=0.5)
        assert len(seen[FENCE]) == 2  # the last one was the first one again
        assert len(seen[RALLY]) == len(seen[MISSION]) == 2
        await clear(client, FENCE)
        await other.wait("MISSION_CURRENT", lambda m: whole_ids(m) == {**ids, FENCE: 0})


@both
async def test_conf_072_there_is_no_current_item_without_a_mission(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        current = await w.client.wait("MISSION_CURRENT")
        assert (whole(current).seq, whole(current).total, whole(current).mission_state) == (0, 0xFFFF, 1)
        assert (
            await w.client.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 0, 0)
        ).result == dialect.MAV_RESULT_DENIED
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, 3))
        await w.client.wait("MISSION_CURRENT", since=mark, timeout=2.0)
        await w.client.wait("STATUSTEXT", lambda m: "no mission" in m.text, since=0)


@lists
async def test_conf_142_single_items_replaced(kind: int) -> None:
    """MAVProxy's way to move a point (ArduPilot flavour); PX4 has no such thing and says so."""
    async with world(flavour="ardupilot") as w:
        plan, other = a_plan(kind), a_plan(kind, shift=7.0)
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_write_partial_list_message(1, 1, 9, 9, kind))
        assert (await w.client.wait(REQUESTS, since=mark)).seq == 9
        send_item(w.client, other[9], 9, kind)
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == ACCEPTED
        wanted = [*plan[:9], other[9]]
        assert [content(item) for item in await download(w.client, kind)] == [item.content for item in wanted]
    async with world(flavour="px4") as w:
        assert (await upload(w.client, plan, kind)).type == ACCEPTED
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_write_partial_list_message(1, 1, 9, 9, kind))
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == UNSUPPORTED


async def test_conf_069_home_is_item_0_to_ardupilots_clients_alone() -> None:
    """One mission, two numberings: a jump names the same item to both, and no heading is 0 here and NaN there."""
    plan = [
        *a_plan(MISSION, 3)[:2],
        Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20.0, frame=3),
        Item(dialect.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=2.0, p2=1.0, frame=2),
    ]
    async with world(flavour="ardupilot", also="px4") as w:
        copter, px4 = w.client, await w.connect(port=5761)
        assert (await upload(copter, plan, MISSION)).type == ACCEPTED
        assert [content(item) for item in await download(copter, MISSION)] == [item.content for item in plan]
        seen = await download(px4, MISSION)
        assert [(m.command, m.x) for m in seen] == [(item.command, item.content[6]) for item in plan[1:]]
        assert (seen[0].param4, seen[2].param1, seen[2].param2) == (10.0, 1.0, 1.0)
        assert math.isnan(seen[1].param4)
        assert whole(await count(px4, MISSION)).opaque_id == whole(await count(copter, MISSION)).opaque_id
        # As they are, but for the home that one of them lists.
        totals = [whole(await client.wait("MISSION_CURRENT")) for client in (copter, px4)]
        assert [(m.seq, m.total, m.mission_state) for m in totals] == [(0, 3, 2), (0, 3, 2)]  # before a start
        assert (await upload(px4, plan[1:3], MISSION)).type == ACCEPTED
        assert [content(item)[6] for item in await download(copter, MISSION)] == [i.content[6] for i in plan[:3]]


async def test_conf_069_heading_north_survives_an_ardupilot_client() -> None:
    """0 is north to PX4's clients and no heading to ArduPilot's, for whom north is 360."""
    north = Item(dialect.MAV_CMD_NAV_WAYPOINT, *PLACE, z=20.0, p4=0.0, frame=3)
    async with world(flavour="ardupilot", also="px4") as w:
        copter, px4 = w.client, await w.connect(port=5761)
        assert (await upload(px4, [north], MISSION)).type == ACCEPTED
        identity = whole(await count(px4, MISSION)).opaque_id
        home, seen = await download(copter, MISSION)
        assert seen.param4 == 360.0
        again = [Item(m.command, m.x / 1e7, m.y / 1e7, m.z, p4=m.param4, frame=m.frame) for m in (home, seen)]
        assert (await upload(copter, again, MISSION)).type == ACCEPTED
        assert [m.param4 for m in await download(px4, MISSION)] == [0.0]
        assert whole(await count(px4, MISSION)).opaque_id == identity


async def test_conf_069_home_can_be_read_without_a_mission() -> None:
    """dronekit reads it as item 0 and waits for ever without it; ArduCopter always has it."""
    async with world(flavour="ardupilot") as w:
        w.client.send_command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_HOME_POSITION)
        await w.client.wait("HOME_POSITION", since=0)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_request_message(1, 1, 0, MISSION))
        home = await w.client.wait("MISSION_ITEM", since=mark)
        assert (home.seq, home.command, home.frame) == (0, 16, 0)
        assert (home.x, home.y, home.z) == pytest.approx(HOME, abs=2e-6)
        # Uploaded alone it is no mission; and a plan of PX4's kind has no such item.
        assert (await upload(w.client, a_plan(MISSION, 1), MISSION)).type == ACCEPTED
        assert (await count(w.client, MISSION)).count == 0
    async with world(flavour="px4") as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_mission_request_message(1, 1, 0, MISSION))
        assert (await w.client.wait("MISSION_ACK", since=mark)).type == INVALID_SEQUENCE


@asynccontextmanager
async def simulated() -> AsyncIterator[str]:
    """A simulated drone alone; its address."""
    address = loopback()
    async with Simulator([DroneSpec(address=address, home=HOME, http_port=None)], speed=3.0, seed=1):
        yield address


@asynccontextmanager
async def gateway(drone: str, state: str | None = None) -> AsyncIterator[Client]:
    """A gateway for it, and a client."""
    address = loopback()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",), drones=(DroneConfig(name="alpha", sysid=1, address=drone),), state=state
    )
    async with Gateway(config) as running:
        client = await Client().connect(5760, address)
        assert await running.ready(10.0), running.lines()
        await client.heartbeat(lambda beat: True, since=0)
        try:
            yield client
        finally:
            await client.close()


async def test_conf_122_plans_outlive_the_gateway(tmp_path: Path) -> None:
    """With the same ids; and a gateway that keeps its state elsewhere knows nothing of them."""
    async with simulated() as drone:
        ids = {}
        async with gateway(drone) as client:
            for kind in (MISSION, FENCE, RALLY):
                ids[kind] = whole(await upload(client, a_plan(kind), kind)).opaque_id
        async with gateway(drone) as client:
            await client.wait("STATUSTEXT", lambda m: m.text.startswith("Fence: "), since=0)
            for kind in (MISSION, FENCE, RALLY):
                assert whole(await count(client, kind)).opaque_id == ids[kind]
                wanted = [item.content for item in a_plan(kind)]
                assert [content(item) for item in await download(client, kind)] == wanted
            await clear(client, FENCE)
        async with gateway(drone) as client:
            assert [(await count(client, kind)).count for kind in (MISSION, FENCE, RALLY)] == [10, 0, 10]
        (file,) = (tmp_path / "state" / "anafi-mav").glob("*.json")
        async with gateway(drone, str(tmp_path / "elsewhere")) as client:
            assert (await count(client, RALLY)).count == 0
        # A file that a person has spoiled: one line, and it is still there.
        file.write_bytes(b"{]")
        async with gateway(drone) as client:
            text = await client.wait("STATUSTEXT", lambda m: "put aside" in m.text or m.chunk_seq == 0, since=0)
            assert text.severity <= dialect.MAV_SEVERITY_WARNING
            assert (await count(client, RALLY)).count == 0
            assert (await upload(client, a_plan(RALLY), RALLY)).type == ACCEPTED
        names = sorted(path.name for path in file.parent.iterdir() if path.suffix != ".lock")
        assert names == [file.name, file.with_suffix(".unreadable-1").name]
        assert file.with_suffix(".unreadable-1").read_bytes() == b"{]"


async def test_conf_122_plans_outlive_a_lost_link() -> None:
    async with world() as w:
        ack = await upload(w.client, a_plan(FENCE), FENCE)
        mark = send_count(w.client, 5, RALLY)
        await w.client.wait(REQUESTS, since=mark)
        w.drone.faults.mute = True
        down = time.monotonic()
        while not w.client.received[-1][0] < time.monotonic() - 2.0:  # the system is gone when its heartbeat is
            assert time.monotonic() < down + 10.0
            await asyncio.sleep(0.1)
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=15.0)
        total = await count(w.client, FENCE)
        assert (total.count, whole(total).opaque_id) == (10, whole(ack).opaque_id)
        assert (await upload(w.client, a_plan(RALLY), RALLY)).type == ACCEPTED


@both
async def test_a_thousand_items_without_a_pause(flavour: str) -> None:
    """Nothing waits but for the client: loopback and a client in Python make it a few seconds at most."""
    async with world(flavour=flavour) as w:
        plan = a_plan(RALLY, 1000)
        start = time.monotonic()
        assert (await upload(w.client, plan, RALLY)).type == ACCEPTED
        took = time.monotonic() - start
        sent = requests(w.client)
        assert [m.seq for _, m in sent] == list(range(1000)), "nothing was requested twice"
        assert took < 1000 * 0.25 / 10
        assert [content(item) for item in await download(w.client, RALLY)] == [item.content for item in plan]
