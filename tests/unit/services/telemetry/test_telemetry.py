"""The I/O-free cores of what a vehicle reports: paces, groups, flights, texts, and single values in other scales."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone
from anafi_mav.drone.controller.state import ControllerState
from anafi_mav.drone.piloting.state import Attitude, PilotingState, Velocity
from anafi_mav.drone.status.battery import BatteryState
from anafi_mav.drone.status.link import LinkState
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Node
from anafi_mav.services.flavours import ARDUPILOT, PX4, STANDARD
from anafi_mav.services.ground_station.shell_service import PROMPT, answer
from anafi_mav.services.statustext import TextNumbers
from anafi_mav.services.stream import Times
from anafi_mav.services.system import System
from anafi_mav.services.telemetry import (
    data_streams,
    telemetry_anafi,
    telemetry_flight,
    telemetry_link,
    telemetry_status,
)
from anafi_mav.services.telemetry.flight_record_service import FlightRecord
from anafi_mav.services.telemetry.update_tracker import UpdateTracker
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.vehicle import Landed

NOW = Times(1_234_567_890, 1_234_567, 1_234)


def bundled(tracker: UpdateTracker, sources: str, at: float) -> tuple[int, ...]:
    """One turn of the loop in which these sources have news."""
    assert [tracker.mark(source, at) for source in sources] == [True] + [False] * (len(sources) - 1)
    ids, when = tracker.take()
    assert when == at
    return ids


def registered() -> UpdateTracker:
    """a makes 1 and 2 new, b makes 2 and 3 new, c makes 3 new."""
    tracker = UpdateTracker({"a": (1, 2), "b": (2, 3), "c": (3,)})
    tracker.reset(0.0)
    return tracker


def test_updates_of_one_loop_iteration_are_one_bundle() -> None:
    tracker = registered()
    assert bundled(tracker, "ab", 1.0) == (1, 2, 3)
    assert bundled(tracker, "b", 2.0) == (2, 3)
    assert bundled(tracker, "aac", 3.0) == (1, 2, 3)
    assert (tracker.at(1), tracker.at(2), tracker.at(3), tracker.at(4)) == (3.0, 3.0, 3.0, None)
    assert bundled(tracker, "c", 4.0) == (3,)
    assert (tracker.at(1), tracker.at(3)) == (3.0, 4.0)
    assert tracker.take() == ((), 4.0)


def test_counted_updates_are_those_of_a_bundle_that_is_taken() -> None:
    taken, counted = registered(), registered()
    for number in range(1, 26):
        counted.bundle(("a", "b")).add(0.2 * number)
        assert bundled(taken, "ab", 0.2 * number) == (1, 2, 3)
    assert not counted.has_updates
    assert counted.bundle(("a", "b")).ids == (1, 2, 3)
    assert [counted.at(id) for id in (1, 2, 4)] == [taken.at(id) for id in (1, 2, 4)] == [5.0, 5.0, None]
    assert counted.interval(1, 5.0) == taken.interval(1, 5.0) == pytest.approx(0.2)
    assert counted.mark("c", 6.0)
    assert counted.has_updates


def test_how_often_a_message_is_new() -> None:
    tracker = registered()
    assert tracker.interval(1, 0.0) is None
    for number in range(1, 51):  # ten seconds: all at 5 Hz in one turn, and b once a second in a turn of its own
        bundled(tracker, "abc", 0.2 * number)
        if number % 5 == 0:
            bundled(tracker, "b", 0.2 * number + 0.01)
        tracker.pass_time(0.2 * number)
    assert tracker.interval(1, 10.0) == pytest.approx(0.2)
    assert tracker.interval(2, 10.0) == pytest.approx(1 / 6)
    for number in range(51, 200):  # from then on at 1 Hz, and after two windows nothing is left of the old pace
        if number % 5 == 0:
            bundled(tracker, "a", 0.2 * number)
        tracker.pass_time(0.2 * number)
    assert tracker.interval(1, 39.8) == pytest.approx(1.0, rel=0.1)
    tracker.reset(40.0)
    assert tracker.interval(1, 41.0) is None
    assert tracker.at(1) is None


def test_bundles_are_bounded() -> None:
    tracker = UpdateTracker({source: (source,) for source in range(600)})
    tracker.reset(0.0)
    for source in range(600):
        tracker.mark(source, 1.0)
        assert tracker.take() == ((source,), 1.0)
    assert len(tracker._bundles) <= 256


def test_groups_of_ardupilot_have_what_we_stream() -> None:
    everything = data_streams.members(dialect.MAV_DATA_STREAM_ALL)
    assert len(set(everything)) == len(everything)
    assert dialect.MAVLINK_MSG_ID_ATTITUDE in data_streams.members(dialect.MAV_DATA_STREAM_EXTRA1)
    assert list(data_streams.members(dialect.MAV_DATA_STREAM_RAW_CONTROLLER)) == []
    assert list(data_streams.members(99)) == []
    # Home is in no group of ArduCopter's either; all else that flows by itself is.
    rows = {**telemetry_flight.STREAMS, **telemetry_status.STREAMS, **telemetry_link.STREAMS}
    assert {id for id, row in rows.items() if row.every is not None and id not in everything} == {
        dialect.MAVLINK_MSG_ID_HOME_POSITION
    }


async def test_default_intervals_are_those_of_the_rows() -> None:
    clock = SystemClock()
    system = System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)
    autopilot = system.components[0]
    rows = {id: row for service in autopilot.services for id, row in service.streams().items()}
    assert all(id in dialect.mavlink_map for id in rows)
    assert {dialect.mavlink_map[id].msgname: row.every for id, row in rows.items() if row.every is not None} == {
        "ATTITUDE": 0.1,
        "ATTITUDE_QUATERNION": 0.1,
        "GLOBAL_POSITION_INT": 0.2,
        "LOCAL_POSITION_NED": 0.2,
        "ALTITUDE": 0.2,
        "VFR_HUD": 0.2,
        "DISTANCE_SENSOR": 0.2,
        "GIMBAL_DEVICE_ATTITUDE_STATUS": 0.1,
        "MOUNT_ORIENTATION": 0.2,
        "GPS_RAW_INT": 0.5,
        "EXTENDED_SYS_STATE": 0.5,
        "ATTITUDE_TARGET": 0.5,
        "POSITION_TARGET_LOCAL_NED": 0.5,
        "POSITION_TARGET_GLOBAL_INT": 0.5,
        "ORBIT_EXECUTION_STATUS": 0.8,
        "SYS_STATUS": 1.0,
        "BATTERY_STATUS": 1.0,
        "MISSION_CURRENT": 1.0,
        "FENCE_STATUS": 1.0,
        "GIMBAL_MANAGER_STATUS": 1.0,
        "RC_CHANNELS": 1.0,
        "RADIO_STATUS": 1.0,
        "CONTROL_STATUS": 1.0,
        "SYSTEM_TIME": 1.0,
        "EKF_STATUS_REPORT": 1.0,
        "CURRENT_EVENT_SEQUENCE": 1.0,
        "HOME_POSITION": 2.0,
        "CURRENT_MODE": 5.0,
        "AVAILABLE_MODES_MONITOR": 10.0,
    }
    # On a full channel gives way what the next one of its kind replaces, and no answer, parameter, item or text.
    assert autopilot.telemetry == {*rows, dialect.MAVLINK_MSG_ID_HEARTBEAT}
    assert autopilot.telemetry.isdisjoint({77, 22, 44, 47, 253, 110})


def test_a_flight_is_armed_takes_off_and_lands() -> None:
    record = FlightRecord()
    record.look(armed=False, landed=Landed.ON_GROUND, now=1)
    record.look(armed=True, landed=Landed.ON_GROUND, now=5)
    record.look(armed=True, landed=Landed.TAKEOFF, now=8)
    record.flight_id("A5")
    record.look(armed=True, landed=Landed.IN_AIR, now=9)
    assert (record.armed_at, record.took_off_at, record.landed_at) == (5, 8, 0)
    number = record.number
    # sha256 of "A5", its first eight bytes, little-endian
    assert number == 0xBD0A0B9F354B64EA
    record.look(armed=True, landed=Landed.LANDING, now=20)
    record.look(armed=True, landed=Landed.ON_GROUND, now=22)
    record.flight_id("")
    record.look(armed=False, landed=Landed.ON_GROUND, now=23)
    assert (record.armed_at, record.took_off_at, record.landed_at, record.number) == (5, 8, 22, number)
    record.look(armed=True, landed=Landed.ON_GROUND, now=30)
    assert (record.armed_at, record.took_off_at, record.landed_at, record.number) == (30, 0, 0, 0)


def test_flight_that_began_before_the_record_has_no_start() -> None:
    record = FlightRecord()
    record.look(armed=True, landed=Landed.IN_AIR, now=1)
    record.look(armed=True, landed=Landed.UNKNOWN, now=2)
    record.look(armed=True, landed=Landed.IN_AIR, now=3)
    assert (record.armed_at, record.took_off_at, record.landed_at, record.number) == (0, 0, 0, 0)
    record.look(armed=False, landed=Landed.ON_GROUND, now=9)
    assert record.landed_at == 9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[cal] done\t", b"[cal] done"),
        ("two\nlines\r\n", b"two lines"),
        ("nul\0 inside", b"nul inside"),
        ("höher als 50 m", "höher als 50 m".encode()),
    ],
)
def test_a_text_is_one_clean_line(text: str, said: bytes) -> None:
    [message] = TextNumbers().messages(Severity.NOTICE, text)
    assert message._text_raw.rstrip(b"\0") == said
    assert message.severity == 5


def test_nothing_is_no_text_and_too_much_is_cut() -> None:
    assert TextNumbers().messages(Severity.INFO, " \t\n") == []
    messages = TextNumbers().messages(Severity.INFO, "ü" * 400)
    data = b"".join(m._text_raw.rstrip(b"\0") for m in messages)
    assert len(data) <= 500
    assert data.decode().endswith("ü...")
    assert [m.chunk_seq for m in messages] == list(range(len(messages)))


def vehicle(**elements: Any) -> Any:
    """A vehicle of which these elements have reported something."""
    return SimpleNamespace(
        drone=SimpleNamespace(**{name: SimpleNamespace(state=state) for name, state in elements.items()})
    )


@pytest.mark.parametrize("quality", [1, 2, 3, 4, 5])
def test_rssi_in_the_scale_of_the_family(quality: int) -> None:
    # fifths of 100, and of 254: 50.8, 101.6, 152.4, 203.2, 254
    observed = vehicle(link=LinkState(quality=quality))
    observed.drone.controller = SimpleNamespace(present=True, state=ControllerState())
    for flavour, full in (
        (PX4, [20, 40, 60, 80, 100]),
        (STANDARD, [20, 40, 60, 80, 100]),
        (ARDUPILOT, [51, 102, 152, 203, 254]),
    ):
        message: Any = telemetry_link.rc_channels(observed, NOW.for_flavour(flavour))
        assert message.rssi == full[quality - 1]
        assert message.time_boot_ms == 1234


def test_rssi_without_a_skycontroller_is_unknown() -> None:
    observed = vehicle(link=LinkState(quality=5))
    observed.drone.controller = SimpleNamespace(present=False)
    message: Any = telemetry_link.rc_channels(observed, NOW)
    assert (message.rssi, message.chancount) == (255, 0)


@pytest.mark.parametrize(
    ("dbm", "px4", "ardupilot"),
    [(-30, 226, 184), (-100, 156, 51), (-127, 129, 0), (-200, 128, 0), (-2, 254, 238), (-1, 254, 239)],
)
def test_radio_signal_in_the_scale_of_the_family(dbm: int, px4: int, ardupilot: int) -> None:
    observed = vehicle(link=LinkState(rssi_dbm=dbm))
    a: Any = telemetry_link.radio_status(observed, NOW)
    b: Any = telemetry_link.radio_status(observed, NOW.for_flavour(ARDUPILOT))
    assert (a.rssi, b.rssi) == (px4, ardupilot)
    assert telemetry_link.radio_status(vehicle(link=LinkState()), NOW) is None
    assert telemetry_link.radio_status(vehicle(link=LinkState(rssi_dbm=0)), NOW) is None  # 0 dBm is no reading


@pytest.mark.parametrize(
    ("state", "voltages", "more"),
    [
        (BatteryState(percent=50), [65535] * 10, [0] * 4),
        (BatteryState(percent=50, voltage_mv=7600), [7600] + [65535] * 9, [0] * 4),
        (
            BatteryState(percent=50, voltage_mv=12300, cell_voltages_mv={2: 4099, 0: 4101, 1: 4100}),
            [4101, 4100, 4099] + [65535] * 7,
            [0] * 4,
        ),
        # One of three cells is missing: their sum would be wrong, so the pack's voltage it is.
        (
            BatteryState(percent=50, voltage_mv=12300, cell_count=3, cell_voltages_mv={0: 4101, 1: 4100}),
            [12300] + [65535] * 9,
            [0] * 4,
        ),
        (BatteryState(percent=50, cell_voltages_mv=dict.fromkeys(range(12), 4000)), [4000] * 10, [4000, 4000, 0, 0]),
    ],
)
def test_cells(state: BatteryState, voltages: list[int], more: list[int]) -> None:
    message: Any = telemetry_status.battery_status(vehicle(battery=state), NOW)
    assert message.voltages == voltages
    assert message.voltages_ext == more


@pytest.mark.parametrize(("height", "distance"), [(1.234, 123), (-0.1, 0), (700.0, 65535)])
def test_distance_to_the_ground(height: float, distance: int) -> None:
    message: Any = telemetry_flight.distance_sensor(vehicle(piloting=PilotingState(height=height)), NOW)
    assert message.current_distance == distance
    assert (message.min_distance, message.max_distance) == (0, 65535)


@pytest.mark.parametrize(
    ("attitude", "velocity", "body"),
    [
        (Attitude(0.0, 0.0, 0.0), Velocity(1.0, 2.0, 3.0), (1.0, 2.0, 3.0)),
        (Attitude(0.0, 0.0, math.pi / 2), Velocity(1.0, 2.0, 3.0), (2.0, -1.0, 3.0)),  # nose east
        (Attitude(0.0, math.pi / 2, 0.0), Velocity(1.0, 2.0, 3.0), (-3.0, 2.0, 1.0)),  # nose up: forward is up
        (Attitude(math.pi / 2, 0.0, 0.0), Velocity(1.0, 2.0, 3.0), (1.0, 3.0, -2.0)),  # right wing down
        # Nose up 30 degrees and climbing along it: all of it is forward.
        (Attitude(0.0, math.pi / 6, 0.0), Velocity(2 * math.sqrt(3), 0.0, -2.0), (4.0, 0.0, 0.0)),
    ],
)
def test_velocity_along_the_drones_axes(
    attitude: Attitude, velocity: Velocity, body: tuple[float, float, float]
) -> None:
    assert telemetry_flight._to_body(velocity, attitude) == pytest.approx(body, abs=1e-12)


def test_an_attitude_alone_is_no_estimate_of_a_place() -> None:
    held: Any = vehicle(
        piloting=PilotingState(attitude=Attitude(0.0, 0.0, 0.0)),
        alerts=SimpleNamespace(too_dark_to_hover=None, too_high_to_hover=None),
    )
    held.place = None
    assert telemetry_status.ekf_flags(held) == dialect.EKF_ATTITUDE
    held.drone.piloting.state = PilotingState()
    assert telemetry_status.ekf_flags(held) == dialect.EKF_UNINITIALIZED
    report: Any = telemetry_status.ekf_status_report(held, NOW)
    assert math.isnan(report.pos_horiz_variance)


def test_a_mask_has_a_bit_for_each_number_that_fits() -> None:
    assert telemetry_anafi._mask([0, 3, 3, 31, 32, 99]) == 0x80000009


def test_the_shell_answers_a_line_and_prompts() -> None:
    assert answer(None, "  ") == PROMPT  # type: ignore[arg-type]  # asks nothing of its host
    assert answer(None, "halt").startswith("no such command: halt")  # type: ignore[arg-type]
    assert "status" in answer(None, " HELP ")  # type: ignore[arg-type]


def test_memory_counts_page_cache_as_available(tmp_path: Path) -> None:
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:  4096000 kB\nMemFree:  102400 kB\nMemAvailable:  3072000 kB\nHugePages_Total: 0\n")
    assert telemetry_link.memory_mib(meminfo) == (4000, 3000)


@pytest.mark.parametrize("text", [None, "", "MemTotal: 4096000 kB\n", "MemTotal: many kB\nMemAvailable: 1 kB\n", "no"])
def test_memory_that_no_kernel_reports_is_unknown(tmp_path: Path, text: str | None) -> None:
    meminfo = tmp_path / "meminfo"
    if text is not None:
        meminfo.write_text(text)
    assert telemetry_link.memory_mib(meminfo) is None
