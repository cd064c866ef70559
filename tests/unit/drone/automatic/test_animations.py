"""Animations through a drone of ours: flown by the simulator, and refused by a device that answers as the test says."""

from __future__ import annotations

import asyncio
import math

import pytest
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected, take_off

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation, ardrone3, common
from anafi_mav.arsdk.messages.animation import AnimationState, Indicator, Mode, PlayMode, Type
from anafi_mav.arsdk.messages.ardrone3 import PoiMode
from anafi_mav.drone import Drone
from anafi_mav.errors import CommandRejected, CommandTimeout, LocalProtocolError, NotSupported


async def ready(drone: Drone, type: Type) -> None:
    """In the air, and the drone says that this can be flown."""
    await take_off(drone)
    if type not in (drone.animations.state.available or ()):
        await drone.expect(animation.Availability, lambda message: bool(message.values >> type & 1))


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_animation_is_reported_from_start_to_end(model: str) -> None:
    async with connected(model, speed=4.0) as (drone, real):
        with pytest.raises(CommandRejected, match="is not available now"):
            await drone.animations.horizontal_panorama()
        assert await drone.animations.finished()
        await ready(drone, Type.HORIZONTAL_PANORAMA)
        before = real.pose.yaw
        await drone.animations.horizontal_panorama(math.pi / 2.0, 1.0)
        assert drone.animations.state.running == Type.HORIZONTAL_PANORAMA
        values = drone.animations.state.values
        assert isinstance(values, animation.HorizontalPanoramaState)
        assert (values.rotation_angle, values.rotation_speed) == pytest.approx((math.pi / 2.0, 1.0))
        assert await drone.animations.finished()
        assert real.pose.yaw - before == pytest.approx(math.pi / 2.0, abs=0.1)
        assert drone.animations.state.phase == AnimationState.IDLE


async def test_a_figure_is_cancelled() -> None:
    async with connected("4k", speed=2.0) as (drone, _):
        await ready(drone, Type.DRONIE)
        await drone.animations.dronie(5.0, 100.0, PlayMode.ONCE_THEN_MIRRORED)
        end = asyncio.ensure_future(drone.animations.finished())
        await drone.animations.cancel()
        assert drone.animations.state.running == Type.NONE
        assert not await end
        assert not await drone.animations.finished()
        await drone.animations.cancel()  # nothing to cancel


async def test_hover_ends_a_figure_of_the_real_thing() -> None:
    async with connected("4k", speed=2.0) as (drone, real):
        await ready(drone, Type.TWIST_UP)
        await drone.animations.twist_up(vertical_distance=30.0)
        await drone.piloting.stop()
        assert drone.animations.state.running == Type.NONE
        assert real.firmware.animations.running is False


async def test_figures_about_a_point() -> None:
    async with connected("ai", speed=4.0) as (drone, real):
        await ready(drone, Type.DRONIE)
        with pytest.raises(CommandRejected, match="spiral is not available now: it lacks target position accuracy"):
            await drone.animations.spiral()
        latitude, longitude = real.firmware.place()
        await drone.poi.start(latitude + 1e-4, longitude, 0.0, PoiMode.LOCKED_GIMBAL)
        if Type.SPIRAL not in (drone.animations.state.available or ()):
            await drone.expect(animation.Availability, lambda message: bool(message.values >> Type.SPIRAL & 1))
        await drone.animations.spiral(turns=0.25, vertical_distance=2.0)
        assert await drone.animations.finished()


async def test_a_photo_panorama_is_in_the_store() -> None:
    async with connected("4k", speed=5.0) as (drone, _):
        await ready(drone, Type.HORIZONTAL_180_PHOTO_PANORAMA)
        with pytest.raises(NotSupported):
            await drone.animations.photo_panorama(Type.DRONIE)
        with pytest.raises(CommandRejected):  # only an Ai has it
            await drone.animations.photo_panorama(Type.SUPER_WIDE_PHOTO_PANORAMA)
        await drone.animations.photo_panorama(Type.HORIZONTAL_180_PHOTO_PANORAMA)
        assert await drone.animations.finished()
        while not (found := await drone.media.list()):
            await drone.expect(common.BatteryStateChanged)  # the file is written a moment after the last picture
        (media,) = found
        assert len(media.resources) == 9


# -- scripted


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [
        *STATES,
        animation.Availability(1 << Type.VERTIGO | 1 << Type.DRONIE),
        animation.State(Type.NONE, 0),
        # One mode, two figures, as an Ai reports it.
        animation.Capabilities(Mode.MANUAL, 1 << Type.VERTIGO | 1 << Type.CANDLE | 1 << Type.DRONIE, 3),
        animation.Info(Type.VERTIGO, 0, 1),
        animation.Info(Type.CANDLE, 1 << Indicator.DRONE_GPS | 1 << Indicator.DRONE_BATTERY, 2),
    ]


async def test_animations_state_has_the_reported_values(drone: Drone) -> None:
    state = drone.animations.state
    assert state.modes == {Mode.MANUAL: {Type.VERTIGO, Type.CANDLE, Type.DRONIE}}
    assert state.missing == {Type.VERTIGO: frozenset(), Type.CANDLE: {Indicator.DRONE_GPS, Indicator.DRONE_BATTERY}}
    with pytest.raises(NotSupported, match="parabola"):
        await drone.animations.parabola()
    with pytest.raises(CommandRejected, match="it lacks drone gps, drone battery"):
        await drone.animations.candle()


async def test_animation_uses_only_the_given_values(drone: Drone, device: ScriptedDevice) -> None:
    device.script[animation.StartVertigo] = lambda m: [
        animation.VertigoState(AnimationState.RUNNING, 3.0, 2.0, m.finish_action, PlayMode.NORMAL),
        animation.State(Type.VERTIGO, 0),
    ]
    await drone.animations.vertigo(duration=3.0, finish=animation.VertigoFinishAction.UNZOOM)
    (sent,) = device.got(animation.StartVertigo)
    assert sent == animation.StartVertigo(0b101, 3.0, 0.0, animation.VertigoFinishAction.UNZOOM, PlayMode.NORMAL)
    with pytest.raises(LocalProtocolError):
        await drone.animations.vertigo(duration=math.nan)


async def test_unanswered_animation_start_is_withdrawn(
    drone: Drone, device: ScriptedDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("anafi_mav.drone.automatic.animations.ANSWER_TIMEOUT", 0.2)
    with pytest.raises(CommandTimeout):
        await drone.animations.dronie()
    await device.until(animation.Cancel)


async def test_animation_without_progress_fails(drone: Drone, device: ScriptedDevice) -> None:
    device.say(animation.State(Type.DRONIE, 10))
    await drone.expect(animation.State)
    with pytest.raises(CommandTimeout):
        await drone.animations.finished(timeout=0.2)


async def test_a_drone_without_animations() -> None:
    async with ScriptedDevice() as device:
        drone = device.drone()
        await drone.connect()
        for call in (
            drone.animations.horizontal_reveal(),
            drone.animations.vertical_reveal(),
            drone.animations.dolly_slide(),
            drone.animations.twist_up(above_target=True),
            drone.animations.photo_panorama(),
            drone.animations.finished(),
            drone.animations.cancel(),
        ):
            with pytest.raises(NotSupported):
                await call
        assert not device.got(ardrone3.PCMD)
        await drone.close()
