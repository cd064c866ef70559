"""Conformance items 76, 77 and 143 (DO_FENCE_ENABLE): fences enforced and rally points used, in both flavours.

What the drone did is read from the simulator's own log. Where it is flown by setpoints the simulator runs at the speed
of life: how far a drone goes before it stands is a matter of real seconds.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import another_controller, watched
from support.flavours import both
from support.mav import NAN, Client
from support.params import read, send_set, value_of, write
from support.plans import ACCEPTED as TAKEN
from support.plans import FENCE, RALLY, Item, around, circle, clear, content, download, rally, square, upload
from support.setpoints import NO_ACCELERATION, NO_YAW, NO_YAW_RATE, allow_speed, engage, local, streaming
from support.world import HOME, MODES, World, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.rth import RthHomeType
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim.world.faults import CLEAR, Impairment
from anafi_mav.units import quaternion_from_euler

PLACE = (HOME[0], HOME[1])
ACCEPTED, REJECTED, DENIED = (
    dialect.MAV_RESULT_ACCEPTED,
    dialect.MAV_RESULT_TEMPORARILY_REJECTED,
    dialect.MAV_RESULT_DENIED,
)
GEOFENCE = dialect.MAV_SYS_STATUS_GEOFENCE
HOME_CIRCLE = mav_enums.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION
REPOSITION, ENABLE = dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_CMD_DO_FENCE_ENABLE
BRAKE = 17
FENCE_OFF = "Fence off: only the drone's own limits hold"

PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

FORWARD = -0.17
"""rad of pitch: more than the 10 degrees that are full tilt."""


async def put(w: World, name: str, value: float, kind: int | None = None) -> Any:
    """Set a parameter of the gateway's; whole numbers in the flavour's encoding."""
    kind = kind or (6 if w.flavour == "px4" else 2)
    carrier = float(value)
    if kind == 6 and w.flavour == "px4":
        (carrier,) = struct.unpack("<f", struct.pack("<i", int(value)))
    mark = w.client.mark()
    w.client.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), carrier, kind))
    return await w.client.wait(("PARAM_VALUE", "PARAM_ERROR"), lambda m: m.param_id == name, since=mark)


ACTION = {"px4": "GF_ACTION", "ardupilot": "FENCE_ACTION"}
NUMBER = {"px4": {"hold": 2, "return": 3, "land": 5}, "ardupilot": {"hold": 4, "return": 1, "land": 2}}


@asynccontextmanager
async def flown(w: World, *, pitch: float = FORWARD, thrust: float = 0.5) -> AsyncIterator[None]:
    """A program at the PX4 endpoint that flies the drone north by setpoints, and goes on whatever the fence does."""
    pilot = await w.connect(254, port=5761)

    async def stream() -> None:
        rotation = list(quaternion_from_euler(0.0, pitch, 0.0))
        while True:
            pilot.send(dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, rotation, 0.0, 0.0, 0.0, thrust))
            await asyncio.sleep(0.05)  # the program's own rate

    task = asyncio.ensure_future(stream())
    try:
        await asyncio.sleep(0.3)  # what it takes to be listened to
        assert (await pilot.command(dialect.MAV_CMD_DO_SET_MODE, 1, 6, 0)).result == ACCEPTED
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


def farthest(w: World) -> float:
    """m from home that the drone has ever been."""
    return max(math.hypot(e.args["north"], e.args["east"]) for e in w.drone.log if e.kind == "pose")


async def at_rest(w: World, timeout: float = 20.0) -> None:
    """The drone stands in the air."""
    deadline = asyncio.get_running_loop().time() + timeout
    while math.hypot(w.drone.pose.vn, w.drone.pose.ve) > 0.3:
        assert asyncio.get_running_loop().time() < deadline
        await asyncio.sleep(0.1)  # the simulation's own time


def texts(client: Client, since: int = 0) -> list[str]:
    """What was said, whole: a long text comes in chunks that share a number."""
    result: list[str] = []
    number = 0
    for _, m in client.since(since, "STATUSTEXT"):
        if m.id and m.id == number:
            result[-1] += m.text
        else:
            result.append(m.text)
        number = m.id
    return result


async def said(client: Client, words: str, *, since: int = 0, timeout: float = 5.0) -> None:
    """Wait until something with these words is said."""
    await client.wait(
        "STATUSTEXT", lambda m: any(words in text for text in texts(client, since)), since=since, timeout=timeout
    )


async def bits(client: Client, present: bool, enabled: bool, healthy: bool | None) -> None:
    """SYS_STATUS reports the fence; its health may be left open."""
    await client.wait(
        "SYS_STATUS",
        lambda m: (
            bool(m.onboard_control_sensors_present & GEOFENCE) is present
            and bool(m.onboard_control_sensors_enabled & GEOFENCE) is enabled
            and healthy in (None, bool(m.onboard_control_sensors_health & GEOFENCE))
        ),
    )


@both
async def test_conf_076_stopped_before_the_fence(flavour: str) -> None:
    """A square of 50 m, flown at by setpoints: the drone holds inside, once, and the setpoints fly it no more."""
    async with world(flavour=flavour, also="px4", speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 25.0), FENCE)).type == TAKEN
        await bits(w.client, True, True, True)
        await w.take_off()
        mark = w.client.mark()
        async with flown(w):
            await said(w.client, "too fast for", since=mark, timeout=15.0)
            stopped = BRAKE if flavour == "ardupilot" else MODES["px4"].hold
            await w.client.heartbeat(lambda beat: beat.custom_mode == stopped, since=mark)
            await at_rest(w)
            assert 10.0 < farthest(w) < 25.0
            here = w.drone.pose.north
            await w.client.wait("HEARTBEAT", timeout=3.0)
            await w.client.wait("HEARTBEAT", timeout=3.0)
            assert w.drone.pose.north == pytest.approx(here, abs=0.5)
        statuses = [m for _, m in w.client.since(mark, "FENCE_STATUS")]
        assert {(m.breach_status, m.breach_count) for m in statuses} == {(0, 0)}
        assert len([text for text in texts(w.client, mark) if text.startswith("Fence")]) == 1


@pytest.mark.parametrize("delay", [0.35, 0.7])
async def test_drone_over_a_late_link_is_stopped_before_the_fence(delay: float) -> None:
    """The sight of the drone is late, and so is the stop: both belong to the way that it still flies."""
    async with world(also="px4", speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 80.0), FENCE)).type == TAKEN
        await bits(w.client, True, True, True)
        await w.take_off()
        allow_speed(w)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=delay)
        mark = w.client.mark()
        async with flown(w, pitch=2.0 * FORWARD):
            await said(w.client, "too fast for", since=mark, timeout=25.0)
            await w.client.heartbeat(lambda beat: beat.custom_mode == MODES["px4"].hold, since=mark, timeout=10.0)
            await at_rest(w)
            assert 50.0 < farthest(w) < 80.0


@both
async def test_conf_076_position_with_a_velocity_is_stopped_before_the_fence(flavour: str) -> None:
    """A feed-forward of 9 m/s leads away from a position inside: the drone holds before the square, not behind it."""
    async with world(flavour=flavour, speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 20.0), FENCE)).type == TAKEN
        await w.take_off(10.0)
        allow_speed(w)
        mark = w.client.mark()
        setpoint = local(NO_ACCELERATION | NO_YAW | NO_YAW_RATE, at=(0.0, 0.0, -10.0), v=(9.0, 0.0, 0.0))
        async with streaming(w.client, setpoint):
            await engage(w.client, flavour)
            await said(w.client, "too fast for", since=mark, timeout=20.0)
            await at_rest(w)
        assert 8.0 < farthest(w) < 20.0


@both
async def test_conf_076_goto_that_a_new_fence_cuts_off_is_stopped_before_it(flavour: str) -> None:
    """The fence is uploaded while the drone flies to a place that is outside of it."""
    async with world(flavour=flavour, speed=1.0) as w:
        await w.take_off(10.0)
        away = geo.destination(*PLACE, 200.0, 0.0)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=away[0], y=away[1], z=10.0)
        assert ack.result == ACCEPTED
        mark = w.client.mark()
        assert (await upload(w.client, square(PLACE, 40.0), FENCE)).type == TAKEN
        await said(w.client, "too fast for", since=mark, timeout=20.0)
        await at_rest(w)
        assert 10.0 < farthest(w) < 40.0


@pytest.mark.parametrize(
    ("flavour", "action", "command"),
    [
        ("px4", "return", "rth.return_to_home"),
        ("ardupilot", "return", "rth.return_to_home"),
        ("px4", "land", "ardrone3.Piloting.Landing"),
        ("ardupilot", "land", "ardrone3.Piloting.Landing"),
    ],
)
async def test_conf_076_a_breach_is_acted_upon_once(flavour: str, action: str, command: str) -> None:
    """A square of 24 m, no prediction: the drone leaves it, and goes home or lands, and is left in peace meanwhile."""
    async with world(flavour=flavour, also="px4", speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 12.0), FENCE)).type == TAKEN
        value = await put(w, ACTION[flavour], NUMBER[flavour][action])
        assert value.get_type() == "PARAM_VALUE"
        assert (await put(w, "ANF_FENCE_AHEAD", 0, 6)).get_type() == "PARAM_VALUE"
        await w.take_off()
        mark = w.client.mark()
        async with flown(w):
            status = await w.client.wait("FENCE_STATUS", lambda m: m.breach_status == 1, since=mark, timeout=15.0)
            assert (status.breach_count, status.breach_type) == (1, dialect.FENCE_BREACH_BOUNDARY)
            assert status.breach_time > 0
            await said(w.client, " m beyond ", since=mark)
            await bits(w.client, True, True, False)
            mode = {"return": w.modes.returning, "land": w.modes.land}[action]
            await w.client.heartbeat(lambda beat: beat.custom_mode == mode, since=mark)
            if action == "return":  # it flies home although the setpoints go on, and the way in is no new breach
                await w.client.wait("FENCE_STATUS", lambda m: m.breach_status == 0, timeout=20.0)
                await said(w.client, "Inside the fence again", since=mark)
            else:
                await w.drone.wait_log(lambda e: e.kind == "state" and e.args.get("to") == "landed", 20.0)
        assert len(w.commands(command)) == 1
        assert farthest(w) > 12.0
        counts = [m.breach_count for _, m in w.client.since(mark, "FENCE_STATUS")]
        assert max(counts) == 1
        if action == "return":
            assert not w.commands("ardrone3.Piloting.Landing")
            north = [e.args["north"] for e in w.drone.log if e.kind == "pose"]
            assert north[-1] < max(north) - 1.0


@asynccontextmanager
async def breached(w: World, flavour: str, action: str) -> AsyncIterator[int]:
    """Fly out of a fence whose action the drone answers late; the client's mark of before, and setpoints that go on."""
    assert (await upload(w.client, square(PLACE, 12.0), FENCE)).type == TAKEN
    await put(w, ACTION[flavour], NUMBER[flavour][action])
    await put(w, "ANF_FENCE_AHEAD", 0, 6)
    await w.take_off()
    mark = w.client.mark()
    async with flown(w):
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 9.0, 15.0)
        w.drone.faults.down = Impairment(delay=0.5)
        await w.client.wait("STATUSTEXT", lambda m: " m beyond " in m.text, since=mark, timeout=15.0)
        yield mark


@both
@pytest.mark.parametrize("action", ["return", "land"])
async def test_conf_076_fence_action_ended_by_a_client_allows_flight(flavour: str, action: str) -> None:
    """A Hold that arrives before the drone has answered the return or landing of a breach ends it for good."""
    async with world(flavour=flavour, also="px4", speed=1.0) as w:
        async with breached(w, flavour, action) as mark:
            hold = (1, BRAKE) if flavour == "ardupilot" else (1, 4, 3)
            ack = await w.client.command(dialect.MAV_CMD_DO_SET_MODE, *hold, timeout=10.0)
            assert ack.result == ACCEPTED
            w.drone.faults.down = CLEAR
            held = BRAKE if flavour == "ardupilot" else MODES["px4"].hold
            await w.client.heartbeat(lambda beat: beat.custom_mode == held, since=w.client.mark())
            after = w.client.mark()
            for _ in range(4):  # longer than an action that failed waits
                await w.client.heartbeat(lambda beat: beat.custom_mode == held)
            assert {beat.custom_mode for _, beat in w.client.since(after, "HEARTBEAT")} == {held}
        name = {"return": "rth.return_to_home", "land": "ardrone3.Piloting.Landing"}[action]
        assert len(w.commands(name)) == 1
        assert len([text for text in texts(w.client, mark) if " m beyond " in text]) == 1
        assert w.drone.pose.north > 12.0


async def test_conf_076_breach_after_an_action_that_a_client_has_ended_is_acted_upon() -> None:
    """A Hold ends the return of the first breach; flown back inside and out again, the drone returns."""
    async with world(also="px4", speed=1.0) as w:
        async with breached(w, "px4", "return"):
            assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3, timeout=10.0)).result == ACCEPTED
            w.drone.faults.down = CLEAR
        mark = w.client.mark()
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=PLACE[0], y=PLACE[1], z=5.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["north"]) < 1.0, 20.0, since=w.drone.log[-1].t)
        returns = len(w.commands("rth.return_to_home"))
        async with flown(w):
            await w.client.wait("STATUSTEXT", lambda m: " m beyond " in m.text, since=mark, timeout=15.0)
            await w.client.heartbeat(lambda beat: beat.custom_mode == MODES["px4"].returning)
        assert len(w.commands("rth.return_to_home")) == returns + 1


async def test_conf_076_floor_counts_in_a_flight_that_began_without_a_link_once_it_was_reached() -> None:
    """The drone lands and takes off unseen. The floor must not hold it down on its way up."""
    async with world(speed=1.0) as w:
        await put(w, "ANF_FENCE_FLOOR", 5.0, 9)
        await w.take_off(10.0)
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 2.0)
        for message, state in ((ardrone3.Landing(), "landed"), (ardrone3.TakeOff(), "hovering")):
            another_controller(w, message)
            await w.drone.wait_log(lambda e, to=state: e.name == "flying" and e.args["to"] == to, 40.0)
        mark = w.client.mark()
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, since=mark, timeout=20.0)
        await watched(3.0)
        assert w.drone.pose.up < 3.0
        assert [text for text in texts(w.client, mark) if "below floor" in text] == []


async def test_conf_076_floor_does_not_count_where_a_return_ends_below_it() -> None:
    async with world(speed=4.0) as w:
        await put(w, "ANF_FENCE_FLOOR", 15.0, 9)
        await put(w, "GF_ACTION", NUMBER["px4"]["land"])
        await put(w, "ANF_RTL_END", 1)
        await w.take_off(20.0)
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)).result == ACCEPTED
        await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Return ended"), since=mark, timeout=60.0)
        assert w.drone.pose.up < 15.0
        await watched(5.0)
        assert w.drone.pose.up > 5.0


@pytest.mark.parametrize("action", ["return", "land"])
async def test_conf_076_breach_during_a_takeoff_is_acted_upon_when_the_drone_hovers(action: str) -> None:
    """The fence that the drone is not in is uploaded while it leaves the ground."""
    async with world(speed=1.0) as w:
        await put(w, ACTION["px4"], NUMBER["px4"][action])
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == ACCEPTED
        w.client.send_command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "takingoff", 10.0)
        assert (await upload(w.client, square(geo.destination(*PLACE, 60.0, 0.0), 25.0), FENCE)).type == TAKEN
        await said(w.client, " m beyond ", since=mark, timeout=10.0)
        mode = {"return": w.modes.returning, "land": w.modes.land}[action]
        await w.client.heartbeat(lambda beat: beat.custom_mode == mode, since=mark, timeout=10.0)
        if action == "land":
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
            await w.client.wait("FENCE_STATUS", lambda m: not m.breach_status)
            assert "Inside the fence again" not in texts(w.client, mark)
        assert max(e.args["up"] for e in w.drone.log if e.kind == "pose") < 10.0


async def test_conf_076_return_that_the_drone_cannot_fly_becomes_a_hold() -> None:
    """The goto that leads out of the fence is not flown on."""
    async with world(speed=1.0) as w:
        await put(w, ACTION["px4"], NUMBER["px4"]["return"])
        await w.take_off(10.0)
        away = geo.destination(*PLACE, 200.0, 0.0)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=away[0], y=away[1], z=10.0)
        assert ack.result == ACCEPTED
        w.drone.inject(rth.State(rth.RthState.UNAVAILABLE, rth.StateReason.DISABLED))
        assert (await upload(w.client, square(PLACE, 40.0), FENCE)).type == TAKEN
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == MODES["px4"].hold, timeout=20.0)
        await said(w.client, "return home is unavailable", timeout=20.0)
        await at_rest(w)
        assert 10.0 < farthest(w) < 60.0
        assert w.commands("rth.return_to_home") == []


async def test_conf_076_action_that_has_failed_is_tried_again() -> None:
    """The drone does not report the landing, so that it counts as failed beyond the boundary."""
    async with world(speed=1.0) as w:
        await w.take_off(10.0)
        away = geo.destination(*PLACE, 200.0, 0.0)
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=away[0], y=away[1], z=10.0)
        assert ack.result == ACCEPTED
        mark = w.client.mark()
        await put(w, ACTION["px4"], NUMBER["px4"]["land"])
        await put(w, "ANF_FENCE_AHEAD", 0, 6)
        w.drone.faults.unreported = frozenset({ardrone3.FlyingStateChanged.NAME})
        assert (await upload(w.client, square(PLACE, 20.0), FENCE)).type == TAKEN
        await said(w.client, "Fence landing failed: ", since=mark, timeout=30.0)
        before = len(w.commands("ardrone3.Piloting.Landing"))
        await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.Landing", 10.0, since=w.drone.log[-1].t)
        assert len(w.commands("ardrone3.Piloting.Landing")) == before + 1


async def test_conf_076_below_the_floor_the_zones_hold() -> None:
    """Held below the floor, the drone is flown on and out sideways: that is stopped like any other way out."""
    async with world(also="px4", speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 15.0), FENCE)).type == TAKEN
        assert (await put(w, "ANF_FENCE_FLOOR", 10.0, 9)).param_value == 10.0
        await w.take_off(12.0)
        async with flown(w, pitch=0.0, thrust=0.2):
            await said(w.client, "m below floor 10 m", timeout=20.0)
        for ahead, words in ((1, "too fast for"), (0, " m beyond ")):
            await put(w, "ANF_FENCE_AHEAD", ahead, 6)
            mark = w.client.mark()
            async with flown(w):
                await said(w.client, words, since=mark, timeout=20.0)
                await w.client.heartbeat(lambda beat: beat.custom_mode == MODES["px4"].hold, since=mark)
                await at_rest(w)
                assert farthest(w) < 15.0 if ahead else 15.0 < farthest(w) < 25.0
                here = w.drone.pose.north
                for _ in range(2):
                    await w.client.wait("HEARTBEAT", timeout=3.0)
                assert w.drone.pose.north == pytest.approx(here, abs=0.5)
            assert w.drone.pose.up < 9.0
            status = [m for _, m in w.client.since(0, "FENCE_STATUS")][-1]
            kind = dialect.FENCE_BREACH_MINALT if ahead else dialect.FENCE_BREACH_BOUNDARY
            assert (status.breach_status, status.breach_count, status.breach_type) == (1, 2 - ahead, kind)
        assert len([text for text in texts(w.client) if text.startswith("Fence hold: ")]) == 3


async def test_conf_076_warned_and_nothing_else() -> None:
    async with world(also="px4", speed=1.0) as w:
        assert (await upload(w.client, square(PLACE, 12.0), FENCE)).type == TAKEN
        await put(w, "GF_ACTION", 1)
        await w.take_off()
        mark = w.client.mark()
        async with flown(w):
            await said(w.client, "too fast for", since=mark, timeout=15.0)
            await said(w.client, " m beyond ", since=mark, timeout=15.0)
            await w.client.heartbeat(lambda beat: True)
            assert {beat.custom_mode for _, beat in w.client.since(mark, "HEARTBEAT")} <= {
                0x00060000,
                MODES["px4"].hold,
            }
            assert w.drone.pose.north > 12.0
            before = w.drone.pose.north
            await w.client.heartbeat(lambda beat: beat.custom_mode == 0x00060000)
            assert w.drone.pose.north > before


async def test_conf_076_the_pilot_at_the_skycontroller_has_the_last_word() -> None:
    """His sticks have the drone: nothing acts against him, he is warned."""
    async with world(speed=1.0, skycontroller=3) as w:
        assert (await upload(w.client, square(PLACE, 20.0), FENCE)).type == TAKEN
        await w.take_off()
        pilot = w.drone.skycontroller
        assert pilot is not None
        mark = w.client.mark()
        pilot.stick(PITCH_STICK, 60)
        await said(w.client, "too fast for", since=mark, timeout=20.0)
        await said(w.client, " m beyond ", since=mark, timeout=20.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 24.0, 20.0)
        assert [text for text in texts(w.client, mark) if text.startswith("Fence hold: ")] == []


@both
async def test_conf_076_targets_outside_are_refused(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        hole = circle(around(PLACE, (30.0, 0.0))[0], 8.0, inclusion=False)
        assert (await upload(w.client, [*square(PLACE, 60.0), hole], FENCE)).type == TAKEN
        await w.take_off()
        for (north, east), words in (
            ((80.0, 0.0), " m beyond inclusion"),
            ((32.0, 1.0), " m beyond exclusion"),
            ((50.0, 0.0), "path crosses"),
        ):
            place = around(PLACE, (north, east))[0]
            mark = w.client.mark()
            ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
            assert ack.result == DENIED
            await said(w.client, words, since=mark)
        assert w.commands("ardrone3.Piloting.moveTo") == []
        place = around(PLACE, (50.0, 30.0))[0]
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name.endswith("moveToChanged") and e.args["status"] == 1, 40.0)
        mark = w.client.mark()
        await w.client.wait("HEARTBEAT")
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if m.text.startswith("Fence ")]


@both
async def test_conf_076_no_takeoff_outside(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        elsewhere = around(PLACE, (500.0, 0.0))[0]
        assert (await upload(w.client, [circle(elsewhere, 100.0)], FENCE)).type == TAKEN
        await bits(w.client, True, True, True)  # on the ground it is no breach
        await w.client.wait(
            "SYS_STATUS", lambda m: not m.onboard_control_sensors_health & dialect.MAV_SYS_STATUS_PREARM_CHECK
        )
        mark = w.client.mark()
        assert (await w.client.command(mav_enums.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == REJECTED
        await said(w.client, " m beyond inclusion", since=mark)
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=5.0)).result in (DENIED, REJECTED)
        assert w.commands("ardrone3.Piloting.TakeOff") == []
        assert (await w.client.command(ENABLE, 0)).result == ACCEPTED
        await w.take_off()


async def test_conf_076_no_takeoff_without_knowing_where() -> None:
    async with world() as w:
        assert (await upload(w.client, [circle(PLACE, 100.0)], FENCE)).type == TAKEN
        w.drone.faults.gps = False
        await w.client.wait("GPS_RAW_INT", lambda m: m.fix_type < 2)
        mark = w.client.mark()
        assert (await w.client.command(mav_enums.MAV_CMD_COMPONENT_ARM_DISARM, 1)).result == REJECTED
        await said(w.client, "no GPS fix", since=mark)


@both
async def test_conf_143_do_fence_enable(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        client = w.client
        assert (await upload(client, square(PLACE, 30.0), FENCE)).type == TAKEN
        assert (await put(w, "ANF_FENCE_FLOOR", 3.0, 9)).param_value == 3.0
        await w.take_off()
        far = around(PLACE, (60.0, 0.0))[0]

        async def goes(place: tuple[float, float], height: float) -> int:
            ack = await client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=height)
            return int(ack.result)

        assert await goes(far, 5.0) == DENIED
        assert await goes(PLACE, 2.0) == DENIED
        # 2: the floor only.
        assert (await client.command(ENABLE, 2)).result == ACCEPTED
        await bits(client, True, True, True)
        assert await goes(PLACE, 2.0) == ACCEPTED
        assert await goes(far, 5.0) == DENIED
        # By kind: 4 polygons, 8 the floor.
        assert (await client.command(ENABLE, 0, 4)).result == ACCEPTED
        assert await goes(far, 5.0) == ACCEPTED
        assert (await client.command(ENABLE, 1, 8)).result == ACCEPTED
        assert await goes(PLACE, 2.0) == DENIED
        # All of it off and on again, however it is sent.
        assert (await client.command(ENABLE, 0, 0)).result == ACCEPTED
        await bits(client, True, False, True)
        assert await goes(PLACE, 2.0) == ACCEPTED
        assert (await client.command(ENABLE, 1, frame=0, x=0.0, y=0.0, z=0.0)).result == ACCEPTED
        await bits(client, True, True, None)  # the drone may be outside now
        assert await goes(far, 5.0) == DENIED
        for params in ((NAN,), (3.0,), (math.inf,), (1.0, 16.0), (1.0, 0.5), (0.0, math.inf), (0.0, 1.0)):
            assert (await client.command(ENABLE, *params)).result == DENIED, params
        if flavour == "ardupilot":
            assert (await put(w, "FENCE_ENABLE", 0)).param_value == 0
            await bits(client, True, False, True)
        await clear(client, FENCE)
        assert (await put(w, "ANF_FENCE_FLOOR", 0.0, 9)).param_value == 0.0
        await bits(client, False, False, True)


async def test_conf_143_kinds_of_a_fence_and_its_switch_are_independent() -> None:
    """As ArduPilot's FENCE_TYPE and FENCE_ENABLE: neither changes the other, and a command switches what is chosen."""
    async with world(flavour="ardupilot") as w:
        client, floor, polygon = w.client, 1 + 8, 1 + 4
        assert (await upload(client, square(PLACE, 30.0), FENCE)).type == TAKEN
        assert (await put(w, "ANF_FENCE_FLOOR", 3.0, 9)).param_value == 3.0
        assert (await put(w, "FENCE_ENABLE", 0)).param_value == 0
        assert (await put(w, "FENCE_TYPE", floor)).param_value == floor
        assert (await read(client, "FENCE_ENABLE")).param_value == 0
        await bits(client, True, False, True)
        assert (await put(w, "FENCE_ENABLE", 1)).param_value == 1
        assert (await read(client, "FENCE_TYPE")).param_value == floor
        assert (await client.command(ENABLE, 1, 4)).result == DENIED
        await said(client, "Fence refused: kind not in ANF_FENCE_TYPES")
        await w.take_off()
        far = around(PLACE, (60.0, 0.0))[0]
        ack = await client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=far[0], y=far[1], z=5.0)
        assert ack.result == ACCEPTED
        assert (await put(w, "FENCE_TYPE", polygon)).param_value == polygon
        ack = await client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=far[0], y=far[1], z=6.0)
        assert ack.result == DENIED


@pytest.mark.parametrize("way", ["command", "ANF_FENCE_ON", "ANF_FENCE_TYPES"])
async def test_fence_switched_off_by_one_client_is_reported_to_all(way: str) -> None:
    async with world(clients=2) as w:
        first, second = w.clients
        assert (await upload(first, square(PLACE, 30.0), FENCE)).type == TAKEN
        mark = second.mark()
        for _ in range(2):  # the second time changes nothing
            if way == "command":
                assert (await first.command(ENABLE, 0)).result == ACCEPTED
            else:
                assert (await put(w, way, 0)).param_value == 0
        await bits(second, True, False, True)
        assert [text for text in texts(second, mark) if "Fence" in text] == [FENCE_OFF]


@both()
async def test_floor_that_one_client_removes_is_reported_to_all(flavour: str) -> None:
    async with world(clients=2, flavour=flavour) as w:
        second = w.clients[1]
        for floor in (5.0, 0.0):
            mark = second.mark()
            assert (await put(w, "ANF_FENCE_FLOOR", floor, 9)).param_value == floor
        await second.wait("STATUSTEXT", lambda m: m.text == FENCE_OFF, since=mark)


async def test_kinds_of_ardupilot_without_the_uploaded_zones_are_reported_to_all() -> None:
    async with world(clients=2, flavour="ardupilot") as w:
        second = w.clients[1]
        assert (await upload(w.client, square(PLACE, 30.0), FENCE)).type == TAKEN
        mark = second.mark()
        assert (await put(w, "FENCE_TYPE", 1)).param_value == 1
        await second.wait("STATUSTEXT", lambda m: m.text == FENCE_OFF, since=mark)


async def test_fence_switched_on_without_a_boundary_is_reported() -> None:
    """Accepted, for a fence that is uploaded later is to be in force."""
    async with world() as w:
        assert (await w.client.command(ENABLE, 1)).result == ACCEPTED
        await said(w.client, "Fence on, but no boundary is in force")
        assert (await upload(w.client, square(PLACE, 30.0), FENCE)).type == TAKEN
        mark = w.client.mark()
        assert (await w.client.command(ENABLE, 1)).result == ACCEPTED
        await bits(w.client, True, True, True)
        assert not [m for _, m in w.client.since(mark, "STATUSTEXT") if "no boundary" in m.text]


async def test_conf_076_a_motor_cut_needs_leave() -> None:
    async with world() as w:
        mark = w.client.mark()
        assert value_of(await write(w.client, "GF_ACTION", 4, 6)) == 2
        assert (await w.client.wait("PARAM_ERROR", since=mark)).error == mav_enums.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
        await said(w.client, "allow_kill")
    async with world(allow_kill=True) as w:
        value = await put(w, "GF_ACTION", 4)
        assert struct.unpack("<i", struct.pack("<f", value.param_value)) == (4,)


# The drone's own geofence.

DISTANCE = "ardrone3.PilotingSettings.MaxDistance"
SWITCH = "ardrone3.PilotingSettings.NoFlyOverMaxDistance"


def own_fence(w: World) -> tuple[float, int]:
    """The radius of the drone's own geofence, and whether it is on: what it was commanded last."""
    settings = w.drone.firmware.settings
    return settings.number("max_distance"), int(settings["geofence"])


async def until(condition: Callable[[], bool], timeout: float = 5.0) -> None:
    """Look again and again: the simulator has no event for a setting."""
    deadline = asyncio.get_running_loop().time() + timeout
    while not condition():
        assert asyncio.get_running_loop().time() < deadline
        await asyncio.sleep(0.05)


@both
@pytest.mark.parametrize(
    "item",
    [circle(PLACE, 60.0), Item(mav_enums.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, 0.0, 0.0, p1=60.0)],
    ids=["circle", "home"],
)
async def test_fence_circle_around_the_start_becomes_the_drones_geofence(flavour: str, item: Item) -> None:
    async with world(flavour=flavour) as w:
        before = own_fence(w)
        assert before == (100.0, 0)
        assert (await upload(w.client, [item], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (60.0, 1))
        await said(w.client, "Drone geofence set: 60 m", since=0)
        await w.take_off()
        assert own_fence(w) == (60.0, 1)
        # Another one: what was before all of them is what comes back.
        assert (await upload(w.client, [circle(PLACE, 80.0)], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (80.0, 1))
        assert (await w.client.command(ENABLE, 0)).result == ACCEPTED
        await until(lambda: own_fence(w) == before)
        assert (await w.client.command(ENABLE, 1)).result == ACCEPTED
        await until(lambda: own_fence(w) == (80.0, 1))
        assert (await clear(w.client, FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == before)


async def test_drones_own_circle_is_neither_enabled_nor_disabled_by_command() -> None:
    """FENCE_TYPE's bit 2 is the drone's own circle: it is in force, and a command does not switch it off."""
    async with world(flavour="ardupilot") as w:
        client, circle_kind = w.client, 2
        assert (await client.command(ENABLE, 0, circle_kind)).result == ACCEPTED
        assert (await put(w, "FENCE_TYPE", 1 + circle_kind)).param_value == 1 + circle_kind
        assert own_fence(w) == (100.0, 1)
        mark = client.mark()
        assert (await client.command(ENABLE, 1, circle_kind)).result == ACCEPTED
        assert not [text for text in texts(client, mark) if "Fence" in text]
        assert (await client.command(ENABLE, 0, circle_kind)).result == DENIED
        await said(client, "Fence refused: circle set by ANF_GEOFENCE", since=mark)
        assert own_fence(w) == (100.0, 1)


async def test_mirrored_circle_around_home_is_disabled_by_command() -> None:
    async with world() as w:
        item = Item(mav_enums.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, 0.0, 0.0, p1=60.0)
        assert (await upload(w.client, [item], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (60.0, 1))
        assert (await w.client.command(ENABLE, 0, 2)).result == ACCEPTED
        await until(lambda: own_fence(w) == (100.0, 0))


async def test_fence_wider_than_the_geofence_keeps_drone_settings() -> None:
    async with world() as w:
        elsewhere = around(PLACE, (40.0, 0.0))[0]
        for items in (
            square(PLACE, 60.0),
            [circle(elsewhere, 60.0)],
            [circle(PLACE, 60.0), circle(PLACE, 70.0)],
            [circle(PLACE, 60.0, inclusion=False)],
            [circle(PLACE, 9.0)],  # the drone's smallest is 10 m
        ):
            assert (await upload(w.client, items, FENCE)).type == TAKEN
            for _ in range(3):
                await w.client.wait("HEARTBEAT")
            assert (w.commands(DISTANCE), w.commands(SWITCH)) == ([], [])


async def test_geofence_changed_by_another_client_stays() -> None:
    async with world() as w:
        assert (await upload(w.client, [circle(PLACE, 60.0)], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (60.0, 1))
        await put(w, "ANF_MAX_DIST", 90.0, 9)
        assert own_fence(w) == (90.0, 1)
        assert (await clear(w.client, FENCE)).type == TAKEN
        await said(w.client, "changed meanwhile")
        assert own_fence(w) == (90.0, 1)


async def test_the_next_gateway_puts_the_geofence_back() -> None:
    """It finds the fence, the settings and what the drone had before; then the fence is cleared."""
    async with world() as w:
        await put(w, "GF_ACTION", 3)
        assert (await upload(w.client, [circle(PLACE, 60.0)], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (60.0, 1))
        (drone,) = w.gateway.config.drones
        await w.gateway.close()
        config = Config(
            endpoints=(f"tcpin://{w.address}:5761",),
            drones=(DroneConfig(name="again", sysid=1, address=drone.address),),
        )
        async with Gateway(config) as again:
            client = await w.connect(port=5761)
            assert await again.ready(10.0), again.lines()
            await said(client, "Fence: 1 inclusion circle")
            mark = client.mark()
            client.send(dialect.MAVLink_param_request_read_message(1, 1, b"GF_ACTION", -1))
            value = await client.wait("PARAM_VALUE", since=mark)
            assert struct.unpack("<i", struct.pack("<f", value.param_value)) == (3,)
            assert own_fence(w) == (60.0, 1)
            assert (await clear(client, FENCE)).type == TAKEN
            await until(lambda: own_fence(w) == (100.0, 0))


# Its centre behind a Skycontroller with GPS is the pilot (S10).

CENTRE = "ardrone3.GPSSettingsState.GeofenceCenterChanged"


async def pilot_goes_to(w: World, north: float) -> None:
    """Carry the Skycontroller to a place so many metres north of the take-off; the drone reports its new centre."""
    pilot, place = w.drone.skycontroller, around(PLACE, (north, 0.0))[0]
    assert pilot is not None
    pilot.locate(*place, HOME[2])
    await w.drone.wait_log(
        lambda e: e.name == CENTRE and geo.distance(e.args["latitude"], e.args["longitude"], *place) < 0.1, 5.0
    )


@both
async def test_goto_beyond_the_distance_limit_is_refused(flavour: str) -> None:
    async with world(flavour=flavour, skycontroller=3) as w:
        w.drone.firmware.receive(ardrone3.MaxDistance(60.0), 0.0)
        w.drone.firmware.receive(ardrone3.NoFlyOverMaxDistance(1), 0.0)
        await w.take_off()
        await pilot_goes_to(w, 50.0)
        mark = w.client.mark()
        for north, result in ((-20.0, DENIED), (90.0, ACCEPTED)):
            place = around(PLACE, (north, 0.0))[0]
            ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, x=place[0], y=place[1], z=6.0, frame=3)
            assert ack.result == result, (north, texts(w.client, mark))
        assert "Goto refused: 70 m > geofence 60 m" in texts(w.client, mark)
        assert len(w.commands("ardrone3.Piloting.moveTo")) == 1


async def test_fence_circle_becomes_geofence_only_near_its_centre() -> None:
    async with world(skycontroller=3) as w:
        assert (await upload(w.client, [circle(PLACE, 60.0)], FENCE)).type == TAKEN
        await until(lambda: own_fence(w) == (60.0, 1))
        await pilot_goes_to(w, 4.0)
        await w.take_off()
        await w.client.wait("HEARTBEAT")
        await w.client.wait("HEARTBEAT")
        assert own_fence(w) == (60.0, 1)
        mark = w.client.mark()
        await pilot_goes_to(w, 7.0)
        await said(w.client, "Drone geofence ends: centre is 7 m off", since=mark)
        await until(lambda: own_fence(w) == (100.0, 0))


# Rally points.


@both
async def test_conf_077_rally_points_are_kept_and_not_used(flavour: str) -> None:
    """The default: they come back as they were sent, and a return ends at home."""
    async with world(flavour=flavour) as w:
        points = [rally(around(PLACE, (60.0, 0.0))[0], 15.0), rally(around(PLACE, (0.0, 80.0))[0], 20.0)]
        mark = w.client.mark()
        assert (await upload(w.client, points, RALLY)).type == TAKEN
        await said(w.client, "Rally points not used: RTL_TYPE is home (2)", since=mark)
        assert [content(item) for item in await download(w.client, RALLY)] == [item.content for item in points]
        await w.take_off()
        for _ in range(3):
            await w.client.wait("HEARTBEAT")
        assert (w.commands("rth.set_custom_location"), w.commands("rth.set_preferred_home_type")) == ([], [])


def preferred(w: World) -> list[int]:
    return [entry.args["type"] for entry in w.commands("rth.set_preferred_home_type")]


async def test_conf_077_rally_points_are_used_according_to_rtl_type() -> None:
    """A return ends at the closest one; after the landing the drone's home is what it was."""
    async with world() as w:
        near, far = around(PLACE, (40.0, 30.0), (-90.0, 0.0))
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(far, 25.0), rally(near, 25.0)], RALLY)).type == TAKEN
        assert preferred(w) == []  # not on the ground
        await w.take_off()
        await said(w.client, "Returns end at rally point 1", since=0, timeout=10.0)
        (location,) = w.commands("rth.set_custom_location")
        assert geo.distance(location.args["latitude"], location.args["longitude"], *near) < 0.1
        assert location.args["altitude"] == pytest.approx(25.0)
        await w.client.wait("HOME_POSITION", lambda m: geo.distance(m.latitude / 1e7, m.longitude / 1e7, *near) < 1.0)
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH)).result == ACCEPTED
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and math.hypot(e.args["north"] - 40.0, e.args["east"] - 30.0) < 1.0, 60.0
        )
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & 128, timeout=60.0)
        await until(lambda: len(preferred(w)) == 2)
        assert preferred(w) == [3, 1]  # custom, then take-off again


async def test_conf_077_the_closest_of_home_and_rally_points() -> None:
    async with world() as w:
        far = around(PLACE, (100.0, 0.0))[0]
        await put(w, "RTL_TYPE", 0)
        assert (await upload(w.client, [rally(far, 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        for _ in range(3):
            await w.client.wait("HEARTBEAT")
        assert w.commands("rth.set_custom_location") == []
        place = around(PLACE, (80.0, 0.0))[0]
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
        assert ack.result == ACCEPTED
        await said(w.client, "Returns end at rally point 0", timeout=30.0)
        assert w.drone.pose.north > 50.0
        await put(w, "RTL_TYPE", 2)
        await until(lambda: preferred(w) == [3, 1])


async def test_conf_077_a_rally_point_outside_the_fence_is_not_used() -> None:
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, square(PLACE, 50.0), FENCE)).type == TAKEN
        outside, inside = around(PLACE, (60.0, 0.0), (-45.0, 0.0))
        assert (await upload(w.client, [rally(outside, 20.0), rally(inside, 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        await said(w.client, "Returns end at rally point 1", since=0, timeout=10.0)


async def test_conf_077_rally_point_in_use_does_not_move_a_fence_circle_around_home() -> None:
    """The drone's home is the rally point, 35 m north; the circle of 40 m stays around the take-off point."""
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [Item(HOME_CIRCLE, 0.0, 0.0, p1=40.0, frame=3)], FENCE)).type == TAKEN
        assert (await upload(w.client, [rally(around(PLACE, (35.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off(10.0)
        await said(w.client, "Returns end at rally point 0", since=0, timeout=10.0)
        for north, is_inside in ((60.0, False), (-30.0, True)):
            place = around(PLACE, (north, 0.0))[0]
            ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=10.0)
            assert (ack.result == ACCEPTED) is is_inside
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["north"] + 30.0) < 1.0, 40.0)
        assert [text for text in texts(w.client) if text.startswith("Fence ") and " beyond " in text] == []


async def test_conf_077_home_type_written_while_a_rally_point_becomes_home_follows_it() -> None:
    """What is reported last holds: returns end at the take-off point again."""
    async with world(speed=1.0) as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(around(PLACE, (-30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        w.drone.faults.down = w.drone.faults.up = Impairment(delay=0.3)
        mark = w.client.mark()
        taking_off = asyncio.ensure_future(w.take_off())
        await until(lambda: preferred(w) == [RthHomeType.CUSTOM], 20.0)
        send_set(w.client, "ANF_HOME_TYPE", RthHomeType.TAKEOFF, dialect.MAV_PARAM_TYPE_INT32)
        await taking_off
        await said(w.client, "Returns end at rally point 0", since=mark, timeout=10.0)
        chosen = w.client.mark()
        value = await w.client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_HOME_TYPE", since=chosen, timeout=10.0)
        assert value_of(value) == RthHomeType.TAKEOFF
        assert preferred(w)[-1] == RthHomeType.TAKEOFF


async def test_conf_077_home_type_written_while_a_rally_point_is_home_holds_after_a_lost_link() -> None:
    async with world(speed=1.0) as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(around(PLACE, (-30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        await said(w.client, "Returns end at rally point 0", timeout=10.0)
        await write(w.client, "ANF_HOME_TYPE", RthHomeType.TAKEOFF, dialect.MAV_PARAM_TYPE_INT32)
        await looked(w)
        w.drone.faults.mute = True
        await watched(6.0)
        w.drone.faults.mute, mark = False, w.client.mark()
        await w.client.wait("GLOBAL_POSITION_INT", since=mark, timeout=30.0)
        await looked(w)
        assert preferred(w) == [RthHomeType.CUSTOM, RthHomeType.TAKEOFF]


async def test_conf_077_home_type_written_while_a_rally_point_is_home_holds_until_the_landing() -> None:
    """The rally point that is the closest from then on does not become home; in the next flight it does."""
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        points = [rally(place, 20.0) for place in around(PLACE, (-30.0, 0.0), (60.0, 0.0))]
        assert (await upload(w.client, points, RALLY)).type == TAKEN
        await w.take_off()
        await said(w.client, "Returns end at rally point 0", timeout=10.0)
        answer = await write(w.client, "ANF_HOME_TYPE", RthHomeType.TAKEOFF, dialect.MAV_PARAM_TYPE_INT32)
        assert value_of(answer) == RthHomeType.TAKEOFF
        place = around(PLACE, (50.0, 0.0))[0]
        ack = await w.client.command(REPOSITION, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=8.0)
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 48.0, 40.0)
        await said(w.client, "Rally points not used: another home is set", timeout=10.0)
        await looked(w)
        assert preferred(w) == [RthHomeType.CUSTOM, RthHomeType.TAKEOFF]
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & 128, timeout=60.0)
        await w.take_off()
        await said(w.client, "Returns end at rally point 1", timeout=10.0)


@pytest.mark.parametrize("by", ["a client", "a rally point"])
async def test_conf_077_home_of_some_other_day_is_none_while_a_custom_one_is_set(by: str) -> None:
    """The drone is given the place before it prefers custom homes."""
    async with world() as w:
        if by == "a rally point":
            await put(w, "RTL_TYPE", 1)
            assert (await upload(w.client, [rally(around(PLACE, (30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        if by == "a client":
            await set_home(w, 10.0)
        await until(lambda: preferred(w) != [])
        names = [e.name for e in w.drone.log if e.kind == "command" and e.name.startswith("rth.set")]
        assert names == ["rth.set_custom_location", "rth.set_preferred_home_type"]


async def test_conf_077_home_chosen_by_a_client_is_left_alone() -> None:
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        await w.take_off()
        place = around(PLACE, (10.0, 0.0))[0]
        ack = await w.client.command(dialect.MAV_CMD_DO_SET_HOME, 0, x=place[0], y=place[1], z=HOME[2])
        assert ack.result == ACCEPTED
        sent = len(w.commands("rth.set_custom_location"))
        assert (await upload(w.client, [rally(around(PLACE, (30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await said(w.client, "Rally points not used", timeout=10.0)
        assert len(w.commands("rth.set_custom_location")) == sent


def homes(w: World) -> list[tuple[float, float]]:
    """Places that the drone was given as its home, m north and east of where it took off."""
    entries = w.commands("rth.set_custom_location")
    return [
        (round(north), round(east))
        for north, east in (geo.offset(*PLACE, e.args["latitude"], e.args["longitude"]) for e in entries)
    ]


async def set_home(w: World, north: float, timeout: float = 8.0) -> None:
    place = around(PLACE, (north, 0.0))[0]
    ack = await w.client.command(dialect.MAV_CMD_DO_SET_HOME, 0, x=place[0], y=place[1], z=HOME[2], timeout=timeout)
    assert ack.result == ACCEPTED


async def looked(w: World) -> None:
    """The rally points have been looked at again, which is once a second."""
    for _ in range(3):
        await w.client.wait("HEARTBEAT")


async def test_conf_077_home_set_while_a_rally_point_counts_stays() -> None:
    """No other rally point takes its place in flight, nor the take-off point after the landing."""
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(around(PLACE, (30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        await said(w.client, "Returns end at rally point 0", since=0, timeout=10.0)
        await set_home(w, 10.0)
        assert (await upload(w.client, [rally(around(PLACE, (0.0, 20.0))[0], 20.0)], RALLY)).type == TAKEN
        await said(w.client, "Rally points not used: another home is set", timeout=10.0)
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: not beat.base_mode & 128, timeout=60.0)
        await looked(w)
        assert homes(w) == [(30, 0), (10, 0)]
        assert preferred(w) == [3, 3]


async def test_conf_077_home_set_just_before_landing_stays() -> None:
    """No one has looked at it before the drone stands."""
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(around(PLACE, (30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        await said(w.client, "Returns end at rally point 0", since=0, timeout=10.0)
        assert (await w.client.command(mav_enums.MAV_CMD_NAV_LAND)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] < 0.5, 30.0, since=w.drone.log[-1].t)
        await set_home(w, 10.0)
        await w.client.heartbeat(lambda beat: not beat.base_mode & 128, timeout=60.0)
        await looked(w)
        assert (homes(w), preferred(w)) == ([(30, 0), (10, 0)], [3, 3])


async def test_conf_077_home_set_while_a_rally_point_is_refused_stays() -> None:
    """The drone does not take the rally point, which is too far away, and says so by silence: it is asked meanwhile."""
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        assert (await upload(w.client, [rally(around(PLACE, (200.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        await w.drone.wait_log(lambda e: e.name == "rth.set_custom_location", 10.0)
        await set_home(w, 10.0, timeout=15.0)
        await said(w.client, "Rally point 0 not used", since=0)
        await looked(w)
        assert homes(w) == [(200, 0), (10, 0)]
        assert preferred(w)[-1] == 3


async def test_conf_077_home_type_is_restored_after_a_rally_point_whose_choice_is_not_reported() -> None:
    async with world() as w:
        await put(w, "RTL_TYPE", 1)
        w.drone.faults.unreported = frozenset({rth.PreferredHomeType.NAME})
        assert (await upload(w.client, [rally(around(PLACE, (-30.0, 0.0))[0], 20.0)], RALLY)).type == TAKEN
        await w.take_off()
        chosen = await w.drone.wait_log(lambda e: e.name == rth.SetPreferredHomeType.NAME, 10.0)
        await said(w.client, "Rally point 0 not used", since=0, timeout=10.0)
        w.drone.faults.unreported = frozenset()
        await w.drone.wait_log(lambda e: e.name == chosen.name and e is not chosen, 10.0, since=chosen.t)
        assert preferred(w) == [RthHomeType.CUSTOM, RthHomeType.TAKEOFF]
        assert w.drone.firmware.settings["home_type"] == RthHomeType.TAKEOFF
