"""Items 108-110 and 150 of the conformance list: which message leaves how often, and who decides."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import missions, plans
from support.flavours import both
from support.mav import NAN, Client
from support.world import HOME, world

from anafi_mav.drone.events import AttitudeChanged, SpeedChanged
from anafi_mav.mavlink import dialect as newer
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.services.telemetry import telemetry_flight
from anafi_mav.vehicle.vehicle import Vehicle

ACCEPTED, DENIED, UNSUPPORTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED, dialect.MAV_RESULT_UNSUPPORTED
SET, GET = dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_GET_MESSAGE_INTERVAL

STATES = [
    "SYS_STATUS",
    "BATTERY_STATUS",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "RC_CHANNELS",
    "RADIO_STATUS",
    "SYSTEM_TIME",
    "EKF_STATUS_REPORT",
    "ESTIMATOR_STATUS",
    "NAV_CONTROLLER_OUTPUT",
    "FLIGHT_INFORMATION",
    "GPS_GLOBAL_ORIGIN",
    "BATTERY_INFO",
    "ONBOARD_COMPUTER_STATUS",
    "CURRENT_MODE",
    "AVAILABLE_MODES_MONITOR",
    "ANAFI_FLIGHT_STATUS",
    "ANAFI_HOME",
    "ANAFI_CHECKLIST",
    "ANAFI_CAMERA_INTRINSICS",
]
"""Repeated without news, ten times a second at most."""

VIDEO = ["ANAFI_LINK", "ANAFI_CAMERA_EXPOSURE"]
"""The same, but pictures of the live video update them."""

MOTION = ["ATTITUDE", "ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ALTITUDE", "VFR_HUD"]
MOTION += ["DISTANCE_SENSOR", "RANGEFINDER", "ODOMETRY"]
"""The drone reports what they are made of five times a second."""

SLOW = ["GPS_RAW_INT"]
"""And this once a second."""

IDS = {name: newer_id for newer_id, kind in newer.mavlink_map.items() for name in [kind.msgname]}


async def rates(client: Client, names: list[str], seconds: float) -> dict[str, float]:
    """Hz of each message, of so many seconds."""
    mark = client.mark()
    clock = await client.wait("SYSTEM_TIME")
    await client.wait(
        "SYSTEM_TIME", lambda m: m.time_boot_ms >= clock.time_boot_ms + 1000 * seconds, timeout=2 * seconds + 5
    )
    found = {}
    for name in names:
        times = [at for at, _ in client.since(mark, name)]
        found[name] = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
    return found


async def interval(client: Client, name: str) -> float:
    """s, as MESSAGE_INTERVAL reports it; 0 unsupported, -1e-6 off."""
    mark = client.mark()
    assert (await client.command(GET, IDS[name])).result == ACCEPTED
    observed = await client.wait("MESSAGE_INTERVAL", lambda m: m.message_id == IDS[name], since=mark)
    return float(observed.interval_us) / 1e6


async def set_all(client: Client, names: list[str], microseconds: float) -> None:
    for name in names:
        assert (await client.command(SET, IDS[name], microseconds)).result == ACCEPTED, name


@both
async def test_conf_108_the_lower_of_request_and_source(flavour: str) -> None:
    names = MOTION + SLOW + STATES + VIDEO
    async with world(speed=1.0, flavour=flavour) as w:
        w.drone.place(0.0, 0.0)
        await set_all(w.client, names, 500_000)
        measured = await rates(w.client, names, 6.0)
        assert measured == {
            **dict.fromkeys(MOTION + STATES + VIDEO, pytest.approx(2.0, rel=0.2)),
            **dict.fromkeys(SLOW, pytest.approx(1.0, rel=0.2)),
        }
        for name in names:  # and this is what it says
            assert await interval(w.client, name) == pytest.approx(1 / measured[name], rel=0.2), name
        await set_all(w.client, STATES, 50_000)
        await set_all(w.client, MOTION + SLOW + VIDEO, 100_000)  # a pose at more than 10 Hz is made of pictures
        measured = await rates(w.client, names, 6.0)
        assert measured == {
            **dict.fromkeys(MOTION, pytest.approx(5.0, rel=0.2)),
            **dict.fromkeys(SLOW, pytest.approx(1.0, rel=0.2)),
            **dict.fromkeys(STATES + VIDEO, pytest.approx(10.0, rel=0.2)),
        }
        for name in names:
            assert await interval(w.client, name) == pytest.approx(1 / measured[name], rel=0.2), name


async def test_conf_108_fast_source_is_thinned_out_to_the_newest_values() -> None:
    """What leaves is the newest, with its own time; nothing is reported twice."""
    async with world(speed=1.0, telemetry_rate=30.0) as w:
        names = ["ATTITUDE", "GLOBAL_POSITION_INT"]
        await set_all(w.client, names, 100_000)
        mark = w.client.mark()
        measured = await rates(w.client, names, 4.0)
        assert measured == dict.fromkeys(names, pytest.approx(10.0, rel=0.2))
        stamps = [m.time_boot_ms for _, m in w.client.since(mark, "ATTITUDE")]
        assert len(set(stamps)) == len(stamps)
        await set_all(w.client, names, 10_000)
        await rates(w.client, names, 4.0)
        assert await interval(w.client, "ATTITUDE") == pytest.approx(1 / 30, rel=0.2)


@both
async def test_conf_108_off_default_and_refused_on_each_link_alone(flavour: str) -> None:
    async with world(clients=2, telemetry_rate=30.0, speed=1.0, flavour=flavour) as w:
        first, second = w.clients
        assert (await first.command(SET, 30, -1)).result == ACCEPTED
        marks = first.mark(), second.mark()
        for _ in range(5):
            await second.wait("ATTITUDE")
        assert first.since(marks[0], "ATTITUDE") == []
        assert await interval(first, "ATTITUDE") < 0
        assert await interval(second, "ATTITUDE") == pytest.approx(0.1, rel=0.05)
        assert (await first.command(SET, 30, 0)).result == ACCEPTED
        await first.wait("ATTITUDE")
        assert await interval(first, "ATTITUDE") == pytest.approx(0.1, rel=0.05)
        assert (await first.command(SET, 30, NAN)).result == ACCEPTED  # NaN means default
        for unknown in (999, 30.5, -1, NAN, math.inf, dialect.MAVLINK_MSG_ID_RAW_IMU):
            assert (await first.command(SET, unknown, 1000)).result == UNSUPPORTED
        for impossible in (-2, -0.5, math.inf, -math.inf):
            assert (await first.command(SET, 30, impossible)).result == DENIED
        assert await interval(first, "ATTITUDE") == pytest.approx(0.1, rel=0.05)


@both
async def test_conf_108_state_that_is_off_stays_off_at_a_change(flavour: str) -> None:
    names = ["SYS_STATUS", "EXTENDED_SYS_STATE", "HOME_POSITION"]
    async with world(clients=2, flavour=flavour) as w:
        first, second = w.clients
        for name in names:
            assert (await first.command(SET, IDS[name], -1)).result == ACCEPTED
        marks = first.mark(), second.mark()
        await w.take_off()
        for client in w.clients:
            await client.wait("HEARTBEAT")
        assert {name: first.since(marks[0], name) for name in names} == {name: [] for name in names}
        assert all(second.since(marks[1], name) for name in names)
        assert (await first.command(SET, IDS["SYS_STATUS"], 0)).result == ACCEPTED
        await first.wait("SYS_STATUS")


@both
async def test_conf_108_message_that_is_off_is_not_announced(flavour: str) -> None:
    """What leaves at each change of its content is a stream, too; but MISSION_CURRENT answers MISSION_SET_CURRENT."""
    names = ["CURRENT_MODE", "FENCE_STATUS"]
    async with world(clients=2, flavour=flavour) as w:
        await w.take_off()
        first, second = w.clients
        for name in names:
            assert (await first.command(SET, IDS[name], -1)).result == ACCEPTED
        marks = first.mark(), second.mark()
        around_the_drone = plans.circle(HOME[:2], 30.0, inclusion=False)
        assert (await plans.upload(second, [around_the_drone], plans.FENCE)).type == plans.ACCEPTED
        await second.wait("FENCE_STATUS", lambda m: m.breach_status, since=marks[1])
        assert (await second.command(dialect.MAV_CMD_NAV_LAND)).result == ACCEPTED
        for client, mark in zip(w.clients, marks, strict=True):
            await client.heartbeat(lambda beat: beat.custom_mode == w.modes.land, since=mark)
            assert (await client.command(dialect.MAV_CMD_REQUEST_MESSAGE, IDS["SYS_STATUS"])).result == ACCEPTED
        assert {name: first.since(marks[0], name) for name in names} == {name: [] for name in names}
        assert all(second.since(marks[1], name) for name in names)


@both
async def test_set_current_is_answered_to_a_client_that_has_switched_mission_current_off(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await missions.put(w, [missions.takeoff(6.0), missions.way(12.0, 0.0, 6.0)])
        assert (await w.client.command(SET, IDS["MISSION_CURRENT"], -1)).result == ACCEPTED
        for item in (1, 1, 0):
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_mission_set_current_message(1, 1, item + missions.first(w)))
            await missions.state(w, missions.NOT_STARTED, seq=item, since=mark)


async def test_message_of_a_new_row_leaves_at_default_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """An element's value in a message of its own: builder, events that update it, and default interval in one row."""

    def heading(vehicle: Vehicle, times: Times) -> newer.MAVLink_message | None:
        attitude = vehicle.drone.piloting.state.attitude
        return (
            None if attitude is None else newer.MAVLink_named_value_float_message(times.boot_ms, b"yaw", attitude.yaw)
        )

    row = MessageStream(heading, (AttitudeChanged,), every=0.5)
    monkeypatch.setitem(telemetry_flight.STREAMS, newer.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, row)
    async with world(speed=1.0) as w:
        assert await rates(w.client, ["NAMED_VALUE_FLOAT"], 6.0) == {"NAMED_VALUE_FLOAT": pytest.approx(2.0, rel=0.2)}
        assert await interval(w.client, "NAMED_VALUE_FLOAT") == pytest.approx(0.5)
        await set_all(w.client, ["NAMED_VALUE_FLOAT"], 50_000)
        observed = await rates(w.client, ["NAMED_VALUE_FLOAT"], 4.0)
        assert observed == {"NAMED_VALUE_FLOAT": pytest.approx(5.0, rel=0.2)}  # each attitude, and no more than those
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, IDS["NAMED_VALUE_FLOAT"])).result == ACCEPTED


@both
async def test_conf_109_message_interval(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        assert await interval(w.client, "SYS_STATUS") == pytest.approx(1.0)
        assert await interval(w.client, "RAW_IMU") == 0.0  # an ANAFI has none to tell
        assert (await w.client.command(SET, IDS["SYS_STATUS"], 3e15)).result == ACCEPTED
        assert await interval(w.client, "SYS_STATUS") == pytest.approx((2**31 - 1) / 1e6)
        for impossible in (-1, 65536, 30.5, NAN, math.inf):
            assert (await w.client.command(GET, impossible)).result == DENIED
        mark = w.client.mark()  # and by REQUEST_MESSAGE, as the message's own description has it
        assert (await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, 244, IDS["BATTERY_STATUS"])).result == ACCEPTED
        observed = await w.client.wait("MESSAGE_INTERVAL", since=mark)
        assert (observed.message_id, observed.interval_us) == (IDS["BATTERY_STATUS"], 1_000_000)


def ask_streams(client: Client, group: int, rate: int, *, start: bool = True) -> None:
    client.send(dialect.MAVLink_request_data_stream_message(1, 1, group, rate, int(start)))


async def test_conf_110_data_streams_of_ardupilot() -> None:
    async with world(flavour="ardupilot", speed=1.0) as w:
        ask_streams(w.client, dialect.MAV_DATA_STREAM_EXTENDED_STATUS, 4)
        ask_streams(w.client, dialect.MAV_DATA_STREAM_POSITION, 4, start=False)
        ask_streams(w.client, dialect.MAV_DATA_STREAM_EXTRA1, 0)
        ask_streams(w.client, dialect.MAV_DATA_STREAM_RAW_SENSORS, 4)  # for which there is nothing
        ask_streams(w.client, 77, 4)
        assert await interval(w.client, "SYS_STATUS") == pytest.approx(0.25)
        assert await interval(w.client, "MISSION_CURRENT") in (0.0, pytest.approx(0.25))
        assert await interval(w.client, "GLOBAL_POSITION_INT") < 0
        assert await interval(w.client, "ATTITUDE") < 0
        assert await interval(w.client, "BATTERY_STATUS") == pytest.approx(1.0)
        mark = w.client.mark()
        measured = await rates(w.client, ["SYS_STATUS", "ATTITUDE"], 4.0)
        assert measured == {"SYS_STATUS": pytest.approx(4.0, rel=0.2), "ATTITUDE": 0.0}
        assert w.client.since(mark, "GLOBAL_POSITION_INT") == []
        for _ in range(35):  # QGroundControl says everything so many times
            ask_streams(w.client, dialect.MAV_DATA_STREAM_ALL, 2)
        measured = await rates(w.client, ["SYS_STATUS", "ATTITUDE", "VFR_HUD"], 4.0)
        assert measured == dict.fromkeys(measured, pytest.approx(2.0, rel=0.2))


async def test_conf_110_a_px4_does_not_obey() -> None:
    async with world(speed=1.0) as w:
        before = {name: await interval(w.client, name) for name in ("ATTITUDE", "SYS_STATUS", "GLOBAL_POSITION_INT")}
        for group in range(13):
            ask_streams(w.client, group, 1)
            ask_streams(w.client, group, 0, start=False)
        after = {name: await interval(w.client, name) for name in before}
        assert after == {name: pytest.approx(value, rel=0.2) for name, value in before.items()}
        await w.client.wait("ATTITUDE")


@pytest.mark.parametrize(("flavour", "hold"), [("px4", 0x0304), ("ardupilot", 17)])
async def test_conf_150_high_latency(flavour: str, hold: int) -> None:
    control = dialect.MAV_CMD_CONTROL_HIGH_LATENCY
    async with world(clients=2, flavour=flavour) as w:
        expensive, other = w.clients
        mark = expensive.mark()
        assert (await expensive.command(control, 1)).result == ACCEPTED
        first = await expensive.wait("HIGH_LATENCY2", since=mark, timeout=1.0)
        quiet = expensive.mark()
        began = first.timestamp
        w.drone.inject(SpeedChanged(0.0, 0.0, -4.0))
        second = await expensive.wait("HIGH_LATENCY2", timeout=6.0)
        assert second.timestamp - began == pytest.approx(5000, abs=300)
        assert {m.get_type() for _, m in expensive.received[quiet:]} == {"HIGH_LATENCY2"}
        assert (second.type, second.custom_mode) == (dialect.MAV_TYPE_QUADROTOR, hold)
        assert second.latitude / 1e7 == pytest.approx(48.8789, abs=1e-4)
        assert (second.altitude, second.battery, second.failure_flags) == (35, w.drone.battery.percent, 0)
        assert (second.eph, second.epv, second.groundspeed, second.climb_rate) == (
            10,
            20,
            0,
            40,
        )  # 4 m/s at most since the first one
        # Commands are answered all the same, the other client misses nothing.
        assert (await expensive.command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)).result == ACCEPTED
        await other.heartbeat(lambda beat: True, timeout=1.5)
        assert (await expensive.command(control, 2)).result == DENIED
        assert (await expensive.command(control, 0)).result == ACCEPTED
        for name in ("HEARTBEAT", "ATTITUDE", "SYS_STATUS"):
            await expensive.wait(name, timeout=2.0)
