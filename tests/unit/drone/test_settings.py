"""The settings of a drone over real sockets: what it confirms is what a verb returns, what it never reported is not."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from support.scripted_device import SETTINGS, ScriptedDevice

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, common, obstacle_avoidance, piloting_style, precise_home, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle
from anafi_mav.arsdk.messages.rth import RthAutoTriggerMode, RthEndingBehavior, RthHomeType
from anafi_mav.drone import Drone, Position
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, LocalProtocolError, NotSupported

AVOIDING = obstacle_avoidance.Status(
    obstacle_avoidance.Mode.DISABLED, obstacle_avoidance.State.INACTIVE, obstacle_avoidance.Availability.AVAILABLE
)
REPORTED: list[Message] = [
    ardrone3.MaxPitchRollRotationSpeedChanged(116.0, 40.0, 300.0),
    ardrone3.MaxHorizontalSpeedChanged(5.0, 0.1, 15.0),
    ardrone3.NoFlyOverMaxDistanceChanged(0),
    ardrone3.BankedTurnChanged(0),
    piloting_style.Style(PilotingStyleStyle.STANDARD),
    AVOIDING,
    rth.EndingBehavior(RthEndingBehavior.LANDING),
    rth.EndingHoveringAltitude(10.0, 1.0, 10.0),
    rth.Delay(60, 0, 120),
    rth.AutoTriggerMode(RthAutoTriggerMode.OFF),
    rth.PreferredHomeType(RthHomeType.TAKEOFF),
    rth.HomeTypeCapabilities(1 << RthHomeType.TAKEOFF | 1 << RthHomeType.CUSTOM),
    precise_home.Mode(precise_home.PreciseHomeMode.DISABLED),
]

VERBS: list[tuple[Callable[[Drone], Awaitable[Any]], Message, Message, Any]] = [
    (
        lambda drone: drone.piloting.set_max_tilt_speed(500.0),
        ardrone3.MaxPitchRollRotationSpeed(500.0),
        ardrone3.MaxPitchRollRotationSpeedChanged(300.0, 40.0, 300.0),
        300.0,
    ),
    (
        lambda drone: drone.piloting.set_max_horizontal_speed(3.0),
        ardrone3.MaxHorizontalSpeed(3.0),
        ardrone3.MaxHorizontalSpeedChanged(3.0, 0.1, 15.0),
        3.0,
    ),
    (
        lambda drone: drone.piloting.set_geofence(True),
        ardrone3.NoFlyOverMaxDistance(1),
        ardrone3.NoFlyOverMaxDistanceChanged(1),
        True,
    ),
    # the drone did not want it
    (
        lambda drone: drone.piloting.set_banked_turn(True),
        ardrone3.BankedTurn(1),
        ardrone3.BankedTurnChanged(0),
        False,
    ),
    (
        lambda drone: drone.piloting.set_style(PilotingStyleStyle.CAMERA_OPERATED),
        piloting_style.SetStyle(PilotingStyleStyle.CAMERA_OPERATED),
        piloting_style.Style(PilotingStyleStyle.CAMERA_OPERATED),
        PilotingStyleStyle.CAMERA_OPERATED,
    ),
    (
        lambda drone: drone.piloting.set_obstacle_avoidance(True),
        obstacle_avoidance.SetMode(obstacle_avoidance.Mode.STANDARD),
        obstacle_avoidance.Status(
            obstacle_avoidance.Mode.STANDARD,
            obstacle_avoidance.State.ACTIVE,
            obstacle_avoidance.Availability.AVAILABLE,
        ),
        True,
    ),
    (
        lambda drone: drone.home.set_ending(RthEndingBehavior.HOVERING),
        rth.SetEndingBehavior(RthEndingBehavior.HOVERING),
        rth.EndingBehavior(RthEndingBehavior.HOVERING),
        RthEndingBehavior.HOVERING,
    ),
    (
        lambda drone: drone.home.set_ending_altitude(4.0),
        rth.SetEndingHoveringAltitude(4.0),
        rth.EndingHoveringAltitude(4.0, 1.0, 10.0),
        4.0,
    ),
    (lambda drone: drone.home.set_delay(30), rth.SetDelay(30), rth.Delay(30, 0, 120), 30),
    (
        lambda drone: drone.home.set_by_itself(True),
        rth.SetAutoTriggerMode(RthAutoTriggerMode.ON),
        rth.AutoTriggerMode(RthAutoTriggerMode.ON),
        True,
    ),
    (
        lambda drone: drone.home.set_preferred_type(RthHomeType.CUSTOM),
        rth.SetPreferredHomeType(RthHomeType.CUSTOM),
        rth.PreferredHomeType(RthHomeType.CUSTOM),
        RthHomeType.CUSTOM,
    ),
    (
        lambda drone: drone.home.set_custom_location(48.5, 2.25, 12.5),
        rth.SetCustomLocation(48.5, 2.25, 12.5),
        rth.CustomLocation(48.5, 2.25, 12.5),
        Position(48.5, 2.25, 12.5),
    ),
    (
        lambda drone: drone.home.set_precise(True),
        precise_home.SetMode(precise_home.PreciseHomeMode.STANDARD),
        precise_home.Mode(precise_home.PreciseHomeMode.STANDARD),
        True,
    ),
]


@pytest.fixture
def settings() -> list[Message]:
    """Settings that the device reports at the start."""
    return [*SETTINGS, *REPORTED]


@pytest.mark.parametrize("case", VERBS, ids=[command.NAME for _, command, _, _ in VERBS])
async def test_setting_returns_the_confirmed_value(
    device: ScriptedDevice, drone: Drone, case: tuple[Callable[[Drone], Awaitable[Any]], Message, Message, Any]
) -> None:
    verb, command, answer, result = case
    device.script[type(command)] = lambda _: [answer]
    assert await verb(drone) == result
    assert device.got(type(command)) == [command]


@pytest.mark.parametrize(
    ("call", "command", "before", "after"),
    [
        (
            lambda drone: drone.piloting.set_max_horizontal_speed(3.0),
            ardrone3.MaxHorizontalSpeed,
            ardrone3.MaxHorizontalSpeedChanged(5.0, 0.1, 15.0),
            ardrone3.MaxHorizontalSpeedChanged(3.0, 0.1, 15.0),
        ),
        (
            lambda drone: drone.piloting.set_geofence(True),
            ardrone3.NoFlyOverMaxDistance,
            ardrone3.NoFlyOverMaxDistanceChanged(0),
            ardrone3.NoFlyOverMaxDistanceChanged(1),
        ),
    ],
)
async def test_report_of_before_a_change_is_not_its_answer(
    device: ScriptedDevice,
    drone: Drone,
    call: Callable[[Drone], Awaitable[float]],
    command: type[Message],
    before: Message,
    after: Message,
) -> None:
    device.script[command] = lambda message: [before, after]
    assert await call(drone) in (3.0, True)


async def test_unreported_setting_is_unsupported(device: ScriptedDevice) -> None:
    device.script[common.AllSettings] = lambda _: [*SETTINGS, common.AllSettingsChanged()]
    drone = device.drone()
    with pytest.raises(LinkLost):
        await drone.home.set_precise(True)
    await drone.connect()
    sent = len(device.received)
    for verb, _, _, _ in VERBS:
        with pytest.raises(NotSupported):
            await verb(drone)
    assert len(device.received) == sent
    await drone.close()


async def test_unsupported_home_type_is_refused(device: ScriptedDevice, drone: Drone) -> None:
    with pytest.raises(NotSupported, match="pilot"):
        await drone.home.set_preferred_type(RthHomeType.PILOT)
    with pytest.raises(LocalProtocolError):
        await drone.home.set_custom_location(500.0, 500.0, 0.0)


async def test_refused_custom_home_is_reported_before_the_timeout(device: ScriptedDevice, drone: Drone) -> None:
    """It reports the place that it keeps. One that is silent may have obeyed."""
    device.script[rth.SetCustomLocation] = lambda _: [rth.CustomLocation(1.0, 1.0, 0.0)]
    with pytest.raises(CommandRejected, match="does not accept the place"):
        await drone.home.set_custom_location(48.5, 2.25, 0.0, timeout=60.0)
    device.script[rth.SetCustomLocation] = lambda _: []
    with pytest.raises(CommandTimeout, match=r"within 1\.5 s"):
        await drone.home.set_custom_location(48.5, 2.25, 0.0, timeout=60.0)
    device.session.air = lambda data, inward, hand_on: None if inward else hand_on(data)
    with pytest.raises(CommandTimeout):
        await drone.home.set_custom_location(48.5, 2.25, 0.0, timeout=0.3)


async def test_older_report_of_a_setting_that_is_not_received_is_no_answer(
    device: ScriptedDevice, drone: Drone
) -> None:
    device.session.air = lambda data, inward, hand_on: None if inward else hand_on(data)
    setting = asyncio.ensure_future(drone.piloting.set_banked_turn(True))
    await asyncio.sleep(0)
    device.say(ardrone3.BankedTurnChanged(0))
    with pytest.raises(CommandTimeout):
        await setting


async def test_hand_launch(device: ScriptedDevice, drone: Drone) -> None:
    device.script[ardrone3.UserTakeOff] = lambda m: [
        ardrone3.FlyingStateChanged(s)
        for s in ([FlyingState.MOTOR_RAMPING, FlyingState.USERTAKEOFF] if m.state else [FlyingState.LANDED])
    ]
    await drone.piloting.hand_launch()
    assert drone.piloting.state.flying == FlyingState.USERTAKEOFF
    await drone.piloting.hand_launch()
    ready = asyncio.ensure_future(drone.expect(ardrone3.UserTakeoffReady))
    await asyncio.sleep(0)
    device.say(ardrone3.UserTakeoffReady())
    await ready
    observed = [drone.piloting.state.ready_for_hand_launch]
    await drone.piloting.cancel_hand_launch()
    observed.append(drone.piloting.state.ready_for_hand_launch)
    assert observed == [True, False]
    await drone.piloting.cancel_hand_launch()
    assert [m.state for m in device.got(ardrone3.UserTakeOff)] == [1, 0]


async def test_hand_launch_replaced_by_a_failed_take_off_is_cancelled(device: ScriptedDevice, drone: Drone) -> None:
    """The drone has received both: its motors must not start in a hand after both have failed."""
    launching = asyncio.ensure_future(drone.piloting.hand_launch())
    await device.until(ardrone3.UserTakeOff)
    with pytest.raises(CommandTimeout):
        await drone.piloting.take_off(timeout=0.3)
    with pytest.raises(CommandRejected, match="replaced"):
        await launching
    assert (await device.until(ardrone3.UserTakeOff, 2)).state == 0


async def test_hand_launch_whose_motors_stop_again_is_cancelled(device: ScriptedDevice, drone: Drone) -> None:
    """The drone may try once more: motors in a hand must not start after the refusal."""
    device.script[ardrone3.UserTakeOff] = lambda m: [
        ardrone3.FlyingStateChanged(s) for s in ((FlyingState.MOTOR_RAMPING, FlyingState.LANDED) if m.state else ())
    ]
    with pytest.raises(CommandRejected, match="the motors stopped again"):
        await drone.piloting.hand_launch()
    assert (await device.until(ardrone3.UserTakeOff, 2)).state == 0


async def test_hand_launch_is_refused_while_a_take_off_is_awaited(device: ScriptedDevice, drone: Drone) -> None:
    """The cancellation of the hand launch would end the take-off."""
    launching = asyncio.ensure_future(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    with pytest.raises(CommandRejected, match="about to take off"):
        await drone.piloting.hand_launch(timeout=0.3)
    device.say(*(ardrone3.FlyingStateChanged(s) for s in (FlyingState.MOTOR_RAMPING, FlyingState.TAKINGOFF)))
    await launching
    assert device.got(ardrone3.UserTakeOff) == []


async def test_timed_out_hand_launch_is_cancelled(device: ScriptedDevice, drone: Drone) -> None:
    with pytest.raises(CommandTimeout):
        await drone.piloting.hand_launch(timeout=0.3)
    assert (await device.until(ardrone3.UserTakeOff, 2)).state == 0
    device.script[ardrone3.UserTakeOff] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.HOVERING)]
    await drone.piloting.hand_launch()
    with pytest.raises(CommandRejected):
        await drone.piloting.hand_launch()
    with pytest.raises(CommandRejected):
        await drone.piloting.cancel_hand_launch()
