"""What must never happen over people: old setpoints that fly on, acknowledgements that lie, orders that overtake each
other, and our hand in what the drone does by itself. Judged by what the simulated drone heard and did."""

from __future__ import annotations

import asyncio
import itertools
import math
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    CANCELLED,
    DENIED,
    GOTO,
    LAND_CMD,
    PX4_HOLD,
    PX4_OFFBOARD,
    REJECTED,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    being_tried,
    deaf,
    goto,
    heard,
    now_mute,
    on_command,
    return_by_itself,
    until,
    watched,
)
from support.mav import NAN, Client
from support.params import write
from support.world import HOLD, HOME, LAND, OFFBOARD, RETURN, World, world

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import ardrone3, common, rth
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.units import quaternion_from_euler

PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

FORWARD = -0.17
"""rad of pitch: more than the 10 degrees that are full tilt."""


def at_once(client: Client, *commands: tuple[int, tuple[float, ...]]) -> None:
    """Several COMMAND_LONG in one segment."""
    data = b""
    for id, params in commands:
        seven = [*params, *[NAN] * (7 - len(params))]
        data += client.pack(dialect.MAVLink_command_long_message(1, 1, id, 0, *seven))
    client.send_raw(data)


def attitude(client: Client, *, pitch: float = 0.0, yaw: float = 0.0, q: Any = None, thrust: float = 0.5) -> None:
    rotation = list(quaternion_from_euler(0.0, pitch, yaw)) if q is None else q
    client.send(dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, rotation, 0.0, 0.0, 0.0, thrust))


@asynccontextmanager
async def streaming(client: Client, **setpoint: Any) -> AsyncIterator[None]:
    """A program that sends the same setpoint twenty times a second, and dies at the end of the block."""

    under_way = asyncio.Event()

    async def stream() -> None:
        for count in itertools.count(1):
            attitude(client, **setpoint)
            if count == 4:
                under_way.set()
            await asyncio.sleep(0.05)  # the program's own rate

    task = asyncio.ensure_future(stream())
    try:
        await under_way.wait()
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def deflected(w: World) -> None:
    """The drone hears the sticks lean."""
    await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.PCMD" and e.args["pitch"] != 0)


async def engage(client: Client) -> None:
    assert (await client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED


def pitches(w: World, since: int = 0) -> list[int]:
    """What the sticks said, nose down +."""
    return [entry.args["pitch"] for entry in w.commands("ardrone3.Piloting.PCMD")][since:]


# Orders that overtake each other.


async def test_two_commands_in_one_segment_are_answered_newer_flown() -> None:
    async with world() as w:
        await w.take_off()
        mark = w.client.mark()
        at_once(w.client, (RTL, ()), (LAND_CMD, ()))
        assert set(await until(w.client, mark, 2)) == {(RTL, CANCELLED), (LAND_CMD, ACCEPTED)}
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


async def test_older_of_two_commands_does_not_cancel_the_newer() -> None:
    """The newer one is refused: the older one goes on, and is answered."""
    async with world() as w:
        await w.take_off()
        mark = w.client.mark()
        at_once(w.client, (RTL, ()), (TAKEOFF_CMD, ()))
        assert set(await until(w.client, mark, 2)) == {(RTL, ACCEPTED), (TAKEOFF_CMD, REJECTED)}
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)


async def test_late_repetition_does_not_replace_another_clients_command() -> None:
    async with world(clients=1) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert await goto(w, 40.0, 10.0) == ACCEPTED
        assert (await w.client.command(RTL)).result == ACCEPTED
        assert (await other.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert (await w.client.command(RTL)).result == CANCELLED
        assert heard(w, "return_to_home") == ["return_to_home"]
        # An order to stop is carried out, repetition or not.
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        place = geo.destination(*HOME[:2], 60.0, 0.0)
        assert (await other.command(GOTO, -1, 1, 0, NAN, frame=6, x=place[0], y=place[1], z=10.0)).result == ACCEPTED
        before = heard(w, "CancelMoveTo")
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert len(heard(w, "CancelMoveTo")) == len(before) + 1


async def test_repeated_takeoff_after_success_is_not_refused() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=3.0)).result == ACCEPTED
        await watched(2.5)  # MAVSDK waits up to 3 s for an acknowledgement that was lost
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=3.0)).result == ACCEPTED
        assert heard(w, "TakeOff") == ["TakeOff"]


async def test_disarm_after_a_takeoff_waiting_for_arming_ends_it() -> None:
    async with world() as w:
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        mark = w.client.mark()
        at_once(w.client, (ARM, (1.0,)), (ARM, (0.0,)))
        await until(w.client, mark, 2)
        await watched(1.0)
        assert w.drone.flying_state.name in ("LANDED", "LANDING")
        assert w.drone.pose.up < 2.0  # certainly not on its way to five metres


async def test_disarm_while_the_take_off_is_in_bad_air() -> None:
    """What is accepted is what happens: disarmed means that it does not take off."""
    async with world() as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.mute = True
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await being_tried(w.client, mark, TAKEOFF_CMD)
        w.client.send_command(ARM, 0.0)
        await being_tried(w.client, mark, ARM)
        w.drone.faults.mute = False
        assert set(await until(w.client, mark, 2)) == {(TAKEOFF_CMD, CANCELLED), (ARM, ACCEPTED)}
        await watched(1.0)
        assert w.drone.flying_state.name == "LANDED"


async def test_land_during_an_unreported_takeoff() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        muted = now_mute(w, "ardrone3.Piloting.TakeOff", 0.7)
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await muted
        w.client.send_command(LAND_CMD)
        assert set(await until(w.client, mark, 2)) == {(TAKEOFF_CMD, CANCELLED), (LAND_CMD, ACCEPTED)}
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        await watched(1.0)
        assert w.drone.flying_state.name == "LANDED"


async def test_disarm_of_a_drone_that_has_taken_off_meanwhile_is_refused() -> None:
    """For the gateway it still stands: it is landed, and is not reported as disarmed before."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        muted = now_mute(w, "ardrone3.Piloting.TakeOff", 1.5)
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await muted
        w.client.send_command(ARM, 0.0)
        assert set(await until(w.client, mark, 2)) == {(TAKEOFF_CMD, CANCELLED), (ARM, REJECTED)}
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


async def test_goto_during_an_unreported_return() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        muted = now_mute(w, "rth.return_to_home", 0.5)
        mark = w.client.mark()
        w.client.send_command(RTL)
        await muted
        assert await goto(w, 30.0, 8.0) == REJECTED  # a goto does not end a return
        assert set(await until(w.client, mark, 2)) == {(GOTO, REJECTED), (RTL, ACCEPTED)}
        assert heard(w, "return_to_home", "abort", "moveTo") == ["return_to_home"]


async def test_return_repeated_during_a_hold() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        assert await goto(w, 40.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 15.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        aborted = now_mute(w, "rth.abort", 0.4)
        mark = w.client.mark()
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await aborted
        w.client.send_command(RTL)
        assert set(await until(w.client, mark, 2)) == {(SET_MODE, CANCELLED), (RTL, ACCEPTED)}
        assert len(heard(w, "return_to_home")) == 2
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)


@pytest.mark.parametrize("order", [(LAND_CMD,), (ARM, 0.0)])
async def test_land_and_disarm_during_unreported_climb_are_not_confirmed(order: tuple[Any, ...]) -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        gone = on_command(w, "ardrone3.Piloting.TakeOff", lambda: deaf(w, 3.5))
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await gone
        ack = await w.client.command(*order)
        if ack.result == ACCEPTED:
            assert w.drone.flying_state.name in ("LANDED", "LANDING")
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        else:  # disarming comes too late, which is said
            assert (order[0], ack.result) == (ARM, REJECTED)


async def test_hold_is_confirmed_when_the_climb_has_ended() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=30.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 3.0, 20.0)
        deaf(w, 2.0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        height = w.drone.pose.up
        assert height > 6.0  # it was not confirmed before it was heard
        await watched(2.0)
        assert w.drone.pose.up < height + 3.0


async def test_second_hold_does_not_confirm_the_first() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        assert await goto(w, 80.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 20.0)
        deaf(w, 3.0)
        mark = w.client.mark()
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await being_tried(w.client, mark, SET_MODE)
        assert (await other.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert heard(w, "CancelMoveTo") != []


async def test_return_is_not_confirmed_by_a_return_under_abort() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        assert await goto(w, 60.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 20.0, 20.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        deaf(w, 3.2)
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await watched(2.4)  # the abort is not forgotten after any time
        assert (await w.client.command(RTL)).result == ACCEPTED
        again = await w.drone.wait_log(lambda e: heard(w, "return_to_home", "abort")[1:] == ["abort", "return_to_home"])
        await w.drone.wait_log(
            lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.IN_PROGRESS, since=again.t
        )
        mark = w.client.mark()
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, since=mark)


async def test_repeated_land_and_return_are_executed_each_time() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        another_controller(w, ardrone3.PCMD(1, 0, 0, 0, 50, 0))  # a pilot pulls up
        await w.client.heartbeat(lambda beat: beat.custom_mode != LAND)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        another_controller(w, ardrone3.PCMD(1, 0, 0, 0, 50, 0))
        await w.client.heartbeat(lambda beat: beat.custom_mode != LAND)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        another_controller(w, rth.Abort())
        await w.client.heartbeat(lambda beat: beat.custom_mode != RETURN)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)


async def test_another_clients_arming_starts_no_take_off() -> None:
    async with world() as w:
        other = await w.connect(sysid=250)
        assert (await other.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        await watched(1.0)
        assert heard(w, "TakeOff") == []
        assert (await other.command(ARM, 1)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "ardrone3.Piloting.TakeOff")


# Setpoints.


async def test_the_sticks_are_level_before_a_landing_begins() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client, pitch=FORWARD):
            await engage(w.client)
            await deflected(w)
            assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        sent = [e for e in w.drone.log if e.kind == "command" and e.name.startswith("ardrone3.Piloting.")]
        landing = [e.name for e in sent].index("ardrone3.Piloting.Landing")
        assert (sent[landing - 1].name, sent[landing - 1].args["pitch"]) == ("ardrone3.Piloting.PCMD", 0)
        assert [e for e in sent[landing:] if e.name == "ardrone3.Piloting.PCMD"] == []


async def test_setpoint_ends_with_its_own_sender() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        async with streaming(other):
            async with streaming(w.client, pitch=FORWARD):
                pass
            last = time.monotonic()
            await watched(0.3)  # his last setpoint grows old, and is still just fresh
            await engage(w.client)
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
        leaning = [e.t for e in w.commands("ardrone3.Piloting.PCMD") if e.args["pitch"] != 0]
        assert leaning
        assert leaning[-1] - last <= 0.6  # half a second, and a little for this machine


async def test_a_refused_return_leaves_no_stick_deflected() -> None:
    async with world() as w:
        await w.take_off()
        async with streaming(w.client, pitch=FORWARD):
            await engage(w.client)
            w.drone.faults.gps = False
            await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["state"] == rth.RthState.UNAVAILABLE)
            assert (await w.client.command(RTL)).result == REJECTED
        flown = len(pitches(w))
        await watched(1.0)
        assert set(pitches(w, flown)) <= {0}


async def test_setpoints_end_at_a_return_by_another_controller() -> None:
    async with world() as w:
        await w.take_off()
        async with streaming(w.client, pitch=FORWARD):
            await engage(w.client)
            another_controller(w, rth.ReturnToHome())
            await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
            flown = len(pitches(w))
            await watched(0.5)  # the program goes on, to no effect
        assert set(pitches(w, flown)) <= {0}


async def test_offboard_has_one_pilot() -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        async with streaming(other, pitch=FORWARD):
            async with streaming(w.client):
                await engage(w.client)
                flown = len(pitches(w))
                await w.drone.wait_log(lambda e: len(pitches(w, flown)) > 5)
            # The pilot dies. The other one never asked for Offboard.
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
            await watched(0.3)
        assert set(pitches(w, flown)) == {0}
        assert any("another program" in m.text for _, m in other.since(0, "STATUSTEXT"))


@pytest.mark.parametrize("q", [[NAN] * 4, [0.0] * 4, [math.inf, 0.0, 0.0, 0.0], [1e30, 0.0, 1e30, 0.0]])
async def test_invalid_setpoints_move_nothing(q: list[float]) -> None:
    async with world() as w:
        await w.take_off()
        async with streaming(w.client):
            await engage(w.client)
            flown = len(pitches(w))
            for thrust in (NAN, math.inf, -math.inf, -5.0, 5.0):
                attitude(w.client, q=q, thrust=thrust)
                attitude(w.client, thrust=5.0 if math.isfinite(thrust) else thrust)
            await watched(0.2)
        sticks = [e.args for e in w.commands("ardrone3.Piloting.PCMD")[flown:]]
        assert {(s["roll"], s["pitch"], s["gaz"]) for s in sticks} == {(0, 0, 0)}


async def test_without_a_heading_the_other_axes_still_obey() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client, pitch=FORWARD, yaw=1.0):
            await engage(w.client)
        w.drone.firmware.motion_report = lambda: [ardrone3.AttitudeChanged(NAN, NAN, NAN)]  # type: ignore[method-assign]
        async with streaming(w.client, pitch=FORWARD, yaw=1.0):
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
        async with streaming(w.client, yaw=1.0):
            flown = len(pitches(w))
            await w.drone.wait_log(lambda e: len(pitches(w, flown)) > 5)
        last = w.commands("ardrone3.Piloting.PCMD")[-1].args
        assert (last["pitch"], last["yaw"]) == (0, 0)


async def test_many_setpoints_are_not_as_many_datagrams() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client):
            await engage(w.client)
            flown = len(pitches(w))
            for _ in range(400):
                attitude(w.client)
                await asyncio.sleep(0.002)  # the program's own rate
        times = [entry.t for entry in w.commands("ardrone3.Piloting.PCMD")][flown:]
        assert len(times) < (times[-1] - times[0]) / 0.02 + 5  # at most one in 20 ms


async def test_a_pilots_stick_ends_offboard_for_good() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off()
        pilot = w.drone.skycontroller
        assert pilot is not None
        async with streaming(w.client, pitch=FORWARD):
            await engage(w.client)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 0.5)
            pilot.stick(PITCH_STICK, -50)
            await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD)
            pilot.stick(PITCH_STICK, 0)
            flown = len(pitches(w))
            await watched(3.0)  # longer than he keeps the drone after his last touch
            assert set(pitches(w, flown)) <= {0}
        assert any("Skycontroller pilot" in m.text for _, m in w.client.since(0, "STATUSTEXT"))


# What the drone does by itself.


async def test_hold_does_not_abort_a_return_beginning_meanwhile() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        assert await goto(w, 60.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 1.0, 15.0)
        began = on_command(w, "ardrone3.Piloting.CancelMoveTo", lambda: return_by_itself(w))
        ack = await w.client.command(SET_MODE, *PX4_HOLD)
        await began
        assert ack.result == REJECTED
        assert heard(w, "abort") == []
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)


async def test_climb_after_takeoff_yields_to_the_drones_return() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        await watched(3.0)
        assert heard(w, "moveBy", "abort") == []


async def test_climb_ends_with_its_own_takeoff() -> None:
    async with world() as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        another_controller(w, ardrone3.Landing())
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        another_controller(w, ardrone3.TakeOff())
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
        await watched(1.0)
        assert heard(w, "moveBy") == []
        assert w.drone.pose.up < 2.0


async def test_hold_ends_a_move_of_another_client() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        place = geo.destination(*HOME[:2], 80.0, 0.0)
        another_controller(w, ardrone3.MoveTo(*place, 10.0, ardrone3.OrientationMode.NONE, 0.0))
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 15.0)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert heard(w, "CancelMoveTo") == ["CancelMoveTo"]
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 10.0)


def plan(state: common.PlayingState) -> common.MavlinkFilePlayingStateChanged:
    return common.MavlinkFilePlayingStateChanged(state, "uid", common.MavlinkType.FLIGHT_PLAN)


async def test_hold_pauses_a_flight_plan() -> None:
    async with world() as w:
        await w.take_off()
        w.drone.inject(plan(common.PlayingState.PLAYING))
        await w.client.heartbeat(lambda beat: beat.custom_mode == 0x04040000)  # Mission
        answered = on_command(w, "common.Mavlink.Pause", lambda: w.drone.inject(plan(common.PlayingState.PAUSED)))
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await answered


# The motors.


async def test_accepted_motor_cut_cannot_be_cancelled() -> None:
    async with world(allow_kill=True) as w:
        other = await w.connect(sysid=250)
        await w.take_off()
        w.drone.faults.mute = True
        mark = w.client.mark()
        w.client.send_command(ARM, 0.0, 21196.0)
        await being_tried(w.client, mark, ARM)
        assert (await other.command(SET_MODE, *PX4_HOLD)).result == REJECTED
        w.drone.faults.mute = False
        assert (ARM, ACCEPTED) in await until(w.client, mark, 1)
        assert w.drone.flying_state.name in ("EMERGENCY", "LANDED")


# The end of the gateway.


async def test_gateway_shutdown_levels_sticks_under_an_active_sender() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        async with streaming(w.client, pitch=FORWARD):
            await engage(w.client)
            await deflected(w)
            flown = len(pitches(w))
            await w.gateway.close()
        assert len(pitches(w, flown)) > 30
        assert set(pitches(w, flown + 2)) == {0}  # what was on its way when the closing began aside


async def test_gateway_does_not_climb_during_shutdown() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=20.0)).result == ACCEPTED
        await w.gateway.close()
        assert [e.args for e in w.commands("ardrone3.Piloting.moveBy") if e.args["dZ"] != 0.0] == []


async def test_end_of_the_gateway_lands_a_takeoff_that_the_drone_has_not_received() -> None:
    """It would rise after the end of the gateway, and hover with no program to land it."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.drone.faults.up = Impairment(delay=0.8)
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await being_tried(w.client, mark, TAKEOFF_CMD)
        assert heard(w, "TakeOff") == []
        await w.gateway.close()
        await watched(10.0)
        assert w.drone.flying_state.name == "LANDED"


async def test_end_of_the_gateway_lands_a_drone_that_starts_its_motors() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.client.send_command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)
        await being_tried(w.client, mark, TAKEOFF_CMD)
        await w.drone.wait_log(lambda e: w.drone.flying_state.name == "MOTOR_RAMPING", 5.0)
        await w.gateway.close()
        await watched(10.0)
        assert w.drone.flying_state.name == "LANDED"


@pytest.mark.parametrize("skycontroller", [None, 3])
async def test_end_of_the_gateway_stops_the_motors_of_a_drone_in_a_hand(skycontroller: int | None) -> None:
    """A throw after it would be a take-off without a program. A hand launch does not take the pilot's sticks."""
    async with world(speed=1.0, skycontroller=skycontroller) as w:
        await write(w.client, "ANF_HAND_LAUNCH", 1, dialect.MAV_PARAM_TYPE_INT32)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert w.drone.flying_state.name == "USERTAKEOFF"
        await w.gateway.close()
        await watched(10.0)
        assert w.drone.flying_state.name == "LANDED"


async def test_end_of_the_gateway_leaves_the_takeoff_of_a_skycontrollers_pilot() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(1)
        await w.drone.wait_log(lambda e: w.drone.flying_state.name == "MOTOR_RAMPING", 5.0)
        await watched(0.1)
        await w.gateway.close()
        await watched(10.0)
        assert w.drone.flying_state.name == "HOVERING"


# Values that no one foresaw.


async def test_an_impossible_value_of_the_drone_silences_nothing() -> None:
    async with world() as w:
        w.drone.inject(common.BatteryStateChanged(200))
        await w.client.wait("BATTERY_STATUS", lambda m: m.battery_remaining == -1)
        for _ in range(2):
            await w.client.wait("HEARTBEAT", timeout=2.0)
        w.drone.inject(ardrone3.AltitudeChanged(1e300))
        for _ in range(2):
            await w.client.wait("HEARTBEAT", timeout=2.0)
        await w.client.wait("ATTITUDE")
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED


async def test_a_relative_heading_counts_from_the_present_one() -> None:
    async with world() as w:
        await w.take_off()
        w.client.send_command(GOTO, -1, 1, 0, math.pi / 2, frame=6, x=HOME[0], y=HOME[1], z=5.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["yaw"] - math.pi / 2) < 0.05, 15.0)
        await w.client.wait("ATTITUDE", lambda m: abs(m.yaw - math.pi / 2) < 0.05)
        ack = await w.client.command(GOTO, -1, 1 | 2, 0, math.pi / 2, frame=6, x=HOME[0], y=HOME[1], z=6.0)
        assert ack.result == ACCEPTED
        assert w.commands("ardrone3.Piloting.moveTo")[-1].args["heading"] == pytest.approx(180.0, abs=5.0)


async def test_a_speed_alone_is_refused() -> None:
    async with world() as w:
        await w.take_off()
        assert (await w.client.command(GOTO, 5.0, 1, 0, NAN)).result == DENIED


async def test_interval_beyond_the_int32_range_is_answered() -> None:
    async with world() as w:
        assert (await w.client.command(mav_enums.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 1e12)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(mav_enums.MAV_CMD_GET_MESSAGE_INTERVAL, 30)).result == ACCEPTED
        assert (await w.client.wait("MESSAGE_INTERVAL", since=mark)).interval_us == 2**31 - 1


def test_the_names_above_are_px4s() -> None:
    assert PX4_OFFBOARD[1] << 16 == OFFBOARD


@pytest.mark.parametrize("stop", ["hold", "land"])
async def test_stop_does_not_wait_behind_settings_that_a_client_loads(stop: str) -> None:
    """In version 1 of Parrot's protocol each setting takes a round trip, of 0.4 s here."""
    async with world(speed=1.0, versions=(1, 1)) as w:
        await w.take_off()
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        for name in ("ANF_MAX_TILT", "ANF_YAW_RATE", "ANF_VERT_SPEED", "ANF_TILT_RATE", "ANF_MAX_ALT", "ANF_RTH_ALT"):
            for value in (30.0, 31.0):
                w.client.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("MaxTilt"), 5.0)
        began = asyncio.get_running_loop().time()
        w.client.send_command(*((SET_MODE, *PX4_HOLD) if stop == "hold" else (LAND_CMD,)))
        name = "CancelMoveTo" if stop == "hold" else "Landing"
        heard_at = (await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith(name), 10.0)).t
        assert heard_at - began < 1.0
