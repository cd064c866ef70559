"""Follow me in the simulator: what it needs, whom it follows and how, and what ends it."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, controller_info, follow_me, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, PoiMode, PoiStatus
from anafi_mav.arsdk.messages.follow_me import Behavior, Input, Mode
from anafi_mav.sim.world.place import WorldOrigin

RAD = math.pi / 180.0


class Walk:
    """A person who carries the controller: m from the drone's home, m/s, on the ground."""

    def __init__(self, bench: Bench, north: float, east: float, vn: float = 0.0, ve: float = 0.0) -> None:
        self.bench = bench
        self.north, self.east, self.vn, self.ve = north, east, vn, ve

    def tell(self, accuracy: float = 3.0) -> None:
        latitude, longitude = WorldOrigin(*HOME).place(self.north, self.east)
        gps = controller_info.Gps(latitude, longitude, HOME[2], accuracy, accuracy, self.vn, self.ve, 0.0, 0.0)
        self.bench.send(gps)

    def walk(self, seconds: float) -> None:
        """Go on, and tell of it five times a second."""
        for _ in range(round(seconds / 0.2)):
            self.tell()
            self.bench.run(0.2)
            self.north += self.vn * 0.2
            self.east += self.ve * 0.2


@pytest.fixture
def bench() -> Bench:
    """Hovering at 10 m, heading north; the target is the person who controls."""
    bench = Bench()
    bench.take_off()
    bench.climb(10.0)
    bench.send(follow_me.SetTargetIsController(1))
    return bench


def missing(bench: Bench, mode: Mode) -> set[Input]:
    """By the report of the states: bits that are 0."""
    report = bench.firmware.follow.states_report()
    (info,) = (observed for observed in report if isinstance(observed, follow_me.ModeInfo) and observed.mode is mode)
    return {input for input in Input if not info.missing_requirements >> input & 1}


def state(bench: Bench) -> tuple[Mode, Behavior]:
    last = bench.of(follow_me.State)[-1]
    return last.mode, last.behavior


def test_missing_input_is_a_cleared_bit() -> None:
    bench = Bench()
    assert missing(bench, Mode.LOOK_AT) == {Input.IMAGE_DETECTION, Input.DRONE_HIGH_ENOUGH}
    bench.send(follow_me.SetTargetIsController(1))
    bench.faults.gps = False
    bench.run(0.1)
    assert missing(bench, Mode.GEOGRAPHIC) == {
        Input.DRONE_GPS_GOOD_ACCURACY,
        Input.TARGET_GPS_GOOD_ACCURACY,
        Input.DRONE_HIGH_ENOUGH,
    }
    bench.faults.gps = True
    bench.take_off()
    Walk(bench, 15.0, 0.0).tell()
    bench.run(0.1)
    assert missing(bench, Mode.LOOK_AT) == set()
    assert missing(bench, Mode.RELATIVE) == {Input.DRONE_HIGH_ENOUGH}  # a metre after take-off
    assert {info.mode for info in bench.of(follow_me.ModeInfo)} == {Mode.LOOK_AT, Mode.GEOGRAPHIC, Mode.RELATIVE}


def test_follow_me_reports_inputs_to_improve(bench: Bench) -> None:
    Walk(bench, 70.0, 0.0, vn=20.0).tell()
    bench.run(0.1)
    info = bench.of(follow_me.ModeInfo)[-1]
    better = {input for input in Input if not info.improvements >> input & 1}
    assert better == {
        Input.TARGET_BAROMETER_OK,
        Input.IMAGE_DETECTION,
        Input.TARGET_GOOD_SPEED,
        Input.DRONE_CLOSE_ENOUGH,
    }
    bench.send(controller_info.Barometer(101325.0, 0.0))
    bench.run(0.1)
    assert bench.of(follow_me.ModeInfo)[-1].improvements >> Input.TARGET_BAROMETER_OK & 1


def test_controller_position_is_valid_while_recent_and_accurate(bench: Bench) -> None:
    walk = Walk(bench, 15.0, 0.0)
    walk.tell()
    bench.run(3.5)
    walk.tell(accuracy=50.0)
    assert [observed.is_valid for observed in bench.of(controller_info.ValidityFromDrone)] == [1, 0]


def test_look_at_turns_the_drone_and_leaves_sticks_free(bench: Bench) -> None:
    walk = Walk(bench, 0.0, 10.0)
    walk.walk(0.4)
    (answer,) = bench.send(follow_me.Start(Mode.LOOK_AT))
    assert isinstance(answer, follow_me.State)
    assert (answer.mode, answer.behavior) == (Mode.LOOK_AT, Behavior.LOOK_AT)
    walk.walk(5.0)
    assert bench.pose.yaw == pytest.approx(90.0 * RAD, abs=3.0 * RAD)
    assert bench.firmware.operator.tilt == pytest.approx(-45.0, abs=3.0)
    assert math.hypot(bench.pose.north, bench.pose.east) < 0.3
    for _ in range(20):
        walk.walk(0.2)
        bench.send(ardrone3.PCMD(1, 0, -50, 0, 0, 0))
    assert bench.pose.east < -1.0  # backwards


@pytest.mark.parametrize("mode", [Mode.GEOGRAPHIC, Mode.RELATIVE])
def test_follow_me_keeps_its_place_beside_a_walker(bench: Bench, mode: Mode) -> None:
    walk = Walk(bench, 10.0, 0.0, vn=2.0)
    walk.walk(0.4)
    bench.send(follow_me.Start(mode))
    assert state(bench) == (mode, Behavior.FOLLOW)
    gap = walk.north - bench.pose.north
    walk.walk(15.0)
    assert walk.north - bench.pose.north == pytest.approx(gap, abs=1.0)
    assert bench.pose.east == pytest.approx(0.0, abs=0.5)
    assert bench.pose.up == pytest.approx(10.0, abs=0.5)
    assert bench.state is FlyingState.FLYING
    # He turns left, to the west.
    walk.vn, walk.ve = 0.0, -2.0
    walk.walk(20.0)
    north, east = bench.pose.north - walk.north, bench.pose.east - walk.east
    behind = (-gap, 0.0) if mode is Mode.GEOGRAPHIC else (0.0, gap)
    assert (north, east) == pytest.approx(behind, abs=1.0)
    assert bench.pose.yaw == pytest.approx(math.atan2(-east, -north), abs=0.2)


def test_follow_me_flies_to_the_requested_vector(bench: Bench) -> None:
    walk = Walk(bench, 10.0, 0.0)
    walk.walk(0.4)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    first = bench.of(follow_me.GeographicConfig)[-1]
    assert (first.distance, first.azimuth) == pytest.approx((math.hypot(10, 10), math.pi), abs=0.3)
    # 20 m away to the east of him, 30 degrees up.
    (observed,) = bench.send(follow_me.ConfigureGeographic(0, 20.0, 30.0 * RAD, 90.0 * RAD))
    assert isinstance(observed, follow_me.GeographicConfig)
    assert (observed.use_default, observed.distance, observed.elevation) == pytest.approx((0, 20.0, 30.0 * RAD))
    walk.walk(20.0)
    pose = bench.pose
    expected = (10.0, 20.0 * math.cos(30.0 * RAD), 10.0)
    assert (pose.north, pose.east, pose.up) == pytest.approx(expected, abs=0.5)


def test_target_seen_only_is_assumed_on_the_ground(bench: Bench) -> None:
    bench.send(follow_me.SetTargetIsController(0))
    for _ in range(50):
        (north, east) = (10.0 - bench.pose.north, 0.0 - bench.pose.east)
        azimuth, elevation = math.atan2(east, north), math.atan2(-bench.pose.up, math.hypot(north, east))
        bench.send(follow_me.TargetImageDetection(azimuth, elevation, 0.0, 200, 0, 0))
        bench.run(0.2)
        if not bench.firmware.follow.engaged:
            bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    assert state(bench) == (Mode.GEOGRAPHIC, Behavior.FOLLOW)
    assert [observed.state for observed in bench.of(follow_me.TargetImageDetectionState)] == [
        follow_me.ImageDetectionStatus.OK
    ]
    assert math.hypot(bench.pose.north, bench.pose.east) < 0.5
    bench.send(follow_me.TargetImageDetection(0.0, 0.5, 0.0, 200, 0, 0))  # above the horizon
    assert bench.of(follow_me.TargetImageDetectionState)[-1].state is follow_me.ImageDetectionStatus.LOST
    (trajectory,) = bench.firmware.follow.telemetry()
    assert isinstance(trajectory, follow_me.TargetTrajectory)
    assert (trajectory.latitude, trajectory.longitude) == pytest.approx(WorldOrigin(*HOME).place(10.0, 0.0), abs=1e-6)


def test_a_start_without_a_target_waits_for_one(bench: Bench) -> None:
    (answer, *_) = bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    assert isinstance(answer, follow_me.State)
    assert (answer.mode, answer.behavior) == (Mode.GEOGRAPHIC, Behavior.IDLE)
    assert bench.firmware.follow.telemetry() == []
    walk = Walk(bench, 10.0, 0.0)
    walk.walk(0.4)
    assert state(bench) == (Mode.GEOGRAPHIC, Behavior.FOLLOW)


def test_a_lost_target_stops_the_drone(bench: Bench) -> None:
    walk = Walk(bench, 10.0, 0.0, vn=3.0)
    walk.walk(0.4)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    walk.walk(6.0)
    bench.run(6.0)  # he goes on and is heard of no more
    walk.north += 18.0
    assert state(bench) == (Mode.GEOGRAPHIC, Behavior.IDLE)
    assert bench.state is FlyingState.HOVERING
    walk.walk(0.4)
    assert state(bench) == (Mode.GEOGRAPHIC, Behavior.FOLLOW)


def test_follow_me_on_ground_or_leash_is_refused() -> None:
    bench = Bench()
    (answer,) = bench.send(follow_me.Start(Mode.LOOK_AT))
    assert answer == follow_me.State(Mode.NONE, Behavior.IDLE, follow_me.Animation.NONE, 0)
    bench.take_off()
    (answer,) = bench.send(follow_me.Start(Mode.LEASH))
    assert answer == follow_me.State(Mode.NONE, Behavior.IDLE, follow_me.Animation.NONE, 0)


@pytest.mark.parametrize(
    "command",
    [
        follow_me.Stop(),
        ardrone3.MoveBy(1.0, 0.0, 0.0, 0.0),
        ardrone3.Landing(),
        rth.ReturnToHome(),
        ardrone3.StartPilotedPOIV2(*WorldOrigin(*HOME).place(50.0, 0.0), 0.0, PoiMode.LOCKED_GIMBAL),
    ],
    ids=lambda command: command.NAME,
)
def test_follow_me_ends_by_each_of_these(bench: Bench, command: Message) -> None:
    walk = Walk(bench, 10.0, 0.0, vn=2.0)
    walk.walk(0.4)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    walk.walk(3.0)
    bench.send(command)
    assert state(bench) == (Mode.NONE, Behavior.IDLE)
    if isinstance(command, ardrone3.Landing):
        walk.walk(20.0)
        assert bench.state is FlyingState.LANDED
    else:
        walk.walk(5.0)
        assert abs(bench.pose.vn) < 0.3 or isinstance(command, rth.ReturnToHome)


def test_follow_me_ends_with_the_link(bench: Bench) -> None:
    walk = Walk(bench, 10.0, 0.0)
    walk.walk(0.4)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    bench.firmware.link_lost()
    assert state(bench) == (Mode.NONE, Behavior.IDLE)


def test_follow_me_replaces_a_move_and_a_poi(bench: Bench) -> None:
    walk = Walk(bench, 10.0, 0.0)
    walk.walk(0.4)
    bench.send(ardrone3.StartPilotedPOIV2(*WorldOrigin(*HOME).place(50.0, 0.0), 0.0, PoiMode.LOCKED_GIMBAL))
    bench.send(follow_me.Start(Mode.LOOK_AT))
    assert bench.of(ardrone3.PilotedPOIV2)[-1].status is PoiStatus.AVAILABLE
    bench.send(ardrone3.MoveBy(50.0, 0.0, 0.0, 0.0))
    walk.walk(1.0)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    assert bench.of(ardrone3.MoveByEnd)[-1].error is ardrone3.MoveByError.INTERRUPTED
    assert state(bench) == (Mode.GEOGRAPHIC, Behavior.FOLLOW)


def test_the_framing_is_kept() -> None:
    bench = Bench()
    assert bench.send(follow_me.TargetFramingPosition(30, 70)) == [follow_me.TargetFramingPositionChanged(30, 70)]
    assert bench.send(follow_me.TargetFramingPosition(-1, 70)) == [follow_me.TargetFramingPositionChanged(30, 70)]


def test_flight_plan_is_not_replaced_by_follow_me(bench: Bench) -> None:
    uid = bench.firmware.plans.put(b"QGC WPL 120\n0\t0\t3\t93\t60\t0\t0\t0\t0\t0\t0\t1\n")
    bench.send(common.Start(uid, common.MavlinkType.FLIGHT_PLAN))
    assert bench.firmware.flight_plan.playing
    Walk(bench, 10.0, 0.0).walk(0.4)
    bench.send(follow_me.Start(Mode.GEOGRAPHIC))
    assert state(bench)[0] is Mode.NONE
    assert bench.firmware.flight_plan.playing
