"""The status of a gateway with a flying drone: record, page, metrics and command line say the same."""

from __future__ import annotations

import asyncio
import json
import re
import sys
from pathlib import Path

import aiohttp
import msgspec
import pytest
from prometheus_client.parser import text_string_to_metric_families
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, DENIED, goto
from support.statuses import NASTY, STATUS
from support.world import OPTIONS_PORT, World, world

from anafi_mav.cli import status as command
from anafi_mav.errors import ConfigError
from anafi_mav.status_record import VERSION, GatewayStatus
from anafi_mav.web.status_routes import MAX_AGE


def url(w: World, path: str) -> str:
    assert w.gateway.web is not None
    return f"http://127.0.0.1:{w.gateway.web.port}{path}"


async def fetched(w: World) -> GatewayStatus:
    async with aiohttp.ClientSession() as session:
        return command.decode(await command.fetch(session, command.AskedGateway(url(w, "/"), None)))


async def test_status_of_a_flight_has_drone_client_and_refusal() -> None:
    async with world(speed=4.0) as w:
        await w.take_off(10.0)
        assert await goto(w, 20.0, 10.0) == ACCEPTED
        ack = await w.client.command(dialect.MAV_CMD_DO_CHANGE_SPEED, 1, 900.0)
        assert ack.result == DENIED
        assert (await w.client.command(dialect.MAV_CMD_DO_PARACHUTE, 1)).result == dialect.MAV_RESULT_UNSUPPORTED
        await w.client.wait("ATTITUDE")
        await asyncio.sleep(5.0)  # two measurements of the rates
        status = await fetched(w)
        assert status.version == VERSION
        (drone,) = status.drones
        assert (drone.name, drone.connected, drone.mode, drone.flying) == ("alpha", True, "Hold", "IN_AIR")
        assert drone.serial == w.drone.identity.serial
        assert drone.height_m is not None
        assert abs(drone.height_m - w.drone.pose.up) < 0.5
        assert drone.commands.results["ACCEPTED"] >= 3
        assert drone.commands.latency.count >= 3
        parachute, speed = drone.commands.refused[:2]
        assert (parachute.command, parachute.result) == ("DO_PARACHUTE", "UNSUPPORTED")
        assert (speed.command, speed.result, speed.sender) == ("DO_CHANGE_SPEED", "DENIED", "255/190")
        assert speed.reason.startswith("Speed refused: ")
        (client,) = status.endpoints[0].clients
        assert client.systems == ("255/190",)
        assert client.sent_rate > 1000.0
        assert status.counters.keys() == dict(w.gateway.counters()).keys()
        async with aiohttp.ClientSession() as session, session.get(url(w, "/metrics")) as answer:
            assert answer.headers["Content-Type"] == "text/plain; version=0.0.4; charset=utf-8"
            families = {one.name: one for one in text_string_to_metric_families(await answer.text())}
        assert families["anafi_mav_drone_in_air"].samples[0].value == 1.0


async def test_refusals_of_a_client_that_has_left_stay_in_the_status() -> None:
    async with world(options=["access=observe"]) as w:
        observer = await w.connect(250, port=OPTIONS_PORT)
        assert (await observer.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == DENIED
        await observer.close()
        await w.client.wait("SYSTEM_TIME", since=w.client.mark())  # the gateway has seen the end, too
        await asyncio.sleep(MAX_AGE + 0.1)
        status = await fetched(w)
        assert status.endpoints[1].clients == ()
        assert status.endpoints[1].refused == {"message beyond the access of the endpoint": 1}
        assert status.counters["refused_access"] == 1


async def test_status_command_finds_the_gateway_by_its_state_folder() -> None:
    async with world() as w:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "anafi_mav", "status", "--json"),
            stdout=asyncio.subprocess.PIPE,
        )
        out, _ = await process.communicate()
        assert process.returncode == 0
        assert json.loads(out)["drones"][0]["serial"] == w.drone.identity.serial


def test_status_command_without_a_gateway_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=re.escape(str(tmp_path))):
        command.find(str(tmp_path), None)


def test_lines_above_the_tables_have_the_state_of_each_endpoint() -> None:
    """An endpoint that connects may not be connected, and has no client then."""
    replaced = msgspec.structs.replace(STATUS, problems=("the state folder is full",))
    assert command.head(replaced)[-2:] == ["1 client", "the state folder is full"]


def test_tables_of_the_status_show_what_was_refused() -> None:
    drones, clients, refused, peers = command.tables(STATUS)
    assert [row[2] for row in drones.rows] == ["in air, armed", "not connected"]
    assert [row[9] for row in drones.rows] == ["255 (251, 253)", ""]
    assert {len(row) for row in drones.rows} == {len(drones.head)}
    assert drones.rows[1][-1] == "no answer yet"
    assert clients.rows[0][3] == "2.5 kB/s"
    assert refused.rows[0][3:] == ("NAV_TAKEOFF", "DENIED", NASTY)  # the terminal cleans it
    assert peers.rows == [("tcpin://127.0.0.1:5760", "all places taken", "2")]
