"""Failsafes of docs/failsafes.md that no other test flies, and the texts about dangerous settings."""

from __future__ import annotations

import asyncio
import math
import time
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.clock import everybodys
from support.fault_scenarios import ACCEPTED, ARM, REJECTED, RTL, SET_MODE, deaf, goto, heard, return_by_itself, watched
from support.mav import Client
from support.missions import said
from support.params import write
from support.setpoints import COPTER_GUIDED, VELOCITY_ONLY, local, motion, streaming
from support.world import LAND, RETURN, World, world

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import RthAutoTriggerMode
from anafi_mav.sim.autopilot import power
from anafi_mav.sim.autopilot.homing import ReturnPhase

AT_CONNECTION = {
    "common.Common.CurrentDateTime",
    "common.Common.AllStates",
    "common.Settings.AllSettings",
    "user_storage.start_monitoring",
}
"""Commands of every connection."""

STALLED = 1.5
"""s that the host stalls: more than a stall begins with."""

DANGERS = (
    "Return at low battery is off (ANF_RTH_AUTO)",
    "Return height low: 12 m < 20 m",
    "Return delay 0 s: each link loss is a return",
    "Geofence off: max. 2000 m > radio 100 m",
)


def warned(client: Client) -> list[str]:
    return [m.text for _, m in client.since(0, "STATUSTEXT") if m.text in DANGERS]


async def test_dangerous_settings_are_reported_once_and_not_written() -> None:
    async with world() as w:
        greeting = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
        w.client.send(greeting)
        await said(w, " firmware ")  # the banner's last line; it has none of them yet
        assert warned(w.client) == []
        for setting in (
            rth.AutoTriggerMode(RthAutoTriggerMode.OFF),
            rth.MinAltitude(12.0, 5.0, 100.0),
            rth.Delay(0, 0, 120),
            ardrone3.MaxDistanceChanged(2000.0, 10.0, 4000.0),
        ):
            w.drone.inject(setting)
        second = await w.connect(254)
        second.send(greeting)
        # The banner's last line comes behind them.
        await second.wait("STATUSTEXT", lambda m: " firmware " in m.text, since=0)
        assert sorted(warned(second)) == sorted(DANGERS)
        assert warned(w.client) == []
        assert {entry.name for entry in w.drone.log if entry.kind == "command"} <= AT_CONNECTION


async def afar(w: World) -> None:
    """Hover 40 m north of the take-off point, at 10 m."""
    await w.take_off(10.0)
    assert await goto(w, 40.0, 10.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 39.0, 30.0)


async def test_low_battery_return_is_announced_shown_and_flown() -> None:
    async with world(speed=8.0) as w:
        await afar(w)
        mark = w.client.mark()
        firmware = w.drone.firmware
        firmware.battery.charge = power.CRITICAL + firmware.endurance.needed(w.drone.pose, (0.0, 0.0))
        await said(w, "Drone returns home", mark)
        await said(w, "Battery low", mark)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, since=mark, timeout=20.0)
        await w.drone.wait_log(lambda e: math.hypot(w.drone.pose.north, w.drone.pose.east) < 2.0, 40.0)
        assert [entry.name for entry in w.drone.log if entry.name == "rth.return_to_home"] == []


INPUTS: dict[str, tuple[tuple[float, ...], Any]] = {
    "ardupilot": ((1, COPTER_GUIDED), local(VELOCITY_ONLY, v=(3.0, 0.0, 0.0))),
    "px4": ((1, 3, 0), dialect.MAVLink_manual_control_message(1, 400, 0, 500, 0, 0)),
}
"""By flavour: a mode that is no flight task, and what flies northwards in it."""


@pytest.mark.parametrize("skycontroller", [None, 3])
@pytest.mark.parametrize("flavour", INPUTS)
async def test_stream_flies_no_further_after_a_return_that_no_client_commanded(
    flavour: str, skycontroller: int | None
) -> None:
    """The battery, or the pilot's button, has led the drone home: a stream does not fly it off again."""
    mode, message = INPUTS[flavour]
    async with world(speed=4.0, flavour=flavour, skycontroller=skycontroller) as w:
        await w.take_off(8.0)
        assert (await w.client.command(SET_MODE, *mode)).result == ACCEPTED
        async with streaming(w.client, message):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 15.0, 30.0)
            if w.drone.skycontroller is None:
                return_by_itself(w)
            else:
                w.drone.skycontroller.press(0)
            await w.drone.wait_log(lambda e: w.drone.firmware.homing.flying, 10.0)
            await w.drone.wait_log(lambda e: w.drone.firmware.homing.phase is ReturnPhase.IDLE, 120.0)
            home = asyncio.get_running_loop().time()
            await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.idle)
            await watched(5.0)
            assert motion(w, home) == []
            assert math.hypot(w.drone.pose.north, w.drone.pose.east) < 2.0


async def test_critical_battery_lands_and_refuses_a_goto() -> None:
    async with world(speed=4.0) as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        w.drone.firmware.battery.charge = float(power.EMPTY)
        await said(w, "Drone lands", mark)
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND, since=mark, timeout=10.0)
        assert await goto(w, 40.0, 10.0) == REJECTED
        await w.drone.wait_log(lambda e: w.drone.flying_state is FlyingState.LANDED, 30.0)


async def test_gps_loss_in_flight_hovers_and_refuses_goto_and_return() -> None:
    async with world(speed=4.0) as w:
        await w.take_off(10.0)
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        mark = w.client.mark()
        w.drone.faults.gps = False
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold, since=mark, timeout=10.0)
        lost = asyncio.get_running_loop().time()
        await w.drone.wait_log(
            lambda e: e.kind == "pose" and math.hypot(e.args["vn"], e.args["ve"]) < 0.3, 10.0, since=lost
        )
        assert await goto(w, 150.0, 10.0) == REJECTED
        assert (await w.client.command(RTL)).result != ACCEPTED
        assert w.drone.flying_state is FlyingState.HOVERING


async def test_return_of_a_station_loss_that_fails_is_tried_again() -> None:
    """The drone hears nothing of the first return, hovers once it hears again, and returns ten seconds later."""
    async with world(speed=1.0) as w:
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await w.take_off(10.0)
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        mark = w.client.mark()
        await asyncio.sleep(1.5)  # no heartbeat
        deaf(w, 6.0)
        await w.client.wait("STATUSTEXT", lambda m: "return failed" in m.text, since=mark, timeout=10.0)
        assert heard(w, "return_to_home") == []
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, since=mark, timeout=30.0)
        assert heard(w, "return_to_home") == ["return_to_home"]


async def test_landing_of_a_station_loss_follows_a_return_that_ends_in_a_hover() -> None:
    """The return that a client commanded goes on; with no station left its end is no place to stay."""
    async with world(speed=1.0) as w:
        await write(w.client, "ANF_GCS_LOSS", 3, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await write(w.client, "ANF_RTL_END", 1, dialect.MAV_PARAM_TYPE_INT32)
        await w.take_off(10.0)
        assert await goto(w, 60.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 55.0, 40.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        mark = w.client.mark()
        await w.client.wait(
            "STATUSTEXT", lambda m: m.text == "No ground station for 2 s: drone is returning", since=mark
        )
        await w.drone.wait_log(lambda e: e.name == "rth.state" and e.args["reason"] == 3, 60.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 40.0)
        assert abs(w.drone.pose.north) < 2.0


async def test_return_of_a_station_loss_that_failed_yields_to_a_later_command() -> None:
    """A program flies on by a goto of its own after the return has failed."""
    async with world(speed=1.0) as w:
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await w.take_off(10.0)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        mark = w.client.mark()
        await asyncio.sleep(1.5)  # no heartbeat
        deaf(w, 6.0)
        await w.client.wait("STATUSTEXT", lambda m: "return failed" in m.text, since=mark, timeout=10.0)
        await asyncio.sleep(3.0)  # until the drone hears again and hovers
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        await asyncio.sleep(15.0)
        assert heard(w, "return_to_home") == []


async def test_drone_whose_stations_were_lost_on_the_ground_does_not_take_off() -> None:
    """No action would follow in the air: the loss has been reported."""
    prearm, beat = dialect.MAV_SYS_STATUS_PREARM_CHECK, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    async with world() as w:
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        w.client.send(beat)
        mark = w.client.mark()
        await w.client.wait("STATUSTEXT", lambda m: m.text == "No ground station for 2 s", since=mark, timeout=10.0)
        await w.client.wait("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & prearm, timeout=3.0)
        mark = w.client.mark()
        assert (await w.client.command(ARM, 1)).result == REJECTED
        text = "PreArm: no ground station (ANF_GCS_LOSS)"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)
        w.client.send(beat)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Ground station is back", since=mark)
        await w.client.wait("SYS_STATUS", lambda m: m.onboard_control_sensors_health & prearm, timeout=3.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "No ground station for 2 s", since=mark, timeout=10.0)
        await write(w.client, "ANF_GCS_LOSS", 0, dialect.MAV_PARAM_TYPE_INT32)
        await w.take_off(5.0)


async def test_take_off_that_is_reported_after_the_loss_of_the_stations_is_acted_against() -> None:
    """It was commanded before the loss, and nothing else would act in the air."""
    beat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    async with world(speed=1.0) as w:
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        w.drone.faults.late = {ardrone3.FlyingStateChanged.NAME: 1.5}
        mark = w.client.mark()
        w.client.send(beat)
        await watched(1.0)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.client.send_command(dialect.MAV_CMD_NAV_TAKEOFF, x=0.0, y=0.0, z=20.0)
        await w.drone.wait_log(lambda e: e.name == "rth.return_to_home", 10.0)
        found = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if m.text.startswith("No ground station")]
        assert found == ["No ground station for 2 s", "No ground station for 2 s: return"]


async def test_stall_of_the_host_is_no_silence_of_the_ground_station() -> None:
    async with world() as w:
        await write(w.client, "ANF_GCS_LOSS", 2, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        mark, sent = w.client.mark(), time.monotonic()
        await asyncio.sleep(0.3)
        with everybodys():
            await asyncio.sleep(0)  # the next callbacks run on the clock of everybody
            time.sleep(STALLED)  # noqa: ASYNC251
        await w.client.wait("STATUSTEXT", lambda m: "No ground station" in m.text, since=mark, timeout=10.0)
        assert time.monotonic() - sent >= 2.0 + STALLED
