"""Points of interest, follow me, the beep, the magnetometer and the reboot: in the simulator, and scripted."""

from __future__ import annotations

import asyncio
import math

import pytest
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected, take_off

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, controller_info, follow_me
from anafi_mav.arsdk.messages.ardrone3 import PoiMode, PoiStatus
from anafi_mav.arsdk.messages.common import CalibrationAxis
from anafi_mav.drone import Drone, Position
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported

PLACE = (48.8795, 2.3680, 3.0)


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [
        *STATES,
        ardrone3.PilotedPOIV2(500.0, 500.0, 500.0, PoiMode.LOCKED_GIMBAL, PoiStatus.AVAILABLE),
        follow_me.State(follow_me.Mode.NONE, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0),
        # All but image detection (6) and drone high enough (5) are there: a bit is an input that is ok.
        follow_me.ModeInfo(follow_me.Mode.LOOK_AT, 0b1_1001_1111, 0b1_1111_1111),
        common.MagnetoCalibrationStartedChanged(0),
    ]


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_a_point_of_interest(model: str) -> None:
    async with connected(model) as (drone, _):
        with pytest.raises(CommandRejected):
            await drone.poi.start(*PLACE)
        assert (drone.poi.state.missing is None) == (model == "4k")
        await take_off(drone)
        if drone.poi.state.status != PoiStatus.AVAILABLE:
            await drone.expect(ardrone3.PilotedPOIV2, lambda m: m.status == PoiStatus.AVAILABLE)
        await drone.poi.start(*PLACE, PoiMode.FREE_GIMBAL)
        assert drone.poi.state.target == Position(*PLACE)
        assert drone.poi.state.mode == PoiMode.FREE_GIMBAL
        await drone.poi.stop()
        assert drone.poi.state.status == PoiStatus.AVAILABLE
        await drone.poi.stop()
        with pytest.raises(LocalProtocolError):
            await drone.poi.start(500.0, 500.0, 0.0)


async def test_unanswered_poi_is_withdrawn(device: ScriptedDevice, drone: Drone) -> None:
    # An event about another point is no answer.
    device.script[ardrone3.StartPilotedPOIV2] = lambda _: [
        ardrone3.PilotedPOIV2(1.0, 1.0, 1.0, PoiMode.LOCKED_GIMBAL, PoiStatus.RUNNING)
    ]
    with pytest.raises(CommandTimeout):
        await drone.poi.start(*PLACE, timeout=0.2)
    await device.until(ardrone3.StopPilotedPOI)


async def test_follow_me(device: ScriptedDevice, drone: Drone) -> None:
    with pytest.raises(CommandRejected, match="drone high enough, image detection"):
        await drone.follow_me.start(follow_me.Mode.LOOK_AT, timeout=0.2)
    await device.until(follow_me.Stop)
    with pytest.raises(NotSupported, match="leash"):
        await drone.follow_me.start(follow_me.Mode.LEASH)
    with pytest.raises(LocalProtocolError):
        await drone.follow_me.start(follow_me.Mode.NONE)
    assert drone.follow_me.state.improvements == {follow_me.Mode.LOOK_AT: frozenset()}
    # It has taken the mode and waits for what it lacks: that is no success, and is withdrawn.
    device.script[follow_me.Start] = lambda m: [
        follow_me.State(m.mode, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0)
    ]
    with pytest.raises(CommandRejected, match="drone high enough, image detection"):
        await drone.follow_me.start(follow_me.Mode.LOOK_AT)
    await device.until(follow_me.Stop, 2)
    device.script[follow_me.Start] = lambda m: [
        follow_me.State(m.mode, follow_me.Behavior.LOOK_AT, follow_me.Animation.NONE, 0),
        follow_me.TargetTrajectory(48.0, 2.0, 40.0, 1.0, 2.0, 0.0),
    ]
    await drone.follow_me.start(follow_me.Mode.LOOK_AT)
    if drone.follow_me.state.target is None:
        await drone.expect(follow_me.TargetTrajectory)
    assert drone.follow_me.state.behavior == follow_me.Behavior.LOOK_AT
    assert drone.follow_me.state.target is not None
    assert drone.follow_me.state.target.position == Position(48.0, 2.0, 40.0)
    device.script[follow_me.Stop] = lambda _: [
        follow_me.State(follow_me.Mode.NONE, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0)
    ]
    await drone.follow_me.stop()
    stops = len(device.got(follow_me.Stop))
    await drone.follow_me.stop()
    assert len(device.got(follow_me.Stop)) == stops


async def test_follow_target_is_sent(device: ScriptedDevice, drone: Drone) -> None:
    drone.follow_me.tell_target(Position(48.0, 2.0, 40.0), (1.0, 2.0, -0.5), 3.0)
    observed = await device.until(controller_info.Gps)
    assert (observed.latitude, observed.longitude, observed.altitude) == (48.0, 2.0, 40.0)
    assert (observed.north_speed, observed.east_speed, observed.down_speed) == (1.0, 2.0, -0.5)
    assert (observed.horizontal_accuracy, observed.vertical_accuracy) == (3.0, 3.0)
    with pytest.raises(LocalProtocolError):
        drone.follow_me.tell_target(Position(48.0, 2.0, math.nan))


async def test_the_beep() -> None:
    async with connected("4k") as (drone, _):
        await drone.sound.start()
        observed = [drone.sound.state.playing]
        await drone.sound.stop()
        observed.append(drone.sound.state.playing)
        assert observed == [True, False]


async def test_the_magnetometer() -> None:
    async with connected("4k") as (drone, _):
        await drone.calibration.magnetometer_done()
        await drone.calibration.start_magnetometer()
        assert drone.calibration.state.started
        await drone.calibration.magnetometer_done()
        assert drone.calibration.state.done == frozenset(CalibrationAxis) - {CalibrationAxis.NONE}
        await drone.calibration.start_magnetometer()
        await drone.calibration.abort_magnetometer()
        assert not drone.calibration.state.started


async def test_magnetometer_calibration_without_turns_fails(device: ScriptedDevice, drone: Drone) -> None:
    device.script[common.MagnetoCalibration] = lambda _: [common.MagnetoCalibrationStartedChanged(1)]
    await drone.calibration.start_magnetometer()
    with pytest.raises(CommandTimeout):
        await drone.calibration.magnetometer_done(timeout=0.2)
    done = asyncio.ensure_future(drone.calibration.magnetometer_done())
    await asyncio.sleep(0)
    device.say(
        common.MagnetoCalibrationStateChanged(1, 0, 0, 0),
        common.MagnetoCalibrationStateChanged(1, 0, 0, 1),
    )
    with pytest.raises(CommandRejected, match="failed"):
        await done
    assert drone.calibration.state.done == frozenset({CalibrationAxis.X_AXIS})


NO_AXIS, ONE_AXIS, TWO_AXES, ALL_AXES = (
    common.MagnetoCalibrationStateChanged(*axes, 0) for axes in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))
)
FAILED_AXES = common.MagnetoCalibrationStateChanged(1, 0, 0, 1)
STOPPED = common.MagnetoCalibrationStartedChanged(0)


@pytest.mark.parametrize(
    ("reports", "is_success"),
    [
        ([ALL_AXES, STOPPED], True),
        ([STOPPED, ALL_AXES], True),
        ([STOPPED], True),
        ([STOPPED, common.MagnetoCalibrationRequiredState(1)], False),
        ([NO_AXIS, STOPPED], False),
        ([ONE_AXIS, STOPPED], False),
        ([TWO_AXES, STOPPED, ALL_AXES], True),
        ([NO_AXIS, STOPPED, ALL_AXES], False),  # aborted: those of the calibration before
        ([ONE_AXIS, STOPPED, ALL_AXES], False),
        ([STOPPED, FAILED_AXES], False),
    ],
)
async def test_end_of_a_magnetometer_calibration_is_a_success_unless_it_lacks_an_axis(
    device: ScriptedDevice, drone: Drone, reports: list[Message], is_success: bool
) -> None:
    device.script[common.MagnetoCalibration] = lambda _: [common.MagnetoCalibrationStartedChanged(1)]
    await drone.calibration.start_magnetometer()
    done = asyncio.ensure_future(drone.calibration.magnetometer_done())
    device.say(*reports)  # received in a later event-loop iteration than the first step of `done`
    if is_success:
        await done
    else:
        with pytest.raises(CommandRejected, match="failed"):
            await done


async def test_failure_of_an_earlier_magnetometer_calibration_is_none_of_the_next_one(
    device: ScriptedDevice, drone: Drone
) -> None:
    device.script[common.MagnetoCalibration] = lambda _: [common.MagnetoCalibrationStartedChanged(1)]
    device.say(FAILED_AXES)
    await drone.calibration.start_magnetometer()
    done = asyncio.ensure_future(drone.calibration.magnetometer_done())
    device.say(common.MagnetoCalibrationAxisToCalibrateChanged(CalibrationAxis.X_AXIS), NO_AXIS, ALL_AXES, STOPPED)
    await done


async def test_a_reboot_is_confirmed_by_the_lost_link(device: ScriptedDevice, drone: Drone) -> None:
    with pytest.raises(CommandTimeout):
        await drone.reboot(timeout=0.2)
    rebooting = asyncio.ensure_future(drone.reboot())
    await device.until(common.Reboot, 2)
    await device.session.close()
    await rebooting
    assert not drone.connected
    with pytest.raises(LinkLost):
        await drone.reboot()


@pytest.mark.parametrize("skycontroller", [None, 3])
async def test_rebooted_drone_has_a_new_state(skycontroller: int | None) -> None:
    async with connected("4k", speed=5.0, skycontroller=skycontroller) as (drone, real):
        await drone.piloting.set_max_tilt(23.0)
        await drone.camera.set_mode(CameraMode.PHOTO)
        await drone.camera.take_photo()
        await drone.sound.start()
        before = drone.product.state
        await drone.reboot()
        assert not drone.connected
        off = await real.wait_log(lambda entry: entry.name == "power" and not entry.args["on"])
        await real.wait_log(lambda entry: entry.name == "power" and entry.args["on"], timeout=20.0, since=off.t)
        await drone.connect()
        after = drone.product.state
        assert after.boot_id not in (None, before.boot_id)
        assert after.run_id not in (None, before.run_id)
        assert drone.sound.state.playing is False
        limit = drone.piloting.state.max_tilt
        assert limit is not None
        assert limit.current == 23.0  # a setting is kept,
        (media,) = await drone.media.list()
        assert len(media.resources) == 1  # and so is what was on the card


async def test_no_reboot_in_the_air() -> None:
    async with connected("4k") as (drone, real):
        await take_off(drone)
        with pytest.raises(CommandRejected):
            await drone.reboot()
        assert not real.log.find("command", "common.Common.Reboot")


async def test_verbs_of_unreported_features_are_not_supported() -> None:
    async with ScriptedDevice() as device:
        drone = device.drone()
        await drone.connect()
        for call in (
            drone.poi.start(*PLACE),
            drone.poi.stop(),
            drone.follow_me.start(follow_me.Mode.LOOK_AT),
            drone.follow_me.stop(),
            drone.sound.start(),
            drone.calibration.start_magnetometer(),
        ):
            with pytest.raises(NotSupported):
                await call
        await drone.close()
