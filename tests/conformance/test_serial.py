"""A system id that belongs to one aircraft, by its serial number."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import watched
from support.mav import Client
from support.world import HOME, loopback

from anafi_mav.arsdk.messages import drone_manager
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.config import Config, DroneConfig, HttpConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator

OURS, OTHER = "PI040416AA0A000001", "PI040416AA0A000002"


@asynccontextmanager
async def gateway_of(drone: str) -> AsyncIterator[tuple[Gateway, Client]]:
    """A gateway whose system 7 is the aircraft `OURS` at an address, and a client that was there first."""
    address = loopback()
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=7, address=drone, serial=OURS),),
        video=False,
        http=HttpConfig(port=0),
    )
    gateway, client = Gateway(config), Client()
    await gateway.open()
    await client.connect(5760, address)
    await gateway.start()
    try:
        yield gateway, client
    finally:
        await client.close()
        await gateway.close()


def aircraft(address: str, serial: str, skycontroller: int | None = None) -> Simulator:
    spec = DroneSpec(address=address, home=HOME, serial=serial, http_port=None, skycontroller=skycontroller)
    return Simulator([spec], speed=1.0, seed=1)


def received(drone: SimulatedDrone) -> list[str]:
    """Sessions and commands that reached the aircraft."""
    return [entry.name for entry in drone.log if entry.kind in ("command", "session")]


async def is_refused(gateway: Gateway, client: Client) -> None:
    """One text about the aircraft in a minute and no vehicle, through several attempts; commands fail with it."""
    text = await client.wait("STATUSTEXT", lambda m: m.text.startswith("Not connected"), since=0)
    assert (text.text, text.severity) == (f"Not connected: drone has serial {OTHER}", dialect.MAV_SEVERITY_CRITICAL)
    assert f"the aircraft has serial number {OTHER}, expected {OURS}" in gateway.status().drones[0].problem
    mark = client.mark()
    await watched(25.0)
    assert client.since(mark, "HEARTBEAT") == []
    assert client.since(mark, "STATUSTEXT") == []
    ack = await client.command(dialect.MAV_CMD_NAV_TAKEOFF, z=5.0, target=(7, 1))
    assert ack.result == dialect.MAV_RESULT_FAILED
    said = [m.text for _, m in client.since(mark, "STATUSTEXT")]
    assert said == ["Command failed: drone not connected", text.text]
    # A client that connected later learns it too.
    assert (await client.wait("STATUSTEXT", timeout=50.0)).text == text.text
    assert gateway.status().drones[0].connections == 0


async def test_aircraft_with_another_serial_is_left_alone() -> None:
    address = loopback()
    async with gateway_of(address) as (gateway, client):
        async with aircraft(address, OTHER) as simulator:
            await is_refused(gateway, client)
            # A handshake would end another controller's connection.
            assert received(simulator.drones[0]) == []
        async with aircraft(address, OURS):
            beat = await client.heartbeat(lambda beat: True, timeout=30.0)
            assert beat.get_srcSystem() == 7


@pytest.mark.parametrize("generation", [3, 4])
async def test_other_aircraft_behind_the_skycontroller_gets_no_command(generation: int) -> None:
    address = loopback()
    async with gateway_of(address) as (gateway, client):
        async with aircraft(address, OTHER, generation) as simulator:
            await is_refused(gateway, client)
            assert set(received(simulator.drones[0])) <= {"up", "lost"}
        async with aircraft(address, OURS, generation):
            await client.heartbeat(lambda beat: True, timeout=30.0)


def unnamed(simulator: Simulator) -> Simulator:
    """The same, with a Skycontroller that reports its drone without a serial number."""
    pilot = simulator.drones[0].skycontroller
    assert pilot is not None
    pilot.drone = replace(pilot.drone, serial="")
    return simulator


async def test_aircraft_behind_a_skycontroller_that_names_no_serial_is_known_by_its_own_report() -> None:
    """No aircraft is refused as "unknown": it reports its serial number with its settings."""
    address = loopback()
    async with gateway_of(address) as (_, client):
        async with unnamed(aircraft(address, OTHER, 3)):
            await client.wait("STATUSTEXT", lambda m: m.text == f"Not connected: drone has serial {OTHER}", since=0)
            assert client.since(0, "HEARTBEAT") == []
        async with unnamed(aircraft(address, OURS, 3)):
            await client.heartbeat(lambda beat: True, timeout=30.0)


async def test_connection_ends_when_the_skycontroller_has_another_aircraft() -> None:
    address = loopback()
    async with gateway_of(address) as (_, client), aircraft(address, OURS, 3) as simulator:
        await client.heartbeat(lambda beat: True, timeout=30.0)
        drone = simulator.drones[0]
        drone.inject(drone_manager.ConnectionState(Connection.CONNECTED, OTHER, 0x0914, "ANAFI-A000002"))
        # The Skycontroller reports its own aircraft again to a new connection.
        await drone.wait_log(lambda entry: received(drone).count("up") == 2, 10.0)
