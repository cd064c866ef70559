"""Items 34-41 and 131-140 of the conformance list: what the vehicle reports, to clients of both families."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.mav import NAN, Client
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import alarms, ardrone3, battery, common, wifi
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim import SimulatedDrone

ACCEPTED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_UNSUPPORTED
ON_GROUND, IN_AIR = dialect.MAV_LANDED_STATE_ON_GROUND, dialect.MAV_LANDED_STATE_IN_AIR
GYRO, ACCEL, MAG, GPS, RECEIVER, PREARM = 1, 2, 4, 32, 0x10000, 0x10000000


async def airborne(w: World, height: float) -> None:
    """Take off by what clients of both families send, and wait until the drone is there."""
    client = w.client
    assert (await client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
    assert (await client.command(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, x=0.0, y=0.0, z=height)).result == ACCEPTED
    await client.wait("ALTITUDE", lambda m: m.altitude_relative > height - 0.3, timeout=20.0)
    await client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == IN_AIR)


async def ask(client: Client, id: int, *, timeout: float = 2.0) -> Any:
    """A message on request."""
    mark = client.mark()
    assert (await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, id)).result == ACCEPTED
    return await client.wait(newer.mavlink_map[id].msgname, since=mark, timeout=timeout)


@both
async def test_conf_034_home(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        if flavour == "ardupilot":  # ArduCopter sends it when it is set; its clients request it, or an interval
            late = await w.connect()
            await late.wait("SYS_STATUS", since=0)
            await late.wait("SYS_STATUS")
            assert late.since(0, "HOME_POSITION") == []
            interval = (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAVLINK_MSG_ID_HOME_POSITION, 1_000_000)
            assert (await w.client.command(*interval)).result == ACCEPTED
        home = await w.client.wait("HOME_POSITION", since=0, timeout=2.0)
        assert (home.latitude / 1e7, home.longitude / 1e7) == pytest.approx(HOME[:2], abs=3e-5)
        assert home.altitude / 1000 == pytest.approx(HOME[2], abs=1.5)
        for request in ((410,), (512, 242)):
            mark = w.client.mark()
            assert (await w.client.command(*request)).result == ACCEPTED
            await w.client.wait("HOME_POSITION", since=mark)
        mark = w.client.mark()
        await w.client.wait("HOME_POSITION", since=mark, timeout=2.5)  # 0.5 Hz, unasked
        await airborne(w, 5.0)
        reported = w.drone.log.find("event", "ardrone3.GPSSettingsState.HomeChanged")[-1].args
        home = await w.client.wait("HOME_POSITION", timeout=2.5)
        assert home.latitude / 1e7 == pytest.approx(reported["latitude"], abs=1e-7)
        assert home.longitude / 1e7 == pytest.approx(reported["longitude"], abs=1e-7)


@both
async def test_conf_035_altitudes_agree(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await airborne(w, 10.0)
        mark = w.client.mark()
        altitude = await w.client.wait("ALTITUDE", since=mark)
        position = await w.client.wait("GLOBAL_POSITION_INT", since=mark)
        hud = await w.client.wait("VFR_HUD", since=mark)
        assert altitude.altitude_relative == pytest.approx(w.drone.pose.up, abs=0.5)
        assert position.relative_alt / 1000 == pytest.approx(altitude.altitude_relative, abs=0.5)
        assert position.alt / 1000 == pytest.approx(altitude.altitude_amsl, abs=0.5)
        assert hud.alt == pytest.approx(altitude.altitude_amsl, abs=0.5)
        assert altitude.altitude_amsl == pytest.approx(HOME[2] + 10.0, abs=2.0)


@both
async def test_conf_036_gps(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        raw = await w.client.wait("GPS_RAW_INT")
        assert raw.fix_type == 3
        assert raw.satellites_visible == w.drone.firmware.satellites
        assert (raw.eph, raw.epv, raw.cog) == (65535, 65535, 65535)
        assert (raw.lat / 1e7, raw.lon / 1e7) == pytest.approx(HOME[:2], abs=3e-5)
        assert (raw.h_acc, raw.v_acc) == (1000, 2000)  # the simulated drone's 1 and 2 m
        w.drone.faults.gps = False
        raw = await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        assert (raw.lat, raw.lon) == (0, 0)
        mark = w.client.mark()
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        assert w.client.since(mark, "GLOBAL_POSITION_INT") == []


@both
async def test_conf_037_battery(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        w.drone.faults.battery = 63
        truth = w.drone.firmware.battery
        status = await w.client.wait("BATTERY_STATUS", lambda m: m.voltages[0] == truth.millivolts)
        assert status.battery_remaining == 63
        assert status.voltages[1:] == [65535] * 9
        assert (status.current_battery, status.current_consumed, status.energy_consumed) == (-1, -1, -1)
        assert status.charge_state == dialect.MAV_BATTERY_CHARGE_STATE_OK


@pytest.mark.parametrize("unreported", [[], [battery.Alert.NAME], [ardrone3.AlertStateChanged.NAME]])
async def test_conf_037_low_charge_is_reported_by_either_alert(unreported: list[str]) -> None:
    """Parrot's files name battery.alert for the 4K and the Ai, AlertStateChanged for 4K and Thermal."""

    def reports(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset(unreported)

    async with world(model="thermal", before=reports) as w:
        levels = (
            (19, dialect.MAV_BATTERY_CHARGE_STATE_LOW, "Battery low (19 %)", dialect.MAV_STATE_STANDBY),
            (9, dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL, "Battery critical (9 %)", dialect.MAV_STATE_CRITICAL),
        )
        for percent, charge, text, health in levels:
            mark = w.client.mark()
            w.drone.faults.battery = percent
            await w.client.wait("STATUSTEXT", lambda m, text=text: m.text == text, since=mark)
            await w.client.wait("BATTERY_STATUS", lambda m, charge=charge: m.charge_state == charge, since=mark)
            await w.client.heartbeat(lambda beat, health=health: beat.system_status == health, since=mark)
        status = await w.client.wait("SYS_STATUS", since=w.client.mark())
        assert not status.onboard_control_sensors_health & dialect.MAV_SYS_STATUS_SENSOR_BATTERY
        texts = [m.text for _, m in w.client.since(0, "STATUSTEXT") if "attery" in m.text]
        assert texts == ["Battery low (19 %)", "Battery critical (9 %)"]


async def test_conf_037_low_charge_outlasts_another_alert() -> None:
    """AlertStateChanged has one alert; NONE alone ends the battery's (GroundSDK AnafiAlarms)."""

    def reports(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({battery.Alert.NAME, alarms.TakeoffChecklist.NAME})

    async with world(model="thermal", before=reports) as w:
        w.drone.faults.battery = 9
        critical = dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL
        await w.client.wait("BATTERY_STATUS", lambda m: m.charge_state == critical)
        for alert in (ardrone3.AlertState.MAGNETO_PERTUBATION, ardrone3.AlertState.USER):
            w.drone.inject(ardrone3.AlertStateChanged(alert))
            mark = w.client.mark()
            for _ in range(2):
                assert (await w.client.wait("BATTERY_STATUS")).charge_state == critical
            await w.client.heartbeat(lambda beat: beat.system_status == dialect.MAV_STATE_CRITICAL, since=mark)
            ack = await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        w.drone.inject(ardrone3.AlertStateChanged(ardrone3.AlertState.NONE))
        await w.client.wait("BATTERY_STATUS", lambda m: m.charge_state == dialect.MAV_BATTERY_CHARGE_STATE_OK)


async def test_conf_037_charge_state_without_an_alert_is_undefined() -> None:
    """Stations then judge the percentage."""

    def reports(drone: SimulatedDrone) -> None:
        drone.faults.unreported = frozenset({battery.Alert.NAME, ardrone3.AlertStateChanged.NAME})
        drone.faults.battery = 5

    async with world(before=reports) as w:
        status = await w.client.wait("BATTERY_STATUS", lambda m: m.battery_remaining == 5)
        assert status.charge_state == dialect.MAV_BATTERY_CHARGE_STATE_UNDEFINED


@both
@pytest.mark.parametrize("alert", [battery.BatteryAlert.TOO_COLD, battery.BatteryAlert.LOST_COMM])
async def test_conf_037_full_battery_with_another_alert_is_not_low(flavour: str, alert: battery.BatteryAlert) -> None:
    """Stations speak of a low charge at LOW and CRITICAL."""
    async with world(flavour=flavour) as w:
        fault = dialect.MAV_BATTERY_FAULT_UNDER_TEMPERATURE if alert == battery.BatteryAlert.TOO_COLD else 0
        for level, charge in (
            (battery.AlertLevel.WARNING, dialect.MAV_BATTERY_CHARGE_STATE_OK),
            (battery.AlertLevel.CRITICAL, dialect.MAV_BATTERY_CHARGE_STATE_UNHEALTHY),
        ):
            mark = w.client.mark()
            w.drone.inject(battery.Alert(alert, level, 0))
            await w.client.wait("STATUSTEXT", lambda m: "attery" in m.text, since=mark)
            status = await w.client.wait("BATTERY_STATUS")
            assert (status.battery_remaining, status.charge_state, status.fault_bitmask) == (100, charge, fault)


async def test_battery_alert_beyond_critical_counts_as_critical() -> None:
    """A level of a newer firmware: the text alone called it critical, and the drone could be armed."""
    async with world() as w:
        mark = w.client.mark()
        w.drone.inject(battery.Alert(battery.BatteryAlert.TOO_HOT, battery.AlertLevel(3), 0))
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Battery too hot: critical", since=mark)
        status = await w.client.wait("BATTERY_STATUS")
        assert status.charge_state == dialect.MAV_BATTERY_CHARGE_STATE_UNHEALTHY
        sys_status = await w.client.wait("SYS_STATUS")
        assert not sys_status.onboard_control_sensors_health & newer.MAV_SYS_STATUS_SENSOR_BATTERY
        ack = await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED


async def test_conf_037_the_cells_of_an_ai() -> None:
    """149-0-6 to 149-0-9: three cells, kelvin, and charge in mAh."""
    async with world(model="ai") as w:
        w.drone.inject(battery.Description("BAT1", "", 6800, 3, 3000, 4400))
        w.drone.inject(battery.Temperature(303))
        w.drone.inject(battery.Capacity(6500, 4100))
        for index, millivolts in enumerate((4101, 4102, 4099)):
            w.drone.inject(battery.CellVoltage(index, millivolts))
        status = await w.client.wait("BATTERY_STATUS", lambda m: m.voltages[1] != 65535)
        assert status.voltages == [4101, 4102, 4099] + [65535] * 7
        assert status.temperature == 2985  # 303 K are 29.85 degC
        assert status.current_consumed == 2400
        info = await ask(w.client, newer.MAVLINK_MSG_ID_BATTERY_INFO)
        assert (info.cells_in_series, info.state_of_health) == (3, 97)
        assert info.design_capacity == pytest.approx(6.8)
        assert info.full_charge_capacity == pytest.approx(6.5)
        assert info.charging_maximum_voltage == pytest.approx(4.4)
        assert info.discharge_minimum_voltage == pytest.approx(3.0)
        assert info.serial_number == "BAT1"


async def test_battery_temperature_of_zero_kelvin_is_unknown() -> None:
    async with world(model="ai") as w:
        w.drone.inject(battery.Temperature(303))
        await w.client.wait("BATTERY_STATUS", lambda m: m.temperature == 2985)
        w.drone.inject(battery.Temperature(0))
        status = await w.client.wait("BATTERY_STATUS", lambda m: m.temperature != 2985)
        assert status.temperature == 0x7FFF


@both
async def test_conf_038_health_bits(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        status = await w.client.wait("SYS_STATUS")
        wanted = GYRO | ACCEL | MAG | GPS
        assert status.onboard_control_sensors_present & wanted == wanted
        assert status.onboard_control_sensors_enabled & wanted == wanted
        assert status.onboard_control_sensors_health & wanted == wanted
        w.drone.faults.gps = False
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & GPS)


@both
async def test_conf_039_prearm(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        status = await w.client.wait("SYS_STATUS")
        assert status.onboard_control_sensors_present & PREARM
        assert status.onboard_control_sensors_enabled & PREARM
        assert status.onboard_control_sensors_health & PREARM
        w.drone.faults.magneto_required = True
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & (PREARM | MAG))
        mark = w.client.mark()
        assert (
            await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        ).result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("PreArm: "), since=mark)


@both
async def test_conf_040_attitude_signs(flavour: str) -> None:
    """Flying north with the nose north is nose down; turning to east is yaw +90 degrees."""
    async with world(speed=1.0, flavour=flavour) as w:
        await airborne(w, 5.0)
        east = geo.destination(*HOME[:2], 0.0, 40.0)
        ack = await w.client.command(
            dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, math.pi / 2, frame=6, x=east[0], y=east[1], z=5.0
        )
        assert ack.result == ACCEPTED
        attitude = await w.client.wait(
            "ATTITUDE", lambda m: m.pitch < -0.03 and abs(m.yaw - math.pi / 2) < 0.2, timeout=15
        )
        assert math.isnan(attitude.pitchspeed)
        quaternion = await w.client.wait("ATTITUDE_QUATERNION", lambda m: m.q4 > 0.6, timeout=15)
        assert quaternion.q1 == pytest.approx(quaternion.q4, abs=0.1)  # yaw 90: (cos 45, ., ., sin 45)
        truth = w.drone.pose
        assert truth.pitch < 0.0 or truth.east > 30.0


@both
async def test_conf_041_velocity_signs(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await airborne(w, 5.0)
        for north, east, up in ((25.0, 0.0, 5.0), (25.0, -25.0, 5.0), (25.0, -25.0, 25.0)):
            place = geo.destination(*HOME[:2], north, east)
            mark = w.client.mark()
            await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=up)
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


@both
async def test_conf_131_no_logs(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
        entry = await w.client.wait("LOG_ENTRY", since=mark, timeout=0.5)
        assert (entry.id, entry.num_logs, entry.last_log_num, entry.size) == (0, 0, 0, 0)
        w.client.send(dialect.MAVLink_log_request_data_message(1, 1, 7, 90, 90))
        data = await w.client.wait("LOG_DATA", since=mark, timeout=0.5)
        assert (data.id, data.ofs, data.count) == (7, 90, 0)
        for message in (dialect.MAVLink_log_erase_message(1, 1), dialect.MAVLink_log_request_end_message(1, 1)):
            w.client.send(message)
        await w.client.wait("HEARTBEAT", timeout=2.0)


@both
async def test_conf_132_flight_information(flavour: str) -> None:
    flight_information = dialect.MAVLINK_MSG_ID_FLIGHT_INFORMATION
    async with world(flavour=flavour) as w:
        before = await ask(w.client, flight_information)
        assert (before.arming_time_utc, before.takeoff_time_utc, before.landing_time) == (0, 0, 0)
        assert (
            await w.client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, flight_information, 1e6)
        ).result == ACCEPTED
        mark = w.client.mark()
        clock = await w.client.wait("ATTITUDE")
        await airborne(w, 3.0)
        # The drone says that it takes off and which flight that is, one after the other.
        flying = await w.client.wait(
            "FLIGHT_INFORMATION", lambda m: m.takeoff_time_utc > 0 and m.flight_uuid != 0, since=mark
        )
        assert clock.time_boot_ms * 1000 - 300_000 <= flying.arming_time_utc <= flying.takeoff_time_utc
        assert flying.takeoff_time_utc <= flying.time_boot_ms * 1000
        assert flying.landing_time == 0
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        landed = await w.client.wait("FLIGHT_INFORMATION", lambda m: m.landing_time > 0, since=mark, timeout=20.0)
        assert landed.landing_time * 1000 > flying.takeoff_time_utc
        assert (landed.arming_time_utc, landed.flight_uuid) == (flying.arming_time_utc, flying.flight_uuid)
        # 1 Hz, as asked for
        times = [at for at, _ in w.client.since(mark, "FLIGHT_INFORMATION")]
        assert len(times) < 3 or 0.7 < (times[-1] - times[0]) / (len(times) - 1) < 1.3


@both
async def test_conf_133_ground_distance_is_reported_and_unmeasured_fields_are_unknown(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await airborne(w, 8.0)
        below = await w.client.wait("DISTANCE_SENSOR")
        assert below.orientation == dialect.MAV_SENSOR_ROTATION_PITCH_270
        assert below.current_distance / 100 == pytest.approx(w.drone.pose.up, abs=0.5)
        found = await ask(w.client, dialect.MAVLINK_MSG_ID_RANGEFINDER)
        assert found.distance == pytest.approx(w.drone.pose.up, abs=0.5)
        # An ANAFI grades wind and vibration as fine, worse and bad; numbers of them would be made up.
        for id in (dialect.MAVLINK_MSG_ID_WIND_COV, dialect.MAVLINK_MSG_ID_VIBRATION, dialect.MAVLINK_MSG_ID_WIND):
            assert (await w.client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, id, 1e6)).result == UNSUPPORTED
            assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, id)).result == UNSUPPORTED
        mark = w.client.mark()
        w.drone.inject(ardrone3.WindStateChanged(ardrone3.WarningLevel.CRITICAL))
        text = await w.client.wait("STATUSTEXT", lambda m: "Wind" in m.text, since=mark)
        assert (text.text, text.severity) == ("Wind: critical", dialect.MAV_SEVERITY_CRITICAL)


@pytest.mark.parametrize(
    ("flavour", "scale"), [("px4", {5: 100, 1: 20, 0: 255}), ("ardupilot", {5: 254, 1: 51, 0: 255})]
)
async def test_conf_134_rssi(flavour: str, scale: dict[int, int]) -> None:
    """Behind a Skycontroller; without one there are no sticks whose radio could be good."""
    async with world(flavour=flavour) as w:
        assert (await w.client.wait("RC_CHANNELS")).rssi == 255
    async with world(flavour=flavour, skycontroller=3) as w:
        for quality, rssi in scale.items():
            w.drone.inject(common.LinkSignalQuality(quality | 0x40))  # with a bit that is none of the quality
            channels = await w.client.wait("RC_CHANNELS", lambda m, r=rssi: m.rssi == r)
            assert (channels.chancount, channels.chan1_raw, channels.chan18_raw) == (0, 65535, 65535)
        w.drone.inject(common.LinkSignalQuality(4))
        status = await w.client.wait("SYS_STATUS", lambda m: m.onboard_control_sensors_health & RECEIVER)
        assert status.onboard_control_sensors_enabled & RECEIVER
        w.drone.inject(common.LinkSignalQuality(1))
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & RECEIVER)


@pytest.mark.parametrize(
    ("flavour", "values"),
    [
        # QGroundControl reads a signed byte: 256 - 40, 256 - 93; ArduPilot's clients 1.9 (dBm + 127).
        ("px4", {-40: 216, -93: 163, -1: 254}),
        ("ardupilot", {-40: 165, -93: 65, -1: 239}),
    ],
)
async def test_conf_135_radio_status(flavour: str, values: dict[int, int]) -> None:
    async with world(flavour=flavour) as w:
        for dbm, rssi in values.items():
            mark = w.client.mark()
            w.drone.inject(wifi.RssiChanged(dbm))
            radio = await w.client.wait("RADIO_STATUS", lambda m, r=rssi: m.rssi == r, since=mark)
            # 255, MAVLink's unknown, is -1 dBm in QGroundControl; 0 is what it shows before a radio has reported.
            assert (radio.remrssi, radio.noise, radio.remnoise) == ((0,) * 3 if flavour == "px4" else (255,) * 3)


@both
async def test_conf_140_estimator(flavour: str) -> None:
    """What dronekit arms on: absolute position while there is GPS, and never the mode of a constant position."""
    predicted, absolute, relative, constant = 512, 16, 8, 128
    async with world(flavour=flavour) as w:
        report = await w.client.wait("EKF_STATUS_REPORT")
        assert report.flags & (predicted | absolute | relative | constant) == predicted | absolute | relative
        assert report.flags & 7 == 7  # attitude and both velocities
        assert math.isnan(report.velocity_variance)
        accuracy = await ask(w.client, dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS)
        assert (accuracy.pos_horiz_accuracy, accuracy.pos_vert_accuracy) == (1.0, 2.0)
        w.drone.faults.gps = False
        report = await w.client.wait("EKF_STATUS_REPORT", lambda m: not m.flags & absolute)
        assert report.flags & (predicted | constant) == 0  # it hovers by its vertical camera
        w.drone.inject(ardrone3.HoveringWarning(1, 0))
        report = await w.client.wait("EKF_STATUS_REPORT", lambda m: m.flags & constant)
        assert not report.flags & (relative | 2)


@both
async def test_conf_155_nodes(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await w.client.heartbeat(lambda beat: True)
        await w.client.heartbeat(lambda beat: True)
        await w.client.heartbeat(lambda beat: True)
        node = await ask(w.client, newer.MAVLINK_MSG_ID_LINK_NODE_STATUS)
        received = sum(len(m.get_msgbuf()) for _, m in w.client.received)
        assert node.messages_sent == pytest.approx(len(w.client.received), abs=4)
        assert 500 < node.tx_rate < received
        assert (node.tx_buf, node.messages_lost, node.rx_parse_err, node.tx_overflows) == (100, 0, 0, 0)
        assert node.messages_received == 1
        computer = await ask(w.client, newer.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS)
        assert 0 < computer.ram_usage < computer.ram_total
        assert computer.cpu_cores == [255] * 8
        assert computer.temperature_board == 127


async def test_distance_to_the_target_of_a_move() -> None:
    async with world() as w:
        await airborne(w, 5.0)
        assert (
            await w.client.command(
                dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT, 2e5
            )
        ).result == ACCEPTED
        still = await w.client.wait("NAV_CONTROLLER_OUTPUT")
        assert still.wp_dist == 0
        place = geo.destination(*HOME[:2], 0.0, 60.0)
        assert (
            await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=9.0)
        ).result == ACCEPTED
        going = await w.client.wait("NAV_CONTROLLER_OUTPUT", lambda m: m.wp_dist > 0)
        assert going.target_bearing == pytest.approx(90, abs=3)
        assert going.wp_dist == pytest.approx(60.0 - w.drone.pose.east, abs=12)
        assert going.alt_error == pytest.approx(9.0 - w.drone.pose.up, abs=1.5)
        await w.client.wait("NAV_CONTROLLER_OUTPUT", lambda m: m.wp_dist == 0, timeout=30)
