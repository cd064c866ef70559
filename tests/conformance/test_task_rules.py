"""What a flight task may replace, end and wait for: one table per rule, judged by what the simulated drone received.

The tables are written by hand and do not read `TaskRules`: removing a rule from a task makes its row fail.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    ARM,
    CANCELLED,
    GOTO,
    IN_PROGRESS,
    LAND_CMD,
    REJECTED,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    goto,
    home_being_undone,
    return_by_itself,
    until,
    watched,
)
from support.mav import NAN, Client
from support.missions import put, way
from support.params import write
from support.setpoints import POSITION_ONLY, VELOCITY_ONLY, attitude, earth, heard, local, said, streaming
from support.world import HOME, World, world

from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.sim.world.faults import Impairment

PAUSE, YAW, ORBIT = dialect.MAV_CMD_DO_PAUSE_CONTINUE, dialect.MAV_CMD_CONDITION_YAW, dialect.MAV_CMD_DO_ORBIT
ALTITUDE = dialect.MAV_CMD_DO_CHANGE_ALTITUDE
INT32 = dialect.MAV_PARAM_TYPE_INT32
FORCE = 21196
PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""
UP = 8.0

MODES = {
    "px4": {"hold": (1, 4, 3), "position": (1, 3, 0), "offboard": (1, 6, 0), "mission": (1, 4, 4)},
    "ardupilot": {"brake": (1, 17), "loiter": (1, 5), "guided": (1, 4), "mission": (1, 3)},
}

Send = Callable[[World, Client], Awaitable[Any]]


def now() -> float:
    return asyncio.get_running_loop().time()


def mode(name: str) -> Send:
    """Return the request of a mode of the flavour."""
    return lambda w, client: client.command(SET_MODE, *MODES[w.flavour][name], timeout=12.0)


def command(id: int, *params: float, **place: float) -> Send:
    """Return the request of a command."""
    return lambda w, client: client.command(id, *params, timeout=12.0, **place)


async def fly_offboard(w: World, client: Client) -> Any:
    """Stream velocities and choose mode Offboard."""
    async with streaming(client, local(VELOCITY_ONLY, v=(0.0, 1.0, 0.0))):
        return await mode("offboard")(w, client)


REPOSITION = {"frame": 6, "x": HOME[0], "y": HOME[1] + 0.0001, "z": UP}

# What ends a landing or a return.

ENDS: dict[str, tuple[str, Send, str, str]] = {
    "Hold": ("px4", mode("hold"), "client drone", "client drone"),
    "Position": ("px4", mode("position"), "client drone", "client drone"),
    "Pause": ("px4", command(PAUSE, 0), "client drone", "client drone"),
    "Pause by reposition": ("px4", command(GOTO, -1, 0, 0, NAN), "client drone", "client drone"),
    "Brake": ("ardupilot", mode("brake"), "client drone", "client drone"),
    "Loiter": ("ardupilot", mode("loiter"), "client drone", "client drone"),
    "Pause in ArduPilot": ("ardupilot", command(PAUSE, 0), "client drone", "client drone"),
    "Takeoff": ("px4", command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0), "client drone", ""),
    "Return": ("px4", command(RTL), "client", ""),
    "Guided": ("ardupilot", mode("guided"), "client", "client"),
    "Offboard": ("px4", fly_offboard, "client", "client"),
    "Mission": ("px4", mode("mission"), "client", "client"),
    "Goto": ("px4", command(GOTO, -1, 1, 0, NAN, **REPOSITION), "", ""),
    "Altitude": ("px4", command(ALTITUDE, 5.0, 3.0), "", ""),
    "Yaw": ("px4", command(YAW, 90.0, 0.0, 0.0, 0.0), "", ""),
    "Orbit": ("px4", command(ORBIT, 10.0, 2.0, 0.0, 0.0), "", ""),
}
"""Flavour, request, and whose landings and whose returns it ends: those that a client commanded, the drone's own."""


@pytest.mark.parametrize("by", ["client", "drone"])
@pytest.mark.parametrize("name", ENDS)
async def test_landing_is_ended_by_the_tasks_that_may_end_it(name: str, by: str) -> None:
    flavour, send, ended_by, _ = ENDS[name]
    async with world(speed=1.0, flavour=flavour, web=True) as w:
        await put(w, [way(12.0, 0.0, UP)])
        await w.take_off(10.0)
        if by == "client":
            assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        else:
            another_controller(w, ardrone3.Landing())
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)
        ack = await send(w, w.client)
        ends = by in ended_by.split()
        assert (ack.result == ACCEPTED) is ends, ack
        await watched(1.0)
        assert (w.drone.firmware.state is not ardrone3.FlyingState.LANDING) is ends
        assert bool([e for e in heard(w, "PCMD") if e.args["gaz"] > 0] or len(heard(w, "TakeOff")) > 1) is ends


@pytest.mark.parametrize("by", ["client", "drone"])
@pytest.mark.parametrize("name", [name for name in ENDS if name != "Return"])
async def test_return_is_ended_by_the_tasks_that_may_end_it(name: str, by: str) -> None:
    flavour, send, _, ended_by = ENDS[name]
    async with world(speed=1.0, flavour=flavour, web=True) as w:
        await put(w, [way(12.0, 0.0, UP)])
        await w.take_off(UP)
        speed, w.simulator.speed = w.simulator.speed, 8.0
        assert await goto(w, 40.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 39.0, 30.0)
        w.simulator.speed = speed
        if by == "client":
            assert (await w.client.command(RTL)).result == ACCEPTED
        else:
            return_by_itself(w)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.returning)
        ack = await send(w, w.client)
        ends = by in ended_by.split()
        assert (ack.result == ACCEPTED) is ends, ack
        assert bool(heard(w, "abort")) is ends
        assert w.drone.firmware.homing.active is not ends


# A landing that begins while a stop is under way.


@pytest.mark.parametrize("moment", ["while what flew ends", "while the drone stops"])
async def test_landing_that_begins_during_a_stop_is_not_ended_without_the_right(moment: str) -> None:
    """Guided may not end a landing that the drone began, also when it was chosen before the landing."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await w.take_off(UP)
        assert await goto(w, 60.0, UP) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 2.0, 20.0)
        mark, began = w.client.mark(), now()
        if moment == "while what flew ends":
            await home_being_undone(w)
        else:
            w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        w.client.send_command(SET_MODE, *MODES["ardupilot"]["guided"])
        await watched(0.2)
        another_controller(w, ardrone3.Landing())
        assert await until(w.client, mark, 1) == [(SET_MODE, REJECTED)]
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
        assert [e for e in heard(w, "PCMD", since=began) if e.args["gaz"] > 0] == []


async def test_return_does_not_end_a_landing_that_begins_before_it_is_flown() -> None:
    """It waits for the end of what flew; meanwhile another controller lands the drone."""
    async with world(speed=1.0) as w:
        await w.take_off(UP)
        await home_being_undone(w)
        mark, began = w.client.mark(), now()
        w.client.send_command(RTL)
        await watched(0.2)
        another_controller(w, ardrone3.Landing())
        assert (RTL, REJECTED) in await until(w.client, mark, 2)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
        assert [e for e in heard(w, "PCMD", since=began) if e.args["gaz"] > 0] == []
        assert heard(w, "return_to_home") == []


# What waits for the end of what it replaces, and for how long.


WAITS: dict[str, tuple[str, tuple[int, ...], str, float, float]] = {
    "Motor cut": ("px4", (ARM, 0, FORCE), "Emergency", 0.0, 0.1),
    "Termination": ("px4", (dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1), "Emergency", 0.0, 0.1),
    "Land": ("px4", (LAND_CMD,), "Landing", 0.4, 0.6),
    "Land in ArduPilot": ("ardupilot", (SET_MODE, 1, 9), "Landing", 0.4, 0.6),
    "Hold": ("px4", (SET_MODE, 1, 4, 3), "CancelMoveTo", 0.4, 0.6),
    "Position": ("px4", (SET_MODE, 1, 3, 0), "CancelMoveTo", 0.4, 0.6),
    "Pause": ("px4", (PAUSE, 0), "CancelMoveTo", 0.4, 0.6),
    "Guided": ("ardupilot", (SET_MODE, 1, 4), "CancelMoveTo", 0.4, 0.6),
    "Return": ("px4", (RTL,), "return_to_home", 1.0, 6.0),
    "Heading of a goto": ("px4", (YAW, 90, 0, 0, 0), "moveTo", 1.0, 6.0),
}
"""Flavour, request, the command that the drone receives of it, and s of the wait: at least, at most."""


@pytest.mark.parametrize("name", WAITS)
async def test_stopping_task_waits_briefly_and_a_motor_cut_not_at_all(name: str) -> None:
    flavour, request, sent, least, most = WAITS[name]
    async with world(speed=1.0, flavour=flavour, allow_kill=True) as w:
        await w.take_off(UP)
        assert await goto(w, 90.0, UP) == ACCEPTED
        await home_being_undone(w)
        began = now()
        w.client.send_command(*request)
        await w.drone.wait_log(lambda e: e.t >= began and e.name.endswith(sent) and e.kind == "command", 20.0)
        assert least <= now() - began <= most


# What follows a take-off instead of ending it.


async def guided_item(w: World, client: Client) -> None:
    """A mission item that is a goto, as Mission Planner and MAVProxy send it."""
    item = (2, 0, 0, 0, 0, NAN, round((HOME[0] + 0.0002) * 1e7), round(HOME[1] * 1e7), UP)
    client.send(dialect.MAVLink_mission_item_int_message(1, 1, 0, 6, dialect.MAV_CMD_NAV_WAYPOINT, *item, 0))


async def send_goto(w: World, client: Client) -> None:
    client.send_command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] + 0.0002, y=HOME[1], z=UP)


AFTER_TAKEOFF: dict[str, tuple[str, Send, bool]] = {
    "Goto": ("px4", send_goto, True),
    "Goto in ArduPilot": ("ardupilot", send_goto, True),
    "Guided item": ("ardupilot", guided_item, True),
    "Offboard": ("px4", mode("offboard"), True),
    "Guided setpoints": ("ardupilot", lambda w, client: watched(0.0), True),
    "Hold": ("px4", mode("hold"), False),
    "Pause": ("px4", command(PAUSE, 0), False),
    "Land": ("px4", command(LAND_CMD), False),
    "Return": ("px4", command(RTL), False),
}
"""Flavour, request while the drone rises, and whether it waits for the end of the take-off."""


@pytest.mark.parametrize("moment", ["rises", "climbs"])
@pytest.mark.parametrize("name", AFTER_TAKEOFF)
async def test_task_follows_a_takeoff_or_ends_it(name: str, moment: str) -> None:
    flavour, send, follows = AFTER_TAKEOFF[name]
    async with world(speed=1.0, flavour=flavour) as w:
        if flavour == "ardupilot":
            assert (await w.client.command(SET_MODE, 1, 4)).result == ACCEPTED
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)).result == ACCEPTED
        if moment == "climbs":
            await w.drone.wait_log(lambda e: e.name.endswith(".moveBy"), 20.0)
        is_stream = "Offboard" in name or "setpoints" in name
        message = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0)) if is_stream else attitude(thrust=0.5)
        async with streaming(w.client, message) if is_stream else contextlib.nullcontext():
            await send(w, w.client)
            if follows:
                await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 4.0, 40.0)
            else:
                await watched(6.0)
        climbed = [e for e in w.drone.log if e.name.endswith("moveByEnd") and e.args["dZ"] < -5.0]
        moved = [e for e in heard(w, "moveTo", "PCMD") if e.name.endswith("moveTo") or e.args["pitch"] > 0]
        assert bool(climbed) is follows
        if follows:
            assert climbed[0].t < moved[0].t
            assert w.drone.pose.up == pytest.approx(UP, abs=0.7)


async def test_disarm_waits_briefly_for_what_it_replaces() -> None:
    """The drone stands and receives nothing: the acknowledgement is what waits."""
    async with world(speed=1.0) as w:
        await home_being_undone(w)
        began = now()
        assert (await w.client.command(ARM, 0)).result == ACCEPTED
        assert 0.4 <= now() - began <= 0.6


async def test_newest_task_that_waits_for_a_takeoff_is_flown_alone() -> None:
    """A goto waits, then Offboard is chosen: the goto is answered with CANCELLED, and not flown."""
    async with world(speed=1.0, clients=2) as w:
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=UP)).result == ACCEPTED
        mark = w.client.mark()
        await send_goto(w, w.client)
        await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO and m.result == IN_PROGRESS, since=mark)
        async with streaming(w.clients[1], local(VELOCITY_ONLY, v=(0.0, 2.0, 0.0))):
            await mode("offboard")(w, w.clients[1])
            await w.client.wait("COMMAND_ACK", lambda m: m.command == GOTO and m.result == CANCELLED, since=mark)
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["east"] > 4.0, 40.0)
        assert heard(w, "moveTo") == []


# What leaves a pause.

NORTH = local(VELOCITY_ONLY, v=(2.0, 0.0, 0.0))

STREAMS: dict[str, Any] = {
    "velocity": NORTH,
    "local position": local(POSITION_ONLY, at=(300.0, 0.0, -UP)),
    "global position": earth(POSITION_ONLY, 6, 300.0, 0.0, UP),
    "attitude": attitude(-0.1),
}
LEAVES: dict[str, Send] = {
    "continue": command(PAUSE, 1),
    "another mode": lambda w, client: _modes(client, 5, 4),
    "goto": command(GOTO, -1, 1, 0, NAN, frame=6, x=HOME[0] + 0.001, y=HOME[1], z=UP),
    "yaw": command(YAW, 90.0, 0.0, 0.0, 0.0),
    "return": lambda w, client: _return_and_guided(client),
}


async def _modes(client: Client, *numbers: int) -> None:
    for number in numbers:
        assert (await client.command(SET_MODE, 1, number)).result == ACCEPTED


async def _return_and_guided(client: Client) -> None:
    assert (await client.command(RTL)).result == ACCEPTED
    await _modes(client, 4)


async def paused(w: World) -> None:
    """Fly north by velocities in Guided, pause, and wait until the drone stands."""
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 15.0)
    assert (await w.client.command(PAUSE, 0)).result == ACCEPTED
    await w.drone.wait_log(lambda e: w.drone.pose.ground_speed < 0.2, 15.0)


@pytest.mark.parametrize("name", STREAMS)
async def test_stream_does_not_leave_a_pause(name: str) -> None:
    """Neither the paused program's nor another client's."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(UP)
        async with streaming(w.client, NORTH):
            await paused(w)
        began, mark = now(), w.clients[1].mark()
        where = w.drone.pose.north
        for client in w.clients:
            async with streaming(client, STREAMS[name]):
                await watched(2.0)
        assert abs(w.drone.pose.north - where) < 0.7
        assert [e.name for e in heard(w, "moveTo", "moveBy", since=began)] == []
        assert {e.args["pitch"] for e in heard(w, "PCMD", since=began)} <= {0}
        await said(w.clients[1], "paused by a client", mark)


async def test_setpoint_of_the_same_iteration_does_not_replace_a_pause() -> None:
    """It is newer than the pause, which has not begun to act."""
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(UP)
        mark, began, pack = w.client.mark(), now(), w.client.pack
        pause = dialect.MAVLink_command_long_message(1, 1, PAUSE, 0, 0, *([NAN] * 6))
        w.client.send_raw(pack(pause) + pack(NORTH))
        assert await until(w.client, mark, 1) == [(PAUSE, ACCEPTED)]
        async with streaming(w.clients[1], NORTH):
            await watched(2.0)
        assert {e.args["pitch"] for e in heard(w, "PCMD", since=began)} <= {0}


@pytest.mark.parametrize("name", LEAVES)
async def test_command_of_a_client_leaves_a_pause(name: str) -> None:
    async with world(speed=1.0, flavour="ardupilot", clients=2) as w:
        await w.take_off(UP)
        async with streaming(w.client, NORTH):
            await paused(w)
            await LEAVES[name](w, w.clients[1])
            await w.drone.wait_log(lambda e: w.drone.pose.vn > 1.0, 30.0)


# What the gateway leaves to the Skycontroller's pilot.

ACTIONS = {1: "PCMD", 2: "return_to_home", 3: "Landing"}
"""Values of ANF_GCS_LOSS, and the command that the drone receives of each."""


async def station_lost(w: World, seconds: float = 2.0) -> None:
    """Let the gateway hear a station, and then none."""
    w.client.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
    await watched(seconds)


@pytest.mark.parametrize("pilot", [False, True], ids=["program flies", "pilot has the source"])
@pytest.mark.parametrize("action", ACTIONS)
async def test_station_loss_acts_unless_the_pilot_has_the_source(action: int, pilot: bool) -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await write(w.client, "ANF_GCS_LOSS", action, INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await w.take_off(UP)
        assert w.drone.skycontroller is not None
        if pilot:
            await w.drone.wait_log(lambda e: w.drone.skycontroller.source is Source.SKY_CONTROLLER, 10.0)  # type: ignore[union-attr]
        else:
            assert await goto(w, 90.0, UP) == ACCEPTED
        began = now()
        await station_lost(w, 4.0)
        names = ("PCMD", "CancelMoveTo", "return_to_home", "Landing")
        assert bool(heard(w, *names, since=began)) is not pilot
        if not pilot:
            assert heard(w, ACTIONS[action], since=began)


async def test_pilot_who_takes_the_source_during_the_wait_is_left_alone() -> None:
    """The loss of stations lands, and waits for what flew: then the pilot moves a stick."""
    async with world(speed=1.0, skycontroller=3) as w:
        await write(w.client, "ANF_GCS_LOSS", 3, INT32)
        await write(w.client, "ANF_GCS_LOSS_T", 2.0)
        await w.take_off(UP)
        assert await goto(w, 90.0, UP) == ACCEPTED
        mark = w.client.mark()
        await station_lost(w, 1.5)
        await home_being_undone(w)
        await w.client.wait("STATUSTEXT", lambda m: "No ground station" in m.text, since=mark)
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.stick(PITCH_STICK, 60)
        await watched(3.0)
        assert heard(w, "Landing") == []
        assert w.drone.pose.up == pytest.approx(UP, abs=0.7)
        assert w.drone.pose.vn > 1.0
