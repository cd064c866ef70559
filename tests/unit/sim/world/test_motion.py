"""How the simulated aircraft moves, against numbers worked out by hand and those of the anafi_ros paper."""

from __future__ import annotations

import math

import pytest

from anafi_mav.sim.world.airframe import Airframe
from anafi_mav.sim.world.model import MODELS
from anafi_mav.sim.world.motion import STEP, Pose, Turn

RAD = math.pi / 180.0
AIRFRAME = MODELS["4k"].airframe


class Flyer:
    """A drone in the air at 50 m, hovering."""

    def __init__(self, heading_deg: float = 0.0, height: float = 50.0) -> None:
        self.body = Airframe(AIRFRAME)
        self.body.place(0.0, 0.0, heading_deg * RAD)
        self.body.down = -height
        self.body.limits(tilt_rate=300.0 * RAD, ceiling=4000.0)
        self.body.hover()

    def run(self, seconds: float) -> Pose:
        for _ in range(round(seconds / STEP)):
            self.body.step()
        return self.pose

    @property
    def pose(self) -> Pose:
        return self.body.pose


@pytest.mark.parametrize(
    ("tilt", "speed"),
    [
        (40.0, 15.0),  # the model's top speed
        (20.0, 9.88),  # 15 sqrt(tan 20 / tan 40): drag grows with the square
        (10.0, 6.88),  # 15 sqrt(tan 10 / tan 40)
    ],
)
def test_steady_speed_at_a_tilt(tilt: float, speed: float) -> None:
    flyer = Flyer()
    flyer.body.sticks(0.0, -tilt * RAD, 0.0, 0.0)
    pose = flyer.run(20.0)
    assert pose.vn == pytest.approx(speed, abs=0.05)
    assert (pose.ve, pose.vd) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert pose.pitch == pytest.approx(-tilt * RAD, abs=1e-3)


@pytest.mark.parametrize(
    ("heading", "roll", "pitch", "north", "east"),
    [
        (0.0, 0.0, -10.0, 1, 0),  # nose down is forward, which is north
        (0.0, 0.0, 10.0, -1, 0),
        (0.0, 10.0, 0.0, 0, 1),  # right wing down is right, which is east
        (0.0, -10.0, 0.0, 0, -1),
        (90.0, 0.0, -10.0, 0, 1),  # heading east
        (90.0, 10.0, 0.0, -1, 0),
        (180.0, 0.0, -10.0, -1, 0),
        (-90.0, 0.0, -10.0, 0, -1),
    ],
)
def test_where_a_tilt_leads(heading: float, roll: float, pitch: float, north: int, east: int) -> None:
    flyer = Flyer(heading)
    flyer.body.sticks(roll * RAD, pitch * RAD, 0.0, 0.0)
    pose = flyer.run(3.0)
    speed = pose.ground_speed
    assert speed > 3.0
    assert (pose.vn / speed, pose.ve / speed) == pytest.approx((north, east), abs=0.01)
    assert (pose.roll, pose.pitch) == pytest.approx((roll * RAD, pitch * RAD), abs=2e-3)


def test_climb_rate() -> None:
    flyer = Flyer()
    flyer.body.sticks(0.0, 0.0, 0.0, 3.0)
    assert flyer.run(0.14).up == pytest.approx(50.0, abs=1e-6)  # the delay
    pose = flyer.run(1.86)
    assert pose.vd == pytest.approx(-3.0, abs=0.01)
    # 3 m/s for 2 s less the delay of 0.15 s and the time constant of 0.12 s
    assert pose.up - 50.0 == pytest.approx(3.0 * 1.73, abs=0.03)
    flyer.body.sticks(0.0, 0.0, 0.0, -3.0)
    assert flyer.run(2.0).vd == pytest.approx(3.0, abs=0.01)


def test_yaw_rate() -> None:
    flyer = Flyer()
    flyer.body.sticks(0.0, 0.0, 90.0 * RAD, 0.0)
    # Clockwise is positive; 90 degrees/s for 2 s less delay and time constant, 0.1 s each
    assert flyer.run(2.0).yaw == pytest.approx(162.0 * RAD, abs=1.0 * RAD)
    flyer.body.sticks(0.0, 0.0, 0.0, 0.0)
    assert flyer.run(1.0).yaw == pytest.approx(180.0 * RAD, abs=1.0 * RAD)


def test_delays_of_every_model_are_whole_steps() -> None:
    for model in MODELS.values():
        for delay in (model.airframe.yaw_delay, model.airframe.climb_delay):
            assert delay / STEP == pytest.approx(round(delay / STEP), abs=1e-9)


@pytest.mark.parametrize("time", [0.1, 0.2, 0.5])
def test_tilt_after_a_step_is_the_closed_form(time: float) -> None:
    """10 rad/s with a damping of 0.9: x'' = -100 x - 18 x', whose roots are -9 +- 4.35890 i."""
    flyer = Flyer()
    flyer.body.sticks(10.0 * RAD, 0.0, 0.0, 0.0)
    turned = 4.358898943540674 * time
    left = math.exp(-9.0 * time) * (math.cos(turned) + 9.0 / 4.358898943540674 * math.sin(turned))
    assert flyer.run(time).roll == pytest.approx(10.0 * RAD * (1.0 - left), abs=1e-9)


@pytest.mark.parametrize("time", [0.3, 0.5])
def test_yaw_and_climb_after_a_step_are_closed_form(time: float) -> None:
    """First-order lags of 0.1 s behind 0.1 s (yaw) and of 0.12 s behind 0.15 s (climb): rate and its integral."""
    flyer = Flyer()
    flyer.body.sticks(0.0, 0.0, 1.0, 3.0)
    pose = flyer.run(time)
    assert pose.yaw == pytest.approx(time - 0.2 + 0.1 * math.exp(-(time - 0.1) / 0.1), abs=1e-9)
    kept = math.exp(-(time - 0.15) / 0.12)
    assert -pose.vd == pytest.approx(3.0 * (1.0 - kept), abs=1e-9)
    assert pose.up - 50.0 == pytest.approx(3.0 * (time - 0.27 + 0.12 * kept), abs=1e-9)


def test_pose_at_rest_is_kept_until_it_is_carried() -> None:
    body = Airframe(AIRFRAME)
    body.step()
    before = body.pose
    body.step()
    assert body.pose is before
    body.place(3.0, 4.0, 0.5)
    assert body.pose == Pose(3.0, 4.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0)


def test_tilt_rate_stays_below_its_limit() -> None:
    flyer = Flyer()
    flyer.body.limits(tilt_rate=40.0 * RAD, ceiling=4000.0)
    flyer.body.sticks(0.0, -40.0 * RAD, 0.0, 0.0)
    assert flyer.run(0.5).pitch > -20.0 * RAD
    assert flyer.run(1.5).pitch == pytest.approx(-40.0 * RAD, abs=0.5 * RAD)


def test_step_responses_are_those_of_the_paper() -> None:
    """Section IV of the anafi_ros paper: 2 s of full stick along each axis."""
    ahead = Flyer()
    ahead.body.sticks(0.0, -40.0 * RAD, 0.0, 0.0)
    assert ahead.run(2.0).vn > 8.0
    aside = Flyer()
    aside.body.sticks(40.0 * RAD, 0.0, 0.0, 0.0)
    assert aside.run(2.0).ve > 10.0
    up = Flyer()
    up.body.sticks(0.0, 0.0, 0.0, 4.0)
    assert up.run(2.0).up - 50.0 == pytest.approx(7.0, abs=0.3)
    about = Flyer()
    about.body.sticks(0.0, 0.0, 200.0 * RAD, 0.0)
    about.run(2.5)
    assert about.body.heading > 2.0 * math.pi


def test_released_sticks_stop_the_drone() -> None:
    flyer = Flyer()
    flyer.body.sticks(0.0, -20.0 * RAD, 0.0, 0.0)
    moving = flyer.run(5.0)
    flyer.body.sticks(0.0, 0.0, 0.0, 0.0)
    stopped = flyer.run(8.0)
    assert stopped.ground_speed < 0.05
    # It brakes at 2 to 4 m/s2: v squared over twice that, and a bit for the tilt to turn.
    assert stopped.north - moving.north < moving.vn**2 / (2.0 * 2.0) + moving.vn * 0.5


def test_a_fall_is_free() -> None:
    flyer = Flyer(height=20.0)
    flyer.body.fall()
    # sqrt(2 h / g) = 2.02 s
    assert flyer.run(1.9).up > 0.0
    assert flyer.run(0.2).up == 0.0
    pose = flyer.run(0.1)
    assert (pose.vd, pose.ground_speed) == (0.0, 0.0)


def test_a_move_goes_straight_and_does_not_overshoot() -> None:
    flyer = Flyer()
    flyer.body.move(30.0, 40.0, 60.0, speed=5.0, climb=2.0, yaw_rate=1.0)
    for _ in range(30):
        pose = flyer.run(1.0)
        assert pose.ground_speed < 5.2
        assert -pose.vd < 2.1
        assert abs(pose.north * 40.0 - pose.east * 30.0) / 50.0 < 0.2  # distance from the line
        assert math.hypot(pose.north, pose.east) < 50.3
    assert (pose.north, pose.east, pose.up) == pytest.approx((30.0, 40.0, 60.0), abs=0.1)
    assert flyer.body.has_arrived


def test_move_with_turn_first_turns_before_moving() -> None:
    flyer = Flyer()
    flyer.body.move(0.0, 20.0, 50.0, yaw=math.pi / 2, turn=Turn.FIRST, speed=5.0, climb=2.0, yaw_rate=1.0)
    pose = flyer.run(1.0)
    assert pose.yaw > 0.3
    assert abs(pose.east) < 0.01
    assert flyer.run(15.0).east == pytest.approx(20.0, abs=0.1)


def test_the_ceiling_and_the_fence_hold() -> None:
    flyer = Flyer()
    flyer.body.limits(tilt_rate=300.0 * RAD, ceiling=60.0)
    flyer.body.fence(40.0)
    flyer.body.sticks(0.0, -40.0 * RAD, 0.0, 4.0)
    highest = farthest = 0.0
    for _ in range(100):
        pose = flyer.run(0.2)
        highest, farthest = max(highest, pose.up), max(farthest, pose.north)
    assert 59.0 < highest < 60.5
    assert 37.0 < farthest <= 40.0


def test_same_commands_same_flight() -> None:
    def flight() -> Pose:
        flyer = Flyer(30.0)
        flyer.body.sticks(0.1, -0.2, 0.5, 1.0)
        return flyer.run(3.0)

    assert flight() == flight()
