"""Ending a landing, stopping propellers on the ground, and a Landing that is repeated until it counts."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from support.scripted_device import ScriptedDevice

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.drone import Drone, PilotingCommand, sent_commands
from anafi_mav.drone.piloting import landing
from anafi_mav.drone.sent_commands import Expiry, Slot
from anafi_mav.errors import AnafiMavError, CommandRejected, CommandTimeout


def state(flying: FlyingState) -> Message:
    return ardrone3.FlyingStateChanged(flying)


async def reported(drone: Drone, device: ScriptedDevice, flying: FlyingState) -> None:
    heard = asyncio.ensure_future(drone.expect(ardrone3.FlyingStateChanged, lambda m: m.state == flying))
    await asyncio.sleep(0)
    device.say(state(flying))
    await heard


async def given(drone: Drone, kind: type[Message]) -> None:
    """Wait until a command of this kind is on its way, whether the drone receives it or not."""
    sent = asyncio.Event()
    drone.on_command = lambda message: sent.set() if isinstance(message, kind) else None
    await sent.wait()
    drone.on_command = None


def deaf(device: ScriptedDevice, command: Message) -> asyncio.Event:
    """Let the drone receive nothing from now on; return the event that this command is lost."""
    lost, content = asyncio.Event(), wire.encode(command)

    def air(data: bytes, inward: bool, hand_on: Callable[[bytes], None]) -> None:
        if not inward:
            hand_on(data)
        elif content in data:
            lost.set()

    device.session.air = air
    return lost


async def cancelled(work: asyncio.Future[None]) -> None:
    work.cancel()
    with pytest.raises(asyncio.CancelledError):
        await work


def gaz(device: ScriptedDevice) -> list[tuple[int, int, int, int, int]]:
    return [(p.flag, p.roll, p.pitch, p.yaw, p.gaz) for p in device.got(ardrone3.PCMD)]


UP, LEVEL = (0, 0, 0, 0, 100), (0, 0, 0, 0, 0)


async def begun(work: Awaitable[None]) -> asyncio.Future[None]:
    task = asyncio.ensure_future(work)
    await asyncio.sleep(0)
    return task


async def test_gaz_against_landing_lasts_until_another_state_is_reported(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 4)
    assert set(gaz(device)) == {UP}
    assert not ending.done()
    await reported(drone, device, FlyingState.HOVERING)
    await ending
    count = gaz(device).count(UP)
    await device.until(ardrone3.PCMD, count + 10)
    assert gaz(device)[count:] == [LEVEL] * (len(gaz(device)) - count)
    assert device.got(ardrone3.TakeOff) == device.got(ardrone3.SmartTakeOffLand) == []


async def test_gaz_against_landing_ends_after_a_second_centred(drone: Drone, device: ScriptedDevice) -> None:
    """A firmware that ignores it, or reports nothing: no stick outlives the second."""
    await reported(drone, device, FlyingState.LANDING)
    with pytest.raises(CommandRejected, match="drone still landing"):
        await drone.piloting.end_landing(timeout=1.5)
    await device.until(ardrone3.PCMD, gaz(device).count(UP) + 20)
    times = [at for at, m in device.received if isinstance(m, ardrone3.PCMD) and m.gaz]
    assert 10 <= len(times) <= 21
    assert times[-1] - times[0] <= 1.1
    assert gaz(device)[-20:] == [LEVEL] * 20


async def test_landing_of_another_levels_the_sticks_that_it_finds_deflected(
    drone: Drone, device: ScriptedDevice
) -> None:
    await reported(drone, device, FlyingState.FLYING)
    drone.piloting.pilot(PilotingCommand(roll_deg=10.0, pitch_deg=0.0, yaw_rate_dps=0.0, climb_mps=0.0))
    await device.until(ardrone3.PCMD, 2)
    count = len(gaz(device))
    assert gaz(device)[-1][1] > 0
    await reported(drone, device, FlyingState.LANDING)
    await device.until(ardrone3.PCMD, count + 5)
    assert set(gaz(device)[count:]) == {LEVEL}


async def test_touchdown_ends_the_gaz_and_nothing_starts_the_motors(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 2)
    await reported(drone, device, FlyingState.LANDED)
    with pytest.raises(CommandRejected, match="already landed"):
        await ending
    await device.quiet(ardrone3.PCMD)
    assert device.got(ardrone3.TakeOff) == []


@pytest.mark.parametrize("flying", [FlyingState.EMERGENCY_LANDING, FlyingState.EMERGENCY])
async def test_landing_becoming_forced_is_left_alone(drone: Drone, device: ScriptedDevice, flying: FlyingState) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 2)
    await reported(drone, device, flying)
    with pytest.raises(CommandRejected):
        await ending
    await device.quiet(ardrone3.PCMD)


@pytest.mark.parametrize(
    ("flying", "reason"),
    [
        (FlyingState.LANDED, "already landed"),
        (FlyingState.EMERGENCY_LANDING, "forced landing"),
        (FlyingState.EMERGENCY, "motors cut"),
    ],
)
async def test_end_of_a_landing_that_is_over_or_forced_is_refused(
    drone: Drone, device: ScriptedDevice, flying: FlyingState, reason: str
) -> None:
    """A caller that received no refusal would report a landing as ended, and fly on."""
    await reported(drone, device, flying)
    with pytest.raises(CommandRejected, match=reason):
        await drone.piloting.end_landing(take_off=True)
    await device.quiet(ardrone3.PCMD)
    assert gaz(device) == device.got(ardrone3.TakeOff) == []


@pytest.mark.parametrize("modern", [False, True])
async def test_end_of_a_landing_of_a_drone_that_hovers_sends_nothing(
    drone: Drone, device: ScriptedDevice, modern: bool
) -> None:
    """SmartTakeOffLand would begin a landing here."""
    drone.piloting.is_modern = lambda: modern
    await reported(drone, device, FlyingState.HOVERING)
    await drone.piloting.end_landing(timeout=0.5, take_off=True)
    await device.quiet()
    assert gaz(device) == device.got(ardrone3.TakeOff) == device.got(ardrone3.SmartTakeOffLand) == []


async def test_landing_ended_and_forced_together_is_refused(drone: Drone, device: ScriptedDevice) -> None:
    """A link that was interrupted delivers both states in one event-loop iteration."""
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 2)
    device.say(state(FlyingState.HOVERING))
    device.say(state(FlyingState.EMERGENCY_LANDING))
    with pytest.raises(CommandRejected, match="forced landing"):
        await ending


async def test_cancelled_end_of_a_landing_centres_the_sticks(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 2)
    await cancelled(ending)
    count = gaz(device).count(UP)
    await device.until(ardrone3.PCMD, count + 5)
    assert gaz(device)[-5:] == [LEVEL] * 5


@pytest.mark.parametrize("modern", [False, True])
async def test_takeoff_command_against_a_landing_depends_on_the_model(
    drone: Drone, device: ScriptedDevice, modern: bool
) -> None:
    drone.piloting.is_modern = lambda: modern
    kind, other = (
        (ardrone3.SmartTakeOffLand, ardrone3.TakeOff) if modern else (ardrone3.TakeOff, ardrone3.SmartTakeOffLand)
    )
    device.script[kind] = lambda _: [state(FlyingState.TAKINGOFF)]
    await reported(drone, device, FlyingState.LANDING)
    await drone.piloting.end_landing(take_off=True)
    assert len(device.got(kind)) == 1
    assert device.got(other) == []
    if modern:  # it toggles: no gaz beside it
        assert UP not in gaz(device)


async def test_motors_started_after_a_late_takeoff_are_stopped(drone: Drone, device: ScriptedDevice) -> None:
    """The TakeOff reached a drone that had just landed, and is executed late."""
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await device.until(ardrone3.TakeOff)
    await reported(drone, device, FlyingState.LANDED)
    with pytest.raises(CommandRejected, match="already landed"):
        await ending
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    assert (await device.until(ardrone3.UserTakeOff)).state == 0
    await device.until(ardrone3.Landing, 1)
    await reported(drone, device, FlyingState.TAKINGOFF)
    await device.until(ardrone3.Landing, 2)


async def test_motors_reported_started_together_with_touchdown_are_stopped(
    drone: Drone, device: ScriptedDevice
) -> None:
    """A link that was interrupted delivers both states in one event-loop iteration (soak, seed 2168)."""
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await device.until(ardrone3.TakeOff)
    device.say(state(FlyingState.LANDED))
    device.say(state(FlyingState.MOTOR_RAMPING))
    with pytest.raises(CommandRejected, match="already landed"):
        await ending
    assert (await device.until(ardrone3.UserTakeOff)).state == 0
    await device.until(ardrone3.Landing, 1)
    await reported(drone, device, FlyingState.TAKINGOFF)
    await device.until(ardrone3.Landing, 2)


async def test_touchdown_after_an_ended_landing_does_not_stop_motors(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await reported(drone, device, FlyingState.HOVERING)
    await ending
    await reported(drone, device, FlyingState.LANDED)
    await reported(drone, device, FlyingState.MOTOR_RAMPING)  # by another controller
    await device.quiet(ardrone3.Landing)
    assert device.got(ardrone3.Landing) == []


@pytest.mark.parametrize("modern", [False, True])
async def test_takeoff_command_against_a_withdrawn_landing_is_withdrawn(
    drone: Drone, device: ScriptedDevice, modern: bool
) -> None:
    """A newer command replaces it while the drone receives nothing: it must not arrive later, on the ground."""
    drone.piloting.is_modern = lambda: modern
    await reported(drone, device, FlyingState.LANDING)
    device.session.mute = True
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await asyncio.sleep(0.05)
    await cancelled(ending)
    device.session.mute = False
    await reported(drone, device, FlyingState.LANDED)
    for _ in range(2):  # longer than an acknowledgement is waited for
        await device.quiet(ardrone3.TakeOff)
    assert device.got(ardrone3.TakeOff) == device.got(ardrone3.SmartTakeOffLand) == []
    await reported(drone, device, FlyingState.MOTOR_RAMPING)  # had it arrived
    await device.until(ardrone3.Landing)


async def test_toggle_that_the_drone_has_not_received_is_withdrawn_before_the_gaz(
    drone: Drone, device: ScriptedDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SmartTakeOffLand lands a drone whose landing the gaz has ended: it must not arrive after it."""
    monkeypatch.setattr(landing, "SMART_WAIT", 0.3)  # its true length without a packet would end the link
    drone.piloting.is_modern = lambda: True
    await reported(drone, device, FlyingState.LANDING)
    device.session.mute = True
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await given(drone, ardrone3.PCMD)
    device.session.mute = False
    await device.until(ardrone3.PCMD, 10)
    assert UP in gaz(device)
    assert device.got(ardrone3.SmartTakeOffLand) == []
    await reported(drone, device, FlyingState.HOVERING)
    await ending
    await device.quiet(ardrone3.SmartTakeOffLand)
    assert device.got(ardrone3.SmartTakeOffLand) == []


async def test_motors_of_another_controller_start_after_a_cancelled_end_of_a_landing(
    drone: Drone, device: ScriptedDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The TakeOff against the landing has expired by then: it does not explain motors that start at any later time."""
    expiry = {**sent_commands.EXPIRY, Slot.LANDING_END: Expiry(0.1)}  # STAYS_DOWN in less time
    monkeypatch.setattr(sent_commands, "EXPIRY", expiry)
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await device.until(ardrone3.TakeOff)
    await cancelled(ending)
    await device.quiet(ardrone3.TakeOff)  # longer than it counts
    await reported(drone, device, FlyingState.LANDED)
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    await device.quiet(ardrone3.Landing)
    assert device.got(ardrone3.Landing) == device.got(ardrone3.UserTakeOff) == []


async def test_requested_takeoff_after_a_lost_race_is_not_stopped(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing(take_off=True))
    await device.until(ardrone3.TakeOff)
    await reported(drone, device, FlyingState.LANDED)
    with pytest.raises(CommandRejected):
        await ending
    device.script[ardrone3.TakeOff] = lambda _: [state(FlyingState.MOTOR_RAMPING), state(FlyingState.TAKINGOFF)]
    await drone.piloting.take_off()
    await device.quiet(ardrone3.Landing)
    assert device.got(ardrone3.Landing) == []


# Landing again.


async def test_landing_is_repeated_at_each_state_of_the_climb(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing, 1)
    for count, flying in enumerate((FlyingState.TAKINGOFF, FlyingState.HOVERING), 2):
        await reported(drone, device, flying)
        await device.until(ardrone3.Landing, count)
        assert not landing.done()
    await reported(drone, device, FlyingState.LANDING)
    await landing
    await reported(drone, device, FlyingState.FLYING)  # another one's doing
    await device.quiet(ardrone3.Landing)
    assert len(device.got(ardrone3.Landing)) == 3


async def test_landing_is_not_repeated_after_a_newer_command(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing, 1)
    await cancelled(landing)
    await reported(drone, device, FlyingState.TAKINGOFF)
    await device.quiet(ardrone3.Landing)


async def test_landing_that_a_newer_command_replaces_does_not_arrive_later(
    drone: Drone, device: ScriptedDevice
) -> None:
    """The drone received nothing meanwhile: it would land during the newer command."""
    await reported(drone, device, FlyingState.HOVERING)
    lost = deaf(device, ardrone3.Landing())
    landing = await begun(drone.piloting.land())
    await lost.wait()
    await cancelled(landing)
    device.session.air = None
    for _ in range(2):  # longer than an acknowledgement is waited for
        await device.quiet(ardrone3.Landing)
    assert device.got(ardrone3.Landing) == []


async def test_land_after_gaz_is_sent_although_landing_is_reported(drone: Drone, device: ScriptedDevice) -> None:
    """The gaz may have ended the landing, which is reported late: LANDING proves nothing, so Landing is sent again."""
    await reported(drone, device, FlyingState.LANDING)
    ending = await begun(drone.piloting.end_landing())
    await device.until(ardrone3.PCMD, 2)
    await cancelled(ending)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing, 1)
    await reported(drone, device, FlyingState.FLYING)
    await device.until(ardrone3.Landing, 2)
    assert not landing.done()
    await reported(drone, device, FlyingState.LANDING)
    await landing
    await device.quiet(ardrone3.PCMD)


async def test_repeated_landed_does_not_end_a_landing_behind_a_takeoff(drone: Drone, device: ScriptedDevice) -> None:
    """It may be older than the TakeOff: the drone may still rise until it reports nothing."""
    launching = await begun(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    await cancelled(launching)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing)
    await reported(drone, device, FlyingState.LANDED)
    assert drone.piloting.about_to_fly
    assert not landing.done()
    await landing
    assert not drone.piloting.about_to_fly


async def test_withdrawn_land_that_begins_is_settled(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.HOVERING)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing, 1)
    await cancelled(landing)
    device.script[ardrone3.CancelMoveTo] = lambda _: [state(FlyingState.LANDING)]
    assert await drone.piloting.settle_landing()


async def test_withdrawn_land_that_has_begun_is_settled_at_once(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.HOVERING)
    landing = await begun(drone.piloting.land())
    await device.until(ardrone3.Landing, 1)
    await cancelled(landing)
    await reported(drone, device, FlyingState.LANDING)
    assert await drone.piloting.settle_landing()
    assert device.got(ardrone3.CancelMoveTo) == []


# Propellers on the ground.


async def test_stop_motors_sends_both_and_returns_when_landed(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    stopping = await begun(drone.piloting.stop_motors())
    assert (await device.until(ardrone3.UserTakeOff)).state == 0
    await device.until(ardrone3.Landing)
    await device.quiet(ardrone3.Emergency)
    assert not stopping.done()
    await reported(drone, device, FlyingState.LANDED)
    await stopping
    assert device.got(ardrone3.Emergency) == []


async def test_stop_motors_withdraws_a_take_off_that_the_drone_has_not_received(
    drone: Drone, device: ScriptedDevice
) -> None:
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    lost = deaf(device, ardrone3.TakeOff())
    launching = await begun(drone.piloting.take_off())
    await lost.wait()
    stopping = await begun(drone.piloting.stop_motors())
    device.session.air = None
    with pytest.raises(CommandRejected, match="the motors are to stop"):
        await launching
    await device.until(ardrone3.Landing)
    await device.quiet(ardrone3.TakeOff)
    assert device.got(ardrone3.TakeOff) == []
    await reported(drone, device, FlyingState.LANDED)
    await stopping


async def test_forced_motor_stop_cuts_motors_still_ramping(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.Emergency] = lambda _: [state(FlyingState.EMERGENCY)]
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    await drone.piloting.stop_motors(force=True)
    times = [at for at, m in device.received if isinstance(m, ardrone3.Landing | ardrone3.Emergency)]
    assert times[-1] - times[0] >= 0.25


async def test_forced_stop_never_cuts_motors_in_the_air(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    stopping = await begun(drone.piloting.stop_motors(force=True))
    await device.until(ardrone3.Landing)
    await reported(drone, device, FlyingState.TAKINGOFF)
    await device.until(ardrone3.Landing, 2)
    for _ in range(3):
        await device.quiet(ardrone3.Emergency)
    await reported(drone, device, FlyingState.LANDING)
    await reported(drone, device, FlyingState.LANDED)
    await stopping


async def test_motor_cut_that_the_drone_has_not_received_is_withdrawn_in_the_air(
    drone: Drone, device: ScriptedDevice
) -> None:
    """It would be repeated until it arrives, and the drone would fall."""
    await reported(drone, device, FlyingState.MOTOR_RAMPING)
    stopping = await begun(drone.piloting.stop_motors(force=True))
    await device.until(ardrone3.Landing)
    lost = deaf(device, ardrone3.Emergency())
    await lost.wait()
    await reported(drone, device, FlyingState.TAKINGOFF)
    device.session.air = None
    await device.until(ardrone3.Landing, 2)
    for _ in range(3):
        await device.quiet(ardrone3.Emergency)
    assert device.got(ardrone3.Emergency) == []
    await reported(drone, device, FlyingState.LANDED)
    await stopping


# The motor cut.


async def test_motor_cut_without_an_answer_is_not_confirmed_while_a_take_off_is_awaited(
    drone: Drone, device: ScriptedDevice
) -> None:
    """The drone stands for us, and may have started its motors already."""
    launching = await begun(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    with pytest.raises(CommandTimeout):
        await drone.piloting.emergency()
    with pytest.raises(CommandRejected, match="the motors are cut"):
        await launching
    assert len(device.got(ardrone3.Emergency)) == 1


async def test_confirmed_motor_cut_rules_out_the_take_off_before_it(drone: Drone, device: ScriptedDevice) -> None:
    device.script[ardrone3.Emergency] = lambda _: [state(FlyingState.LANDED)]
    launching = await begun(drone.piloting.take_off())
    await device.until(ardrone3.TakeOff)
    await drone.piloting.emergency()
    with pytest.raises(CommandRejected, match="the motors are cut"):
        await launching
    assert not drone.piloting.about_to_fly


# What newer commands have replaced.


async def test_retired_task_may_only_stop_its_own_start(drone: Drone, device: ScriptedDevice) -> None:
    await reported(drone, device, FlyingState.HOVERING)
    results: list[BaseException | None] = []

    async def replaced() -> None:
        drone.retire([task])
        for verb in (drone.piloting.move_by(1.0, 0.0, 0.0, 0.0), drone.piloting.land()):
            try:
                await verb
            except AnafiMavError as error:
                results.append(error)
        drone.piloting.pilot(PilotingCommand())
        drone.piloting.hover()
        drone.silence([task])
        with pytest.raises(CommandRejected, match="replaced by a newer command"):
            drone._commander.send_stop(ardrone3.CancelMoveTo())

    task = asyncio.get_running_loop().create_task(replaced())
    await task
    assert [str(error) for error in results] == ["replaced by a newer command"] * 2
    await device.until(ardrone3.PCMD)
    assert [m for m in device.got(ardrone3.MoveBy) if m.dX] == device.got(ardrone3.Landing) == []
