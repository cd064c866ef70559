"""Stations and a gateway on a zenoh network: real sessions over a router that is a process of its own."""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import socket
import sys
import threading
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import missions
from support.clock import everybodys
from support.fabric import FabricStation, RouterProcess, ground, router
from support.fault_scenarios import watched
from support.ftp import Ftp
from support.mav import Client
from support.media import DAY, add_photo
from support.own_address import own_address
from support.params import write
from support.poor_link import StallingRelay
from support.process import gateway_process
from support.setpoints import VELOCITY_ONLY, engage, local, streaming
from support.world import HOME, World, loopback, world

from anafi_mav.clock import SystemClock
from anafi_mav.fabric import claims, declaration_check, endpoint
from anafi_mav.fabric.envelope import UpEnvelope
from anafi_mav.fabric.ground import FabricGround
from anafi_mav.fabric.settings import session_settings
from anafi_mav.mavlink import dialect as own
from anafi_mav.mavlink.endpoint import parse_endpoint
from anafi_mav.mavlink.frames import frame, pack

ACCEPTED, REJECTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
GOTO, LAND, HOLD = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_NAV_LAND, 0x03040000
PARTITION = 5.0


@asynccontextmanager
async def flown(**more: Any) -> AsyncIterator[tuple[World, RouterProcess]]:
    """A world whose first client is a station on the fabric."""
    async with router() as node, world(endpoints=(node.url,), **more) as w, ground(node.url) as port:
        w.clients.insert(0, await FabricStation().join(port))
        yield w, node


def opened(node: RouterProcess) -> zenoh.Session:
    """A session of another program at the router."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{node.port}"]))
    return zenoh.open(config)


async def held(node: RouterProcess) -> None:
    """Wait until the router names the gateway that holds system id 1.

    Its telemetry may arrive before its token, and another gateway would claim the id at the same moment then.
    """
    with await asyncio.to_thread(opened, node) as session:
        tokens = session.liveliness().declare_subscriber("anafi/1/drone/**", history=True)
        await asyncio.to_thread(tokens.recv)


def counted(w: World, name: str) -> int:
    return w.gateway.counters()[name]


async def notified(client: Client) -> None:
    """Wait until a client knows that another gateway has the system id: from its banner, if it came too late."""
    client.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    await client.wait("STATUSTEXT", lambda m: m.text.startswith("System id 1: another"), since=0)


async def accepted(station: Client, command: int, *params: float) -> None:
    """Send a command until it is accepted.

    It is temporarily rejected until a ping has been answered.
    """
    while (ack := await station.command(command, *params)).result != ACCEPTED:
        assert ack.result == REJECTED
        await station.heartbeat(lambda beat: True)


async def test_station_on_the_fabric_flies_a_mission_and_downloads_a_picture() -> None:
    async with flown(speed=8.0, web=True) as (w, _):
        photo = add_photo(w.drone)
        await missions.put(w, [missions.takeoff(6.0), missions.way(12.0, 0.0, 6.0), missions.RTL])
        await missions.start(w)
        content = await Ftp(w.client, component=100).download(f"/media/{DAY}/{photo.id}")
        assert content == photo.content()
        await w.client.wait("MISSION_ITEM_REACHED", lambda m: m.seq == 1, since=0, timeout=30.0)
        assert counted(w, "late_inputs") == counted(w, "late_commands") == 0


async def test_state_of_a_system_is_published_and_answered() -> None:
    async with router() as node, world(endpoints=(node.url,)):
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber("anafi/1/state")
            published = await asyncio.to_thread(samples.recv)
            (reply,) = await asyncio.to_thread(lambda: list(session.get("anafi/*/state")))
            tokens = await asyncio.to_thread(lambda: [str(one.ok.key_expr) for one in session.liveliness().get("**")])
        for sample in (published, reply.ok):
            state = json.loads(sample.payload.to_string())
            assert state["version"] == 1
            assert (state["drone"]["sysid"], state["drone"]["connected"]) == (1, True)
            assert math.isclose(state["position"]["latitude"], HOME[0], abs_tol=1e-4)
        gateway = state["gateway"]
        assert sorted(tokens) == [f"anafi/1/drone/v1/{gateway}", f"anafi/gateway/v1/{gateway}"]


async def test_setpoints_of_a_partition_move_nothing_after_it() -> None:
    async with router() as node, world(endpoints=(node.url,)) as w:
        relay = StallingRelay(node.port)
        try:
            async with ground(f"zenoh://127.0.0.1:{await relay.start()}", "tcpin") as port:
                station = await FabricStation().join(port, tcp=True)
                w.clients.insert(0, station)
                await w.take_off()
                async with streaming(station, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))) as sent:
                    await engage(station, "px4")
                    await station.wait("LOCAL_POSITION_NED", lambda m: m.x > 1.0)
                    relay.stall()
                    mark = station.mark()
                    station.send_command(GOTO, -1, 1, 0, frame=6, x=HOME[0] + 0.001, y=HOME[1], z=10.0)
                    count = len(sent)
                    with everybodys():  # zenoh gives up a link after 10 s of everybody's clock
                        await asyncio.sleep(PARTITION)
                await asyncio.sleep(0.5)  # the last setpoint is now too old, too
                began, before = len([*w.drone.log]), w.drone.pose
                relay.resume()
                ack = await station.wait("COMMAND_ACK", lambda m: m.command == GOTO, since=mark)
                assert ack.result == REJECTED
                assert (await station.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
                await asyncio.sleep(1.0)
                after = w.drone.pose
                assert math.dist((before.north, before.east, before.up), (after.north, after.east, after.up)) < 0.3
                later = [entry for entry in [*w.drone.log][began:] if entry.kind == "command"]
                assert not [entry for entry in later if entry.name.endswith((".Landing", ".moveTo", ".moveBy"))]
                sticks = [entry.args for entry in later if entry.name.endswith(".PCMD")]
                assert not [args for args in sticks if any(args[axis] for axis in ("roll", "pitch", "yaw", "gaz"))]
                assert counted(w, "late_inputs") >= len(sent) - count > 50
                assert counted(w, "late_commands") == 1
        finally:
            await relay.close()


async def test_stop_of_a_partition_is_carried_out_after_it() -> None:
    async with router() as node, world(endpoints=(node.url,)) as w:
        relay = StallingRelay(node.port)
        try:
            async with ground(f"zenoh://127.0.0.1:{await relay.start()}", "tcpin") as port:
                station = w.take(await FabricStation().join(port, tcp=True))
                await w.take_off()
                relay.stall()
                mark = station.mark()
                station.send(dialect.MAVLink_set_mode_message(1, 1, 0x04040000))  # Mission
                station.send_command(GOTO, -1, 1, 0, frame=6, x=HOME[0] + 0.001, y=HOME[1], z=10.0)
                station.send_command(LAND)
                with everybodys():
                    await asyncio.sleep(2.5)
                relay.resume()
                for command, result in ((GOTO, REJECTED), (LAND, ACCEPTED)):
                    ack = await station.wait("COMMAND_ACK", lambda m, c=command: m.command == c, since=mark)
                    assert ack.result == result
                await station.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark)
                await station.wait("STATUSTEXT", lambda m: m.text == "Command refused: too old on arrival", since=mark)
                assert counted(w, "late_commands") == 2
        finally:
            await relay.close()


async def test_stop_that_waits_while_the_host_stalls_is_carried_out() -> None:
    """Ground process and gateway share the stalled event loop."""
    async with flown() as (w, _):
        await w.take_off()
        with everybodys():
            await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
            mark = w.client.mark()
            w.client.send_command(GOTO, -1, 1, 0, frame=6, x=HOME[0] + 0.001, y=HOME[1], z=10.0)
            w.client.send_command(LAND)
            time.sleep(2.2)  # noqa: ASYNC251
        for command, result in ((GOTO, REJECTED), (LAND, ACCEPTED)):
            ack = await w.client.wait("COMMAND_ACK", lambda m, c=command: m.command == c, since=mark)
            assert ack.result == result
        assert counted(w, "late_commands") == 1


async def test_killed_router_that_returns_brings_the_station_back() -> None:
    async with flown() as (w, node):
        await node.kill()
        await w.client.silence("HEARTBEAT", 2.0)
        await node.start()
        await w.client.heartbeat(lambda beat: True, timeout=20.0)
        await accepted(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, 148)


async def test_system_id_of_another_gateway_is_left_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with router() as node, world(endpoints=(node.url,)) as w, ground(node.url) as port:
        station = w.take(await FabricStation().join(port))
        await held(node)
        file = tmp_path / "second.yaml"
        file.write_text(
            f"state: {tmp_path}/state\nendpoints: ['{node.url}']\nhttp: off\nvideo: off\n"
            f"drones: [{{name: second, sysid: 1, address: {loopback()}}}]\n"
        )
        check = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "anafi_mav", "run", "--check", "-c", str(file), stdout=asyncio.subprocess.PIPE
        )
        output, _ = await check.communicate()
        assert check.returncode == 1
        assert "system 1 is held by gateway" in output.decode()
        # The first goes on, and no sooner than it has ended for a while does the second hold the id.
        monkeypatch.setattr(claims, "FREE_FOR", 1.0)
        monkeypatch.setattr(claims, "SPREAD", 0.0)
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))  # one gateway uses one state folder
        async with world(endpoints=(node.url,)) as other:
            await notified(other.client)
            await accepted(station, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
            await w.gateway.close()
            mark = station.mark()
            await station.heartbeat(lambda beat: True, since=mark, timeout=10.0)
            assert "1 station" in "".join(other.gateway.lines())


async def test_router_that_is_not_there_is_a_problem() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # and does not listen
        url = f"zenoh://127.0.0.1:{taken.getsockname()[1]}"
        async with world(endpoints=(url,)) as w:
            (problem,) = await w.gateway.endpoint_problems()
        assert problem.startswith(f"{url}: no router within 15 s (")


async def test_list_of_ids_that_is_not_the_routers_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """zenoh answers for a router that it loses with an empty list that counts as complete."""
    monkeypatch.setattr(declaration_check, "LIST_TRIES", 1)  # of 3 s each
    async with router() as node:
        relay = StallingRelay(node.port)
        try:
            async with world(endpoints=(f"zenoh://127.0.0.1:{await relay.start()}",)) as w:
                while "connected, 0 stations" not in "".join(w.gateway.lines()):
                    await watched(0.05)
                assert await w.gateway.endpoint_problems() == []
                relay.unanswered = 100  # new connections, which prove that the router names the tokens
                (problem,) = await w.gateway.endpoint_problems()
                assert problem.endswith("the router does not name all system ids that are held: check again")
        finally:
            await relay.close()


async def test_list_without_the_token_of_another_session_proves_nothing() -> None:
    async with router() as node:
        settings = session_settings(parse_endpoint(node.url))

        def look(witness: str) -> set[str]:
            return declaration_check.list_proven(settings, "anafi/**", f"anafi/{witness}", threading.Event())

        with await asyncio.to_thread(opened, node) as session:
            tokens = [session.liveliness().declare_token(f"anafi/{key}") for key in ("1/drone", "gateway/a")]
            assert await asyncio.to_thread(look, "gateway/a") == {"anafi/1/drone", "anafi/gateway/a"}
            assert await asyncio.to_thread(look, "gateway/b") == set()
            assert len(tokens) == 2


async def test_lost_link_of_a_gateway_gives_its_system_id_to_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a restarted router: the gateway is back within seconds, and another one waits for its id."""
    async with router() as node:
        relay = StallingRelay(node.port)
        port = await relay.start()
        try:
            async with world(endpoints=(f"zenoh://127.0.0.1:{port}",)) as w, ground(node.url) as stations:
                station = w.take(await FabricStation().join(stations))
                await held(node)
                monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))  # one gateway uses one state folder
                async with world(endpoints=(node.url,)) as other:
                    await notified(other.client)
                    await notified(await other.connect(250))
                    await relay.close()
                    await station.silence("HEARTBEAT", 2.0)
                    relay = StallingRelay(node.port)
                    await relay.start(port)
                    await station.heartbeat(lambda beat: True, since=station.mark(), timeout=20.0)
                    assert "system 1 is another gateway's" in "".join(other.gateway.lines())
                    assert "another gateway" not in "".join(w.gateway.lines())
        finally:
            await relay.close()


async def test_silent_station_gives_its_place_to_one_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint, "REPLACEABLE", 2.0)  # a station sends once a second
    async with (
        router() as node,
        world(endpoints=(f"{node.url}?max_clients=1",)) as w,
        ground(node.url) as first,
        ground(node.url) as second,
    ):
        idle = await FabricStation().join(first)
        await idle.close()  # its place at the ground process remains
        pilot = w.take(await FabricStation().join(second))
        await accepted(pilot, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        assert counted(w, "refused_peers") == counted(w, "evicted_peers") == 1


async def test_flood_of_stations_without_a_place_fills_no_log(caplog: pytest.LogCaptureFixture) -> None:
    async with router() as node, world(endpoints=(f"{node.url}?max_clients=1",)) as w:
        with await asyncio.to_thread(opened, node) as session:
            names = [f"anafi/station/v1/{number:016x}-1" for number in range(1, 51)]
            tokens = [session.liveliness().declare_token(name) for name in names]
            while counted(w, "refused_peers") < 49:
                await watched(0.05)
            assert len([line for line in caplog.messages if "all places are taken" in line]) == 1
            for token in tokens:
                token.undeclare()


async def test_killed_gateway_that_returns_is_found_by_its_stations(tmp_path: Path) -> None:
    file = tmp_path / "fleet.yaml"
    async with router() as node, ground(node.url) as port:
        file.write_text(
            f"state: {tmp_path}/state\nendpoints: ['{node.url}']\nhttp: off\nvideo: off\n"
            "drones: [{name: alpha, sysid: 1, sim: {}}]\n"
        )
        station = FabricStation()
        try:
            async with gateway_process(file, 10.0) as gateway:
                await station.join(port)
                gateway.kill()
                await gateway.wait()
            await station.silence("HEARTBEAT", 2.0)
            async with gateway_process(file, 10.0):
                await station.heartbeat(lambda beat: True, timeout=20.0)
                await accepted(station, dialect.MAV_CMD_REQUEST_MESSAGE, 148)
        finally:
            await station.close()


async def test_station_whose_token_ends_is_lost_at_once() -> None:
    async with router() as node, world(endpoints=(node.url,)) as w:
        await write(w.client, "ANF_GCS_LOSS", 1, dialect.MAV_PARAM_TYPE_INT32)  # a hold, after 10 s of silence
        async with ground(node.url) as port:
            station = await FabricStation().join(port)
            for _ in range(3):  # it sends one for each: the first are dropped until a ping has been answered
                await station.heartbeat(lambda beat: True)
            mark = w.client.mark()
        await station.close()
        text = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("No ground station"), since=mark)
        seconds = float(text.text.removeprefix("No ground station for ").partition(" s")[0])
        assert seconds < 9.0


async def test_end_of_a_token_without_an_action_is_no_loss() -> None:
    async with router() as node, world(endpoints=(node.url,)) as w:
        async with ground(node.url) as port:
            station = await FabricStation().join(port)
            for _ in range(3):
                await station.heartbeat(lambda beat: True)
        await station.close()
        while "0 stations" not in "".join(w.gateway.lines()):
            await watched(0.05)
        w.client.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        assert "Ground station is back" not in [message.text for _, message in w.client.since(0, "STATUSTEXT")]


async def test_station_that_answers_no_ping_can_stop_the_flight_and_begin_nothing() -> None:
    async with router() as node, world(endpoints=(node.url,), allow_kill=True) as w:
        await w.take_off()
        name = f"{7:016x}-1"
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber(f"anafi/1/down/{name}")
            token = session.liveliness().declare_token(f"anafi/station/v1/{name}")
            await asyncio.to_thread(samples.recv)
            numbers = itertools.count(1)

            def put(sent: own.MAVLink_message) -> None:
                number = next(numbers)
                raw = frame(pack(sent), number, 255, 190)
                session.put(f"anafi/1/up/{name}", raw, attachment=UpEnvelope(7, number, 0).encode())

            put(own.MAVLink_command_long_message(1, 1, own.MAV_CMD_NAV_TAKEOFF, *[0] * 8))
            put(own.MAVLink_set_mode_message(1, 1, 0x04040000))  # Mission
            put(own.MAVLink_command_long_message(1, 1, own.MAV_CMD_DO_FLIGHTTERMINATION, 0, 1, *[0] * 6))
            put(own.MAVLink_command_long_message(1, 1, own.MAV_CMD_NAV_RETURN_TO_LAUNCH, *[0] * 8))
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning, timeout=10.0)
            assert counted(w, "late_commands") == 3
            mark = w.client.mark()
            next(numbers)  # one is lost on the way
            put(own.MAVLink_set_mode_message(1, 1, HOLD))
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=10.0)
            assert counted(w, "late_commands") == 3
            assert w.drone.pose.up > 3.0
            assert counted(w, "lost_samples") == 1
            assert "1 station, 1 of their samples lost" in "".join(w.gateway.lines())
            token.undeclare()


async def test_late_target_is_reported_only_while_it_is_followed() -> None:
    """QGroundControl sends its own position to every drone, once a second."""
    async with router() as node, world(endpoints=(node.url,)) as w:
        await w.take_off()
        name = f"{7:016x}-1"
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber(f"anafi/1/down/{name}")
            token = session.liveliness().declare_token(f"anafi/station/v1/{name}")
            await asyncio.to_thread(samples.recv)  # it answers no ping, so that its time is not known
            numbers = itertools.count(1)

            async def put(*sent: own.MAVLink_message) -> None:
                before = counted(w, "late_frames")
                for message in sent:
                    number = next(numbers)
                    raw = frame(pack(message), number, w.client.sysid, 190)
                    session.put(f"anafi/1/up/{name}", raw, attachment=UpEnvelope(7, number, 0).encode())
                while counted(w, "late_frames") < before + len(sent):
                    await watched(0.05)

            place = (round(HOME[0] * 1e7), round(HOME[1] * 1e7))
            position = own.MAVLink_global_position_int_message(0, *place, 35_000, 0, 0, 0, 0, 0)
            target = own.MAVLink_follow_target_message(0, 1, *place, 35.0, *[[0.0] * n for n in (3, 3, 4, 3, 3)], 0)
            await put(position, target)
            assert counted(w, "late_inputs") == 0
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 8)).result == ACCEPTED  # Follow
            await put(position)
            assert counted(w, "late_inputs") == 0
            await put(target)
            assert counted(w, "late_inputs") == 1
            w.client.send(dialect.MAVLink_global_position_int_message(0, *place, 35_000, 0, 0, 0, 0, 0))
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_ROI_SYSID, w.client.sysid)).result == ACCEPTED
            await put(position)
            assert counted(w, "late_inputs") == 2
            token.undeclare()


async def test_silent_station_with_a_token_is_lost_and_returns_with_its_next_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The end of its token was lost: no ping is answered."""
    monkeypatch.setattr(endpoint, "UNANSWERED_PINGS", 3)
    monkeypatch.setattr(endpoint, "UNANSWERED_FOR", 0.3)
    async with router() as node, world(endpoints=(node.url,)) as w:
        name = f"{7:016x}-1"
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber(f"anafi/1/down/{name}")
            token = session.liveliness().declare_token(f"anafi/station/v1/{name}")
            await asyncio.to_thread(samples.recv)
            while "0 stations" not in "".join(w.gateway.lines()):
                await watched(0.05)
            assert counted(w, "silent_stations") == 1
            raw = frame(pack(own.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)), 1, 255, 190)
            session.put(f"anafi/1/up/{name}", raw, attachment=UpEnvelope(7, 1, 0).encode())
            while "1 station" not in "".join(w.gateway.lines()):
                await watched(0.05)
            token.undeclare()


@asynccontextmanager
async def station_of_system_1(*frames: bytes) -> AsyncIterator[tuple[FabricGround, FabricStation]]:
    """A ground process and its station; these bytes were put for the station under the key of system 1."""
    async with router() as node:
        fabric = FabricGround(parse_endpoint(node.url), [parse_endpoint("udpin://127.0.0.1:0")], SystemClock())
        await fabric.start()
        station = FabricStation()
        with await asyncio.to_thread(opened, node) as session:
            tokens = session.liveliness().declare_subscriber("anafi/station/v1/*", history=True)
            joining = asyncio.ensure_future(station.join(fabric.endpoints[0].local_port or 0))
            name = str((await asyncio.to_thread(tokens.recv)).key_expr).rpartition("/")[2]
            for data in frames:
                session.put(f"anafi/1/down/{name}", data)
            await joining
            yield fabric, station
        await station.close()
        await fabric.close()


async def test_frames_that_do_not_reach_a_station_are_counted() -> None:
    beat = pack(own.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3))
    async with station_of_system_1(*(frame(beat, number, 1, 1) for number in (250, 251, 2, 3))) as (fabric, station):
        await station.heartbeat(lambda beat: beat.get_seq() == 3, since=0)
        assert fabric.all_counters()["lost_frames"] == 6


async def test_frame_of_another_system_than_the_keys_reaches_no_station() -> None:
    """A router's rules name the keys that a gateway may publish: otherwise it could speak for every drone."""
    beat = pack(own.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3))
    async with station_of_system_1(frame(beat, 1, 7, 1) + frame(beat, 2, 1, 1)) as (fabric, station):
        assert {message.get_srcSystem() for _, message in station.received} == {1}
        assert fabric.all_counters()["misdirected_frames"] == 1


async def test_command_to_a_system_whose_token_is_late_is_published() -> None:
    """zenoh reports tokens and samples in a thread each: a station may see a system before its token is known."""
    beat = pack(own.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3))
    loop, commands = asyncio.get_running_loop(), asyncio.Queue[int]()

    def publish(sample: zenoh.Sample) -> None:
        for message in own.MAVLink(None).parse_buffer(sample.payload.to_bytes()) or ():
            if message.get_msgId() == own.MAVLINK_MSG_ID_COMMAND_LONG:
                loop.call_soon_threadsafe(commands.put_nowait, message.command)

    async with router() as node:
        fabric = FabricGround(parse_endpoint(node.url), [parse_endpoint("udpin://127.0.0.1:0")], SystemClock())
        await fabric.start()
        station = FabricStation()
        try:
            with await asyncio.to_thread(opened, node) as session:
                tokens = session.liveliness().declare_subscriber("anafi/station/v1/*", history=True)
                session.declare_subscriber("anafi/1/up/*", publish)
                joining = asyncio.ensure_future(station.join(fabric.endpoints[0].local_port or 0))
                name = str((await asyncio.to_thread(tokens.recv)).key_expr).rpartition("/")[2]
                session.put(f"anafi/1/down/{name}", frame(beat, 0, 1, 1))
                await joining
                station.send_command(LAND)
                assert await asyncio.wait_for(commands.get(), 10.0) == LAND
                # The end of a token ends it: what is sent then reaches no system, as before the first frame.
                with session.liveliness().declare_token(f"anafi/1/drone/v1/{7:016x}"):
                    while fabric.sysids != [1]:
                        await watched(0.05)
                while fabric.sysids:
                    await watched(0.05)
                before = fabric.all_counters()["no_system"]
                station.send_command(LAND)
                while fabric.all_counters()["no_system"] == before:
                    await watched(0.05)
        finally:
            await station.close()
            await fabric.close()


async def test_oversized_samples_are_counted_and_disturb_no_station() -> None:
    async with router() as node, world(endpoints=(node.url,)) as w:
        name = f"{7:016x}-1"
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber(f"anafi/1/down/{name}")
            token = session.liveliness().declare_token(f"anafi/station/v1/{name}")
            await asyncio.to_thread(samples.recv)
            session.put(f"anafi/1/up/{name}", bytes(1401), attachment=UpEnvelope(7, 1, 0).encode())
            session.put(f"anafi/1/up/{name}", b"", attachment=bytes(65))
            sent = own.MAVLink_command_long_message(1, 1, own.MAV_CMD_NAV_TAKEOFF, *[0] * 8)
            raw = frame(pack(sent), 2, 255, 190)
            session.put(f"anafi/1/up/{name}", raw, attachment=UpEnvelope(7, 2, 0).encode())
            session.put(f"anafi/1/up/{name}/pong", b"")  # the last one that is counted
            while counted(w, "bad_envelopes") < 3:
                await asyncio.to_thread(samples.recv)
            assert counted(w, "late_commands") == 1  # no ping was answered
            token.undeclare()


async def test_key_that_a_station_sends_is_not_published() -> None:
    """Gateways take it from signed links only; on the network it could be read."""
    key = bytes(range(32))
    async with flown() as (w, node):
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber("anafi/1/up/**")
            await asyncio.to_thread(samples.recv)
            w.client.send(dialect.MAVLink_setup_signing_message(1, 1, key, 1))
            w.client.send(dialect.MAVLink_setup_signing_message(0, 0, key, 1))
            w.client.send(dialect.MAVLink_statustext_message(6, b"after the key"))
            contents = [b""]
            while b"after the key" not in contents[-1]:
                contents.append((await asyncio.to_thread(samples.recv)).payload.to_bytes())
        assert not [content for content in contents if key in content]


async def test_made_up_address_is_no_station_on_the_fabric() -> None:
    """One datagram, whose sender's address may be forged, would take a place of each gateway."""
    address = own_address()
    async with router() as node:
        ground_process = FabricGround(parse_endpoint(node.url), [parse_endpoint(f"udpin://{address}:0")], SystemClock())
        await ground_process.start()
        client, tokens = Client(), "anafi/station/**"
        try:
            (port,) = (one.local_port for one in ground_process.endpoints)
            assert port is not None
            with await asyncio.to_thread(opened, node) as session:
                appeared = session.liveliness().declare_subscriber(tokens)
                heartbeat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
                client.connect_udp(address, port)
                for _ in range(2):
                    client.send(heartbeat)
                    await asyncio.sleep(0.5)  # in which no station may appear
                    assert not await asyncio.to_thread(lambda: list(session.liveliness().get(tokens)))
                client.send(heartbeat)
                await asyncio.to_thread(appeared.recv)
        finally:
            await client.close()
            await ground_process.close()


async def test_flood_of_queries_leaves_room_for_the_next_one() -> None:
    """Queries beyond those that may be open end without an answer, and none stays open."""
    async with router() as node, world(endpoints=(node.url,)):
        with await asyncio.to_thread(opened, node) as session:
            samples = session.declare_subscriber("anafi/1/state")
            await asyncio.to_thread(samples.recv)
            flood = [session.get("anafi/1/state", timeout=20.0) for _ in range(300)]
            answers = await asyncio.to_thread(lambda: [len(list(replies)) for replies in flood])
            assert set(answers) <= {0, 1}
            assert sum(answers) > 0
            (reply,) = await asyncio.to_thread(lambda: list(session.get("anafi/1/state")))
            assert json.loads(reply.ok.payload.to_string())["version"] == 1
