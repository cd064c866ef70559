"""The sign of the reported roll: by hand, sample by sample, and flown in virtual time.

5 degrees of roll push with 9.81 * tan 5 = 0.86 m/s2: 0.17 m/s in each interval of 0.2 s.
"""

from __future__ import annotations

import math

import pytest
from sim_bench import Bench

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.drone import Limits
from anafi_mav.drone.sticks import percent
from anafi_mav.services.offboard_control import (
    CAUTIOUS_GAIN,
    CAUTIOUS_TILT,
    Axis,
    Controller,
    Demand,
    G,
    Motion,
)
from anafi_mav.services.roll_sign import ODDS, SAMPLES, RollCheck, Sign
from anafi_mav.services.roll_sign_service import read, written

PUSH = G * math.tan(math.radians(5.0)) * 0.2
"""m/s that 5 degrees give in an interval."""


class Flight:
    """Reports to a check, five times a second."""

    def __init__(self, check: RollCheck, yaw: float = 0.0) -> None:
        self.check, self.yaw, self.now = check, math.radians(yaw), 0.0
        self.right = 0.0

    def lean(self, degrees: float, change: float, times: int = 1) -> bool:
        """Report a roll, and a speed to the right that changes by so much in each interval. True on a verdict."""
        verdict = False
        for _ in range(times):
            self.now += 0.2
            self.right += change
            self.check.on_attitude(math.radians(degrees), self.yaw)
            north, east = -math.sin(self.yaw) * self.right, math.cos(self.yaw) * self.right
            verdict = self.check.on_velocity(north, east, self.now) or verdict
        return verdict


@pytest.mark.parametrize("yaw", [0.0, 90.0, 200.0])
@pytest.mark.parametrize("sign", [Sign.RIGHT, Sign.LEFT])
@pytest.mark.parametrize("side", [1, -1])
def test_roll_check_after_twenty_samples_of_one_sign_knows_it(yaw: float, sign: Sign, side: int) -> None:
    check = RollCheck()
    flight = Flight(check, yaw)
    change = PUSH * side * (1 if sign is Sign.RIGHT else -1)
    assert not flight.lean(5.0 * side, change, SAMPLES)  # the first report begins the first interval
    assert check.sign is Sign.UNKNOWN
    assert flight.lean(5.0 * side, change)
    assert check.sign is sign
    assert (check.trusted, check.inverted) == (sign is Sign.RIGHT, sign is Sign.LEFT)


def test_roll_check_with_odds_below_three_to_one_waits() -> None:
    check = RollCheck()
    flight = Flight(check)
    flight.lean(5.0, PUSH)
    assert not flight.lean(5.0, -PUSH, 6)
    assert not flight.lean(5.0, PUSH, 6 * ODDS - 1)
    assert check.sign is Sign.UNKNOWN
    assert flight.lean(5.0, PUSH)
    assert check.sign is Sign.RIGHT


@pytest.mark.parametrize(
    ("degrees", "change"),
    [
        pytest.param(3.9, PUSH, id="level"),
        pytest.param(20.0, 0.05, id="drag and lean in balance"),
    ],
)
def test_roll_check_with_what_says_nothing_learns_nothing(degrees: float, change: float) -> None:
    check = RollCheck()
    assert not Flight(check).lean(degrees, change, 200)
    assert check.sign is Sign.UNKNOWN


def test_roll_check_leaves_out_intervals_with_a_lean_to_both_sides_or_a_gap() -> None:
    check = RollCheck()
    flight = Flight(check)
    for _ in range(100):
        flight.lean(5.0, PUSH)
        flight.lean(-5.0, PUSH)
    for _ in range(100):
        flight.lean(5.0, PUSH)
        flight.now += 1.0
    check.forget_motion()
    assert not check.on_velocity(1.0, 1.0, flight.now)
    assert check.sign is Sign.UNKNOWN


def test_roll_check_corrects_a_verdict_that_later_samples_contradict() -> None:
    check = RollCheck(Sign.LEFT)
    flight = Flight(check)
    flight.lean(5.0, PUSH)
    assert flight.lean(5.0, PUSH, SAMPLES)
    assert check.sign is Sign.RIGHT


@pytest.mark.parametrize("kept", [None, 3, {}, {"firmware": "1.8.2"}, {"firmware": "1.8.2", "inverted": "no"}])
def test_roll_record_that_is_none_is_not_read(kept: object) -> None:
    assert read(kept, "1.8.2") is Sign.UNKNOWN


@pytest.mark.parametrize("sign", [Sign.RIGHT, Sign.LEFT])
def test_roll_record_counts_for_its_firmware_only(sign: Sign) -> None:
    kept = written("1.8.2", sign)
    assert read(kept, "1.8.2") is sign
    assert read(kept, "1.8.3") is Sign.UNKNOWN
    assert read(kept, None) is Sign.UNKNOWN


# The loop until the sign is known.


def test_loop_with_unverified_roll_leans_by_ten_degrees_at_most() -> None:
    motion = Motion(RollCheck())
    motion.on_attitude(0.0, 0.0, 0.0, 0.0)
    motion.on_velocity(0.0, 0.0, 0.0, 0.0)
    command = Controller(motion).sticks(Demand(Axis(12.0), Axis(9.0)), Limits(35.0, 90.0, 3.0), 0.0)
    assert command is not None
    front, right = math.tan(math.radians(-command.pitch_deg)), math.tan(math.radians(command.roll_deg))
    assert math.atan(math.hypot(front, right)) == pytest.approx(CAUTIOUS_TILT)
    assert right / front == pytest.approx(0.75)


@pytest.mark.parametrize("reported", [-5.0, 0.0, 5.0])
def test_loop_with_unverified_roll_does_not_use_the_reported_tilt(reported: float) -> None:
    motion = Motion(RollCheck())
    for step in range(20):
        motion.on_attitude(math.radians(reported), math.radians(reported), 0.0, 0.2 * step)
        motion.on_velocity(0.0, 0.0, 0.0, 0.2 * step)
    assert motion.velocity(4.2) == (0.0, 0.0)
    command = Controller(motion).sticks(Demand(Axis(0.5), Axis(0.0)), Limits(35.0, 90.0, 3.0), 3.8)
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
    motion = Motion(unknown)
    controller = Controller(motion)
    reports: list[tuple[float, tuple[float, ...]]] = []
    speeds, command, wanted = [], None, 3.0
    for tick in range(4800):
        bench.turn()
        now, pose = bench.now, bench.pose
        if tick % 20 == 0:
            roll = -pose.roll if inverted else pose.roll
            reports.append((now + late, (roll, pose.pitch, pose.yaw, pose.vn, pose.ve, pose.vd)))
        if reports and reports[0][0] <= now:
            _, (roll, pitch, yaw, vn, ve, vd) = reports.pop(0)
            motion.on_attitude(roll, pitch, yaw, now)
            motion.on_velocity(vn, ve, vd, now)
            roll_check.on_attitude(roll, yaw)
            roll_check.on_velocity(vn, ve, now)
            wanted = 3.0 if tick % 1600 < 800 else -3.0
            command = controller.sticks(Demand(Axis(0.0), Axis(wanted), yaw=0.0), limits, now)
        if command is not None and tick % 5 == 0:
            bench.send(ardrone3.PCMD(1, *percent(command, limits), 0))
        assert abs(pose.ve) < 4.5
        if tick % 800 > 650:
            speeds.append(abs(pose.ve - wanted))
    assert max(speeds) < 0.8
    assert roll_check.sign is (Sign.LEFT if inverted else Sign.RIGHT)
