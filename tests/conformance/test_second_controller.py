"""Two controllers want one drone: which one backs off, and the texts to the clients, by the drone's sessions."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import GOTO, goto, watched
from support.mav import Client
from support.world import HOME, World, loopback, world

from anafi_mav.arsdk.link import controller
from anafi_mav.arsdk.messages import common
from anafi_mav.config import Config, DroneConfig
from anafi_mav.drone.contention import SHORT
from anafi_mav.errors import LinkLost
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.faults import Impairment

TAKEN = "Drone connected to another controller"


@asynccontextmanager
async def second(w: World, folder: Path) -> AsyncIterator[tuple[Gateway, Client]]:
    """Another gateway with a client, at the same drone: another machine's, so that no lock file keeps it away."""
    address = loopback()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="beta", sysid=2, address=w.drone.address),),
        state=str(folder / "other"),
    )
    client = Client(250)
    async with Gateway(config) as gateway:
        await client.connect(5760, address)
        client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        try:
            yield gateway, client
        finally:
            await client.close()


def ups(w: World, since: float = 0.0) -> list[float]:
    """When sessions of the drone began."""
    return [e.t for e in w.drone.log if (e.kind, e.name) == ("session", "up") and e.t > since]


def now() -> float:
    return asyncio.get_running_loop().time()


async def received(client: Client, text: str, timeout: float = 20.0) -> dialect.MAVLink_message:
    return await client.wait("STATUSTEXT", lambda m: m.text.startswith(text), since=0, timeout=timeout)


async def test_gateway_connected_to_a_flying_drone_yields(tmp_path: Path) -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with second(w, tmp_path) as (_, client):
            text = await received(client, TAKEN)
            assert (text.severity, text.get_srcSystem()) == (dialect.MAV_SEVERITY_CRITICAL, 2)
            await received(client, "Reconnecting in ")
            # The first one has it back, and keeps it.
            await w.client.heartbeat(lambda beat: True, timeout=10.0)
            taken = now()
            assert len(ups(w)) == 3
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > taken + 20.0, 30.0)
            assert len(ups(w)) == 3
            assert await goto(w, 30.0, 8.0) == 0


@pytest.mark.parametrize("skycontroller", [None, 3, 4])
async def test_link_cut_after_a_restart_in_flight_is_no_second_controller(
    skycontroller: int | None, tmp_path: Path
) -> None:
    """The drone answers nothing then. The gateway connects as soon as it does, and the first Hold is accepted."""
    async with world(speed=1.0, skycontroller=skycontroller) as w:
        await w.take_off()
        await w.gateway.close()
        begun = now()
        async with second(w, tmp_path) as (gateway, client):
            await w.drone.wait_log(lambda e: (e.kind, e.name) == ("session", "up"), 10.0, since=begun)
            assert await gateway.ready(10.0)
            await watched(ups(w)[-1] + 3.5 - now())
            w.drone.faults.mute = True
            await client.silence("HEARTBEAT", 10.0)
            w.drone.faults.mute = False
            mark = client.mark()
            await client.heartbeat(lambda beat: True, since=mark, timeout=5.0)
            ack = await client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3, target=(2, 1))
            assert ack.result == dialect.MAV_RESULT_ACCEPTED
            texts = [m.text for _, m in client.since(0, "STATUSTEXT")]
            assert not [text for text in texts if text.startswith((TAKEN, "Reconnecting"))]


async def test_yielded_gateway_reconnects_at_once_on_a_command(tmp_path: Path) -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with second(w, tmp_path) as (_, client):
            await received(client, "Reconnecting in ")
            await w.client.heartbeat(lambda beat: True, timeout=10.0)
            count, asked = len(ups(w)), now()
            # What a ground station sends by itself does not count.
            client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
            client.send(dialect.MAVLink_manual_control_message(2, 500, 0, 500, 0, 0))
            client.send_command(dialect.MAV_CMD_REQUEST_MESSAGE, 148, target=(2, 1))
            client.send_command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3, target=(1, 1))
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > asked + 2.0, 10.0)
            assert len(ups(w)) == count
            client.send_command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3, target=(2, 1))
            await received(client, "Reconnecting: command of system 250")
            await w.drone.wait_log(lambda e: len(ups(w)) == count + 1, 3.0)


async def test_gateway_from_before_takeoff_yields_after_five_losses() -> None:
    """A controller that takes the drone a second after each handshake of ours."""
    async with world(speed=1.0) as w:
        await w.take_off()
        await asyncio.sleep(6.0)  # so that the first loss comes after a long connection
        mine: list[controller.ControllerSession] = []

        async def rival() -> None:
            while True:
                with contextlib.suppress(LinkLost):
                    session = await controller.connect(w.drone.address, on_message=lambda message, now: None)
                    mine.append(session)
                    mark = now()
                    await w.drone.wait_log(lambda e: (e.kind, e.name) == ("session", "up"), 60.0, since=mark)
                await asyncio.sleep(1.0)

        task = asyncio.ensure_future(rival())
        try:
            await received(w.client, "Reconnecting in ", 90.0)
            texts = [m.text for _, m in w.client.since(0, "STATUSTEXT")]
            assert texts.count(TAKEN) == 4  # one short connection may have been bad radio
            # The one before the fight, then a rival and an attempt of ours in turn, and the rival has it.
            assert len(ups(w)) == 1 + 5 * 2 + 1
            away = now()
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > away + 20.0, 40.0)
            assert ups(w, away) == []
            assert GOTO not in [m.command for _, m in w.client.since(0, "COMMAND_ACK")]
        finally:
            task.cancel()
            await asyncio.wait([task])
            for session in mine:
                await session.close()


async def test_bad_radio_twice_is_no_second_controller_with_a_long_connection_between() -> None:
    """It ends when the drone closes its port, which no handshake of another controller does."""
    async with world(speed=1.0) as w:
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        for is_last in (False, True):
            w.drone.faults.mute = True
            await w.client.silence("HEARTBEAT", 5.0)
            w.drone.faults.mute = False
            await w.client.heartbeat(lambda beat: True, timeout=15.0)
            if not is_last:
                await watched(SHORT + 1.0)
                session, mark = w.drone.session, now()
                assert session is not None
                session.end("switched off")
                await w.drone.wait_log(lambda e: (e.kind, e.name) == ("session", "up"), 10.0, since=mark)
                await w.client.heartbeat(lambda beat: True, timeout=10.0)
        assert TAKEN not in [m.text for _, m in w.client.since(0, "STATUSTEXT")]


async def test_drone_that_is_never_heard_after_its_handshake_is_no_second_controller() -> None:
    """Its answers by UDP do not arrive: a gateway that stayed away would miss the moment at which they do."""
    address, local = loopback(), loopback()
    spec = DroneSpec(model="4k", address=address, home=HOME, http_port=None, rtsp_port=None)
    config = Config(
        endpoints=(f"tcpin://{local}:5760",), drones=(DroneConfig(name="alpha", sysid=1, address=address),), video=False
    )
    async with Simulator([spec], speed=1.0, seed=1) as simulator:
        drone, client = simulator.drones[0], Client()
        drone.faults.down = Impairment(loss=1.0)
        async with Gateway(config):
            await client.connect(5760, local)
            for _ in range(3):
                mark = now()
                await drone.wait_log(lambda e: (e.kind, e.name) == ("session", "up"), 15.0, since=mark)
            drone.faults.down = Impairment()
            await client.heartbeat(lambda beat: True, timeout=10.0)
            assert TAKEN not in [m.text for _, m in client.since(0, "STATUSTEXT")]
            await client.close()


@pytest.mark.parametrize(
    ("cause", "taken"),
    [(common.DisconnectionCause.UNKNOWN, True), (common.DisconnectionCause.OFF_BUTTON, False)],
)
async def test_disconnection_cause_distinguishes_switched_off_from_taken_over(
    cause: common.DisconnectionCause, taken: bool
) -> None:
    async with world(speed=1.0) as w:
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        session = w.drone.session
        assert session is not None
        mark = w.client.mark()
        session.send(common.Disconnection(cause))
        await asyncio.sleep(0.3)  # it has arrived, within 5 s of the handshake
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 4.0)
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if m.text == TAKEN]
        assert said == ([TAKEN] if taken else [])
