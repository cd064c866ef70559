"""QGroundControl's connect sequence through `anafi-mav ground` gets the answers of a direct endpoint.

With one gateway, and with three, whose drones fly missions and deliver pictures at the same time.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import missions
from support.fabric import FabricStation, StationOfSystem, free_port, router
from support.ftp import Ftp
from support.mav import Client, kind_of
from support.media import DAY, add_photo
from support.missions import ROUND
from support.params import fetch
from support.plans import FENCE, MISSION, RALLY, content, download, upload
from support.world import World, world

PAGES: list[dict[str, Any]] = json.loads((Path(__file__).parents[1] / "support" / "qgroundcontrol.json").read_text())[
    "pages"
]

REQUESTED = {
    "AUTOPILOT_VERSION": 148,
    "PROTOCOL_VERSION": 300,
    "AVAILABLE_MODES": 435,
    "CURRENT_MODE": 436,
    "HOME_POSITION": 242,
    "COMPONENT_METADATA": 397,
    "COMPONENT_INFORMATION": 395,
    "CAMERA_INFORMATION": 259,
    "VIDEO_STREAM_INFORMATION": 269,
    "GIMBAL_MANAGER_INFORMATION": 280,
    "no message": 99999,
}

FILES = ("/general.json.xz", "/parameter.json.xz", "/events.json.xz")


async def answers(client: Client) -> dict[str, Any]:
    """Connect as QGroundControl does, open its pages, and return what was answered."""
    found: dict[str, Any] = {}
    for name, id in REQUESTED.items():
        mark = client.mark()
        result = (await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, id)).result
        found[name] = (result, None)
        if result == dialect.MAV_RESULT_ACCEPTED:
            message = await client.wait(name, since=mark)
            found[name] = (result, {k: repr(v) for k, v in message.to_dict().items() if "time" not in k})
    listed = await fetch(client)
    found["parameters"] = {name: (m.param_index, m.param_type, bytes(m.get_payload())) for name, m in listed.items()}
    for kind in (MISSION, FENCE, RALLY):
        found[f"plan {kind}"] = [repr(content(item)) for item in await download(client, kind)]
    for path in FILES:
        found[path] = await Ftp(client).download(path)
    for page in PAGES:
        if page["flavour"] != "px4":
            continue
        mark = client.mark()
        for name in (*page["names"], "CAL_MAG7_ROT"):  # the last one does not exist
            client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
        await client.wait("PARAM_ERROR", lambda m: m.param_id == "CAL_MAG7_ROT", since=mark)
        kinds = ("PARAM_VALUE", "PARAM_ERROR")
        sent = [message for _, message in client.received[mark:] if kind_of(message) in kinds]
        found[f"page {page['page']}"] = sorted(bytes(message.get_payload()) for message in sent)
    return found


@contextlib.asynccontextmanager
async def ground_process(fabric: str) -> AsyncIterator[int]:
    """`anafi-mav ground` for the length of a block: the port for stations."""
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "anafi_mav", "ground", "--zenoh", fabric, "--endpoint", f"tcpin://127.0.0.1:{port}",
        stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        while not (line := await asyncio.wait_for(process.stdout.readline(), 60.0)).startswith(b"ready"):
            assert line, "the ground process ended before it was ready"
        yield port
    finally:
        process.terminate()
        assert await process.wait() == 0


async def answered(station: Client) -> None:
    """Wait until a command is accepted: it is rejected until a ping has been answered."""
    while (await station.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result != dialect.MAV_RESULT_ACCEPTED:
        await station.heartbeat(lambda beat: True)


async def test_connect_over_the_fabric_is_answered_as_over_a_direct_endpoint() -> None:
    async with router() as node, world(endpoints=(node.url,), web=True) as w, ground_process(node.url) as port:
        assert (await upload(w.client, ROUND, MISSION)).type == dialect.MAV_MISSION_ACCEPTED
        station = w.take(await FabricStation().join(port, tcp=True))
        await answered(station)
        late = w.gateway.counters()["late_frames"]
        direct, over_fabric = await answers(w.client), await answers(station)
        assert over_fabric.keys() == direct.keys()
        for what, answer in direct.items():
            assert over_fabric[what] == answer, what
        assert len(direct["parameters"]) > 100
        assert len(direct[f"plan {MISSION}"]) == len(ROUND)
        assert w.gateway.counters()["late_frames"] == late


async def flies_and_shows_a_picture(w: World, station: Client) -> None:
    """Fly a mission and download a picture meanwhile."""
    plan = [missions.takeoff(6.0), missions.way(12.0, 0.0, 6.0), missions.RTL]
    assert (await upload(station, plan, MISSION)).type == dialect.MAV_MISSION_ACCEPTED
    photo, mark = add_photo(w.drone), station.mark()
    for command in ((dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1), (dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)):
        assert (await station.command(*command)).result == dialect.MAV_RESULT_ACCEPTED
    assert await Ftp(station, component=100).download(f"/media/{DAY}/{photo.id}") == photo.content()
    await station.wait("MISSION_ITEM_REACHED", lambda m: m.seq == 1, since=mark, timeout=30.0)


async def test_three_gateways_answer_fly_and_show_pictures_over_one_fabric(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with AsyncExitStack() as stack:
        node = await stack.enter_async_context(router())
        port = await stack.enter_async_context(ground_process(node.url))
        worlds, direct, stations = [], [], []
        for system in (1, 2, 3):
            monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / str(system)))  # one gateway uses one state folder
            w = await stack.enter_async_context(world(sysid=system, endpoints=(node.url,), web=True, speed=8.0))
            worlds.append(w)
            beside = w.take(await StationOfSystem(system).join(5760, host=w.address))
            direct.append(await answers(beside))
        for w, system in zip(worlds, (1, 2, 3), strict=True):
            stations.append(w.take(await StationOfSystem(system).join(port, tcp=True)))
        await asyncio.gather(*map(answered, stations))
        for station, wanted in zip(stations, direct, strict=True):
            over_fabric = await answers(station)
            for what, answer in wanted.items():
                assert over_fabric[what] == answer, (station.system, what)
        await asyncio.gather(*map(flies_and_shows_a_picture, worlds, stations))
        for w, system in zip(worlds, (1, 2, 3), strict=True):
            counters = w.gateway.counters()
            assert [counters[name] for name in ("late_inputs", "late_commands", "misdirected_frames")] == [0, 0, 0]
            flown = w.commands("ardrone3.Piloting.TakeOff") + w.commands("common.Mavlink.Start")
            assert flown, system
