"""What was cancelled does not happen, what is said to have ended has ended, and the drone's own will is not fought:
against a device that answers as each test says, and goes deaf when it says so."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from support.scripted_device import STATES, ScriptedDevice

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation, ardrone3, common, follow_me, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, MoveByError, PoiMode, PoiStatus
from anafi_mav.arsdk.messages.common import MavlinkType, PlayingState
from anafi_mav.arsdk.messages.rth import RthState, StateReason
from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.errors import CommandRejected, CommandTimeout

PLACE = (48.8795, 2.3680, 3.0)
FORWARD = PilotingCommand(pitch_deg=-5.0)
LOOK_AT = follow_me.Mode.LOOK_AT

OTHERS: list[Message] = [
    common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, "", MavlinkType.FLIGHT_PLAN),
    ardrone3.PilotedPOIV2(500.0, 500.0, 500.0, PoiMode.LOCKED_GIMBAL, PoiStatus.AVAILABLE),
    follow_me.State(follow_me.Mode.NONE, follow_me.Behavior.IDLE, follow_me.Animation.NONE, 0),
    follow_me.ModeInfo(LOOK_AT, 0, 0),
    common.MagnetoCalibrationStartedChanged(0),
    animation.State(animation.Type.NONE, 0),
    animation.Availability(1 << animation.Type.HORIZONTAL_PANORAMA),
]


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [*STATES, *OTHERS]


def deaf(device: ScriptedDevice, deaf: bool = True) -> None:
    """The device hears no command. It is heard, and the link lives: pings and acknowledgements come through."""
    queue = 1 if device.session.version == 1 else 2  # where a frame says to which queue it belongs

    def drop(data: bytes, inward: bool, hand_on: Callable[[bytes], None]) -> None:
        if not inward or data[queue] not in (10, 11):
            hand_on(data)

    device.session.air = drop if deaf else None


async def reported(drone: Drone, device: ScriptedDevice, *events: Message) -> None:
    """Let the device say this and the drone hear it."""
    heard = asyncio.ensure_future(drone.expect(type(events[-1]), lambda message: message == events[-1]))
    await asyncio.sleep(0)
    device.say(*events)
    await heard


async def flies(drone: Drone, device: ScriptedDevice, state: FlyingState = FlyingState.HOVERING) -> None:
    await reported(drone, device, ardrone3.FlyingStateChanged(state))


async def in_order(drone: Drone, device: ScriptedDevice) -> None:
    """Everything that was sent before has arrived."""
    device.script[ardrone3.MaxTilt] = lambda command: [ardrone3.MaxTiltChanged(command.current, 1.0, 40.0)]
    await drone.piloting.set_max_tilt(15.0)


def plan(state: PlayingState, uid: str = "abc") -> common.MavlinkFilePlayingStateChanged:
    return common.MavlinkFilePlayingStateChanged(state, uid, MavlinkType.FLIGHT_PLAN)


def point(status: PoiStatus, place: tuple[float, float, float] = PLACE) -> ardrone3.PilotedPOIV2:
    return ardrone3.PilotedPOIV2(*place, PoiMode.LOCKED_GIMBAL, status)


def following(mode: follow_me.Mode) -> follow_me.State:
    behavior = follow_me.Behavior.IDLE if mode == follow_me.Mode.NONE else follow_me.Behavior.LOOK_AT
    return follow_me.State(mode, behavior, follow_me.Animation.NONE, 0)


BEGINNINGS: list[Any] = [
    pytest.param(lambda d: d.flight_plan.start("abc"), common.Start, common.Stop, id="flight plan"),
    pytest.param(
        lambda d: d.poi.start(*PLACE), ardrone3.StartPilotedPOIV2, ardrone3.StopPilotedPOI, id="point of interest"
    ),
    pytest.param(lambda d: d.follow_me.start(LOOK_AT), follow_me.Start, follow_me.Stop, id="follow me"),
    pytest.param(
        lambda d: d.animations.horizontal_panorama(),
        animation.StartHorizontalPanorama,
        animation.Cancel,
        id="animation",
    ),
]

Verb = Callable[[Drone], Awaitable[Any]]


# -- what has not begun yet


@pytest.mark.parametrize(("verb", "start", "stop"), BEGINNINGS)
async def test_hover_cancels_commands_before_they_begin(
    drone: Drone, device: ScriptedDevice, verb: Verb, start: type[Message], stop: type[Message]
) -> None:
    await flies(drone, device)
    starting = asyncio.ensure_future(verb(drone))
    await device.until(start)
    drone.piloting.hover()
    with pytest.raises(CommandRejected, match="stopped by hover"):
        await starting
    await device.until(stop)


@pytest.mark.parametrize(("verb", "start", "stop"), BEGINNINGS)
async def test_undelivered_start_is_not_sent_after_hover(
    drone: Drone, device: ScriptedDevice, verb: Verb, start: type[Message], stop: type[Message]
) -> None:
    await flies(drone, device)
    deaf(device)
    starting = asyncio.ensure_future(verb(drone))
    await asyncio.sleep(0.2)
    drone.piloting.hover()
    with pytest.raises(CommandRejected, match="stopped by hover"):
        await starting
    deaf(device, False)
    await device.until(stop)
    assert device.got(start) == []


@pytest.mark.parametrize(("verb", "start", "stop"), BEGINNINGS)
@pytest.mark.parametrize("how", ["hover", "cancel"])
async def test_stop_is_confirmed_when_the_drone_has_the_command(
    drone: Drone, device: ScriptedDevice, verb: Verb, start: type[Message], stop: type[Message], how: str
) -> None:
    await flies(drone, device)
    drone.piloting.hover()  # an earlier connection's moveBy, which is not what this is about
    await in_order(drone, device)
    starting = asyncio.ensure_future(verb(drone))
    await device.until(start)
    deaf(device)
    if how == "cancel":
        starting.cancel()
        await asyncio.wait([starting])
    stopping = asyncio.ensure_future(drone.piloting.stop())
    await asyncio.wait([stopping], timeout=0.5)
    assert not stopping.done()
    deaf(device, False)
    await stopping
    assert len(device.got(stop)) == 1
    await asyncio.wait([starting])
    assert starting.cancelled() or isinstance(starting.exception(), CommandRejected)


@pytest.mark.parametrize(
    ("verb", "stop", "start", "order"),
    [
        (lambda d: d.flight_plan.start("abc"), lambda d: d.flight_plan.stop(), common.Start, common.Stop),
        (lambda d: d.poi.start(*PLACE), lambda d: d.poi.stop(), ardrone3.StartPilotedPOIV2, ardrone3.StopPilotedPOI),
        (lambda d: d.follow_me.start(LOOK_AT), lambda d: d.follow_me.stop(), follow_me.Start, follow_me.Stop),
        (
            lambda d: d.animations.horizontal_panorama(),
            lambda d: d.animations.cancel(),
            animation.StartHorizontalPanorama,
            animation.Cancel,
        ),
    ],
    ids=["flight plan", "point of interest", "follow me", "animation"],
)
async def test_stop_before_the_start_is_confirmed_still_stops(
    drone: Drone, device: ScriptedDevice, verb: Verb, stop: Verb, start: type[Message], order: type[Message]
) -> None:
    await flies(drone, device)
    starting = asyncio.ensure_future(verb(drone))
    await device.until(start)
    await stop(drone)
    assert len(device.got(order)) == 1
    with pytest.raises(CommandRejected):
        await starting
    await stop(drone)
    assert len(device.got(order)) == 1


@pytest.mark.parametrize(("verb", "start", "stop"), BEGINNINGS)
@pytest.mark.parametrize("newer", ["move_to", "move_by", "return_home", "land"])
async def test_newer_command_cancels_the_older_before_it_begins(
    drone: Drone, device: ScriptedDevice, verb: Verb, start: type[Message], stop: type[Message], newer: str
) -> None:
    await flies(drone, device)
    starting = asyncio.ensure_future(verb(drone))
    await device.until(start)
    piloting = drone.piloting
    calls: dict[str, Callable[[], Awaitable[Any]]] = {
        "move_to": lambda: piloting.move_to(48.0, 2.0, 5.0),
        "move_by": lambda: piloting.move_by(1.0, 0.0, 0.0, 0.0),
        "return_home": piloting.return_home,
        "land": piloting.land,
    }
    task = asyncio.ensure_future(calls[newer]())
    with pytest.raises(CommandRejected):
        await starting
    await device.until(stop)
    task.cancel()
    await asyncio.wait([task])


@pytest.mark.parametrize(("verb", "start", "stop"), BEGINNINGS)
async def test_emergency_ends_pending_starts_and_sends_no_other_command(
    drone: Drone, device: ScriptedDevice, verb: Verb, start: type[Message], stop: type[Message]
) -> None:
    """No stop delays it, and no start follows it: the motors are cut."""
    await flies(drone, device)
    starting = asyncio.ensure_future(verb(drone))
    await device.until(start)
    device.script[ardrone3.Emergency] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.EMERGENCY)]
    await drone.piloting.emergency()
    with pytest.raises(CommandRejected):
        await starting
    assert device.got(stop) == []
    assert len(device.got(start)) == 1


async def test_replaced_start_does_not_end_the_newer_one(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    elsewhere = (48.0, 2.0, 5.0)
    older = asyncio.ensure_future(drone.poi.start(*elsewhere, timeout=0.3))
    await device.until(ardrone3.StartPilotedPOIV2)
    device.script[ardrone3.StartPilotedPOIV2] = lambda _: [point(PoiStatus.RUNNING)]
    await drone.poi.start(*PLACE)
    with pytest.raises(CommandRejected, match="replaced"):
        await older
    await in_order(drone, device)
    assert device.got(ardrone3.StopPilotedPOI) == []


async def test_hover_ends_follow_me(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    device.script[follow_me.Start] = lambda m: [following(m.mode)]
    await drone.follow_me.start(LOOK_AT)
    stopping = asyncio.ensure_future(drone.piloting.stop())
    await device.until(follow_me.Stop)
    await asyncio.sleep(0.2)
    assert not stopping.done()
    device.say(following(follow_me.Mode.NONE))
    await stopping


async def test_hover_repeats_the_stop_when_follow_me_continues(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    await reported(drone, device, following(LOOK_AT))
    drone.piloting.hover()
    drone.piloting.hover()  # the first order may be on its way
    await device.until(follow_me.Stop)
    await asyncio.sleep(1.3)
    drone.piloting.hover()
    await device.until(follow_me.Stop, 2)
    await in_order(drone, device)
    assert len(device.got(follow_me.Stop)) == 2


async def test_return_cancelled_during_a_takeoff_leaves_no_unread_error(
    drone: Drone, device: ScriptedDevice, caplog: pytest.LogCaptureFixture
) -> None:
    """The wait for its answer has ended before the link is lost."""
    await flies(drone, device, FlyingState.TAKINGOFF)
    returning = asyncio.ensure_future(drone.piloting.return_home())
    await device.until(rth.ReturnToHome)
    returning.cancel()
    await asyncio.wait([returning])
    await drone.close()
    del returning
    gc.collect()
    assert "never retrieved" not in caplog.text


# -- flight plans


async def test_plan_starting_after_hover_is_stopped(drone: Drone, device: ScriptedDevice) -> None:
    """A drone reads the whole file before it says anything."""
    await flies(drone, device)
    starting = asyncio.ensure_future(drone.flight_plan.start("abc"))
    await device.until(common.Start)
    drone.piloting.hover()
    with pytest.raises(CommandRejected):
        await starting
    await device.until(common.Stop)
    device.say(plan(PlayingState.PLAYING))
    await device.until(common.Stop, 2)
    # Asked for again it is wanted.
    device.script[common.Start] = lambda _: [plan(PlayingState.PLAYING)]
    await reported(drone, device, plan(PlayingState.STOPPED))
    await drone.flight_plan.start("abc")
    await in_order(drone, device)
    assert len(device.got(common.Stop)) == 2


async def test_plan_of_another_controller_is_not_stopped(drone: Drone, device: ScriptedDevice) -> None:
    """Ours of the same name was refused, by ourselves or by the drone: there is nothing to take back."""
    await flies(drone, device, FlyingState.LANDING)
    with pytest.raises(CommandRejected, match="landing"):
        await drone.flight_plan.start("abc")
    await flies(drone, device)
    device.script[common.Start] = lambda _: [common.StartingErrorEvent()]
    with pytest.raises(CommandRejected):
        await drone.flight_plan.start("abc")
    await reported(drone, device, plan(PlayingState.PLAYING))
    await in_order(drone, device)
    assert device.got(common.Stop) == []


async def test_another_playing_plan_does_not_confirm_a_start(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    await reported(drone, device, plan(PlayingState.PLAYING, "first"))
    device.script[common.Start] = lambda _: [plan(PlayingState.PLAYING, "first")]
    with pytest.raises(CommandTimeout):
        await drone.flight_plan.start("second", timeout=0.3)
    await device.until(common.Stop)


async def test_sticks_are_silent_while_a_plan_plays(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    device.script[common.Start] = lambda _: [plan(PlayingState.PLAYING)]
    drone.piloting.pilot(FORWARD)
    await device.until(ardrone3.PCMD, 2)
    await drone.flight_plan.start("abc")
    await in_order(drone, device)
    flown = len(device.got(ardrone3.PCMD))
    assert drone.piloting.sticks_blocked == "a flight plan plays"
    drone.piloting.pilot(FORWARD)
    await asyncio.sleep(0.3)  # six periods
    assert len(device.got(ardrone3.PCMD)) == flown
    # Hover says both: pause, and level.
    drone.piloting.hover()
    await device.until(common.Pause)
    await device.until(ardrone3.PCMD, flown + 3)
    assert {(p.roll, p.pitch, p.yaw, p.gaz) for p in device.got(ardrone3.PCMD)[flown:]} == {(0, 0, 0, 0)}


async def test_plan_sent_to_a_landed_drone_is_stopped(drone: Drone, device: ScriptedDevice) -> None:
    starting = asyncio.ensure_future(drone.flight_plan.start("abc"))
    await device.until(common.Start)
    assert drone.piloting.about_to_fly
    deaf(device)
    starting.cancel()
    await asyncio.wait([starting])
    assert drone.piloting.about_to_fly
    landing = asyncio.ensure_future(drone.piloting.land())
    await asyncio.wait([landing], timeout=0.5)
    assert not landing.done()
    deaf(device, False)
    await landing
    assert [type(m) for _, m in device.received if isinstance(m, common.Stop | ardrone3.Landing)] == [
        common.Stop,
        ardrone3.Landing,
    ]
    assert not drone.piloting.about_to_fly


# -- what the drone does by itself


WISHES: list[Any] = [
    pytest.param(lambda d: d.flight_plan.start("abc"), id="flight plan"),
    pytest.param(lambda d: d.poi.start(*PLACE), id="point of interest"),
    pytest.param(lambda d: d.follow_me.start(LOOK_AT), id="follow me"),
    pytest.param(lambda d: d.animations.horizontal_panorama(), id="animation"),
    pytest.param(lambda d: d.piloting.move_to(48.0, 2.0, 5.0), id="moveTo"),
    pytest.param(lambda d: d.piloting.move_by(1.0, 0.0, 0.0, 0.0), id="moveBy"),
]


@pytest.mark.parametrize("verb", WISHES)
@pytest.mark.parametrize(
    "event",
    [
        rth.State(RthState.IN_PROGRESS, StateReason.LOW_BATTERY),
        rth.State(RthState.PENDING, StateReason.CONNECTION_LOST),
        ardrone3.FlyingStateChanged(FlyingState.EMERGENCY_LANDING),
        ardrone3.FlyingStateChanged(FlyingState.LANDING),
    ],
    ids=["returns", "is about to return", "emergency landing", "landing"],
)
async def test_verb_during_the_drones_own_action_is_refused(
    drone: Drone, device: ScriptedDevice, verb: Verb, event: Message
) -> None:
    await flies(drone, device)
    await reported(drone, device, event)
    before = len(device.received)
    with pytest.raises(CommandRejected, match=r"by itself|landing"):
        await verb(drone)
    assert len(device.received) == before


async def test_no_return_during_an_emergency_landing(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device, FlyingState.EMERGENCY_LANDING)
    with pytest.raises(CommandRejected, match="emergency landing"):
        await drone.piloting.return_home()


@pytest.mark.parametrize("verb", ["hover", "cancel"])
async def test_late_abort_does_not_end_the_drones_own_return(drone: Drone, device: ScriptedDevice, verb: str) -> None:
    await flies(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)]
    await drone.piloting.return_home()
    await in_order(drone, device)
    deaf(device)
    stopping = asyncio.ensure_future(drone.piloting.stop() if verb == "hover" else drone.piloting.cancel_return_home())
    await asyncio.sleep(0.2)
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.LOW_BATTERY))
    with pytest.raises(CommandRejected, match="by itself"):
        await stopping
    deaf(device, False)
    device.script[ardrone3.MaxTilt] = lambda command: [ardrone3.MaxTiltChanged(command.current, 1.0, 40.0)]
    await drone.piloting.set_max_tilt(20.0)
    assert device.got(rth.Abort) == []


async def test_abort_of_the_drones_own_return_is_not_withdrawn(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    await reported(drone, device, rth.State(RthState.PENDING, StateReason.LOW_BATTERY))
    deaf(device)
    stopping = asyncio.ensure_future(drone.piloting.cancel_return_home(even_its_own=True))
    await asyncio.sleep(0.2)
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.LOW_BATTERY))
    device.script[rth.Abort] = lambda _: [rth.State(RthState.AVAILABLE, StateReason.STOPPED)]
    deaf(device, False)
    await stopping


async def test_return_with_second_abort_sent_is_not_confirmed(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)]
    device.script[rth.Abort] = lambda _: [rth.State(RthState.AVAILABLE, StateReason.STOPPED)]
    await drone.piloting.return_home()
    await drone.piloting.cancel_return_home()
    await drone.piloting.return_home()
    await in_order(drone, device)
    deaf(device)
    aborting = asyncio.ensure_future(drone.piloting.cancel_return_home())
    await asyncio.sleep(1.2)  # the first abort has had its second of quiet
    returning = asyncio.ensure_future(drone.piloting.return_home())
    await asyncio.sleep(0.2)
    assert not returning.done()
    deaf(device, False)
    await aborting
    await returning
    assert [type(m) for _, m in device.received if isinstance(m, rth.Abort | rth.ReturnToHome)] == [
        rth.ReturnToHome,
        rth.Abort,
        rth.ReturnToHome,
        rth.Abort,
        rth.ReturnToHome,
    ]


async def test_move_ending_in_a_return_does_not_end_it(drone: Drone, device: ScriptedDevice) -> None:
    """The pilot at a Skycontroller pressed his button: nothing of ours is sent into his return."""
    await flies(drone, device)
    moving = asyncio.ensure_future(drone.piloting.move_by(50.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST))
    moving.cancel()
    await asyncio.wait([moving])
    drone.piloting.hover()
    await in_order(drone, device)
    assert [m.dX for m in device.got(ardrone3.MoveBy)] == [50.0]


# -- hand launch, take-off, motors


async def test_landing_ends_a_hand_launch(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device, FlyingState.USERTAKEOFF)
    device.script[ardrone3.UserTakeOff] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.LANDED)]
    await drone.piloting.land()
    assert [m.state for m in device.got(ardrone3.UserTakeOff)] == [0]


async def test_drone_thrown_during_a_stop_lands(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device, FlyingState.USERTAKEOFF)
    device.script[ardrone3.UserTakeOff] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.TAKINGOFF)]
    device.script[ardrone3.Landing] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.LANDING)]
    await drone.piloting.land()


@pytest.mark.parametrize("verb", ["land", "cancel_hand_launch"])
async def test_hand_launch_in_progress_is_stopped(drone: Drone, device: ScriptedDevice, verb: str) -> None:
    """Motors that start in a hand after "disarmed" are the worst."""
    deaf(device)
    launching = asyncio.ensure_future(drone.piloting.hand_launch())
    await asyncio.sleep(0.2)
    assert drone.piloting.about_to_fly
    launching.cancel()
    await asyncio.wait([launching])
    ending = asyncio.ensure_future(getattr(drone.piloting, verb)())
    await asyncio.wait([ending], timeout=0.5)
    assert not ending.done()
    deaf(device, False)
    await ending
    assert [m.state for m in device.got(ardrone3.UserTakeOff)][-1] == 0
    assert 1 not in [m.state for m in device.got(ardrone3.UserTakeOff)]


@pytest.mark.parametrize("state", [FlyingState.USERTAKEOFF, FlyingState.LANDING, FlyingState.EMERGENCY])
async def test_no_take_off_in_other_states(drone: Drone, device: ScriptedDevice, state: FlyingState) -> None:
    await flies(drone, device, state)
    with pytest.raises(CommandRejected):
        await drone.piloting.take_off()
    assert device.got(ardrone3.TakeOff) == []


async def test_drone_with_unknown_state_does_not_take_off(device: ScriptedDevice) -> None:
    device.script[common.AllStates] = lambda _: [common.AllStatesChanged()]
    drone = device.drone()
    await drone.connect()
    with pytest.raises(CommandRejected, match="not reported"):
        await drone.piloting.take_off()
    await drone.close()


@pytest.mark.parametrize("verb", ["take_off", "hand_launch"])
async def test_motors_do_not_start_during_a_calibration(drone: Drone, device: ScriptedDevice, verb: str) -> None:
    device.script[common.MagnetoCalibration] = lambda m: [common.MagnetoCalibrationStartedChanged(m.calibrate)]
    await drone.calibration.start_magnetometer()
    assert drone.takeoff_blockers() == ["the magnetometer is being calibrated"]
    with pytest.raises(CommandRejected, match="by hand"):
        await getattr(drone.piloting, verb)()
    with pytest.raises(CommandRejected, match="by hand"):
        await drone.flight_plan.start("abc")
    assert not drone.piloting.about_to_fly
    await drone.calibration.abort_magnetometer()
    assert drone.takeoff_blockers() == []


async def test_calibration_in_flight_or_before_takeoff_is_refused(drone: Drone, device: ScriptedDevice) -> None:
    rising = asyncio.ensure_future(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    with pytest.raises(CommandRejected, match="about to take off"):
        await drone.calibration.start_magnetometer()
    device.say(ardrone3.FlyingStateChanged(FlyingState.TAKINGOFF))
    await rising
    with pytest.raises(CommandRejected, match="not calibrated"):
        await drone.calibration.start_magnetometer()
    assert device.got(common.MagnetoCalibration) == []


async def test_emergency_overtakes_other_commands_and_ends_them(drone: Drone, device: ScriptedDevice) -> None:
    deaf(device)
    tilt = asyncio.ensure_future(drone.piloting.set_max_tilt(20.0))
    await asyncio.sleep(0.05)  # in flight: what comes now waits behind it
    rising = asyncio.ensure_future(drone.piloting.take_off())
    await asyncio.sleep(0.05)
    cutting = asyncio.ensure_future(drone.piloting.emergency())
    with pytest.raises(CommandRejected, match="cut"):
        await rising
    device.script[ardrone3.Emergency] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.EMERGENCY)]
    deaf(device, False)
    await cutting
    assert device.got(ardrone3.TakeOff) == []
    tilt.cancel()
    await asyncio.wait([tilt])


async def test_failed_motor_cut_is_not_executed_later(
    drone: Drone, device: ScriptedDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("anafi_mav.drone.piloting.motors.EMERGENCY_TIMEOUT", 0.4)
    await flies(drone, device)
    deaf(device)
    with pytest.raises(CommandTimeout):
        await drone.piloting.emergency()
    deaf(device, False)
    await in_order(drone, device)
    assert device.got(ardrone3.Emergency) == []


# -- reboot


async def test_cancelled_reboot_is_withdrawn(drone: Drone, device: ScriptedDevice) -> None:
    deaf(device)
    rebooting = asyncio.ensure_future(drone.reboot())
    await asyncio.sleep(0.2)
    rebooting.cancel()
    await asyncio.wait([rebooting])
    deaf(device, False)
    await in_order(drone, device)
    assert device.got(common.Reboot) == []


async def test_reboot_in_a_fall_or_before_takeoff_is_refused(drone: Drone, device: ScriptedDevice) -> None:
    rising = asyncio.ensure_future(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    with pytest.raises(CommandRejected, match="about to take off"):
        await drone.reboot()
    device.say(ardrone3.FlyingStateChanged(FlyingState.TAKINGOFF))
    await rising
    await flies(drone, device, FlyingState.EMERGENCY)
    with pytest.raises(CommandRejected, match="not rebooted"):
        await drone.reboot()
    assert device.got(common.Reboot) == []


# -- moves


async def test_zero_move_of_hover_confirms_no_newer_move(drone: Drone, device: ScriptedDevice) -> None:
    await flies(drone, device)
    given_up = asyncio.ensure_future(drone.piloting.move_by(9.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    drone.piloting.hover()
    with pytest.raises(CommandRejected):
        await given_up
    older = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    newer = asyncio.ensure_future(drone.piloting.move_by(2.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy, 4)
    device.say(
        ardrone3.MoveByEnd(0.4, 0.0, 0.0, 0.0, MoveByError.INTERRUPTED),  # what was abandoned
        ardrone3.MoveByEnd(0.0, 0.0, 0.0, 0.0, MoveByError.OK),  # the zero move
        ardrone3.MoveByEnd(0.0, 0.0, 0.0, 0.0, MoveByError.INTERRUPTED),  # the older
    )
    with pytest.raises(CommandRejected, match="interrupted"):
        await older
    assert not newer.done()
    assert drone.piloting.moving
    await asyncio.sleep(0.5)  # of the flight
    device.say(ardrone3.MoveByEnd(2.0, 0.0, 0.0, 0.0, MoveByError.OK))
    assert (await newer).front == 2.0


# -- version 1 of the protocol


async def test_stop_is_repeated_without_limit_in_version_1() -> None:
    async with ScriptedDevice(versions=(1, 1)) as device:
        drone = device.drone()
        await drone.connect()
        await flies(drone, device)
        drone.piloting.hover()  # an earlier connection's moveBy, which is not what this is about
        await in_order(drone, device)
        device.received.clear()
        moving = asyncio.ensure_future(drone.piloting.move_by(100.0, 0.0, 0.0, 0.0))
        await device.until(ardrone3.MoveBy)
        deaf(device)
        moving.cancel()
        await asyncio.sleep(1.3)  # longer than five repetitions of 150 ms
        stopping = asyncio.ensure_future(drone.piloting.stop())
        await asyncio.sleep(0.1)
        assert not stopping.done()
        deaf(device, False)
        await stopping
        assert [m.dX for m in device.got(ardrone3.MoveBy)] == [100.0, 0.0]
        await drone.close()
