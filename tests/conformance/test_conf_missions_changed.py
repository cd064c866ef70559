"""Conformance items 66 and 74: missions that are refused, and others that are uploaded while one is flown.

What is flown is taken from the simulator's own log.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.hanging_disk import hanging
from support.mav import Client
from support.missions import (
    ACTIVE,
    COMPLETE,
    CORNERS,
    LAND,
    NO_MISSION,
    NOT_STARTED,
    PAUSED,
    first,
    mode,
    on_the_way,
    pauses,
    put,
    reached,
    said,
    settled,
    state,
    takeoff,
    way,
    whole,
)
from support.plans import (
    ACCEPTED,
    CANCELLED,
    MISSION,
    REQUESTS,
    UNSUPPORTED,
    Item,
    clear,
    download,
    send_count,
    send_item,
    upload,
)
from support.world import HOME, World, world

from anafi_mav import mav_enums
from anafi_mav.services.memory import Memory
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.state_lock import STATE_WRITER

ERROR, INVALID = 1, 5

SERVO = [takeoff(6.0), way(10.0, 0.0, 6.0), Item(mav_enums.MAV_CMD_DO_SET_SERVO, 0.0, 0.0, p1=1.0, p2=1500.0, frame=2)]
NOTHING = [
    Item(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=4.0, p3=-1.0, frame=2),
    Item(mav_enums.MAV_CMD_DO_LAND_START, 0.0, 0.0, frame=2),
]
"""No item of it flies."""

ROUND_AND_ROUND = [takeoff(6.0), Item(mav_enums.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, p1=1.0, p2=4.0, p3=-1.0, frame=2)]
"""Nothing of what a jump back to its last item repeats flies."""


class AckLost(Client):
    """A client that does not get its first MISSION_ACK."""

    lost: Any = None

    def feed(self, data: bytes) -> None:
        before = self.mark()
        super().feed(data)
        for place in range(before, self.mark()):
            if self.lost is None and self.received[place][1].get_type() == "MISSION_ACK":
                self.lost = self.received.pop(place)[1]
                return


async def without_its_ack(w: World, items: list[Item]) -> tuple[AckLost, list[Item]]:
    """Another client has uploaded a mission, and its acknowledgement is lost; what it listed."""
    client = AckLost(254, 190)
    await client.connect(5760, w.address)
    w.clients.append(client)
    listed = [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME), *items] if first(w) else items
    mark = send_count(client, len(listed), MISSION)
    for seq, item in enumerate(listed):
        await client.wait(REQUESTS, lambda m, seq=seq: m.seq == seq, since=mark)  # type: ignore[misc]
        send_item(client, item, seq, MISSION)
    return client, listed


@both
@pytest.mark.parametrize("often", [-1.0, 60000.0])
async def test_conf_066_endless_loop_without_flight_is_refused_at_upload(flavour: str, often: float) -> None:
    async with world(flavour=flavour) as w:
        jump = Item(mav_enums.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=1.0 + first(w), p2=often, frame=2)
        listed = [*([Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME)] if first(w) else []), *ROUND_AND_ROUND, jump]
        assert (await upload(w.client, listed, MISSION)).type == INVALID
        reason = "endless loop, no flight" if often < 0.0 else "loop without flight"
        await w.client.wait("STATUSTEXT", lambda m: m.text == f"Mission refused: item 3: {reason}", since=0)
        assert len(await download(w.client, MISSION)) == 0


@both
@pytest.mark.parametrize(("items", "result"), [(SERVO, UNSUPPORTED), (NOTHING, INVALID)], ids=["item", "plan"])
async def test_conf_066_lost_refusal_is_repeated_for_a_repeated_last_item(
    flavour: str, items: list[Item], result: int
) -> None:
    """As MAVSDK does after half a second: the same result, and one text in all."""
    async with world(flavour=flavour) as w:
        client, listed = await without_its_ack(w, items)
        await client.wait("STATUSTEXT", lambda m: m.text.startswith("Mission refused: item"), since=0)
        for _ in range(3):
            mark = client.mark()
            send_item(client, listed[-1], len(listed) - 1, MISSION)
            assert (await client.wait("MISSION_ACK", since=mark)).type == result
        assert client.lost.type == result
        await client.heartbeat(lambda beat: True, since=client.mark())
        texts = [m.text for _, m in client.since(0, "STATUSTEXT") if "refused" in m.text]
        assert len(texts) == 1, texts


# While one is flown.


@both
async def test_conf_074_the_same_mission_again_disturbs_nothing(flavour: str) -> None:
    """From two clients, in mid-flight: the drone hears nothing of it, and flies each line of its one file once."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        before, heard = pauses(w), len(w.commands("common.Mavlink.Start"))
        other = await w.connect(254)
        mark = w.client.mark()
        for client in (w.client, other):
            listed = [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME), *CORNERS] if first(w) else CORNERS
            assert (await upload(client, listed, MISSION)).type == ACCEPTED
            await said(w, "continues at item 3", since=mark)
        assert pauses(w) == before
        observed = await state(w, ACTIVE, seq=2, since=w.client.mark())
        await state(w, COMPLETE, since=mark)
        assert len(w.commands("common.Mavlink.Start")) == heard == 1
        assert pauses(w) == [*before, "stopped"]
        assert [e.args["index"] for e in w.drone.log if e.name == "item"] == [0, 1, 2, 3, 4]
        assert reached(w) == [0, 1, 2, 3]
        assert whole(observed).mission_id == whole(await state(w, COMPLETE)).mission_id != 0
        await settled(w, (0.0, 14.0, 6.0))


@both
async def test_conf_074_same_mission_uploaded_after_its_end_is_new(flavour: str) -> None:
    """A program that uploads, starts and waits for the end must not take the last end for this one's."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        assert (await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        mark = w.client.mark()
        await put(w, CORNERS)
        await state(w, NOT_STARTED, seq=0, since=mark)
        for _ in range(2):
            mark, flights = w.client.mark(), len(w.commands("common.Mavlink.Start"))
            assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
            await state(w, ACTIVE, seq=1, since=mark)
            await state(w, COMPLETE, since=mark)
            assert reached(w, mark) == [0, 1, 2, 3]
            assert len(w.commands("common.Mavlink.Start")) == flights + 1
            mark = w.client.mark()
            await put(w, CORNERS)
            await state(w, NOT_STARTED, seq=0, since=mark)


@both
@pytest.mark.parametrize("how", ["another", "one item", "cleared"])
async def test_conf_074_other_mission_uploaded_in_flight_stops_the_flown_one(flavour: str, how: str) -> None:
    """The drone is paused, hovers where it is, and flies nothing of either until a person says so."""
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 2)
        mark = w.client.mark()
        if how == "cleared":
            assert (await clear(w.client, MISSION)).type == ACCEPTED
            await said(w, "mission was cleared", since=mark)
            await state(w, NO_MISSION, since=mark)
        else:
            await put(
                w, [takeoff(6.0), way(0.0, 9.0, 6.0)] if how == "another" else [*CORNERS[:-1], way(0.0, 9.0, 6.0)]
            )
            await said(w, "Mission paused at item 3: another was uploaded", since=mark)
            await state(w, NOT_STARTED, seq=0, since=mark)
        await mode(w, w.modes.idle, since=mark)
        (paused,) = w.commands("common.Mavlink.Pause")
        await w.drone.wait_log(lambda e: e.kind == "state" and e.args["event"] == "at_rest", since=paused.t)
        there = w.drone.pose
        for _ in range(3):
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle, since=w.client.mark())
        here = w.drone.pose
        assert math.dist((there.north, there.east, there.up), (here.north, here.east, here.up)) < 0.3
        assert pauses(w) == ["common.Mavlink.Pause", "playing", "paused"]
        if how != "cleared":
            assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
            await settled(w, (0.0, 9.0, 6.0))


@both
@pytest.mark.parametrize("how", ["refused", "given up", "refused in the thread"])
async def test_conf_063_failed_upload_leaves_the_flight_alone(flavour: str, how: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await on_the_way(w, 1)
        before, mark = pauses(w), w.client.mark()
        home = [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME)] if first(w) else []
        if how == "given up":
            send_count(w.client, 9, MISSION)
            await w.client.wait(REQUESTS, since=mark)
            w.client.send(dialect.MAVLink_mission_ack_message(1, 1, CANCELLED, MISSION))
        else:
            bad = (
                SERVO
                if how == "refused"
                else [*ROUND_AND_ROUND, Item(mav_enums.MAV_CMD_DO_JUMP, 0.0, 0.0, p1=1.0, p2=-1.0, frame=2)]
            )
            assert (await upload(w.client, [*home, *bad], MISSION)).type in (UNSUPPORTED, INVALID)
        await state(w, COMPLETE, since=mark)
        assert pauses(w) == [*before, "stopped"]
        assert reached(w) == [0, 1, 2, 3]
        assert len(await download(w.client, MISSION)) == len(CORNERS) + first(w)


ONE_WAY = [takeoff(6.0), way(15.0, 0.0, 6.0), LAND]
OTHER_WAY = [takeoff(6.0), way(0.0, 12.0, 6.0), way(0.0, 15.0, 6.0), LAND]


async def up_to_the_last_item(w: World, items: list[Item]) -> None:
    """Upload, and do not wait for the acknowledgement."""
    listed = [Item(mav_enums.MAV_CMD_NAV_WAYPOINT, *HOME), *items] if first(w) else items
    position = send_count(w.client, len(listed), MISSION)
    for seq, item in enumerate(listed):
        await w.client.wait(REQUESTS, lambda m, seq=seq: m.seq == seq, since=position)
        send_item(w.client, item, seq, MISSION)


@both
async def test_conf_073_start_after_the_last_item_starts_new_mission(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ONE_WAY)
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        await up_to_the_last_item(w, OTHER_WAY)
        if flavour == "ardupilot":
            ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        else:
            ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)
        assert ack.result == ACCEPTED
        assert [m.type for _, m in w.client.since(mark, "MISSION_ACK")] == [ACCEPTED]
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 11.0, timeout=40.0)
        assert all(e.args["north"] < 2.0 for e in w.drone.log if e.kind == "pose")
        files = [e for e in w.drone.log if e.kind == "plan" and e.name == "plan" and e.args["state"] == "playing"]
        assert len(files) == 1


@both
async def test_conf_074_item_selected_after_upload_belongs_to_new_mission(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await put(w, ONE_WAY)
        mark = w.client.mark()
        await up_to_the_last_item(w, OTHER_WAY)
        chosen = first(w) + 3
        w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, chosen))
        observed = await w.client.wait("MISSION_CURRENT", lambda m: m.seq == chosen, since=mark)
        assert whole(observed).total == len(OTHER_WAY)  # home is not one of them


async def test_conf_074_mission_armed_during_its_upload_is_the_new_one() -> None:
    """The mode is chosen before the upload; arming follows its last item, while the mission is being stored."""
    async with world(web=True) as w:
        await put(w, ONE_WAY)
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)).result == ACCEPTED
        await up_to_the_last_item(w, OTHER_WAY)
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 11.0, timeout=40.0)
        assert all(e.args["north"] < 2.0 for e in w.drone.log if e.kind == "pose")


async def test_start_of_a_mission_being_stored_fails_with_a_text_when_the_link_is_lost() -> None:
    """It waits for the disk: the loss of the drone does not reach it."""
    async with world(web=True, speed=1.0) as w:
        with hanging(STATE_WRITER):
            w.drone.faults.mute = True
            await up_to_the_last_item(w, ONE_WAY)
            mark = w.client.mark()
            ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
            assert ack.result == dialect.MAV_RESULT_FAILED
            texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
            assert "Command failed: drone not connected" in texts
            assert w.client.since(mark, "MISSION_ACK") == []  # the disk has not answered


async def test_conf_063_failed_storing_is_reported_and_the_next_upload_succeeds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever goes wrong in the gateway: clients must not wait for an answer that never comes."""

    async def fail(memory: Memory) -> None:
        raise RuntimeError("as if the gateway had a mistake")

    async with world(web=True) as w:
        with monkeypatch.context() as broken:
            broken.setattr(Memory, "save", fail)
            assert (await upload(w.client, ONE_WAY, MISSION)).type == ERROR
            assert (await w.client.wait("STATUSTEXT", lambda m: "cannot be stored" in m.text, since=0)).severity <= 4
        assert (await upload(w.client, OTHER_WAY, MISSION)).type == ACCEPTED
        assert len(await download(w.client, MISSION)) == len(OTHER_WAY)


@both
@pytest.mark.parametrize("how", ["longer", "shorter"])
async def test_conf_074_an_edited_mission_is_flown_with_the_new_numbers(flavour: str, how: str) -> None:
    """An Ai begins in the middle of a file that it has; the old mission's file says the same places of other items."""
    last = [way(14.0, 14.0, 6.0), way(0.0, 14.0, 6.0)]
    longer = [takeoff(6.0), way(14.0, 0.0, 6.0), way(7.0, 7.0, 6.0), *last]
    async with world(flavour=flavour, web=True, model="ai") as w:
        await on_the_way(w, 1)
        mark, edited = w.client.mark(), longer if how == "longer" else last
        begin = len(edited) - len(last)
        await put(w, edited)
        await state(w, NOT_STARTED, seq=0, since=mark)
        if begin:
            number = begin + first(w)
            assert (
                await w.client.command(mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT, number, 0)
            ).result == dialect.MAV_RESULT_ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, ACTIVE, seq=begin, since=mark)
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [begin, begin + 1], "and no item that was never flown"
        old, new = w.commands("flight_plan.start_at_v2")
        assert old.args["flightplan_id"] != new.args["flightplan_id"]
        assert [e.args["index"] for e in w.drone.log if e.name == "item" and e.t > new.t] == [0, 1]
        assert [e.args["state"] for e in w.drone.log if e.name == "plan" and e.t > new.t][-1] == "stopped"
        await mode(w, w.modes.idle, since=mark)
        await settled(w, (0.0, 14.0, 6.0))


async def test_mission_uploaded_in_a_pause_flies_despite_refused_files() -> None:
    """The paused plan is stopped before the upload, as GroundSDK does."""
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({Quirk.UPLOAD_REFUSED_WHILE_PAUSED})
        await on_the_way(w, 2)
        assert (await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        mark = w.client.mark()
        await put(w, [way(6.0, 0.0, 6.0), way(0.0, 6.0, 6.0)])
        assert (await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, COMPLETE, since=mark)
        assert reached(w, mark) == [0, 1]


async def test_continue_after_the_paused_mission_was_replaced_is_refused() -> None:
    """It would fly nothing of the new mission, and so it is not accepted."""
    async with world(web=True) as w:
        await on_the_way(w, 2)
        pause = dialect.MAV_CMD_DO_PAUSE_CONTINUE
        assert (await w.client.command(pause, 0)).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=2)
        await put(w, [way(6.0, 0.0, 6.0), way(0.0, 6.0, 6.0)])
        assert (await w.client.command(pause, 1)).result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
