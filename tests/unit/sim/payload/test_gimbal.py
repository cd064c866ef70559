"""The simulated gimbals: targets in both frames and modes, limits, offsets, calibration, by hand."""

from __future__ import annotations

import math

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import gimbal
from anafi_mav.arsdk.messages.gimbal import (
    Axis,
    ControlMode,
    FrameOfReference,
    GimbalCalibrationResult,
    GimbalCalibrationState,
    State,
)

NONE, RELATIVE, ABSOLUTE = FrameOfReference.NONE, FrameOfReference.RELATIVE, FrameOfReference.ABSOLUTE
POSITION, VELOCITY = ControlMode.POSITION, ControlMode.VELOCITY


@pytest.fixture
def bench() -> Bench:
    return Bench()


def target(
    mode: ControlMode = POSITION,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    frames: tuple[FrameOfReference, FrameOfReference, FrameOfReference] = (NONE, ABSOLUTE, NONE),
    id: int = 0,
) -> gimbal.SetTarget:
    return gimbal.SetTarget(id, mode, frames[0], yaw, frames[1], pitch, frames[2], roll)


def look(bench: Bench, id: int = 0) -> gimbal.Attitude:
    bench.firmware.gimbal.advance(bench.firmware.time)
    return bench.firmware.gimbal.attitude(bench.pose, id)


def report(bench: Bench, kind: type[Message]) -> list[Message]:
    return [m for m in bench.firmware.gimbal.states_report(bench.pose) if type(m) is kind]


def test_a_position_is_reached_at_the_speed_that_is_set(bench: Bench) -> None:
    assert bench.send(gimbal.SetMaxSpeed(0, 1.0, 60.0, 2.0)) == [
        # Yaw does not turn; the speed of pitch counts for all, as Parrot's XML says.
        gimbal.MaxSpeed(0, 0.0, 0.0, 0.0, 1.0, 180.0, 60.0, 1.0, 180.0, 60.0)
    ]
    assert bench.send(target(pitch=-45.0)) == []
    bench.run(0.5)
    assert look(bench).pitch_absolute == pytest.approx(-30.0, abs=1.0)
    bench.run(0.5)
    assert look(bench).pitch_absolute == -45.0
    bench.send(target(pitch=-120.0))
    bench.run(2.0)
    assert look(bench).pitch_absolute == -90.0


def test_speed_has_limits(bench: Bench) -> None:
    def speed(value: float) -> float:
        answer = bench.send(gimbal.SetMaxSpeed(0, 0.0, value, 0.0))[0]
        assert isinstance(answer, gimbal.MaxSpeed)
        return answer.current_pitch

    assert (speed(0.0), speed(500.0), speed(math.nan)) == (1.0, 180.0, 180.0)


def test_a_velocity_is_a_share_of_the_speed_and_holds(bench: Bench) -> None:
    bench.send(gimbal.SetMaxSpeed(0, 0.0, 40.0, 0.0))
    bench.send(target(VELOCITY, pitch=-0.5))
    bench.run(1.0)
    assert look(bench).pitch_absolute == pytest.approx(-20.0, abs=0.5)
    bench.send(target(VELOCITY, pitch=-7.0))
    bench.run(1.0)
    assert look(bench).pitch_absolute == pytest.approx(-60.0, abs=0.5)
    bench.run(5.0)
    assert look(bench).pitch_absolute == -90.0
    bench.send(target(VELOCITY, pitch=0.5))
    bench.run(1.0)
    bench.send(target(VELOCITY, pitch=0.0))
    stopped = look(bench).pitch_absolute
    assert stopped == pytest.approx(-70.0, abs=0.5)
    bench.run(1.0)
    assert look(bench).pitch_absolute == stopped


def test_absolute_keeps_the_horizon_and_relative_the_body(bench: Bench) -> None:
    bench.take_off()
    bench.send(target(pitch=-10.0, roll=5.0, frames=(NONE, ABSOLUTE, ABSOLUTE)))
    bench.sticks(1.5, pitch=100)
    nose = math.degrees(bench.pose.pitch)
    assert nose == pytest.approx(-10.0, abs=1.0)  # MaxTilt of the factory
    seen = look(bench)
    assert (seen.pitch_absolute, seen.roll_absolute) == (-10.0, 5.0)
    assert seen.pitch_relative == pytest.approx(-10.0 - nose)
    assert seen.roll_relative == pytest.approx(5.0 - math.degrees(bench.pose.roll))
    assert seen.yaw_absolute == pytest.approx(math.degrees(bench.pose.yaw))
    bench.send(target(pitch=-10.0, frames=(NONE, RELATIVE, NONE)))
    bench.sticks(1.5, pitch=100)
    seen = look(bench)
    assert (seen.pitch_frame_of_reference, seen.roll_frame_of_reference) == (RELATIVE, ABSOLUTE)
    assert seen.pitch_relative == -10.0
    assert seen.pitch_absolute == pytest.approx(-10.0 + math.degrees(bench.pose.pitch))


def test_a_change_of_frame_does_not_make_it_jump(bench: Bench) -> None:
    bench.take_off()
    bench.sticks(1.5, pitch=100)
    before = look(bench)
    bench.send(target(VELOCITY, pitch=0.0, frames=(NONE, RELATIVE, NONE)))
    assert look(bench).pitch_absolute == pytest.approx(before.pitch_absolute, abs=0.01)


def test_invalid_gimbal_target_changes_nothing(bench: Bench) -> None:
    bench.send(target(pitch=-30.0))
    bench.run(1.0)
    for odd in (
        target(pitch=math.nan),
        target(pitch=20.0, frames=(NONE, NONE, NONE)),
        target(pitch=20.0, frames=(NONE, FrameOfReference(9), NONE)),
        target(ControlMode(9), pitch=20.0),
        target(yaw=20.0, pitch=-30.0, frames=(ABSOLUTE, ABSOLUTE, NONE)),
        target(pitch=20.0, id=4),
    ):
        assert bench.send(odd) == []
    bench.run(1.0)
    assert look(bench).pitch_absolute == -30.0
    assert look(bench).yaw_relative == 0.0


def test_reset_keeps_the_frames(bench: Bench) -> None:
    bench.send(target(pitch=-30.0, roll=20.0, frames=(NONE, RELATIVE, ABSOLUTE)))
    bench.run(1.0)
    assert bench.send(gimbal.ResetOrientation(0)) == []
    bench.run(1.0)
    seen = look(bench)
    assert (seen.pitch_frame_of_reference, seen.pitch_relative) == (RELATIVE, 0.0)
    assert (seen.roll_frame_of_reference, seen.roll_absolute) == (ABSOLUTE, 0.0)


def test_offsets_are_set_while_they_are_being_set(bench: Bench) -> None:
    def offsets(command: Message) -> tuple[State, float, float, float]:
        answer = bench.send(command)[0]
        assert isinstance(answer, gimbal.Offsets)
        return answer.update_state, answer.current_yaw, answer.current_pitch, answer.current_roll

    assert offsets(gimbal.SetOffsets(0, 1.0, 2.0, 3.0)) == (State.INACTIVE, 0.0, 0.0, 0.0)
    assert offsets(gimbal.StartOffsetsUpdate(0)) == (State.ACTIVE, 0.0, 0.0, 0.0)
    assert offsets(gimbal.SetOffsets(0, 1.0, 2.0, -99.0)) == (State.ACTIVE, 0.0, 2.0, -10.0)
    assert offsets(gimbal.StopOffsetsUpdate(0)) == (State.INACTIVE, 0.0, 2.0, -10.0)


def test_calibration_on_the_ground_only(bench: Bench) -> None:
    assert bench.send(gimbal.Calibrate(0)) == [gimbal.CalibrationState(GimbalCalibrationState.IN_PROGRESS, 0)]
    bench.send(target(pitch=-30.0))  # no one turns it meanwhile
    bench.run_until(lambda: bool(bench.of(gimbal.CalibrationResult)))
    assert bench.events[-2:] == [
        gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
        gimbal.CalibrationResult(0, GimbalCalibrationResult.SUCCESS),
    ]
    assert look(bench).pitch_absolute == 0.0
    bench.send(gimbal.Calibrate(0))
    assert bench.send(gimbal.CancelCalibration(0)) == [
        gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
        gimbal.CalibrationResult(0, GimbalCalibrationResult.CANCELED),
    ]
    bench.take_off()
    assert bench.send(gimbal.Calibrate(0)) == [
        gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
        gimbal.CalibrationResult(0, GimbalCalibrationResult.FAILURE),
    ]


@pytest.mark.parametrize("model", ["4k", "thermal", "usa"])
def test_axes_of_the_older_models(model: str) -> None:
    bench = Bench(model)
    assert report(bench, gimbal.GimbalCapabilities) == [
        gimbal.GimbalCapabilities(0, gimbal.Model.MAIN, 1 << Axis.PITCH | 1 << Axis.ROLL)
    ]
    assert report(bench, gimbal.AbsoluteAttitudeBounds) == [
        gimbal.AbsoluteAttitudeBounds(0, 0.0, 0.0, -90.0, 90.0, -38.0, 38.0)
    ]


def test_an_ai_has_two_and_the_first_turns_every_way() -> None:
    bench = Bench("ai")
    axes = [
        (m.model, m.axes) for m in report(bench, gimbal.GimbalCapabilities) if isinstance(m, gimbal.GimbalCapabilities)
    ]
    assert axes == [(gimbal.Model.MAIN, 0b111), (gimbal.Model.FSTCAM, 1 << Axis.PITCH)]
    bench.send(target(yaw=30.0, pitch=170.0, frames=(RELATIVE, ABSOLUTE, NONE)))
    bench.send(target(pitch=-20.0, id=1))
    bench.run(3.0)
    assert (look(bench).yaw_relative, look(bench).pitch_absolute) == pytest.approx((30.0, 170.0))
    assert (look(bench).yaw_absolute, look(bench, 1).pitch_absolute) == pytest.approx((30.0, -20.0))
    bench.send(target(yaw=90.0, pitch=-170.0, frames=(RELATIVE, ABSOLUTE, NONE)))
    bench.run(5.0)
    assert (look(bench).yaw_relative, look(bench).pitch_absolute) == pytest.approx((48.0, -116.0))


def test_absolute_yaw_is_to_north_and_ends_at_the_range_of_the_body() -> None:
    bench = Bench("ai")
    bench.take_off()
    while math.degrees(bench.pose.yaw) < 90.0:
        bench.sticks(0.1, yaw=50)
    bench.run(2.0)
    heading = math.degrees(bench.pose.yaw)
    bench.send(target(yaw=heading - 30.0, frames=(ABSOLUTE, NONE, NONE)))
    bench.run(2.0)
    assert (look(bench).yaw_absolute, look(bench).yaw_relative) == pytest.approx((heading - 30.0, -30.0), abs=0.01)
    bench.sticks(1.0, yaw=-15)  # the nose turns left under the camera, which keeps its direction
    bench.run(2.0)
    turned = math.degrees(bench.pose.yaw)
    assert turned < heading - 5.0
    assert look(bench).yaw_absolute == pytest.approx(heading - 30.0, abs=0.01)
    bench.send(target(yaw=turned - 100.0, frames=(ABSOLUTE, NONE, NONE)))
    bench.run(3.0)
    assert look(bench).yaw_relative == pytest.approx(-48.0)
    bench.send(target(VELOCITY, yaw=0.1, frames=(ABSOLUTE, NONE, NONE)))
    bench.run(1.0)
    assert look(bench).yaw_relative == pytest.approx(-39.0, abs=1.0)  # 0.1 of 90 deg/s, at once
