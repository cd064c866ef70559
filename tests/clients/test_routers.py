"""Several gateways behind one router: a station flies the drones of both, and each command reaches its drone alone.

The router is an unmodified program of another project. mavlink-router and mavp2p are in no package index: a binary is
named by an environment variable.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.product import Product, product, program
from support.routers import ROUTERS, program_of, words
from support.world import loopback

pytestmark = pytest.mark.third_party


def made(folder: Path) -> Path:
    folder.mkdir()
    return folder


@asynccontextmanager
async def gateway(folder: Path, sysid: int, endpoint: str) -> AsyncIterator[Product]:
    config = f"""
        state: {folder / "state"}
        endpoints: ["tcpin://{endpoint}"]
        drones: [{{name: d{sysid}, sysid: {sysid}, sim: {{address: {loopback()}, speed: 3}}}}]
        video: off
        http: off
    """
    async with product(folder, config) as held:
        yield held


async def seen(client: Client, *systems: int) -> None:
    """Send heartbeats until the vehicles' have arrived: a router has heard of a station when it has sent something."""
    for _ in range(240):
        client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        here = {m.get_srcSystem() for _, m in client.since(0, "HEARTBEAT")}
        if set(systems) <= here:
            return
        await asyncio.sleep(0.5)  # the router starts and connects in its own time
    raise AssertionError(f"systems {here} of {systems}")


async def fly(client: Client, sysid: int) -> None:
    accepted = dialect.MAV_RESULT_ACCEPTED
    target = (sysid, 1)
    ack = await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=target, timeout=20.0)
    assert (ack.get_srcSystem(), ack.result) == (sysid, accepted)
    ack = await client.command(dialect.MAV_CMD_NAV_TAKEOFF, target=target, timeout=30.0)
    assert (ack.get_srcSystem(), ack.result) == (sysid, accepted)


@pytest.mark.parametrize("router", ROUTERS)
async def test_station_flies_drones_of_two_gateways_behind_one_router(router: str, tmp_path: Path) -> None:
    found = program_of(router)
    if found is None:
        pytest.skip(f"no {router} here: {ROUTERS[router]} names no program, and no package index has one")
    here = loopback()
    places = [f"{here}:5760", f"{here}:5761"]
    async with AsyncExitStack() as stack:
        one = await stack.enter_async_context(gateway(made(tmp_path / "one"), 1, places[0]))
        two = await stack.enter_async_context(gateway(made(tmp_path / "two"), 2, places[1]))
        command = words(router, found, places, f"{here}:14551")
        held = await stack.enter_async_context(program(*command, env={"HOME": str(tmp_path)}, cwd=tmp_path))
        client = Client().connect_udp(here, 14551)
        stack.push_async_callback(client.close)
        await seen(client, 1, 2)

        await fly(client, 2)
        assert len(two.entries("command", "Piloting.TakeOff")) == 1, held
        assert one.entries("command", "Piloting.TakeOff") == []
        await fly(client, 1)
        assert len(one.entries("command", "Piloting.TakeOff")) == 1, held
        assert len(two.entries("command", "Piloting.TakeOff")) == 1


def test_router_of_the_image_is_started_as_the_tested_one() -> None:
    dockerfile = (Path(__file__).parents[2] / "docker" / "Dockerfile").read_text()
    (entry,) = [line for line in dockerfile.splitlines() if line.startswith('ENTRYPOINT ["mavproxy.py"')]
    tested = [word for word in words("mavproxy", "mavproxy.py", [], "") if word.startswith("--")]
    assert set(json.loads(entry.partition(" ")[2])[1:]) == set(tested) - {"--out=udpin:"}
