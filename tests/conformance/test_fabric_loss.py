"""The fabric over a poor link between gateway and router: late and stalled on `tcp/`, late and lossy on `udp/`.

The station repeats what is not answered (support/repeating.py). tests/bench/fabric_loss.py prints the figures.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import missions, repeating
from support.fabric import FabricStation, ground, router
from support.media import DAY, add_photo
from support.plans import ACCEPTED as STORED
from support.plans import MISSION
from support.poor_link import LossyRelay, StallingRelay
from support.setpoints import VELOCITY_ONLY, local, streaming
from support.world import OFFBOARD, World, world

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DELAY, LOSS, STALL = 0.05, 0.05, 1.0
NORTH = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))
PLAN = [missions.takeoff(6.0), *(missions.way(10.0 + n, 0.0, 6.0) for n in range(4)), missions.RTL]


@asynccontextmanager
async def stalling(*, flying: bool = False) -> AsyncIterator[tuple[World, StallingRelay]]:
    """A world whose first client is a station on the fabric; the gateway's link is 50 ms late."""
    async with router() as node:
        relay = StallingRelay(node.port, delay=DELAY)
        try:
            async with joined(f"zenoh://127.0.0.1:{await relay.start()}", node.url, flying=flying) as w:
                yield w, relay
        finally:
            await relay.close()


@asynccontextmanager
async def lossy(*, flying: bool = False) -> AsyncIterator[tuple[World, LossyRelay]]:
    """A world whose first client is a station on the fabric; the gateway's link is 50 ms late and loses 5 %.

    It loses nothing before the station is known: a lost declaration is found after seconds (docs/fabric.md).
    """
    async with router(also="udp") as node:
        relay = LossyRelay(node.other, loss=0.0, delay=DELAY)
        try:
            async with joined(f"zenoh://127.0.0.1:{await relay.start()}?link=udp", node.url, flying=flying) as w:
                relay.loss = LOSS
                yield w, relay
        finally:
            await relay.close()


@asynccontextmanager
async def joined(gateway: str, station: str, *, flying: bool) -> AsyncIterator[World]:
    async with world(endpoints=(gateway,), web=True) as w, ground(station) as port:
        if flying:
            await w.take_off()
        w.clients.insert(0, await FabricStation().join(port))
        # A command is rejected until a ping has been answered.
        while (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result != ACCEPTED:
            await w.client.heartbeat(lambda beat: True)
        yield w


async def over_a_stall(relay: StallingRelay, work: Coroutine[None, None, Any]) -> Any:
    """Begin work, stall the link for a second, and return the result of the work."""
    task = asyncio.ensure_future(work)
    await asyncio.sleep(2.5 * DELAY)
    relay.stall()
    await asyncio.sleep(STALL)
    assert not task.done()
    relay.resume()
    return await task


async def test_stall_delays_a_command_an_upload_and_a_download_and_loses_none() -> None:
    async with stalling() as (w, relay):
        photo, refused = add_photo(w.drone), w.gateway.counters()["late_commands"]
        task = w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        relay.stall()  # before it is sent
        assert (await over_a_stall(relay, task)).result == ACCEPTED
        assert (await over_a_stall(relay, repeating.upload(w.client, PLAN, MISSION))).type == STORED
        path = f"/media/{DAY}/{photo.id}"
        assert await over_a_stall(relay, repeating.download(w.client, path)) == photo.content()
        assert w.gateway.counters()["late_commands"] == refused


async def test_setpoints_of_a_stall_move_nothing_and_land_gets_through() -> None:
    async with stalling(flying=True) as (w, relay):
        async with streaming(w.client, NORTH):
            await offboard(w)
            await w.client.wait("LOCAL_POSITION_NED", lambda m: m.x > 1.0)
            relay.stall()
            # The silence of 0.5 s ends the flight; the program goes on sending.
            await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=now())
            before, mark = w.drone.pose, w.client.mark()
            w.client.send_command(dialect.MAV_CMD_NAV_LAND)
            await asyncio.sleep(4 * DELAY)
            relay.resume()
            ack = await w.client.wait("COMMAND_ACK", lambda m: m.command == dialect.MAV_CMD_NAV_LAND, since=mark)
            assert ack.result == ACCEPTED
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark)
            after = w.drone.pose
            assert math.dist((before.north, before.east), (after.north, after.east)) < 0.5
        assert w.gateway.counters()["late_inputs"] > 5


async def test_link_of_600_ms_there_and_back_connects() -> None:
    async with router() as node:
        relay = StallingRelay(node.port, delay=0.3)
        try:
            async with joined(f"zenoh://127.0.0.1:{await relay.start()}", node.url, flying=False) as w:
                assert w.gateway.counters()["reopened"] == 0
        finally:
            await relay.close()


async def test_drones_are_back_soon_when_new_connections_get_no_answer() -> None:
    async with stalling() as (w, relay):
        relay.unanswered = 2
        relay.reset()
        await w.client.silence("HEARTBEAT", 1.5)
        # Each of both attempts ends after 3 s; zenoh's own limit is 10 s.
        await w.client.heartbeat(lambda beat: True, timeout=10.0)
        assert (relay.unanswered, w.gateway.counters()["reopened"]) == (0, 1)


async def test_loss_delays_commands_an_upload_and_a_download_and_loses_none() -> None:
    async with lossy() as (w, relay):
        photo = add_photo(w.drone)
        for _ in range(5):
            ack, _ = await repeating.command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
            assert ack.result == ACCEPTED
        assert (await repeating.upload(w.client, PLAN, MISSION)).type == STORED
        assert await repeating.download(w.client, f"/media/{DAY}/{photo.id}") == photo.content()
        assert relay.lost > 0


async def test_setpoints_over_a_lossy_link_end_with_their_sender_and_land_gets_through() -> None:
    async with lossy(flying=True) as (w, relay):
        async with streaming(w.client, NORTH):
            await offboard(w)
            await w.client.wait("LOCAL_POSITION_NED", lambda m: m.x > 2.0, timeout=10.0)
            mark, ended = w.client.mark(), now()
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.2, 10.0, since=ended)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold, since=mark, timeout=10.0)
        ack, _ = await repeating.command(w.client, dialect.MAV_CMD_NAV_LAND)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0, since=ended)
        # The link may lose all heartbeats of a landing of some seconds, but not what is sent until it arrives.
        standby = dialect.MAV_STATE_STANDBY
        await w.client.heartbeat(lambda beat: beat.system_status == standby, since=mark, timeout=10.0)
        assert relay.lost > 0


def now() -> float:
    return asyncio.get_running_loop().time()


async def offboard(w: World) -> None:
    """Choose mode Offboard, again while it is refused for the one reason that this link may cause.

    Setpoints that the link, or a busy machine, made older than 0.3 s are dropped.
    """
    for _ in range(20):
        mark = w.client.mark()
        ack, _ = await repeating.command(w.client, dialect.MAV_CMD_DO_SET_MODE, 1, 6, 0)
        if ack.result == ACCEPTED:
            await w.client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD, since=mark, timeout=10.0)
            return
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await w.client.heartbeat(lambda beat: True, timeout=10.0)
    raise AssertionError("mode Offboard is not accepted")


async def accepted(station: FabricStation) -> None:
    """Wait until a command is accepted."""
    for _ in range(20):
        with contextlib.suppress(repeating.Unanswered):
            ack, _ = await repeating.command(station, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
            if ack.result == ACCEPTED:
                return
        await station.heartbeat(lambda beat: True, timeout=20.0)
    raise AssertionError("no command is accepted")


@pytest.mark.parametrize("lost", [b"anafi/1/drone", b"anafi/1/up", b"anafi/station"])
async def test_lost_declaration_of_the_gateway_is_made_again(lost: bytes) -> None:
    """Its token, its subscription, and that to the tokens of stations."""
    async with router(also="udp") as node:
        relay = LossyRelay(node.other, loss=0.0, delay=DELAY)
        relay.lose_next = lost
        url = f"zenoh://127.0.0.1:{await relay.start()}?link=udp"
        try:
            async with world(endpoints=(url,)) as w, ground(node.url) as port:
                station = w.take(await FabricStation().join(port))
                await accepted(station)
                assert (relay.lost, relay.lose_next) == (1, b"")
                # In use: nothing that a look misses opens another session.
                assert w.gateway.counters()["reopened"] <= 1
        finally:
            await relay.close()


async def test_station_whose_token_was_lost_on_the_way_to_the_gateway_is_found() -> None:
    async with router(also="udp") as node:
        relay = LossyRelay(node.other, loss=0.0, delay=DELAY)
        url = f"zenoh://127.0.0.1:{await relay.start()}?link=udp"
        try:
            async with world(endpoints=(url,)) as w, ground(node.url) as port:
                await accepted(w.take(await FabricStation().join(port)))
                relay.lose_next = b"anafi/station/v1"
                await accepted(w.take(await FabricStation(254).join(port)))
                assert (relay.lost, w.gateway.counters()["reopened"]) == (1, 0)
        finally:
            await relay.close()
