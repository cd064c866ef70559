"""The piloted point of interest of the simulated drone."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, gimbal, rth
from anafi_mav.arsdk.messages.ardrone3 import PoiMode, PoiStatus
from anafi_mav.arsdk.messages.gimbal import ControlMode, FrameOfReference
from anafi_mav.sim.autopilot.poi import look
from anafi_mav.sim.states import all_states
from anafi_mav.sim.world.motion import Pose

UNKNOWN = (500.0, 500.0, 500.0)


@pytest.fixture
def bench() -> Bench:
    """In the air at 10 m, hovering, facing north; the yaw limit is 100 deg/s."""
    bench = Bench()
    bench.take_off()
    bench.send(ardrone3.MaxRotationSpeed(100.0))
    bench.climb(10.0)
    return bench


def at(north: float, east: float, up: float, mode: PoiMode = PoiMode.LOCKED_GIMBAL) -> ardrone3.StartPilotedPOIV2:
    return ardrone3.StartPilotedPOIV2(*geo.destination(*HOME[:2], north, east), up, mode)


def statuses(bench: Bench) -> list[PoiStatus]:
    return [event.status for event in bench.of(ardrone3.PilotedPOIV2)]


def pitch(bench: Bench) -> float:
    bench.firmware.gimbal.advance(bench.firmware.time)
    return bench.firmware.gimbal.attitude(bench.pose).pitch_absolute


def look_up(pitch: float) -> gimbal.SetTarget:
    none = FrameOfReference.NONE
    return gimbal.SetTarget(0, ControlMode.POSITION, none, 0.0, FrameOfReference.ABSOLUTE, pitch, none, 0.0)


def test_how_a_point_is_seen() -> None:
    # 30 m north and 40 m east of the drone, 50 m below it; the drone flies north at 5 m/s.
    seen = look(Pose(0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0), 30.0, 40.0, 0.0)
    assert seen.bearing == pytest.approx(math.radians(53.13), abs=1e-4)
    assert seen.distance == pytest.approx(50.0)
    assert seen.elevation == pytest.approx(math.radians(-45.0))
    # Of 5 m/s 4 m/s are across the line of sight, and the point falls back to the right: 4/50 rad/s.
    assert seen.bearing_rate == pytest.approx(0.08)
    assert seen.yaw_rate(math.radians(53.13), 1.0) == pytest.approx(0.08, abs=1e-3)
    assert seen.yaw_rate(0.0, 1.0) == 1.0


def test_poi_from_a_hover_runs_immediately(bench: Bench) -> None:
    wanted = at(0.0, 20.0, 10.0 - 20.0)
    answer = bench.send(wanted)
    place = (wanted.latitude, wanted.longitude, wanted.altitude, PoiMode.LOCKED_GIMBAL)
    assert answer == [
        ardrone3.PilotedPOIV2(*place, PoiStatus.PENDING),
        ardrone3.PilotedPOIV2(*place, PoiStatus.RUNNING),
    ]
    assert answer[-1] in all_states(bench.firmware)
    bench.run(4.0)
    assert math.degrees(bench.pose.yaw) == pytest.approx(90.0, abs=1.0)
    assert pitch(bench) == pytest.approx(-45.0, abs=1.0)
    bench.send(look_up(30.0))
    bench.run(1.0)
    assert pitch(bench) == pytest.approx(-45.0, abs=1.0)  # locked
    assert bench.send(ardrone3.StopPilotedPOI()) == [
        ardrone3.PilotedPOIV2(*UNKNOWN, PoiMode.LOCKED_GIMBAL, PoiStatus.AVAILABLE)
    ]
    assert bench.send(ardrone3.StopPilotedPOI()) == []
    bench.send(look_up(30.0))
    bench.run(1.0)
    assert pitch(bench) == pytest.approx(30.0, abs=0.1)


def test_the_nose_follows_while_the_pilot_flies_round(bench: Bench) -> None:
    bench.send(at(20.0, 0.0, 0.0))
    bench.run(1.0)
    bench.sticks(8.0, roll=100, yaw=100)  # sideways to the right; the yaw stick does nothing
    assert bench.pose.ground_speed > 3.0
    bearing, distance = bench.pose.bearing(20.0, 0.0)
    assert abs(bench.pose.yaw - bearing) < math.radians(4.0)
    assert bench.pose.east > 5.0 or bench.pose.north > 5.0
    assert statuses(bench)[-1] is PoiStatus.RUNNING
    assert distance > 10.0


def test_poi_in_flight_waits_for_the_hover(bench: Bench) -> None:
    bench.sticks(2.0, pitch=100)
    bench.send(at(20.0, 0.0, 0.0))
    assert statuses(bench) == [PoiStatus.PENDING]
    bench.send(ardrone3.PCMD(1, 0, 0, 0, 0, 0))
    bench.run_until(lambda: len(statuses(bench)) == 2)
    assert statuses(bench) == [PoiStatus.PENDING, PoiStatus.RUNNING]


def test_poi_waiting_for_centred_sticks_ends_after_ten_seconds(bench: Bench) -> None:
    bench.sticks(1.0, pitch=20)
    bench.send(at(20.0, 0.0, 0.0))
    bench.sticks(9.5, pitch=20)
    assert statuses(bench) == [PoiStatus.PENDING]
    bench.sticks(1.0, pitch=20)
    assert statuses(bench) == [PoiStatus.PENDING, PoiStatus.AVAILABLE]


def test_a_free_gimbal_stays_free(bench: Bench) -> None:
    bench.send(at(0.0, 20.0, 0.0, PoiMode.FREE_GIMBAL))
    bench.send(look_up(15.0))
    bench.run(2.0)
    assert pitch(bench) == pytest.approx(15.0, abs=0.1)


def test_locked_once(bench: Bench) -> None:
    bench.send(at(20.0, 0.0, -10.0, PoiMode.LOCKED_ONCE_GIMBAL))
    bench.run(2.0)
    bench.send(look_up(15.0))
    bench.run(2.0)
    assert pitch(bench) == pytest.approx(15.0, abs=0.1)
    assert bench.firmware.poi.running


def test_locked_once_and_exit(bench: Bench) -> None:
    bench.send(at(0.0, 20.0, 10.0, PoiMode.LOCKED_ONCE_GIMBAL_AND_EXIT))
    bench.run_until(lambda: statuses(bench)[-1] is PoiStatus.AVAILABLE)
    assert math.degrees(bench.pose.yaw) == pytest.approx(90.0, abs=3.0)


def test_legacy_poi_command_has_its_legacy_event(bench: Bench) -> None:
    place = (*geo.destination(*HOME[:2], 20.0, 0.0), 3.0)
    answer = bench.send(ardrone3.StartPilotedPOI(*place))
    assert answer[-1] == ardrone3.PilotedPOI(*place, PoiStatus.RUNNING)


def test_not_on_the_ground_and_not_without_gps() -> None:
    bench = Bench()
    assert statuses(bench) == []  # unavailable from the start
    assert bench.send(at(20.0, 0.0, 0.0)) == []
    bench.take_off()
    bench.run(0.1)
    assert statuses(bench) == [PoiStatus.AVAILABLE]
    bench.send(at(20.0, 0.0, 0.0))
    bench.faults.gps = False
    bench.run(0.1)
    assert statuses(bench)[-1] is PoiStatus.UNAVAILABLE
    assert bench.send(at(20.0, 0.0, 0.0)) == []


@pytest.mark.parametrize(
    "command", [ardrone3.MoveBy(2.0, 0.0, 0.0, 0.0), rth.ReturnToHome(), ardrone3.Landing(), ardrone3.Emergency()]
)
def test_poi_ends_when_another_flight_begins(
    bench: Bench, command: ardrone3.MoveBy | rth.ReturnToHome | ardrone3.Landing | ardrone3.Emergency
) -> None:
    bench.send(at(0.0, 20.0, 0.0))
    bench.send(command)
    assert statuses(bench)[2] is PoiStatus.AVAILABLE


@pytest.mark.parametrize("place", [(91.0, 0.0, 1.0), (0.0, 181.0, 1.0), (48.0, 2.0, math.nan), (math.nan, 2.0, 1.0)])
def test_invalid_poi_place_is_ignored(bench: Bench, place: tuple[float, float, float]) -> None:
    assert bench.send(ardrone3.StartPilotedPOIV2(*place, PoiMode.LOCKED_GIMBAL)) == []
