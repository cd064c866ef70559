"""The sign of the reported roll: by hand, sample by sample, and flown in virtual time."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone import Limits
from anafi_mav.drone.piloting.sticks import percent
from anafi_mav.services.monitor.roll_sign_service import read, written
from anafi_mav.sim.world.motion import STEP
from anafi_mav.vehicle.base.roll_sign import OVERTURN, SAMPLES, RollCheck, RollSign
from anafi_mav.vehicle.base.velocity_loop import (
    CAUTIOUS_GAIN,
    CAUTIOUS_TILT,
    Axis,
    Demand,
    G,
    MotionEstimate,
    VelocityController,
)

STEPS = round(1.0 / STEP)
"""Steps of the simulated motion in a second."""


class Flight:
    """Reports to a check, five times a second, of a drone that follows its lean and is pushed by a wind as well."""

    def __init__(self, check: RollCheck, yaw: float = 0.0) -> None:
        self.check, self.yaw, self.now = check, math.radians(yaw), 0.0
        self.right = 0.0
        self.roll = 0.0

    def lean(self, degrees: float, *, sign: int = 1, wind: float = 0.0) -> bool:
        """Report a roll, and the speed to the right after 0.2 s with the mean of this and the last lean.

        `sign` -1: a drone that reports roll the other way round. `wind` pushes to the right, m/s2. True on a verdict.
        """
        before, self.roll = self.roll, math.radians(degrees)
        self.now += 0.2
        self.right += 0.2 * (sign * G * (math.tan(before) + math.tan(self.roll)) / 2.0 + wind)
        self.check.on_attitude(self.roll, self.yaw)
        north, east = -math.sin(self.yaw) * self.right, math.cos(self.yaw) * self.right
        return self.check.on_velocity(north, east, self.now)

    def rock(self, times: int, degrees: float = 10.0, *, sign: int = 1, wind: float = 0.0) -> int:
        """Lean this way and that, level in between; the number of verdicts that changed."""
        turns = (degrees, 0.0, -degrees, 0.0)
        return sum(self.lean(turns[index % 4], sign=sign, wind=wind) for index in range(times))


@pytest.mark.parametrize("yaw", [0.0, 90.0, 200.0])
@pytest.mark.parametrize(("sign", "verdict"), [(1, RollSign.NORMAL), (-1, RollSign.INVERTED)])
@pytest.mark.parametrize("wind", [0.0, 3.0, -3.0])
def test_roll_check_after_twenty_equal_changes_knows_the_sign(
    yaw: float, sign: int, verdict: RollSign, wind: float
) -> None:
    """10 degrees push with 9.81 * tan 10 = 1.73 m/s2, their mean with level 0.86: each sample changes by 1.73."""
    check = RollCheck()
    flight = Flight(check, yaw)
    flight.lean(0.0)
    samples = 0
    while check.sign is RollSign.UNKNOWN:
        samples += 1
        assert samples <= 2 * SAMPLES + 2
        flight.lean((10.0, 0.0, -10.0, 0.0)[samples % 4], sign=sign, wind=wind)
    assert check.sign is verdict
    assert samples > SAMPLES


@pytest.mark.parametrize("wind", [-3.0, -1.0, 3.0])
def test_roll_check_of_steady_lean_in_wind_stays_undecided(wind: float) -> None:
    """Drag and wind outweigh the lean of a drone that slows down: where it accelerates says nothing of roll's sign."""
    check = RollCheck()
    flight = Flight(check)
    for _ in range(200):
        flight.lean(8.0, wind=wind)
    assert check.sign is RollSign.UNKNOWN


def test_roll_check_of_small_leans_learns_nothing() -> None:
    check = RollCheck()
    Flight(check).rock(400, 3.9)
    assert check.sign is RollSign.UNKNOWN


def test_roll_check_with_odds_below_three_to_one_waits() -> None:
    check = RollCheck()
    flight = Flight(check)
    for _ in range(40):
        flight.rock(8)
        flight.rock(8, sign=-1)
    assert check.sign is RollSign.UNKNOWN


def test_roll_check_leaves_out_intervals_with_a_gap() -> None:
    check = RollCheck()
    flight = Flight(check)
    for _ in range(100):
        flight.lean(10.0)
        flight.lean(-10.0)
        flight.now += 1.0
    check.forget_motion()
    assert not check.on_velocity(1.0, 1.0, flight.now)
    assert check.sign is RollSign.UNKNOWN


def test_roll_check_while_the_drone_turns_fast_learns_nothing() -> None:
    check = RollCheck()
    flight = Flight(check)
    for index in range(200):
        flight.yaw = math.radians(30.0 * index)
        flight.lean((10.0, 0.0, -10.0, 0.0)[index % 4])
    assert check.sign is RollSign.UNKNOWN


def test_roll_check_reverses_after_three_times_the_samples() -> None:
    check = RollCheck(RollSign.INVERTED)
    flight = Flight(check)
    flight.rock(OVERTURN // 2)
    assert check.sign is RollSign.INVERTED
    assert flight.rock(2 * OVERTURN) == 1
    assert check.sign is RollSign.NORMAL


@pytest.mark.parametrize("kept", [None, 3, {}, {"firmware": "1.8.2"}, {"firmware": "1.8.2", "inverted": "no"}])
def test_invalid_roll_record_is_not_read(kept: object) -> None:
    assert read(kept, "1.8.2") is RollSign.UNKNOWN


@pytest.mark.parametrize("sign", [RollSign.NORMAL, RollSign.INVERTED])
def test_roll_record_counts_for_its_firmware_only(sign: RollSign) -> None:
    kept = written("1.8.2", sign)
    assert read(kept, "1.8.2") is sign
    assert read(kept, "1.8.3") is RollSign.UNKNOWN
    assert read(kept, None) is RollSign.UNKNOWN


# The loop until the sign is known.


def test_loop_with_unverified_roll_leans_ten_degrees_at_most() -> None:
    motion = MotionEstimate(RollCheck())
    motion.on_attitude(0.0, 0.0, 0.0, 0.0)
    motion.on_velocity(0.0, 0.0, 0.0, 0.0)
    command = VelocityController(motion).sticks(Demand(Axis(12.0), Axis(9.0)), Limits(35.0, 90.0, 3.0), 0.0)
    assert command is not None
    front, right = math.tan(math.radians(-command.pitch_deg)), math.tan(math.radians(command.roll_deg))
    assert math.atan(math.hypot(front, right)) == pytest.approx(CAUTIOUS_TILT)
    assert right / front == pytest.approx(0.75)


@pytest.mark.parametrize("reported", [-5.0, 0.0, 5.0])
def test_loop_with_unverified_roll_ignores_the_reported_tilt(reported: float) -> None:
    motion = MotionEstimate(RollCheck())
    for step in range(20):
        motion.on_attitude(math.radians(reported), math.radians(reported), 0.0, 0.2 * step)
        motion.on_velocity(0.0, 0.0, 0.0, 0.2 * step)
    assert motion.velocity(4.2) == (0.0, 0.0)
    command = VelocityController(motion).sticks(Demand(Axis(0.5), Axis(0.0)), Limits(35.0, 90.0, 3.0), 3.8)
    assert command is not None
    # The gain, and the drag of 0.5 m/s in calm air.
    assert -math.tan(math.radians(command.pitch_deg)) * G == pytest.approx(CAUTIOUS_GAIN * 0.5, abs=0.02)


@pytest.mark.parametrize("late", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("model", ["4k", "ai"])
def test_step_in_virtual_time_with_unverified_roll_settles(model: str, inverted: bool, late: float) -> None:
    """0 to 3 m/s to the east with the nose to the north, in calm air, until a verdict; it is the right one."""
    bench = Bench(model)
    for setting in (ardrone3.MaxTilt(35.0), ardrone3.MaxRotationSpeed(90.0), ardrone3.MaxVerticalSpeed(3.0)):
        bench.send(setting)
    limits = Limits(35.0, 90.0, 3.0)
    bench.take_off()
    bench.climb(10.0)
    roll_check, unknown = RollCheck(), RollCheck()
    motion = MotionEstimate(unknown)
    controller = VelocityController(motion)
    reports: list[tuple[float, tuple[float, ...]]] = []
    speeds, command, wanted = [], None, 3.0
    for step in range(24 * STEPS):
        bench.turn()
        now, pose = bench.now, bench.pose
        if step % (STEPS // 10) == 0:
            roll = -pose.roll if inverted else pose.roll
            reports.append((now + late, (roll, pose.pitch, pose.yaw, pose.vn, pose.ve, pose.vd)))
        if reports and reports[0][0] <= now:
            _, (roll, pitch, yaw, vn, ve, vd) = reports.pop(0)
            motion.on_attitude(roll, pitch, yaw, now)
            motion.on_velocity(vn, ve, vd, now)
            roll_check.on_attitude(roll, yaw)
            roll_check.on_velocity(vn, ve, now)
            wanted = 3.0 if step % (8 * STEPS) < 4 * STEPS else -3.0
            command = controller.sticks(Demand(Axis(0.0), Axis(wanted), yaw=0.0), limits, now)
        if command is not None and step % (STEPS // 20) == 0:
            bench.send(ardrone3.PCMD(1, *percent(command, limits), 0))
        assert abs(pose.ve) < 4.5
        if step % (4 * STEPS) > 3.25 * STEPS:
            speeds.append(abs(pose.ve - wanted))
    assert max(speeds) < 0.8
    assert roll_check.sign is (RollSign.INVERTED if inverted else RollSign.NORMAL)
