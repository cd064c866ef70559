"""The verbs of a drone over real sockets, against a device that answers as each test says."""

from __future__ import annotations

import asyncio
import logging
import math
from datetime import datetime

import pytest
from support.fault_scenarios import watched
from support.scripted_device import SETTINGS, STATES, ScriptedDevice

from anafi_mav.arsdk.codec.wire import Message, MessageId, UnknownMessage
from anafi_mav.arsdk.messages import alarms, animation, ardrone3, common, follow_me, move, rth
from anafi_mav.arsdk.messages.ardrone3 import (
    FlyingState,
    MoveByError,
    MoveToStatus,
    OrientationMode,
    PoiMode,
    PoiStatus,
)
from anafi_mav.arsdk.messages.rth import RthState, StateReason
from anafi_mav.drone import Displacement, Drone, MoveEnd, PilotingCommand, Range
from anafi_mav.errors import (
    CommandRejected,
    CommandTimeout,
    Disconnected,
    LinkLost,
    LocalProtocolError,
    NotSupported,
)

SHORT = 0.3
"""s to wait for a drone that is meant to stay silent."""


async def reported(drone: Drone, device: ScriptedDevice, *events: Message) -> None:
    """Let the device say this and the drone hear it."""
    heard = asyncio.ensure_future(drone.expect(type(events[-1]), lambda message: message == events[-1]))
    await asyncio.sleep(0)
    device.say(*events)
    await heard


async def flying(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, ardrone3.FlyingStateChanged(FlyingState.HOVERING))


def running(command: ardrone3.MoveTo, status: MoveToStatus = MoveToStatus.RUNNING) -> ardrone3.MoveToChanged:
    return ardrone3.MoveToChanged(
        command.latitude, command.longitude, command.altitude, command.orientation_mode, command.heading, status
    )


def following(mode: follow_me.Mode) -> follow_me.State:
    behavior = follow_me.Behavior.IDLE if mode == follow_me.Mode.NONE else follow_me.Behavior.FOLLOW
    return follow_me.State(mode, behavior, follow_me.Animation.NONE, 0)


def zeros(device: ScriptedDevice) -> list[ardrone3.PCMD]:
    return [p for p in device.got(ardrone3.PCMD) if (p.roll, p.pitch, p.yaw, p.gaz) == (0, 0, 0, 0)]


# -- the connection


async def test_message_log_contains_each_sent_command(
    drone: Drone, device: ScriptedDevice, caplog: pytest.LogCaptureFixture
) -> None:
    """With `-vv` the log is a trace of both directions, which a report from a real aircraft needs."""
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    with caplog.at_level(logging.DEBUG, "anafi_mav.message"):
        await drone.piloting.move_to(48.0, 2.0, 10.0)
    assert any("sent MoveTo(latitude=48.0" in record.getMessage() for record in caplog.records)
    assert any("MoveToChanged(" in record.getMessage() for record in caplog.records)


async def test_connect_requests_all_states_and_awaits_them(device: ScriptedDevice) -> None:
    drone = device.drone()
    assert not drone.connected
    seen: list[str] = []
    undo = drone.subscribe(lambda message, now: seen.append(message.NAME))
    await drone.connect()
    assert drone.connected
    assert [type(m) for _, m in device.received] == [common.CurrentDateTime, common.AllStates, common.AllSettings]
    assert drone.piloting.state.flying == FlyingState.LANDED
    assert drone.piloting.state.max_tilt == Range(10.0, 1.0, 40.0)
    identity = drone.identity
    assert (identity.model.key, identity.serial, identity.firmware) == ("4k", "PI040416DA9H000001", "1.8.2")
    assert identity.name == "ANAFI-H000001"
    assert len(seen) == len(STATES) + len(SETTINGS) + 2
    undo()
    await reported(drone, device, common.BatteryStateChanged(79))
    assert len(seen) == len(STATES) + len(SETTINGS) + 2
    with pytest.raises(LocalProtocolError):
        await drone.connect()
    await drone.close()
    await drone.close()
    assert not drone.connected


async def test_date_is_local_time_with_its_offset(device: ScriptedDevice) -> None:
    class Clock:
        def monotonic(self) -> float:
            return 0.0

        def time(self) -> float:
            return 1_700_000_000.0

    drone = device.drone(clock=Clock())
    await drone.connect()
    text = device.got(common.CurrentDateTime)[0].datetime
    assert len(text) == len("20231114T221320+0000")
    assert datetime.strptime(text, "%Y%m%dT%H%M%S%z").timestamp() == 1_700_000_000.0
    await drone.close()


async def test_connect_without_all_states_fails(device: ScriptedDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("anafi_mav.drone.startup_queries.STATES_TIMEOUT", SHORT)
    del device.script[common.AllSettings]
    drone = device.drone()
    with pytest.raises(LinkLost, match="all its settings"):
        await drone.connect()
    assert not drone.connected
    assert drone.lost.done()


async def test_connect_to_an_empty_address_raises_link_lost() -> None:
    with pytest.raises(LinkLost):
        await Drone("127.0.0.1", discovery_port=1).connect()


async def test_lost_link_ends_every_wait_and_is_reported(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    waits = [
        asyncio.ensure_future(wait)
        for wait in (
            drone.piloting.return_home(),
            drone.piloting.move_by(1.0, 0.0, 0.0, 0.0),
            drone.piloting.move_to(48.0, 2.0, 10.0),
            drone.piloting.land(),
            drone.piloting.set_max_tilt(20.0),
            drone.expect(ardrone3.AltitudeChanged),
        )
    ]
    await device.until(ardrone3.MaxTilt)
    device.session.end("gone")
    results = await asyncio.gather(*waits, return_exceptions=True)
    assert [type(result) for result in results] == [Disconnected] * len(waits)
    assert await asyncio.wait_for(asyncio.shield(drone.lost), 5.0)
    assert not drone.connected
    assert drone.moves_started == ()
    with pytest.raises(LinkLost):
        drone.piloting.hover()
    with pytest.raises(LinkLost):
        await drone.piloting.take_off()


async def test_a_new_connection_begins_with_nothing_of_the_old(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    await reported(drone, device, common.BatteryStateChanged(33))
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.0, 2.0, 10.0)
    assert drone.moves_started == (journey,)
    lost = drone.lost
    device.session.end("gone")
    await asyncio.wait([lost], timeout=5.0)
    assert lost.done()
    assert await journey.result() is MoveEnd.LINK_LOST

    device.received.clear()
    device.script[common.AllStates] = lambda _: [STATES[0], common.AllStatesChanged()]
    await drone.connect()
    assert drone.connected
    assert drone.lost is not lost
    assert drone.battery.state.percent is None
    assert drone.piloting.state.flying == FlyingState.LANDED
    assert drone.moves_started == ()
    drone.piloting.hover()
    device.say(common.BatteryStateChanged(32))
    await drone.expect(common.BatteryStateChanged)
    assert [type(m) for _, m in device.received] == [common.CurrentDateTime, common.AllStates, common.AllSettings]


async def test_failing_subscriber_does_not_affect_others(
    drone: Drone, device: ScriptedDevice, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(message: Message, now: float) -> None:
        raise RuntimeError("mine")

    heard: list[Message] = []
    drone.subscribe(fail)
    drone.subscribe(lambda message, now: heard.append(message))
    await reported(drone, device, common.BatteryStateChanged(50))
    await reported(drone, device, common.BatteryStateChanged(49))
    assert drone.connected
    assert len(heard) == 2
    assert "a subscriber failed on common.CommonState.BatteryStateChanged" in caplog.text


async def test_unknown_message_is_counted(drone: Drone, device: ScriptedDevice) -> None:
    device.session.send(UnknownMessage(MessageId(200, 1, 2), b"whatever"))
    await reported(drone, device, common.BatteryStateChanged(50))
    assert drone.counters["unknown message"] == 1


async def test_unknown_model_is_named_by_its_number() -> None:
    async with ScriptedDevice(model_id=0x0999) as device:
        drone = device.drone()
        await drone.connect()
        assert (drone.identity.model.id, drone.identity.model.key) == (0x0999, "0x0999")
        await drone.close()


async def test_expect_accepts_the_next_matching_message(drone: Drone, device: ScriptedDevice) -> None:
    wait = asyncio.ensure_future(drone.expect(common.BatteryStateChanged, lambda m: m.percent < 50))
    await asyncio.sleep(0)
    device.say(common.BatteryStateChanged(60), common.BatteryStateChanged(40), common.BatteryStateChanged(30))
    assert (await wait).percent == 40
    with pytest.raises(CommandTimeout):
        await drone.expect(common.BatteryStateChanged, timeout=0.05)

    def broken(message: common.BatteryStateChanged) -> bool:
        raise ValueError("mine")

    wait = asyncio.ensure_future(drone.expect(common.BatteryStateChanged, broken))
    await asyncio.sleep(0)
    device.say(common.BatteryStateChanged(20))
    with pytest.raises(ValueError, match="mine"):
        await wait
    assert drone.connected


# -- up and down


async def test_timeout_of_nan_raises_and_sends_nothing(drone: Drone, device: ScriptedDevice) -> None:
    """In asyncio's heap of timers NaN would hold back those of others, as the one that centres the sticks."""
    await flying(drone, device)
    before = len(device.received)
    for call in (
        drone.piloting.land(timeout=math.nan),
        drone.piloting.stop(timeout=math.nan),
        drone.piloting.return_home(timeout=math.nan),
        drone.piloting.cancel_return_home(timeout=math.nan),
        drone.piloting.move_by(1.0, 0.0, 0.0, 0.0, timeout=math.nan),
        drone.piloting.move_to(48.8, 2.3, 5.0, timeout=math.nan),
        drone.wait_for(FlyingState.LANDED, timeout=math.nan),
        drone.expect(ardrone3.FlyingStateChanged, timeout=math.nan),
        drone.video.next_frame(timeout=math.nan),
    ):
        with pytest.raises(LocalProtocolError, match="timeout"):
            await call
    await watched(SHORT)
    assert device.received[before:] == []


async def test_take_off_waits_through_the_ramping_for_takingoff(drone: Drone, device: ScriptedDevice) -> None:
    take_off = asyncio.ensure_future(drone.piloting.take_off(timeout=SHORT))
    await device.until(ardrone3.TakeOff)
    device.say(ardrone3.FlyingStateChanged(FlyingState.MOTOR_RAMPING))
    done, _ = await asyncio.wait([take_off], timeout=2 * SHORT)
    assert not done  # the motors turn: the drone has accepted
    device.say(ardrone3.FlyingStateChanged(FlyingState.TAKINGOFF))
    await take_off
    await drone.piloting.take_off()
    assert len(device.got(ardrone3.TakeOff)) == 1


@pytest.mark.parametrize(
    ("events", "reason"),
    [
        (
            [alarms.TakeoffChecklist(alarms.TakeoffChecklistType.DRONE_INCLINATION_TOO_HIGH, alarms.State.ON, 3)],
            "drone inclination too high",
        ),
        ([common.MagnetoCalibrationRequiredState(1)], "magnetometer calibration required"),
        ([ardrone3.AlertStateChanged(ardrone3.AlertState.CRITICAL_BATTERY)], "alert critical battery"),
    ],
)
async def test_silently_refused_takeoff_names_the_reported_reason(
    drone: Drone, device: ScriptedDevice, events: list[Message], reason: str
) -> None:
    await reported(drone, device, *events)
    with pytest.raises(CommandRejected) as caught:
        await drone.piloting.take_off(timeout=SHORT)
    assert caught.value.reason == reason


async def test_a_silent_refusal_without_a_reason_is_a_timeout(drone: Drone, device: ScriptedDevice) -> None:
    with pytest.raises(CommandTimeout, match=r"ardrone3\.Piloting\.TakeOff within 0\.3 s"):
        await drone.piloting.take_off(timeout=SHORT)


async def test_motors_stopping_again_are_a_refused_takeoff(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.TakeOff] = lambda _: [
        ardrone3.FlyingStateChanged(FlyingState.MOTOR_RAMPING),
        ardrone3.MotorErrorStateChanged(1, ardrone3.MotorError.ERROR_MOTOR_STALLED),
        ardrone3.FlyingStateChanged(FlyingState.LANDED),
    ]
    with pytest.raises(CommandRejected, match="motor error motor stalled"):
        await drone.piloting.take_off()


async def test_repeated_landed_does_not_refuse_a_takeoff(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.TakeOff] = lambda _: [
        ardrone3.FlyingStateChanged(FlyingState.LANDED),  # of before, a second time
        ardrone3.FlyingStateChanged(FlyingState.MOTOR_RAMPING),
        ardrone3.FlyingStateChanged(FlyingState.TAKINGOFF),
    ]
    await drone.piloting.take_off()


async def test_no_take_off_while_landing(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, ardrone3.FlyingStateChanged(FlyingState.LANDING))
    with pytest.raises(CommandRejected, match="landing"):
        await drone.piloting.take_off()
    assert device.got(ardrone3.TakeOff) == []


async def test_cut_motors_end_the_moves(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.0, 2.0, 15.0)
    relative = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    device.say(ardrone3.FlyingStateChanged(FlyingState.EMERGENCY))
    with pytest.raises(CommandRejected, match="motors are off"):
        await relative
    assert await journey.result() is MoveEnd.CANCELED
    assert drone.moves_started == ()


@pytest.mark.parametrize("state", [FlyingState.LANDING, FlyingState.LANDED])
async def test_land(drone: Drone, device: ScriptedDevice, state: FlyingState) -> None:
    await flying(drone, device)
    device.script[ardrone3.Landing] = lambda _: [ardrone3.FlyingStateChanged(state)]
    await drone.piloting.land()
    await drone.piloting.land()
    assert len(device.got(ardrone3.Landing)) == 1


async def test_no_stick_moves_from_the_order_to_land_on(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    drone.piloting.pilot(PilotingCommand(climb_mps=1.0))
    await device.until(ardrone3.PCMD, 2)
    land = asyncio.ensure_future(drone.piloting.land())
    await device.until(ardrone3.Landing)
    before = len(device.got(ardrone3.PCMD))
    drone.piloting.pilot(PilotingCommand(climb_mps=1.0))  # the drone has not said yet that it lands
    assert drone.piloting.sticks_blocked == "the drone is about to land"
    drone.piloting.hover()
    device.say(ardrone3.FlyingStateChanged(FlyingState.LANDING))
    await land
    drone.piloting.pilot(PilotingCommand(climb_mps=1.0))
    drone.piloting.hover()
    assert drone.piloting.sticks_blocked == "the drone is in the state landing"
    assert len(device.got(ardrone3.PCMD)) == before
    await device.quiet(ardrone3.PCMD)


async def test_emergency(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.Emergency] = lambda _: [ardrone3.FlyingStateChanged(FlyingState.EMERGENCY)]
    await drone.piloting.emergency()
    assert drone.piloting.state.motors_on is False


# -- relative moves


async def test_move_by_returns_the_flown_distance(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    flight = asyncio.ensure_future(drone.piloting.move_by(1.0, -2.0, 0.5, math.pi / 2))
    command = await device.until(ardrone3.MoveBy)
    assert command == ardrone3.MoveBy(1.0, -2.0, 0.5, pytest.approx(math.pi / 2))
    assert len(drone.moves_started) == 1
    device.say(ardrone3.FlyingStateChanged(FlyingState.FLYING))
    device.say(ardrone3.MoveByEnd(1.0, -2.0, 0.5, 1.5, MoveByError.OK))
    assert await flight == Displacement(1.0, -2.0, 0.5, 1.5)
    assert drone.moves_started == ()


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (MoveByError.BUSY, "the drone is busy"),
        (MoveByError.NOT_AVAILABLE, "a relative move is not available now"),
        (MoveByError.INTERRUPTED, "the move was interrupted"),
        (MoveByError(77), "the drone could not make the move"),
    ],
)
async def test_move_by_refused(drone: Drone, device: ScriptedDevice, error: MoveByError, reason: str) -> None:
    device.script[ardrone3.MoveBy] = lambda _: [ardrone3.MoveByEnd(0, 0, 0, 0, error)]
    with pytest.raises(CommandRejected) as caught:
        await drone.piloting.move_by(1.0, 0.0, 0.0, 0.0)
    assert caught.value.reason == reason


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", range(4))
async def test_move_by_end_without_a_number_ends_the_move(
    drone: Drone, device: ScriptedDevice, axis: int, number: float
) -> None:
    flown = [5.0, 0.0, 0.0, 0.0]
    flown[axis] = number
    device.script[ardrone3.MoveBy] = lambda _: [ardrone3.MoveByEnd(*flown, MoveByError.OK)]
    done = await drone.piloting.move_by(5.0, 0.0, 0.0, 0.0)
    assert (done.front, done.right, done.down, done.turn) == pytest.approx(tuple(flown), nan_ok=True)
    assert drone.piloting.move is None


async def test_a_newer_move_by_interrupts_the_older(drone: Drone, device: ScriptedDevice) -> None:
    older = asyncio.ensure_future(drone.piloting.move_by(10.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    newer = asyncio.ensure_future(drone.piloting.move_by(0.0, 5.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy, 2)
    device.say(ardrone3.MoveByEnd(3.0, 0, 0, 0, MoveByError.INTERRUPTED))
    with pytest.raises(CommandRejected, match="interrupted"):
        await older
    assert not newer.done()
    device.say(ardrone3.MoveByEnd(0, 5.0, 0, 0, MoveByError.OK))
    assert (await newer).right == 5.0


async def test_end_of_a_cancelled_move_by_leaves_the_next(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    first = asyncio.ensure_future(drone.piloting.move_by(10.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    drone.piloting.hover()
    second = asyncio.ensure_future(drone.piloting.move_by(0.0, 5.0, 0.0, 0.0))
    with pytest.raises(CommandRejected, match="stopped by hover"):
        await first
    await device.until(ardrone3.MoveBy, 3)
    assert device.got(ardrone3.MoveBy)[1] == ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0)
    device.say(
        ardrone3.MoveByEnd(3.0, 0, 0, 0, MoveByError.INTERRUPTED),  # the first
        ardrone3.MoveByEnd(0, 0, 0, 0, MoveByError.OK),  # the zero move that stopped it
    )
    await asyncio.sleep(0.5)  # of the flight
    device.say(ardrone3.MoveByEnd(0, 5.0, 0, 0, MoveByError.OK))
    assert (await second).right == 5.0


async def test_move_by_of_an_earlier_connection_is_among_what_ends_an_unheard_motion(device: ScriptedDevice) -> None:
    """No event tells of it: it may be flown until a hover has cancelled it."""
    states = [ardrone3.FlyingStateChanged(FlyingState.HOVERING), *STATES[1:], common.AllStatesChanged()]
    device.script[common.AllStates] = lambda _: states
    async with device.connected() as drone:
        assert drone.piloting.stopping() == [ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0)]
        drone.piloting.hover()
        assert drone.piloting.stopping() == []


async def test_timed_out_move_by_is_stopped(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    with pytest.raises(CommandTimeout):
        await drone.piloting.move_by(10.0, 0.0, 0.0, 0.0, timeout=SHORT)
    assert await device.until(ardrone3.MoveBy, 2) == ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0)
    assert drone.moves_started == ()

    cancelled = asyncio.ensure_future(drone.piloting.move_by(10.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy, 3)
    cancelled.cancel()
    assert await device.until(ardrone3.MoveBy, 4) == ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0)


async def test_moves_with_nan_raise(drone: Drone, device: ScriptedDevice) -> None:
    with pytest.raises(LocalProtocolError):
        await drone.piloting.move_by(math.nan, 0.0, 0.0, 0.0)
    with pytest.raises(LocalProtocolError):
        await drone.piloting.move_to(48.0, math.inf, 0.0)
    with pytest.raises(LocalProtocolError):
        await drone.piloting.move_to(48.0, 2.0, 10.0, horizontal_speed=0.0)
    with pytest.raises(LocalProtocolError):
        await drone.piloting.set_max_tilt(math.nan)
    assert drone.moves_started == ()


# -- absolute moves


async def test_move_to_returns_under_way_and_result_at_end(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.8789, 2.3677, 15.0)
    assert device.got(ardrone3.MoveTo) == [ardrone3.MoveTo(48.8789, 2.3677, 15.0, OrientationMode.NONE, 0.0)]
    assert drone.piloting.move is journey
    assert not journey.ended.done()
    device.say(running(device.got(ardrone3.MoveTo)[0], MoveToStatus.DONE))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.DONE
    assert drone.moves_started == ()


@pytest.mark.parametrize(("heading", "sent"), [(0.0, 0.0), (90.0, 90.0), (-90.0, 270.0), (360.0, 0.0), (725.0, 5.0)])
async def test_move_to_with_a_heading_turns_on_the_way(
    drone: Drone, device: ScriptedDevice, heading: float, sent: float
) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0, heading_deg=heading)
    command = device.got(ardrone3.MoveTo)[0]
    assert (command.orientation_mode, command.heading) == (OrientationMode.HEADING_DURING, sent)


@pytest.mark.parametrize(
    ("orientation", "heading", "sent"),
    [
        (OrientationMode.NONE, None, 0.0),
        (OrientationMode.TO_TARGET, None, 0.0),
        (OrientationMode.HEADING_START, -90.0, 270.0),
        (OrientationMode.HEADING_DURING, 90.0, 90.0),
    ],
)
async def test_move_to_turns_by_its_orientation(
    drone: Drone, device: ScriptedDevice, orientation: OrientationMode, heading: float | None, sent: float
) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0, heading_deg=heading, orientation=orientation)
    assert device.got(ardrone3.MoveTo) == [ardrone3.MoveTo(48.0, 2.0, 15.0, orientation, sent)]
    with pytest.raises(LocalProtocolError):  # a heading too many, or none
        await drone.piloting.move_to(
            48.0, 2.0, 15.0, heading_deg=30.0 if heading is None else None, orientation=orientation
        )
    assert len(device.got(ardrone3.MoveTo)) == 1


async def test_move_to_with_one_speed_uses_drone_limits(drone: Drone, device: ScriptedDevice) -> None:
    device.script[move.ExtendedMoveTo] = lambda c: [
        ardrone3.MoveToChanged(
            c.latitude, c.longitude, c.altitude, OrientationMode(c.orientation_mode), c.heading, MoveToStatus.RUNNING
        )
    ]
    await drone.piloting.move_to(48.0, 2.0, 15.0, 180.0, horizontal_speed=5.0)
    assert device.got(move.ExtendedMoveTo) == [
        move.ExtendedMoveTo(48.0, 2.0, 15.0, move.OrientationMode.HEADING_DURING, 180.0, 5.0, 3.0, 40.0)
    ]


async def test_legacy_return_state_counts_until_rth_state_is_received(device: ScriptedDevice) -> None:
    """A firmware that sends NavigateHomeStateChanged alone; icing has another number there."""
    legacy = ardrone3.NavigateHomeStateChanged
    states = [one for one in STATES if not isinstance(one, rth.State)]
    device.script[common.AllStates] = lambda _: [*states, common.AllStatesChanged()]
    drone = device.drone()
    await drone.connect()
    home = drone.home
    heard = asyncio.ensure_future(drone.expect(rth.State))
    await asyncio.sleep(0)
    device.say(legacy(ardrone3.NavigateHomeState.IN_PROGRESS, ardrone3.NavigateHomeReason.ICING))
    await heard
    assert (home.state.rth, home.state.reason) == (RthState.IN_PROGRESS, StateReason.ICING)
    assert home.state.returning_by_itself
    await reported(drone, device, rth.State(RthState.AVAILABLE, StateReason.STOPPED))
    await reported(drone, device, legacy(ardrone3.NavigateHomeState.PENDING, ardrone3.NavigateHomeReason.USER_REQUEST))
    assert home.state.rth == RthState.AVAILABLE
    await drone.close()


def rounded(command: ardrone3.MoveTo, status: MoveToStatus, metres: float) -> ardrone3.MoveToChanged:
    """An event of a firmware that has the target from its own frame: so many metres north and 1 cm lower."""
    return ardrone3.MoveToChanged(
        command.latitude + metres / 111_195.0, command.longitude, command.altitude - 0.01, command.orientation_mode,
        command.heading, status,
    )  # fmt: skip


async def test_move_to_with_rounded_echo_is_under_way(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [rounded(command, MoveToStatus.RUNNING, 0.8)]
    journey = await drone.piloting.move_to(48.8789, 2.3677, 15.0, timeout=SHORT)
    device.say(rounded(device.got(ardrone3.MoveTo)[0], MoveToStatus.DONE, 0.8))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.DONE


async def test_move_to_with_wrong_echo_is_not_under_way(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [rounded(command, MoveToStatus.RUNNING, 1.2)]
    with pytest.raises(CommandTimeout):
        await drone.piloting.move_to(48.8789, 2.3677, 15.0, timeout=SHORT)


async def test_rounded_echo_with_another_unanswered_move_to_is_ignored(drone: Drone, device: ScriptedDevice) -> None:
    """The late RUNNING of a move that was cancelled, half a metre from the new one, starts nothing."""
    await flying(drone, device)
    first = asyncio.ensure_future(drone.piloting.move_to(48.8789, 2.3677, 15.0))
    command = await device.until(ardrone3.MoveTo)
    drone.piloting.hover()
    with pytest.raises(CommandRejected):
        await first
    second = asyncio.ensure_future(drone.piloting.move_to(48.8789 + 0.5 / 111_195.0, 2.3677, 15.0, timeout=SHORT))
    await device.until(ardrone3.MoveTo, 2)
    await reported(drone, device, rounded(command, MoveToStatus.RUNNING, 0.1))
    with pytest.raises(CommandTimeout):
        await second


@pytest.mark.parametrize("status", [MoveToStatus.ERROR, MoveToStatus.CANCELED])
async def test_move_to_refused(drone: Drone, device: ScriptedDevice, status: MoveToStatus) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command, status)]
    with pytest.raises(CommandRejected):
        await drone.piloting.move_to(48.0, 2.0, 15.0)
    assert drone.moves_started == ()


async def test_a_newer_move_to_replaces_the_older(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    older = await drone.piloting.move_to(48.0, 2.0, 15.0)
    newer = await drone.piloting.move_to(49.0, 2.0, 15.0)
    assert await older.result() is MoveEnd.REPLACED
    # A late word about the older one does not end the newer.
    await reported(drone, device, running(device.got(ardrone3.MoveTo)[0], MoveToStatus.DONE))
    assert drone.moves_started == (newer,)
    await reported(drone, device, running(device.got(ardrone3.MoveTo)[1], MoveToStatus.DONE))
    assert await newer.result() is MoveEnd.DONE


async def test_refused_newer_move_to_keeps_the_older_active(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    older = await drone.piloting.move_to(48.0, 2.0, 15.0)
    device.script[ardrone3.MoveTo] = lambda command: [running(command, MoveToStatus.ERROR)]
    with pytest.raises(CommandRejected):
        await drone.piloting.move_to(49.0, 2.0, 15.0)
    assert drone.moves_started == (older,)
    assert not older.ended.done()
    drone.piloting.hover()
    await device.until(ardrone3.CancelMoveTo)
    device.say(running(device.got(ardrone3.MoveTo)[0], MoveToStatus.CANCELED))
    assert await asyncio.wait_for(older.result(), 3.0) is MoveEnd.CANCELED


async def test_older_move_to_may_arrive_before_the_newer_begins(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    older = await drone.piloting.move_to(48.0, 2.0, 15.0)
    device.script[ardrone3.MoveTo] = lambda command: [running(command, MoveToStatus.DONE), running(command)]
    newer = await drone.piloting.move_to(48.0, 2.0, 15.0)
    assert await older.result() is MoveEnd.DONE
    assert drone.moves_started == (newer,)


async def test_move_to_replaced_before_its_answer_is_withdrawn(drone: Drone, device: ScriptedDevice) -> None:
    older = asyncio.ensure_future(drone.piloting.move_to(48.0, 2.0, 15.0))
    await device.until(ardrone3.MoveTo)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    newer = await drone.piloting.move_to(49.0, 2.0, 15.0)
    with pytest.raises(CommandRejected, match="newer"):
        await older
    assert drone.moves_started == (newer,)
    assert device.got(ardrone3.CancelMoveTo) == []


async def test_canceled_event_leaves_next_move_to_same_place(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    first = await drone.piloting.move_to(48.0, 2.0, 15.0)
    device.script[ardrone3.CancelMoveTo] = lambda _: [running(device.got(ardrone3.MoveTo)[0], MoveToStatus.CANCELED)]
    drone.piloting.hover()
    second = await drone.piloting.move_to(48.0, 2.0, 15.0)
    assert await first.result() is MoveEnd.CANCELED
    assert drone.moves_started == (second,)
    await reported(drone, device, running(device.got(ardrone3.MoveTo)[1], MoveToStatus.DONE))
    assert await second.result() is MoveEnd.DONE


async def test_late_event_of_aborted_move_leaves_the_next(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    first = asyncio.ensure_future(drone.piloting.move_to(48.0, 2.0, 15.0))
    await device.until(ardrone3.MoveTo)
    drone.piloting.hover()
    with pytest.raises(CommandRejected, match="hover"):
        await first
    second = asyncio.ensure_future(drone.piloting.move_to(48.0, 2.0, 15.0))
    await device.until(ardrone3.MoveTo, 2)
    one, two = device.got(ardrone3.MoveTo)
    assert (two.latitude, two.longitude, two.altitude) == (48.0, 2.0, 14.998)
    await reported(drone, device, running(one), running(one, MoveToStatus.CANCELED))
    assert not second.done()
    await reported(drone, device, running(two))
    journey = await second
    assert journey.running
    assert drone.moves_started == (journey,)
    # Once it is flown, nothing can be confused any more.
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    assert device.got(ardrone3.MoveTo)[-1].altitude == 15.0


@pytest.mark.parametrize(("height", "again"), [(2000.0, 1999.996), (1e300, 1e300 - 2e294)])
async def test_moves_are_distinguished_at_any_height(
    drone: Drone, device: ScriptedDevice, height: float, again: float
) -> None:
    await flying(drone, device)
    for number in (1, 2):
        move = asyncio.ensure_future(drone.piloting.move_to(48.0, 2.0, height))
        await device.until(ardrone3.MoveTo, number)
        drone.piloting.hover()
        with pytest.raises(CommandRejected, match="hover"):
            await move
    assert [move.altitude for move in device.got(ardrone3.MoveTo)] == pytest.approx([height, again], rel=1e-12)


async def test_timed_out_move_to_is_cancelled(drone: Drone, device: ScriptedDevice) -> None:
    with pytest.raises(CommandTimeout):
        await drone.piloting.move_to(48.0, 2.0, 15.0, timeout=SHORT)
    await device.until(ardrone3.CancelMoveTo)
    assert drone.moves_started == ()


async def test_landing_ends_a_move_to(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.0, 2.0, 15.0)
    device.say(ardrone3.FlyingStateChanged(FlyingState.LANDED))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.CANCELED


async def test_cancelled_wait_for_the_result_keeps_the_move(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.0, 2.0, 15.0)
    with pytest.raises(asyncio.TimeoutError):
        await asyncio.wait_for(journey.result(), 0.05)
    device.say(running(device.got(ardrone3.MoveTo)[0], MoveToStatus.DONE))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.DONE


# -- home


@pytest.mark.parametrize("state", [RthState.IN_PROGRESS, RthState.PENDING])
async def test_return_home(drone: Drone, device: ScriptedDevice, state: RthState) -> None:
    device.script[rth.ReturnToHome] = lambda _: [rth.State(state, StateReason.USER_REQUEST)]
    journey = await drone.piloting.return_home()
    assert journey is not None
    assert drone.moves_started == (journey,)
    assert await drone.piloting.return_home() is None
    device.say(rth.State(RthState.AVAILABLE, StateReason.FINISHED))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.DONE
    assert drone.moves_started == ()


async def test_return_home_unavailable(drone: Drone, device: ScriptedDevice) -> None:
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.UNAVAILABLE, StateReason.DISABLED)]
    with pytest.raises(CommandRejected, match="unavailable: disabled"):
        await drone.piloting.return_home()
    with pytest.raises(CommandRejected, match="unavailable"):
        await drone.piloting.return_home()
    assert len(device.got(rth.ReturnToHome)) == 1
    assert drone.moves_started == ()


async def test_return_home_takes_the_hands_off_the_sticks(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.PENDING, StateReason.USER_REQUEST)]
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await device.until(ardrone3.PCMD, 2)
    await drone.piloting.return_home()
    assert device.got(ardrone3.PCMD)[-1].flag == 0
    assert len(device.got(rth.ReturnToHome)) == 1


async def test_cancel_return_home(drone: Drone, device: ScriptedDevice) -> None:
    assert not await drone.piloting.cancel_return_home()
    assert device.got(rth.Abort) == []
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.CONNECTION_LOST))
    with pytest.raises(CommandRejected, match="by itself"):
        await drone.piloting.cancel_return_home()
    assert device.got(rth.Abort) == []
    device.script[rth.Abort] = lambda _: [rth.State(RthState.AVAILABLE, StateReason.STOPPED)]
    assert await drone.piloting.cancel_return_home(even_its_own=True)
    assert len(device.got(rth.Abort)) == 1


async def test_return_during_its_cancellation_is_commanded_again(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST))
    cancelled = asyncio.ensure_future(drone.piloting.cancel_return_home())
    await device.until(rth.Abort)  # what the drone last said, that it returns, is not true for long
    again = asyncio.ensure_future(drone.piloting.return_home())
    await device.until(rth.ReturnToHome)
    device.say(rth.State(RthState.AVAILABLE, StateReason.STOPPED))
    await cancelled
    device.say(rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST))
    assert await again is not None


async def test_return_possibly_delivered_is_aborted(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    home = asyncio.ensure_future(drone.piloting.return_home())
    await device.until(rth.ReturnToHome)
    home.cancel()  # by a newer order, before the drone has said anything
    await asyncio.wait([home])
    cancelled = asyncio.ensure_future(drone.piloting.cancel_return_home())
    await device.until(rth.Abort)
    device.say(rth.State(RthState.AVAILABLE, StateReason.STOPPED))
    await cancelled
    assert drone.moves_started == ()


# -- sticks and hover


async def test_pilot_sends_percent_of_drone_limits_at_20_hz(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    for renewed in (5, 10, 15, 21):
        drone.piloting.pilot(PilotingCommand(roll_deg=5.0, pitch_deg=2.0, yaw_rate_dps=-10.0, climb_mps=1.5))
        await device.until(ardrone3.PCMD, renewed)
    pcmds = device.got(ardrone3.PCMD)
    # of 10 degrees, 40 deg/s, 3 m/s
    assert {(p.flag, p.roll, p.pitch, p.yaw, p.gaz) for p in pcmds} == {(1, 50, -20, -25, 50)}
    drone.piloting.pilot(None)
    await device.until(ardrone3.PCMD, 23)
    assert device.got(ardrone3.PCMD)[-1].roll == 0


async def test_unrepeated_sticks_centre_after_half_a_second(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await device.until(ardrone3.PCMD, 50)
    assert [p.roll for p in device.got(ardrone3.PCMD)] == [50] * 10 + [0] * 40


async def test_every_new_setpoint_leaves_at_once(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    for roll in range(1, 6):
        drone.piloting.pilot(PilotingCommand(roll_deg=float(roll)))
        assert (await device.until(ardrone3.PCMD, roll, timeout=0.04)).roll == 10 * roll


async def test_only_the_newest_of_many_setpoints_leaves(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    for tenth in range(1, 101):
        drone.piloting.pilot(PilotingCommand(roll_deg=0.1 * tenth))
    await device.until(ardrone3.PCMD, 3)
    assert [p.roll for p in device.got(ardrone3.PCMD)][:3] == [1, 2, 100]


async def test_sticks_need_the_limits_and_an_airborne_drone(drone: Drone, device: ScriptedDevice) -> None:
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    assert drone.piloting.sticks_blocked == "the drone is in the state landed"
    await flying(drone, device)
    drone.piloting.set_state(type(drone.piloting.state)(flying=FlyingState.HOVERING))
    with pytest.raises(NotSupported):
        drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    with pytest.raises(NotSupported):
        await drone.piloting.move_to(48.0, 2.0, 10.0, horizontal_speed=1.0)
    await reported(drone, device, common.BatteryStateChanged(1))
    assert device.got(ardrone3.PCMD) == []  # nor did the one before the take-off wait for its moment


async def test_hover_repeats_zero_for_two_seconds(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    drone.piloting.hover()
    await device.until(ardrone3.PCMD, 41)
    times = device.times(ardrone3.PCMD)
    assert len(zeros(device)) == 40
    assert times[40] - times[1] == pytest.approx(1.95, abs=0.1)
    await device.quiet(ardrone3.PCMD)
    assert len(device.got(ardrone3.PCMD)) == 41


async def test_hover_with_nothing_running_sends_sticks_only(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.received.clear()
    drone.piloting.hover()
    await device.until(ardrone3.PCMD, 3)
    assert {type(message) for _, message in device.received} == {ardrone3.PCMD}


async def test_hover_cancels_the_verbs_of_this_controller(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)]
    home = await drone.piloting.return_home()
    assert home is not None
    relative = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    journey = await drone.piloting.move_to(48.0, 2.0, 15.0)
    await reported(drone, device, ardrone3.PilotedPOIV2(48.0, 2.0, 0.0, PoiMode.LOCKED_GIMBAL, PoiStatus.RUNNING))
    assert len(drone.moves_started) == 3
    device.received.clear()
    drone.piloting.hover()
    assert drone.moves_started == ()
    await device.until(rth.Abort)
    await device.until(ardrone3.PCMD)
    sent = [message for _, message in device.received if not isinstance(message, ardrone3.PCMD)]
    assert sent == [
        ardrone3.CancelMoveTo(),
        ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0),
        ardrone3.StopPilotedPOI(),
        rth.Abort(),
    ]
    with pytest.raises(CommandRejected, match="hover"):
        await relative
    assert await home.result() is MoveEnd.CANCELED
    device.say(ardrone3.MoveToChanged(48.0, 2.0, 15.0, OrientationMode.NONE, 0.0, MoveToStatus.CANCELED))
    assert await asyncio.wait_for(journey.result(), 3.0) is MoveEnd.CANCELED
    # Once is enough.
    device.received.clear()
    drone.piloting.hover()
    await device.until(ardrone3.PCMD, 2)
    assert device.got(ardrone3.CancelMoveTo) == []
    assert device.got(rth.Abort) == []


async def test_hover_during_move_by_cancels_another_controllers_move_to(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    await reported(drone, device, running(ardrone3.MoveTo(48.0, 2.0, 15.0, OrientationMode.NONE, 0.0)))
    relative = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    drone.piloting.hover()
    with pytest.raises(CommandRejected, match="hover"):
        await relative
    await device.until(ardrone3.CancelMoveTo)
    assert device.got(ardrone3.MoveBy)[-1] == ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0)


async def test_hover_ends_follow_me_and_animation(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    await reported(drone, device, following(follow_me.Mode.GEOGRAPHIC))
    await reported(drone, device, animation.State(animation.Type.SPIRAL, 10))
    drone.piloting.hover()
    drone.piloting.hover()  # once is enough
    stopping = asyncio.ensure_future(drone.piloting.stop())
    await device.until(follow_me.Stop)
    await device.until(animation.Cancel)
    await reported(drone, device, following(follow_me.Mode.NONE))
    assert not stopping.done()
    device.say(animation.State(animation.Type.NONE, 0))
    await stopping
    assert (len(device.got(follow_me.Stop)), len(device.got(animation.Cancel))) == (1, 1)


@pytest.mark.parametrize(("mode", "stops"), [(follow_me.Mode.RELATIVE, 1), (follow_me.Mode.LOOK_AT, 0)])
async def test_setpoint_replaces_the_active_automatic_flight(
    drone: Drone, device: ScriptedDevice, mode: follow_me.Mode, stops: int
) -> None:
    await flying(drone, device)
    await reported(drone, device, following(mode))
    await reported(drone, device, animation.State(animation.Type.DRONIE, 10))
    for _ in range(3):
        drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await device.until(ardrone3.PCMD, 3)
    assert (len(device.got(follow_me.Stop)), len(device.got(animation.Cancel))) == (stops, 1)


async def test_return_cancels_what_the_drone_flies_before_it_is_sent(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.PENDING, StateReason.USER_REQUEST)]
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    relative = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    await reported(drone, device, ardrone3.PilotedPOIV2(48.0, 2.0, 0.0, PoiMode.LOCKED_GIMBAL, PoiStatus.RUNNING))
    device.received.clear()
    home = await drone.piloting.return_home()
    assert drone.moves_started == (home,)
    sent = [message for _, message in device.received if not isinstance(message, ardrone3.PCMD)]
    assert sent == [
        ardrone3.CancelMoveTo(),
        ardrone3.MoveBy(0.0, 0.0, 0.0, 0.0),
        ardrone3.StopPilotedPOI(),
        rth.ReturnToHome(),
    ]
    with pytest.raises(CommandRejected, match="return home"):
        await relative


async def test_hover_rejects_a_waiting_verb(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    waits = [
        asyncio.ensure_future(drone.piloting.return_home()),
        asyncio.ensure_future(drone.piloting.move_to(48.0, 2.0, 15.0)),
    ]
    await device.until(rth.ReturnToHome)
    await device.until(ardrone3.MoveTo)
    drone.piloting.hover()
    for wait in waits:
        with pytest.raises(CommandRejected, match="stopped by hover"):
            await wait
    await device.until(ardrone3.CancelMoveTo)
    await device.until(rth.Abort)


@pytest.mark.parametrize("reason", [StateReason.LOW_BATTERY, StateReason.CONNECTION_LOST])
async def test_hover_leaves_a_return_begun_by_the_drone(
    drone: Drone, device: ScriptedDevice, reason: StateReason
) -> None:
    await flying(drone, device)
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await device.until(ardrone3.PCMD)
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, reason))
    device.received.clear()
    drone.piloting.hover()
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    assert drone.piloting.sticks_blocked is not None
    await device.quiet()
    assert device.received == []


async def test_return_continued_for_the_battery_is_the_drones_own(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)]
    home = await drone.piloting.return_home()
    assert home is not None
    await reported(drone, device, rth.State(RthState.IN_PROGRESS, StateReason.LOW_BATTERY))
    assert await home.result() is MoveEnd.REPLACED
    drone.piloting.hover()
    await reported(drone, device, common.BatteryStateChanged(9))
    assert device.got(rth.Abort) == []


async def test_a_setpoint_takes_over_from_a_move_of_ours(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await device.until(ardrone3.CancelMoveTo)
    await device.until(ardrone3.PCMD, 3)
    assert len(device.got(ardrone3.CancelMoveTo)) == 1
    assert drone.moves_started == ()


async def test_release_of_unheld_sticks_sends_nothing(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    journey = await drone.piloting.move_to(48.0, 2.0, 15.0)
    drone.piloting.pilot(None)
    await reported(drone, device, common.BatteryStateChanged(1))
    assert drone.moves_started == (journey,)
    assert device.got(ardrone3.PCMD) == []


async def test_a_move_ends_the_zeros_of_hover(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    drone.piloting.hover()
    await device.until(ardrone3.PCMD, 2)
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    await device.quiet(ardrone3.PCMD)


async def test_stop_awaits_the_end_of_the_active_verb(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    await asyncio.wait_for(drone.piloting.stop(), 1.0)  # nothing is running
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    relative = asyncio.ensure_future(drone.piloting.move_by(1.0, 0.0, 0.0, 0.0))
    await device.until(ardrone3.MoveBy)
    stopped = asyncio.ensure_future(drone.piloting.stop())
    await device.until(ardrone3.MoveBy, 2)
    assert not stopped.done()
    device.say(ardrone3.MoveToChanged(48.0, 2.0, 15.0, OrientationMode.NONE, 0.0, MoveToStatus.CANCELED))
    device.say(ardrone3.MoveByEnd(0.5, 0, 0, 0, MoveByError.INTERRUPTED))
    await asyncio.wait_for(stopped, 3.0)
    with pytest.raises(CommandRejected):
        await relative


async def test_stop_waits_for_the_end_of_a_return(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[rth.ReturnToHome] = lambda _: [rth.State(RthState.IN_PROGRESS, StateReason.USER_REQUEST)]
    await drone.piloting.return_home()
    stopped = asyncio.ensure_future(drone.piloting.stop())
    await device.until(rth.Abort)
    assert not stopped.done()
    device.say(rth.State(RthState.AVAILABLE, StateReason.STOPPED))
    await asyncio.wait_for(stopped, 3.0)


async def test_stop_without_confirmation_raises(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.0, 2.0, 15.0)
    with pytest.raises(CommandTimeout):
        await drone.piloting.stop(timeout=SHORT)


async def test_stop_waits_for_all_states_although_one_end_is_reported_before(
    drone: Drone, device: ScriptedDevice
) -> None:
    """Those that follow name the panorama as under way: it has not ended, however long the drone hovers."""
    panorama = animation.State(animation.Type.HORIZONTAL_PANORAMA, 10)
    await flying(drone, device)
    await reported(drone, device, following(follow_me.Mode.LOOK_AT), panorama)
    device.script[common.AllStates] = lambda _: [following(follow_me.Mode.NONE)]
    asked = len(device.got(common.AllStates))
    stopped = asyncio.ensure_future(drone.piloting.stop())
    await device.until(common.AllStates, asked + 1)
    await watched(1.5)  # of a slow link
    device.say(panorama, common.AllStatesChanged())
    with pytest.raises(CommandTimeout):
        await stopped


# -- settings


@pytest.mark.parametrize(("asked", "confirmed"), [(20.0, 20.0), (90.0, 40.0), (0.0, 1.0)])
async def test_setting_returns_the_value_reported_by_the_drone(
    drone: Drone, device: ScriptedDevice, asked: float, confirmed: float
) -> None:
    device.script[ardrone3.MaxTilt] = lambda command: [
        ardrone3.MaxTiltChanged(min(max(command.current, 1.0), 40.0), 1.0, 40.0)
    ]
    assert await drone.piloting.set_max_tilt(asked) == confirmed
    assert drone.piloting.state.max_tilt == Range(confirmed, 1.0, 40.0)


async def test_concurrent_settings_get_their_own_answers(drone: Drone, device: ScriptedDevice) -> None:
    device.script[rth.SetMinAltitude] = lambda command: [rth.MinAltitude(command.altitude, 20.0, 100.0)]
    assert await asyncio.gather(drone.piloting.set_min_altitude(30.0), drone.piloting.set_min_altitude(40.0)) == [
        30.0,
        40.0,
    ]


async def test_setting_never_reported_is_unsupported(drone: Drone, device: ScriptedDevice) -> None:
    for verb in (drone.piloting.set_max_altitude, drone.piloting.set_max_distance):
        with pytest.raises(NotSupported):
            await verb(100.0)
    device.script[ardrone3.MaxVerticalSpeed] = lambda c: [ardrone3.MaxVerticalSpeedChanged(c.current, 0.1, 4.0)]
    device.script[ardrone3.MaxRotationSpeed] = lambda c: [ardrone3.MaxRotationSpeedChanged(c.current, 3.0, 200.0)]
    assert await drone.piloting.set_max_vertical_speed(2.0) == 2.0
    assert await drone.piloting.set_max_rotation_speed(100.0) == 100.0


# -- commands are withdrawn


@pytest.mark.parametrize("how", ["timeout", "cancel"])
async def test_a_command_reported_failed_is_never_carried_out(drone: Drone, device: ScriptedDevice, how: str) -> None:
    session = drone._session
    assert session is not None
    session.mute = True  # the air is gone: nothing arrives, nothing is acknowledged
    take_off = asyncio.ensure_future(drone.piloting.take_off(timeout=SHORT))
    if how == "cancel":
        await asyncio.sleep(0)
        take_off.cancel()
    with pytest.raises((CommandTimeout, asyncio.CancelledError)):
        await take_off
    session.mute = False
    # What is sent later in the same, ordered queue arrives, and the take-off has not.
    device.script[ardrone3.MaxTilt] = lambda command: [ardrone3.MaxTiltChanged(command.current, 1.0, 40.0)]
    await drone.piloting.set_max_tilt(15.0)
    assert device.got(ardrone3.TakeOff) == []


async def iterations(count: int) -> None:
    """Let the event loop run: a datagram is received in the iteration after the one that sends it."""
    for _ in range(count):
        await asyncio.sleep(0)


async def test_sticks_leave_in_the_iteration_that_sets_them(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    drone.piloting.pilot(PilotingCommand(roll_deg=5.0))
    await iterations(2)
    assert [pcmd.roll > 0 for pcmd in device.got(ardrone3.PCMD)] == [True]


async def test_move_leaves_in_the_iteration_that_asks_for_it(drone: Drone, device: ScriptedDevice) -> None:
    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    move = asyncio.ensure_future(drone.piloting.move_to(48.1, 2.1, 10.0))
    await iterations(3)
    assert len(device.got(ardrone3.MoveTo)) == 1
    await move


async def test_commands_of_one_iteration_share_a_frame_with_the_one_that_leaves_at_once(
    drone: Drone, device: ScriptedDevice
) -> None:
    """The moveTo waits for no acknowledgement of the CancelMoveTo before it."""

    async def again() -> None:
        drone.piloting.hover()
        await drone.piloting.move_to(48.2, 2.2, 10.0)

    await flying(drone, device)
    device.script[ardrone3.MoveTo] = lambda command: [running(command)]
    await drone.piloting.move_to(48.1, 2.1, 10.0)
    move = asyncio.ensure_future(again())
    await iterations(4)  # the datagram before has the sticks
    assert [command.latitude for command in device.got(ardrone3.MoveTo)] == [48.1, 48.2]
    assert len(device.got(ardrone3.CancelMoveTo)) == 1
    await move
