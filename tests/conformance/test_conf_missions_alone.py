"""Conformance item 122: missions when the link or the gateway is gone, and those that need the gateway all the time."""

from __future__ import annotations

import asyncio
import json
import math
import signal
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.missions import (
    ACTIVE,
    COMPLETE,
    NOT_STARTED,
    PAUSED,
    flown,
    mode,
    put,
    reached,
    said,
    settled,
    start,
    state,
    takeoff,
    way,
    whole,
)
from support.params import write
from support.plans import Item
from support.product import Process, program
from support.world import HOME, WEB_PORT, World, loopback, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.messages import common
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

INT32 = 6
FAR = [takeoff(6.0), way(8.0, 0.0, 6.0), way(600.0, 0.0, 6.0), way(600.0, 8.0, 6.0)]
"""Its third item takes longer than a link is lost here."""

TURN = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=90.0, frame=2)
"""East, in place: no flight plan of Parrot's can say that."""

ZOOM = Item(mav_enums.MAV_CMD_SET_CAMERA_ZOOM, 0.0, 0.0, p1=2.0, p2=50.0, frame=2)
"""Half of what the camera can."""


async def lost_and_back(w: World, *, noticed: bool = False) -> None:
    """The link is lost, the vehicle disappears, and both come back; `noticed`: the drone has missed the gateway too."""
    w.drone.faults.mute = True
    await w.client.silence("HEARTBEAT", 2.0)  # the system is gone when its heartbeat is
    if noticed:
        await w.drone.wait_log(lambda e: (e.kind, e.name) == ("session", "lost"), 10.0)
    w.drone.faults.mute = False
    await w.client.heartbeat(lambda beat: True, timeout=20.0)


async def test_conf_122_the_drone_flies_on_while_the_link_is_lost() -> None:
    """Afterwards it is the same system, home and mission, it is active, and nothing was reported that was not flown."""
    async with world(web=True, speed=1.5) as w:
        await put(w, FAR)
        assert (await write(w.client, "ANF_MIS_RTH", 0, INT32)).param_id == "ANF_MIS_RTH"
        await start(w)
        await said(w, "link loss: continue")
        before = whole(await state(w, ACTIVE, seq=2, since=0))
        home = await w.client.wait("HOME_POSITION", since=0)
        await lost_and_back(w)
        after = whole(await state(w, ACTIVE, seq=2))
        assert after.mission_id == before.mission_id != 0
        assert after.get_srcSystem() == before.get_srcSystem() == 1
        again = await w.client.wait("HOME_POSITION")
        assert (again.latitude, again.longitude, again.altitude) == (home.latitude, home.longitude, home.altitude)
        await mode(w, 0x04040000)
        assert reached(w) == [0, 1]
        # And it obeys.
        mark = w.client.mark()
        await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)
        await state(w, PAUSED, seq=2, since=mark)


async def test_conf_122_the_drone_returns_when_the_link_is_lost() -> None:
    """The factory's setting: what it does is reported at the start, and the mission is paused afterwards."""
    async with world(web=True, speed=1.5) as w:
        await put(w, FAR)
        await start(w)
        await said(w, "link loss: return home")
        await state(w, ACTIVE, seq=2, since=0)
        await lost_and_back(w, noticed=True)
        mark = w.client.mark()
        await state(w, PAUSED, seq=2, since=mark)
        assert reached(w) == [0, 1]
        assert len(w.commands("common.Mavlink.Start")) == 1


async def test_mission_whose_lines_were_all_reported_before_the_link_was_lost_completes() -> None:
    """The drone reports its last wait when it begins, and never the end of its plan."""
    async with world(web=True, speed=1.5) as w:
        wait = Item(mav_enums.MAV_CMD_NAV_DELAY, 0.0, 0.0, p1=30.0, frame=2)
        await put(w, [takeoff(6.0), way(8.0, 0.0, 6.0), wait])
        assert (await write(w.client, "ANF_MIS_RTH", 0, INT32)).param_id == "ANF_MIS_RTH"
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"].endswith("delay"), 40.0)
        w.drone.inject(common.MissionItemExecuted(len(w.drone.firmware.flight_plan.items) - 1))
        await w.client.wait("MISSION_ITEM_REACHED", lambda m: m.seq == 2, since=0)
        await lost_and_back(w)
        mark = w.client.mark()
        await state(w, ACTIVE, since=mark)
        w.drone.faults.unreported = frozenset({common.MavlinkFilePlayingStateChanged.NAME})
        await state(w, COMPLETE, since=mark, timeout=60.0)
        assert not w.drone.firmware.flight_plan.playing


@asynccontextmanager
async def gateway(config: Path) -> AsyncIterator[Process]:
    """`anafi-mav run` alone, without a simulator of its own."""
    async with program(sys.executable, "-m", "anafi_mav", "run", "-c", str(config)) as process:
        await process.line(lambda line: line.startswith("ready"))
        yield process


def fleet(folder: Path, drone: str, address: str) -> Path:
    """A configuration file of one drone."""
    config = folder / "fleet.yaml"
    config.write_text(
        f"endpoints: ['tcpin://{address}:5760']\nstate: {folder / 'state'}\n"
        f"drones: [{{name: alpha, sysid: 1, address: {drone}, http_port: {WEB_PORT}}}]\n"
    )
    return config


def kept(folder: Path) -> list[Any]:
    """What is on the disk of the missions that are flown."""
    found = [json.loads(path.read_text())["settings"].get("mission") for path in folder.glob("*.json")]
    return [record for record in found if record is not None]


async def written(folder: Path, item: int) -> None:
    """Until it is on the disk that this item of the mission is flown. It is another process's file."""
    limit = time.monotonic() + 30.0
    while not any(record["origins"][record["line"] + 1] == item for record in kept(folder)):
        assert time.monotonic() < limit, f"item {item} is never written to {folder}"
        await asyncio.sleep(0.05)


async def test_conf_122_killed_gateway_recognises_the_drones_plan(tmp_path: Path) -> None:
    drone, address = loopback(), loopback()
    spec = DroneSpec(address=drone, home=HOME, http_port=WEB_PORT)
    config = fleet(tmp_path, drone, address)
    async with Simulator([spec], speed=6.0, seed=1) as simulator:
        async with gateway(config) as running:
            w = World(simulator, None, address)  # type: ignore[arg-type]
            await w.connect()
            await put(w, FAR)
            await write(w.client, "ANF_MIS_RTH", 0, INT32)
            await start(w)
            before = whole(await state(w, ACTIVE, seq=2, since=0))
            await written(tmp_path / "state", 2)
            running.process.kill()
            await running.process.wait()
            await w.client.close()
        again = Config(
            endpoints=(f"tcpin://{address}:5760",),
            drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT),),
            state=str(tmp_path / "state"),
        )
        async with Gateway(again) as here:
            w = World(simulator, here, address)
            await w.connect()
            await w.client.heartbeat(lambda beat: True, since=0, timeout=30.0)
            after = whole(await state(w, ACTIVE, seq=2))
            assert after.mission_id == before.mission_id != 0
            await mode(w, 0x04040000)
            assert reached(w) == []
            await w.client.command(mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0)
            await state(w, PAUSED, seq=2)
            await w.client.close()
    assert len(w.commands("common.Mavlink.Start")) == 1


@pytest.mark.parametrize("returns", [0, 1])
@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_122_gateway_shutdown_pauses_the_mission(model: str, returns: int) -> None:
    """Also of a drone that would fly it on without a link: it is commanded to pause, hovers, and flies home as it does
    without anybody."""
    drone, address = loopback(), loopback()
    spec = DroneSpec(model=model, address=drone, home=HOME, http_port=WEB_PORT)
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT),),
    )
    async with Simulator([spec], speed=1.5, seed=1) as simulator:
        async with Gateway(config) as running:
            w = World(simulator, running, address)
            await w.connect()
            assert await running.ready(10.0)
            await put(w, FAR)
            await write(w.client, "ANF_MIS_RTH", returns, INT32)
            await start(w)
            await state(w, ACTIVE, seq=2, since=0)
            (sentence,) = running.drones_in_air()
            assert sentence == "alpha is in the air: it will hover and fly home 60 s after it lost the link"
            begun = flown(w)
            await w.client.close()
        log = w.drone.log
        (paused, *_) = w.commands("common.Mavlink.Pause")
        gone = await w.drone.wait_log(lambda e: e.kind == "session" and e.name == "lost", timeout=20.0)
        assert paused.t < gone.t
        simulator.speed = 30.0
        there = w.drone.pose
        assert math.hypot(there.vn, there.ve) < 0.5
        home = await w.drone.wait_log(
            lambda e: e.kind == "state" and e.args["to"] == "flying", timeout=60.0, since=gone.t
        )
        assert math.dist((w.drone.pose.north, w.drone.pose.east), (there.north, there.east)) < 0.5
        assert home.t - gone.t == pytest.approx(60.0 / 30.0, abs=0.2)
        assert flown(w) == begun
        assert [e.args["state"] for e in log if e.name == "plan" and e.t < gone.t] == ["playing", "paused"]


async def test_conf_122_ctrl_c_pauses_the_mission(tmp_path: Path) -> None:
    """The first asks and changes nothing; with the second the program ends, and the drone hovers before it is alone."""
    drone, address = loopback(), loopback()
    spec = DroneSpec(address=drone, home=HOME, http_port=WEB_PORT)
    async with Simulator([spec], speed=6.0, seed=1) as simulator:
        async with gateway(fleet(tmp_path, drone, address)) as running:
            w = World(simulator, None, address)  # type: ignore[arg-type]
            await w.connect()
            await put(w, FAR)
            await write(w.client, "ANF_MIS_RTH", 0, INT32)
            await start(w)
            await state(w, ACTIVE, seq=2, since=0)
            simulator.speed = 1.5
            running.process.send_signal(signal.SIGINT)
            await running.line(lambda line: line.startswith("Ctrl-C once more"))
            assert [line for line in running.lines if "it will hover" in line]
            await state(w, ACTIVE, seq=2)
            assert w.commands("common.Mavlink.Pause") == []
            running.process.send_signal(signal.SIGINT)
            assert await running.end() == 0
            await w.client.close()
        (paused, *_) = w.commands("common.Mavlink.Pause")
        gone = await w.drone.wait_log(lambda e: e.kind == "session" and e.name == "lost", timeout=20.0)
        assert paused.t < gone.t
        assert math.hypot(w.drone.pose.vn, w.drone.pose.ve) < 0.5
        assert [e.args["state"] for e in w.drone.log if e.name == "plan" and e.t < gone.t] == ["playing", "paused"]
        assert [record["origins"][record["line"] + 1] for record in kept(tmp_path / "state")] == [2]


# What the gateway flies itself.


async def test_gateway_flies_items_between_two_files() -> None:
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(10.0, 0.0, 6.0), TURN, ZOOM, way(10.0, 10.0, 6.0)])
        await said(w, "flown by gateway: item 3: COND")
        await start(w)
        await state(w, COMPLETE, since=0)
        assert reached(w) == [0, 1, 2, 3, 4]
        names = ("common.Mavlink.Start", "ardrone3.Piloting.moveBy", "camera.set_zoom_target")
        orders = [e for e in w.drone.log if e.kind == "command" and e.name in names]
        orders = [e for e in orders if e.name != names[1] or e.args["dPsi"]]
        assert [e.name for e in orders] == [names[0], names[1], names[2], names[0]]
        assert orders[0].args["filepath"] != orders[3].args["filepath"]
        assert orders[2].args["target"] == 2.0, "from 1 to 3"
        await settled(w, (10.0, 10.0, 6.0))


@pytest.mark.parametrize("returns", [0, 1])
async def test_items_of_the_gateway_are_not_flown_without_it(returns: int) -> None:
    """The drone may fly its first file to the end while the link is lost; the turn behind it is no one's then."""
    async with world(web=True, speed=1.5) as w:
        await put(w, [takeoff(6.0), way(40.0, 0.0, 6.0), TURN, way(40.0, 10.0, 6.0)])
        await write(w.client, "ANF_MIS_RTH", returns, INT32)
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "item" and e.args["command"] == "waypoint", timeout=20.0)
        await lost_and_back(w)
        await state(w, PAUSED, timeout=40.0)
        assert 2 not in reached(w)
        assert len(w.commands("common.Mavlink.Start")) == 1
        assert [entry for entry in w.commands("ardrone3.Piloting.moveBy") if entry.args["dPsi"]] == []


SLOW_TURN = Item(mav_enums.MAV_CMD_CONDITION_YAW, 0.0, 0.0, p1=180.0, p2=9.0, frame=2)
"""Round to the south: twenty seconds in which something can happen."""

STEPS = [takeoff(6.0), way(8.0, 0.0, 6.0), ZOOM, SLOW_TURN, way(8.0, 8.0, 6.0)]


async def turning(w: World) -> None:
    """STEPS are flown, and the drone is at the slow turn, its second item without a file."""
    await put(w, STEPS)
    await start(w)
    await state(w, ACTIVE, seq=3, since=0)
    await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "move.extended_move_by", timeout=20.0)


def with_a_memory(folder: Path) -> tuple[DroneSpec, Config, str]:
    """A drone, a gateway that keeps what it knows in a folder, and the gateway's address: for several runs of it."""
    drone, address = loopback(), loopback()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT),),
        state=str(folder),
    )
    return DroneSpec(address=drone, home=HOME, http_port=WEB_PORT), config, address


async def test_gateway_restart_between_two_files_continues_there(tmp_path: Path) -> None:
    """Another run of it knows that the first file is flown, and which item was next: neither is flown again."""
    spec, config, address = with_a_memory(tmp_path)
    async with Simulator([spec], speed=1.5, seed=1) as simulator:
        for run in (1, 2):
            async with Gateway(config) as running:
                w = World(simulator, running, address)
                await w.connect()
                assert await running.ready(20.0)
                if run == 1:
                    await turning(w)
                    assert reached(w) == [0, 1, 2]
                else:
                    await said(w, "Mission not flying: ")
                    await state(w, PAUSED, seq=3)
                    await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0, timeout=20.0)
                    simulator.speed = 6.0
                    await state(w, COMPLETE, since=0, timeout=60.0)
                    assert reached(w) == [3, 4]
                    await settled(w, (8.0, 8.0, 6.0))
                await w.client.close()
    assert len(w.commands("common.Mavlink.Start")) == 2
    assert len(w.commands("camera.set_zoom_target")) == 1


async def test_link_loss_between_two_files_keeps_the_mission_progress() -> None:
    """Not behind what was flown, and not behind the item that a client has chosen since."""
    async with world(web=True, speed=1.5) as w:
        await turning(w)
        await lost_and_back(w)
        await state(w, PAUSED, seq=3)
        assert (
            await w.client.command(mav_enums.MAV_CMD_DO_SET_MISSION_CURRENT, 4, 0)
        ).result == dialect.MAV_RESULT_ACCEPTED
        await state(w, PAUSED, seq=4)
        await lost_and_back(w)
        await state(w, PAUSED, seq=4)
        assert reached(w) == [0, 1, 2]


def spoil(folder: Path, key: str) -> None:
    """What is kept of a flight of FAR names an item that it does not have, or its last line as flown."""
    (path,) = folder.glob("*.json")
    content = json.loads(path.read_text())
    record = content["settings"]["mission"]
    lines = len(record["done"])
    record[key] = {"done": [[len(FAR)]] * lines, "jumps": [[len(FAR), 1]], "line": lines - 1}[key]
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("key", "words", "then"),
    [
        ("done", "Mission record in ", NOT_STARTED),
        ("jumps", "Mission record in ", NOT_STARTED),
        ("line", "Mission complete", COMPLETE),
    ],
)
async def test_invalid_mission_record_is_not_used(tmp_path: Path, key: str, words: str, then: int) -> None:
    """What is none of the mission is ignored with a text: people can write files. What was flown is complete."""
    spec, config, address = with_a_memory(tmp_path)
    async with Simulator([spec], speed=1.5, seed=1) as simulator:
        for run in (1, 2):
            async with Gateway(config) as running:
                w = World(simulator, running, address)
                await w.connect()
                assert await running.ready(20.0)
                if run == 1:
                    await put(w, FAR)
                    await start(w)
                    await state(w, ACTIVE, seq=2, since=0)
                else:
                    await said(w, words)
                    await state(w, then, seq=0)
                await w.client.close()
            if run == 1:
                spoil(tmp_path, key)
