"""The drone's link dies in the air, in three ways; what clients see meanwhile, and what the drone hears afterwards."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, PX4_OFFBOARD, SET_MODE, goto
from support.mav import Client
from support.params import write
from support.process import simulator_process
from support.setpoints import VELOCITY_ONLY, local, streaming
from support.world import ARMED, HOLD, OFFBOARD, TAKEOFF, loopback, world

from anafi_mav import geo, mav_enums
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway

HOME = (48.8789, 2.3677, 35.0)

AT_CONNECTION = {
    "common.Common.CurrentDateTime",
    "common.Common.AllStates",
    "common.Settings.AllSettings",
    "user_storage.start_monitoring",
}
"""What a connection begins with: no order to do anything."""

MOTION = ("roll", "pitch", "yaw", "gaz", "dX", "dY", "dZ", "dPsi")
"""Arguments of PCMD and moveBy that move the drone unless they are 0."""


def moving(name: str, arguments: Mapping[str, Any]) -> bool:
    """Does a command do more than a connection begins with, and than what stops a drone that flies on?"""
    kind = name.rpartition(".")[2]
    if kind in ("PCMD", "moveBy"):
        return any(arguments[axis] for axis in MOTION if axis in arguments)
    return name not in AT_CONNECTION and kind != "CancelMoveTo"


TURNS = 20
"""Of the event loop, in which what is due is done and what was sent is read."""


def gateway(drone: str, address: str) -> Gateway:
    return Gateway(
        Config(
            endpoints=(f"tcpin://{address}:5760",),
            drones=(DroneConfig(name="alpha", sysid=7, address=drone),),
        )
    )


async def fly(client: Client, height: float = 5.0) -> None:
    """Take off, then set out for a place far away."""
    target = (7, 1)
    assert (await client.command(mav_enums.MAV_CMD_COMPONENT_ARM_DISARM, 1, target=target)).result == 0
    mark = client.mark()
    assert (await client.command(mav_enums.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=height, target=target)).result == 0
    await client.heartbeat(lambda beat: beat.custom_mode == TAKEOFF, since=mark)
    await client.heartbeat(lambda beat: beat.custom_mode == HOLD, timeout=20.0)
    place = geo.destination(*HOME[:2], 80.0, 0.0)
    assert (
        await client.command(
            mav_enums.MAV_CMD_DO_REPOSITION, -1, 1, 0, frame=6, x=place[0], y=place[1], z=height, target=target
        )
    ).result == 0
    await client.wait("LOCAL_POSITION_NED", lambda m: m.vx > 1.0, timeout=15.0)


async def silent_after(client: Client, lost: float) -> None:
    """Three seconds after the loss nothing more comes; watched for two heartbeat periods."""
    await asyncio.sleep(lost + 3.0 - time.monotonic())
    mark = -1
    while mark != client.mark():  # what was due while the machine stood still comes now
        mark = client.mark()
        for _ in range(TURNS):
            await asyncio.sleep(0)
    await asyncio.sleep(2.0)
    assert client.received[mark:] == []


async def back_within(client: Client, seconds: float, landed: Callable[[int], bool]) -> None:
    """The system is there again: same id, in Hold, its state read again."""
    mark = client.mark()
    beat = await client.heartbeat(lambda beat: True, timeout=seconds)
    assert (beat.get_srcSystem(), beat.custom_mode) == (7, HOLD)
    state = await client.wait("EXTENDED_SYS_STATE", since=mark)
    assert landed(state.landed_state)


async def test_killed(tmp_path: Path) -> None:
    """Port unreachable; what comes back is another boot of the drone, on the ground."""
    drone, address = loopback(), loopback()
    async with gateway(drone, address):
        async with simulator_process(drone, tmp_path / "first.jsonl", "--speed", "3") as sim:
            client = await Client().connect(5760, address)
            await client.heartbeat(lambda beat: True, timeout=10.0)
            await fly(client)
            await sim.kill()
            lost = time.monotonic()
        await silent_after(client, lost)
        async with simulator_process(drone, tmp_path / "second.jsonl", "--speed", "3") as sim:
            await back_within(client, 5.0, lambda landed: landed == 1)
            await client.heartbeat(lambda beat: not beat.base_mode & ARMED)
            assert {command["name"] for command in sim.commands()} <= AT_CONNECTION
        await client.close()


async def test_stopped(tmp_path: Path) -> None:
    """SIGSTOP: the sockets stay, no one answers. It goes on where it was, and hears no old order."""
    drone, address = loopback(), loopback()
    async with gateway(drone, address), simulator_process(drone, tmp_path / "sim.jsonl", "--speed", "2") as sim:
        client = await Client().connect(5760, address)
        await client.heartbeat(lambda beat: True, timeout=10.0)
        await fly(client)
        heard = len(sim.commands())
        sim.signal(signal.SIGSTOP)
        await silent_after(client, time.monotonic())
        sim.signal(signal.SIGCONT)
        await back_within(client, 5.0, lambda landed: landed == 2)
        await client.heartbeat(lambda beat: True)
        assert [one["name"] for one in sim.commands()[heard:] if moving(one["name"], one["args"])] == []
        await client.close()


@pytest.mark.parametrize("engaged", [False, True])
async def test_all_datagrams_lost(engaged: bool) -> None:
    """Silence as over Wi-Fi. Setpoints that go on coming meanwhile do not fly the drone that comes back."""
    async with world(speed=1.0, sysid=7) as w:
        client = w.client
        await fly(client)
        setpoint = dialect.MAVLink_set_attitude_target_message(0, 7, 1, 7, [1, 0, 0, 0], 0, 0, 0, 0.8)

        async def stream() -> None:
            while True:
                client.send(setpoint)
                await asyncio.sleep(0.05)  # the client's setpoint rate

        sender = asyncio.get_running_loop().create_task(stream())
        try:
            if engaged:
                await client.wait("HEARTBEAT")
                assert (await client.command(mav_enums.MAV_CMD_DO_SET_MODE, 1, 6, 0, target=(7, 1))).result == 0
                await client.heartbeat(lambda beat: beat.custom_mode == OFFBOARD)
                await client.wait("LOCAL_POSITION_NED", lambda m: m.vz < -0.5)
            w.drone.faults.mute = True
            await silent_after(client, time.monotonic())
            heard = len(w.drone.log)
            w.drone.faults.mute = False
            await back_within(client, 5.0, lambda landed: landed == 2)
            await client.heartbeat(lambda beat: True)
            after = [entry for entry in list(w.drone.log)[heard:] if entry.kind == "command"]
            assert [entry.name for entry in after if moving(entry.name, entry.args)] == []
        finally:
            sender.cancel()


async def test_drone_whose_link_was_lost_in_the_air_is_named_before_the_gateway_ends() -> None:
    """Ctrl-C must not end the only program that looks for it without a warning."""
    async with world(speed=1.0) as w:
        assert w.gateway.drones_in_air() == []
        await w.take_off()
        w.drone.faults.mute = True
        await silent_after(w.client, time.monotonic())
        (sentence,) = w.gateway.drones_in_air()
        assert sentence == "alpha was in the air when its link was lost: the gateway looks for it"
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        (sentence,) = w.gateway.drones_in_air()
        assert sentence.startswith("alpha is in the air: it will hover and fly home")


async def test_drone_whose_link_was_lost_on_the_ground_does_not_delay_the_end_of_the_gateway() -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.mute = True
        await silent_after(w.client, time.monotonic())
        assert w.gateway.drones_in_air() == []


async def test_the_ground_station_falls_silent_during_the_loss() -> None:
    """What ANF_GCS_LOSS promises is kept, counted from when the drone is back: no one was heard before."""
    async with world(speed=1.0) as w:
        client, after = w.client, 4.0
        await write(client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(client, "ANF_GCS_LOSS_T", after)
        await w.take_off()
        client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        w.drone.faults.mute = True
        await silent_after(client, time.monotonic())
        assert w.commands("rth.return_to_home") == []
        w.drone.faults.mute = False
        await client.heartbeat(lambda beat: True, timeout=5.0)
        back = time.monotonic()
        done = await w.drone.wait_log(lambda e: e.name == "rth.return_to_home", 2.0 * after)
        assert done.t - back > after - 1.0
        await client.wait("STATUSTEXT", lambda m: "No ground station for 4 s: return" in m.text, since=0)


@pytest.mark.parametrize("what", ["Goto", "Orbit", "Follow", "Offboard", ""])
async def test_flight_that_the_link_loss_ends_is_reported(what: str) -> None:
    """The connection may be back before a station misses it: without a text the drone just stopped."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        async with streaming(w.client, local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))):
            if what == "Goto":
                assert await goto(w, 200.0, 10.0) == ACCEPTED
            elif what == "Orbit":
                assert (await w.client.command(mav_enums.MAV_CMD_DO_ORBIT, 3.0, 2.0)).result == ACCEPTED
                await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["roll"] != 0, 20.0)
            elif what == "Follow":
                assert (await w.client.command(SET_MODE, 1, 4, 8)).result == ACCEPTED
            elif what == "Offboard":
                assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            mark = w.client.mark()
            assert w.drone.session is not None
            w.drone.session.end("closed")
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=15.0)
        ended = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "ended" in m.text]
        assert ended == ([f"{what} ended: link lost"] if what else [])
