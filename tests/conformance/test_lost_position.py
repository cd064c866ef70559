"""Position, climb and fix in what clients receive while the drone reports no position any more."""

from __future__ import annotations

import asyncio

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.cameras import PHOTO, enter, request
from support.fault_scenarios import ACCEPTED
from support.mav import NAN, Client
from support.setpoints import streaming
from support.world import ARMED, HOME, World, loopback, world

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.quirks import Quirk

HIGH_LATENCY, HL_FAILURE_GPS = dialect.MAV_CMD_CONTROL_HIGH_LATENCY, dialect.HL_FAILURE_FLAG_GPS
UNKNOWN = 2**31 - 1
LOCATION = ardrone3.GpsLocationChanged.NAME


async def position_unknown(w: World) -> None:
    """The drone's locations stop, without a word about its fix."""
    mark = w.client.mark()
    w.drone.faults.unreported = frozenset({LOCATION})
    await w.client.wait("STATUSTEXT", lambda m: "Position unknown" in m.text, since=mark, timeout=30.0)


async def test_fix_is_gone_while_locations_are_missing() -> None:
    async with world() as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        await position_unknown(w)
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < dialect.GPS_FIX_TYPE_2D_FIX, since=mark, timeout=10.0)
        late = await w.connect(sysid=200)
        await late.wait("GPS_RAW_INT", lambda m: m.fix_type < dialect.GPS_FIX_TYPE_2D_FIX, since=0, timeout=10.0)
        w.drone.faults.unreported = frozenset()
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type == dialect.GPS_FIX_TYPE_3D_FIX, timeout=10.0)


async def test_position_lost_in_flight_is_unknown_after_the_landing() -> None:
    """The last location is of another place; the next one tells where the drone stands."""
    async with world() as w:
        await w.take_off(5.0)
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 3)  # Position
        assert ack.result == ACCEPTED
        await position_unknown(w)
        async with streaming(w.client, dialect.MAVLink_manual_control_message(1, 1000, 0, 500, 0, 0)):
            while w.drone.pose.north < 20.0:
                await w.client.wait("ATTITUDE")
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND, timeout=20.0)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, since=mark, timeout=20.0)
        landed = w.client.mark()
        for _ in range(3):
            await w.client.wait("SYS_STATUS")
        assert not w.client.since(landed, "GLOBAL_POSITION_INT")
        assert {m.fix_type for _, m in w.client.since(mark, "GPS_RAW_INT")} == {dialect.GPS_FIX_TYPE_NO_FIX}
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "Position known" in m.text]
        w.drone.faults.unreported = frozenset()
        place = await w.client.wait("GLOBAL_POSITION_INT")
        assert (place.lat / 1e7 - HOME[0]) * 111_000 > 20.0
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Position known again", since=landed)


async def test_position_is_not_called_known_when_the_fix_is_lost_too() -> None:
    async with world() as w:
        await w.take_off(5.0)
        await position_unknown(w)
        mark = w.client.mark()
        w.drone.faults.gps = False
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Sensor failed: gps", since=mark)
        for _ in range(3):
            await w.client.wait("SYS_STATUS")
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "Position" in m.text]
        w.drone.faults.gps = True
        w.drone.faults.unreported = frozenset()
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Position known again", since=mark)
        await w.client.wait("GLOBAL_POSITION_INT")


async def test_single_location_after_a_long_gap_is_not_current_for_long() -> None:
    async with world() as w:
        await w.take_off(5.0)
        mark = w.client.mark()
        w.drone.faults.quirks = frozenset({Quirk.GPS_LOCATION_STOPS})
        await w.client.wait("STATUSTEXT", lambda m: "Position unknown" in m.text, since=mark, timeout=10.0)
        await asyncio.sleep(20.0)  # without a location
        mark = w.client.mark()
        w.drone.inject(ardrone3.GpsLocationChanged(*HOME, 1, 1, 1))
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Position known again", since=mark)
        await w.client.wait("STATUSTEXT", lambda m: "Position unknown" in m.text, since=mark, timeout=6.0)


async def test_place_of_the_camera_is_unknown_while_locations_are_missing() -> None:
    async with world(video=False) as w:
        await w.take_off(10.0)
        await enter(w.client, PHOTO)
        assert (await request(w.client, "CAMERA_FOV_STATUS")).lat_camera != UNKNOWN
        await position_unknown(w)
        assert (await request(w.client, "CAMERA_FOV_STATUS")).lat_camera == UNKNOWN


async def test_high_latency_message_reports_a_lost_fix() -> None:
    async with world(clients=2) as w:
        await w.take_off(4.0)
        far, near = w.clients
        assert (await far.command(HIGH_LATENCY, 1)).result == ACCEPTED
        await far.wait("HIGH_LATENCY2", timeout=8.0)
        w.drone.faults.gps = False
        await near.wait("GPS_RAW_INT", lambda m: m.fix_type < dialect.GPS_FIX_TYPE_2D_FIX)
        message = await far.wait("HIGH_LATENCY2", lambda m: m.failure_flags & HL_FAILURE_GPS, timeout=30.0)
        assert abs(message.latitude / 1e7 - HOME[0]) < 1e-3
        assert message.eph == 255


async def test_high_latency_message_is_sent_before_the_first_fix() -> None:
    drone, address = loopback(), loopback()
    endpoints = (f"tcpin://{address}:5760",)
    config = Config(endpoints=endpoints, drones=(DroneConfig(name="alpha", sysid=1, address=drone),), http=False)
    spec = DroneSpec(address=drone, home=HOME, http_port=None)
    async with Simulator([spec], seed=1) as simulator:
        simulator.drones[0].faults.unreported = frozenset({LOCATION})
        async with Gateway(config) as gateway:
            far = await Client().connect(5760, address)
            assert await gateway.ready(10.0), gateway.lines()
            await far.heartbeat(lambda beat: True, since=0)
            assert (await far.command(HIGH_LATENCY, 1)).result == ACCEPTED
            message = await far.wait("HIGH_LATENCY2", timeout=8.0)
            assert (message.latitude, message.longitude, message.eph) == (0, 0, 255)
            assert message.failure_flags & HL_FAILURE_GPS
            mark = far.mark()
            simulator.drones[0].faults.unreported = frozenset()
            message = await far.wait("HIGH_LATENCY2", lambda m: m.eph < 255, since=mark, timeout=15.0)
            assert abs(message.latitude / 1e7 - HOME[0]) < 1e-3
            assert not message.failure_flags & HL_FAILURE_GPS
            await far.close()


async def test_high_latency_message_on_request_has_the_climb() -> None:
    async with world() as w:
        await w.take_off(4.0)
        ack = await w.client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 235, 500_000)
        assert ack.result == ACCEPTED
        mark = w.client.mark()
        up = HOME[2] + 40.0
        ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=0, x=NAN, y=NAN, z=up)
        assert ack.result == ACCEPTED
        await w.client.wait("HIGH_LATENCY2", lambda m: m.climb_rate > 5, since=mark, timeout=8.0)


async def test_high_latency_messages_of_two_clients_have_a_largest_climb_each() -> None:
    async with world(clients=3) as w:
        one, other, _ = w.clients
        await w.take_off(5.0)
        assert (await one.command(HIGH_LATENCY, 1)).result == ACCEPTED
        await one.wait("HIGH_LATENCY2", since=0, timeout=8.0)
        assert (await other.command(HIGH_LATENCY, 1)).result == ACCEPTED
        await other.wait("HIGH_LATENCY2", since=0, timeout=8.0)
        marks = one.mark(), other.mark()
        w.drone.inject(ardrone3.SpeedChanged(0.0, 0.0, -4.0))
        for client, mark in zip((one, other), marks, strict=True):
            assert (await client.wait("HIGH_LATENCY2", since=mark, timeout=9.0)).climb_rate == 40
