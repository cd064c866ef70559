"""The loops over velocity, position and heading: signs and sizes by hand, and flown in virtual time.

North, east, down; front and right of the nose; tilt in degrees, roll right and pitch nose up +. A push of g is a tilt
of 45 degrees.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone import Limits, PilotingCommand
from anafi_mav.drone.piloting.sticks import percent
from anafi_mav.sim.world.model import MODELS
from anafi_mav.vehicle.base.velocity_loop import (
    AIR_GAIN,
    PLACE_GAIN,
    STALE,
    VELOCITY_GAIN,
    YAW_GAIN,
    Axis,
    Demand,
    G,
    MotionEstimate,
    VelocityController,
    tilt_for,
    turn_towards,
)

LIMITS = Limits(tilt_deg=35.0, yaw_rate_dps=90.0, climb_mps=3.0)


def still(yaw: float = 0.0, *, height: float = 10.0, now: float = 0.0) -> MotionEstimate:
    """A drone that hovers in calm air with its nose to `yaw` (deg)."""
    motion = MotionEstimate()
    motion.on_attitude(0.0, 0.0, math.radians(yaw), now)
    motion.on_velocity(0.0, 0.0, 0.0, now)
    motion.on_height(height, now)
    motion.on_place(48.8789, 2.3677)
    return motion


def sticks(
    demand: Demand, motion: MotionEstimate | None = None, now: float = 0.0, limits: Limits = LIMITS
) -> PilotingCommand:
    command = VelocityController(motion or still()).sticks(demand, limits, now)
    assert command is not None
    return command


def tilt(push: float) -> float:
    """deg of tilt that push (m/s2) that way."""
    return math.degrees(math.atan(push / G))


# Signs.


@pytest.mark.parametrize(
    ("yaw", "north", "east", "front", "right"),
    [
        (0.0, 1.0, 0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, 1.0),
        (90.0, 1.0, 0.0, 0.0, -1.0),
        (90.0, 0.0, 1.0, 1.0, 0.0),
        (180.0, 1.0, 0.0, -1.0, 0.0),
        (-90.0, 1.0, 0.0, 0.0, 1.0),
        (45.0, 1.0, 1.0, math.sqrt(2.0), 0.0),
    ],
)
def test_a_velocity_over_ground_leans_the_right_way(
    yaw: float, north: float, east: float, front: float, right: float
) -> None:
    command = sticks(Demand(Axis(north), Axis(east)), still(yaw))
    # In calm air, from rest: the gain, and the drag that there will be at 1 m/s.
    assert command.pitch_deg == pytest.approx(-tilt(VELOCITY_GAIN * front), abs=0.5)
    assert command.roll_deg == pytest.approx(tilt(VELOCITY_GAIN * right), abs=0.5)


@pytest.mark.parametrize("yaw", [0.0, 90.0, 200.0])
def test_a_velocity_of_the_body_knows_no_north(yaw: float) -> None:
    command = sticks(Demand(Axis(1.0), Axis(-1.0), body=True), still(yaw))
    assert command.pitch_deg == pytest.approx(-tilt(VELOCITY_GAIN), abs=0.6)
    assert command.roll_deg == pytest.approx(-tilt(VELOCITY_GAIN), abs=0.6)


def test_reached_velocity_needs_tilt_against_drag_only() -> None:
    motion = still()
    motion.on_velocity(5.0, 0.0, 0.0, 0.001)
    command = sticks(Demand(Axis(5.0), Axis(0.0)), motion, 0.001)
    assert command.pitch_deg == pytest.approx(-0.35, abs=0.01)  # a hundredth of full tilt: a stick at zero would brake
    assert command.roll_deg == 0.0


@pytest.mark.parametrize(("down", "climb"), [(1.0, -1.0), (-1.0, 1.0), (-9.0, 3.0), (9.0, -3.0), (0.0, 0.0)])
def test_a_velocity_down_is_a_climb_rate(down: float, climb: float) -> None:
    assert sticks(Demand(down_velocity=down)).climb_mps == climb


def test_a_height_is_climbed_to() -> None:
    assert sticks(Demand(height=12.0), still(height=10.0)).climb_mps == pytest.approx(2.0)
    assert sticks(Demand(height=2.0), still(height=10.0)).climb_mps == -3.0
    assert sticks(Demand(height=10.5, down_velocity=0.3), still(height=10.0)).climb_mps == pytest.approx(0.2)


def test_vertical_accelerations_add_up() -> None:
    motion = still()
    controller = VelocityController(motion)
    climbs = []
    for step in range(11):
        now = 0.2 * step
        motion.on_velocity(0.0, 0.0, 0.0, now)
        motion.on_attitude(0.0, 0.0, 0.0, now)
        command = controller.sticks(Demand(down_acceleration=-0.5 if step < 6 else 0.0), LIMITS, now)
        assert command is not None
        climbs.append(command.climb_mps)
    assert climbs[5] == pytest.approx(0.5)
    assert climbs[10] == pytest.approx(climbs[5])  # no acceleration: it goes on
    command = controller.sticks(Demand(down_velocity=0.0), LIMITS, 2.2)
    assert command is not None
    assert command.climb_mps == 0.0


@pytest.mark.parametrize(("x", "y", "pitch", "roll"), [(1.0, 0.0, -1.0, 0.0), (0.0, -2.0, 0.0, -2.0)])
def test_an_acceleration_is_a_tilt(x: float, y: float, pitch: float, roll: float) -> None:
    command = sticks(Demand(Axis(None, x), Axis(None, y)))
    assert (command.pitch_deg, command.roll_deg) == pytest.approx((math.copysign(tilt(abs(x)), pitch), tilt(roll)))


def test_an_acceleration_is_added_to_a_velocity() -> None:
    plain = sticks(Demand(Axis(1.0), Axis(0.0)))
    ahead = sticks(Demand(Axis(1.0, 1.5), Axis(0.0)))
    push = math.tan(math.radians(-ahead.pitch_deg)) - math.tan(math.radians(-plain.pitch_deg))
    assert push * G == pytest.approx(1.5)


def test_no_acceleration_and_no_velocity_is_the_drones_own_hover() -> None:
    for demand in (
        Demand(),
        Demand(Axis(0.0), Axis(0.0)),
        Demand(Axis(None, 0.0), Axis(None, 0.0)),
        Demand(down_velocity=1.0, yaw_rate=1.0),
    ):
        command = sticks(demand)
        assert (command.roll_deg, command.pitch_deg) == (0.0, 0.0)


def test_a_place_is_flown_to() -> None:
    command = sticks(Demand(Axis(None, None, 3.0), Axis(None, None, -4.0)))
    # 5 m away: 0.7 * 5 = 3.5 m/s, towards it, which full tilt does not give at once: the direction counts.
    front, right = math.tan(math.radians(-command.pitch_deg)), math.tan(math.radians(command.roll_deg))
    assert math.atan2(right, front) == pytest.approx(math.atan2(-4.0, 3.0), abs=1e-6)
    near = sticks(Demand(Axis(None, None, 0.1), Axis(None, None, 0.0)))
    assert -near.pitch_deg == pytest.approx(tilt(VELOCITY_GAIN * PLACE_GAIN * 0.1), abs=0.05)


def test_a_place_in_turned_axes() -> None:
    """Front is east: 2 m along the first axis is 2 m east."""
    demand = Demand(Axis(None, None, 2.0), Axis(None, None, 0.0), turn=math.pi / 2)
    command = sticks(demand)
    assert command.roll_deg > 5.0
    assert command.pitch_deg == pytest.approx(0.0, abs=1e-6)


def test_headings_turn_the_short_way() -> None:
    assert turn_towards(math.radians(170), math.radians(-170)) == pytest.approx(-YAW_GAIN * math.radians(20))
    assert turn_towards(math.radians(10), math.radians(-10), 0.5) == pytest.approx(0.5 + YAW_GAIN * math.radians(20))
    command = sticks(Demand(yaw=math.radians(30), yaw_rate=0.1), still(10.0))
    assert command.yaw_rate_dps == pytest.approx(math.degrees(0.1) + YAW_GAIN * 20.0)


# Limits.


def test_the_tilt_is_limited_as_a_whole_and_keeps_its_direction() -> None:
    command = sticks(Demand(Axis(12.0), Axis(9.0)))
    front, right = math.tan(math.radians(-command.pitch_deg)), math.tan(math.radians(command.roll_deg))
    assert math.degrees(math.atan(math.hypot(front, right))) == pytest.approx(35.0)
    assert right / front == pytest.approx(0.75)


def test_lasting_limit_is_reported() -> None:
    motion, controller = still(), None
    controller = VelocityController(motion)
    short = []
    for step in range(12):
        now = 0.2 * step
        motion.on_attitude(0.0, 0.0, 0.0, now)
        motion.on_velocity(0.0, 0.0, 0.0, now)
        controller.sticks(Demand(Axis(15.0), Axis(0.0)), LIMITS, now)
        short.append(controller.short_of)
    assert short[:7] == [None] * 7
    assert short[-1] == pytest.approx(15.0)
    controller.sticks(Demand(Axis(0.0), Axis(0.0)), LIMITS, 3.0)
    assert controller.short_of is None


def test_demand_with_stale_estimates_has_no_sticks() -> None:
    motion = still()
    controller = VelocityController(motion)
    assert controller.sticks(Demand(Axis(1.0)), LIMITS, STALE) is None
    assert controller.sticks(Demand(height=5.0), LIMITS, STALE) is None
    assert controller.sticks(Demand(down_velocity=1.0), LIMITS, STALE) is not None
    motion.forget_attitude()
    assert controller.sticks(Demand(Axis(1.0)), LIMITS, 0.1) is None
    turn = controller.sticks(Demand(yaw=1.0, yaw_rate=0.2), LIMITS, 0.1)
    assert turn is not None
    assert turn.yaw_rate_dps == pytest.approx(math.degrees(0.2))


def test_the_tilt_that_a_speed_needs() -> None:
    assert math.degrees(tilt_for(15.0, wind=0.0)) == pytest.approx(40.0)  # by definition
    assert math.degrees(tilt_for(5.0)) == pytest.approx(20.4, abs=0.1)  # 10 m/s through the air: 40 * (10 / 15)^2 or so


# What the drone reports.


def test_hover_in_wind_estimates_the_air() -> None:
    """Nose north, it leans 5 degrees forward and does not move: the air pushes it south with g tan 5."""
    motion = MotionEstimate()
    for step in range(20):
        motion.on_attitude(0.0, math.radians(-5.0), 0.0, 0.2 * step)
        motion.on_velocity(0.0, 0.0, 0.0, 0.2 * step)
    assert motion.air == pytest.approx((-G * math.tan(math.radians(5.0)), 0.0), abs=1e-3)


def test_one_look_believes_a_share() -> None:
    motion = MotionEstimate()
    for now, north in ((0.0, 0.0), (0.2, 0.1)):
        motion.on_attitude(0.0, 0.0, 0.0, now)
        motion.on_velocity(north, 0.0, 0.0, now)
    assert motion.air[0] == pytest.approx(AIR_GAIN * 0.5)


def test_air_estimate_ignores_ripple_at_high_rates() -> None:
    """A speed with a ripple, 200 times a second: its difference would be 20 m/s2."""
    motion = MotionEstimate()
    for step in range(400):
        motion.on_attitude(0.0, 0.0, 0.0, 0.005 * step)
        motion.on_velocity(0.05 * (step % 2), 0.0, 0.0, 0.005 * step)
    assert abs(motion.air[0]) < 0.4


def test_the_place_is_carried_on_by_speed_and_set_right_by_gps() -> None:
    motion = still()
    assert (motion.north, motion.east) == (0.0, 0.0)
    for step in range(1, 6):
        motion.on_velocity(2.0, -1.0, 0.0, 0.2 * step)
    assert (motion.north, motion.east) == pytest.approx((1.8, -0.9))
    motion.on_place(48.8789 + 3.0 / 111_221.0, 2.3677)  # 3 m north: 1.8 + 0.6 * 1.2
    assert (motion.north, motion.east) == pytest.approx((2.52, -0.36), abs=0.01)
    motion.on_place(48.8789 + 100.0 / 111_221.0, 2.3677)  # it was gone for a while
    assert motion.north == pytest.approx(100.0, abs=0.1)


def test_the_heading_goes_on_as_it_turns() -> None:
    motion = MotionEstimate()
    motion.on_attitude(0.0, 0.0, math.radians(170.0), 0.0)
    motion.on_attitude(0.0, 0.0, math.radians(-170.0), 0.2)
    assert motion.turning == pytest.approx(math.radians(100.0))
    assert motion.heading(0.3) == pytest.approx(math.radians(-160.0))


@pytest.mark.parametrize(("seconds", "share"), [(0.0, 1.0), (0.2, 1.0), (1.0, 0.5), (2.0, 0.25)])
def test_a_gain_is_lowered_by_the_round_trip(seconds: float, share: float) -> None:
    motion = still(height=10.0)
    motion.round_trip.measure(seconds)
    assert sticks(Demand(height=11.0), motion).climb_mps == pytest.approx(share)


# Flown, with reports as late as a radio makes them.


def hovering(model: str) -> Bench:
    """A drone 10 m above the ground, with limits that leave the loop free."""
    bench = Bench(model)
    for setting in (ardrone3.MaxTilt(35.0), ardrone3.MaxRotationSpeed(90.0), ardrone3.MaxVerticalSpeed(3.0)):
        bench.send(setting)
    bench.take_off()
    bench.climb(10.0)
    return bench


@pytest.mark.parametrize("delay", [0.35, 0.7])
@pytest.mark.parametrize("model", sorted(MODELS))
def test_a_place_is_held_over_a_late_link(model: str, delay: float) -> None:
    """10 m to the north and 3 m up, with sticks and reports that arrive so many s late."""
    bench = hovering(model)
    motion = MotionEstimate()
    motion.round_trip.measure(2.0 * delay)
    controller = VelocityController(motion)
    reports: list[tuple[float, Any]] = []
    sent: list[tuple[float, PilotingCommand]] = []
    begin = bench.pose
    motion.on_place(48.8789, 2.3677)
    demand = Demand(Axis(0.0, position=10.0), Axis(0.0, position=0.0), height=13.0, yaw=0.0)
    command = None
    for tick in range(6000):
        bench.turn()
        now = bench.now
        if tick % 20 == 0:
            reports.append((now + delay, bench.pose))
        if reports and reports[0][0] <= now:
            _, pose = reports.pop(0)
            motion.on_attitude(pose.roll, pose.pitch, pose.yaw, now)
            motion.on_velocity(pose.vn, pose.ve, pose.vd, now)
            motion.on_height(pose.up, now)
            if (sticks := controller.sticks(demand, LIMITS, now)) is not None:
                sent.append((now + delay, sticks))
        if sent and sent[0][0] <= now:
            _, command = sent.pop(0)
        if command is not None and tick % 5 == 0:
            bench.send(ardrone3.PCMD(1, *percent(command, LIMITS), 0))
        if tick > 3000:
            assert bench.pose.north - begin.north == pytest.approx(10.0, abs=1.0)
            assert bench.pose.up == pytest.approx(13.0, abs=0.5)


@pytest.mark.parametrize("late", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("model", sorted(MODELS))
def test_a_step_in_virtual_time(model: str, late: float) -> None:
    """0 to 5 m/s to the east with the nose to the north, in 5 m/s of headwind, at five reports a second."""
    bench = hovering(model)
    motion = MotionEstimate()
    controller = VelocityController(motion)
    reports: list[tuple[float, tuple[float, ...]]] = []
    speeds = []
    command = None
    for tick in range(1400):
        bench.body.blow(0.0, -5.0)
        bench.turn()
        now, pose = bench.now, bench.pose
        if tick % 20 == 0:
            reports.append((now + late, (pose.roll, pose.pitch, pose.yaw, pose.vn, pose.ve, pose.vd)))
        if reports and reports[0][0] <= now:
            _, (roll, pitch, yaw, vn, ve, vd) = reports.pop(0)
            motion.on_attitude(roll, pitch, yaw, now)
            motion.on_velocity(vn, ve, vd, now)
            if tick >= 400:
                command = controller.sticks(Demand(Axis(0.0), Axis(5.0), yaw=0.0), LIMITS, now)
        if command is not None and tick % 5 == 0:
            bench.send(ardrone3.PCMD(1, *percent(command, LIMITS), 0))
        if tick >= 400:
            speeds.append(math.hypot(pose.vn, pose.ve - 5.0))
            assert pose.ve < 6.0
    assert max(speeds[300:]) < 0.5
    assert sum(speeds[500:]) / len(speeds[500:]) < 0.3
