"""The gimbal: frames, rates and bounds by hand against a scripted device, and turned in the simulator."""

from __future__ import annotations

import asyncio
import gc

import pytest
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import gimbal
from anafi_mav.arsdk.messages.gimbal import (
    Axis,
    ControlMode,
    FrameOfReference,
    GimbalCalibrationResult,
    GimbalCalibrationState,
    Model,
)
from anafi_mav.drone import Drone, Range
from anafi_mav.drone.payload.gimbal import Aim
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported

NONE, RELATIVE, ABSOLUTE = FrameOfReference.NONE, FrameOfReference.RELATIVE, FrameOfReference.ABSOLUTE
NAN = float("nan")


def attitude(pitch: float, roll: float = 0.0, id: int = 0) -> gimbal.Attitude:
    """The body stands 10 degrees nose up: what is absolute is 10 more than what is relative."""
    return gimbal.Attitude(id, RELATIVE, ABSOLUTE, ABSOLUTE, 0.0, pitch - 10.0, roll, 90.0, pitch, roll)


REPORTED: list[Message] = [
    gimbal.GimbalCapabilities(0, Model.MAIN, 1 << Axis.PITCH | 1 << Axis.ROLL),
    gimbal.AbsoluteAttitudeBounds(0, 0.0, 0.0, -90.0, 90.0, -38.0, 38.0),
    gimbal.RelativeAttitudeBounds(0, 0.0, 0.0, -100.0, 100.0, -38.0, 38.0),
    gimbal.MaxSpeed(0, 0.0, 0.0, 0.0, 1.0, 180.0, 90.0, 1.0, 180.0, 45.0),
    gimbal.Offsets(0, gimbal.State.INACTIVE, 0.0, 0.0, 0.0, -10.0, 10.0, 1.5, -10.0, 10.0, 0.0),
    gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
    gimbal.Alert(0, 1 << gimbal.Error.OVERLOAD_ERROR | 1 << 7),
    attitude(0.0),
]


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [*STATES, *REPORTED]


async def test_the_state(drone: Drone) -> None:
    state = drone.gimbal[0]
    assert state.axes == frozenset({Axis.PITCH, Axis.ROLL})
    assert state.max_speed[Axis.PITCH] == Range(90.0, 1.0, 180.0)
    assert state.absolute_bounds[Axis.PITCH] == (-90.0, 90.0)
    assert state.offsets[Axis.PITCH] == Range(1.5, -10.0, 10.0)
    assert state.errors == frozenset({gimbal.Error.OVERLOAD_ERROR})
    assert state.attitude is not None
    assert state.attitude.relative.pitch == -10.0
    assert state.attitude.absolute.yaw == 90.0
    assert state.attitude.frames[Axis.YAW] == RELATIVE


async def test_an_attitude_that_is_no_number_is_none(device: ScriptedDevice, drone: Drone) -> None:
    heard = asyncio.ensure_future(drone.expect(gimbal.Attitude))
    await asyncio.sleep(0)
    device.say(attitude(NAN))
    await heard
    assert drone.gimbal[0].attitude is None


async def test_aim_is_clipped_to_its_frame_and_keeps_other_axes(device: ScriptedDevice, drone: Drone) -> None:
    drone.gimbal.aim(pitch=Aim(-95.0), roll=Aim(50.0, RELATIVE))
    drone.gimbal.aim(pitch=Aim(-95.0, RELATIVE))
    await device.until(gimbal.SetTarget, 2)
    assert device.got(gimbal.SetTarget) == [
        gimbal.SetTarget(0, ControlMode.POSITION, NONE, 0.0, ABSOLUTE, -90.0, RELATIVE, 38.0),
        gimbal.SetTarget(0, ControlMode.POSITION, NONE, 0.0, RELATIVE, -95.0, NONE, 0.0),
    ]


async def test_a_rate_is_sent_as_the_share_of_the_axis_own_speed(device: ScriptedDevice, drone: Drone) -> None:
    drone.gimbal.turn(pitch=Aim(-22.5), roll=Aim(22.5))
    drone.gimbal.turn(pitch=Aim(500.0, RELATIVE))
    await device.until(gimbal.SetTarget, 2)
    assert device.got(gimbal.SetTarget) == [
        gimbal.SetTarget(0, ControlMode.VELOCITY, NONE, 0.0, ABSOLUTE, -0.25, ABSOLUTE, 0.5),
        gimbal.SetTarget(0, ControlMode.VELOCITY, NONE, 0.0, RELATIVE, 1.0, NONE, 0.0),
    ]


async def test_wrong_targets(drone: Drone) -> None:
    with pytest.raises(NotSupported, match="yaw"):
        drone.gimbal.aim(yaw=Aim(1.0))
    with pytest.raises(NotSupported, match="yaw"):
        drone.gimbal.turn(yaw=Aim(1.0))
    with pytest.raises(NotSupported, match="gimbal 1"):
        drone.gimbal.aim(pitch=Aim(1.0), id=1)
    for aim in (Aim(NAN), Aim(1.0, NONE)):
        with pytest.raises(LocalProtocolError):
            drone.gimbal.aim(pitch=aim)
        with pytest.raises(LocalProtocolError):
            drone.gimbal.turn(pitch=aim)
    await drone.close()
    with pytest.raises(LinkLost):
        drone.gimbal.aim(pitch=Aim(1.0))


async def test_point_repeats_a_lost_target_until_the_attitude_shows_it(device: ScriptedDevice, drone: Drone) -> None:
    sent = 0

    def answer(_: gimbal.SetTarget) -> list[Message]:
        nonlocal sent
        sent += 1
        return [attitude(0.0)] if sent == 1 else [attitude(29.0), attitude(30.2)]

    device.script[gimbal.SetTarget] = answer
    reached = await drone.gimbal.point(pitch=Aim(30.0))
    assert reached.absolute.pitch == pytest.approx(30.2)
    assert sent == 2


async def test_point_gives_up_when_it_does_not_come_or_another_target_does(drone: Drone) -> None:
    with pytest.raises(CommandTimeout):
        await drone.gimbal.point(pitch=Aim(30.0), timeout=0.2)
    waiting = asyncio.ensure_future(drone.gimbal.point(pitch=Aim(30.0)))
    await asyncio.sleep(0)
    drone.gimbal.aim(pitch=Aim(0.0))
    with pytest.raises(CommandRejected, match="newer"):
        await waiting


async def test_stop_is_confirmed_while_the_drone_turns(device: ScriptedDevice, drone: Drone) -> None:
    """This gimbal has no yaw axis: whatever frame is reported for it, its absolute angle is the drone's heading."""

    def turning(_: gimbal.SetTarget) -> list[Message]:
        return [
            gimbal.Attitude(0, NONE, ABSOLUTE, ABSOLUTE, 0.0, -30.0, 0.0, 20.0 * step, -20.0, 0.0) for step in range(4)
        ]

    device.script[gimbal.SetTarget] = turning
    assert (await drone.gimbal.stop(timeout=0.5)).absolute.pitch == -20.0


async def test_settings_and_offsets(device: ScriptedDevice, drone: Drone) -> None:
    device.script[gimbal.SetMaxSpeed] = lambda m: [
        gimbal.MaxSpeed(1, 0, 0, 0, 1.0, 2.0, 2.0, 0, 0, 0),  # another gimbal's
        gimbal.MaxSpeed(0, 0, 0, 0, 1.0, 180.0, 180.0, 1.0, 180.0, 180.0),
    ]
    assert (await drone.gimbal.set_max_speed(999.0))[Axis.PITCH].current == 180.0
    device.script[gimbal.StartOffsetsUpdate] = lambda _: [
        gimbal.Offsets(0, gimbal.State.ACTIVE, 0, 0, 0, -10.0, 10.0, 1.5, -10.0, 10.0, 0.0)
    ]
    device.script[gimbal.SetOffsets] = lambda m: [
        gimbal.Offsets(0, gimbal.State.ACTIVE, 0, 0, 0, -10.0, 10.0, m.pitch, -10.0, 10.0, m.roll)
    ]
    assert await drone.gimbal.open_offsets(True)
    offsets = await drone.gimbal.set_offsets(roll=2.0)
    assert (offsets[Axis.PITCH].current, offsets[Axis.ROLL].current) == (1.5, 2.0)
    for call in (drone.gimbal.set_max_speed(NAN), drone.gimbal.set_offsets(pitch=NAN)):
        with pytest.raises(LocalProtocolError):
            await call


@pytest.mark.parametrize("result", list(GimbalCalibrationResult))
async def test_calibration(device: ScriptedDevice, drone: Drone, result: GimbalCalibrationResult) -> None:
    device.script[gimbal.Calibrate] = lambda _: [
        gimbal.CalibrationState(GimbalCalibrationState.IN_PROGRESS, 0),
        gimbal.CalibrationResult(1, GimbalCalibrationResult.FAILURE),  # another gimbal's
        gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
        gimbal.CalibrationResult(0, result),
    ]
    if result is GimbalCalibrationResult.SUCCESS:
        await drone.gimbal.calibrate()
    else:
        with pytest.raises(CommandRejected, match=result.name.lower()):
            await drone.gimbal.calibrate()
    assert drone.gimbal[0].calibration_result == result


async def test_started_calibration_is_waited_for_and_cancelled(device: ScriptedDevice, drone: Drone) -> None:
    working = gimbal.CalibrationState(GimbalCalibrationState.IN_PROGRESS, 0)
    device.script[gimbal.Calibrate] = lambda _: [working]
    ended = gimbal.CalibrationState(GimbalCalibrationState.OK, 0)
    device.script[gimbal.CancelCalibration] = lambda _: [
        ended,
        gimbal.CalibrationResult(0, GimbalCalibrationResult.CANCELED),
    ]
    calibration = await drone.gimbal.start_calibration()
    await drone.gimbal.cancel_calibration()
    with pytest.raises(CommandRejected, match="canceled"):
        await calibration.done()
    calibration = await drone.gimbal.start_calibration(timeout=0.1)
    with pytest.raises(CommandTimeout):
        await calibration.done()
    failed = [ended, gimbal.CalibrationResult(0, GimbalCalibrationResult.FAILURE)]
    device.script[gimbal.Calibrate] = lambda _: failed
    with pytest.raises(CommandRejected, match="failure"):
        await drone.gimbal.start_calibration()


async def test_end_of_a_calibration_that_nothing_waits_for_is_no_error(
    device: ScriptedDevice, drone: Drone, caplog: pytest.LogCaptureFixture
) -> None:
    device.script[gimbal.Calibrate] = lambda _: [gimbal.CalibrationState(GimbalCalibrationState.IN_PROGRESS, 0)]
    device.script[gimbal.CancelCalibration] = lambda _: [
        gimbal.CalibrationResult(0, GimbalCalibrationResult.CANCELED),
        gimbal.CalibrationState(GimbalCalibrationState.OK, 0),
    ]
    await drone.gimbal.start_calibration()
    await drone.gimbal.cancel_calibration()
    gc.collect()
    assert [record.getMessage() for record in caplog.records] == []


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_in_the_simulator(model: str) -> None:
    async with connected(model) as (drone, _):
        assert drone.gimbal[0].axes == frozenset(Axis) - (frozenset() if model == "ai" else {Axis.YAW})
        assert set(drone.gimbal.state) == ({0, 1} if model == "ai" else {0})
        speeds = await drone.gimbal.set_max_speed(60.0)
        assert speeds[Axis.PITCH].current == 60.0
        there = await drone.gimbal.point(pitch=Aim(-45.0))
        assert there.absolute.pitch == pytest.approx(-45.0, abs=0.5)
        if model == "ai":
            there = await drone.gimbal.point(yaw=Aim(20.0, RELATIVE))
            assert there.relative.yaw == pytest.approx(20.0, abs=0.5)
        began = asyncio.get_running_loop().time()
        drone.gimbal.turn(pitch=Aim(30.0))
        await drone.expect(gimbal.Attitude, lambda m: m.gimbal_id == 0 and m.pitch_absolute > -20.0)
        # 25 degrees at 30 deg/s, five times faster
        assert 0.1 < asyncio.get_running_loop().time() - began < 1.0
        stopped = await drone.gimbal.stop()
        assert stopped.absolute.pitch < 60.0
        back = await drone.gimbal.reset_orientation()
        assert back.absolute.pitch == pytest.approx(0.0, abs=0.5)
        await drone.gimbal.calibrate()
        await drone.gimbal.cancel_calibration()


async def test_report_of_before_a_change_of_the_speed_is_not_its_answer() -> None:
    async with connected("4k") as (drone, simulator):
        change = asyncio.ensure_future(drone.gimbal.set_max_speed(33.3))
        await asyncio.sleep(0)
        simulator.inject(gimbal.MaxSpeed(0, *(1.0, 180.0, 60.0) * 3))  # as it was
        assert (await change)[Axis.PITCH].current == pytest.approx(33.3)


async def test_offsets_of_two_axes_set_at_once_are_both_kept() -> None:
    async with connected("4k") as (drone, simulator):
        await drone.gimbal.open_offsets(True)
        await asyncio.gather(drone.gimbal.set_offsets(pitch=1.5), drone.gimbal.set_offsets(roll=2.0))
        sent = [entry.args for entry in simulator.log if entry.name == gimbal.SetOffsets.NAME]
        assert [(one["pitch"], one["roll"]) for one in sent] == [(1.5, 0.0), (1.5, 2.0)]
