"""A gateway that is started, or that finds its drone again, while the drone flies (S7, D3)."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.missions import put, said, way
from support.params import write
from support.plans import Item
from support.setpoints import POSITION_ONLY, engage, local, streaming
from support.world import HOME, WEB_PORT, World, loopback, world

from anafi_mav import mav_enums
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, SimulatedDrone, Simulator
from anafi_mav.sim.world.faults import CLEAR, Impairment
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.follow import AltitudeMode

ACCEPTED, REJECTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
GLOBAL, RELATIVE = dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
GOTO = dialect.MAV_CMD_DO_REPOSITION
ESTIMATED = "Take-off altitude estimated"
METRE = 1.0 / 111_195.0


@asynccontextmanager
async def flying(
    tmp_path: Path, height: float, *quirks: Quirk, air: Impairment = CLEAR, unreported: Sequence[type[Message]] = ()
) -> AsyncIterator[World]:
    """A world whose first gateway has taken the drone off and has ended; the second one has just found it."""
    drone, address = loopback(), loopback()
    names = tuple(quirk.value for quirk in quirks)
    spec = DroneSpec(address=drone, home=HOME, http_port=WEB_PORT, firmware_quirks=names)
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT),),
        state=str(tmp_path / "state"),
    )
    async with Simulator([spec], speed=3.0, seed=1) as simulator:
        async with Gateway(config) as first:
            w = World(simulator, first, address)
            await w.connect()
            assert await first.ready(10.0)
            await w.client.wait("GLOBAL_POSITION_INT", since=0)
            await w.take_off(height)
            await w.client.close()
        simulator.drones[0].faults.up = simulator.drones[0].faults.down = air
        simulator.drones[0].faults.unreported = frozenset(event.NAME for event in unreported)
        async with Gateway(config) as second:
            w = World(simulator, second, address)
            await w.connect()
            armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
            await w.client.heartbeat(lambda beat: beat.base_mode & armed, since=0, timeout=30.0)
            await w.client.wait(
                "GPS_RAW_INT" if ardrone3.AltitudeChanged in unreported else "GLOBAL_POSITION_INT", since=0
            )
            yield w
            for client in w.clients:
                await client.close()
            await simulator.close()


async def goto(w: World, north: float, height: float, frame: int) -> int:
    ack = await w.client.command(GOTO, -1, 1, 0, math.nan, x=HOME[0] + north * METRE, y=HOME[1], z=height, frame=frame)
    return int(ack.result)


async def at(drone: SimulatedDrone, north: float, height: float) -> None:
    """Wait until the drone itself is there."""
    await drone.wait_log(
        lambda e: math.dist((drone.pose.north, drone.pose.east, drone.pose.up), (north, 0.0, height)) < 0.7, 30.0
    )


async def test_restart_in_flight_keeps_takeoff_point_and_goto(tmp_path: Path) -> None:
    """The kept height is no estimate, so that an AMSL target 8 m above the ground is flown to."""
    async with flying(tmp_path, 6.0) as w:
        home = await w.client.wait("HOME_POSITION", since=0)
        assert (home.latitude, home.longitude, home.altitude) == (round(HOME[0] * 1e7), round(HOME[1] * 1e7), 35_000)
        assert await goto(w, 12.0, HOME[2] + 8.0, GLOBAL) == ACCEPTED
        await at(w.drone, 12.0, 8.0)
        local = await w.client.wait("LOCAL_POSITION_NED", lambda m: abs(m.x - 12.0) < 1.5 and abs(m.z + 8.0) < 0.7)
        assert abs(local.y) < 1.0
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if ESTIMATED in m.text]


async def test_restart_without_flight_id_estimates_the_height_safely(tmp_path: Path) -> None:
    async with flying(tmp_path, 20.0, Quirk.NO_FLIGHT_ID) as w:
        home = await w.client.wait("HOME_POSITION", since=0)
        assert abs(home.altitude - 35_000) < 1_500
        mark = w.client.mark()
        assert await goto(w, 10.0, HOME[2] + 12.0, GLOBAL) == REJECTED
        refusal = "Height refused: estimated AMSL: 12 m < 15 m"
        await w.client.wait("STATUSTEXT", lambda m: m.text == refusal, since=mark)
        assert w.commands("ardrone3.Piloting.moveTo") == []
        late = await w.connect(sysid=254)
        late.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        await late.wait("STATUSTEXT", lambda m: m.text.startswith(ESTIMATED), since=0)
        assert await goto(w, 10.0, HOME[2] + 18.0, GLOBAL) == ACCEPTED
        await at(w.drone, 10.0, 18.0)
        assert await goto(w, 0.0, 5.0, RELATIVE) == ACCEPTED  # above take-off: no bridge is needed
        await at(w.drone, 0.0, 5.0)


async def test_goto_that_keeps_the_height_needs_a_reported_one(tmp_path: Path) -> None:
    async with flying(tmp_path, 10.0, unreported=[ardrone3.AltitudeChanged]) as w:
        mark = w.client.mark()
        assert await goto(w, 10.0, math.nan, RELATIVE) == REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Goto refused: height unknown", since=mark)
        assert await goto(w, 10.0, 12.0, RELATIVE) == ACCEPTED


async def test_restart_without_flight_id_follows_no_target_near_the_estimated_ground(tmp_path: Path) -> None:
    async with flying(tmp_path, 20.0, Quirk.NO_FLIGHT_ID) as w:
        await write(w.client, "ANF_FOLLOW_ALT", AltitudeMode.TARGET, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_FOLLOW_HT", 2.0)
        place = round((HOME[0] + 12.0 * METRE) * 1e7), round(HOME[1] * 1e7)
        unset = [math.nan] * 3
        target = dialect.MAVLink_follow_target_message(
            0, 1, *place, HOME[2] + 5.0, unset, unset, [1.0, *unset], unset, unset, 0
        )
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 8)).result == ACCEPTED
        async with streaming(w.client, target):
            await said(w, "Target ignored: estimated AMSL: 7 m < 15 m")
            assert w.drone.pose.up > 15.0


async def test_restart_without_flight_id_refuses_low_amsl_items(tmp_path: Path) -> None:
    async with flying(tmp_path, 20.0, Quirk.NO_FLIGHT_ID) as w:
        await put(
            w,
            [
                way(6.0, 0.0, 18.0),
                Item(mav_enums.MAV_CMD_NAV_WAYPOINT, HOME[0] + 9 * METRE, HOME[1], z=HOME[2] + 12.0, frame=GLOBAL),
            ],
        )
        ack = await w.client.command(dialect.MAV_CMD_MISSION_START, 0, 0)
        assert ack.result == REJECTED
        await said(w, "Item 2 refused: estimated AMSL: ")
        assert w.commands("common.Mavlink.Start") == []


async def test_restart_in_flight_flies_local_setpoints_from_takeoff_place(tmp_path: Path) -> None:
    async with flying(tmp_path, 6.0, Quirk.NO_FLIGHT_ID) as w:
        assert w.drone.pose.north < 0.5
        async with streaming(w.client, local(POSITION_ONLY, at=(8.0, 0.0, -7.0))):
            await engage(w.client, "px4")
            await at(w.drone, 8.0, 7.0)


@pytest.mark.parametrize("quirks", [frozenset(), frozenset({Quirk.NO_FLIGHT_ID})])
async def test_goto_after_a_link_loss_of_seconds_is_flown(quirks: frozenset[Quirk]) -> None:
    async with world() as w:
        w.drone.faults.quirks = quirks
        await w.take_off(20.0)
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 2.0)
        mark = w.client.mark()
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=20.0)
        home = await w.client.wait("HOME_POSITION", since=mark)
        ground = home.altitude / 1e3  # m, an estimate without a flight id
        assert abs(ground - HOME[2]) < (1.5 if quirks else 0.1)
        assert await goto(w, 10.0, HOME[2] + 18.0, GLOBAL) == ACCEPTED
        await at(w.drone, 10.0, HOME[2] + 18.0 - ground)
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert any(ESTIMATED in text for text in texts) is bool(quirks)


async def test_goto_after_restart_over_a_bad_link_is_flown(tmp_path: Path) -> None:
    """200 ms and a quarter of the datagrams lost, both ways, from before the second gateway has connected."""
    air = Impairment(loss=0.25, delay=0.2)
    async with flying(tmp_path, 6.0, air=air) as w:
        assert (await w.client.wait("HOME_POSITION", since=0)).altitude == 35_000
        assert await goto(w, 10.0, HOME[2] + 8.0, GLOBAL) == ACCEPTED
        await at(w.drone, 10.0, 8.0)


@pytest.mark.parametrize(
    ("quirks", "unreported"),
    [((), (rth.TakeoffLocation,)), ((Quirk.NO_FLIGHT_ID,), (rth.TakeoffLocation,))],
    ids=["kept with the flight id", "home of type take-off"],
)
async def test_restart_in_flight_without_takeoff_location_keeps_local_frame(
    tmp_path: Path, quirks: tuple[Quirk, ...], unreported: tuple[type[Message], ...]
) -> None:
    async with flying(tmp_path, 6.0, *quirks, unreported=unreported) as w:
        assert await goto(w, 12.0, 6.0, RELATIVE) == ACCEPTED
        await w.client.wait("LOCAL_POSITION_NED", lambda m: abs(m.x - 12.0) < 0.7 and abs(m.y) < 0.7, timeout=30.0)


async def test_restart_in_flight_without_takeoff_place_refuses_local_frame(tmp_path: Path) -> None:
    async with flying(tmp_path, 6.0, Quirk.NO_FLIGHT_ID, unreported=(rth.TakeoffLocation, rth.HomeType)) as w:
        async with streaming(w.client, local(POSITION_ONLY, at=(8.0, 0.0, -7.0))):
            await w.client.wait("STATUSTEXT", lambda m: m.text == "Setpoint refused: take-off point unknown", since=0)
        assert w.client.since(0, "LOCAL_POSITION_NED") == []
        assert w.commands("ardrone3.Piloting.moveTo") == []
