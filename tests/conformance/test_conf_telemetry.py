"""Items 34-41 and 46 of the conformance list: what the vehicle reports, and its empty lists."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import NAN
from support.world import HOME, world

from anafi_mav import geo

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
GYRO, ACCEL, MAG, GPS, PREARM = 1, 2, 4, 32, 0x10000000


async def test_conf_034_home() -> None:
    async with world() as w:
        home = await w.client.wait("HOME_POSITION", since=0, timeout=2.0)
        assert (home.latitude / 1e7, home.longitude / 1e7) == pytest.approx(HOME[:2], abs=3e-5)
        assert home.altitude / 1000 == pytest.approx(HOME[2], abs=1.5)
        for request in ((410,), (512, 242)):
            mark = w.client.mark()
            assert (await w.client.command(*request)).result == ACCEPTED
            await w.client.wait("HOME_POSITION", since=mark)
        mark = w.client.mark()
        await w.client.wait("HOME_POSITION", since=mark, timeout=2.5)  # 0.5 Hz, unasked
        await w.take_off()
        reported = w.drone.log.find("event", "ardrone3.GPSSettingsState.HomeChanged")[-1].args
        home = await w.client.wait("HOME_POSITION", timeout=2.5)
        assert home.latitude / 1e7 == pytest.approx(reported["latitude"], abs=1e-7)
        assert home.longitude / 1e7 == pytest.approx(reported["longitude"], abs=1e-7)


async def test_conf_035_altitudes_agree() -> None:
    async with world() as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        altitude = await w.client.wait("ALTITUDE", since=mark)
        position = await w.client.wait("GLOBAL_POSITION_INT", since=mark)
        hud = await w.client.wait("VFR_HUD", since=mark)
        assert altitude.altitude_relative == pytest.approx(w.drone.pose.up, abs=0.5)
        assert position.relative_alt / 1000 == pytest.approx(altitude.altitude_relative, abs=0.5)
        assert position.alt / 1000 == pytest.approx(altitude.altitude_amsl, abs=0.5)
        assert hud.alt == pytest.approx(altitude.altitude_amsl, abs=0.5)
        assert altitude.altitude_amsl == pytest.approx(HOME[2] + 10.0, abs=2.0)


async def test_conf_036_gps() -> None:
    async with world() as w:
        raw = await w.client.wait("GPS_RAW_INT")
        assert raw.fix_type == 3
        assert raw.satellites_visible == w.drone.firmware.satellites
        assert (raw.eph, raw.epv, raw.cog) == (65535, 65535, 65535)
        assert (raw.lat / 1e7, raw.lon / 1e7) == pytest.approx(HOME[:2], abs=3e-5)
        w.drone.faults.gps = False
        raw = await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        assert (raw.lat, raw.lon) == (0, 0)
        mark = w.client.mark()
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        assert w.client.since(mark, "GLOBAL_POSITION_INT") == []


async def test_conf_037_battery() -> None:
    async with world() as w:
        w.drone.faults.battery = 63
        truth = w.drone.firmware.battery
        status = await w.client.wait("BATTERY_STATUS", lambda m: m.voltages[0] == truth.millivolts)
        assert status.battery_remaining == 63
        assert status.voltages[1:] == [65535] * 9
        assert (status.current_battery, status.current_consumed, status.energy_consumed) == (-1, -1, -1)


async def test_conf_038_health_bits() -> None:
    async with world() as w:
        status = await w.client.wait("SYS_STATUS")
        wanted = GYRO | ACCEL | MAG | GPS
        assert status.onboard_control_sensors_present & wanted == wanted
        assert status.onboard_control_sensors_enabled & wanted == wanted
        assert status.onboard_control_sensors_health & wanted == wanted
        w.drone.faults.gps = False
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & GPS)


async def test_conf_039_prearm() -> None:
    async with world() as w:
        status = await w.client.wait("SYS_STATUS")
        assert status.onboard_control_sensors_present & PREARM
        assert status.onboard_control_sensors_enabled & PREARM
        assert status.onboard_control_sensors_health & PREARM
        w.drone.faults.magneto_required = True
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & (PREARM | MAG))
        mark = w.client.mark()
        assert (await w.client.command(400, 1)).result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("PreArm: "), since=mark)


async def test_conf_040_attitude_signs() -> None:
    """Flying north with the nose north is nose down; turning to east is yaw +90 degrees."""
    async with world(speed=1.0) as w:
        await w.take_off(5.0)
        east = geo.destination(*HOME[:2], 0.0, 40.0)
        ack = await w.client.command(192, -1, 1, 0, math.pi / 2, frame=6, x=east[0], y=east[1], z=5.0)
        assert ack.result == ACCEPTED
        attitude = await w.client.wait(
            "ATTITUDE", lambda m: m.pitch < -0.03 and abs(m.yaw - math.pi / 2) < 0.2, timeout=15
        )
        assert math.isnan(attitude.pitchspeed)
        quaternion = await w.client.wait("ATTITUDE_QUATERNION", lambda m: m.q4 > 0.6, timeout=15)
        assert quaternion.q1 == pytest.approx(quaternion.q4, abs=0.1)  # yaw 90: (cos 45, ., ., sin 45)
        truth = w.drone.pose
        assert truth.pitch < 0.0 or truth.east > 30.0


async def test_conf_041_velocity_signs() -> None:
    async with world() as w:
        await w.take_off(5.0)
        for north, east, up in ((25.0, 0.0, 5.0), (25.0, -25.0, 5.0), (25.0, -25.0, 25.0)):
            place = geo.destination(*HOME[:2], north, east)
            mark = w.client.mark()
            await w.client.command(192, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=up)
            if up > 5.0:
                local = await w.client.wait("LOCAL_POSITION_NED", lambda m: m.vz < -0.8, since=mark, timeout=15)
                globe = await w.client.wait("GLOBAL_POSITION_INT", lambda m: m.vz < -80, since=mark, timeout=15)
            elif east == 0.0:
                local = await w.client.wait("LOCAL_POSITION_NED", lambda m: m.vx > 1.0, since=mark, timeout=15)
                globe = await w.client.wait("GLOBAL_POSITION_INT", lambda m: m.vx > 100, since=mark, timeout=15)
                assert abs(local.vy) < 0.5
                assert abs(globe.vy) < 50
            else:
                local = await w.client.wait("LOCAL_POSITION_NED", lambda m: m.vy < -1.0, since=mark, timeout=15)
                globe = await w.client.wait("GLOBAL_POSITION_INT", lambda m: m.vy < -100, since=mark, timeout=15)
            await w.drone.wait_log(
                lambda entry, z=up: (
                    entry.name.endswith("moveToChanged") and entry.args["status"] == 1 and entry.args["altitude"] == z
                ),
                40.0,
            )
            await w.client.wait("HEARTBEAT")
        local = await w.client.wait("LOCAL_POSITION_NED", timeout=5)
        assert (local.x, local.y, local.z) == pytest.approx((25.0, -25.0, -25.0), abs=1.5)


async def test_message_intervals_are_per_client() -> None:
    async with world(clients=2, telemetry_rate=30.0, speed=1.0) as w:
        first, second = w.clients
        assert (await first.command(511, 30, -1)).result == ACCEPTED
        assert (await first.command(511, 999, 1000)).result == dialect.MAV_RESULT_UNSUPPORTED
        marks = first.mark(), second.mark()
        for _ in range(5):
            await second.wait("ATTITUDE")
        assert first.since(marks[0], "ATTITUDE") == []
        mark = first.mark()
        assert (await first.command(510, 30)).result == ACCEPTED
        assert (await first.wait("MESSAGE_INTERVAL", since=mark)).interval_us == -1
        assert (await first.command(511, 30, 0)).result == ACCEPTED
        await first.wait("ATTITUDE")
