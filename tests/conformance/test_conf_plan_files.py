"""Missions, fences and rally points as ArduPilot's files: read and written over MAVLink FTP, as MAVProxy does it."""

from __future__ import annotations

import struct

import pytest
from support.ftp import ACK, FAIL, NAK, NOT_FOUND, OPEN, TERMINATE, Ftp, taken_apart
from support.plans import FENCE, MISSION, RALLY, Item, circle, content, download, rally, upload
from support.world import HOME, World, world

from anafi_mav import mav_enums
from anafi_mav.services.plan.plan_files import PATHS, unpack_plan
from anafi_mav.vehicle.fence.plan_items import PlanItem

CREATE, WRITE = 6, 7
PLACE = (HOME[0], HOME[1])
LISTS = {
    MISSION: [
        Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME),
        Item(mav_enums.MAV_CMD_NAV_TAKEOFF, *PLACE, z=6.0, frame=3),
        Item(mav_enums.MAV_CMD_NAV_WAYPOINT, HOME[0] + 1e-4, HOME[1], z=8.0, frame=3),
    ],
    FENCE: [circle(PLACE, 80.0), circle(PLACE, 9.0, inclusion=False)],
    RALLY: [rally(PLACE, 20.0), rally((PLACE[0] + 0.001, PLACE[1]), 25.0)],
}


def file_of(items: list[Item], kind: int, *, autocontinue: int = 1) -> bytes:
    """By hand: header, then payloads of MISSION_ITEM_INT in the order of the wire."""
    rows = [
        struct.pack(
            "<ffffiifHHBBBBBB", item.p1, item.p2, item.p3, item.p4, *item.content[6:8], item.z,
            seq, item.command, 1, 1, item.frame, 0, autocontinue, kind,
        )
        for seq, item in enumerate(items)
    ]  # fmt: skip
    return struct.pack("<HHHHH", 0x763D, kind, 0, 0, len(items)) + b"".join(rows)


async def write(w: World, kind: int, data: bytes) -> tuple[int, bytes]:
    """Replace a file; opcode and data of the last answer."""
    ftp = Ftp(w.client)
    assert (await ftp.ask(CREATE, PATHS[kind].encode())).opcode == ACK
    for offset in range(0, len(data), 200):
        assert (await ftp.ask(WRITE, data[offset : offset + 200], offset=offset)).opcode == ACK
    end = await ftp.ask(TERMINATE)
    return end.opcode, end.data


@pytest.mark.parametrize("kind", LISTS)
async def test_ardupilot_client_reads_a_plan_as_a_file(kind: int) -> None:
    async with world(flavour="ardupilot") as w:
        assert (await upload(w.client, LISTS[kind], kind)).type == 0
        found = unpack_plan(await Ftp(w.client).download(PATHS[kind]), kind)
        read = await download(w.client, kind)
        assert isinstance(found, list)
        assert all(isinstance(item, PlanItem) for item in found)
        assert [(item.command, item.frame, *item.params, item.x, item.y, item.z) for item in found] == [
            content(message) for message in read
        ]


@pytest.mark.parametrize("kind", LISTS)
async def test_plan_file_upload_replaces_plan_without_mission_ack(kind: int) -> None:
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        assert await write(w, kind, file_of(LISTS[kind], kind, autocontinue=0)) == (ACK, b"")
        word = {MISSION: "Mission: 2 items", FENCE: "Fence: 1 inclusion circle", RALLY: None}[kind]
        if word is not None:
            await w.client.wait("STATUSTEXT", lambda m: word in m.text, since=mark)
        assert w.client.since(mark, "MISSION_ACK") == []
        read = await download(w.client, kind)
        wanted = [item.content for item in LISTS[kind]]
        assert [content(message) for message in read][1:] == wanted[1:]  # item 0 of a mission is home as it is
        assert all(message.autocontinue == 1 for message in read[1:]) or kind != MISSION
        assert await write(w, kind, file_of([], kind)) == (ACK, b"")
        assert await download(w.client, kind) == []


@pytest.mark.parametrize(
    ("kind", "data", "reason"),
    [
        (MISSION, b"", "Mission refused: file without header"),
        (MISSION, file_of(LISTS[MISSION], MISSION)[:-1], "Mission refused: file lacks its 3 items"),
        (FENCE, file_of([circle(PLACE, -5.0)], FENCE), "Fence refused: item 0: radius -5 m"),
    ],
)
async def test_invalid_plan_file_keeps_plan_and_names_the_reason(kind: int, data: bytes, reason: str) -> None:
    async with world(flavour="ardupilot") as w:
        assert (await upload(w.client, LISTS[kind], kind)).type == 0
        mark = w.client.mark()
        assert (await write(w, kind, data))[0] == NAK
        await w.client.wait("STATUSTEXT", lambda m: m.text == reason, since=mark)
        assert len(await download(w.client, kind)) == len(LISTS[kind])


async def test_mission_file_that_cannot_fly_is_refused_with_text() -> None:
    """The end of the session is answered when it has been examined and stored."""
    async with world(flavour="ardupilot") as w:
        mark = w.client.mark()
        assert await write(
            w,
            MISSION,
            file_of(
                [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME), Item(mav_enums.MAV_CMD_NAV_VTOL_TAKEOFF, *PLACE)], MISSION
            ),
        ) == (NAK, bytes((FAIL,)))
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Mission refused: item 1: "), since=mark)
        assert await download(w.client, MISSION) == []


async def test_end_of_a_mission_file_that_is_sent_again_while_it_is_stored_is_answered_once_for_each() -> None:
    async with world(flavour="ardupilot") as w:
        ftp, data = Ftp(w.client), file_of(LISTS[MISSION], MISSION)
        assert (await ftp.ask(CREATE, PATHS[MISSION].encode())).opcode == ACK
        assert (await ftp.ask(WRITE, data, size=len(data))).opcode == ACK
        mark = w.client.mark()
        for _ in range(3):
            ftp.send(TERMINATE, seq=ftp.seq)
        await w.client.wait("STATUSTEXT", lambda m: "Mission: 2 items" in m.text, since=mark)
        assert (await ftp.ask(TERMINATE, seq=ftp.seq)).opcode == ACK  # its answer is kept
        answers = [taken_apart(m) for _, m in w.client.since(mark, "FILE_TRANSFER_PROTOCOL")]
        assert {(answer.opcode, answer.seq) for answer in answers} == {(ACK, ftp.seq - 1)}
        assert len([m for _, m in w.client.since(mark, "STATUSTEXT") if "Mission: " in m.text]) == 1


async def test_files_of_lists_are_ardupilots_alone() -> None:
    async with world() as w:
        ftp = Ftp(w.client)
        for path in PATHS.values():
            assert (await ftp.ask(OPEN, path.encode())).error == NOT_FOUND
            assert (await ftp.ask(CREATE, path.encode())).opcode == NAK
