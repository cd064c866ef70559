"""Flight plans: uploaded to the simulator and flown there; what the drone lacks is in the error."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
from support.flight_plans import V1
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import Pair, connected, take_off

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages import flight_plan as modern
from anafi_mav.arsdk.messages.common import FlightPlanComponent, MavlinkType, PlayingState
from anafi_mav.drone import Drone
from anafi_mav.drone.automatic.flight_plan import DOUBT_TIMEOUT
from anafi_mav.drone.sent_commands import SentCommand
from anafi_mav.errors import CommandRejected, CommandTimeout, LinkLost, NotSupported, RemoteProtocolError

V2 = V1.replace(b"\t3\t93\t2.0\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0", b"\t2\t93\t2.0\t-1\t-1\t-1\tnan\tnan\tnan").replace(
    b"\t3\t93\t60.0\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0", b"\t2\t93\t60.0\t-1\t-1\t-1\tnan\tnan\tnan"
)


@pytest.fixture(params=["4k", "ai"])
async def pair(request: pytest.FixtureRequest) -> AsyncIterator[Pair]:
    async with connected(request.param) as pair:
        yield pair


def plan(drone: Drone) -> bytes:
    return V1 if drone.flight_plan.version == 1 else V2


async def test_a_plan_is_uploaded_flown_paused_and_stopped(pair: Pair) -> None:
    drone = pair.drone
    assert drone.flight_plan.version == (2 if drone.identity.model.key == "ai" else 1)
    assert drone.flight_plan.state.playing == PlayingState.STOPPED
    assert drone.flight_plan.state.available
    assert drone.flight_plan.state.unavailable == ()
    uid = await drone.flight_plan.upload(plan(drone))
    assert uid in [one.uid for one in await drone.flight_plan.list()]
    assert (await drone.flight_plan.get(uid))["uid"] == uid
    with pytest.raises(CommandRejected):
        await drone.flight_plan.pause()
    await drone.flight_plan.stop()
    await drone.flight_plan.start(uid)
    assert (drone.flight_plan.state.playing, drone.flight_plan.state.uid) == (PlayingState.PLAYING, uid)
    await drone.expect(common.MissionItemExecuted, lambda m: m.idx == 1, 20.0)
    assert drone.flight_plan.state.item == 1
    await drone.flight_plan.pause()
    observed = [drone.flight_plan.state.playing]
    await drone.flight_plan.start(uid)
    assert drone.flight_plan.state.item == 1
    await drone.flight_plan.stop()
    observed.append(drone.flight_plan.state.playing)
    assert observed == [PlayingState.PAUSED, PlayingState.STOPPED]
    assert await drone.flight_plan.delete(uid)
    assert not await drone.flight_plan.delete(uid)
    with pytest.raises(CommandRejected, match="404"):
        await drone.flight_plan.get(uid)


async def test_invalid_plan_is_refused(pair: Pair) -> None:
    drone = pair.drone
    uid = await drone.flight_plan.upload(b"nonsense")
    with pytest.raises(CommandRejected, match="mavlink file"):
        await drone.flight_plan.start(uid)
    assert drone.flight_plan.state.components[FlightPlanComponent.MAVLINK_FILE] is False
    with pytest.raises(CommandRejected):
        await drone.flight_plan.start("unknown")
    with pytest.raises(CommandRejected):
        await drone.flight_plan.get("../plans")
    with pytest.raises(CommandRejected):
        await drone.flight_plan.upload(b"")


async def test_without_gps(pair: Pair) -> None:
    drone, real = pair
    uid = await drone.flight_plan.upload(plan(drone))
    real.faults.gps = False
    if drone.flight_plan.state.available:
        await drone.expect(common.AvailabilityStateChanged, lambda m: not m.AvailabilityState)
    with pytest.raises(CommandRejected, match="gps"):
        await drone.flight_plan.start(uid)


async def test_from_the_middle(pair: Pair) -> None:
    drone = pair.drone
    uid = await drone.flight_plan.upload(plan(drone))
    await take_off(drone)
    if drone.flight_plan.version == 1:
        with pytest.raises(NotSupported):
            await drone.flight_plan.start(uid, item=2)
        with pytest.raises(NotSupported):
            await drone.flight_plan.start(uid, continue_on_disconnect=True)
        return
    await drone.flight_plan.start(uid, item=2, continue_on_disconnect=True)
    done = await drone.expect(common.MissionItemExecuted, timeout=20.0)
    assert done.idx == 2
    await drone.flight_plan.stop()


async def test_return_on_disconnect() -> None:
    async with connected("4k") as (drone, _):
        assert await drone.flight_plan.set_returns_on_disconnect(False) in (True, False)


# -- a scripted drone: what the simulator never does


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [
        *STATES,
        common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, "", MavlinkType.FLIGHT_PLAN),
        common.ComponentStateListChanged(FlightPlanComponent.GPS, 1),
    ]


async def test_unanswered_plan_start_is_withdrawn(device: ScriptedDevice) -> None:
    drone = device.drone()
    await drone.connect()
    with pytest.raises(CommandTimeout):
        await drone.flight_plan.start("abc", timeout=0.2)
    await device.until(common.Stop)
    # Silent, but it had said what it lacks.
    device.script[common.Start] = lambda _: [
        common.ComponentStateListChanged(FlightPlanComponent.CALIBRATION, 0),
        common.ComponentStateListChanged(FlightPlanComponent.CAMERA_AVAILABLE, 0),
    ]
    with pytest.raises(CommandRejected, match="calibration, camera available"):
        await drone.flight_plan.start("def", timeout=0.2)
    starting = asyncio.ensure_future(drone.flight_plan.start("ghi"))
    await device.until(common.Start, 3)
    await drone.close()
    with pytest.raises(LinkLost):
        await starting


async def test_late_stop_of_an_older_plan_leaves_the_newer_one_playing(device: ScriptedDevice) -> None:
    """What ends the newer plan is sent all the same."""
    drone = device.drone()
    await drone.connect()

    async def report(state: PlayingState, uid: str) -> None:
        heard = asyncio.ensure_future(drone.expect(common.MavlinkFilePlayingStateChanged))
        await asyncio.sleep(0)
        device.say(common.MavlinkFilePlayingStateChanged(state, uid, MavlinkType.FLIGHT_PLAN))
        await heard

    for number, uid in enumerate(("abc", "def"), 1):
        starting = asyncio.ensure_future(drone.flight_plan.start(uid))
        await device.until(common.Start, number)
        await report(PlayingState.PLAYING, uid)
        await starting
    await report(PlayingState.STOPPED, "abc")
    drone.flight_plan.suspend()
    await device.until(common.Pause)
    drone.piloting.hover()
    await device.until(common.Pause, 2)
    await drone.close()


async def test_late_error_of_a_withdrawn_start_leaves_the_newer(device: ScriptedDevice) -> None:
    drone = device.drone()
    await drone.connect()
    older = asyncio.ensure_future(drone.flight_plan.start("abc"))
    await device.until(common.Start)
    device.script[common.Stop] = lambda _: [common.ComponentStateListChanged(FlightPlanComponent.GPS, 1)]
    heard = asyncio.ensure_future(drone.expect(common.ComponentStateListChanged))
    older.cancel()
    await heard
    newer = asyncio.ensure_future(drone.flight_plan.start("def"))
    await device.until(common.Start, 2)
    device.say(common.StartingErrorEvent())
    device.say(common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "def", MavlinkType.FLIGHT_PLAN))
    await newer
    await drone.close()


async def test_plan_of_a_withdrawn_start_is_not_started_again_until_that_is_decided(device: ScriptedDevice) -> None:
    """Its PLAYING would be taken for the newer start's: the drone reports the name of the plan alone."""
    drone = device.drone()
    await drone.connect()

    async def report(state: PlayingState) -> None:
        heard = asyncio.ensure_future(drone.expect(common.MavlinkFilePlayingStateChanged))
        await asyncio.sleep(0)
        device.say(common.MavlinkFilePlayingStateChanged(state, "abc", MavlinkType.FLIGHT_PLAN))
        await heard

    with pytest.raises(CommandTimeout):
        await drone.flight_plan.start("abc", timeout=0.2)
    await device.until(common.Stop)
    for state in (PlayingState.STOPPED, PlayingState.PLAYING):  # the first answers the command against it
        with pytest.raises(CommandRejected, match="an earlier start may still begin"):
            await drone.flight_plan.start("abc")
        await report(state)
    assert drone.flight_plan.plays_withdrawn
    assert drone.flight_plan.is_undecided("abc")
    await report(PlayingState.STOPPED)
    assert len(device.got(common.Start)) == 1
    newer = asyncio.ensure_future(drone.flight_plan.start("abc", cause="the newer"))
    await device.until(common.Start, 2)
    await report(PlayingState.PLAYING)
    await newer
    flown = drone.flight_plan.flown
    assert isinstance(flown, SentCommand)
    assert flown.cause == "the newer"
    assert not drone.flight_plan.plays_withdrawn
    await report(PlayingState.STOPPED)
    assert drone.flight_plan.flown is None
    await report(PlayingState.PLAYING)
    assert drone.flight_plan.flown == "abc"  # started by another controller
    await drone.close()


async def test_start_cancelled_while_an_older_one_plays_stops_the_plan(device: ScriptedDevice) -> None:
    drone = device.drone()
    await drone.connect()
    with pytest.raises(CommandTimeout):
        await drone.flight_plan.start("abc", timeout=0.2)
    await device.until(common.Stop)
    newer = asyncio.ensure_future(drone.flight_plan.start("def"))
    await device.until(common.Start, 2)
    device.script[common.Stop] = lambda _: []
    heard = asyncio.ensure_future(drone.expect(common.MavlinkFilePlayingStateChanged))
    await asyncio.sleep(0)
    device.say(common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "abc", MavlinkType.FLIGHT_PLAN))
    await heard
    drone.flight_plan.suspend()
    with pytest.raises(CommandRejected):
        await newer
    await device.until(common.Stop, 2)
    await device.until(common.Pause)
    await drone.close()


async def test_start_error_that_may_be_the_newer_starts_ends_its_wait_early(device: ScriptedDevice) -> None:
    """The drone never answered the older start, so the error is attributed to that one; the newer one is stopped."""
    drone = device.drone()
    await drone.connect()
    with pytest.raises(CommandTimeout):
        await drone.flight_plan.start("abc", timeout=0.5)
    await device.until(common.Stop)
    newer = asyncio.ensure_future(drone.flight_plan.start("def"))
    await device.until(common.Start, 2)
    began = asyncio.get_running_loop().time()
    device.say(common.StartingErrorEvent())
    with pytest.raises(CommandTimeout):
        await newer
    assert asyncio.get_running_loop().time() - began == pytest.approx(DOUBT_TIMEOUT, abs=0.5)
    await device.until(common.Stop, 2)
    await drone.close()


async def test_start_at_of_older_firmware_uses_the_older_form(device: ScriptedDevice) -> None:
    drone = device.drone()
    await drone.connect()
    heard = asyncio.ensure_future(drone.expect(modern.Capabilities))
    await asyncio.sleep(0)
    device.say(modern.Capabilities(1 << modern.SupportedCapabilities.START_AT))
    await heard
    device.script[modern.StartAt] = lambda m: [
        common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, m.flightplan_id, MavlinkType.FLIGHT_PLAN)
    ]
    await drone.flight_plan.start("abc", item=3)
    assert device.got(modern.StartAt) == [modern.StartAt("abc", "abc", modern.MavlinkType.FLIGHT_PLAN, 3)]
    # It ended by itself while we asked for a pause.
    device.script[common.Pause] = lambda m: [
        common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, "", MavlinkType.FLIGHT_PLAN)
    ]
    with pytest.raises(CommandRejected, match="ended"):
        await drone.flight_plan.pause()
    await drone.close()


async def test_a_drone_without_flight_plans() -> None:
    async with ScriptedDevice() as device:
        drone = device.drone()
        await drone.connect()
        with pytest.raises(NotSupported):
            await drone.flight_plan.upload(V1)
        await drone.close()


async def test_invalid_plan_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    async with connected("4k") as (drone, real):
        for uid in ("", "../x", 5):
            monkeypatch.setattr(real.firmware.plans, "put", lambda data, date, uid=uid: uid)
            with pytest.raises(RemoteProtocolError):
                await drone.flight_plan.upload(V1)
