"""moveBy, moveTo, the sticks, and who takes over from whom."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, move
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveByError, MoveToStatus, OrientationMode
from anafi_mav.sim.autopilot.guidance import STICK_TIMEOUT

NAN, INF = math.nan, math.inf


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.take_off()
    bench.events.clear()
    return bench


def place(north: float, east: float) -> tuple[float, float]:
    return geo.destination(HOME[0], HOME[1], north, east)


def move_to(
    north: float, east: float, up: float, mode: OrientationMode = OrientationMode.NONE, heading: float = 0.0
) -> ardrone3.MoveTo:
    return ardrone3.MoveTo(*place(north, east), up, mode, heading)


def ends(bench: Bench) -> list[MoveByError]:
    return [event.error for event in bench.of(ardrone3.MoveByEnd)]


def statuses(bench: Bench) -> list[MoveToStatus]:
    return [event.status for event in bench.of(ardrone3.MoveToChanged)]


def turn_to(bench: Bench, degrees: float) -> None:
    bench.send(ardrone3.MoveBy(0.0, 0.0, 0.0, math.radians(degrees)))
    bench.run_until(lambda: bool(ends(bench)))
    bench.rest()
    bench.events.clear()


# -- moveBy


@pytest.mark.parametrize(
    ("heading", "north", "east"),
    [(0.0, 4.0, 3.0), (90.0, -3.0, 4.0), (180.0, -4.0, -3.0), (-90.0, 3.0, -4.0)],
)
def test_move_by_is_in_the_frame_of_the_body(bench: Bench, heading: float, north: float, east: float) -> None:
    turn_to(bench, heading)
    start = bench.pose
    bench.send(ardrone3.MoveBy(4.0, 3.0, -2.0, 0.0))  # front, right, down
    bench.run_until(lambda: bool(ends(bench)))
    pose = bench.pose
    flown = (pose.north - start.north, pose.east - start.east, pose.up - start.up)
    assert flown == pytest.approx((north, east, 2.0), abs=0.15)
    end = bench.of(ardrone3.MoveByEnd)[0]
    assert end.error is MoveByError.OK
    assert (end.dX, end.dY, end.dZ, end.dPsi) == pytest.approx((4.0, 3.0, -2.0, 0.0), abs=0.15)
    bench.rest()
    assert bench.states() == [FlyingState.FLYING, FlyingState.HOVERING]


def test_move_by_turns_while_the_way_stays_straight(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(5.0, 0.0, 0.0, math.pi))
    bench.run_until(lambda: bool(ends(bench)))
    assert (bench.pose.north, bench.pose.east) == pytest.approx((5.0, 0.0), abs=0.2)
    assert abs(bench.pose.yaw) == pytest.approx(math.pi, abs=0.05)
    assert bench.of(ardrone3.MoveByEnd)[0].dPsi == pytest.approx(math.pi, abs=0.05)


def test_move_by_of_two_turns_makes_two(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(0.0, 0.0, 0.0, 4.0 * math.pi))
    bench.run_until(lambda: bool(ends(bench)), 30.0)
    assert bench.of(ardrone3.MoveByEnd)[0].dPsi == pytest.approx(4.0 * math.pi, abs=0.05)


@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize("rate", [20.0, 60.0, 200.0])
def test_turn_of_a_move_by_ends_where_it_is_reported(model: str, rate: float) -> None:
    bench = Bench(model)
    bench.take_off()
    bench.send(move.ExtendedMoveBy(0.0, 0.0, 0.0, math.pi / 2, 0.0, 0.0, rate))
    bench.run_until(lambda: bool(ends(bench)))
    bench.rest()
    bench.run(1.0)
    reported = bench.of(ardrone3.MoveByEnd)[0].dPsi
    assert math.degrees(reported) == pytest.approx(90.0, abs=1.5)
    assert math.degrees(bench.pose.yaw) == pytest.approx(math.degrees(reported), abs=1.0)


def test_a_newer_move_by_interrupts_the_older(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(50.0, 0.0, 0.0, 0.0))
    bench.run(3.0)
    north = bench.pose.north
    answer = bench.send(ardrone3.MoveBy(0.0, 5.0, 0.0, 0.0))
    assert len(answer) == 1
    assert isinstance(answer[0], ardrone3.MoveByEnd)
    assert answer[0].error is MoveByError.INTERRUPTED
    assert answer[0].dX == pytest.approx(north - 0.0, abs=0.1)  # what it managed until then
    bench.run_until(lambda: len(ends(bench)) == 2)
    assert ends(bench) == [MoveByError.INTERRUPTED, MoveByError.OK]
    # The newer one began where its command arrived.
    assert (bench.pose.north, bench.pose.east) == pytest.approx((north, 5.0), abs=0.2)


def test_move_by_nothing_ends_the_one_before(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(50.0, 0.0, 0.0, 0.0))
    bench.run(2.0)
    answer = bench.send(ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0))
    assert [event.error for event in answer if isinstance(event, ardrone3.MoveByEnd)] == [
        MoveByError.INTERRUPTED,
        MoveByError.OK,
    ]
    bench.rest()
    assert bench.pose.north < 15.0


def test_sticks_do_not_touch_a_move_by(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(10.0, 0.0, 0.0, 0.0))
    bench.sticks(1.0, roll=100, yaw=100, gaz=100)
    bench.run_until(lambda: bool(ends(bench)))
    assert (bench.pose.north, bench.pose.east, bench.pose.yaw) == pytest.approx((10.0, 0.0, 0.0), abs=0.15)


@pytest.mark.parametrize(
    ("asked", "slow"),
    [((20.0, 0.0, 0.0, 0.0, 2.0, 1.0, 30.0), 10.0), ((0.0, 0.0, -10.0, 0.0, 2.0, 1.0, 30.0), 10.0)],
)
def test_extended_move_by_keeps_its_speeds(bench: Bench, asked: tuple[float, ...], slow: float) -> None:
    bench.send(move.ExtendedMoveBy(*asked))
    took = bench.run_until(lambda: bool(ends(bench)))
    assert slow < took < slow + 5.0
    assert ends(bench) == [MoveByError.OK]


@pytest.mark.parametrize(
    "asked",
    [
        (5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),  # all speeds are zero
        (5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 30.0),  # the one it needs is
        (0.0, 0.0, -1.0, 0.0, 2.0, 0.0, 30.0),
        (0.0, 0.0, 0.0, 1.0, 2.0, 1.0, 0.0),
        (5.0, 0.0, 0.0, 0.0, -2.0, 1.0, 30.0),
        (5.0, 0.0, 0.0, 0.0, NAN, 1.0, 30.0),
        (NAN, 0.0, 0.0, 0.0, 2.0, 1.0, 30.0),
        (INF, 0.0, 0.0, 0.0, 2.0, 1.0, 30.0),
    ],
)
def test_invalid_move_by_is_refused(bench: Bench, asked: tuple[float, ...]) -> None:
    bench.send(move.ExtendedMoveBy(*asked))
    assert ends(bench) == [MoveByError.UNKNOWN]
    bench.run(0.5)
    assert bench.state is FlyingState.HOVERING


def test_moves_on_the_ground() -> None:
    bench = Bench()
    bench.send(ardrone3.MoveBy(1.0, 0.0, 0.0, 0.0))
    bench.send(move_to(10.0, 0.0, 5.0))
    assert ends(bench) == [MoveByError.NOT_AVAILABLE]
    assert statuses(bench) == [MoveToStatus.ERROR]
    bench.run(1.0)
    assert bench.pose.up == 0.0


# -- moveTo


def test_move_to_echoes_its_command(bench: Bench) -> None:
    command = move_to(12.0, 9.0, 6.0, OrientationMode.HEADING_DURING, 45.0)
    (running,) = bench.send(command)
    assert running == ardrone3.MoveToChanged(
        command.latitude, command.longitude, 6.0, OrientationMode.HEADING_DURING, 45.0, MoveToStatus.RUNNING
    )
    bench.run_until(lambda: len(statuses(bench)) == 2)
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.DONE]
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((12.0, 9.0, 6.0), abs=0.15)
    assert math.degrees(bench.pose.yaw) == pytest.approx(45.0, abs=2.0)


@pytest.mark.parametrize(
    ("mode", "heading", "yaw", "turns_first"),
    [
        (OrientationMode.NONE, 200.0, 0.0, False),
        (OrientationMode.TO_TARGET, 200.0, 90.0, True),
        (OrientationMode.HEADING_START, -90.0, -90.0, True),
        (OrientationMode.HEADING_START, 270.0, -90.0, True),
        (OrientationMode.HEADING_DURING, 180.0, 180.0, False),
    ],
)
def test_where_the_nose_points(
    bench: Bench, mode: OrientationMode, heading: float, yaw: float, turns_first: bool
) -> None:
    bench.send(move_to(0.0, 20.0, 5.0, mode, heading))
    bench.run(1.5)  # a quarter turn takes 2.25 s at the factory's 40 degrees/s
    assert (bench.pose.ground_speed < 0.1) is turns_first
    bench.run_until(lambda: len(statuses(bench)) == 2)
    assert abs(math.remainder(math.degrees(bench.pose.yaw) - yaw, 360.0)) < 2.0


def test_a_newer_move_to_replaces_the_older_in_silence(bench: Bench) -> None:
    bench.send(move_to(60.0, 0.0, 5.0))
    bench.run(3.0)
    bench.send(move_to(0.0, 15.0, 5.0))
    bench.run_until(lambda: MoveToStatus.DONE in statuses(bench))
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.RUNNING, MoveToStatus.DONE]
    assert (bench.pose.north, bench.pose.east) == pytest.approx((0.0, 15.0), abs=0.15)


def test_a_refused_move_to_leaves_the_older_one(bench: Bench) -> None:
    bench.send(move_to(15.0, 0.0, 5.0))
    bench.send(move_to(15.0, 0.0, 500.0))
    bench.run_until(lambda: MoveToStatus.DONE in statuses(bench))
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.ERROR, MoveToStatus.DONE]


def test_move_by_and_move_to_replace_each_other(bench: Bench) -> None:
    bench.send(ardrone3.MoveBy(50.0, 0.0, 0.0, 0.0))
    bench.run(1.0)
    bench.send(move_to(60.0, 0.0, 5.0))
    assert ends(bench) == [MoveByError.INTERRUPTED]
    bench.run(1.0)
    bench.send(ardrone3.MoveBy(0.0, 2.0, 0.0, 0.0))
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.CANCELED]
    bench.run_until(lambda: len(ends(bench)) == 2)
    assert ends(bench) == [MoveByError.INTERRUPTED, MoveByError.OK]


def test_cancel_move_to(bench: Bench) -> None:
    assert bench.send(ardrone3.CancelMoveTo()) == []
    bench.send(move_to(60.0, 0.0, 5.0))
    bench.run(3.0)
    bench.send(ardrone3.CancelMoveTo())
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.CANCELED]
    bench.rest()
    assert 1.0 < bench.pose.north < 30.0
    bench.send(ardrone3.MoveBy(30.0, 0.0, 0.0, 0.0))
    bench.run(1.0)
    assert bench.send(ardrone3.CancelMoveTo()) == []  # it is for moveTo alone


def test_sticks_turn_a_move_to_without_stopping_it(bench: Bench) -> None:
    bench.send(move_to(20.0, 0.0, 5.0))
    bench.sticks(1.0, roll=-100, pitch=-100, gaz=100, yaw=100)
    assert bench.pose.yaw > math.radians(20.0)  # 40 degrees/s, less the delays
    assert bench.pose.north > 0.1
    assert abs(bench.pose.east) < 0.1
    bench.run_until(lambda: MoveToStatus.DONE in statuses(bench))
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((20.0, 0.0, 5.0), abs=0.15)


@pytest.mark.parametrize("mode", [OrientationMode.TO_TARGET, OrientationMode.HEADING_DURING])
def test_with_an_orientation_not_even_yaw_counts(bench: Bench, mode: OrientationMode) -> None:
    bench.send(move_to(20.0, 0.0, 5.0, mode, 0.0))
    bench.sticks(1.0, yaw=100)
    assert abs(bench.pose.yaw) < 0.05


def test_extended_move_to_keeps_its_speeds(bench: Bench) -> None:
    bench.send(move.ExtendedMoveTo(*place(30.0, 0.0), 5.0, move.OrientationMode.NONE, 0.0, 3.0, 1.0, 30.0))
    fastest = 0.0
    while MoveToStatus.DONE not in statuses(bench):
        bench.turn()
        fastest = max(fastest, bench.pose.ground_speed)
    assert 2.8 < fastest < 3.1


@pytest.mark.parametrize(
    "asked",
    [
        (500.0, 500.0, 5.0),  # Parrot's "unknown"
        (NAN, 2.0, 5.0),
        (*place(10.0, 0.0), NAN),
        (*place(10.0, 0.0), 150.1),  # above the ceiling
    ],
)
def test_invalid_move_to_is_refused(bench: Bench, asked: tuple[float, float, float]) -> None:
    bench.send(ardrone3.MoveTo(*asked, OrientationMode.NONE, 0.0))
    assert statuses(bench) == [MoveToStatus.ERROR]


def test_extended_move_to_without_speed(bench: Bench) -> None:
    bench.send(move.ExtendedMoveTo(*place(5.0, 0.0), 5.0, move.OrientationMode.NONE, 0.0, 0.0, 0.0, 0.0))
    assert statuses(bench) == [MoveToStatus.ERROR]


def test_geofence_refuses_only_when_enabled(bench: Bench) -> None:
    bench.send(move_to(120.0, 0.0, 5.0))  # MaxDistance is 100 m
    assert statuses(bench) == [MoveToStatus.RUNNING]
    bench.send(ardrone3.NoFlyOverMaxDistance(1))
    bench.send(move_to(120.0, 0.0, 5.0))
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.ERROR]


def test_lost_fix_ends_move_to_but_not_move_by(bench: Bench) -> None:
    bench.send(move_to(60.0, 0.0, 5.0))
    bench.run(1.0)
    bench.faults.gps = False
    bench.run(0.1)
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.ERROR]
    bench.rest()
    bench.send(move_to(60.0, 0.0, 5.0))
    assert statuses(bench)[-1] is MoveToStatus.ERROR
    bench.send(ardrone3.MoveBy(3.0, 0.0, 0.0, 0.0))
    bench.run_until(lambda: bool(ends(bench)))
    assert ends(bench) == [MoveByError.OK]


def test_a_move_into_the_fence_gives_up(bench: Bench) -> None:
    bench.send(ardrone3.MaxDistance(10.0))
    bench.send(ardrone3.NoFlyOverMaxDistance(1))
    bench.send(ardrone3.MoveBy(30.0, 0.0, 0.0, 0.0))
    bench.run_until(lambda: bool(ends(bench)))
    assert ends(bench) == [MoveByError.UNKNOWN]
    assert 8.0 < bench.pose.north <= 10.0


@pytest.mark.parametrize("command", [ardrone3.Landing(), ardrone3.Emergency()])
def test_move_is_ended_by_landing_and_emergency(bench: Bench, command: ardrone3.Landing | ardrone3.Emergency) -> None:
    bench.send(move_to(60.0, 0.0, 5.0))
    bench.run(1.0)
    bench.send(command)
    assert statuses(bench) == [MoveToStatus.RUNNING, MoveToStatus.CANCELED]


# -- sticks


def test_sticks_are_percent_of_the_limits(bench: Bench) -> None:
    bench.send(ardrone3.MaxTilt(30.0))
    bench.send(ardrone3.MaxVerticalSpeed(2.0))
    bench.sticks(3.0, pitch=50, gaz=50)  # nose down, up
    assert math.degrees(bench.pose.pitch) == pytest.approx(-15.0, abs=0.2)
    assert bench.pose.vn > 3.0
    assert bench.pose.vd == pytest.approx(-1.0, abs=0.02)
    assert bench.state is FlyingState.FLYING
    bench.sticks(3.0, roll=-50)
    assert math.degrees(bench.pose.roll) == pytest.approx(-15.0, abs=0.2)
    assert bench.pose.ve < -3.0


def test_flag_zero_ignores_roll_and_pitch(bench: Bench) -> None:
    bench.sticks(2.0, flag=0, roll=100, pitch=100, yaw=50)
    assert bench.pose.ground_speed < 0.01
    assert bench.pose.yaw > math.radians(20.0)


def test_silent_sticks_are_released(bench: Bench) -> None:
    bench.sticks(2.0, pitch=100)
    last = bench.now - 0.05
    released = bench.run_until(lambda: bench.body.stick_push[0] == 0.0)
    assert bench.now - last == pytest.approx(STICK_TIMEOUT, abs=0.02)
    assert released < STICK_TIMEOUT
    bench.rest()
    assert bench.pose.ground_speed < 0.2


def test_the_watchdog_runs_on_the_machines_clock(bench: Bench) -> None:
    bench.send(ardrone3.PCMD(1, 0, 100, 0, 0, 0))
    bench.firmware.tick(bench.now + STICK_TIMEOUT - 0.01, 30.0, bench.pose, True, True)  # a simulation that hurries
    assert bench.body.stick_push[0] != 0.0
    bench.firmware.tick(bench.now + STICK_TIMEOUT + 0.01, 0.0, bench.pose, True, True)
    assert bench.body.stick_push[0] == 0.0


def test_sticks_beyond_a_hundred_are_a_hundred(bench: Bench) -> None:
    bench.sticks(3.0, pitch=127)
    assert math.degrees(bench.pose.pitch) == pytest.approx(-10.0, abs=0.2)


def test_sticks_on_ground_or_during_takeoff_do_nothing() -> None:
    bench = Bench()
    bench.sticks(1.0, gaz=100, pitch=100)
    assert bench.pose.up == 0.0
    bench.send(ardrone3.TakeOff())
    bench.run_until(lambda: bench.state is FlyingState.TAKINGOFF)
    bench.sticks(0.5, pitch=100)
    assert bench.pose.ground_speed < 0.01


def test_gaz_ends_a_landing(bench: Bench) -> None:
    bench.climb(10.0)
    bench.send(ardrone3.Landing())
    bench.run(1.0)
    assert bench.pose.vd > 0.5
    bench.sticks(0.2, gaz=-50)
    assert bench.state is FlyingState.LANDING
    bench.sticks(1.0, gaz=50)
    assert bench.state is FlyingState.FLYING
    assert bench.pose.vd < 0.0
