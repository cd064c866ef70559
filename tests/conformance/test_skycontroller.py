"""A pilot at a Skycontroller beside MAVLink clients: who has control, judged by what the simulated drone received."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, ARM, REJECTED, RTL, SET_MODE, goto, heard, watched
from support.fault_scenarios import TAKEOFF_CMD as TAKEOFF
from support.missions import CORNERS, LAND, put, start, takeoff, way
from support.params import write
from support.plans import ACCEPTED as TAKEN
from support.plans import FENCE, square, upload
from support.setpoints import COPTER_GUIDED, VELOCITY_ONLY, local, motion, said, streaming, texts
from support.world import HOME, World, world

from anafi_mav.arsdk.messages import alarms, skyctrl
from anafi_mav.arsdk.messages.skyctrl import BatteryStatus, Source
from anafi_mav.sim import SimulatedDrone
from anafi_mav.sim.world.faults import Impairment

PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

ACTS = ("Landing", "return_to_home", "abort", "CancelMoveTo", "moveBy", "moveTo")
"""What a failsafe could command, by the last part of Parrot's names."""

RETURN_ACTION, LAND_ACTION = 2, 5
"""Values of ANF_GCS_LOSS and ANF_FENCE_ACTION."""

BAD_AIR = Impairment(loss=0.25, delay=0.2)

generations = pytest.mark.parametrize("generation", [3, 4])


def sticks(w: World, since: float) -> list[int]:
    """Pitch of each PCMD that the drone received after a moment."""
    return [entry.args["pitch"] for entry in w.commands("ardrone3.Piloting.PCMD") if entry.t > since]


async def source_is(w: World, source: Source) -> None:
    """Wait until the Skycontroller gives the sticks to one side."""
    pilot = w.drone.skycontroller
    assert pilot is not None
    if pilot.source is not source:
        await w.drone.wait_log(lambda entry: pilot.source is source, 20.0)


async def to_the_pilot(w: World) -> None:
    """Take off, until nothing of ours flies and the axes are the pilot's again."""
    await w.take_off()
    await source_is(w, Source.SKY_CONTROLLER)


async def greeted(w: World) -> None:
    """Wait for the last text that a client is greeted with."""
    w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
    await w.client.wait("STATUSTEXT", lambda m: "firmware" in m.text, since=0, timeout=10.0)


@dataclass
class Joystick:
    """MANUAL_CONTROL of a station."""

    pitch: int
    """Forward, -1000 to 1000."""

    def message(self) -> Any:
        return dialect.MAVLink_manual_control_message(1, self.pitch, 0, 500, 0, 0)


STREAMS: dict[str, tuple[tuple[float, ...], Any]] = {
    "ardupilot": ((1, COPTER_GUIDED), local(VELOCITY_ONLY, v=(3.0, 0.0, 0.0))),
    "px4": ((1, 3, 0), dialect.MAVLink_manual_control_message(1, 400, 0, 500, 0, 0)),
}
"""By flavour: a mode that is no flight task, and what flies northwards in it."""


@pytest.mark.parametrize("arms", [False, True])
@pytest.mark.parametrize("flavour", STREAMS)
async def test_stream_from_before_pilots_takeoff_does_not_fly_the_drone(flavour: str, arms: bool) -> None:
    """The pilot takes off by the button, at a height of 1 m: what a client chose on the ground was not for that."""
    mode, message = STREAMS[flavour]
    async with world(flavour=flavour, skycontroller=3) as w:
        assert w.drone.skycontroller is not None
        assert (await w.client.command(SET_MODE, *mode)).result == ACCEPTED
        async with streaming(w.client, message):
            if arms:
                assert (await w.client.command(ARM, 1)).result == ACCEPTED
            mark = w.client.mark()
            w.drone.skycontroller.press(1)
            name = "Guided" if flavour == "ardupilot" else "Position"
            ended = f"{name} ended: takeoff by another controller"
            await w.client.wait("STATUSTEXT", lambda m: m.text == ended, since=mark, timeout=10.0)
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
            await watched(4.0)
            assert motion(w, 0.0) == []
            assert abs(w.drone.pose.north) < 0.5


async def test_pilots_takeoff_after_an_ignored_takeoff_of_a_client_is_the_pilots() -> None:
    """The drone has refused the client's by silence: a withdrawn take-off that it did not react to is over."""
    mode, message = STREAMS["ardupilot"]
    async with world(speed=1.0, flavour="ardupilot", skycontroller=3) as w:
        assert w.drone.skycontroller is not None
        w.drone.faults.unreported = frozenset({alarms.TakeoffChecklist.NAME})
        w.drone.faults.refuse_take_off = frozenset({alarms.TakeoffChecklistType.VCAM})
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=5.0)
        await w.drone.wait_log(lambda e: e.name.endswith(".TakeOff"), 5.0)
        await watched(1.5)
        assert (await w.client.command(SET_MODE, *mode)).result == ACCEPTED
        await watched(1.5)
        w.drone.faults.refuse_take_off = frozenset()
        async with streaming(w.client, message):
            mark = w.client.mark()
            w.drone.skycontroller.press(1)
            await said(w.client, "Guided ended: takeoff by another controller", mark)
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
            await watched(4.0)
            assert motion(w, 0.0) == []


async def test_late_takeoff_of_a_client_is_not_taken_for_the_pilots() -> None:
    """Its acknowledgement was received, and the drone's reaction is on its way: the mode chosen meanwhile stays."""
    async with world(speed=1.0, flavour="ardupilot", skycontroller=3) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        w.drone.faults.down = Impairment(delay=0.4)
        w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=5.0)
        await w.drone.wait_log(lambda e: e.name.endswith(".TakeOff"), 5.0)
        assert (await w.client.command(SET_MODE, 1, COPTER_GUIDED)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
        await watched(1.0)
        assert not [text for text in texts(w.client, mark) if "another controller" in text]


@generations
async def test_station_loss_while_pilot_has_source_only_warns(generation: int) -> None:
    async with world(skycontroller=generation) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await write(w.client, "ANF_GCS_LOSS", RETURN_ACTION, dialect.MAV_PARAM_TYPE_INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        await to_the_pilot(w)
        w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        before, mark = heard(w, *ACTS), w.client.mark()
        pilot.stick(PITCH_STICK, 60)
        await w.client.wait("STATUSTEXT", lambda m: "No ground station" in m.text, since=mark, timeout=10.0)
        text = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "No ground" in m.text]
        assert text == ["No ground station for 2 s: pilot in control"]
        north = w.drone.pose.north
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > north + 3.0, 10.0)
        assert heard(w, *ACTS) == before


async def test_fence_while_pilot_has_source_only_warns() -> None:
    async with world(skycontroller=3) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await write(w.client, "ANF_FENCE_ACTION", LAND_ACTION, dialect.MAV_PARAM_TYPE_INT32)
        assert (await upload(w.client, square((HOME[0], HOME[1]), 20.0), FENCE)).type == TAKEN
        await to_the_pilot(w)
        before, mark = heard(w, *ACTS), w.client.mark()
        pilot.stick(PITCH_STICK, 60)
        text = await w.client.wait("STATUSTEXT", lambda m: "Fence" in m.text, since=mark, timeout=20.0)
        assert text.severity == dialect.MAV_SEVERITY_CRITICAL
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 25.0, 20.0)
        assert heard(w, *ACTS) == before


async def test_goto_right_after_pilots_stick_is_refused() -> None:
    async with world(skycontroller=3) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        assert await goto(w, 60.0, 10.0) == ACCEPTED
        await source_is(w, Source.CONTROLLER)
        pilot.stick(PITCH_STICK, 40)
        await source_is(w, Source.SKY_CONTROLLER)
        assert await goto(w, 70.0, 10.0) == REJECTED  # another place, or it counts as a retransmission


@generations
@pytest.mark.parametrize("is_orbit", [False, True])
async def test_flight_while_pilot_holds_a_stick_is_refused_with_the_reason(generation: int, is_orbit: bool) -> None:
    """The gateway learns of the stick when it has grabbed the axes."""
    what = "Orbit" if is_orbit else "Goto"
    async with world(speed=1.0, skycontroller=generation) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        pilot.stick(PITCH_STICK, 40)
        await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] == 40, 10.0)
        for north in (60.0, 70.0):  # a moment later, and while the pilot is known to have control
            mark = w.client.mark()
            if is_orbit:
                result = (await w.client.command(dialect.MAV_CMD_DO_ORBIT, north, 2.0)).result
            else:
                result = await goto(w, north, 10.0)
            assert result == REJECTED
            await said(w.client, f"{what} refused: Skycontroller pilot in control", mark)


@pytest.mark.parametrize("ends", ["stick", "link"])
async def test_orbit_that_ends_on_the_way_to_its_circle_is_reported_with_the_reason(ends: str) -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        pilot, session = w.drone.skycontroller, w.drone.session
        assert pilot is not None
        assert session is not None
        await to_the_pilot(w)
        assert (await w.client.command(dialect.MAV_CMD_DO_ORBIT, 30.0, 2.0)).result == ACCEPTED
        await source_is(w, Source.CONTROLLER)
        await w.drone.wait_log(lambda e: pilot.grabbed_axes != 0, 10.0)
        mark = w.client.mark()
        if ends == "stick":
            pilot.stick(PITCH_STICK, 40)
            await said(w.client, "Orbit ended: Skycontroller pilot in control", mark)
        else:
            session.end("closed")
            await said(w.client, "Orbit ended: link lost", mark)


@generations
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_joystick_that_is_held_does_not_take_the_drone_from_the_pilot(flavour: str, generation: int) -> None:
    """The pilot stops the drone and centres his sticks. The joystick flies again after a rest of two seconds."""
    async with world(speed=1.0, skycontroller=generation, flavour=flavour) as w:
        pilot, joystick = w.drone.skycontroller, Joystick(400)
        assert pilot is not None
        await to_the_pilot(w)
        position = (1, 3, 0) if flavour == "px4" else (1, 5)
        assert (await w.client.command(SET_MODE, *position)).result == ACCEPTED
        async with streaming(w.client, joystick.message):
            await source_is(w, Source.CONTROLLER)
            await w.drone.wait_log(lambda e: pilot.grabbed_axes != 0, 10.0)
            pilot.stick(PITCH_STICK, 60)
            await source_is(w, Source.SKY_CONTROLLER)
            pilot.stick(PITCH_STICK, 0)
            began = asyncio.get_running_loop().time()
            await watched(8.0)
            assert pilot.source is Source.SKY_CONTROLLER
            assert not any(sticks(w, began + 0.5))
            assert w.drone.pose.ground_speed < 0.3
            joystick.pitch = 0
            await watched(2.5)
            joystick.pitch = 400
            await source_is(w, Source.CONTROLLER)


async def test_return_while_pilot_has_source_sends_no_pcmd() -> None:
    """No hand of ours on the sticks: they are the pilot's, level or not."""
    async with world(skycontroller=3) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        began, dropped = w.drone.log[-1].t, pilot.dropped
        assert (await w.client.command(RTL)).result == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 3)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > began + 1.0)
        assert pilot.dropped == dropped
        assert sticks(w, began) == []


async def test_first_texts_behind_skycontroller_say_that_failsafes_only_warn() -> None:
    async with world(skycontroller=3) as w:
        await greeted(w)
        texts = [m.text for _, m in w.client.since(0, "STATUSTEXT")]
        assert texts[:2] == [
            "Skycontroller in control until a client flies",
            "Until then station loss and fence only warn",
        ]
    async with world() as w:
        await greeted(w)
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if "Skycontroller" in m.text]


@generations
@pytest.mark.parametrize("way", ["goto", "mission"])
async def test_pilots_stick_in_bad_air_takes_the_drone(generation: int, way: str) -> None:
    async with world(speed=1.0, skycontroller=generation, web=True) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        if way == "mission":
            await put(w, CORNERS)
            await start(w)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 40.0)
        else:
            await to_the_pilot(w)
            assert await goto(w, 200.0, 10.0) == ACCEPTED
        await source_is(w, Source.CONTROLLER)
        if pilot.grabbed_axes == 0:
            await w.drone.wait_log(lambda e: pilot.grabbed_axes != 0, 10.0)
        w.drone.faults.up = w.drone.faults.down = BAD_AIR
        moved = asyncio.get_running_loop().time()
        pilot.stick(PITCH_STICK, 60)
        await w.drone.wait_log(lambda e: pilot.source is Source.SKY_CONTROLLER and pilot.grabbed_axes == 0, 10.0)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Skycontroller pilot has control: stick moved", since=0)
        stopped = {"goto": "CancelMoveTo", "mission": "Pause"}[way]
        await w.drone.wait_log(lambda e: e.name.endswith(stopped) and e.t >= moved, 10.0)
        # His stick flies the drone, and nothing of ours follows.
        await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] == 60, 10.0, since=moved)
        await asyncio.sleep(5.0)
        assert pilot.source is Source.SKY_CONTROLLER
        assert pilot.grabbed_axes == 0


@pytest.mark.parametrize(("version", "seconds"), [(1, 5.0), (3, 3.5)])
async def test_pilot_gets_the_sticks_of_a_skycontroller_that_is_not_heard(version: int, seconds: float) -> None:
    """It hears the gateway, so that it would keep the axes grabbed until it misses the gateway's answers.

    In version 1 of the protocol each command has a frame of its own.
    """
    quirks = ("handshake-refused-8s",)
    async with world(speed=1.0, skycontroller=3, quirks=quirks, versions=(1, version)) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        if pilot.grabbed_axes == 0:
            await w.drone.wait_log(lambda e: pilot.grabbed_axes != 0, 10.0)
        w.drone.faults.down = Impairment(loss=1.0)
        began = asyncio.get_running_loop().time()
        await w.drone.wait_log(lambda e: pilot.source is Source.SKY_CONTROLLER and pilot.grabbed_axes == 0, 10.0)
        assert asyncio.get_running_loop().time() - began < seconds
        assert not any(e.kind == "session" and e.name == "lost" for e in w.drone.log)
        pilot.stick(PITCH_STICK, -60)
        north = w.drone.pose.north
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] < north - 1.0, 10.0)


async def test_goto_is_stopped_after_a_skycontroller_has_closed_the_connection() -> None:
    """The drone does not notice it: it flew the goto on, in mode Hold."""
    async with world(speed=1.0, skycontroller=3) as w:
        await to_the_pilot(w)
        assert await goto(w, 300.0, 10.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
        session, mark, began = w.drone.session, w.client.mark(), asyncio.get_running_loop().time()
        assert session is not None
        session.end("closed")
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.hold, since=mark, timeout=15.0)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 5.0, since=began)
        assert w.drone.pose.north < 100.0


@generations
async def test_sticks_that_are_grabbed_before_the_gateway_connects_fly_again(generation: int) -> None:
    """A Skycontroller may keep the grab of a gateway that was killed: its pilot had no sticks until the next flight."""

    def keep_grab(drone: SimulatedDrone) -> None:
        assert drone.skycontroller is not None
        drone.skycontroller.grabbed_axes = 0b1111

    async with world(speed=1.0, skycontroller=generation, before=keep_grab) as w:
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(1)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 20.0)
        w.drone.skycontroller.stick(PITCH_STICK, 60)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 10.0)


@generations
async def test_goto_of_a_killed_gateway_flies_on_until_the_pilots_button(generation: int) -> None:
    """The drone would miss the Skycontroller alone, which gives its pilot the sticks once it misses the gateway."""
    async with world(speed=1.0, skycontroller=generation) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        assert await goto(w, 300.0, 10.0) == ACCEPTED
        await source_is(w, Source.CONTROLLER)
        w.drone.faults.mute = True  # what the gateway sends at its end is not received
        await w.gateway.close()
        await w.drone.wait_log(lambda e: pilot.source is Source.SKY_CONTROLLER and pilot.grabbed_axes == 0, 15.0)
        assert w.drone.pose.vn > 3.0
        pilot.press(1)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


@generations
@pytest.mark.parametrize("button", [0, 1], ids=["return home", "land"])
async def test_mission_of_a_killed_gateway_flies_on_until_the_pilots_button(generation: int, button: int) -> None:
    """Its setting to return home at a lost link is on: that link is the one to the Skycontroller."""
    async with world(speed=1.0, skycontroller=generation, web=True) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await put(w, [takeoff(12.0), way(300.0, 0.0, 12.0), LAND])
        await start(w)
        await w.client.wait("STATUSTEXT", lambda m: "link loss: return home" in m.text, since=0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 5.0, 30.0)
        w.drone.faults.mute = True
        await w.gateway.close()
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 100.0, 60.0)
        assert w.drone.pose.vn > 3.0
        pilot.press(button)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.1, 20.0)
        assert w.drone.pose.north < 150.0


async def test_pilot_who_flies_as_the_connection_is_closed_is_left_alone() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        pilot, session = w.drone.skycontroller, w.drone.session
        assert pilot is not None
        assert session is not None
        await to_the_pilot(w)
        pilot.stick(PITCH_STICK, 60)
        before, mark = heard(w, *ACTS), w.client.mark()
        session.end("closed")
        await w.client.heartbeat(lambda beat: True, since=mark, timeout=15.0)
        north = w.drone.pose.north
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > north + 3.0, 10.0)
        assert heard(w, *ACTS) == before


@generations
async def test_silence_while_pilot_flies_sends_nothing_against_him(generation: int) -> None:
    async with world(speed=1.0, skycontroller=generation) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        pilot.stick(PITCH_STICK, 60)
        before = heard(w, *ACTS)
        w.drone.faults.mute = True
        await asyncio.sleep(3.2)
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        await asyncio.sleep(2.0)
        assert heard(w, *ACTS) == before


async def test_end_of_gateway_while_pilot_flies_sends_nothing_against_him() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await to_the_pilot(w)
        pilot.stick(PITCH_STICK, 60)
        # After a silence a move of before could be under way, as far as the gateway knows.
        w.drone.faults.mute = True
        await asyncio.sleep(3.2)
        w.drone.faults.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        before = heard(w, *ACTS)
        north = w.drone.pose.north
        await w.gateway.close()
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > north + 3.0, 20.0)
        assert heard(w, *ACTS) == before


async def test_low_battery_and_end_of_a_skycontroller_are_reported() -> None:
    async with world(skycontroller=3) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        assert pilot.send is not None
        pilot.send(skyctrl.BatteryChanged(14))
        low, critical = BatteryStatus.DISCHARGING_LOW, BatteryStatus.DISCHARGING_CRITICAL
        for status, severity, word in (
            (low, dialect.MAV_SEVERITY_WARNING, "low"),
            (critical, dialect.MAV_SEVERITY_CRITICAL, "critical"),
        ):
            mark = w.client.mark()
            pilot.send(skyctrl.BatteryState(status))
            text = f"Skycontroller battery {word} (14 %)"
            message = await w.client.wait("STATUSTEXT", lambda m, text=text: m.text == text, since=mark)
            assert message.severity == severity
        mark = w.client.mark()
        pilot.send(skyctrl.Shutdown(skyctrl.ShutdownReason.LOW_BATTERY))
        text = "Skycontroller switches off: low battery"
        await w.client.wait("STATUSTEXT", lambda m: m.text == text, since=mark)
